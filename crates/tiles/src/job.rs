//! A tiles job: its grid, its output, and the content of the tiles.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use terrane_options::check;

use super::options::TileOptions;
use terrane_base::error::{Error, Result};
use terrane_engine::options::GridInput;
use terrane_engine::{Resources, plan};
use terrane_raster::Inputs;

/// Tiles to make of a grid. A plan notes what they depend on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TilesJob {
    /// File names, or a grid in memory by name.
    pub input: Inputs,
    /// What is read of it.
    #[serde(with = "terrane_options::as_map")]
    pub reading: GridInput,
    /// Folder to make.
    #[serde(skip)]
    pub output: PathBuf,
    /// Replace a folder of tiles that exists.
    #[serde(skip)]
    pub overwrite: bool,
    /// What tiles hold.
    #[serde(with = "terrane_options::as_map")]
    pub tiles: TileOptions,
    /// What the job may use.
    #[serde(skip)]
    pub resources: Resources,
}

impl TilesJob {
    /// The job with everything else at its default.
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

/// Tiles to plan; a task has so many tiles of regions, or of levels above them (`cut`).
pub type PlanJob = plan::PlanJob<TilesJob>;
/// Fails where no format is asked for, one twice, or what a format has not.
pub(super) fn check_formats(tiles: &TileOptions) -> Result<()> {
    let is_twice = |i: usize| tiles.format[..i].contains(&tiles.format[i]);
    if tiles.format.is_empty() || (0..tiles.format.len()).any(is_twice) {
        return Err(
            Error::usage("tile formats are missing or repeated").remedy("name each format once")
        );
    }
    check(tiles)
}
