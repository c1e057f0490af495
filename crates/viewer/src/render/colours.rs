//! Colours of a surface, beside its heights.

/// A colour for each pixel of a field: red, green, blue and opacity, in sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelColors {
    width: usize,
    rgba: Vec<[u8; 4]>,
}

impl PixelColors {
    /// For a field of this size, all transparent.
    pub fn none(width: usize, height: usize) -> Self {
        Self { width, rgba: vec![[0; 4]; width * height] }
    }

    /// The colour at (`col`, `row`).
    pub fn at(&self, col: usize, row: usize) -> [u8; 4] {
        self.rgba[row * self.width + col]
    }

    /// Sets a colour of 0 to 255, rounded; NaN is 0.
    pub(crate) fn put(&mut self, col: usize, row: usize, colour: [f64; 4]) {
        self.rgba[row * self.width + col] = colour.map(|value| value.round() as u8);
    }
}
