//! A cloud from above: how dense it is, where it has voids, how high its highest points are and of which class.
//!
//! The plane is divided into cells whose corners are at multiples of their size. Each point adds to the count of its
//! cell, and may become its highest one: sums and largest values, which no order of points or threads changes.

mod paint;
mod voids;

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use serde::Serialize;
use terrane_options::Choice;

use crate::render::MAX_PICTURE_SIDE;
use crate::view::write_png;
use paint::Sheet;
use terrane_base::bits::ordered;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::{Cloud, CloudInfo, PointSource, Seen, Sight, round_side, round_up};
use terrane_engine::input::workers;
use terrane_engine::memory::{PROGRAM, beside_program, short};
use terrane_engine::{Cancel, FileAt, Progress, Resources};
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_gridding::{Edges, Lattice};
pub use voids::Voids;

/// What a picture shows of each cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Choice)]
#[serde(rename_all = "lowercase")]
pub enum Shows {
    /// Points to a unit of area
    #[default]
    Density,
    /// Cells without points, within the convex hull of those with points
    Voids,
    /// The height of the highest point
    Height,
    /// The class of the highest point
    Class,
}

/// A picture to draw.
#[derive(Clone, Debug)]
pub struct PictureJob {
    /// PNG file to write.
    pub output: PathBuf,
    /// Replace an existing picture.
    pub overwrite: bool,
    /// What it shows.
    pub shows: Shows,
    /// Side of a cell, in units of x and y; by the density of the points when `None`.
    pub cell: Option<f64>,
}

/// What was drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct PictureReport {
    pub output: String,
    pub shows: Shows,
    /// Points that were drawn: those that are not withheld, unless they were asked for.
    pub points: u64,
    /// Side of a cell, in units of x and y.
    pub cell: f64,
    pub columns: u64,
    pub rows: u64,
    /// West, south, east, north of the cells.
    pub bounds: [f64; 4],
    /// Cells that have points.
    pub filled: u64,
    /// Cells that have none, within the convex hull of those that do.
    pub voids: Voids,
    /// Most points to a unit of area of a cell.
    pub densest: f64,
    pub output_bytes: u64,
}

/// Most cells along a side, by default.
const USUAL_SIDE: f64 = 1000.0;
/// Bytes of a cell: counts, highest points, states, what is still to be looked at, heights.
const CELL_BYTES: u64 = 8 + 8 + 1 + 4 + 4;
/// Bytes of a thread that reads points.
const WORKER: u64 = 12 << 20;
/// Bytes for rows of the picture on their way.
const PAINTING: u64 = 8 << 20;

/// Draws the points of an open cloud.
///
/// # Errors
/// An output that exists; cells that are too small for the points, the picture or the memory; a cloud without points;
/// what its files have wrong with them.
pub fn draw(
    cloud: &Cloud,
    job: &PictureJob,
    resources: &Resources,
    (progress, cancel): (&dyn Progress, &Cancel),
) -> Result<PictureReport> {
    refuse_existing(&job.output, job.overwrite)?;
    let info = cloud.info();
    let bounds = info.bounds.ok_or_else(no_points)?;
    let cells = Cells::new(info, bounds, job.cell)?;
    let threads = threads(&cells, resources)?;
    let resources = Resources { threads, ..resources.clone() };
    let map = workers(&resources)?.install(|| Map::read(cloud, cells, (progress, cancel)))?;
    if map.points == 0 {
        return Err(no_points());
    }
    let found = voids::find(&map);
    let sheet = Sheet::new(&map, &found, job.shows, info);
    let mut file = AtomicFile::create(&job.output, job.overwrite)?;
    let fill = |row, line: &mut [u8]| sheet.row(row, line);
    write_png(&mut file, sheet.size(), fill, &resources, progress, cancel)?;
    let [columns, rows] = map.cells.size.map(|n| n as u64);
    Ok(PictureReport {
        output: job.output.display().to_string(),
        shows: job.shows,
        points: map.points,
        cell: map.cells.side,
        columns,
        rows,
        bounds: map.cells.bounds([0, 0], [columns as usize - 1, rows as usize - 1]),
        filled: map.filled(),
        voids: found.voids,
        densest: map.counts.iter().copied().max().unwrap_or(0) as f64 / map.cells.area(),
        output_bytes: file.commit()?,
    })
}

fn no_points() -> Error {
    Error::bad_input("there is no point to draw")
        .remedy("name a cloud that has points, or filter less of it out")
}

/// Threads that fit beside the cells.
fn threads(cells: &Cells, resources: &Resources) -> Result<usize> {
    let count = cells.count();
    let need = count * CELL_BYTES + PAINTING;
    let free = beside_program(resources.memory);
    let Some(rest) = free.checked_sub(need + WORKER) else {
        let enough = need + WORKER + PROGRAM;
        let mib = enough.div_ceil(1 << 20);
        let message = format!("a picture of {count} cells takes {mib} MiB of memory");
        return Err(short(message, enough).or("larger cells with ‹cell›"));
    };
    Ok(resources.threads.clamp(1, 1 + (rest / WORKER) as usize))
}

/// Cells of the plane, from the north-west on.
struct Cells {
    side: f64,
    lattice: Lattice,
    /// Lattice indices of the cell in the south-west.
    first: [i64; 2],
    size: [usize; 2],
}

impl Cells {
    fn new(info: &CloudInfo, bounds: [Point; 2], side: Option<f64>) -> Result<Self> {
        let side = side.unwrap_or_else(|| usual_side(info, bounds));
        if info.frame.scale[..2].iter().any(|step| side < *step) {
            let message = format!("cells of {side} are smaller than a step of the points");
            return Err(Error::usage(message).remedy("choose a larger ‹cell›"));
        }
        let lattice = Lattice::new(&info.frame, [0.0; 2], [side; 2], Edges::default());
        let span = lattice.span(bounds);
        let size = span.map(|[low, high]| high.abs_diff(low).saturating_add(1));
        let most = u64::from(MAX_PICTURE_SIDE);
        if let Some(cells) = size.into_iter().find(|cells| *cells > most) {
            let message =
                format!("cells of {side} are {cells} along a side, and a picture has up to {most}");
            return Err(Error::usage(message).remedy("choose a larger ‹cell›"));
        }
        Ok(Self { side, lattice, first: span.map(|[low, _]| low), size: size.map(|n| n as usize) })
    }

    fn count(&self) -> u64 {
        self.size.iter().map(|n| *n as u64).product()
    }

    /// The number of the cell that a point is in.
    fn of(&self, point: Point) -> Option<usize> {
        let col = usize::try_from(self.lattice.x.index(point.x) - self.first[0]).ok()?;
        let up = usize::try_from(self.lattice.y.index(point.y) - self.first[1]).ok()?;
        let [columns, rows] = self.size;
        (col < columns && up < rows).then(|| (rows - 1 - up) * columns + col)
    }

    fn area(&self) -> f64 {
        self.side * self.side
    }

    /// West, south, east, north of cells from one (column, row) to another.
    fn bounds(&self, [left, top]: [usize; 2], [right, bottom]: [usize; 2]) -> [f64; 4] {
        let rows = self.size[1];
        let x = |col: usize| (self.first[0] + col as i64) as f64 * self.side;
        let y = |row: usize| (self.first[1] + rows as i64 - row as i64) as f64 * self.side;
        [x(left), y(bottom + 1), x(right + 1), y(top)]
    }
}

/// A round size of cells with some points on the average, that are not too many.
fn usual_side(info: &CloudInfo, [low, high]: [Point; 2]) -> f64 {
    let [west, south, _] = info.frame.world(low);
    let [east, north, _] = info.frame.world(high);
    let longest = (east - west).max(north - south);
    round_up(round_side(info, [low, high]).max(longest / USUAL_SIDE))
}

/// What was counted.
struct Map {
    cells: Cells,
    points: u64,
    counts: Vec<u64>,
    /// Of the highest point of each cell: its height in steps, ordered, and its class in the lowest 8 bits.
    tops: Vec<u64>,
}

impl Map {
    fn read(
        cloud: &Cloud,
        cells: Cells,
        (progress, cancel): (&dyn Progress, &Cancel),
    ) -> Result<Self> {
        let zeros = || (0..cells.count()).map(|_| AtomicU64::new(0)).collect::<Vec<_>>();
        let (counts, tops, sight) = (zeros(), zeros(), Sight::new(cloud)?);
        let add = |Seen { point, class, .. }: &Seen| {
            let Some(cell) = cells.of(*point) else { return };
            counts[cell].fetch_add(1, Ordering::Relaxed);
            tops[cell].fetch_max(ordered(point.z) << 8 | u64::from(*class), Ordering::Relaxed);
        };
        progress.begin("points", cloud.info().count);
        let read = (0..cloud.parts()).into_par_iter().try_for_each(|part| {
            FileAt::tell(progress, cloud, part);
            sight.read(part, &mut |points| {
                cancel.check()?;
                points.iter().for_each(add);
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

    fn is_filled(&self, cell: usize) -> bool {
        self.counts[cell] > 0
    }

    fn filled(&self) -> u64 {
        self.counts.iter().filter(|count| **count > 0).count() as u64
    }

    /// The height of the highest point in steps, and its class.
    fn top(&self, cell: usize) -> (i32, u8) {
        ((self.tops[cell] >> 8) as u32 as i32 ^ i32::MIN, self.tops[cell] as u8)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use terrane_base::geom::Frame;

    /// A map of cells of side 1 with these counts, rows from the north.
    pub(super) fn map(rows: &[&[u64]]) -> Map {
        let frame = Frame { scale: [0.01; 3], offset: [0.0; 3] };
        let lattice = Lattice::new(&frame, [0.0; 2], [1.0; 2], Edges::default());
        let cells = Cells { side: 1.0, lattice, first: [0, 0], size: [rows[0].len(), rows.len()] };
        let counts = rows.concat();
        let tops = counts.iter().map(|n| (ordered(*n as i32 * 100) << 8) | (n % 3)).collect();
        Map { points: counts.iter().sum(), cells, counts, tops }
    }

    #[test]
    fn points_are_in_the_cells_whose_borders_are_below_them() {
        let map = map(&[&[0, 0, 0], &[0, 0, 0]]);
        let of = |x, y| map.cells.of(Point::new(x, y, 0));
        assert_eq!([of(0, 0), of(99, 99), of(100, 0), of(299, 100)], [3, 3, 4, 2].map(Some));
        assert_eq!([of(-1, 0), of(300, 0), of(0, 200), of(0, -1)], [None; 4]);
        assert_eq!(map.cells.bounds([1, 0], [2, 0]), [1.0, 1.0, 3.0, 2.0]);
    }

    #[test]
    fn heights_and_classes_come_back() {
        for (z, class) in [(0, 0), (-1, 255), (i32::MIN, 7), (i32::MAX, 2)] {
            let tops = vec![ordered(z) << 8 | u64::from(class)];
            assert_eq!(Map { tops, ..map(&[&[1]]) }.top(0), (z, class));
        }
    }
}
