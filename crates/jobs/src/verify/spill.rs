//! Records sorted into numbered buckets through one temporary file, in bounded memory.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use bytemuck::Pod;

use terrane_base::error::{Error, Result};
use terrane_files::atomic::plain;
use terrane_files::lock;

/// Bytes read at a time.
const READ_BYTES: usize = 64 << 10;

/// A run of records of one bucket in the file.
#[derive(Clone, Copy, Debug)]
struct Extent {
    offset: u64,
    records: u32,
}

/// Buckets of records. Memory: 16 bytes per run of records that were flushed together.
#[derive(Debug)]
pub(super) struct Spill<T> {
    folder: PathBuf,
    file: Mutex<(File, u64)>,
    extents: Mutex<Vec<Vec<Extent>>>,
    records: PhantomData<T>,
}

impl<T: Pod> Spill<T> {
    /// Empty buckets `0 .. buckets`, in a nameless file in `folder`.
    pub(super) fn new(folder: &Path, buckets: u64) -> Result<Self> {
        let file = tempfile::tempfile_in(folder).map_err(|e| Error::write(folder, plain(e)))?;
        Ok(Self {
            folder: folder.to_path_buf(),
            file: Mutex::new((file, 0)),
            extents: Mutex::new(vec![Vec::new(); buckets as usize]),
            records: PhantomData,
        })
    }

    /// A writer that holds up to about `bytes` of records before it flushes them.
    pub(super) fn writer(&self, bytes: u64) -> Writer<'_, T> {
        let each = 2 * size_of::<T>() + 2 * size_of::<u64>();
        let capacity = (bytes as usize / each).clamp(64, u32::MAX as usize);
        Writer { spill: self, capacity, records: Vec::new(), order: Vec::new(), sorted: Vec::new() }
    }

    /// Number of records in a bucket.
    pub(super) fn len(&self, bucket: u64) -> u64 {
        let extents = lock(&self.extents);
        extents[bucket as usize].iter().map(|extent| u64::from(extent.records)).sum()
    }

    /// Bytes written so far.
    pub(super) fn bytes(&self) -> u64 {
        lock(&self.file).1
    }

    /// Calls `visit` with all records of a bucket, a few at a time.
    pub(super) fn read(&self, bucket: u64, mut visit: impl FnMut(&[T])) -> Result<()> {
        let extents = lock(&self.extents)[bucket as usize].clone();
        let most = READ_BYTES / size_of::<T>();
        let mut piece = vec![T::zeroed(); most];
        for Extent { mut offset, records } in extents {
            let mut left = records as usize;
            while left > 0 {
                let piece = &mut piece[..left.min(most)];
                let bytes = bytemuck::cast_slice_mut(piece);
                self.read_at(offset, bytes).map_err(|e| Error::read(&self.folder, e))?;
                offset += bytes.len() as u64;
                left -= piece.len();
                visit(piece);
            }
        }
        Ok(())
    }

    fn read_at(&self, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
        let (file, _) = &mut *lock(&self.file);
        file.seek(SeekFrom::Start(offset))?;
        file.read_exact(bytes)
    }

    fn append(&self, bytes: &[u8]) -> Result<u64> {
        let (file, end) = &mut *lock(&self.file);
        let start = *end;
        let written = file.seek(SeekFrom::Start(start)).and_then(|_| file.write_all(bytes));
        written
            .map_err(|e| Error::write(&self.folder, e).remedy("free space or set --temp-dir"))?;
        *end += bytes.len() as u64;
        Ok(start)
    }
}

/// Collects records of one thread. Call [`finish`](Writer::finish) at the end.
pub(super) struct Writer<'a, T> {
    spill: &'a Spill<T>,
    capacity: usize,
    records: Vec<T>,
    /// Bucket and record number.
    order: Vec<(u64, u32)>,
    sorted: Vec<T>,
}

impl<T: Pod> Writer<'_, T> {
    /// Adds a record to a bucket.
    pub(super) fn push(&mut self, bucket: u64, record: T) -> Result<()> {
        if self.records.len() >= self.capacity {
            self.flush()?;
        }
        self.order.push((bucket, self.records.len() as u32));
        self.records.push(record);
        Ok(())
    }

    /// Writes what is left.
    pub(super) fn finish(mut self) -> Result<()> {
        self.flush()
    }

    fn flush(&mut self) -> Result<()> {
        self.order.sort_unstable();
        self.sorted.clear();
        self.sorted.extend(self.order.iter().map(|&(_, i)| self.records[i as usize]));
        let mut offset = self.spill.append(bytemuck::cast_slice(&self.sorted))?;
        let mut extents = lock(&self.spill.extents);
        for group in self.order.chunk_by(|a, b| a.0 == b.0) {
            extents[group[0].0 as usize].push(Extent { offset, records: group.len() as u32 });
            offset += (group.len() * size_of::<T>()) as u64;
        }
        self.order.clear();
        self.records.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_record_comes_back_from_its_bucket() {
        let folder = tempfile::tempdir().unwrap();
        let spill = Spill::<u64>::new(folder.path(), 7).unwrap();
        let mut writers = [spill.writer(0), spill.writer(1 << 20)];
        for value in 0..10_000u64 {
            writers[value as usize % 2].push(value * value % 7, value).unwrap();
        }
        writers.into_iter().for_each(|w| w.finish().unwrap());
        for bucket in 0..7 {
            let mut found = Vec::new();
            spill.read(bucket, |records| found.extend_from_slice(records)).unwrap();
            found.sort_unstable();
            let expected: Vec<u64> = (0..10_000).filter(|v| v * v % 7 == bucket).collect();
            assert_eq!(spill.len(bucket), expected.len() as u64);
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = Spill::<u64>::new(Path::new("/no/such/folder"), 1).unwrap_err();
        assert_eq!(error.path(), Some(Path::new("/no/such/folder")));
    }
}
