//! Blocks of remote files, asked for before they are read.

use std::ops::Range;

use super::blocks::GeoTiffBlockExtent;
use super::image::{GeoTiffImage, blocks_touching};
use super::layout::GeoTiffLayout;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::AHEAD;

impl GeoTiffImage {
    /// Asks for what is missing of the blocks of `rect`, and with it for the next blocks of what is `expected` to be read
    /// from the top.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn prefetch(&self, rect: Rect, expected: Rect) -> Result<()> {
        let layout = &self.blocks.layout;
        // Rows of blocks that are not decoded are asked for as they are read; with them, those below.
        let is_wide = rect.col == expected.col && rect.width == expected.width;
        let needed = blocks_touching(layout, rect).map(|at| match layout.is_read_by_rows() {
            true if !is_wide => Ok(None),
            _ => self.needed(at, rect),
        });
        let needed: Vec<_> = needed.filter_map(Result::transpose).collect::<Result<_>>()?;
        let mut ahead = Vec::new();
        let mut left = AHEAD;
        let later = Rect {
            row: rect.end_row(),
            height: expected.end_row().saturating_sub(rect.end_row()),
            ..expected
        };
        let rows = blocks_touching(layout, rect).filter(|_| layout.is_read_by_rows() && is_wide);
        let rows = rows.map(|at| (at, later));
        let after = blocks_after(layout, rect, expected).map(|at| (at, expected));
        for (at, rect) in rows.chain(after) {
            let Some(range) = self.needed(at, rect)? else { continue };
            let bytes = range.end - range.start;
            if bytes > left {
                break;
            }
            left -= bytes;
            ahead.push(range);
        }
        self.file.prefetch(&needed, &ahead)
    }

    /// The bytes of a block, or of the rows of it that are in `rect`.
    fn needed(&self, [bx, by]: [u32; 2], rect: Rect) -> Result<Option<Range<u64>>> {
        let layout = &self.blocks.layout;
        let Some(place) = self.blocks.place(bx, by, &self.file)? else { return Ok(None) };
        let GeoTiffBlockExtent { offset, bytes } = place;
        if !layout.is_read_by_rows() {
            return Ok(Some(offset..offset + bytes));
        }
        let block = layout.block_rect(bx, by);
        let part = block.intersect(&rect);
        if part.is_empty() {
            return Ok(None);
        }
        let rows = u64::from(part.row - block.row)..u64::from(part.end_row() - block.row);
        let [first, end] = [rows.start, rows.end].map(|row| (row * layout.row_bytes()).min(bytes));
        Ok(Some(offset + first..offset + end))
    }
}

/// The blocks of `expected` after those of `rect`: to the right of them, and below.
fn blocks_after(
    layout: &GeoTiffLayout,
    rect: Rect,
    expected: Rect,
) -> impl Iterator<Item = [u32; 2]> {
    let right = Rect {
        col: rect.end_col(),
        width: expected.end_col().saturating_sub(rect.end_col()),
        ..rect
    };
    let below = Rect {
        row: rect.end_row(),
        height: expected.end_row().saturating_sub(rect.end_row()),
        ..expected
    };
    let is_new = move |[_, by]: &[u32; 2], layout: &GeoTiffLayout| {
        u64::from(*by) * u64::from(layout.block_height) >= u64::from(rect.end_row())
    };
    let right = blocks_touching(layout, right.intersect(&expected));
    let below = blocks_touching(layout, below.intersect(&expected));
    right.chain(below.filter(move |at| is_new(at, layout)))
}
