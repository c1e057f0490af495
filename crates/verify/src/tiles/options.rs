//! Options of proofs of terrain tiles.

use terrane_options::Options;

use terrane_engine::Resources;
use terrane_engine::options::{CloudInput, FileName, GridInput};
use terrane_tiles::{CloudStages, ModelOptions};

/// Verify terrain tiles against their grid
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct TilesProof {
    /// Geoid model that the tiles were made with
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<String>,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

terrane_engine::has_within!(CloudTilesProof: ModelOptions => [CloudStages]);

/// Verify terrain tiles against the terrain model of their point cloud
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct CloudTilesProof {
    /// Geoid model that the tiles were made with
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<String>,
    /// File of water features that were flattened; water masks are checked against them
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub water: Option<String>,
    /// The model of the ground.
    #[option(flatten)]
    pub model: ModelOptions,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}
