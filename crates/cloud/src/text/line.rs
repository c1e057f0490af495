//! Lines of text point clouds: separators, headers, numbers.

use crate::column::{self, ColumnEncoding, PointColumn};
use crate::format::PointFormat;
use crate::quantization::MAX_DECIMALS;
use crate::raw::{Flags, RawPoint};

/// Largest mantissa exact in `f64`, and maximum decimals with an exact power of ten.
const EXACT_MANTISSA: u64 = 1 << 53;
const EXACT_DECIMALS: usize = 22;

/// Names of the columns in headers, in lower case without word separators.
const NAMES: [&[&str]; 6] = [
    &["x", "lon", "long", "longitude", "east", "easting"],
    &["y", "lat", "latitude", "north", "northing"],
    &["z", "alt", "altitude", "elev", "elevation", "height", "h"],
    &["classification", "class", "c"],
    &["returnnumber", "return", "r"],
    &["numberofreturns", "returns", "n"],
];
/// Number of required columns: x, y and z.
const NEEDED: usize = 3;
/// The largest return number of a record.
const MAX_RETURNS: u8 = 15;
/// Aliases of fields.
const ALIASES: [(&str, &str); 7] = [
    ("nir", "infrared"),
    ("sourceid", "pointsourceid"),
    ("scananglerank", "scanangle"),
    ("scandirectionflag", "scandirection"),
    ("keypointflag", "keypoint"),
    ("withheldflag", "withheld"),
    ("overlapflag", "overlap"),
];
/// Colours by their letters.
const COLOURS: [(&str, &str); 3] = [("r", "red"), ("g", "green"), ("b", "blue")];
/// The point format with all fields of text, and the length of its records.
const WIDEST: u8 = 8;
const RECORD: usize = PointFormat::NEW + 8;
/// Maximum number of column names in a note.
const MAX_LISTED: usize = 12;

/// A point of a text file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TextPoint {
    pub(super) xyz: [i32; 3],
    pub(super) class: u8,
    pub(super) returns: [u8; 2],
    pub(super) fields: TextPointRecord,
}

/// A record with the optional columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TextPointRecord([u8; RECORD]);

impl Default for TextPointRecord {
    fn default() -> Self {
        Self([0; RECORD])
    }
}

impl TextPoint {
    /// As a record of the widest format, of which records of the other formats from 6 are prefixes.
    pub(crate) fn record(&self) -> [u8; RECORD] {
        let (TextPointRecord(mut record), [number, returns]) = (self.fields, self.returns);
        record[..12].copy_from_slice(self.xyz.map(i32::to_le_bytes).as_flattened());
        record[14] = number | returns << 4;
        record[16] = self.class;
        record
    }
}

impl RawPoint for TextPoint {
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
        PointFormat::default().flags(&self.fields.0)
    }
}

/// Syntax of lines.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PointLineGrammar {
    separator: PointTextSeparator,
    /// Column of each of [`NAMES`].
    columns: [Option<usize>; NAMES.len()],
    /// Columns and the fields of records that they hold.
    fields: Vec<(usize, PointColumn)>,
    /// Names of ignored columns.
    others: Vec<String>,
    /// True if the first line is a header.
    pub(super) has_heading: bool,
    /// Number of columns of every line.
    count: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PointTextSeparator {
    Space,
    Comma,
    /// Semicolons; decimal commas are allowed.
    Semicolon,
}

impl PointTextSeparator {
    #[inline]
    fn splits_at(self, c: u8) -> bool {
        match self {
            // Other white space within a line is damage.
            Self::Space => is_space(c),
            Self::Comma => c == b',',
            Self::Semicolon => c == b';',
        }
    }
}

#[inline]
fn is_space(c: u8) -> bool {
    matches!(c, b' ' | b'\t')
}

/// Values of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TextPointValues {
    pub(super) world: [f64; 3],
    pub(super) decimals: [u8; 3],
    pub(super) class: u8,
    pub(super) returns: [u8; 2],
    pub(super) fields: TextPointRecord,
}

/// Content of a line; `None` for empty lines and comments.
pub(super) fn content(line: &[u8]) -> Option<&[u8]> {
    let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line).trim_ascii();
    (!line.is_empty() && line[0] != b'#' && !line.starts_with(b"//")).then_some(line)
}

impl PointLineGrammar {
    /// From the first line with content.
    pub(super) fn of(line: &[u8]) -> Result<Self, String> {
        let separator = match line {
            _ if line.contains(&b';') => PointTextSeparator::Semicolon,
            _ if line.contains(&b',') => PointTextSeparator::Comma,
            _ => PointTextSeparator::Space,
        };
        let mut plain = Self {
            separator,
            columns: [Some(0), Some(1), Some(2), None, None, None],
            fields: Vec::new(),
            others: Vec::new(),
            has_heading: false,
            count: 0,
        };
        plain.count = plain.fields(line).count();
        if !line.first().is_some_and(|c| c.is_ascii_alphabetic() || *c == b'"') {
            return Ok(plain);
        }
        let mut names: Vec<String> = plain.fields(line).map(column_name).collect();
        // With columns g and b, r is red and not the return number.
        if COLOURS.iter().all(|(short, _)| names.iter().any(|name| name == short)) {
            for (short, colour) in COLOURS {
                names.iter_mut().filter(|name| *name == short).for_each(|n| *n = colour.to_owned());
            }
        }
        let columns = NAMES.map(|known| names.iter().position(|n| known.contains(&n.as_str())));
        match columns[..NEEDED].iter().position(Option::is_none) {
            Some(missing) => Err(format!("the header line has no column {}", NAMES[missing][0])),
            None => {
                let texts = plain.fields(line).map(|name| String::from_utf8_lossy(name).into());
                let texts: Vec<String> = texts.collect();
                Ok(Self { columns, has_heading: true, ..plain }.with_fields(&names, &texts))
            }
        }
    }

    /// Assigns fields to columns by name; the first column of a name counts.
    fn with_fields(mut self, names: &[String], texts: &[String]) -> Self {
        let all = PointFormat::new(WIDEST).map_or_else(|_| Vec::new(), |f| column::columns(f, &[]));
        for (number, (name, text)) in names.iter().zip(texts).enumerate() {
            if self.columns.contains(&Some(number)) {
                continue;
            }
            let alias = ALIASES.iter().find(|(alias, _)| alias == name);
            let name = alias.map_or(name.as_str(), |(_, name)| name);
            // Class and return numbers have their own columns.
            let has_column = NAMES[NEEDED..].iter().any(|known| known.contains(&name));
            let field = all.iter().find(|field| column_name(field.name().as_bytes()) == name);
            match field.filter(|_| !has_column) {
                Some(field) if self.fields.iter().all(|(_, other)| other != field) => {
                    self.fields.push((number, field.clone()));
                }
                _ => self.others.push(text.clone()),
            }
        }
        self
    }

    /// The point format with fields for all columns.
    pub(super) fn format(&self) -> PointFormat {
        let places = PointFormat::new(WIDEST).unwrap_or_default().places();
        let has = |place: Option<usize>| {
            self.fields.iter().any(|(_, field)| place.is_some_and(|at| field.at >= at))
        };
        let number = match (has(places.infrared), has(places.colour)) {
            (true, _) => WIDEST,
            (false, true) => 7,
            (false, false) => 6,
        };
        PointFormat::new(number).unwrap_or_default()
    }

    /// The time of a point, if there is a column.
    pub(super) fn time(&self, values: &TextPointValues) -> Option<f64> {
        let (_, field) = self.fields.iter().find(|(_, field)| field.name() == column::TIME)?;
        Some(field.number(&values.fields.0))
    }

    /// The fields with a column.
    pub(super) fn known(&self) -> Vec<PointColumn> {
        self.fields.iter().map(|(_, field)| field.clone()).collect()
    }

    /// Notes on missing and ignored columns.
    pub(super) fn notes(&self) -> Vec<String> {
        let text = "column classification is missing; all points have class 0";
        let class = self.columns[NEEDED].is_none().then(|| text.to_owned());
        let mut others =
            self.others.iter().take(MAX_LISTED).cloned().collect::<Vec<_>>().join(", ");
        if self.others.len() > MAX_LISTED {
            others += ", ...";
        }
        let others = match (self.has_heading, self.count.saturating_sub(NEEDED)) {
            (true, _) if others.is_empty() => None,
            (true, _) => Some(format!("ignored columns: {others}")),
            (false, 0) => None,
            (false, more) => {
                Some(format!("no header line; the {more} columns after the third are ignored"))
            }
        };
        class.into_iter().chain(others).collect()
    }

    /// The values of a line with content.
    pub(super) fn values(&self, line: &[u8]) -> Result<TextPointValues, String> {
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
            return Err(format!("{count} columns, expected {}", self.count));
        }
        let mut values = TextPointValues { returns: [1, 1], ..TextPointValues::default() };
        for axis in 0..3 {
            let field = found[axis].ok_or_else(|| format!("{} is missing", NAMES[axis][0]))?;
            let parsed = number(field, self.separator == PointTextSeparator::Semicolon);
            let (value, decimals) = parsed.ok_or_else(|| {
                let field = String::from_utf8_lossy(&field[..field.len().min(40)]);
                format!("{field:?} is not a finite number")
            })?;
            (values.world[axis], values.decimals[axis]) = (value, decimals);
        }
        values.class = small_integer(found[3], 0, u8::MAX)?;
        values.returns[0] = small_integer(found[4], 1, MAX_RETURNS)?;
        values.returns[1] = small_integer(found[5], values.returns[0], MAX_RETURNS)?;
        self.set_fields(line, &mut values.fields)?;
        Ok(values)
    }

    fn set_fields(
        &self,
        line: &[u8],
        TextPointRecord(record): &mut TextPointRecord,
    ) -> Result<(), String> {
        let mut fields = self.fields(line).enumerate();
        for (at, field) in &self.fields {
            let Some((_, text)) = fields.by_ref().find(|(number, _)| number == at) else {
                return Err(format!("{} is missing", field.name()));
            };
            match (number(text, self.separator == PointTextSeparator::Semicolon), field.value) {
                (Some((value, _)), _) => field.set(record, value)?,
                // Times may be NaN or infinite.
                (None, ColumnEncoding::Float(8)) if word(text).is_some() => {
                    let bytes = word(text).unwrap_or_default().to_le_bytes();
                    record[field.at..][..8].copy_from_slice(&bytes);
                }
                _ => {
                    let text = String::from_utf8_lossy(&text[..text.len().min(40)]);
                    return Err(format!("{text:?} is not a valid {}", field.name()));
                }
            }
        }
        Ok(())
    }

    fn fields<'a>(&self, line: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
        let separator = self.separator;
        let fields = line.split(move |c| separator.splits_at(*c)).map(trimmed);
        fields.filter(move |field| separator != PointTextSeparator::Space || !field.is_empty())
    }
}

/// A class or return number of at most `max`; `default` without a column.
#[inline]
fn small_integer(field: Option<&[u8]>, default: u8, max: u8) -> Result<u8, String> {
    let Some(field) = field else { return Ok(default) };
    let text = String::from_utf8_lossy(&field[..field.len().min(40)]);
    let value = text.parse::<f64>().ok().filter(|value| value.fract() == 0.0);
    let value = value.filter(|value| (0.0..=f64::from(max)).contains(value));
    value.map(|value| value as u8).ok_or_else(|| {
        let what = if max == MAX_RETURNS { "return number" } else { "class" };
        format!("{text:?} is not a {what} from 0 to {max}")
    })
}

/// Trims white space.
fn trimmed(field: &[u8]) -> &[u8] {
    let start = field.iter().position(|c| !is_space(*c)).unwrap_or(field.len());
    let end = field.iter().rposition(|c| !is_space(*c)).map_or(start, |last| last + 1);
    &field[start..end]
}

/// A column name without quotes, spaces and underscores, in lower case.
fn column_name(field: &[u8]) -> String {
    let text = String::from_utf8_lossy(field).to_lowercase();
    text.chars().filter(|c| c.is_alphanumeric()).collect()
}

/// A finite number and its number of decimals.
fn number(field: &[u8], comma: bool) -> Option<(f64, u8)> {
    plain_number(field, comma).or_else(|| any_number(field, comma))
}

/// A number such as -12.345 with exact digits.
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
    Some((value, (decimals as u8).min(MAX_DECIMALS)))
}

const POWERS: [f64; EXACT_DECIMALS + 1] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// NaN or an infinity.
fn word(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field).ok()?.parse().ok().filter(|value: &f64| !value.is_finite())
}

/// Any other number, with the decimals needed to make it an integer.
fn any_number(field: &[u8], comma: bool) -> Option<(f64, u8)> {
    let text = std::str::from_utf8(field).ok()?;
    let value: f64 = match comma {
        true => text.replace(',', ".").parse().ok()?,
        false => text.parse().ok()?,
    };
    let decimals =
        (0..MAX_DECIMALS).find(|decimals| (value * POWERS[usize::from(*decimals)]).fract() == 0.0);
    value.is_finite().then_some((value, decimals.unwrap_or(MAX_DECIMALS)))
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
        let plain = PointLineGrammar::of(b"1.5 2 3.25 7").unwrap();
        assert_eq!(plain.values(b" 1.5\t 2  3.25 8").unwrap().world, [1.5, 2.0, 3.25]);
        let named =
            PointLineGrammar::of(b"\"Z\",X,Y,Classification,Return_Number,Number Of Returns")
                .unwrap();
        let values = named.values(b"3,1,2,6,2,3").unwrap();
        assert_eq!((values.world, values.class, values.returns), ([1.0, 2.0, 3.0], 6, [2, 3]));
        for bad in [&b"3,1,2,256,2,3"[..], b"3,1,2,6,16,3", b"3,1,2,6,2,16", b"3,1,2,6,1.5,3"] {
            assert!(named.values(bad).is_err(), "{bad:?}");
        }
        let all =
            PointLineGrammar::of(b"x y z r g b Intensity gps_time withheld scan_angle foo foo")
                .unwrap();
        let line = b"1 2 3 10 20 30 400 700000.5 1 -12 5 6";
        let values = all.values(line).unwrap();
        assert_eq!((all.format().number(), all.time(&values)), (7, Some(700_000.5)));
        let told: Vec<(String, f64)> = all
            .known()
            .iter()
            .map(|field| (field.name().to_owned(), field.number(&values.fields.0)))
            .collect();
        let expected = [
            ("red", 10.0),
            ("green", 20.0),
            ("blue", 30.0),
            ("intensity", 400.0),
            ("gps_time", 700_000.5),
            ("withheld", 1.0),
            ("scan_angle", -12.0),
        ];
        assert_eq!(told, expected.map(|(name, value)| (name.to_owned(), value)));
        assert_eq!(values.returns, [1, 1]);
        assert!(all.notes().contains(&"ignored columns: foo, foo".to_owned()));
        let odd = all.values(b"1 2 3 1 2 3 4 NaN 0 1 5 6").unwrap();
        assert!(all.time(&odd).unwrap().is_nan());
        for bad in ["70000 1 1 1 1 1 0 0 5 6", "1 1 1 1 1 1 2 0 5 6", "1 1 1 1 1 x 0 0 5 6"] {
            let line = format!("1 2 3 {bad}");
            assert!(all.values(line.as_bytes()).is_err(), "{line}");
        }
        assert_eq!(PointLineGrammar::of(b"1 2 3 4 5").unwrap().notes().len(), 2);
        // Ambiguous names are not assigned to a field.
        let other = PointLineGrammar::of(b"x,y,z,time,i,angle,channel").unwrap();
        assert!(other.values(b"1,2,3,12:30:05,0.5,left,a").is_ok() && other.known().is_empty());
        assert_eq!(PointLineGrammar::of(b"x,y,z,nir").unwrap().format().number(), 8);
        let decimal = PointLineGrammar::of(b"1,5;2;3,25").unwrap();
        assert_eq!(decimal.values(b"1,5;2;3,25").unwrap().world, [1.5, 2.0, 3.25]);
        assert!(PointLineGrammar::of(b"x y w").is_err());
        let plain = PointLineGrammar::of(b"1.5 2 3.25").unwrap();
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
