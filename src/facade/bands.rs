//! Several bands of a grid that share one mesh, such as the colours of a photograph.

use std::path::Path;

use terrane_engine::operation::{HasGroup, Job};
use terrane_engine::options::GridInput;
use terrane_engine::proof::WrittenOutput;
use terrane_options::Options;
use terrane_raster::Inputs;
use terrane_terrain::tin::TinOptions;
use terrane_verify::MeshProof;

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
/// use terrane::prelude::*;
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

    /// One mesh of all the bands, by greedy insertion of the sample whose largest weighted error over all bands is the
    /// largest (Garland and Heckbert 1995). The bands are held in memory, at 8 bytes a sample each and 212 for all of them.
    /// PLY holds any bands, GLB three or four of 8 bits as colours.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// let bands = terrane::open_bands("synth:rough,size=65", &[1, 1]);
    /// assert!(bands.tin().max_error(1.0).write("mesh.ply").is_err(), "one band twice");
    /// # Ok(())
    /// # }
    /// ```
    pub fn tin(&self) -> Job<'_, TinOptions> {
        Job::new(
            self.inputs.clone(),
            self.options(|own: &mut TinOptions| (&mut own.bands, &mut own.weights)),
        )
    }

    /// The proof of a mesh in a file against these bands, each of its channels and its heights.
    pub fn verify(&self, mesh: impl AsRef<Path>) -> Job<'_, MeshProof, WrittenOutput> {
        let written =
            WrittenOutput { file: mesh.as_ref().to_path_buf(), original: self.inputs.clone() };
        Job::new(written, self.options(|own: &mut MeshProof| (&mut own.bands, &mut own.weights)))
    }

    /// Options for these bands, which `of` are in.
    fn options<O: Options + HasGroup<GridInput>>(
        &self,
        of: impl FnOnce(&mut O) -> (&mut Vec<u32>, &mut Vec<f64>),
    ) -> O {
        let mut options = O::default();
        let reading = options.part_mut();
        reading.clone_from(&self.reading);
        reading.band = self.heights;
        let (bands, weights) = of(&mut options);
        bands.clone_from(&self.bands);
        weights.clone_from(&self.weights);
        options
    }
}
