//! All features together: shared borders are simplified once, and nothing crosses, collapses or
//! changes sides; or a number of vertices or bytes is to be met.

mod cover;
mod gaps;
mod input;
mod kept;
mod moves;
mod own;
mod search;
mod spool;
mod square;

pub(in crate::pipeline) use cover::positions;

use std::time::Instant;

use super::files::{self, Files, Pair};
use super::goal::Goal;
use super::part::{self, Tally};
use super::stored::{self, Order, Store};
use super::tool::Rule;
use super::trees::Trees;
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
    let plain = files.rule(job, 0.0)?;
    let mut store = Store::of(job, &plain)?;
    let mut input = Input::read(job, files, most, &mut store, progress, cancel)?;
    store.end()?;
    if is_search && input.held().is_none() {
        let message = "the threshold is looked for in memory, and this is more than is allowed";
        return Err(Error::new(ErrorKind::Resource, message)
            .in_file(&files.pairs[0].input)
            .remedy("pass more --memory, pass --tolerance, or split the input"));
    }
    let rule = match is_search {
        false => plain,
        true => on_threads(job.resources.threads, || {
            split(files, &mut input.all, &plain, &mut store, &mut report, cancel)?;
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
            report.stored(job, store)?;
            progress.end();
        }
    }
    Ok(report)
}

/// Makes the hierarchies that were ordered of all features, and stores new ones.
fn split(
    files: &Files,
    all: &mut [Collected],
    rule: &Rule,
    store: &mut Store,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<()> {
    if !store.is_some() {
        return Ok(());
    }
    for (pair, collected) in files.pairs.iter().zip(all) {
        let orders = std::mem::take(&mut collected.orders);
        let make = |((order, place), feature): ((Order, String), &Feature)| {
            cancel.check()?;
            let started = Instant::now();
            let trees = stored::trees(order, &feature.geometry, rule).map_err(|e| e.at(place))?;
            Ok((trees.unwrap_or_default(), started.elapsed().as_secs_f64()))
        };
        let made = orders.into_par_iter().zip(&collected.features).map(make);
        let made: Result<Vec<(Trees, f64)>> = made.collect();
        for (trees, prepare_seconds) in made.map_err(|e| e.in_file(&pair.input))? {
            report.add(&Tally { prepare_seconds, ..Tally::default() });
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

/// Simplifies the features of a file one by one and writes them.
fn write(
    job: &LineJob,
    (pair, collected): (&Pair, Collected),
    rule: &Rule,
    report: &mut LineReport,
    cancel: &Cancel,
) -> Result<()> {
    let trees = &collected.trees;
    let one = |(at, feature)| part::simplify(feature, trees.get(at), rule);
    let made: Vec<(Feature, Tally)> = on_threads(job.resources.threads, || {
        collected.features.into_par_iter().enumerate().map(one).collect::<Result<_>>()
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
