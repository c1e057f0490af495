//! Median of recent values.

use super::machine::InstructionSet;

/// Five sorted values between the minimum and maximum integers. A new value alternately replaces the largest or the
/// smallest.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub(super) struct FiveValueMedian {
    values: [i32; 8],
    drops_largest: bool,
}

/// Indices of the lower and upper neighbours of each value after the smallest or the largest is removed.
const NEIGHBOURS: [[[u32; 8]; 2]; 2] = [
    [[0, 0, 2, 3, 4, 5, 6, 6], [0, 2, 3, 4, 5, 6, 6, 6]],
    [[0, 0, 1, 2, 3, 4, 6, 6], [0, 1, 2, 3, 4, 6, 6, 6]],
];

impl FiveValueMedian {
    /// Five zeros.
    pub(super) const fn new() -> Self {
        Self { values: [i32::MIN, 0, 0, 0, 0, 0, i32::MAX, i32::MAX], drops_largest: true }
    }

    /// The median.
    #[inline(always)]
    pub(super) fn middle(&self) -> i32 {
        self.values[3]
    }

    /// Adds the median plus `difference`, and returns it.
    #[inline(always)]
    pub(super) fn go<M: InstructionSet>(&mut self, difference: i32) -> i32 {
        let middle = self.values[3];
        let value = middle.wrapping_add(difference);
        let neighbours = &NEIGHBOURS[usize::from(self.drops_largest)];
        self.drops_largest = (value < middle) | (!self.drops_largest & (value == middle));
        // An insertion without a branch: each place takes the new value as far as its neighbours allow.
        self.values = M::put_between(&self.values, neighbours, value);
        value
    }
}

#[cfg(test)]
mod tests {
    use super::super::machine::{PortableInstructions, SimdTask, run};
    use super::*;

    /// Takes values in; the middle after each.
    struct Middles<'a>(&'a [i32]);

    impl SimdTask for Middles<'_> {
        type Result = Vec<i32>;

        fn work<M: InstructionSet>(self, _: M) -> Vec<i32> {
            let mut median = FiveValueMedian::new();
            let mut put = |value: i32| {
                median.go::<M>(value.wrapping_sub(median.values[3]));
                median.values[3]
            };
            self.0.iter().map(|&value| put(value)).collect()
        }
    }

    /// The same by sorting.
    fn sorted(values: &[i32]) -> Vec<i32> {
        let (mut kept, mut drops_largest) = (vec![0; 5], true);
        let mut put = |value: i32| {
            let middle = kept[2];
            kept.remove(if drops_largest { 4 } else { 0 });
            drops_largest = value < middle || !drops_largest && value == middle;
            kept.push(value);
            kept.sort_unstable();
            kept[2]
        };
        values.iter().map(|&value| put(value)).collect()
    }

    #[test]
    fn the_middle_is_that_of_sorted_values() {
        let (least, most) = (i32::MIN, i32::MAX);
        let mut state = 1_u64;
        let mut any = || {
            state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(9);
            let spread = 1 << (state >> 58 & 31);
            ((state >> 30) as i32).checked_rem(spread).unwrap_or(0)
        };
        let mut values: Vec<i32> = (0..5000).map(|_| any()).collect();
        values.extend([least, most, least, least, least, 0, most, most, most, -1, 1, 1, 1, 1]);
        let expected = sorted(&values);
        assert_eq!(run(Middles(&values)), expected);
        assert_eq!(Middles(&values).work(PortableInstructions), expected);
    }
}
