//! TIFF predictors, encoding: TIFF 6.0 section 14 (horizontal) and Adobe's TIFF Technical Note 3 (floating
//! point).

/// Replaces each little-endian sample of `size` bytes in `row` by the difference from its predecessor.
pub(super) fn horizontal(row: &mut [u8], size: usize) {
    match size {
        1 => differences(row, |b: [u8; 1]| u8::from_le_bytes(b), u8::wrapping_sub, u8::to_le_bytes),
        2 => differences(row, u16::from_le_bytes, u16::wrapping_sub, u16::to_le_bytes),
        4 => differences(row, u32::from_le_bytes, u32::wrapping_sub, u32::to_le_bytes),
        _ => differences(row, u64::from_le_bytes, u64::wrapping_sub, u64::to_le_bytes),
    }
}

#[inline(always)]
fn differences<T: Copy, const N: usize>(
    row: &mut [u8],
    read: impl Fn([u8; N]) -> T,
    less: impl Fn(T, T) -> T,
    write: impl Fn(T) -> [u8; N],
) {
    let Some((first, rest)) = row.as_chunks_mut::<N>().0.split_first_mut() else { return };
    let mut left = read(*first);
    for sample in rest {
        let value = read(*sample);
        *sample = write(less(value, left));
        left = value;
    }
}

/// Reorders the bytes of the little-endian samples in `row` by significance, highest first, and replaces each
/// byte by the difference from its predecessor. `scratch` is a reusable buffer.
pub(super) fn float(row: &mut [u8], size: usize, scratch: &mut Vec<u8>) {
    let width = row.len() / size;
    scratch.clear();
    for plane in 0..size {
        scratch.extend(row.iter().skip(size - 1 - plane).step_by(size).take(width));
    }
    let mut left = 0;
    for (out, byte) in row.iter_mut().zip(scratch.iter()) {
        *out = byte.wrapping_sub(left);
        left = *byte;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The slow twin, after TIFF's description, by arithmetic on whole numbers.
    fn naive_horizontal(row: &[u8], size: usize) -> Vec<u8> {
        let value =
            |sample: &[u8]| sample.iter().rev().fold(0_u128, |v, b| v << 8 | u128::from(*b));
        let values: Vec<u128> = row.chunks(size).map(value).collect();
        let modulus = 1_u128 << (8 * size);
        let left = |i: usize| if i == 0 { 0 } else { values[i - 1] };
        let coded = (0..values.len()).map(|i| (values[i] + modulus - left(i)) % modulus);
        coded.flat_map(|v| v.to_le_bytes()[..size].to_vec()).collect()
    }

    fn naive_float(row: &[u8], size: usize) -> Vec<u8> {
        let width = row.len() / size;
        let byte = |i: usize| row[i % width * size + size - 1 - i / width];
        let left = |i: usize| if i == 0 { 0 } else { byte(i - 1) };
        (0..row.len()).map(|i| byte(i).wrapping_sub(left(i))).collect()
    }

    proptest! {
        #[test]
        fn like_their_naive_twins(
            row in prop::collection::vec(any::<u8>(), 0..200),
            size in prop::sample::select(vec![1_usize, 2, 4, 8]),
        ) {
            let row = &row[..row.len() / size * size];
            let mut coded = row.to_vec();
            horizontal(&mut coded, size);
            prop_assert_eq!(coded, naive_horizontal(row, size));
            let mut coded = row.to_vec();
            float(&mut coded, size, &mut vec![1, 2, 3]);
            prop_assert_eq!(coded, naive_float(row, size));
        }
    }

    #[test]
    fn as_the_notes_have_it() {
        let mut row = [1, 0, 3, 0, 2, 1];
        horizontal(&mut row, 2);
        assert_eq!(row, [1, 0, 2, 0, 255, 0]);
        let mut row = [1, 10, 2, 20];
        float(&mut row, 2, &mut Vec::new());
        assert_eq!(row, [10, 10, 1_u8.wrapping_sub(20), 1]);
    }
}
