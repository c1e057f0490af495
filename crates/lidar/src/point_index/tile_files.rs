//! Points by tile in persistent files: a task writes one, and readers read single tiles.
//!
//! A file has the points of its tiles in order, then an index, and the number of tiles. The index has a
//! checksum of the points of each tile; the reader knows the checksum of the index.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::summary::TileSummary;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_delaunay::SiteWindow;
use terrane_engine::plan::{Digest, damaged_object};
use terrane_files::atomic::AtomicFile;

/// Bytes of a point: x, y and z as `i32`.
pub(crate) const POINT: u64 = 12;
/// Bytes of an index entry of a tile: its number and its point count as `u32`, their bounds and lowest point as
/// `i32`, and their digest.
pub(crate) const ENTRY: u64 = 9 * 4 + Digest::BYTES as u64;

/// A file that is being written.
pub(crate) struct TileFileWriter {
    file: AtomicFile,
    path: PathBuf,
    index: Vec<u8>,
}

impl TileFileWriter {
    /// Creates or replaces the file at `path`.
    pub(crate) fn create(path: &Path) -> Result<Self> {
        let file = AtomicFile::create(path, true)?;
        Ok(Self { file, path: path.to_path_buf(), index: Vec::new() })
    }

    /// Adds the points of a tile, if there are any.
    pub(crate) fn put(&mut self, square: usize, points: &[Point]) -> Result<()> {
        if points.is_empty() {
            return Ok(());
        }
        let bytes = bytes_of(points);
        self.write(&bytes)?;
        let mut summary = TileSummary::EMPTY;
        summary.add(points);
        let TileSummary { window: SiteWindow { low, high }, lowest, .. } = summary;
        let [square, count] = [square, points.len()].map(|n| (n as u32).to_le_bytes());
        self.index.extend([square, count].concat());
        let [box_, lowest] = [[low, high].concat(), vec![lowest.x, lowest.y, lowest.z]];
        self.index.extend(box_.into_iter().chain(lowest).flat_map(i32::to_le_bytes));
        self.index.extend(Digest::of(&bytes).bytes());
        Ok(())
    }

    /// Gives the file its name; returns the digest of its index.
    pub(crate) fn finish(mut self) -> Result<Digest> {
        let index = std::mem::take(&mut self.index);
        let count = index.len() as u64 / ENTRY;
        self.write(&index)?;
        self.write(&count.to_le_bytes())?;
        self.file.commit()?;
        Ok(Digest::of(&index))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::write(&self.path, e))
    }
}

fn bytes_of(points: &[Point]) -> Vec<u8> {
    points.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(i32::to_le_bytes).collect()
}

/// A tile of a file.
#[derive(Clone, Copy, Debug)]
struct PointTileIndexEntry {
    square: u32,
    /// Index of the file.
    file: u32,
    /// Offset of its points in the file.
    start: u64,
    digest: Digest,
    summary: TileSummary,
}

/// The tiles of several files.
#[derive(Debug, Default)]
pub(crate) struct PointTileIndexes {
    files: Vec<PathBuf>,
    /// Sorted by tile, then file.
    entries: Vec<PointTileIndexEntry>,
}

impl PointTileIndexes {
    /// Opens files whose indices have these digests.
    ///
    /// # Errors
    /// Damaged files.
    pub(crate) fn open(files: impl IntoIterator<Item = (PathBuf, Digest)>) -> Result<Self> {
        let mut indexes = Self::default();
        for (path, digest) in files {
            let number = indexes.files.len() as u32;
            indexes.entries.extend(index(&path, digest, number)?);
            indexes.files.push(path);
        }
        indexes.entries.sort_by_key(|entry| (entry.square, entry.file));
        Ok(indexes)
    }

    /// Tiles with points and their summaries; a tile is listed once for each file that has points of it.
    pub(crate) fn squares(&self) -> impl Iterator<Item = (usize, TileSummary)> {
        self.entries.iter().map(|entry| (entry.square as usize, entry.summary))
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(&self.entries[..]) as u64
    }

    /// Reads the points of a tile, file by file.
    pub(crate) fn read(&self, square: usize, mut each: impl FnMut(&[Point])) -> Result<()> {
        let from = self.entries.partition_point(|entry| (entry.square as usize) < square);
        let here = self.entries[from..].iter();
        for entry in here.take_while(|entry| entry.square as usize == square) {
            each(&self.points_of(entry)?);
        }
        Ok(())
    }

    fn points_of(&self, entry: &PointTileIndexEntry) -> Result<Vec<Point>> {
        let path = &self.files[entry.file as usize];
        let mut bytes = vec![0; (entry.summary.count * POINT) as usize];
        let read = File::open(path).and_then(|file| read_at(file, entry.start, &mut bytes));
        read.map_err(|e| Error::read(path, e))?;
        if Digest::of(&bytes) != entry.digest {
            return Err(damaged_object(path));
        }
        let points = words(&bytes).collect::<Vec<_>>();
        Ok(points.chunks_exact(3).map(|p| Point::new(p[0], p[1], p[2])).collect())
    }
}

/// Reads the index of a file.
fn index(path: &Path, digest: Digest, number: u32) -> Result<Vec<PointTileIndexEntry>> {
    let bytes = index_bytes(path).map_err(|e| Error::read(path, e))?;
    let (bytes, end) = bytes.ok_or_else(|| damaged_object(path))?;
    if Digest::of(&bytes) != digest {
        return Err(damaged_object(path));
    }
    let (mut entries, mut start) = (Vec::new(), 0);
    for bytes in bytes.chunks_exact(ENTRY as usize) {
        let entry = entry(bytes, number, start);
        start += entry.summary.count * POINT;
        entries.push(entry);
    }
    if start == end { Ok(entries) } else { Err(damaged_object(path)) }
}

/// The bytes of the index of a file, and where it begins; `None` if it does not fit into the file.
fn index_bytes(path: &Path) -> io::Result<Option<(Vec<u8>, u64)>> {
    let file = File::open(path)?;
    let Some(end) = file.metadata()?.len().checked_sub(8) else { return Ok(None) };
    let mut count = [0; 8];
    read_at(&file, end, &mut count)?;
    let size = u64::from_le_bytes(count).checked_mul(ENTRY);
    let Some(start) = size.and_then(|size| end.checked_sub(size)) else { return Ok(None) };
    let mut bytes = vec![0; (end - start) as usize];
    read_at(&file, start, &mut bytes)?;
    Ok(Some((bytes, start)))
}

fn read_at(mut file: impl Read + Seek, start: u64, bytes: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(start))?;
    file.read_exact(bytes)
}

fn entry(bytes: &[u8], file: u32, start: u64) -> PointTileIndexEntry {
    let (bytes, digest) = bytes.split_at(ENTRY as usize - Digest::BYTES);
    let mut numbers = [0; 9];
    numbers.iter_mut().zip(words(bytes)).for_each(|(number, word)| *number = word);
    let [square, count, west, south, east, north, x, y, z] = numbers;
    let window = SiteWindow { low: [west, south], high: [east, north] };
    let count = u64::from(count.cast_unsigned());
    let summary = TileSummary { count, window, lowest: Point::new(x, y, z) };
    let mut of = [0; Digest::BYTES];
    of.copy_from_slice(digest);
    let square = square.cast_unsigned();
    PointTileIndexEntry { square, file, start, digest: Digest(of), summary }
}

fn words(bytes: &[u8]) -> impl Iterator<Item = i32> {
    bytes.chunks_exact(4).map(|word| i32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(number: i32) -> Vec<Point> {
        (0..number % 7).map(|i| Point::new(number, -i, i * number)).collect()
    }

    fn written(path: &Path, squares: impl Iterator<Item = i32>) -> (PathBuf, Digest) {
        let mut writer = TileFileWriter::create(path).unwrap();
        squares.for_each(|number| writer.put(number as usize, &square(number)).unwrap());
        (path.to_path_buf(), writer.finish().unwrap())
    }

    #[test]
    fn squares_come_back_from_whichever_files_have_them() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name| folder.path().join(name);
        let all = [
            written(&at("a"), (0..40).step_by(2)),
            written(&at("b"), (0..40).step_by(3)),
            written(&at("c"), 0..0),
        ];
        let indexes = PointTileIndexes::open(all).unwrap();
        for number in 0..45 {
            let times = [2, 3].iter().filter(|step| number < 40 && number % **step == 0).count();
            let mut found = Vec::new();
            indexes.read(number as usize, |run| found.extend_from_slice(run)).unwrap();
            assert_eq!(found, square(number).repeat(times), "{number}");
            let known = indexes.squares().filter(|(square, _)| *square == number as usize);
            let known: u64 = known.map(|(_, summary)| summary.count).sum();
            assert_eq!(known, found.len() as u64);
        }
    }

    #[test]
    fn whatever_is_altered_is_found_before_it_is_used() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let (_, digest) = written(&path, 1..9);
        let sound = std::fs::read(&path).unwrap();
        let read = || -> Result<()> {
            let indexes = PointTileIndexes::open([(path.clone(), digest)])?;
            (0..9).try_for_each(|square| indexes.read(square, |_| ()))
        };
        read().unwrap();
        for at in 0..sound.len() {
            let mut bytes = sound.clone();
            bytes[at] ^= 1 << (at % 8);
            std::fs::write(&path, &bytes).unwrap();
            assert!(read().is_err(), "byte {at}");
        }
        for length in 0..sound.len() {
            std::fs::write(&path, &sound[..length]).unwrap();
            assert!(read().is_err(), "{length} bytes");
        }
    }
}
