//! Contexts of a scanner channel for intensities, scan angles, user data, point sources and times, for whole records
//! of a layered chunk.

use super::coder::RangeDecoder;
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
        self.set(record);
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

    /// Encodes the next point.
    #[inline(always)]
    fn encode(
        &mut self,
        streams: &mut AttributeEncoders,
        trace: PointChanges,
        returns: ReturnNumbers,
        record: &[u8; RECORD],
    ) {
        let two = |at: usize| u16::from_le_bytes([record[at], record[at + 1]]);
        // Steps of 16 bits wrap, and are signed.
        let step = |to: u16, from: u16| i32::from(to.wrapping_sub(from) as i16);
        if let Some(coder) = &mut streams.intensities {
            let place = usize::from(returns.is_first()) << 1 | usize::from(returns.is_last());
            let last = &mut self.intensities[place << 1 | usize::from(trace.is_later())];
            self.intensity_steps.put(coder, place, step(two(12), *last));
            *last = two(12);
        }
        if let Some(coder) = &mut streams.angles
            && trace.has_other_angle()
        {
            let later = usize::from(trace.is_later());
            self.angle_steps.put(coder, later, step(two(18), self.angle));
        }
        if let Some(coder) = &mut streams.user_data {
            let model = &mut self.users[usize::from(self.user >> 2)];
            coder.symbol(model.ready(256), record[17].into());
        }
        if let Some(coder) = &mut streams.sources
            && trace.has_other_source()
        {
            self.source_steps.put(coder, 0, step(two(20), self.source));
        }
        if let Some(coder) = &mut streams.times
            && trace.is_later()
        {
            self.times.put(coder, time(record));
        }
        self.set(record);
    }

    /// Takes the fields of a record.
    #[inline(always)]
    fn set(&mut self, record: &[u8; RECORD]) {
        self.intensity = u16::from_le_bytes([record[12], record[13]]);
        self.user = record[17];
        self.angle = u16::from_le_bytes([record[18], record[19]]);
        self.source = u16::from_le_bytes([record[20], record[21]]);
        self.time = time(record);
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

/// Encoders of the layers of attributes that are not constant.
pub(super) struct AttributeEncoders {
    pub(super) intensities: Option<RangeEncoder>,
    pub(super) angles: Option<RangeEncoder>,
    pub(super) user_data: Option<RangeEncoder>,
    pub(super) sources: Option<RangeEncoder>,
    pub(super) times: Option<RangeEncoder>,
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

    /// Encodes the next point.
    #[inline(always)]
    pub(super) fn encode(
        &mut self,
        streams: &mut AttributeEncoders,
        trace: PointChanges,
        returns: ReturnNumbers,
        record: &[u8; RECORD],
    ) {
        if trace.channel() != self.current {
            self.switch(trace.channel());
        }
        self.channels[self.current & 3].encode(streams, trace, returns, record);
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
