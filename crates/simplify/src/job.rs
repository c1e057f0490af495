//! A line simplification job.

use std::path::PathBuf;

use super::goal::LineGoal;
use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::transform::TargetCrs;
use terrane_line::topology::{RingCollapse, Strategy};
use terrane_line::{METHODS, SimplifyMethod};
use terrane_vector as vector;

/// Lines to simplify.
#[derive(Clone, Debug)]
pub struct LineJob {
    /// Vector files.
    pub input: Vec<PathBuf>,
    /// Object of TopoJSON files; the first when `None`.
    pub layer: Option<String>,
    /// Output file or folder.
    pub output: PathBuf,
    /// The output is a folder in which inputs keep their names; always the case for several inputs.
    pub into_folder: bool,
    /// Output format; `None` for the format of the ending or of the input.
    pub format: Option<String>,
    /// Simplification method.
    pub method: &'static SimplifyMethod,
    /// Goal.
    pub goal: LineGoal,
    /// Distances include heights.
    pub is_space: bool,
    /// Topology; `None` to simplify each feature independently.
    pub topology: Option<Topology>,
    /// Hierarchy file, for Ramer-Douglas-Peucker without topology: created if missing, otherwise used instead
    /// of the method.
    pub hierarchy: Option<PathBuf>,
    /// Treatment of rings with fewer than three vertices left.
    pub collapse: RingCollapse,
    /// Decimals of positions in the output; with topology only where lines do not touch, cross or change sides;
    /// `None` for no rounding.
    pub decimals: Option<u8>,
    /// Output CRS; that of the inputs when `None`.
    pub transform: Option<TargetCrs>,
    /// Replaces existing files.
    pub overwrite: bool,
    /// Resources of the job.
    pub resources: Resources,
}

/// Default limit of vertices per [tile](Topology::tile_vertices).
pub const TILE_VERTICES: u64 = 1 << 20;

/// Settings of topology.
#[derive(Clone, Debug)]
pub struct Topology {
    /// When crossings are tested.
    pub strategy: Strategy,
    /// Snap distance in units of the data; 0 for none.
    pub snap: f64,
    /// File of points that stay on the same side of every line.
    pub sides: Option<PathBuf>,
    /// Largest number of vertices processed together. Larger inputs are divided into tiles of at most this many
    /// vertices, and segments between tiles are kept. The result depends on it.
    pub tile_vertices: u64,
}

impl Default for Topology {
    fn default() -> Self {
        Self { strategy: Strategy::default(), snap: 0.0, sides: None, tile_vertices: TILE_VERTICES }
    }
}

impl LineJob {
    /// A job with default settings.
    pub fn new(input: impl Into<PathBuf>, output: impl Into<PathBuf>, goal: LineGoal) -> Self {
        Self {
            input: vec![input.into()],
            layer: None,
            output: output.into(),
            into_folder: false,
            format: None,
            method: &METHODS[0],
            goal,
            is_space: false,
            topology: None,
            hierarchy: None,
            collapse: RingCollapse::Minimal,
            decimals: None,
            transform: None,
            overwrite: false,
            resources: Resources::default(),
        }
    }
}

impl LineJob {
    /// True if the output is a folder.
    pub(super) fn is_into_folder(&self) -> bool {
        self.into_folder || self.input.len() > 1
    }

    /// Fails for a job that is invalid whatever the inputs.
    ///
    /// # Errors
    /// A goal that the method does not support; a hierarchy with topology or with another method; an unknown
    /// output format.
    pub fn check(&self) -> Result<()> {
        self.goal.check(self.method)?;
        check_hierarchy(self)?;
        check_transform(self)?;
        match (self.is_into_folder(), &self.format) {
            (true, None) => Ok(()),
            (_, format) => vector::by_path(&self.output, format.as_deref()).map(drop),
        }
    }
}

/// Fails for a hierarchy that the job does not support.
fn check_hierarchy(job: &LineJob) -> Result<()> {
    if job.hierarchy.is_none() {
        return Ok(());
    }
    if job.topology.is_some() {
        return Err(Error::usage("‹hierarchy› is not supported with ‹topology›")
            .remedy("leave one of them out"));
    }
    if job.method.splits {
        return Ok(());
    }
    let (rdp, other) = (SimplifyMethod::RDP.name, job.method.name);
    Err(Error::usage(format!("‹hierarchy› requires the method {rdp}, not {other}"))
        .remedy(format!("leave ‹hierarchy› out, or pass ‹method› {rdp}")))
}

/// Fails if the output would differ from the verified result.
fn check_transform(job: &LineJob) -> Result<()> {
    let is_rounded = job.topology.is_some() && job.decimals.is_some();
    match job.transform.is_some() && is_rounded {
        true => Err(Error::usage("‹topology› does not cover the rounding after a transformation")
            .remedy("leave out ‹decimals›, ‹to_crs› or ‹topology›")),
        false => Ok(()),
    }
}
