//! Intervals, and minimum and maximum of two numbers.

/// Margin for the rounding of a product or a quotient.
pub(super) const SURELY: f64 = 1.0 - 1e-14;

/// Maximum of two numbers that are not NaN, as one instruction.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Minimum of two numbers that are not NaN, as one instruction.
#[inline(always)]
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// A closed interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClosedInterval {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl ClosedInterval {
    #[inline(always)]
    pub(super) fn of(value: f64) -> Self {
        Self { low: value, high: value }
    }

    #[inline(always)]
    pub(super) fn join(self, other: Self) -> Self {
        Self { low: smaller(self.low, other.low), high: larger(self.high, other.high) }
    }

    #[inline(always)]
    pub(super) fn minus(self, value: f64) -> Self {
        Self { low: self.low - value, high: self.high - value }
    }

    #[inline(always)]
    pub(super) fn times(self, factor: f64) -> Self {
        let (a, b) = (self.low * factor, self.high * factor);
        Self { low: smaller(a, b), high: larger(a, b) }
    }

    #[inline(always)]
    pub(super) fn plus_range(self, other: Self) -> Self {
        Self { low: self.low + other.low, high: self.high + other.high }
    }

    #[inline(always)]
    pub(super) fn minus_range(self, other: Self) -> Self {
        Self { low: self.low - other.high, high: self.high - other.low }
    }

    /// Product with a non-negative interval.
    #[inline(always)]
    pub(super) fn times_range(self, factor: Self) -> Self {
        let (a, b) = (self.times(factor.low), self.times(factor.high));
        a.join(b)
    }

    /// Largest square.
    #[inline(always)]
    pub(super) fn max_squared(self) -> f64 {
        let most = larger(-self.low, self.high);
        most * most
    }

    /// Largest squared distance of its numbers from 0 to `limit`.
    #[inline(always)]
    pub(super) fn most_over(self, limit: f64) -> f64 {
        let over = larger(larger(-self.low, self.high - limit), 0.0);
        over * over
    }
}

/// Squared distance of `along` from 0 to `limit`.
#[inline(always)]
pub(super) fn over(along: f64, limit: f64) -> f64 {
    let over = larger(larger(-along, along - limit), 0.0);
    over * over
}
