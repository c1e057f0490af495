//! Lists the tiles of a folder, and reads one tile.

use std::fs::{DirEntry, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use flate2::bufread::GzDecoder;

use super::memory_shares::TilesProofMemory;
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_engine::Cancel;
use terrane_proof::tiles::{DecodedTile, MAX_LEVEL, ProofTileId};

/// The name of the file that describes a set.
pub(super) const NAME: &str = "layer.json";

/// The ending of tiles.
const ENDING: &str = ".terrain";

/// The first bytes of a file packed with gzip.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Limit of the bytes of a tile, packed or not.
const MAX_BYTES: u64 = 64 << 20;

/// The tiles of a folder.
#[derive(Debug, Default)]
pub(super) struct FolderTiles {
    /// Sorted.
    pub(super) all: Vec<ProofTileId>,
    /// Number of tiles, including those beyond the limit.
    count: usize,
    max_count: usize,
    /// Number of other files.
    pub(super) strays: u64,
    /// The first other file by name.
    pub(super) first_stray: Option<PathBuf>,
}

impl FolderTiles {
    /// Empty list with a limit by memory.
    pub(super) fn within(memory: &TilesProofMemory) -> Self {
        Self { max_count: memory.tiles(), ..Self::default() }
    }

    /// Lists the tiles of a folder, within a limit by memory.
    pub(super) fn find(folder: &Path, memory: &TilesProofMemory, cancel: &Cancel) -> Result<Self> {
        let mut tiles = Self::within(memory);
        for level in entries(folder)? {
            let path = level.path();
            match number(&level, "").filter(|&level| level <= u32::from(MAX_LEVEL)) {
                Some(level) if path.is_dir() => tiles.level(&path, level as u8, cancel)?,
                _ if level.file_name() == NAME => (),
                _ => tiles.stray(path),
            }
        }
        tiles.sorted(folder)
    }

    fn level(&mut self, folder: &Path, level: u8, cancel: &Cancel) -> Result<()> {
        for column in entries(folder)? {
            cancel.check()?;
            let path = column.path();
            match number(&column, "").filter(|_| path.is_dir()) {
                Some(x) => self.column(&path, level, x)?,
                None => self.stray(path),
            }
        }
        Ok(())
    }

    fn column(&mut self, folder: &Path, level: u8, x: u32) -> Result<()> {
        for row in entries(folder)? {
            let id = number(&row, ENDING).and_then(|y| ProofTileId::new(level, x, y));
            match id.filter(|_| row.path().is_file()) {
                Some(id) => self.add(id),
                None => self.stray(row.path()),
            }
        }
        Ok(())
    }

    /// Beyond the limit, tiles are only counted.
    pub(super) fn add(&mut self, id: ProofTileId) {
        self.count += 1;
        if self.count <= self.max_count {
            self.all.push(id);
        }
    }

    /// The tiles in order.
    ///
    /// # Errors
    /// More tiles in a folder than fit into memory.
    pub(super) fn sorted(mut self, folder: &Path) -> Result<Self> {
        TilesProofMemory::check(self.count, self.max_count).map_err(|e| e.in_file(folder))?;
        self.all.sort_unstable();
        Ok(self)
    }

    pub(super) fn stray(&mut self, path: PathBuf) {
        self.strays += 1;
        self.first_stray = self.first_stray.take().into_iter().chain([path]).min();
    }

    /// The index of a tile in the list.
    pub(super) fn number_of(&self, id: ProofTileId) -> Option<usize> {
        self.all.binary_search(&id).ok()
    }

    /// The tiles of a level, as indices.
    pub(super) fn of_level(&self, level: u8) -> std::ops::Range<usize> {
        let first = self.all.partition_point(|id| id.level < level);
        first..self.all.partition_point(|id| id.level <= level)
    }
}

pub(super) fn entries(folder: &Path) -> Result<Vec<DirEntry>> {
    let all = std::fs::read_dir(folder).and_then(Iterator::collect);
    all.map_err(|e| Error::read(folder, e))
}

/// The number in a file name, before its ending; only in its shortest form (`7`, not `07`).
pub(super) fn number(entry: &DirEntry, ending: &str) -> Option<u32> {
    let name = entry.file_name();
    let digits = name.to_str()?.strip_suffix(ending)?;
    digits.parse().ok().filter(|number: &u32| number.to_string() == digits)
}

/// Path of a tile.
pub(super) fn path_of(folder: &Path, id: ProofTileId) -> PathBuf {
    folder.join(format!("{id}{ENDING}"))
}

/// Reads a tile, and whether its file is packed. `check_vertices` is called with the number of vertices before memory is
/// allocated for them.
///
/// # Errors
/// Files that cannot be read, are too large, are not gzip or have trailing bytes, and errors of
/// [`DecodedTile::read`].
pub(super) fn read(
    folder: &Path,
    id: ProofTileId,
    check_vertices: impl FnOnce(usize) -> Result<()>,
) -> Result<(DecodedTile, bool)> {
    let path = path_of(folder, id);
    let (bytes, is_packed) = bytes(&path)?;
    let tile = DecodedTile::read(&bytes, check_vertices).map_err(|e| e.in_file(&path))?;
    Ok((tile, is_packed))
}

/// The bytes of a file, unpacked, and whether they are packed in it.
pub(super) fn bytes(path: &Path) -> Result<(Vec<u8>, bool)> {
    let file = File::open(path).map_err(|e| Error::read(path, e))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::read(path, e))?;
    limits::check("length of the tile", bytes.len() as u64, MAX_BYTES)
        .map_err(|e| e.in_file(path))?;
    match bytes.starts_with(&GZIP) {
        true => Ok((unpacked(&bytes).map_err(|e| e.in_file(path))?, true)),
        false => Ok((bytes, false)),
    }
}

/// Decompresses a gzip file of one member.
fn unpacked(packed: &[u8]) -> Result<Vec<u8>> {
    let (mut unpacker, mut bytes) = (GzDecoder::new(packed), Vec::new());
    let read = (&mut unpacker).take(MAX_BYTES + 1).read_to_end(&mut bytes);
    limits::check("length of the unpacked tile", bytes.len() as u64, MAX_BYTES)?;
    match read {
        Ok(_) if unpacker.get_ref().is_empty() => Ok(bytes),
        Ok(_) => Err(Error::bad_input("gzip data is followed by further bytes")),
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            let length = packed.len();
            Err(Error::bad_input(format!("truncated: the gzip data ends after {length} bytes")))
        }
        Err(e) => Err(Error::bad_input(format!("invalid gzip data: {e}"))),
    }
}
