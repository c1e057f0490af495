//! A tiles job: grid, output, and content of the tiles.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use terrane_options::check;

use super::options::TileOptions;
use terrane_base::error::{Error, Result};
use terrane_engine::options::GridInput;
use terrane_engine::{Resources, plan};
use terrane_raster::Inputs;

/// Tiles of a grid. A plan records these settings.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TilesJob {
    /// File names, or a grid in memory by name.
    pub input: Inputs,
    /// Input options.
    #[serde(with = "terrane_options::as_map")]
    pub reading: GridInput,
    /// Output folder.
    #[serde(skip)]
    pub output: PathBuf,
    /// Replaces an existing folder of tiles.
    #[serde(skip)]
    pub overwrite: bool,
    /// Content of tiles.
    #[serde(with = "terrane_options::as_map")]
    pub tiles: TileOptions,
    /// Resources of the job.
    #[serde(skip)]
    pub resources: Resources,
}

impl TilesJob {
    /// A job with default settings.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>) -> Self {
        Self {
            input: input.into(),
            reading: GridInput::default(),
            output: output.into(),
            overwrite: false,
            tiles: TileOptions::default(),
            resources: Resources::default(),
        }
    }
}

/// Tiles to plan; `cut` is the number of tiles per task, of regions or of levels above them.
pub type PlanJob = plan::PlanJob<TilesJob>;
/// Fails for missing or repeated formats, and for options that a format does not support.
pub(super) fn check_formats(tiles: &TileOptions) -> Result<()> {
    let formats = &tiles.format;
    if formats.is_empty() || (1..formats.len()).any(|i| formats[..i].contains(&formats[i])) {
        return Err(
            Error::usage("a tile format is missing or given twice").remedy("name each format once")
        );
    }
    check(tiles)
}
