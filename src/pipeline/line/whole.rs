//! All features together: shared borders are simplified once, and nothing crosses, collapses or
//! changes sides; or a number of vertices or bytes is to be met.

mod cover;
mod search;

pub(in crate::pipeline) use cover::positions;

use super::files::{self, Files, Pair};
use super::goal::Goal;
use super::part::{self, Tally};
use super::tool::Rule;
use super::{LineJob, LineReport, on_threads};
use crate::error::{Error, ErrorKind, Result};
use crate::pipeline::{Cancel, Progress};
use crate::vector::{Feature, Layer, OpenOptions};
use rayon::prelude::*;

/// The features of a file.
pub(super) struct Collected {
    pub(super) layer: Layer,
    pub(super) features: Vec<Feature>,
    notes: Vec<String>,
}

/// Bytes for each vertex that is held: itself, its arc, what is kept of it, what is written.
const VERTEX: u64 = 112;
/// Bytes for each feature beside its vertices, about.
const FEATURE: u64 = 400;

pub(super) fn run(
    job: &LineJob,
    files: &Files,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineReport> {
    progress.begin("read", files.pairs.len() as u64);
    let mut held = 0;
    let read = |pair: &Pair| {
        let collected = collect(job, pair, &mut held, cancel);
        progress.advance(1);
        collected
    };
    let mut all: Vec<Collected> = files.pairs.iter().map(read).collect::<Result<_>>()?;
    progress.end();
    let mut report = LineReport { crs: files.crs.label(), ..LineReport::default() };
    on_threads(job.resources.threads, || {
        let rule = match job.goal {
            Goal::Tolerance(_) | Goal::Area(_) => files.rule(job, 0.0)?,
            _ => search::rule(job, files, &all, progress, cancel)?,
        };
        report.measured_by(&rule);
        progress.begin("simplify", 1);
        simplify(job, &mut all, &rule, &mut report, cancel)?;
        progress.end();
        cancel.check()
    })??;
    progress.begin("write", files.pairs.len() as u64);
    for (pair, collected) in files.pairs.iter().zip(&all) {
        let mut sink = pair.create(job, &collected.layer)?;
        for feature in &collected.features {
            cancel.check()?;
            sink.write(feature)?;
        }
        let written = sink.finish(&collected.layer.foreign)?;
        files::note(&mut report, written, collected.notes.clone());
        progress.advance(1);
    }
    progress.end();
    Ok(report)
}

/// Simplifies all features in place.
fn simplify(
    job: &LineJob,
    all: &mut [Collected],
    rule: &Rule,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<()> {
    if let Some(topology) = &job.topology {
        let points = match &topology.sides {
            Some(path) => cover::positions(path, &OpenOptions::default())?,
            None => Vec::new(),
        };
        return cover::simplify(all, topology, &points, rule, report, cancel);
    }
    for collected in all {
        let features = std::mem::take(&mut collected.features);
        let one = |feature| part::simplify(feature, rule);
        let made: Vec<(Feature, Tally)> =
            features.into_par_iter().map(one).collect::<Result<_>>()?;
        made.iter().for_each(|(_, tally)| report.add(tally));
        collected.features = made.into_iter().map(|(feature, _)| feature).collect();
        cancel.check()?;
    }
    Ok(())
}

/// Reads all features of a file, within the memory of the job.
fn collect(job: &LineJob, pair: &Pair, held: &mut u64, cancel: &Cancel) -> Result<Collected> {
    let mut source = pair.open(job)?;
    let mut features = Vec::new();
    while let Some(feature) = source.next()? {
        cancel.check()?;
        *held += feature.geometry.vertices() as u64 * VERTEX + FEATURE;
        if *held > job.resources.memory {
            let message = "neighbours are looked at in memory, and this is more than is allowed";
            return Err(Error::new(ErrorKind::Resource, message)
                .in_file(&pair.input)
                .at(source.place())
                .remedy("pass more --memory, leave --topology out, or split the input"));
        }
        features.push(feature);
    }
    Ok(Collected { layer: source.layer().clone(), features, notes: source.notes() })
}
