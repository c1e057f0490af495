//! Ramer-Douglas-Peucker: split at the farthest vertex until all are within the tolerance.
//!
//! Ramer, "An iterative procedure for the polygonal approximation of plane curves" (1972); Douglas &
//! Peucker (1973). Among vertices equally far the first one splits. The farthest vertex is found in a
//! tree of boxes (see `regions`), so that a split that takes off one vertex does not cost a look at all
//! others: O(n log n) on the zigzags, spirals and arcs on which plain scans are quadratic, with the
//! result of plain scans, bit for bit. (Hershberger & Snoeyink, 1992, reach that in the worst case with
//! hulls of paths, for the distance from infinite lines; their hulls do not tell what is farthest from a
//! segment.) A line made to defeat the boxes is still quadratic.

use super::metric::Metric;
use super::regions::{Regions, farthest_beyond};
use super::{Scratch, keep_short};

/// Appends to `kept` the vertices that Ramer-Douglas-Peucker keeps at `tolerance`.
pub fn rdp<V: Copy, M: Metric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
    scratch: &mut Scratch,
    kept: &mut Vec<u32>,
) {
    if keep_short(points.len(), kept) {
        return;
    }
    let tree = Regions::new::<V, M>(points);
    kept.push(0);
    let ends = &mut scratch.ends;
    ends.clear();
    ends.push(points.len() as u32 - 1);
    let mut start = 0;
    while let Some(&end) = ends.last() {
        match split(metric, points, &tree, start, end as usize, tolerance * tolerance) {
            Some((middle, _)) => ends.push(middle as u32),
            None => {
                ends.pop();
                kept.push(end);
                start = end as usize;
            }
        }
    }
}

/// The vertex strictly between `start` and `end` that is farthest from their segment, and its squared
/// distance, if that is above `tolerance2`.
pub(super) fn split<V: Copy, M: Metric<V>>(
    metric: &M,
    points: &[V],
    tree: &Regions<M::Region>,
    start: usize,
    end: usize,
    tolerance2: f64,
) -> Option<(usize, f64)> {
    if end - start < 2 {
        return None;
    }
    let segment = metric.segment(&points[start], &points[end]);
    farthest_beyond::<V, M>(&segment, points, tree, start + 1, end, tolerance2)
}
