//! A grid-to-TIN job.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::goal::TinGoal;
use super::layout::USUAL_TILE;
use super::refinement::TinMethod;
use terrane_engine::Resources;
use terrane_engine::local_frame::LocalFrame;
use terrane_engine::options::GridInput;
use terrane_engine::transform::TargetCrs;
use terrane_raster::Inputs;

/// A grid-to-TIN job. A plan records everything the mesh depends on, except the form of its output.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TinJob {
    /// File names, or a synthetic terrain by name (`synth:rough,size=4097,seed=7`).
    pub input: Inputs,
    /// How the input is read.
    #[serde(with = "terrane_options::as_map")]
    pub reading: GridInput,
    /// Mesh file to write.
    #[serde(skip)]
    pub output: PathBuf,
    /// Mesh format by name; by the output's extension when `None`.
    pub format: Option<String>,
    /// Replace an existing output.
    #[serde(skip)]
    pub overwrite: bool,
    /// Write a folder of meshes, each of this number of tiles a side.
    #[serde(skip)]
    pub split: Option<u32>,
    /// STL and 3MF: close the surface down to this height.
    #[serde(skip)]
    pub solid_base: Option<f64>,
    /// STL and 3MF: close the surface down to this distance below the lowest height, in millimetres of the
    /// print.
    #[serde(skip)]
    pub base: Option<f64>,
    /// Placement in formats with model coordinates.
    #[serde(skip)]
    pub placing: LocalFrame,
    /// Target CRS; that of the grid when `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transform: Option<TargetCrs>,
    /// The goal of the mesh.
    #[serde(flatten)]
    pub goal: TinGoal,
    /// Options of refinement.
    #[serde(with = "terrane_options::as_map")]
    pub refinement: TinMethod,
    /// Cells along a tile's side.
    pub tile: u32,
    /// Measure maximum error and RMSE for the report.
    #[serde(skip)]
    pub measure: bool,
    /// Resources of the job.
    #[serde(skip)]
    pub resources: Resources,
}

impl TinJob {
    /// The job with everything else at its default, errors measured.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>, goal: TinGoal) -> Self {
        Self {
            input: input.into(),
            reading: GridInput::default(),
            output: output.into(),
            format: None,
            overwrite: false,
            split: None,
            solid_base: None,
            base: None,
            placing: LocalFrame::default(),
            transform: None,
            goal,
            refinement: TinMethod::default(),
            tile: USUAL_TILE,
            measure: true,
            resources: Resources::default(),
        }
    }
}
