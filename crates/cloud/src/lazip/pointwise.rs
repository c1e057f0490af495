//! Chunks of point formats 0 to 5: one stream, record after record.

use super::channel::Point;
use super::coder::Coder;
use super::follow::Follow;
use super::machine::{Machine, Plain, Work, run};
use super::old::{First, OLD_RECORD, Old};
use super::schema::{Item, Records};
use super::{Damage, Fields, Layer};

/// What is kept from chunk to chunk, to be used again.
#[derive(Default)]
pub(super) struct Pointwise {
    old: Option<Box<Old>>,
    follow: Vec<Follow>,
    /// What `follow` decodes.
    items: Vec<Item>,
}

impl Pointwise {
    /// Makes ready for a chunk, in the room of the one before where records are alike.
    fn begin(&mut self, items: &[Item]) {
        if self.items == items {
            self.follow.iter_mut().for_each(Follow::clear);
            return;
        }
        self.items = items.to_vec();
        self.follow = items.iter().map(Follow::new).collect();
    }
}

/// A stream on its way.
pub(super) struct Run<'a> {
    first: Option<Point>,
    coder: Option<Coder<'a, Plain>>,
    bytes: &'a [u8],
}

impl<'a> Run<'a> {
    /// Begins with the record of the first point.
    pub(super) fn new(
        pointwise: &mut Pointwise,
        records: &Records,
        bytes: &'a [u8],
    ) -> Result<Self, Damage> {
        let record: &[u8; OLD_RECORD] = bytes.first_chunk().ok_or(Damage::Short)?;
        let bytes = bytes.get(OLD_RECORD + records.bytes..).ok_or(Damage::Short)?;
        pointwise.begin(&records.follow);
        let old = pointwise.old.get_or_insert_with(Old::boxed);
        Ok(Self { first: Some(old.begin(records.version, First::new(record))), coder: None, bytes })
    }

    /// Bytes behind the end of the stream, which must be here.
    pub(super) fn end(&self) -> Result<usize, Damage> {
        // A single point leaves the stream unopened.
        match self.coder.or_else(|| Coder::new(self.bytes)) {
            Some(coder) if coder.is_at_end() => Ok(coder.left()),
            _ => Err(Damage::Layer(Layer::Records)),
        }
    }

    /// Bytes that were not taken in.
    pub(super) fn left(&self) -> usize {
        self.coder.map_or(self.bytes.len(), |coder| coder.left())
    }

    /// The same, with other bytes to go on with.
    pub(super) fn with<'b>(&self, bytes: &'b [u8]) -> Run<'b> {
        Run { first: self.first, coder: self.coder.map(|coder| coder.with(bytes)), bytes }
    }

    /// Decodes the next `count` points.
    pub(super) fn read(
        &mut self,
        pointwise: &mut Pointwise,
        count: usize,
        fields: &mut Fields,
    ) -> Result<(), Damage> {
        let first = self.first.take_if(|_| count > 0);
        first.iter().for_each(|first| fields.push(first));
        let count = count - usize::from(first.is_some());
        if count == 0 {
            return Ok(());
        }
        let damage = Damage::Layer(Layer::Records);
        let coder = self.coder.or_else(|| Coder::new(self.bytes)).ok_or(damage)?;
        let Some(old) = &mut pointwise.old else { return Err(damage) };
        let coder = run(Points { old, follow: &mut pointwise.follow, coder, count, fields });
        self.coder = Some(coder);
        if coder.is_sound() { Ok(()) } else { Err(damage) }
    }
}

/// Points to be decoded.
struct Points<'a, 'b> {
    old: &'a mut Old,
    follow: &'a mut [Follow],
    coder: Coder<'b, Plain>,
    count: usize,
    fields: &'a mut Fields,
}

impl<'b> Work for Points<'_, 'b> {
    type Result = Coder<'b, Plain>;

    #[inline(always)]
    fn work<M: Machine>(self, _: M) -> Self::Result {
        let mut coder = self.coder.on::<M>();
        for _ in 0..self.count {
            let point = self.old.next(&mut coder);
            for item in &mut *self.follow {
                item.next(&mut coder);
            }
            self.fields.push(&point);
        }
        coder.on()
    }
}
