//! Adapter that flips a grid north-up: the same samples with rows from north to south and columns from west
//! to east, so that results do not depend on the corner where the file begins.

use std::ops::Deref;
use std::path::PathBuf;

use crate::grid::{GridInfo, GridSource};
use crate::sample::HeightSample;
use crate::window::{GridHeight, SampleWindow};
use terrane_base::error::Result;
use terrane_base::geom::{Affine, Rect};

/// A north-up grid. Rotations below 45 degrees are kept; beyond that columns and rows keep their roles.
pub struct NorthUpGrid<S> {
    info: GridInfo,
    inner: S,
    /// Whether columns and rows are reversed.
    flips: [bool; 2],
}

impl<'a, S: Deref<Target = dyn GridSource + 'a>> NorthUpGrid<S> {
    /// Wraps any grid.
    pub fn new(inner: S) -> Self {
        let info = inner.info().clone();
        let Affine { a, b, d, e, .. } = info.transform;
        let flips = [a < 0.0 && a.abs() > b.abs(), e > 0.0 && e.abs() > d.abs()];
        // The last column and row of a flipped axis become the first ones.
        let first_col = if flips[0] { f64::from(info.width - 1) } else { 0.0 };
        let first_row = if flips[1] { f64::from(info.height - 1) } else { 0.0 };
        let from = info.transform.shifted(first_col, first_row);
        let [across, down] = flips.map(|flip| if flip { -1.0 } else { 1.0 });
        let transform = Affine { a: across * a, d: across * d, b: down * b, e: down * e, ..from };
        Self { info: GridInfo { transform, ..info }, inner, flips }
    }
}

impl<S> NorthUpGrid<S> {
    /// The rectangle in the inner grid.
    fn behind(&self, rect: Rect) -> Rect {
        let [col, row] = self.flips;
        Rect {
            col: if col { self.info.width - rect.end_col() } else { rect.col },
            row: if row { self.info.height - rect.end_row() } else { rect.row },
            ..rect
        }
    }
}

impl<'a, S: Deref<Target = dyn GridSource + 'a>> NorthUpGrid<S> {
    fn read<H: GridHeight + HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        SampleWindow::new(&self.info, rect, out)?;
        H::read(&*self.inner, self.behind(rect), out)?;
        let [cols, rows] = self.flips;
        if rows {
            out.reverse();
        }
        if cols != rows {
            out.chunks_mut(rect.width.max(1) as usize).for_each(<[H]>::reverse);
        }
        Ok(())
    }
}

impl<'a, S: Deref<Target = dyn GridSource + 'a> + Send + Sync> GridSource for NorthUpGrid<S> {
    reads_alike!();

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }

    fn release(&self, rect: Rect) {
        self.inner.release(self.behind(rect));
    }

    fn copied(&self, rect: Rect) {
        self.inner.copied(self.behind(rect));
    }

    fn advise_read(&self, rect: Rect) {
        self.inner.advise_read(self.behind(rect));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArrayGrid;

    const WIDTH: u32 = 7;
    const HEIGHT: u32 = 5;

    /// Every window of a grid whose rows or columns run the other way has the samples of their places.
    #[test]
    fn samples_stay_where_they_are_whatever_the_order_of_rows_and_columns() {
        let samples: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| i as f32).collect();
        for (a, e) in [(2.0, -3.0), (2.0, 3.0), (-2.0, -3.0), (-2.0, 3.0)] {
            let map = Affine { x0: 50.0, a, b: 0.5, y0: 90.0, d: 0.25, e };
            let grid = ArrayGrid::new(&samples, WIDTH, HEIGHT).unwrap();
            let grid = grid.placed(map, Default::default());
            let upright = NorthUpGrid::new(&grid as &dyn GridSource);
            let info = upright.info().clone();
            assert!(info.transform.a > 0.0 && info.transform.e < 0.0);
            for rect in
                [Rect::new(0, 0, WIDTH, HEIGHT), Rect::new(2, 1, 4, 3), Rect::new(6, 4, 1, 1)]
            {
                let mut out = vec![0.0_f32; rect.len()];
                upright.read_f32(rect, &mut out).unwrap();
                for (i, height) in (0..).zip(out) {
                    let (col, row) = (rect.col + i % rect.width, rect.row + i / rect.width);
                    let [x, y] = info.transform.apply(col.into(), row.into());
                    let [col, row] = map.invert(x, y).map(f64::round);
                    assert_eq!(height, row as f32 * WIDTH as f32 + col as f32, "{a} {e} {rect:?}");
                }
            }
            assert!(upright.read_f32(Rect::new(5, 0, 3, 1), &mut [0.0; 3]).is_err());
        }
    }

    /// A grid that is turned far has no rows from north to south.
    #[test]
    fn a_grid_on_its_side_stays_what_it_is() {
        let samples = [0.0_f32; 6];
        let map = Affine { x0: 0.0, a: -0.5, b: 2.0, y0: 0.0, d: 2.0, e: 0.5 };
        let grid = ArrayGrid::new(&samples, 3, 2).unwrap().placed(map, Default::default());
        assert_eq!(NorthUpGrid::new(&grid as &dyn GridSource).info().transform, map);
    }
}
