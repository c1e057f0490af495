//! Proves simplified lines against the file they were made from.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::error::{Error, ErrorKind, Result};
use crate::pipeline::line::{Length, Measure, goal_of, positions};
use crate::pipeline::{Cancel, Progress, Resources, peak_memory};
use crate::vector::{self, Feature, FeatureSource, OpenOptions};
use crate::verify::lines::{Defect, Distance, Lines, Question, check};

/// Simplified lines to be proven.
#[derive(Clone, Debug)]
pub struct LineVerifyJob {
    /// The simplified lines.
    pub lines: PathBuf,
    /// What they were made from.
    pub original: PathBuf,
    /// The object of a TopoJSON original; its first one when `None`.
    pub layer: Option<String>,
    /// Largest allowed distance; only measured when `None`.
    pub tolerance: Option<Length>,
    /// Heights take part in distances.
    pub is_space: bool,
    /// Crossings, rings, sides and borders are judged, too.
    pub topology: bool,
    /// Points that had to stay on their side.
    pub sides: Option<PathBuf>,
    /// What the job may use.
    pub resources: Resources,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct LineVerifyReport {
    pub lines: String,
    pub original: String,
    pub passed: bool,
    /// One line for each broken promise.
    pub failures: Vec<String>,
    pub features: u64,
    /// Lines and rings of the result, and those that are gone.
    pub parts: u64,
    pub dropped: u64,
    /// Before and after.
    pub vertices: [u64; 2],
    pub measure: Measure,
    pub tolerance: Option<f64>,
    pub largest_distance: f64,
    /// Where that is.
    pub farthest: Option<[f64; 2]>,
    /// Vertices beyond the tolerance.
    pub beyond: u64,
    /// Parts with vertices that the original does not have.
    pub foreign: u64,
    /// Pairs of segments that cross, touch or overlap: before, after, and those after that are not
    /// both segments of the original.
    pub crossings: [u64; 3],
    pub collapsed: u64,
    pub turned: u64,
    /// Vertices, and points to be kept on their side, that have changed sides.
    pub moved: u64,
    /// Borders torn apart or run together.
    pub torn: u64,
    pub peak_memory: Option<u64>,
    pub wall_seconds: f64,
}

/// Bytes that the proof needs for each vertex of either file.
const VERTEX: u64 = 180;

/// Proves the lines of a file against the original.
///
/// # Errors
/// Files that cannot be read, or have other features than each other; more than the memory holds.
pub fn verify_lines(
    job: &LineVerifyJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<LineVerifyReport> {
    let started = Instant::now();
    let options = OpenOptions { layer: job.layer.clone() };
    let mut original = vector::open(&job.original, &options)?;
    let mut lines = vector::open(&job.lines, &OpenOptions::default())?;
    let measured = job.tolerance.map(|length| goal_of(length, job.is_space, &original.layer().crs));
    let plain = if job.is_space { Measure::Space } else { Measure::Plane };
    let (measure, tolerance) = match measured.transpose()? {
        Some((measure, tolerance)) => (measure, Some(tolerance)),
        None => (plain, None),
    };
    progress.begin("read", 0);
    let mut flat = [Flat::default(), Flat::default()];
    let mut features = 0;
    loop {
        cancel.check()?;
        let pair = (original.next()?, lines.next()?);
        let (before, after) = match pair {
            (None, None) => break,
            (Some(before), Some(after)) => (before, after),
            (before, _) => return Err(other_features(job, before.is_some(), features)),
        };
        features += 1;
        progress.advance(1);
        let [from, to] = &mut flat;
        place(&before, &after, from, to).map_err(|e| at(e, &*lines, &job.lines))?;
        let held = (from.points.len() + to.points.len()) as u64 * VERTEX;
        if held > job.resources.memory {
            return Err(Error::new(ErrorKind::Resource, "the lines are more than memory holds")
                .in_file(&job.original)
                .remedy("pass more --memory"));
        }
    }
    progress.end();
    let points = match &job.sides {
        Some(path) => positions(path, &OpenOptions::default())?,
        None => Vec::new(),
    };
    let [original, simplified] = &flat;
    let question = Question {
        original: original.lines(),
        simplified: simplified.lines(),
        points: &points,
        distance: match measure {
            Measure::Plane => Distance::Plane,
            Measure::Space => Distance::Space,
            Measure::Geographic => Distance::Geographic,
        },
        tolerance,
    };
    let found = check(&question)?;
    let count = |defect: Defect| defect.count;
    let mut report = LineVerifyReport {
        lines: job.lines.display().to_string(),
        original: job.original.display().to_string(),
        failures: failures(&found, job.topology),
        features,
        parts: found.parts,
        dropped: found.dropped,
        vertices: found.vertices,
        measure,
        tolerance,
        largest_distance: found.farthest.map_or(0.0, |far| far.distance),
        farthest: found.farthest.map(|far| far.at),
        beyond: count(found.beyond),
        foreign: count(found.foreign),
        crossings: [found.original_crossings, found.crossings, count(found.new_crossings)],
        collapsed: count(found.collapsed),
        turned: count(found.turned),
        moved: count(found.moved),
        torn: count(found.torn),
        peak_memory: peak_memory(),
        wall_seconds: started.elapsed().as_secs_f64(),
        passed: false,
    };
    report.passed = report.failures.is_empty();
    Ok(report)
}

fn at(error: Error, source: &dyn FeatureSource, path: &Path) -> Error {
    error.at(source.place()).in_file(path)
}

fn other_features(job: &LineVerifyJob, fewer: bool, same: u64) -> Error {
    let how = if fewer { "fewer" } else { "more" };
    Error::bad_input(format!(
        "has {how} features than the original, which agree up to number {same}"
    ))
    .in_file(&job.lines)
    .remedy("name the file that it was made from")
}

/// Lines of each broken promise.
fn failures(found: &crate::verify::lines::Report, topology: bool) -> Vec<String> {
    let own = [
        (
            found.foreign,
            "parts with a vertex that the original does not have, or not in that order",
        ),
        (found.beyond, "vertices farther than the tolerance from the segment in their place"),
    ];
    let neighbours = [
        (found.new_crossings, "pairs of segments meet that did not"),
        (found.collapsed, "rings have lost their area"),
        (found.turned, "rings are turned over"),
        (found.moved, "vertices or points have changed sides"),
        (found.torn, "borders are torn apart or run together"),
    ];
    let judged = own.into_iter().chain(neighbours.into_iter().filter(|_| topology));
    let tell = |(defect, what): (Defect, &str)| {
        let (part, [x, y]) = defect.first?;
        Some(format!("{} {what}; the first in part {part} at {x}, {y}", defect.count))
    };
    judged.filter(|(defect, _)| defect.count > 0).filter_map(tell).collect()
}

/// Parts, flat.
#[derive(Default)]
struct Flat {
    points: Vec<[f64; 3]>,
    ends: Vec<usize>,
    closed: Vec<bool>,
}

impl Flat {
    fn push(&mut self, part: &[[f64; 3]], is_ring: bool) {
        if self.ends.is_empty() {
            self.ends.push(0);
        }
        self.points.extend_from_slice(part);
        self.ends.push(self.points.len());
        self.closed.push(is_ring);
    }

    fn lines(&self) -> Lines<'_> {
        let starts = if self.ends.is_empty() { &[0][..] } else { &self.ends };
        Lines { points: &self.points, starts, closed: &self.closed }
    }
}

type OwnPart = (Vec<[f64; 3]>, bool);

fn parts_of(feature: &Feature) -> Vec<OwnPart> {
    let of = |part: vector::Part<'_>| {
        let z = |i: usize| part.z.get(i).copied().filter(|z| z.is_finite()).unwrap_or(0.0);
        let points = part.xy.iter().enumerate().map(|(i, [x, y])| [*x, *y, z(i)]);
        (points.collect(), part.is_ring())
    };
    feature.geometry.parts().map(of).collect()
}

/// Puts the parts of a feature beside those they were made from: all of them, or, where some are gone,
/// those whose vertices they have.
fn place(before: &Feature, after: &Feature, from: &mut Flat, to: &mut Flat) -> Result<()> {
    let (before, after) = (parts_of(before), parts_of(after));
    let one_to_one = before.len() == after.len();
    let mut left = after.into_iter().peekable();
    for (part, is_ring) in before {
        let known: HashSet<[u64; 2]> = part.iter().map(key).collect();
        let is_of = |(points, ring): &OwnPart| {
            *ring == is_ring && points.iter().all(|point| known.contains(&key(point)))
        };
        let own = left.next_if(|next| (one_to_one && next.1 == is_ring) || is_of(next));
        from.push(&part, is_ring);
        to.push(&own.map_or(Vec::new(), |(points, _)| points), is_ring);
    }
    match left.next() {
        None => Ok(()),
        Some(_) => Err(Error::bad_input("a feature has a part that the original has not")
            .remedy("name the file that it was made from, in the same order")),
    }
}

/// A position in the plane as bits, where 0 and -0 are the same.
fn key(point: &[f64; 3]) -> [u64; 2] {
    [(point[0] + 0.0).to_bits(), (point[1] + 0.0).to_bits()]
}
