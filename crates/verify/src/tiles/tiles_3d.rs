//! The files of a set of 3D Tiles: subtrees and tiles.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::folder::{self, FolderTiles, entries, number};
use super::level::StatedLevel;
use super::memory_shares::TilesProofMemory;
use terrane_base::error::{Error, Result};
use terrane_engine::Cancel;
use terrane_proof::tiles::{
    DecodedTile, ERROR_OF_ROOT, GlbTileContent, MAX_LEVEL, MetadataSchema, ProofTileId,
    StatedTileLevel, StatedTileMetadata, Subtree, TilesetFault, TilesetFaults,
};

/// The name of the file.
pub(super) const NAME: &str = "tileset.json";

/// Folders of the western and the eastern half of the globe.
pub(super) const HALVES: [&str; 2] = ["west", "east"];
pub(super) const TILE: &str = ".glb";
pub(super) const SUBTREE: &str = ".subtree";

/// Rounding of heights of regions, in metres.
const METRES: f64 = 1e-6;
/// Relative rounding of geometric errors.
const SHARE: f64 = 1e-6;

/// Metadata of 3D Tiles only.
#[derive(Debug)]
pub(super) struct ThreeTilesCheck {
    /// Metadata of tiles from the subtrees.
    pub(super) metadata: HashMap<ProofTileId, StatedTileMetadata>,
    /// The tiles at the tops of subtrees.
    pub(super) subtrees: HashSet<ProofTileId>,
    /// Lowest and highest height of the regions of the globe and of its halves.
    pub(super) regions: [[f64; 2]; 3],
    /// Geometric errors of the tileset, its root and the halves.
    pub(super) errors: [f64; 3],
    pub(super) has_edges: bool,
}

impl ThreeTilesCheck {
    /// Reads all subtrees of `levels` levels, from the roots on.
    pub(super) fn collect(
        &mut self,
        folder: &Path,
        levels: u8,
        schema: &MetadataSchema,
        max_tiles: usize,
        cancel: &Cancel,
    ) -> Result<()> {
        let mut open: Vec<ProofTileId> = [0, 1].map(|x| ProofTileId { level: 0, y: 0, x }).into();
        let mut count = 0;
        while let Some(top) = open.pop() {
            cancel.check()?;
            let path = path_of(folder, top, SUBTREE);
            let (bytes, _) = folder::bytes(&path)?;
            let subtree =
                Subtree::read(&bytes, top, levels, schema).map_err(|e| e.in_file(&path))?;
            if top.level + levels > MAX_LEVEL && !subtree.below.is_empty() {
                let message = format!("child subtrees exceed level {MAX_LEVEL}");
                return Err(Error::bad_input(message).in_file(&path));
            }
            open.extend(subtree.below);
            // Beyond the limit, tiles are only counted, for the error.
            count += subtree.tiles.len();
            if count <= max_tiles {
                self.subtrees.insert(top);
                self.metadata.extend(subtree.tiles);
            }
        }
        TilesProofMemory::check(count, max_tiles).map_err(|e| e.in_file(folder))
    }

    /// Metadata of a tile.
    pub(super) fn stated(&self, id: ProofTileId) -> Option<&StatedTileMetadata> {
        self.metadata.get(&id)
    }

    /// Reads a tile, and whether its file is packed. `check_vertices` is called with the number of vertices before memory is
    /// allocated for them.
    pub(super) fn read(
        &self,
        folder: &Path,
        id: ProofTileId,
        level: StatedLevel,
        check_vertices: impl FnOnce(usize) -> Result<()>,
    ) -> Result<(DecodedTile, bool)> {
        let path = path_of(folder, id, TILE);
        let stated = StatedTileLevel {
            step: level.step,
            lattice: level.lattice.unwrap_or_default(),
            has_edges: self.has_edges,
            skirt: level.skirt,
        };
        let (bytes, is_packed) = folder::bytes(&path)?;
        let content = GlbTileContent::read(&bytes, check_vertices);
        let tile = content.and_then(|content| content.tile(id, stated));
        Ok((tile.map_err(|e| e.in_file(&path))?, is_packed))
    }

    /// Compares the metadata of each tile with that of its descendants, and checks that regions
    /// contain them.
    pub(super) fn check(&self, faults: &mut TilesetFaults) {
        for (id, metadata) in &self.metadata {
            let parent = id.parent().and_then(|parent| Some((parent, self.stated(parent)?)));
            if let Some((parent, _)) = parent.filter(|(_, stated)| !stated.holds(metadata)) {
                faults.add(TilesetFault::Nested, 1, parent);
            }
        }
        let [globe, west, east] = self.regions;
        let halves = [self.heights_of_half(0), self.heights_of_half(1)];
        let all = halves.into_iter().flatten().reduce(union);
        let regions = [(globe, all), (west, halves[0]), (east, halves[1])];
        let is_off = regions.into_iter().any(|(stated, needed)| differ(stated, needed));
        faults.add(TilesetFault::Regions, u64::from(is_off), None);
        let errors = self.metadata.values().map(|metadata| metadata.error);
        let worst = errors.fold(ERROR_OF_ROOT, f64::max);
        let needed = [2.0 * worst, 2.0 * worst, worst];
        let mut errors = self.errors.iter().zip(&needed);
        let is_off = errors.any(|(stated, needed)| (stated / needed - 1.0).abs() > SHARE);
        faults.add(TilesetFault::RootErrors, u64::from(is_off), None);
    }

    /// Stated height range of all tiles of a half of the globe: 0 is the west.
    fn heights_of_half(&self, half: u32) -> Option<[f64; 2]> {
        let tiles = self.metadata.iter().filter(|(id, _)| id.x >> id.level == half);
        tiles.map(|(_, metadata)| metadata.heights).reduce(union)
    }

    /// Lists the files of a set.
    pub(super) fn find(
        &self,
        top: &Path,
        memory: &TilesProofMemory,
        cancel: &Cancel,
    ) -> Result<FolderTiles> {
        let mut tiles = FolderTiles::within(memory);
        for half in entries(top)? {
            let path = half.path();
            let name = half.file_name();
            match HALVES.iter().position(|known| name == *known).filter(|_| path.is_dir()) {
                Some(x) => self.find_half(&mut tiles, &path, x as u32, cancel)?,
                None if name == NAME => (),
                None => tiles.stray(path),
            }
        }
        tiles.sorted(top)
    }

    fn find_half(
        &self,
        tiles: &mut FolderTiles,
        folder: &Path,
        half: u32,
        cancel: &Cancel,
    ) -> Result<()> {
        for level in entries(folder)? {
            let known = number(&level, "").filter(|&level| level <= u32::from(MAX_LEVEL));
            let Some(z) = known.filter(|_| level.path().is_dir()) else {
                tiles.stray(level.path());
                continue;
            };
            for column in entries(&level.path())? {
                cancel.check()?;
                let known = number(&column, "").filter(|x| *x < 1 << z);
                let Some(x) = known.filter(|_| column.path().is_dir()) else {
                    tiles.stray(column.path());
                    continue;
                };
                self.column(tiles, &column.path(), z as u8, x + (half << z))?;
            }
        }
        Ok(())
    }

    fn column(&self, tiles: &mut FolderTiles, folder: &Path, level: u8, x: u32) -> Result<()> {
        for row in entries(folder)? {
            let [tile, subtree] = [TILE, SUBTREE]
                .map(|ending| number(&row, ending).and_then(|y| ProofTileId::new(level, x, y)));
            let path = row.path();
            let is_subtree = subtree.is_some_and(|top| self.subtrees.contains(&top));
            match tile {
                Some(id) if path.is_file() => tiles.add(id),
                _ if is_subtree && path.is_file() => (),
                _ => tiles.stray(path),
            }
        }
        Ok(())
    }
}

/// Union of two height ranges.
fn union(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Whether a stated height range is not the needed one; a half without tiles needs none.
fn differ(stated: [f64; 2], needed: Option<[f64; 2]>) -> bool {
    needed.is_some_and(|needed| (0..2).any(|end| (stated[end] - needed[end]).abs() > METRES))
}

/// Path of a file of a tile.
fn path_of(folder: &Path, id: ProofTileId, ending: &str) -> PathBuf {
    let ProofTileId { level, x, y } = id;
    let half = HALVES[(x >> level) as usize & 1];
    folder.join(format!("{half}/{level}/{}/{y}{ending}", x & ((1 << level) - 1)))
}
