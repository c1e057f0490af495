//! The whole job: open, check, find the tolerance, triangulate into the file, report.

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::budget::search;
use super::estimate::{Estimator, Size};
use super::job::{Goal, TinJob};
use super::layout::Layout;
use super::local::height_origin;
use super::report::TinReport;
use super::run::{Outcome, Settings, run_on};
use super::units::{horizontal_unit, vertical_unit};
use super::worker::worker_bytes;
use crate::atomic::{AtomicFile, refuse_existing};
use crate::error::{Error, ErrorKind, Result};
use crate::geom::Point3;
use crate::output::{
    self, MeshBatch, MeshFormat, MeshHeader, MeshSink, SinkOptions, check_prj, write_prj,
};
use crate::pipeline::memory::{self, Shares};
use crate::pipeline::{Cancel, Progress, peak_memory};
use crate::raster::{self, GridInfo, GridSource, OpenOptions};
use crate::tin::Spec;

/// Runs a job from file to file.
///
/// What is wrong with the request is found before the work starts: an output that exists or cannot
/// be created, a format that cannot hold the mesh, too little memory. The output appears whole at
/// the end or not at all. A budget of vertices or triangles takes several complete runs that only
/// count.
///
/// # Errors
/// `Usage` for a goal, tile or name that makes no sense and for a budget below the coarsest mesh;
/// `BadInput`, `Unsupported`, `Limit` from the input, also when it has no surface; `CannotWrite`
/// and `Io` from the output and the temporary file; `Resource` when the memory does not suffice;
/// `Interrupted`; `Internal` for a caught fault of the program, naming the tile.
pub fn run(job: &TinJob, progress: &dyn Progress, cancel: &Cancel) -> Result<TinReport> {
    let started = Instant::now();
    job.goal.check()?;
    let format = output::by_path(&job.output, job.format.as_deref())?;
    refuse_existing(&job.output, job.overwrite)?;
    let resources = &job.resources;
    let shares = memory::divide(resources.memory, resources.threads, worker_bytes(job.tile))?;
    let options = OpenOptions {
        band: job.band,
        nodata: job.nodata,
        cache_bytes: usize::try_from(shares.cache).unwrap_or(usize::MAX),
        threads: shares.threads,
    };
    let source = raster::open_all(job.input.names(), &options)?;
    let height_origin = match format.single_precision {
        true => {
            Some(height_origin(&*source).map_err(|error| in_input(error, &job.input.to_string()))?)
        }
        false => None,
    };
    let maker = Maker { job, source: &*source, format, height_origin, shares, progress, cancel };
    let mut report = maker.make().map_err(|error| in_input(error, &job.input.to_string()))?;
    report.wall_seconds = started.elapsed().as_secs_f64();
    report.samples_per_second = report.samples as f64 / report.wall_seconds;
    Ok(report)
}

/// Errors about the content of the input name it.
fn in_input(error: Error, input: &str) -> Error {
    use ErrorKind::{BadInput, Internal, Limit, Unsupported};
    match error.kind() {
        BadInput | Internal | Limit | Unsupported => error.in_file(Path::new(input)),
        _ => error,
    }
}

/// An opened job.
struct Maker<'a> {
    job: &'a TinJob,
    source: &'a dyn GridSource,
    format: &'static MeshFormat,
    /// What heights are stored relative to, where the format stores them in f32.
    height_origin: Option<f64>,
    shares: Shares,
    progress: &'a dyn Progress,
    cancel: &'a Cancel,
}

impl Maker<'_> {
    fn make(&self) -> Result<TinReport> {
        let info = self.source.info();
        let layout = Layout::new(info.width, info.height, self.job.tile)?;
        self.check_output(info)?;
        let (tolerance, trials) = self.tolerance(layout)?;
        let header =
            header(info, &self.job.input.to_string(), tolerance, self.height_origin.unwrap_or(0.0));
        let options = SinkOptions {
            overwrite: self.job.overwrite,
            solid_base: self.job.solid_base,
            temp_dir: self.job.resources.temp_dir.clone(),
        };
        let sink = (self.format.create)(&self.job.output, &header, &options)?;
        let spec = Spec { tolerance, measure: self.job.measure, ..self.spec() };
        let outcome = self.run("triangulate", layout, sink, spec)?;
        let prj = write_prj(&self.job.output, &info.crs, self.job.overwrite)?;
        Ok(self.report(layout, tolerance, trials, outcome, prj))
    }

    /// Finds out before the work that the output can be created.
    fn check_output(&self, info: &GridInfo) -> Result<()> {
        drop(AtomicFile::create(&self.job.output, self.job.overwrite)?);
        check_prj(&self.job.output, &info.crs, self.job.overwrite)
    }

    /// The tolerance to run with, and how many trials it took to find it.
    fn tolerance(&self, layout: Layout) -> Result<(f64, u32)> {
        let most = Size { vertices: layout.samples(), triangles: 2 * layout.cells() };
        match self.job.goal {
            Goal::MaxError(tolerance) => {
                self.check_capacity(layout, most, tolerance)?;
                Ok((tolerance, 0))
            }
            Goal::MaxVertices(budget) if budget >= most.vertices => self.everything(most),
            Goal::MaxTriangles(budget) if budget >= most.triangles => self.everything(most),
            Goal::MaxVertices(budget) => {
                self.format.check_capacity(budget, budget)?;
                self.search(layout, budget, |size| size.vertices)
            }
            Goal::MaxTriangles(budget) => {
                self.format.check_capacity(budget / 2, budget)?;
                self.search(layout, budget, |size| size.triangles)
            }
        }
    }

    /// A budget that every mesh of this grid fits: no error at all.
    fn everything(&self, most: Size) -> Result<(f64, u32)> {
        self.format.check_capacity(most.vertices, most.triangles)?;
        Ok((0.0, 0))
    }

    /// Fails when the format will not hold the mesh. Sure when every sample fits; otherwise from
    /// an estimate, because hardly any mesh keeps all samples.
    fn check_capacity(&self, layout: Layout, most: Size, tolerance: f64) -> Result<()> {
        if self.format.check_capacity(most.vertices, most.triangles).is_ok() {
            return Ok(());
        }
        let mut estimator = Estimator::new(self.source, layout, self.cancel);
        let size = estimator.size(&Spec { tolerance, ..self.spec() })?;
        self.format.check_capacity(size.vertices, size.triangles)
    }

    fn search(
        &self,
        layout: Layout,
        budget: u64,
        counted: impl Fn(Size) -> u64,
    ) -> Result<(f64, u32)> {
        let spec = self.spec();
        if budget >= layout.samples() / 2 && self.count(layout, 0.0, &counted)? <= budget {
            return Ok((0.0, 1));
        }
        let guess =
            Estimator::new(self.source, layout, self.cancel).guess(&spec, budget, &counted)?;
        search(budget, guess, |tolerance| self.count(layout, tolerance, &counted))
    }

    /// The size of the mesh at a tolerance, by making it and throwing it away.
    fn count(&self, layout: Layout, tolerance: f64, counted: impl Fn(Size) -> u64) -> Result<u64> {
        let stage = format!("count at {tolerance:.4}");
        let spec = Spec { tolerance, ..self.spec() };
        let outcome = self.run(&stage, layout, Box::new(Counter), spec)?;
        Ok(counted(Size { vertices: outcome.vertices, triangles: outcome.triangles }))
    }

    fn spec(&self) -> Spec {
        Spec {
            tolerance: 0.0,
            strict: self.job.strict,
            drop: self.job.drop,
            single_precision: self.height_origin,
            measure: false,
        }
    }

    fn run(
        &self,
        stage: &str,
        layout: Layout,
        sink: Box<dyn MeshSink>,
        spec: Spec,
    ) -> Result<Outcome> {
        let settings = Settings {
            spec,
            tile: self.job.tile,
            threads: self.shares.threads,
            mesh_bytes: self.shares.mesh,
            temp_dir: &self.temp_dir(),
            order_seed: None,
            progress: self.progress,
            cancel: self.cancel,
        };
        self.progress.begin(stage, layout.samples());
        let outcome = run_on(self.source, sink, &settings);
        self.progress.end();
        outcome
    }

    /// Where to spill: beside the output unless told otherwise.
    fn temp_dir(&self) -> PathBuf {
        let beside = || match self.job.output.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
            _ => PathBuf::from("."),
        };
        self.job.resources.temp_dir.clone().unwrap_or_else(beside)
    }

    fn report(
        &self,
        layout: Layout,
        tolerance: f64,
        trials: u32,
        outcome: Outcome,
        prj: Option<PathBuf>,
    ) -> TinReport {
        let (job, info) = (self.job, self.source.info());
        let surface = (outcome.valid - outcome.isolated).max(1) as f64;
        let measured = |value: f64| job.measure.then_some(value);
        TinReport {
            input: job.input.to_string(),
            output: job.output.display().to_string(),
            format: self.format.name.to_owned(),
            width: info.width,
            height: info.height,
            crs: info.crs.label(),
            horizontal_unit: horizontal_unit(&info.crs).to_owned(),
            vertical_unit: vertical_unit(&info.crs).unwrap_or("units").to_owned(),
            tolerance,
            max_error: measured(outcome.max_error),
            rmse: measured((outcome.square_sum / surface).sqrt()),
            samples: layout.samples(),
            valid_samples: outcome.valid,
            isolated_samples: outcome.isolated,
            suspected_nodata: outcome.suspects.map(|(value, _)| value),
            suspected_samples: outcome.suspects.map(|(_, count)| count),
            vertices: outcome.vertices,
            triangles: outcome.triangles,
            kept: outcome.vertices as f64 / outcome.valid.max(1) as f64,
            output_bytes: outcome.output_bytes,
            prj: prj.map(|path| path.display().to_string()),
            tiles: layout.tiles(),
            tile_cells: job.tile,
            threads: self.shares.threads,
            memory_budget: job.resources.memory,
            peak_memory: peak_memory(),
            spilled_bytes: outcome.spilled_bytes,
            trials,
            stages: outcome.stages,
            wall_seconds: 0.0,
            samples_per_second: 0.0,
        }
    }
}

/// A sink that keeps nothing; the run itself counts.
struct Counter;

impl MeshSink for Counter {
    fn push(&mut self, _batch: MeshBatch<'_>) -> Result<()> {
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        Ok(0)
    }
}

fn header(info: &GridInfo, input: &str, tolerance: f64, height: f64) -> MeshHeader {
    let bounds = bounds(info);
    let unit = vertical_unit(&info.crs).map(|unit| format!(" {unit}")).unwrap_or_default();
    MeshHeader {
        crs: info.crs.clone(),
        origin: origin(bounds, height),
        bounds,
        comments: vec![format!("source {input}"), format!("max error {tolerance}{unit}")],
    }
}

/// World bounding box of the samples; z is not known.
fn bounds(info: &GridInfo) -> [Point3; 2] {
    let (col, row) = (f64::from(info.width - 1), f64::from(info.height - 1));
    let corners = [(0.0, 0.0), (col, 0.0), (0.0, row), (col, row)];
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for world in corners.map(|(col, row)| info.transform.apply(col, row)) {
        for axis in 0..2 {
            low[axis] = low[axis].min(world[axis]);
            high[axis] = high[axis].max(world[axis]);
        }
    }
    [[low[0], low[1], f64::NAN], [high[0], high[1], f64::NAN]]
}

/// The centre, rounded to a multiple of a power of two that is small against the extent: few
/// digits, and subtracted without rounding.
fn origin([low, high]: [Point3; 2], height: f64) -> Point3 {
    let extent = (high[0] - low[0]).max(high[1] - low[1]);
    let unit = (extent / 8.0).log2().floor().exp2();
    let round = |axis: usize| (f64::midpoint(low[axis], high[axis]) / unit).round() * unit;
    [round(0), round(1), height]
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
