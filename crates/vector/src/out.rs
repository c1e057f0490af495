//! Writing from the front to the back, buffered, to a file that appears when it is complete.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use terrane_base::error::{Error, Result};
use terrane_files::RawFile;
use terrane_files::atomic::{AtomicFile, plain};

/// Bytes gathered before they go to the file.
const BUFFER_BYTES: usize = 1 << 18;

/// An output file.
pub(super) struct Out {
    file: AtomicFile,
    /// What is to be written next; appended to by formats.
    pub(super) buffer: Vec<u8>,
    /// Bytes that have left the buffer.
    written: u64,
}

impl Out {
    pub(super) fn create(path: &Path, overwrite: bool) -> Result<Self> {
        let file = AtomicFile::create(path, overwrite)?;
        Ok(Self { file, buffer: Vec::new(), written: 0 })
    }

    /// Bytes written so far, those in the buffer included.
    pub(super) fn bytes(&self) -> u64 {
        self.written + self.buffer.len() as u64
    }

    /// Empties the buffer if it has grown large.
    pub(super) fn settle(&mut self) -> Result<()> {
        if self.buffer.len() < BUFFER_BYTES { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<()> {
        self.file.write_all(&self.buffer).map_err(|e| Error::write(self.file.path(), e))?;
        self.written += self.buffer.len() as u64;
        self.buffer.clear();
        Ok(())
    }

    /// Writes over the start of the file.
    pub(super) fn rewrite_start(&mut self, bytes: &[u8]) -> Result<()> {
        self.flush()?;
        let file = &mut self.file;
        let written = file.seek(SeekFrom::Start(0)).and_then(|_| file.write_all(bytes));
        let back = written.and_then(|()| file.seek(SeekFrom::End(0)));
        back.map(|_| ()).map_err(|e| Error::write(self.file.path(), e))
    }

    /// Appends all that `spool` holds.
    pub(super) fn append(&mut self, spool: Spool) -> Result<()> {
        let mut at = 0;
        let file = spool.finish()?;
        let Some(file) = file else { return Ok(()) };
        while at < file.size() {
            let bytes = (file.size() - at).min(BUFFER_BYTES as u64);
            self.buffer.extend_from_slice(&file.read_vec(at, bytes)?);
            self.settle()?;
            at += bytes;
        }
        Ok(())
    }

    /// Gives the file its name; its path and size.
    pub(super) fn commit(mut self) -> Result<(PathBuf, u64)> {
        self.flush()?;
        let path = self.file.path().to_path_buf();
        Ok((path, self.file.commit()?))
    }
}

/// An unnamed temporary file: what has to wait until all features are known.
pub(super) struct Spool {
    file: File,
    /// The folder, which its errors name.
    folder: PathBuf,
    pub(super) buffer: Vec<u8>,
    written: u64,
}

impl Spool {
    /// In `folder`, or else beside the file at `path`.
    pub(super) fn new(path: &Path, folder: Option<&Path>) -> Result<Self> {
        let beside = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let folder = folder.or(beside).unwrap_or(Path::new(".")).to_path_buf();
        let file = tempfile::tempfile_in(&folder).map_err(|e| Error::write(&folder, plain(e)))?;
        Ok(Self { file, folder, buffer: Vec::new(), written: 0 })
    }

    /// Bytes so far.
    pub(super) fn bytes(&self) -> u64 {
        self.written + self.buffer.len() as u64
    }

    /// Empties the buffer if it has grown large.
    pub(super) fn settle(&mut self) -> Result<()> {
        if self.buffer.len() < BUFFER_BYTES { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<()> {
        self.file.write_all(&self.buffer).map_err(|e| Error::write(&self.folder, e))?;
        self.written += self.buffer.len() as u64;
        self.buffer.clear();
        Ok(())
    }

    /// All of it, to be read; `None` where nothing was written.
    pub(super) fn finish(mut self) -> Result<Option<RawFile>> {
        self.flush()?;
        if self.written == 0 {
            return Ok(None);
        }
        RawFile::of(self.file, &self.folder).map(Some)
    }
}
