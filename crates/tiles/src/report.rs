//! What was made.

use serde::{Deserialize, Serialize};

use terrane_engine::figures::RunStatistics;
use terrane_engine::plan::{self, DescribesRun};

/// What a job that makes tiles did.
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
    /// The format of the tiles.
    pub format: String,
    /// From 0.
    pub level: u8,
    /// Metres that no sample is further from its tile: what clients take the level to be off by, or the error where
    /// positions cannot tell samples apart and it is larger.
    pub tolerance: f64,
    /// Metres of a step of heights.
    pub step: f64,
    /// Metres of a step of earth-centred coordinates, where tiles hold such.
    pub lattice: Option<f64>,
    /// Metres that skirts hang down, where tiles have such.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skirt: Option<f64>,
    /// Metres that no sample is further from its tile: measured of samples, or of blocks of them.
    pub error: f64,
    /// How many.
    pub tiles: u64,
    /// In all tiles.
    pub vertices: u64,
    /// In all tiles.
    pub triangles: u64,
    /// Of all files.
    pub bytes: u64,
}

/// What is told of the plan of tiles alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TilesStatus {
    /// Maximum level.
    pub max_level: u8,
    /// Of the grid.
    pub samples: u64,
}

/// The plan of tiles, or how far the work on it has come.
pub type StatusReport = plan::StatusReport<TilesStatus>;

/// What is told of a run on tiles alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TilesRun {
    /// Tiles made by the tasks it did.
    pub made_tiles: u64,
    /// The set, if this run came to it; its time is that of writing it.
    pub tiles: Option<TilesReport>,
}

impl DescribesRun for TilesRun {
    fn written(&self) -> Option<&str> {
        self.tiles.as_ref().map(|tiles| tiles.output.as_str())
    }
}
