//! What follows the point in records of formats 0 to 5. Its values are not kept: it is decoded only
//! to get past it, as all fields share one stream.

use super::coder::Coder;
use super::integer::Integer;
use super::machine::Machine;
use super::model::Model;
use super::schema::Item;

/// A part of a record.
pub(super) enum Follow {
    OldTime(Box<OldTime>),
    Time(Box<Time>),
    OldColour(Box<OldColour>),
    Colour(Box<Colour>),
    Packet(Box<Packet>),
    Bytes(Vec<Model<16>>),
}

impl Follow {
    /// Whether the part is one of these.
    pub(super) fn is_known(item: &Item) -> bool {
        matches!(
            (item.kind, item.size, item.version),
            (7, 8, 1 | 2) | (8, 6, 1 | 2) | (9, 29, 1 | 2) | (0, 1.., 2)
        )
    }

    /// The decoder of a part that is known.
    pub(super) fn new(item: &Item) -> Self {
        match (item.kind, item.version) {
            (7, 1) => Self::OldTime(Box::new(OldTime::new())),
            (7, _) => Self::Time(Box::new(Time::new())),
            (8, 1) => Self::OldColour(Box::new(OldColour::new())),
            (8, _) => Self::Colour(Box::new(Colour::new())),
            (9, _) => Self::Packet(Box::new(Packet::new())),
            _ => Self::Bytes(vec![Model::new(); usize::from(item.size)]),
        }
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        match self {
            Self::OldTime(time) => **time = OldTime::new(),
            Self::Time(time) => **time = Time::new(),
            Self::OldColour(colour) => **colour = OldColour::new(),
            Self::Colour(colour) => **colour = Colour::new(),
            Self::Packet(packet) => **packet = Packet::new(),
            Self::Bytes(bytes) => bytes.iter_mut().for_each(Model::clear),
        }
    }

    /// Gets past the part in the next record.
    #[inline(always)]
    pub(super) fn next<M: Machine>(&mut self, coder: &mut Coder<M>) {
        match self {
            Self::OldTime(time) => time.next(coder),
            Self::Time(time) => time.next(coder),
            Self::OldColour(colour) => colour.next(coder),
            Self::Colour(colour) => colour.next(coder),
            Self::Packet(packet) => packet.next(coder),
            Self::Bytes(bytes) => {
                for model in bytes {
                    coder.symbol(model.ready(256));
                }
            }
        }
    }
}

/// A time of the first version: differences between numbers as bits are expected to repeat, or to be
/// a multiple of the last one.
pub(super) struct OldTime {
    multiple: Model<64>,
    after_same: Model<1>,
    difference: Integer<6>,
    last: i32,
    extremes: u32,
}

impl OldTime {
    /// Symbols of `multiple`; the last two are a new time and the same time, and the one before them
    /// stands for every larger multiple.
    const MULTIPLES: usize = 512;

    fn new() -> Self {
        Self {
            multiple: Model::new(),
            after_same: Model::new(),
            difference: Integer::new(32),
            last: 0,
            extremes: 0,
        }
    }

    #[inline(always)]
    fn next<M: Machine>(&mut self, coder: &mut Coder<M>) {
        if self.last == 0 {
            match coder.symbol(self.after_same.ready(3)) {
                0 => {}
                1 => self.last = self.difference.next(coder, 0).0,
                _ => whole(coder),
            }
            return;
        }
        let multiple = coder.symbol(self.multiple.ready(Self::MULTIPLES));
        const LARGEST: usize = OldTime::MULTIPLES - 3;
        match multiple {
            0 => {
                let difference = self.last.wrapping_div(4).wrapping_add(self.step(coder, 2));
                self.extreme(difference);
            }
            1 => {
                self.last = self.last.wrapping_add(self.step(coder, 1));
                self.extremes = 0;
            }
            2..10 => drop(self.step(coder, 3)),
            10..50 => drop(self.step(coder, 4)),
            50..LARGEST => drop(self.step(coder, 5)),
            LARGEST => {
                let expected = self.last.wrapping_mul(multiple as i32);
                let difference = expected.wrapping_add(self.step(coder, 5));
                self.extreme(difference);
            }
            510 => whole(coder),
            _ => {}
        }
    }

    #[inline(always)]
    fn step<M: Machine>(&mut self, coder: &mut Coder<M>, circumstance: usize) -> i32 {
        self.difference.next(coder, circumstance).0
    }

    fn extreme(&mut self, difference: i32) {
        self.extremes += 1;
        if self.extremes > 3 {
            self.last = difference;
            self.extremes = 0;
        }
    }
}

/// Gets past eight bytes that are stored as they are.
#[inline(always)]
fn whole<M: Machine>(coder: &mut Coder<M>) {
    coder.raw(32);
    coder.raw(32);
}

/// A time of the second version: as the first, of four interleaved sequences.
pub(super) struct Time {
    multiple: Model<64>,
    after_same: Model<1>,
    difference: Integer<9>,
    /// The last difference of each sequence, and how often it was far off.
    last: [i32; 4],
    extremes: [u32; 4],
    current: usize,
    newest: usize,
}

impl Time {
    /// Largest multiple; the symbols up to here are multiples, then negative ones follow.
    const LARGEST: usize = 500;
    /// Symbol of the multiple -1.
    const NEGATIVE: usize = Self::LARGEST + 1;
    /// Symbol of the most negative multiple, and of all below it.
    const SMALLEST: usize = Self::LARGEST + 10;
    const SAME: usize = Self::SMALLEST + 1;
    const WHOLE: usize = Self::SMALLEST + 2;
    /// Symbols of `multiple`; the last three switch to another sequence.
    const MULTIPLES: usize = Self::SMALLEST + 6;

    fn new() -> Self {
        Self {
            multiple: Model::new(),
            after_same: Model::new(),
            difference: Integer::new(32),
            last: [0; 4],
            extremes: [0; 4],
            current: 0,
            newest: 0,
        }
    }

    #[inline(always)]
    fn next<M: Machine>(&mut self, coder: &mut Coder<M>) {
        // An encoder switches once at most.
        for _ in 0..2 {
            let switch = match self.last[self.current & 3] {
                0 => self.next_after_same(coder),
                last => self.next_multiple(coder, last),
            };
            if switch == 0 {
                return;
            }
            self.current = (self.current + switch) & 3;
        }
        coder.doubt();
    }

    /// The next time of a sequence that stood still, or how many sequences to go on by.
    #[inline(always)]
    fn next_after_same<M: Machine>(&mut self, coder: &mut Coder<M>) -> usize {
        let symbol = coder.symbol(self.after_same.ready(6));
        match symbol {
            0 => {}
            1 => {
                self.last[self.current & 3] = self.step(coder, 0);
                self.extremes[self.current & 3] = 0;
            }
            2 => self.begin(coder),
            _ => return symbol - 2,
        }
        0
    }

    /// The next time, of a sequence whose last difference was `last`, or how many sequences to go on
    /// by.
    #[inline(always)]
    fn next_multiple<M: Machine>(&mut self, coder: &mut Coder<M>, last: i32) -> usize {
        let symbol = coder.symbol(self.multiple.ready(Self::MULTIPLES));
        match symbol {
            0 => self.extreme(coder, 0, 7),
            1 => {
                self.step(coder, 1);
                self.extremes[self.current & 3] = 0;
            }
            2..10 => drop(self.step(coder, 2)),
            10..Self::LARGEST => drop(self.step(coder, 3)),
            Self::LARGEST => self.extreme(coder, last.wrapping_mul(Self::LARGEST as i32), 4),
            Self::SMALLEST => self.extreme(coder, last.wrapping_mul(-10), 6),
            Self::NEGATIVE..Self::SMALLEST => drop(self.step(coder, 5)),
            Self::SAME => {}
            Self::WHOLE => self.begin(coder),
            _ => return symbol - Self::WHOLE,
        }
        0
    }

    #[inline(always)]
    fn step<M: Machine>(&mut self, coder: &mut Coder<M>, circumstance: usize) -> i32 {
        self.difference.next(coder, circumstance).0
    }

    /// Takes in a difference that is far from those expected.
    #[inline(always)]
    fn extreme<M: Machine>(&mut self, coder: &mut Coder<M>, expected: i32, circumstance: usize) {
        let difference = expected.wrapping_add(self.step(coder, circumstance));
        let extremes = &mut self.extremes[self.current & 3];
        *extremes += 1;
        if *extremes > 3 {
            *extremes = 0;
            self.last[self.current & 3] = difference;
        }
    }

    /// Begins a new sequence in place of the oldest.
    #[inline(always)]
    fn begin<M: Machine>(&mut self, coder: &mut Coder<M>) {
        self.step(coder, 8);
        coder.raw(32);
        self.newest = (self.newest + 1) & 3;
        self.current = self.newest;
        self.last[self.current & 3] = 0;
        self.extremes[self.current & 3] = 0;
    }
}

/// A colour of the first version.
pub(super) struct OldColour {
    changes: Model<4>,
    byte: Integer<6>,
}

impl OldColour {
    fn new() -> Self {
        Self { changes: Model::new(), byte: Integer::new(8) }
    }

    #[inline(always)]
    fn next<M: Machine>(&mut self, coder: &mut Coder<M>) {
        let changes = coder.symbol(self.changes.ready(64));
        for byte in 0..6 {
            if changes >> byte & 1 != 0 {
                self.byte.next(coder, byte);
            }
        }
    }
}

/// A colour of the second version.
pub(super) struct Colour {
    changes: Model<8>,
    bytes: [Model<16>; 6],
}

impl Colour {
    /// Stands for a colour that is not grey.
    const COLOURED: usize = 1 << 6;

    fn new() -> Self {
        Self { changes: Model::new(), bytes: [const { Model::new() }; 6] }
    }

    #[inline(always)]
    fn next<M: Machine>(&mut self, coder: &mut Coder<M>) {
        let changes = coder.symbol(self.changes.ready(128));
        // Red, then the lower bytes of green and blue, then the upper ones.
        let bytes: &[usize] = match changes & Self::COLOURED {
            0 => &[0, 1],
            _ => &[0, 1, 2, 4, 3, 5],
        };
        for &byte in bytes {
            if changes >> byte & 1 != 0 {
                coder.symbol(self.bytes[byte].ready(256));
            }
        }
    }
}

/// Where the waveform of a point is.
pub(super) struct Packet {
    descriptor: Model<16>,
    /// How the offset goes on, by how it went on before.
    offset: [Model<1>; 4],
    last: usize,
    difference: Integer<1>,
    size: Integer<1>,
    location: Integer<1>,
    direction: Integer<3>,
}

impl Packet {
    fn new() -> Self {
        Self {
            descriptor: Model::new(),
            offset: [const { Model::new() }; 4],
            last: 0,
            difference: Integer::new(32),
            size: Integer::new(32),
            location: Integer::new(32),
            direction: Integer::new(32),
        }
    }

    #[inline(always)]
    fn next<M: Machine>(&mut self, coder: &mut Coder<M>) {
        coder.symbol(self.descriptor.ready(256));
        self.last = coder.symbol(self.offset[self.last & 3].ready(4));
        match self.last {
            2 => drop(self.difference.next(coder, 0)),
            3 => whole(coder),
            _ => {}
        }
        self.size.next(coder, 0);
        self.location.next(coder, 0);
        for axis in 0..3 {
            self.direction.next(coder, axis);
        }
    }
}
