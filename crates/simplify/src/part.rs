//! Features one by one: what is kept of each of their parts, whatever lies beside them.

use std::cell::Cell;

use super::tool::{Rule, Task, Tool, Vertex, check, vertices};
use super::trees::{Left, Trees};
use terrane_base::error::Result;
use terrane_line::{Metric, Scratch};
use terrane_vector::{Geometry, Kept};

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
