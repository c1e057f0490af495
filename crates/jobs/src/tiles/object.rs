//! What tasks leave: what was seen of rows of the grid, or tiles with an index at the end.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::folder::Made;
use super::format::Format;
use super::spans::Known;
use crate::plan::damaged_object;
use terrane_base::error::{Error, Result};
use terrane_files::atomic::AtomicFile;
use terrane_tiles::{DEEPEST, Facts, Gathered, TileId, Vector};

/// Numbers of an index for a tile: format, level, column, row, vertices, triangles and bytes as `u32`.
const WHOLE: usize = 7;
/// The largest error, and what 3D Tiles tell: heights, sphere, occlusion point and error, as `f64`.
const REAL: usize = 11;
/// Bytes of an index for a tile.
pub(super) const ENTRY: usize = WHOLE * 4 + REAL * 8;

/// An object that is being written.
pub(super) struct Writer {
    file: AtomicFile,
    path: PathBuf,
    index: Vec<u8>,
}

impl Writer {
    pub(super) fn create(path: &Path) -> Result<Self> {
        let file = AtomicFile::create(path, true)?;
        Ok(Self { file, path: path.to_path_buf(), index: Vec::new() })
    }

    /// Adds bytes as they are.
    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::write(&self.path, e))
    }

    /// Adds a tile.
    pub(super) fn tile(&mut self, made: &Made) -> Result<()> {
        let Made { id, format, largest, vertices, triangles, facts, bytes } = made;
        let (TileId { level, x, y }, size) = (*id, bytes.len() as u32);
        let format = u32::from(*format == Format::ThreeTiles);
        let whole = [format, level.into(), x, y, *vertices, *triangles, size];
        self.index.extend(whole.map(u32::to_le_bytes).as_flattened());
        let mut real = [0.0; REAL];
        real[0] = *largest;
        if let Some(Facts { heights, sphere, occlusion, error, .. }) = facts {
            real[1..3].copy_from_slice(heights);
            real[3..6].copy_from_slice(&sphere.0.0);
            real[6] = sphere.1;
            real[7..10].copy_from_slice(&occlusion.0);
            real[10] = *error;
        }
        self.index.extend(real.map(f64::to_le_bytes).as_flattened());
        self.put(bytes)
    }

    /// Puts the index to the end; returns how many tiles there are.
    pub(super) fn index(&mut self) -> Result<u64> {
        let index = std::mem::take(&mut self.index);
        let count = (index.len() / ENTRY) as u64;
        self.put(&index)?;
        self.put(&count.to_le_bytes())?;
        Ok(count)
    }

    /// Gives the object its name.
    pub(super) fn finish(self) -> Result<()> {
        self.file.commit().map(drop)
    }
}

/// Adds what was seen of rows.
pub(super) fn add_glances(path: &Path, gathered: &mut Gathered) -> Result<()> {
    let bytes = std::fs::read(path).map_err(|e| Error::read(path, e))?;
    let mut left = &bytes[..];
    while !left.is_empty() {
        let glance = gathered.plan().read_glance(&mut left);
        gathered.add(glance.ok_or_else(|| damaged_object(path))?);
    }
    Ok(())
}

/// Adds the tiles of an object to what is known.
pub(super) fn add_known(path: &Path, known: &mut Known) -> Result<()> {
    let index = index(&mut File::open(path).map_err(|e| Error::read(path, e))?, path)?;
    index.iter().for_each(|(made, _)| known.insert(made.id));
    Ok(())
}

/// Hands on all tiles of an object.
pub(super) fn each_tile(path: &Path, mut take: impl FnMut(Made) -> Result<()>) -> Result<()> {
    let fail = |e| Error::read(path, e);
    let mut file = File::open(path).map_err(fail)?;
    let index = index(&mut file, path)?;
    file.rewind().map_err(fail)?;
    let mut file = BufReader::new(file);
    for (made, bytes) in index {
        let mut here = vec![0; bytes as usize];
        file.read_exact(&mut here).map_err(fail)?;
        take(Made { bytes: here, ..made })?;
    }
    Ok(())
}

/// The tiles of an object without their bytes, and how many these are.
fn index(file: &mut File, path: &Path) -> Result<Vec<(Made, u32)>> {
    let fail = |e: io::Error| Error::read(path, e);
    let length = file.metadata().map_err(fail)?.len();
    let damaged = || damaged_object(path);
    let mut count = [0; 8];
    let end = length.checked_sub(8).ok_or_else(damaged)?;
    file.seek(SeekFrom::Start(end)).map_err(fail)?;
    file.read_exact(&mut count).map_err(fail)?;
    let size = u64::from_le_bytes(count).checked_mul(ENTRY as u64);
    let (size, start) =
        size.and_then(|size| Some((size, end.checked_sub(size)?))).ok_or_else(damaged)?;
    file.seek(SeekFrom::Start(start)).map_err(fail)?;
    let mut entries = vec![0; size as usize];
    file.read_exact(&mut entries).map_err(fail)?;
    let found = entries.chunks_exact(ENTRY).map(entry).collect::<Option<Vec<_>>>();
    let found = found.ok_or_else(damaged)?;
    let all: u64 = found.iter().map(|(_, bytes)| u64::from(*bytes)).sum();
    if all == start { Ok(found) } else { Err(damaged()) }
}

fn entry(bytes: &[u8]) -> Option<(Made, u32)> {
    let (whole, real) = bytes.split_at(WHOLE * 4);
    let whole = whole.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
    let whole: [u32; WHOLE] = whole.collect::<Vec<_>>().try_into().ok()?;
    let [format, level, x, y, vertices, triangles, size] = whole;
    let real = real.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
    let real: [f64; REAL] = real.collect::<Vec<_>>().try_into().ok()?;
    let [largest, low, high, cx, cy, cz, radius, ox, oy, oz, error] = real;
    let level = u8::try_from(level).ok().filter(|level| *level <= DEEPEST)?;
    let id = TileId { level, x, y };
    let facts = || Facts {
        id,
        heights: [low, high],
        sphere: (Vector([cx, cy, cz]), radius),
        occlusion: Vector([ox, oy, oz]),
        error,
    };
    let (format, facts) = match format {
        0 => (Format::QuantizedMesh, None),
        1 => (Format::ThreeTiles, Some(facts())),
        _ => return None,
    };
    Some((Made { id, format, largest, vertices, triangles, facts, bytes: Vec::new() }, size))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_come_back_and_torn_objects_are_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("objects/near-0.object");
        std::fs::create_dir(path.parent().unwrap()).unwrap();
        let facts = |i: u32, id: TileId| {
            let part = |k: u32| f64::from(i) / f64::from(k + 7);
            Facts {
                id,
                heights: [part(0), part(1)],
                sphere: (Vector([part(2), part(3), part(4)]), part(5)),
                occlusion: Vector([part(6), part(7), part(8)]),
                error: part(9),
            }
        };
        let made = |i: u32| {
            let id = TileId { level: 9, x: i, y: 7 };
            let format =
                if i.is_multiple_of(2) { Format::QuantizedMesh } else { Format::ThreeTiles };
            Made {
                id,
                format,
                largest: f64::from(i) / 3.0,
                vertices: i + 3,
                triangles: i + 1,
                facts: (format == Format::ThreeTiles).then(|| facts(i, id)),
                bytes: vec![i as u8; i as usize * 5],
            }
        };
        let mut writer = Writer::create(&path).unwrap();
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
        let mut known = Known::default();
        add_known(&path, &mut known).unwrap();
        assert_eq!(known.level(9).count(), 9);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(each_tile(&path, |_| Ok(())).is_err(), "{length}");
        }
    }
}
