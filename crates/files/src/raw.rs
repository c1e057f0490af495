//! Input files read by position (`pread`), never mapped: a shrinking file is an error, not a signal. Every
//! range is checked against the file length before memory is allocated.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::position::read_exact_at;
use crate::remote::{self, RemoteFile};
use terrane_base::error::{Error, ErrorKind, Result};

/// Bytes that are read ahead of remote files.
pub const AHEAD: u64 = 8 << 20;
/// Maximum number of bytes read at once for adjacent rows.
const RUN_BYTES: usize = 1 << 20;
/// Bytes that are read in the time of a call of the system.
const CALL_BYTES: u64 = 4 << 10;

/// An open input file of known length.
#[derive(Debug)]
pub struct RawFile {
    bytes: FileBytes,
    len: u64,
    path: PathBuf,
}

/// Where the bytes of a file are.
#[derive(Debug)]
enum FileBytes {
    Local(File),
    Remote(Arc<RemoteFile>),
}

/// Equally spaced rows of bytes in a file.
#[derive(Clone, Copy, Debug)]
pub struct RowRun {
    /// Offset of the first byte of the first row.
    pub offset: u64,
    /// Bytes from the start of one row to that of the next.
    pub pitch: u64,
    /// Bytes to read of each row.
    pub bytes: usize,
    /// Number of rows.
    pub rows: usize,
}

impl RowRun {
    /// Passes each row to `each(row, bytes)`. `read(offset, out)` fills `out`, with adjacent rows in one call; `scratch` is
    /// reused between calls.
    pub fn each(
        self,
        scratch: &mut Vec<u8>,
        mut read: impl FnMut(u64, &mut [u8]) -> Result<()>,
        mut each: impl FnMut(usize, &mut [u8]),
    ) -> Result<()> {
        let step = self.rows_at_once();
        for first in (0..self.rows).step_by(step) {
            let rows = step.min(self.rows - first);
            // With one row at a time the pitch is unused, so it may exceed usize.
            let pitch = if rows == 1 { 0 } else { self.pitch as usize };
            // No gap follows the last row: the file may end with it.
            let bytes = pitch * (rows - 1) + self.bytes;
            // Never shorter: what is grown again is zeroed again.
            scratch.resize(scratch.len().max(bytes), 0);
            // Saturated, so that offsets of damaged files fail in `read` and do not wrap into the file.
            let offset = self.offset.saturating_add(self.pitch.saturating_mul(first as u64));
            read(offset, &mut scratch[..bytes])?;
            for row in 0..rows {
                each(first + row, &mut scratch[row * pitch..][..self.bytes]);
            }
        }
        Ok(())
    }

    /// The bytes that are read.
    fn ranges(&self) -> Vec<Range<u64>> {
        let range = |first: usize, rows: usize| {
            let start = self.offset.saturating_add(self.pitch.saturating_mul(first as u64));
            let gaps = self.pitch.saturating_mul(rows as u64 - 1);
            start..start.saturating_add(gaps).saturating_add(self.bytes as u64)
        };
        match (self.rows, self.rows_at_once()) {
            (0, _) => Vec::new(),
            (rows, 1) => (0..rows).map(|row| range(row, 1)).collect(),
            (rows, _) => std::iter::once(range(0, rows)).collect(),
        }
    }

    /// The bytes after whole rows, which are read from the top to the bottom of a file.
    fn after(&self) -> Vec<Range<u64>> {
        let end = self.offset.saturating_add(self.pitch.saturating_mul(self.rows as u64));
        let is_whole = self.pitch == self.bytes as u64;
        is_whole.then(|| end..end.saturating_add(AHEAD)).into_iter().collect()
    }

    /// Number of rows to read in one call: several if at least half of the bytes read are used, or those between two rows
    /// cost less than a call.
    fn rows_at_once(&self) -> usize {
        let bytes = self.bytes as u64;
        let dense = self.pitch <= (2 * bytes).max(bytes + CALL_BYTES);
        if dense && self.pitch > 0 { (RUN_BYTES / self.pitch as usize).max(1) } else { 1 }
    }
}

impl RawFile {
    /// Opens the regular, non-empty file at `path`, or at a URL (`https://host/file`, `s3://bucket/key`).
    pub fn open(path: &Path) -> Result<Self> {
        if remote::is_remote(path) {
            let file = remote::open(path)?;
            let (len, path) = (file.bytes(), path.to_path_buf());
            return Ok(Self { bytes: FileBytes::Remote(file), len, path });
        }
        let meta = std::fs::metadata(path).map_err(|e| Error::read(path, e))?;
        if meta.is_dir() {
            return Err(Error::usage("is a folder, not a file").in_file(path));
        }
        if !meta.is_file() {
            return Err(Error::bad_input("is not a regular file").in_file(path));
        }
        Self::of(File::open(path).map_err(|e| Error::read(path, e))?, path)
    }

    /// Takes over an open file; errors name it `path`.
    pub fn of(file: File, path: &Path) -> Result<Self> {
        let len = file.metadata().map_err(|e| Error::read(path, e))?.len();
        if len == 0 {
            return Err(Error::bad_input("file is empty").in_file(path).remedy("copy it again"));
        }
        Ok(Self { bytes: FileBytes::Local(file), len, path: path.to_path_buf() })
    }

    /// Length in bytes at the time of opening.
    pub fn size(&self) -> u64 {
        self.len
    }

    /// Path named in errors.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Fails unless `bytes` bytes at `offset` lie inside the file.
    pub fn check_range(&self, offset: u64, bytes: u64) -> Result<()> {
        match offset.checked_add(bytes) {
            Some(end) if end <= self.len => Ok(()),
            _ => Err(Error::bad_input(format!(
                "file is truncated or damaged: {bytes} bytes expected at offset {offset}, file ends at {}",
                self.len
            ))
            .in_file(&self.path)
            .remedy("copy it again")),
        }
    }

    /// Fills `out` from the bytes at `offset`.
    pub fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        self.read_on(offset, out, 0)
    }

    /// As [`read_at`](Self::read_at); of a remote file, the next `ahead` bytes are read ahead.
    pub fn read_on(&self, offset: u64, out: &mut [u8], ahead: u64) -> Result<()> {
        self.check_range(offset, out.len() as u64)?;
        match &self.bytes {
            FileBytes::Local(file) => {
                read_exact_at(file, out, offset).map_err(|e| self.failed(offset, e))
            }
            FileBytes::Remote(file) => file.read_at(offset, out, ahead),
        }
    }

    /// Whether it is a remote file.
    pub fn is_remote(&self) -> bool {
        !matches!(self.bytes, FileBytes::Local(_))
    }

    /// The strong ETag or Last-Modified of a remote file, if the server sends one.
    pub fn version(&self) -> Option<&str> {
        match &self.bytes {
            FileBytes::Local(_) => None,
            FileBytes::Remote(file) => file.version(),
        }
    }

    /// Requests the `needed` ranges of a remote file in parallel; if any of them was not cached, those `ahead`, too. Does
    /// nothing for local files.
    ///
    /// # Errors
    /// Those of reading.
    pub fn prefetch(&self, needed: &[Range<u64>], ahead: &[Range<u64>]) -> Result<()> {
        match &self.bytes {
            FileBytes::Local(_) => Ok(()),
            FileBytes::Remote(file) => file.prefetch(needed, ahead),
        }
    }

    /// Reads `bytes` bytes at `offset`; the caller has capped `bytes`.
    pub fn read_vec(&self, offset: u64, bytes: u64) -> Result<Vec<u8>> {
        // Before the buffer is made: a damaged length would otherwise ask for memory the file cannot fill.
        self.check_range(offset, bytes)?;
        let mut out = vec![0; to_usize("read length", bytes)?];
        self.read_at(offset, &mut out)?;
        Ok(out)
    }

    /// Reads up to `most` bytes from the start of the file.
    pub fn head(&self, most: u64) -> Result<Vec<u8>> {
        self.read_vec(0, self.len.min(most))
    }

    /// Passes each row of `run` to `each(row, bytes)`; adjacent rows are read together. `scratch` is reused
    /// between calls.
    pub fn each_row(
        &self,
        run: RowRun,
        scratch: &mut Vec<u8>,
        each: impl FnMut(usize, &mut [u8]),
    ) -> Result<()> {
        if self.is_remote() {
            self.prefetch(&run.ranges(), &run.after())?;
        }
        run.each(scratch, |offset, out| self.read_at(offset, out), each)
    }

    /// A sequential reader from the start.
    pub fn reader(&self) -> RawFileReader<'_> {
        self.reader_at(0)
    }

    /// A sequential reader from `offset` on.
    pub fn reader_at(&self, offset: u64) -> RawFileReader<'_> {
        RawFileReader { file: self, at: offset }
    }

    fn failed(&self, offset: u64, source: io::Error) -> Error {
        if source.kind() == io::ErrorKind::UnexpectedEof {
            return Error::bad_input("file shrank while it was being read")
                .at(format_args!("offset {offset}"))
                .in_file(&self.path);
        }
        Error::read(&self.path, source)
    }
}

/// Sequential reader of a [`RawFile`], for stream decoders.
pub struct RawFileReader<'a> {
    file: &'a RawFile,
    at: u64,
}

impl<'a> RawFileReader<'a> {
    /// Path named in errors.
    pub fn path(&self) -> &'a Path {
        self.file.path()
    }
}

impl io::Read for RawFileReader<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let bytes = (out.len() as u64).min(self.file.len.saturating_sub(self.at)) as usize;
        if bytes == 0 {
            return Ok(0);
        }
        match &self.file.bytes {
            FileBytes::Local(file) => read_exact_at(file, &mut out[..bytes], self.at)?,
            FileBytes::Remote(file) => {
                file.read_at(self.at, &mut out[..bytes], AHEAD).map_err(io::Error::other)?;
            }
        }
        self.at += bytes as u64;
        Ok(bytes)
    }
}

impl io::Seek for RawFileReader<'_> {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        let at = match to {
            io::SeekFrom::Start(at) => Some(at),
            io::SeekFrom::End(by) => self.file.len.checked_add_signed(by),
            io::SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.at)
    }
}

/// `value` as a length in memory.
pub fn to_usize(name: &str, value: u64) -> Result<usize> {
    usize::try_from(value).map_err(|_| {
        Error::new(
            ErrorKind::Resource,
            format!("{name} of {value} bytes exceeds the address space"),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn file_of(bytes: &[u8]) -> RawFile {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        RawFile::of(file, Path::new("t.bin")).unwrap()
    }

    #[test]
    fn ranges_beyond_the_end_are_refused_before_allocation() {
        let file = file_of(&[1, 2, 3]);
        assert_eq!(file.read_vec(1, 2).unwrap(), [2, 3]);
        for (offset, bytes) in [(1, 3), (4, 0), (u64::MAX, 2), (0, u64::MAX)] {
            let error = file.read_vec(offset, bytes).unwrap_err().to_string();
            assert!(error.contains("ends at 3"), "{error}");
        }
    }

    #[test]
    fn rows_come_out_alike_dense_or_sparse() {
        let bytes: Vec<u8> = (0..200).map(|i| i as u8).collect();
        let file = file_of(&bytes);
        let mut scratch = Vec::new();
        for (pitch, wanted) in [(10, 9), (10, 2), (3, 3), (1, 1)] {
            let run = RowRun { offset: 5, pitch, bytes: wanted, rows: 7 };
            let mut seen = 0;
            file.each_row(run, &mut scratch, |row, got| {
                let start = 5 + row * pitch as usize;
                assert_eq!(got, &bytes[start..start + wanted]);
                seen += 1;
            })
            .unwrap();
            assert_eq!(seen, 7);
        }
        let beyond = RowRun { offset: 195, pitch: 10, bytes: 9, rows: 2 };
        assert!(file.each_row(beyond, &mut scratch, |_, _| {}).is_err());
    }

    #[test]
    fn folders_and_empty_files_are_named_as_such() {
        let folder = tempfile::tempdir().unwrap();
        assert!(RawFile::open(folder.path()).unwrap_err().to_string().contains("folder"));
        let empty = folder.path().join("e");
        std::fs::write(&empty, b"").unwrap();
        assert!(RawFile::open(&empty).unwrap_err().to_string().contains("empty"));
    }
}
