//! Adaptive models: symbol probabilities estimated from the preceding symbols.

use super::machine::{InstructionSet, Lanes};

/// Symbols compared at once.
const LANES: usize = 16;
/// Maximum sum of the counts of a model.
const MAX_COUNTS: u32 = 1 << 15;
/// Maximum sum of the counts of a bit model.
const MAX_BITS: u32 = 1 << 13;
/// End marker; larger than any position in the interval.
const NONE: u16 = u16::MAX;

/// A model of at most 16 * `B` symbols; `B` is a power of two.
///
/// A reset model is initialised when it is next used.
#[derive(Clone)]
pub(super) struct ArithmeticModel<const B: usize> {
    /// Start of each symbol in an interval of 2^15, then [`NONE`].
    starts: [Lanes; B],
    /// Every n-th of `starts`, so that there are 16.
    coarse: Lanes,
    counts: [Lanes; B],
    symbols: u16,
    /// Sum of the counts at the last update of `starts`.
    total: u16,
    /// Symbols between updates of `starts`.
    cycle: u16,
    /// Symbols until the next update; 0 for a reset model.
    left: u16,
}

/// A symbol and its part of the interval of 2^15.
pub(super) struct DecodedSymbol {
    pub(super) symbol: usize,
    pub(super) low: u32,
    pub(super) high: u32,
    /// Whether this is the last symbol, whose part ends with the interval.
    pub(super) is_last: bool,
}

impl<const B: usize> ArithmeticModel<B> {
    /// Blocks from one of `coarse` to the next.
    const STRIDE: usize = B.div_ceil(LANES);

    /// A reset model.
    pub(super) const fn new() -> Self {
        Self {
            starts: [[NONE; LANES]; B],
            coarse: [NONE; LANES],
            counts: [[0; LANES]; B],
            symbols: 0,
            total: 0,
            cycle: 0,
            left: 0,
        }
    }

    /// Resets the model.
    pub(super) fn clear(&mut self) {
        self.left = 0;
    }

    /// Prepares the model for use; a reset model gets `symbols` equally likely symbols.
    #[inline(always)]
    pub(super) fn ready(&mut self, symbols: usize) -> &mut Self {
        if self.left == 0 {
            self.begin(symbols);
        }
        self
    }

    #[cold]
    #[inline(never)]
    fn begin(&mut self, symbols: usize) {
        let symbols = symbols.min(LANES * B);
        self.symbols = symbols as u16;
        self.counts.as_flattened_mut()[..symbols].fill(1);
        self.starts.as_flattened_mut()[symbols..].fill(NONE);
        self.total = self.symbols;
        self.set();
        // This schedule and the one in `learn` are LASzip's: encoder and decoder have to learn at the same
        // symbols, or everything behind is noise.
        self.cycle = (self.symbols + 6) / 2;
        self.left = self.cycle;
    }

    /// The symbol at `place` in the interval.
    #[inline(always)]
    pub(super) fn find<M: InstructionSet>(&self, place: u32) -> DecodedSymbol {
        let place = place as u16;
        let block = match B {
            1 => 0,
            2..=4 => self.blocks_before(place, 1),
            5..=16 => M::last_at_most(&self.coarse, place),
            _ => {
                let block = M::last_at_most(&self.coarse, place) * Self::STRIDE;
                block + self.blocks_before(place, block + 1)
            }
        } % B;
        // The remainders never act. They are powers of two, and stand in for bounds checks, which cost a
        // branch for each symbol.
        self.part(LANES * block + M::last_at_most(&self.starts[block], place) % LANES)
    }

    /// The part of a symbol.
    #[inline(always)]
    pub(super) fn part(&self, symbol: usize) -> DecodedSymbol {
        let starts = self.starts.as_flattened();
        DecodedSymbol {
            symbol,
            low: u32::from(starts[symbol % (LANES * B)]),
            high: u32::from(starts[(symbol + 1) % (LANES * B)]),
            is_last: symbol + 1 == usize::from(self.symbols),
        }
    }

    /// Number of blocks from `first` that begin before `place`, within the resolution of `coarse`.
    #[inline(always)]
    fn blocks_before(&self, place: u16, first: usize) -> usize {
        let blocks = self.starts.iter().skip(first).take(Self::STRIDE.max(4) - 1);
        blocks.take_while(|lanes| lanes[0] <= place).count()
    }

    /// Counts `symbol`.
    #[inline(always)]
    pub(super) fn count(&mut self, symbol: usize) {
        self.counts.as_flattened_mut()[symbol % (LANES * B)] += 1;
        self.left -= 1;
        if self.left == 0 {
            self.learn();
        }
    }

    #[cold]
    #[inline(never)]
    fn learn(&mut self) {
        let mut total = u32::from(self.total) + u32::from(self.cycle);
        if total > MAX_COUNTS {
            let counts = &mut self.counts.as_flattened_mut()[..usize::from(self.symbols)];
            // Rounded up: a count of 0 would leave its symbol without a part of the interval.
            counts.iter_mut().for_each(|count| *count = count.div_ceil(2));
            total = counts.iter().map(|&count| u32::from(count)).sum();
        }
        self.total = total as u16;
        self.set();
        self.cycle = (self.cycle * 5 / 4).min((self.symbols + 6) * 8);
        self.left = self.cycle;
    }

    /// Updates the parts of the interval from the counts.
    fn set(&mut self) {
        let scale = (1 << 31) / u32::from(self.total);
        let symbols = usize::from(self.symbols);
        let starts = &mut self.starts.as_flattened_mut()[..symbols];
        let mut sum = 0;
        for (start, count) in starts.iter_mut().zip(self.counts.as_flattened()) {
            *start = ((scale * sum) >> 16) as u16;
            sum += u32::from(*count);
        }
        for (coarse, lanes) in self.coarse.iter_mut().zip(self.starts.iter().step_by(Self::STRIDE))
        {
            *coarse = lanes[0];
        }
    }
}

/// A model of a bit.
#[derive(Clone, Copy)]
pub(super) struct BitModel {
    /// Probability of zero, of 2^13.
    pub(super) zero: u32,
    zeros: u32,
    total: u32,
    cycle: u32,
    left: u32,
}

impl BitModel {
    /// A model with equally likely bits.
    pub(super) const fn new() -> Self {
        Self { zero: MAX_BITS / 2, zeros: 1, total: 2, cycle: 4, left: 4 }
    }

    /// Counts `bit`.
    #[inline(always)]
    pub(super) fn count(&mut self, bit: bool) {
        self.zeros += u32::from(!bit);
        self.left -= 1;
        if self.left == 0 {
            self.learn();
        }
    }

    #[cold]
    #[inline(never)]
    fn learn(&mut self) {
        self.total += self.cycle;
        if self.total > MAX_BITS {
            self.total = self.total.div_ceil(2);
            self.zeros = self.zeros.div_ceil(2);
            // Ones keep a part of the interval even where none came.
            self.total += u32::from(self.zeros == self.total);
        }
        let scale = (1 << 31) / self.total;
        self.zero = (self.zeros * scale) >> 18;
        self.cycle = (self.cycle * 5 / 4).min(64);
        self.left = self.cycle;
    }
}
