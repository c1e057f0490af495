//! Grids of heights in files and in memory.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Map, Value as Json};
use terrane_base::geom::Rect;
use terrane_base::{Error, ErrorKind, Result};
use terrane_engine::operation::{HasGroup, Job};
use terrane_engine::options::GridInput;
use terrane_engine::proof::{OutputProof, WrittenOutput};
use terrane_engine::{Resources, memory};
use terrane_files::name_of;
use terrane_options::{Options, to_map};
use terrane_raster::{
    self as raster, ArrayGrid, GridInfo, GridNote, GridOpenOptions, GridSource, InMemoryGrid,
    Inputs,
};
use terrane_terrain::colours::{ColorReliefOptions, ColorReliefSetters};
use terrane_terrain::contour::ContourOptions;
use terrane_terrain::convert::ConvertOptions;
use terrane_terrain::difference::{DifferenceOptions, DifferenceSetters};
use terrane_terrain::fill::FillOptions;
use terrane_terrain::relief::{
    AspectOptions, CurvatureOptions, HillshadeOptions, RoughnessOptions, SlopeOptions, TpiOptions,
    TriOptions,
};
use terrane_terrain::sample::{SampleOptions, SampleSetters};
use terrane_terrain::tin::TinOptions;
use terrane_terrain::zonal::{ZonalOptions, ZonalSetters};
use terrane_verify::MeshProof;

use super::Data;

/// A grid of heights in one file or many; see [`open`].
///
/// Jobs read it by window; nothing is held in memory. A grid is a lattice of *samples*; samples without a value
/// (nodata, masked, NaN) are *voids*.
pub struct Grid {
    pub(super) inputs: Inputs,
    pub(super) reading: GridInput,
    source: Box<dyn GridSource>,
    /// Releases memory when the last copy is dropped.
    memory: Option<Arc<InMemoryGrid>>,
}

/// Opens a grid of heights: a GeoTIFF, SRTM, ASCII, DTED, NumPy or any other
/// [format](https://docs.rs/terrane-raster) by its content, or a synthetic terrain by its name.
///
/// Several files (a `Vec<String>`), a folder, a list or a pattern are one mosaic on the lattice of the first
/// file; later files cover earlier ones where they are valid.
///
/// Compressed containers are unpacked into the system's temporary folder.
///
/// # Errors
/// A missing or damaged file, an unknown format, an exceeded limit; files that do not match.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// let grid = terrane::open("synth:rough,size=129,seed=7")?;
/// assert_eq!((grid.info().width, grid.info().height), (129, 129));
/// let corner = grid.heights(terrane::Rect::new(0, 0, 2, 2))?;
/// assert_eq!(corner.len(), 4);
/// # Ok(())
/// # }
/// ```
pub fn open(input: impl Into<Inputs>) -> Result<Grid> {
    Grid::open(input.into(), GridInput::default())
}

/// Wraps heights in memory as a grid, without copying. To make a [`Tin`](crate::Tin) of a slice, use
/// [`Tin::from_array`](crate::Tin::from_array).
///
/// # Errors
/// Too little memory.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("mesh.ply");
/// let heights: Vec<i16> = (0..90 * 60).map(|i| (i % 90 * (i / 90) / 7) as i16).collect();
/// let grid = terrane::open_array(terrane::ArrayGrid::shared(heights, 90, 60)?.with_nodata(Some(0.0)))?;
/// grid.tin().max_error(1.5).write(&path)?;
/// let proof = grid.verify(&path).run()?;
/// assert!(proof.verdict.passed);
/// # Ok(())
/// # }
/// ```
pub fn open_array(grid: ArrayGrid<'static>) -> Result<Grid> {
    let memory = InMemoryGrid::new(grid);
    let inputs = Inputs::labelled(vec![memory.name().to_owned()], "array".to_owned());
    let grid = Grid::open(inputs, GridInput::default())?;
    Ok(Grid { memory: Some(Arc::new(memory)), ..grid })
}

impl Grid {
    fn open(inputs: Inputs, reading: GridInput) -> Result<Self> {
        let cache_bytes = GridOpenOptions::default().cache_bytes;
        let options = reading.options(&Resources::default(), cache_bytes)?;
        let source = match raster::open_all(inputs.names(), &options) {
            // A block is larger than the default cache.
            Err(error) if error.kind() == ErrorKind::Resource => {
                let block = memory::open_for_estimate(&inputs, &options)?.block_bytes();
                let cache_bytes = usize::try_from(2 * block).unwrap_or(usize::MAX);
                raster::open_all(inputs.names(), &GridOpenOptions { cache_bytes, ..options })?
            }
            opened => opened?,
        };
        Ok(Self { inputs, reading, source, memory: None })
    }

    /// The same grid with other input options.
    fn read_as(self, change: impl FnOnce(&mut GridInput)) -> Result<Self> {
        let Self { inputs, memory, mut reading, .. } = self;
        change(&mut reading);
        Ok(Self { memory, ..Self::open(inputs, reading)? })
    }

    /// Selects another band of the files, counted from 1.
    ///
    /// # Errors
    /// An unknown band.
    pub fn band(self, band: u32) -> Result<Self> {
        self.read_as(|reading| reading.band = Some(band))
    }

    /// The same grid with this stored nodata value, instead of that of the files.
    ///
    /// # Errors
    /// As [`open`].
    pub fn nodata(self, value: f64) -> Result<Self> {
        self.read_as(|reading| reading.nodata = Some(value))
    }

    /// The part whose cells (the square around each sample) intersect the box (x low, y low, x high, y high).
    ///
    /// # Errors
    /// A box that intersects no cell of the grid.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?.bounds([500_200.0, 4_749_000.0, 500_700.0, 4_749_500.0])?;
    /// assert_eq!((dem.info().width, dem.info().height), (51, 51));
    /// # Ok(())
    /// # }
    /// ```
    pub fn bounds(self, bounds: [f64; 4]) -> Result<Self> {
        self.read_as(|reading| reading.bounds = Some(bounds))
    }

    /// The grid clipped to the polygons of a vector file: samples outside all polygons are voids. Samples on a
    /// border stay; inner rings are holes.
    ///
    /// # Errors
    /// A file that cannot be read, has another CRS, has geometries other than polygons, or has no polygon with
    /// samples.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
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
        let clip = name_of(polygons.as_ref().to_path_buf())?;
        self.read_as(|reading| reading.clip = Some(clip))
    }

    /// The grid with flattened water: polygons of a vector file are lakes at the height of their lowest bank;
    /// polygons with a line of the file inside are rivers, which descend along the line (drawn downstream) and
    /// stay below their banks. Levels are computed at the first read, in time linear in the samples near water;
    /// mesh edges follow the banks.
    ///
    /// # Errors
    /// A file that cannot be read, has another CRS, has points, has no polygons, or lies off the grid.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
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
        let water = name_of(file.as_ref().to_path_buf())?;
        self.read_as(|reading| reading.water = Some(water))
    }

    /// Size, georeference, CRS and storage.
    pub fn info(&self) -> &GridInfo {
        self.source.info()
    }

    /// Problems and things easily overlooked: no CRS, several bands, a nodata value out of range for the type.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// let heights = terrane::ArrayGrid::shared(vec![0_i16; 12], 4, 3)?.with_nodata(Some(70_000.0));
    /// let notes = terrane::open_array(heights)?.notes();
    /// assert!(notes.iter().any(|note| note.kind == "impossible nodata"));
    /// # Ok(())
    /// # }
    /// ```
    pub fn notes(&self) -> Vec<GridNote> {
        raster::notes(self.info())
    }

    /// Heights of a rectangle of samples, row by row, NaN for voids; 8 bytes per sample.
    ///
    /// # Errors
    /// A rectangle that extends beyond the grid; a damaged file.
    pub fn heights(&self, rect: Rect) -> Result<Vec<f64>> {
        if self.info().bounds().intersect(&rect) != rect {
            return Err(Error::usage(format!("{rect:?} extends beyond the grid")));
        }
        let mut heights = vec![f64::NAN; rect.len()];
        self.source.read_f64(rect, &mut heights)?;
        Ok(heights)
    }

    /// A triangle mesh whose vertical error at all samples is at most a tolerance, by greedy insertion (Garland
    /// and Heckbert 1995) in tiles with shared border vertices, joined without seams, with redundant vertices
    /// removed; or by [another method](crate::prelude::TinSetters::method).
    ///
    /// The target is one of [`max_error`](crate::prelude::TinTargetSetters::max_error),
    /// [`max_vertices`](crate::prelude::TinTargetSetters::max_vertices) and
    /// [`max_triangles`](crate::prelude::TinTargetSetters::max_triangles). [`write`](Job::write) makes a mesh
    /// file of any size, [`build`](crate::prelude::BuildTin::build) a mesh in memory. Time is about linear in
    /// the samples; two to six times as long for a number of vertices or triangles. The result depends only on
    /// heights, options and [tile size](crate::prelude::TinSetters::tile).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [path, peaks, thin] = ["mesh.ply", "peaks.wkt", "thin.ply"].map(|name| folder.path().join(name));
    /// # std::fs::write(&peaks, "MULTIPOINT ((500100 4749000), (500512 4749377))").unwrap();
    /// # std::fs::write(peaks.with_extension("prj"), "EPSG:32631").unwrap();
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let report = dem.tin().max_error(5.0).min_angle(20.0).memory("256M").write(&path)?;
    /// assert_eq!(report.thin_triangles.unwrap().count, 0);
    /// assert!(dem.verify(&path).run()?.verdict.passed);
    ///
    /// // Samples nearest to the points of a file stay; triangles may be others than Delaunay ones.
    /// let fewer = dem.tin().max_error(5.0).keep_points(peaks.to_str().unwrap());
    /// let fewer = fewer.triangulation(terrane::TriangulationRule::DataDependent).write(&thin)?;
    /// assert!(fewer.vertices < report.vertices);
    /// # Ok(())
    /// # }
    /// ```
    pub fn tin(&self) -> Job<'_, TinOptions> {
        self.job()
    }

    /// Contour lines at an interval or at given levels, joined across tiles and ended at voids.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("contours.geojson");
    /// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
    /// let report = dem.contour().interval(20.0).write(&path)?;
    /// assert!(report.levels > 0);
    /// let path = folder.path().join("degrees.geojson");
    /// let report = dem.contour().interval(20.0).to_crs("EPSG:4326").write(&path)?;
    /// assert_eq!(report.transformed.unwrap().crs, "EPSG:4326 (WGS 84)");
    /// # Ok(())
    /// # }
    /// ```
    pub fn contour(&self) -> Job<'_, ContourOptions> {
        self.job()
    }

    /// Heights at the points of a feature file, as a property; or at all vertices of its features, as
    /// [z](crate::prelude::SampleSetters::with_z).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [points, path] = ["points.wkt", "heights.geojson"].map(|name| folder.path().join(name));
    /// # std::fs::write(&points, "POINT (500100 4749000)").unwrap();
    /// # std::fs::write(points.with_extension("prj"), "EPSG:32631").unwrap();
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let report = dem.sample(&points).write(&path)?;
    /// assert_eq!((report.positions, report.without_height), (1, 0));
    /// # Ok(())
    /// # }
    /// ```
    pub fn sample(&self, features: impl Into<PathBuf>) -> Job<'_, SampleOptions> {
        self.job().features(features)
    }

    /// Statistics within each polygon of a feature file, as properties of the polygons.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::ZoneStatistic::{Mean, Percentile};
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [zones, path] = ["zones.wkt", "means.geojson"].map(|name| folder.path().join(name));
    /// # std::fs::write(&zones, "POLYGON ((500100 4749000, 501000 4749000, 500500 4748000, 500100 4749000))").unwrap();
    /// # std::fs::write(zones.with_extension("prj"), "EPSG:32631").unwrap();
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let report = dem.zonal(&zones).stat([Mean, Percentile(95.0)]).write(&path)?;
    /// assert_eq!((report.common.features, report.empty_zones), (1, 0));
    /// # Ok(())
    /// # }
    /// ```
    pub fn zonal(&self, zones: impl Into<PathBuf>) -> Job<'_, ZonalOptions> {
        self.job().zones(zones)
    }

    /// The grid with voids filled from the nearest valid samples in four quadrants around each, weighted by the inverse
    /// of their distance (the rule of `gdal_fillnodata`).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("filled.tif");
    /// let heights = terrane::ArrayGrid::shared(vec![1.0, f32::NAN, f32::NAN, 4.0], 4, 1)?;
    /// let report = terrane::open_array(heights)?.fill().max_distance(10).write(&path)?;
    /// assert_eq!((report.filled, report.left), (2, 0));
    /// let filled = terrane::open(&path)?.heights(terrane::Rect::new(0, 0, 4, 1))?;
    /// assert_eq!(filled, [1.0, 2.0, 3.0, 4.0]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn fill(&self) -> Job<'_, FillOptions> {
        self.job()
    }

    /// Heights of the grid minus those of a reference, a file, a pattern or a synthetic terrain, on the lattice of the
    /// grid; with statistics, and areas and volumes above and below.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("difference.tif");
    /// let dem = terrane::open("synth:rough,size=129,seed=7")?;
    /// let report = dem.difference("synth:rough,size=129,seed=8").level_of_detection(0.5).write(&path)?;
    /// assert_eq!(report.compared, 129 * 129);
    /// assert!(report.volume_below > Some(0.0) && report.lowest_at.is_some());
    /// # Ok(())
    /// # }
    /// ```
    pub fn difference(&self, reference: impl Into<String>) -> Job<'_, DifferenceOptions> {
        self.job().reference(reference)
    }

    /// A copy of the grid, or of a part, in another format; exact unless
    /// [rounding](crate::prelude::SampleOutputSetters::round) is allowed. With
    /// [`resampling`](crate::prelude::ConvertSetters::resampling) it may have another lattice and another CRS.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("copy.tif");
    /// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
    /// dem.convert().write(&path)?;
    /// let copy = terrane::open(&path)?;
    /// assert_eq!(copy.heights(copy.info().bounds())?, dem.heights(dem.info().bounds())?);
    /// # let path = folder.path().join("globe.tif");
    /// dem.convert().to_crs("EPSG:4326").resampling("bilinear").write(&path)?;
    /// assert_eq!(terrane::open(&path)?.info().crs.epsg, Some(4326));
    /// # Ok(())
    /// # }
    /// ```
    pub fn convert(&self) -> Job<'_, ConvertOptions> {
        self.job()
    }

    /// Slope at each sample.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("slope.tif");
    /// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
    /// dem.slope().percent(true).creation("COMPRESS", "DEFLATE").format("GTiff").write(&path)?;
    /// assert!(terrane::open(&path)?.heights(terrane::Rect::new(1, 1, 1, 1))?[0] > 0.0);
    /// # Ok(())
    /// # }
    /// ```
    pub fn slope(&self) -> Job<'_, SlopeOptions> {
        self.job()
    }

    /// The direction of steepest descent at each sample.
    pub fn aspect(&self) -> Job<'_, AspectOptions> {
        self.job()
    }

    /// Shaded relief.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::prelude::*;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("shade.png");
    /// let dem = terrane::open("synth:smooth,size=129,seed=7")?;
    /// dem.hillshade().altitude(30.0).multidirectional(true).write(&path)?;
    /// let error = dem.hillshade().azimuth(90.0).multidirectional(true).write(&path).unwrap_err();
    /// assert!(error.to_string().contains("cannot be used with"));
    /// # Ok(())
    /// # }
    /// ```
    pub fn hillshade(&self) -> Job<'_, HillshadeOptions> {
        self.job()
    }

    /// A picture with colours by height from a file.
    pub fn color_relief(&self, colors: impl Into<PathBuf>) -> Job<'_, ColorReliefOptions> {
        self.job().colors(colors)
    }

    /// Curvature at each sample.
    pub fn curvature(&self) -> Job<'_, CurvatureOptions> {
        self.job()
    }

    /// Range of heights around each sample.
    pub fn roughness(&self) -> Job<'_, RoughnessOptions> {
        self.job()
    }

    /// Topographic position index of each sample.
    pub fn tpi(&self) -> Job<'_, TpiOptions> {
        self.job()
    }

    /// Terrain ruggedness index of each sample.
    pub fn tri(&self) -> Job<'_, TriOptions> {
        self.job()
    }

    /// An operation on the grid.
    pub(super) fn job<O: Options + HasGroup<GridInput> + HasGroup<Resources>>(&self) -> Job<'_, O> {
        Job::new(self.inputs.clone(), self.options())
    }

    /// Verification of a mesh file against this grid. Meshes of terrane state their tolerance, the samples it
    /// refers to, and their smallest angle; errors of other meshes are measured and not judged without a
    /// [largest error](crate::prelude::MeshProofSetters::max_error).
    pub fn verify(&self, mesh: impl AsRef<Path>) -> Job<'_, MeshProof, WrittenOutput> {
        self.proof(mesh.as_ref())
    }

    pub(super) fn proof<O: OutputProof + HasGroup<GridInput>>(
        &self,
        file: &Path,
    ) -> Job<'_, O, WrittenOutput> {
        let written = WrittenOutput { file: file.to_path_buf(), original: self.inputs.clone() };
        Job::new(written, self.options())
    }

    /// Input options of the grid.
    fn options<O: Options + HasGroup<GridInput>>(&self) -> O {
        let mut options = O::default();
        *options.part_mut() = self.reading.clone();
        options
    }
}

/// Files that may differ in lattice or CRS: each is resampled when they are [converted](Self::convert) to one grid.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// # let folder = tempfile::tempdir().unwrap();
/// # let [fine, coarse, path] = ["fine.tif", "coarse.tif", "merged.tif"].map(|name| folder.path().join(name));
/// let dem = terrane::open("synth:smooth,size=65,seed=7")?;
/// dem.convert().to_crs("EPSG:4326").resampling("bilinear").write(&coarse)?;
/// dem.convert().resolution([5.0, 5.0]).resampling("cubic").write(&fine)?;
/// # let names = [coarse, fine].map(|path| path.display().to_string()).to_vec();
/// let files = terrane::open_files(names); // from bottom to top
/// files.convert().to_crs("EPSG:32631").resampling("bilinear").write(&path)?;
/// assert_eq!(terrane::open(&path)?.info().transform.a, 5.0);
/// # Ok(())
/// # }
/// ```
pub struct GridFiles(Inputs);

/// Files that may differ in lattice or CRS. Nothing is read until they are converted.
pub fn open_files(input: impl Into<Inputs>) -> GridFiles {
    GridFiles(input.into())
}

impl GridFiles {
    /// One grid of all files, the later ones on top where they are valid; see
    /// [`priority`](crate::prelude::ConvertSetters::priority).
    pub fn convert(&self) -> Job<'_, ConvertOptions> {
        Job::new(self.0.clone(), ConvertOptions::default())
    }
}

impl Data for GridFiles {
    fn inputs(&self) -> Inputs {
        self.0.clone()
    }

    fn reading(&self) -> Map<String, Json> {
        Map::new()
    }
}

impl Data for Grid {
    fn inputs(&self) -> Inputs {
        self.inputs.clone()
    }

    fn reading(&self) -> Map<String, Json> {
        to_map(&self.reading)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use crate::{open_cloud, open_points};

    /// What is made of a grid in a file and of the same heights in memory, byte by byte.
    #[test]
    fn grids_in_memory_are_as_those_in_files() -> Result<()> {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        open("synth:rough,size=257,seed=7")?.convert().write(path("dem.tif"))?;
        let file = open(path("dem.tif"))?;
        let info = file.info().clone();
        let heights: Vec<f32> =
            file.heights(info.bounds())?.into_iter().map(|height| height as f32).collect();
        let array = ArrayGrid::shared(heights, info.width, info.height)?;
        let array = open_array(array.placed(info.transform, info.crs))?;
        for (name, grid) in [("file", &file), ("array", &array)] {
            let at = |ending: &str| path(&format!("{name}.{ending}"));
            grid.tin().max_error(3.0).tile(64).write(at("ply"))?;
            grid.contour().interval(25.0).write(at("geojson"))?;
            grid.convert().write(at("asc"))?;
            assert!(grid.verify(at("ply")).run()?.verdict.passed);
        }
        // The header of a mesh names what it was made from.
        let body = |bytes: Vec<u8>| {
            let end = bytes.windows(10).position(|word| word == b"end_header").unwrap_or(0);
            bytes[end..].to_vec()
        };
        for ending in ["ply", "geojson", "asc"] {
            let [one, other] = ["file", "array"]
                .map(|name| std::fs::read(path(&format!("{name}.{ending}"))).unwrap());
            assert!(body(one) == body(other), "{ending}");
        }
        let plan = array.tin().max_error(3.0).plan(path("plan"), None).err().unwrap();
        assert!(plan.remedy_text().is_some_and(|remedy| remedy.contains("to a file")), "{plan}");
        Ok(())
    }

    #[test]
    fn models_of_points_in_memory_are_made_and_not_planned() -> Result<()> {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let points: Vec<[f64; 3]> = (0..4000_u32)
            .map(|i| [f64::from(i * 37 % 1000) / 10.0, f64::from(i * 91 % 997) / 10.0, 5.0])
            .collect();
        let cloud = open_points(&points, None, Default::default())?;
        cloud.grid(2.0).dtm(true).write(path("dtm.tif"))?;
        let dtm = open(path("dtm.tif"))?;
        let middle = dtm.heights(terrane_base::geom::Rect::new(20, 20, 3, 3))?;
        assert_eq!(middle, [5.0; 9]);
        let tin = cloud.tin().max_error(0.1).write(path("mesh.ply"))?;
        assert!(tin.vertices > 2 && cloud.verify(path("mesh.ply")).run()?.verdict.passed);
        assert!(cloud.grid(2.0).stat("mean").plan(path("plan"), None).is_err());
        let named = open_cloud("synth:cloud,size=60,density=2,seed=5")?;
        assert!(named.grid(2.0).stat("mean").plan(path("plan"), None).is_ok());
        Ok(())
    }
}
