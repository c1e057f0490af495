//! What a grid-to-TIN job is asked to do.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::layout::USUAL_TILE;
use crate::Resources;
use crate::kept::Features;
use crate::placing::Placing;
use crate::reading::Reading;
use terrane_base::bound::Bound;
use terrane_base::error::{Error, Result};
use terrane_raster::Inputs;

/// What the mesh has to reach.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// No valid sample further than this from the surface, vertically.
    MaxError(f64),
    /// The smallest tolerance whose mesh has at most this many vertices.
    MaxVertices(u64),
    /// The smallest tolerance whose mesh has at most this many triangles.
    MaxTriangles(u64),
}

impl Goal {
    /// Whether all samples may become vertices, if triangles are held to such an angle.
    pub(super) fn may_keep_all(self, min_angle: Option<f64>) -> bool {
        self == Self::MaxError(0.0) || min_angle.is_some()
    }

    /// Fails on a tolerance that is negative, infinite or NaN, and on a budget of nothing.
    pub(super) fn check(self) -> Result<()> {
        match self {
            Self::MaxError(e) if !(e.is_finite() && e >= 0.0) => {
                Err(Error::usage(format!("{e} is no maximum error"))
                    .remedy("give a number of 0 or more, in the unit of the heights"))
            }
            Self::MaxVertices(0) | Self::MaxTriangles(0) => {
                Err(Error::usage("a mesh of 0 vertices or triangles is no mesh")
                    .remedy("allow at least 3 vertices"))
            }
            _ => Ok(()),
        }
    }
}

/// Fails where breaklines are to meet under angles that are not theirs.
pub(super) fn check_lines(has_lines: bool, min_angle: Option<f64>) -> Result<()> {
    if has_lines && min_angle.is_some() {
        let message = "breaklines may meet under any angle, so there is no smallest one";
        return Err(Error::usage(message)
            .remedy("leave one of --breaklines and --min-angle out, or pass --keep-points"));
    }
    Ok(())
}

/// A grid-to-TIN job. A plan notes what the mesh depends on, but for its form.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TinJob {
    /// File names, or a synthetic terrain by name (`synth:rough,size=4097,seed=7`).
    pub input: Inputs,
    /// What is read of it.
    #[serde(flatten)]
    pub reading: Reading,
    /// The name of a file of features; the sample nearest to each point of it stays a vertex.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep_points: Option<String>,
    /// The name of a file of lines and polygons that edges follow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<String>,
    /// Mesh file to write.
    #[serde(skip)]
    pub output: PathBuf,
    /// Mesh format by name; by the output's extension when `None`.
    pub format: Option<String>,
    /// Replace an existing output.
    #[serde(skip)]
    pub overwrite: bool,
    /// Write a folder of meshes, each of so many by so many tiles.
    #[serde(skip)]
    pub split: Option<u32>,
    /// STL: close the surface down to this height.
    #[serde(skip)]
    pub solid_base: Option<f64>,
    /// How the mesh lies in a file of its own coordinates.
    #[serde(skip)]
    pub placing: Placing,
    /// What to reach.
    #[serde(flatten)]
    pub goal: Goal,
    /// Of what the tolerance is promised.
    pub bound: Bound,
    /// Reference greedy instead of adaptive strides.
    pub strict: bool,
    /// Run the drop pass.
    pub drop: bool,
    /// Let vertices lie above or below their samples.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fit: bool,
    /// The smallest angle that triangles may have in plan, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_angle: Option<f64>,
    /// Cells along a tile's side.
    pub tile: u32,
    /// Measure maximum error and RMSE for the report.
    #[serde(skip)]
    pub measure: bool,
    /// What the job may use.
    #[serde(skip)]
    pub resources: Resources,
}

impl TinJob {
    /// The points and breaklines to keep.
    pub(super) fn features(&self) -> Result<Features> {
        check_lines(self.breaklines.is_some(), self.min_angle)?;
        let [points, lines] = [&self.keep_points, &self.breaklines].map(Option::as_deref);
        Features::read(points, lines, &self.resources)
    }

    /// The job with everything else at its default, errors measured.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>, goal: Goal) -> Self {
        Self {
            input: input.into(),
            reading: Reading::default(),
            keep_points: None,
            breaklines: None,
            output: output.into(),
            format: None,
            overwrite: false,
            split: None,
            solid_base: None,
            placing: Placing::default(),
            goal,
            bound: Bound::default(),
            strict: false,
            drop: true,
            fit: false,
            min_angle: None,
            tile: USUAL_TILE,
            measure: true,
            resources: Resources::default(),
        }
    }
}
