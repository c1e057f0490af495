//! Distances from a vertex to the segment that replaces it: one trait, one file per metric.
//!
//! All methods of this crate use this formula. With `a` and `b` the ends of the segment, `p` the vertex, `d = b
//! - a` and `q = p - a`, each operation rounded to `f64`:
//!
//! ```text
//! along = q.x * d.x + q.y * d.y
//! cross = q.x * d.y - q.y * d.x
//! over  = max(-along, along - (d.x * d.x + d.y * d.y), 0)     how far p lies beyond an end, times |d|
//! distance^2 = (cross * cross + over * over) / (d.x * d.x + d.y * d.y)
//! ```
//!
//! and `distance^2 = q.x * q.x + q.y * q.y` where `|d|^2` is 0. A vertex is *within* a tolerance when
//! `distance^2 <= tolerance * tolerance`; as the square root of a rounded square is the number
//! itself, a checker that compares `distance` with the tolerance agrees. What rounding leaves: the
//! differences are off by half an ulp each, so a checker with another formula may find a distance
//! larger by about 2^-51 times the length of the segment. On coordinates that are whole multiples of
//! some power of two, with differences below 2^26 of it, `cross` and `along` are exact, so that a
//! tolerance of 0 drops exactly the vertices on their segments; elsewhere it drops those whose
//! computed distance is 0.
//!
//! The products are of the fourth degree: lengths must lie between 1e-75 and 1e75 (in metres for degrees). This
//! holds for coordinates that are 0 or between [`LEAST`] and [`MOST`].

mod euclidean;
mod geographic;
pub(crate) mod located;
pub(crate) mod range;
mod rotated;
mod vertical;

pub use euclidean::SpaceMetric;
pub use geographic::GeographicMetric;
pub use located::LocatedVertex;
pub use vertical::{VerticalMetric, is_monotone};

use super::wedge::{PlaneWedge, Wedge};
use range::{ClosedInterval, SURELY, over};
use terrane_base::geom::plane::Xy;

/// A distance from vertices to segments.
pub trait DistanceMetric<V: Copy>: Sync {
    /// A segment, prepared for many vertices.
    type Segment: Copy;
    /// A region of a run of vertices.
    type Region: Copy;
    /// Directions from a vertex that pass others within a tolerance.
    type Wedge: Wedge<V>;

    /// The segment from `a` to `b`.
    fn segment(&self, a: &V, b: &V) -> Self::Segment;

    /// A value that orders vertices by their distance from a segment; [`DistanceMetric::squared`] converts it.
    fn reach(segment: &Self::Segment, p: &V) -> f64;

    /// Squared distance of a `reach`; monotone.
    fn squared(segment: &Self::Segment, reach: f64) -> f64;

    /// A reach that is certainly within: [`DistanceMetric::squared`] of it, or less, is at most `tolerance2`.
    /// Larger reaches have to be squared.
    fn within(segment: &Self::Segment, tolerance2: f64) -> f64;

    /// Region of one vertex.
    fn region(p: &V) -> Self::Region;

    /// Union of two regions.
    fn join(a: &Self::Region, b: &Self::Region) -> Self::Region;

    /// Upper bound of the computed [`DistanceMetric::reach`] of every vertex in a region, by interval
    /// arithmetic in the same order of operations; rounding is monotone, so no allowance is needed.
    fn reach_most(segment: &Self::Segment, region: &Self::Region) -> f64;

    /// Area of a triangle, in squared units of distance.
    fn area(&self, a: &V, b: &V, c: &V) -> f64;

    /// Cosine of the angle at `b`; 0 where a side has no length.
    fn cosine(&self, a: &V, b: &V, c: &V) -> f64;

    /// The squared distance of `p` from the segment from `a` to `b`.
    fn distance2(&self, p: &V, a: &V, b: &V) -> f64 {
        let segment = self.segment(a, b);
        Self::squared(&segment, Self::reach(&segment, p))
    }

    /// Coordinates, 0 if missing.
    fn coordinates(p: &V) -> [f64; 3];

    /// The line itself, for the distance in the plane.
    fn in_plane(_points: &[V]) -> Option<&[Xy]> {
        None
    }
}

/// Largest magnitude of a coordinate for which no product overflows.
pub const MOST: f64 = 1e70;

/// Smallest magnitude of a coordinate other than 0 for which no product underflows: differences are
/// 2^-53 of it at least.
pub const LEAST: f64 = 1e-59;

/// A coordinate for measuring: below [`LEAST`] it is 0.
#[inline(always)]
pub fn measurable(c: f64) -> f64 {
    if c.abs() < LEAST { 0.0 } else { c }
}

/// The Euclidean distance in the plane.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlaneMetric;

/// A segment in the plane. A degenerate one has the direction (1, 0) and ends at its start, so that the same
/// formula gives the distance from a point.
#[derive(Clone, Copy, Debug)]
pub struct PlaneSegment {
    from: Xy,
    along: Xy,
    /// End, in units of `along`'s squared length.
    limit: f64,
    /// Squared length of `along`.
    scale: f64,
}

/// A box in the plane.
#[derive(Clone, Copy, Debug)]
pub struct PlaneBox {
    x: ClosedInterval,
    y: ClosedInterval,
}

impl DistanceMetric<Xy> for PlaneMetric {
    type Segment = PlaneSegment;
    type Region = PlaneBox;
    type Wedge = PlaneWedge;

    #[inline(always)]
    fn segment(&self, a: &Xy, b: &Xy) -> PlaneSegment {
        let along = [b[0] - a[0], b[1] - a[1]];
        let scale = along[0] * along[0] + along[1] * along[1];
        match scale > 0.0 {
            true => PlaneSegment { from: *a, along, limit: scale, scale },
            false => PlaneSegment { from: *a, along: [1.0, 0.0], limit: 0.0, scale: 1.0 },
        }
    }

    #[inline(always)]
    fn reach(segment: &PlaneSegment, p: &Xy) -> f64 {
        let (q, d) = ([p[0] - segment.from[0], p[1] - segment.from[1]], segment.along);
        let cross = q[0] * d[1] - q[1] * d[0];
        let along = q[0] * d[0] + q[1] * d[1];
        cross * cross + over(along, segment.limit)
    }

    #[inline(always)]
    fn squared(segment: &PlaneSegment, reach: f64) -> f64 {
        reach / segment.scale
    }

    #[inline(always)]
    fn within(segment: &PlaneSegment, tolerance2: f64) -> f64 {
        tolerance2 * segment.scale * SURELY
    }

    #[inline(always)]
    fn region(p: &Xy) -> PlaneBox {
        PlaneBox { x: ClosedInterval::of(p[0]), y: ClosedInterval::of(p[1]) }
    }

    #[inline(always)]
    fn join(a: &PlaneBox, b: &PlaneBox) -> PlaneBox {
        PlaneBox { x: a.x.join(b.x), y: a.y.join(b.y) }
    }

    #[inline(always)]
    fn reach_most(segment: &PlaneSegment, region: &PlaneBox) -> f64 {
        let (x, y) = (region.x.minus(segment.from[0]), region.y.minus(segment.from[1]));
        let d = segment.along;
        let cross = x.times(d[1]).minus_range(y.times(d[0]));
        let along = x.times(d[0]).plus_range(y.times(d[1]));
        cross.max_squared() + along.most_over(segment.limit)
    }

    #[inline(always)]
    fn area(&self, a: &Xy, b: &Xy, c: &Xy) -> f64 {
        let (u, v) = ([a[0] - b[0], a[1] - b[1]], [c[0] - b[0], c[1] - b[1]]);
        (u[0] * v[1] - u[1] * v[0]).abs() * 0.5
    }

    #[inline(always)]
    fn cosine(&self, a: &Xy, b: &Xy, c: &Xy) -> f64 {
        cosine([a[0] - b[0], a[1] - b[1]], [c[0] - b[0], c[1] - b[1]])
    }

    #[inline(always)]
    fn coordinates(p: &Xy) -> [f64; 3] {
        [p[0], p[1], 0.0]
    }

    fn in_plane(points: &[Xy]) -> Option<&[Xy]> {
        Some(points)
    }
}

/// Cosine of the angle between two vectors; 0 where one has no length.
#[inline(always)]
fn cosine<const N: usize>(u: [f64; N], v: [f64; N]) -> f64 {
    let lengths = (dot(&u, &u) * dot(&v, &v)).sqrt();
    if lengths > 0.0 { dot(&u, &v) / lengths } else { 0.0 }
}

#[inline(always)]
fn dot<const N: usize>(u: &[f64; N], v: &[f64; N]) -> f64 {
    u.iter().zip(v).map(|(a, b)| a * b).sum()
}

/// The largest squared distance of the vertices of `points` from the segments that join `kept`
/// (ascending, at least the first and the last), and the vertex it is found at: the lowest among
/// equals. `None` when no vertex was dropped. Linear in the vertices.
pub fn largest_distance2<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    kept: &[u32],
) -> Option<(u32, f64)> {
    let mut worst: Option<(u32, f64)> = None;
    for pair in kept.windows(2) {
        let segment = metric.segment(&points[pair[0] as usize], &points[pair[1] as usize]);
        for i in pair[0] + 1..pair[1] {
            let distance = M::squared(&segment, M::reach(&segment, &points[i as usize]));
            if worst.is_none_or(|(_, most)| distance > most) {
                worst = Some((i, distance));
            }
        }
    }
    worst
}
