//! Triangulates an open grid into any sink, for meshes in memory.

use std::path::Path;

use super::goal::TinGoal;
use super::layout::{TileLayout, checked_tile};
use super::make::{MeshProvenance, header, in_input, open_tiled};
use super::refinement::TinMethod;
use super::report::{FlawReport, shortfall};
use super::run::TinOutcome;
use super::settings::TinSettings;
use super::tolerance_search::{TinSeeker, run_stage};
use terrane_base::error::Result;
use terrane_engine::constraints::ConstraintFeatures;
use terrane_engine::memory::{self, MemoryShares};
use terrane_engine::{Cancel, Progress, Resources, feature_files};
use terrane_mesh::{MeshHeader, MeshSink};
use terrane_raster::{GridOpenOptions, GridSource, Inputs, NorthUpGrid};
use terrane_tin::TinSpec;

/// A mesh to make of a grid that is open.
#[derive(Clone, Copy, Debug)]
pub struct BuildJob<'a> {
    /// The goal of the mesh.
    pub goal: TinGoal,
    /// Options of refinement.
    pub refinement: &'a TinMethod,
    /// Cells along a tile's side.
    pub tile: u32,
    /// Resources of the job, without those of the source and the sink.
    pub resources: &'a Resources,
}

impl BuildJob<'_> {
    /// Bytes of a worker on tiles of `tile` cells, shared data included.
    fn worker(&self, features: &ConstraintFeatures, tile: u32) -> u64 {
        let worker = self.refinement.worker_bytes(self.goal, tile, features.has_lines());
        features.bytes() + worker
    }
}

/// What a [`BuildJob`] did.
#[derive(Clone, Debug)]
pub struct BuildOutcome {
    /// The tolerance of the mesh.
    pub tolerance: f64,
    /// Counts and measured errors of the run.
    pub outcome: TinOutcome,
    /// Requirements that the mesh does not meet, as text.
    pub shortfall: Option<String>,
    /// Header for files of the mesh.
    pub header: MeshHeader,
}

/// Triangulates all of `source` into `sink`, heights as exact as the source has them.
///
/// # Errors
/// Those of [`run`](super::run) that are not about files.
pub fn build(
    source: &dyn GridSource,
    sink: Box<dyn MeshSink>,
    job: &BuildJob<'_>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<BuildOutcome> {
    job.goal.check()?;
    let source = &NorthUpGrid::new(source);
    let info = source.info();
    let layout = TileLayout::new(info.width, info.height, checked_tile(job.tile)?)?;
    let features = job.refinement.features(None, job.resources)?;
    let worker = job.worker(&features, layout.side());
    let shares = memory::divide(job.resources.memory, job.resources.threads, worker)
        .map_err(memory::or_smaller_tiles)?;
    let input = BuildInput { source, clip: None, water: None, features };
    build_within(input, sink, job, shares, progress, cancel)
}

/// As [`build`], from files, whose decoded blocks get a share of the memory.
///
/// # Errors
/// As [`build`], and those of opening and reading the files.
pub fn build_files(
    input: &Inputs,
    options: &GridOpenOptions,
    sink: Box<dyn MeshSink>,
    job: &BuildJob<'_>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<BuildOutcome> {
    job.goal.check()?;
    let features = job.refinement.features(options.water.as_ref(), job.resources)?;
    let (source, shares) =
        open_tiled(input, options, job.tile, |tile| job.worker(&features, tile), job.resources)?;
    let opened = BuildInput {
        source: &*source,
        clip: options.clip.as_ref().map(|clip| clip.path()),
        water: options.water.as_ref().map(|water| water.path()),
        features,
    };
    let built = build_within(opened, sink, job, shares, progress, cancel);
    built.map_err(|error| in_input(error, input))
}

/// An opened grid, the files that were applied to it, and constraints.
struct BuildInput<'a> {
    source: &'a dyn GridSource,
    clip: Option<&'a Path>,
    water: Option<&'a Path>,
    features: ConstraintFeatures,
}

fn build_within(
    BuildInput { source, clip, water, features }: BuildInput<'_>,
    sink: Box<dyn MeshSink>,
    job: &BuildJob<'_>,
    shares: MemoryShares,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<BuildOutcome> {
    let info = source.info();
    let layout = TileLayout::new(info.width, info.height, job.tile)?;
    let constraints = features.on(info)?;
    let folder = job.resources.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
    let settings = TinSettings {
        spec: job.refinement.spec(&info.transform)?,
        tile: job.tile,
        constraints: &constraints,
        threads: shares.threads,
        mesh_bytes: shares.mesh,
        temp_dir: &folder,
        order_seed: None,
        progress,
        cancel,
    };
    let (tolerance, _) = TinSeeker { source, layout, settings }.tolerance(job.goal)?;
    let settings = TinSettings { spec: TinSpec { tolerance, ..settings.spec }, ..settings };
    let outcome = run_stage("triangulate", source, sink, layout, &settings)?;
    let [clip, water] = [clip, water].map(|path| path.map(feature_files::label));
    let provenance = MeshProvenance { input: info.format, clip, water, refinement: job.refinement };
    let [thin, apart] =
        [outcome.thin, outcome.apart].map(|flaws| Some(FlawReport::of(flaws, &info.transform)));
    let shortfall = shortfall(thin, apart, job.refinement.min_angle);
    Ok(BuildOutcome {
        tolerance,
        outcome,
        shortfall,
        header: header(info, provenance, &settings.spec, 0.0),
    })
}
