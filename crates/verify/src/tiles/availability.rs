//! Availability metadata: lists of the tiles below, which tiles of every few levels carry for
//! clients.

use std::collections::{HashMap, HashSet};

use super::folder::FolderTiles;
use super::layer::{TileRange, TilesetPromises, tiles_of};
use terrane_proof::tiles::ProofTileId;

/// Number of tiles below each tile with availability metadata.
pub(super) struct TileDescendants {
    /// Levels between tiles with availability metadata.
    every: u8,
    counts: HashMap<ProofTileId, u64>,
}

impl TileDescendants {
    /// `None` for a set without availability metadata.
    pub(super) fn of(layer: &TilesetPromises, tiles: &FolderTiles) -> Option<Self> {
        let every = layer.told_every?;
        let mut counts = HashMap::new();
        for &id in tiles.all.iter().filter(|id| id.level > 0) {
            let level = (id.level - 1) / every * every;
            *counts.entry(above(id, level)).or_default() += 1;
        }
        Some(Self { every, counts })
    }

    /// Whether a tile lists exactly the tiles below it, each once, down to the next level with metadata.
    pub(super) fn is_right(
        &self,
        id: ProofTileId,
        listed: Option<&[Vec<TileRange>]>,
        tiles: &FolderTiles,
    ) -> bool {
        let expected = match id.level.is_multiple_of(self.every) {
            true => self.counts.get(&id).copied().unwrap_or_default(),
            false => 0,
        };
        let ranges = listed.unwrap_or_default();
        let count = ranges.iter().flatten().map(TileRange::count).fold(0, u64::saturating_add);
        // What is counted alike is no more than there is on disk.
        if count != expected || ranges.len() > usize::from(self.every) {
            return false;
        }
        let levels = (id.level + 1..).zip(ranges);
        let found = levels.flat_map(|(level, ranges)| tiles_of(level, ranges));
        let is_below =
            |at: &ProofTileId| above(*at, id.level) == id && tiles.find_one(*at).is_some();
        let found: HashSet<ProofTileId> = found.filter(is_below).collect();
        found.len() as u64 == expected
    }
}

/// The tile of a level that one of it or a finer one lies in.
fn above(id: ProofTileId, level: u8) -> ProofTileId {
    let by = id.level - level;
    ProofTileId { level, x: id.x >> by, y: id.y >> by }
}
