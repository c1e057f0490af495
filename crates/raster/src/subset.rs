//! Adapter for a window of a grid.

use std::path::PathBuf;

use crate::format::GridOpenOptions;
use crate::grid::{GridInfo, GridSource};
use crate::sample::HeightSample;
use crate::window::{GridHeight, SampleWindow};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// Overlaps below this fraction of a cell are rounding errors.
const HAIR: f64 = 1e-6;

/// A window of a grid.
struct WindowedGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    /// Window in the whole grid.
    window: Rect,
}

/// The cells of the grid of `open` that overlap a box (x min, y min, x max, y max). The cell of a sample is
/// the square around it, for points and areas, so the box is extended to whole cells and clipped to the grid.
/// On a rotated grid the window is the bounding rectangle of the box in columns and rows.
///
/// # Errors
/// Errors of `open`; a box without a cell.
pub(crate) fn part(
    bbox: [f64; 4],
    options: &GridOpenOptions,
    open: impl FnOnce(&GridOpenOptions) -> Result<Box<dyn GridSource>>,
) -> Result<Box<dyn GridSource>> {
    let inner = open(&GridOpenOptions { bbox: None, ..options.clone() })?;
    let info = inner.info();
    let window = window(info, bbox)?;
    let transform = info.transform.shifted(f64::from(window.col), f64::from(window.row));
    let info = GridInfo { width: window.width, height: window.height, transform, ..info.clone() };
    Ok(Box::new(WindowedGrid { info, inner, window }))
}

impl WindowedGrid {
    fn whole(&self, rect: Rect) -> Rect {
        Rect { col: rect.col + self.window.col, row: rect.row + self.window.row, ..rect }
    }

    fn read<H: GridHeight + HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        SampleWindow::new(&self.info, rect, out)?;
        H::read(&*self.inner, self.whole(rect), out)
    }
}

impl GridSource for WindowedGrid {
    reads_alike!();

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }

    fn release(&self, rect: Rect) {
        self.inner.release(self.whole(rect));
    }

    fn copied(&self, rect: Rect) {
        self.inner.copied(self.whole(rect));
    }

    fn advise_read(&self, rect: Rect) {
        self.inner.advise_read(self.whole(rect));
    }
}

fn window(info: &GridInfo, [x0, y0, x1, y1]: [f64; 4]) -> Result<Rect> {
    let corners =
        [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(|[x, y]| info.transform.invert(x, y));
    let (col, width) = span(corners.map(|c| c[0]), info.width);
    let (row, height) = span(corners.map(|c| c[1]), info.height);
    let ordered = x0 <= x1 && y0 <= y1;
    if !ordered || width == 0 || height == 0 {
        let message = format!("box {x0},{y0},{x1},{y1} contains no cell");
        let [a, b] = extent(info);
        let extent = format!("{},{},{},{}", a[0], a[1], b[0], b[1]);
        return Err(
            Error::usage(message).remedy(format!("pass x min,y min,x max,y max within {extent}"))
        );
    }
    Ok(Rect::new(col, row, width, height))
}

/// First cell and number of cells covered by four lattice positions.
fn span(positions: [f64; 4], side: u32) -> (u32, u32) {
    let least = positions.into_iter().fold(f64::INFINITY, f64::min) + 0.5;
    let most = positions.into_iter().fold(f64::NEG_INFINITY, f64::max) + 0.5;
    let side = f64::from(side);
    let first = (least + HAIR).floor();
    let end = (most - HAIR).ceil().max(first + 1.0);
    let (first, end) = (first.clamp(0.0, side) as u32, end.clamp(0.0, side) as u32);
    (first, end.saturating_sub(first))
}

/// Bounding box of the cells of the grid in world coordinates.
fn extent(info: &GridInfo) -> [[f64; 2]; 2] {
    let (right, down) = (f64::from(info.width) - 0.5, f64::from(info.height) - 0.5);
    let corners = [[-0.5, -0.5], [right, -0.5], [-0.5, down], [right, down]];
    let corners = corners.map(|[col, row]| info.transform.apply(col, row));
    [
        [0, 1].map(|axis| corners.iter().map(|at| at[axis]).fold(f64::INFINITY, f64::min)),
        [0, 1].map(|axis| corners.iter().map(|at| at[axis]).fold(f64::NEG_INFINITY, f64::max)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_widened_to_whole_cells() {
        let of = |least: f64, most: f64| span([least, most, least, most], 10);
        assert_eq!(of(-0.5, 9.5), (0, 10), "the edges of the grid");
        assert_eq!(of(2.0, 2.0), (2, 1), "a point");
        assert_eq!(of(1.5, 3.5), (2, 2), "cell edges");
        assert_eq!(of(1.4, 3.6), (1, 4));
        assert_eq!(of(-7.0, 0.6), (0, 2));
        assert_eq!(of(9.4, 99.0), (9, 1));
        assert_eq!(of(9.5, 99.0).1, 0);
        assert_eq!(of(-9.0, -0.5).1, 0);
        assert_eq!(of(f64::NAN, f64::NAN).1, 0);
    }

    #[test]
    fn a_part_is_a_grid_of_its_own() {
        let whole = |options: &GridOpenOptions| {
            crate::open_all(&["synth:rough,size=200".to_owned()], options)
        };
        let grid = whole(&GridOpenOptions::default()).unwrap();
        let [x, y] = grid.info().transform.apply(40.0, 60.0);
        let bbox = Some([x - 4.0, y - 96.0, x + 196.0, y + 3.0]);
        let part = whole(&GridOpenOptions { bbox, ..GridOpenOptions::default() }).unwrap();
        assert_eq!([part.info().width, part.info().height], [21, 11]);
        assert_eq!(part.info().transform.apply(0.0, 0.0), [x, y]);
        let read = |grid: &dyn GridSource, rect| {
            let mut out = vec![0.0; Rect::len(&rect)];
            grid.read_f64(rect, &mut out).unwrap();
            out
        };
        assert_eq!(read(&*part, Rect::new(3, 2, 18, 9)), read(&*grid, Rect::new(43, 62, 18, 9)));
        assert!(part.read_f64(Rect::new(3, 2, 19, 9), &mut [0.0; 171]).is_err(), "beyond the part");
        let none =
            GridOpenOptions { bbox: Some([0.0, 0.0, 1.0, 1.0]), ..GridOpenOptions::default() };
        let told = whole(&none).err().unwrap().to_string();
        assert!(told.contains("contains no cell") && told.contains("y max within"), "{told}");
    }
}
