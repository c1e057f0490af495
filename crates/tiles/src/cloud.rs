//! Tiles of a point cloud: a terrain model is made first, as by `grid`, and the tiles are made of the model.

use std::path::{Path, PathBuf};

use super::job::{TilesJob, check_formats};
use super::make::{run, run_in};
use super::options::{CloudTilesOptions, ModelOptions};
use super::report::TilesReport;
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as cloud, CloudOpenOptions};
use terrane_engine::made_input::MadeInput;
use terrane_engine::memory::with_polygons;
use terrane_engine::operation::{Divisible, Operation, RunRequest, Writes};
use terrane_engine::options::{CloudInput, GridInput};
use terrane_engine::outputs::place;
use terrane_engine::plan::{DiskCheck, OutputForm, POINTS, RunControl, RunJob, refuse_file};
use terrane_engine::skip_bad::Skipped;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::refuse_existing;
use terrane_files::path_of;
use terrane_lidar::grid::GridOptions;
use terrane_lidar::grid::plan::{PlanGridJob, plan_grid};
use terrane_lidar::grid::{self, GridJob, Placement, SurfaceModel};
use terrane_lidar::points::{StagedCloud, StagedPlace};
use terrane_raster::Inputs;

/// Format of the model file: all properties of a grid, in memory-mapped blocks.
const FORMAT: &str = "store";
/// Contents of a work folder: the model, the tiles, and points that were made for them.
const PARTS: [&str; 3] = ["model", "tiles", POINTS];
/// File name of the model.
const MODEL: &str = "model.tif";

/// Terrain model of a point cloud.
#[derive(Clone, Debug)]
pub struct CloudModel {
    /// Files, folders, patterns or lists of point clouds.
    pub input: Inputs,
    /// Input options.
    pub cloud: CloudOpenOptions,
    /// Cell size and ground points.
    pub model: ModelOptions,
}

/// Work folder and its options.
#[derive(Clone, Copy, Debug)]
pub struct ModelWorkFolder<'a> {
    /// The folder.
    pub folder: &'a Path,
    /// Files left out of the point cloud.
    pub skipped: &'a [Skipped],
    /// Checks the free disk space.
    pub disk: DiskCheck,
}

impl ModelWorkFolder<'_> {
    /// Fails if the folder is a file, or if the output lies in the work folder.
    fn check(&self, output: &Path) -> Result<()> {
        refuse_file(self.folder)?;
        match PARTS.iter().any(|part| lies_in(output, &self.folder.join(part))) {
            true => Err(Error::usage("lies in the work folder")
                .in_file(output)
                .remedy("choose another folder")),
            false => Ok(()),
        }
    }
}

/// Whether a path lies in a folder, by name or after following links.
fn lies_in(path: &Path, folder: &Path) -> bool {
    let absolute = std::path::absolute(folder).ok().zip(std::path::absolute(path).ok());
    absolute.is_some_and(|(folder, path)| path.starts_with(folder))
        || std::fs::canonicalize(folder).is_ok_and(|folder| place(path).starts_with(folder))
}

/// Makes tiles of a point cloud; the input of `job` is ignored. The output appears only on success. With a work
/// folder the model and the tiles resume after an interruption.
///
/// # Errors
/// As [`grid::run`] and [`run`]; a point cloud without a CRS.
pub fn run_cloud(
    model: &CloudModel,
    job: &TilesJob,
    work_folder: Option<ModelWorkFolder<'_>>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TilesReport> {
    check_formats(&job.tiles)?;
    let resources = &job.resources;
    let made = match work_folder {
        None => {
            refuse_existing(&job.output, job.overwrite)?;
            model.make(&job.output, resources, progress, cancel)?
        }
        Some(work_folder) => {
            work_folder.check(&job.output)?;
            model.make_in(work_folder, resources, progress, cancel)?
        }
    };
    let tiles = TilesJob { input: made.inputs.clone(), ..job.clone() };
    let report = with_polygons(&model.cloud, &job.resources, |resources| {
        let tiles = TilesJob { resources, ..tiles };
        match work_folder {
            None => run(&tiles, progress, cancel),
            Some(ModelWorkFolder { folder, disk, .. }) => {
                run_in(&folder.join(PARTS[1]), &tiles, &[], disk, progress, cancel)
            }
        }
    });
    let report = report.map_err(|error| made.renamed(error))?;
    let mut report = TilesReport { notes: [made.notes, report.notes].concat(), ..report };
    report.run.memory_budget = job.resources.memory;
    Ok(report)
}

impl CloudModel {
    /// Makes the model in a temporary folder beside `output`.
    pub fn make(
        &self,
        output: &Path,
        resources: &Resources,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<MadeInput> {
        MadeInput::temporary(self.label(), output, MODEL, resources, |path| {
            let at = RunControl { progress, cancel };
            self.with_job(StagedPlace::Beside(path), resources, at, |job| {
                let job = GridJob { output: path.to_path_buf(), ..job };
                Ok(grid::run(&job, progress, cancel)?.notes)
            })
        })
    }

    /// Makes the model by a plan in a folder, or reuses a finished one.
    fn make_in(
        &self,
        work_folder: ModelWorkFolder<'_>,
        resources: &Resources,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<MadeInput> {
        let folder = work_folder.folder.join(PARTS[0]);
        std::fs::create_dir_all(&folder).map_err(|e| Error::write(&folder, e))?;
        let path = folder.join(MODEL);
        let points = work_folder.folder.join(PARTS[2]);
        let at = RunControl { progress, cancel };
        let notes = self.with_job(StagedPlace::In(points), resources, at, |job| {
            let plan = PlanGridJob {
                job: GridJob { output: path.clone(), overwrite: true, ..job },
                folder: folder.clone(),
                cut: None,
                skipped: work_folder.skipped.to_vec(),
            };
            plan_grid(&plan, progress, cancel)?;
            let run = RunJob {
                folder: folder.clone(),
                task: None,
                output: Some(path.clone()),
                overwrite: true,
                form: OutputForm::default(),
                disk: work_folder.disk,
                resources: resources.clone(),
            };
            let made = GridOptions::run_plan(&run, progress, cancel)?.of.grid;
            Ok(made.map_or_else(Vec::new, |made| made.notes))
        })?;
        MadeInput::kept(self.label(), path, notes)
    }

    /// Calls `act` with the job of the model of the points, or of those that stages make of them; returns all notes.
    fn with_job(
        &self,
        place: StagedPlace<'_>,
        resources: &Resources,
        at: RunControl<'_>,
        act: impl FnOnce(GridJob) -> Result<Vec<String>>,
    ) -> Result<Vec<String>> {
        let source =
            StagedCloud { inputs: &self.input, cloud: &self.cloud, has_ground_classes: true };
        let stages = &self.model.stages;
        let (notes, before) = stages.before(source, place, resources, at, |inputs, cloud| {
            act(self.job(inputs, cloud, resources)?)
        })?;
        Ok([before, notes].concat())
    }

    /// The job of the model, without its output.
    ///
    /// # Errors
    /// A point cloud that cannot be opened, lacks a CRS, or has too few points to estimate their spacing.
    fn job(
        &self,
        inputs: &Inputs,
        cloud: CloudOpenOptions,
        resources: &Resources,
    ) -> Result<GridJob> {
        let names = inputs.names();
        if cloud::source(names, &cloud)?.info().crs.is_unknown() {
            let error = Error::bad_input("CRS is missing");
            return Err(self.in_input(error.remedy("pass it, such as ‹crs› EPSG:2154")));
        }
        let model = GridJob::of_preset(names.to_vec(), PathBuf::new(), SurfaceModel::Dtm, 1.0);
        let model = GridJob {
            cloud,
            format: Some(FORMAT.to_owned()),
            ground: self.model.ground,
            placement: Placement { cell: self.model.cell, ..Placement::default() },
            resources: resources.clone(),
            ..model
        };
        model.settled().map_err(|error| self.in_input(error))
    }

    fn label(&self) -> String {
        MadeInput::label(&self.input)
    }

    /// Names the input in an error, if it is a single file.
    fn in_input(&self, error: Error) -> Error {
        match self.input.names() {
            [name] => error.in_file(&path_of(name)),
            _ => error,
        }
    }
}

impl Operation for CloudTilesOptions {
    const NAME: &'static str = "cloud-tiles";
    type Input = CloudInput;
    const WRITES: Writes = Writes::Tiles;
    type Report = TilesReport;

    fn check(&self, _output: &Path) -> Result<()> {
        check_formats(&self.tiles)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<TilesReport> {
        let RunRequest { inputs, output, skipped, progress, cancel, .. } = request;
        let job = TilesJob {
            reading: GridInput::with_water(self.water.clone()),
            overwrite: self.replacing.overwrite,
            tiles: self.tiles.clone(),
            resources: self.resources.clone(),
            ..TilesJob::new("", output)
        };
        let model = CloudModel {
            input: inputs.clone(),
            cloud: self.cloud.options(&self.resources)?,
            model: self.model.clone(),
        };
        let disk = self.resuming.disk();
        let work_folder = self.resuming.workdir.as_deref();
        let work_folder = work_folder.map(|folder| ModelWorkFolder { folder, skipped, disk });
        run_cloud(&model, &job, work_folder, progress, cancel)
    }
}
