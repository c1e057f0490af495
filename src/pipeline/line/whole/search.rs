//! The threshold that meets a number of vertices, or a size of the files.

use rayon::prelude::*;

use super::Collected;
use crate::error::{Error, Result};
use crate::line::registry::Bounds;
use crate::pipeline::line::files::Files;
use crate::pipeline::line::goal::{Goal, smallest};
use crate::pipeline::line::tool::Rule;
use crate::pipeline::line::{LineJob, part};
use crate::pipeline::{Cancel, Progress};

/// The rule with the smallest threshold that meets the goal of a job, each feature by itself.
pub(super) fn rule(
    job: &LineJob,
    files: &Files,
    all: &[Collected],
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Rule> {
    let at = |threshold: f64| files.rule(job, threshold);
    let vertices: u64 = all.iter().flat_map(|c| &c.features).map(vertices).sum();
    progress.begin("search", 0);
    let fits = |threshold: f64| {
        cancel.check()?;
        progress.advance(1);
        let rule = at(threshold)?;
        match (job.goal, job.goal.most(vertices)) {
            (Goal::Size(most), _) => Ok(size(job, files, all, &rule)? <= most),
            (_, Some(most)) => Ok(count(all, &rule) <= most),
            _ => Ok(true),
        }
    };
    let extent = extent(all);
    let largest = if job.method.bounds == Bounds::Area { extent * extent } else { extent };
    let threshold = smallest(largest, fits)?;
    progress.end();
    at(threshold)
}

fn vertices(feature: &crate::vector::Feature) -> u64 {
    feature.geometry.parts().map(|part| part.xy.len() as u64).sum()
}

fn count(all: &[Collected], rule: &Rule) -> u64 {
    let own = |collected: &Collected| -> u64 {
        let features = collected.features.par_iter().enumerate();
        features.map(|(at, feature)| part::count(feature, collected.trees.get(at), rule)).sum()
    };
    all.par_iter().map(own).sum()
}

/// The larger side of the box around all features.
fn extent(all: &[Collected]) -> f64 {
    let bounds = all.iter().flat_map(|c| &c.features).filter_map(|f| f.geometry.bounds());
    let join =
        |a: [f64; 4], b: [f64; 4]| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])];
    bounds.reduce(join).map_or(0.0, |[west, south, east, north]| (east - west).max(north - south))
}

/// Bytes of all files, written to a place from which they are taken away again.
fn size(job: &LineJob, files: &Files, all: &[Collected], rule: &Rule) -> Result<u64> {
    let folder = match &job.resources.temp_dir {
        Some(folder) => tempfile::tempdir_in(folder),
        None => tempfile::tempdir(),
    };
    let folder = folder.map_err(|e| Error::write(&std::env::temp_dir(), e))?;
    let mut bytes = 0;
    for (number, (pair, collected)) in files.pairs.iter().zip(all).enumerate() {
        let path = folder.path().join(format!("{number}.{}", pair.ending()));
        let mut sink = pair.create_at(path, job, &collected.layer)?;
        for (at, feature) in collected.features.iter().enumerate() {
            let trees = collected.trees.get(at);
            sink.write(&part::simplify(feature.clone(), trees, rule)?.0)?;
        }
        bytes += sink.finish(&collected.foreign)?.bytes;
    }
    Ok(bytes)
}
