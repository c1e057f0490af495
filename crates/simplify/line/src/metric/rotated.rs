//! Bounds of distances by the extremes of vertices across and along a segment.

use super::range::{ClosedInterval, larger};
use super::{PlaneBox, PlaneSegment};
use terrane_base::geom::plane::Xy;

impl PlaneSegment {
    /// From its begin to its end.
    #[inline(always)]
    pub(crate) fn direction(&self) -> Xy {
        self.along
    }

    /// Rounding error of positions of vertices in a box, across and along the segment: computed values, and the
    /// extreme of a search by computed products, are off by at most 12 units of 2^-53 of the product.
    #[inline(always)]
    pub(crate) fn rounding(&self, around: &PlaneBox) -> f64 {
        let (x, y) = (around.x.minus(self.from[0]), around.y.minus(self.from[1]));
        let reach = larger(-x.low, x.high) + larger(-y.low, y.high);
        (self.along[0].abs() + self.along[1].abs()) * reach * (8.0 * f64::EPSILON)
    }

    /// Whether a vertex lies beyond the start (0) or the end (1).
    #[inline(always)]
    pub(crate) fn is_beyond(&self, p: &Xy, side: usize) -> bool {
        let (q, d) = ([p[0] - self.from[0], p[1] - self.from[1]], self.along);
        let along = q[0] * d[0] + q[1] * d[1];
        if side == 0 { along < 0.0 } else { along > self.limit }
    }

    /// Reach of a vertex beyond an end, from its squared distance to it.
    #[inline(always)]
    pub(crate) fn reach_from_end(&self, square: f64) -> f64 {
        square * self.scale
    }

    /// Largest difference of a coordinate among both ends and a box.
    pub(crate) fn span(&self, around: &PlaneBox) -> f64 {
        let [x, y] = [(around.x, 0), (around.y, 1)].map(|(range, i)| {
            let range = range.minus(self.from[i]);
            let range = range.join(ClosedInterval::of(0.0)).join(ClosedInterval::of(self.along[i]));
            range.high - range.low
        });
        larger(x, y)
    }

    /// Part of [`super::DistanceMetric::reach_most`] from vertices beyond an end.
    #[inline(always)]
    pub(crate) fn most_over(&self, around: &PlaneBox) -> f64 {
        let (x, y) = (around.x.minus(self.from[0]), around.y.minus(self.from[1]));
        let along = x.times(self.along[0]).plus_range(y.times(self.along[1]));
        along.most_over(self.limit)
    }

    /// Upper bound of the reach from vertices beside the segment, no farther to either side than two vertices,
    /// plus `slack`.
    #[inline(always)]
    pub(crate) fn max_across(&self, extremes: &[Xy; 2], slack: f64) -> f64 {
        let [first, second] = extremes.map(|p| {
            let (q, d) = ([p[0] - self.from[0], p[1] - self.from[1]], self.along);
            ClosedInterval::of(q[0] * d[1] - q[1] * d[0])
        });
        wider(first.join(second), slack).max_squared()
    }

    /// Upper bound of the reach from vertices beyond an end, no farther to either end than two vertices, plus
    /// `slack`.
    #[inline(always)]
    pub(crate) fn max_along(&self, extremes: &[Xy; 2], slack: f64) -> f64 {
        let [first, second] = extremes.map(|p| {
            let (q, d) = ([p[0] - self.from[0], p[1] - self.from[1]], self.along);
            ClosedInterval::of(q[0] * d[0] + q[1] * d[1])
        });
        wider(first.join(second), slack).most_over(self.limit)
    }

    /// Upper bound of vertices in a convex hull whose corners reach at most `reach`: distances are convex, so
    /// only rounding and `slack` are added.
    #[inline(always)]
    pub(crate) fn max_around(&self, reach: f64, slack: f64) -> f64 {
        let distance = reach.sqrt() + 2.0 * slack;
        distance * distance * (1.0 + 4.0 * f64::EPSILON)
    }
}

fn wider(range: ClosedInterval, slack: f64) -> ClosedInterval {
    ClosedInterval { low: range.low - slack, high: range.high + slack }
}
