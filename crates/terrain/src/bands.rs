//! Computed heights of rows at work, for outputs in low strips.
//!
//! The samples around a strip of a row or two can be hundreds of times as many as its own. So the rows of a band are
//! computed at once, piece by piece, and kept until the strips of the next band have been written. Threads that need the
//! same band compute different pieces of it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, TryLockError};

use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::lock;

/// Columns, and most rows, of a piece.
pub(crate) const PIECE: u32 = 512;
/// Most bytes for bands.
const MAX_BYTES: u64 = 64 << 20;
/// Bands in memory: that of the strips at work, and the one before or after.
const BANDS: usize = 2;

/// Bands of a grid, each of some rows and cut into pieces.
#[derive(Debug)]
pub(crate) struct ComputedBands {
    width: u32,
    /// Rows of a band; 0 if there is no memory for any.
    rows: u32,
    bands: Mutex<VecDeque<Arc<ComputedBand>>>,
}

/// Heights of the pieces of a band, as far as they were needed.
#[derive(Debug)]
struct ComputedBand {
    number: u32,
    pieces: Vec<Mutex<Option<Vec<f64>>>>,
}

impl ComputedBands {
    /// Bytes for bands within a memory limit.
    pub(crate) fn bytes(memory: u64) -> u64 {
        (memory / 8).min(MAX_BYTES)
    }

    /// Bands of a grid of this width, of at most `bytes` bytes in all.
    pub(crate) fn new(width: u32, bytes: u64) -> Self {
        let row = u64::from(width.div_ceil(PIECE) * PIECE) * 8 * BANDS as u64;
        let rows = (bytes / row).min(PIECE.into()) as u32;
        Self { width, rows, bands: Mutex::default() }
    }

    /// True if a rectangle is so low that it takes less time to compute its band.
    pub(crate) fn are_for(&self, rect: Rect) -> bool {
        rect.height <= self.rows / 2
    }

    fn band(&self, number: u32) -> Arc<ComputedBand> {
        let mut bands = lock(&self.bands);
        if let Some(band) = bands.iter().find(|band| band.number == number) {
            return Arc::clone(band);
        }
        let pieces = (0..self.width.div_ceil(PIECE)).map(|_| Mutex::default()).collect();
        let band = Arc::new(ComputedBand { number, pieces });
        if bands.len() == BANDS {
            bands.pop_front();
        }
        bands.push_back(Arc::clone(&band));
        band
    }

    /// Passes the heights of the pieces of some `columns` of pieces that `rect` intersects to `visit`; `compute` computes
    /// them.
    pub(crate) fn each(
        &self,
        rect: Rect,
        grid: Rect,
        columns: &[u32],
        compute: &mut dyn FnMut(Rect) -> Result<Vec<f64>>,
        visit: &mut dyn FnMut(Rect, &[f64]),
    ) -> Result<()> {
        for number in rect.row / self.rows..=(rect.end_row() - 1) / self.rows {
            let band = self.band(number);
            let mut left = columns.to_vec();
            // Those that another thread is computing come last.
            for is_waiting in [false, true] {
                let mut busy = Vec::new();
                for column in left {
                    let slot = &band.pieces[column as usize];
                    let piece = Rect::new(column * PIECE, number * self.rows, PIECE, self.rows);
                    let piece = piece.intersect(&grid);
                    let mut heights = match slot.try_lock() {
                        Err(TryLockError::WouldBlock) if !is_waiting => {
                            busy.push(column);
                            continue;
                        }
                        Ok(heights) => heights,
                        Err(_) => lock(slot),
                    };
                    let heights = match &mut *heights {
                        Some(heights) => heights,
                        none => none.insert(compute(piece)?),
                    };
                    visit(piece, heights);
                }
                left = busy;
            }
        }
        Ok(())
    }
}
