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
mod format;
mod glance;
mod near;
mod place;
mod report;
mod three;

use std::path::PathBuf;
use std::time::Instant;

use crate::figures::Figures;
use crate::memory;
use crate::reading::Reading;
use crate::workers;
use crate::{Cancel, Progress, Resources};
use folder::Folder;
pub use format::{FORMATS, Format};
use place::Place;
pub use report::{LevelReport, TilesReport};
use terrane_base::error::{Error, Result};
use terrane_raster::{GridSource, Inputs};
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
    /// What to write: of several formats, a folder in the output for each, by its name.
    pub formats: Vec<Format>,
    /// Name the vertices of the sides of 3D Tiles (CESIUM_tile_edges).
    pub tile_edges: bool,
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
            formats: vec![Format::QuantizedMesh],
            tile_edges: false,
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
    /// By set, from level 0 on.
    levels: Vec<Vec<Level>>,
    /// The first level whose tiles are regions or parts of one.
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
    check_formats(job)?;
    terrane_files::atomic::refuse_existing(&job.output, job.overwrite)?;
    let options = job.reading.options(&job.resources, 0)?;
    let (grid, shares) = memory::open(&job.input, &options, &job.resources, near::WORKER_BYTES)?;
    let place = Place::of(grid.info(), &job.input)?;
    let last = job.max_level.unwrap_or_else(|| deepest_for(place.spacing));
    let folder = Folder::create(job, last)?;
    let is_near = |level: &u8| degrees(*level) <= REGION * place.spacing;
    let near = (0..last).find(is_near).unwrap_or(last);
    let overview = glance::look(&*grid, &place, near, shares.threads, progress, cancel)?;
    let levels = job
        .formats
        .iter()
        .map(|format| levels(*format, last, &place, overview.range))
        .collect::<Result<_>>()?;
    let ground = Ground { job, grid: &*grid, place, overview, levels, near };
    ground.make(&folder, shares.threads, progress, cancel)?;
    let made = folder.finish(&ground, cancel)?;
    Ok(TilesReport {
        run: Figures { threads: shares.threads, ..Figures::since(started, &job.resources) },
        ..made
    })
}

/// Fails where no format is asked for, one twice, or edges of tiles of a format without.
fn check_formats(job: &TilesJob) -> Result<()> {
    let is_twice = |i: usize| job.formats[..i].contains(&job.formats[i]);
    if job.formats.is_empty() || (0..job.formats.len()).any(is_twice) {
        return Err(Error::usage("a format of tiles is asked for twice, or none")
            .remedy("name each format once"));
    }
    if job.tile_edges && !job.formats.contains(&Format::ThreeTiles) {
        return Err(Error::usage("edges of tiles belong to 3D Tiles")
            .remedy("pass --format 3dtiles, or leave out --tile-edges"));
    }
    Ok(())
}

/// The levels of a set.
fn levels(format: Format, last: u8, place: &Place, range: [f64; 2]) -> Result<Vec<Level>> {
    let reach = range[0].abs().max(range[1].abs());
    let level = |level: u8| {
        let level = Level::new(level, place.spacing, reach)?;
        match format {
            Format::QuantizedMesh => Ok(level),
            Format::ThreeTiles => level.on_lattice(range),
        }
    };
    (0..=last).map(level).collect()
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

    /// The level of a tile, by set.
    fn of_level(&self, id: TileId) -> impl Iterator<Item = &Level> {
        self.levels.iter().map(move |levels| &levels[usize::from(id.level)])
    }

    /// The deepest level.
    fn last(&self) -> u8 {
        self.levels[0].len() as u8 - 1
    }
}
