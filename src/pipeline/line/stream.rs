//! Features one by one, in the order of the file: batches are simplified on all threads while the
//! next one is read.

use rayon::prelude::*;

use super::files::{self, Files, Pair};
use super::part::{self, Tally};
use super::tool::Rule;
use super::{LineJob, LineReport, on_threads};
use crate::error::Result;
use crate::pipeline::{Cancel, Progress};
use crate::vector::{Feature, FeatureSource};

/// Vertices of a batch, at least, unless memory is short.
const BATCH: u64 = 1 << 20;
/// Bytes that a vertex of a batch takes, with what is made of it.
const VERTEX: u64 = 160;
/// Features of a batch at most.
const MOST_FEATURES: usize = 1 << 16;

pub(super) fn run(
    job: &LineJob,
    files: &Files,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineReport> {
    let rule = files.rule(job, 0.0)?;
    let mut report = LineReport { crs: files.crs.label(), ..LineReport::default() };
    report.measured_by(&rule);
    let bytes: u64 = files.pairs.iter().map(size_of).sum();
    progress.begin("simplify", bytes);
    for pair in &files.pairs {
        on_threads(job.resources.threads, || copy(job, pair, &rule, &mut report, cancel))??;
        progress.advance(size_of(pair));
    }
    progress.end();
    Ok(report)
}

fn size_of(pair: &Pair) -> u64 {
    std::fs::metadata(&pair.input).map_or(0, |meta| meta.len())
}

/// One file.
fn copy(
    job: &LineJob,
    pair: &Pair,
    rule: &Rule,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<()> {
    let mut source = pair.open(job)?;
    let mut sink = pair.create(job, source.layer())?;
    let most = BATCH.min(job.resources.memory / VERTEX / 4).max(1);
    let mut batch = read(&mut *source, most)?;
    while !batch.is_empty() {
        cancel.check()?;
        let (made, next) = rayon::join(|| simplify(batch, rule), || read(&mut *source, most));
        for one in made {
            let (feature, tally) = one.map_err(|e| e.in_file(&pair.input))?;
            report.add(&tally);
            sink.write(&feature)?;
        }
        batch = next?;
    }
    let foreign = source.layer().foreign.clone();
    files::note(report, sink.finish(&foreign)?, source.notes());
    Ok(())
}

/// A feature, and where it was.
type Placed = (Feature, String);

/// The next features, of about so many vertices.
fn read(source: &mut dyn FeatureSource, most: u64) -> Result<Vec<Placed>> {
    let (mut batch, mut vertices) = (Vec::new(), 0);
    while vertices < most && batch.len() < MOST_FEATURES {
        let Some(feature) = source.next()? else { break };
        vertices += feature.geometry.vertices() as u64;
        batch.push((feature, source.place()));
    }
    Ok(batch)
}

fn simplify(batch: Vec<Placed>, rule: &Rule) -> Vec<Result<(Feature, Tally)>> {
    let one = |(feature, place): Placed| part::simplify(feature, rule).map_err(|e| e.at(place));
    batch.into_par_iter().map(one).collect()
}
