//! How the memory of a cloud-to-grid job is divided.
//!
//! | share | bytes |
//! |---|---|
//! | the program itself | [`PROGRAM`] |
//! | half of all, if there is a surface beside statistics: points it goes through | [`GridBudget::points`] |
//! | the table of blocks | 64 for each |
//! | each thread: a batch of points and what decodes it, later a block of the output | [`WORKER`] or more |
//! | each thread: the columns of attributes, if there are any, and what decodes them | [`COLUMNS`] |
//! | the rest: blocks of cells, those beyond it spilled | [`GridBudget::blocks`] |
//!
//! Without statistics of cells 7/8 of the rest is for points, but never less than half of all.

use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::memory::{PROGRAM, too_little, without_slack};
use terrane_gridding::StatisticRecipe;
use terrane_raster::write::{GridFormat, GridSink};

use super::extent::GridExtent;
use super::neighbours;

const WORKER: u64 = 12 << 20;
const COLUMNS: u64 = 8 << 20;
/// Least for blocks.
const LEAST: u64 = 8 << 20;
/// Bytes of an entry in the table of blocks.
const SLOT: u64 = 64;
/// Blocks have 2^8 x 2^8 cells, or fewer where memory is short, down to 2^4 x 2^4.
const MAX_SHIFT: u32 = 8;
const MIN_SHIFT: u32 = 4;
/// Blocks that should fit into memory for each thread.
const AT_HAND: u64 = 24;

/// A divided budget.
#[derive(Clone, Copy, Debug)]
pub(super) struct GridBudget {
    pub(super) threads: usize,
    /// Bytes for cells.
    pub(super) blocks: u64,
    /// Bytes for points that surfaces go through.
    pub(super) points: u64,
    /// A block has 2^shift columns and rows.
    pub(super) shift: u32,
}

/// A grid in the making: all that its memory depends on besides the points.
#[derive(Clone, Copy)]
pub(super) struct GridWorkload<'a> {
    pub(super) format: &'a GridFormat,
    pub(super) sink: &'a dyn GridSink,
    pub(super) extent: &'a GridExtent,
    pub(super) recipe: &'a StatisticRecipe,
}

impl GridWorkload<'_> {
    /// Bytes a thread needs.
    fn worker(self) -> u64 {
        let around = if self.recipe.triangulates() { neighbours::WORKER } else { 0 };
        let columns = if self.recipe.attributes().is_empty() { 0 } else { COLUMNS };
        columns + WORKER.max(around + self.writing())
    }

    /// Bytes a thread needs to write a block of the output, with the margin for filling voids.
    fn writing(self) -> u64 {
        let ((width, height), output) = (self.sink.block(), self.extent.output);
        let (width, height) = (width.min(output.width), height.min(output.height));
        let (width, height) = (u64::from(width), u64::from(height));
        let around = 2 * u64::from(self.extent.fill);
        let sample = self.format.bytes_per_sample + 8 * self.recipe.bands().len() as u64;
        let samples = width.saturating_mul(height).saturating_mul(sample);
        samples.saturating_add((width + around).saturating_mul(height + around).saturating_mul(8))
    }

    fn cells(self) -> u64 {
        let (width, height) = self.extent.lattice.size();
        u64::from(width).saturating_mul(u64::from(height)).max(1)
    }

    /// Bytes of the table of blocks.
    fn table(self, shift: u32) -> u64 {
        self.cells().div_ceil(1 << (2 * shift)).saturating_mul(SLOT)
    }

    /// Bytes of `memory` that are left for blocks; `None` if that is less than the least.
    fn left(self, memory: u64, threads: u64, shift: u32) -> Option<u64> {
        let rest = memory.checked_sub(PROGRAM + self.table(shift))?;
        rest.checked_sub(threads * self.worker()).filter(|left| *left >= LEAST)
    }
}

impl GridBudget {
    /// The budget for `points` points.
    pub(super) fn divide(
        resources: &Resources,
        work: GridWorkload<'_>,
        points: u64,
    ) -> Result<Self> {
        let Resources { threads, memory: all, .. } = *resources;
        let surface_share = if work.recipe.triangulates() { all / 2 } else { 0 };
        let memory = all - surface_share;
        let mut threads = (1..=threads.max(1) as u64).rev();
        let threads = threads.find(|threads| work.left(memory, *threads, MAX_SHIFT).is_some());
        let threads = threads.ok_or_else(|| too_small(all, Self::min_memory(work)))?;
        let cell = work.recipe.bytes_per_cell() as u64
            + work.recipe.bytes_per_point() as u64 * points.div_ceil(work.cells());
        let mut shifts = (MIN_SHIFT..=MAX_SHIFT).rev();
        let fitting = shifts.find_map(|shift| {
            let blocks = work.left(memory, threads, shift)?;
            let at_hand = (cell << (2 * shift)).saturating_mul(AT_HAND * threads);
            (at_hand <= blocks).then_some((shift, blocks))
        });
        // Else the smallest blocks whose table fits: that of the largest ones does.
        let smallest = (MIN_SHIFT..=MAX_SHIFT)
            .find_map(|shift| Some((shift, work.left(memory, threads, shift)?)));
        let (shift, blocks) = fitting.or(smallest).unwrap_or((MAX_SHIFT, LEAST));
        let threads = threads as usize;
        if work.recipe.triangulates() && work.recipe.bytes_per_cell() == 0 {
            let points = surface_share.max(without_slack(surface_share + blocks - LEAST));
            return Ok(Self { threads, blocks: LEAST, points, shift });
        }
        Ok(Self { threads, blocks, points: surface_share, shift })
    }

    /// Memory that is enough for `points` bytes of points that a surface goes through, whatever the threads.
    pub(super) fn with_points(points: u64) -> u64 {
        points.saturating_mul(2)
    }

    /// Least memory for one thread in both [`divide`](Self::divide), if half of it goes to triangulated points,
    /// and [`writing`](Self::writing).
    pub(super) fn min_memory(work: GridWorkload<'_>) -> u64 {
        let least = PROGRAM + work.table(MAX_SHIFT) + LEAST + work.worker();
        if work.recipe.triangulates() { 2 * least } else { least }
    }

    /// Fails if an earlier step exceeds the memory; the advised budget suffices for all steps.
    pub(super) fn check(resources: &Resources, work: GridWorkload<'_>, before: u64) -> Result<()> {
        match before > resources.memory {
            true => Err(too_small(resources.memory, before.max(Self::min_memory(work)))),
            false => Ok(()),
        }
    }

    /// The budget for writing a grid whose values are read from files: the rest is for their blocks.
    pub(super) fn writing(resources: &Resources, work: GridWorkload<'_>) -> Result<Self> {
        let worker = WORKER.max(work.writing());
        let rest = resources.memory.checked_sub(PROGRAM + LEAST).filter(|rest| *rest >= worker);
        let Some(rest) = rest else {
            return Err(too_small(resources.memory, PROGRAM + LEAST + worker));
        };
        let threads = resources.threads.clamp(1, (rest / worker) as usize);
        let blocks = LEAST + (rest - threads as u64 * worker) / 2;
        Ok(Self { threads, blocks, points: 0, shift: MAX_SHIFT })
    }
}

fn too_small(memory: u64, least: u64) -> Error {
    too_little(memory, least).or("choose larger cells")
}
