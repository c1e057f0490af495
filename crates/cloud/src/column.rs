//! Columns of records, and records as text lines: a header line, and a line per point.

use std::fmt::Write as _;

use crate::format::{ANGLES, PointFormat};
use terrane_base::geom::{PointFrame, Ruler};

/// Encoding of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ColumnEncoding {
    /// Bits of a byte: the lowest one, and their count.
    Bits(u32, u32),
    Unsigned(usize),
    Signed(usize),
    Float(usize),
    /// Steps of the scan angle, in degrees.
    Angle,
}

/// A column: name, offset in the record, encoding, scale and offset of values.
#[derive(Clone, Debug, PartialEq)]
pub struct PointColumn {
    pub(crate) name: String,
    pub(crate) at: usize,
    pub(crate) value: ColumnEncoding,
    pub(crate) scale: Option<[f64; 2]>,
    /// Raw nodata value.
    pub(crate) none: Option<f64>,
}

/// Name of the column of GPS times.
pub(crate) const TIME: &str = "gps_time";

/// Columns of point formats 0 to 5, of 6 to 10, and of both, except coordinates.
const OLD: [(&str, usize, ColumnEncoding); 11] = [
    ("intensity", 12, ColumnEncoding::Unsigned(2)),
    ("return_number", 14, ColumnEncoding::Bits(0, 3)),
    ("number_of_returns", 14, ColumnEncoding::Bits(3, 3)),
    ("scan_direction", 14, ColumnEncoding::Bits(6, 1)),
    ("edge_of_flight_line", 14, ColumnEncoding::Bits(7, 1)),
    ("classification", 15, ColumnEncoding::Bits(0, 5)),
    ("synthetic", 15, ColumnEncoding::Bits(5, 1)),
    ("key_point", 15, ColumnEncoding::Bits(6, 1)),
    ("withheld", 15, ColumnEncoding::Bits(7, 1)),
    ("scan_angle", 16, ColumnEncoding::Signed(1)),
    ("user_data", 17, ColumnEncoding::Unsigned(1)),
];
const NEW: [(&str, usize, ColumnEncoding); 13] = [
    ("intensity", 12, ColumnEncoding::Unsigned(2)),
    ("return_number", 14, ColumnEncoding::Bits(0, 4)),
    ("number_of_returns", 14, ColumnEncoding::Bits(4, 4)),
    ("synthetic", 15, ColumnEncoding::Bits(0, 1)),
    ("key_point", 15, ColumnEncoding::Bits(1, 1)),
    ("withheld", 15, ColumnEncoding::Bits(2, 1)),
    ("overlap", 15, ColumnEncoding::Bits(3, 1)),
    ("scanner_channel", 15, ColumnEncoding::Bits(4, 2)),
    ("scan_direction", 15, ColumnEncoding::Bits(6, 1)),
    ("edge_of_flight_line", 15, ColumnEncoding::Bits(7, 1)),
    ("classification", 16, ColumnEncoding::Unsigned(1)),
    ("user_data", 17, ColumnEncoding::Unsigned(1)),
    ("scan_angle", 18, ColumnEncoding::Angle),
];

/// Columns of the records of a point format, except coordinates; extra bytes are last.
pub(crate) fn columns(format: PointFormat, extra: &[PointColumn]) -> Vec<PointColumn> {
    let places = format.places();
    let (common, source): (&[_], _) = if format.is_new() { (&NEW, 20) } else { (&OLD, 18) };
    let colours = ["red", "green", "blue"].into_iter().enumerate();
    let colours = places.colour.into_iter().flat_map(|at| {
        colours.clone().map(move |(i, name)| (name, at + 2 * i, ColumnEncoding::Unsigned(2)))
    });
    let more = [("point_source_id", source, ColumnEncoding::Unsigned(2))]
        .into_iter()
        .chain(places.time.map(|at| (TIME, at, ColumnEncoding::Float(8))))
        .chain(colours)
        .chain(places.infrared.map(|at| ("infrared", at, ColumnEncoding::Unsigned(2))));
    let plain = common.iter().copied().chain(more).map(|(name, at, value)| PointColumn {
        name: name.into(),
        at,
        value,
        scale: None,
        none: None,
    });
    plain.chain(extra.iter().cloned()).collect()
}

/// Formatter of records as text lines.
#[derive(Clone, Debug)]
pub struct PointLineFormatter {
    rulers: [Ruler; 3],
    columns: Vec<PointColumn>,
    /// Bytes of a record.
    size: usize,
}

impl PointLineFormatter {
    /// For records of a point format, with columns of extra bytes.
    pub(crate) fn new(
        format: PointFormat,
        frame: &PointFrame,
        extra: &[PointColumn],
        size: usize,
    ) -> Self {
        let columns = columns(format, extra);
        Self { rulers: [0, 1, 2].map(|axis| frame.ruler(axis)), columns, size }
    }

    /// The header line.
    pub fn heading(&self) -> String {
        let names =
            self.columns.iter().map(|column| column.name.replace([',', '"', '\n', '\r'], " "));
        let names: Vec<String> =
            ["x", "y", "z"].map(str::to_owned).into_iter().chain(names).collect();
        names.join(",") + "\n"
    }

    /// One line per record.
    pub fn lines(&self, records: &[u8]) -> String {
        let mut text = String::with_capacity(records.len() * 3);
        for record in records.chunks_exact(self.size) {
            let (fours, _) = record.as_chunks::<4>();
            for (ruler, four) in self.rulers.iter().zip(fours) {
                put(&mut text, ruler.at(i32::from_le_bytes(*four).into()));
            }
            for column in &self.columns {
                column.put(record, &mut text);
            }
            text.pop();
            text.push('\n');
        }
        text
    }
}

impl PointColumn {
    fn put(&self, record: &[u8], text: &mut String) {
        let bytes = &record[self.at..];
        match self.value {
            ColumnEncoding::Bits(first, count) => put(text, bits(bytes, first, count)),
            ColumnEncoding::Unsigned(count) if self.scale.is_none() => {
                put(text, word(bytes, count))
            }
            ColumnEncoding::Signed(count) if self.scale.is_none() => {
                put(text, signed(bytes, count))
            }
            ColumnEncoding::Float(4) if self.scale.is_none() => put(text, single(bytes)),
            ColumnEncoding::Angle => put(text, f32::from(signed(bytes, 2) as i16) * ANGLES),
            _ => put(text, self.scaled(self.stored(bytes))),
        }
    }

    /// Scaled value of a record; NaN for nodata.
    #[inline]
    pub fn number(&self, record: &[u8]) -> f64 {
        let stored = self.stored(&record[self.at..]);
        if self.none == Some(stored) { f64::NAN } else { self.scaled(stored) }
    }

    /// Whether a double represents the value exactly; 64-bit integers may be too large.
    pub fn is_exact(&self, record: &[u8]) -> bool {
        const MOST: u64 = 1 << 53;
        let bytes = &record[self.at..];
        match self.value {
            _ if self.none == Some(self.stored(bytes)) => true,
            ColumnEncoding::Unsigned(8) => word(bytes, 8) <= MOST,
            ColumnEncoding::Signed(8) => signed(bytes, 8).unsigned_abs() <= MOST,
            _ => true,
        }
    }

    /// Raw value at the start of `bytes`.
    fn stored(&self, bytes: &[u8]) -> f64 {
        match self.value {
            ColumnEncoding::Bits(first, count) => bits(bytes, first, count).into(),
            ColumnEncoding::Unsigned(count) => word(bytes, count) as f64,
            ColumnEncoding::Signed(count) => signed(bytes, count) as f64,
            ColumnEncoding::Float(4) => single(bytes).into(),
            ColumnEncoding::Float(_) => f64::from_bits(word(bytes, 8)),
            // 0.006 is not exact as a float; 3/500 is rounded once.
            ColumnEncoding::Angle => f64::from(signed(bytes, 2) as i16) * 3.0 / 500.0,
        }
    }

    /// Decimal lattice of the values, for scaled integers.
    pub fn ruler(&self) -> Option<Ruler> {
        let is_integer =
            matches!(self.value, ColumnEncoding::Signed(_) | ColumnEncoding::Unsigned(1..8));
        let [scale, offset] = self.scale?;
        let is_valid = scale > 0.0 && scale.is_finite() && offset.is_finite();
        (is_integer && is_valid).then(|| Ruler::new(scale, offset))
    }

    /// Value of a record as a step of its [`ruler`](Self::ruler); NaN for nodata.
    pub fn decimal(&self, record: &[u8], ruler: &Ruler) -> f64 {
        let bytes = &record[self.at..];
        let step = match self.value {
            ColumnEncoding::Signed(count) => signed(bytes, count),
            ColumnEncoding::Unsigned(count) => word(bytes, count).cast_signed(),
            _ => return self.number(record),
        };
        if self.none == Some(step as f64) { f64::NAN } else { ruler.at(step) }
    }

    fn scaled(&self, stored: f64) -> f64 {
        let [scale, offset] = self.scale.unwrap_or([1.0, 0.0]);
        stored * scale + offset
    }
}

fn bits(bytes: &[u8], first: u32, count: u32) -> u8 {
    bytes[0] >> first & ((1 << count) - 1) as u8
}

fn word(bytes: &[u8], count: usize) -> u64 {
    let mut word = [0; 8];
    word[..count].copy_from_slice(&bytes[..count]);
    u64::from_le_bytes(word)
}

fn signed(bytes: &[u8], count: usize) -> i64 {
    let unused = 64 - 8 * count as u32;
    (word(bytes, count) << unused).cast_signed() >> unused
}

fn single(bytes: &[u8]) -> f32 {
    f32::from_bits(word(bytes, 4) as u32)
}

fn put(text: &mut String, value: impl std::fmt::Display) {
    // Writing to a string cannot fail.
    let _ = write!(text, "{value},");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_beyond_those_of_floats_are_known() {
        let column =
            |value| PointColumn { name: "id".into(), at: 1, value, scale: None, none: None };
        let is_exact = |value, stored: i64| {
            column(value).is_exact(&[&[9][..], &stored.to_le_bytes()].concat())
        };
        for (stored, signed, unsigned) in [
            (0, true, true),
            (1 << 53, true, true),
            ((1 << 53) + 1, false, false),
            (-1 << 53, true, false),
            (-1, true, false),
            (i64::MIN, false, false),
        ] {
            assert_eq!(is_exact(ColumnEncoding::Signed(8), stored), signed, "{stored}");
            assert_eq!(is_exact(ColumnEncoding::Unsigned(8), stored), unsigned, "{stored}");
            assert!(
                is_exact(ColumnEncoding::Unsigned(4), stored)
                    && is_exact(ColumnEncoding::Float(8), stored)
            );
        }
        let none =
            PointColumn { none: Some(-1_i64 as u64 as f64), ..column(ColumnEncoding::Unsigned(8)) };
        assert!(none.is_exact(&[0xff; 9]));
    }
}
