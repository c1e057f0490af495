//! Several bands of a grid that share one mesh, such as the colours of a photograph.

use std::path::{Path, PathBuf};

use super::run::{Run, output_settings, run_settings};
use super::verify::VerifyBuilder;
use terrane_base::{Error, Result};
use terrane_jobs::bands::Bands;
use terrane_jobs::options::GridInput;
use terrane_jobs::tin::{self, Goal, TinJob, TinReport};
use terrane_jobs::verify::{self, AskedBands, VerifyJob, VerifyReport};
use terrane_raster::Inputs;

/// Bands of a grid, in one file or many, that are to share one mesh: what [`open_bands`] names. Nothing is read of
/// them before a mesh is made.
#[derive(Clone, Debug)]
pub struct BandGrid {
    inputs: Inputs,
    reading: GridInput,
    bands: Vec<u32>,
    weights: Vec<f64>,
    heights: Option<u32>,
}

/// Names bands of a grid, from 1, that are to share one mesh: of a photograph, the numbers of its colours.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = |name| folder.path().join(name);
/// # let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=5")?;
/// # cloud.grid(1.0).stat("min,mean,max").write(path("photo.tif"))?;
/// # let (photo, mesh) = (path("photo.tif").display().to_string(), path("mesh.ply"));
/// let photo = terrane::open_bands(photo, &[1, 2, 3]).weights(&[1.0, 2.0, 1.0]); // "photo.tif"
/// let made = photo.tin().max_error(4.0).write(&mesh)?;                          // "mesh.ply"
/// assert!(made.bands[1].max_error.unwrap() <= 2.0);
/// assert!(photo.verify(&mesh).run()?.verdict.passed);
/// # Ok(())
/// # }
/// ```
pub fn open_bands(input: impl Into<Inputs>, bands: &[u32]) -> BandGrid {
    BandGrid {
        inputs: input.into(),
        reading: GridInput::default(),
        bands: bands.to_vec(),
        weights: Vec::new(),
        heights: None,
    }
}

impl BandGrid {
    /// How much an error in each band counts; 1 unless told otherwise.
    pub fn weights(mut self, weights: &[f64]) -> Self {
        self.weights = weights.to_vec();
        self
    }

    /// The band, one of those named, whose values are the heights of vertices; they are at 0 unless told otherwise.
    pub fn heights(mut self, band: u32) -> Self {
        self.heights = Some(band);
        self
    }

    /// The stored value for voids, instead of the files' own. What is void in one band is void in all.
    pub fn nodata(mut self, value: f64) -> Self {
        self.reading.nodata = Some(value);
        self
    }

    /// One mesh of all the bands.
    pub fn tin(&self) -> BandTinBuilder<'_> {
        BandTinBuilder { grid: self, goal: None, format: None, run: Run::default() }
    }

    /// The proof of a mesh in a file against these bands, each of its channels and its heights.
    pub fn verify(&self, mesh: impl AsRef<Path>) -> VerifyBuilder<'_, BandGrid> {
        VerifyBuilder::of(self, mesh.as_ref())
    }

    fn bands(&self) -> Result<Bands> {
        Bands::new(&self.bands, &self.weights, self.heights)
    }
}

/// A mesh of several bands to be made, by greedy insertion of the sample whose largest weighted error over all
/// bands is the largest (Garland and Heckbert 1995). The bands are held in memory, at 8 bytes a sample each
/// and 212 for all of them.
pub struct BandTinBuilder<'a> {
    grid: &'a BandGrid,
    goal: Option<Goal>,
    format: Option<String>,
    run: Run,
}

run_settings!([] BandTinBuilder<'_>);
output_settings!([] BandTinBuilder<'_>);

impl BandTinBuilder<'_> {
    /// In no band any valid sample further than this from the mesh, divided by the weight of the band.
    pub fn max_error(mut self, tolerance: f64) -> Self {
        self.goal = Some(Goal::MaxError(tolerance));
        self
    }

    /// The smallest tolerance that so many vertices allow.
    pub fn max_vertices(mut self, count: u64) -> Self {
        self.goal = Some(Goal::MaxVertices(count));
        self
    }

    /// The smallest tolerance that so many triangles allow.
    pub fn max_triangles(mut self, count: u64) -> Self {
        self.goal = Some(Goal::MaxTriangles(count));
        self
    }

    /// Makes the mesh and writes it: PLY holds any bands, GLB three or four of 8 bits as colours.
    ///
    /// # Errors
    /// No goal; a band there is not, or twice; weights of another number; a grid with a side of more than 2^14
    /// samples, or that the memory does not hold; an output that exists, or of a format without room for bands.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// let bands = terrane::open_bands("synth:rough,size=65", &[1, 1]);
    /// assert!(bands.tin().max_error(1.0).write("mesh.ply").is_err(), "one band twice");
    /// # Ok(())
    /// # }
    /// ```
    pub fn write(self, path: impl Into<PathBuf>) -> Result<TinReport> {
        let none = || Error::usage("the mesh has nothing to reach").remedy("say .max_error(...)");
        let BandGrid { inputs, reading, .. } = self.grid;
        let job = TinJob {
            reading: reading.clone(),
            format: self.format,
            overwrite: self.run.overwrite,
            resources: self.run.resources()?,
            ..TinJob::new(inputs.clone(), path.into(), self.goal.ok_or_else(none)?)
        };
        tin::run_bands(&job, &self.grid.bands()?, &*self.run.progress, &self.run.cancel)
    }
}

impl VerifyBuilder<'_, BandGrid> {
    /// Proves the mesh.
    ///
    /// # Errors
    /// What keeps the proof from being done: bands that the mesh was not made of, files that cannot be read, too
    /// little memory.
    pub fn run(self) -> Result<VerifyReport> {
        self.against.bands()?;
        let BandGrid { inputs, reading, bands, weights, heights } = self.against;
        let asked =
            AskedBands { bands: bands.clone(), weights: weights.clone(), heights: *heights };
        let job = VerifyJob { bands: Some(asked), ..self.mesh_job(inputs, reading)? };
        verify::run(&job, &*self.run.progress, &self.run.cancel)
    }
}
