//! Tiles of the globe's terrain at every level of detail, of a grid of any size.
//!
//! **Once over the grid**: its range, means for voids, a plane for each block of samples, and the samples along the
//! borders of large tiles ([`terrane_tiles::Plan`]).
//!
//! **Near levels**: a *region* is a tile with at most 1,024 samples along a side. Its samples are read once, and
//! all its tiles down to the deepest level are made of them. Regions are independent.
//!
//! **Far levels**: tiles that hold several regions are made of the overview, and measured by blocks; where a block
//! does not tell, its samples are read.
//!
//! Whatever is made depends on the grid and the options alone. Files are put into a folder that appears whole.

mod far;
mod folder;
mod glance;
mod near;
mod place;
mod report;

use std::path::PathBuf;
use std::time::Instant;

use crate::figures::Figures;
use crate::memory;
use crate::reading::Reading;
use crate::workers;
use crate::{Cancel, Progress, Resources};
use folder::Folder;
use place::Place;
pub use report::{LevelReport, TilesReport};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_raster::{GridSource, Inputs, looks_like_nodata};
use terrane_tiles::{DEEPEST, Level, Overview, TileId, deepest_for, degrees};

/// Samples along a side of the tiles that are made of samples read once.
const REGION: f64 = 1024.0;
/// Samples around a region that slopes are told from.
const APRON: u32 = 10;

/// Tiles to make of a grid.
#[derive(Clone, Debug)]
pub struct TilesJob {
    /// File names, or a grid in memory by name.
    pub input: Inputs,
    /// What is read of it.
    pub reading: Reading,
    /// Folder to make.
    pub output: PathBuf,
    /// Replace a folder of tiles that exists.
    pub overwrite: bool,
    /// The deepest level; that of the grid's resolution when `None`.
    pub max_level: Option<u8>,
    /// Write a normal for each vertex.
    pub normals: bool,
    /// Compress each file (gzip).
    pub compress: bool,
    /// What the job may use.
    pub resources: Resources,
}

impl TilesJob {
    /// The job with everything else at its default.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>) -> Self {
        Self {
            input: input.into(),
            reading: Reading::default(),
            output: output.into(),
            overwrite: false,
            max_level: None,
            normals: true,
            compress: true,
            resources: Resources::default(),
        }
    }
}

/// What all of the work knows.
struct Ground<'a> {
    job: &'a TilesJob,
    grid: &'a dyn GridSource,
    place: Place,
    overview: Overview,
    levels: Vec<Level>,
    /// The first level whose tiles are regions or parts of one; it may be beyond the deepest that is made.
    near: u8,
}

/// Makes tiles. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// A grid without a system of longitudes and latitudes, or one that is turned, or beyond the poles or 180 degrees;
/// an output that exists; a level too deep for the heights; all that reading and writing may find.
pub fn run(job: &TilesJob, progress: &dyn Progress, cancel: &Cancel) -> Result<TilesReport> {
    let started = Instant::now();
    if let Some(level) = job.max_level.filter(|level| *level > DEEPEST) {
        return Err(Error::usage(format!("level {level} is too deep"))
            .remedy(format!("choose {DEEPEST} at most")));
    }
    terrane_files::atomic::refuse_existing(&job.output, job.overwrite)?;
    let options = job.reading.options(&job.resources, 0)?;
    // There is no --tile here to make smaller.
    let plainly =
        |error: Error| match error.remedy_text().and_then(|text| text.split_once(", or a")) {
            Some((memory, _)) if error.kind() == ErrorKind::Resource => {
                let memory = memory.to_owned();
                error.remedy(memory)
            }
            _ => error,
        };
    let looked = memory::look_at(&job.input, &options)?;
    let mut place = Place::of(looked.info(), &job.input)?;
    drop(looked);
    let last = job.max_level.unwrap_or_else(|| deepest_for(place.spacing));
    let is_near = |level: &u8| degrees(*level) <= REGION * place.spacing;
    // Whatever is made of a grid, no more of it is read at once.
    let near = (0..DEEPEST).find(is_near).unwrap_or(DEEPEST);
    let plan = glance::plan(&place, near);
    let (worker, held) = (glance::worker_bytes(&place, &plan), plan.bytes());
    let (grid, shares) =
        memory::open_beside(&job.input, &options, &job.resources, worker, held).map_err(plainly)?;
    let folder = Folder::create(job, last)?;
    let overview = glance::look(&*grid, &place, &plan, shares.threads, progress, cancel)?;
    let suspect = looks_like_nodata(overview.range[0] / place.metres, grid.info());
    place.notes.extend(suspect.map(|stored| {
        format!("the lowest height, {stored:e}, looks like an undeclared nodata value")
    }));
    let reach = overview.range[0].abs().max(overview.range[1].abs());
    let levels =
        (0..=last).map(|level| Level::new(level, place.spacing, reach)).collect::<Result<_>>()?;
    let ground = Ground { job, grid: &*grid, place, overview, levels, near };
    let of_nodata = |error: Error| match suspect.filter(|_| error.kind() == ErrorKind::Usage) {
        Some(stored) => {
            error.remedy(format!("if {stored:e} stands for nodata, pass --nodata {stored:e}"))
        }
        None => error,
    };
    ground.make(&folder, shares.threads, progress, cancel).map_err(of_nodata)?;
    let made = folder.finish(&ground, cancel)?;
    Ok(TilesReport {
        run: Figures { threads: shares.threads, ..Figures::since(started, &job.resources) },
        ..made
    })
}

impl Ground<'_> {
    fn make(
        &self,
        folder: &Folder,
        threads: usize,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<()> {
        let regions = self.regions();
        progress.begin("near levels", regions.len() as u64);
        let nothing = |_| Ok(());
        workers::run(
            threads,
            regions.len() as u64,
            cancel,
            || (),
            |(), i| {
                self.region(regions[i as usize], folder, cancel)?;
                progress.advance(1);
                Ok(())
            },
            nothing,
        )?;
        progress.end();
        let far = folder.above(self.near);
        progress.begin("far levels", far.len() as u64);
        workers::run(
            threads,
            far.len() as u64,
            cancel,
            || (),
            |(), i| {
                self.far(far[i as usize], folder, cancel)?;
                progress.advance(1);
                Ok(())
            },
            nothing,
        )?;
        progress.end();
        Ok(())
    }

    /// The tiles whose samples are read once, from the north as rows of grids mostly are.
    fn regions(&self) -> Vec<TileId> {
        let [[west, east], [south, north]] = TileId::meeting(self.near, &self.place.bounds);
        let row = |y: u32| (west..=east).map(move |x| TileId { level: self.near, x, y });
        (south..=north).rev().flat_map(row).collect()
    }

    fn level(&self, id: TileId) -> &Level {
        &self.levels[usize::from(id.level)]
    }
}
