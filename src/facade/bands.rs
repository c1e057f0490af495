//! Several bands of a grid that share one mesh, such as the colours of a photograph.

use std::path::Path;

use terrane_engine::operation::{HasGroup, Job};
use terrane_engine::options::GridInput;
use terrane_engine::proof::WrittenOutput;
use terrane_options::Options;
use terrane_raster::Inputs;
use terrane_terrain::tin::TinOptions;
use terrane_verify::MeshProof;

/// Bands of a grid, in one file or many, that share one mesh; see [`open_bands`]. Nothing is read before a mesh
/// is made.
#[derive(Clone, Debug)]
pub struct BandGrid {
    inputs: Inputs,
    reading: GridInput,
    bands: Vec<u32>,
    weights: Vec<f64>,
    heights: Option<u32>,
}

/// Selects bands of a grid (counted from 1) that share one mesh, such as the colours of a photograph.
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
    /// Weight of the error in each band; 1 by default.
    pub fn weights(mut self, weights: &[f64]) -> Self {
        self.weights = weights.to_vec();
        self
    }

    /// The band whose values are the vertex heights, one of the selected bands; heights are 0 by default.
    pub fn heights(mut self, band: u32) -> Self {
        self.heights = Some(band);
        self
    }

    /// Stored nodata value, instead of that of the files. A void in one band is a void in all.
    pub fn nodata(mut self, value: f64) -> Self {
        self.reading.nodata = Some(value);
        self
    }

    /// One mesh of all bands by greedy insertion of the sample with the largest weighted error over all bands
    /// (Garland and Heckbert 1995). Bands are held in memory: 8 bytes per sample and band, and 212 bytes per
    /// sample. PLY holds any bands, GLB three or four 8-bit bands as colours.
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

    /// Verification of a mesh file against these bands: each channel and the heights.
    pub fn verify(&self, mesh: impl AsRef<Path>) -> Job<'_, MeshProof, WrittenOutput> {
        let written =
            WrittenOutput { file: mesh.as_ref().to_path_buf(), original: self.inputs.clone() };
        Job::new(written, self.options(|own: &mut MeshProof| (&mut own.bands, &mut own.weights)))
    }

    /// Options for the inputs `of`.
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
