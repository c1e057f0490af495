//! Instruction sets: decoding steps with specialised implementations.
#![allow(unsafe_code)]

/// Numbers compared at once.
pub(super) type Lanes = [u16; 16];

/// An instruction set. Its values prove that the machine supports it.
pub(super) trait InstructionSet: Copy {
    /// Index of the last of ascending numbers that is at most `place`; the first always is.
    fn last_at_most(numbers: &Lanes, place: u16) -> usize;

    /// For each number the value, clamped between its lower and its upper neighbour.
    fn put_between(numbers: &[i32; 8], neighbours: &[[u32; 8]; 2], value: i32) -> [i32; 8];

    /// Runs a task compiled for this instruction set.
    fn run<W: SimdTask>(self, work: W) -> W::Result;
}

/// A task for any instruction set.
pub(super) trait SimdTask {
    type Result;
    /// The task; it must be inlined with all its callees.
    fn work<M: InstructionSet>(self, machine: M) -> Self::Result;
}

/// Runs a task with the best instruction set of this machine.
pub(super) fn run<W: SimdTask>(work: W) -> W::Result {
    #[cfg(target_arch = "x86_64")]
    if let Some(machine) = x86::Avx2::found() {
        return machine.run(work);
    }
    PortableInstructions.run(work)
}

/// Portable instructions.
#[derive(Clone, Copy)]
pub(super) struct PortableInstructions;

impl InstructionSet for PortableInstructions {
    #[inline(always)]
    fn last_at_most(numbers: &Lanes, place: u16) -> usize {
        let is_at_most = numbers.map(|number| u16::from(number <= place));
        usize::from(is_at_most.iter().sum::<u16>()).wrapping_sub(1)
    }

    #[inline(always)]
    fn put_between(numbers: &[i32; 8], neighbours: &[[u32; 8]; 2], value: i32) -> [i32; 8] {
        let [below, above] = neighbours;
        std::array::from_fn(|i| {
            // The mask spares the bounds check.
            let below = numbers[below[i] as usize & 7];
            let above = numbers[above[i] as usize & 7];
            value.min(above).max(below)
        })
    }

    fn run<W: SimdTask>(self, work: W) -> W::Result {
        work.work(self)
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use crate::lazip::machine::{InstructionSet, Lanes, SimdTask};
    use std::arch::x86_64::*;
    use std::marker::PhantomData;

    /// AVX2 and earlier extensions.
    #[derive(Clone, Copy)]
    pub(super) struct Avx2(PhantomData<()>);

    impl Avx2 {
        /// Detects AVX2.
        pub(super) fn found() -> Option<Self> {
            let is_one = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("movbe")
                && is_x86_feature_detected!("popcnt");
            is_one.then_some(Self(PhantomData))
        }
    }

    impl InstructionSet for Avx2 {
        #[inline(always)]
        fn last_at_most(numbers: &Lanes, place: u16) -> usize {
            // SAFETY: called by work that `run` does for a machine that was found.
            unsafe { last_at_most(numbers, place) }
        }

        #[inline(always)]
        fn put_between(numbers: &[i32; 8], neighbours: &[[u32; 8]; 2], value: i32) -> [i32; 8] {
            // SAFETY: called by work that `run` does for a machine that was found.
            unsafe { put_between(numbers, neighbours, value) }
        }

        fn run<W: SimdTask>(self, work: W) -> W::Result {
            // SAFETY: `self` was found.
            unsafe { run(self, work) }
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,movbe,popcnt")]
    fn run<W: SimdTask>(machine: Avx2, work: W) -> W::Result {
        work.work(machine)
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,movbe,popcnt")]
    fn last_at_most(numbers: &Lanes, place: u16) -> usize {
        let numbers: __m256i = bytemuck::cast(*numbers);
        let places = _mm256_set1_epi16(place as i16);
        // AVX2 compares signed numbers only. A number is at most the place where it is the minimum of both.
        let is_at_most = _mm256_cmpeq_epi16(_mm256_min_epu16(numbers, places), numbers);
        let mask = _mm256_movemask_epi8(is_at_most);
        // The mask has two bits for each of the 16-bit numbers, which ascend: their count is the index.
        (mask.count_ones() as usize / 2).wrapping_sub(1)
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,movbe,popcnt")]
    fn put_between(numbers: &[i32; 8], neighbours: &[[u32; 8]; 2], value: i32) -> [i32; 8] {
        let numbers: __m256i = bytemuck::cast(*numbers);
        let [below, above] = neighbours
            .map(|neighbours| _mm256_permutevar8x32_epi32(numbers, bytemuck::cast(neighbours)));
        let value = _mm256_min_epi32(_mm256_set1_epi32(value), above);
        bytemuck::cast(_mm256_max_epi32(value, below))
    }
}
