//! The object of a task of a mesh: a file of containers, tile by tile, any of which can be read alone.
//!
//! | part | bytes |
//! |---|---|
//! | magic | 16 |
//! | a record for each tile, row by row: numbers of its triangles, inner triangles and vertices (3 x u64), then these and the vertices' heights as they are in memory | |
//! | the index: offset, length and digest of each record | 48 each |
//!
//! All numbers are little-endian. The digest of the index is stored beside the file, so each record is verified
//! without reading the rest.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use super::container::TileContainer;
use super::counters::SampleCounts;
use terrane_base::error::{Error, Result};
use terrane_engine::plan::{Digest, damaged_object as damaged};
use terrane_files::atomic::AtomicFile;
use terrane_files::fault::{self, FaultPoint};
use terrane_files::lock;

const MAGIC: &[u8; 16] = b"terrane object 2";
/// Bytes of the header of a record.
const RECORD_HEAD: u64 = 24;
const _: () = assert!(cfg!(target_endian = "little"), "records are written as they are in memory");

/// Offset, length and digest of a record.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct RecordIndexEntry {
    offset: u64,
    len: u64,
    digest: [u8; 32],
}

/// Metadata of an object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TinArtifactFacts {
    /// Digest of the index.
    pub(super) index: Digest,
    #[serde(flatten)]
    pub(super) tally: SampleCounts,
}

/// Bytes of an object whose containers take `container_bytes` bytes in memory.
pub(super) fn object_bytes(container_bytes: u64, tiles: u64) -> u64 {
    container_bytes
        + tiles * (size_of::<RecordIndexEntry>() as u64 + RECORD_HEAD)
        + MAGIC.len() as u64
}

/// A container as bytes, with their digest.
#[derive(Debug)]
pub(super) struct ContainerRecord {
    bytes: Vec<u8>,
    digest: Digest,
}

impl ContainerRecord {
    /// Of a settled container.
    pub(super) fn of(container: &TileContainer) -> Self {
        let bytes = container.to_bytes();
        let digest = Digest::of(&bytes);
        Self { bytes, digest }
    }

    /// Bytes held.
    pub(super) fn len(&self) -> u64 {
        self.bytes.len() as u64
    }
}

/// Writes an object; leaves no file if dropped unfinished.
pub(super) struct ArtifactWriter {
    path: PathBuf,
    file: BufWriter<AtomicFile>,
    /// Hash of all bytes written.
    hasher: blake3::Hasher,
    offset: u64,
    index: Vec<RecordIndexEntry>,
}

impl ArtifactWriter {
    /// Starts the object at `path`.
    pub(super) fn create(path: &Path) -> Result<Self> {
        let file = BufWriter::with_capacity(1 << 18, AtomicFile::create(path, true)?);
        let (path, hasher) = (path.to_path_buf(), blake3::Hasher::new());
        let mut writer = Self { path, file, hasher, offset: 0, index: Vec::new() };
        writer.write(MAGIC)?;
        Ok(writer)
    }

    /// Appends the next tile's record.
    pub(super) fn push(&mut self, record: &ContainerRecord) -> Result<()> {
        let ContainerRecord { bytes, digest } = record;
        self.index.push(RecordIndexEntry {
            offset: self.offset,
            len: record.len(),
            digest: digest.0,
        });
        self.write(bytes)
    }

    /// Moves the finished object to its path; returns its metadata and the digest of its bytes.
    pub(super) fn finish(mut self, tally: SampleCounts) -> Result<(TinArtifactFacts, Digest)> {
        let index = std::mem::take(&mut self.index);
        let bytes: &[u8] = bytemuck::cast_slice(&index);
        self.write(bytes)?;
        // A buffer that is dropped swallows the error of its last write.
        let file = self.file.into_inner().map_err(|e| Error::write(&self.path, e.into_error()))?;
        file.commit()?;
        let digest = Digest(*self.hasher.finalize().as_bytes());
        Ok((TinArtifactFacts { index: Digest::of(bytes), tally }, digest))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.offset += bytes.len() as u64;
        self.hasher.update(bytes);
        self.file.write_all(bytes).map_err(|e| Error::write(&self.path, e))
    }
}

/// A finished object.
pub(super) struct ArtifactFile {
    path: PathBuf,
    file: Mutex<File>,
    index: Vec<RecordIndexEntry>,
}

impl ArtifactFile {
    /// Opens the object of `tiles` tiles at `path`, whose index has that digest. Fails with the kind
    /// `Io` when it is damaged.
    pub(super) fn open(path: PathBuf, index: Digest, tiles: u64) -> Result<Self> {
        let fail = |e| Error::read(&path, e);
        let mut file = File::open(&path).map_err(fail)?;
        let bytes = file.metadata().map_err(fail)?.len();
        let len = tiles * size_of::<RecordIndexEntry>() as u64;
        let offset = bytes.checked_sub(len).ok_or_else(|| damaged(&path))?;
        let mut end = vec![0; len as usize];
        read_at(&mut file, &mut end, offset).map_err(fail)?;
        if Digest::of(&end) != index {
            return Err(damaged(&path));
        }
        let index: Vec<RecordIndexEntry> = bytemuck::allocation::pod_collect_to_vec(&end);
        let mut ends = index.iter().map(|entry| entry.offset.checked_add(entry.len));
        match ends.all(|end| end.is_some_and(|end| end <= offset)) {
            true => Ok(Self { path, file: Mutex::new(file), index }),
            false => Err(damaged(&path)),
        }
    }

    /// Reads the container of the tile at `position`.
    pub(super) fn read(&self, position: u64) -> Result<TileContainer> {
        let entry = self.index.get(position as usize).ok_or_else(|| damaged(&self.path))?;
        let mut bytes = vec![0; entry.len as usize];
        read_at(&mut lock(&self.file), &mut bytes, entry.offset)
            .map_err(|e| Error::read(&self.path, e))?;
        if Digest::of(&bytes).0 != entry.digest {
            return Err(damaged(&self.path));
        }
        TileContainer::of_bytes(&bytes).ok_or_else(|| damaged(&self.path))
    }
}

fn read_at(file: &mut File, out: &mut [u8], offset: u64) -> io::Result<()> {
    fault::point(FaultPoint::Read)?;
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_beyond_the_file_are_damage_whatever_the_digest_says() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.object");
        for (offset, len) in [(16, 0), (16, 1), (0, u64::MAX >> 1), (u64::MAX, 2)] {
            let index = [RecordIndexEntry { offset, len, digest: Digest::of(b"").0 }];
            let index: &[u8] = bytemuck::cast_slice(&index);
            std::fs::write(&path, [MAGIC, index].concat()).unwrap();
            let opened = ArtifactFile::open(path.clone(), Digest::of(index), 1);
            assert_eq!(opened.is_ok(), len == 0, "{len} bytes at {offset}");
        }
    }
}
