//! Chunks of point formats 0 to 5: one stream of records.

use super::chunk::{ChunkDamage, LazLayer};
use super::coder::RangeDecoder;
use super::fields::{DecodedFields, FieldSelection};
use super::machine::{InstructionSet, PortableInstructions, SimdTask, run};
use super::old::{OLD_RECORD, Point10Context, Point10Fields};
use super::point::LazPoint;
use super::record_items::ItemContext;
use super::schema::{self, LaszipItem};

/// State reused between chunks.
#[derive(Default)]
pub(super) struct Pointwise {
    old: Option<Box<Point10Context>>,
    follow: Vec<ItemContext>,
    /// Items decoded by `follow`.
    items: Vec<LaszipItem>,
    /// The last record. The bytes after the common fields are up to date.
    record: Vec<u8>,
}

impl Pointwise {
    /// Prepares for a chunk that begins with a record; the allocation is reused if the schema is the same.
    fn begin(&mut self, items: &[LaszipItem], record: &[u8]) {
        self.record.clear();
        self.record.extend_from_slice(record);
        if self.items == items {
            self.follow.iter_mut().for_each(ItemContext::clear);
            return;
        }
        self.items = items.to_vec();
        self.follow = items.iter().map(ItemContext::new).collect();
    }
}

/// A stream being decoded.
pub(super) struct PointwiseStream<'a> {
    first: Option<LazPoint>,
    wants_records: bool,
    coder: Option<RangeDecoder<'a, PortableInstructions>>,
    bytes: &'a [u8],
}

impl<'a> PointwiseStream<'a> {
    /// Begins with the record of the first point.
    pub(super) fn new(
        pointwise: &mut Pointwise,
        records: &schema::PointwiseSchema,
        bytes: &'a [u8],
        wanted: FieldSelection,
    ) -> Result<Self, ChunkDamage> {
        let size = OLD_RECORD + records.bytes;
        let (record, bytes) = bytes.split_at_checked(size).ok_or(ChunkDamage::Short)?;
        let first = Point10Fields::new(record.first_chunk().ok_or(ChunkDamage::Short)?);
        pointwise.begin(&records.follow, record);
        let old = pointwise.old.get_or_insert_with(Point10Context::boxed);
        let first = Some(old.begin(records.version, first));
        Ok(Self { first, wants_records: wanted.records, coder: None, bytes })
    }

    /// Bytes after the end of the stream, which must be here.
    pub(super) fn end(&self) -> Result<usize, ChunkDamage> {
        // With a single point the stream is not opened.
        match self.coder.or_else(|| RangeDecoder::new(self.bytes)) {
            Some(coder) if coder.is_at_end() => Ok(coder.left()),
            _ => Err(ChunkDamage::Layer(LazLayer::Records)),
        }
    }

    /// Number of unread bytes.
    pub(super) fn left(&self) -> usize {
        self.coder.map_or(self.bytes.len(), |coder| coder.left())
    }

    /// The same stream with other bytes to continue.
    pub(super) fn with<'b>(&self, bytes: &'b [u8]) -> PointwiseStream<'b> {
        let Self { first, wants_records, coder, .. } = *self;
        PointwiseStream { first, wants_records, coder: coder.map(|coder| coder.with(bytes)), bytes }
    }

    /// Decodes the next `count` points.
    pub(super) fn read(
        &mut self,
        pointwise: &mut Pointwise,
        count: usize,
        fields: &mut DecodedFields,
    ) -> Result<(), ChunkDamage> {
        let count = count - usize::from(self.begin(pointwise, count, fields));
        if count == 0 {
            return Ok(());
        }
        let damage = ChunkDamage::Layer(LazLayer::Records);
        let coder = self.coder.or_else(|| RangeDecoder::new(self.bytes)).ok_or(damage)?;
        let Pointwise { old: Some(old), follow, record, .. } = pointwise else {
            return Err(damage);
        };
        let points = PointwiseBatch { old, follow, record, coder, count, fields };
        let coder = match self.wants_records {
            true => run(PointwiseRecordBatch(points)),
            false => run(points),
        };
        self.coder = Some(coder);
        if coder.is_sound() { Ok(()) } else { Err(damage) }
    }

    /// Passes on the first point if it is pending and `count` is not 0; returns whether it was.
    fn begin(&mut self, pointwise: &Pointwise, count: usize, fields: &mut DecodedFields) -> bool {
        if self.wants_records {
            fields.records.reserve(count * pointwise.record.len());
        }
        let Some(first) = self.first.take_if(|_| count > 0) else { return false };
        fields.push(&first);
        if self.wants_records {
            fields.records.extend_from_slice(&pointwise.record);
        }
        true
    }
}

/// A batch of points.
struct PointwiseBatch<'a, 'b> {
    old: &'a mut Point10Context,
    follow: &'a mut [ItemContext],
    /// The last record.
    record: &'a mut [u8],
    coder: RangeDecoder<'b, PortableInstructions>,
    count: usize,
    fields: &'a mut DecodedFields,
}

impl<'b> PointwiseBatch<'_, 'b> {
    #[inline(always)]
    fn decode<M: InstructionSet, const WANTS_RECORDS: bool>(
        self,
    ) -> RangeDecoder<'b, PortableInstructions> {
        let mut coder = self.coder.on::<M>();
        for _ in 0..self.count {
            let point = self.old.next(&mut coder);
            let mut rest = &mut self.record[OLD_RECORD..];
            for item in &mut *self.follow {
                item.next(&mut coder, &mut rest);
            }
            self.fields.push(&point);
            if WANTS_RECORDS {
                self.record[..OLD_RECORD].copy_from_slice(&self.old.record());
                self.fields.records.extend_from_slice(self.record);
            }
        }
        coder.on()
    }
}

impl<'b> SimdTask for PointwiseBatch<'_, 'b> {
    type Result = RangeDecoder<'b, PortableInstructions>;

    #[inline(always)]
    fn work<M: InstructionSet>(self, _: M) -> Self::Result {
        self.decode::<M, false>()
    }
}

/// A batch of points with records.
struct PointwiseRecordBatch<'a, 'b>(PointwiseBatch<'a, 'b>);

impl<'b> SimdTask for PointwiseRecordBatch<'_, 'b> {
    type Result = RangeDecoder<'b, PortableInstructions>;

    #[inline(always)]
    fn work<M: InstructionSet>(self, _: M) -> Self::Result {
        self.0.decode::<M, true>()
    }
}
