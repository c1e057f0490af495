//! The first pass over a grid: samples to read, and results of its parts.

use std::collections::BTreeMap;
use std::ops::Range;

use super::blocks::{SampleBlock, SampleBlocks};
use super::lines::{Lines, spots, whole_lines};
use crate::georeference::GridGeolocation;
use crate::terrain::VoidFillSums;
use terrane_base::geom::Rect;

/// Survey of a part, to be merged with the others.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockSummary {
    pub(super) rect: Rect,
    pub(super) blocks: Vec<SampleBlock>,
    pub(super) lines: [BTreeMap<u32, Vec<f64>>; 2],
    pub(super) means: VoidFillSums,
    pub(super) range: Option<[f64; 2]>,
}

/// Plan of the first pass: blocks of the grid, and columns and rows with kept samples.
#[derive(Clone, Debug)]
pub struct OverviewPlan {
    /// Division into blocks.
    pub blocks: SampleBlocks,
    pub(super) chart: GridGeolocation,
    pub(super) lines: [Lines; 2],
}

impl OverviewPlan {
    /// For a grid; samples on both sides of the meridians and parallels of `lines` are kept.
    pub fn new(chart: GridGeolocation, lines: [&[f64]; 2]) -> Self {
        let lines =
            if chart.map().is_some() { whole_lines(&chart, lines) } else { spots(&chart, lines) };
        Self { blocks: SampleBlocks::of(chart.size()), chart, lines }
    }

    /// Positions of the grid's samples.
    pub fn chart(&self) -> &GridGeolocation {
        &self.chart
    }

    /// Lines with kept samples in a rectangle, and the kept samples along each.
    pub(super) fn within(
        &self,
        axis: usize,
        rect: Rect,
    ) -> impl Iterator<Item = (u32, Range<usize>)> {
        let across = [(rect.col, rect.width), (rect.row, rect.height)];
        let ((first, count), (from, along)) = (across[axis], across[1 - axis]);
        self.lines[axis].range(first..first + count).filter_map(move |(line, spots)| {
            let [from, to] = [from, from + along].map(|end| match spots {
                None => end as usize,
                Some(spots) => spots.partition_point(|spot| *spot < end),
            });
            (from < to).then_some((*line, from..to))
        })
    }

    /// Kept samples of a line.
    fn len(&self, axis: usize, spots: &Option<Vec<u32>>) -> usize {
        spots.as_ref().map_or(self.blocks.size[1 - axis] as usize, Vec::len)
    }

    /// Surveys the samples of a rectangle of whole blocks, row by row.
    pub fn summarize(&self, rect: Rect, heights: &[f64]) -> BlockSummary {
        let SampleBlocks { side, size, .. } = self.blocks;
        let mut means = VoidFillSums::new(size);
        for (row, line) in (rect.row..).zip(heights.chunks(rect.width as usize)) {
            means.add(rect.col, row, line);
        }
        let mut blocks = Vec::new();
        for row in (0..rect.height).step_by(side as usize) {
            for col in (0..rect.width).step_by(side as usize) {
                let size = [side.min(rect.width - col), side.min(rect.height - row)];
                let from = &heights[row as usize * rect.width as usize + col as usize..];
                blocks.push(SampleBlock::of(
                    from,
                    rect.width as usize,
                    size.map(|side| side as usize),
                ));
            }
        }
        let valid = heights.iter().filter(|height| height.is_finite());
        let range = valid.map(|height| [*height; 2]).reduce(both);
        let lines = [0, 1].map(|axis| {
            let lines = self.within(axis, rect);
            lines.map(|(line, spots)| (line, self.line(axis, line, spots, rect, heights))).collect()
        });
        BlockSummary { rect, blocks, lines, means, range }
    }

    /// Heights of stored samples of a line in a rectangle.
    fn line(
        &self,
        axis: usize,
        line: u32,
        spots: Range<usize>,
        rect: Rect,
        heights: &[f64],
    ) -> Vec<f64> {
        let at = |along: u32| {
            let [col, row] = if axis == 0 { [line, along] } else { [along, line] };
            heights[(row - rect.row) as usize * rect.width as usize + (col - rect.col) as usize]
        };
        match &self.lines[axis][&line] {
            None => spots.map(|along| at(along as u32)).collect(),
            Some(numbers) => numbers[spots].iter().map(|along| at(*along)).collect(),
        }
    }

    /// Memory in bytes of the survey of the whole grid.
    pub fn bytes(&self) -> u64 {
        let SampleBlocks { counts, .. } = self.blocks;
        let blocks = u64::from(counts[0]) * u64::from(counts[1]) * size_of::<SampleBlock>() as u64;
        let lines = (0..2).flat_map(|axis| {
            self.lines[axis].values().map(move |spots| {
                let number = if spots.is_some() { size_of::<u32>() } else { 0 };
                self.len(axis, spots) * (size_of::<f64>() + number)
            })
        });
        blocks + lines.sum::<usize>() as u64 + VoidFillSums::BYTES + self.chart.bytes()
    }

    /// An empty survey.
    pub fn gather(self) -> GatheredOverview {
        let SampleBlocks { counts, size, .. } = self.blocks;
        let blocks = vec![SampleBlock::default(); counts[0] as usize * counts[1] as usize];
        let lines = [0, 1].map(|axis: usize| {
            let lines = self.lines[axis].iter();
            lines.map(|(at, spots)| (*at, vec![f64::NAN; self.len(axis, spots)])).collect()
        });
        GatheredOverview { plan: self, blocks, lines, means: VoidFillSums::new(size), range: None }
    }
}

/// Merged surveys, in any order.
#[derive(Clone, Debug)]
pub struct GatheredOverview {
    pub(super) plan: OverviewPlan,
    pub(super) blocks: Vec<SampleBlock>,
    pub(super) lines: [BTreeMap<u32, Vec<f64>>; 2],
    pub(super) means: VoidFillSums,
    pub(super) range: Option<[f64; 2]>,
}

impl GatheredOverview {
    /// Plan of the pass.
    pub fn plan(&self) -> &OverviewPlan {
        &self.plan
    }

    /// Merges the survey of a rectangle.
    pub fn add(&mut self, summary: BlockSummary) {
        let SampleBlocks { side, counts, .. } = self.plan.blocks;
        let Rect { col, row, width, .. } = summary.rect;
        let across = width.div_ceil(side) as usize;
        for (i, block) in summary.blocks.into_iter().enumerate() {
            let [x, y] = [col / side, row / side].map(|at| at as usize);
            self.blocks[(y + i / across) * counts[0] as usize + x + i % across] = block;
        }
        for axis in 0..2 {
            for (at, part) in self.plan.within(axis, summary.rect) {
                if let (Some(line), Some(heights)) =
                    (self.lines[axis].get_mut(&at), summary.lines[axis].get(&at))
                {
                    line[part].copy_from_slice(heights);
                }
            }
        }
        self.means.join(&summary.means);
        self.range = self.range.into_iter().chain(summary.range).reduce(both);
    }
}

/// Union of two ranges.
pub(super) fn both(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}
