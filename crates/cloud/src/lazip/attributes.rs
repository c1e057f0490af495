//! Contexts of a scanner channel for intensities, scan angles, user data, point sources and times, for whole records
//! of a layered chunk.

use super::coder::RangeDecoder;
use super::coordinates::DecodedPosition;
use super::integer::IntegerDecoder;
use super::machine::InstructionSet;
use super::model::ArithmeticModel;
use super::point::RECORD;
use super::range_encoder::RangeEncoder;
use super::returns::ReturnNumbers;
use super::streams::RestStreams;
use super::time::GpsTime;
use super::trace::PointChanges;

/// Contexts of a channel, except those of the columns. A field without a stream keeps its value.
pub(super) struct AttributeContext {
    /// Whether the chunk has a point of this channel.
    is_used: bool,
    intensity: u16,
    angle: u16,
    user: u8,
    source: u16,
    time: u64,
    /// Last intensity, by position among the returns and change of time.
    intensities: [u16; 8],
    intensity_steps: IntegerDecoder<4>,
    angle_steps: IntegerDecoder<2>,
    users: [ArithmeticModel<16>; 64],
    source_steps: IntegerDecoder<1>,
    times: GpsTime,
}

impl AttributeContext {
    /// A channel without a point.
    fn new() -> Self {
        Self {
            is_used: false,
            intensity: 0,
            angle: 0,
            user: 0,
            source: 0,
            time: 0,
            intensities: [0; 8],
            intensity_steps: IntegerDecoder::new(16),
            angle_steps: IntegerDecoder::new(16),
            users: [const { ArithmeticModel::new() }; 64],
            source_steps: IntegerDecoder::new(16),
            times: GpsTime::new(),
        }
    }

    /// Restarts after the point of `record`.
    fn begin(&mut self, record: &[u8; RECORD]) {
        self.is_used = true;
        self.intensity = two_bytes(record, 12);
        self.user = record[17];
        self.angle = two_bytes(record, 18);
        self.source = two_bytes(record, 20);
        self.time = time(record);
        self.intensities = [self.intensity; 8];
        self.intensity_steps.clear();
        self.angle_steps.clear();
        self.users.iter_mut().for_each(ArithmeticModel::clear);
        self.source_steps.clear();
        self.times.begin_at(self.time);
    }

    /// Decodes the next point.
    #[inline(always)]
    fn next<M: InstructionSet>(
        &mut self,
        streams: &mut RestStreams<M>,
        trace: PointChanges,
        returns: ReturnNumbers,
    ) {
        if let Some(coder) = &mut streams.intensities {
            self.next_intensity(coder, trace, returns);
        }
        if let Some(coder) = &mut streams.angles
            && trace.has_other_angle()
        {
            let step = self.angle_steps.next(coder, usize::from(trace.is_later())).0;
            self.angle = self.angle.wrapping_add(step as u16);
        }
        if let Some(coder) = &mut streams.user_data {
            let model = &mut self.users[usize::from(self.user >> 2)];
            self.user = coder.symbol(model.ready(256)) as u8;
        }
        if let Some(coder) = &mut streams.sources
            && trace.has_other_source()
        {
            self.source = self.source.wrapping_add(self.source_steps.next(coder, 0).0 as u16);
        }
        if let Some(coder) = &mut streams.times
            && trace.is_later()
        {
            self.time = self.times.next::<M, true>(coder, self.time);
        }
    }

    #[inline(always)]
    fn next_intensity<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        trace: PointChanges,
        returns: ReturnNumbers,
    ) {
        let place = usize::from(returns.is_first()) << 1 | usize::from(returns.is_last());
        let step = self.intensity_steps.next(coder, place).0;
        let last = &mut self.intensities[place << 1 | usize::from(trace.is_later())];
        *last = last.wrapping_add(step as u16);
        self.intensity = *last;
    }

    /// Encodes the intensity of the next point.
    #[inline(always)]
    pub(super) fn put_intensity(
        &mut self,
        coder: &mut RangeEncoder,
        at: &DecodedPosition,
        record: &[u8; RECORD],
    ) {
        let place = usize::from(at.returns.is_first()) << 1 | usize::from(at.returns.is_last());
        let last = &mut self.intensities[place << 1 | usize::from(at.trace.is_later())];
        let intensity = two_bytes(record, 12);
        self.intensity_steps.put(coder, place, step(*last, intensity));
        *last = intensity;
    }

    /// Encodes the scan angle of the next point.
    #[inline(always)]
    pub(super) fn put_angle(
        &mut self,
        coder: &mut RangeEncoder,
        at: &DecodedPosition,
        record: &[u8; RECORD],
    ) {
        if at.trace.has_other_angle() {
            let angle = two_bytes(record, 18);
            let later = usize::from(at.trace.is_later());
            self.angle_steps.put(coder, later, step(self.angle, angle));
            self.angle = angle;
        }
    }

    /// Encodes the user data of the next point.
    #[inline(always)]
    pub(super) fn put_user(
        &mut self,
        coder: &mut RangeEncoder,
        _: &DecodedPosition,
        record: &[u8; RECORD],
    ) {
        let model = &mut self.users[usize::from(self.user >> 2)];
        coder.symbol(model.ready(256), record[17].into());
        self.user = record[17];
    }

    /// Encodes the point source of the next point.
    #[inline(always)]
    pub(super) fn put_source(
        &mut self,
        coder: &mut RangeEncoder,
        at: &DecodedPosition,
        record: &[u8; RECORD],
    ) {
        if at.trace.has_other_source() {
            let source = two_bytes(record, 20);
            self.source_steps.put(coder, 0, step(self.source, source));
            self.source = source;
        }
    }

    /// Encodes the time of the next point.
    #[inline(always)]
    pub(super) fn put_time(
        &mut self,
        coder: &mut RangeEncoder,
        at: &DecodedPosition,
        record: &[u8; RECORD],
    ) {
        if at.trace.is_later() {
            self.times.put(coder, time(record));
        }
    }

    /// Stores the fields in the record.
    #[inline(always)]
    fn put(&self, record: &mut [u8; RECORD]) {
        record[12..14].copy_from_slice(&self.intensity.to_le_bytes());
        record[17] = self.user;
        record[18..20].copy_from_slice(&self.angle.to_le_bytes());
        record[20..22].copy_from_slice(&self.source.to_le_bytes());
        record[22..].copy_from_slice(&self.time.to_le_bytes());
    }
}

/// The time of a record, as bits.
#[inline(always)]
pub(super) fn time(record: &[u8; RECORD]) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|i| record[22 + i]))
}

/// The unsigned number at a byte of a record.
#[inline(always)]
fn two_bytes(record: &[u8; RECORD], at: usize) -> u16 {
    u16::from_le_bytes([record[at], record[at + 1]])
}

/// A step between numbers of 16 bits, which wraps.
#[inline(always)]
fn step(from: u16, to: u16) -> i32 {
    i32::from(to.wrapping_sub(from) as i16)
}

/// Contexts of all channels. They are large: allocated once per thread and reused.
pub(super) struct ChannelHeads {
    channels: Box<[AttributeContext; 4]>,
    current: usize,
}

impl ChannelHeads {
    #[cold]
    #[inline(never)]
    pub(super) fn new() -> Self {
        let channels: Vec<_> = (0..4).map(|_| AttributeContext::new()).collect();
        let channels = channels.into_boxed_slice().try_into();
        Self { channels: channels.unwrap_or_else(|_| unreachable!()), current: 0 }
    }

    /// Begins a chunk after a point of `channel`.
    pub(super) fn begin(&mut self, channel: usize, record: &[u8; RECORD]) {
        self.channels.iter_mut().for_each(|channel| channel.is_used = false);
        self.channels[channel & 3].begin(record);
        self.current = channel;
    }

    /// Decodes the next point and stores its fields in its record.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        streams: &mut RestStreams<M>,
        trace: PointChanges,
        returns: ReturnNumbers,
        record: &mut [u8; RECORD],
    ) {
        if trace.channel() != self.current {
            self.switch(trace.channel());
        }
        let channel = &mut self.channels[self.current & 3];
        channel.next(streams, trace, returns);
        channel.put(record);
    }

    /// Switches to the channel of a point for encoding it; a new one begins after the record `before`.
    #[inline(always)]
    pub(super) fn turn(&mut self, channel: usize, before: &[u8; RECORD]) -> &mut AttributeContext {
        self.current = channel;
        let channel = &mut self.channels[channel & 3];
        if !channel.is_used {
            channel.begin(before);
        }
        channel
    }

    /// Switches to a channel; a new one begins after the last point of the other.
    #[inline(never)]
    fn switch(&mut self, channel: usize) {
        let mut record = [0; RECORD];
        self.channels[self.current & 3].put(&mut record);
        self.current = channel;
        let channel = &mut self.channels[channel & 3];
        if !channel.is_used {
            channel.begin(&record);
        }
    }
}
