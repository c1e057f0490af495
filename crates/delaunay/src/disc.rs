//! Circumscribed discs in floating point, with margins that make every answer a certain one.

use super::position::FixedPosition;
use super::predicates::{Site, in_circle, orient};
use super::window::SiteWindow;

/// The closed disc through the corners of a triangle. Positions are relative to the first corner, so
/// rounding is relative to the size of the triangle, not to that of the cloud.
#[derive(Clone, Copy, Debug)]
pub struct CircumscribedDisc {
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

impl CircumscribedDisc {
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
    pub fn lies_in(&self, window: &SiteWindow) -> bool {
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
    pub(super) fn centre_from(&self, q: FixedPosition) -> [f64; 2] {
        let corner = q.to(self.corners[0]).steps();
        [corner[0] + self.centre[0], corner[1] + self.centre[1]]
    }

    /// True when a position lies strictly inside; exactly, and without perturbation.
    pub(super) fn holds_position(&self, q: FixedPosition) -> bool {
        let [x, y] = self.centre_from(q);
        let square = x * x + y * y;
        square < self.within || (square <= self.beyond && self.holds_exactly(q))
    }

    /// The determinant of [`in_circle`] in 1/256 steps, below 2^160: lifts are split at bit 40.
    #[inline(never)]
    fn holds_exactly(&self, q: FixedPosition) -> bool {
        let [a, b, c] = self.corners.map(|p| q.to(p));
        let (mut high, mut low) = (0_i128, 0_i128);
        for (arm, minor) in [(a, b.cross(c)), (b, c.cross(a)), (c, a.cross(b))] {
            let lift = arm.square();
            high += (lift >> 40) * minor;
            low += (lift & ((1 << 40) - 1)) * minor;
        }
        let high = high + (low >> 40);
        high > 0 || (high == 0 && low & ((1 << 40) - 1) > 0)
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
        let [low, high] = [low, high].map(|v| (i64::from(v) - i64::from(anchor[1 - axis])) as f64);
        let centre = self.centre[1 - axis];
        let gap = (low - centre).max(centre - high).max(0.0);
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
    #[inline]
    pub fn clip(&self, window: &SiteWindow) -> Option<SiteWindow> {
        let mut clipped = *window;
        // Twice, because a narrower window in y narrows that in x and the other way round.
        for axis in [0, 1, 0, 1] {
            let span = self.span(axis, clipped.low[1 - axis], clipped.high[1 - axis])?;
            clipped.low[axis] = span[0].max(clipped.low[axis].into()).try_into().ok()?;
            clipped.high[axis] = span[1].min(clipped.high[axis].into()).try_into().ok()?;
            if clipped.low[axis] > clipped.high[axis] {
                return None;
            }
        }
        Some(clipped)
    }
}

/// Centre of the circle through the origin, `u` and `v`, times twice their cross product.
#[inline(always)]
fn numerators(u: [i64; 2], v: [i64; 2]) -> [f64; 2] {
    let (uu, vv) = (u[0] * u[0] + u[1] * u[1], v[0] * v[0] + v[1] * v[1]);
    let largest = u[0].abs().max(u[1].abs()).max(v[0].abs()).max(v[1].abs());
    if largest < SMALL {
        return [(v[1] * uu - u[1] * vv) as f64, (u[0] * vv - v[0] * uu) as f64];
    }
    // Cubes of long sides do not fit into 64 bits.
    let (u, v) = (u.map(i128::from), v.map(i128::from));
    let (uu, vv) = (i128::from(uu), i128::from(vv));
    [(v[1] * uu - u[1] * vv) as f64, (u[0] * vv - v[0] * uu) as f64]
}

#[cfg(test)]
mod tests {
    use super::super::predicates::determinant;
    use super::*;
    use proptest::prelude::*;

    fn site() -> impl Strategy<Value = Site> {
        (1u32..29).prop_flat_map(|bits| [-(1i32 << bits)..1 << bits, -(1i32 << bits)..1 << bits])
    }

    /// A triangle, counter-clockwise, and another site.
    fn four<S: Strategy<Value = Site>>(site: fn() -> S) -> impl Strategy<Value = [Site; 4]> {
        prop::array::uniform4(site()).prop_filter_map("no triangle", turned)
    }

    fn turned([a, b, c, d]: [Site; 4]) -> Option<[Site; 4]> {
        let area = orient(a, b, c);
        let [b, c] = if area > 0 { [b, c] } else { [c, b] };
        (area != 0 && ![a, b, c].contains(&d)).then_some([a, b, c, d])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn answers_as_the_exact_predicate([a, b, c, d] in four(site)) {
            let disc = CircumscribedDisc::around([a, b, c]);
            prop_assert_eq!(disc.holds(d), in_circle(a, b, c, d));
            prop_assert!(!disc.holds(a) && !disc.holds(b) && !disc.holds(c));
        }

        #[test]
        fn positions_are_inside_as_sites_are([a, b, c, d] in four(site)) {
            let (disc, q) = (CircumscribedDisc::around([a, b, c]), FixedPosition::of(d));
            prop_assert_eq!(disc.holds_exactly(q), determinant(a, b, c, d) > 0);
            prop_assert_eq!(disc.holds_position(q), determinant(a, b, c, d) > 0);
        }

        /// A position is a site of a plane 256 times as large.
        #[test]
        fn positions_between_sites_are_inside_exactly(
            sites in prop::array::uniform4(site()).prop_filter_map("no triangle", |[a, b, c, d]| {
                let [a, b, c] = [a, b, c].map(|p| p.map(|v| v >> 9));
                turned([a, b, c, d])
            })
        ) {
            let [a, b, c, d] = sites;
            let q = FixedPosition { x: d[0].into(), y: d[1].into() };
            let [large_a, large_b, large_c] = [a, b, c].map(|p| p.map(|v| v * 256));
            let expected = determinant(large_a, large_b, large_c, d) > 0;
            prop_assert_eq!(CircumscribedDisc::around([a, b, c]).holds_exactly(q), expected);
            prop_assert_eq!(CircumscribedDisc::around([a, b, c]).holds_position(q), expected);
        }

        #[test]
        fn spans_miss_nothing([a, b, c, d] in four(site)) {
            let disc = CircumscribedDisc::around([a, b, c]);
            for p in [a, b, c, d].into_iter().filter(|&p| p != d || disc.holds(p)) {
                for axis in [0, 1] {
                    let other = p[1 - axis];
                    let span = disc.span(axis, other, other).unwrap();
                    prop_assert!(span[0] <= p[axis].into() && i64::from(p[axis]) <= span[1]);
                }
                let window = SiteWindow { low: p, high: p };
                prop_assert_eq!(disc.clip(&window), Some(window));
            }
        }

        /// What is searched beyond the disc costs time, and what is called for in vain costs reading.
        #[test]
        fn spans_and_boxes_are_those_of_the_circle([a, b, c, d] in four(small), high in 0..300i32) {
            let disc = CircumscribedDisc::around([a, b, c]);
            let (centre, radius) = circle([a, b, c]);
            let near = 2.0 + 1e-9 * radius;
            prop_assert!((disc.radius() - radius - 1.0).abs() < 1e-9 * radius, "{} {radius}", disc.radius());
            for axis in [0, 1] {
                let across = [d[1 - axis], d[1 - axis] + high].map(f64::from);
                let gap = (across[0] - centre[1 - axis]).max(centre[1 - axis] - across[1]).max(0.0);
                let half = (radius * radius - gap * gap).max(0.0).sqrt();
                match disc.span(axis, d[1 - axis], d[1 - axis] + high) {
                    None => prop_assert!(gap > radius * (1.0 - 1e-9)),
                    Some(span) => {
                        prop_assert!(gap < radius * (1.0 + 1e-9));
                        // A grazing line is known to half the digits.
                        let near = near + 1e-6 * radius * f64::from(u8::from(half < 1e-3 * radius));
                        prop_assert!((span[0] as f64 - (centre[axis] - half)).abs() < near, "{span:?}");
                        prop_assert!((span[1] as f64 - (centre[axis] + half)).abs() < near, "{span:?}");
                    }
                }
            }
        }

        #[test]
        fn a_disc_lies_in_a_window_that_holds_its_box(
            sites in prop::array::uniform3(small()), off in prop::array::uniform4(-6..6i32)
        ) {
            let Some([a, b, c, _]) = turned([sites[0], sites[1], sites[2], [i32::MAX; 2]]) else {
                return Ok(());
            };
            let (centre, radius) = circle([a, b, c]);
            prop_assume!(radius < 1e6);
            let end = |axis: usize, sign: f64, off: i32| {
                ((centre[axis] + sign * radius).round() as i32) + off
            };
            let window = SiteWindow {
                low: [end(0, -1.0, off[0]), end(1, -1.0, off[1])],
                high: [end(0, 1.0, off[2]), end(1, 1.0, off[3])],
            };
            let room = [-off[0], -off[1], off[2], off[3]].into_iter().min().unwrap();
            if room != 1 {
                prop_assert_eq!(CircumscribedDisc::around([a, b, c]).lies_in(&window), room > 1);
            }
        }
    }

    /// Sites so near that `f64` tells their circle well.
    fn small() -> impl Strategy<Value = Site> {
        [-3_000..3_000i32, -3_000..3_000i32]
    }

    /// Centre and radius by the perpendicular bisectors, from the origin.
    fn circle(corners: [Site; 3]) -> ([f64; 2], f64) {
        let [a, b, c] = corners.map(|p| p.map(f64::from));
        let row = |p: [f64; 2], q: [f64; 2]| {
            let normal = [q[0] - p[0], q[1] - p[1]];
            let middle = [(p[0] + q[0]) / 2.0, (p[1] + q[1]) / 2.0];
            (normal, normal[0] * middle[0] + normal[1] * middle[1])
        };
        let ((u, m), (v, n)) = (row(a, b), row(a, c));
        let area = u[0] * v[1] - u[1] * v[0];
        let centre = [(m * v[1] - n * u[1]) / area, (u[0] * n - v[0] * m) / area];
        (centre, (a[0] - centre[0]).hypot(a[1] - centre[1]))
    }

    /// All four corners of a square lie on one circle, and next to the fourth lies the inside.
    #[test]
    fn positions_are_told_from_the_largest_circle_by_the_smallest_step() {
        for r in [1, 1000, terrane_base::geom::REACH] {
            let disc = CircumscribedDisc::around([[-r, -r], [r, -r], [r, r]]);
            let FixedPosition { x, y } = FixedPosition::of([-r, r]);
            for (east, north) in (-1..=1).flat_map(|e| (-1..=1).map(move |n| (e, n))) {
                let q = FixedPosition { x: x + east, y: y + north };
                let square = i128::from(q.x).pow(2) + i128::from(q.y).pow(2);
                let is_inside = square < 2 * i128::from(x).pow(2);
                assert_eq!(disc.holds_exactly(q), is_inside, "{r} {east} {north}");
                assert_eq!(disc.holds_position(q), is_inside, "{r} {east} {north}");
            }
        }
    }

    #[test]
    fn positions_on_a_circle_do_not_lie_in_it() {
        let mut dice = crate::oracle::Dice(4);
        for _ in 0..20_000 {
            let bits = 1 + dice.below(28);
            let [x, y, east, north] = [0; 4].map(|_| dice.below(1 << bits) + 1);
            // The fourth corner of a rectangle, and a step of 1/256 to and from its middle.
            let disc = CircumscribedDisc::around([[x, y], [x + east, y], [x + east, y + north]]);
            let FixedPosition { x, y } = FixedPosition::of([x, y + north]);
            let inside =
                [-1, 0, 1].map(|step| disc.holds_exactly(FixedPosition { x: x + step, y }));
            assert_eq!(inside, [false, false, true], "{disc:?}");
        }
    }

    /// Of the positions next to a circle some are nearer to it than floats can tell.
    #[test]
    fn positions_beside_large_circles_are_told_exactly() {
        let (mut dice, mut close) = (crate::oracle::Dice(6), [0; 2]);
        for _ in 0..20_000 {
            let mut any = || dice.below(1 << 29) - (1 << 28);
            let corners = [0; 3].map(|_| [any(), any()]);
            let Some([a, b, c, _]) = turned([corners[0], corners[1], corners[2], [i32::MAX; 2]])
            else {
                continue;
            };
            let ([east, north], radius) = circle([a, b, c]);
            let across = f64::from(any()) * 1e-9 * radius;
            let up = (radius * radius - across * across).sqrt();
            let q = FixedPosition::from_steps(east + across, north + up);
            let disc = CircumscribedDisc::around([a, b, c]);
            assert_eq!(disc.holds_position(q), disc.holds_exactly(q));
            let [x, y] = disc.centre_from(q);
            let is_close = disc.within <= x * x + y * y && x * x + y * y <= disc.beyond;
            close[usize::from(disc.holds_exactly(q))] += u32::from(is_close);
        }
        assert!(close.iter().all(|count| *count > 20), "{close:?}");
    }

    #[test]
    fn what_a_window_holds_of_a_disc_is_found_within_few_steps() {
        // A circle of radius 50 around (0, 0).
        let disc = CircumscribedDisc::around([[50, 0], [-30, 40], [-30, -40]]);
        let clip = |low: Site, high: Site| disc.clip(&SiteWindow { low, high });
        assert_eq!(clip([60, -90], [90, 90]), None);
        assert_eq!(clip([-90, 53], [90, 90]), None);
        let whole = clip([-90, -90], [90, 90]).unwrap();
        assert!(whole.low.iter().all(|v| (-53..=-50).contains(v)), "{whole:?}");
        assert!(whole.high.iter().all(|v| (50..=53).contains(v)), "{whole:?}");
        // Beside the centre the circle is 40 high on each side.
        let right = clip([30, -90], [90, 90]).unwrap();
        assert!(right.low[0] == 30 && (50..=53).contains(&right.high[0]), "{right:?}");
        assert!((-43..=-40).contains(&right.low[1]) && (40..=43).contains(&right.high[1]));
        let top = clip([-90, 30], [90, 90]).unwrap();
        assert!(top.low[1] == 30 && (-43..=-40).contains(&top.low[0]), "{top:?}");
    }
}
