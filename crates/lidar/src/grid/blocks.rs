//! The cells of a grid in blocks: made when a point first touches one, spilled when memory is short.
//!
//! Accumulators can be merged, so a spilled block starts empty when it is touched again, and its parts are
//! merged when it is read (or when they become many). The least recently touched are spilled first.
//!
//! Blocks are of 256 x 256 cells, smaller where memory is short. A batch of points is cut into runs for one
//! block, which is locked once for each; a batch with short runs is sorted first. A cell that takes points
//! within a radius reaches into neighbouring blocks: such a point is added to each of them.

use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard};

use super::budget::GridBudget;
use super::extent::GridExtent;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::{self as files, SpoolFile, lock};
use terrane_gridding::{CellBlock, StatisticRecipe};

/// All blocks of a grid.
pub(super) struct CellBlocks<'a> {
    recipe: &'a StatisticRecipe,
    /// Blocks have 2^shift columns and rows.
    shift: u32,
    width: u32,
    height: u32,
    slots: Vec<CellBlockSlot>,
    /// Budget for blocks in memory, and bytes in use.
    budget: u64,
    used: AtomicU64,
    /// Counts touches.
    clock: AtomicU64,
    spool: SpoolFile,
    spilling: Mutex<()>,
    /// Number of written cells of each block; 0 to keep it.
    written: Vec<AtomicU32>,
}

/// One block.
#[derive(Default)]
struct CellBlockSlot {
    state: Mutex<CellBlockState>,
    /// When it was last touched; 0 while it is not in memory.
    touched: AtomicU64,
}

#[derive(Default)]
struct CellBlockState {
    block: Option<Box<CellBlock>>,
    spilled: Vec<SpilledBlock>,
    settled: bool,
}

/// A block in the spool.
struct SpilledBlock {
    place: files::SpoolExtent,
    lengths: Vec<usize>,
}

/// Parts of one block that lie in the spool at most.
const MAX_PARTS: usize = 4;

impl<'a> CellBlocks<'a> {
    pub(super) fn new(
        recipe: &'a StatisticRecipe,
        extent: &GridExtent,
        budget: &GridBudget,
        folder: &Path,
    ) -> Self {
        let (width, height) = extent.lattice.size();
        let side = 1 << budget.shift;
        let blocks = width.div_ceil(side) as usize * height.div_ceil(side) as usize;
        let mut all = Self {
            recipe,
            shift: budget.shift,
            width,
            height,
            slots: (0..blocks).map(|_| CellBlockSlot::default()).collect(),
            budget: budget.blocks,
            used: AtomicU64::new(0),
            clock: AtomicU64::new(1),
            spool: SpoolFile::new(folder),
            spilling: Mutex::new(()),
            written: Vec::new(),
        };
        // Voids are filled from cells that are written already: then no block is thrown away.
        let unwritten = (0..blocks as u32).map(|index| match extent.fill {
            0 => all.window(index).intersect(&extent.output).len() as u32,
            _ => 0,
        });
        all.written = unwritten.map(AtomicU32::new).collect();
        all
    }

    /// Columns and rows of a block, as a power of two.
    pub(super) fn shift(&self) -> u32 {
        self.shift
    }

    /// Number of blocks in a row.
    pub(super) fn across(&self) -> u32 {
        self.width.div_ceil(1 << self.shift)
    }

    /// The cells of a block; its rows lie 2^shift places apart.
    pub(super) fn window(&self, index: u32) -> Rect {
        let (down, across) = (index / self.across(), index % self.across());
        let (col, row) = (across << self.shift, down << self.shift);
        let side = 1 << self.shift;
        Rect::new(col, row, side.min(self.width - col), side.min(self.height - row))
    }

    /// Bytes that went through the temporary file.
    pub(super) fn spilled_bytes(&self) -> u64 {
        self.spool.written()
    }

    /// Lets `work` change a block, which is made if need be.
    pub(super) fn change(
        &self,
        index: u32,
        work: impl FnOnce(&mut CellBlock) -> Result<()>,
    ) -> Result<()> {
        let slot = &self.slots[index as usize];
        let mut state = self.present(slot)?;
        let Some(block) = state.block.as_mut() else { return Ok(()) };
        let before = block.memory_use();
        let done = work(block);
        let grown = (block.memory_use() - before) as u64;
        // Counted before another thread can spill the block and count it out.
        let used = self.used.fetch_add(grown, Ordering::Relaxed) + grown;
        drop(state);
        if grown > 0 && used > self.budget {
            self.evict()?;
        }
        done
    }

    /// The block of a slot in memory, as it is or empty.
    fn present<'s>(&self, slot: &'s CellBlockSlot) -> Result<MutexGuard<'s, CellBlockState>> {
        let now = self.clock.fetch_add(1, Ordering::Relaxed);
        let state = lock(&slot.state);
        if state.block.is_some() {
            slot.touched.store(now, Ordering::Relaxed);
            return Ok(state);
        }
        // Memory is freed without holding a block, as that locks others.
        drop(state);
        let bytes = (self.recipe.bytes_per_cell() as u64) << (2 * self.shift);
        self.reserve(bytes)?;
        let mut state = lock(&slot.state);
        slot.touched.store(now, Ordering::Relaxed);
        match state.block {
            Some(_) => drop(self.used.fetch_sub(bytes, Ordering::Relaxed)),
            None => state.block = Some(Box::new(self.empty())),
        }
        state.settled = false;
        Ok(state)
    }

    fn empty(&self) -> CellBlock {
        CellBlock::new(self.recipe, 1 << (2 * self.shift))
    }

    /// Reserves bytes.
    fn reserve(&self, bytes: u64) -> Result<()> {
        let used = self.used.fetch_add(bytes, Ordering::Relaxed) + bytes;
        if used > self.budget { self.evict() } else { Ok(()) }
    }

    /// Spills blocks, the least recently touched first, until a quarter of the budget is free.
    fn evict(&self) -> Result<()> {
        let _one_at_a_time = lock(&self.spilling);
        if self.used.load(Ordering::Relaxed) <= self.budget {
            return Ok(());
        }
        let touched = self.slots.iter().map(|slot| slot.touched.load(Ordering::Relaxed));
        let mut order: Vec<(u64, usize)> = touched.zip(0..).filter(|(at, _)| *at > 0).collect();
        order.sort_unstable();
        for (_, index) in order {
            if self.used.load(Ordering::Relaxed) <= self.budget / 4 * 3 {
                break;
            }
            self.spill(&self.slots[index])?;
        }
        Ok(())
    }

    fn spill(&self, slot: &CellBlockSlot) -> Result<()> {
        let mut state = lock(&slot.state);
        let Some(mut block) = state.block.take() else { return Ok(()) };
        slot.touched.store(0, Ordering::Relaxed);
        let before = block.memory_use() as u64;
        if state.spilled.len() >= MAX_PARTS {
            self.join(&mut block, &mut state.spilled)?;
        }
        let parts = block.parts();
        let lengths = parts.iter().map(|part| part.len()).collect();
        let place = self.spool.put(&parts)?;
        state.spilled.push(SpilledBlock { place, lengths });
        state.settled = false;
        self.used.fetch_sub(before, Ordering::Relaxed);
        Ok(())
    }

    /// Adds the spilled parts of a block to it.
    fn join(&self, block: &mut CellBlock, spilled: &mut Vec<SpilledBlock>) -> Result<()> {
        for SpilledBlock { place, lengths } in spilled.drain(..) {
            let mut other = self.empty();
            self.spool.take(place, &mut other.parts_mut(&lengths))?;
            block.fold(&other)?;
        }
        Ok(())
    }

    /// Calls `visit` with a complete block; skips one that was never touched.
    pub(super) fn read(&self, index: u32, visit: impl FnOnce(&CellBlock)) -> Result<()> {
        let slot = &self.slots[index as usize];
        let state = lock(&slot.state);
        if state.block.is_none() && state.spilled.is_empty() {
            return Ok(());
        }
        drop(state);
        let mut state = self.present(slot)?;
        let CellBlockState { block, spilled, settled } = &mut *state;
        let Some(block) = block.as_mut() else { return Ok(()) };
        let before = block.memory_use();
        if !spilled.is_empty() {
            self.join(block, spilled)?;
            *settled = false;
        }
        if !*settled {
            block.settle();
            *settled = true;
        }
        visit(block);
        let grown = (block.memory_use() - before) as u64;
        drop(state);
        if grown > 0 { self.reserve(grown) } else { Ok(()) }
    }

    /// Marks the cells of `rect` as written; frees blocks that are written completely.
    pub(super) fn release(&self, rect: Rect) {
        for index in self.touching(rect) {
            let cells = self.window(index).intersect(&rect).len() as u32;
            let written = &self.written[index as usize];
            let left = written.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                (left > 0 && cells > 0).then(|| left.saturating_sub(cells))
            });
            if left == Ok(cells) {
                self.forget(&self.slots[index as usize]);
            }
        }
    }

    fn forget(&self, slot: &CellBlockSlot) {
        let mut state = lock(&slot.state);
        slot.touched.store(0, Ordering::Relaxed);
        let CellBlockState { block, spilled, .. } = std::mem::take(&mut *state);
        let bytes = block.map_or(0, |block| block.memory_use() as u64);
        self.used.fetch_sub(bytes, Ordering::Relaxed);
        spilled.into_iter().for_each(|part| self.spool.free(part.place));
    }

    /// The blocks that a rectangle of cells touches.
    pub(super) fn touching(&self, rect: Rect) -> impl Iterator<Item = u32> + use<> {
        let (shift, across) = (self.shift, self.across());
        let side = 1 << shift;
        let rows = rect.row >> shift..(rect.row + rect.height).div_ceil(side);
        let cols = rect.col >> shift..(rect.col + rect.width).div_ceil(side);
        rows.flat_map(move |row| cols.clone().map(move |col| row * across + col))
    }
}
