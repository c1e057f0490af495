//! Availability metadata: lists of the tiles below, which tiles of every few levels carry for
//! clients.

use std::collections::{HashMap, HashSet};

use super::folder::FolderTiles;
use super::layer::{TileRange, TilesetPromises, tiles_of};
use terrane_proof::tiles::ProofTileId;

/// Number of tiles below each tile with availability metadata.
pub(super) struct TileDescendants {
    /// Levels between tiles with availability metadata.
    interval: u8,
    counts: HashMap<ProofTileId, u64>,
}

impl TileDescendants {
    /// `None` for a set without availability metadata.
    pub(super) fn of(layer: &TilesetPromises, tiles: &FolderTiles) -> Option<Self> {
        let interval = layer.metadata_interval?;
        let mut counts = HashMap::new();
        for &id in tiles.all.iter().filter(|id| id.level > 0) {
            let level = (id.level - 1) / interval * interval;
            *counts.entry(above(id, level)).or_default() += 1;
        }
        Some(Self { interval, counts })
    }

    /// Whether a tile lists exactly the tiles below it, each once, down to the next level with metadata.
    pub(super) fn is_right(
        &self,
        id: ProofTileId,
        listed: Option<&[Vec<TileRange>]>,
        tiles: &FolderTiles,
    ) -> bool {
        let expected = match id.level.is_multiple_of(self.interval) {
            true => self.counts.get(&id).copied().unwrap_or_default(),
            false => 0,
        };
        let ranges = listed.unwrap_or_default();
        let count = ranges.iter().flatten().map(TileRange::count).fold(0, u64::saturating_add);
        // Ranges of a hostile tile may name 2^62 tiles: they are expanded only if the count is that of the files.
        if count != expected || ranges.len() > usize::from(self.interval) {
            return false;
        }
        let levels = (id.level + 1..).zip(ranges);
        let named = levels.flat_map(|(level, ranges)| tiles_of(level, ranges));
        let below = named.filter(|at| above(*at, id.level) == id && tiles.number_of(*at).is_some());
        let distinct: HashSet<ProofTileId> = below.collect();
        distinct.len() as u64 == expected
    }
}

/// The ancestor of a tile on a level, or the tile itself.
fn above(id: ProofTileId, level: u8) -> ProofTileId {
    let by = id.level - level;
    ProofTileId { level, x: id.x >> by, y: id.y >> by }
}
