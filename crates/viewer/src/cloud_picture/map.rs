//! Cells of the plane, and the points added up in them.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use crate::render::MAX_PICTURE_SIDE;
use terrane_base::attribute::CLASS;
use terrane_base::bits::ordered;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::{CloudInfo, PointCloud, PointSource, round_side, round_up};
use terrane_engine::{Cancel, FileAt, Progress};
use terrane_gridding::{CellEdgeRule, CellLattice};

/// Default maximum number of cells along a side.
const USUAL_SIDE: f64 = 1000.0;

/// Cells over the bounds of a cloud: their lattice, the indices of the one in the south-west, and columns and rows.
///
/// # Errors
/// Cells below the scale of the points.
pub(crate) fn cells_over(
    info: &CloudInfo,
    bounds: [Point; 2],
    side: f64,
) -> Result<(CellLattice, [i64; 2], [u64; 2])> {
    if info.frame.scale[..2].iter().any(|step| side < *step) {
        let message = format!("cell size {side} is below the coordinate scale of the points");
        return Err(Error::usage(message).remedy("choose a larger ‹cell›"));
    }
    let lattice = CellLattice::new(&info.frame, [0.0; 2], [side; 2], CellEdgeRule::default());
    let span = lattice.span(bounds);
    let size = span.map(|[low, high]| high.abs_diff(low).saturating_add(1));
    Ok((lattice, span.map(|[low, _]| low), size))
}

/// Cells of the plane, from the north-west on.
pub(super) struct PictureCells {
    pub(super) side: f64,
    pub(super) lattice: CellLattice,
    /// Lattice indices of the cell in the south-west.
    pub(super) first: [i64; 2],
    pub(super) size: [usize; 2],
}

impl PictureCells {
    pub(super) fn new(info: &CloudInfo, bounds: [Point; 2], side: Option<f64>) -> Result<Self> {
        let side = side.unwrap_or_else(|| usual_side(info, bounds));
        let (lattice, first, size) = cells_over(info, bounds, side)?;
        let limit = u64::from(MAX_PICTURE_SIDE);
        if let Some(cells) = size.into_iter().find(|cells| *cells > limit) {
            let message = format!(
                "cell size {side} gives {cells} cells along a side, more than the limit of \
                     {limit}"
            );
            return Err(Error::usage(message).remedy("choose a larger ‹cell›"));
        }
        Ok(Self { side, lattice, first, size: size.map(|n| n as usize) })
    }

    pub(super) fn count(&self) -> u64 {
        self.size.iter().map(|n| *n as u64).product()
    }

    /// The number of the cell that a point is in.
    fn of(&self, point: Point) -> Option<usize> {
        let col = usize::try_from(self.lattice.x.index(point.x) - self.first[0]).ok()?;
        let up = usize::try_from(self.lattice.y.index(point.y) - self.first[1]).ok()?;
        let [columns, rows] = self.size;
        (col < columns && up < rows).then(|| (rows - 1 - up) * columns + col)
    }

    pub(super) fn area(&self) -> f64 {
        self.side * self.side
    }

    /// West, south, east, north of cells from one (column, row) to another.
    pub(super) fn bounds(&self, [left, top]: [usize; 2], [right, bottom]: [usize; 2]) -> [f64; 4] {
        [self.west(left), self.north(bottom + 1), self.west(right + 1), self.north(top)]
    }

    fn west(&self, column: usize) -> f64 {
        (self.first[0] + column as i64) as f64 * self.side
    }

    fn north(&self, row: usize) -> f64 {
        (self.first[1] + self.size[1] as i64 - row as i64) as f64 * self.side
    }
}

/// Round cell size that gives a few points per cell and at most [`USUAL_SIDE`] cells along a side.
fn usual_side(info: &CloudInfo, [low, high]: [Point; 2]) -> f64 {
    let [west, south, _] = info.frame.world(low);
    let [east, north, _] = info.frame.world(high);
    let longest = (east - west).max(north - south);
    round_up(round_side(info, [low, high]).max(longest / USUAL_SIDE))
}

fn zeros(count: u64) -> Vec<AtomicU64> {
    (0..count).map(|_| AtomicU64::new(0)).collect()
}

/// Counts per cell.
pub(super) struct PointDensityMap {
    pub(super) cells: PictureCells,
    pub(super) points: u64,
    pub(super) counts: Vec<u64>,
    /// Highest point of each cell: its height in steps, ordered, and its class in the lowest 8 bits.
    pub(super) tops: Vec<u64>,
}

impl PointDensityMap {
    pub(super) fn read(
        cloud: &PointCloud,
        cells: PictureCells,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Self> {
        let (counts, tops) = (zeros(cells.count()), zeros(cells.count()));
        let selection = cloud.select(&[CLASS.to_owned()])?;
        progress.begin("points", cloud.info().count);
        let read = (0..cloud.parts()).into_par_iter().try_for_each(|part| {
            FileAt::report_part(progress, cloud, part);
            cloud.read(part, &selection, &mut |batch| {
                cancel.check()?;
                for (point, class) in batch.positions.iter().zip(&batch.attributes[0]) {
                    let Some(cell) = cells.of(*point) else { continue };
                    // Sums and maxima do not depend on the order of threads.
                    counts[cell].fetch_add(1, Ordering::Relaxed);
                    let top = ordered(point.z) << 8 | u64::from(*class as u8);
                    tops[cell].fetch_max(top, Ordering::Relaxed);
                }
                Ok(())
            })?;
            progress.advance(cloud.points_of(part));
            Ok(())
        });
        progress.end();
        read?;
        let [counts, tops] = [counts, tops]
            .map(|all| all.into_iter().map(AtomicU64::into_inner).collect::<Vec<_>>());
        Ok(Self { points: counts.iter().sum(), cells, counts, tops })
    }

    pub(super) fn is_filled(&self, cell: usize) -> bool {
        self.counts[cell] > 0
    }

    pub(super) fn filled(&self) -> u64 {
        self.counts.iter().filter(|count| **count > 0).count() as u64
    }

    /// The height of the highest point in steps, and its class.
    pub(super) fn top(&self, cell: usize) -> (i32, u8) {
        ((self.tops[cell] >> 8) as u32 as i32 ^ i32::MIN, self.tops[cell] as u8)
    }
}

#[cfg(test)]
impl PointDensityMap {
    /// A map of cells of side 1 with these counts, rows from the north.
    pub(super) fn of_rows(rows: &[&[u64]]) -> Self {
        let frame = terrane_base::geom::PointFrame { scale: [0.01; 3], offset: [0.0; 3] };
        let lattice = CellLattice::new(&frame, [0.0; 2], [1.0; 2], CellEdgeRule::default());
        let cells =
            PictureCells { side: 1.0, lattice, first: [0, 0], size: [rows[0].len(), rows.len()] };
        let counts = rows.concat();
        let tops = counts.iter().map(|n| (ordered(*n as i32 * 100) << 8) | (n % 3)).collect();
        Self { points: counts.iter().sum(), cells, counts, tops }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_in_the_cells_whose_borders_are_below_them() {
        let map = PointDensityMap::of_rows(&[&[0, 0, 0], &[0, 0, 0]]);
        let of = |x, y| map.cells.of(Point::new(x, y, 0));
        assert_eq!([of(0, 0), of(99, 99), of(100, 0), of(299, 100)], [3, 3, 4, 2].map(Some));
        assert_eq!([of(-1, 0), of(300, 0), of(0, 200), of(0, -1)], [None; 4]);
        assert_eq!(map.cells.bounds([1, 0], [2, 0]), [1.0, 1.0, 3.0, 2.0]);
    }

    #[test]
    fn heights_and_classes_come_back() {
        for (z, class) in [(0, 0), (-1, 255), (i32::MIN, 7), (i32::MAX, 2)] {
            let tops = vec![ordered(z) << 8 | u64::from(class)];
            assert_eq!(
                PointDensityMap { tops, ..PointDensityMap::of_rows(&[&[1]]) }.top(0),
                (z, class)
            );
        }
    }
}
