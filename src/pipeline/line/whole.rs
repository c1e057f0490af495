//! All features together: shared borders are simplified once, and nothing crosses, collapses or
//! changes sides; or a number of vertices or bytes is to be met.

mod cover;
mod input;
mod kept;
mod own;
mod search;
mod spool;
mod square;

pub(in crate::pipeline) use cover::positions;

use super::files::{self, Files, Pair};
use super::goal::Goal;
use super::part::{self, Tally};
use super::tool::Rule;
use super::{LineJob, LineReport, on_threads};
use crate::error::{Error, ErrorKind, Result};
use crate::pipeline::{Cancel, Progress};
use crate::vector::Feature;
use cover::Cover;
use input::{Collected, Input};
use rayon::prelude::*;

pub(super) fn run(
    job: &LineJob,
    files: &Files,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineReport> {
    let mut report = LineReport { crs: files.crs.label(), ..LineReport::default() };
    let is_search = !matches!(job.goal, Goal::Tolerance(_) | Goal::Area(_));
    let most = job.resources.memory / if is_search { 4 } else { 2 };
    let input = Input::read(job, files, most, progress, cancel)?;
    if is_search && input.held().is_none() {
        let message = "the threshold is looked for in memory, and this is more than is allowed";
        return Err(Error::new(ErrorKind::Resource, message)
            .in_file(&files.pairs[0].input)
            .remedy("pass more --memory, pass --tolerance, or split the input"));
    }
    let rule = match is_search {
        false => files.rule(job, 0.0)?,
        true => on_threads(job.resources.threads, || {
            search::rule(job, files, &input.all, progress, cancel)
        })??,
    };
    report.measured_by(&rule);
    match &job.topology {
        Some(topology) => {
            Cover { job, files, topology, rule: &rule, progress, cancel }
                .run(input, &mut report)?;
        }
        None => {
            progress.begin("write", files.pairs.len() as u64);
            for (pair, collected) in files.pairs.iter().zip(input.all) {
                write(job, (pair, collected), &rule, &mut report, cancel)?;
                progress.advance(1);
            }
            progress.end();
        }
    }
    Ok(report)
}

/// Simplifies the features of a file one by one and writes them.
fn write(
    job: &LineJob,
    (pair, collected): (&Pair, Collected),
    rule: &Rule,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<()> {
    let one = |feature| part::simplify(feature, rule);
    let made: Vec<(Feature, Tally)> = on_threads(job.resources.threads, || {
        collected.features.into_par_iter().map(one).collect::<Result<_>>()
    })??;
    let mut sink = pair.create(job, &collected.layer)?;
    for (feature, tally) in &made {
        cancel.check()?;
        report.add(tally);
        sink.write(feature)?;
    }
    files::note(report, sink.finish(&collected.foreign)?, collected.notes);
    Ok(())
}
