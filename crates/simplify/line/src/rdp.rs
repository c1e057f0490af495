//! Ramer-Douglas-Peucker: split at the farthest vertex until all are within the tolerance.
//!
//! Ramer, "An iterative procedure for the polygonal approximation of plane curves" (1972); Douglas &
//! Peucker (1973). Among vertices equally far the first one splits. The farthest vertex is found in a
//! tree of boxes (see `regions`), so that a split that takes off one vertex does not cost a look at all
//! others. Where boxes do not tell, in the plane, hulls take over, once boxes have been looked at three
//! times for each vertex and doubling of the line: O(n log^2 n) whether the line crosses itself or not,
//! and beyond that what `path_hull` tells with the proof (vertices within rounding of the farthest, and
//! corners beyond ends that are new each time). The result is that of plain scans, bit for bit. In other
//! metrics there are boxes alone, and a line made to defeat them is quadratic.
//!
//! Plain scans stay at the baseline instruction set: with AVX2, the coast takes 4 to 8 % less, as
//! branches cost, not arithmetic.

use super::metric::{DistanceMetric, PlaneMetric};
use super::path_hull::{Hulls, PendingRun};
use super::regions::{LOOK, SHORTEST, VertexRegions, beyond};
use super::scratch::{SimplifyScratch, keep_short};
use terrane_base::geom::plane::Xy;

/// Regions tested per vertex and doubling of the line before boxes are replaced by hulls.
const ENOUGH: u64 = 3;

/// Appends to `kept` the vertices that Ramer-Douglas-Peucker keeps at `tolerance`.
pub fn rdp<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
    scratch: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) {
    counted(metric, points, tolerance, scratch, kept);
}

/// As [`rdp`]. In tests, returns the number of tested vertices, regions, runs and corners.
pub(super) fn counted<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
    scratch: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) -> u64 {
    if keep_short(points.len(), kept) {
        return 0;
    }
    let mut splits = VertexSplits::new(metric, points);
    let last = points.len() - 1;
    kept.push(0);
    refine(
        0,
        last,
        &mut scratch.ends,
        |start, end| Some(splits.split(start, end, tolerance * tolerance)?.0),
        |vertex| kept.push(vertex as u32),
    );
    kept.push(last as u32);
    splits.looks
}

/// Calls `keep` with the kept vertices strictly between `start` and `end`, in order: `split` divides a range,
/// and both halves recursively. `ends` is a reused buffer.
pub fn refine(
    start: usize,
    end: usize,
    ends: &mut Vec<usize>,
    mut split: impl FnMut(usize, usize) -> Option<usize>,
    mut keep: impl FnMut(usize),
) {
    let mut start = start;
    ends.clear();
    ends.push(end);
    // A stack of right ends instead of recursion: where each split takes off one vertex, recursion is
    // as deep as the line is long and overflows the stack.
    while let Some(&end) = ends.last() {
        match split(start, end) {
            Some(middle) => ends.push(middle),
            None => {
                ends.pop();
                start = end;
                if !ends.is_empty() {
                    keep(end);
                }
            }
        }
    }
}

/// Finds split vertices of a line.
pub(super) struct VertexSplits<'a, V: Copy, M: DistanceMetric<V>> {
    metric: &'a M,
    points: &'a [V],
    tree: VertexRegions<M::Region>,
    /// Remaining region tests before hulls are built.
    left: u64,
    hulls: Option<Hulls>,
    open: Vec<PendingRun>,
    /// Number of tested vertices, regions, runs and corners; those of boxes in tests only.
    pub(super) looks: u64,
}

impl<'a, V: Copy, M: DistanceMetric<V>> VertexSplits<'a, V, M> {
    /// For the splits of `points`.
    pub(super) fn new(metric: &'a M, points: &'a [V]) -> Self {
        let left = ENOUGH * points.len() as u64 * u64::from(points.len().max(1).ilog2());
        let tree = VertexRegions::new::<V, M>(points);
        Self { metric, points, tree, left, hulls: None, open: Vec::new(), looks: 0 }
    }

    /// The vertex strictly between `start` and `end` farthest from their segment, and its squared distance, if
    /// above `tolerance2`.
    pub(super) fn split(
        &mut self,
        start: usize,
        end: usize,
        tolerance2: f64,
    ) -> Option<(usize, f64)> {
        if end - start < 2 {
            return None;
        }
        if self.hulls.is_some() {
            return self.split_by_hulls(start, end, tolerance2);
        }
        let segment = self.metric.segment(&self.points[start], &self.points[end]);
        let mut looks = 0;
        let found = beyond::<V, M>(&segment, tolerance2, |farthest| {
            looks = self.tree.farthest::<V, M>(&segment, self.points, start + 1, end, farthest);
        });
        self.count(looks, end - start);
        found
    }

    /// Counts the tests of a box query, and builds the hulls at the limit.
    #[inline]
    fn count(&mut self, looks: u64, vertices: usize) {
        // Only there: it costs plain lines a tenth.
        if cfg!(test) {
            self.looks += LOOK * looks + vertices.min(SHORTEST) as u64;
        }
        self.left = self.left.saturating_sub(looks);
        if let (0, Some(line)) = (self.left, M::in_plane(self.points)) {
            let hulls = Hulls::new(line);
            self.looks += hulls.corners();
            self.hulls = Some(hulls);
        }
    }

    /// As [`VertexSplits::split`], with hulls.
    #[inline(never)]
    fn split_by_hulls(
        &mut self,
        start: usize,
        end: usize,
        tolerance2: f64,
    ) -> Option<(usize, f64)> {
        let (hulls, line) = (self.hulls.as_ref()?, M::in_plane(self.points)?);
        let segment = PlaneMetric.segment(&line[start], &line[end]);
        beyond::<Xy, PlaneMetric>(&segment, tolerance2, |farthest| {
            let vertices = start + 1..end;
            self.looks += hulls.farthest(&segment, line, vertices, &mut self.open, farthest);
        })
    }
}
