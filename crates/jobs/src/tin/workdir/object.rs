//! The result of one task: a file of containers, tile by tile, that proves itself.
//!
//! | part | bytes |
//! |---|---|
//! | magic | 16 |
//! | a record for each tile, row by row: numbers of its triangles, inner triangles and vertices (3 x u64), then these and the vertices' heights as they are in memory | |
//! | the index: offset, length and digest of each record | 48 each |
//! | the tail: tiles, offset of the index, valid and isolated samples, suspects and their value (u64, f64) | 48 |
//! | the seal: digest of key, index and tail | 32 |
//!
//! All numbers are little-endian. Every byte is under a digest, and the seal alone, the last 32
//! bytes, stands for the whole. What is in the file is a function of the plan, so the seal is the
//! same whoever wrote it and when.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use bytemuck::{Pod, Zeroable};

use crate::Cancel;
use crate::plan::{Digest, damaged_object as damaged};
use crate::tin::container::Container;
use crate::tin::schedule::lock;
use crate::tin::tally::Tally;
use terrane_base::error::{Error, Result};
use terrane_files::atomic::AtomicFile;
use terrane_files::fault::{self, Point};

const MAGIC: &[u8; 16] = b"terrane object 1";
/// Bytes of the numbers that a record begins with.
const RECORD_HEAD: u64 = 24;
const _: () = assert!(cfg!(target_endian = "little"), "records are written as they are in memory");

/// Where a record lies.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Entry {
    offset: u64,
    len: u64,
    digest: [u8; 32],
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Tail {
    tiles: u64,
    index: u64,
    valid: u64,
    isolated: u64,
    suspects: u64,
    suspect: f64,
}

impl Tail {
    fn tally(&self) -> Tally {
        let suspects = (self.suspects > 0).then_some((self.suspect, self.suspects));
        Tally { valid: self.valid, isolated: self.isolated, suspects }
    }
}

/// Bytes of an object whose containers take `kept` bytes in memory.
pub(super) fn object_bytes(kept: u64, tiles: u64) -> u64 {
    let end = size_of::<Tail>() + size_of::<Digest>() + MAGIC.len();
    kept + tiles * (size_of::<Entry>() as u64 + RECORD_HEAD) + end as u64
}

/// A container as bytes, with their digest.
#[derive(Debug)]
pub(in crate::tin) struct Record {
    bytes: Vec<u8>,
    digest: Digest,
}

impl Record {
    /// Of a settled container.
    pub(in crate::tin) fn of(container: &Container) -> Self {
        let bytes = container.to_bytes();
        let digest = Digest::of(&bytes);
        Self { bytes, digest }
    }

    /// Bytes held.
    pub(in crate::tin) fn len(&self) -> u64 {
        self.bytes.len() as u64
    }
}

/// An object in the making; dropped unfinished it leaves nothing.
pub(in crate::tin) struct ObjectWriter {
    path: PathBuf,
    key: Digest,
    file: BufWriter<AtomicFile>,
    offset: u64,
    index: Vec<Entry>,
}

impl ObjectWriter {
    /// Starts the object `key` at `path`.
    pub(super) fn create(path: &Path, key: Digest) -> Result<Self> {
        let file = BufWriter::with_capacity(1 << 18, AtomicFile::create(path, true)?);
        let mut writer = Self { path: path.to_path_buf(), key, file, offset: 0, index: Vec::new() };
        writer.write(MAGIC)?;
        Ok(writer)
    }

    /// Appends the next tile's record.
    pub(in crate::tin) fn push(&mut self, record: &Record) -> Result<()> {
        let Record { bytes, digest } = record;
        self.index.push(Entry { offset: self.offset, len: record.len(), digest: digest.0 });
        self.write(bytes)
    }

    /// Puts the whole object at its place; returns its seal and size.
    pub(in crate::tin) fn finish(mut self, tally: Tally) -> Result<(Digest, u64)> {
        let (suspect, suspects) = tally.suspects.unwrap_or_default();
        let Tally { valid, isolated, .. } = tally;
        let tiles = self.index.len() as u64;
        let tail = Tail { tiles, index: self.offset, valid, isolated, suspects, suspect };
        let index = std::mem::take(&mut self.index);
        let seal = seal(self.key, &index, &tail);
        self.write(bytemuck::cast_slice(&index))?;
        self.write(bytemuck::bytes_of(&tail))?;
        self.write(&seal.0)?;
        let file = self.file.into_inner().map_err(|e| Error::write(&self.path, e.into_error()))?;
        Ok((seal, file.commit()?))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.offset += bytes.len() as u64;
        self.file.write_all(bytes).map_err(|e| Error::write(&self.path, e))
    }
}

fn seal(key: Digest, index: &[Entry], tail: &Tail) -> Digest {
    Digest::of_parts(&[&key.0, bytemuck::cast_slice(index), bytemuck::bytes_of(tail)])
}

/// A finished object.
pub(in crate::tin) struct Object {
    path: PathBuf,
    file: Mutex<File>,
    index: Vec<Entry>,
    pub(super) tally: Tally,
    pub(super) seal: Digest,
    pub(super) bytes: u64,
}

impl Object {
    /// Opens the object `key` of `tiles` tiles at `path`. Its index and tail are checked, its
    /// records when they are read. Fails with the kind `Io` when it is damaged.
    pub(super) fn open(path: &Path, key: Digest, tiles: u64) -> Result<Self> {
        let fail = |e| Error::read(path, e);
        let mut file = File::open(path).map_err(fail)?;
        let bytes = file.metadata().map_err(fail)?.len();
        let damaged = || damaged(path);
        let tail_len = (size_of::<Tail>() + size_of::<Digest>()) as u64;
        let index_len = tiles * size_of::<Entry>() as u64;
        let index_at = bytes.checked_sub(tail_len + index_len).ok_or_else(damaged)?;
        let mut end = vec![0; (index_len + tail_len) as usize];
        read_at(&mut file, &mut end, index_at).map_err(fail)?;
        let (index, rest) = end.split_at(index_len as usize);
        let (tail, sealed) = rest.split_at(size_of::<Tail>());
        let index: Vec<Entry> = bytemuck::allocation::pod_collect_to_vec(index);
        let tail: Tail = bytemuck::pod_read_unaligned(tail);
        let seal = seal(key, &index, &tail);
        let is_inside =
            |entry: &Entry| entry.offset.checked_add(entry.len).is_some_and(|end| end <= index_at);
        if seal.0 != sealed
            || (tail.tiles, tail.index) != (tiles, index_at)
            || !index.iter().all(is_inside)
        {
            return Err(damaged());
        }
        let (path, file) = (path.to_path_buf(), Mutex::new(file));
        Ok(Self { path, file, index, tally: tail.tally(), seal, bytes })
    }

    /// Reads the container of the tile at `position`.
    pub(super) fn read(&self, position: u64) -> Result<Container> {
        let entry = self.index.get(position as usize).ok_or_else(|| damaged(&self.path))?;
        let bytes = self.record(entry)?;
        Container::of_bytes(&bytes).ok_or_else(|| damaged(&self.path))
    }

    /// Reads everything once and fails when a byte is not what it was.
    pub(super) fn check(&self, cancel: &Cancel) -> Result<()> {
        let mut magic = [0; MAGIC.len()];
        self.read_at(&mut magic, 0)?;
        if &magic != MAGIC {
            return Err(damaged(&self.path));
        }
        self.index.iter().try_for_each(|entry| {
            cancel.check()?;
            self.record(entry).map(drop)
        })
    }

    fn record(&self, entry: &Entry) -> Result<Vec<u8>> {
        let mut bytes = vec![0; entry.len as usize];
        self.read_at(&mut bytes, entry.offset)?;
        if Digest::of(&bytes).0 != entry.digest { Err(damaged(&self.path)) } else { Ok(bytes) }
    }

    fn read_at(&self, out: &mut [u8], offset: u64) -> Result<()> {
        read_at(&mut lock(&self.file), out, offset).map_err(|e| Error::read(&self.path, e))
    }
}

fn read_at(file: &mut File, out: &mut [u8], offset: u64) -> io::Result<()> {
    fault::point(Point::Read)?;
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_beyond_the_file_are_damage_whatever_the_seal_says() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.object");
        let key = Digest::of(b"key");
        for (offset, len) in [(16, 0), (16, 1), (0, u64::MAX >> 1), (u64::MAX, 2)] {
            let index = [Entry { offset, len, digest: Digest::of(b"").0 }];
            let tail = Tail { tiles: 1, index: 16, ..Tail::zeroed() };
            let seal = seal(key, &index, &tail);
            let parts = [MAGIC, bytemuck::cast_slice(&index), bytemuck::bytes_of(&tail), &seal.0];
            std::fs::write(&path, parts.concat()).unwrap();
            let checked = Object::open(&path, key, 1).and_then(|o| o.check(&Cancel::default()));
            assert_eq!(checked.is_ok(), len == 0, "{len} bytes at {offset}");
        }
    }
}
