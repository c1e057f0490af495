//! Point formats of LAS: which fields their records have, and where (ASPRS LAS 1.4 R15, tables 6 to 18).

use terrane_base::error::{Error, Result};

use crate::raw::Flags;

/// A LAS point format, 0 to 10.
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

/// Degrees per step of scan angles.
pub(crate) const ANGLES: f32 = 0.006;
/// Bits of the class in point formats 0 to 5, which share their byte with flags.
const OLD_CLASS: u8 = 31;

/// Offsets of optional fields in a record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LasFieldOffsets {
    pub(crate) time: Option<usize>,
    pub(crate) colour: Option<usize>,
    pub(crate) infrared: Option<usize>,
    pub(crate) wave: Option<usize>,
    /// Bytes of all fields.
    pub(crate) size: usize,
}

impl LasFieldOffsets {
    /// Whether all fields of `other` are there.
    fn includes(&self, other: &Self) -> bool {
        self.time.is_some() >= other.time.is_some()
            && self.colour.is_some() >= other.colour.is_some()
            && self.infrared.is_some() >= other.infrared.is_some()
            && self.wave.is_some() >= other.wave.is_some()
    }

    /// Appends a field of `bytes`, if it is there; returns its offset.
    fn append(&mut self, is_there: bool, bytes: usize) -> Option<usize> {
        let at = self.size;
        self.size += if is_there { bytes } else { 0 };
        is_there.then_some(at)
    }
}

impl PointFormat {
    /// Number of point formats.
    pub const COUNT: u8 = 11;
    /// Bytes of the common fields of formats 0 to 5, and of 6 to 10.
    pub(crate) const OLD: usize = 20;
    pub(crate) const NEW: usize = 30;

    /// The point format with this number.
    ///
    /// # Errors
    /// An unknown format.
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

    /// True for the formats of LAS 1.4 (6 to 10).
    pub fn is_new(self) -> bool {
        self.0 >= 6
    }

    /// Whether its records have a waveform packet.
    pub fn has_waves(self) -> bool {
        matches!(self.0, 4 | 5 | 9 | 10)
    }

    /// Offset of the GPS time in a record, if any.
    pub fn time_at(self) -> Option<usize> {
        self.places().time
    }

    /// Bytes of a record without extra bytes.
    pub fn size(self) -> usize {
        self.places().size
    }

    /// Return number and number of returns of a point.
    pub fn returns(self, record: &[u8]) -> [u8; 2] {
        let (byte, bits) = (record[14], if self.is_new() { 4 } else { 3 });
        let most = (1 << bits) - 1;
        [byte & most, byte >> bits & most]
    }

    /// The class of a point.
    pub fn class(self, record: &[u8]) -> u8 {
        if self.is_new() { record[16] } else { record[15] & OLD_CLASS }
    }

    /// Sets the class of a point; the format must be able to store it.
    pub fn set_class(self, record: &mut [u8], class: u8) {
        match self.is_new() {
            true => record[16] = class,
            false => record[15] = record[15] & !OLD_CLASS | class & OLD_CLASS,
        }
    }

    /// Point source id: file or flight line.
    pub fn source(self, record: &[u8]) -> u16 {
        let at = if self.is_new() { 20 } else { 18 };
        u16::from_le_bytes([record[at], record[at + 1]])
    }

    /// Scan angle in steps of the format.
    pub fn angle(self, record: &[u8]) -> i16 {
        match self.is_new() {
            true => i16::from_le_bytes([record[18], record[19]]),
            false => i8::from_le_bytes([record[16]]).into(),
        }
    }

    /// Flags of a point.
    pub fn flags(self, record: &[u8]) -> Flags {
        Flags(if self.is_new() { record[15] & 15 } else { record[15] >> 5 })
    }

    /// Adds flags to a point; the format must be able to store them.
    pub fn set_flags(self, record: &mut [u8], Flags(bits): Flags) {
        record[15] |= if self.is_new() { bits } else { bits << 5 };
    }

    /// The largest class of the format.
    pub fn max_class(self) -> u8 {
        if self.is_new() { u8::MAX } else { OLD_CLASS }
    }

    /// The first format with all fields of both; a LAS 1.4 format if one of them is.
    pub(crate) fn holding(self, other: Self) -> Self {
        let is_new = self.is_new() || other.is_new();
        let mut formats = (0..Self::COUNT).map(Self).filter(|format| format.is_new() == is_new);
        let common = formats.find(|format| {
            let fields = format.places();
            fields.includes(&self.places()) && fields.includes(&other.places())
        });
        common.unwrap_or(Self(10))
    }

    pub(crate) fn places(self) -> LasFieldOffsets {
        let mut places = LasFieldOffsets {
            size: if self.is_new() { Self::NEW } else { Self::OLD },
            ..LasFieldOffsets::default()
        };
        let time = places.append(matches!(self.0, 1 | 3..=5), TIME);
        // LAS 1.4 formats have the time in their fixed part.
        places.time = if self.is_new() { Some(Self::NEW - TIME) } else { time };
        places.colour = places.append(matches!(self.0, 2 | 3 | 5 | 7 | 8 | 10), COLOUR);
        places.infrared = places.append(matches!(self.0, 8 | 10), INFRARED);
        places.wave = places.append(self.has_waves(), WAVE);
        places
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
