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
    pub(super) places: GlobeRaster<'a>,
    /// Reference polygons of water masks.
    pub(super) shore: Option<WaterShore>,
    /// Metres that heights of steep ground are apart; none where it is not steep.
    pub(super) steep: f64,
    pub(super) progress: &'a dyn Progress,
    pub(super) cancel: &'a Cancel,
    pub(super) room: &'a DividedBudget,
}

impl TilesProofContext<'_> {
    /// A tile, and whether its file is packed.
    pub(super) fn read(&self, id: ProofTileId) -> Result<(DecodedTile, bool)> {
        let folder = &self.layer.folder;
        let fit = |vertices| self.room.fit(vertices);
        match (self.layer.three(), self.layer.own(id.level)) {
            (Some(three), Some(level)) => three.read(folder, id, level, fit),
            _ => folder::read(folder, id, fit),
        }
    }

    /// The largest distance of samples allowed at a level.
    pub(super) fn limit(&self, level: u8) -> f64 {
        self.layer.tolerance(level) + ROUNDING
    }

    /// The error that a tile of a level may record: of 3D Tiles also that of one below it.
    pub(super) fn max_recorded(&self, level: u8) -> f64 {
        let finest = if self.layer.three().is_some() { self.layer.finest } else { level };
        (level..=finest).map(|level| self.limit(level)).fold(0.0, f64::max)
    }

    /// The largest gap allowed between borders of a level and the next coarser one. On steep ground, the rounding of
    /// positions adds to heights.
    pub(super) fn allowed_gap(&self, level: u8) -> f64 {
        let of = |level: u8| {
            let part = (4.0 * self.places.samples_of_step(level)).min(1.0);
            if self.steep > 0.0 { self.steep * part } else { 0.0 }
        };
        self.assumed_gap(level) + of(level) + level.checked_sub(1).map_or(0.0, of) + ROUNDING
    }

    /// The errors together that clients assume of a level and the next coarser one.
    pub(super) fn assumed_gap(&self, level: u8) -> f64 {
        let coarser = level.checked_sub(1).map_or(0.0, |level| self.layer.apart(level));
        self.layer.apart(level) + coarser
    }
}

/// The error of a tile that cannot be decoded, in place of the tile; others end the proof.
pub(super) fn decoded<T>(read: Result<T>) -> Result<std::result::Result<T, Error>> {
    match read {
        Ok(found) => Ok(Ok(found)),
        Err(e) => match e.kind() {
            ErrorKind::BadInput | ErrorKind::Unsupported | ErrorKind::Limit => Ok(Err(e)),
            _ => Err(e),
        },
    }
}
