//! Positions finer than a step: where a surface is asked for.

use super::predicates::Site;

/// Bits of the fraction of a step in a [`FixedPosition`].
pub const FRACTION: u32 = 8;

/// A position in 1/256 steps: whole numbers, so that containment is exact. Magnitudes at most 2^38,
/// that is 2^30 steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FixedPosition {
    /// East, in 1/256 steps.
    pub x: i64,
    /// North, in 1/256 steps.
    pub y: i64,
}

/// Largest magnitude of a coordinate of a [`FixedPosition`].
const FAR: i64 = 1 << 38;

impl FixedPosition {
    /// The position nearest to (`x`, `y`) steps (ties away from zero); those beyond 2^30 steps, which
    /// no point comes near, are moved there, and NaN to the origin.
    pub fn from_steps(x: f64, y: f64) -> Self {
        let [x, y] =
            [x, y].map(|v| ((v * f64::from(1u32 << FRACTION)).round() as i64).clamp(-FAR, FAR));
        Self { x, y }
    }

    /// The position of a site.
    pub fn of(site: Site) -> Self {
        Self { x: i64::from(site[0]) << FRACTION, y: i64::from(site[1]) << FRACTION }
    }

    /// The site at or next to it in the south-west.
    pub fn floor(self) -> Site {
        // At most 2^30 in magnitude.
        [(self.x >> FRACTION) as i32, (self.y >> FRACTION) as i32]
    }

    /// The position in steps, exactly.
    pub fn steps(self) -> [f64; 2] {
        [self.x, self.y].map(|v| v as f64 / f64::from(1u32 << FRACTION))
    }

    /// Offset of a site from this position: below 2^39 in magnitude.
    #[inline(always)]
    pub(super) fn to(self, site: Site) -> SiteOffset {
        let there = Self::of(site);
        SiteOffset([there.x - self.x, there.y - self.y])
    }
}

/// A site as seen from a position, in 1/256 steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SiteOffset(pub(super) [i64; 2]);

impl SiteOffset {
    /// In steps, exactly.
    #[inline]
    pub(super) fn steps(self) -> [f64; 2] {
        self.0.map(|v| v as f64 / f64::from(1u32 << FRACTION))
    }

    /// Squared length; exact, below 2^79.
    #[inline]
    pub(super) fn square(self) -> i128 {
        self.0.iter().map(|&v| i128::from(v) * i128::from(v)).sum()
    }

    /// True when the site is at the position.
    #[inline(always)]
    pub(super) fn is_zero(self) -> bool {
        self.0 == [0, 0]
    }

    /// Twice the signed area of (position, self, other); exact, below 2^80.
    #[inline(always)]
    pub(super) fn cross(self, other: Self) -> i128 {
        let ([ux, uy], [vx, vy]) = (self.0, other.0);
        i128::from(ux) * i128::from(vy) - i128::from(uy) * i128::from(vx)
    }

    /// True when the position, moved by an infinitesimal to the east and one infinitely smaller to
    /// the north (to the west and south for `back`), lies left of the line from self to other. The
    /// two sites must differ; then no position is on any line.
    #[inline(always)]
    pub(super) fn sees_left(self, other: Self, back: bool) -> bool {
        let cross = self.cross(other);
        if cross != 0 {
            return cross > 0;
        }
        let ([ux, uy], [vx, vy]) = (self.0, other.0);
        // The cross product changes by (uy - vy) for the step east, and by (vx - ux) for that north.
        let change = if uy != vy { uy - vy } else { vx - ux };
        (change > 0) != back
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_to_the_nearest_and_floors_to_the_south_west() {
        let p = FixedPosition::from_steps(1.5, -0.25);
        assert_eq!((p.x, p.y, p.floor()), (384, -64, [1, -1]));
        let far = FixedPosition::from_steps(f64::NAN, f64::INFINITY);
        assert_eq!((far.x, far.y), (0, FAR));
        assert_eq!(FixedPosition::of([3, -2]).floor(), [3, -2]);
    }

    #[test]
    fn a_position_on_a_line_is_moved_off_it() {
        let q = FixedPosition::of([0, 0]);
        let arms = |a: Site, b: Site| (q.to(a), q.to(b));
        let (a, b) = arms([-1, 0], [1, 0]);
        assert!(a.sees_left(b, false) && !b.sees_left(a, false) && !a.sees_left(b, true));
        let (a, b) = arms([0, -1], [0, 1]);
        assert!(!a.sees_left(b, false) && b.sees_left(a, false) && a.sees_left(b, true));
    }
}
