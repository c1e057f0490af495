//! One anonymous temporary file that holds what does not fit in memory, by extents.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::schedule::lock;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::fault::{self, Point};

/// A run of bytes in the spill file.
#[derive(Debug)]
pub(crate) struct Extent {
    offset: u64,
    len: u64,
}

/// The spill file. It is created at the first write and has no name, so the system removes it
/// whatever happens to the process.
pub(crate) struct Spill {
    folder: PathBuf,
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    file: Option<File>,
    end: u64,
    /// Free runs: length by offset, never touching each other.
    free: BTreeMap<u64, u64>,
    written: u64,
}

impl Spill {
    /// A spill file to be created in `folder`.
    pub(crate) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_path_buf(), inner: Mutex::default() }
    }

    /// Writes `parts` one after the other.
    pub(crate) fn write(&self, parts: &[&[u8]]) -> Result<Extent> {
        let len = parts.iter().map(|part| part.len() as u64).sum();
        let mut inner = lock(&self.inner);
        let offset = inner.take(len);
        let written = inner.write_at(&self.folder, offset, parts);
        inner.written += len;
        written.map_err(|e| self.failure("write to the temporary file", e))?;
        Ok(Extent { offset, len })
    }

    /// Reads `extent` back into `parts`, which together have its length, and frees it.
    pub(crate) fn read(&self, extent: Extent, parts: &mut [&mut [u8]]) -> Result<()> {
        let mut inner = lock(&self.inner);
        let read = inner.read_at(extent.offset, parts);
        inner.put_back(extent);
        read.map_err(|e| self.failure("read back the temporary file", e))
    }

    /// Gives the bytes of `extent` back without reading them.
    pub(crate) fn free(&self, extent: Extent) {
        lock(&self.inner).put_back(extent);
    }

    /// Bytes written so far.
    pub(crate) fn written(&self) -> u64 {
        lock(&self.inner).written
    }

    fn failure(&self, action: &str, source: io::Error) -> Error {
        Error::io(ErrorKind::Io, action, source)
            .in_file(&self.folder)
            .remedy("choose another folder with --temp-dir or allow more --memory")
    }
}

impl Inner {
    /// An offset with `len` free bytes: the first hole that is large enough, or the end.
    fn take(&mut self, len: u64) -> u64 {
        let hole = self.free.iter().find(|&(_, &size)| size >= len).map(|(&at, &size)| (at, size));
        let Some((offset, size)) = hole else {
            self.end += len;
            return self.end - len;
        };
        self.free.remove(&offset);
        if size > len {
            self.free.insert(offset + len, size - len);
        }
        offset
    }

    /// Frees an extent, joined with the free runs before and after it.
    fn put_back(&mut self, Extent { mut offset, mut len }: Extent) {
        if let Some((&before, &size)) = self.free.range(..offset).next_back()
            && before + size == offset
        {
            self.free.remove(&before);
            (offset, len) = (before, size + len);
        }
        if let Some(size) = self.free.remove(&(offset + len)) {
            len += size;
        }
        if offset + len == self.end {
            self.end = offset;
        } else if len > 0 {
            self.free.insert(offset, len);
        }
    }

    fn write_at(&mut self, folder: &Path, offset: u64, parts: &[&[u8]]) -> io::Result<()> {
        fault::point(Point::Write)?;
        let mut file = match self.file.take() {
            Some(file) => file,
            None => tempfile::tempfile_in(folder)?,
        };
        file.seek(SeekFrom::Start(offset))?;
        parts.iter().try_for_each(|part| file.write_all(part))?;
        self.file = Some(file);
        Ok(())
    }

    fn read_at(&mut self, offset: u64, parts: &mut [&mut [u8]]) -> io::Result<()> {
        fault::point(Point::Read)?;
        let file = self.file.as_mut().ok_or(io::ErrorKind::NotFound)?;
        file.seek(SeekFrom::Start(offset))?;
        parts.iter_mut().try_for_each(|part| file.read_exact(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extents_come_back_and_space_is_reused() {
        let folder = tempfile::tempdir().unwrap();
        let spill = Spill::new(folder.path());
        let extents: Vec<Extent> =
            (0..8u8).map(|i| spill.write(&[&[i; 100], &[i + 100; 50]]).unwrap()).collect();
        for (i, extent) in extents.into_iter().enumerate() {
            let (mut a, mut b) = ([0; 100], [0; 50]);
            spill.read(extent, &mut [&mut a, &mut b]).unwrap();
            assert_eq!((a, b), ([i as u8; 100], [i as u8 + 100; 50]));
        }
        let inner = lock(&spill.inner);
        assert_eq!((inner.end, inner.free.len()), (0, 0));
    }

    #[test]
    fn holes_are_split_and_joined() {
        let mut inner = Inner::default();
        let offsets: Vec<u64> = [10, 20, 30, 40].into_iter().map(|len| inner.take(len)).collect();
        assert_eq!(offsets, [0, 10, 30, 60]);
        inner.put_back(Extent { offset: 10, len: 20 });
        inner.put_back(Extent { offset: 30, len: 30 });
        assert_eq!(inner.free, BTreeMap::from([(10, 50)]));
        assert_eq!(inner.take(45), 10);
        assert_eq!(inner.free, BTreeMap::from([(55, 5)]));
        inner.put_back(Extent { offset: 60, len: 40 });
        assert_eq!((inner.end, inner.free.len()), (55, 0));
    }

    #[test]
    fn a_missing_folder_is_an_error_with_a_remedy() {
        let spill = Spill::new(Path::new("/nonexistent/terrane"));
        let error = spill.write(&[b"x"]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.to_string().contains("--temp-dir"));
    }
}
