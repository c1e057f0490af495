//! How the memory of a cloud-to-grid job is divided.
//!
//! | share | bytes |
//! |---|---|
//! | the program itself | [`PROGRAM`] |
//! | half of all, if there is a surface: points it goes through | [`GridBudget::points`] |
//! | the table of blocks | 64 for each |
//! | each thread: a batch of points and what decodes it, later a block of the output | [`WORKER`] or more |
//! | each thread: the columns of attributes, if there are any, and what decodes them | [`COLUMNS`] |
//! | the rest: blocks of cells, those beyond it spilled | [`GridBudget::blocks`] |

use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::memory::{PROGRAM, too_little};
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

impl GridBudget {
    pub(super) fn divide(
        resources: &Resources,
        format: &GridFormat,
        sink: &dyn GridSink,
        extent: &GridExtent,
        recipe: &StatisticRecipe,
        points: u64,
    ) -> Result<Self> {
        let Resources { threads, memory: all, .. } = *resources;
        let surface_share = if recipe.triangulates() { all / 2 } else { 0 };
        let memory = all - surface_share;
        let worker = worker(format, sink, extent, recipe);
        let cells = cells(extent);
        let cell = recipe.bytes_per_cell() as u64
            + recipe.bytes_per_point() as u64 * points.div_ceil(cells);
        let slots = |shift: u32| cells.div_ceil(1 << (2 * shift)).saturating_mul(SLOT);
        let left = |threads: u64, shift: u32| {
            memory.checked_sub(PROGRAM + slots(shift))?.checked_sub(threads * worker)
        };
        let fits = |threads: &u64| left(*threads, MAX_SHIFT).is_some_and(|left| left >= LEAST);
        let threads = (1..=threads.max(1) as u64).rev().find(fits).ok_or_else(|| {
            let least = PROGRAM + slots(MAX_SHIFT) + worker + LEAST;
            too_small(all, if surface_share > 0 { 2 * least } else { least })
        })?;
        let good = |shift: &u32| {
            let room = left(threads, *shift).unwrap_or(0);
            (cell << (2 * shift)).saturating_mul(AT_HAND * threads) <= room && room >= LEAST
        };
        let shift = (MIN_SHIFT..=MAX_SHIFT).rev().find(good).unwrap_or_else(|| {
            let held = |shift: &u32| left(threads, *shift).is_some_and(|left| left >= LEAST);
            (MIN_SHIFT..=MAX_SHIFT).find(held).unwrap_or(MAX_SHIFT)
        });
        let blocks = left(threads, shift).unwrap_or(LEAST);
        Ok(Self { threads: threads as usize, blocks, points: surface_share, shift })
    }

    /// Least memory for one thread in both [`divide`](Self::divide), if half of it goes to triangulated points,
    /// and [`writing`](Self::writing).
    pub(super) fn least(
        format: &GridFormat,
        sink: &dyn GridSink,
        extent: &GridExtent,
        recipe: &StatisticRecipe,
    ) -> u64 {
        let slots = cells(extent).div_ceil(1 << (2 * MAX_SHIFT)).saturating_mul(SLOT);
        let one = PROGRAM + slots + LEAST + worker(format, sink, extent, recipe);
        if recipe.triangulates() { 2 * one } else { one }
    }

    /// Fails if an earlier step exceeds the memory; the advised budget suffices for all steps.
    pub(super) fn check(
        resources: &Resources,
        format: &GridFormat,
        (sink, extent, recipe): (&dyn GridSink, &GridExtent, &StatisticRecipe),
        before: u64,
    ) -> Result<()> {
        match before > resources.memory {
            true => {
                let least = before.max(Self::least(format, sink, extent, recipe));
                Err(too_small(resources.memory, least))
            }
            false => Ok(()),
        }
    }

    /// The budget for writing a grid whose values are read from files: the rest is for their blocks.
    pub(super) fn writing(
        resources: &Resources,
        format: &GridFormat,
        sink: &dyn GridSink,
        extent: &GridExtent,
        recipe: &StatisticRecipe,
    ) -> Result<Self> {
        let worker = WORKER.max(writing(format, sink, extent, recipe));
        let left = |threads: usize| {
            resources.memory.checked_sub(PROGRAM + LEAST + threads as u64 * worker)
        };
        let fits = |threads: &usize| left(*threads).is_some();
        let threads = (1..=resources.threads.max(1)).rev().find(fits);
        let least = PROGRAM + LEAST + worker;
        let threads = threads.ok_or_else(|| too_small(resources.memory, least))?;
        let blocks = LEAST + left(threads).unwrap_or(0) / 2;
        Ok(Self { threads, blocks, points: 0, shift: MAX_SHIFT })
    }
}

/// Bytes a thread needs.
fn worker(
    format: &GridFormat,
    sink: &dyn GridSink,
    extent: &GridExtent,
    recipe: &StatisticRecipe,
) -> u64 {
    let around = if recipe.triangulates() { neighbours::WORKER } else { 0 };
    let columns = if recipe.attributes().is_empty() { 0 } else { COLUMNS };
    columns + WORKER.max(around + writing(format, sink, extent, recipe))
}

fn cells(extent: &GridExtent) -> u64 {
    let (width, height) = extent.lattice.size();
    u64::from(width).saturating_mul(u64::from(height)).max(1)
}

/// Bytes a thread needs to write a block of the output, with the margin for filling voids.
fn writing(
    format: &GridFormat,
    sink: &dyn GridSink,
    extent: &GridExtent,
    recipe: &StatisticRecipe,
) -> u64 {
    let (width, height) = sink.block();
    let (width, height) = (width.min(extent.output.width), height.min(extent.output.height));
    let (width, height) = (u64::from(width), u64::from(height));
    let around = 2 * u64::from(extent.fill);
    let coded = 8 * recipe.bands().len() as u64;
    let samples = width.saturating_mul(height).saturating_mul(format.bytes_per_sample + coded);
    samples.saturating_add((width + around).saturating_mul(height + around).saturating_mul(8))
}

fn too_small(memory: u64, least: u64) -> Error {
    too_little(memory, least).or("choose larger cells")
}
