//! Records with heights and classes.

use std::path::Path;

use bytemuck::{Pod, Zeroable};

use crate::records::numbered::RecordNumbers;
use crate::records::{PointRecords, RecordUnit, Take};
use terrane_base::error::Result;
use terrane_cloud::PointFormat;
use terrane_files::{BucketWriter, Buckets};

/// Marks the lack of a height.
pub(super) const NO_HEIGHT: i32 = i32::MIN;
/// Bytes of values that are held while they are read.
pub(super) const VALUES: u64 = 16 << 20;
/// Values of a bucket.
const BUCKET: u64 = 1 << 16;
/// Most buckets.
const MAX_BUCKETS: u64 = 1 << 14;

/// Height and class of a point.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct PointAnnotation {
    /// Within its bucket.
    number: u32,
    class: u32,
    height: i32,
}

/// Values by record number, in buckets of equal size.
pub(super) struct PointAnnotations {
    buckets: Buckets<PointAnnotation>,
    /// Numbers of a bucket.
    each: u64,
}

impl PointAnnotations {
    pub(super) fn new(points: u64, folder: &Path) -> Self {
        let each = BUCKET.max(points.div_ceil(MAX_BUCKETS));
        let count = points.div_ceil(each).max(1) as usize;
        Self { buckets: Buckets::new(folder, count, VALUES), each }
    }

    /// A writer for one thread.
    pub(super) fn writer(&self) -> ValueWriter<'_> {
        ValueWriter { each: self.each, to: self.buckets.writer() }
    }

    /// The values of a bucket, by number.
    fn of(&self, bucket: u64) -> Result<Vec<(i32, u8)>> {
        let mut all = vec![(NO_HEIGHT, 0); self.buckets.len(bucket as usize) as usize];
        self.buckets.read(bucket as usize, |values| {
            for PointAnnotation { number, class, height } in values {
                all[*number as usize] = (*height, *class as u8);
            }
        })?;
        Ok(all)
    }
}

/// Stores values by record number. Call [`finish`](Self::finish) at the end.
pub(super) struct ValueWriter<'a> {
    each: u64,
    to: BucketWriter<'a, PointAnnotation>,
}

impl ValueWriter<'_> {
    pub(super) fn put(&mut self, number: u64, class: u8, height: i32) -> Result<()> {
        let (bucket, number) = ((number / self.each) as usize, (number % self.each) as u32);
        self.to.push(bucket, PointAnnotation { number, class: class.into(), height })
    }

    pub(super) fn finish(self) -> Result<()> {
        self.to.finish()
    }
}

/// Offset of z in a record.
pub(super) const Z: usize = 8;

/// Records with heights and classes.
pub(super) struct AnnotatedRecords<'a> {
    pub(super) records: &'a dyn PointRecords,
    pub(super) format: PointFormat,
    pub(super) record: usize,
    /// Offset of heights in a record, if any.
    pub(super) heights_at: Option<usize>,
    pub(super) values: PointAnnotations,
    pub(super) numbers: RecordNumbers,
    pub(super) notes: Vec<String>,
}

impl PointRecords for AnnotatedRecords<'_> {
    fn units(&self) -> usize {
        self.records.units()
    }

    fn unit(&self, unit: usize) -> RecordUnit<'_> {
        self.records.unit(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let (mut number, mut annotated) = (self.numbers.first(unit), Vec::new());
        let (mut bucket, mut values) = (None, Vec::new());
        self.records.read(unit, &mut |bytes| {
            annotated.clear();
            for record in bytes.chunks_exact(self.record) {
                if bucket != Some(number / self.values.each) {
                    bucket = Some(number / self.values.each);
                    values = self.values.of(number / self.values.each)?;
                }
                let (height, class) = values[(number % self.values.each) as usize];
                number += 1;
                if self.heights_at == Some(Z) && height == NO_HEIGHT {
                    continue;
                }
                let first = annotated.len();
                annotated.extend_from_slice(record);
                let record = &mut annotated[first..];
                self.format.set_class(record, class);
                if let Some(at) = self.heights_at {
                    record[at..at + size_of::<i32>()].copy_from_slice(&height.to_le_bytes());
                }
            }
            take(&annotated)
        })
    }
}
