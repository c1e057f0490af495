//! Points of clouds in whole steps of a frame, and the frame that places them in the world.

use bytemuck::{Pod, Zeroable};

use super::{Decimal, Ruler};

/// A point of a cloud, in steps of its [`Frame`]. The order (x, then y, then z) is the canonical one:
/// wherever a tie must be broken, the lowest point wins.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
pub struct Point {
    /// Steps east of the frame's origin.
    pub x: i32,
    /// Steps north.
    pub y: i32,
    /// Steps up.
    pub z: i32,
}

impl Point {
    /// The point of these steps.
    pub const fn new(x: i32, y: i32, z: i32) -> Self {
        Self { x, y, z }
    }
}

/// Largest magnitude of a coordinate of a [`Point`]: differences stay below 2^30, so orientation is
/// exact in `i64` and in-circle in `i128`.
pub const REACH: i32 = (1 << 29) - 1;

/// Where the points of a cloud lie: world = offset + scale * steps, axis by axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// World units of a step along x, y, z; finite and positive.
    pub scale: [f64; 3],
    /// World position of the origin; finite.
    pub offset: [f64; 3],
}

impl Frame {
    /// World coordinates of a point.
    pub fn world(&self, point: Point) -> [f64; 3] {
        let steps = [point.x, point.y, point.z].map(f64::from);
        std::array::from_fn(|axis| steps[axis] * self.scale[axis] + self.offset[axis])
    }

    /// The steps along an axis.
    pub fn ruler(&self, axis: usize) -> Ruler {
        Ruler::new(self.scale[axis], self.offset[axis])
    }

    /// Position of a world coordinate on `axis`, in steps; whole steps are points, but for rounding.
    pub fn steps(&self, axis: usize, world: f64) -> f64 {
        (world - self.offset[axis]) / self.scale[axis]
    }
}

/// Part of a square that floats do not decide.
const DOUBT: f64 = 1e-9;

/// Whether two points are no farther apart, across, than `most` world units: exactly, where `scale` and
/// `most` are taken for the decimals they are.
pub fn is_within(a: Point, b: Point, scale: [f64; 2], most: f64) -> bool {
    let steps = [i64::from(a.x) - i64::from(b.x), i64::from(a.y) - i64::from(b.y)];
    let [x, y] = [0, 1].map(|axis| steps[axis] as f64 * scale[axis]);
    let (square, limit) = (x * x + y * y, most * most);
    match (square - limit).abs() > DOUBT * limit {
        true => square < limit,
        false => is_within_exactly(steps, scale, most).unwrap_or(square <= limit),
    }
}

/// The same in whole numbers; `None` where there are too many digits.
#[cold]
fn is_within_exactly(steps: [i64; 2], scale: [f64; 2], most: f64) -> Option<bool> {
    let all = [Decimal::of(scale[0])?, Decimal::of(scale[1])?, Decimal::of(most)?];
    let digits = all.iter().map(|number| number.digits()).max()?;
    let square = |number: i128| number.checked_mul(number);
    let along = |axis: usize| square(all[axis].units(digits)?.checked_mul(steps[axis].into())?);
    Some(along(0)?.checked_add(along(1)?)? <= square(all[2].units(digits)?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_many_digits_are_compared_in_floats() {
        // A third of a unit in each step: no decimals that can be counted.
        let (scale, origin) = ([1.0 / 3.0 * 1e-30; 2], Point::new(0, 0, 0));
        let at = |x: i32| is_within(origin, Point::new(x, 0, 0), scale, 3.0 * scale[0]);
        assert_eq!([0, 2, 3, 4].map(at), [true, true, true, false]);
        let third = |x: i32| is_within(origin, Point::new(x, 0, 0), [1.0 / 3.0; 2], 10_000.0);
        assert_eq!([29_999, 30_000, 30_001].map(third), [true, true, false]);
        let wide = |x: i32, most: f64| is_within(origin, Point::new(x, 0, 0), [1.0; 2], most);
        assert!(wide(5, 5.0) && !wide(5, 5.0_f64.next_down()) && wide(5, 1e9) && !wide(5, 0.0));
    }

    #[test]
    fn distances_are_compared_as_decimals() {
        let mut off = 0;
        for k in 1..400 {
            // Three, four, five, turned and in steps of two sizes.
            for (x, y, scale) in
                [(3, 4, [0.01; 2]), (4, 3, [0.001; 2]), (3, 2, [0.01, 0.02]), (0, 5, [0.1; 2])]
            {
                let most: f64 = format!(
                    "{}e-{}",
                    5 * k,
                    if scale[0] == 0.1 {
                        1
                    } else if scale[0] == 0.001 {
                        3
                    } else {
                        2
                    }
                )
                .parse()
                .unwrap();
                let (a, b) = (Point::new(7, -9, 0), Point::new(7 + x * k, -9 - y * k, 99));
                assert!(is_within(a, b, scale, most), "{k} {x} {y}");
                assert!(!is_within(a, b, scale, most.next_down()), "{k} {x} {y}");
                assert!(!is_within(a, Point::new(b.x + 1, b.y, 0), scale, most), "{k} {x} {y}");
                let [x, y] = [f64::from(x * k) * scale[0], f64::from(y * k) * scale[1]];
                off += i32::from(x * x + y * y > most * most);
            }
        }
        assert!(off > 50, "floats alone are wrong in {off}");
    }
}
