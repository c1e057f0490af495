//! Points of point clouds as integers, and the frame that places them in the world.

use std::cmp::Ordering;

use bytemuck::{Pod, Zeroable};

use super::{Decimal, Ruler};

/// A point in steps of its [`PointFrame`]. The order (x, then y, then z) is canonical: ties go to the lowest point.
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
    /// The point with these steps.
    pub const fn new(x: i32, y: i32, z: i32) -> Self {
        Self { x, y, z }
    }
}

/// Largest magnitude of a coordinate of a [`Point`]: differences stay below 2^30, so orientation is
/// exact in `i64` and in-circle in `i128`.
pub const REACH: i32 = (1 << 29) - 1;

/// Scale and offset of a point cloud: world = offset + scale * steps, axis by axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointFrame {
    /// World units of a step along x, y, z; finite and positive.
    pub scale: [f64; 3],
    /// World position of the origin; finite.
    pub offset: [f64; 3],
}

impl PointFrame {
    /// World coordinates of a point.
    #[inline]
    pub fn world(&self, point: Point) -> [f64; 3] {
        let steps = [point.x, point.y, point.z].map(f64::from);
        std::array::from_fn(|axis| steps[axis] * self.scale[axis] + self.offset[axis])
    }

    /// The steps along an axis.
    pub fn ruler(&self, axis: usize) -> Ruler {
        Ruler::new(self.scale[axis], self.offset[axis])
    }

    /// World coordinate to steps on `axis`; integers are points, up to rounding.
    pub fn steps(&self, axis: usize, world: f64) -> f64 {
        (world - self.offset[axis]) / self.scale[axis]
    }
}

/// Fraction of a squared distance within which floats do not decide.
const DOUBT: f64 = 1e-9;

/// Whether the horizontal distance of two points is at most `most` world units: exact, with `scale` and `most` as
/// decimals.
pub fn is_within(a: Point, b: Point, scale: [f64; 2], most: f64) -> bool {
    let steps = [a.x, a.y].map(i64::from);
    let steps = [steps[0] - i64::from(b.x), steps[1] - i64::from(b.y)];
    compared(steps, scale, most, || IntegerSteps::of(scale, most)).is_le()
}

/// A 3D distance, to test many pairs of points for being closer than it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistancePredicate {
    scale: [f64; 3],
    least: f64,
    units: Option<IntegerSteps<3>>,
}

impl DistancePredicate {
    /// A distance of `least` world units, for points with these scales.
    pub fn new(scale: [f64; 3], least: f64) -> Self {
        Self { scale, least, units: IntegerSteps::of(scale, least) }
    }

    /// Whether two points are closer than the distance: exact, with scale and distance as decimals.
    #[inline]
    pub fn is_nearer(&self, a: Point, b: Point) -> bool {
        let steps = [(a.x, b.x), (a.y, b.y), (a.z, b.z)].map(|(a, b)| i64::from(a) - i64::from(b));
        compared(steps, self.scale, self.least, || self.units).is_lt()
    }

    /// The distance, in world units.
    pub fn least(&self) -> f64 {
        self.least
    }

    /// Number of steps along each axis by which closer points differ less.
    pub fn steps(&self) -> [i64; 3] {
        // Plus one, as the quotient is rounded.
        self.scale.map(|step| ((self.least / step).ceil() as i64).saturating_add(1))
    }
}

/// Compares the length of a vector of steps with a length.
#[inline]
fn compared<const N: usize>(
    steps: [i64; N],
    scale: [f64; N],
    length: f64,
    units: impl FnOnce() -> Option<IntegerSteps<N>>,
) -> Ordering {
    // Steps are below 2^33, exact as doubles: what is rounded is some 2^-52 of the square, far below `DOUBT`.
    let square: f64 = (0..N).map(|axis| (steps[axis] as f64 * scale[axis]).powi(2)).sum();
    let limit = length * length;
    match (square - limit).abs() > DOUBT * limit {
        true => square.total_cmp(&limit),
        false => exactly(steps, units()).unwrap_or(square.total_cmp(&limit)),
    }
}

/// The same in integers; `None` if there are too many digits.
#[cold]
fn exactly<const N: usize>(steps: [i64; N], units: Option<IntegerSteps<N>>) -> Option<Ordering> {
    let IntegerSteps { scale, square } = units?;
    let sum = (0..N).try_fold(0_i128, |sum, axis| {
        let along = scale[axis].checked_mul(steps[axis].into())?;
        sum.checked_add(along.checked_mul(along)?)
    });
    Some(sum?.cmp(&square))
}

/// Step sizes and a squared length in integers, in units of their last common decimal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct IntegerSteps<const N: usize> {
    scale: [i128; N],
    square: i128,
}

impl<const N: usize> IntegerSteps<N> {
    fn of(scale: [f64; N], length: f64) -> Option<Self> {
        let length = Decimal::of(length)?;
        let mut all = [length; N];
        for (number, step) in all.iter_mut().zip(scale) {
            *number = Decimal::of(step)?;
        }
        let digits = all.iter().map(|number| number.digits()).fold(length.digits(), u32::max);
        let mut scale = [0; N];
        for (units, number) in scale.iter_mut().zip(all) {
            *units = number.units(digits)?;
        }
        let length = length.units(digits)?;
        Some(Self { scale, square: length.checked_mul(length)? })
    }
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

    #[test]
    fn distances_in_space_are_compared_as_decimals() {
        let mut off = 0;
        for k in 1..400 {
            let least: f64 = format!("{}e-3", 3 * k).parse().unwrap();
            // One, two, two: three. Heights are in finer steps.
            let apart = DistancePredicate::new([0.001, 0.001, 0.0005], least);
            let (a, b) = (Point::new(-5, 6, 7), Point::new(-5 + k, 6 - 2 * k, 7 + 4 * k));
            assert!(!apart.is_nearer(a, b) && !apart.is_nearer(b, a), "{k}");
            assert!(apart.is_nearer(a, Point { z: b.z - 1, ..b }), "{k}");
            assert!(DistancePredicate::new(apart.scale, least.next_up()).is_nearer(a, b), "{k}");
            let steps = apart.steps();
            assert!(
                (0..2).all(|axis| steps[axis] >= i64::from(3 * k)) && steps[2] >= 6 * i64::from(k)
            );
            let square =
                [1.0, 2.0, 2.0].map(|n| (n * f64::from(k) * 0.001).powi(2)).iter().sum::<f64>();
            off += i32::from(square < least * least);
        }
        assert!(off > 50, "floats alone are wrong in {off}");
    }
}
