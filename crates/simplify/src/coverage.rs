//! Features processed together: shared borders are simplified once, and nothing crosses, collapses or changes
//! sides; or a number of vertices or bytes is the goal.

mod gaps;
mod input;
mod kept_bits;
mod own_ring;
mod rebuild;
mod separate;
mod snapping;
mod spool;
mod target_search;
mod tile;
mod tiled_coverage;
mod trial;

pub use tiled_coverage::positions;

use std::time::Instant;

use super::feature::PartCounts;
use super::files::LineFiles;
use super::hierarchy_file::{self, HierarchyFile, HierarchyUse};
use super::job::LineJob;
use super::report::LineReport;
use super::tool::SimplifyRule;
use super::trees::FeatureHierarchies;
use input::{CoverageInput, ReadFile, memory_for_tiles};
use rayon::prelude::*;
use terrane_base::error::{Error, Result};
use terrane_engine::memory::{PROGRAM, short};
use terrane_engine::{Cancel, Progress};
use terrane_files::on_threads;
use terrane_vector::Feature;
use trial::OpenedLineJob;

pub(super) fn run(
    job: &LineJob,
    files: &LineFiles,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineReport> {
    let mut report = LineReport { crs: files.crs.label(), ..LineReport::default() };
    let whole = OpenedLineJob { job, files, progress, cancel };
    let plain = files.rule(job, 0.0)?;
    let mut store = HierarchyFile::of(job, &plain)?;
    let mut input = CoverageInput::read(job, files, whole.share(), &mut store, progress, cancel)?;
    store.end()?;
    if job.topology.is_none() && input.memory_use().is_none() {
        return Err(whole.too_little(&input));
    }
    match job.goal.target(input.vertices) {
        Some((max, unit)) => {
            on_threads(job.resources.threads, || {
                split(files, &mut input.all, &plain, &mut store, &mut report, cancel)
            })?;
            target_search::run(&whole, &mut input, max, unit, &mut report)?;
        }
        None => {
            whole.make(&mut input, &plain, None, &mut report)?;
            report.measured_by(&plain);
        }
    }
    report.stored(job, store)?;
    Ok(report)
}

/// Largest share of memory for held features: with topology, beside the data of tiles; without, beside a result
/// of the same size.
const WITH_NEIGHBOURS: u64 = 2;
const ALONE: u64 = 4;

impl OpenedLineJob<'_> {
    /// Bytes available for held features.
    fn share(&self) -> u64 {
        match self.job.topology {
            Some(_) => memory_for_tiles(self.job) / WITH_NEIGHBOURS,
            None => memory_for_tiles(self.job) / ALONE,
        }
    }

    fn too_little(&self, input: &CoverageInput<'_>) -> Error {
        let enough = input.bytes * ALONE + PROGRAM;
        let mib = enough.div_ceil(1 << 20);
        let message = format!("the search for the threshold requires {mib} MiB of memory");
        let error = short(message, enough).or("pass ‹tolerance›, or split the input");
        error.in_file(&self.files.pairs[0].input)
    }
}

/// Builds the requested hierarchies of all features, and stores new ones.
fn split(
    files: &LineFiles,
    all: &mut [ReadFile],
    rule: &SimplifyRule,
    store: &mut HierarchyFile,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<()> {
    if !store.is_some() {
        return Ok(());
    }
    for (pair, collected) in files.pairs.iter().zip(all) {
        let orders = std::mem::take(&mut collected.orders);
        let features = orders.into_par_iter().zip(&collected.features);
        let timed = features.map(|((order, location), feature)| {
            cancel.check()?;
            timed_trees(order, feature, rule).map_err(|e| e.at(location))
        });
        let timed: Result<Vec<(FeatureHierarchies, f64)>> = timed.collect();
        for (trees, prepare_seconds) in timed.map_err(|e| e.in_file(&pair.input))? {
            report.add(&PartCounts { prepare_seconds, ..PartCounts::default() });
            collected.trees.push(trees);
        }
        if store.makes() {
            for (trees, feature) in collected.trees.iter().zip(&collected.features) {
                store.push(&trees.record(&feature.geometry, rule.measure))?;
            }
        }
    }
    Ok(())
}

/// The hierarchies of a feature, and the seconds to get them.
fn timed_trees(
    order: HierarchyUse,
    feature: &Feature,
    rule: &SimplifyRule,
) -> Result<(FeatureHierarchies, f64)> {
    let started = Instant::now();
    let trees = hierarchy_file::trees(order, &feature.geometry, rule)?;
    Ok((trees.unwrap_or_default(), started.elapsed().as_secs_f64()))
}
