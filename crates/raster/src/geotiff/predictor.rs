//! TIFF predictors, decoding: TIFF 6.0 section 14 (horizontal) and Adobe's TIFF Technical Note 3 (floating
//! point).

#[cfg(all(target_arch = "aarch64", target_endian = "little"))]
mod neon;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(all(target_arch = "aarch64", target_endian = "little"))]
use neon as vectors;
#[cfg(target_arch = "x86_64")]
use x86 as vectors;

use terrane_base::error::{Error, Result};

use super::ifd::ByteOrder;

/// Samples at a time in vectors.
const LANES: usize = 16;

/// Predictor applied before compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    None,
    /// Differences of neighbouring samples as integers.
    Horizontal,
    /// Bytes of a row ordered by significance, then differences of neighbouring bytes.
    Float,
}

impl Predictor {
    /// From the value of the Predictor tag.
    pub(super) fn from_code(code: u64) -> Result<Self> {
        match code {
            1 => Ok(Self::None),
            2 => Ok(Self::Horizontal),
            3 => Ok(Self::Float),
            _ => Err(Error::unsupported(format!("predictor {code} is not supported")).remedy(
                "rewrite the file: gdal_translate -co COMPRESS=DEFLATE -co PREDICTOR=1 IN OUT",
            )),
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Horizontal => "horizontal (2)",
            Self::Float => "floating point (3)",
        }
    }
}

/// Converts samples of `size` bytes in `order` to native byte order, in place.
pub(super) fn to_native(bytes: &mut [u8], size: usize, order: ByteOrder) {
    if order == ByteOrder::NATIVE {
        return;
    }
    match size {
        2 => reverse_each::<2>(bytes),
        4 => reverse_each::<4>(bytes),
        8 => reverse_each::<8>(bytes),
        _ => {}
    }
}

fn reverse_each<const N: usize>(bytes: &mut [u8]) {
    bytes.as_chunks_mut::<N>().0.iter_mut().for_each(|sample| sample.reverse());
}

/// Undoes the horizontal predictor in one row of native samples of `size` bytes, with `stride` samples per
/// pixel.
pub(super) fn undo_horizontal(row: &mut [u8], size: usize, stride: usize) {
    match size {
        1 => add_left(
            row.as_chunks_mut::<1>().0,
            stride,
            u8::from_ne_bytes,
            u8::wrapping_add,
            u8::to_ne_bytes,
        ),
        2 => add_left(
            row.as_chunks_mut::<2>().0,
            stride,
            u16::from_ne_bytes,
            u16::wrapping_add,
            u16::to_ne_bytes,
        ),
        4 => add_left(
            row.as_chunks_mut::<4>().0,
            stride,
            u32::from_ne_bytes,
            u32::wrapping_add,
            u32::to_ne_bytes,
        ),
        _ => add_left(
            row.as_chunks_mut::<8>().0,
            stride,
            u64::from_ne_bytes,
            u64::wrapping_add,
            u64::to_ne_bytes,
        ),
    }
}

#[inline(always)]
fn add_left<T: Copy, const N: usize>(
    row: &mut [[u8; N]],
    stride: usize,
    read: impl Fn([u8; N]) -> T,
    add: impl Fn(T, T) -> T,
    write: impl Fn(T) -> [u8; N],
) {
    if stride == 1 {
        let Some((first, rest)) = row.split_first_mut() else { return };
        let mut sum = read(*first);
        for sample in rest {
            sum = add(sum, read(*sample));
            *sample = write(sum);
        }
    } else {
        for i in stride..row.len() {
            row[i] = write(add(read(row[i]), read(row[i - stride])));
        }
    }
}

/// Undoes the floating point predictor in one row: `coded` contains `stride` interleaved bands of samples of
/// `size` bytes, `out` receives band `band` in native byte order. `coded` is overwritten.
pub(super) fn undo_float(
    coded: &mut [u8],
    out: &mut [u8],
    size: usize,
    stride: usize,
    band: usize,
) {
    match (size, stride) {
        (2, 1) => planes_to_samples::<2>(coded, out),
        (4, 1) => planes_to_samples::<4>(coded, out),
        (8, 1) => planes_to_samples::<8>(coded, out),
        _ => {
            for i in stride..coded.len() {
                coded[i] = coded[i].wrapping_add(coded[i - stride]);
            }
            gather_planes(coded, out, size, stride, band);
        }
    }
}

/// One band: the running sum over the row is split into one chain per byte plane, computed in parallel; each
/// starts from the total of the preceding planes.
fn planes_to_samples<const N: usize>(coded: &[u8], out: &mut [u8]) {
    let width = coded.len() / N;
    let planes: [&[u8]; N] = std::array::from_fn(|k| &coded[k * width..(k + 1) * width]);
    let mut sums = [0_u8; N];
    for k in 1..N {
        sums[k] = planes[k - 1].iter().fold(sums[k - 1], |sum, b| sum.wrapping_add(*b));
    }
    let done = merge_in_vectors(&planes, &mut sums, out);
    for (i, sample) in out.as_chunks_mut::<N>().0.iter_mut().enumerate().take(width).skip(done) {
        for k in 0..N {
            sums[k] = sums[k].wrapping_add(planes[k][i]);
        }
        *sample = big_to_native(sums);
    }
}

/// Undoes the predictor for the first samples where the processor has instructions for it; returns how many are done.
fn merge_in_vectors<const N: usize>(
    planes: &[&[u8]; N],
    sums: &mut [u8; N],
    out: &mut [u8],
) -> usize {
    #[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_endian = "little")))]
    if let (Ok(planes), Ok(sums)) = (planes[..].try_into(), (&mut sums[..]).try_into()) {
        return vectors::merge_planes(planes, sums, out);
    }
    let _ = (planes, sums, out);
    0
}

/// Undoes the predictor for the first samples of a row, a multiple of [`LANES`], and returns how many. `planes` are the
/// bytes of the row by significance, highest first, `sums` the running sums before each, which then include the samples
/// done. `add` gives running sums and the last of them; `samples` joins the bytes of samples.
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_endian = "little")))]
#[inline(always)]
fn merge_planes(
    planes: [&[u8]; 4],
    sums: &mut [u8; 4],
    out: &mut [u8],
    add: impl Fn([u8; LANES], u8) -> ([u8; LANES], u8),
    samples: impl Fn([[u8; LANES]; 4]) -> [u8; 4 * LANES],
) -> usize {
    let planes = planes.map(|plane| plane.as_chunks::<LANES>().0);
    let out = out.as_chunks_mut::<{ 4 * LANES }>().0;
    let count = planes.iter().map(|plane| plane.len()).fold(out.len(), usize::min);
    for (at, out) in out[..count].iter_mut().enumerate() {
        let mut bytes = [[0; LANES]; 4];
        for ((plane, sum), bytes) in planes.iter().zip(&mut *sums).zip(&mut bytes) {
            (*bytes, *sum) = add(plane[at], *sum);
        }
        *out = samples(bytes);
    }
    count * LANES
}

fn gather_planes(planes: &[u8], out: &mut [u8], size: usize, stride: usize, band: usize) {
    let row = planes.len() / size;
    for (i, sample) in out.chunks_exact_mut(size).enumerate() {
        for (k, byte) in sample.iter_mut().enumerate() {
            let plane = if cfg!(target_endian = "big") { k } else { size - 1 - k };
            *byte = planes[plane * row + i * stride + band];
        }
    }
}

/// Big-endian to native byte order.
#[inline(always)]
fn big_to_native<const N: usize>(mut sample: [u8; N]) -> [u8; N] {
    if cfg!(target_endian = "little") {
        sample.reverse();
    }
    sample
}

/// Copies band `band` out of `row`, with `stride` interleaved bands of samples of `size` bytes.
pub(super) fn gather_band(row: &[u8], out: &mut [u8], size: usize, stride: usize, band: usize) {
    let pixels = row.chunks_exact(size * stride);
    for (sample, pixel) in out.chunks_exact_mut(size).zip(pixels) {
        sample.copy_from_slice(&pixel[band * size..][..size]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The slow twin of both predictors, after libtiff's description: differences forward.
    fn horizontal_differences(samples: &[u64], size: usize, stride: usize) -> Vec<u8> {
        let mask = if size == 8 { u64::MAX } else { (1 << (8 * size)) - 1 };
        let difference = |i: usize| match i.checked_sub(stride) {
            Some(left) => samples[i].wrapping_sub(samples[left]) & mask,
            None => samples[i] & mask,
        };
        (0..samples.len()).flat_map(|i| native(difference(i), size)).collect()
    }

    fn native(value: u64, size: usize) -> Vec<u8> {
        let mut bytes = value.to_le_bytes()[..size].to_vec();
        if cfg!(target_endian = "big") {
            bytes.reverse();
        }
        bytes
    }

    fn float_differences(samples: &[u64], size: usize, stride: usize) -> Vec<u8> {
        let plane = |k: usize| samples.iter().map(move |s| (s >> (8 * (size - 1 - k))) as u8);
        let sorted: Vec<u8> = (0..size).flat_map(plane).collect();
        let left = |i: usize| i.checked_sub(stride).map_or(0, |j| sorted[j]);
        (0..sorted.len()).map(|i| sorted[i].wrapping_sub(left(i))).collect()
    }

    proptest! {
        #[test]
        fn horizontal_inverts_the_differences(
            samples in prop::collection::vec(any::<u64>(), 1..60),
            size in prop::sample::select(vec![1_usize, 2, 4, 8]), stride in 1_usize..4,
        ) {
            let pixels = samples.len() / stride;
            let samples = &samples[..pixels * stride];
            let mut row = horizontal_differences(samples, size, stride);
            undo_horizontal(&mut row, size, stride);
            let expected: Vec<u8> = samples.iter().flat_map(|s| native(*s, size)).collect();
            prop_assert_eq!(row, expected);
        }

        #[test]
        fn float_inverts_the_differences(
            samples in prop::collection::vec(any::<u64>(), 1..150),
            size in prop::sample::select(vec![2_usize, 4, 8]), stride in 1_usize..4,
        ) {
            let pixels = samples.len() / stride;
            let samples = &samples[..pixels * stride];
            for band in 0..stride {
                let mut coded = float_differences(samples, size, stride);
                let mut out = vec![0; pixels * size];
                undo_float(&mut coded, &mut out, size, stride, band);
                let of_band = samples.iter().skip(band).step_by(stride);
                let expected: Vec<u8> = of_band.flat_map(|s| native(*s, size)).collect();
                prop_assert_eq!(out, expected);
            }
        }

        #[test]
        fn swapping_twice_changes_nothing(
            bytes in prop::collection::vec(any::<u8>(), 0..64),
            size in prop::sample::select(vec![1_usize, 2, 4, 8]),
        ) {
            let other = match ByteOrder::NATIVE {
                ByteOrder::Little => ByteOrder::Big,
                ByteOrder::Big => ByteOrder::Little,
            };
            let mut swapped = bytes.clone();
            to_native(&mut swapped, size, other);
            if size > 1 && bytes.len() >= size {
                prop_assert_eq!(swapped[0], bytes[size - 1]);
            }
            to_native(&mut swapped, size, other);
            prop_assert_eq!(swapped, bytes);
        }
    }
}
