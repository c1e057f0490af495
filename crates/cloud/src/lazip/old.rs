//! The common fields of point formats 0 to 5, versions 1 and 2.

use super::coder::RangeDecoder;
use super::integer::IntegerDecoder;
use super::machine::InstructionSet;
use super::median::FiveValueMedian;
use super::model::ArithmeticModel;
use super::point::LazPoint;
use super::returns::ReturnNumbers;

/// Bytes of these fields.
pub(super) const OLD_RECORD: usize = 20;

/// Bits of the symbol of changed fields.
const INTENSITY: usize = 1 << 4;
const BITS: usize = 1 << 5;
const CLASS: usize = 1 << 3;
const ANGLE: usize = 1 << 2;
const USER: usize = 1 << 1;
const SOURCE: usize = 1;

/// The common fields.
#[derive(Clone, Copy)]
pub(super) struct Point10Fields {
    place: [i32; 3],
    intensity: u16,
    /// Return number, number of returns, scan direction, edge of flight line.
    bits: u8,
    /// The class, and flags in its upper bits.
    class: u8,
    angle: u8,
    user: u8,
    source: u16,
}

impl Point10Fields {
    /// The fields of a record.
    pub(super) fn new(record: &[u8; OLD_RECORD]) -> Self {
        Self {
            place: [0, 4, 8].map(|at| i32::from_le_bytes(std::array::from_fn(|i| record[at + i]))),
            intensity: u16::from_le_bytes([record[12], record[13]]),
            bits: record[14],
            class: record[15],
            angle: record[16],
            user: record[17],
            source: u16::from_le_bytes([record[18], record[19]]),
        }
    }

    /// The record of the fields.
    #[inline(always)]
    fn record(self) -> [u8; OLD_RECORD] {
        let mut record = [0; OLD_RECORD];
        record[..12].copy_from_slice(self.place.map(i32::to_le_bytes).as_flattened());
        record[12..14].copy_from_slice(&self.intensity.to_le_bytes());
        record[14..18].copy_from_slice(&[self.bits, self.class, self.angle, self.user]);
        record[18..].copy_from_slice(&self.source.to_le_bytes());
        record
    }

    fn returns(self) -> ReturnNumbers {
        ReturnNumbers::new(self.bits & 7, self.bits >> 3 & 7)
    }

    fn point(self) -> LazPoint {
        LazPoint {
            place: self.place,
            returns: self.returns(),
            class: self.class & 31,
            flags: self.class >> 5 | self.bits >> 2 & 0x30,
        }
    }
}

/// Decoder context.
pub(super) struct Point10Context {
    version: u16,
    last: Point10Fields,
    /// Recent steps along x and y, by group of returns.
    steps: [[FiveValueMedian; 2]; 16],
    /// The last three steps along x and y, and the index of the oldest (version 1).
    recent: [[i32; 2]; 3],
    oldest: usize,
    /// Last height, by distance of the return from the last one.
    heights: [i32; 8],
    /// Last intensity, by group of returns (version 2).
    intensities: [u16; 16],
    changes: ArithmeticModel<4>,
    bits: Vec<ArithmeticModel<16>>,
    classes: Vec<ArithmeticModel<16>>,
    users: Vec<ArithmeticModel<16>>,
    angles: [ArithmeticModel<16>; 2],
    angle: IntegerDecoder<2>,
    intensity: IntegerDecoder<4>,
    source: IntegerDecoder<1>,
    x: IntegerDecoder<2>,
    y: IntegerDecoder<22>,
    z: IntegerDecoder<20>,
}

impl Point10Context {
    #[cold]
    #[inline(never)]
    pub(super) fn boxed() -> Box<Self> {
        Box::new(Self {
            version: 2,
            last: Point10Fields::new(&[0; OLD_RECORD]),
            steps: [[const { FiveValueMedian::new() }; 2]; 16],
            recent: [[0; 2]; 3],
            oldest: 0,
            heights: [0; 8],
            intensities: [0; 16],
            changes: ArithmeticModel::new(),
            bits: vec![ArithmeticModel::new(); 256],
            classes: vec![ArithmeticModel::new(); 256],
            users: vec![ArithmeticModel::new(); 256],
            angles: [const { ArithmeticModel::new() }; 2],
            angle: IntegerDecoder::new(8),
            intensity: IntegerDecoder::new(16),
            source: IntegerDecoder::new(16),
            x: IntegerDecoder::new(32),
            y: IntegerDecoder::new(32),
            z: IntegerDecoder::new(32),
        })
    }

    /// Restarts after the first point.
    pub(super) fn begin(&mut self, version: u16, first: Point10Fields) -> LazPoint {
        self.version = version;
        self.last = first;
        self.steps = [[FiveValueMedian::new(); 2]; 16];
        self.recent = [[0; 2]; 3];
        self.oldest = 0;
        self.heights = [0; 8];
        self.intensities = [0; 16];
        self.changes.clear();
        for models in [&mut self.bits, &mut self.classes, &mut self.users] {
            models.iter_mut().for_each(ArithmeticModel::clear);
        }
        self.angles.iter_mut().for_each(ArithmeticModel::clear);
        self.angle.clear();
        self.intensity.clear();
        self.source.clear();
        self.x.clear();
        self.y.clear();
        self.z.clear();
        first.point()
    }

    /// The record of the last point.
    #[inline(always)]
    pub(super) fn record(&self) -> [u8; OLD_RECORD] {
        self.last.record()
    }

    /// Decodes the next point.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) -> LazPoint {
        match self.version {
            1 => self.next_1(coder),
            _ => self.next_2(coder),
        }
        self.last.point()
    }

    #[inline(always)]
    fn next_2<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) {
        let changes = coder.symbol(self.changes.ready(64));
        if changes & BITS != 0 {
            self.next_bits(coder);
        }
        let returns = self.last.returns();
        let group = returns.old_group();
        let intensity = &mut self.intensities[group];
        if changes & INTENSITY != 0 {
            let difference = self.intensity.next(coder, group.min(3)).0;
            *intensity = intensity.wrapping_add(difference as u16);
        }
        self.last.intensity = *intensity;
        if changes & CLASS != 0 {
            self.next_class(coder);
        }
        if changes & ANGLE != 0 {
            let direction = usize::from(self.last.bits >> 6 & 1);
            let difference = coder.symbol(self.angles[direction].ready(256));
            self.last.angle = self.last.angle.wrapping_add(difference as u8);
        }
        if changes & USER != 0 {
            self.next_user(coder);
        }
        if changes & SOURCE != 0 {
            self.next_source(coder);
        }
        let is_single = usize::from(returns.is_single());
        let [x_steps, y_steps] = &mut self.steps[group];
        let (x, x_size) = self.x.next(coder, is_single);
        // The lowest bit of the size makes room for whether the return is single, as in LASzip: contexts
        // are even numbers up to 20, and one more for single returns.
        let detail = (x_size & !1).min(20) as usize;
        let (y, y_size) = self.y.next(coder, detail | is_single);
        let detail = (((x_size + y_size) / 2) & !1).min(18) as usize;
        let (z, _) = self.z.next(coder, detail | is_single);
        let step = [x_steps.go::<M>(x), y_steps.go::<M>(y)];
        let height = &mut self.heights[returns.depth()];
        *height = height.wrapping_add(z);
        let [last_x, last_y, _] = self.last.place;
        self.last.place = [last_x.wrapping_add(step[0]), last_y.wrapping_add(step[1]), *height];
    }

    #[inline(always)]
    fn next_1<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) {
        let (x, x_size) = self.x.next(coder, 0);
        let (y, y_size) = self.y.next(coder, x_size.min(19) as usize);
        let size = (x_size + y_size) / 2;
        let (z, _) = self.z.next(coder, size.min(19) as usize);
        self.go([x, y, z]);
        let changes = coder.symbol(self.changes.ready(64));
        // Version 1 has these two in reverse order.
        if changes & BITS != 0 {
            let difference = self.intensity.next(coder, 0).0;
            self.last.intensity = self.last.intensity.wrapping_add(difference as u16);
        }
        if changes & INTENSITY != 0 {
            self.next_bits(coder);
        }
        if changes & CLASS != 0 {
            self.next_class(coder);
        }
        if changes & ANGLE != 0 {
            let difference = self.angle.next(coder, usize::from(size < 3)).0;
            self.last.angle = self.last.angle.wrapping_add(difference as u8);
        }
        if changes & USER != 0 {
            self.next_user(coder);
        }
        if changes & SOURCE != 0 {
            self.next_source(coder);
        }
    }

    /// Adds the median of the last three steps along x and y, and the differences.
    #[inline(always)]
    fn go(&mut self, difference: [i32; 3]) {
        let [a, b, c] = self.recent;
        let step = [0, 1].map(|axis| {
            let [a, b, c] = [a[axis], b[axis], c[axis]];
            let median = a.min(b).max(a.max(b).min(c));
            median.wrapping_add(difference[axis])
        });
        self.recent[self.oldest] = step;
        self.oldest = (self.oldest + 1) % 3;
        let [x, y, z] = self.last.place;
        let [east, north] = step;
        self.last.place =
            [x.wrapping_add(east), y.wrapping_add(north), z.wrapping_add(difference[2])];
    }

    #[inline(always)]
    fn next_bits<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) {
        let bits = &mut self.last.bits;
        *bits = coder.symbol(self.bits[usize::from(*bits)].ready(256)) as u8;
    }

    #[inline(always)]
    fn next_class<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) {
        let class = &mut self.last.class;
        *class = coder.symbol(self.classes[usize::from(*class)].ready(256)) as u8;
    }

    #[inline(always)]
    fn next_user<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) {
        let user = &mut self.last.user;
        *user = coder.symbol(self.users[usize::from(*user)].ready(256)) as u8;
    }
    #[inline(always)]
    fn next_source<M: InstructionSet>(&mut self, coder: &mut RangeDecoder<M>) {
        let source = &mut self.last.source;
        *source = source.wrapping_add(self.source.next(coder, 0).0 as u16);
    }
}
