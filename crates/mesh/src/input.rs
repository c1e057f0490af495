//! Random access to mesh files: records and lines.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::ops::Range;
use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::{AHEAD, RawFile, RawFileReader};

/// Bytes read at a time.
const CHUNK_BYTES: u64 = 256 << 10;
/// Maximum bytes of a line.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// An open file of known length.
#[derive(Debug)]
pub(super) struct MeshFile {
    file: RawFile,
}

impl MeshFile {
    /// Opens a regular file.
    pub(super) fn open(path: &Path) -> Result<Self> {
        // Of a folder of blocks, a file that is a folder is a fault of the folder.
        if path.is_dir() {
            return Err(Error::bad_input("not a regular file").in_file(path));
        }
        RawFile::open(path).map(|file| Self { file })
    }

    /// Its path.
    pub(super) fn path(&self) -> &Path {
        self.file.path()
    }

    /// Its length.
    pub(super) fn bytes(&self) -> u64 {
        self.file.size()
    }

    /// An error about this file.
    pub(super) fn bad(&self, message: impl Into<String>) -> Error {
        Error::bad_input(message).in_file(self.path())
    }

    /// An error about an unsupported feature of this file.
    pub(super) fn unsupported(&self, message: impl Into<String>) -> Error {
        Error::unsupported(message).in_file(self.path())
    }

    /// The first bytes of the file, at most `max_bytes`.
    pub(super) fn head(&self, max_bytes: usize) -> Result<Vec<u8>> {
        self.file.head(max_bytes as u64)
    }

    /// Fills `out` from `offset`.
    pub(super) fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        self.file.read_at(offset, out)
    }

    /// Passes the records of `stride` bytes in the range `bytes` to `each`, numbered from 0. The range must lie
    /// inside the file.
    pub(super) fn records(
        &self,
        bytes: Range<u64>,
        stride: u64,
        mut each: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let chunk = (CHUNK_BYTES / stride).max(1) * stride;
        let mut buffer = vec![0; chunk.min(bytes.end - bytes.start) as usize];
        let (mut at, mut place) = (bytes.start, 0);
        while at < bytes.end {
            let records = &mut buffer[..chunk.min(bytes.end - at) as usize];
            let ahead = AHEAD.min(bytes.end - at - records.len() as u64);
            self.file.read_on(at, records, ahead)?;
            for record in records.chunks_exact(stride as usize) {
                each(place, record).map_err(|e| e.in_file(self.path()))?;
                place += 1;
            }
            at += chunk;
        }
        Ok(())
    }

    /// A reader of `file` whose errors name `path`.
    pub(super) fn of(file: File, path: &Path) -> Result<Self> {
        RawFile::of(file, path).map(|file| Self { file })
    }

    /// The bytes from `offset`.
    pub(super) fn from(&self, offset: u64) -> BufReader<RawFileReader<'_>> {
        BufReader::with_capacity(64 << 10, self.file.reader_at(offset))
    }

    /// The lines from byte `offset`, the start of line `number` (from 1).
    pub(super) fn lines(&self, offset: u64, number: u64) -> MeshFileLines<'_> {
        let reader = self.from(offset);
        MeshFileLines { reader, line: Vec::new(), start: offset, end: offset, number: number - 1 }
    }
}

/// Iterator over the lines of a text.
pub(super) struct MeshFileLines<'a> {
    reader: BufReader<RawFileReader<'a>>,
    line: Vec<u8>,
    start: u64,
    end: u64,
    number: u64,
}

impl MeshFileLines<'_> {
    /// Reads the next line; false at the end of the file.
    pub(super) fn advance(&mut self) -> Result<bool> {
        self.line.clear();
        self.start = self.end;
        let path = self.reader.get_ref().path();
        let mut reader = Read::take(&mut self.reader, MAX_LINE_BYTES + 1);
        let read = reader.read_until(b'\n', &mut self.line).map_err(|e| Error::read(path, e))?;
        self.end += read as u64;
        self.number += u64::from(read > 0);
        limits::check("line length", read as u64, MAX_LINE_BYTES)
            .map_err(|e| e.in_file(path).at(format!("line {}", self.number)))?;
        Ok(read > 0)
    }

    /// The line without its line break.
    pub(super) fn text(&self) -> &[u8] {
        let line = self.line.strip_suffix(b"\n").unwrap_or(&self.line);
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// Start of the line, in bytes.
    pub(super) fn start(&self) -> u64 {
        self.start
    }

    /// Start of the next line.
    pub(super) fn end(&self) -> u64 {
        self.end
    }

    /// The line's number, from 1.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// An error about the line.
    pub(super) fn bad(&self, message: impl Into<String>) -> Error {
        self.place(Error::bad_input(message))
    }

    /// An error about an unsupported feature of the line.
    pub(super) fn unsupported(&self, message: impl Into<String>) -> Error {
        self.place(Error::unsupported(message))
    }

    fn place(&self, error: Error) -> Error {
        error.in_file(self.reader.get_ref().path()).at(format!("line {}", self.number))
    }
}

/// Fails unless the range `first .. first + count` is within `total` items called `what`.
pub(super) fn check_range(what: &str, first: u64, count: usize, total: u64) -> Result<()> {
    match first.checked_add(count as u64) {
        Some(end) if end <= total => Ok(()),
        _ => Err(Error::usage(format!(
            "the range of {count} {what} from {first} exceeds the {total} {what} of the \
             mesh"
        ))),
    }
}

/// Fails unless the corners of triangle `index` are among `vertices`.
pub(super) fn check_corners(index: u64, corners: &[u64; 3], vertices: u64) -> Result<()> {
    match corners.iter().find(|&&id| id >= vertices) {
        None => Ok(()),
        Some(id) => Err(Error::bad_input(format!(
            "vertex {id} does not exist (the mesh has {vertices} vertices)"
        ))
        .at(format!("triangle {index}"))),
    }
}

/// Fails unless the position of vertex `index` is finite.
pub(super) fn check_position(index: u64, point: &[f64; 3]) -> Result<()> {
    if point.iter().all(|c| c.is_finite()) {
        return Ok(());
    }
    Err(Error::bad_input("position is not finite").at(format!("vertex {index}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(bytes: &[u8]) -> (tempfile::NamedTempFile, MeshFile) {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        let input = MeshFile::open(file.path()).unwrap();
        (file, input)
    }

    #[test]
    fn lines_know_their_places() {
        let (_file, input) = input(b"one\r\ntwo\n\nend");
        let mut lines = input.lines(5, 2);
        let mut found = Vec::new();
        while lines.advance().unwrap() {
            let text = String::from_utf8(lines.text().to_vec()).unwrap();
            found.push((text, lines.start(), lines.end(), lines.number()));
        }
        let expected = [("two", 5, 9, 2), ("", 9, 10, 3), ("end", 10, 13, 4)];
        assert_eq!(found, expected.map(|(t, a, b, n)| (t.to_owned(), a, b, n)));
    }

    #[test]
    fn endless_lines_are_refused() {
        let (_file, input) = input(&vec![b'x'; MAX_LINE_BYTES as usize + 2]);
        let error = input.lines(0, 1).advance().unwrap_err().to_string();
        assert!(error.contains("line 1: line length"), "{error}");
    }

    #[test]
    fn records_cross_chunks() {
        let bytes: Vec<u8> = (0..1_000_003_u32).map(|i| (i % 251) as u8).collect();
        let (_file, input) = input(&bytes);
        let mut seen = Vec::new();
        let keep = |place, record: &[u8]| {
            assert_eq!((place * 7, record.len()), (seen.len(), 7));
            seen.extend_from_slice(record);
            Ok(())
        };
        input.records(3..3 + 7 * 142_000, 7, keep).unwrap();
        assert_eq!(seen, bytes[3..3 + 7 * 142_000]);
    }
}
