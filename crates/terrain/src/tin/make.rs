//! The job of `terrane tin` on grids: open the input, check the output, find the tolerance, triangulate into the file,
//! report.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::estimate::MeshSize;
use super::goal::TinGoal;
use super::height_origin::height_origin;
use super::job::TinJob;
use super::layout::{TileLayout, checked_tile};
use super::output_frame::{MeshFrame, bounds};
use super::refinement::TinMethod;
use super::report::{FlawReport, TinReport};
use super::run::TinOutcome;
use super::settings::TinSettings;
use super::tolerance_search::{TinSeeker, run_stage};
use terrane_base::bound::ErrorBound;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{HeightQuantization, Point3};
use terrane_baselines::TriangulationRule;
use terrane_engine::bands::MeshBands;
use terrane_engine::constraints::{ConstraintFeatures, GridConstraints};
use terrane_engine::feature_files;
use terrane_engine::input::grid_stats;
use terrane_engine::local_frame::StorageScale;
use terrane_engine::memory::{self, MemoryShares};
use terrane_engine::outputs::refuse_file_name;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::{MovingMesh, Transformed};
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::{AtomicFile, AtomicFolder, refuse_existing};
use terrane_files::folder_for;
use terrane_mesh::split::{self, MeshBlockLayout};
use terrane_mesh::{
    self as mesh, FittedHeights, MaxError, MeshFormat, MeshHeader, MeshSink, Promises, SinkOptions,
    VertexChannel, check_prj, write_prj,
};
use terrane_raster::{
    self as raster, GridInfo, GridOpenOptions, GridSource, Inputs, NorthUpGrid, Water, WaterReport,
};
use terrane_tin::TinSpec;

/// Runs a job from input file to output file.
///
/// Before the work starts, it fails if the output exists or cannot be created, the format cannot hold the mesh, or the
/// memory does not suffice. The output appears under its name when it is complete. A budget of vertices or triangles
/// takes several complete runs that only count.
///
/// # Errors
/// `Usage` for an invalid goal, tile or name, and for a budget below the coarsest mesh; `BadInput`, `Unsupported`,
/// `Limit` from the input, also if no cell has four valid samples; `CannotWrite` and `Io` from the output and the
/// temporary file; `Resource` if the memory does not suffice; `Interrupted`; `Internal` for a panic of a worker, with
/// its tile.
pub fn run(job: &TinJob, progress: &dyn Progress, cancel: &Cancel) -> Result<TinReport> {
    let started = Instant::now();
    job.goal.check()?;
    refuse_existing(&job.output, job.overwrite)?;
    let opened = OpenedTinJob::new(job)?;
    let report = TinMaker { job, opened: &opened, progress, cancel }.make();
    let mut report = report.map_err(|error| in_input(error, &job.input))?;
    report.took(started.elapsed());
    Ok(report)
}

/// What a job has opened and computed before the work: its input, output format, constraints and memory shares.
pub(super) struct OpenedTinJob {
    /// The grid, with rows from the north.
    pub(super) source: Box<dyn GridSource>,
    /// The mesh format of the output.
    pub(super) format: &'static MeshFormat,
    /// Height that is subtracted from all heights in the file, if the format stores them as f32.
    pub(super) height_origin: Option<f64>,
    /// Scale and origin of the coordinates in the file.
    pub(super) placed: StorageScale,
    /// CRS and extent of the mesh.
    pub(super) frame: MeshFrame,
    /// Notes for the report.
    notes: Vec<String>,
    pub(super) shares: MemoryShares,
    /// Samples that must be vertices, and breaklines.
    pub(super) constraints: GridConstraints,
    /// Water to flatten.
    water: Option<Arc<Water>>,
    /// Attributes of vertices.
    pub(super) carried: VertexExtras,
    /// Settings of the kernel; the tolerance is set later.
    spec: TinSpec,
}

impl OpenedTinJob {
    /// Opens the input of `job` and divides its memory.
    pub(super) fn new(job: &TinJob) -> Result<Self> {
        let options = options(job)?;
        let features = job.refinement.features(options.water.as_ref(), &job.resources)?;
        let mut opened = Self::with(job, || open(job, &options, &features))?;
        opened.water = options.water;
        opened.spec.data_dependent = job.refinement.is_data_dependent();
        opened.constraints = features.on(opened.source.info())?;
        Ok(opened)
    }

    /// As [`new`](Self::new), with an input opened by `open`, and without constraints, water or attributes.
    pub(super) fn with(
        job: &TinJob,
        open: impl FnOnce() -> Result<memory::Opened>,
    ) -> Result<Self> {
        let format = mesh::by_path(&job.output, job.format.as_deref())?;
        let (source, shares) = open()?;
        source.info().check_cells().map_err(|error| in_input(error, &job.input))?;
        let height_origin = match format.single_precision {
            true => Some(height_origin(&*source).map_err(|error| in_input(error, &job.input))?),
            false => None,
        };
        let info = source.info();
        let frame = MeshFrame::new(info, job, format)?;
        let (placed, mut notes) =
            job.placing.place(&frame.crs, frame.bounds, frame.steps, format)?;
        notes.extend(frame.notes().into_iter().chain(raster::cautions(info)));
        let (constraints, carried) = (GridConstraints::default(), VertexExtras::default());
        let spec = job.refinement.spec(&info.transform)?;
        let water = None;
        let mut opened = Self {
            source,
            format,
            height_origin,
            placed,
            frame,
            notes,
            shares,
            constraints,
            water,
            carried,
            spec,
        };
        opened.spec.single_precision = opened.rounding();
        opened.spec.measure = job.measure;
        // Only `new` sets this; textbook methods and meshes of bands state their triangulation in `carried`.
        opened.spec.data_dependent = false;
        Ok(opened)
    }

    /// How heights are rounded in the file, if it stores them as f32. The kernel computes with the rounded heights, so
    /// that the bound holds for the written mesh.
    pub(super) fn rounding(&self) -> Option<HeightQuantization> {
        let scale = self.placed.scale[2];
        self.height_origin.map(|origin| HeightQuantization { origin, scale })
    }
}

/// Attributes of vertices beside the height, and the name of the triangulation.
#[derive(Default)]
pub(super) struct VertexExtras {
    pub(super) channels: Vec<VertexChannel>,
    /// The bands of the channels.
    pub(super) bands: Option<MeshBands>,
    /// Name of the triangulation, if it is not Delaunay.
    pub(super) triangulation: Option<&'static str>,
}

impl VertexExtras {
    /// Writes the attributes, their tolerance and the triangulation into the header.
    fn describe(&self, header: &mut MeshHeader, tolerance: f64) {
        header.channels.clone_from(&self.channels);
        let promises = &mut header.promises;
        if let Some(bands) = &self.bands {
            bands.promise(promises, tolerance);
        }
        if let Some(name) = self.triangulation {
            promises.triangulation = Some(name.to_owned());
        }
    }
}

/// Opens the input of `job`, and divides the memory that `features` leave.
fn open(
    job: &TinJob,
    options: &GridOpenOptions,
    features: &ConstraintFeatures,
) -> Result<memory::Opened> {
    // All workers share the features. Their memory is counted once per worker, which is too much but never too little.
    let (feature_bytes, has_lines) = (features.bytes(), features.has_lines());
    open_tiled(
        &job.input,
        options,
        job.tile,
        |tile| feature_bytes + job.refinement.worker_bytes(job.goal, tile, has_lines),
        &job.resources,
    )
}

/// The options for opening the input of `job`.
pub(super) fn options(job: &TinJob) -> Result<GridOpenOptions> {
    job.reading.options(&job.resources, GridOpenOptions::default().cache_bytes)
}

/// Opens `input` for workers on tiles of `tile` x `tile` cells; `worker` gives the bytes of one for the side of a tile.
pub(super) fn open_tiled(
    input: &Inputs,
    options: &GridOpenOptions,
    tile: u32,
    worker: impl Fn(u32) -> u64,
    resources: &Resources,
) -> Result<memory::Opened> {
    let tile = checked_tile(tile)?;
    let opened = match memory::open(input, options, resources, worker(tile)) {
        // The side of the grid is known only once it is open. If the grid is smaller than a tile, workers need less.
        Err(error) if error.kind() == ErrorKind::Resource => {
            match side_on_grid(input, options, tile) {
                Some(side) if side < tile => memory::open(input, options, resources, worker(side)),
                _ => Err(error),
            }
        }
        opened => opened,
    };
    let (source, shares) = opened.map_err(memory::or_smaller_tiles)?;
    Ok((Box::new(NorthUpGrid::new(source)), shares))
}

/// The side of tiles in cells, at most that of the grid; `None` if the grid cannot be opened.
fn side_on_grid(input: &Inputs, options: &GridOpenOptions, tile: u32) -> Option<u32> {
    let source = memory::open_for_estimate(input, options).ok()?;
    let GridInfo { width, height, .. } = *source.info();
    TileLayout::new(width, height, tile).ok().map(|layout| layout.side())
}

/// Adds the name of the input to errors about its content.
pub(super) fn in_input(error: Error, input: &Inputs) -> Error {
    use ErrorKind::{BadInput, Internal, Limit, Unsupported};
    match error.kind() {
        BadInput | Internal | Limit | Unsupported => error.in_file(Path::new(&input.to_string())),
        _ => error,
    }
}

/// Makes the mesh of an opened job.
pub(super) struct TinMaker<'a> {
    pub(super) job: &'a TinJob,
    pub(super) opened: &'a OpenedTinJob,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
}

impl TinMaker<'_> {
    /// Makes the mesh in one run, without a plan.
    fn make(&self) -> Result<TinReport> {
        self.check_output()?;
        let (tolerance, trials) = self.tolerance()?;
        self.complete(tolerance, trials, |sink, spec| self.run(sink, spec))
    }

    /// Creates the output and its header, lets `write` push the mesh to the sink of the output, and returns the report.
    /// `trials` is the number of runs that found the tolerance.
    pub(super) fn complete(
        &self,
        tolerance: f64,
        trials: u32,
        write: impl FnOnce(Box<dyn MeshSink>, TinSpec) -> Result<TinOutcome>,
    ) -> Result<TinReport> {
        let (job, info) = (self.job, self.opened.source.info());
        let height = self.opened.height_origin.unwrap_or(0.0);
        let spec = self.spec(tolerance);
        let provenance = MeshProvenance {
            input: &feature_files::source(&job.input),
            clip: job.reading.clip.as_deref().map(feature_files::label_of),
            water: job.reading.water.as_deref().map(feature_files::label_of),
            refinement: &job.refinement,
        };
        let mut header = header(info, provenance, &spec, height);
        self.opened.carried.describe(&mut header, tolerance);
        self.opened.frame.describe(&mut header, height);
        header.scale = self.opened.placed.scale;
        header.unit.clone_from(&self.opened.placed.unit);
        header.origin = self.opened.placed.origin(header.origin, header.bounds);
        let solid_base = self.solid_base(&mut header)?;
        let bottom = solid_base.filter(|_| job.base.is_some()).map(bottom_note);
        let options = SinkOptions {
            overwrite: job.overwrite,
            solid_base,
            temp_dir: job.resources.temp_dir.clone(),
        };
        let sink = match self.blocks()? {
            None => (self.opened.format.create)(&job.output, &header, &options)?,
            Some(blocks) => {
                split::create(&job.output, self.opened.format, &header, &options, blocks)?
            }
        };
        let sink = match &self.opened.frame.operation {
            None => sink,
            Some(operation) => Box::new(MovingMesh::new(sink, operation.clone())),
        };
        let outcome = write(sink, self.spec(tolerance))?;
        let prj = match job.split {
            None => write_prj(&job.output, &self.opened.frame.crs, job.overwrite)?,
            Some(_) => None,
        };
        let mut report = self.report(tolerance, trials, outcome, prj)?;
        report.notes.extend(bottom);
        Ok(report)
    }

    /// The height of the flat bottom of a solid, if requested. Reads the grid for its range of heights, which it puts
    /// into the header, and fails if the bottom is not below the lowest.
    fn solid_base(&self, header: &mut MeshHeader) -> Result<Option<f64>> {
        let Self { job, opened, progress, cancel } = self;
        if job.solid_base.is_none() && job.base.is_none() {
            return Ok(None);
        }
        let stats = grid_stats(&*opened.source, &job.resources, *progress, cancel)?;
        let (Some(lowest), Some(highest)) = (stats.min, stats.max) else {
            return Ok(job.solid_base);
        };
        (header.bounds[0][2], header.bounds[1][2]) = (lowest, highest);
        // The thickness is in units of the file (millimetres), the bottom in units of the data.
        let base = job
            .solid_base
            .or_else(|| job.base.map(|thickness| lowest - thickness / opened.placed.scale[2]));
        match base.filter(|base| lowest <= *base) {
            Some(base) => Err(Error::usage(format!(
                "the base of the solid, {base}, is not below the lowest height, {lowest}"
            ))
            .remedy(format!("pass a base below {lowest}"))),
            None => Ok(base),
        }
    }

    /// The division of the mesh into files; `None` for one file.
    fn blocks(&self) -> Result<Option<MeshBlockLayout>> {
        let Some(tiles) = self.job.split else { return Ok(None) };
        let info = self.opened.source.info();
        let cells = tiles.checked_mul(self.job.tile).filter(|cells| *cells > 0);
        let cells = cells.ok_or_else(|| {
            Error::usage(format!("a block of {tiles} x {tiles} tiles is out of range"))
        })?;
        let samples = [info.width, info.height];
        Ok(Some(MeshBlockLayout { cells, samples, to_world: info.transform }))
    }

    /// The division of the grid into tiles.
    pub(super) fn layout(&self) -> Result<TileLayout> {
        let info = self.opened.source.info();
        TileLayout::new(info.width, info.height, self.job.tile)
    }

    /// Fails if the output cannot be created: creates a temporary file or folder beside it, and removes it.
    pub(super) fn check_output(&self) -> Result<()> {
        let Self { job, .. } = self;
        if job.split.is_some() && job.transform.is_some() {
            let message = "‹split› does not support reprojection: blocks follow the rows and columns of the grid";
            return Err(Error::usage(message).remedy("leave out ‹split› or ‹to_crs›"));
        }
        if job.split.is_some() {
            refuse_file_name(&job.output)?;
            return AtomicFolder::create(&job.output, job.overwrite, split::is_replaceable)
                .map(drop);
        }
        drop(AtomicFile::create(&self.job.output, self.job.overwrite)?);
        check_prj(&self.job.output, &self.opened.frame.crs, self.job.overwrite)
    }

    /// The tolerance to run with, and the number of trial runs that found it. Fails if the format cannot hold the mesh.
    pub(super) fn tolerance(&self) -> Result<(f64, u32)> {
        let (layout, folder) = (self.layout()?, self.temp_dir());
        let settings = self.settings(self.spec(0.0), folder);
        let seeker = TinSeeker { source: &*self.opened.source, layout, settings };
        let max_size = seeker.max_size();
        match self.job.goal {
            // The mesh of all samples is known without reading them. Few meshes are as large, so the size is estimated
            // from the heights only if that would not fit.
            TinGoal::MaxError(tolerance) => {
                self.check_size(max_size)
                    .or_else(|_| self.check_size(seeker.estimate(tolerance)?))?;
            }
            TinGoal::MaxVertices(vertices) if vertices < max_size.vertices => {
                self.check_size(MeshSize { vertices, triangles: vertices })?;
            }
            TinGoal::MaxTriangles(triangles) if triangles < max_size.triangles => {
                self.check_size(MeshSize { vertices: triangles / 2, triangles })?;
            }
            TinGoal::MaxVertices(_) | TinGoal::MaxTriangles(_) => self.check_size(max_size)?,
        }
        seeker.tolerance(self.job.goal)
    }

    /// Fails if the format cannot hold a mesh of `size`; with several files, the share of the largest block.
    fn check_size(&self, size: MeshSize) -> Result<()> {
        let share = self.blocks()?.map_or(1.0, |blocks| blocks.largest_share());
        let [vertices, triangles] =
            [size.vertices, size.triangles].map(|count| (count as f64 * share).ceil() as u64);
        self.opened.format.check_capacity(vertices, triangles)
    }

    pub(super) fn spec(&self, tolerance: f64) -> TinSpec {
        TinSpec { tolerance, ..self.opened.spec }
    }

    fn run(&self, sink: Box<dyn MeshSink>, spec: TinSpec) -> Result<TinOutcome> {
        let settings = self.settings(spec, self.temp_dir());
        run_stage("triangulate", &*self.opened.source, sink, self.layout()?, &settings)
    }

    /// The settings of a run over all tiles.
    pub(super) fn settings<'a>(&'a self, spec: TinSpec, temp_dir: &'a Path) -> TinSettings<'a> {
        TinSettings {
            spec,
            tile: self.job.tile,
            constraints: &self.opened.constraints,
            threads: self.opened.shares.threads,
            mesh_bytes: self.opened.shares.mesh,
            temp_dir,
            order_seed: None,
            progress: self.progress,
            cancel: self.cancel,
        }
    }

    /// The folder for spilled data; by default that of the output.
    fn temp_dir(&self) -> &Path {
        folder_for(&self.job.output, self.job.resources.temp_dir.as_deref())
    }

    fn report(
        &self,
        tolerance: f64,
        trials: u32,
        outcome: TinOutcome,
        prj: Option<PathBuf>,
    ) -> Result<TinReport> {
        let layout = self.layout()?;
        let (job, info) = (self.job, self.opened.source.info());
        // Isolated samples are in no cell, so they have no error.
        let samples = (outcome.valid - outcome.isolated).max(1) as f64;
        let rmse = (outcome.square_sum / samples).sqrt();
        let water = self.opened.water.as_ref().and_then(|water| water.report());
        let rising = water.iter().flat_map(WaterReport::notes);
        let notes = self.opened.notes.iter().cloned().chain(self.opened.frame.crs.lost_in_wkt());
        // Undeclared nodata is reported by itself, and explains an odd range.
        let odd_range = outcome.odd_range.filter(|_| outcome.suspects.is_none());
        let odd_note = odd_range.and_then(|range| raster::no_terrain(info, range));
        let notes = notes.chain(rising).chain(odd_note).collect();
        Ok(TinReport {
            input: job.input.to_string(),
            output: job.output.display().to_string(),
            format: self.opened.format.name.to_owned(),
            width: info.width,
            height: info.height,
            crs: info.crs.label(),
            transformed: self.opened.frame.operation.as_deref().map(Transformed::of),
            horizontal_unit: info.crs.horizontal_units().to_owned(),
            vertical_unit: info.crs.heights_unit().unwrap_or("units").to_owned(),
            method: None,
            triangulation: (self.opened.spec.data_dependent)
                .then(|| TriangulationRule::DataDependent.name().to_owned()),
            bands: Vec::new(),
            tolerance,
            bound: job.refinement.bound,
            fit_heights: job.refinement.fit_heights,
            min_angle: job.refinement.min_angle,
            max_error: job.measure.then_some(outcome.max_error),
            rmse: job.measure.then_some(rmse),
            samples: layout.samples(),
            valid_samples: outcome.valid,
            isolated_samples: outcome.isolated,
            suspected_nodata: outcome.suspects.map(|(value, _)| value),
            suspected_samples: outcome.suspects.map(|(_, count)| count),
            vertices: outcome.vertices,
            triangles: outcome.triangles,
            kept: outcome.vertices as f64 / outcome.valid.max(1) as f64,
            keep_points: self.opened.constraints.report(outcome.kept, outcome.kept),
            breaklines: self.opened.constraints.lines().report(outcome.apart.count),
            water,
            apart: (outcome.apart.count > 0)
                .then(|| FlawReport::of(outcome.apart, &info.transform)),
            thin_triangles: (job.refinement.min_angle)
                .map(|_| FlawReport::of(outcome.thin, &info.transform)),
            output_bytes: outcome.output_bytes,
            prj: prj.map(|path| path.display().to_string()),
            placed: Some(self.opened.placed.clone()).filter(StorageScale::is_local),
            notes,
            tiles: layout.tiles(),
            tile_cells: layout.side(),
            trials,
            stages: outcome.stages,
            run: RunStatistics::since(Instant::now(), &job.resources)
                .with_threads(self.opened.shares.threads)
                .with_spilled(outcome.spilled_bytes),
            samples_per_second: 0.0,
        })
    }
}

/// Provenance of a mesh: names of the grid, the clip polygons and the water, and the options of the method.
pub(super) struct MeshProvenance<'a> {
    pub(super) input: &'a str,
    pub(super) clip: Option<String>,
    pub(super) water: Option<String>,
    pub(super) refinement: &'a TinMethod,
}

/// The header of a mesh of the grid `info`, relative to the height `height`.
pub(super) fn header(
    info: &GridInfo,
    provenance: MeshProvenance<'_>,
    spec: &TinSpec,
    height: f64,
) -> MeshHeader {
    let bounds = bounds(info);
    let unit = info.crs.heights_unit().map(str::to_owned);
    MeshHeader {
        crs: info.crs.clone(),
        origin: origin(bounds, height),
        scale: [1.0; 3],
        unit: None,
        bounds,
        promises: promises(provenance, spec, unit),
        channels: Vec::new(),
    }
}

/// The statements of a mesh about its provenance and its guarantees.
fn promises(provenance: MeshProvenance<'_>, spec: &TinSpec, unit: Option<String>) -> Promises {
    let [points, lines] = provenance.refinement.files();
    Promises {
        source: Some(provenance.input.to_owned()),
        max_error: Some(MaxError { value: spec.tolerance, unit }),
        // At samples is the default of readers.
        bound: (spec.bound != ErrorBound::Samples).then_some(spec.bound),
        fitted: spec.fit_heights.then_some(FittedHeights),
        triangulation: (spec.data_dependent)
            .then(|| TriangulationRule::DataDependent.name().to_owned()),
        min_angle: spec.min_angle.map(|least| least.degrees()),
        clip: provenance.clip,
        water: provenance.water,
        keep_points: points.map(feature_files::label_of),
        breaklines: lines.map(feature_files::label_of),
        ..Promises::default()
    }
}

impl MeshFrame {
    /// Writes the CRS and the extent of a reprojected mesh into the header.
    fn describe(&self, header: &mut MeshHeader, height: f64) {
        let Some(operation) = &self.operation else { return };
        header.crs = self.crs.clone();
        header.bounds = self.bounds;
        header.origin = origin(self.bounds, height);
        header.promises.transformed_from = Some(operation.source().label());
    }
}

/// The note on a bottom at a distance below the lowest height: adjacent grids have other lowest heights.
fn bottom_note(height: f64) -> String {
    format!(
        "‹base› is measured from the lowest height of each mesh: the bottom of this one is at {height}; \
         to match adjacent prints, pass a common height as ‹co› SOLID_BASE=HEIGHT instead"
    )
}

/// The origin of stored coordinates: the centre of the extent, rounded to a multiple of a power of two of about an
/// eighth of the extent. Such a number has few digits, and is subtracted from coordinates without rounding.
fn origin([low, high]: [Point3; 2], height: f64) -> Point3 {
    let extent = (high[0] - low[0]).max(high[1] - low[1]);
    let unit = (extent / 8.0).log2().floor().exp2();
    let [x, y] = [0, 1].map(|axis| (f64::midpoint(low[axis], high[axis]) / unit).round() * unit);
    [x, y, height]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_origin_is_short_and_near_the_centre() {
        let bounds = [[500_010.3, 4_100_000.0, f64::NAN], [504_106.3, 4_104_096.0, f64::NAN]];
        assert_eq!(origin(bounds, 0.0), [502_272.0, 4_102_144.0, 0.0]);
        let degrees = [[-125.0, 48.0, f64::NAN], [-124.0, 49.0, f64::NAN]];
        assert_eq!(origin(degrees, 4096.0), [-124.5, 48.5, 4096.0]);
    }
}
