//! What a height becomes in a file that stores it as an f32, relative to a height and in a unit of its
//! own.

/// How heights are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounding {
    /// The height that others are relative to.
    pub origin: f64,
    /// Stored units in one unit of the heights.
    pub scale: f64,
}

impl Rounding {
    /// Relative to `origin`, in the unit of the heights.
    pub fn about(origin: f64) -> Self {
        Self { origin, scale: 1.0 }
    }

    /// The height that is read back for this one, and for itself: where heights are scaled, to come back
    /// rounds once more, which may move what is written next by the last bit of an f32.
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
