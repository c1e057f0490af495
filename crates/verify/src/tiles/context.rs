//! The context of both passes over a set of tiles: the set, the raster, and the allowed errors.

use super::folder::{self, FolderTiles};
use super::georeference::GlobeRaster;
use super::layer::TilesetPromises;
use super::memory_shares::DividedBudget;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::{Cancel, Progress};
use terrane_proof::tiles::{DecodedTile, ProofTileId, WaterShore};

/// Metres by which a distance may exceed its limit because of rounding.
pub const ROUNDING: f64 = 1e-6;

/// Inputs shared by both passes.
pub(super) struct TilesProofContext<'a> {
    pub(super) layer: &'a TilesetPromises,
    pub(super) tiles: &'a FolderTiles,
    pub(super) raster: GlobeRaster<'a>,
    /// Reference polygons of water masks.
    pub(super) shore: Option<WaterShore>,
    /// Metres between the lowest and the highest sample if the ground is steep, else 0.
    pub(super) steep: f64,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
    pub(super) memory: &'a DividedBudget,
}

impl TilesProofContext<'_> {
    /// A tile, and whether its file is packed.
    pub(super) fn read(&self, id: ProofTileId) -> Result<(DecodedTile, bool)> {
        let folder = &self.layer.folder;
        let check_vertices = |vertices| self.memory.check_vertices(vertices);
        match (self.layer.three_tiles(), self.layer.stated(id.level)) {
            (Some(three), Some(level)) => three.read(folder, id, level, check_vertices),
            _ => folder::read(folder, id, check_vertices),
        }
    }

    /// The largest distance of samples allowed at a level.
    pub(super) fn limit(&self, level: u8) -> f64 {
        self.layer.tolerance(level) + ROUNDING
    }

    /// The largest error that a tile of a level may record. In 3D Tiles it includes that of finer tiles.
    pub(super) fn max_recorded(&self, level: u8) -> f64 {
        let finest = if self.layer.three_tiles().is_some() { self.layer.finest } else { level };
        (level..=finest).map(|level| self.limit(level)).fold(0.0, f64::max)
    }

    /// The largest gap allowed between borders of a level and the next coarser one. On steep ground, the rounding of
    /// positions adds to heights.
    pub(super) fn allowed_gap(&self, level: u8) -> f64 {
        let coarser = level.checked_sub(1).map_or(0.0, |level| self.position_error(level));
        self.assumed_gap(level) + self.position_error(level) + coarser + ROUNDING
    }

    /// Metres that the rounding of positions of a level moves heights by on steep ground.
    fn position_error(&self, level: u8) -> f64 {
        self.steep * (4.0 * self.raster.samples_of_step(level)).min(1.0)
    }

    /// Sum of the errors that clients assume of a level and the next coarser one.
    pub(super) fn assumed_gap(&self, level: u8) -> f64 {
        let coarser = level.checked_sub(1).map_or(0.0, |level| self.layer.border_error(level));
        self.layer.border_error(level) + coarser
    }
}

/// The error of a tile that cannot be decoded, in place of the tile; others end the proof.
pub(super) fn decoded<T>(read: Result<T>) -> Result<std::result::Result<T, Error>> {
    match read {
        Ok(tile) => Ok(Ok(tile)),
        Err(e) => match e.kind() {
            ErrorKind::BadInput | ErrorKind::Unsupported | ErrorKind::Limit => Ok(Err(e)),
            _ => Err(e),
        },
    }
}
