//! Triangles of a row of blocks, kept by block in one nameless file until the row is complete.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};

use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;
use terrane_files::atomic::plain;
use terrane_files::fault::{self, Point};

/// Records of all buckets in memory before the largest bucket goes to the file.
const MOST_HELD: usize = 1 << 15;
/// Records read back at a time.
const MOST_READ: usize = 1 << 14;

/// A triangle with its vertices' ids in the whole mesh.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Record {
    pub(super) ids: [u64; 3],
    pub(super) corners: [Point3; 3],
}

/// Records by bucket, each in the order they came.
pub(super) struct Buckets {
    folder: PathBuf,
    file: File,
    end: u64,
    buckets: Vec<Bucket>,
    held: usize,
}

#[derive(Default)]
struct Bucket {
    /// Runs in the file: offset and number of records.
    runs: Vec<(u64, usize)>,
    held: Vec<Record>,
}

impl Buckets {
    /// Empty buckets `0 .. count`, with their file in `folder`.
    pub(super) fn new(folder: &Path, count: u32) -> Result<Self> {
        let file = tempfile::tempfile_in(folder).map_err(|e| Error::write(folder, plain(e)))?;
        let buckets = (0..count).map(|_| Bucket::default()).collect();
        Ok(Self { folder: folder.to_path_buf(), file, end: 0, buckets, held: 0 })
    }

    /// Adds a record.
    pub(super) fn push(&mut self, bucket: u32, record: Record) -> Result<()> {
        self.buckets[bucket as usize].held.push(record);
        self.held += 1;
        if self.held < MOST_HELD { Ok(()) } else { self.flush_largest() }
    }

    fn flush_largest(&mut self) -> Result<()> {
        let Some(largest) = self.buckets.iter_mut().max_by_key(|b| b.held.len()) else {
            return Ok(());
        };
        let bytes: &[u8] = bytemuck::cast_slice(&largest.held);
        let written = fault::point(Point::Write)
            .and_then(|()| self.file.seek(SeekFrom::Start(self.end)))
            .and_then(|_| self.file.write_all(bytes));
        written.map_err(|e| Error::write(&self.folder, e))?;
        largest.runs.push((self.end, largest.held.len()));
        self.end += bytes.len() as u64;
        self.held -= largest.held.len();
        largest.held = Vec::new();
        Ok(())
    }

    /// True when nothing has come for a bucket.
    pub(super) fn is_empty(&self, bucket: u32) -> bool {
        let bucket = &self.buckets[bucket as usize];
        bucket.runs.is_empty() && bucket.held.is_empty()
    }

    /// Calls `visit` with all records of a bucket, some at a time.
    pub(super) fn read(
        &mut self,
        bucket: u32,
        mut visit: impl FnMut(&[Record]) -> Result<()>,
    ) -> Result<()> {
        let Bucket { runs, held } = &self.buckets[bucket as usize];
        let mut piece = vec![Record::zeroed(); MOST_READ];
        for &(mut offset, mut left) in runs {
            while left > 0 {
                let piece = &mut piece[..left.min(MOST_READ)];
                let bytes: &mut [u8] = bytemuck::cast_slice_mut(piece);
                let read = fault::point(Point::Read)
                    .and_then(|()| self.file.seek(SeekFrom::Start(offset)))
                    .and_then(|_| self.file.read_exact(bytes));
                read.map_err(|e| Error::read(&self.folder, e))?;
                offset += bytes.len() as u64;
                left -= piece.len();
                visit(piece)?;
            }
        }
        visit(held)
    }

    /// Empties all buckets.
    pub(super) fn clear(&mut self) -> Result<()> {
        self.buckets.iter_mut().for_each(|bucket| *bucket = Bucket::default());
        (self.end, self.held) = (0, 0);
        self.file.set_len(0).map_err(|e| Error::write(&self.folder, e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_come_back_by_bucket_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut buckets = Buckets::new(folder.path(), 3).unwrap();
        let record = |i: u64| Record { ids: [i; 3], corners: [[i as f64; 3]; 3] };
        for round in 0..2 {
            let count = 3 * MOST_HELD as u64 / (1 + round);
            (0..count).for_each(|i| buckets.push((i * i % 2) as u32, record(i)).unwrap());
            assert!(buckets.is_empty(2) && !buckets.is_empty(1));
            for bucket in 0..2 {
                let mut found = Vec::new();
                let keep = |records: &[Record]| {
                    found.extend_from_slice(records);
                    Ok(())
                };
                buckets.read(bucket, keep).unwrap();
                let own = (0..count).filter(|i| i * i % 2 == u64::from(bucket));
                assert!(found == own.map(record).collect::<Vec<_>>());
            }
            buckets.clear().unwrap();
            assert!(buckets.is_empty(0));
        }
    }
}
