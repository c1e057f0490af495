//! A job after reading the headers: properties of the mesh and its file, and the division of memory.

use std::path::Path;

use super::context::CloudTinContext;
use super::job::CloudTinJob;
use super::lines::CloudLines;
use super::regions::{CloudTinRegions, no_surface};
use crate::point_index::{PointStore, PointStoreSetup, Tiling};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, Point3};
use terrane_cloud::{CloudInfo, PointSource};
use terrane_engine::cloud_constraints::OnCloud;
use terrane_engine::constraints::ConstraintFeatures;
use terrane_engine::local_frame::StorageScale;
use terrane_engine::memory::{PROGRAM, too_little};
use terrane_engine::plan::RunControl;
use terrane_engine::{Resources, feature_files};
use terrane_files::folder_for;
use terrane_mesh::{MaxError, MeshFormat, MeshHeader, MeshSink, Promises, SinkOptions};

/// Division of the memory.
pub(super) struct CloudTinMemory {
    /// Eighths of the memory for stored points.
    points: u64,
    /// Eighths of the memory for stored vertices.
    vertices: u64,
    /// Eighths of the memory for the program and its workers.
    pub(super) workers: u64,
    /// Bytes of a worker for each point of a region, including its surroundings, mesh and pending output.
    point_bytes: u64,
}

/// Division if vertices are selected among the points.
const CHOSEN: CloudTinMemory =
    CloudTinMemory { points: 4, vertices: 1, workers: 3, point_bytes: 320 };
/// Division if every point is a vertex: the mesh is larger, and no vertices are stored beside the points.
const ALL: CloudTinMemory = CloudTinMemory { points: 2, vertices: 0, workers: 6, point_bytes: 600 };
/// Division if every point is a vertex and lines add posts.
const ALL_AND_POSTS: CloudTinMemory =
    CloudTinMemory { points: 2, vertices: 2, workers: 4, point_bytes: 600 };

impl CloudTinMemory {
    fn of(tolerance: f64, constraints: &OnCloud) -> &'static Self {
        match (tolerance == 0.0, constraints.has_lines()) {
            (false, _) => &CHOSEN,
            (true, false) => &ALL,
            (true, true) => &ALL_AND_POSTS,
        }
    }

    /// Bytes of a worker on regions with this number of points and bytes of lines.
    pub(super) fn worker(&self, max_points: u64, max_lines: u64) -> u64 {
        (max_points * self.point_bytes + max_lines).max(1)
    }

    /// Least memory for one worker, with `resident_bytes` throughout.
    pub(super) fn min_memory(&self, worker: u64, resident_bytes: u64) -> u64 {
        let eighth = (worker + PROGRAM).div_ceil(self.workers);
        8 * eighth.max(MIN_SHARED.div_ceil(self.points)) + resident_bytes
    }

    /// Number of workers that fit beside the points.
    fn workers(&self, worker: u64, resident_bytes: u64, memory: u64) -> Result<usize> {
        let eighth = memory.saturating_sub(resident_bytes) / 8;
        let fitting = (eighth * self.workers).saturating_sub(PROGRAM) / worker;
        if fitting == 0 || eighth * self.points < MIN_SHARED {
            return Err(too_little(memory, self.min_memory(worker, resident_bytes)));
        }
        Ok(usize::try_from(fitting).unwrap_or(usize::MAX))
    }
}

/// Least bytes for stored points and vertices.
const MIN_SHARED: u64 = 8 << 20;

/// A job after reading the headers: properties of the mesh and its file.
pub(super) struct PreparedCloudTin<'a> {
    /// Name of the input for the user.
    pub(super) label: String,
    pub(super) job: &'a CloudTinJob,
    pub(super) info: &'a CloudInfo,
    pub(super) bounds: [Point; 2],
    pub(super) constraints: OnCloud,
    pub(super) format: &'static MeshFormat,
    header: MeshHeader,
    pub(super) placed: StorageScale,
    pub(super) notes: Vec<String>,
    pub(super) division: &'static CloudTinMemory,
}

impl<'a> PreparedCloudTin<'a> {
    /// Prepares a job on points; `label` names the input for the user.
    pub(super) fn new(
        job: &'a CloudTinJob,
        label: &str,
        points: &'a dyn PointSource,
        features: ConstraintFeatures,
        format: &'static MeshFormat,
    ) -> Result<Self> {
        let info = points.info();
        let bounds = info.bounds.ok_or_else(no_surface)?;
        let constraints = features.on_cloud(info, bounds)?;
        let files = if points.files().is_empty() { job.inputs.names() } else { points.files() };
        let source = match job.inputs.label() {
            Some(_) => feature_files::source(&job.inputs),
            None => feature_files::source(&feature_files::in_order(files)),
        };
        let mut header = header(job, &source, info, constraints.and_heights(bounds), format)?;
        let (placed, notes) =
            job.placing.place(&info.crs, header.bounds, info.frame.scale, format)?;
        header.scale = placed.scale;
        header.unit.clone_from(&placed.unit);
        header.origin = placed.origin(header.origin, header.bounds);
        let division = CloudTinMemory::of(job.tolerance, &constraints);
        let label = label.to_owned();
        Ok(Self { label, job, info, bounds, constraints, format, header, placed, notes, division })
    }

    /// The sink of the mesh.
    pub(super) fn sink(&self) -> Result<Box<dyn MeshSink>> {
        let Resources { temp_dir, .. } = &self.job.resources;
        let (overwrite, temp_dir) = (self.job.overwrite, temp_dir.clone());
        let options = SinkOptions { overwrite, temp_dir, ..SinkOptions::default() };
        (self.format.create)(&self.job.output, &self.header, &options)
    }

    /// The tiling of points.
    pub(super) fn tiling(&self) -> Tiling {
        Tiling::new(self.bounds, self.info.count)
    }

    /// How points are read.
    pub(super) fn filling<'f>(&'f self, at: RunControl<'f>) -> PointStoreSetup<'f> {
        let memory = self.job.resources.memory.saturating_sub(self.constraints.bytes());
        PointStoreSetup {
            threads: self.job.resources.threads.max(1),
            memory: memory / 8 * self.division.points,
            folder: self.folder(),
            within: None,
            progress: at.progress,
            cancel: at.cancel,
        }
    }

    pub(super) fn folder(&self) -> &Path {
        folder_for(&self.job.output, self.job.resources.temp_dir.as_deref())
    }

    /// The work on points, with `resident_bytes` throughout.
    ///
    /// # Errors
    /// Too little memory.
    pub(super) fn work<'w>(
        &'w self,
        points: &'w PointStore,
        regions: &'w CloudTinRegions,
        lines: &'w CloudLines<'w>,
        resident_bytes: u64,
        at: RunControl<'w>,
    ) -> Result<CloudTinContext<'w>> {
        let Resources { threads, memory, .. } = self.job.resources;
        let worker = self.division.worker(regions.max_points(), lines.max_bytes());
        Ok(CloudTinContext {
            points,
            regions,
            lines,
            threads: threads.clamp(1, self.division.workers(worker, resident_bytes, memory)?),
            vertex_bytes: memory.saturating_sub(resident_bytes) / 8 * self.division.vertices,
            measure: self.job.measure,
            folder: self.folder(),
            progress: at.progress,
            cancel: at.cancel,
        })
    }

    /// The tolerance in steps.
    pub(super) fn tolerance(&self) -> f64 {
        in_steps(self.job.tolerance, self.info.frame.scale[2])
    }
}

/// A tolerance in steps; rounds to an integer if it is one up to rounding errors.
pub(super) fn in_steps(tolerance: f64, step: f64) -> f64 {
    let steps = tolerance / step;
    let whole = steps.round();
    if (steps - whole).abs() <= whole * 1e-12 { whole } else { steps }
}

fn header(
    job: &CloudTinJob,
    source: &str,
    info: &CloudInfo,
    bounds: [Point; 2],
    format: &MeshFormat,
) -> Result<MeshHeader> {
    let [low, high] = bounds;
    let centre = Point::new(low.x.midpoint(high.x), low.y.midpoint(high.y), low.z.midpoint(high.z));
    if format.single_precision {
        check_single(bounds, centre, format)?;
    }
    let unit = info.crs.heights_unit().map(str::to_owned);
    let promises = Promises {
        source: Some(source.to_owned()),
        max_error: Some(MaxError { value: job.tolerance, unit }),
        keep_points: job.keep_points.as_deref().map(feature_files::label_of),
        breaklines: job.breaklines.as_deref().map(feature_files::label_of),
        ..Promises::default()
    };
    let bounds: [Point3; 2] = bounds.map(|corner| info.frame.world(corner));
    let (crs, origin) = (info.crs.clone(), info.frame.world(centre));
    Ok(MeshHeader {
        crs,
        origin,
        scale: [1.0; 3],
        unit: None,
        bounds,
        promises,
        channels: Vec::new(),
    })
}

/// Fails if f32 cannot distinguish adjacent steps.
fn check_single(bounds: [Point; 2], centre: Point, format: &MeshFormat) -> Result<()> {
    let offsets = bounds.map(|p| [(p.x, centre.x), (p.y, centre.y), (p.z, centre.z)]);
    if offsets.as_flattened().iter().all(|(at, centre)| at.abs_diff(*centre) < 1 << 23) {
        return Ok(());
    }
    let message = format!(
        "{} stores 32-bit floats, which do not resolve a point cloud of this extent",
        format.name
    );
    Err(Error::usage(message).remedy("write PLY or OBJ, or clip the point cloud with ‹bounds›"))
}
