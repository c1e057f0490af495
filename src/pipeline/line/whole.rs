//! All features together: shared borders are simplified once, and nothing crosses, collapses or
//! changes sides; or a number of vertices or bytes is to be met.

mod cover;
mod search;

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
use crate::vector::{Feature, Layer, OpenOptions};
use rayon::prelude::*;

/// The features of a file.
pub(super) struct Collected {
    pub(super) layer: Layer,
    pub(super) features: Vec<Feature>,
    /// How each of them is simplified, and where it was, until hierarchies are made.
    orders: Vec<(Order, String)>,
    /// The hierarchies of each; none without `--hierarchy`.
    pub(super) trees: Vec<Trees>,
    notes: Vec<String>,
}

/// Bytes for each vertex that is held: itself, its arc, what is kept of it, what is written.
const VERTEX: u64 = 112;
/// Bytes more for each vertex of which there is a hierarchy.
const SPLIT: u64 = 24;
/// Bytes for each feature beside its vertices, about.
const FEATURE: u64 = 400;

pub(super) fn run(
    job: &LineJob,
    files: &Files,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineReport> {
    progress.begin("read", files.pairs.len() as u64);
    let (mut held, mut store) = (0, Store::of(job, &files.rule(job, 0.0)?)?);
    let read = |pair: &Pair| {
        let collected = collect(job, pair, &mut store, &mut held, cancel);
        progress.advance(1);
        collected
    };
    let mut all: Vec<Collected> = files.pairs.iter().map(read).collect::<Result<_>>()?;
    store.end()?;
    progress.end();
    let mut report = LineReport { crs: files.crs.label(), ..LineReport::default() };
    on_threads(job.resources.threads, || {
        split(files, &mut all, &files.rule(job, 0.0)?, &mut store, &mut report, cancel)?;
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
    report.stored(job, store)?;
    progress.end();
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
        let trees = &collected.trees;
        let one = |(at, feature)| part::simplify(feature, trees.get(at), rule);
        let made: Vec<(Feature, Tally)> =
            features.into_par_iter().enumerate().map(one).collect::<Result<_>>()?;
        made.iter().for_each(|(_, tally)| report.add(tally));
        collected.features = made.into_iter().map(|(feature, _)| feature).collect();
        cancel.check()?;
    }
    Ok(())
}

/// Reads all features of a file, within the memory of the job.
fn collect(
    job: &LineJob,
    pair: &Pair,
    store: &mut Store,
    held: &mut u64,
    cancel: &Cancel,
) -> Result<Collected> {
    let mut source = pair.open(job)?;
    let (mut features, mut orders) = (Vec::new(), Vec::new());
    let vertex = if store.is_some() { VERTEX + SPLIT } else { VERTEX };
    while let Some(feature) = source.next()? {
        cancel.check()?;
        *held += feature.geometry.vertices() as u64 * vertex + FEATURE;
        if *held > job.resources.memory {
            let message = "neighbours are looked at in memory, and this is more than is allowed";
            return Err(Error::new(ErrorKind::Resource, message)
                .in_file(&pair.input)
                .at(source.place())
                .remedy("pass more --memory, leave --topology out, or split the input"));
        }
        if store.is_some() {
            orders.push((store.next(&feature.geometry)?, source.place()));
        }
        features.push(feature);
    }
    let (layer, notes) = (source.layer().clone(), source.notes());
    Ok(Collected { layer, features, orders, trees: Vec::new(), notes })
}
