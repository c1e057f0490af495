//! Features one by one: what is kept of each of their parts, whatever lies beside them.

use std::cell::Cell;

use super::tool::{Measure, Rule, Task, Tool, Vertex};
use super::trees::{Left, Trees};
use terrane_base::error::{Error, Result};
use terrane_line::metric::{LEAST, MOST};
use terrane_line::{Metric, Scratch};
use terrane_vector::{Geometry, Kept, Part};

/// What became of the parts of some features.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tally {
    pub(super) features: u64,
    pub(super) parts: u64,
    pub(super) vertices: u64,
    pub(super) kept: u64,
    pub(super) collapsed: u64,
    /// The largest squared distance.
    pub(super) square: f64,
    /// Seconds that hierarchies took to be made, or checked, and to answer.
    pub(super) prepare_seconds: f64,
    pub(super) query_seconds: f64,
}

/// What `rule` keeps of a geometry, by hierarchies where it has them.
///
/// # Errors
/// A part that the metric cannot measure ([`check`]).
pub(super) fn simplify(
    geometry: &Geometry,
    trees: Option<&Trees>,
    rule: &Rule,
) -> Result<(Geometry, Tally)> {
    geometry.parts().try_for_each(|part| check(&part, rule))?;
    let left = Left::of(trees, rule.threshold);
    Ok(rule.apply(One { geometry, left }))
}

/// Fails when a part cannot be measured: it has no heights, latitudes that are none, or coordinates whose
/// products are no numbers.
pub(super) fn check(part: &Part<'_>, rule: &Rule) -> Result<()> {
    let z = if rule.measure == Measure::Space { part.z } else { &[] };
    match rule.measure {
        _ if rule.keeps_everything() => return Ok(()),
        Measure::Space if part.z.is_empty() || part.z.iter().any(|z| z.is_nan()) => {
            return Err(Error::bad_input("a vertex has no height, which ‹metric› 3d measures")
                .remedy("leave ‹metric› 3d out"));
        }
        Measure::Geographic if part.xy.iter().any(|[_, y]| y.abs() > 90.0) => {
            return Err(Error::bad_input("a latitude is beyond 90 degrees")
                .remedy("pass ‹tolerance› as a plain number, in units of the data"));
        }
        _ => {}
    }
    let mut all = part.xy.as_flattened().iter().chain(z);
    // Those that are too small count as 0, which is near enough beside any threshold but a tiny one.
    let least = if rule.threshold < FINEST { LEAST } else { 0.0 };
    let is_wrong = |c: &&f64| c.abs() > MOST || (**c != 0.0 && c.abs() < least);
    let Some(wrong) = all.find(is_wrong) else { return Ok(()) };
    let (extreme, remedy) = match wrong.abs() > MOST {
        true => ("large", "bring it into other units, or take the feature out"),
        false => ("small", "pass ‹tolerance› 1e-50 or more, or write 0 in its place"),
    };
    let message = format!("coordinate {wrong:?} is too {extreme} for distances to be computed");
    Err(Error::bad_input(message).remedy(remedy))
}

/// Thresholds from here on do not see what is below [`LEAST`].
const FINEST: f64 = 1e-50;

/// The vertices of a part, for a metric.
pub(super) fn vertices<V: Vertex>(part: &Part<'_>, out: &mut Vec<V>) {
    out.clear();
    let z = |i: usize| part.z.get(i).copied().unwrap_or(0.0);
    out.extend(part.xy.iter().enumerate().map(|(i, xy)| V::of(*xy, z(i))));
}

/// Does `work` with the thread's room.
fn with_scratch<T>(work: impl FnOnce(&mut Scratch, &mut Vec<u32>) -> T) -> T {
    thread_local! {
        static ROOM: Cell<(Scratch, Vec<u32>)> = Cell::default();
    }
    let (mut scratch, mut kept) = ROOM.take();
    let done = work(&mut scratch, &mut kept);
    ROOM.set((scratch, kept));
    done
}

/// A geometry to be simplified.
struct One<'a> {
    geometry: &'a Geometry,
    left: Left<'a>,
}

impl Task for One<'_> {
    type Output = (Geometry, Tally);

    fn run<V: Vertex, M: Metric<V> + Copy>(mut self, tool: &Tool<V, M>) -> (Geometry, Tally) {
        let mut tally = Tally { features: 1, ..Tally::default() };
        let (mut points, everything) = (Vec::new(), tool.rule.keeps_everything());
        let geometry = with_scratch(|scratch, kept| {
            self.geometry.keep(|_, part| {
                vertices(&part, &mut points);
                let mut choose = chooser(&mut self.left, tool);
                let outcome = tool.part(&points, part.is_ring(), &mut choose, scratch, kept);
                tally.parts += 1;
                tally.vertices += points.len() as u64;
                tally.collapsed += u64::from(outcome.collapsed);
                tally.square = tally.square.max(outcome.square);
                // A ring that had fewer than three different vertices stays as it was.
                let is_flat = part.is_ring() && (1..3).contains(&kept.len());
                if is_flat || everything { Kept::All } else { chosen(kept) }
            })
        });
        tally.kept = geometry.parts().map(|part| part.xy.len() as u64).sum();
        tally.query_seconds = self.left.seconds;
        (geometry, tally)
    }
}

/// Keeps vertices of lines by what is left of their hierarchies, or else by the method.
fn chooser<V: Vertex, M: Metric<V> + Copy>(
    left: &mut Left<'_>,
    tool: &Tool<V, M>,
) -> impl FnMut(&[V], &mut Scratch, &mut Vec<u32>) {
    |line, scratch, kept| {
        if tool.rule.keeps_everything() || !left.filter(line.len(), kept) {
            tool.line(line, scratch, kept);
        }
    }
}

/// Indices as a choice.
pub(super) fn chosen(kept: &[u32]) -> Kept {
    if kept.is_empty() { Kept::Nothing } else { Kept::Vertices(kept.to_vec()) }
}
