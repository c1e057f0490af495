//! Conversion of records between point formats (ASPRS LAS 1.4 R15, tables 7 to 18). Values that the target cannot
//! store are errors; fields that it does not have are dropped.

use crate::format::{ANGLES, COLOUR, INFRARED, PointFormat, TIME, WAVE};
use crate::las::{ExtraBytes, OVERLAP_CLASS, RecordByteCopy};
use terrane_base::geom::Point;

/// Bytes at the start of records of every format: position and intensity.
const COMMON: usize = 14;
/// The overlap flag.
const OVERLAP: u8 = 8;

/// Converter from the records of a file to those of an output.
#[derive(Clone, Debug)]
pub(crate) struct PointFormatConversion {
    /// Whether the formats are of LAS 1.4: of the file, and of the output.
    is_new: [bool; 2],
    /// Common fields and extra bytes to copy.
    moves: Vec<RecordByteCopy>,
    /// Initial bytes of a record.
    blank: Vec<u8>,
    /// Whether records differ in their position only.
    is_same: bool,
}

impl PointFormatConversion {
    pub(crate) fn new(
        from: PointFormat,
        from_extra: &ExtraBytes,
        to: PointFormat,
        to_extra: &ExtraBytes,
    ) -> Self {
        let (a, b) = (from.places(), to.places());
        let fields = [
            (a.time.zip(b.time), TIME),
            (a.colour.zip(b.colour), COLOUR),
            (a.infrared.zip(b.infrared), INFRARED),
            (a.wave.zip(b.wave), WAVE),
        ];
        let fields = fields.into_iter().filter_map(|(offsets, bytes)| {
            let (from, to) = offsets?;
            Some(RecordByteCopy { from, to, bytes })
        });
        let extra = to_extra.moves(from_extra);
        let is_same = from == to && from_extra == to_extra;
        let extra = extra.into_iter().map(|RecordByteCopy { from, to, bytes }| RecordByteCopy {
            from: a.size + from,
            to: b.size + to,
            bytes,
        });
        let moves = fields.chain(extra).collect();
        let blank = [vec![0; b.size], to_extra.filling()].concat();
        Self { is_new: [from.is_new(), to.is_new()], moves, blank, is_same }
    }

    /// Appends the record of a point at `place`; at its stored position when `None`.
    ///
    /// # Errors
    /// A value that the output format cannot store.
    #[inline]
    pub(crate) fn push(
        &self,
        record: &[u8],
        place: Option<Point>,
        out: &mut Vec<u8>,
    ) -> Result<(), String> {
        let at = out.len();
        if self.is_same {
            // Unrequested extra bytes are at the end.
            out.extend_from_slice(&record[..self.blank.len()]);
        } else {
            out.extend_from_slice(&self.blank);
            self.fill(record, &mut out[at..])?;
        }
        if let Some(Point { x, y, z }) = place {
            out[at..at + 12].copy_from_slice([x, y, z].map(i32::to_le_bytes).as_flattened());
        }
        Ok(())
    }

    fn fill(&self, record: &[u8], out: &mut [u8]) -> Result<(), String> {
        let unchanged = match self.is_new {
            [true, true] => PointFormat::NEW,
            [false, false] => PointFormat::OLD,
            _ => COMMON,
        };
        out[..unchanged].copy_from_slice(&record[..unchanged]);
        match self.is_new {
            [false, true] => out[COMMON..22].copy_from_slice(&newer(record)),
            [true, false] => out[COMMON..PointFormat::OLD].copy_from_slice(&older(record)?),
            _ => (),
        }
        for RecordByteCopy { from, to, bytes } in &self.moves {
            out[*to..to + bytes].copy_from_slice(&record[*from..from + bytes]);
        }
        Ok(())
    }
}

/// Bytes between intensity and time in formats 6 to 10, from a record of formats 0 to 5.
fn newer(record: &[u8]) -> [u8; 8] {
    let (returns, class) = (record[14], record[15]);
    let overlap = if class & 31 == OVERLAP_CLASS { OVERLAP } else { 0 };
    let degrees = i8::from_le_bytes([record[16]]);
    let angle = (f32::from(degrees) / ANGLES).round() as i16;
    let [low, high] = angle.to_le_bytes();
    [
        returns & 7 | (returns >> 3 & 7) << 4,
        class >> 5 | overlap | returns & 0xC0,
        class & 31,
        record[17],
        low,
        high,
        record[18],
        record[19],
    ]
}

/// Bytes between intensity and time in formats 0 to 5, from a record of formats 6 to 10.
fn older(record: &[u8]) -> Result<[u8; 6], String> {
    let (number, returns) = (record[14] & 15, record[14] >> 4);
    let (flags, class) = (record[15], record[16]);
    if number > 7 || returns > 7 {
        return Err(format!("return {number} of {returns}"));
    }
    if class > 31 {
        return Err(format!("class {class}"));
    }
    if flags & OVERLAP > 0 && class != OVERLAP_CLASS {
        return Err("the overlap flag".to_owned());
    }
    if flags >> 4 & 3 > 0 {
        return Err(format!("scanner channel {}", flags >> 4 & 3));
    }
    let steps = i16::from_le_bytes([record[18], record[19]]);
    let degrees = (f32::from(steps) * ANGLES).round();
    if !(f32::from(i8::MIN)..=f32::from(i8::MAX)).contains(&degrees) {
        return Err(format!("the scan angle {} degrees", f64::from(steps) * 3.0 / 500.0));
    }
    let [angle] = (degrees as i8).to_le_bytes();
    Ok([
        number | returns << 3 | flags & 0xC0,
        class | (flags & 7) << 5,
        angle,
        record[17],
        record[20],
        record[21],
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conversion(from: u8, to: u8) -> PointFormatConversion {
        let [from, to] = [from, to].map(|number| PointFormat::new(number).unwrap());
        PointFormatConversion::new(from, &ExtraBytes::default(), to, &ExtraBytes::default())
    }

    fn push(conversion: &PointFormatConversion, record: &[u8]) -> Result<Vec<u8>, String> {
        let mut out = Vec::new();
        let at = Point { x: 1, y: -2, z: 3 };
        conversion.push(record, Some(at), &mut out).map(|()| out)
    }

    fn record(format: u8) -> Vec<u8> {
        (0..PointFormat::new(format).unwrap().size() as u8)
            .map(|byte| byte.wrapping_mul(37) + 5)
            .collect()
    }

    #[test]
    fn fields_that_both_formats_have_keep_their_bytes() {
        for (from, to) in [(0, 3), (5, 4), (3, 5), (6, 10), (10, 7), (8, 9)] {
            let (source, made) =
                (record(from), push(&conversion(from, to), &record(from)).unwrap());
            let [a, b] = [from, to].map(|number| PointFormat::new(number).unwrap().places());
            assert_eq!((made.len(), &made[12..20]), (b.size, &source[12..20]), "{from} to {to}");
            for (from, to, bytes) in [
                (a.time, b.time, TIME),
                (a.colour, b.colour, COLOUR),
                (a.infrared, b.infrared, INFRARED),
                (a.wave, b.wave, WAVE),
            ] {
                let Some(to) = to else { continue };
                let expected =
                    from.map_or(vec![0; bytes], |from| source[from..from + bytes].to_vec());
                assert_eq!(made[to..to + bytes], expected);
            }
        }
    }

    #[test]
    fn what_an_old_format_holds_comes_back_from_a_new_one() {
        let mut source = record(1);
        // Return 2 of 5, backward scan, edge of flight line; key point of class 17; 90 degrees; user data and source.
        (source[14], source[15], source[16]) = (2 | 5 << 3 | 0x80, 17 | 2 << 5, 90);
        let there = push(&conversion(1, 6), &source).unwrap();
        assert_eq!((there[14], there[15], there[16]), (2 | 5 << 4, 2 | 0x80, 17));
        assert_eq!(i16::from_le_bytes([there[18], there[19]]), 15_000);
        let back = push(&conversion(6, 1), &there).unwrap();
        assert_eq!(back[12..], source[12..]);
        assert_eq!(back[..12], there[..12]);
        for degrees in i8::MIN..=i8::MAX {
            [source[16]] = degrees.to_le_bytes();
            let back = push(&conversion(6, 1), &push(&conversion(1, 6), &source).unwrap()).unwrap();
            assert_eq!(back[16], source[16]);
        }
    }

    /// Of each field with less room in an old format: the bytes of a new record, and what an old format cannot hold of
    /// them, if anything.
    const NARROWER: [(usize, [u8; 2], Option<&str>); 14] = [
        (14, [7 | 7 << 4, 0], None),
        (14, [8 | 7 << 4, 0], Some("return 8 of 7")),
        (14, [1 | 8 << 4, 0], Some("return 1 of 8")),
        (16, [31, 0], None),
        (16, [32, 0], Some("class 32")),
        (16, [255, 0], Some("class 255")),
        (15, [7, 2], None),
        (15, [8, 12], None),
        (15, [8, 2], Some("the overlap flag")),
        (15, [16, 2], Some("scanner channel 1")),
        (18, 21_249_i16.to_le_bytes(), None),
        (18, 21_250_i16.to_le_bytes(), Some("the scan angle 127.5 degrees")),
        (18, (-21_416_i16).to_le_bytes(), None),
        (18, (-21_417_i16).to_le_bytes(), Some("the scan angle -128.502 degrees")),
    ];

    #[test]
    fn what_an_old_format_cannot_hold_is_told() {
        for (at, bytes, lost) in NARROWER {
            let mut source = record(6);
            source[14..17].copy_from_slice(&[1 | 1 << 4, 0, 2]);
            source[18..20].fill(0);
            source[at..at + 2].copy_from_slice(&bytes);
            for to in 0..6 {
                let made = push(&conversion(6, to), &source);
                assert_eq!(made.as_ref().err().map(String::as_str), lost, "{at}: {bytes:?}");
                let Ok(made) = made else { continue };
                // Values that fit are restored exactly, except fractions of degrees.
                let back = push(&conversion(to, 6), &made).unwrap();
                assert_eq!(back[14..18], source[14..18], "{at}: {bytes:?}");
            }
        }
    }
}
