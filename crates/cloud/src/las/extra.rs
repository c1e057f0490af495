//! Extra bytes of points: dimensions described by a VLR (ASPRS LAS 1.4 R15, table 24), and undescribed bytes after
//! them.

use std::ops::Range;

use terrane_base::error::{Error, Result};

use super::bytes::LasHeaderBytes;
use crate::column::{ColumnEncoding, PointColumn};
use crate::converter::{NewDimension, NewDimensionValue};

/// User id and record id of the Extra Bytes VLR.
pub(crate) const USER: &str = "LASF_Spec";
pub(crate) const NUMBER: u16 = 4;
/// Bytes of a description.
const BYTES: usize = 192;
/// Maximum number of names in a note.
const MAX_LISTED: usize = 8;
/// Offsets within a description: reserved bytes, data type, options, name, nodata, minimum and maximum.
const RESERVED: [Range<usize>; 2] = [0..2, 36..40];
const KIND: usize = 2;
const OPTIONS: usize = 3;
const NAME: Range<usize> = 4..36;
const NONE: usize = 40;
const RANGE: Range<usize> = 64..112;
/// Bits of the options: nodata, minimum and maximum are valid.
const HAS_NONE: u8 = 1;
const HAS_RANGE: u8 = 2 | 4;
/// Bits of the options: scale and offset are valid; and their offsets.
const HAS_SCALE: u8 = 8;
const HAS_OFFSET: u8 = 16;
const SCALE: usize = 112;
const OFFSET: usize = 136;
/// Bytes of a triple of values: nodata, scale, offset.
const THREE: usize = 24;
/// Offset of the description text; data type of signed 32-bit integers, after that of unsigned ones.
const ABOUT: Range<usize> = 160..BYTES;
const STEPS: u8 = 6;
/// Last digit of data types of 32-bit floats.
const SINGLES: u8 = 9;
/// Bytes per value of the data types from 1; the deprecated types from 11 and from 21 have two or three values.
const SIZES: [usize; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];

/// A dimension: its description without the range of values, which differs between files.
#[derive(Clone, Debug, PartialEq, Eq)]
struct ExtraBytesDimension {
    about: [u8; BYTES],
    size: usize,
    /// Number of preceding dimensions with the same name.
    before: usize,
}

/// Extra bytes of the records of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ExtraBytes {
    dimensions: Vec<ExtraBytesDimension>,
    /// Undescribed bytes after the dimensions.
    plain: usize,
}

/// A byte range to copy between records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RecordByteCopy {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) bytes: usize,
}

impl ExtraBytesDimension {
    /// Normalises a description: clears bytes after the end of texts, and numbers whose option is not set. `None` for
    /// unknown data types.
    fn of(found: &[u8; BYTES]) -> Option<Self> {
        let mut about = *found;
        for text in [NAME, ABOUT] {
            let text = &mut about[text];
            let end = text.iter().position(|byte| *byte == 0).unwrap_or(text.len());
            text[end..].fill(0);
        }
        RESERVED.into_iter().chain([RANGE]).for_each(|unused| about[unused].fill(0));
        if about[KIND] > 0 {
            // For the undocumented type, the options are the number of bytes.
            about[OPTIONS] &= !HAS_RANGE;
        }
        for (option, at) in [(HAS_NONE, NONE), (HAS_SCALE, SCALE), (HAS_OFFSET, OFFSET)] {
            if about[KIND] == 0 || about[OPTIONS] & option == 0 {
                about[at..at + THREE].fill(0);
            }
        }
        let size = size(about[KIND], about[OPTIONS])?;
        Some(Self { about, size, before: 0 })
    }

    /// An added dimension; `step` is that of heights.
    fn of_new(NewDimension { name, about, value, .. }: &NewDimension, step: f64) -> Self {
        let mut bytes = [0; BYTES];
        let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
        let (kind, none) = match value {
            NewDimensionValue::HeightSteps => {
                put(SCALE, &step.to_le_bytes());
                (STEPS, i64::from(i32::MIN).to_le_bytes())
            }
            NewDimensionValue::Whole => (STEPS - 1, [0; 8]),
            NewDimensionValue::Single => (SINGLES, f64::NAN.to_le_bytes()),
            NewDimensionValue::Double => (SINGLES + 1, f64::NAN.to_le_bytes()),
        };
        let has_scale = if kind == STEPS { HAS_SCALE } else { 0 };
        put(KIND, &[kind, HAS_NONE | has_scale]);
        put(NAME.start, name.as_bytes());
        put(NONE, &none);
        put(ABOUT.start, about.as_bytes());
        Self { about: bytes, size: SIZES[usize::from(kind) - 1], before: 0 }
    }

    fn name(&self) -> String {
        name(&self.about)
    }

    /// Whether the dimension of another file has this name.
    fn is_named(&self, other: &Self) -> bool {
        self.before == other.before && self.name() == other.name()
    }

    /// Whether values are stored alike; descriptions are ignored.
    fn is_alike(&self, other: &Self) -> bool {
        self.size == other.size && self.about[..ABOUT.start] == other.about[..ABOUT.start]
    }

    /// A column for each value; none if the type is not numeric.
    fn columns(&self, at: usize) -> Vec<PointColumn> {
        let Some(kind) = usize::from(self.about[KIND]).checked_sub(1) else { return Vec::new() };
        let (size, count) = (SIZES[kind % 10], 1 + kind / 10);
        let value = match kind % 10 {
            8 | 9 => ColumnEncoding::Float(size),
            kind if kind % 2 == 0 => ColumnEncoding::Unsigned(size),
            _ => ColumnEncoding::Signed(size),
        };
        let columns = (0..count).map(|i| {
            let name = if count == 1 { self.name() } else { format!("{}[{i}]", self.name()) };
            let (scale, none) = (self.scale_and_offset(i), self.none(i, value));
            PointColumn { name, at: at + size * i, value, scale, none }
        });
        columns.collect()
    }

    /// Scale and offset of one of its values.
    fn scale_and_offset(&self, i: usize) -> Option<[f64; 2]> {
        let (about, options) = (LasHeaderBytes(&self.about), self.about[OPTIONS]);
        let scale = if options & HAS_SCALE > 0 { about.f64(SCALE + 8 * i) } else { 1.0 };
        let offset = if options & HAS_OFFSET > 0 { about.f64(OFFSET + 8 * i) } else { 0.0 };
        (options & (HAS_SCALE | HAS_OFFSET) > 0).then_some([scale, offset])
    }

    /// Nodata of one of its values: a 64-bit integer or a double.
    fn none(&self, i: usize, value: ColumnEncoding) -> Option<f64> {
        let word = LasHeaderBytes(&self.about).u64(NONE + 8 * i);
        let number = match value {
            ColumnEncoding::Float(_) => f64::from_bits(word),
            ColumnEncoding::Signed(_) => word.cast_signed() as f64,
            _ => word as f64,
        };
        (self.about[OPTIONS] & HAS_NONE > 0).then_some(number)
    }

    /// Bytes for records of files without this dimension.
    fn filling(&self) -> Vec<u8> {
        if self.about[KIND] == 0 {
            return vec![0; self.size];
        }
        // Each value takes 8 bytes; 32-bit floats are stored as doubles.
        let (each, kind) = (SIZES[usize::from(self.about[KIND] - 1) % 10], self.about[KIND] % 10);
        let values = (0..self.size / each).flat_map(|i| {
            let stored = &self.about[NONE + 8 * i..][..8];
            match kind == SINGLES {
                true => (LasHeaderBytes(stored).f64(0) as f32).to_le_bytes().to_vec(),
                false => stored[..each].to_vec(),
            }
        });
        values.collect()
    }
}

fn name(about: &[u8; BYTES]) -> String {
    LasHeaderBytes(about).text(NAME.start, NAME.len())
}

/// Bytes of a dimension of a data type; `None` if unknown.
fn size(kind: u8, options: u8) -> Option<usize> {
    match usize::from(kind) {
        0 => Some(options.into()),
        kind @ 1..=30 => Some(SIZES[(kind - 1) % 10] * (1 + (kind - 1) / 10)),
        _ => None,
    }
}

impl ExtraBytes {
    /// From the descriptions of a file whose records have this number of extra bytes, with notes. Dimensions are
    /// consecutive: from the first one that does not fit or has an unknown type, bytes cannot be assigned. They are
    /// kept as undescribed bytes.
    pub(crate) fn of(described: &[u8], bytes: usize) -> (Self, Vec<String>) {
        let descriptions = described.as_chunks::<BYTES>().0;
        let mut extra = Self { dimensions: Vec::new(), plain: bytes };
        for about in descriptions {
            let Some(dimension) = ExtraBytesDimension::of(about) else { break };
            let Some(plain) = extra.plain.checked_sub(dimension.size) else { break };
            extra.plain = plain;
            extra.push(dimension);
        }
        let left_out = &descriptions[extra.dimensions.len()..];
        let notes = extra.notes(left_out, bytes);
        // Dimensions without bytes have no values.
        extra.dimensions.retain(|dimension| dimension.size > 0);
        (extra, notes)
    }

    fn push(&mut self, dimension: ExtraBytesDimension) {
        let name = dimension.name();
        let before = self.dimensions.iter().filter(|known| known.name() == name).count();
        self.dimensions.push(ExtraBytesDimension { before, ..dimension });
    }

    /// Notes on descriptions that do not match the records; `left_out` are ignored.
    fn notes(&self, left_out: &[[u8; BYTES]], bytes: usize) -> Vec<String> {
        let named = left_out.iter().take(MAX_LISTED).map(|about| format!("\"{}\"", name(about)));
        let mut named = named.collect::<Vec<_>>().join(", ");
        if left_out.len() > MAX_LISTED {
            named += ", ...";
        }
        let lost = left_out.first().map(|first| match size(first[KIND], first[OPTIONS]) {
            Some(_) => format!("extra bytes {named} do not fit into the {bytes} bytes of a point"),
            None => {
                format!("unknown data type {} of extra bytes; {named} are left out", first[KIND])
            }
        });
        let twice = self.dimensions.iter().filter(|dimension| dimension.before == 1);
        let twice = twice.map(|dimension| {
            format!("several extra bytes are named \"{}\"; the first is used", dimension.name())
        });
        lost.into_iter().chain(twice).collect()
    }

    /// Bytes in a record.
    pub(crate) fn bytes(&self) -> usize {
        self.plain + self.dimensions.iter().map(|dimension| dimension.size).sum::<usize>()
    }

    /// The union with the extra bytes of another file.
    ///
    /// # Errors
    /// Different dimensions of one name; different undescribed bytes.
    pub(crate) fn and(mut self, other: &Self) -> Result<Self> {
        for dimension in &other.dimensions {
            match self.dimensions.iter().find(|known| known.is_named(dimension)) {
                Some(known) if known.is_alike(dimension) => {}
                None => self.dimensions.push(dimension.clone()),
                Some(_) => {
                    let name = dimension.name();
                    return Err(Error::unsupported(format!(
                        "its extra bytes \"{name}\" differ in type, scale, offset or nodata from those of other \
                             files"
                    ))
                    .remedy("process it separately"));
                }
            }
        }
        if self.plain != other.plain {
            return Err(Error::unsupported(format!(
                "its points have {} undescribed extra bytes, those of other files {}",
                other.plain, self.plain
            ))
            .remedy("process it separately"));
        }
        Ok(self)
    }

    /// Removes the dimensions of this name.
    pub(crate) fn remove(&mut self, name: &str) {
        self.dimensions.retain(|dimension| !dimension.name().eq_ignore_ascii_case(name));
    }

    /// Whether there is a dimension of this name, of numbers.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.columns(0).iter().any(|column| column.name().eq_ignore_ascii_case(name))
    }

    /// Adds a dimension, with this step of heights; returns its offset within the extra bytes.
    pub(crate) fn push_new(&mut self, new: &NewDimension, step: f64) -> usize {
        let at = self.bytes() - self.plain;
        self.dimensions.push(ExtraBytesDimension::of_new(new, step));
        at
    }

    /// Byte ranges to copy from records of another file, whose extra bytes are a subset; offsets count from the first
    /// extra byte.
    pub(crate) fn moves(&self, from: &Self) -> Vec<RecordByteCopy> {
        let mut moves: Vec<RecordByteCopy> = Vec::new();
        let mut at = 0;
        for dimension in &from.dimensions {
            let place = self.place(|known| known.is_named(dimension) && known.is_alike(dimension));
            if let Some(to) = place {
                push_joined(&mut moves, RecordByteCopy { from: at, to, bytes: dimension.size });
            }
            at += dimension.size;
        }
        if from.plain > 0 {
            let to = self.bytes() - self.plain;
            push_joined(&mut moves, RecordByteCopy { from: at, to, bytes: from.plain });
        }
        moves
    }

    fn place(&self, is_it: impl Fn(&ExtraBytesDimension) -> bool) -> Option<usize> {
        let mut at = 0;
        for dimension in &self.dimensions {
            if is_it(dimension) {
                return Some(at);
            }
            at += dimension.size;
        }
        None
    }

    /// Default extra bytes of a point.
    pub(crate) fn filling(&self) -> Vec<u8> {
        let known = self.dimensions.iter().flat_map(ExtraBytesDimension::filling);
        known.chain(std::iter::repeat_n(0, self.plain)).collect()
    }

    /// Columns of the dimensions, for records where they begin at `at`.
    pub(crate) fn columns(&self, mut at: usize) -> Vec<PointColumn> {
        let mut columns = Vec::new();
        for dimension in &self.dimensions {
            columns.extend(dimension.columns(at));
            at += dimension.size;
        }
        columns
    }

    /// Whether some of them are not numeric.
    pub(crate) fn has_others(&self) -> bool {
        self.plain > 0 || self.dimensions.iter().any(|dimension| dimension.about[KIND] == 0)
    }

    /// Data of the Extra Bytes VLR; `None` if there are no dimensions.
    pub(crate) fn described(&self) -> Option<Vec<u8>> {
        let data: Vec<u8> = self.dimensions.iter().flat_map(|d| d.about).collect();
        (!data.is_empty()).then_some(data)
    }
}

/// Appends a byte range, as one with the last range if it continues it.
fn push_joined(moves: &mut Vec<RecordByteCopy>, new: RecordByteCopy) {
    match moves.last_mut() {
        Some(last) if last.from + last.bytes == new.from && last.to + last.bytes == new.to => {
            last.bytes += new.bytes;
        }
        _ => moves.push(new),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described(name: &str, kind: u8, none: Option<u8>) -> [u8; BYTES] {
        let mut about = [0; BYTES];
        about[KIND] = kind;
        about[NAME][..name.len()].copy_from_slice(name.as_bytes());
        if let Some(none) = none {
            (about[OPTIONS], about[NONE]) = (HAS_NONE, none);
        }
        about
    }

    fn extra(all: &[[u8; BYTES]], bytes: usize) -> ExtraBytes {
        let (extra, notes) = ExtraBytes::of(&all.concat(), bytes);
        assert!(notes.is_empty(), "{notes:?}");
        extra
    }

    #[test]
    fn dimensions_are_matched_by_name_whatever_their_order() {
        let (a, b, c) =
            (described("a", 3, None), described("b", 1, Some(7)), described("c", 10, None));
        let (first, second) = (extra(&[a, b], 3), extra(&[c, a], 10));
        let both = first.clone().and(&second).unwrap();
        assert_eq!((first.bytes(), both.bytes()), (3, 11));
        assert_eq!(both.moves(&first), [RecordByteCopy { from: 0, to: 0, bytes: 3 }]);
        let of_second = [
            RecordByteCopy { from: 0, to: 3, bytes: 8 },
            RecordByteCopy { from: 8, to: 0, bytes: 2 },
        ];
        assert_eq!(both.moves(&second), of_second);
        assert_eq!(both.filling(), [&[0, 0, 7][..], &[0; 8]].concat());
        assert_eq!(both.described().unwrap(), [a, b, c].concat());
    }

    #[test]
    fn ranges_are_left_out_and_what_is_not_the_same_is_refused() {
        let mut ranged = described("a", 3, None);
        (ranged[OPTIONS], ranged[64], ranged[80]) = (HAS_RANGE, 1, 9);
        let plain = extra(&[described("a", 3, None)], 2);
        assert_eq!(extra(&[ranged], 2), plain);
        let wider = extra(&[described("a", 5, None)], 4);
        let error = plain.clone().and(&wider).unwrap_err().to_string();
        assert!(error.contains("\"a\" differ in type"), "{error}");
        let error = plain.and(&extra(&[], 2)).unwrap_err().to_string();
        assert!(error.contains("2 undescribed extra bytes"), "{error}");
    }

    #[test]
    fn bytes_that_nothing_describes_are_kept_and_lies_are_told() {
        let bytes = extra(&[described("a", 3, None)], 5);
        assert_eq!(bytes.moves(&bytes), [RecordByteCopy { from: 0, to: 0, bytes: 5 }]);
        let mut of_no_kind = described("x", 0, None);
        of_no_kind[OPTIONS] = 3;
        assert_eq!(extra(&[of_no_kind], 3).bytes(), 3);
    }

    /// Descriptions of 5 extra bytes: names and offsets of values, undescribed bytes, and a word of the note, if any.
    #[test]
    fn descriptions_that_do_not_fit_are_told_and_no_byte_moves() {
        let name = "of thirty-two letters without 0!";
        let mut behind = described("a", 3, None);
        behind[NAME][2..4].copy_from_slice(&[0xFC, 0x39]);
        let mut umlaut = described("H?he", 3, None);
        umlaut[NAME][1] = 0xF6;
        let of_no_kind = |bytes: u8| {
            let mut about = described("x", 0, None);
            about[OPTIONS] = bytes;
            about
        };
        let a = described("a", 3, None);
        type Case<'a> = (Vec<[u8; BYTES]>, &'a [(&'a str, usize)], usize, Option<&'a str>);
        let cases: [Case<'_>; 11] = [
            (vec![], &[], 5, None),
            (vec![a], &[("a", 0)], 3, None),
            (vec![a, described("b", 5, None)], &[("a", 0)], 3, Some("\"b\" do not fit")),
            (
                vec![described("b", 10, None), a],
                &[],
                5,
                Some("\"b\", \"a\" do not fit into the 5 bytes"),
            ),
            (vec![a, described("b", 31, None), a], &[("a", 0)], 3, Some("data type 31")),
            (vec![a, of_no_kind(1), described("c", 1, None)], &[("a", 0), ("c", 3)], 1, None),
            (vec![of_no_kind(0), a], &[("a", 0)], 3, None),
            (vec![described("p", 13, None)], &[("p[0]", 0), ("p[1]", 2)], 1, None),
            (vec![a, a], &[("a", 0), ("a", 2)], 1, Some("several extra bytes are named \"a\"")),
            (vec![behind, described(name, 1, None)], &[("a", 0), (name, 2)], 2, None),
            (vec![umlaut], &[("H\u{f6}he", 0)], 3, None),
        ];
        for (descriptions, named, plain, word) in cases {
            let (extra, notes) = ExtraBytes::of(&descriptions.concat(), 5);
            let columns = extra.columns(0);
            let found: Vec<_> = columns.iter().map(|c| (c.name(), c.at)).collect();
            assert_eq!((found.as_slice(), extra.plain, extra.bytes()), (named, plain, 5));
            assert_eq!(notes.len(), usize::from(word.is_some()), "{notes:?}");
            assert!(word.is_none_or(|word| notes[0].contains(word)), "{notes:?}");
            assert_eq!(extra.moves(&extra), [RecordByteCopy { from: 0, to: 0, bytes: 5 }]);
            // A round trip is exact and has no notes.
            let again = ExtraBytes::of(&extra.described().unwrap_or_default(), 5);
            assert_eq!(again.0, extra);
            assert_eq!(again.1.is_empty(), !word.is_some_and(|word| word.contains("several")));
        }
    }

    #[test]
    fn dimensions_that_only_are_described_otherwise_and_those_of_one_name_keep_their_values() {
        let said = |text: &[u8], kind: u8| {
            let mut about = described("a", kind, None);
            about[ABOUT][..text.len()].copy_from_slice(text);
            about
        };
        let (one, two) = (extra(&[said(b"one", 3)], 2), extra(&[said(b"two", 3)], 2));
        let both = one.clone().and(&two).unwrap();
        assert_eq!(
            (&both, both.moves(&two)),
            (&one, vec![RecordByteCopy { from: 0, to: 0, bytes: 2 }])
        );
        let (twice, _) = ExtraBytes::of(&[said(b"one", 3), said(b"two", 3)].concat(), 4);
        let all = extra(&[described("b", 1, None)], 1).and(&twice).unwrap();
        assert_eq!(all.moves(&twice), [RecordByteCopy { from: 0, to: 1, bytes: 4 }]);
        // Dimensions of one name are distinguished by their order.
        let (other, _) = ExtraBytes::of(&[said(b"one", 3), said(b"two", 5)].concat(), 6);
        assert!(twice.and(&other).is_err());
    }

    #[test]
    fn each_value_that_is_none_is_told_in_its_own_kind() {
        let mut three = described("a", 21, Some(1));
        (three[NONE + 8], three[NONE + 16]) = (2, 3);
        assert_eq!(extra(&[three], 3).filling(), [1, 2, 3]);
        let mut single = described("s", 9, Some(0));
        single[NONE..NONE + 8].copy_from_slice(&(-9999.0_f64).to_le_bytes());
        assert_eq!(extra(&[single], 4).filling(), (-9999.0_f32).to_le_bytes());
    }
}
