//! Proves simplified lines against the file they were made from.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
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
    let mut held = 0;
    let mut read = |source: &mut dyn FeatureSource| {
        let mut all = Vec::new();
        while let Some(feature) = source.next()? {
            cancel.check()?;
            progress.advance(1);
            held += feature.geometry.vertices() as u64 * VERTEX;
            if held > job.resources.memory {
                return Err(Error::new(
                    ErrorKind::Resource,
                    "the lines are more than memory holds",
                )
                .in_file(&job.original)
                .remedy("pass more --memory"));
            }
            all.push(Own::of(&feature));
        }
        Ok(all)
    };
    let (before, after) = (read(&mut *original)?, read(&mut *lines)?);
    progress.end();
    let features = before.len() as u64;
    let flat = pairs(&before, &after).map_err(|e| e.in_file(&job.lines))?;
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

/// The vertices of a part, and whether it is a ring.
type OwnPart = (Vec<[f64; 3]>, bool);

/// A feature.
struct Own {
    parts: Vec<OwnPart>,
    /// Its id and properties, to tell it from others.
    stamp: String,
}

impl Own {
    fn of(feature: &Feature) -> Self {
        let of = |part: vector::Part<'_>| {
            let z = |i: usize| part.z.get(i).copied().filter(|z| z.is_finite()).unwrap_or(0.0);
            let points = part.xy.iter().enumerate().map(|(i, [x, y])| [*x, *y, z(i)]);
            (points.collect(), part.is_ring())
        };
        let values: Vec<_> = feature.properties.iter().map(|(_, value)| value).collect();
        let stamp = format!("{:?} {values:?}", feature.id);
        Self { parts: feature.geometry.parts().map(of).collect(), stamp }
    }
}

/// The parts of all features beside those they were made from. Features come in the order of the
/// original, or, from formats that sort them, in any.
fn pairs(before: &[Own], after: &[Own]) -> Result<[Flat; 2]> {
    if before.len() != after.len() {
        let how = if after.len() < before.len() { "fewer" } else { "more" };
        let (here, there) = (after.len(), before.len());
        return Err(Error::bad_input(format!(
            "has {how} features than the original: {here}, not {there}"
        ))
        .remedy("name the file that it was made from"));
    }
    let in_order = before.iter().zip(after).map(|(before, after)| beside(before, after));
    let placed = match in_order.collect::<Option<Vec<_>>>() {
        Some(placed) => placed,
        None => sorted(before, after)?,
    };
    let mut flat = [Flat::default(), Flat::default()];
    for ((part, is_ring), own) in
        before.iter().flat_map(|own| &own.parts).zip(placed.into_iter().flatten())
    {
        flat[0].push(part, *is_ring);
        let own = own.map_or(&[][..], |(points, _)| points);
        match *is_ring && is_backward(part, own) {
            true => flat[1].push(&own.iter().rev().copied().collect::<Vec<_>>(), true),
            false => flat[1].push(own, *is_ring),
        }
    }
    Ok(flat)
}

/// For each part of a feature before what it became, if it is still there.
type Placed<'a> = Vec<Option<&'a OwnPart>>;

/// Features that are not in the order of the original, found by their vertices.
fn sorted<'a>(before: &[Own], after: &'a [Own]) -> Result<Vec<Placed<'a>>> {
    let mut having: HashMap<[u64; 2], Vec<usize>> = HashMap::new();
    for (number, feature) in before.iter().enumerate() {
        for point in feature.parts.iter().flat_map(|(points, _)| points) {
            let numbers = having.entry(key(point)).or_default();
            if numbers.last() != Some(&number) {
                numbers.push(number);
            }
        }
    }
    let mut placed: Vec<Option<Placed<'a>>> = vec![None; before.len()];
    for (number, feature) in after.iter().enumerate() {
        let firsts = feature.parts.iter().find_map(|(points, _)| points.first());
        let Some(first) = firsts else { continue };
        let candidates = having.get(&key(first)).map_or(&[][..], Vec::as_slice);
        let mut free: Vec<usize> =
            candidates.iter().copied().filter(|own| placed[*own].is_none()).collect();
        // A small one may lie on the vertices of a neighbour: first those that are like it.
        free.sort_by_key(|own| {
            let own = &before[*own];
            (own.stamp != feature.stamp, own.parts.len() != feature.parts.len())
        });
        let found = free.into_iter().find_map(|own| Some((own, beside(&before[own], feature)?)));
        let (own, parts) = found.ok_or_else(|| {
            let message = format!("feature {number} was made from none of the original");
            Error::bad_input(message).remedy("name the file that it was made from")
        })?;
        placed[own] = Some(parts);
    }
    let gone = |(own, feature): (Option<Placed<'a>>, &Own)| {
        own.unwrap_or_else(|| vec![None; feature.parts.len()])
    };
    Ok(placed.into_iter().zip(before).map(gone).collect())
}

/// The parts of a feature beside those they were made from: all of them, or, where some are gone, those
/// whose vertices they have. `None` when one was made from none.
fn beside<'a>(before: &Own, after: &'a Own) -> Option<Placed<'a>> {
    let (before, after) = (&before.parts, &after.parts);
    let one_to_one = before.len() == after.len()
        && before.iter().zip(after).all(|(before, after)| before.1 == after.1);
    let mut left = after.iter().peekable();
    let mut placed = Vec::new();
    for (part, is_ring) in before {
        let known: HashSet<[u64; 2]> = part.iter().map(key).collect();
        let is_of = |(points, ring): &OwnPart| {
            *ring == *is_ring && points.iter().all(|point| known.contains(&key(point)))
        };
        let is_near =
            |(points, _): &OwnPart| points.iter().any(|point| known.contains(&key(point)));
        placed.push(left.next_if(|next| is_of(next) || (one_to_one && is_near(next))));
    }
    left.next().is_none().then_some(placed)
}

/// True for a ring whose vertices come in the opposite order of those of `part`: formats have rules of
/// their own for the direction of rings.
fn is_backward(part: &[[f64; 3]], ring: &[[f64; 3]]) -> bool {
    let places: HashMap<_, _> = part.iter().zip(0..).map(|(point, at)| (key(point), at)).collect();
    let along: Vec<i64> =
        ring.iter().filter_map(|point| places.get(&key(point)).copied()).collect();
    // Once around there is one step back, where the numbers begin again.
    let back = along.windows(2).filter(|pair| pair[1] < pair[0]).count();
    2 * back > along.len().saturating_sub(1)
}

/// A position in the plane as bits, where 0 and -0 are the same.
fn key(point: &[f64; 3]) -> [u64; 2] {
    [(point[0] + 0.0).to_bits(), (point[1] + 0.0).to_bits()]
}
