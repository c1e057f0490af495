//! The vertical distance of a profile.
//!
//! For vertical distances monotone chains need no square root and no circle, so `line::wedge` has a wedge of
//! slopes. In the plane monotone chains gain nothing: the distance from a segment does not depend on the
//! direction of the chain. Tile borders are refined by the same loop as lines (`line::rdp::refine`) with exact
//! distances.

use super::range::{ClosedInterval, SURELY};
use super::{DistanceMetric, cosine};
use crate::wedge::SlopeWedge;
use terrane_base::geom::plane::Xy;

/// Vertical distance of a profile: x, strictly monotone, is the position, y the height.
///
/// `distance = |q.y * d.x - q.x * d.y| / |d.x|`, compared as squares. See [`is_monotone`].
#[derive(Clone, Copy, Debug, Default)]
pub struct VerticalMetric;

/// True if x strictly increases, or decreases.
pub fn is_monotone(points: &[Xy]) -> bool {
    points.windows(2).all(|pair| pair[0][0] < pair[1][0])
        || points.windows(2).all(|pair| pair[0][0] > pair[1][0])
}

/// A segment of a profile.
#[derive(Clone, Copy, Debug)]
pub struct ProfileSegment {
    from: Xy,
    along: Xy,
}

/// A box around a part of a profile.
#[derive(Clone, Copy, Debug)]
pub struct ProfileBox {
    x: ClosedInterval,
    y: ClosedInterval,
}

impl DistanceMetric<Xy> for VerticalMetric {
    type Segment = ProfileSegment;
    type Region = ProfileBox;
    type Wedge = SlopeWedge;

    #[inline(always)]
    fn segment(&self, a: &Xy, b: &Xy) -> ProfileSegment {
        let along = [b[0] - a[0], b[1] - a[1]];
        match along[0] == 0.0 {
            true => ProfileSegment { from: *a, along: [1.0, 0.0] },
            false => ProfileSegment { from: *a, along },
        }
    }

    #[inline(always)]
    fn reach(chord: &ProfileSegment, p: &Xy) -> f64 {
        let (q, d) = ([p[0] - chord.from[0], p[1] - chord.from[1]], chord.along);
        let cross = q[0] * d[1] - q[1] * d[0];
        cross * cross
    }

    #[inline(always)]
    fn squared(chord: &ProfileSegment, reach: f64) -> f64 {
        reach / (chord.along[0] * chord.along[0])
    }

    #[inline(always)]
    fn within(chord: &ProfileSegment, tolerance2: f64) -> f64 {
        tolerance2 * (chord.along[0] * chord.along[0]) * SURELY
    }

    #[inline(always)]
    fn region(p: &Xy) -> ProfileBox {
        ProfileBox { x: ClosedInterval::of(p[0]), y: ClosedInterval::of(p[1]) }
    }

    #[inline(always)]
    fn join(a: &ProfileBox, b: &ProfileBox) -> ProfileBox {
        ProfileBox { x: a.x.join(b.x), y: a.y.join(b.y) }
    }

    #[inline(always)]
    fn reach_most(chord: &ProfileSegment, region: &ProfileBox) -> f64 {
        let (x, y) = (region.x.minus(chord.from[0]), region.y.minus(chord.from[1]));
        x.times(chord.along[1]).minus_range(y.times(chord.along[0])).max_squared()
    }

    fn area(&self, a: &Xy, b: &Xy, c: &Xy) -> f64 {
        super::PlaneMetric.area(a, b, c)
    }

    fn cosine(&self, a: &Xy, b: &Xy, c: &Xy) -> f64 {
        cosine([a[0] - b[0], a[1] - b[1]], [c[0] - b[0], c[1] - b[1]])
    }

    #[inline(always)]
    fn coordinates(p: &Xy) -> [f64; 3] {
        [p[0], p[1], 0.0]
    }
}
