//! Metres on the ellipsoid, for longitudes and latitudes in degrees.

use super::located::LocatedVertex;
use super::range::{ClosedInterval, larger};
use super::{DistanceMetric, cosine};
use crate::wedge::EllipseWedge;
use terrane_base::geom::plane::Xy;

/// Metres in the plane that touches the WGS 84 ellipsoid at the vertex.
///
/// A vertex at latitude phi has the local scale `k = [N(phi) cos(phi), M(phi)] * pi / 180` metres a
/// degree, with N and M the radii of curvature in the prime vertical and in the meridian. Its distance
/// from a segment is the formula of [the plane](super) with `q` and `d` multiplied by `k`, component by
/// component. It depends on the vertex and the segment alone, and a segment is straight in longitude
/// and latitude, as it is drawn; it is exact in the limit of short distances. Longitudes are plain
/// numbers: a line across the antimeridian must go on beyond 180.
#[derive(Clone, Copy, Debug, Default)]
pub struct GeographicMetric;

/// A segment in longitude and latitude; see [`super::PlaneSegment`].
#[derive(Clone, Copy, Debug)]
pub struct GeographicSegment {
    from: Xy,
    along: Xy,
    /// 1, or 0 for a segment without length.
    length: f64,
}

/// A box with the range of local scales in it.
#[derive(Clone, Copy, Debug)]
pub struct GeographicBox {
    at: [ClosedInterval; 2],
    scale: [ClosedInterval; 2],
}

impl DistanceMetric<LocatedVertex> for GeographicMetric {
    type Segment = GeographicSegment;
    type Region = GeographicBox;
    type Wedge = EllipseWedge;

    #[inline(always)]
    fn segment(&self, a: &LocatedVertex, b: &LocatedVertex) -> GeographicSegment {
        let along = [b.at[0] - a.at[0], b.at[1] - a.at[1]];
        match along == [0.0; 2] {
            true => GeographicSegment { from: a.at, along: [1.0, 1.0], length: 0.0 },
            false => GeographicSegment { from: a.at, along, length: 1.0 },
        }
    }

    #[inline(always)]
    fn reach(course: &GeographicSegment, p: &LocatedVertex) -> f64 {
        let [kx, ky] = p.scale;
        let q = [(p.at[0] - course.from[0]) * kx, (p.at[1] - course.from[1]) * ky];
        let d = [course.along[0] * kx, course.along[1] * ky];
        let cross = q[0] * d[1] - q[1] * d[0];
        let along = q[0] * d[0] + q[1] * d[1];
        let length = d[0] * d[0] + d[1] * d[1];
        let over = larger(larger(-along, along - length * course.length), 0.0);
        // At a pole, an eastward segment has no length.
        match length > 0.0 {
            true => (cross * cross + over * over) / length,
            false => q[0] * q[0] + q[1] * q[1],
        }
    }

    #[inline(always)]
    fn squared(_: &GeographicSegment, reach: f64) -> f64 {
        reach
    }

    #[inline(always)]
    fn within(_: &GeographicSegment, tolerance2: f64) -> f64 {
        tolerance2
    }

    #[inline(always)]
    fn region(p: &LocatedVertex) -> GeographicBox {
        GeographicBox { at: p.at.map(ClosedInterval::of), scale: p.scale.map(ClosedInterval::of) }
    }

    #[inline(always)]
    fn join(a: &GeographicBox, b: &GeographicBox) -> GeographicBox {
        GeographicBox {
            at: [a.at[0].join(b.at[0]), a.at[1].join(b.at[1])],
            scale: [a.scale[0].join(b.scale[0]), a.scale[1].join(b.scale[1])],
        }
    }

    #[inline(always)]
    fn reach_most(course: &GeographicSegment, zone: &GeographicBox) -> f64 {
        let q = [0, 1].map(|i| zone.at[i].minus(course.from[i]).times_range(zone.scale[i]));
        let d = [0, 1].map(|i| zone.scale[i].times(course.along[i]));
        let [x, y] = d.map(|range| larger(larger(range.low, -range.high), 0.0));
        let length = x * x + y * y;
        if length <= 0.0 {
            // No farther than from the beginning, rounding included.
            return (q[0].max_squared() + q[1].max_squared()) * (1.0 + 1e-9);
        }
        let cross = product(q[0], d[1]).minus_range(product(q[1], d[0]));
        let along = product(q[0], d[0]).plus_range(product(q[1], d[1]));
        let over = larger(larger(-along.low, along.high - length * course.length), 0.0);
        (cross.max_squared() + over * over) / length
    }

    fn area(&self, a: &LocatedVertex, b: &LocatedVertex, c: &LocatedVertex) -> f64 {
        let (u, v) = (b.to(a), b.to(c));
        (u[0] * v[1] - u[1] * v[0]).abs() * 0.5
    }

    fn cosine(&self, a: &LocatedVertex, b: &LocatedVertex, c: &LocatedVertex) -> f64 {
        cosine(b.to(a), b.to(c))
    }

    #[inline(always)]
    fn coordinates(p: &LocatedVertex) -> [f64; 3] {
        [p.at[0], p.at[1], 0.0]
    }
}

#[inline(always)]
fn product(a: ClosedInterval, b: ClosedInterval) -> ClosedInterval {
    a.times(b.low).join(a.times(b.high))
}
