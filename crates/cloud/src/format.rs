//! Point formats of LAS: which fields their records have, and where (ASPRS LAS 1.4 R15, tables 6 to 18).

use terrane_base::error::{Error, Result};

use crate::raw::Flags;

/// A point format of LAS, 0 to 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PointFormat(u8);

impl Default for PointFormat {
    fn default() -> Self {
        Self(6)
    }
}

/// Bytes of fields.
pub(crate) const TIME: usize = 8;
pub(crate) const COLOUR: usize = 6;
pub(crate) const INFRARED: usize = 2;
pub(crate) const WAVE: usize = 29;

/// Degrees of a step of scan angles.
pub(crate) const ANGLES: f32 = 0.006;
/// Bits of the class in the formats before 6, which share their byte with marks.
const OLD_CLASS: u8 = 31;

/// Where fields are that not all formats have, from the beginning of a record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LasFieldOffsets {
    pub(crate) time: Option<usize>,
    pub(crate) colour: Option<usize>,
    pub(crate) infrared: Option<usize>,
    pub(crate) wave: Option<usize>,
    /// Bytes of all fields.
    pub(crate) size: usize,
}

impl PointFormat {
    /// How many formats there are.
    pub const COUNT: u8 = 11;
    /// Size of the fields that all formats have, before 6 and from 6 on.
    pub(crate) const OLD: usize = 20;
    pub(crate) const NEW: usize = 30;

    /// The format of this number.
    ///
    /// # Errors
    /// One that does not exist.
    pub fn new(number: u8) -> Result<Self> {
        if number < Self::COUNT {
            return Ok(Self(number));
        }
        Err(Error::usage(format!("unknown point format {number}")).remedy("choose 0 to 10"))
    }

    /// Its number.
    pub fn number(self) -> u8 {
        self.0
    }

    /// True for the formats of LAS 1.4.
    pub fn is_new(self) -> bool {
        self.0 >= 6
    }

    /// Whether its records have a packet of waveforms.
    pub fn has_waves(self) -> bool {
        matches!(self.0, 4 | 5 | 9 | 10)
    }

    /// Where a record has its time, if it has one.
    pub fn time_at(self) -> Option<usize> {
        self.places().time
    }

    /// Bytes of a record without extra bytes.
    pub fn size(self) -> usize {
        self.places().size
    }

    /// The number of a point's return, and how many its pulse has.
    pub fn returns(self, record: &[u8]) -> [u8; 2] {
        let (byte, bits) = (record[14], if self.is_new() { 4 } else { 3 });
        let most = (1 << bits) - 1;
        [byte & most, byte >> bits & most]
    }

    /// The class of a point.
    pub fn class(self, record: &[u8]) -> u8 {
        if self.is_new() { record[16] } else { record[15] & OLD_CLASS }
    }

    /// Gives a point another class, which the format can hold.
    pub fn set_class(self, record: &mut [u8], class: u8) {
        match self.is_new() {
            true => record[16] = class,
            false => record[15] = record[15] & !OLD_CLASS | class & OLD_CLASS,
        }
    }

    /// The file or flight line that a point came from.
    pub fn source(self, record: &[u8]) -> u16 {
        let at = if self.is_new() { 20 } else { 18 };
        u16::from_le_bytes([record[at], record[at + 1]])
    }

    /// The angle of a point's beam from upright, in steps of the format.
    pub fn angle(self, record: &[u8]) -> i16 {
        match self.is_new() {
            true => i16::from_le_bytes([record[18], record[19]]),
            false => i8::from_le_bytes([record[16]]).into(),
        }
    }

    /// The marks of a point.
    pub fn flags(self, record: &[u8]) -> Flags {
        Flags(if self.is_new() { record[15] & 15 } else { record[15] >> 5 })
    }

    /// Gives a point more marks, which the format can hold.
    pub fn mark(self, record: &mut [u8], Flags(bits): Flags) {
        record[15] |= if self.is_new() { bits } else { bits << 5 };
    }

    /// The largest class that a record holds.
    pub fn most_class(self) -> u8 {
        if self.is_new() { u8::MAX } else { OLD_CLASS }
    }

    /// The first format with all fields of both; of LAS 1.4 where one of them is.
    pub(crate) fn holding(self, other: Self) -> Self {
        let is_new = self.is_new() || other.is_new();
        let has = |field: fn(LasFieldOffsets) -> Option<usize>| {
            field(self.places()).is_some() || field(other.places()).is_some()
        };
        let fits = |format: &Self| {
            let own = format.places();
            format.is_new() == is_new
                && own.time.is_some() >= has(|p| p.time)
                && own.colour.is_some() >= has(|p| p.colour)
                && own.infrared.is_some() >= has(|p| p.infrared)
                && own.wave.is_some() >= has(|p| p.wave)
        };
        (0..Self::COUNT).map(Self).find(fits).unwrap_or(Self(10))
    }

    pub(crate) fn places(self) -> LasFieldOffsets {
        let mut places = LasFieldOffsets {
            size: if self.is_new() { Self::NEW } else { Self::OLD },
            ..LasFieldOffsets::default()
        };
        let mut field = |is_there: bool, bytes: usize| {
            let at = places.size;
            places.size += if is_there { bytes } else { 0 };
            is_there.then_some(at)
        };
        let time = field(matches!(self.0, 1 | 3..=5), TIME);
        let colour = field(matches!(self.0, 2 | 3 | 5 | 7 | 8 | 10), COLOUR);
        let infrared = field(matches!(self.0, 8 | 10), INFRARED);
        let wave = field(self.has_waves(), WAVE);
        let time = if self.is_new() { Some(Self::NEW - TIME) } else { time };
        LasFieldOffsets { time, colour, infrared, wave, ..places }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format(number: u8) -> PointFormat {
        PointFormat::new(number).unwrap()
    }

    #[test]
    fn sizes_and_places_are_those_of_the_standard() {
        let sizes = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
        for (number, size) in (0..).zip(sizes) {
            assert_eq!(format(number).size(), size, "{number}");
        }
        assert!(PointFormat::new(11).is_err());
        let of_five = LasFieldOffsets {
            time: Some(20),
            colour: Some(28),
            infrared: None,
            wave: Some(34),
            size: 63,
        };
        assert_eq!(format(5).places(), of_five);
        let of_ten = LasFieldOffsets {
            time: Some(22),
            colour: Some(30),
            infrared: Some(36),
            wave: Some(38),
            size: 67,
        };
        assert_eq!(format(10).places(), of_ten);
    }

    #[test]
    fn a_format_that_holds_two_loses_no_field() {
        for (a, b, both) in [
            (0, 0, 0),
            (1, 2, 3),
            (0, 6, 6),
            (3, 6, 7),
            (4, 2, 5),
            (9, 8, 10),
            (2, 1, 3),
            (7, 9, 10),
        ] {
            assert_eq!(format(a).holding(format(b)), format(both), "{a} and {b}");
            assert_eq!(format(b).holding(format(a)), format(both), "{b} and {a}");
        }
    }
}
