//! Chunks of point formats 6 to 10: each group of fields is a layer, a stream of its own.

use super::channel::{Channel, Point, RECORD};
use super::coder::Coder;
use super::lane::{Lane, Streams};
use super::machine::{Machine, Plain, Work, run};
use super::schema::Layers;
use super::{Chunk, Damage, Fields, Layer, Wanted};

/// Layers of the part of a record that all formats share.
const LAYERS: usize = 9;

/// What is kept from chunk to chunk, to be used again.
#[derive(Default)]
pub(super) struct Layered {
    channels: Option<Box<[Channel; 4]>>,
}

impl Layered {
    fn channels(&mut self) -> &mut [Channel; 4] {
        self.channels.get_or_insert_with(|| {
            let channels: Vec<_> = (0..4).map(|_| Channel::new()).collect();
            channels.into_boxed_slice().try_into().unwrap_or_else(|_| unreachable!())
        })
    }
}

/// The parts of a chunk.
struct Body<'a> {
    record: &'a [u8; RECORD],
    layers: [&'a [u8]; LAYERS],
}

impl<'a> Body<'a> {
    fn new(chunk: Chunk<'a>, layers: Layers) -> Result<Self, Damage> {
        let record = chunk.bytes.first_chunk().ok_or(Damage::Short)?;
        let mut rest = chunk.bytes.get(RECORD + layers.bytes..).ok_or(Damage::Short)?;
        let held = word(&mut rest)?;
        if (held as usize) < chunk.count {
            return Err(Damage::Count(held));
        }
        let mut sizes = [0; LAYERS];
        for size in &mut sizes {
            *size = word(&mut rest)? as usize;
        }
        let mut rest = rest.get(4 * layers.layers..).ok_or(Damage::Short)?;
        let mut slices = [&[][..]; LAYERS];
        for (layer, size) in slices.iter_mut().zip(sizes) {
            (*layer, rest) = rest.split_at_checked(size).ok_or(Damage::Short)?;
        }
        Ok(Self { record, layers: slices })
    }

    /// The wanted streams. A layer of no bytes stands for a field that is as in the first point.
    fn streams<M: Machine>(&self, wanted: Wanted) -> Result<Streams<'a, M>, Damage> {
        let open = |layer: Layer, is_wanted: bool| match self.layers[layer as usize] {
            [] => Ok(None),
            _ if !is_wanted => Ok(None),
            bytes => Coder::new(bytes).map(Some).ok_or(Damage::Layer(layer)),
        };
        Ok(Streams {
            places: open(Layer::Places, true)?.ok_or(Damage::Layer(Layer::Places))?,
            heights: open(Layer::Heights, wanted.z)?,
            classes: open(Layer::Classes, wanted.class)?,
            flags: open(Layer::Flags, wanted.flags)?,
        })
    }
}

/// Takes a number off the front.
fn word(rest: &mut &[u8]) -> Result<u32, Damage> {
    let (four, after) = rest.split_first_chunk().ok_or(Damage::Short)?;
    *rest = after;
    Ok(u32::from_le_bytes(*four))
}

/// A chunk on its way, between batches of points.
pub(super) struct Run<'d, 'a> {
    channels: &'d mut [Channel; 4],
    current: usize,
    streams: Streams<'a, Plain>,
    first: Option<Point>,
}

impl<'d, 'a> Run<'d, 'a> {
    /// Begins with the record of the first point.
    pub(super) fn new(
        layered: &'d mut Layered,
        layers: Layers,
        chunk: Chunk<'a>,
        wanted: Wanted,
    ) -> Result<Self, Damage> {
        let body = Body::new(chunk, layers)?;
        let streams = body.streams(wanted)?;
        let (first, current) = Point::new(body.record);
        let channels = layered.channels();
        channels.iter_mut().for_each(|channel| channel.is_used = false);
        channels[current].begin(first);
        Ok(Self { channels, current, streams, first: Some(first) })
    }

    /// Decodes the next `count` points.
    pub(super) fn read(&mut self, count: usize, fields: &mut Fields) -> Result<(), Damage> {
        let left = self.begin(count, fields);
        run(One(self, fields, left));
        self.streams.check()
    }

    /// Fails unless all streams end here.
    pub(super) fn end(&self) -> Result<(), Damage> {
        self.streams.check_ends()
    }

    /// Hands on the first point; returns how many of `count` are left.
    fn begin(&mut self, count: usize, fields: &mut Fields) -> usize {
        fields.reserve(count);
        let first = self.first.take_if(|_| count > 0);
        first.iter().for_each(|first| fields.push(first));
        count - usize::from(first.is_some())
    }

    fn lane<'r, M: Machine>(&'r mut self, fields: &'r mut Fields) -> Lane<'r, 'a, M> {
        Lane::new(self.channels, self.current, self.streams.on(), fields)
    }
}

/// Decodes the next points of two chunks at the same time, so many of each.
pub(super) fn read_two(
    runs: &mut [Run; 2],
    counts: [usize; 2],
    fields: &mut [Fields; 2],
) -> [Result<(), Damage>; 2] {
    let left = [0, 1].map(|i| runs[i].begin(counts[i], &mut fields[i]));
    let together = left[0].min(left[1]);
    let [a, b] = &mut *fields;
    run(Two(runs, [a, b], together));
    [0, 1].map(|i| runs[i].read(left[i] - together, &mut fields[i]))
}

/// Points of a chunk.
struct One<'r, 'd, 'a>(&'r mut Run<'d, 'a>, &'r mut Fields, usize);

impl Work for One<'_, '_, '_> {
    type Result = ();

    #[inline(always)]
    fn work<M: Machine>(self, _: M) {
        let mut lanes = [self.0.lane::<M>(self.1)];
        advance(&mut lanes, self.2);
        let [lane] = lanes;
        (self.0.current, self.0.streams) = lane.close();
    }
}

/// As many points of each chunk.
struct Two<'r, 'd, 'a>(&'r mut [Run<'d, 'a>; 2], [&'r mut Fields; 2], usize);

impl Work for Two<'_, '_, '_> {
    type Result = ();

    #[inline(always)]
    fn work<M: Machine>(self, _: M) {
        let ([first, second], [a, b]) = (self.0, self.1);
        let mut lanes = [first.lane::<M>(a), second.lane::<M>(b)];
        advance(&mut lanes, self.2);
        let [one, other] = lanes.map(Lane::close);
        (first.current, first.streams) = one;
        (second.current, second.streams) = other;
    }
}

/// Decodes `count` points of each chunk.
#[inline(always)]
fn advance<M: Machine, const N: usize>(lanes: &mut [Lane<M>; N], count: usize) {
    // Loops, as closures handed to iterators are not always compiled for the machine.
    macro_rules! step {
        ($($step:ident)*) => { $(for lane in &mut *lanes { lane.$step(); })* };
    }
    for _ in 0..count {
        step!(changes returns x_size x_upper x_lower y_size y_upper y_lower z_size z_upper z_lower);
        step!(class flags finish);
    }
}
