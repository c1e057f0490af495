//! Rectangles of positions.

use super::predicates::Site;
use terrane_base::geom::REACH;

/// A rectangle of positions, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SiteWindow {
    /// Lowest x and y.
    pub low: Site,
    /// Highest x and y.
    pub high: Site,
}

impl SiteWindow {
    /// Everything within [`REACH`].
    pub const ALL: Self = Self { low: [-REACH; 2], high: [REACH; 2] };

    /// True when the whole of `other` lies in it.
    #[inline]
    pub fn covers(&self, other: &Self) -> bool {
        (0..2).all(|i| self.low[i] <= other.low[i] && other.high[i] <= self.high[i])
    }

    /// True when the position lies in it.
    #[inline]
    pub fn contains(&self, p: Site) -> bool {
        (0..2).all(|i| (self.low[i]..=self.high[i]).contains(&p[i]))
    }

    /// The smallest window that covers both.
    #[inline]
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|i| self.low[i].min(other.low[i])),
            high: std::array::from_fn(|i| self.high[i].max(other.high[i])),
        }
    }

    /// The intersection of both, if any.
    #[inline]
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let low: Site = std::array::from_fn(|i| self.low[i].max(other.low[i]));
        let high: Site = std::array::from_fn(|i| self.high[i].min(other.high[i]));
        (low[0] <= high[0] && low[1] <= high[1]).then_some(Self { low, high })
    }

    /// Distance of both along the axis where it is larger; 0 if they meet.
    pub fn steps_to(&self, other: &Self) -> i64 {
        let gaps = [0, 1].map(|axis| {
            let before = i64::from(self.low[axis]) - i64::from(other.high[axis]);
            let after = i64::from(other.low[axis]) - i64::from(self.high[axis]);
            before.max(after).max(0)
        });
        gaps[0].max(gaps[1])
    }

    /// The window with `margin` (>= 0) more on each side, within [`REACH`].
    #[inline]
    #[must_use]
    pub fn grown(&self, margin: i32) -> Self {
        Self {
            low: self.low.map(|v| v.saturating_sub(margin).max(-REACH)),
            high: self.high.map(|v| v.saturating_add(margin).min(REACH)),
        }
    }

    /// The smallest window that holds all points; `None` without points.
    pub fn of(points: impl IntoIterator<Item = Site>) -> Option<Self> {
        let each = points.into_iter().map(|p| Self { low: p, high: p });
        each.reduce(|all, one| all.union(&one))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_grow_within_the_reach_and_meet_in_what_both_hold() {
        let window = |low: Site, high: Site| SiteWindow { low, high };
        let (a, b) = (window([0, 10], [20, 30]), window([20, -5], [40, 10]));
        assert_eq!(a.grown(7), window([-7, 3], [27, 37]));
        assert_eq!(window([i32::MIN + 1; 2], [i32::MAX; 2]).grown(9), SiteWindow::ALL);
        assert_eq!(a.intersection(&b), Some(window([20, 10], [20, 10])));
        assert_eq!(a.intersection(&window([21, 0], [40, 90])), None);
        assert_eq!(a.intersection(&window([0, 31], [40, 90])), None);
        assert_eq!(a.union(&b), window([0, -5], [40, 30]));
        let (right, above) = (window([23, 0], [40, 90]), window([30, 35], [40, 90]));
        let apart = [b, right, above].map(|other| (a.steps_to(&other), other.steps_to(&a)));
        assert_eq!(apart, [(0, 0), (3, 3), (10, 10)]);
        assert!(a.contains([0, 30]) && !a.contains([21, 20]) && !a.contains([5, 9]));
        assert!(a.covers(&a) && !a.covers(&a.grown(1)) && a.grown(1).covers(&a));
        assert!(!a.covers(&b) && !a.covers(&window([5, 15], [10, 31])));
    }
}
