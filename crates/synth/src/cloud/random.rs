//! Random numbers of a survey.

use crate::hash::mix64;

/// Random numbers that are a pure function of the start value.
#[derive(Clone, Copy)]
pub(super) struct PulseRandom(pub(super) u64);

impl PulseRandom {
    #[inline(always)]
    pub(super) fn bits(&mut self) -> u64 {
        self.0 = mix64(self.0);
        self.0
    }

    /// Four numbers from 0 up to 1, of 16 bits each.
    #[inline(always)]
    pub(super) fn four(&mut self) -> [f64; 4] {
        let bits = self.bits();
        [0, 16, 32, 48].map(|at| f64::from((bits >> at) as u16) * (1.0 / 65_536.0))
    }

    /// A byte from the bits drawn last, without drawing new ones.
    #[inline(always)]
    pub(super) fn byte(self) -> u8 {
        (self.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8
    }

    /// A number of mean 0 and standard deviation 1: the sum of four uniform numbers, at most 3.5.
    #[inline(always)]
    pub(super) fn bell(&mut self) -> f64 {
        let [a, b, c, d] = self.four();
        (a + b + c + d - 2.0) * 1.732_050_807_568_877_2
    }
}
