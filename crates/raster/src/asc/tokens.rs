//! Tokenizer of a text file in bounded memory; words carry their position.

use crate::decimal;
use terrane_base::error::{Error, Result};
use terrane_files::{AHEAD, RawFile};

/// Bytes read at a time.
const CHUNK: usize = 64 << 10;
/// Maximum length of a number.
const MAX_WORD: usize = 256;

/// A reader of whitespace-separated words.
pub(super) struct AscTokens<'a> {
    file: &'a RawFile,
    buffer: Vec<u8>,
    /// Index of the next byte in `buffer`.
    next: usize,
    /// File offset of the end of `buffer`.
    end: u64,
    /// Offset and line number of the start.
    start: (u64, u64),
    /// Number of line ends skipped before the last word.
    breaks: u64,
}

/// True for a line end byte, alone or as part of CR LF.
fn is_break(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

impl<'a> AscTokens<'a> {
    /// Words from `offset` on, which is in line `line`.
    pub(super) fn new(file: &'a RawFile, offset: u64, line: u64) -> Self {
        Self { file, buffer: Vec::new(), next: 0, end: offset, start: (offset, line), breaks: 0 }
    }

    /// A counter that increases exactly when a line ends between two words.
    pub(super) fn breaks(&self) -> u64 {
        self.breaks
    }

    /// Number of the line of the last word, from 1.
    pub(super) fn line(&self) -> u64 {
        self.line_of(self.offset())
    }

    /// Line number, from 1, of the word that ends at `offset`. Rescans the file, because line numbers are
    /// rarely needed and counting them would slow down parsing.
    pub(super) fn line_of(&self, offset: u64) -> u64 {
        let (mut at, mut line) = self.start;
        while at < offset {
            let bytes = (offset - at).min(CHUNK as u64);
            let Ok(text) = self.file.read_vec(at, bytes) else { break };
            line += text.iter().filter(|byte| **byte == b'\n').count() as u64;
            at += bytes;
        }
        line
    }

    /// The next word and its offset in the file; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<(u64, &[u8])>> {
        if !self.skip_space()? {
            return Ok(None);
        }
        let mut bytes = 0;
        loop {
            let rest = &self.buffer[self.next + bytes..];
            if let Some(found) = rest.iter().position(u8::is_ascii_whitespace) {
                bytes += found;
                break;
            }
            bytes += rest.len();
            if bytes > MAX_WORD || !self.refill()? {
                break;
            }
        }
        if bytes > MAX_WORD {
            return Err(Error::bad_input("word is too long for a number").at(self.place()));
        }
        let (offset, start) = (self.offset(), self.next);
        self.next += bytes;
        Ok(Some((offset, &self.buffer[start..start + bytes])))
    }

    /// Passes the next `count` words as numbers to `each`; returns the number of words if the file ends
    /// before.
    pub(super) fn values(&mut self, count: u64, mut each: impl FnMut(f64)) -> Result<u64> {
        let mut done = 0;
        loop {
            done += self.plain_values(count - done, &mut each);
            if done == count {
                return Ok(done);
            }
            let Some(value) = self.value()? else { return Ok(done) };
            each(value);
            done += 1;
        }
    }

    /// As [`values`](Self::values), up to the first word that is not a plain decimal or may continue after
    /// the buffer.
    #[inline(always)]
    fn plain_values(&mut self, count: u64, each: &mut impl FnMut(f64)) -> u64 {
        let (text, mut at, mut breaks) = (self.buffer.as_slice(), self.next, 0);
        let is_space = |at: usize| text.get(at).is_some_and(u8::is_ascii_whitespace);
        for done in 0..count {
            while is_space(at) {
                breaks += u64::from(is_break(text[at]));
                at += 1;
            }
            match decimal::leading(&text[at..]) {
                Some((value, bytes)) if is_space(at + bytes) => {
                    each(value);
                    at += bytes;
                }
                _ => {
                    (self.next, self.breaks) = (at, self.breaks + breaks);
                    return done;
                }
            }
        }
        (self.next, self.breaks) = (at, self.breaks + breaks);
        count
    }

    /// The next word as a number; `None` at the end.
    fn value(&mut self) -> Result<Option<f64>> {
        let Some((_, word)) = self.next()? else { return Ok(None) };
        let value = number(word).ok_or_else(|| no_number(word));
        value.map(Some).map_err(|e| e.at(self.place()))
    }

    /// File offset after the last word.
    pub(super) fn offset(&self) -> u64 {
        self.end - (self.buffer.len() - self.next) as u64
    }

    /// "line 7".
    pub(super) fn place(&self) -> String {
        format!("line {}", self.line())
    }

    /// Skips to the next word; false at the end of the file.
    fn skip_space(&mut self) -> Result<bool> {
        loop {
            while let Some(byte) = self.buffer.get(self.next) {
                if !byte.is_ascii_whitespace() {
                    return Ok(true);
                }
                self.breaks += u64::from(is_break(*byte));
                self.next += 1;
            }
            if !self.refill()? {
                return Ok(false);
            }
        }
    }

    /// Drops consumed bytes and appends a chunk; false at the end of the file.
    fn refill(&mut self) -> Result<bool> {
        self.buffer.drain(..self.next);
        self.next = 0;
        let bytes = (self.file.size() - self.end).min(CHUNK as u64) as usize;
        let start = self.buffer.len();
        self.buffer.resize(start + bytes, 0);
        self.file.read_on(self.end, &mut self.buffer[start..], AHEAD)?;
        self.end += bytes as u64;
        Ok(bytes > 0)
    }
}

fn no_number(word: &[u8]) -> Error {
    let word = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
    Error::bad_input(format!("{word:?} is not a number"))
}

/// Parses a number, accepting a decimal comma, `nan`, and Microsoft's `1.#QNAN`. `None` if it is not a
/// number, or out of the range of `f64`.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    if let Some(value) = decimal::whole(text) {
        return Some(value);
    }
    let lower = text.to_lowercase();
    if ["#qnan", "#snan", "#ind", "#inf"].iter().any(|mark| lower.contains(mark)) {
        return Some(f64::NAN);
    }
    if text.matches(',').count() == 1 { decimal::whole(&text.replace(',', ".")) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::path::Path;

    #[test]
    fn words_with_offsets_and_lines_across_chunks() {
        let mut text = String::new();
        let mut expected = Vec::new();
        for i in 0..30_000_u64 {
            text += if i % 7 == 0 { "\r\n" } else { " \t" };
            let line = text.bytes().filter(|b| *b == b'\n').count() as u64 + 1;
            if i % 1000 == 0 {
                expected.push((i, text.len() as u64, line));
            }
            text += &i.to_string();
        }
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        let file = RawFile::of(file, Path::new("t.asc")).unwrap();
        let mut tokens = AscTokens::new(&file, 0, 1);
        let mut expected = expected.into_iter();
        for i in 0..30_000_u64 {
            let (offset, word) = tokens.next().unwrap().unwrap();
            assert_eq!(number(word), Some(i as f64));
            let after = offset + word.len() as u64;
            if i % 1000 == 0 {
                assert_eq!(expected.next(), Some((i, offset, tokens.line())));
            }
            assert_eq!(tokens.offset(), after);
        }
        assert!(tokens.next().unwrap().is_none());
    }

    #[test]
    fn values_are_those_of_the_words_wherever_chunks_end() {
        let words = ["1", "-2.5", "1e3", "+7", "1,5", "12345678901234567890", "0.1", "-0"];
        let mut file = tempfile::tempfile().unwrap();
        let text: String = (0..40_000).map(|i| format!("{}\n", words[i % words.len()])).collect();
        file.write_all(text.as_bytes()).unwrap();
        let file = RawFile::of(file, Path::new("t.asc")).unwrap();
        let mut tokens = AscTokens::new(&file, 0, 1);
        let mut values = Vec::new();
        // Of any number at a time.
        for count in (0..).take_while(|count| count * (count + 1) / 2 < 40_000) {
            assert_eq!(tokens.line(), values.len().max(1) as u64);
            assert_eq!(tokens.values(count, |value| values.push(value)).unwrap(), count);
        }
        let left = 40_000 - values.len() as u64;
        assert_eq!(tokens.values(50_000, |value| values.push(value)).unwrap(), left);
        assert_eq!(values.len(), 40_000);
        for (i, value) in values.iter().enumerate() {
            let expected = number(words[i % words.len()].as_bytes()).unwrap();
            assert_eq!(value.to_bits(), expected.to_bits(), "{i}");
        }
    }

    #[test]
    fn numbers_as_people_write_them() {
        let cases: [(&str, f64); 8] = [
            ("12", 12.0),
            ("-7", -7.0),
            ("+3.5", 3.5),
            (",500E+02", 50.0),
            ("1,5", 1.5),
            ("1e3", 1000.0),
            ("12345678901", 12_345_678_901.0),
            (".5", 0.5),
        ];
        for (word, value) in cases {
            assert_eq!(number(word.as_bytes()), Some(value), "{word}");
        }
        for word in ["nan", "NaN", "-nan", "1.#QNAN", "-1.#IND", "-1.#INF"] {
            assert!(number(word.as_bytes()).unwrap().is_nan(), "{word}");
        }
        for word in ["", "-", "x", "1,2,3", "1.2.3", "12a", "\u{e9}", "6e999", "-6e999", "6,1e999"]
        {
            assert_eq!(number(word.as_bytes()), None, "{word}");
        }
        assert_eq!(number(&[0xff, b'1']), None);
    }
}
