//! Buffered writing of records and text, for final files and spools alike.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use terrane_base::error::{Error, Result};
use terrane_files::atomic::plain;
use terrane_files::fault::{self, Point};

/// Bytes gathered before they go to the file: enough to make the cost of a call vanish.
const BUFFER_BYTES: usize = 1 << 20;

/// A file being written from the front to the back, and the name that its errors bear.
pub(super) struct Out {
    file: File,
    path: PathBuf,
    buffer: Vec<u8>,
}

impl Out {
    /// Writes to `file` from its current position on; errors name `path`.
    pub(super) fn new(file: File, path: &Path) -> Self {
        Self { file, path: path.to_path_buf(), buffer: Vec::new() }
    }

    /// Starts an anonymous file in `folder`, which vanishes with this value. Errors name `folder`.
    pub(super) fn spool(folder: &Path) -> Result<Self> {
        let file = tempfile::tempfile_in(folder).map_err(|e| Error::write(folder, plain(e)))?;
        Ok(Self::new(file, folder))
    }

    /// Appends bytes.
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> Result<()> {
        self.buffer.extend_from_slice(bytes);
        self.flush_when_full()
    }

    /// Appends one record of `N` bytes per item.
    pub(super) fn records<T, const N: usize>(
        &mut self,
        items: &[T],
        mut encode: impl FnMut(&T) -> [u8; N],
    ) -> Result<()> {
        for some in items.chunks(BUFFER_BYTES / N) {
            let at = self.buffer.len();
            self.buffer.resize(at + some.len() * N, 0);
            let (records, _) = self.buffer[at..].as_chunks_mut::<N>();
            for (record, item) in records.iter_mut().zip(some) {
                *record = encode(item);
            }
            self.flush_when_full()?;
        }
        Ok(())
    }

    /// Appends what `write` adds to the buffer for each item.
    pub(super) fn lines<T>(
        &mut self,
        items: &[T],
        mut write: impl FnMut(&T, &mut Vec<u8>),
    ) -> Result<()> {
        for item in items {
            write(item, &mut self.buffer);
            self.flush_when_full()?;
        }
        Ok(())
    }

    /// Appends everything written to `spool` so far; within the kernel where it can.
    pub(super) fn append(&mut self, spool: &mut Out) -> Result<()> {
        self.flush()?;
        let mut source = spool.rewound()?;
        io::copy(&mut source, &mut self.file).map_err(|e| Error::write(&self.path, e))?;
        Ok(())
    }

    /// Overwrites the start of the file; nothing may be appended afterwards.
    pub(super) fn rewrite_start(&mut self, bytes: &[u8]) -> Result<()> {
        self.flush()?;
        let written = self.file.rewind().and_then(|()| self.file.write_all(bytes));
        written.map_err(|e| Error::write(&self.path, e))
    }

    /// The file, complete, to be read from its start.
    pub(super) fn rewound(&mut self) -> Result<&File> {
        self.flush()?;
        self.file.seek(SeekFrom::Start(0)).map_err(|e| Error::write(&self.path, e))?;
        Ok(&self.file)
    }

    /// As [`rewound`](Self::rewound), when writing is over.
    pub(super) fn into_file(mut self) -> Result<File> {
        self.rewound()?;
        Ok(self.file)
    }

    fn flush_when_full(&mut self) -> Result<()> {
        if self.buffer.len() < BUFFER_BYTES { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<()> {
        let written = fault::point(Point::Write).and_then(|()| self.file.write_all(&self.buffer));
        written.map_err(|e| Error::write(&self.path, e))?;
        self.buffer.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use terrane_base::error::ErrorKind;

    #[test]
    fn records_lines_and_spools_come_out_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut body = Out::spool(folder.path()).unwrap();
        let mut tail = Out::spool(folder.path()).unwrap();
        let numbers: Vec<u32> = (0..700_000).collect();
        body.bytes(b"head").unwrap();
        body.records(&numbers, |n| n.to_le_bytes()).unwrap();
        tail.lines(&numbers, |n, buffer| buffer.extend_from_slice(&n.to_be_bytes())).unwrap();
        body.append(&mut tail).unwrap();
        body.rewrite_start(b"HE").unwrap();
        let mut bytes = Vec::new();
        body.into_file().unwrap().read_to_end(&mut bytes).unwrap();
        let little = numbers.iter().flat_map(|n| n.to_le_bytes());
        let big = numbers.iter().flat_map(|n| n.to_be_bytes());
        assert!(b"HEad".iter().copied().chain(little).chain(big).eq(bytes));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_an_io_error() {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut out = Out::new(full, Path::new("mesh.ply"));
        let error = out.bytes(&vec![0; BUFFER_BYTES]).unwrap_err();
        assert_eq!((error.kind(), error.path()), (ErrorKind::Io, Some(Path::new("mesh.ply"))));
        assert!(error.to_string().ends_with("free some space, or choose another place"));
    }
}
