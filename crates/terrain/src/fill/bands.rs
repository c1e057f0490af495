//! Filled heights of rows at work, for outputs in low strips.
//!
//! The samples around a strip of a row or two are hundreds of times as many as its own. So the rows of a band are filled
//! at once, piece by piece, and kept until the strips of the next band have been written. Threads that need the same band
//! fill different pieces of it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, TryLockError};

use super::PIECE;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::lock;

/// Bands in memory: that of the strips at work, and the one before or after.
const BANDS: usize = 2;

/// Bands of a grid, each of some rows and cut into pieces.
#[derive(Debug)]
pub(super) struct FilledBands {
    width: u32,
    /// Rows of a band; 0 if there is no memory for any.
    rows: u32,
    bands: Mutex<VecDeque<Arc<FilledBand>>>,
}

/// Filled heights of the pieces of a band, as far as they were needed.
#[derive(Debug)]
struct FilledBand {
    number: u32,
    pieces: Vec<Mutex<Option<Vec<f64>>>>,
}

impl FilledBands {
    /// Bands of a grid of this width, of at most `bytes` bytes in all.
    pub(super) fn new(width: u32, bytes: u64) -> Self {
        let row = u64::from(width.div_ceil(PIECE) * PIECE) * 8 * BANDS as u64;
        let rows = (bytes / row).min(PIECE.into()) as u32;
        Self { width, rows, bands: Mutex::default() }
    }

    /// True if a rectangle is so low that it takes less time to fill its band.
    pub(super) fn are_for(&self, rect: Rect) -> bool {
        rect.height <= self.rows / 2
    }

    fn band(&self, number: u32) -> Arc<FilledBand> {
        let mut bands = lock(&self.bands);
        if let Some(band) = bands.iter().find(|band| band.number == number) {
            return Arc::clone(band);
        }
        let pieces = (0..self.width.div_ceil(PIECE)).map(|_| Mutex::default()).collect();
        let band = Arc::new(FilledBand { number, pieces });
        if bands.len() == BANDS {
            bands.pop_front();
        }
        bands.push_back(Arc::clone(&band));
        band
    }

    /// Passes the filled heights of the pieces of some `columns` of pieces that `rect` intersects to `visit`; `fill`
    /// computes them.
    pub(super) fn each(
        &self,
        rect: Rect,
        grid: Rect,
        columns: &[u32],
        fill: &mut dyn FnMut(Rect) -> Result<Vec<f64>>,
        visit: &mut dyn FnMut(Rect, &[f64]),
    ) -> Result<()> {
        for number in rect.row / self.rows..=(rect.end_row() - 1) / self.rows {
            let band = self.band(number);
            let mut left = columns.to_vec();
            // Those that another thread is filling come last.
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
                        none => none.insert(fill(piece)?),
                    };
                    visit(piece, heights);
                }
                left = busy;
            }
        }
        Ok(())
    }
}
