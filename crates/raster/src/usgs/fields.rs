//! Number fields of a USGS DEM, which may be adjacent without a space ("  100-32767").

use terrane_base::error::{Error, Result};
use terrane_files::RawFile;

/// Bytes read at a time.
const CHUNK: u64 = 64 << 10;
/// Field width of a height, alone and with the padding of the preceding record.
const FIELDS: [usize; 2] = [6, 10];
/// Maximum length of a number.
const MAX_WORD: usize = 64;

/// Sequential reader of numbers.
pub(super) struct UsgsDemFieldReader<'a> {
    file: &'a RawFile,
    buffer: Vec<u8>,
    /// Index of the next byte in `buffer`.
    next: usize,
    /// File offset of the end of `buffer`.
    end: u64,
}

impl<'a> UsgsDemFieldReader<'a> {
    /// A reader from `offset` on.
    pub(super) fn new(file: &'a RawFile, offset: u64) -> Self {
        Self { file, buffer: Vec::new(), next: 0, end: offset }
    }

    /// Skips blanks up to the next multiple of `record` bytes after `start`.
    pub(super) fn align(&mut self, start: u64, record: u64) -> Result<()> {
        let at = start + (self.offset() - start).div_ceil(record) * record;
        self.skip_blanks(at)?;
        if self.offset() < at.min(self.file.size()) {
            return Err(Error::bad_input("data after the last height"));
        }
        Ok(())
    }

    /// Fails if more than blanks and a record of at most `most` bytes (the accuracy record) is left.
    pub(super) fn finish(&mut self, most: u64) -> Result<()> {
        self.skip_blanks(self.file.size())?;
        match self.file.size() - self.offset() {
            left if left <= most => Ok(()),
            left => Err(Error::bad_input(format!("{left} extra bytes after the last profile"))
                .remedy("copy the file again")),
        }
    }

    /// Skips blanks, up to `end` at most.
    fn skip_blanks(&mut self, end: u64) -> Result<()> {
        while self.offset() < end && self.peek()?.is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.next += 1;
        }
        Ok(())
    }

    /// An integer.
    pub(super) fn integer(&mut self) -> Result<i64> {
        let word = self.word()?;
        let text = std::str::from_utf8(&word).ok();
        text.and_then(|t| t.parse().ok()).ok_or_else(|| not_a("whole number", &word))
    }

    /// A Fortran real: "0.557945011821133D+06".
    pub(super) fn decimal(&mut self) -> Result<f64> {
        let word = self.word()?;
        decimal(&word).ok_or_else(|| not_a("number", &word))
    }

    fn offset(&self) -> u64 {
        self.end - (self.buffer.len() - self.next) as u64
    }

    fn word(&mut self) -> Result<Vec<u8>> {
        let (mut word, mut before) = (Vec::new(), 0);
        while let Some(byte) = self.peek()? {
            if byte.is_ascii_whitespace() {
                self.next += 1;
                if word.is_empty() {
                    before += 1;
                    continue;
                }
                return Ok(word);
            }
            let is_sign = matches!(byte, b'-' | b'+');
            if is_sign && word.last().is_some_and(|last| !b"DdEe".contains(last)) {
                return Ok(word);
            }
            if word.len() == MAX_WORD {
                return Err(not_a("number", &word));
            }
            word.push(byte);
            self.next += 1;
        }
        // A number that ends with the file must fill its field, or digits may be missing.
        if word.is_empty() || !FIELDS.contains(&(before + word.len())) {
            let found = self.file.size();
            let message = format!("file is truncated: it ends at byte {found}");
            return Err(Error::bad_input(message));
        }
        Ok(word)
    }

    fn peek(&mut self) -> Result<Option<u8>> {
        if self.next == self.buffer.len() {
            let bytes = (self.file.size() - self.end).min(CHUNK);
            self.buffer = self.file.read_vec(self.end, bytes)?;
            self.next = 0;
            self.end += bytes;
        }
        Ok(self.buffer.get(self.next).copied())
    }
}

/// A finite number with an exponent after D or E.
pub(super) fn decimal(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?.trim().replace(['D', 'd'], "E");
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

fn not_a(what: &str, word: &[u8]) -> Error {
    let word = String::from_utf8_lossy(word).into_owned();
    Error::bad_input(format!("{word:?} is not a {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::path::Path;

    #[test]
    fn numbers_that_touch_and_records() {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(b"  12-32767+5 0.5D+01-2.5e-1  7               8").unwrap();
        let file = RawFile::of(file, Path::new("t.dem")).unwrap();
        let mut fields = UsgsDemFieldReader::new(&file, 0);
        assert_eq!(fields.integer().unwrap(), 12);
        assert_eq!(fields.integer().unwrap(), -32767);
        assert_eq!(fields.integer().unwrap(), 5);
        assert_eq!(fields.decimal().unwrap(), 5.0);
        assert_eq!(fields.decimal().unwrap(), -0.25);
        assert_eq!(fields.integer().unwrap(), 7);
        fields.align(0, 40).unwrap();
        assert_eq!(fields.integer().unwrap(), 8);
        fields.align(0, 1000).unwrap();
        let error = fields.integer().unwrap_err().to_string();
        assert!(error.contains("it ends at byte 46"), "{error}");
        assert!(UsgsDemFieldReader::new(&file, 32).integer().is_err());
        let mut fields = UsgsDemFieldReader::new(&file, 0);
        fields.integer().unwrap();
        assert!(
            fields.align(0, 40).unwrap_err().to_string().contains("data after the last height")
        );
        assert!(fields.finish(41).unwrap_err().to_string().contains("42 extra bytes"));
        assert!(fields.finish(42).is_ok());
    }
}
