//! Features one by one, independent of their neighbours.

use std::cell::Cell;

use super::tool::{MetricTask, MetricTool, MetricVertex, SimplifyRule, check, vertices};
use super::trees::{FeatureHierarchies, PendingHierarchies};
use terrane_base::error::Result;
use terrane_line::{DistanceMetric, SimplifyScratch};
use terrane_vector::{Geometry, RetainedVertices};

/// Statistics of the parts of some features.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PartCounts {
    pub(super) features: u64,
    pub(super) parts: u64,
    pub(super) vertices: u64,
    pub(super) kept: u64,
    pub(super) collapsed: u64,
    /// Largest squared distance.
    pub(super) distance2: f64,
    /// Time in seconds to make or check hierarchies, and to query them.
    pub(super) prepare_seconds: f64,
    pub(super) query_seconds: f64,
}

/// Vertices of a geometry kept by `rule`, from hierarchies if available.
///
/// # Errors
/// A part that the metric does not support ([`check`]).
pub(super) fn simplify(
    geometry: &Geometry,
    trees: Option<&FeatureHierarchies>,
    rule: &SimplifyRule,
) -> Result<(Geometry, PartCounts)> {
    geometry.parts().try_for_each(|part| check(&part, rule))?;
    let left = PendingHierarchies::of(trees, rule.threshold);
    Ok(rule.apply(GeometryTask { geometry, left }))
}

/// Runs `work` with the buffers of the thread.
fn with_scratch<T>(work: impl FnOnce(&mut SimplifyScratch, &mut Vec<u32>) -> T) -> T {
    thread_local! {
        static ROOM: Cell<(SimplifyScratch, Vec<u32>)> = Cell::default();
    }
    let (mut scratch, mut kept) = ROOM.take();
    let done = work(&mut scratch, &mut kept);
    ROOM.set((scratch, kept));
    done
}

/// A geometry to simplify.
struct GeometryTask<'a> {
    geometry: &'a Geometry,
    left: PendingHierarchies<'a>,
}

impl MetricTask for GeometryTask<'_> {
    type Output = (Geometry, PartCounts);

    fn run<V: MetricVertex, M: DistanceMetric<V> + Copy>(
        mut self,
        tool: &MetricTool<V, M>,
    ) -> (Geometry, PartCounts) {
        let mut tally = PartCounts { features: 1, ..PartCounts::default() };
        let (mut points, everything) = (Vec::new(), tool.rule.keeps_everything());
        let geometry = with_scratch(|scratch, kept| {
            self.geometry.keep(|_, part| {
                vertices(&part, &mut points);
                let mut choose = selector(&mut self.left, tool);
                let outcome = tool.part(&points, part.is_ring(), &mut choose, scratch, kept);
                tally.parts += 1;
                tally.vertices += points.len() as u64;
                tally.collapsed += u64::from(outcome.collapsed);
                tally.distance2 = tally.distance2.max(outcome.distance2);
                // A ring with fewer than three distinct vertices is unchanged.
                let is_flat = part.is_ring() && (1..3).contains(&kept.len());
                if is_flat || everything { RetainedVertices::All } else { chosen(kept) }
            })
        });
        tally.kept = geometry.parts().map(|part| part.xy.len() as u64).sum();
        tally.query_seconds = self.left.seconds;
        (geometry, tally)
    }
}

/// Selects vertices of lines from their hierarchies, or by the method.
fn selector<V: MetricVertex, M: DistanceMetric<V> + Copy>(
    left: &mut PendingHierarchies<'_>,
    tool: &MetricTool<V, M>,
) -> impl FnMut(&[V], &mut SimplifyScratch, &mut Vec<u32>) {
    |line, scratch, kept| {
        if tool.rule.keeps_everything() || !left.filter(line.len(), kept) {
            tool.line(line, scratch, kept);
        }
    }
}

/// Indices as a bit set.
pub(super) fn chosen(kept: &[u32]) -> RetainedVertices {
    if kept.is_empty() {
        RetainedVertices::Nothing
    } else {
        RetainedVertices::Vertices(kept.to_vec())
    }
}
