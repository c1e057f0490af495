//! Circumscribed discs in floating point, with margins that make every answer a certain one.

use super::position::{Arm, Position};
use super::predicates::{Site, in_circle, orient};
use super::space::Window;

/// The closed disc through the corners of a triangle. Positions are relative to the first corner, so
/// rounding is relative to the size of the triangle, not to that of the cloud.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    corners: [Site; 3],
    /// Centre, relative to the first corner; each coordinate is off by at most 4u of the radius.
    centre: [f64; 2],
    /// Squared radius, less and plus the margin.
    within: f64,
    beyond: f64,
    /// Radius with its margin.
    radius: f64,
}

/// Relative margin of squared distances: 512u, an order of magnitude beyond the sum of the roundings
/// of the centre (4u each), of its square and of the distance of a point to it.
const MARGIN: f64 = 1.0 / (1u64 << 44) as f64;

/// Differences below this keep the numerators of the centre within 62 bits.
const SMALL: i64 = 1 << 20;

impl Disc {
    /// The disc of a counter-clockwise triangle with non-zero area.
    #[inline]
    pub fn around(corners: [Site; 3]) -> Self {
        let [a, b, c] = corners.map(|p| p.map(i64::from));
        let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let double = 2.0 * orient(corners[0], corners[1], corners[2]) as f64;
        let centre = numerators(u, v).map(|n| n / double);
        let square = centre[0] * centre[0] + centre[1] * centre[1];
        Self {
            corners,
            centre,
            within: square * (1.0 - MARGIN),
            beyond: square * (1.0 + MARGIN),
            radius: square.sqrt() * (1.0 + MARGIN) + 1.0,
        }
    }

    /// Squared distance of a site from the centre, off by less than half the margin near the circle.
    #[inline(always)]
    pub(super) fn square(&self, p: Site) -> f64 {
        let a = self.corners[0];
        let x = (i64::from(p[0]) - i64::from(a[0])) as f64 - self.centre[0];
        let y = (i64::from(p[1]) - i64::from(a[1])) as f64 - self.centre[1];
        x * x + y * y
    }

    /// Squared distances beyond this are certainly outside.
    #[inline(always)]
    pub(super) fn beyond(&self) -> f64 {
        self.beyond
    }

    /// Radius, with a margin of a step and more.
    #[inline(always)]
    pub(super) fn radius(&self) -> f64 {
        self.radius
    }

    /// True when the whole disc certainly lies in the window.
    #[inline]
    pub fn lies_in(&self, window: &Window) -> bool {
        (0..2).all(|axis| {
            let anchor = i64::from(self.corners[0][axis]);
            let low = (i64::from(window.low[axis]) - anchor) as f64;
            let high = (i64::from(window.high[axis]) - anchor) as f64;
            low <= self.centre[axis] - self.radius && self.centre[axis] + self.radius <= high
        })
    }

    /// True when a site whose squared distance is `square` lies strictly inside, after perturbation;
    /// corners do not.
    #[inline(always)]
    pub(super) fn holds_at(&self, p: Site, square: f64) -> bool {
        square < self.within || (square <= self.beyond && self.holds_near(p))
    }

    /// True when the site lies strictly inside, after perturbation; corners do not.
    pub fn holds(&self, p: Site) -> bool {
        self.holds_at(p, self.square(p))
    }

    /// The centre as seen from a position, in steps.
    pub(super) fn centre_from(&self, q: Position) -> [f64; 2] {
        let corner = q.to(self.corners[0]).steps();
        [corner[0] + self.centre[0], corner[1] + self.centre[1]]
    }

    /// True when a position lies strictly inside; exactly, and without perturbation.
    pub(super) fn holds_position(&self, q: Position) -> bool {
        let [x, y] = self.centre_from(q);
        let square = x * x + y * y;
        square < self.within || (square <= self.beyond && self.holds_exactly(q))
    }

    /// The determinant of [`in_circle`] in 1/256 steps, below 2^160: lifts are split at bit 40.
    #[inline(never)]
    fn holds_exactly(&self, q: Position) -> bool {
        let [a, b, c] = self.corners.map(|p| q.to(p));
        let terms: [(Arm, i128); 3] = [(a, b.cross(c)), (b, c.cross(a)), (c, a.cross(b))];
        let part = |part: &dyn Fn(i128) -> i128| -> i128 {
            terms.iter().map(|(arm, minor)| part(arm.square()) * minor).sum()
        };
        let (high, low) = (part(&|lift| lift >> 40), part(&|lift| lift & ((1 << 40) - 1)));
        let carried = high + (low >> 40);
        carried > 0 || (carried == 0 && low & ((1 << 40) - 1) > 0)
    }

    #[inline(never)]
    fn holds_near(&self, p: Site) -> bool {
        let [a, b, c] = self.corners;
        !self.corners.contains(&p) && in_circle(a, b, c, p)
    }

    /// Lowest and highest coordinate on `axis` of sites of the disc whose other coordinate lies in
    /// `low..=high`; never too narrow. `None` when it certainly has none.
    #[inline(always)]
    pub fn span(&self, axis: usize, low: i32, high: i32) -> Option<[i64; 2]> {
        let anchor = self.corners[0];
        let across = |v: i32| (i64::from(v) - i64::from(anchor[1 - axis])) as f64;
        let centre = self.centre[1 - axis];
        let gap = (across(low) - centre).max(centre - across(high)).max(0.0);
        let left = self.beyond - gap * gap;
        if left < 0.0 {
            return None;
        }
        let (half, middle) = (left.sqrt(), self.centre[axis]);
        // One step of slack for the roundings of the root and of the sums.
        let slack = 1.0 + half * MARGIN;
        let anchor = i64::from(anchor[axis]);
        // Casts saturate; clipping follows.
        Some([
            anchor.saturating_add((middle - half - slack) as i64),
            anchor.saturating_add((middle + half + slack) as i64),
        ])
    }

    /// The part of a window that the disc touches, never too small; `None` when it certainly touches
    /// nothing.
    pub fn clip(&self, window: &Window) -> Option<Window> {
        let mut part = *window;
        // Twice, because a narrower window in y narrows that in x and the other way round.
        for axis in [0, 1, 0, 1] {
            let span = self.span(axis, part.low[1 - axis], part.high[1 - axis])?;
            part.low[axis] = span[0].max(part.low[axis].into()).try_into().ok()?;
            part.high[axis] = span[1].min(part.high[axis].into()).try_into().ok()?;
            if part.low[axis] > part.high[axis] {
                return None;
            }
        }
        Some(part)
    }
}

/// Centre of the circle through the origin, `u` and `v`, times twice their cross product.
#[inline(always)]
fn numerators(u: [i64; 2], v: [i64; 2]) -> [f64; 2] {
    let (uu, vv) = (u[0] * u[0] + u[1] * u[1], v[0] * v[0] + v[1] * v[1]);
    let most = u[0].abs().max(u[1].abs()).max(v[0].abs()).max(v[1].abs());
    if most < SMALL {
        return [(v[1] * uu - u[1] * vv) as f64, (u[0] * vv - v[0] * uu) as f64];
    }
    let wide = |p: i64, q: i64, r: i64, s: i64| {
        (i128::from(p) * i128::from(q) - i128::from(r) * i128::from(s)) as f64
    };
    [wide(v[1], uu, u[1], vv), wide(u[0], vv, v[0], uu)]
}

#[cfg(test)]
mod tests {
    use super::super::predicates::determinant;
    use super::*;
    use proptest::prelude::*;

    fn site() -> impl Strategy<Value = Site> {
        (1u32..29).prop_flat_map(|bits| [-(1i32 << bits)..1 << bits, -(1i32 << bits)..1 << bits])
    }

    fn turned([a, b, c, d]: [Site; 4]) -> Option<[Site; 4]> {
        let area = orient(a, b, c);
        let [b, c] = if area > 0 { [b, c] } else { [c, b] };
        (area != 0 && ![a, b, c].contains(&d)).then_some([a, b, c, d])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn answers_as_the_exact_predicate(sites in prop::array::uniform4(site())) {
            let Some([a, b, c, d]) = turned(sites) else { return Ok(()) };
            let disc = Disc::around([a, b, c]);
            prop_assert_eq!(disc.holds(d), in_circle(a, b, c, d));
            prop_assert!(!disc.holds(a) && !disc.holds(b) && !disc.holds(c));
        }

        #[test]
        fn positions_are_inside_as_sites_are(sites in prop::array::uniform4(site())) {
            let Some([a, b, c, d]) = turned(sites) else { return Ok(()) };
            let (disc, q) = (Disc::around([a, b, c]), Position::of(d));
            prop_assert_eq!(disc.holds_exactly(q), determinant(a, b, c, d) > 0);
            prop_assert_eq!(disc.holds_position(q), determinant(a, b, c, d) > 0);
        }

        /// A position is a site of a plane 256 times as large.
        #[test]
        fn positions_between_sites_are_inside_exactly(sites in prop::array::uniform4(site())) {
            let [a, b, c, _] = sites.map(|p| p.map(|v| v >> 9));
            let Some([a, b, c, d]) = turned([a, b, c, sites[3]]) else { return Ok(()) };
            let q = Position { x: d[0].into(), y: d[1].into() };
            let [large_a, large_b, large_c] = [a, b, c].map(|p| p.map(|v| v * 256));
            let expected = determinant(large_a, large_b, large_c, d) > 0;
            prop_assert_eq!(Disc::around([a, b, c]).holds_exactly(q), expected);
            prop_assert_eq!(Disc::around([a, b, c]).holds_position(q), expected);
        }

        #[test]
        fn spans_miss_nothing(sites in prop::array::uniform4(site())) {
            let Some([a, b, c, d]) = turned(sites) else { return Ok(()) };
            let disc = Disc::around([a, b, c]);
            for p in [a, b, c, d].into_iter().filter(|&p| p != d || disc.holds(p)) {
                for axis in [0, 1] {
                    let other = p[1 - axis];
                    let span = disc.span(axis, other, other).unwrap();
                    prop_assert!(span[0] <= p[axis].into() && i64::from(p[axis]) <= span[1]);
                }
                let window = Window { low: p, high: p };
                prop_assert_eq!(disc.clip(&window), Some(window));
            }
        }
    }
}
