//! Points in a k-d tree, and the squared distances of the nearest to any other.

use terrane_base::geom::Point;

use super::Neighbor;
use super::position::{Bounds, MetricSpace, bounds, gaps};

/// Most points of a leaf.
const LEAF: usize = 12;

/// A k-d tree.
pub(super) struct PointKdTree<'a> {
    space: &'a MetricSpace,
    bounds: Option<Bounds>,
    points: Vec<Point>,
    /// Split axis and position of each node; the root is node 1.
    splits: Vec<(usize, f64)>,
}

/// Points of a node, by their places, and its number.
type Node = (usize, usize, usize);

impl<'a> PointKdTree<'a> {
    pub(super) fn new(space: &'a MetricSpace, mut points: Vec<Point>) -> Self {
        let all = bounds(points.iter().copied());
        let mut splits = Vec::new();
        let mut left: Vec<Node> = vec![(0, points.len(), 1)];
        while let Some((first, end, node)) = left.pop() {
            if end - first <= LEAF {
                continue;
            }
            let axis = longest(space, &points[first..end]);
            let middle = middle(first, end);
            let half = &mut points[first..end];
            let (_, at, _) = half.select_nth_unstable_by_key(middle - first, |p| along(*p, axis));
            splits.resize(splits.len().max(node + 1), (0, 0.0));
            splits[node] = (axis, along(*at, axis).into());
            left.extend([(first, middle, 2 * node), (middle, end, 2 * node + 1)]);
        }
        Self { space, bounds: all, points, splits }
    }

    /// Puts the points near one into `nearest`, which holds the nearest so far in their order.
    pub(super) fn search<N: Neighbor>(&self, at: Point, nearest: &mut [N]) {
        let Some(bounds) = self.bounds else { return };
        self.visit((0, self.points.len(), 1), gaps(bounds, [at; 2]), at, nearest);
    }

    /// Looks at the points of a node that is `off` steps away along each axis.
    fn visit<N: Neighbor>(
        &self,
        (first, end, node): Node,
        off: [f64; 3],
        at: Point,
        nearest: &mut [N],
    ) {
        let most = furthest(nearest).square();
        // Beside points at no distance there is none nearer.
        if self.space.square(off) > most || most == 0.0 {
            return;
        }
        if end - first <= LEAF {
            let points = &self.points[first..end];
            let near = points.iter().map(|point| N::new(self.space.between(at, *point), *point));
            return near.for_each(|point| offer(point, nearest));
        }
        let ((axis, split), middle) = (self.splits[node], middle(first, end));
        let beyond = split - f64::from(along(at, axis));
        let halves = [(first, middle, 2 * node), (middle, end, 2 * node + 1)];
        let [near, far] = if beyond > 0.0 { halves } else { [halves[1], halves[0]] };
        self.visit(near, off, at, nearest);
        let mut away = off;
        // The gap along one axis takes the place of the one before, so no box is compared with the point
        // (Arya & Mount, "Algorithms for fast vector quantization", 1993).
        away[axis] = beyond.abs();
        self.visit(far, away, at, nearest);
    }
}

fn middle(first: usize, end: usize) -> usize {
    first + (end - first) / 2
}

fn along(point: Point, axis: usize) -> i32 {
    [point.x, point.y, point.z][axis]
}

/// The axis of the largest extent.
fn longest(space: &MetricSpace, points: &[Point]) -> usize {
    let extent = bounds(points.iter().copied()).map_or([0.0; 3], |[low, high]| {
        [0, 1, 2].map(|i| (f64::from(along(high, i)) - f64::from(along(low, i))) * space.step[i])
    });
    (1..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best })
}

/// The last of sorted points.
fn furthest<N: Neighbor>(nearest: &[N]) -> N {
    nearest.last().copied().unwrap_or(N::NONE)
}

/// Puts a point among the nearest, if it is one of them.
fn offer<N: Neighbor>(point: N, nearest: &mut [N]) {
    if nearest.is_empty() || point >= furthest(nearest) {
        return;
    }
    let mut at = nearest.len() - 1;
    while at > 0 && nearest[at - 1] > point {
        nearest[at] = nearest[at - 1];
        at -= 1;
    }
    nearest[at] = point;
}
