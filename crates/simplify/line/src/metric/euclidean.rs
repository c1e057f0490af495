//! Euclidean distance in space, including heights.

use super::range::{ClosedInterval, SURELY, over};
use super::{DistanceMetric, cosine};
use crate::wedge::{SpaceWedge, difference};

/// The Euclidean distance in space; x, y and z in one unit.
///
/// As in the plane, with `|cross|^2` the sum of the squares of the three components of q x d.
#[derive(Clone, Copy, Debug, Default)]
pub struct SpaceMetric;

/// A segment in space; see [`super::PlaneSegment`].
#[derive(Clone, Copy, Debug)]
pub struct SpaceSegment {
    from: [f64; 3],
    along: [f64; 3],
    limit: f64,
    scale: f64,
}

impl DistanceMetric<[f64; 3]> for SpaceMetric {
    type Segment = SpaceSegment;
    type Region = SpaceBox;
    type Wedge = SpaceWedge;

    #[inline(always)]
    fn segment(&self, a: &[f64; 3], b: &[f64; 3]) -> SpaceSegment {
        let along = difference(b, a);
        let scale = along[0] * along[0] + along[1] * along[1] + along[2] * along[2];
        match scale > 0.0 {
            true => SpaceSegment { from: *a, along, limit: scale, scale },
            false => SpaceSegment { from: *a, along: [1.0, 0.0, 0.0], limit: 0.0, scale: 1.0 },
        }
    }

    #[inline(always)]
    fn reach(segment: &SpaceSegment, p: &[f64; 3]) -> f64 {
        let (q, d) = (difference(p, &segment.from), segment.along);
        let (x, y, z) =
            (q[1] * d[2] - q[2] * d[1], q[2] * d[0] - q[0] * d[2], q[0] * d[1] - q[1] * d[0]);
        let along = q[0] * d[0] + q[1] * d[1] + q[2] * d[2];
        x * x + y * y + z * z + over(along, segment.limit)
    }

    #[inline(always)]
    fn squared(segment: &SpaceSegment, reach: f64) -> f64 {
        reach / segment.scale
    }

    #[inline(always)]
    fn within(segment: &SpaceSegment, tolerance2: f64) -> f64 {
        tolerance2 * segment.scale * SURELY
    }

    #[inline(always)]
    fn region(p: &[f64; 3]) -> SpaceBox {
        SpaceBox(p.map(ClosedInterval::of))
    }

    #[inline(always)]
    fn join(a: &SpaceBox, b: &SpaceBox) -> SpaceBox {
        SpaceBox([a.0[0].join(b.0[0]), a.0[1].join(b.0[1]), a.0[2].join(b.0[2])])
    }

    #[inline(always)]
    fn reach_most(segment: &SpaceSegment, region: &SpaceBox) -> f64 {
        let (r, from, d) = (region.0, segment.from, segment.along);
        let q = [r[0].minus(from[0]), r[1].minus(from[1]), r[2].minus(from[2])];
        let cross = |i: usize, j: usize| q[i].times(d[j]).minus_range(q[j].times(d[i]));
        let along = q[0].times(d[0]).plus_range(q[1].times(d[1])).plus_range(q[2].times(d[2]));
        cross(1, 2).max_squared()
            + cross(2, 0).max_squared()
            + cross(0, 1).max_squared()
            + along.most_over(segment.limit)
    }

    fn area(&self, a: &[f64; 3], b: &[f64; 3], c: &[f64; 3]) -> f64 {
        let (u, v) = (difference(a, b), difference(c, b));
        let (x, y, z) =
            (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
        (x * x + y * y + z * z).sqrt() * 0.5
    }

    fn cosine(&self, a: &[f64; 3], b: &[f64; 3], c: &[f64; 3]) -> f64 {
        cosine(difference(a, b), difference(c, b))
    }

    #[inline(always)]
    fn coordinates(p: &[f64; 3]) -> [f64; 3] {
        *p
    }
}

/// A box in space.
#[derive(Clone, Copy, Debug)]
pub struct SpaceBox([ClosedInterval; 3]);
