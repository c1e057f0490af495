//! Point clouds in files and in memory.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::plan::Plan;
use super::points::PointsBuilder;
use super::run::{Run, output_settings, run_settings};
use super::tiles::TilesBuilder;
use super::verify::VerifyBuilder;
use terrane_base::geom::Crs;
use terrane_base::{Error, Result};
use terrane_cloud::{self as cloud, CloudInfo, Filter, HeldCloud, Marks, OpenOptions};
use terrane_files::name_of;
use terrane_gridding::parse_list;
use terrane_jobs::cloud_tin::plan::{PlanCloudTinJob, plan_cloud_tin};
use terrane_jobs::cloud_tin::{self, CloudTinJob, CloudTinReport};
use terrane_jobs::grid::plan::{PlanGridJob, plan_grid};
use terrane_jobs::grid::{self, Canopy, GridJob, GridReport, GroundFrom, Placement, Preset};
use terrane_raster::Inputs;

/// A point cloud, in one file or many: what [`open_cloud`] opens. Nothing of it is held.
pub struct Cloud {
    pub(super) inputs: Vec<String>,
    pub(super) options: OpenOptions,
    info: CloudInfo,
    /// Gives up what is in memory, once the last one of it is gone.
    held: Option<Arc<HeldCloud>>,
}

/// Opens a point cloud: LAS, LAZ, COPC or text, or a synthetic one by its name. Several files (a
/// `Vec<String>`), a folder, a list or a pattern are one cloud.
///
/// # Errors
/// A file that is missing, damaged or no cloud; files that do not fit together.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("dtm.tif");
/// let cloud = terrane::open_cloud("synth:cloud,size=100,density=2,seed=7")?;
/// let report = cloud.grid(1.0).stats("mean,count").write(&path)?;
/// assert_eq!(report.bands.len(), 2);
/// # Ok(())
/// # }
/// ```
pub fn open_cloud(input: impl Into<Inputs>) -> Result<Cloud> {
    Cloud::open(input.into().names().to_vec(), OpenOptions::default())
}

/// Takes points in memory, x, y and z, for a cloud that jobs read as they read those in files; with what is known
/// of them, for filters. They are copied onto a lattice with the decimals they have, at most 9 and no more than
/// keep them within reach: 16 bytes a point.
///
/// # Errors
/// A coordinate that is not finite; marks of another number of points; points too far from each other.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("count.tif");
/// let points: Vec<[f64; 3]> = (0..5000).map(|i| [i as f64 % 71.0, i as f64 / 71.0, 0.25 * i as f64]).collect();
/// let cloud = terrane::open_points(&points, None, terrane::Crs::default())?;
/// let report = cloud.grid(10.0).stats("count,mean").write(&path)?;
/// assert_eq!(report.points.kept, 5000);
/// # Ok(())
/// # }
/// ```
pub fn open_points(positions: &[[f64; 3]], marks: Option<&[Marks]>, crs: Crs) -> Result<Cloud> {
    let held = HeldCloud::new(positions, marks, crs)?;
    let cloud = Cloud::open(vec![held.name().to_owned()], OpenOptions::default())?;
    Ok(Cloud { held: Some(Arc::new(held)), ..cloud })
}

impl Cloud {
    fn open(inputs: Vec<String>, options: OpenOptions) -> Result<Self> {
        // What a job cannot work on, it says.
        let any = OpenOptions { any_extent: true, ..options.clone() };
        let info = cloud::source(&inputs, &any)?.info().clone();
        Ok(Self { inputs, options, info, held: None })
    }

    /// The same, read otherwise.
    fn read_as(self, options: OpenOptions) -> Result<Self> {
        let Self { inputs, held, .. } = self;
        Ok(Self { held, ..Self::open(inputs, options)? })
    }

    /// The same cloud, only the points that pass `filter`.
    ///
    /// # Errors
    /// As [`open_cloud`]; a cloud that has a filter already.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// use terrane::Filter;
    /// let cloud = terrane::open_cloud("synth:cloud,size=50,density=2,seed=7")?;
    /// let condition = Some("classification = 2 and intensity > 100".parse().unwrap());
    /// let strong = cloud.filter(Filter { condition, ..Filter::default() })?;
    /// # let _ = strong;
    /// # Ok(())
    /// # }
    /// ```
    pub fn filter(self, filter: Filter) -> Result<Self> {
        if self.options.filter != Filter::default() {
            return Err(Error::usage("the cloud has a filter already")
                .remedy("say all that points have to meet in one filter"));
        }
        let options = OpenOptions { filter, ..self.options.clone() };
        self.read_as(options)
    }

    /// The same cloud; what cannot be read is given up and counted, instead of failing the job.
    ///
    /// # Errors
    /// As [`open_cloud`].
    pub fn salvage(self, salvage: bool) -> Result<Self> {
        let options = OpenOptions { salvage, ..self.options.clone() };
        self.read_as(options)
    }

    /// Bounds, number of points and reference system, as the headers claim.
    pub fn info(&self) -> &CloudInfo {
        &self.info
    }

    /// A triangle mesh of it, none of its points further from the mesh than a tolerance.
    pub fn tin(&self) -> CloudTinBuilder<'_> {
        let run = Run::default();
        CloudTinBuilder {
            cloud: self,
            tolerance: None,
            keep_points: None,
            breaklines: None,
            format: None,
            run,
        }
    }

    /// A grid with square cells of this side, in units of the reference system: statistics of the points
    /// in each, or a model of the terrain.
    ///
    /// A [model](GridBuilder::model) without a side (`None`) has cells of about the distance between points.
    pub fn grid(&self, cell: impl Into<Option<f64>>) -> GridBuilder<'_> {
        GridBuilder::of(self, cell.into())
    }

    /// Its points in files of points.
    pub fn points(&self) -> PointsBuilder<'_> {
        PointsBuilder::of(self)
    }

    /// Tiles for viewers of the globe of a model of its ground ([`Preset::Dtm`]) with square cells of this side, in units
    /// of the reference system; about as wide as points are apart when `None`. What tiles promise is about samples
    /// of the model.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let tiles = folder.path().join("tiles");
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?;
    /// let made = cloud.tiles(2.0).max_level(12).write(&tiles)?;
    /// assert!(made.levels.iter().all(|level| level.error <= level.tolerance)); // metres
    /// # Ok(())
    /// # }
    /// ```
    pub fn tiles(&self, cell: impl Into<Option<f64>>) -> TilesBuilder<'_> {
        TilesBuilder::of_cloud(self, cell.into())
    }

    /// The proof of a mesh in a file against this cloud.
    pub fn verify(&self, mesh: impl AsRef<Path>) -> VerifyBuilder<'_, Cloud> {
        VerifyBuilder::of(self, mesh.as_ref())
    }
}

/// A mesh of a cloud to be made: the Delaunay triangulation of some of its points, and of posts on lines.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// # let folder = tempfile::tempdir().unwrap();
/// # let path = folder.path().join("mesh.ply");
/// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?;
/// let report = cloud.tin().max_error(0.5).write(&path)?;
/// assert!(report.max_error <= Some(0.5));
/// # Ok(())
/// # }
/// ```
pub struct CloudTinBuilder<'a> {
    cloud: &'a Cloud,
    tolerance: Option<f64>,
    keep_points: Option<PathBuf>,
    breaklines: Option<PathBuf>,
    format: Option<String>,
    run: Run,
}

run_settings!([] CloudTinBuilder<'_>);
output_settings!([] CloudTinBuilder<'_>);

impl CloudTinBuilder<'_> {
    /// No point further than this from the mesh, vertically, in the unit of the heights; 0 keeps all.
    pub fn max_error(mut self, tolerance: f64) -> Self {
        self.tolerance = Some(tolerance);
        self
    }

    /// The point of the cloud nearest to each point of a file of features is a vertex; of lines and polygons it is
    /// that nearest to each of their vertices.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [file, path] = ["peaks.wkt", "mesh.ply"].map(|name| folder.path().join(name));
    /// std::fs::write(&file, "MULTIPOINT (500010 4750010, 500040.5 4750033)").unwrap();
    /// std::fs::write(file.with_extension("prj"), "EPSG:32631").unwrap();
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?;
    /// let made = cloud.tin().max_error(0.5).keep_points(&file).write(&path)?;
    /// assert_eq!(made.keep_points.unwrap().vertices, 2);
    /// # Ok(())
    /// # }
    /// ```
    pub fn keep_points(mut self, file: impl Into<PathBuf>) -> Self {
        self.keep_points = Some(file.into());
        self
    }

    /// Edges follow the lines and the rings of the polygons of a file of features, along posts of their own: at the
    /// heights of the lines, if they have any, and else on the surface of all points.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [file, path] = ["kerb.wkt", "mesh.ply"].map(|name| folder.path().join(name));
    /// std::fs::write(&file, "LINESTRING (500010 4750010, 500040.5 4750033, 500055 4750020)").unwrap();
    /// std::fs::write(file.with_extension("prj"), "EPSG:32631").unwrap();
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?;
    /// let made = cloud.tin().max_error(0.5).breaklines(&file).write(&path)?;
    /// assert_eq!(made.breaklines.unwrap().apart, 0);
    /// let proof = cloud.verify(&path).breaklines(&file).run()?;
    /// assert!(proof.verdict.passed && proof.verdict.judged);
    /// # Ok(())
    /// # }
    /// ```
    pub fn breaklines(mut self, file: impl Into<PathBuf>) -> Self {
        self.breaklines = Some(file.into());
        self
    }

    /// Makes the mesh and writes it, within the memory allowed.
    ///
    /// # Errors
    /// No tolerance, or one that is none; points that are no surface; features none of which is on the cloud; damage
    /// in the files; too little memory; an output that exists or cannot be written; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<CloudTinReport> {
        let job = CloudTinJob { measure: true, ..self.job(path.into())? };
        cloud_tin::run(&job, &*self.run.progress, &self.run.cancel)
    }

    /// Writes down in a folder what is to be made and by which tasks, so that it can be done by pieces and by
    /// many machines: [`Plan`](crate::Plan). A task has `cut` points at the most, but for the few that are worked on
    /// together, or as many as make a fair piece of work. The format is PLY unless told otherwise.
    ///
    /// # Errors
    /// As [`write`](Self::write); points to keep and breaklines; a folder that holds something else.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let (work, mesh) = (folder.path().join("work"), folder.path().join("mesh.ply"));
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=7")?;
    /// let plan = cloud.tin().max_error(0.5).plan(&work, None)?;
    /// plan.run().task("choose-0").run()?; // anywhere, in any order
    /// plan.run().output(&mesh).run()?; // what is left, and the mesh
    /// assert!(cloud.verify(&mesh).run()?.verdict.passed);
    /// # Ok(())
    /// # }
    /// ```
    pub fn plan(self, folder: impl Into<PathBuf>, cut: impl Into<Option<u32>>) -> Result<Plan> {
        if self.run.overwrite {
            return Err(Error::usage("a plan writes no mesh yet, in place of another")
                .remedy("leave overwrite out, and say it of the run"));
        }
        let folder = folder.into();
        let format = Some(self.format.clone().unwrap_or_else(|| "PLY".to_owned()));
        let job = CloudTinJob { format, ..self.job(folder.join("mesh"))? };
        let plan =
            PlanCloudTinJob { job, folder: folder.clone(), cut: cut.into(), skipped: Vec::new() };
        plan_cloud_tin(&plan, &*self.run.progress, &self.run.cancel)?;
        Plan::open(folder)
    }

    fn job(&self, output: PathBuf) -> Result<CloudTinJob> {
        let none = || Error::usage("the mesh has nothing to reach").remedy("say .max_error(...)");
        let (tolerance, resources) = (self.tolerance.ok_or_else(none)?, self.run.resources()?);
        let name = |file: &Option<PathBuf>| file.clone().map(name_of).transpose();
        Ok(CloudTinJob {
            options: self.cloud.options.clone(),
            format: self.format.clone(),
            overwrite: self.run.overwrite,
            keep_points: name(&self.keep_points)?,
            breaklines: name(&self.breaklines)?,
            ..CloudTinJob::new(self.cloud.inputs.clone(), output, tolerance, resources)
        })
    }
}

/// A grid of a cloud to be made: in one pass over the points, each band a statistic of the points in its
/// cells, or a model of the terrain. Corners of cells are at multiples of their size. The result does not
/// depend on the order of points or files.
pub struct GridBuilder<'a> {
    cloud: &'a Cloud,
    stats: String,
    preset: Option<Preset>,
    ground: GroundFrom,
    canopy: Canopy,
    water: Option<PathBuf>,
    placement: Placement,
    radius: Option<f64>,
    max_edge: Option<f64>,
    fill: u32,
    format: Option<String>,
    creation: Vec<(String, String)>,
    run: Run,
}

run_settings!([] GridBuilder<'_>);
output_settings!([] GridBuilder<'_>);

impl<'a> GridBuilder<'a> {
    fn of(cloud: &'a Cloud, cell: Option<f64>) -> Self {
        let cell = cell.map(|side| [side; 2]);
        Self {
            cloud,
            stats: "mean".to_owned(),
            preset: None,
            ground: GroundFrom::Auto,
            canopy: Canopy::default(),
            water: None,
            placement: Placement { cell, ..Placement::default() },
            radius: None,
            max_edge: None,
            fill: 0,
            format: None,
            creation: Vec::new(),
            run: Run::default(),
        }
    }

    /// A band for each of these statistics, such as `"mean,p95,idw:radius=2"`; the mean unless told otherwise.
    pub fn stats(mut self, list: impl Into<String>) -> Self {
        (self.stats, self.preset) = (list.into(), None);
        self
    }

    /// A model of the terrain instead of statistics: of the ground, of what is seen from above, or the height
    /// of the one above the other.
    pub fn model(mut self, model: Preset) -> Self {
        self.preset = Some(model);
        self
    }

    /// Which points are ground, for a [`model`](Self::model): those of class 2 or of the cloud's filter, or those that a
    /// method finds; the first, and if there are none the best method, unless told otherwise.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [work, path] = ["work", "dtm.tif"].map(|name| folder.path().join(name));
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=5")?;
    /// let ground = || cloud.grid(1.0).model(terrane::Preset::Dtm).ground("csf:rigidness=1".parse().unwrap());
    /// ground().write(&path)?;
    /// let made = ground().plan(&work, 256)?.run().run()?; // by tasks, the same bytes
    /// assert!(std::fs::read(path).unwrap() == std::fs::read(made.written.unwrap()).unwrap());
    /// # Ok(())
    /// # }
    /// ```
    pub fn ground(mut self, from: GroundFrom) -> Self {
        self.ground = from;
        self
    }

    /// How a [`model`](Self::model) of what is seen from above gets rid of returns from deep in crowns: pit-free, unless
    /// told otherwise, or spike-free, which is made of all returns.
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("chm.tif");
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=5")?;
    /// let canopy: terrane::Canopy = "spike-free:freeze=2".parse()?;
    /// let made = cloud.grid(1.0).model(terrane::Preset::Chm).canopy(canopy).write(&path)?;
    /// assert!(made.notes.iter().any(|note| note.contains("spike-free")));
    /// # Ok(())
    /// # }
    /// ```
    pub fn canopy(mut self, method: Canopy) -> Self {
        self.canopy = method;
        self
    }

    /// In a model of the ground, level water: the polygons of a file of features are lakes, and those that a line of
    /// the file runs within are rivers, as for a [`Grid`](crate::Grid::water).
    ///
    /// ```
    /// # fn main() -> terrane::Result<()> {
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let [file, path] = ["lake.wkt", "dtm.tif"].map(|name| folder.path().join(name));
    /// std::fs::write(&file, "POLYGON ((500010 4750010, 500040 4750010, 500030 4750040))").unwrap();
    /// std::fs::write(file.with_extension("prj"), "EPSG:32631").unwrap();
    /// let cloud = terrane::open_cloud("synth:cloud,size=60,density=2,seed=5")?;
    /// let made = cloud.grid(1.0).model(terrane::Preset::Dtm).water(&file).write(&path)?;
    /// assert_eq!(made.water.unwrap().lakes, 1);
    /// # Ok(())
    /// # }
    /// ```
    pub fn water(mut self, file: impl Into<PathBuf>) -> Self {
        self.water = Some(file.into());
        self
    }

    /// All cells that the box (x low, y low, x high, y high) overlaps, instead of those of the cloud.
    pub fn bounds(mut self, bounds: [f64; 4]) -> Self {
        self.placement.bbox = Some(bounds);
        self
    }

    /// The very cells of this grid, instead of those of a size.
    pub fn like(mut self, grid: impl Into<String>) -> Self {
        self.placement = Placement { like: Some(grid.into()), cell: None, ..self.placement };
        self
    }

    /// The radius of idw and nearest, in units of the reference system; the diagonal of a cell unless told
    /// otherwise.
    pub fn radius(mut self, radius: f64) -> Self {
        self.radius = Some(radius);
        self
    }

    /// Triangles with a longer edge are no surface, for statistics and models made of triangulations.
    pub fn max_edge(mut self, length: f64) -> Self {
        self.max_edge = Some(length);
        self
    }

    /// Fill voids from known cells at most so many columns and rows away.
    pub fn fill(mut self, cells: u32) -> Self {
        self.fill = cells;
        self
    }

    /// A creation option of the format, such as `COMPRESS`, `DEFLATE`.
    pub fn creation(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.creation.push((key.into(), value.into()));
        self
    }

    /// Makes the grid and writes it, within the memory allowed.
    ///
    /// # Errors
    /// An unknown statistic; damage in the files; too little memory; an output that exists, cannot be written
    /// or does not hold the bands; cancelled.
    pub fn write(self, path: impl Into<PathBuf>) -> Result<GridReport> {
        grid::run(&self.job(path.into())?, &*self.run.progress, &self.run.cancel)
    }

    /// Writes down in a folder what is to be made and by which tasks, so that it can be done by pieces and by
    /// many machines: [`Plan`](crate::Plan). A task has `cut` cells along a tile, a multiple of 256, or as many as make a
    /// fair piece of work. The format is GTiff unless told otherwise.
    ///
    /// # Errors
    /// As [`write`](Self::write); [`water`](Self::water), whose level is that of a whole bank; a folder that holds
    /// something else.
    pub fn plan(mut self, folder: impl Into<PathBuf>, cut: impl Into<Option<u32>>) -> Result<Plan> {
        if self.run.overwrite {
            return Err(Error::usage("a plan writes no grid yet, in place of another")
                .remedy("leave overwrite out, and say it of the run"));
        }
        let folder = folder.into();
        let format = terrane_raster::write::by_name(self.format.as_deref().unwrap_or("GTiff"))?;
        self.format = Some(format.name.to_owned());
        let job = self.job(folder.join("grid").with_extension(format.extensions[0]))?;
        let plan =
            PlanGridJob { job, folder: folder.clone(), cut: cut.into(), skipped: Vec::new() };
        plan_grid(&plan, &*self.run.progress, &self.run.cancel)?;
        Plan::open(folder)
    }

    fn job(&self, output: PathBuf) -> Result<GridJob> {
        let stats = match self.preset {
            Some(preset) => vec![preset.band()],
            None => parse_list(&self.stats)?,
        };
        Ok(GridJob {
            cloud: self.cloud.options.clone(),
            preset: self.preset,
            ground: self.ground,
            canopy: self.canopy,
            water: self.water.clone().map(name_of).transpose()?,
            placement: self.placement.clone(),
            radius: self.radius,
            max_edge: self.max_edge,
            fill: self.fill,
            format: self.format.clone(),
            creation: self.creation.clone(),
            overwrite: self.run.overwrite,
            resources: self.run.resources()?,
            ..GridJob::new(self.cloud.inputs.clone(), output, stats, 1.0)
        })
    }
}
