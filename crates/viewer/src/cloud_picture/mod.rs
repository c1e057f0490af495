//! Top views of a point cloud: density, voids, height and class of the highest points.
//!
//! The plane is divided into cells whose corners are at multiples of their size. Each point adds to the count of its
//! cell, and may become its highest one: sums and maxima, which do not depend on the order of points or threads.

mod map;
mod paint;
mod voids;

use std::path::PathBuf;

use serde::Serialize;

use crate::view::write_png;
pub(crate) use map::cells_over;
use map::{PictureCells, PointDensityMap};
use paint::CloudPicture;
pub use paint::PictureContent;
pub(crate) use paint::{DENSITIES, density_colour};
use terrane_base::error::{Error, Result};
use terrane_cloud::{PointCloud, PointSource};
use terrane_engine::input::workers;
use terrane_engine::memory::{PROGRAM, beside_program, short};
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::{AtomicFile, refuse_existing};
pub use voids::VoidStatistics;

/// A picture to draw.
#[derive(Clone, Debug)]
pub struct PictureJob {
    /// PNG file to write.
    pub output: PathBuf,
    /// Replace an existing picture.
    pub overwrite: bool,
    /// Displayed quantity.
    pub shows: PictureContent,
    /// Side of a cell, in units of x and y; by the density of the points when `None`.
    pub cell: Option<f64>,
}

/// Report on the picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct PictureReport {
    pub output: String,
    pub shows: PictureContent,
    /// Number of drawn points, without withheld ones unless requested.
    pub points: u64,
    /// Side of a cell, in units of x and y.
    pub cell: f64,
    pub columns: u64,
    pub rows: u64,
    /// West, south, east, north of the cells.
    pub bounds: [f64; 4],
    /// Cells that have points.
    pub filled: u64,
    /// Empty cells within the convex hull of the occupied ones.
    pub voids: VoidStatistics,
    /// Most points to a unit of area of a cell.
    pub densest: f64,
    pub output_bytes: u64,
}

/// Bytes of a cell: counts, highest points, states, work list, heights.
const CELL_BYTES: u64 = 8 + 8 + 1 + 4 + 4;
/// Bytes of a thread that reads points.
const WORKER: u64 = 12 << 20;
/// Bytes for rows of the picture on their way.
const PAINTING: u64 = 8 << 20;

/// Draws the points of an open cloud.
///
/// # Errors
/// An output that exists; cells that are too small for the points, the picture or the memory; a cloud without points;
/// damaged files.
pub fn draw(
    cloud: &PointCloud,
    job: &PictureJob,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<PictureReport> {
    refuse_existing(&job.output, job.overwrite)?;
    let info = cloud.info();
    let bounds = info.bounds.ok_or_else(no_points)?;
    let cells = PictureCells::new(info, bounds, job.cell)?;
    let threads = threads(&cells, resources)?;
    let resources = Resources { threads, ..resources.clone() };
    let map =
        workers(&resources)?.install(|| PointDensityMap::read(cloud, cells, progress, cancel))?;
    if map.points == 0 {
        return Err(no_points());
    }
    let void_cells = voids::find(&map);
    let sheet = CloudPicture::new(&map, &void_cells, job.shows, info);
    let mut file = AtomicFile::create(&job.output, job.overwrite)?;
    let size = sheet.size();
    write_png(&mut file, size, |row, line| sheet.row(row, line), &resources, progress, cancel)?;
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
        voids: void_cells.statistics,
        densest: map.counts.iter().copied().max().unwrap_or(0) as f64 / map.cells.area(),
        output_bytes: file.commit()?,
    })
}

fn no_points() -> Error {
    Error::bad_input("no points to draw")
        .remedy("name a point cloud with points, or relax the filters")
}

/// Number of threads that fit into memory with the cells.
fn threads(cells: &PictureCells, resources: &Resources) -> Result<usize> {
    let count = cells.count();
    let need = count * CELL_BYTES + PAINTING;
    let free = beside_program(resources.memory);
    let Some(rest) = free.checked_sub(need + WORKER) else {
        let required = need + WORKER + PROGRAM;
        let mib = required.div_ceil(1 << 20);
        let message = format!("a picture of {count} cells needs {mib} MiB of memory");
        return Err(short(message, required).or("choose a larger ‹cell›"));
    };
    Ok(resources.threads.clamp(1, 1 + (rest / WORKER) as usize))
}
