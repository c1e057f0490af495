//! Reports of tiles.

use serde::{Deserialize, Serialize};

use terrane_engine::plan::{self, DescribesRun};
use terrane_engine::run_statistics::RunStatistics;

/// Report of a tiles job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct TilesReport {
    pub input: String,
    pub output: String,
    pub crs: String,
    pub samples: u64,
    pub tiles: u64,
    pub levels: Vec<TileLevelReport>,
    pub notes: Vec<String>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
}

/// The tiles of a level.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TileLevelReport {
    /// Format of the tiles.
    pub format: String,
    /// From 0.
    pub level: u8,
    /// Error bound in metres: the geometric error of the level, or a larger bound where quantization is
    /// coarser.
    pub tolerance: f64,
    /// Step of heights in metres.
    pub step: f64,
    /// Step of earth-centred coordinates in metres, if used.
    pub lattice: Option<f64>,
    /// Depth of skirts in metres, if used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skirt: Option<f64>,
    /// Measured error bound in metres, from samples or from blocks of samples.
    pub error: f64,
    /// Number of tiles.
    pub tiles: u64,
    /// In all tiles.
    pub vertices: u64,
    /// In all tiles.
    pub triangles: u64,
    /// Size of all files in bytes.
    pub bytes: u64,
}

/// Report of a plan, for tiles only.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TilesStatus {
    /// Maximum level.
    pub max_level: u8,
    /// Of the grid.
    pub samples: u64,
}

/// Status of a plan of tiles.
pub type StatusReport = plan::StatusReport<TilesStatus>;

/// Report of a run, for tiles only.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TilesRun {
    /// Tiles made by the tasks of this run.
    pub made_tiles: u64,
    /// The tileset, if this run wrote it; its time is the writing time.
    pub tiles: Option<TilesReport>,
}

impl DescribesRun for TilesRun {
    fn written(&self) -> Option<&str> {
        self.tiles.as_ref().map(|tiles| tiles.output.as_str())
    }
}
