//! Grids from format to format.

use std::path::PathBuf;

use super::grid::Grid;
use super::run::{Run, System, output_settings, run_settings, system_settings};
use terrane_base::{Result, registry};
use terrane_jobs::convert::{self, ConvertJob, ConvertReport};
use terrane_jobs::reading::Reading;
use terrane_jobs::warp::{self, Wanted, WarpJob};
use terrane_raster::SampleType;
use terrane_resample::RESAMPLINGS;

/// A copy of a grid to be made, exact unless [rounding](Self::round) is allowed.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("copy.tif");
/// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
/// dem.convert().write(&path)?;
/// let copy = terrane::open(&path)?;
/// assert_eq!(copy.heights(copy.info().bounds())?, dem.heights(dem.info().bounds())?);
/// # Ok(())
/// # }
/// ```
pub struct ConvertBuilder<'a> {
    grid: &'a Grid,
    format: Option<String>,
    creation: Vec<(String, String)>,
    bounds: Option<[f64; 4]>,
    sample_type: Option<SampleType>,
    round: bool,
    system: System,
    wanted: Wanted,
    resampling: Option<String>,
    run: Run,
}

run_settings!([] ConvertBuilder<'_>);
output_settings!([] ConvertBuilder<'_>);
system_settings!([] ConvertBuilder<'_>);

impl<'a> ConvertBuilder<'a> {
    pub(super) fn of(grid: &'a Grid) -> Self {
        Self {
            grid,
            format: None,
            creation: Vec::new(),
            bounds: None,
            sample_type: None,
            round: false,
            system: System::default(),
            wanted: Wanted::default(),
            resampling: None,
            run: Run::default(),
        }
    }

    /// A creation option of the format, such as `COMPRESS`, `DEFLATE`.
    pub fn creation(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.creation.push((key.into(), value.into()));
        self
    }

    /// Only the cells that the box (x low, y low, x high, y high) overlaps.
    pub fn bounds(mut self, bounds: [f64; 4]) -> Self {
        self.bounds = Some(bounds);
        self
    }

    /// Type of the written samples; the grid's own, or what the format holds, unless told otherwise.
    pub fn sample_type(mut self, sample_type: SampleType) -> Self {
        self.sample_type = Some(sample_type);
        self
    }

    /// Write the nearest value where the type does not hold a height exactly, instead of failing.
    pub fn round(mut self, round: bool) -> Self {
        self.round = round;
        self
    }

    /// How heights are found where samples of the output lie between those of the grid: `"near"`, `"bilinear"` or
    /// `"cubic"`. Nothing is resampled without it, and what it is for has to be said, too: [`to_crs`](Self::to_crs),
    /// [`resolution`](Self::resolution), [`extent`](Self::extent) or [`like`](Self::like).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("globe.tif");
    /// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
    /// dem.convert().to_crs("EPSG:4326").resampling("bilinear").write(&path)?;
    /// assert_eq!(terrane::open(&path)?.info().crs.epsg, Some(4326));
    /// # Ok(())
    /// # }
    /// ```
    pub fn resampling(mut self, name: impl Into<String>) -> Self {
        self.resampling = Some(name.into());
        self
    }

    /// Width and height of a cell of the output, in units of its system; edges of cells lie at multiples of them. As
    /// large as in the middle of the grid unless told otherwise.
    pub fn resolution(mut self, cell: [f64; 2]) -> Self {
        self.wanted.resolution = Some(cell);
        self
    }

    /// The box (x low, y low, x high, y high) that the output covers, in its system; all of the grid unless told
    /// otherwise.
    pub fn extent(mut self, extent: [f64; 4]) -> Self {
        self.wanted.extent = Some(extent);
        self
    }

    /// A grid whose samples are where those of the output are to be, whatever else was said of that.
    pub fn like(mut self, grid: impl Into<String>) -> Self {
        self.wanted.like = Some(grid.into());
        self
    }

    /// Copies the grid, within the memory allowed.
    ///
    /// # Errors
    /// Another lattice without [`resampling`](Self::resampling), no known way to the system, or no sample there; a height that the type does not hold; damage in the grid; too little memory; an output that exists or
    /// cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<ConvertReport> {
        let job = ConvertJob {
            format: self.format,
            creation: self.creation,
            reading: Reading {
                bbox: self.bounds.or(self.grid.reading.bbox),
                ..self.grid.reading.clone()
            },
            sample_type: self.sample_type,
            round: self.round,
            overwrite: self.run.overwrite,
            resources: self.run.resources()?,
            ..ConvertJob::new(self.grid.inputs.clone(), path.into())
        };
        let named = |name: &String| registry::named(RESAMPLINGS, name);
        let resampling = self.resampling.as_ref().map(named).transpose()?;
        match WarpJob::asked(&job, self.system.transform()?, self.wanted, resampling)? {
            Some(job) => warp::run(&job, &*self.run.progress, &self.run.cancel),
            None => convert::run(&job, &*self.run.progress, &self.run.cancel),
        }
    }
}
