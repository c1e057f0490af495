//! The main job: a grid in, a seamless mesh with a proven error bound out.

use std::path::PathBuf;

use serde::Serialize;

use crate::pipeline::Resources;

/// What the mesh has to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// No valid sample further than this from the surface, vertically.
    MaxError(f64),
    /// The smallest tolerance whose mesh has at most this many vertices.
    MaxVertices(u64),
    /// The smallest tolerance whose mesh has at most this many triangles.
    MaxTriangles(u64),
}

/// A grid-to-TIN job.
#[derive(Clone, Debug)]
pub struct TinJob {
    /// File name, or a synthetic terrain by name (`synth:rough,size=4097,seed=7`).
    pub input: String,
    /// How to open it.
    pub band: u32,
    /// Replaces the file's nodata value.
    pub nodata: Option<f64>,
    /// Mesh file to write.
    pub output: PathBuf,
    /// Mesh format by name; by the output's extension when `None`.
    pub format: Option<String>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// STL: close the surface down to this height.
    pub solid_base: Option<f64>,
    /// What to reach.
    pub goal: Goal,
    /// Reference greedy instead of adaptive strides.
    pub strict: bool,
    /// Run the drop pass.
    pub drop: bool,
    /// Cells along a tile's side.
    pub tile: u32,
    /// Measure maximum error and RMSE for the report.
    pub measure: bool,
    /// What the job may use.
    pub resources: Resources,
}

/// Seconds and samples of one stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StageReport {
    /// Name: "read", "tiles", "seams", "write".
    pub name: String,
    /// Seconds spent in it, summed over threads.
    pub cpu_seconds: f64,
    /// Samples it handled.
    pub samples: u64,
}

/// What a grid-to-TIN job did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct TinReport {
    pub input: String,
    pub output: String,
    pub format: String,
    pub width: u32,
    pub height: u32,
    pub crs: String,
    pub horizontal_unit: String,
    pub vertical_unit: String,
    pub tolerance: f64,
    /// Largest error of any sample, when measured.
    pub max_error: Option<f64>,
    /// Root mean square error, when measured.
    pub rmse: Option<f64>,
    pub samples: u64,
    pub valid_samples: u64,
    /// Valid samples without any valid cell: they have no surface.
    pub isolated_samples: u64,
    pub vertices: u64,
    pub triangles: u64,
    /// Vertices per valid sample.
    pub kept: f64,
    pub output_bytes: u64,
    pub tiles: u64,
    pub tile_cells: u32,
    pub threads: usize,
    pub memory_budget: u64,
    pub peak_memory: Option<u64>,
    pub wall_seconds: f64,
    pub samples_per_second: f64,
    pub stages: Vec<StageReport>,
}
