//! Sequential reading of input files through a buffer.

use std::path::Path;

use terrane_base::error::Result;
use terrane_base::limits;
use terrane_files::RawFile;

/// Bytes read at a time.
const CHUNK_BYTES: usize = 1 << 18;

/// The buffered, unread part of a file.
pub(super) struct FileWindow {
    file: RawFile,
    buffer: Vec<u8>,
    /// The first unread byte in the buffer.
    start: usize,
    /// One past the last byte read into the buffer.
    end: usize,
    /// File offset of the end of the buffer.
    read: u64,
}

impl FileWindow {
    /// Opens a file and skips the UTF-8 byte order mark.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = RawFile::open(path)?;
        let mut window = Self { file, buffer: Vec::new(), start: 0, end: 0, read: 0 };
        window.ensure(3)?;
        if window.text().starts_with(b"\xef\xbb\xbf") {
            window.advance(3);
        }
        Ok(window)
    }

    /// The buffered, unread text.
    #[inline]
    pub(super) fn text(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    /// File offset of the unread text.
    pub(super) fn offset(&self) -> u64 {
        self.read - (self.end - self.start) as u64
    }

    /// Consumes `bytes` of the text.
    #[inline]
    pub(super) fn advance(&mut self, bytes: usize) {
        self.start = (self.start + bytes).min(self.end);
    }

    /// Reads more text; false at the end of the file.
    pub(super) fn more(&mut self) -> Result<bool> {
        let left = self.file.size() - self.read;
        if left == 0 {
            return Ok(false);
        }
        let unread = self.end - self.start;
        limits::check("feature size in bytes", unread as u64, limits::MAX_FEATURE_BYTES)?;
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, unread);
        // Doubles the buffer, so that long features are moved only a few times.
        let chunk = (unread.max(CHUNK_BYTES) as u64).min(left) as usize;
        if self.buffer.len() < unread + chunk {
            self.buffer.resize(unread + chunk, 0);
        }
        self.file.read_at(self.read, &mut self.buffer[unread..unread + chunk])?;
        self.end += chunk;
        self.read += chunk as u64;
        Ok(true)
    }

    /// Buffers `bytes`, or the rest of the file if it is shorter.
    #[inline]
    pub(super) fn ensure(&mut self, bytes: usize) -> Result<()> {
        while self.end - self.start < bytes && self.more()? {}
        Ok(())
    }

    /// The byte at `at` of the text, read if necessary.
    #[inline]
    pub(super) fn byte(&mut self, at: usize) -> Result<Option<u8>> {
        self.ensure(at + 1)?;
        Ok(self.text().get(at).copied())
    }

    /// Length of the current line without its terminator; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Result<Option<usize>> {
        let mut seen = 0;
        loop {
            let found = self.text()[seen..].iter().position(|&byte| byte == b'\n');
            if let Some(found) = found {
                return Ok(Some(seen + found));
            }
            seen = self.text().len();
            if !self.more()? {
                return Ok((seen > 0).then_some(seen));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_bytes_cross_chunks() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let long = "x".repeat(CHUNK_BYTES * 2 + 7);
        std::fs::write(file.path(), format!("\u{feff}a\n{long}\n\nend")).unwrap();
        let mut window = FileWindow::open(file.path()).unwrap();
        let mut lines = Vec::new();
        while let Some(bytes) = window.line().unwrap() {
            lines.push((window.offset(), bytes));
            window.advance(bytes + 1);
        }
        let after = 5 + long.len() as u64 + 1;
        assert_eq!(lines, [(3, 1), (5, long.len()), (after, 0), (after + 1, 3)]);
        assert_eq!(window.byte(0).unwrap(), None);
    }
}
