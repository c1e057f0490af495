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

/// Metres that heights of regions may be off by, and parts that errors may: rounding.
const METRES: f64 = 1e-6;
const SHARE: f64 = 1e-6;

/// Metadata of 3D Tiles only.
#[derive(Debug)]
pub(super) struct ThreeTilesCheck {
    /// Metadata of tiles from the subtrees.
    pub(super) about: HashMap<ProofTileId, StatedTileMetadata>,
    /// The tiles at the tops of subtrees.
    pub(super) subtrees: HashSet<ProofTileId>,
    /// Lowest and highest of the regions of the whole and of its halves.
    pub(super) regions: [[f64; 2]; 3],
    /// Errors of the whole, its root and the halves.
    pub(super) errors: [f64; 3],
    pub(super) has_edges: bool,
}

impl ThreeTilesCheck {
    /// Follows the subtrees from the roots on.
    pub(super) fn collect(
        &mut self,
        folder: &Path,
        (levels, schema): (u8, &MetadataSchema),
        most: usize,
        cancel: &Cancel,
    ) -> Result<()> {
        let mut open: Vec<ProofTileId> = [0, 1].map(|x| ProofTileId { level: 0, y: 0, x }).into();
        let mut count = 0;
        while let Some(top) = open.pop() {
            cancel.check()?;
            let path = path_of(folder, top, SUBTREE);
            let (bytes, _) = folder::bytes(&path)?;
            let found = Subtree::read(&bytes, top, levels, schema).map_err(|e| e.in_file(&path))?;
            if top.level + levels > MAX_LEVEL && !found.below.is_empty() {
                return Err(Error::bad_input("leads to levels beyond the last").in_file(&path));
            }
            open.extend(found.below);
            // Of what does not fit all is counted.
            count += found.tiles.len();
            if count <= most {
                self.subtrees.insert(top);
                self.about.extend(found.tiles);
            }
        }
        TilesProofMemory::check(count, most).map_err(|e| e.in_file(folder))
    }

    /// Metadata of a tile.
    pub(super) fn about(&self, id: ProofTileId) -> Option<&StatedTileMetadata> {
        self.about.get(&id)
    }

    /// Reads a tile.
    pub(super) fn read(
        &self,
        folder: &Path,
        id: ProofTileId,
        level: StatedLevel,
        fit: impl FnOnce(usize) -> Result<()>,
    ) -> Result<(DecodedTile, bool)> {
        let path = path_of(folder, id, TILE);
        let said = StatedTileLevel {
            step: level.step,
            lattice: level.lattice.unwrap_or_default(),
            has_edges: self.has_edges,
            skirt: level.skirt,
        };
        let (bytes, is_packed) = folder::bytes(&path)?;
        let read = || GlbTileContent::read(&bytes, fit)?.tile(id, said);
        read().map(|tile| (tile, is_packed)).map_err(|e| e.in_file(&path))
    }

    /// Compares the metadata of each tile with that of its descendants, and checks that regions
    /// contain them.
    pub(super) fn check(&self, faults: &mut TilesetFaults) {
        for (id, about) in &self.about {
            let whole = id.parent().and_then(|parent| Some((parent, self.about(parent)?)));
            if let Some((parent, _)) = whole.filter(|(_, whole)| !whole.holds(about)) {
                faults.add(TilesetFault::Nested, 1, parent);
            }
        }
        let [whole, west, east] = self.regions;
        let both = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let of_half = |x: u32| {
            let tiles = self.about.iter().filter(|(id, _)| id.x >> id.level == x);
            tiles.map(|(_, about)| about.heights).reduce(both)
        };
        let halves = [of_half(0), of_half(1)];
        let needed = halves.into_iter().flatten().reduce(both);
        let is_other = |(told, needed): ([f64; 2], Option<[f64; 2]>)| {
            needed.is_some_and(|needed| (0..2).any(|end| (told[end] - needed[end]).abs() > METRES))
        };
        let is_off =
            [(whole, needed), (west, halves[0]), (east, halves[1])].into_iter().any(is_other);
        faults.add(TilesetFault::Regions, u64::from(is_off), None);
        let worst = self.about.values().map(|about| about.error).fold(ERROR_OF_ROOT, f64::max);
        let needed = [2.0 * worst, 2.0 * worst, worst];
        let is_other = |(told, needed): (&f64, &f64)| (told / needed - 1.0).abs() > SHARE;
        let is_off = self.errors.iter().zip(&needed).any(is_other);
        faults.add(TilesetFault::RootErrors, u64::from(is_off), None);
    }

    /// Looks through the folder of a set for its files.
    pub(super) fn find(
        &self,
        top: &Path,
        room: &TilesProofMemory,
        cancel: &Cancel,
    ) -> Result<FolderTiles> {
        let mut found = FolderTiles::within(room);
        for half in entries(top)? {
            let path = half.path();
            let name = half.file_name();
            match HALVES.iter().position(|known| name == *known).filter(|_| path.is_dir()) {
                Some(x) => self.find_half(&mut found, &path, x as u32, cancel)?,
                None if name == NAME => (),
                None => found.stray(path),
            }
        }
        found.sorted(top)
    }

    fn find_half(
        &self,
        found: &mut FolderTiles,
        folder: &Path,
        half: u32,
        cancel: &Cancel,
    ) -> Result<()> {
        for level in entries(folder)? {
            let known = number(&level, "").filter(|&level| level <= u32::from(MAX_LEVEL));
            let Some(z) = known.filter(|_| level.path().is_dir()) else {
                found.stray(level.path());
                continue;
            };
            for column in entries(&level.path())? {
                cancel.check()?;
                let known = number(&column, "").filter(|x| *x < 1 << z);
                let Some(x) = known.filter(|_| column.path().is_dir()) else {
                    found.stray(column.path());
                    continue;
                };
                self.column(found, &column.path(), (z as u8, x + (half << z)))?;
            }
        }
        Ok(())
    }

    fn column(&self, found: &mut FolderTiles, folder: &Path, (level, x): (u8, u32)) -> Result<()> {
        for row in entries(folder)? {
            let id =
                |ending: &str| number(&row, ending).and_then(|y| ProofTileId::new(level, x, y));
            let path = row.path();
            let is_subtree = id(SUBTREE).is_some_and(|top| self.subtrees.contains(&top));
            match id(TILE) {
                Some(id) if path.is_file() => found.add(id),
                _ if is_subtree && path.is_file() => (),
                _ => found.stray(path),
            }
        }
        Ok(())
    }
}

/// Where a file of a tile is.
fn path_of(folder: &Path, id: ProofTileId, ending: &str) -> PathBuf {
    let ProofTileId { level, x, y } = id;
    let half = HALVES[(x >> level) as usize & 1];
    folder.join(format!("{half}/{level}/{}/{y}{ending}", x & ((1 << level) - 1)))
}
