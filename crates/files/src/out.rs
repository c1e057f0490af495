//! Sequential buffered output: to a permanent file, or to an unnamed one that holds part of an output until
//! the parts before it are complete.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::atomic::AtomicFile;
use crate::fault::{self, FaultPoint};
use crate::{RawFile, nameless, spool, write_all_at};
use terrane_base::error::{Error, Result};

/// Buffer size in bytes, large enough that the cost of a system call is negligible.
const BUFFER_BYTES: usize = 256 << 10;

/// Appends to a growing file.
#[derive(Debug)]
pub struct AppendWriter {
    file: File,
    /// Path named in errors.
    path: PathBuf,
    fail: fn(&Path, io::Error) -> Error,
    /// Pending bytes. Call [`settle`](Self::settle) after appending.
    pub buffer: Vec<u8>,
    /// Bytes flushed from the buffer.
    written: u64,
}

impl AppendWriter {
    /// Writes to `file` from its cursor on; errors name `path`.
    pub fn new(file: File, path: &Path) -> Self {
        let path = path.to_path_buf();
        Self { file, path, fail: Error::write, buffer: Vec::new(), written: 0 }
    }

    /// Writes to `target` from `start` on. The file is complete after a [`flush`](Self::flush).
    pub fn of(target: &AtomicFile, start: u64) -> Result<Self> {
        let fail = |e| Error::write(target.path(), e);
        let mut file = target.file().try_clone().map_err(fail)?;
        file.seek(SeekFrom::Start(start)).map_err(fail)?;
        Ok(Self::new(file, target.path()))
    }

    /// Writes to an unnamed file in `folder`, which errors name.
    pub fn spool(folder: &Path) -> Result<Self> {
        Ok(Self {
            fail: |folder, e| spool::failure(folder, "write to", e),
            ..Self::new(nameless(folder)?, folder)
        })
    }

    /// Path named in errors.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes written so far, including the buffer.
    pub fn bytes(&self) -> u64 {
        self.written + self.buffer.len() as u64
    }

    /// Appends bytes.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        if bytes.len() >= BUFFER_BYTES {
            self.flush()?;
            return self.pass_on(bytes);
        }
        self.buffer.extend_from_slice(bytes);
        self.settle()
    }

    /// Appends one record of `N` bytes per item.
    pub fn records<T, const N: usize>(
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
            self.settle()?;
        }
        Ok(())
    }

    /// Appends what `write` adds to the buffer for each item.
    pub fn lines<T>(&mut self, items: &[T], mut write: impl FnMut(&T, &mut Vec<u8>)) -> Result<()> {
        for item in items {
            write(item, &mut self.buffer);
            self.settle()?;
        }
        Ok(())
    }

    /// Appends the content of `spool`, within the kernel if possible.
    pub fn append(&mut self, spool: AppendWriter) -> Result<()> {
        self.flush()?;
        let mut source = spool.into_file()?;
        let copied = io::copy(&mut source, &mut self.file);
        self.written += copied.map_err(|e| (self.fail)(&self.path, e))?;
        Ok(())
    }

    /// Overwrites the bytes at `offset`.
    pub fn replace(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.flush()?;
        let replaced = write_all_at(&self.file, bytes, offset);
        // Without positioned writes the cursor has moved.
        let back = replaced.and_then(|()| self.file.seek(SeekFrom::End(0)));
        back.map(drop).map_err(|e| (self.fail)(&self.path, e))
    }

    /// Flushes the buffer if it has grown large.
    pub fn settle(&mut self) -> Result<()> {
        if self.buffer.len() < BUFFER_BYTES { Ok(()) } else { self.flush() }
    }

    /// Flushes the buffer.
    pub fn flush(&mut self) -> Result<()> {
        let mut gathered = std::mem::take(&mut self.buffer);
        let written = self.pass_on(&gathered);
        gathered.clear();
        self.buffer = gathered;
        written
    }

    fn pass_on(&mut self, bytes: &[u8]) -> Result<()> {
        let written = fault::point(FaultPoint::Write).and_then(|()| self.file.write_all(bytes));
        written.map_err(|e| (self.fail)(&self.path, e))?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    /// The complete file, positioned at its start.
    pub fn into_file(mut self) -> Result<File> {
        self.flush()?;
        self.file.seek(SeekFrom::Start(0)).map_err(|e| (self.fail)(&self.path, e))?;
        Ok(self.file)
    }

    /// The complete, non-empty file, for reading by position.
    pub fn into_raw(mut self) -> Result<RawFile> {
        self.flush()?;
        RawFile::of(self.file, &self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Read;

    fn read(out: AppendWriter) -> Vec<u8> {
        let mut bytes = Vec::new();
        out.into_file().unwrap().read_to_end(&mut bytes).unwrap();
        bytes
    }

    proptest! {
        /// Beside a vector.
        #[test]
        fn like_a_vector(steps in prop::collection::vec((0_u8..5, 0_usize..400_000), 1..12)) {
            let folder = tempfile::tempdir().unwrap();
            let mut out = AppendWriter::spool(folder.path()).unwrap();
            let mut twin: Vec<u8> = Vec::new();
            for (what, count) in steps {
                let bytes: Vec<u8> = (0..count).map(|i| (i * 7 + twin.len()) as u8).collect();
                match what {
                    0 => out.write(&bytes).unwrap(),
                    1 => out.records(&bytes, |b| [*b]).unwrap(),
                    2 => out.lines(&bytes, |b, buffer| buffer.push(*b)).unwrap(),
                    3 => {
                        let mut tail = AppendWriter::spool(folder.path()).unwrap();
                        tail.write(&bytes).unwrap();
                        out.append(tail).unwrap();
                    }
                    _ => {
                        let at = count.min(twin.len());
                        let bytes = &bytes[..bytes.len().min(twin.len() - at)];
                        out.replace(at as u64, bytes).unwrap();
                        twin[at..at + bytes.len()].copy_from_slice(bytes);
                        continue;
                    }
                }
                twin.extend_from_slice(&bytes);
                prop_assert_eq!(out.bytes(), twin.len() as u64);
            }
            prop_assert!(read(out) == twin);
        }
    }

    #[test]
    fn a_file_to_come_is_written_behind_its_start() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let target = AtomicFile::create(&path, false).unwrap();
        let mut out = AppendWriter::of(&target, 3).unwrap();
        out.write(b"body").unwrap();
        out.replace(0, b"the").unwrap();
        out.write(b"!").unwrap();
        out.flush().unwrap();
        target.commit().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"thebody!");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_an_error_with_the_name_and_a_remedy() {
        use terrane_base::error::ErrorKind;
        let full = || File::options().write(true).open("/dev/full").unwrap();
        let mesh = Path::new("mesh.ply");
        let spool = AppendWriter::spool(&std::env::temp_dir()).unwrap();
        let spool = AppendWriter { file: full(), ..spool };
        for (mut out, remedy) in
            [(AppendWriter::new(full(), mesh), "another folder"), (spool, "‹temp_dir›")]
        {
            let path = out.path().to_path_buf();
            let error = out.write(&vec![0; BUFFER_BYTES]).unwrap_err();
            assert_eq!((error.kind(), error.path()), (ErrorKind::Io, Some(&*path)));
            assert!(error.to_string().ends_with(remedy), "{error}");
        }
    }
}
