//! Rounding of heights in files that store them as `f32` relative to an origin, with a scale.

/// Storage of heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightQuantization {
    /// Origin of stored heights.
    pub origin: f64,
    /// Stored units per unit of the heights.
    pub scale: f64,
}

impl HeightQuantization {
    /// Relative to `origin`, with a scale of 1.
    pub fn about(origin: f64) -> Self {
        Self { origin, scale: 1.0 }
    }

    /// The height that is read back for a stored height. With a scale, storing the result again may change its last
    /// bit.
    #[inline(always)]
    pub fn apply(self, height: f64) -> f64 {
        let once = self.once(height);
        if self.scale == 1.0 { once } else { self.once(once) }
    }

    #[inline(always)]
    fn once(self, height: f64) -> f64 {
        self.origin + f64::from(((height - self.origin) * self.scale) as f32) / self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_read_back_is_written_as_it_is() {
        let feet = HeightQuantization { origin: 5e5, scale: 0.3048 };
        // A millimetre from the origin an f32 is as fine as the height itself.
        let near = (1..20_000).map(|i| 5e5 + f64::from(i) * 1.234_567e-7);
        for height in near.chain((0..20_000).map(|i| 4e5 + f64::from(i) * 17.123_456_7)) {
            for rounding in [feet, HeightQuantization::about(0.0), HeightQuantization::about(5e5)] {
                let read = rounding.apply(height);
                assert!((read - height).abs() <= 1e-6 * height, "{read} {height}");
                assert_eq!(rounding.apply(read), read);
            }
        }
        assert_eq!(
            HeightQuantization::about(0.5).apply(0.5 + 1.0 / 3.0),
            0.5 + f64::from(1.0_f32 / 3.0)
        );
    }
}
