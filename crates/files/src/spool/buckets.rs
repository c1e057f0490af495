//! Records in numbered buckets, kept in memory up to a budget and then spilled to a [`SpoolFile`].

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use bytemuck::Pod;

use super::{SpoolExtent, SpoolFile};
use crate::lock;
use terrane_base::error::Result;

/// Maximum number of records of a chunk in memory.
const CHUNK: usize = 4096;
/// Records of the first chunk of a bucket; each following chunk is twice as large.
const FIRST_CHUNK: usize = 16;
/// Bytes read from the file at a time.
const READ_BYTES: usize = 64 << 10;
/// Bytes after which a spilling bucket yields to other threads: a few hundredths of a second.
const SPILLED: u64 = if cfg!(test) { 1 << 10 } else { 16 << 20 };
/// Records that a [`BucketWriter`] buffers.
const GATHERED: usize = 128;

/// A run of records of one bucket in the file.
#[derive(Clone, Copy, Debug)]
struct BucketRun {
    offset: u64,
    /// Number of the bucket's records up to the end of this run.
    end: u64,
}

/// A run of records of one bucket in memory.
#[derive(Debug)]
struct BucketChunk<T> {
    /// Number of the bucket's records before this run.
    first: u64,
    records: Vec<T>,
}

impl<T> BucketChunk<T> {
    fn bytes(&self) -> u64 {
        (self.records.capacity() * size_of::<T>()) as u64
    }
}

/// The records of a bucket in order of insertion.
#[derive(Debug)]
struct Bucket<T> {
    runs: Vec<BucketRun>,
    chunks: Vec<BucketChunk<T>>,
}

impl<T> Default for Bucket<T> {
    fn default() -> Self {
        Self { runs: Vec::new(), chunks: Vec::new() }
    }
}

impl<T: Pod> Bucket<T> {
    /// Adds records; returns the bytes of memory allocated.
    fn push(&mut self, mut run: &[T]) -> u64 {
        let mut taken = 0;
        while !run.is_empty() {
            let last = self.chunks.last_mut().map(|chunk| &mut chunk.records);
            let Some(records) = last.filter(|records| records.len() < records.capacity()) else {
                taken += self.grow(run.len());
                continue;
            };
            let free = records.capacity() - records.len();
            let (now, later) = run.split_at(free.min(run.len()));
            records.extend_from_slice(now);
            run = later;
        }
        taken
    }

    /// Adds an empty chunk for up to `wanted` records; returns its bytes.
    fn grow(&mut self, wanted: usize) -> u64 {
        let twice = self.chunks.last().map_or(FIRST_CHUNK, |chunk| 2 * chunk.records.len());
        let records = Vec::with_capacity(twice.max(wanted).min(CHUNK));
        let chunk = BucketChunk { first: self.len(), records };
        let bytes = chunk.bytes();
        self.chunks.push(chunk);
        bytes
    }

    fn len(&self) -> u64 {
        match self.chunks.last() {
            Some(chunk) => chunk.first + chunk.records.len() as u64,
            None => self.filed(),
        }
    }

    /// Number of records in the file; they precede those in memory.
    fn filed(&self) -> u64 {
        self.runs.last().map_or(0, |run| run.end)
    }

    fn bytes(&self) -> u64 {
        self.chunks.iter().map(BucketChunk::bytes).sum()
    }

    /// Fills `out` with the records from number `first` on; returns how many there are.
    fn read(&self, spool: &SpoolFile, mut first: u64, out: &mut [T]) -> Result<usize> {
        let mut filled = 0;
        let mut run = self.runs.partition_point(|run| run.end <= first);
        while first < self.filed() && filled < out.len() {
            let BucketRun { offset, end } = self.runs[run];
            let begin = run.checked_sub(1).map_or(0, |before| self.runs[before].end);
            let count = usize::try_from(end - first).unwrap_or(usize::MAX).min(out.len() - filled);
            let extent = extent::<T>(offset, end - begin);
            let bytes = bytemuck::cast_slice_mut(&mut out[filled..filled + count]);
            spool.get(&extent, (first - begin) * size_of::<T>() as u64, &mut [bytes])?;
            (filled, first, run) = (filled + count, first + count as u64, run + 1);
        }
        let chunk = self.chunks.partition_point(|chunk| chunk.first <= first);
        for chunk in &self.chunks[chunk.saturating_sub(1)..] {
            if filled == out.len() {
                break;
            }
            let from = usize::try_from(first - chunk.first).unwrap_or(usize::MAX);
            let rest = chunk.records.get(from..).unwrap_or_default();
            let count = rest.len().min(out.len() - filled);
            out[filled..filled + count].copy_from_slice(&rest[..count]);
            (filled, first) = (filled + count, first + count as u64);
        }
        Ok(filled)
    }
}

fn extent<T>(offset: u64, records: u64) -> SpoolExtent {
    SpoolExtent { offset, len: records * size_of::<T>() as u64 }
}

/// Buckets of records for concurrent writing and reading. Records that one thread adds to a bucket keep their
/// order; records of several threads interleave in any order.
#[derive(Debug)]
pub struct Buckets<T> {
    spool: SpoolFile,
    /// Memory budget of records in bytes.
    budget: u64,
    held: AtomicU64,
    buckets: Vec<Mutex<Bucket<T>>>,
    /// The bucket to spill next.
    next: AtomicUsize,
}

impl<T: Pod> Buckets<T> {
    /// Empty buckets `0 .. count` with about `budget` bytes in memory and the rest in an unnamed file in
    /// `folder`.
    pub fn new(folder: &Path, count: usize, budget: u64) -> Self {
        Self {
            spool: SpoolFile::new(folder),
            budget,
            held: AtomicU64::new(0),
            buckets: (0..count).map(|_| Mutex::default()).collect(),
            next: AtomicUsize::new(0),
        }
    }

    /// Adds a run of records to a bucket.
    pub fn push(&self, bucket: usize, run: &[T]) -> Result<()> {
        let mut own = lock(&self.buckets[bucket]);
        let taken = own.push(run);
        // Counted before another thread can spill the bucket and subtract it.
        let held = self.held.fetch_add(taken, Ordering::Relaxed) + taken;
        drop(own);
        if taken > 0 && held > self.budget {
            // Somewhat below the budget: at the budget itself the next push would spill again.
            self.relieve(self.budget - (self.budget / 4).min(SPILLED))?;
        }
        Ok(())
    }

    /// A writer for one thread that adds records one by one.
    pub fn writer(&self) -> BucketWriter<'_, T> {
        BucketWriter { buckets: self, gathered: Vec::with_capacity(GATHERED), run: Vec::new() }
    }

    /// Spills all records to the file.
    pub fn settle(&self) -> Result<()> {
        self.relieve(0)
    }

    /// Spills buckets in turn until at most `most` bytes are in memory.
    fn relieve(&self, most: u64) -> Result<()> {
        for _ in 0..self.buckets.len() {
            if self.memory_use() <= most {
                break;
            }
            let next = self.next.fetch_add(1, Ordering::Relaxed) % self.buckets.len();
            // Each piece locks the bucket anew, so that threads that add to it wait for one piece at most.
            while self.memory_use() > most && self.spill(&mut lock(&self.buckets[next]))? {}
        }
        Ok(())
    }

    /// Spills the first chunks of a bucket, about [`SPILLED`] bytes; false if it has none.
    fn spill(&self, bucket: &mut Bucket<T>) -> Result<bool> {
        let Some(first) = bucket.chunks.first() else { return Ok(false) };
        let until = first.first + SPILLED / size_of::<T>() as u64;
        // First chunks leave first: `read` relies on records in the file being those before memory's.
        let count = bucket.chunks.partition_point(|chunk| chunk.first < until);
        let (chunks, rest) = bucket.chunks.split_at(count);
        let end = rest.first().map_or(bucket.len(), |chunk| chunk.first);
        let parts: Vec<&[u8]> =
            chunks.iter().map(|chunk| bytemuck::cast_slice(&chunk.records)).collect();
        let SpoolExtent { offset, .. } = self.spool.put(&parts)?;
        bucket.runs.push(BucketRun { offset, end });
        let bytes = bucket.chunks.drain(..count).map(|chunk| chunk.bytes()).sum();
        self.held.fetch_sub(bytes, Ordering::Relaxed);
        Ok(true)
    }

    /// Number of records in a bucket.
    pub fn len(&self, bucket: usize) -> u64 {
        lock(&self.buckets[bucket]).len()
    }

    /// Passes all records of a bucket to `each`, in runs.
    pub fn read(&self, bucket: usize, mut each: impl FnMut(&[T])) -> Result<()> {
        self.try_read(bucket, |records| {
            each(records);
            Ok(())
        })
    }

    /// As [`read`](Self::read), stopping at the first error of `each`.
    pub fn try_read(&self, bucket: usize, mut each: impl FnMut(&[T]) -> Result<()>) -> Result<()> {
        let bucket = lock(&self.buckets[bucket]);
        let (mut first, filed, most) = (0, bucket.filed(), (READ_BYTES / size_of::<T>()) as u64);
        let mut piece = vec![T::zeroed(); most.min(filed) as usize];
        while first < filed {
            let piece = &mut piece[..most.min(filed - first) as usize];
            bucket.read(&self.spool, first, piece)?;
            each(piece)?;
            first += piece.len() as u64;
        }
        bucket.chunks.iter().try_for_each(|chunk| each(&chunk.records))
    }

    /// Fills `out` with the records of a bucket from number `first` on; returns how many there are.
    pub fn read_from(&self, bucket: usize, first: u64, out: &mut [T]) -> Result<usize> {
        lock(&self.buckets[bucket]).read(&self.spool, first, out)
    }

    /// Forgets the records of a bucket.
    pub fn forget(&self, bucket: usize) {
        let bucket = std::mem::take(&mut *lock(&self.buckets[bucket]));
        self.held.fetch_sub(bucket.bytes(), Ordering::Relaxed);
        let mut begin = 0;
        for BucketRun { offset, end } in bucket.runs {
            self.spool.free(extent::<T>(offset, end - begin));
            begin = end;
        }
    }

    /// Bytes of records in memory.
    pub fn memory_use(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    /// Bytes written to the file so far.
    pub fn spilled(&self) -> u64 {
        self.spool.written()
    }
}

/// Buffers records and adds those of one bucket together. Call [`finish`](BucketWriter::finish) at the end.
#[derive(Debug)]
pub struct BucketWriter<'a, T> {
    buckets: &'a Buckets<T>,
    gathered: Vec<(usize, T)>,
    run: Vec<T>,
}

impl<T: Pod> BucketWriter<'_, T> {
    /// Adds a record to a bucket.
    pub fn push(&mut self, bucket: usize, record: T) -> Result<()> {
        self.gathered.push((bucket, record));
        if self.gathered.len() < GATHERED { Ok(()) } else { self.flush() }
    }

    /// Flushes the buffered records.
    pub fn finish(mut self) -> Result<()> {
        self.flush()
    }

    fn flush(&mut self) -> Result<()> {
        // A stable sort: records of a bucket stay in the order in which they came.
        self.gathered.sort_by_key(|(bucket, _)| *bucket);
        for group in self.gathered.chunk_by(|(a, _), (b, _)| a == b) {
            self.run.clear();
            self.run.extend(group.iter().map(|(_, record)| *record));
            self.buckets.push(group[0].0, &self.run)?;
        }
        self.gathered.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all_of(buckets: &Buckets<u32>, bucket: usize) -> Vec<u32> {
        let mut all = Vec::new();
        buckets.read(bucket, |run| all.extend_from_slice(run)).unwrap();
        all
    }

    proptest! {
        /// Beside a vector for each bucket.
        #[test]
        fn like_vectors_however_little_fits_in_memory(
            budget in prop::sample::select(vec![0_u64, 200, 5000, 1 << 20]),
            steps in prop::collection::vec((0_usize..4, 0_usize..400, 0_u8..12), 1..60),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let buckets = Buckets::new(folder.path(), 4, budget);
            let mut twin = vec![Vec::new(); 4];
            let mut next = 0_u32;
            for (bucket, count, what) in steps {
                match what {
                    0 => {
                        buckets.forget(bucket);
                        twin[bucket].clear();
                    }
                    1 => buckets.settle().unwrap(),
                    2..5 => {
                        let mut some = [0; 70];
                        let found = buckets.read_from(bucket, count as u64, &mut some).unwrap();
                        let rest = twin[bucket].get(count..).unwrap_or_default();
                        prop_assert_eq!(&some[..found], &rest[..rest.len().min(70)]);
                    }
                    5 => {
                        let mut writer = buckets.writer();
                        for value in next..next + count as u32 {
                            let bucket = (value % 3) as usize;
                            writer.push(bucket, value).unwrap();
                            twin[bucket].push(value);
                        }
                        writer.finish().unwrap();
                        next += count as u32;
                    }
                    _ => {
                        let run: Vec<u32> = (next..next + count as u32).collect();
                        buckets.push(bucket, &run).unwrap();
                        twin[bucket].extend_from_slice(&run);
                        next += count as u32;
                    }
                }
                prop_assert!(buckets.memory_use() <= budget);
                prop_assert_eq!(buckets.len(bucket), twin[bucket].len() as u64);
            }
            for (bucket, twin) in twin.iter().enumerate() {
                prop_assert_eq!(&all_of(&buckets, bucket), twin);
                buckets.forget(bucket);
            }
            prop_assert_eq!(buckets.memory_use(), 0);
            prop_assert_eq!(lock(&buckets.spool.space).end, 0, "all room is free again");
        }
    }

    #[test]
    fn every_record_of_every_thread_comes_back_once() {
        for budget in [1 << 30, 4096] {
            let folder = tempfile::tempdir().unwrap();
            let buckets = Buckets::new(folder.path(), 7, budget);
            std::thread::scope(|scope| {
                for thread in 0..3_u32 {
                    let buckets = &buckets;
                    scope.spawn(move || {
                        for i in 0..2000 {
                            let value = thread * 100_000 + i * 10;
                            let run: Vec<u32> = (value..value + i % 10).collect();
                            buckets.push(i as usize % 7, &run).unwrap();
                        }
                    });
                }
            });
            assert_eq!(buckets.spilled() > 50_000, budget == 4096);
            for bucket in 0..7 {
                let expected: Vec<u32> = (0..3)
                    .flat_map(|t| (0..2000).map(move |i| (t, i)))
                    .filter(|(_, i)| *i as usize % 7 == bucket)
                    .flat_map(|(t, i)| (0..i % 10).map(move |k| t * 100_000 + i * 10 + k))
                    .collect();
                let mut found = all_of(&buckets, bucket);
                found.sort_unstable();
                assert_eq!(found, expected);
            }
        }
    }

    #[test]
    fn reading_stops_where_it_fails() {
        let folder = tempfile::tempdir().unwrap();
        let buckets = Buckets::new(folder.path(), 1, 0);
        buckets.push(0, &vec![1_u32; 100_000]).unwrap();
        let mut calls = 0;
        let read = buckets.try_read(0, |_| {
            calls += 1;
            Err(terrane_base::Error::usage("no more"))
        });
        assert!(read.is_err() && calls == 1);
    }

    #[test]
    fn a_missing_folder_is_told_when_the_file_is_needed() {
        let buckets = Buckets::new(Path::new("/nonexistent/terrane"), 1, 64);
        buckets.push(0, &[1_u32; 16]).unwrap();
        let error = buckets.push(0, &[1_u32]).unwrap_err();
        assert!(error.to_string().contains("‹temp_dir›"), "{error}");
        assert_eq!(all_of(&buckets, 0), [1; 17], "what is in memory is still there");
    }
}
