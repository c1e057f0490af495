//! Chunks of point formats 6 to 10: each group of fields is a layer, a stream of its own.

use super::body::Body;
use super::channel::{Channel, Point};
use super::lane::Lane;
use super::machine::{Machine, Plain, Work, run};
use super::rest::{self, Rest, Trace};
use super::schema::Layers;
use super::streams::Streams;
use super::{Chunk, Damage, Fields, Wanted};

/// What is kept from chunk to chunk, to be used again.
#[derive(Default)]
pub(super) struct Layered {
    channels: Option<Box<[Channel; 4]>>,
    /// Nothing until whole records are wanted.
    rest: Option<rest::Room>,
}

fn channels() -> Box<[Channel; 4]> {
    let channels: Vec<_> = (0..4).map(|_| Channel::new()).collect();
    channels.into_boxed_slice().try_into().unwrap_or_else(|_| unreachable!())
}

/// A chunk on its way, between batches of points.
pub(super) struct Run<'d, 'a> {
    channels: &'d mut [Channel; 4],
    current: usize,
    streams: Streams<'a, Plain>,
    /// The first point and its record, until they are handed on.
    first: Option<(Point, &'a [u8])>,
    /// Of points whose records are still to be completed.
    traces: Vec<Trace>,
    /// Nothing where whole records are not wanted.
    rest: Option<Box<Rest<'d, 'a>>>,
}

impl<'d, 'a> Run<'d, 'a> {
    /// Begins with the record of the first point.
    pub(super) fn new(
        layered: &'d mut Layered,
        layers: &Layers,
        chunk: Chunk<'a>,
        wanted: Wanted,
    ) -> Result<Self, Damage> {
        let body = Body::new(chunk, layers)?;
        let streams = body.streams(wanted)?;
        let record = body.record;
        let (first, current) = Point::new(record.first_chunk().ok_or(Damage::Short)?);
        let channels = layered.channels.get_or_insert_with(channels);
        channels.iter_mut().for_each(|channel| channel.is_used = false);
        channels[current].begin(first);
        let rest = match wanted.records {
            true => {
                let room = layered.rest.get_or_insert_with(rest::Room::new);
                Some(Box::new(Rest::new(room, body, layers, current)?))
            }
            false => None,
        };
        let first = Some((first, record));
        Ok(Self { channels, current, streams, first, traces: Vec::new(), rest })
    }

    /// Decodes the next `count` points.
    pub(super) fn read(&mut self, count: usize, fields: &mut Fields) -> Result<(), Damage> {
        let left = self.begin(count, fields);
        match self.rest {
            Some(_) => run(One::<true>(self, fields, left)),
            None => run(One::<false>(self, fields, left)),
        }
        let done = self.finish(fields);
        self.traces.clear();
        done
    }

    /// Fails unless all streams end here.
    pub(super) fn end(&self) -> Result<(), Damage> {
        self.streams.check(|coder| coder.is_all())?;
        self.rest.as_deref().map_or(Ok(()), Rest::end)
    }

    /// Hands on the first point; returns how many of `count` are left.
    fn begin(&mut self, count: usize, fields: &mut Fields) -> usize {
        fields.reserve(count);
        let Some((first, record)) = self.first.take_if(|_| count > 0) else { return count };
        fields.push(&first);
        if self.rest.is_some() {
            fields.records.extend_from_slice(record);
        }
        count - 1
    }

    /// Completes the records of the points that were decoded.
    fn finish(&mut self, fields: &mut Fields) -> Result<(), Damage> {
        self.streams.check(|coder| coder.is_sound())?;
        self.rest.as_mut().map_or(Ok(()), |rest| rest.read(&self.traces, fields))
    }

    fn lane<'r, M: Machine>(&'r mut self, fields: &'r mut Fields) -> Lane<'r, 'a, M> {
        Lane::new(self.channels, self.current, self.streams.on(), fields, &mut self.traces)
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
    match runs.iter().any(|run| run.rest.is_some()) {
        true => run(Two::<true>(runs, [a, b], together)),
        false => run(Two::<false>(runs, [a, b], together)),
    }
    [0, 1].map(|i| runs[i].read(left[i] - together, &mut fields[i]))
}

/// Points of a chunk; traces of them are kept if they are `TRACED`.
struct One<'r, 'd, 'a, const TRACED: bool>(&'r mut Run<'d, 'a>, &'r mut Fields, usize);

impl<const TRACED: bool> Work for One<'_, '_, '_, TRACED> {
    type Result = ();

    #[inline(always)]
    fn work<M: Machine>(self, _: M) {
        let mut lanes = [self.0.lane::<M>(self.1)];
        advance::<M, 1, TRACED>(&mut lanes, self.2);
        let [lane] = lanes;
        (self.0.current, self.0.streams) = lane.close();
    }
}

/// As many points of each chunk.
struct Two<'r, 'd, 'a, const TRACED: bool>(&'r mut [Run<'d, 'a>; 2], [&'r mut Fields; 2], usize);

impl<const TRACED: bool> Work for Two<'_, '_, '_, TRACED> {
    type Result = ();

    #[inline(always)]
    fn work<M: Machine>(self, _: M) {
        let ([first, second], [a, b]) = (self.0, self.1);
        let mut lanes = [first.lane::<M>(a), second.lane::<M>(b)];
        advance::<M, 2, TRACED>(&mut lanes, self.2);
        let [one, other] = lanes.map(Lane::close);
        (first.current, first.streams) = one;
        (second.current, second.streams) = other;
    }
}

/// Decodes `count` points of each chunk.
#[inline(always)]
fn advance<M: Machine, const N: usize, const TRACED: bool>(lanes: &mut [Lane<M>; N], count: usize) {
    // Loops, as closures handed to iterators are not always compiled for the machine.
    macro_rules! step {
        ($($step:ident)*) => { $(for lane in &mut *lanes { lane.$step(); })* };
    }
    for _ in 0..count {
        step!(changes returns x_size x_upper x_lower y_size y_upper y_lower z_size z_upper z_lower);
        step!(class flags);
        for lane in &mut *lanes {
            lane.finish::<TRACED>();
        }
    }
}
