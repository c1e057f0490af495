//! Fills a triangle of a surface into a field of heights.

use crate::render::{PictureHeights, PixelColors};

/// Corners closer to a pixel centre than this (relative to the triangle's size) still cover it, so
/// that no pinholes open between neighbours.
const SLACK: f64 = 1e-9;

/// Writes the heights of a triangle at the pixel centres it covers; where another surface is
/// there already, the higher one stays. `corners` are (column, row, height) in picture positions.
/// Triangles that are empty, or not finite, leave no mark. Cost: rows touched + pixels covered.
pub fn fill_triangle(field: &mut PictureHeights, corners: [[f64; 3]; 3]) {
    fill(field, corners, |_, _| ());
}

/// The same of a triangle whose corners have colours (red, green, blue and opacity, 0 to 255), which are
/// interpolated between them (Gouraud 1971), in the space that they are in.
pub fn fill_coloured(
    field: &mut PictureHeights,
    colours: &mut PixelColors,
    corners: [[f64; 3]; 3],
    rgba: [[f64; 4]; 3],
) {
    let planes = [0, 1, 2, 3].map(|channel| {
        PixelPlane::through([0, 1, 2].map(|k| [corners[k][0], corners[k][1], rgba[k][channel]]))
    });
    let [Some(red), Some(green), Some(blue), Some(opacity)] = planes else { return };
    fill(field, corners, |col, row| {
        let (x, y) = (col as f64 + 0.5, row as f64 + 0.5);
        colours.put(col, row, [&red, &green, &blue, &opacity].map(|plane| plane.height(x, y)));
    });
}

/// Fills the heights of a triangle; calls `top` for each pixel where it is the highest surface so far.
fn fill(field: &mut PictureHeights, corners: [[f64; 3]; 3], mut top: impl FnMut(usize, usize)) {
    let Some(plane) = PixelPlane::through(corners) else { return };
    let rows = clip(corners.map(|c| c[1]), field.height);
    for row in rows {
        let y = row as f64 + 0.5;
        let (from, to) = span(&corners, plane.area, y);
        let width = field.width;
        let line = &mut field.z[row * width..(row + 1) * width];
        for col in clip([from, to, to], width) {
            let z = plane.height(col as f64 + 0.5, y) as f32;
            let old = &mut line[col];
            if z.is_finite() && (old.is_nan() || z > *old) {
                *old = z;
                top(col, row);
            }
        }
    }
}

/// Pixels whose centres lie between the smallest and the largest of `positions`.
fn clip(positions: [f64; 3], end: usize) -> std::ops::Range<usize> {
    let low = positions.iter().copied().fold(f64::INFINITY, f64::min);
    let high = positions.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let from = (low - 0.5 - SLACK).ceil().max(0.0);
    let to = (high - 0.5 + SLACK).floor() + 1.0;
    // Casts saturate; an empty range comes of `from >= to`.
    (from as usize).min(end)..(to.max(0.0) as usize).min(end)
}

/// The interval of the horizontal line at `y` in the triangle; empty is (inf, -inf).
fn span(corners: &[[f64; 3]; 3], area: f64, y: f64) -> (f64, f64) {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        // Inside is where s * ((bx-ax)(y-ay) - (by-ay)(x-ax)) >= 0, s the orientation's sign.
        let (dx, dy) = ((b[0] - a[0]) * area.signum(), (b[1] - a[1]) * area.signum());
        if dy > 0.0 {
            to = to.min(a[0] + dx * (y - a[1]) / dy);
        } else if dy < 0.0 {
            from = from.max(a[0] + dx * (y - a[1]) / dy);
        } else if dx * (y - a[1]) < -SLACK * area.abs() {
            return (f64::INFINITY, f64::NEG_INFINITY);
        }
    }
    if from <= to + SLACK { (from, to.max(from)) } else { (f64::INFINITY, f64::NEG_INFINITY) }
}

/// z as a linear function of picture position, relative to a corner.
struct PixelPlane {
    corner: [f64; 3],
    dx: f64,
    dy: f64,
    area: f64,
}

impl PixelPlane {
    fn through([a, b, c]: [[f64; 3]; 3]) -> Option<Self> {
        let (ab, ac) = (sub(b, a), sub(c, a));
        let area = ab[0] * ac[1] - ab[1] * ac[0];
        let dx = (ab[2] * ac[1] - ac[2] * ab[1]) / area;
        let dy = (ac[2] * ab[0] - ab[2] * ac[0]) / area;
        let sound = area != 0.0 && [dx, dy, area, a[2]].iter().all(|v| v.is_finite());
        sound.then_some(Self { corner: a, dx, dy, area })
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        self.corner[2] + self.dx * (x - self.corner[0]) + self.dy * (y - self.corner[1])
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The obvious twin: every pixel, three signs.
    fn fill_slowly(field: &mut PictureHeights, corners: [[f64; 3]; 3]) {
        let Some(plane) = PixelPlane::through(corners) else { return };
        for row in 0..field.height {
            for col in 0..field.width {
                let (x, y) = (col as f64 + 0.5, row as f64 + 0.5);
                let side = |i: usize| {
                    let (a, b) = (corners[i], corners[(i + 1) % 3]);
                    ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) * plane.area.signum()
                };
                if (0..3).all(|i| side(i) >= 0.0) {
                    let old = &mut field.z[row * field.width + col];
                    *old = old.max(plane.height(x, y) as f32);
                }
            }
        }
    }

    fn bits(field: &PictureHeights) -> Vec<u32> {
        field.z.iter().map(|z| z.to_bits()).collect()
    }

    fn corner() -> impl Strategy<Value = [f64; 3]> {
        // Multiples of a quarter make every product exact, so both twins decide edges alike.
        (-40i32..80, -40i32..80, 0i32..9)
            .prop_map(|(x, y, z)| [f64::from(x) / 4.0, f64::from(y) / 4.0, f64::from(z)])
    }

    proptest! {
        #[test]
        fn covers_the_same_pixels_as_its_slow_twin(a in corner(), b in corner(), c in corner()) {
            let (mut fast, mut slow) = (PictureHeights::void(10, 9), PictureHeights::void(10, 9));
            fill_triangle(&mut fast, [a, b, c]);
            fill_slowly(&mut slow, [a, b, c]);
            prop_assert_eq!(bits(&fast), bits(&slow));
        }
    }

    #[test]
    fn colours_are_interpolated_and_the_higher_surface_has_its_own() {
        let (mut field, mut colours) = (PictureHeights::void(4, 4), PixelColors::none(4, 4));
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let ramp = |[x, y]: [f64; 2]| [x * 10.0, y * 10.0, 200.0, 255.0];
        let mut draw = |ids: [usize; 3], z: f64, colour: &dyn Fn([f64; 2]) -> [f64; 4]| {
            let corners = ids.map(|id| [square[id][0], square[id][1], z]);
            fill_coloured(&mut field, &mut colours, corners, ids.map(|id| colour(square[id])));
        };
        draw([0, 1, 2], 0.0, &ramp);
        draw([0, 2, 3], 0.0, &ramp);
        draw([0, 1, 2], -1.0, &|_| [1.0; 4]);
        for (col, row) in (0..16).map(|i| (i % 4, i / 4)) {
            let of = |at: usize| 10 * at as u8 + 5;
            assert_eq!(colours.at(col, row), [of(col), of(row), 200, 255], "{col}, {row}");
        }
        let mut over = |z| {
            let flat = [[0.0, 0.0, z], [9.0, 0.0, z], [0.0, 9.0, z]];
            fill_coloured(&mut field, &mut colours, flat, [[7.0, f64::NAN, 300.0, -4.0]; 3]);
        };
        over(1.0);
        assert_eq!(colours.at(0, 0), [5, 5, 200, 255], "a colour that is no number is not drawn");
    }

    #[test]
    fn wild_corners_do_no_harm() {
        let mut field = PictureHeights::void(4, 4);
        for bad in [f64::NAN, f64::INFINITY, 1e308, -1e308] {
            fill_triangle(&mut field, [[bad, 0.0, 0.0], [0.0, bad, 0.0], [1.0, 1.0, bad]]);
        }
        fill_triangle(&mut field, [[1.0, 1.0, 0.0]; 3]);
        assert!(field.z.iter().all(|z| z.is_nan()));
        fill_triangle(&mut field, [[-1e7, -1e7, 2.0], [1e7, -1e7, 2.0], [0.0, 1e7, 2.0]]);
        assert!(field.z.iter().all(|&z| z == 2.0));
    }
}
