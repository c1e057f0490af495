//! Random numbers of a survey.

use crate::hash::mix64;

/// A source of chance that is a pure function of its start.
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

    /// A byte out of the bits drawn last, which need not be drawn for it.
    #[inline(always)]
    pub(super) fn byte(self) -> u8 {
        (self.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8
    }

    /// A number of mean 0 and deviation 1: four even numbers added, so it ends at 3.5.
    #[inline(always)]
    pub(super) fn bell(&mut self) -> f64 {
        let [a, b, c, d] = self.four();
        (a + b + c + d - 2.0) * 1.732_050_807_568_877_2
    }
}
