//! Wedges: the directions from a vertex whose rays pass others within a tolerance.
//!
//! A ray from the anchor passes a vertex within the tolerance if it meets the disc of that radius around it.
//! The rays that meet a disc without the anchor form a wedge narrower than a half turn, and the wedges of
//! several vertices intersect in a wedge, or not at all. A segment passes all its vertices within the tolerance
//! if the ray from either end does (Chan & Chin, "Approximation of polygonal curves with minimum number of line
//! segments or minimum error", 1996).
//!
//! Wedges here are conservative: they include an allowance for rounding, so rejected directions are beyond the
//! tolerance by the formula of [`super::metric`], and accepted ones have to be checked with it. If the
//! tolerance is below the allowance nothing could be rejected; there the first vertex outside ends the wedge.
//! With a tolerance of 0 in the plane, directions are compared exactly: a vertex is in the wedge if its cross
//! product with the first is 0.

use std::marker::PhantomData;

use super::metric::located::LocatedVertex;
use super::metric::range::{larger, smaller};
use terrane_base::geom::plane::Xy;

/// Effect of a vertex on a wedge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WedgeStep {
    /// Its direction is in the wedge: the segment may end here.
    Ends,
    /// Its direction is outside, but some directions pass it.
    Passes,
    /// The wedge is empty.
    Stops,
}

/// Directions from an anchor.
pub trait Wedge<V>: Copy {
    /// All directions from `anchor`.
    fn new(anchor: &V, tolerance: f64) -> Self;

    /// Keeps the directions that pass `p`, and returns its effect.
    fn step(&mut self, p: &V) -> WedgeStep;

    /// Distance of `p` beside the wedge, without unit: at most 0 where [`Wedge::step`] returns
    /// [`WedgeStep::Ends`], and almost nowhere else.
    fn outside(&self, p: &V) -> f64;

    /// Sides cut by the last step, as bits below [`MAX_SIDES`].
    fn cuts(&self) -> u32;

    /// Smallest [`Wedge::span2`] of the end of a segment that passes `p`: an end closer to the anchor leaves
    /// `p` beyond it by more than the tolerance. 0 if unknown.
    fn min_span2(&self, p: &V) -> f64;

    /// Squared distance of `p` from the anchor, or 0 if no vertex can lie beyond the end of a segment.
    fn span2(&self, p: &V) -> f64;
}

/// Vertices whose directions are compared in parallel.
const LANES: usize = 8;

/// The first vertex of `points` not beside the wedge, with [`Wedge::span2`] of at least `min_span2`.
#[inline]
pub(super) fn first_inside<V, W: Wedge<V>>(
    wedge: &W,
    min_span2: f64,
    points: &[V],
) -> Option<usize> {
    let outside = |p: &V| larger(wedge.outside(p), min_span2 - wedge.span2(p));
    let chunks = points.chunks_exact(LANES);
    let rest = chunks.remainder();
    for (n, chunk) in chunks.enumerate() {
        let mut lanes = [0.0; LANES];
        for (lane, p) in lanes.iter_mut().zip(chunk) {
            *lane = outside(p);
        }
        if lanes.iter().fold(f64::INFINITY, |least, lane| smaller(*lane, least)) <= 0.0 {
            return lanes.iter().position(|x| *x <= 0.0).map(|lane| n * LANES + lane);
        }
    }
    rest.iter().position(|p| outside(p) <= 0.0).map(|i| points.len() - rest.len() + i)
}

/// Largest number of sides of a wedge.
pub const MAX_SIDES: usize = 6;

/// Allowance for rounding, relative to the distance from the anchor (and to the tolerance).
const SLACK: f64 = 1e-14;

/// View of a vertex from another.
pub trait WedgeView<V>: Copy {
    /// True if all scales are 1.
    const IS_UNIFORM: bool;

    /// Vector from `anchor` to `p` in units of distance, and units of distance per unit of either coordinate at
    /// `p`.
    fn look(anchor: &V, p: &V) -> (Xy, Xy);
}

/// In the plane.
#[derive(Clone, Copy, Debug)]
pub struct PlaneView;

impl WedgeView<Xy> for PlaneView {
    const IS_UNIFORM: bool = true;

    #[inline(always)]
    fn look(anchor: &Xy, p: &Xy) -> (Xy, Xy) {
        ([p[0] - anchor[0], p[1] - anchor[1]], [1.0; 2])
    }
}

/// In space, projected on axes `I` and `J`: a distance in space is at least that of its projection.
#[derive(Clone, Copy, Debug)]
pub struct ProjectedView<const I: usize, const J: usize>;

impl<const I: usize, const J: usize> WedgeView<[f64; 3]> for ProjectedView<I, J> {
    const IS_UNIFORM: bool = true;

    #[inline(always)]
    fn look(anchor: &[f64; 3], p: &[f64; 3]) -> (Xy, Xy) {
        ([p[I] - anchor[I], p[J] - anchor[J]], [1.0; 2])
    }
}

/// On the ellipsoid: discs are ellipses in degrees.
#[derive(Clone, Copy, Debug)]
pub struct EllipsoidView;

impl WedgeView<LocatedVertex> for EllipsoidView {
    const IS_UNIFORM: bool = false;

    #[inline(always)]
    fn look(anchor: &LocatedVertex, p: &LocatedVertex) -> (Xy, Xy) {
        let k = p.scale;
        ([(p.at[0] - anchor.at[0]) * k[0], (p.at[1] - anchor.at[1]) * k[1]], k)
    }
}

/// The wedge in the plane.
pub type PlaneWedge = DiscWedge<Xy, PlaneView>;

/// The wedge in longitude and latitude.
pub type EllipseWedge = DiscWedge<LocatedVertex, EllipsoidView>;

/// A wedge between two tangents of discs.
#[derive(Clone, Copy, Debug)]
pub struct DiscWedge<V, L> {
    anchor: V,
    tolerance: f64,
    /// Unit vectors in coordinates, the left one first; `None` for all directions.
    rays: Option<[Xy; 2]>,
    /// Sides cut by the last step: 1 the left, 2 the right.
    cuts: u32,
    look: PhantomData<L>,
}

/// A vertex beside a ray.
#[derive(Clone, Copy)]
struct RayOffset {
    /// Distance to the left of it.
    left: f64,
    /// Distance along it.
    ahead: f64,
}

#[inline(always)]
fn cross(a: Xy, b: Xy) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[inline(always)]
fn dot(a: Xy, b: Xy) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The difference of two positions.
#[inline(always)]
pub(super) fn difference<const N: usize>(p: &[f64; N], from: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| p[i] - from[i])
}

/// Left and right tangent from the anchor to the disc around `v`, which does not contain the anchor, as unit
/// vectors of coordinates scaled by `k`.
#[inline]
fn tangents(v: Xy, k: Xy, tolerance: f64) -> [Xy; 2] {
    let square = dot(v, v);
    // Rounding makes the difference negative where the anchor lies on the circle.
    let along = (square - tolerance * tolerance).max(0.0).sqrt() / square;
    let aside = tolerance / square;
    [
        unscaled([v[0] * along - v[1] * aside, v[1] * along + v[0] * aside], k),
        unscaled([v[0] * along + v[1] * aside, v[1] * along - v[0] * aside], k),
    ]
}

/// The unit vector in the direction of a vector of coordinates scaled by `k`.
#[inline(always)]
fn unscaled([x, y]: Xy, k: Xy) -> Xy {
    if k == [1.0; 2] {
        return [x, y];
    }
    let (x, y) = (x / k[0], y / k[1]);
    let length = (x * x + y * y).sqrt();
    [x / length, y / length]
}

impl<V, L: WedgeView<V>> DiscWedge<V, L> {
    /// The vertex at `v` beside the ray in direction `ray`.
    #[inline(always)]
    fn ray_offset(ray: Xy, v: Xy, k: Xy) -> RayOffset {
        if L::IS_UNIFORM {
            return RayOffset { left: cross(ray, v), ahead: dot(ray, v) };
        }
        let ray = [ray[0] * k[0], ray[1] * k[1]];
        let unit = 1.0 / dot(ray, ray).sqrt();
        RayOffset { left: cross(ray, v) * unit, ahead: dot(ray, v) * unit }
    }

    /// With a tolerance of 0, only the direction of the first vertex is left; its length does not
    /// matter.
    fn step_straight(&mut self, v: Xy) -> WedgeStep {
        self.cuts = 0;
        match self.rays {
            // A vertex at the anchor has no direction, and every ray passes it.
            _ if v == [0.0; 2] => WedgeStep::Ends,
            None => {
                self.cuts = 1;
                self.rays = Some([v, v]);
                WedgeStep::Ends
            }
            Some([ray, _]) if cross(ray, v) == 0.0 && dot(ray, v) > 0.0 => WedgeStep::Ends,
            Some(_) => WedgeStep::Stops,
        }
    }

    /// The general case: some ray points away from the vertex.
    #[cold]
    fn step_behind(&mut self, v: Xy, k: Xy, rays: [Xy; 2], reach: f64) -> bool {
        if dot(v, v) <= reach * reach {
            return true;
        }
        let [left, right] = rays.map(|ray| Self::ray_offset(ray, v, k));
        let tangents = tangents(v, k, reach);
        let met = [left, right].map(|ray| ray.ahead > 0.0 && ray.left.abs() <= reach);
        let [Some(left), Some(right)] = [0, 1].map(|i| match met[i] {
            true => Some(rays[i]),
            false => Some(tangents[i]).filter(|tangent| is_between(*tangent, rays)),
        }) else {
            return false;
        };
        self.cuts = u32::from(!met[0]) | u32::from(!met[1]) << 1;
        self.rays = Some([left, right]);
        true
    }
}

/// Squared distance of a vertex minus the tolerance and rounding: by the triangle inequality, no position
/// closer to the anchor is within the tolerance of it.
#[inline(always)]
fn least_square(span2: f64, tolerance: f64) -> f64 {
    let least = (span2.sqrt() * (1.0 - SLACK) - tolerance * (1.0 + SLACK)).max(0.0);
    least * least * (1.0 - SLACK)
}

/// True if a direction lies between two rays, up to rounding.
fn is_between(direction: Xy, [left, right]: [Xy; 2]) -> bool {
    let bisector = [left[0] + right[0], left[1] + right[1]];
    cross(direction, left) >= -SLACK
        && cross(right, direction) >= -SLACK
        // The cross products alone also accept the opposite direction where the rays are close.
        && dot(direction, bisector) >= -SLACK
}

impl<V: Copy, L: WedgeView<V>> Wedge<V> for DiscWedge<V, L> {
    #[inline(always)]
    fn new(anchor: &V, tolerance: f64) -> Self {
        Self { anchor: *anchor, tolerance, rays: None, cuts: 0, look: PhantomData }
    }

    #[inline(always)]
    fn step(&mut self, p: &V) -> WedgeStep {
        let (v, k) = L::look(&self.anchor, p);
        if !L::IS_UNIFORM && k[0] <= 0.0 {
            return WedgeStep::Ends;
        }
        if L::IS_UNIFORM && self.tolerance == 0.0 {
            return self.step_straight(v);
        }
        let slack = SLACK * (v[0].abs() + v[1].abs());
        let reach = self.tolerance + SLACK * self.tolerance + slack;
        self.cuts = 0;
        let Some(rays) = self.rays else {
            if dot(v, v) > reach * reach {
                self.cuts = 3;
                self.rays = Some(tangents(v, k, reach));
            }
            return WedgeStep::Ends;
        };
        let (left, right) = (Self::ray_offset(rays[0], v, k), Self::ray_offset(rays[1], v, k));
        let is_ahead = left.ahead + right.ahead >= 0.0;
        let ends = left.left <= slack && right.left >= -slack && is_ahead;
        if left.ahead > 0.0 && right.ahead > 0.0 {
            if left.left > reach || right.left < -reach {
                return WedgeStep::Stops;
            }
            let (is_left_cut, is_right_cut) = (left.left < -reach, right.left > reach);
            if is_left_cut | is_right_cut {
                self.cuts = u32::from(is_left_cut) | u32::from(is_right_cut) << 1;
                let [l, r] = tangents(v, k, reach);
                self.rays = Some([
                    if is_left_cut { l } else { rays[0] },
                    if is_right_cut { r } else { rays[1] },
                ]);
            }
        } else if !self.step_behind(v, k, rays, reach) {
            return WedgeStep::Stops;
        }
        match ends {
            true => WedgeStep::Ends,
            false if slack > self.tolerance => WedgeStep::Stops,
            false => WedgeStep::Passes,
        }
    }

    #[inline(always)]
    fn outside(&self, p: &V) -> f64 {
        let (v, k) = L::look(&self.anchor, p);
        let Some(rays) = self.rays else { return 0.0 };
        if L::IS_UNIFORM && self.tolerance == 0.0 {
            let is_inside = cross(rays[0], v) == 0.0 && dot(rays[0], v) > 0.0 || v == [0.0; 2];
            return if is_inside { 0.0 } else { 1.0 };
        }
        let slack = SLACK * (v[0].abs() + v[1].abs());
        let (left, right) = (Self::ray_offset(rays[0], v, k), Self::ray_offset(rays[1], v, k));
        let beside = larger(left.left, -right.left) - slack;
        if !L::IS_UNIFORM && k[0] <= 0.0 { 0.0 } else { beside }
    }

    #[inline(always)]
    fn cuts(&self) -> u32 {
        self.cuts
    }

    #[inline(always)]
    fn min_span2(&self, p: &V) -> f64 {
        if L::IS_UNIFORM { least_square(self.span2(p), self.tolerance) } else { 0.0 }
    }

    #[inline(always)]
    fn span2(&self, p: &V) -> f64 {
        let (v, _) = L::look(&self.anchor, p);
        dot(v, v)
    }
}

/// The wedge in space, from three projections; it contains all directions that pass, and others.
#[derive(Clone, Copy, Debug)]
pub struct SpaceWedge {
    xy: DiscWedge<[f64; 3], ProjectedView<0, 1>>,
    yz: DiscWedge<[f64; 3], ProjectedView<1, 2>>,
    zx: DiscWedge<[f64; 3], ProjectedView<2, 0>>,
}

impl Wedge<[f64; 3]> for SpaceWedge {
    fn new(anchor: &[f64; 3], tolerance: f64) -> Self {
        let (xy, yz) = (Wedge::new(anchor, tolerance), Wedge::new(anchor, tolerance));
        Self { xy, yz, zx: Wedge::new(anchor, tolerance) }
    }

    fn step(&mut self, p: &[f64; 3]) -> WedgeStep {
        let steps = [self.xy.step(p), self.yz.step(p), self.zx.step(p)];
        match steps.contains(&WedgeStep::Stops) {
            true => WedgeStep::Stops,
            false if steps == [WedgeStep::Ends; 3] => WedgeStep::Ends,
            false => WedgeStep::Passes,
        }
    }

    fn outside(&self, p: &[f64; 3]) -> f64 {
        larger(larger(self.xy.outside(p), self.yz.outside(p)), self.zx.outside(p))
    }

    fn cuts(&self) -> u32 {
        self.xy.cuts | self.yz.cuts << 2 | self.zx.cuts << 4
    }

    fn min_span2(&self, p: &[f64; 3]) -> f64 {
        least_square(self.span2(p), self.xy.tolerance)
    }

    fn span2(&self, p: &[f64; 3]) -> f64 {
        let [x, y, z] = difference(p, &self.xy.anchor);
        x * x + y * y + z * z
    }
}

/// The wedge of a profile: a range of slopes, a faster special case for monotone chains without square roots or
/// vertices beyond an end.
#[derive(Clone, Copy, Debug)]
pub struct SlopeWedge {
    anchor: Xy,
    tolerance: f64,
    low: f64,
    high: f64,
    cuts: u32,
}

impl Wedge<Xy> for SlopeWedge {
    #[inline(always)]
    fn new(anchor: &Xy, tolerance: f64) -> Self {
        Self { anchor: *anchor, tolerance, low: f64::NEG_INFINITY, high: f64::INFINITY, cuts: 0 }
    }

    #[inline(always)]
    fn step(&mut self, p: &Xy) -> WedgeStep {
        let (x, y) = (p[0] - self.anchor[0], p[1] - self.anchor[1]);
        // The product with the reciprocal, as in `outside`: a quotient could differ in the last bit, and
        // the two have to agree on what ends a segment.
        let unit = 1.0 / x;
        let slope = y * unit;
        let slack = SLACK * slope.abs();
        let reach = (self.tolerance * unit).abs() * (1.0 + SLACK) + slack;
        let ends = slope >= self.low - slack && slope <= self.high + slack;
        let (low, high) = (slope - reach, slope + reach);
        self.cuts = u32::from(low > self.low) | u32::from(high < self.high) << 1;
        self.low = self.low.max(low);
        self.high = self.high.min(high);
        match ends {
            true => WedgeStep::Ends,
            false if self.low > self.high + slack || reach <= 2.0 * slack => WedgeStep::Stops,
            false => WedgeStep::Passes,
        }
    }

    #[inline(always)]
    fn outside(&self, p: &Xy) -> f64 {
        let slope = (p[1] - self.anchor[1]) * (1.0 / (p[0] - self.anchor[0]));
        larger(self.low - slope, slope - self.high) - SLACK * slope.abs()
    }

    #[inline(always)]
    fn cuts(&self) -> u32 {
        self.cuts
    }

    #[inline(always)]
    fn min_span2(&self, _: &Xy) -> f64 {
        0.0
    }

    #[inline(always)]
    fn span2(&self, _: &Xy) -> f64 {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A direction may be so much beside a ray, and a half turn so much too wide.
    #[test]
    fn directions_are_between_rays_but_for_rounding() {
        let rays = [[0.0, 1.0], [1.0, 0.0]];
        assert!(is_between([0.6, 0.8], rays) && !is_between([-0.6, -0.8], rays));
        for (off, is_in) in [(-0.5, true), (0.5, true), (2.0, false)] {
            assert_eq!(
                is_between([-off * SLACK, 1.0], rays),
                is_in,
                "left of the left ray by {off}"
            );
            assert_eq!(is_between([1.0, -off * SLACK], rays), is_in, "right of the right by {off}");
            let wide = [[0.0, 1.0], [0.0, -1.0 - off * SLACK]];
            assert_eq!(is_between([0.0, 1.0], wide), is_in, "more than a half turn by {off}");
        }
        // Along the one line, and away.
        assert!(!is_between([-1.0, 0.0], [[1.0, 0.0]; 2]));
    }

    /// The rays of a disc pass its centre at the tolerance and the two allowances.
    #[test]
    fn discs_are_wider_by_what_rounding_may_do() {
        for v in [[10.0, 0.0], [6.0, -8.0], [-3.0, 9.0], [0.0, -10.0]] {
            for tolerance in [0.5, 4.0] {
                let mut wedge = PlaneWedge::new(&[0.0; 2], tolerance);
                assert_eq!(wedge.step(&v), WedgeStep::Ends);
                let want = SLACK * (tolerance + v[0].abs() + v[1].abs());
                let rays = wedge.rays.expect("the disc does not hold the anchor");
                for own in [-cross(rays[0], v), cross(rays[1], v)] {
                    assert!((own - tolerance - want).abs() < 8e-15, "{own} at {v:?}, {tolerance}");
                }
            }
        }
    }

    /// Beside a ray by less than the allowance a segment may end, by more it may pass; where that is
    /// more than the tolerance, it may not.
    #[test]
    fn segments_end_beside_a_ray_by_no_more_than_rounding() {
        let mut wedge = PlaneWedge::new(&[0.0; 2], 1.0);
        assert_eq!(wedge.step(&[10.0, 3.0]), WedgeStep::Ends);
        for (side, ray) in wedge.rays.expect("some directions are left").into_iter().enumerate() {
            let out = if side == 0 { [-ray[1], ray[0]] } else { [ray[1], -ray[0]] };
            for (off, want) in
                [(-0.5, WedgeStep::Ends), (0.5, WedgeStep::Ends), (2.0, WedgeStep::Passes)]
            {
                let off = off * SLACK * 8.0 * (ray[0].abs() + ray[1].abs());
                let p = [0, 1].map(|i| 8.0 * ray[i] + off * out[i]);
                assert_eq!({ wedge }.step(&p), want, "{off} beside ray {side}");
            }
        }
        for (tolerance, off, want) in [(0.9, 3.0, WedgeStep::Stops), (1.1, 3.3, WedgeStep::Passes)]
        {
            let mut wedge = PlaneWedge::new(&[0.0; 2], tolerance * SLACK);
            assert_eq!(wedge.step(&[1.0, 0.0]), WedgeStep::Ends);
            assert_eq!(wedge.step(&[1.0, off * SLACK]), want);
        }
    }

    /// The same for slopes.
    #[test]
    fn slopes_are_wider_by_what_rounding_may_do() {
        for (p, slope) in [([4.0, 2.0], 0.5), ([-4.0, 2.0], -0.5), ([4.0, -6.0], -1.5)] {
            let mut wedge = SlopeWedge::new(&[0.0; 2], 1.0);
            assert_eq!((wedge.step(&p), wedge.cuts), (WedgeStep::Ends, 3));
            let want = 0.25 + SLACK * (0.25 + f64::abs(slope));
            for own in [slope - wedge.low, wedge.high - slope] {
                assert!((own - want).abs() < 1e-15, "{own} at {p:?}");
            }
            let (low, high) = (wedge.low, wedge.high);
            for (off, step) in
                [(-0.5, WedgeStep::Ends), (0.5, WedgeStep::Ends), (2.0, WedgeStep::Passes)]
            {
                for own in [low - off * SLACK * low.abs(), high + off * SLACK * high.abs()] {
                    assert_eq!({ wedge }.step(&[1.0, own]), step, "{off} beside, at {p:?}");
                }
            }
            // None is left when the lowest is above the highest by more than that.
            for (off, step) in [(0.5, WedgeStep::Passes), (2.0, WedgeStep::Stops)] {
                let reach = |slope: f64| 1.0 + SLACK * (1.0 + f64::abs(slope));
                let (up, down) = (high + reach(high + 1.0), low - reach(low - 1.0));
                for own in [up + off * SLACK * up.abs(), down - off * SLACK * down.abs()] {
                    assert_eq!({ wedge }.step(&[1.0, own]), step, "{off} apart, at {p:?}");
                }
            }
        }
        for (tolerance, off, want) in [(0.9, 3.0, WedgeStep::Stops), (1.1, 3.3, WedgeStep::Passes)]
        {
            let mut wedge = SlopeWedge::new(&[0.0; 2], tolerance * SLACK);
            assert_eq!(wedge.step(&[1.0, 1.0]), WedgeStep::Ends);
            assert_eq!(wedge.step(&[1.0, 1.0 + off * SLACK]), want);
        }
    }
}
