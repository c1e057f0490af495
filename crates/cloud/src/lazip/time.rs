//! GPS times as 64-bit patterns: differences are predicted to be repeated, or to be a multiple of the last one.

use super::coder::RangeDecoder;
use super::integer::IntegerDecoder;
use super::machine::InstructionSet;
use super::model::ArithmeticModel;
use super::range_encoder::RangeEncoder;

/// Decodes eight raw bytes.
#[inline(always)]
pub(super) fn whole<M: InstructionSet>(coder: &mut RangeDecoder<M>) -> u64 {
    let lower = coder.raw(32);
    u64::from(coder.raw(32)) << 32 | u64::from(lower)
}

/// Decoder of times, version 1.
pub(super) struct OldTime {
    multiple: ArithmeticModel<64>,
    after_same: ArithmeticModel<1>,
    difference: IntegerDecoder<6>,
    last: i32,
    extremes: u32,
}

impl OldTime {
    /// Symbols of `multiple`; the last two are a raw time and an equal time, the one before them stands for all
    /// larger multiples.
    const MULTIPLES: usize = 512;
    const LARGEST: usize = Self::MULTIPLES - 3;
    const WHOLE: usize = Self::LARGEST + 1;
    const SAME: usize = Self::LARGEST + 2;

    pub(super) fn new() -> Self {
        Self {
            multiple: ArithmeticModel::new(),
            after_same: ArithmeticModel::new(),
            difference: IntegerDecoder::new(32),
            last: 0,
            extremes: 0,
        }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        self.multiple.clear();
        self.after_same.clear();
        self.difference.clear();
        (self.last, self.extremes) = (0, 0);
    }

    /// Decodes the time after `time`.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        time: u64,
    ) -> u64 {
        match self.last {
            0 => self.next_after_same(coder, time),
            last => self.next_multiple(coder, time, last),
        }
    }

    #[inline(always)]
    fn next_after_same<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        time: u64,
    ) -> u64 {
        match coder.symbol(self.after_same.ready(3)) {
            0 => time,
            1 => {
                self.last = self.difference.next(coder, 0).0;
                later(time, self.last)
            }
            _ => whole(coder),
        }
    }

    #[inline(always)]
    fn next_multiple<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        time: u64,
        last: i32,
    ) -> u64 {
        let multiple = coder.symbol(self.multiple.ready(Self::MULTIPLES));
        let (expected, circumstance) = match multiple {
            0 => (last.wrapping_div(4), 2),
            1 => (last, 1),
            2..10 => (last.wrapping_mul(multiple as i32), 3),
            10..50 => (last.wrapping_mul(multiple as i32), 4),
            50..=Self::LARGEST => (last.wrapping_mul(multiple as i32), 5),
            Self::WHOLE => return whole(coder),
            Self::SAME.. => return time,
        };
        // It wraps in LASzip too, whose numbers are of 32 bits.
        let difference = expected.wrapping_add(self.difference.next(coder, circumstance).0);
        match multiple {
            1 => (self.last, self.extremes) = (difference, 0),
            0 | Self::LARGEST => self.extreme(difference),
            _ => {}
        }
        later(time, difference)
    }

    fn extreme(&mut self, difference: i32) {
        self.extremes += 1;
        // As in LASzip: four extremes in a row are a new pace, not gaps between points.
        if self.extremes > 3 {
            (self.last, self.extremes) = (difference, 0);
        }
    }
}

#[inline(always)]
fn later(time: u64, difference: i32) -> u64 {
    time.wrapping_add_signed(difference.into())
}

/// Decoder of times, version 2 and layered chunks: like version 1, with four interleaved sequences.
pub(super) struct GpsTime {
    multiple: ArithmeticModel<64>,
    after_same: ArithmeticModel<1>,
    difference: IntegerDecoder<9>,
    /// Last time of each sequence except the current one.
    times: [u64; 4],
    /// Last difference of each sequence, and the number of consecutive outliers.
    last: [i32; 4],
    extremes: [u32; 4],
    current: usize,
    newest: usize,
}

/// The next time of a sequence, or the number of sequences to skip.
enum DecodedTime {
    Time(u64),
    Switch(usize),
}

impl GpsTime {
    /// Largest multiple; larger symbols are negative multiples.
    const LARGEST: usize = 500;
    /// Symbol of the multiple -1.
    const NEGATIVE: usize = Self::LARGEST + 1;
    /// Symbol of the most negative multiple and of all below it.
    const SMALLEST: usize = Self::LARGEST + 10;
    const SAME: usize = Self::SMALLEST + 1;
    const WHOLE: usize = Self::SMALLEST + 2;
    /// Symbols of `multiple`; the last three switch the sequence.
    const MULTIPLES: usize = Self::SMALLEST + 6;
    /// Symbols of `after_same`, likewise.
    const AFTER_SAME: usize = 6;

    pub(super) fn new() -> Self {
        Self {
            multiple: ArithmeticModel::new(),
            after_same: ArithmeticModel::new(),
            difference: IntegerDecoder::new(32),
            times: [0; 4],
            last: [0; 4],
            extremes: [0; 4],
            current: 0,
            newest: 0,
        }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        self.multiple.clear();
        self.after_same.clear();
        self.difference.clear();
        (self.times, self.last, self.extremes) = ([0; 4], [0; 4], [0; 4]);
        (self.current, self.newest) = (0, 0);
    }

    /// Decodes the time after `time`. Equal times have a symbol unless it `IS_OTHER`.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet, const IS_OTHER: bool>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        time: u64,
    ) -> u64 {
        let mut last_time = time;
        // An encoder switches at most once.
        for _ in 0..2 {
            let found = match self.last[self.current & 3] {
                0 => self.next_after_same::<M, IS_OTHER>(coder, last_time),
                last => self.next_multiple::<M, IS_OTHER>(coder, last_time, last),
            };
            match found {
                DecodedTime::Time(time) => return time,
                DecodedTime::Switch(by) => {
                    self.times[self.current & 3] = last_time;
                    self.current = (self.current + by) & 3;
                    last_time = self.times[self.current & 3];
                }
            }
        }
        coder.doubt();
        last_time
    }

    /// Decodes the next time of a sequence with equal times.
    #[inline(always)]
    fn next_after_same<M: InstructionSet, const IS_OTHER: bool>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        time: u64,
    ) -> DecodedTime {
        let left_out = usize::from(IS_OTHER);
        let symbol = coder.symbol(self.after_same.ready(Self::AFTER_SAME - left_out)) + left_out;
        DecodedTime::Time(match symbol {
            0 => time,
            1 => {
                let difference = self.difference.next(coder, 0).0;
                self.last[self.current & 3] = difference;
                self.extremes[self.current & 3] = 0;
                later(time, difference)
            }
            2 => self.begin(coder, time),
            _ => return DecodedTime::Switch(symbol - 2),
        })
    }

    /// Decodes the next time of a sequence whose last difference was `last`.
    #[inline(always)]
    fn next_multiple<M: InstructionSet, const IS_OTHER: bool>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        time: u64,
        last: i32,
    ) -> DecodedTime {
        let left_out = usize::from(IS_OTHER);
        let mut symbol = coder.symbol(self.multiple.ready(Self::MULTIPLES - left_out));
        symbol += if symbol < Self::SAME { 0 } else { left_out };
        match symbol {
            0..=Self::SMALLEST => {}
            Self::SAME => return DecodedTime::Time(time),
            Self::WHOLE => return DecodedTime::Time(self.begin(coder, time)),
            _ => return DecodedTime::Switch(symbol - Self::WHOLE),
        }
        let multiple = match symbol <= Self::LARGEST {
            true => symbol as i32,
            false => Self::LARGEST as i32 - symbol as i32,
        };
        let step = self.difference.next(coder, Self::circumstance(symbol)).0;
        let difference = last.wrapping_mul(multiple).wrapping_add(step);
        self.learn(symbol, difference);
        DecodedTime::Time(later(time, difference))
    }

    /// Resets the models, for encoding the times after `time`.
    pub(super) fn begin_at(&mut self, time: u64) {
        self.clear();
        self.times[0] = time;
    }

    /// Encodes the time after the last one, which differs; see [`begin_at`](Self::begin_at).
    #[inline(always)]
    pub(super) fn put(&mut self, coder: &mut RangeEncoder, time: u64) {
        // A sequence to which the time belongs is switched to at most once.
        for _ in 0..2 {
            let current = self.current & 3;
            let Some(difference) = self.difference_to(current, time) else {
                let other = (1..4).find(|by| self.difference_to(current + by, time).is_some());
                self.put_symbol(coder, Self::WHOLE + other.unwrap_or(0));
                match other {
                    Some(by) => self.current = (current + by) & 3,
                    None => return self.put_whole(coder, time),
                }
                continue;
            };
            match self.last[current] {
                0 => {
                    coder.symbol(self.after_same.ready(Self::AFTER_SAME - 1), 0);
                    self.difference.put(coder, 0, difference);
                    (self.last[current], self.extremes[current]) = (difference, 0);
                }
                last => self.put_multiple(coder, last, difference),
            }
            self.times[current] = time;
            return;
        }
    }

    /// The difference of a time from the last one of a sequence, if it has 32 bits.
    #[inline(always)]
    fn difference_to(&self, sequence: usize, time: u64) -> Option<i32> {
        i32::try_from(time.wrapping_sub(self.times[sequence & 3]) as i64).ok()
    }

    /// Encodes a symbol from [`WHOLE`](Self::WHOLE) on, with the models of the current sequence.
    fn put_symbol(&mut self, coder: &mut RangeEncoder, symbol: usize) {
        // Equal times have no symbol.
        match self.last[self.current & 3] {
            0 => {
                let symbol = symbol - Self::WHOLE + 1;
                coder.symbol(self.after_same.ready(Self::AFTER_SAME - 1), symbol);
            }
            _ => coder.symbol(self.multiple.ready(Self::MULTIPLES - 1), symbol - 1),
        }
    }

    /// Encodes the first time of a new sequence.
    fn put_whole(&mut self, coder: &mut RangeEncoder, time: u64) {
        let [upper, before] = [time, self.times[self.current & 3]].map(|time| (time >> 32) as i32);
        self.difference.put(coder, 8, upper.wrapping_sub(before));
        coder.raw(32, time as u32);
        self.newest = (self.newest + 1) & 3;
        self.current = self.newest;
        self.last[self.current & 3] = 0;
        self.extremes[self.current & 3] = 0;
        self.times[self.current & 3] = time;
    }

    /// Encodes a difference as a multiple of the `last` one.
    #[inline(always)]
    fn put_multiple(&mut self, coder: &mut RangeEncoder, last: i32, difference: i32) {
        let multiple = difference as f32 / last as f32;
        // Halves are rounded away from zero, as LASzip does.
        let multiple = (multiple + if multiple >= 0.0 { 0.5 } else { -0.5 }) as i32;
        let multiple = multiple.clamp(-10, Self::LARGEST as i32);
        let symbol = match multiple {
            0.. => multiple as usize,
            _ => Self::LARGEST + multiple.unsigned_abs() as usize,
        };
        coder.symbol(self.multiple.ready(Self::MULTIPLES - 1), symbol);
        let step = difference.wrapping_sub(last.wrapping_mul(multiple));
        self.difference.put(coder, Self::circumstance(symbol), step);
        self.learn(symbol, difference);
    }

    /// Context of the remainder of a multiple.
    #[inline(always)]
    fn circumstance(symbol: usize) -> usize {
        match symbol {
            0 => 7,
            1 => 1,
            2..10 => 2,
            10..Self::LARGEST => 3,
            Self::LARGEST => 4,
            Self::NEGATIVE..Self::SMALLEST => 5,
            _ => 6,
        }
    }

    /// Counts a difference by its multiple.
    #[inline(always)]
    fn learn(&mut self, symbol: usize, difference: i32) {
        match symbol {
            1 => self.extremes[self.current & 3] = 0,
            0 | Self::LARGEST | Self::SMALLEST => self.extreme(difference),
            _ => {}
        }
    }

    /// Counts an outlier difference.
    #[inline(always)]
    fn extreme(&mut self, difference: i32) {
        let extremes = &mut self.extremes[self.current & 3];
        *extremes += 1;
        if *extremes > 3 {
            *extremes = 0;
            self.last[self.current & 3] = difference;
        }
    }

    /// Replaces the oldest sequence by a new one; returns its first time.
    #[inline(always)]
    fn begin<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>, time: u64) -> u64 {
        let upper = ((time >> 32) as u32).wrapping_add_signed(self.difference.next(coder, 8).0);
        self.times[self.current & 3] = time;
        self.newest = (self.newest + 1) & 3;
        self.current = self.newest;
        self.last[self.current & 3] = 0;
        self.extremes[self.current & 3] = 0;
        u64::from(upper) << 32 | u64::from(coder.raw(32))
    }
}
