//! Extent and scale of a picture.

/// Maximum number of pixels along a side of a picture.
pub const MAX_PICTURE_SIDE: u32 = 16_384;

/// A north-up map of a world rectangle onto pixels. Pixel (0, 0) is the upper left; positions are
/// in pixels, with pixel centres at halves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureFrame {
    /// West, south, east, north, in world units.
    pub bounds: [f64; 4],
    /// Picture columns.
    pub width: u32,
    /// Picture rows.
    pub height: u32,
    /// Units of height per world unit along x and y.
    pub scale: [f64; 2],
}

impl PictureFrame {
    /// A frame around `bounds`, `width` pixels wide, with the aspect kept on the ground: `scale`
    /// is the length of a world unit along x and along y. A picture taller than
    /// [`MAX_PICTURE_SIDE`] is narrowed until it fits. Bounds without extent are given some.
    pub fn fit(bounds: [f64; 4], width: u32, scale: [f64; 2]) -> Self {
        let bounds = with_extent(bounds);
        let ground_x = (bounds[2] - bounds[0]) * scale[0];
        let ground_y = (bounds[3] - bounds[1]) * scale[1];
        let aspect = ground_y / ground_x;
        let aspect = if aspect.is_finite() && aspect > 0.0 { aspect } else { 1.0 };
        let limit = f64::from(MAX_PICTURE_SIDE);
        let wide = f64::from(width).min(limit).min(limit / aspect).round().max(1.0);
        let tall = (wide * aspect).round().clamp(1.0, limit);
        Self { bounds, width: wide as u32, height: tall as u32, scale }
    }

    /// The same rectangle with `factor` times as many pixels each way.
    #[must_use]
    pub fn finer(&self, factor: u32) -> Self {
        Self { width: self.width * factor, height: self.height * factor, ..*self }
    }

    /// World units per pixel along x and y.
    pub fn pixel(&self) -> [f64; 2] {
        let [west, south, east, north] = self.bounds;
        [(east - west) / f64::from(self.width), (north - south) / f64::from(self.height)]
    }

    /// Size of a pixel on the ground, in the unit of heights.
    pub fn ground_pixel(&self) -> [f64; 2] {
        let [x, y] = self.pixel();
        [x * self.scale[0], y * self.scale[1]]
    }

    /// Picture position of a world position.
    pub fn to_picture(&self, x: f64, y: f64) -> [f64; 2] {
        let [px, py] = self.pixel();
        [(x - self.bounds[0]) / px, (self.bounds[3] - y) / py]
    }

    /// World position of a picture position.
    pub fn to_world(&self, col: f64, row: f64) -> [f64; 2] {
        let [px, py] = self.pixel();
        [self.bounds[0] + col * px, self.bounds[3] - row * py]
    }
}

/// Bounds without extent along an axis get some, so that a single row, column or point is visible.
fn with_extent([west, south, east, north]: [f64; 4]) -> [f64; 4] {
    let longest = (east - west).max(north - south);
    let pad = if longest > 0.0 { longest / 64.0 } else { 0.5 };
    let (dx, dy) = (pad_of(east - west, pad), pad_of(north - south, pad));
    [west - dx, south - dy, east + dx, north + dy]
}

fn pad_of(extent: f64, pad: f64) -> f64 {
    if extent > 0.0 { 0.0 } else { pad }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_aspect_on_the_ground() {
        let frame = PictureFrame::fit([0.0, 60.0, 1.0, 61.0], 800, [0.5, 1.0]);
        assert_eq!((frame.width, frame.height), (800, 1600));
        let tall = PictureFrame::fit([0.0, 0.0, 1.0, 100.0], 1600, [1.0, 1.0]);
        assert_eq!((tall.width, tall.height), (164, MAX_PICTURE_SIDE));
        let line = PictureFrame::fit([0.0, 5.0, 64.0, 5.0], 640, [1.0, 1.0]);
        assert_eq!((line.width, line.height), (640, 20));
    }

    #[test]
    fn picture_and_world_are_inverse_and_north_is_up() {
        let frame = PictureFrame::fit([10.0, 20.0, 50.0, 40.0], 400, [1.0, 1.0]);
        assert_eq!(frame.to_picture(10.0, 40.0), [0.0, 0.0]);
        assert_eq!(frame.to_world(400.0, 200.0), [50.0, 20.0]);
    }
}
