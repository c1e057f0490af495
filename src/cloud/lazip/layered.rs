//! Chunks of point formats 6 to 10: each group of fields is a layer, a stream of its own.

use super::channel::{Channel, Point, RECORD};
use super::coder::Coder;
use super::lane::{Lane, Streams};
use super::machine::{Machine, Work, run};
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

/// A chunk to be decoded.
pub(super) struct Job<'a> {
    pub(super) layered: &'a mut Layered,
    pub(super) chunk: Chunk<'a>,
    pub(super) layers: Layers,
    pub(super) wanted: Wanted,
    pub(super) fields: &'a mut Fields,
}

impl<'a> Job<'a> {
    fn lane<M: Machine>(self) -> Result<Lane<'a, M>, Damage> {
        let body = Body::new(self.chunk, self.layers)?;
        let streams = body.streams(self.wanted)?;
        let (first, current) = Point::new(body.record);
        let channels = self.layered.channels();
        channels.iter_mut().for_each(|channel| channel.is_used = false);
        channels[current].begin(first);
        self.fields.reserve(self.chunk.count);
        self.fields.push(&first);
        Ok(Lane::new(channels, current, streams, self.fields))
    }
}

/// Decodes a chunk of at least one point.
pub(super) fn read(job: Job) -> Result<(), Damage> {
    run(One(job))
}

/// Decodes two chunks of at least one point each at the same time.
pub(super) fn read_two(jobs: [Job; 2]) -> [Result<(), Damage>; 2] {
    run(Two(jobs))
}

struct One<'a>(Job<'a>);

impl Work for One<'_> {
    type Result = Result<(), Damage>;

    #[inline(always)]
    fn work<M: Machine>(self, machine: M) -> Self::Result {
        let left = self.0.chunk.count - 1;
        machine.run(Rest(self.0.lane::<M>()?, left))
    }
}

struct Two<'a>([Job<'a>; 2]);

impl Work for Two<'_> {
    type Result = [Result<(), Damage>; 2];

    #[inline(always)]
    fn work<M: Machine>(self, machine: M) -> Self::Result {
        let left = self.0.each_ref().map(|job| job.chunk.count - 1);
        match self.0.map(Job::lane::<M>) {
            [Ok(a), Ok(b)] => {
                let mut lanes = [a, b];
                let together = left[0].min(left[1]);
                advance(&mut lanes, together);
                let [a, b] = lanes;
                [machine.run(Rest(a, left[0] - together)), machine.run(Rest(b, left[1] - together))]
            }
            [a, b] => [
                a.and_then(|lane| machine.run(Rest(lane, left[0]))),
                b.and_then(|lane| machine.run(Rest(lane, left[1]))),
            ],
        }
    }
}

/// The last points of a chunk.
struct Rest<'a, M>(Lane<'a, M>, usize);

impl<N: Machine> Work for Rest<'_, N> {
    type Result = Result<(), Damage>;

    #[inline(always)]
    fn work<M: Machine>(self, _: M) -> Self::Result {
        let mut lanes = [self.0];
        advance(&mut lanes, self.1);
        let [lane] = lanes;
        lane.close()
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
