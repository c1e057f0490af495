//! All values of a cell, sorted: for statistics that cannot be computed from sums and extremes.

use bytemuck::{Pod, Zeroable};

use crate::plane::{AccumulatorKind, AccumulatorPlane, CellHits, like};
use terrane_base::error::Result;
use terrane_base::geom::Point;

/// Values in steps.
pub(super) const WHOLE: AccumulatorKind = all::<StepValue>("values");
/// Real values.
pub(super) const REAL: AccumulatorKind = all::<RealValue>("real values");

const fn all<E: CellValue>(name: &'static str) -> AccumulatorKind {
    AccumulatorKind {
        name,
        parameters: [0.0; 2],
        make: |_, _| Box::new(CellValueList::<E>(Vec::new())),
        bytes_per_cell: 0,
        bytes_per_point: size_of::<E>(),
    }
}

/// A value and its cell, ordered by cell and value.
pub(super) trait CellValue: Pod + Default + Ord + std::fmt::Debug + Send {
    fn new(cell: u32, point: &Point, reals: &[f64]) -> Self;
    fn cell(self) -> u32;
    fn value(self) -> f64;
}

/// A value in steps and its cell.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub(super) struct StepValue {
    cell: u32,
    value: i32,
}

/// A real number and its cell: its bits, high and low, mapped so that they sort like the numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub(super) struct RealValue {
    cell: u32,
    high: u32,
    low: u32,
}

impl CellValue for StepValue {
    #[inline(always)]
    fn new(cell: u32, point: &Point, _: &[f64]) -> Self {
        Self { cell, value: point.z }
    }

    fn cell(self) -> u32 {
        self.cell
    }

    fn value(self) -> f64 {
        self.value.into()
    }
}

const SIGN: u64 = 1 << 63;

impl CellValue for RealValue {
    fn new(cell: u32, point: &Point, reals: &[f64]) -> Self {
        // Nought has one sign.
        let value = reals.get(point.z as usize).map_or(0.0, |value| value + 0.0);
        let bits = value.to_bits();
        // Bits of negative numbers ascend with the magnitude, so all of theirs are turned, of others the sign alone.
        let turned = if bits & SIGN == 0 { bits | SIGN } else { !bits };
        // In two halves: a `u64` would pad twelve bytes to sixteen.
        Self { cell, high: (turned >> 32) as u32, low: turned as u32 }
    }

    fn cell(self) -> u32 {
        self.cell
    }

    fn value(self) -> f64 {
        let turned = u64::from(self.high) << 32 | u64::from(self.low);
        f64::from_bits(if turned & SIGN == 0 { !turned } else { turned & !SIGN })
    }
}

/// All values of all cells.
#[derive(Debug)]
pub(super) struct CellValueList<E>(Vec<E>);

impl<E: CellValue> AccumulatorPlane for CellValueList<E> {
    fn add(&mut self, hits: CellHits<'_>) -> Result<()> {
        let cells = hits.cells.iter().zip(hits.points);
        self.0.extend(cells.map(|(&cell, point)| E::new(cell, point, hits.reals)));
        Ok(())
    }

    fn fold(&mut self, other: &dyn AccumulatorPlane) -> Result<()> {
        self.0.extend_from_slice(&like::<Self>(other)?.0);
        Ok(())
    }

    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }

    fn bytes_mut(&mut self, bytes: usize) -> &mut [u8] {
        self.0.resize(bytes / size_of::<E>(), E::default());
        bytemuck::cast_slice_mut(&mut self.0)
    }

    fn memory_use(&self) -> usize {
        self.0.capacity() * size_of::<E>()
    }

    fn settle(&mut self) {
        self.0.sort_unstable();
    }
}

impl<E: CellValue> CellValueList<E> {
    /// Those of a settled cell.
    pub(super) fn of(&self, at: usize) -> &[E] {
        let Self(values) = self;
        let first = values.partition_point(|value| (value.cell() as usize) < at);
        let cell = &values[first..];
        &cell[..cell.partition_point(|value| value.cell() as usize == at)]
    }
}

/// The values of a cell, the lowest first: in steps, where they are of steps.
#[derive(Clone, Copy, Debug)]
pub(super) enum SortedCellValues<'a> {
    Whole(&'a [StepValue]),
    Real(&'a [RealValue]),
}

impl<'a> SortedCellValues<'a> {
    pub(super) fn len(self) -> usize {
        match self {
            Self::Whole(values) => values.len(),
            Self::Real(values) => values.len(),
        }
    }

    pub(super) fn get(self, at: usize) -> Option<f64> {
        match self {
            Self::Whole(values) => values.get(at).map(|value| value.value()),
            Self::Real(values) => values.get(at).map(|value| value.value()),
        }
    }

    pub(super) fn iter(self) -> impl Iterator<Item = f64> + 'a {
        (0..self.len()).filter_map(move |at| self.get(at))
    }

    pub(super) fn last(self) -> Option<f64> {
        self.get(self.len().checked_sub(1)?)
    }

    /// Each distinct value and its count.
    pub(super) fn runs(self) -> impl Iterator<Item = (f64, usize)> + 'a {
        let mut at = 0;
        std::iter::from_fn(move || {
            let value = self.get(at)?;
            let end = self.behind(at, |other| other == value);
            let run = (value, end - at);
            at = end;
            Some(run)
        })
    }

    /// The first place from `at` on whose value is not as `is` says.
    pub(super) fn behind(self, at: usize, is: impl Fn(f64) -> bool) -> usize {
        (at..self.len())
            .find(|next| self.get(*next).is_some_and(|value| !is(value)))
            .unwrap_or(self.len())
    }

    /// The mean, summed from the lowest value on, so that it does not depend on the order of points.
    pub(super) fn mean(self) -> Option<f64> {
        let first = self.get(0)?;
        Some(first + sum(self.iter().map(|value| value - first)) / self.len() as f64)
    }

    /// The sum of the `power`-th powers of the differences from the mean.
    pub(super) fn spread(self, power: i32) -> Option<f64> {
        let mean = self.mean()?;
        Some(sum(self.iter().map(|value| power_of(value - mean, power))))
    }
}

/// Products are the same on all machines.
fn power_of(base: f64, power: i32) -> f64 {
    (1..power).fold(base, |product, _| product * base)
}

/// A compensated sum, with about one rounding error (Neumaier 1974).
fn sum(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for value in values {
        let next = sum + value;
        lost += if sum.abs() >= value.abs() { sum - next + value } else { value - next + sum };
        sum = next;
    }
    sum + lost
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_finite() -> impl Strategy<Value = f64> {
        use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
        NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE
    }

    proptest! {
        #[test]
        fn any_numbers_come_back_in_their_order(
            mut numbers in prop::collection::vec(any_finite(), 1..40),
        ) {
            let places: Vec<_> = (0..numbers.len() as i32).map(|z| Point::new(0, 0, z)).collect();
            let mut values = CellValueList::<RealValue>(Vec::new());
            let cells = vec![3; numbers.len()];
            let hits = CellHits { cells: &cells, points: &places, squares: &[], unit: 1.0, reals: &numbers };
            values.add(hits).unwrap();
            values.settle();
            numbers.sort_by(f64::total_cmp);
            let found: Vec<f64> = SortedCellValues::Real(values.of(3)).iter().collect();
            prop_assert_eq!(found, numbers);
            prop_assert!(values.of(2).is_empty());
        }

        /// Whatever is lost of a plain sum is not lost of this one.
        #[test]
        fn sums_are_those_of_whole_numbers(all in prop::collection::vec(-1_i64 << 52..1 << 52, 0..200)) {
            let exact: i128 = all.iter().map(|value| i128::from(*value)).sum();
            prop_assert_eq!(sum(all.iter().map(|value| *value as f64)), exact as f64);
        }
    }

    #[test]
    fn runs_are_of_equal_values() {
        let values = [1, 1, 2, 5, 5, 5].map(|value| StepValue { cell: 0, value });
        let runs: Vec<_> = SortedCellValues::Whole(&values).runs().collect();
        assert_eq!(runs, [(1.0, 2), (2.0, 1), (5.0, 3)]);
        assert_eq!(SortedCellValues::Whole(&[]).runs().count(), 0);
        assert_eq!(
            (SortedCellValues::Whole(&[]).mean(), SortedCellValues::Whole(&[]).last()),
            (None, None)
        );
    }
}
