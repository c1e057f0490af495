//! The floating point predictor of single precision in vectors of 16 bytes, for NEON, which every aarch64 processor has.

#![allow(unsafe_code)]

use std::arch::aarch64::*;

use super::LANES;

/// See [`merge_planes`](super::merge_planes).
pub(super) fn merge_planes(planes: [&[u8]; 4], sums: &mut [u8; 4], out: &mut [u8]) -> usize {
    // SAFETY: NEON is part of aarch64.
    unsafe { merge(planes, sums, out) }
}

#[target_feature(enable = "neon")]
fn merge(planes: [&[u8]; 4], sums: &mut [u8; 4], out: &mut [u8]) -> usize {
    super::merge_planes(planes, sums, out, |coded, sum| add(coded, sum), |planes| samples(planes))
}

/// Each byte plus all before it and the sum before the first; and the sum after the last.
#[inline]
#[target_feature(enable = "neon")]
fn add(coded: [u8; LANES], sum: u8) -> ([u8; LANES], u8) {
    let (coded, zero) = (bytemuck::cast(coded), vdupq_n_u8(0));
    let sums = vaddq_u8(coded, vextq_u8::<15>(zero, coded));
    let sums = vaddq_u8(sums, vextq_u8::<14>(zero, sums));
    let sums = vaddq_u8(sums, vextq_u8::<12>(zero, sums));
    let sums = vaddq_u8(sums, vextq_u8::<8>(zero, sums));
    (bytemuck::cast(vaddq_u8(sums, vdupq_n_u8(sum))), sum.wrapping_add(vaddvq_u8(coded)))
}

/// Little-endian samples of their bytes, the highest first.
#[inline]
#[target_feature(enable = "neon")]
fn samples(planes: [[u8; LANES]; 4]) -> [u8; 4 * LANES] {
    let [high, second, third, low] = planes.map(bytemuck::cast);
    let pairs = |low, high| {
        [vzip1q_u8(low, high), vzip2q_u8(low, high)].map(|pairs| vreinterpretq_u16_u8(pairs))
    };
    let (lower, upper) = (pairs(low, third), pairs(second, high));
    bytemuck::cast([
        vzip1q_u16(lower[0], upper[0]),
        vzip2q_u16(lower[0], upper[0]),
        vzip1q_u16(lower[1], upper[1]),
        vzip2q_u16(lower[1], upper[1]),
    ])
}
