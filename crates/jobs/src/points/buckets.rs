//! Records in numbered buckets: in memory while their budget lasts, beyond it in a nameless file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use bytemuck::Pod;

use terrane_base::error::{Error, Result};
use terrane_files::atomic::plain;
use terrane_files::{fault, lock};

/// Most records of a chunk in memory; the first chunk of a bucket is small.
const CHUNK: usize = 4096;
/// Records of a bucket's first chunk.
const FIRST_CHUNK: usize = 64;
/// Records read from the file at a time.
const PIECE: usize = 16 << 10;

/// A run of records of one bucket in the file.
#[derive(Clone, Copy, Debug)]
struct Extent {
    offset: u64,
    records: usize,
}

#[derive(Debug)]
struct Bucket<T> {
    chunks: Vec<Vec<T>>,
    extents: Vec<Extent>,
}

impl<T> Default for Bucket<T> {
    fn default() -> Self {
        Self { chunks: Vec::new(), extents: Vec::new() }
    }
}

impl<T: Pod> Bucket<T> {
    /// Adds records; returns the bytes of memory taken for them.
    fn push(&mut self, mut run: &[T]) -> usize {
        let mut taken = 0;
        while !run.is_empty() {
            let free = self.chunks.last().map_or(0, |chunk| chunk.capacity() - chunk.len());
            if free == 0 {
                let twice = self.chunks.last().map_or(FIRST_CHUNK, |chunk| 2 * chunk.len());
                let chunk = Vec::with_capacity(twice.max(run.len()).min(CHUNK));
                taken += chunk.capacity() * size_of::<T>();
                self.chunks.push(chunk);
                continue;
            }
            let (now, later) = run.split_at(free.min(run.len()));
            self.chunks.last_mut().into_iter().for_each(|chunk| chunk.extend_from_slice(now));
            run = later;
        }
        taken
    }

    fn bytes(&self) -> u64 {
        self.chunks.iter().map(|chunk| (chunk.capacity() * size_of::<T>()) as u64).sum()
    }
}

/// Buckets of records that any thread adds to and any thread reads. The order of the records of a
/// bucket depends on the threads: whoever reads them sorts them.
#[derive(Debug)]
pub(crate) struct Buckets<T> {
    folder: PathBuf,
    /// Bytes of records that may be in memory.
    budget: u64,
    held: AtomicU64,
    buckets: Vec<Mutex<Bucket<T>>>,
    /// The bucket that leaves memory next.
    next: AtomicUsize,
    file: Mutex<Option<File>>,
    end: AtomicU64,
}

impl<T: Pod> Buckets<T> {
    /// Empty buckets `0 .. count`, which hold about `budget` bytes in memory and the rest in a
    /// nameless file in `folder`.
    pub(crate) fn new(folder: &Path, count: usize, budget: u64) -> Self {
        Self {
            folder: folder.to_path_buf(),
            budget,
            held: AtomicU64::new(0),
            buckets: (0..count).map(|_| Mutex::default()).collect(),
            next: AtomicUsize::new(0),
            file: Mutex::new(None),
            end: AtomicU64::new(0),
        }
    }

    /// Adds a run of records to a bucket.
    pub(crate) fn push(&self, bucket: usize, run: &[T]) -> Result<()> {
        let taken = lock(&self.buckets[bucket]).push(run) as u64;
        if taken > 0 && self.held.fetch_add(taken, Ordering::Relaxed) + taken > self.budget {
            self.relieve()?;
        }
        Ok(())
    }

    /// Writes buckets to the file, one after the other, until a quarter of the budget is free.
    fn relieve(&self) -> Result<()> {
        for _ in 0..self.buckets.len() {
            if self.held.load(Ordering::Relaxed) <= self.budget / 4 * 3 {
                break;
            }
            let next = self.next.fetch_add(1, Ordering::Relaxed) % self.buckets.len();
            self.spill(&mut lock(&self.buckets[next]))?;
        }
        Ok(())
    }

    fn spill(&self, bucket: &mut Bucket<T>) -> Result<()> {
        let bytes = bucket.bytes();
        if bytes == 0 {
            return Ok(());
        }
        let records = bucket.chunks.iter().map(Vec::len).sum();
        let offset = self.append(&bucket.chunks, records)?;
        bucket.extents.push(Extent { offset, records });
        bucket.chunks = Vec::new();
        self.held.fetch_sub(bytes, Ordering::Relaxed);
        Ok(())
    }

    /// Writes chunks at the end of the file, and returns where.
    fn append(&self, chunks: &[Vec<T>], records: usize) -> Result<u64> {
        let mut file = lock(&self.file);
        let offset = self.end.load(Ordering::Relaxed);
        let written = self.write_at(&mut file, offset, chunks);
        written.map_err(|e| {
            Error::write(&self.folder, plain(e)).remedy("free some space, or set --temp-dir")
        })?;
        self.end.store(offset + (records * size_of::<T>()) as u64, Ordering::Relaxed);
        Ok(offset)
    }

    fn write_at(&self, file: &mut Option<File>, at: u64, chunks: &[Vec<T>]) -> io::Result<()> {
        fault::point(fault::Point::Write)?;
        let mut made = match file.take() {
            Some(made) => made,
            None => tempfile::tempfile_in(&self.folder)?,
        };
        made.seek(SeekFrom::Start(at))?;
        chunks.iter().try_for_each(|chunk| made.write_all(bytemuck::cast_slice(chunk)))?;
        *file = Some(made);
        Ok(())
    }

    /// Hands on all records of a bucket, a run at a time: in the order in which one thread added
    /// them, else in one that means nothing.
    pub(crate) fn read(&self, bucket: usize, mut each: impl FnMut(&[T])) -> Result<()> {
        let bucket = lock(&self.buckets[bucket]);
        let mut piece = Vec::new();
        for &Extent { offset, records } in &bucket.extents {
            for first in (0..records).step_by(PIECE) {
                piece.resize(PIECE.min(records - first), T::zeroed());
                let at = offset + (first * size_of::<T>()) as u64;
                self.read_at(at, bytemuck::cast_slice_mut(&mut piece))
                    .map_err(|e| Error::read(&self.folder, e))?;
                each(&piece);
            }
        }
        // What is in memory came later.
        bucket.chunks.iter().for_each(|chunk| each(chunk));
        Ok(())
    }

    /// Fills `out` with the records of a bucket from number `first` on, in the order of
    /// [`read`](Self::read); returns how many there were.
    pub(crate) fn read_from(
        &self,
        bucket: usize,
        mut first: usize,
        out: &mut [T],
    ) -> Result<usize> {
        let bucket = lock(&self.buckets[bucket]);
        let mut filled = 0;
        for &Extent { offset, records } in &bucket.extents {
            let count = records.saturating_sub(first).min(out.len() - filled);
            if count > 0 {
                let at = offset + (first * size_of::<T>()) as u64;
                let bytes = bytemuck::cast_slice_mut(&mut out[filled..filled + count]);
                self.read_at(at, bytes).map_err(|e| Error::read(&self.folder, e))?;
            }
            filled += count;
            first = first.saturating_sub(records);
        }
        for chunk in &bucket.chunks {
            let rest = chunk.get(first..).unwrap_or_default();
            let count = rest.len().min(out.len() - filled);
            out[filled..filled + count].copy_from_slice(&rest[..count]);
            filled += count;
            first = first.saturating_sub(chunk.len());
        }
        Ok(filled)
    }

    /// Forgets the records of a bucket that are in memory.
    pub(crate) fn forget(&self, bucket: usize) {
        let mut bucket = lock(&self.buckets[bucket]);
        self.held.fetch_sub(bucket.bytes(), Ordering::Relaxed);
        *bucket = Bucket::default();
    }

    /// Bytes of records in memory.
    pub(crate) fn held(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    fn read_at(&self, at: u64, bytes: &mut [u8]) -> io::Result<()> {
        fault::point(fault::Point::Read)?;
        let mut file = lock(&self.file);
        let file = file.as_mut().ok_or(io::ErrorKind::NotFound)?;
        file.seek(SeekFrom::Start(at))?;
        file.read_exact(bytes)
    }

    /// Bytes written to the file so far.
    pub(crate) fn spilled(&self) -> u64 {
        self.end.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(budget: u64) -> (tempfile::TempDir, Buckets<u32>) {
        let folder = tempfile::tempdir().unwrap();
        let buckets = Buckets::new(folder.path(), 7, budget);
        std::thread::scope(|scope| {
            for thread in 0..3u32 {
                let buckets = &buckets;
                scope.spawn(move || {
                    for i in 0..2000u32 {
                        let value = thread * 100_000 + i * 10;
                        let run: Vec<u32> = (value..value + i % 10).collect();
                        buckets.push(i as usize % 7, &run).unwrap();
                    }
                });
            }
        });
        (folder, buckets)
    }

    fn sorted(buckets: &Buckets<u32>, bucket: usize) -> Vec<u32> {
        let mut all = Vec::new();
        buckets.read(bucket, |run| all.extend_from_slice(run)).unwrap();
        all.sort_unstable();
        all
    }

    #[test]
    fn every_record_comes_back_once_from_memory_or_file() {
        let ((_a, memory), (_b, file)) = (filled(1 << 30), filled(4096));
        assert_eq!(memory.spilled(), 0);
        assert!(file.spilled() > 50_000);
        assert!(file.held.load(Ordering::Relaxed) <= 4096 + 3 * 7 * 4 * CHUNK as u64);
        for bucket in 0..7 {
            let expected: Vec<u32> = (0..3u32)
                .flat_map(|t| (0..2000u32).map(move |i| (t, i)))
                .filter(|(_, i)| *i as usize % 7 == bucket)
                .flat_map(|(t, i)| (0..i % 10).map(move |k| t * 100_000 + i * 10 + k))
                .collect();
            assert_eq!(sorted(&memory, bucket), expected);
            assert_eq!(sorted(&file, bucket), expected);
        }
    }

    #[test]
    fn records_of_one_thread_come_back_in_order_from_anywhere() {
        for budget in [1 << 30, 4096, 0] {
            let folder = tempfile::tempdir().unwrap();
            let buckets = Buckets::new(folder.path(), 3, budget);
            for i in 0..3000u32 {
                let run: Vec<u32> = (0..i % 5).map(|k| 10 * i + k).collect();
                buckets.push(i as usize % 3, &run).unwrap();
            }
            for bucket in 0..3 {
                let of = (0..3000u32).filter(|i| *i as usize % 3 == bucket);
                let expected: Vec<u32> =
                    of.flat_map(|i| (0..i % 5).map(move |k| 10 * i + k)).collect();
                let mut all = Vec::new();
                buckets.read(bucket, |run| all.extend_from_slice(run)).unwrap();
                assert_eq!(all, expected);
                for first in [0, 1, 700, 1990, expected.len(), expected.len() + 5] {
                    let mut some = [0; 900];
                    let count = buckets.read_from(bucket, first, &mut some).unwrap();
                    let rest = expected.get(first..).unwrap_or_default();
                    assert_eq!(some[..count], rest[..rest.len().min(900)]);
                }
                buckets.forget(bucket);
                assert_eq!(buckets.read_from(bucket, 0, &mut [0]).unwrap(), 0);
            }
            assert_eq!(buckets.held(), 0);
        }
    }

    #[test]
    fn a_missing_folder_is_an_error_with_a_remedy() {
        let buckets = Buckets::new(Path::new("/nonexistent/terrane"), 1, 0);
        let error = buckets.push(0, &[1u32]).unwrap_err();
        assert!(error.to_string().contains("--temp-dir"), "{error}");
    }
}
