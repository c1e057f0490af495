//! Colours and infrared: predicted differences of each byte. The state is the last record.

use super::coder::RangeDecoder;
use super::integer::IntegerDecoder;
use super::machine::InstructionSet;
use super::model::ArithmeticModel;
use super::range_encoder::RangeEncoder;

/// Decoder of colours, version 1.
pub(super) struct OldColour {
    changes: ArithmeticModel<4>,
    byte: IntegerDecoder<6>,
}

impl OldColour {
    pub(super) fn new() -> Self {
        Self { changes: ArithmeticModel::new(), byte: IntegerDecoder::new(8) }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        self.changes.clear();
        self.byte.clear();
    }

    /// Replaces the last colour by the next one.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        colour: &mut [u8; 6],
    ) {
        let changes = coder.symbol(self.changes.ready(64));
        for (number, byte) in colour.iter_mut().enumerate() {
            if changes >> number & 1 != 0 {
                *byte = byte.wrapping_add(self.byte.next(coder, number).0 as u8);
            }
        }
    }
}

/// Decoder of colours, version 2 and layered chunks.
pub(super) struct RgbColor {
    changes: ArithmeticModel<8>,
    bytes: [ArithmeticModel<16>; 6],
}

impl RgbColor {
    /// Bit of colours that are not grey.
    const COLOURED: usize = 1 << 6;

    pub(super) fn new() -> Self {
        Self { changes: ArithmeticModel::new(), bytes: [const { ArithmeticModel::new() }; 6] }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        self.changes.clear();
        self.bytes.iter_mut().for_each(ArithmeticModel::clear);
    }

    /// Replaces the last colour by the next one.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        colour: &mut [u8; 6],
    ) {
        let changes = coder.symbol(self.changes.ready(128));
        let last = colour.map(i32::from);
        let red = [
            self.byte(coder, changes, 0, &last, last[0]),
            self.byte(coder, changes, 1, &last, last[1]),
        ];
        *colour = [red[0], red[1], red[0], red[1], red[0], red[1]];
        if changes & Self::COLOURED != 0 {
            // Lower bytes, then upper ones: green is predicted from red, blue from both.
            for half in 0..2 {
                let red_step = i32::from(red[half]) - last[half];
                let expected = last[2 + half] + red_step;
                let green = self.byte(coder, changes, 2 + half, &last, expected);
                let step = (red_step + i32::from(green) - last[2 + half]) / 2;
                let expected = last[4 + half] + step;
                colour[2 + half] = green;
                colour[4 + half] = self.byte(coder, changes, 4 + half, &last, expected);
            }
        }
    }

    /// The next byte `number` of a colour: that of the last colour, or a difference from the expected one.
    #[inline(always)]
    fn byte<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        changes: usize,
        number: usize,
        last: &[i32; 6],
        expected: i32,
    ) -> u8 {
        match changes >> number & 1 {
            0 => last[number] as u8,
            _ => {
                let symbol = coder.symbol(self.bytes[number].ready(256));
                (expected.clamp(0, 255) as u8).wrapping_add(symbol as u8)
            }
        }
    }
}

impl RgbColor {
    /// Encodes a colour after the last one.
    #[inline(always)]
    pub(super) fn put(&mut self, coder: &mut RangeEncoder, last: &[u8; 6], colour: &[u8; 6]) {
        let bits = (0..6).map(|i| usize::from(colour[i] != last[i]) << i).sum::<usize>();
        let is_coloured = colour[..2] != colour[2..4] || colour[..2] != colour[4..];
        let changes = bits | (usize::from(is_coloured) * Self::COLOURED);
        coder.symbol(self.changes.ready(128), changes);
        let [last, colour] = [last, colour].map(|colour| colour.map(i32::from));
        let mut put = |number: usize, expected: i32| {
            if changes >> number & 1 != 0 {
                let symbol = (colour[number] as u8).wrapping_sub(expected.clamp(0, 255) as u8);
                coder.symbol(self.bytes[number].ready(256), symbol.into());
            }
        };
        put(0, last[0]);
        put(1, last[1]);
        if is_coloured {
            for half in 0..2 {
                let red_step = colour[half] - last[half];
                put(2 + half, last[2 + half] + red_step);
                let step = (red_step + colour[2 + half] - last[2 + half]) / 2;
                put(4 + half, last[4 + half] + step);
            }
        }
    }
}

impl NearInfrared {
    /// Encodes a value after the last one.
    #[inline(always)]
    pub(super) fn put(&mut self, coder: &mut RangeEncoder, last: &[u8; 2], value: &[u8; 2]) {
        let steps = [0, 1].map(|i| usize::from(value[i].wrapping_sub(last[i])));
        let changes = usize::from(steps[0] != 0) | usize::from(steps[1] != 0) << 1;
        coder.symbol(self.changes.ready(4), changes);
        for (step, model) in steps.into_iter().zip(&mut self.bytes).filter(|(step, _)| *step != 0) {
            coder.symbol(model.ready(256), step);
        }
    }
}

/// Decoder of near infrared.
pub(super) struct NearInfrared {
    changes: ArithmeticModel<1>,
    bytes: [ArithmeticModel<16>; 2],
}

impl NearInfrared {
    pub(super) fn new() -> Self {
        Self { changes: ArithmeticModel::new(), bytes: [const { ArithmeticModel::new() }; 2] }
    }

    /// Resets the models.
    pub(super) fn clear(&mut self) {
        self.changes.clear();
        self.bytes.iter_mut().for_each(ArithmeticModel::clear);
    }

    /// Replaces the last value by the next one.
    #[inline(always)]
    pub(super) fn next<M: InstructionSet>(
        &mut self,
        coder: &mut RangeDecoder<M>,
        value: &mut [u8; 2],
    ) {
        let changes = coder.symbol(self.changes.ready(4));
        for ((number, byte), model) in value.iter_mut().enumerate().zip(&mut self.bytes) {
            if changes >> number & 1 != 0 {
                *byte = byte.wrapping_add(coder.symbol(model.ready(256)) as u8);
            }
        }
    }
}
