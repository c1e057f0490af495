//! Grids of heights in files.

use std::path::Path;

use super::contours::ContourBuilder;
use super::convert::ConvertBuilder;
use super::tin::TinBuilder;
use super::verify::VerifyBuilder;
use terrane_base::geom::Rect;
use terrane_base::{Error, ErrorKind, Result};
use terrane_files::name_of;
use terrane_jobs::reading::Reading;
use terrane_jobs::{Resources, memory};
use terrane_raster::{self as raster, GridInfo, GridSource, Inputs, OpenOptions};

/// A grid of heights, in one file or many: what [`open`] opens.
///
/// Nothing of it is held; jobs read it by window. A grid is a lattice of *samples*; those without a value
/// (nodata, masked, NaN) are *voids*.
pub struct Grid {
    pub(super) inputs: Inputs,
    pub(super) reading: Reading,
    source: Box<dyn GridSource>,
}

/// Opens a grid of heights: a GeoTIFF, SRTM, ASCII, DTED, NumPy or any other
/// [format](https://docs.rs/terrane-raster) by its content, or a synthetic terrain by its name.
///
/// Several files (a `Vec<String>`), a folder, a list or a pattern are one mosaic: on the lattice of the
/// first one, later ones on top wherever they are valid.
///
/// What has to be unpacked first is unpacked into the system's folder for temporary files.
///
/// # Errors
/// A file that is missing, damaged, of no known format or beyond a limit; files that do not fit together.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// let grid = terrane::open("synth:rough,size=129,seed=7")?;
/// assert_eq!((grid.info().width, grid.info().height), (129, 129));
/// let corner = grid.heights(terrane::Rect::new(0, 0, 2, 2))?;
/// assert_eq!(corner.len(), 4);
/// # Ok(())
/// # }
/// ```
pub fn open(input: impl Into<Inputs>) -> Result<Grid> {
    Grid::open(input.into(), Reading::default())
}

impl Grid {
    fn open(inputs: Inputs, reading: Reading) -> Result<Self> {
        let usual = OpenOptions::default().cache_bytes;
        let options = reading.options(&Resources::default(), usual)?;
        let source = match raster::open_all(inputs.names(), &options) {
            // A block of it is larger than what is held unless told otherwise.
            Err(error) if error.kind() == ErrorKind::Resource => {
                let block = memory::look_at(&inputs, &options)?.block_bytes();
                let cache_bytes = usize::try_from(2 * block).unwrap_or(usize::MAX);
                raster::open_all(inputs.names(), &OpenOptions { cache_bytes, ..options })?
            }
            opened => opened?,
        };
        Ok(Self { inputs, reading, source })
    }

    /// The same files, another band of them, counted from 1.
    ///
    /// # Errors
    /// A band there is not.
    pub fn band(self, band: u32) -> Result<Self> {
        Self::open(self.inputs, Reading { band, ..self.reading })
    }

    /// The same, with this stored value for voids instead of the files' own.
    ///
    /// # Errors
    /// As [`open`].
    pub fn nodata(self, value: f64) -> Result<Self> {
        Self::open(self.inputs, Reading { nodata: Some(value), ..self.reading })
    }

    /// The same, clipped to the polygons of a file of features: samples outside of all of them are voids.
    /// Those on a border stay, and rings within a polygon are holes.
    ///
    /// # Errors
    /// A file that cannot be read, of another reference system, with anything else than polygons, or whose
    /// polygons hold no sample.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// let areas = folder.path().join("areas.wkt");
    /// std::fs::write(&areas, "POLYGON ((500100 4749900, 500900 4749900, 500500 4749100))").unwrap();
    /// std::fs::write(areas.with_extension("prj"), "EPSG:32631").unwrap();
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?.clip(&areas)?;
    /// let corner = dem.heights(terrane::Rect::new(0, 0, 1, 1))?;
    /// assert!(corner[0].is_nan());
    /// # Ok(())
    /// # }
    /// ```
    pub fn clip(self, polygons: impl AsRef<Path>) -> Result<Self> {
        let clip = Some(name_of(polygons.as_ref().to_path_buf())?);
        Self::open(self.inputs, Reading { clip, ..self.reading })
    }

    /// The same with level water: the polygons of a file of features are lakes, as high as their lowest bank, and
    /// those that a line of the file runs within are rivers, which fall along it (drawn downstream) and are nowhere
    /// above their banks. Levels are found when it is first read, in time linear in the samples near water; edges
    /// of a mesh made of it follow the banks.
    ///
    /// # Errors
    /// A file that cannot be read, of another reference system, with points, without polygons, or none on the grid.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// let lake = folder.path().join("lake.wkt");
    /// std::fs::write(&lake, "POLYGON ((500300 4749700, 500700 4749700, 500500 4749300))").unwrap();
    /// std::fs::write(lake.with_extension("prj"), "EPSG:32631").unwrap();
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?.water(&lake)?;
    /// let wet = dem.heights(terrane::Rect::new(48, 36, 5, 5))?;
    /// assert!(wet.iter().all(|height| *height == wet[0]));
    /// # Ok(())
    /// # }
    /// ```
    pub fn water(self, file: impl AsRef<Path>) -> Result<Self> {
        let water = Some(name_of(file.as_ref().to_path_buf())?);
        Self::open(self.inputs, Reading { water, ..self.reading })
    }

    /// Size, place, reference system and storage.
    pub fn info(&self) -> &GridInfo {
        self.source.info()
    }

    /// The heights of a rectangle of samples, row by row, NaN for voids. Takes 8 bytes for each.
    ///
    /// # Errors
    /// A rectangle that reaches out of the grid; damage in the file.
    pub fn heights(&self, rect: Rect) -> Result<Vec<f64>> {
        if self.info().bounds().intersect(&rect) != rect {
            return Err(Error::usage(format!("{rect:?} reaches out of the grid")));
        }
        let mut heights = vec![f64::NAN; rect.len()];
        self.source.read_f64(rect, &mut heights)?;
        Ok(heights)
    }

    /// A triangle mesh of it, none of its samples further from the mesh than a tolerance.
    pub fn tin(&self) -> TinBuilder<&Grid> {
        TinBuilder::of(self)
    }

    /// Contour lines of it.
    pub fn contours(&self) -> ContourBuilder<'_> {
        ContourBuilder::of(self)
    }

    /// A copy of it, or of a part, in another format.
    pub fn convert(&self) -> ConvertBuilder<'_> {
        ConvertBuilder::of(self)
    }

    /// The proof of a mesh in a file against this grid.
    pub fn verify(&self, mesh: impl AsRef<Path>) -> VerifyBuilder<'_, Grid> {
        VerifyBuilder::of(self, mesh.as_ref())
    }
}
