//! Reader of points in a text file, one per line, with any common separator and an optional header.

use std::io::{BufRead, BufReader, Read};

use crate::decimal;
use terrane_base::error::{Error, Result};
use terrane_files::{self as file, RawFile};

/// Maximum line length in bytes.
const MAX_LINE: u64 = 4096;
/// Maximum number of consecutive spaces of a plain line.
const MAX_SPACES: usize = 64;

/// Names of the columns x, y and z in headers, in lower case.
const NAMES: [&[&str]; 3] = [
    &["x", "lon", "long", "longitude", "east", "easting"],
    &["y", "lat", "latitude", "north", "northing"],
    &["z", "alt", "altitude", "elev", "elevation", "height", "h"],
];

/// Sequential reader of points.
pub(super) struct XyzPointReader<'a> {
    file: &'a RawFile,
    lines: BufReader<file::RawFileReader<'a>>,
    text: Vec<u8>,
    line: u64,
    separator: Option<XyzSeparator>,
    /// Columns of x, y and z.
    columns: [usize; 3],
    /// Number of words of the first line, required in all lines.
    words: Option<usize>,
}

impl<'a> XyzPointReader<'a> {
    /// A reader at the first point, after the header.
    pub(super) fn new(file: &'a RawFile) -> Result<Self> {
        let mut points = Self {
            file,
            lines: BufReader::with_capacity(64 << 10, file.reader()),
            text: Vec::new(),
            line: 0,
            separator: None,
            columns: [0, 1, 2],
            words: None,
        };
        if points.next_line()?.is_some_and(is_heading) {
            let heading = points.line_text();
            points.words = Some(XyzSeparator::of(heading).words(heading).count());
            points.columns = columns(points.line_text()).map_err(|e| e.at("line 1"))?;
        } else {
            points.lines = BufReader::with_capacity(64 << 10, file.reader());
            points.line = 0;
        }
        Ok(points)
    }

    /// The next point.
    pub(super) fn next(&mut self) -> Result<Option<[f64; 3]>> {
        if let Some(point) = self.next_plain() {
            return Ok(Some(point));
        }
        if self.next_line()?.is_none() {
            return Ok(None);
        }
        let text = self.line_text();
        let separator = self.separator.unwrap_or_else(|| XyzSeparator::of(text));
        let words: Vec<&str> = separator.words(text).collect();
        let found = words.len();
        let point = point(&words, separator, self.columns)
            .and_then(|point| even(found, self.words).map(|()| point))
            .map_err(|e| e.at(self.place()))?;
        (self.separator, self.words) = (Some(separator), Some(found));
        Ok(Some(point))
    }

    /// The next point if its line is plain and entirely in the buffer, which is the common case.
    fn next_plain(&mut self) -> Option<[f64; 3]> {
        let is_plain = self.columns == [0, 1, 2] && self.words == Some(3);
        let separator = self.separator.filter(|_| is_plain)?;
        let (point, bytes) = plain_point(self.lines.buffer(), separator)?;
        self.lines.consume(bytes);
        self.line += 1;
        Some(point)
    }

    /// "line 7".
    pub(super) fn place(&self) -> String {
        format!("line {}", self.line)
    }

    /// The next line that is neither empty nor a comment.
    fn next_line(&mut self) -> Result<Option<&str>> {
        loop {
            self.text.clear();
            let mut lines = self.lines.by_ref().take(MAX_LINE);
            let read = lines.read_until(b'\n', &mut self.text);
            self.line += 1;
            match read.map_err(|e| Error::read(self.file.path(), e))? as u64 {
                0 => return Ok(None),
                MAX_LINE if !self.text.ends_with(b"\n") => {
                    let message = format!("line exceeds {MAX_LINE} bytes");
                    return Err(Error::bad_input(message).at(self.place()));
                }
                _ => {}
            }
            if std::str::from_utf8(&self.text).is_err() {
                return Err(Error::bad_input("line is not text").at(self.place()));
            }
            let text = self.line_text();
            if !text.is_empty() && !text.starts_with('#') {
                break;
            }
        }
        Ok(Some(self.line_text()))
    }

    /// The current line as text.
    fn line_text(&self) -> &str {
        let text = std::str::from_utf8(&self.text).unwrap_or_default();
        trimmed(text.trim_start_matches('\u{feff}').trim_end_matches(['\r', '\n']))
    }
}

/// `text` without surrounding spaces. Other white space is not removed: inside a line it is an error.
fn trimmed(text: &str) -> &str {
    text.trim_matches([' ', '\t'])
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum XyzSeparator {
    Space,
    Comma,
    Semicolon,
}

impl XyzSeparator {
    fn of(line: &str) -> Self {
        let mut spaced = line.split([' ', '\t']).filter(|word| !word.is_empty());
        if line.contains(';') {
            Self::Semicolon
        } else if line.contains(',')
            && (spaced.clone().count() < 3 || spaced.any(|word| word.ends_with(',')))
        {
            Self::Comma
        } else {
            Self::Space
        }
    }

    #[inline]
    fn splits_at(self, c: char) -> bool {
        match self {
            Self::Space => matches!(c, ' ' | '\t'),
            Self::Comma => c == ',',
            Self::Semicolon => c == ';',
        }
    }

    fn words(self, line: &str) -> impl Iterator<Item = &str> {
        let words = line.split(move |c| self.splits_at(c));
        let words = words.filter(move |word| self != Self::Space || !word.is_empty());
        words.map(|word| unquoted(trimmed(word)))
    }

    /// Length of the separator at the start of `text`, with the spaces after it.
    fn leading(self, text: &[u8]) -> Option<usize> {
        let own = match self {
            Self::Space => return Some(spaces(text)).filter(|bytes| *bytes > 0),
            Self::Comma => b',',
            Self::Semicolon => b';',
        };
        let (first, rest) = text.split_first()?;
        (*first == own).then(|| 1 + spaces(rest))
    }

    /// Parses a number; the comma may be the decimal point if it is not the separator.
    fn number(self, word: &str) -> Option<f64> {
        decimal::whole(word).or_else(|| {
            let comma = self != Self::Comma && word.matches(',').count() == 1;
            if comma { decimal::whole(&word.replace(',', ".")) } else { None }
        })
    }
}

/// `word` without a pair of quotes.
fn unquoted(word: &str) -> &str {
    word.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(word)
}

/// Fails if a line has another number of columns than the lines before.
fn even(found: usize, before: Option<usize>) -> Result<()> {
    match before {
        Some(before) if before != found => Err(Error::bad_input(format!(
            "{found} values, expected {before} as in the lines before"
        ))
        .remedy("correct the line")),
        _ => Ok(()),
    }
}

/// Number of leading spaces.
fn spaces(text: &[u8]) -> usize {
    text.iter().take(MAX_SPACES).take_while(|byte| matches!(byte, b' ' | b'\t')).count()
}

/// The point of the first line of `text` and the length of the line, if it is three plain decimals and
/// complete; `None` otherwise.
fn plain_point(text: &[u8], separator: XyzSeparator) -> Option<([f64; 3], usize)> {
    let mut point = [0.0; 3];
    let mut at = spaces(text);
    for (i, value) in point.iter_mut().enumerate() {
        if i > 0 {
            at += separator.leading(&text[at..])?;
        }
        let (number, bytes) = decimal::leading(&text[at..])?;
        *value = number;
        at += bytes;
    }
    match text[at..] {
        [b'\n', ..] => Some((point, at + 1)),
        [b'\r', b'\n', ..] => Some((point, at + 2)),
        _ => None,
    }
}

fn is_heading(line: &str) -> bool {
    let separator = XyzSeparator::of(line);
    let mut words = separator.words(line).take(3);
    words.all(|word| word.starts_with(|c: char| c.is_alphabetic() || c == '_'))
}

/// Columns of x, y and z in a header; the first three if the names are unknown.
fn columns(heading: &str) -> Result<[usize; 3]> {
    let names: Vec<String> =
        XyzSeparator::of(heading).words(heading).map(str::to_lowercase).collect();
    match NAMES.map(|known| names.iter().position(|name| known.contains(&name.as_str()))) {
        [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
        [None, None, None] if names.len() >= 3 => Ok([0, 1, 2]),
        _ => {
            let heading: String = heading.chars().take(80).collect();
            let message = format!("header {heading:?} lacks x, y or z");
            Err(Error::bad_input(message).remedy("write one point per line: x, y and height"))
        }
    }
}

fn point(words: &[&str], separator: XyzSeparator, columns: [usize; 3]) -> Result<[f64; 3]> {
    let mut point = [0.0; 3];
    for (value, column) in point.iter_mut().zip(columns) {
        let word = words.get(column).ok_or_else(|| {
            Error::bad_input(format!("{} values, expected x, y and z", words.len()))
        })?;
        *value = separator.number(word).ok_or_else(|| {
            let word: String = word.chars().take(40).collect();
            Error::bad_input(format!("{word:?} is not a valid number"))
        })?;
    }
    if !(point[0].is_finite() && point[1].is_finite()) {
        return Err(Error::bad_input("x or y is not finite"));
    }
    Ok(point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        #[test]
        fn plain_lines_give_what_any_line_gives(
            line in "[ \t]{0,2}-?[0-9]{0,3}(\\.[0-9]{0,3})?[,; ][ \t]{0,2}-?[0-9]{1,9}[,; ]{1,2}[-0-9e.]{1,9}[ ,]?\r?",
        ) {
            for separator in [XyzSeparator::Space, XyzSeparator::Comma, XyzSeparator::Semicolon] {
                let text = format!("{line}\n1");
                if let Some((plain, bytes)) = plain_point(text.as_bytes(), separator) {
                    prop_assert_eq!(bytes, line.len() + 1);
                    let words: Vec<&str> = separator.words(trimmed(line.trim_end())).collect();
                    let any = point(&words, separator, [0, 1, 2]).unwrap();
                    prop_assert_eq!(words.len(), 3);
                    prop_assert_eq!(plain.map(f64::to_bits), any.map(f64::to_bits));
                }
            }
        }
    }

    #[test]
    fn common_lines_are_plain() {
        use XyzSeparator::{Comma, Semicolon, Space};
        for (line, separator) in [
            ("500000.5 4750000.0 -12.25\n", Space),
            ("  1\t2  3\r\n", Space),
            ("1,2,3\n", Comma),
            ("1, 2, 3\r\n", Comma),
            ("1;2;3\n", Semicolon),
        ] {
            let (_, bytes) = plain_point(line.as_bytes(), separator).unwrap();
            assert_eq!(bytes, line.len(), "{line:?}");
        }
        for line in ["1 2 3", "1 2\n", "1 2 3 4\n", "1 2 nan\n", "1 2 1e3\n", "# 1 2 3\n", ""] {
            assert_eq!(plain_point(line.as_bytes(), Space), None, "{line:?}");
        }
    }

    fn point_of(line: &str) -> Option<[f64; 3]> {
        let separator = XyzSeparator::of(line);
        point(&separator.words(line).collect::<Vec<_>>(), separator, [0, 1, 2]).ok()
    }

    #[test]
    fn separators_and_decimal_commas() {
        for line in
            ["1.5 2 3", "1.5,2,3", "1.5, 2, 3", "1.5;2;3", "1,5 2 3", "1,5;2;3", "1.5\t2\t3"]
        {
            assert_eq!(point_of(line), Some([1.5, 2.0, 3.0]), "{line}");
        }
        assert_eq!(point_of("\"1.5\";\"2\";3"), Some([1.5, 2.0, 3.0]));
        for line in [
            "1 2",
            "a b c",
            "1 2 x",
            "inf 1 2",
            "1,,2",
            "1 nan 2",
            "1 2 6e999",
            "1 2 \"3",
            "1 2 3\"",
            "1 2 \"",
            "1 2\r3",
            "1 2 3\u{b}4",
            "1 2 3\u{a0}000",
        ] {
            assert_eq!(point_of(line), None, "{line}");
        }
    }

    #[test]
    fn headings() {
        assert!(is_heading("x,y,z") && is_heading("Lon; Lat; H") && !is_heading("1 2 3"));
        assert_eq!(columns("id,Height,Northing,Easting").unwrap(), [3, 2, 1]);
        assert_eq!(columns("a b c d").unwrap(), [0, 1, 2]);
        assert!(columns("x y").is_err());
    }
}
