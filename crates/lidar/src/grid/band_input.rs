//! Adds the points of one subject to the blocks of a grid.
//!
//! Points of a subject carry its value instead of the height, so statistics do not depend on subjects. Real
//! values are kept one by one, in order.

use std::ops::Range;

use super::blocks::CellBlocks;
use super::extent::GridExtent;
use terrane_base::error::Result;
use terrane_base::geom::{Point, Rect};
use terrane_gridding::{BlockTarget, CellHits, CellNeighborhood, DiscScatter, StatisticRecipe};

/// Counts points outside of all written cells.
pub(super) struct OutsideCounter<'a> {
    extent: &'a GridExtent,
    pub(super) count: u64,
    cols: Vec<i32>,
    rows: Vec<i32>,
}

impl<'a> OutsideCounter<'a> {
    pub(super) fn new(extent: &'a GridExtent) -> Self {
        Self { extent, count: 0, cols: Vec::new(), rows: Vec::new() }
    }

    pub(super) fn take(&mut self, points: &[Point]) {
        let GridExtent { lattice, output, .. } = self.extent;
        lattice.x.numbers(points.iter().map(|p| p.x), &mut self.cols);
        lattice.y.numbers(points.iter().map(|p| p.y), &mut self.rows);
        let places = self.cols.iter().zip(&self.rows);
        self.count += places.filter(|(col, row)| !is_in(*output, **col, **row)).count() as u64;
    }
}

/// Per-thread state for adding the points of a subject to blocks.
pub(super) struct BandInput<'a> {
    extent: &'a GridExtent,
    blocks: &'a CellBlocks<'a>,
    /// Points outside of all written cells.
    pub(super) outside: u64,
    /// The regions of the subject, with the scatter of discs.
    regions: Vec<(usize, Option<DiscScatter>)>,
    cols: Vec<i32>,
    rows: Vec<i32>,
    /// Points with their cells, each for one block.
    batch: CellPoints,
    spare: CellPoints,
    /// The part of a run that lies in the block itself.
    inside: CellPoints,
}

/// Points for blocks.
#[derive(Default)]
struct CellPoints {
    blocks: Vec<u32>,
    /// Column and row of the cell that holds the point.
    places: Vec<(i32, i32)>,
    points: Vec<Point>,
    /// Index of the cell in the block, if inside.
    cells: Vec<u32>,
}

/// Average length of runs below which a batch is sorted first.
const SHORT_RUN: usize = 16;

impl<'a> BandInput<'a> {
    /// For a subject of the recipe.
    pub(super) fn new(
        recipe: &StatisticRecipe,
        subject: usize,
        extent: &'a GridExtent,
        blocks: &'a CellBlocks<'a>,
    ) -> Self {
        let regions = recipe.regions_of(subject).map(|(number, region)| match region {
            CellNeighborhood::Cell => (number, None),
            CellNeighborhood::Disc(radius) => {
                (number, Some(DiscScatter::new(&extent.lattice, radius)))
            }
        });
        Self {
            extent,
            blocks,
            outside: 0,
            regions: regions.collect(),
            cols: Vec::new(),
            rows: Vec::new(),
            batch: CellPoints::default(),
            spare: CellPoints::default(),
            inside: CellPoints::default(),
        }
    }

    /// Adds a batch of points to the blocks they touch; `reals` are their real values, if any.
    pub(super) fn take(&mut self, points: &[Point], reals: &[f64]) -> Result<()> {
        let lattice = &self.extent.lattice;
        lattice.x.numbers(points.iter().map(|p| p.x), &mut self.cols);
        lattice.y.numbers(points.iter().map(|p| p.y), &mut self.rows);
        if let [(region, None)] = *self.regions.as_slice()
            && self.is_inside()
            && self.index_own()
        {
            return self.hand_over_own(region, points, reals);
        }
        self.batch.clear();
        match self.reach() {
            (0, 0) => self.place_own(points),
            (reach_x, reach_y) => self.place_around(points, reach_x, reach_y),
        }
        if self.batch.is_scattered() {
            self.batch.sort(&mut self.spare);
        }
        let mut batch = std::mem::take(&mut self.batch);
        let done = batch.runs().try_for_each(|run| self.hand_over(&batch.run(run), reals));
        batch.clear();
        self.batch = batch;
        done
    }

    /// Most columns and rows that any region reaches beyond a point's cell.
    fn reach(&self) -> (i64, i64) {
        let reaches =
            self.regions.iter().filter_map(|(_, scatter)| Some(scatter.as_ref()?.reach()));
        reaches.fold((0, 0), |(x, y), (a, b)| (x.max(a), y.max(b)))
    }

    /// True when all points of the batch lie in the grid.
    fn is_inside(&self) -> bool {
        let (width, height) = self.extent.lattice.size();
        let places = self.cols.iter().zip(&self.rows);
        // Numbers below zero are large ones here.
        places
            .fold(true, |all, (col, row)| all & ((*col as u32) < width) & ((*row as u32) < height))
    }

    /// Finds the cell of each point, all of which lie in the grid; returns whether points of a block
    /// follow each other.
    fn index_own(&mut self) -> bool {
        let (shift, across) = (self.blocks.shift(), self.blocks.across());
        let mask = (1 << shift) - 1;
        let places = self.cols.iter().zip(&self.rows).map(|(col, row)| (*col as u32, *row as u32));
        self.batch.clear();
        let blocks = places.clone().map(|(col, row)| (row >> shift) * across + (col >> shift));
        self.batch.blocks.extend(blocks);
        self.batch.cells.extend(places.map(|(col, row)| ((row & mask) << shift) | (col & mask)));
        !self.batch.is_scattered()
    }

    /// Adds the points of a batch to the only region.
    fn hand_over_own(&mut self, region: usize, points: &[Point], reals: &[f64]) -> Result<()> {
        let Self { blocks, extent, .. } = *self;
        if extent.fill > 0 {
            let places = self.cols.iter().zip(&self.rows);
            let outside = places.filter(|(col, row)| !is_in(extent.output, **col, **row));
            self.outside += outside.count() as u64;
        }
        let batch = &self.batch;
        batch.runs().try_for_each(|run| {
            let (cells, points) = (&batch.cells[run.clone()], &points[run.clone()]);
            let hits = CellHits { cells, points, squares: &[], unit: 0.0, reals };
            blocks.change(batch.blocks[run.start], |block| block.add(region, hits))
        })
    }

    /// Each point goes to the block of its cell.
    fn place_own(&mut self, points: &[Point]) {
        let (width, height) = self.extent.lattice.size();
        let output = self.extent.output;
        let (shift, across) = (self.blocks.shift(), self.blocks.across());
        for (point, (&col, &row)) in points.iter().zip(self.cols.iter().zip(&self.rows)) {
            self.outside += u64::from(!is_in(output, col, row));
            // Numbers below zero are large ones here.
            if (col as u32) < width && (row as u32) < height {
                let block = (row as u32 >> shift) * across + (col as u32 >> shift);
                self.batch.push(block, col, row, *point, shift);
            }
        }
    }

    /// Each point goes to all blocks with cells that it may reach.
    fn place_around(&mut self, points: &[Point], reach_x: i64, reach_y: i64) {
        let (width, height) = self.extent.lattice.size();
        let output = self.extent.output;
        let (shift, across) = (self.blocks.shift(), self.blocks.across());
        for (point, (&col, &row)) in points.iter().zip(self.cols.iter().zip(&self.rows)) {
            self.outside += u64::from(!is_in(output, col, row));
            let Some(cols) = blocks_around(col, reach_x, width, shift) else { continue };
            let Some(rows) = blocks_around(row, reach_y, height, shift) else { continue };
            for down in rows {
                for block in cols.clone() {
                    self.batch.push(down * across + block, col, row, *point, shift);
                }
            }
        }
    }

    /// Adds points to one block.
    fn hand_over(&mut self, run: &BlockRun<'_>, reals: &[f64]) -> Result<()> {
        let Self { blocks, extent, .. } = *self;
        let window = blocks.window(run.block);
        let stride = 1 << blocks.shift();
        let (regions, inside) = (&mut self.regions, &mut self.inside);
        blocks.change(run.block, |block| {
            regions.iter_mut().try_for_each(|(region, scatter)| match scatter {
                Some(scatter) => {
                    let to = BlockTarget { block: &mut *block, region: *region, reals };
                    scatter.add(&extent.lattice, window, stride, run.points, run.places, to)
                }
                None => block.add(*region, CellHits { reals, ..run.inside(window, inside) }),
            })
        })
    }
}

/// The columns, or rows, of blocks with cells within `reach` of a cell, among `side` cells.
#[inline]
fn blocks_around(at: i32, reach: i64, side: u32, shift: u32) -> Option<Range<u32>> {
    let first = (i64::from(at) - reach).max(0);
    let end = (i64::from(at) + reach + 1).min(i64::from(side));
    (first < end).then(|| (first >> shift) as u32..((end - 1) >> shift) as u32 + 1)
}

#[inline]
fn is_in(rect: Rect, col: i32, row: i32) -> bool {
    // Columns before the window, negative ones too, wrap beyond its width.
    (col as u32).wrapping_sub(rect.col) < rect.width
        && (row as u32).wrapping_sub(rect.row) < rect.height
}

/// Consecutive points for one block.
struct BlockRun<'a> {
    block: u32,
    places: &'a [(i32, i32)],
    points: &'a [Point],
    cells: &'a [u32],
}

impl BlockRun<'_> {
    /// The points in the cells of the block itself.
    fn inside<'a>(&'a self, window: Rect, inside: &'a mut CellPoints) -> CellHits<'a> {
        if self.places.iter().all(|(col, row)| is_in(window, *col, *row)) {
            return CellHits {
                cells: self.cells,
                points: self.points,
                squares: &[],
                unit: 0.0,
                reals: &[],
            };
        }
        inside.clear();
        let points = self.places.iter().zip(self.points.iter().zip(self.cells));
        for ((col, row), (point, cell)) in points {
            if is_in(window, *col, *row) {
                inside.points.push(*point);
                inside.cells.push(*cell);
            }
        }
        CellHits {
            cells: &inside.cells,
            points: &inside.points,
            squares: &[],
            unit: 0.0,
            reals: &[],
        }
    }
}

impl CellPoints {
    fn clear(&mut self) {
        self.blocks.clear();
        self.places.clear();
        self.points.clear();
        self.cells.clear();
    }

    #[inline(always)]
    fn push(&mut self, block: u32, col: i32, row: i32, point: Point, shift: u32) {
        let mask = (1 << shift) - 1;
        self.blocks.push(block);
        self.places.push((col, row));
        self.points.push(point);
        self.cells.push(((row as u32 & mask) << shift) | (col as u32 & mask));
    }

    /// Stretches of points for one and the same block.
    fn runs(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut start = 0;
        self.blocks.chunk_by(|a, b| a == b).map(move |run| {
            let range = start..start + run.len();
            start = range.end;
            range
        })
    }

    /// True when points for one block hardly follow each other.
    fn is_scattered(&self) -> bool {
        self.runs().count() * SHORT_RUN > self.blocks.len()
    }

    fn run(&self, run: Range<usize>) -> BlockRun<'_> {
        BlockRun {
            block: self.blocks[run.start],
            places: &self.places[run.clone()],
            points: &self.points[run.clone()],
            cells: &self.cells[run],
        }
    }

    /// Puts points for the same block side by side.
    fn sort(&mut self, spare: &mut Self) {
        let mut order: Vec<u32> = (0..self.blocks.len() as u32).collect();
        order.sort_unstable_by_key(|at| (self.blocks[*at as usize], *at));
        spare.clear();
        for at in order {
            let at = at as usize;
            spare.blocks.push(self.blocks[at]);
            spare.places.push(self.places[at]);
            spare.points.push(self.points[at]);
            spare.cells.push(self.cells[at]);
        }
        std::mem::swap(self, spare);
    }
}
