//! Files written from front to end: bytes, and blocks whose sizes are remembered.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use terrane_base::error::{Error, Result};
use terrane_files::atomic::{self, AtomicFile};

const BUFFER: usize = 256 << 10;

/// The end of a file that grows.
pub(super) struct Stream {
    out: BufWriter<File>,
    /// What errors call the file.
    path: PathBuf,
}

impl Stream {
    /// Appends to `target` from `start` on.
    pub(super) fn of(target: &AtomicFile, start: u64) -> Result<Self> {
        let fail = |e| Error::write(target.path(), e);
        let mut file = target.file().try_clone().map_err(fail)?;
        file.seek(SeekFrom::Start(start)).map_err(fail)?;
        Ok(Self::new(file, target.path()))
    }

    fn new(file: File, path: &Path) -> Self {
        Self { out: BufWriter::with_capacity(BUFFER, file), path: path.to_path_buf() }
    }

    /// Appends `bytes`.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes).map_err(|e| Error::write(&self.path, e))
    }

    /// The file, with everything in it.
    pub(super) fn into_file(self) -> Result<File> {
        let path = self.path;
        self.out.into_inner().map_err(|e| Error::write(&path, e.into_error()))
    }
}

/// An unnamed file in `folder`, or else in that of `path`, which goes with the process.
pub(super) fn unnamed(path: &Path, folder: Option<&Path>) -> Result<File> {
    let target = atomic::resolve(path)?;
    let beside = target.parent().filter(|folder| !folder.as_os_str().is_empty());
    tempfile::tempfile_in(folder.or(beside).unwrap_or(Path::new(".")))
        .map_err(|e| Error::write(folder.unwrap_or(path), atomic::plain(e)))
}

/// Blocks one after the other.
pub(super) struct Packed {
    stream: Stream,
    /// Bytes of each block.
    sizes: Vec<u32>,
    /// Bytes of all.
    bytes: u64,
}

impl Packed {
    /// No block yet.
    pub(super) fn new(stream: Stream) -> Self {
        Self { stream, sizes: Vec::new(), bytes: 0 }
    }

    /// In an unnamed file in `folder`, or else beside `path`.
    pub(super) fn spool(path: &Path, folder: Option<&Path>) -> Result<Self> {
        Ok(Self::new(Stream::new(unnamed(path, folder)?, folder.unwrap_or(path))))
    }

    /// Appends a block (of less than 4 GiB, as `limits` has it).
    pub(super) fn append(&mut self, block: &[u8]) -> Result<()> {
        let size = u32::try_from(block.len()).map_err(|_| {
            Error::limit("bytes of one block", block.len(), u32::MAX).in_file(&self.stream.path)
        })?;
        self.sizes.push(size);
        self.bytes += u64::from(size);
        self.stream.write(block)
    }

    /// Bytes of all blocks so far.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Fails unless there are `blocks`; gives the file and the sizes.
    pub(super) fn finish(self, blocks: u64) -> Result<(File, Vec<u32>)> {
        let found = self.sizes.len() as u64;
        if found != blocks {
            let message = format!("{found} of {blocks} blocks were written");
            return Err(Error::usage(message).in_file(&self.stream.path));
        }
        Ok((self.stream.into_file()?, self.sizes))
    }
}

/// Copies all of `from` to the end of `to`.
pub(super) fn copy_all(from: &mut File, to: &mut impl Write) -> io::Result<()> {
    from.seek(SeekFrom::Start(0))?;
    io::copy(from, to).map(drop)
}

/// Locks, also after another thread has failed: its failure is reported by itself.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a mutex held, likewise.
pub(super) fn unlocked<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(PoisonError::into_inner)
}
