//! Extra bytes of records: dimensions that a record of the file describes (ASPRS LAS 1.4 R15, table 24),
//! and bytes behind them that nothing does.

use terrane_base::error::{Error, Result};

use crate::las::Bytes;
use crate::write::{Column, Value};

/// Who writes the record that describes dimensions, and its number.
pub(crate) const USER: &str = "LASF_Spec";
pub(crate) const NUMBER: u16 = 4;
/// Bytes of a description.
const BYTES: usize = 192;
/// Where a description has the kind, the options, the name, the value that stands for none, and its least and
/// largest values.
const KIND: usize = 2;
const OPTIONS: usize = 3;
const NAME: usize = 4;
const NAME_BYTES: usize = 32;
const NONE: usize = 40;
const RANGE: std::ops::Range<usize> = 64..112;
/// Bits of the options: there is a value for none, a least value, a largest one.
const HAS_NONE: u8 = 1;
const HAS_RANGE: u8 = 2 | 4;
/// Bits of the options: values are multiplied, and added to; and where by what.
const HAS_SCALE: u8 = 8;
const HAS_OFFSET: u8 = 16;
const SCALE: usize = 112;
const OFFSET: usize = 136;
/// Where what is said of it is; the kind of signed whole numbers of four bytes.
const ABOUT: usize = 160;
const STEPS: u8 = 6;
/// Bytes of a value of each kind from 1 on; there are two or three of them in kinds from 11 and 21 on.
const SIZES: [usize; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];

/// A dimension: its description without the range of its values, which are others in other files.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Dimension {
    about: [u8; BYTES],
    size: usize,
}

/// Extra bytes of the records of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Extra {
    dimensions: Vec<Dimension>,
    /// Bytes behind them.
    plain: usize,
}

/// Bytes to take from one record to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Move {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) bytes: usize,
}

impl Dimension {
    fn of(found: &[u8; BYTES]) -> Self {
        let mut about = *found;
        about[OPTIONS] = match about[KIND] {
            // The options of bytes of no kind are their number.
            0 => about[OPTIONS],
            _ => about[OPTIONS] & !HAS_RANGE,
        };
        about[RANGE].fill(0);
        Self { size: size(about[KIND], about[OPTIONS]), about }
    }

    /// A whole number of four bytes, in so many units; its least value stands for none.
    fn of_steps(name: &str, about: &str, step: f64) -> Self {
        let mut bytes = [0; BYTES];
        let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
        put(KIND, &[STEPS, HAS_NONE | HAS_SCALE]);
        put(NAME, name.as_bytes());
        put(NONE, &i64::from(i32::MIN).to_le_bytes());
        put(SCALE, &step.to_le_bytes());
        put(ABOUT, about.as_bytes());
        Self { about: bytes, size: size_of::<i32>() }
    }

    fn name(&self) -> String {
        Bytes(&self.about).text(NAME, NAME_BYTES)
    }

    /// Whether values are the same, whatever is said of them.
    fn is_alike(&self, other: &Self) -> bool {
        self.size == other.size && self.about[..ABOUT] == other.about[..ABOUT]
    }

    /// A column for each of its values; none of bytes that are no numbers.
    fn columns(&self, at: usize) -> Vec<Column> {
        let (kind, options) = (usize::from(self.about[KIND]), self.about[OPTIONS]);
        let Some(kind) = kind.checked_sub(1) else { return Vec::new() };
        let (size, count) = (SIZES[kind % 10], 1 + kind / 10);
        let value = match kind % 10 {
            8 | 9 => Value::Float(size),
            kind if kind % 2 == 0 => Value::Unsigned(size),
            _ => Value::Signed(size),
        };
        let number = |at: usize| Bytes(&self.about).f64(at);
        let column = |i: usize| {
            let scale = if options & HAS_SCALE > 0 { number(SCALE + 8 * i) } else { 1.0 };
            let offset = if options & HAS_OFFSET > 0 { number(OFFSET + 8 * i) } else { 0.0 };
            let name = if count == 1 { self.name() } else { format!("{}[{i}]", self.name()) };
            let scale = (options & (HAS_SCALE | HAS_OFFSET) > 0).then_some([scale, offset]);
            Column { name, at: at + size * i, value, scale, none: self.none(i, value) }
        };
        (0..count).map(column).collect()
    }

    /// The value that stands for none, of one of its values: a whole number of 8 bytes, or a double.
    fn none(&self, i: usize, value: Value) -> Option<f64> {
        let word = Bytes(&self.about).u64(NONE + 8 * i);
        let number = match value {
            Value::Float(_) => f64::from_bits(word),
            Value::Signed(_) => word.cast_signed() as f64,
            _ => word as f64,
        };
        (self.about[OPTIONS] & HAS_NONE > 0).then_some(number)
    }

    /// What stands in records of files without it.
    fn filling(&self) -> Vec<u8> {
        let has_none = self.about[KIND] > 0 && self.about[OPTIONS] & HAS_NONE > 0;
        let value = &self.about[NONE..NONE + self.size.min(24)];
        match has_none {
            true if self.size <= 8 => value.to_vec(),
            _ => vec![0; self.size],
        }
    }
}

fn size(kind: u8, options: u8) -> usize {
    match usize::from(kind) {
        0 => options.into(),
        kind @ 1..=30 => SIZES[(kind - 1) % 10] * (1 + (kind - 1) / 10),
        _ => 0,
    }
}

impl Extra {
    /// From the descriptions in a file whose records have so many extra bytes.
    ///
    /// # Errors
    /// Descriptions of more bytes than there are, or of kinds that are not known.
    pub(crate) fn of(described: &[u8], bytes: usize) -> Result<Self> {
        let dimensions: Vec<_> = described.as_chunks().0.iter().map(Dimension::of).collect();
        let taken = dimensions.iter().map(|dimension| dimension.size).sum();
        if let Some(odd) = dimensions.iter().find(|dimension| dimension.size == 0) {
            let message = format!("the extra bytes \"{}\" are of no known kind", odd.name());
            return Err(Error::unsupported(message).remedy("write the file again without them"));
        }
        match bytes.checked_sub(taken) {
            Some(plain) => Ok(Self { dimensions, plain }),
            None => Err(Error::bad_input(format!(
                "points are said to have {bytes} extra bytes, and {taken} are described"
            ))
            .remedy("copy the file again")),
        }
    }

    /// Bytes in a record.
    pub(crate) fn bytes(&self) -> usize {
        self.plain + self.dimensions.iter().map(|dimension| dimension.size).sum::<usize>()
    }

    /// These, and those of another file.
    ///
    /// # Errors
    /// Dimensions of one name that are not the same; bytes that nothing describes where those of the other differ.
    pub(crate) fn and(mut self, other: &Self) -> Result<Self> {
        for dimension in &other.dimensions {
            let name = dimension.name();
            match self.dimensions.iter().find(|known| known.name() == name) {
                Some(known) if known.is_alike(dimension) => {}
                None => self.dimensions.push(dimension.clone()),
                Some(_) => {
                    return Err(Error::unsupported(format!(
                        "its extra bytes \"{name}\" are of another kind, scale, offset or value for none than in other files"
                    ))
                    .remedy("write it on its own"));
                }
            }
        }
        if self.plain != other.plain {
            return Err(Error::unsupported(format!(
                "its points have {} extra bytes that nothing describes, and those of other files {}",
                other.plain, self.plain
            ))
            .remedy("write it on its own"));
        }
        Ok(self)
    }

    /// With steps of so many units in the place of what has that name; returns where in the extra bytes they are.
    pub(crate) fn put_steps(&mut self, name: &str, about: &str, step: f64) -> usize {
        self.dimensions.retain(|dimension| dimension.name() != name);
        let at = self.bytes() - self.plain;
        self.dimensions.push(Dimension::of_steps(name, about, step));
        at
    }

    /// What to take from a record of another file, whose extra bytes are among these; places count from the first
    /// extra byte.
    pub(crate) fn moves(&self, from: &Self) -> Vec<Move> {
        let mut moves: Vec<Move> = Vec::new();
        let mut add = |new: Move| match moves.last_mut() {
            Some(last) if last.from + last.bytes == new.from && last.to + last.bytes == new.to => {
                last.bytes += new.bytes;
            }
            _ => moves.push(new),
        };
        let mut at = 0;
        for dimension in &from.dimensions {
            if let Some(to) = self.place(|known| *known == dimension) {
                add(Move { from: at, to, bytes: dimension.size });
            }
            at += dimension.size;
        }
        if from.plain > 0 {
            add(Move { from: at, to: self.bytes() - self.plain, bytes: from.plain });
        }
        moves
    }

    fn place(&self, is_it: impl Fn(&&Dimension) -> bool) -> Option<usize> {
        let mut at = 0;
        for dimension in &self.dimensions {
            if is_it(&dimension) {
                return Some(at);
            }
            at += dimension.size;
        }
        None
    }

    /// The extra bytes of a point of which nothing is known.
    pub(crate) fn filling(&self) -> Vec<u8> {
        let known = self.dimensions.iter().flat_map(Dimension::filling);
        known.chain(std::iter::repeat_n(0, self.plain)).collect()
    }

    /// Columns of the dimensions, in records where they begin at a byte.
    pub(crate) fn columns(&self, mut at: usize) -> Vec<Column> {
        let mut columns = Vec::new();
        for dimension in &self.dimensions {
            columns.extend(dimension.columns(at));
            at += dimension.size;
        }
        columns
    }

    /// Whether some of them are no numbers.
    pub(crate) fn has_others(&self) -> bool {
        self.plain > 0 || self.dimensions.iter().any(|dimension| dimension.about[KIND] == 0)
    }

    /// The data of the record that describes them; `None` where there is nothing to say.
    pub(crate) fn described(&self) -> Option<Vec<u8>> {
        let data: Vec<u8> = self.dimensions.iter().flat_map(|d| d.about).collect();
        (!data.is_empty()).then_some(data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described(name: &str, kind: u8, none: Option<u8>) -> [u8; BYTES] {
        let mut about = [0; BYTES];
        about[KIND] = kind;
        about[NAME..NAME + name.len()].copy_from_slice(name.as_bytes());
        if let Some(none) = none {
            (about[OPTIONS], about[NONE]) = (HAS_NONE, none);
        }
        about
    }

    fn extra(all: &[[u8; BYTES]], bytes: usize) -> Extra {
        Extra::of(&all.concat(), bytes).unwrap()
    }

    #[test]
    fn dimensions_are_matched_by_name_whatever_their_order() {
        let (a, b, c) =
            (described("a", 3, None), described("b", 1, Some(7)), described("c", 10, None));
        let (first, second) = (extra(&[a, b], 3), extra(&[c, a], 10));
        let both = first.clone().and(&second).unwrap();
        assert_eq!((first.bytes(), both.bytes()), (3, 11));
        assert_eq!(both.moves(&first), [Move { from: 0, to: 0, bytes: 3 }]);
        let of_second = [Move { from: 0, to: 3, bytes: 8 }, Move { from: 8, to: 0, bytes: 2 }];
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
        assert!(error.contains("\"a\" are of another kind"), "{error}");
        let error = plain.and(&extra(&[], 2)).unwrap_err().to_string();
        assert!(error.contains("2 extra bytes that nothing describes"), "{error}");
    }

    #[test]
    fn bytes_that_nothing_describes_are_kept_and_lies_are_told() {
        let bytes = extra(&[described("a", 3, None)], 5);
        assert_eq!(bytes.moves(&bytes), [Move { from: 0, to: 0, bytes: 5 }]);
        let mut of_no_kind = described("x", 0, None);
        of_no_kind[OPTIONS] = 3;
        assert_eq!(extra(&[of_no_kind], 3).bytes(), 3);
        assert!(Extra::of(&described("a", 8, None), 3).is_err());
        assert!(Extra::of(&described("a", 31, None), 300).is_err());
    }
}
