//! Options of proofs of terrain tiles.

use terrane_options::Options;

use terrane_engine::Resources;
use terrane_engine::options::{CloudInput, FileName, GridInput};
use terrane_tiles::ModelOptions;

/// Prove terrain tiles against the grid they were made from
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct TilesProof {
    /// Heights of the geoid above the ellipsoid, as they were given when the tiles were made
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<String>,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

/// Prove terrain tiles against the point cloud they were made from, by way of a model of its ground
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct CloudTilesProof {
    /// Heights of the geoid above the ellipsoid, as they were given when the tiles were made
    #[option(value = "FILE", with = FileName, role = Reads)]
    pub geoid: Option<String>,
    /// Water of a file of features that was made level, which masks of water are held to
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
