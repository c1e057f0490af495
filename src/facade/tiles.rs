//! Tiles of the globe's terrain.

use std::path::PathBuf;

use super::cloud::Cloud;
use super::grid::Grid;
use super::run::{Run, overwrite_setting, run_settings};
use terrane_base::{Error, Result};
use terrane_jobs::grid::GroundFrom;
use terrane_jobs::options::GridInput;
use terrane_jobs::plan::AnyPlan as Plan;
use terrane_jobs::tiles::{
    self, Beyond, Format as TilesFormat, GroundModel, PlanJob, TilesJob, TilesReport, run_cloud,
};

/// Tiles of a grid in any system, or of a model of the ground of a cloud, to be made, for viewers of the globe, at every level of detail:
/// quantized-mesh 1.0, 3D Tiles 1.1, or both. No sample is further from a tile, as a client decodes it, than clients take its level to be
/// off by. Sources: <https://github.com/CesiumGS/quantized-mesh>, <https://www.ogc.org/standards/3dtiles>.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let (dem, tiles) = (folder.path().join("dem.asc"), folder.path().join("tiles"));
/// # let row = "5 7 9 6\n";
/// # let text = format!("ncols 4\nnrows 4\nxllcenter 7\nyllcenter 46\ncellsize 0.01\n{}", row.repeat(4));
/// # std::fs::write(&dem, text).unwrap();
/// # std::fs::write(folder.path().join("dem.prj"), "EPSG:4326").unwrap();
/// let made = terrane::open(&dem)?.tiles().max_level(8).write(&tiles)?;
/// assert_eq!(made.levels.len(), 9);
/// assert!(made.levels.iter().all(|level| level.error <= level.tolerance)); // metres
/// assert!(tiles.join("layer.json").exists());
/// # Ok(())
/// # }
/// ```
pub struct TilesBuilder<'a> {
    of: Of<'a>,
    /// What is asked for; its input and output are those of `of` and of the end.
    job: TilesJob,
    run: Run,
}

/// What tiles are made of.
enum Of<'a> {
    Grid(&'a Grid),
    Cloud(&'a Cloud, Box<GroundModel>),
}

run_settings!([] TilesBuilder<'_>);
overwrite_setting!([] TilesBuilder<'_>);

impl<'a> TilesBuilder<'a> {
    pub(super) fn of(grid: &'a Grid) -> Self {
        Self::new(Of::Grid(grid))
    }

    pub(super) fn of_cloud(cloud: &'a Cloud, cell: Option<f64>) -> Self {
        let model = GroundModel {
            input: cloud.inputs.clone(),
            cloud: cloud.options.clone(),
            cell: cell.map(|side| [side; 2]),
            ground: GroundFrom::Auto,
        };
        Self::new(Of::Cloud(cloud, Box::new(model)))
    }

    fn new(of: Of<'a>) -> Self {
        Self { of, job: TilesJob::new("", ""), run: Run::default() }
    }

    /// A file with the heights of the geoid that those of the grid are counted from, above the ellipsoid, in metres
    /// (GTX or GeoTIFF). Heights are taken from the ellipsoid on without it.
    pub fn geoid(mut self, file: impl Into<String>) -> Self {
        self.job.geoid = Some(file.into());
        self
    }

    /// What to write (quantized-mesh unless told otherwise); of several formats, a folder for each in the output.
    pub fn formats(mut self, formats: &[TilesFormat]) -> Self {
        self.job.formats = formats.to_vec();
        self
    }

    /// Name the vertices of the sides of 3D Tiles (`CESIUM_tile_edges`), which CesiumJS needs to take them for its
    /// terrain.
    pub fn tile_edges(mut self, edges: bool) -> Self {
        self.job.tile_edges = edges;
        self
    }

    /// Compress what is in a tile of 3D Tiles (`EXT_meshopt_compression`), which clients then have to know.
    pub fn meshopt(mut self, meshopt: bool) -> Self {
        self.job.meshopt = meshopt;
        self
    }

    /// Hang a skirt from the sides of each tile of 3D Tiles, as deep as borders of its level and of the next coarser one
    /// may differ.
    pub fn skirts(mut self, skirts: bool) -> Self {
        self.job.skirts = skirts;
        self
    }

    /// Tell in each tile of quantized-mesh which of its 256 x 256 pixels are water (the extension `watermask`): those
    /// whose middle lies in a polygon of the file of [`Grid::water`].
    pub fn water_mask(mut self, mask: bool) -> Self {
        self.job.water_mask = mask;
        self
    }

    /// The deepest level, from 0 to 20; the first whose tiles have at most 64 samples along a side unless told
    /// otherwise.
    pub fn max_level(mut self, level: u8) -> Self {
        self.job.max_level = Some(level);
        self
    }

    /// The ground between the edge of the grid and the sides of the tiles that hold it: it falls to the ellipsoid unless
    /// told otherwise.
    pub fn beyond(mut self, beyond: Beyond) -> Self {
        self.job.beyond = beyond;
        self
    }

    /// Write a normal for each vertex, which viewers light the ground by (so it is unless told otherwise).
    pub fn normals(mut self, normals: bool) -> Self {
        self.job.normals = normals;
        self
    }

    /// Compress each file (gzip; so it is unless told otherwise).
    pub fn compress(mut self, compress: bool) -> Self {
        self.job.compress = compress;
        self
    }

    /// Makes the tiles in a folder of this name, which appears whole or not at all.
    ///
    /// # Errors
    /// A grid whose place on the globe is not known, or that lies around a pole or across 180 degrees; damage in it; too little memory; an output that exists or cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<TilesReport> {
        let (job, run) = (self.job(path.into())?, &self.run);
        match &self.of {
            Of::Grid(_) => tiles::run(&job, &*run.progress, &run.cancel),
            Of::Cloud(_, model) => run_cloud(model, &job, None, &*run.progress, &run.cancel),
        }
    }

    /// Writes down the work as tasks in a folder; each has so many tiles (`cut`), of about a million samples with all
    /// that is in them, or larger ones.
    ///
    /// # Errors
    /// Those of [`write`](Self::write) that are found before the work; a cloud, whose model is planned first; a folder
    /// that holds another plan or other files.
    pub fn plan(self, folder: impl Into<PathBuf>, cut: impl Into<Option<u32>>) -> Result<Plan> {
        if self.run.overwrite {
            return Err(Error::usage("a plan writes no tiles yet, to be in place of others")
                .remedy("leave overwrite out"));
        }
        if matches!(self.of, Of::Cloud(..)) {
            return Err(Error::usage(
                "tiles of a cloud are those of a model, which is planned first",
            )
            .remedy("plan a grid of it, run that, and plan the tiles of the grid"));
        }
        let folder = folder.into();
        let job = self.job(folder.join("tiles"))?;
        let plan = PlanJob { job, folder: folder.clone(), cut: cut.into(), skipped: Vec::new() };
        tiles::plan_tiles(&plan)?;
        Plan::open(folder)
    }

    fn job(&self, output: PathBuf) -> Result<TilesJob> {
        let (input, reading) = match self.of {
            Of::Grid(grid) => (grid.inputs.clone(), grid.reading.clone()),
            Of::Cloud(cloud, _) => (cloud.inputs.clone().into(), GridInput::default()),
        };
        let (overwrite, resources) = (self.run.overwrite, self.run.resources()?);
        Ok(TilesJob { input, reading, output, overwrite, resources, ..self.job.clone() })
    }
}
