//! Records of test clouds, tame and wild.

/// Numbers that look random.
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        (self.0 ^ self.0 >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 8
    }

    pub(super) fn below(&mut self, end: u64) -> u64 {
        self.roll() % end
    }

    fn one_in(&mut self, times: u64) -> bool {
        self.below(times) == 0
    }

    /// A number whose size is random, too.
    fn wild(&mut self) -> i32 {
        (self.roll() as i32) >> self.below(32)
    }
}

/// How the fields of test records run.
#[derive(Clone, Copy, Debug)]
pub(super) enum Style {
    /// Small steps, few changes: as in the field.
    Walk,
    /// The same record again and again.
    Constant,
    /// Anything may be anything.
    Wild,
}

pub(super) const STYLES: [Style; 3] = [Style::Walk, Style::Constant, Style::Wild];

/// Records of format 6 and what follows in `size` bytes.
pub(super) fn new_records(style: Style, size: usize, count: usize, seed: u64) -> Vec<u8> {
    let mut dice = Dice(seed);
    let mut record = vec![0_u8; size];
    record.fill_with(|| dice.roll() as u8);
    tame(&mut record);
    set_time(&mut record, 22, &mut dice);
    let mut records = Vec::new();
    for _ in 0..count {
        records.extend_from_slice(&record);
        match style {
            Style::Walk => walk(&mut record, &mut dice),
            Style::Constant => {}
            Style::Wild => go_wild(&mut record, &mut dice),
        }
    }
    records
}

pub(super) fn put(record: &mut [u8], at: usize, bytes: &[u8]) {
    record[at..at + bytes.len()].copy_from_slice(bytes);
}

pub(super) fn axis(record: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(std::array::from_fn(|i| record[at + i]))
}

fn walk(record: &mut [u8], dice: &mut Dice) {
    for (at, reach) in [(0, 2000), (4, 300), (8, 70)] {
        let step = dice.below(reach) as i32 - reach as i32 / 3;
        let place = axis(record, at).wrapping_add(step);
        put(record, at, &place.to_le_bytes());
    }
    let of = 1 + dice.below(5) as u8;
    record[14] = of << 4 | (1 + dice.below(u64::from(of)) as u8);
    if dice.one_in(9) {
        record[15] = dice.below(4) as u8 | record[15] & 0xf0;
    }
    if dice.one_in(50) {
        record[15] = dice.roll() as u8;
    }
    if dice.one_in(5) {
        record[16] = [1, 2, 3, 5, 6][dice.below(5) as usize];
    }
    if dice.one_in(2) {
        set_time(record, 22, dice);
    }
    record[30..].iter_mut().for_each(|byte| *byte = byte.wrapping_add(dice.below(3) as u8));
    tame(record);
}

fn go_wild(record: &mut [u8], dice: &mut Dice) {
    for at in [0, 4, 8] {
        let place = match dice.below(4) {
            0 => axis(record, at).wrapping_add(dice.wild()),
            1 => [i32::MIN, i32::MAX, 0, -1][dice.below(4) as usize],
            _ => dice.wild(),
        };
        put(record, at, &place.to_le_bytes());
    }
    for byte in &mut record[12..] {
        if dice.one_in(2) {
            *byte = dice.roll() as u8;
        }
    }
    tame(record);
    set_time(record, 22, dice);
}

/// Keeps what follows the point small: the crate computes with offsets of wave packets.
fn tame(record: &mut [u8]) {
    record[30..].iter_mut().for_each(|byte| *byte &= 127);
}

/// A time that is often far from the one before, but no farther than the crate can bear.
fn set_time(record: &mut [u8], at: usize, dice: &mut Dice) {
    let size = dice.below(40);
    let time = dice.below(1 << size) as f64 / 8.0;
    put(record, at, &time.to_le_bytes());
}

/// Records of formats 0 to 5; the time, if there is one, is at 20.
pub(super) fn old_records(style: Style, size: usize, count: usize, seed: u64) -> Vec<u8> {
    let mut dice = Dice(seed);
    let mut record = vec![0_u8; size];
    let mut records = Vec::new();
    for _ in 0..count {
        records.extend_from_slice(&record);
        match style {
            Style::Walk => old_walk(&mut record, &mut dice),
            Style::Constant => {}
            Style::Wild => old_wild(&mut record, &mut dice),
        }
    }
    records
}

fn old_walk(record: &mut [u8], dice: &mut Dice) {
    for (at, reach) in [(0, 2000), (4, 300), (8, 70)] {
        let step = dice.below(reach) as i32 - reach as i32 / 3;
        put(record, at, &(axis(record, at) + step).to_le_bytes());
    }
    for byte in &mut record[12..20] {
        if dice.one_in(6) {
            *byte = dice.below(70) as u8;
        }
    }
    if record.len() >= 28 && dice.one_in(2) {
        let time = axis(record, 20) + 100 + dice.below(3) as i32;
        put(record, 20, &time.to_le_bytes());
        if dice.one_in(30) {
            record[25] = dice.below(4) as u8;
        }
    }
    let tail = record.get_mut(28..).unwrap_or_default();
    tail.iter_mut().for_each(|byte| *byte = (*byte + dice.below(2) as u8) & 127);
}

fn old_wild(record: &mut [u8], dice: &mut Dice) {
    for at in [0, 4, 8] {
        // The first version of the crate cannot bear larger steps.
        put(record, at, &(dice.wild() / 4).to_le_bytes());
    }
    for byte in &mut record[12..20] {
        if dice.one_in(2) {
            *byte = dice.roll() as u8;
        }
    }
    for byte in record.get_mut(20..).unwrap_or_default() {
        if dice.one_in(2) {
            *byte = dice.roll() as u8 & 63;
        }
    }
}
