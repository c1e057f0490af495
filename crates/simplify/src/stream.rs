//! Features one by one in file order: a batch is simplified on all threads while the next is read.

use std::time::Instant;

use rayon::prelude::*;

use super::feature::{self, PartCounts};
use super::files::{self, LineFilePair, LineFiles};
use super::hierarchy_file::{self, HierarchyFile, HierarchyUse};
use super::job::LineJob;
use super::report::LineReport;
use super::tool::SimplifyRule;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::memory::{PROGRAM, beside_program, short};
use terrane_engine::{Cancel, Progress};
use terrane_files::on_threads;
use terrane_vector::{Feature, FeatureSink, FeatureSource};

/// Smallest number of vertices of a batch, unless memory is short.
const BATCH: u64 = 1 << 20;
/// Memory in bytes per vertex of a batch, including its result.
const VERTEX: u64 = 160;
/// Memory in bytes per vertex of a feature larger than a batch, with any method, including the next batch.
const FEATURE_VERTEX: u64 = 104;
/// Additional bytes per vertex with a hierarchy.
const SPLIT: u64 = 60;
/// Largest number of features of a batch.
const MAX_FEATURES: usize = 1 << 16;

pub(super) fn run(
    job: &LineJob,
    files: &LineFiles,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineReport> {
    let rule = files.rule(job, 0.0)?;
    let mut report = LineReport { crs: files.crs.label(), ..LineReport::default() };
    report.measured_by(&rule);
    let mut store = HierarchyFile::of(job, &rule)?;
    let bytes: u64 = files.pairs.iter().map(LineFilePair::size).sum();
    progress.begin("simplify", bytes);
    for (number, pair) in files.pairs.iter().enumerate() {
        let is_last = number + 1 == files.pairs.len();
        on_threads(job.resources.threads, || {
            let copied = copy(job, pair, &rule, &mut store, &mut report, cancel);
            let (source, sink) = copied.map_err(|e| in_input(e, pair))?;
            // Before the output is renamed to its final name.
            if is_last {
                store.end()?;
            }
            let foreign = source.layer().foreign.clone();
            files::note(&mut report, sink.finish(&foreign)?, source.notes());
            Ok(())
        })?;
        progress.advance(pair.size());
    }
    report.stored(job, store)?;
    progress.end();
    Ok(report)
}

/// Adds the input file to an error of a large feature.
fn in_input(error: Error, pair: &LineFilePair) -> Error {
    if error.kind() == ErrorKind::Resource { error.in_file(&pair.input) } else { error }
}

/// A file at its end, and its incomplete output.
type Copied = (Box<dyn FeatureSource>, Box<dyn FeatureSink>);

/// One file.
fn copy(
    job: &LineJob,
    pair: &LineFilePair,
    rule: &SimplifyRule,
    store: &mut HierarchyFile,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<Copied> {
    let mut source = pair.open(job)?;
    let mut sink = pair.create(job, source.layer())?;
    let vertex = if store.is_some() { VERTEX + SPLIT } else { VERTEX };
    let memory = job.resources.memory;
    let max_vertices = BATCH.min(beside_program(memory) / vertex / 4).max(1);
    let mut batch = read(&mut *source, store, max_vertices, memory)?;
    while !batch.is_empty() {
        cancel.check()?;
        let (results, next) = rayon::join(
            || simplify(batch, rule),
            || read(&mut *source, store, max_vertices, memory),
        );
        for result in results {
            let simplified = result.map_err(|e| e.in_file(&pair.input))?;
            report.add(&simplified.tally);
            sink.write(&simplified.feature)?;
            simplified.record.map_or(Ok(()), |record| store.push(&record))?;
        }
        batch = next?;
    }
    Ok((source, sink))
}

/// A feature that waits for its simplification.
struct BatchFeature {
    feature: Feature,
    /// Its location in the file, for errors.
    location: String,
    order: HierarchyUse,
}

/// The next features, of about this many vertices; each has to fit in memory.
fn read(
    source: &mut dyn FeatureSource,
    store: &mut HierarchyFile,
    max_vertices: u64,
    memory: u64,
) -> Result<Vec<BatchFeature>> {
    let (mut batch, mut vertices) = (Vec::new(), 0);
    while vertices < max_vertices && batch.len() < MAX_FEATURES {
        let Some(feature) = source.next()? else { break };
        let count = feature.geometry.vertices() as u64;
        let needed = PROGRAM + count * FEATURE_VERTEX;
        if count > max_vertices && needed > memory {
            let message = format!("a feature of {count} vertices does not fit in memory");
            return Err(short(message, needed).at(source.location()));
        }
        vertices += count;
        let order = store.next(&feature.geometry)?;
        batch.push(BatchFeature { feature, location: source.location(), order });
    }
    Ok(batch)
}

/// A simplified feature.
struct SimplifiedFeature {
    feature: Feature,
    tally: PartCounts,
    /// Its hierarchies, if they are stored.
    record: Option<Vec<u8>>,
}

fn simplify(batch: Vec<BatchFeature>, rule: &SimplifyRule) -> Vec<Result<SimplifiedFeature>> {
    let batch = batch.into_par_iter();
    batch
        .map(|BatchFeature { feature, location, order }| {
            make(feature, order, rule).map_err(|e| e.at(location))
        })
        .collect()
}

fn make(feature: Feature, order: HierarchyUse, rule: &SimplifyRule) -> Result<SimplifiedFeature> {
    let started = Instant::now();
    let is_new = matches!(order, HierarchyUse::Make);
    let trees = hierarchy_file::trees(order, &feature.geometry, rule)?;
    let new = trees.as_ref().filter(|_| is_new);
    let record = new.map(|trees| trees.record(&feature.geometry, rule.measure));
    let prepare_seconds = trees.as_ref().map_or(0.0, |_| started.elapsed().as_secs_f64());
    let (geometry, tally) = feature::simplify(&feature.geometry, trees.as_ref(), rule)?;
    let feature = Feature { geometry, ..feature };
    Ok(SimplifiedFeature { feature, tally: PartCounts { prepare_seconds, ..tally }, record })
}
