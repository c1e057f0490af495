//! Rounding without calls: `floor` is one for machines without an instruction for it.

/// The largest whole number that is not larger.
#[inline]
pub fn floored(value: f64) -> i64 {
    let towards_zero = value as i64;
    towards_zero - i64::from(towards_zero as f64 > value)
}
