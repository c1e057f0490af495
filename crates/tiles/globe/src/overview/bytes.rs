//! Survey of a part of a grid as bytes, to be stored and merged elsewhere.

use std::collections::BTreeMap;

use super::blocks::{BlockExtreme, SampleBlock, SampleBlocks};
use super::plan::{BlockSummary, OverviewPlan};
use crate::terrain::VoidFillSums;
use terrane_base::geom::Rect;

impl BlockSummary {
    /// Appends it to `out`, for [`OverviewPlan::read_summary`].
    pub fn write(&self, out: &mut Vec<u8>) {
        let Rect { col, row, width, height } = self.rect;
        [col, row, width, height].into_iter().for_each(|n| out.extend(n.to_le_bytes()));
        let [low, high] = self.range.unwrap_or([f64::NAN; 2]);
        put(out, &[low, high]);
        for block in &self.blocks {
            out.extend(block.count.to_le_bytes());
            put(out, &block.plane);
            for BlockExtreme { at, height, off } in block.ends {
                at.into_iter().for_each(|at| out.extend(at.to_le_bytes()));
                put(out, &[height, off]);
            }
            put(out, &[block.jump]);
        }
        for lines in &self.lines {
            out.extend((lines.len() as u32).to_le_bytes());
            for (at, heights) in lines {
                out.extend(at.to_le_bytes());
                put(out, heights);
            }
        }
        let sums: Vec<_> = self.means.sums().collect();
        out.extend((sums.len() as u32).to_le_bytes());
        for (cell, sum, count) in sums {
            out.extend(cell.to_le_bytes());
            out.extend(sum.to_le_bytes());
            out.extend(count.to_le_bytes());
        }
    }
}

/// Size in bytes of a stored block, and of a stored sum.
const BLOCK: u64 = 4 + 3 * 8 + 2 * (2 * 2 + 2 * 8) + 8;
const SUM: u64 = 4 + 16 + 8;

impl OverviewPlan {
    /// Size in bytes of a survey of a rectangle without voids.
    pub fn written_bytes(&self, rect: Rect) -> u64 {
        let Rect { width, height, .. } = rect;
        let side = self.blocks.side;
        let blocks = u64::from(width.div_ceil(side)) * u64::from(height.div_ceil(side));
        let lines = (0..2).flat_map(|axis| self.within(axis, rect));
        let lines = lines.map(|(_, range)| 4 + 8 * range.len() as u64).sum::<u64>();
        let cells = VoidFillSums::new(self.blocks.size).cells_in(rect);
        4 * 4 + 2 * 8 + blocks * BLOCK + 2 * 4 + lines + 4 + cells * SUM
    }

    /// Reads a survey from the front of `from`; `None` if there is none of this grid.
    pub fn read_summary(&self, from: &mut &[u8]) -> Option<BlockSummary> {
        let SampleBlocks { side, size, .. } = self.blocks;
        let [col, row, width, height] = numbers(from)?.map(u32::from_le_bytes);
        let rect = Rect::new(col, row, width, height);
        if !fits(col, width, size[0], side) || !fits(row, height, size[1], side) {
            return None;
        }
        let [low, high] = numbers(from)?.map(f64::from_le_bytes);
        let count = width.div_ceil(side) as usize * height.div_ceil(side) as usize;
        let blocks = (0..count).map(|_| block(from)).collect::<Option<_>>()?;
        let mut lines = [BTreeMap::new(), BTreeMap::new()];
        for (axis, lines) in lines.iter_mut().enumerate() {
            let within: Vec<_> = self.within(axis, rect).collect();
            if number(from)? as usize != within.len() {
                return None;
            }
            for (at, part) in within {
                if number(from)? != at {
                    return None;
                }
                lines.insert(at, part.map(|_| float(from)).collect::<Option<_>>()?);
            }
        }
        let mut means = VoidFillSums::new(size);
        for _ in 0..number(from)? {
            let cell = number(from)?;
            let sum = i128::from_le_bytes(bytes(from)?);
            means.put(cell, sum, u64::from_le_bytes(bytes(from)?))?;
        }
        let range = (low <= high).then_some([low, high]);
        Some(BlockSummary { rect, blocks, lines, means, range })
    }
}

/// Whether a range of columns or rows begins with a block, and lies in the grid.
fn fits(first: u32, count: u32, total: u32, side: u32) -> bool {
    let is_aligned = first.is_multiple_of(side) && count > 0;
    is_aligned && first.checked_add(count).is_some_and(|end| end <= total)
}

fn block(from: &mut &[u8]) -> Option<SampleBlock> {
    let count = number(from)?;
    let plane = numbers(from)?.map(f64::from_le_bytes);
    let mut ends = [BlockExtreme::default(); 2];
    for end in &mut ends {
        let at = numbers(from)?.map(u16::from_le_bytes);
        let [height, off] = numbers(from)?.map(f64::from_le_bytes);
        *end = BlockExtreme { at, height, off };
    }
    let jump = float(from)?;
    Some(SampleBlock { count, plane, ends, jump })
}

fn put(out: &mut Vec<u8>, values: &[f64]) {
    values.iter().for_each(|value| out.extend(value.to_le_bytes()));
}

fn bytes<const N: usize>(from: &mut &[u8]) -> Option<[u8; N]> {
    let (here, rest) = from.split_first_chunk()?;
    *from = rest;
    Some(*here)
}

fn numbers<const K: usize, const N: usize>(from: &mut &[u8]) -> Option<[[u8; N]; K]> {
    let mut found = [[0; N]; K];
    for number in &mut found {
        *number = bytes(from)?;
    }
    Some(found)
}

fn number(from: &mut &[u8]) -> Option<u32> {
    bytes(from).map(u32::from_le_bytes)
}

fn float(from: &mut &[u8]) -> Option<f64> {
    bytes(from).map(f64::from_le_bytes)
}
