//! A validated window of samples and its buffer.

use crate::grid::{GridInfo, GridSource};
use crate::sample::HeightSample;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// A rectangle of samples and the buffer for them.
pub(crate) struct SampleWindow<'a, H> {
    rect: Rect,
    out: &'a mut [H],
}

impl<'a, H> SampleWindow<'a, H> {
    /// Checks that `rect` is inside the grid and that `out` has its size.
    pub(crate) fn new(info: &GridInfo, rect: Rect, out: &'a mut [H]) -> Result<Self> {
        if !rect.fits(info.width, info.height) || rect.len() != out.len() {
            return Err(Error::usage(format!(
                "window of {} x {} samples at column {}, row {} does not fit the grid of {} x {} \
                 or its buffer of {}",
                rect.width,
                rect.height,
                rect.col,
                rect.row,
                info.width,
                info.height,
                out.len()
            )));
        }
        Ok(Self { rect, out })
    }

    /// The buffer of row `row` of `part`, which is inside the window.
    pub(crate) fn row(&mut self, part: Rect, row: u32) -> &mut [H] {
        let down = (part.row - self.rect.row + row) as usize;
        let start = down * self.rect.width as usize + (part.col - self.rect.col) as usize;
        &mut self.out[start..][..part.width as usize]
    }
}

/// Height types that grids can be read in.
pub(crate) trait GridHeight: HeightSample {
    fn read(grid: &dyn GridSource, rect: Rect, out: &mut [Self]) -> Result<()>;
    fn is_void(self) -> bool;
}

impl GridHeight for f32 {
    fn read(grid: &dyn GridSource, rect: Rect, out: &mut [f32]) -> Result<()> {
        grid.read_f32(rect, out)
    }

    fn is_void(self) -> bool {
        self.is_nan()
    }
}

impl GridHeight for f64 {
    fn read(grid: &dyn GridSource, rect: Rect, out: &mut [f64]) -> Result<()> {
        grid.read_f64(rect, out)
    }

    fn is_void(self) -> bool {
        self.is_nan()
    }
}
