//! Copying one level of a grid: threads read and encode pieces in any order, and hand them over in
//! theirs.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex};

use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::{Cancel, Progress};
use terrane_files::{lock, wait};
use terrane_raster::GridSource;
use terrane_raster::tiled_tiff::HeightSlice;
use terrane_raster::write::GridSink;

/// The units of work, along rows of blocks: blocks, or some rows of one each.
#[derive(Clone, Copy, Debug)]
pub struct CopyPieces {
    width: u32,
    height: u32,
    block_width: u32,
    /// Rows of a piece; divides the block's.
    rows: u32,
}

impl CopyPieces {
    /// Pieces are whole blocks, unless the sink takes parts and a row of blocks across those of the
    /// source is more than half of `cache` holds: then they are lower, so that no block is decoded
    /// twice.
    pub fn new(window: Rect, source: &dyn GridSource, sink: &dyn GridSink, cache: u64) -> Self {
        let info = source.info();
        let (block_width, mut rows) = sink.block();
        let row_bytes = u64::from(window.width) * info.sample_type.bytes() as u64;
        let lower = !sink.in_order() && info.block.0 > block_width;
        while lower && rows % 2 == 0 && u64::from(rows) * row_bytes > cache / 2 {
            rows /= 2;
        }
        Self { width: window.width, height: window.height, block_width, rows }
    }

    fn across(&self) -> u64 {
        u64::from(self.width.div_ceil(self.block_width))
    }

    fn count(&self) -> u64 {
        self.across() * u64::from(self.height.div_ceil(self.rows))
    }

    fn rect(&self, index: u64) -> Rect {
        let (down, across) = ((index / self.across()) as u32, (index % self.across()) as u32);
        let (col, row) = (across * self.block_width, down * self.rows);
        let (width, height) = (self.width - col, self.height - row);
        Rect::new(col, row, self.block_width.min(width), self.rows.min(height))
    }
}

/// Copying, shared between the threads.
pub struct CopyTask<'a> {
    /// One for each band; equal in size and type.
    pub sources: &'a [&'a dyn GridSource],
    /// The part of the sources to copy.
    pub window: Rect,
    /// The sink to write to.
    pub sink: &'a dyn GridSink,
    /// How it is divided.
    pub pieces: CopyPieces,
}

/// Buffers of one thread.
#[derive(Default)]
struct CopyBuffers {
    narrow: Vec<f32>,
    wide: Vec<f64>,
    /// Band by band.
    bytes: Vec<Vec<u8>>,
}

impl CopyTask<'_> {
    /// Copies everything on `threads` threads.
    pub fn run(
        &self,
        threads: usize,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<CopyStatistics> {
        let (next, turns) = (AtomicU64::new(0), OrderedTurns::default());
        let summaries: Result<_> = std::thread::scope(|scope| {
            let spawned =
                (0..threads).map(|_| scope.spawn(|| self.work(&next, &turns, progress, cancel)));
            // Collected before any is joined, so that all of them run at once.
            let workers: Vec<_> = spawned.collect();
            let joined = workers.into_iter().map(|worker| worker.join());
            joined.map(|end| end.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
        });
        let summaries: Vec<CopyStatistics> = summaries?;
        Ok(summaries.into_iter().fold(CopyStatistics::NONE, CopyStatistics::join))
    }

    fn work(
        &self,
        next: &AtomicU64,
        turns: &OrderedTurns,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<CopyStatistics> {
        let alarm = TurnAlarm(turns);
        let bytes = vec![Vec::new(); self.sources.len()];
        let mut buffers = CopyBuffers { bytes, ..CopyBuffers::default() };
        let mut summary = CopyStatistics::NONE;
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= self.pieces.count() || turns.are_over() {
                std::mem::forget(alarm);
                return Ok(summary);
            }
            cancel.check()?;
            let rect = self.pieces.rect(index);
            summary = summary.join(self.copy(rect, &mut buffers)?);
            if self.sink.in_order() {
                turns.take(index, || {
                    buffers.bytes.iter().try_for_each(|bytes| self.sink.append(bytes))
                })?;
            }
            progress.advance(rect.len() as u64);
        }
    }

    fn copy(&self, rect: Rect, buffers: &mut CopyBuffers) -> Result<CopyStatistics> {
        let Rect { col, row, .. } = self.window;
        let from = Rect::new(col + rect.col, row + rect.row, rect.width, rect.height);
        let mut summary = CopyStatistics::NONE;
        for (band, source) in (0..).zip(self.sources) {
            summary = summary.join(self.copy_band(band, *source, rect, from, buffers)?);
        }
        self.sources.iter().for_each(|source| source.release(from));
        Ok(summary)
    }

    fn copy_band(
        &self,
        band: u32,
        source: &dyn GridSource,
        rect: Rect,
        from: Rect,
        buffers: &mut CopyBuffers,
    ) -> Result<CopyStatistics> {
        let CopyBuffers { narrow, wide, bytes } = buffers;
        let bytes = &mut bytes[band as usize];
        if source.info().exact_in_f32() {
            narrow.resize(rect.len(), 0.0);
            source.read_f32(from, narrow)?;
            self.sink.encode(band, rect, HeightSlice::F32(narrow), bytes)?;
            return Ok(CopyStatistics::of_f32(narrow));
        }
        wide.resize(rect.len(), 0.0);
        source.read_f64(from, wide)?;
        self.sink.encode(band, rect, HeightSlice::F64(wide), bytes)?;
        Ok(CopyStatistics::of_f64(wide))
    }
}

/// Lets the holders of 0, 1, 2, ... through in that order.
#[derive(Default)]
struct OrderedTurns {
    state: Mutex<CopyState>,
    changed: Condvar,
}

#[derive(Default)]
struct CopyState {
    next: u64,
    over: bool,
}

impl OrderedTurns {
    /// Waits until all before `index` are done, then does `work`; does nothing when the turns have ended.
    fn take(&self, index: u64, work: impl FnOnce() -> Result<()>) -> Result<()> {
        let mut state = lock(&self.state);
        while state.next != index && !state.over {
            state = wait(&self.changed, state);
        }
        if !state.over {
            work()?;
            state.next += 1;
            self.changed.notify_all();
        }
        Ok(())
    }

    fn are_over(&self) -> bool {
        lock(&self.state).over
    }
}

/// Ends the turns when a thread fails or panics, so that none waits for it.
struct TurnAlarm<'a>(&'a OrderedTurns);

impl Drop for TurnAlarm<'_> {
    fn drop(&mut self) {
        lock(&self.0.state).over = true;
        self.0.changed.notify_all();
    }
}

/// Statistics of the copied samples.
#[derive(Clone, Copy, Debug)]
pub struct CopyStatistics {
    /// Samples with a value.
    pub valid: u64,
    /// The lowest value.
    pub lowest: f64,
    /// The highest value.
    pub highest: f64,
}

impl CopyStatistics {
    /// Statistics of no samples.
    pub const NONE: Self = Self { valid: 0, lowest: f64::INFINITY, highest: f64::NEG_INFINITY };

    /// Statistics of both together.
    pub fn join(self, other: Self) -> Self {
        Self {
            valid: self.valid + other.valid,
            lowest: self.lowest.min(other.lowest),
            highest: self.highest.max(other.highest),
        }
    }

    fn of_f32(heights: &[f32]) -> Self {
        let (mut valid, mut lowest, mut highest) = (0, f32::INFINITY, f32::NEG_INFINITY);
        for &z in heights {
            valid += u64::from(!z.is_nan());
            lowest = if z < lowest { z } else { lowest };
            highest = if z > highest { z } else { highest };
        }
        Self { valid, lowest: f64::from(lowest), highest: f64::from(highest) }
    }

    fn of_f64(heights: &[f64]) -> Self {
        let (mut valid, mut lowest, mut highest) = (0, f64::INFINITY, f64::NEG_INFINITY);
        for &z in heights {
            valid += u64::from(!z.is_nan());
            lowest = if z < lowest { z } else { lowest };
            highest = if z > highest { z } else { highest };
        }
        Self { valid, lowest, highest }
    }
}
