//! Numbers as short texts, and back.
//!
//! An array of `u32` becomes: differences to the value before (if requested) modulo 2^32, zigzag, four
//! planes of bytes from the lowest to the highest, zlib, base64. A page undoes it with what browsers have.
//!
//! Codes stay below 2^24, which 32-bit floats hold: the graphics card gets what was written, and a lattice is exact.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Codes stay below this, so that 32-bit floats hold each of them.
pub const MAX_CODE: u32 = (1 << 24) - 1;

/// An array, ready to be put into a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedArray {
    /// Values.
    pub count: usize,
    /// True if differences are stored.
    pub differences: bool,
    /// Base64 of zlib.
    pub text: String,
}

impl PackedArray {
    /// Values that are near to those before them.
    pub fn steps(values: &[u32]) -> Self {
        let mut before = 0;
        let differences =
            values.iter().map(|value| value.wrapping_sub(std::mem::replace(&mut before, *value)));
        Self::of(differences.map(zigzag).collect(), true)
    }

    /// Signed values that are small, or repeat: as they are.
    pub fn signed(values: impl Iterator<Item = i32>) -> Self {
        Self::of(values.map(|value| zigzag(value as u32)).collect(), false)
    }

    /// Floats, bit for bit.
    pub fn floats(values: &[f32]) -> Self {
        Self::of(values.iter().map(|value| zigzag(value.to_bits())).collect(), false)
    }

    fn of(words: Vec<u32>, differences: bool) -> Self {
        let mut planes = Vec::with_capacity(words.len() * 4);
        // Bytes of one weight beside each other: the high ones, nearly all 0, deflate to nothing.
        for shift in [0, 8, 16, 24] {
            planes.extend(words.iter().map(|word| (word >> shift) as u8));
        }
        let count = words.len();
        drop(words);
        let mut deflate = flate2::Compress::new(flate2::Compression::default(), true);
        // Incompressible data grows by five bytes for each 16 KiB, and a few around all.
        let mut bytes = Vec::with_capacity(planes.len() + planes.len() / 1024 + 1024);
        let done = deflate.compress_vec(&planes, &mut bytes, flate2::FlushCompress::Finish);
        debug_assert!(matches!(done, Ok(flate2::Status::StreamEnd)));
        Self { count, differences, text: STANDARD.encode(bytes) }
    }

    /// The values as a page finds them; `None` for a text that was not made here.
    pub fn unpack(&self) -> Option<Vec<u32>> {
        let bytes = STANDARD.decode(&self.text).ok()?;
        // The buffer does not grow: one byte more than expected shows that a text holds too much.
        let mut planes = Vec::with_capacity(self.count * 4 + 1);
        let mut inflate = flate2::Decompress::new(true);
        inflate.decompress_vec(&bytes, &mut planes, flate2::FlushDecompress::Finish).ok()?;
        if planes.len() != self.count * 4 {
            return None;
        }
        let words = (0..self.count).map(|i| {
            let bytes =
                (0..4).map(|plane| u32::from(planes[plane * self.count + i]) << (8 * plane));
            unzigzag(bytes.sum())
        });
        if !self.differences {
            return Some(words.collect());
        }
        let values = words.scan(0u32, |value, difference| {
            *value = value.wrapping_add(difference);
            Some(*value)
        });
        Some(values.collect())
    }
}

/// Signed numbers near zero as small ones.
fn zigzag(value: u32) -> u32 {
    (value << 1) ^ (((value as i32) >> 31) as u32)
}

fn unzigzag(value: u32) -> u32 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

/// Coordinates along one axis as whole numbers: `low + code * step`.
#[derive(Clone, Debug, PartialEq)]
pub struct QuantizedAxis {
    /// The lowest coordinate.
    pub low: f64,
    /// One step of the codes.
    pub step: f64,
    /// One code per coordinate, at most [`MAX_CODE`].
    pub codes: Vec<u32>,
    /// The largest distance of a coordinate from the one its code stands for; 0 where all are exact.
    pub rounding: f64,
}

impl QuantizedAxis {
    /// Codes of finite coordinates. The step is the finest power of two that [`MAX_CODE`] allows, times
    /// the greatest divisor of all codes: a lattice of whole steps gets its columns and is exact.
    pub fn of(values: &[f64]) -> Self {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let range = high - low;
        if !(range > 0.0 && range.is_finite()) {
            let low = if low.is_finite() { low } else { 0.0 };
            return Self { low, step: 1.0, codes: vec![0; values.len()], rounding: 0.0 };
        }
        let fine = power_above(range / f64::from(MAX_CODE));
        let steps = values.iter().map(|value| ((value - low) / fine).round());
        let codes = steps.map(|step| step.min(f64::from(MAX_CODE)) as u32).collect();
        let axis = Self::shortened(low, fine, codes);
        Self { rounding: axis.max_distance(values), ..axis }
    }

    /// The largest distance of a coordinate from the one its code stands for.
    pub(crate) fn max_distance(&self, values: &[f64]) -> f64 {
        let pairs = values.iter().zip(&self.codes);
        pairs.map(|(value, code)| (value - self.at(*code)).abs()).fold(0.0, f64::max)
    }

    /// Codes of whole steps that are `scale` long and counted from `offset`: exact where they span no more than
    /// [`MAX_CODE`], else within half of the fewest steps together that do.
    pub fn of_steps(steps: &[i32], scale: f64, offset: f64) -> Self {
        let ends = steps.iter().fold(None, |ends: Option<[i32; 2]>, step| match ends {
            Some([low, high]) => Some([low.min(*step), high.max(*step)]),
            None => Some([*step; 2]),
        });
        let [lowest, highest] = ends.unwrap_or_default();
        let together = u64::from(highest.abs_diff(lowest).div_ceil(MAX_CODE).max(1));
        let distances = steps.iter().map(|step| u64::from(step.abs_diff(lowest)));
        let codes: Vec<u32> =
            distances.clone().map(|d| ((d + together / 2) / together) as u32).collect();
        let errors =
            distances.zip(&codes).map(|(d, code)| (u64::from(*code) * together).abs_diff(d));
        let rounding = errors.max().unwrap_or(0) as f64 * scale;
        let low = f64::from(lowest) * scale + offset;
        Self { rounding, ..Self::shortened(low, scale * together as f64, codes) }
    }

    /// Codes of `fine` steps by their greatest common divisor.
    fn shortened(low: f64, fine: f64, mut codes: Vec<u32>) -> Self {
        let divisor = codes.iter().fold(0, |d, code| gcd(*code, d)).max(1);
        codes.iter_mut().for_each(|code| *code /= divisor);
        Self { low, step: fine * f64::from(divisor), codes, rounding: 0.0 }
    }

    /// The coordinate that a code stands for.
    pub fn at(&self, code: u32) -> f64 {
        self.low + f64::from(code) * self.step
    }
}

/// The smallest power of two that is not below `minimum`.
fn power_above(minimum: f64) -> f64 {
    // The logarithm rounds, so that the power may come out too low.
    let mut power = minimum.log2().ceil().exp2();
    while power < minimum {
        power *= 2.0;
    }
    power
}

fn gcd(a: u32, b: u32) -> u32 {
    let (mut a, mut b) = (a, b);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_lattice_is_exact_and_its_codes_are_its_columns() {
        let axis = QuantizedAxis::of(&[4_745_030.0, 4_745_000.0, 4_745_070.0]);
        assert_eq!((axis.low, axis.step, axis.rounding), (4_745_000.0, 10.0, 0.0));
        assert_eq!(axis.codes, [3, 0, 7]);
        for same in [&[7.5, 7.5][..], &[]] {
            let axis = QuantizedAxis::of(same);
            assert_eq!((axis.codes.len(), axis.step, axis.rounding), (same.len(), 1.0, 0.0));
        }
    }

    #[test]
    fn steps_of_hundredths_are_the_codes() {
        let axis = QuantizedAxis::of_steps(&[702, 500, 500 + MAX_CODE as i32], 0.01, 6_000_000.0);
        assert_eq!((axis.low, axis.step, axis.rounding), (6_000_005.0, 0.01, 0.0));
        assert_eq!(axis.codes, [202, 0, MAX_CODE]);
        let axis = QuantizedAxis::of_steps(&[0, 1, 2 * MAX_CODE as i32], 1.0, 0.0);
        assert_eq!((axis.step, axis.rounding, axis.codes), (2.0, 1.0, vec![0, 1, MAX_CODE]));
        assert!(QuantizedAxis::of_steps(&[], 1.0, 0.0).codes.is_empty());
        let tens = QuantizedAxis::of_steps(&[-30, 0, 70], 1.0, 0.0);
        assert_eq!((tens.low, tens.step, tens.codes), (-30.0, 10.0, vec![0, 3, 10]));
    }

    #[test]
    fn what_repeats_is_short() {
        let packed = PackedArray::steps(&(0..1_000_000).collect::<Vec<u32>>());
        assert!(packed.text.len() < 10_000, "{}", packed.text.len());
        assert_eq!(packed.unpack().unwrap()[999_999], 999_999);
        let broken = PackedArray { count: 7, ..packed };
        assert_eq!(broken.unpack(), None);
    }

    proptest! {
        #[test]
        fn numbers_come_back(values in prop::collection::vec(any::<u32>(), 0..3000)) {
            prop_assert_eq!(PackedArray::steps(&values).unpack().unwrap(), values.clone());
            let signed = PackedArray::signed(values.iter().map(|v| *v as i32)).unpack().unwrap();
            prop_assert_eq!(signed, values.clone());
            let floats: Vec<f32> = values.iter().map(|v| f32::from_bits(*v)).collect();
            prop_assert_eq!(PackedArray::floats(&floats).unpack().unwrap(), values);
        }

        #[test]
        fn steps_are_exact_within_the_codes_and_else_within_half_of_those_together(
            steps in prop::collection::vec(any::<i32>(), 1..300),
            shift in 0u32..32,
        ) {
            let steps: Vec<i32> = steps.iter().map(|step| step >> shift).collect();
            let axis = QuantizedAxis::of_steps(&steps, 0.5, -3.0);
            let span = steps.iter().max().unwrap().abs_diff(*steps.iter().min().unwrap());
            prop_assert_eq!(axis.rounding == 0.0, span <= MAX_CODE || {
                let together = span.div_ceil(MAX_CODE);
                steps.iter().all(|step| step.abs_diff(*steps.iter().min().unwrap()) % together == 0)
            });
            prop_assert!(axis.rounding <= f64::from(span.div_ceil(MAX_CODE)) / 4.0);
            for (step, code) in steps.iter().zip(&axis.codes) {
                prop_assert!(*code <= MAX_CODE);
                prop_assert!((axis.at(*code) - (f64::from(*step) * 0.5 - 3.0)).abs() <= axis.rounding);
            }
        }

        #[test]
        fn coordinates_are_within_half_a_step(values in prop::collection::vec(-1e7..1e7f64, 2..300)) {
            let axis = QuantizedAxis::of(&values);
            let range = values.iter().fold(f64::MIN, |a, b| a.max(*b)) - axis.low;
            prop_assert!(axis.rounding <= range / f64::from(MAX_CODE) * 1.000_001);
            for (value, code) in values.iter().zip(&axis.codes) {
                prop_assert!(*code <= MAX_CODE);
                prop_assert!((axis.at(*code) - value).abs() <= axis.rounding);
            }
        }
    }
}
