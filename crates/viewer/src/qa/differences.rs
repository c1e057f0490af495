//! Differences of height between flight lines, by cell.
//!
//! Two lines are compared in a cell in which each of them has [`MIN_RETURNS`] last returns or more, within a small range
//! of heights: there the surface is flat and without vegetation, and the means of their heights should agree.

use std::collections::BTreeMap;
use std::path::Path;

use bytemuck::{Pod, Zeroable};

use super::lattice::QaLattice;
use super::report::QaOverlap;
use super::tally::CellTally;
use terrane_base::error::Result;
use terrane_files::{AggregatedRecords, KeyedRecord};

/// Last returns of a line in a cell in which it is compared.
pub(super) const MIN_RETURNS: u64 = 3;
/// The default range of heights, as a share of the side of a cell: a slope of 6 degrees.
pub(super) const USUAL_SLOPE: f64 = 0.1;
/// Most pairs of lines. More mean that the ids are not those of flight lines.
pub(super) const MAX_PAIRS: usize = 1 << 12;
/// Differences that are gathered before they are sorted.
const GATHERED: usize = 1 << 12;

/// A flight line in a cell, of all files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LineInCell {
    pub(super) line: u16,
    pub(super) last: u64,
    pub(super) sum: i64,
    pub(super) low: i32,
    pub(super) high: i32,
}

impl LineInCell {
    pub(super) fn of(tally: &CellTally) -> Self {
        let CellTally { line, last, sum, low, high, .. } = *tally;
        Self { line: line as u16, last, sum, low, high }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.last += other.last;
        self.sum = self.sum.saturating_add(other.sum);
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
    }

    fn mean(&self) -> f64 {
        self.sum as f64 / self.last as f64
    }
}

/// Counts of a pair of lines.
#[derive(Clone, Copy, Debug, Default)]
struct PairTally {
    /// Cells with points of both.
    cells: u64,
    compared: u64,
}

/// A difference of a pair of lines, once for its sign and once for its size.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct LineDifference {
    /// The pair, and whether it is the size.
    pair: u64,
    /// Bits of the difference, in the order of numbers.
    bits: u64,
    count: u64,
}

impl LineDifference {
    fn new([a, b]: [u16; 2], is_size: bool, value: f64) -> Self {
        // Zero has one sign, so that equal differences are equal records.
        let bits = (value + 0.0).to_bits();
        let bits = if bits >> 63 == 0 { bits | 1 << 63 } else { !bits };
        let pair = u64::from(a) << 17 | u64::from(b) << 1 | u64::from(is_size);
        Self { pair, bits, count: 1 }
    }

    fn value(&self) -> f64 {
        f64::from_bits(if self.bits >> 63 == 1 { self.bits ^ 1 << 63 } else { !self.bits })
    }
}

impl KeyedRecord for LineDifference {
    fn key(&self) -> u128 {
        u128::from(self.pair) << 64 | u128::from(self.bits)
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
    }
}

/// Compares the lines of cells.
pub(super) struct LineComparison {
    /// Largest range of heights, in steps.
    max_range: f64,
    pairs: BTreeMap<[u16; 2], PairTally>,
    /// Overlaps of other pairs, counted by cell.
    left_out: u64,
    gathered: Vec<LineDifference>,
    sorted: AggregatedRecords<LineDifference>,
}

impl LineComparison {
    /// For ranges of heights up to `max_range` world units.
    pub(super) fn new(max_range: f64, lattice: &QaLattice, folder: &Path, budget: u64) -> Self {
        // Whole steps: a range equal to the limit is within it.
        let steps = max_range / lattice.height_step();
        Self {
            max_range: steps + 1e-6 * steps.max(1.0),
            pairs: BTreeMap::new(),
            left_out: 0,
            gathered: Vec::with_capacity(GATHERED + 2),
            sorted: AggregatedRecords::new(folder, [0, 1 << 97], budget),
        }
    }

    /// Compares the lines of a cell; returns the largest difference in world units, if any two were compared.
    pub(super) fn add(&mut self, lines: &[LineInCell], lattice: &QaLattice) -> Result<Option<f64>> {
        let mut largest = None::<f64>;
        let count = lines.len() * lines.len().saturating_sub(1) / 2;
        if count > MAX_PAIRS {
            self.left_out += count as u64;
            return Ok(None);
        }
        for (at, a) in lines.iter().enumerate() {
            for b in &lines[at + 1..] {
                let lines = [a.line, b.line];
                if self.pairs.len() == MAX_PAIRS && !self.pairs.contains_key(&lines) {
                    self.left_out += 1;
                    continue;
                }
                let is_compared = self.is_flat(a) && self.is_flat(b);
                let pair = self.pairs.entry(lines).or_default();
                pair.cells += 1;
                if !is_compared {
                    continue;
                }
                pair.compared += 1;
                let difference = (a.mean() - b.mean()) * lattice.height_step();
                self.gathered.push(LineDifference::new(lines, false, difference));
                self.gathered.push(LineDifference::new(lines, true, difference.abs()));
                largest = Some(largest.map_or(difference.abs(), |it| it.max(difference.abs())));
                if self.gathered.len() >= GATHERED {
                    self.sorted.push(&mut self.gathered)?;
                }
            }
        }
        Ok(largest)
    }

    fn is_flat(&self, line: &LineInCell) -> bool {
        let range = f64::from(line.high) - f64::from(line.low);
        line.last >= MIN_RETURNS && range <= self.max_range
    }

    /// The report on the pairs that overlap, and how many overlaps of others are left out, counted by cell.
    pub(super) fn finish(mut self, lattice: &QaLattice) -> Result<(Vec<QaOverlap>, u64)> {
        self.sorted.push(&mut self.gathered)?;
        let overlaps = self.pairs.iter().map(|(lines, pair)| QaOverlap {
            lines: *lines,
            area: pair.cells as f64 * lattice.area,
            cells: pair.cells,
            compared: pair.compared,
            ..QaOverlap::default()
        });
        let mut overlaps: Vec<QaOverlap> = overlaps.collect();
        let mut at = 0;
        let mut reading = DifferenceReading::default();
        self.sorted.read(&mut |difference| {
            let [a, b] = [difference.pair >> 17, difference.pair >> 1 & 0xffff];
            while overlaps.get(at).is_some_and(|o| o.lines.map(u64::from) != [a, b]) {
                at += 1;
                reading = DifferenceReading::default();
            }
            if let Some(overlap) = overlaps.get_mut(at) {
                reading.add(difference, overlap);
            }
            Ok(())
        })?;
        Ok((overlaps, self.left_out))
    }
}

/// Statistics of the differences of a pair, which come in their order.
#[derive(Default)]
struct DifferenceReading {
    signed: u64,
    sizes: u64,
    sum: f64,
    squares: f64,
}

impl DifferenceReading {
    fn add(&mut self, difference: &LineDifference, overlap: &mut QaOverlap) {
        let (value, count) = (difference.value(), difference.count);
        let rank = |percent: u64| (overlap.compared * percent).div_ceil(100).max(1);
        if difference.pair & 1 == 1 {
            let before = self.sizes;
            self.sizes += count;
            if (before + 1..=self.sizes).contains(&rank(95)) {
                overlap.p95 = Some(value);
            }
            overlap.largest = Some(value);
            return;
        }
        let before = self.signed;
        self.signed += count;
        self.sum += value * count as f64;
        self.squares += value * value * count as f64;
        if (before + 1..=self.signed).contains(&rank(50)) {
            overlap.median = Some(value);
        }
        overlap.mean = Some(self.sum / self.signed as f64);
        overlap.rmse = Some((self.squares / self.signed as f64).sqrt());
    }
}
