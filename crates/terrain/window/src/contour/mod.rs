//! Contour lines of a rectangle of samples: marching squares for all levels in one pass.
//!
//! **Rules.** The surface is linear along the edges of the lattice. A sample is *above* a level when its height
//! is equal to it or higher; a line crosses an edge where one end is above and the other is not, at the
//! linearly interpolated position, but never nearer to a sample than [`NEAREST`] of the edge. So a line passes
//! close by a sample exactly on the level, on its lower side, instead of through it: lines do not branch, no
//! two crossings of a level are at one place, and no segment has length 0. Within a cell the crossings are
//! joined by straight segments; where all four edges are crossed, the mean of the four samples, summed row by
//! row, decides whether the centre is above, and thereby which crossings are joined. A cell with a void has no
//! segments: lines end at voids and at the border of the grid, and are closed otherwise.
//!
//! **Direction.** Higher ground is on the right where the first row is in the north: a line goes
//! clockwise around a top (as those of `gdal_contour` do). Each crossing has one segment that ends
//! there and one that begins there, whatever the level.
//!
//! **No crossings.** Within a cell, the ends of the segments are ordered along its border like their levels, so
//! no two segments cross; as all crossings of a level are at different positions, they do not touch either. On
//! an edge that rises through more than 1 / [`NEAREST`] levels, lines of neighbouring levels may touch.
//!
//! **Tiles.** A crossing depends only on the two samples of its edge, first to second, so rectangles that share
//! a rim agree exactly.
//!
//! Marching squares: W. Lorensen and H. Cline, "Marching cubes" (1987), in the plane; saddles as in
//! P. Bourke's CONREC (1987), decided by the mean.

mod levels;
mod link;
#[cfg(test)]
mod oracle;
mod sweep;
#[cfg(test)]
mod tests;
mod vertex;

pub use levels::ContourLevels;
pub use link::{WindowContour, WindowContours};
pub use sweep::{ContourWindow, NEAREST};
pub use vertex::{ContourVertex, CrossedEdge};

use sweep::{ContourSweep, CrossingNode};
use terrane_base::Cancel;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// Bytes that [`trace`] takes for each crossing, without those of [`WindowContours`].
pub const CROSSING_BYTES: u64 = size_of::<CrossingNode>() as u64;

/// Most samples along a side of a rectangle.
pub const MOST_SIDE: u32 = 1 << 14;

/// Memory that [`trace`] keeps between calls.
#[derive(Debug, Default)]
pub struct ContourScratch {
    sweep: ContourSweep,
}

/// Fills `lines` with the contour lines of a window at all `levels`, in an order that depends on the
/// window alone.
///
/// O(samples + crossings). Takes [`CROSSING_BYTES`] for each crossing. Cancellation is checked row by row.
///
/// # Errors
/// `Usage` for a window whose heights do not fit its size, or of more than [`MOST_SIDE`] samples along a side;
/// `BadInput` for a height beyond 1e30, or one that is more than 2^30 intervals from the base; `Resource` for
/// more than `max_crossings` crossings; `Interrupted` when cancelled.
pub fn trace<H: Copy + Into<f64>>(
    window: &ContourWindow<'_, H>,
    levels: &ContourLevels,
    max_crossings: u64,
    scratch: &mut ContourScratch,
    lines: &mut WindowContours,
    cancel: &Cancel,
) -> Result<()> {
    lines.clear();
    let Rect { width, height, .. } = window.rect;
    if window.rect.len() != window.heights.len() || width.max(height) > MOST_SIDE {
        return Err(Error::usage(format!(
            "a window of {width} x {height} samples is out of range or does not match its {} heights",
            window.heights.len()
        )));
    }
    // Nodes are numbered in 32 bits.
    let max_crossings = max_crossings.min(u64::from(u32::MAX - 1));
    scratch.sweep.run(window, levels, max_crossings, cancel)?;
    lines.link(&mut scratch.sweep.nodes, window.rect, window.grid_width, cancel)
}
