//! A line simplification job.

use std::path::PathBuf;

use super::goal::LineGoal;
use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::transform::TargetCrs;
use terrane_line::topology::{RingCollapse, Strategy};
use terrane_line::{METHODS, SimplifyMethod};
use terrane_vector as vector;

/// Lines to be simplified.
#[derive(Clone, Debug)]
pub struct LineJob {
    /// Files of features.
    pub input: Vec<PathBuf>,
    /// The object of TopoJSON files; their first one when `None`.
    pub layer: Option<String>,
    /// The file or folder to write.
    pub output: PathBuf,
    /// The output is a folder, in which each input keeps its name; with several inputs it is in any case.
    pub into_folder: bool,
    /// Name of the format to write; by the output's ending, or as the input, when `None`.
    pub format: Option<String>,
    /// How vertices are chosen.
    pub method: &'static SimplifyMethod,
    /// How many are left out.
    pub goal: LineGoal,
    /// Heights take part in distances.
    pub is_space: bool,
    /// Neighbours are looked at; each feature is simplified by itself when `None`.
    pub topology: Option<Topology>,
    /// The file of hierarchies, for Ramer-Douglas-Peucker without topology: made where it is not there,
    /// asked instead of the method where it is.
    pub hierarchy: Option<PathBuf>,
    /// What becomes of rings that have fewer than three vertices left.
    pub collapse: RingCollapse,
    /// Digits behind the point that positions are rounded to, in any format: with topology as far as nothing
    /// comes to touch, cross or change sides; `None` to leave them as they are.
    pub decimals: Option<u8>,
    /// The system to write in; that of the inputs when `None`.
    pub transform: Option<TargetCrs>,
    /// Replace files that exist.
    pub overwrite: bool,
    /// What the job may use.
    pub resources: Resources,
}

/// Most vertices of a [square](Topology::square) unless told otherwise.
pub const SQUARE: u64 = 1 << 20;

/// How neighbours are looked at.
#[derive(Clone, Debug)]
pub struct Topology {
    /// When crossings are looked for.
    pub strategy: Strategy,
    /// Vertices no farther apart than this are made one first, in units of the data; 0 for none.
    pub snap: f64,
    /// Points that stay on the side of every line that they are on.
    pub sides: Option<PathBuf>,
    /// Most vertices that are looked at together. Where there are more in all files, space is divided
    /// into squares that hold no more each, and segments from one square to another stay: what comes
    /// out depends on it.
    pub square: u64,
}

impl Default for Topology {
    fn default() -> Self {
        Self { strategy: Strategy::default(), snap: 0.0, sides: None, square: SQUARE }
    }
}

impl LineJob {
    /// The job with everything else at its default.
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
    /// True where the output is a folder.
    pub(super) fn is_into_folder(&self) -> bool {
        self.into_folder || self.input.len() > 1
    }

    /// Fails where it can be known without the inputs that the job cannot be done.
    ///
    /// # Errors
    /// A goal that the method does not have, hierarchies of another method or with topology, an output
    /// whose format is not known.
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

/// Fails where hierarchies were asked for that do not do the job.
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

/// Fails where what is judged would not be what is written.
fn check_transform(job: &LineJob) -> Result<()> {
    let is_rounded = job.topology.is_some() && job.decimals.is_some();
    match job.transform.is_some() && is_rounded {
        true => Err(Error::usage("‹topology› does not cover the rounding after a transformation")
            .remedy("leave out ‹decimals›, ‹to_crs› or ‹topology›")),
        false => Ok(()),
    }
}
