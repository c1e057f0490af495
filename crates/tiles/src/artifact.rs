//! Task results: the survey of rows of the grid, or tiles with an index at the end.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::available::KnownTiles;
use super::folder::TileFile;
use super::format::TilesFormat;
use terrane_base::error::{Error, Result};
use terrane_engine::plan::damaged_object;
use terrane_files::atomic::AtomicFile;
use terrane_globe::{DEEPEST, GatheredOverview, GlobeTileId, TileMetadata};
use terrane_options::Choice;

/// Size in bytes of an index entry: set, level, column, row, vertices, triangles, number of facts and size as
/// `u32`, largest error as `f64`.
pub(super) const ENTRY: usize = 8 * 4 + 8;
/// Set of a tile without a file.
const NO_SET: u32 = u32::MAX;
/// Values of the 3D Tiles metadata of a tile, stored before its bytes.
pub(super) const FACTS: usize = 10;

/// An object in progress.
pub(super) struct TileArtifactWriter {
    file: AtomicFile,
    path: PathBuf,
    index: Vec<u8>,
}

impl TileArtifactWriter {
    pub(super) fn create(path: &Path) -> Result<Self> {
        let file = AtomicFile::create(path, true)?;
        Ok(Self { file, path: path.to_path_buf(), index: Vec::new() })
    }

    /// Appends bytes.
    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::write(&self.path, e))
    }

    /// Appends a tile.
    pub(super) fn tile(&mut self, made: &TileFile) -> Result<()> {
        let TileFile { set, id, largest, vertices, triangles, facts, bytes } = made;
        let facts = facts.map_or_else(Vec::new, |facts| facts.numbers().to_vec());
        let set = set.map_or(NO_SET, |set| set as u32);
        let level = u32::from(id.level);
        let [count, length] = [facts.len(), bytes.len()].map(|n| n as u32);
        for number in [set, level, id.x, id.y, *vertices, *triangles, count, length] {
            self.index.extend(number.to_le_bytes());
        }
        self.index.extend(largest.to_le_bytes());
        let facts: Vec<u8> = facts.into_iter().flat_map(f64::to_le_bytes).collect();
        self.put(&facts)?;
        self.put(bytes)
    }

    /// Appends the index; returns the number of tiles.
    pub(super) fn index(&mut self) -> Result<u64> {
        let index = std::mem::take(&mut self.index);
        let count = (index.len() / ENTRY) as u64;
        self.put(&index)?;
        self.put(&count.to_le_bytes())?;
        Ok(count)
    }

    /// Renames the object to its final name.
    pub(super) fn finish(self) -> Result<()> {
        self.file.commit().map(drop)
    }
}

/// Appends the survey of rows.
pub(super) fn add_summaries(path: &Path, gathered: &mut GatheredOverview) -> Result<()> {
    let bytes = std::fs::read(path).map_err(|e| Error::read(path, e))?;
    let mut left = &bytes[..];
    while !left.is_empty() {
        let summary = gathered.plan().read_summary(&mut left);
        gathered.add(summary.ok_or_else(|| damaged_object(path))?);
    }
    Ok(())
}

/// Adds the tiles of an object to the known tiles.
pub(super) fn add_known(path: &Path, known: &mut KnownTiles) -> Result<()> {
    let index = index(&mut File::open(path).map_err(|e| Error::read(path, e))?, path)?;
    index.iter().for_each(|entry| known.insert(entry.made.id));
    Ok(())
}

/// Passes on all tiles of an object.
pub(super) fn each_tile(path: &Path, mut take: impl FnMut(TileFile) -> Result<()>) -> Result<()> {
    let fail = |e| Error::read(path, e);
    let mut file = File::open(path).map_err(fail)?;
    let index = index(&mut file, path)?;
    file.rewind().map_err(fail)?;
    let mut file = BufReader::new(file);
    for TileIndexEntry { made, facts, bytes } in index {
        let facts = facts.then(|| read_facts(&mut file, made.id)).transpose().map_err(fail)?;
        let mut here = vec![0; bytes as usize];
        file.read_exact(&mut here).map_err(fail)?;
        take(TileFile { facts, bytes: here, ..made })?;
    }
    Ok(())
}

fn read_facts(from: &mut impl Read, id: GlobeTileId) -> io::Result<TileMetadata> {
    let mut numbers = [0.0; FACTS];
    for number in &mut numbers {
        let mut bytes = [0; 8];
        from.read_exact(&mut bytes)?;
        *number = f64::from_le_bytes(bytes);
    }
    Ok(TileMetadata::of_numbers(id, numbers))
}

/// Index entry of a tile.
struct TileIndexEntry {
    /// Without metadata and bytes.
    made: TileFile,
    facts: bool,
    bytes: u32,
}

impl TileIndexEntry {
    /// Size in bytes of the tile in the object.
    fn stored_bytes(&self) -> u64 {
        u64::from(self.bytes) + if self.facts { 8 * FACTS as u64 } else { 0 }
    }
}

/// Contents of an object's index.
fn index(file: &mut File, path: &Path) -> Result<Vec<TileIndexEntry>> {
    let fail = |e: io::Error| Error::read(path, e);
    let length = file.metadata().map_err(fail)?.len();
    let mut count = [0; 8];
    let end = length.checked_sub(8).ok_or_else(|| damaged_object(path))?;
    file.seek(SeekFrom::Start(end)).map_err(fail)?;
    file.read_exact(&mut count).map_err(fail)?;
    let size = u64::from_le_bytes(count).checked_mul(ENTRY as u64);
    let (size, start) = size
        .and_then(|size| Some((size, end.checked_sub(size)?)))
        .ok_or_else(|| damaged_object(path))?;
    file.seek(SeekFrom::Start(start)).map_err(fail)?;
    let mut entries = vec![0; size as usize];
    file.read_exact(&mut entries).map_err(fail)?;
    let entries = entries.chunks_exact(ENTRY).map(entry).collect::<Option<Vec<_>>>();
    // The tiles fill the object up to its index, so a truncated object is detected.
    entries
        .filter(|entries| entries.iter().map(TileIndexEntry::stored_bytes).sum::<u64>() == start)
        .ok_or_else(|| damaged_object(path))
}

fn entry(bytes: &[u8]) -> Option<TileIndexEntry> {
    let (numbers, largest) = bytes.split_at(ENTRY - 8);
    let numbers: [[u8; 4]; 8] = numbers.as_chunks().0.try_into().ok()?;
    let [set, level, x, y, vertices, triangles, facts, bytes] = numbers.map(u32::from_le_bytes);
    let level = u8::try_from(level).ok().filter(|level| *level <= DEEPEST)?;
    let id = GlobeTileId { level, x, y };
    let largest = f64::from_le_bytes(largest.try_into().ok()?);
    let is_known = set == NO_SET || (set as usize) < TilesFormat::ALL.len();
    let set = (set != NO_SET).then_some(set as usize);
    let made = TileFile { set, id, largest, vertices, triangles, facts: None, bytes: Vec::new() };
    let is_whole = is_known && (facts == 0 || facts as usize == FACTS);
    is_whole.then_some(TileIndexEntry { made, facts: facts > 0, bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_come_back_and_torn_objects_are_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("objects/near-0.object");
        std::fs::create_dir(path.parent().unwrap()).unwrap();
        let id = |i: u32| GlobeTileId { level: 9, x: i, y: 7 };
        let numbers = std::array::from_fn(|k| k as f64 / 7.0);
        let made = |i: u32| TileFile {
            set: (i != 4).then_some(i as usize % 2),
            id: id(i),
            facts: (i % 2 == 1).then(|| TileMetadata::of_numbers(id(i), numbers)),
            largest: f64::from(i) / 3.0,
            vertices: i + 3,
            triangles: i + 1,
            bytes: vec![i as u8; i as usize * 5],
        };
        let mut writer = TileArtifactWriter::create(&path).unwrap();
        (0..9).for_each(|i| writer.tile(&made(i)).unwrap());
        assert_eq!(writer.index().unwrap(), 9);
        writer.finish().unwrap();
        let mut found = Vec::new();
        each_tile(&path, |made| {
            found.push(made);
            Ok(())
        })
        .unwrap();
        assert!(found.into_iter().eq((0..9).map(made)));
        let mut known = KnownTiles::default();
        add_known(&path, &mut known).unwrap();
        assert_eq!(known.level(9).count(), 9);
        let whole = std::fs::read(&path).unwrap();
        // Eight zeros are an object without tiles; its digest detects damage.
        let is_empty = |length: &usize| *length == 8 && whole[..8] == [0; 8];
        for length in (0..whole.len()).filter(|length| !is_empty(length)) {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(each_tile(&path, |_| Ok(())).is_err(), "{length}");
        }
    }
}
