//! Lines of text clouds: separators, headings, numbers.

use crate::Flags;
use crate::PointFormat;
use crate::lattice::MOST_DECIMALS;
use crate::sieve::Raw;

/// Largest mantissa that is exact in `f64`, and most decimals that its power of ten is exact for.
const EXACT_MANTISSA: u64 = 1 << 53;
const EXACT_DECIMALS: usize = 22;

/// Names of the columns in headings, in lower case and without what separates words.
const NAMES: [&[&str]; 6] = [
    &["x", "lon", "long", "longitude", "east", "easting"],
    &["y", "lat", "latitude", "north", "northing"],
    &["z", "alt", "altitude", "elev", "elevation", "height", "h"],
    &["classification", "class", "c"],
    &["returnnumber", "return", "r"],
    &["numberofreturns", "returns", "n"],
];
/// Of these, x, y and z must be there.
const NEEDED: usize = 3;

/// A point of a text file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Line {
    pub(super) xyz: [i32; 3],
    pub(super) class: u8,
    pub(super) returns: [u8; 2],
}

impl Line {
    /// As a record of point format 6.
    pub(crate) fn record(&self) -> [u8; PointFormat::NEW] {
        let (mut record, [number, returns]) = ([0; PointFormat::NEW], self.returns);
        record[..12].copy_from_slice(self.xyz.map(i32::to_le_bytes).as_flattened());
        record[14] = number.min(15) | returns.min(15) << 4;
        record[16] = self.class;
        record
    }
}

impl Raw for Line {
    fn xyz(self) -> [i32; 3] {
        self.xyz
    }

    fn class(self) -> u8 {
        self.class
    }

    fn returns(self) -> [u8; 2] {
        self.returns
    }

    fn flags(self) -> Flags {
        Flags::default()
    }
}

/// How lines are taken apart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grammar {
    separator: Separator,
    /// Which column holds which of [`NAMES`].
    columns: [Option<usize>; NAMES.len()],
    /// True when the first line names columns.
    pub(super) has_heading: bool,
    /// Columns of the first line, and so of all.
    count: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Separator {
    Space,
    Comma,
    /// Decimals may have a comma.
    Semicolon,
}

/// Values of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Values {
    pub(super) world: [f64; 3],
    pub(super) decimals: [u8; 3],
    pub(super) class: u8,
    pub(super) returns: [u8; 2],
}

/// What a line holds: `None` for empty ones and comments.
pub(super) fn content(line: &[u8]) -> Option<&[u8]> {
    let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line).trim_ascii();
    (!line.is_empty() && line[0] != b'#' && !line.starts_with(b"//")).then_some(line)
}

impl Grammar {
    /// From the first line that holds anything.
    pub(super) fn of(line: &[u8]) -> Result<Self, String> {
        let separator = match line {
            _ if line.contains(&b';') => Separator::Semicolon,
            _ if line.contains(&b',') => Separator::Comma,
            _ => Separator::Space,
        };
        let mut plain = Self {
            separator,
            columns: [Some(0), Some(1), Some(2), None, None, None],
            has_heading: false,
            count: 0,
        };
        plain.count = plain.fields(line).count();
        let is_word = |c: &u8| c.is_ascii_alphabetic() || *c == b'"';
        if !line.first().is_some_and(is_word) {
            return Ok(plain);
        }
        let names: Vec<String> = plain.fields(line).map(column_name).collect();
        let columns = NAMES.map(|known| names.iter().position(|n| known.contains(&n.as_str())));
        match columns[..NEEDED].iter().position(Option::is_none) {
            Some(missing) => Err(format!("the heading names no {}", NAMES[missing][0])),
            None => Ok(Self { columns, has_heading: true, ..plain }),
        }
    }

    /// What the columns leave open.
    pub(super) fn note(&self) -> Option<String> {
        let text = "no column is named classification: all points have class 0";
        self.columns[NEEDED].is_none().then(|| text.to_owned())
    }

    /// The values of a line that holds something.
    pub(super) fn values(&self, line: &[u8]) -> Result<Values, String> {
        let mut found: [Option<&[u8]>; NAMES.len()] = [None; NAMES.len()];
        let mut count = 0;
        for (number, field) in self.fields(line).enumerate() {
            count += 1;
            for (place, column) in found.iter_mut().zip(self.columns) {
                if column == Some(number) {
                    *place = Some(field);
                }
            }
        }
        if count != self.count && count >= NEEDED {
            return Err(format!("{count} columns, where the first line has {}", self.count));
        }
        let mut values = Values { returns: [1, 1], ..Values::default() };
        for axis in 0..3 {
            let field = found[axis].ok_or_else(|| format!("there is no {}", NAMES[axis][0]))?;
            let parsed = number(field, self.separator == Separator::Semicolon);
            let (value, decimals) = parsed.ok_or_else(|| {
                let field = String::from_utf8_lossy(&field[..field.len().min(40)]);
                format!("{field:?} is no finite number")
            })?;
            (values.world[axis], values.decimals[axis]) = (value, decimals);
        }
        let small = |field: Option<&[u8]>, default: u8| match field {
            None => Ok(default),
            Some(field) => {
                let text = String::from_utf8_lossy(&field[..field.len().min(40)]);
                let value = text.parse::<f64>().ok().filter(|v| v.fract() == 0.0);
                let value = value.filter(|v| (0.0..=255.0).contains(v)).map(|v| v as u8);
                value.ok_or_else(|| format!("{text:?} is no class or number of a return"))
            }
        };
        values.class = small(found[3], 0)?;
        values.returns[0] = small(found[4], 1)?;
        values.returns[1] = small(found[5], values.returns[0])?;
        Ok(values)
    }

    fn fields<'a>(&self, line: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
        let separator = self.separator;
        let is_end = move |c: &u8| match separator {
            // What else is white space is damage within a line.
            Separator::Space => matches!(c, b' ' | b'\t'),
            Separator::Comma => *c == b',',
            Separator::Semicolon => *c == b';',
        };
        let fields = line.split(is_end).map(trimmed);
        fields.filter(move |field| separator != Separator::Space || !field.is_empty())
    }
}

/// Without spaces around it.
fn trimmed(field: &[u8]) -> &[u8] {
    let is_space = |c: &u8| matches!(c, b' ' | b'\t');
    let start = field.iter().position(|c| !is_space(c)).unwrap_or(field.len());
    let end = field.iter().rposition(|c| !is_space(c)).map_or(start, |last| last + 1);
    &field[start..end]
}

/// A name without quotes, spaces and underscores, in lower case.
fn column_name(field: &[u8]) -> String {
    let text = String::from_utf8_lossy(field).to_lowercase();
    text.chars().filter(|c| c.is_alphanumeric()).collect()
}

/// A finite number and how many decimals it has.
fn number(field: &[u8], comma: bool) -> Option<(f64, u8)> {
    plain_number(field, comma).or_else(|| any_number(field, comma))
}

/// A number such as -12.345 whose digits are exact.
fn plain_number(field: &[u8], comma: bool) -> Option<(f64, u8)> {
    let (sign, digits) = match field {
        [b'-', rest @ ..] => (-1.0, rest),
        [b'+', rest @ ..] => (1.0, rest),
        _ => (1.0, field),
    };
    let (mut mantissa, mut count, mut point) = (0_u64, 0, None);
    for c in digits {
        match c {
            b'0'..=b'9' if mantissa < EXACT_MANTISSA / 10 - 1 => {
                mantissa = mantissa * 10 + u64::from(c - b'0');
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            b',' if comma && point.is_none() => point = Some(count),
            _ => return None,
        }
    }
    let decimals = count - point.unwrap_or(count);
    if count == 0 || decimals > EXACT_DECIMALS {
        return None;
    }
    let value = sign * (mantissa as f64 / POWERS[decimals]);
    Some((value, (decimals as u8).min(MOST_DECIMALS)))
}

const POWERS: [f64; EXACT_DECIMALS + 1] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Any other number; its decimals are as many as it takes to be whole.
fn any_number(field: &[u8], comma: bool) -> Option<(f64, u8)> {
    let text = std::str::from_utf8(field).ok()?;
    let value: f64 = match comma {
        true => text.replace(',', ".").parse().ok()?,
        false => text.parse().ok()?,
    };
    let is_whole = |decimals: &u8| (value * POWERS[usize::from(*decimals)]).fract() == 0.0;
    let decimals = (0..MOST_DECIMALS).find(is_whole).unwrap_or(MOST_DECIMALS);
    value.is_finite().then_some((value, decimals))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_with_their_decimals() {
        for (text, value, decimals) in [
            ("12", 12.0, 0),
            ("-0.25", -0.25, 2),
            ("+1.500", 1.5, 3),
            (".5", 0.5, 1),
            ("5.", 5.0, 0),
            ("1.5e3", 1500.0, 0),
            ("25e-2", 0.25, 2),
            ("6565000.123456", 6_565_000.123_456, 6),
            ("0.1234567890123456789", 0.123_456_789_012_345_68, 9),
        ] {
            assert_eq!(number(text.as_bytes(), false), Some((value, decimals)), "{text}");
        }
        for text in ["", "-", ".", "a", "nan", "inf", "1e999", "1.2.3", "1,5", "0x1"] {
            assert_eq!(number(text.as_bytes(), false), None, "{text}");
        }
        assert_eq!(number(b"1,5", true), Some((1.5, 1)));
    }

    #[test]
    fn headings_and_separators() {
        let plain = Grammar::of(b"1.5 2 3.25 7").unwrap();
        assert_eq!(plain.values(b" 1.5\t 2  3.25 8").unwrap().world, [1.5, 2.0, 3.25]);
        let named =
            Grammar::of(b"\"Z\",X,Y,Classification,Return_Number,Number Of Returns").unwrap();
        let values = named.values(b"3,1,2,6,2,3").unwrap();
        assert_eq!((values.world, values.class, values.returns), ([1.0, 2.0, 3.0], 6, [2, 3]));
        let decimal = Grammar::of(b"1,5;2;3,25").unwrap();
        assert_eq!(decimal.values(b"1,5;2;3,25").unwrap().world, [1.5, 2.0, 3.25]);
        assert!(Grammar::of(b"x y w").is_err());
        let plain = Grammar::of(b"1.5 2 3.25").unwrap();
        for bad in [
            &b"1 2"[..],
            b"1 2 nan",
            b"1 2 z",
            b"1 2 3 4",
            b"1 2 6\r1",
            b"1 2\r3",
            b"1 2 \"3",
            b"1 2 6e999",
            b"1 2 3\x0b4",
        ] {
            assert!(plain.values(bad).is_err(), "{bad:?}");
        }
        assert_eq!((content(b"  # x"), content(b"// y"), content(b" \r\n")), (None, None, None));
    }
}
