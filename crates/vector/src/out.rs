//! Writing to a file that appears when it is complete.

use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};

use terrane_base::error::Result;
use terrane_files::atomic::AtomicFile;

/// An output file.
pub(super) struct VectorOutputFile {
    target: AtomicFile,
    out: terrane_files::AppendWriter,
}

impl VectorOutputFile {
    pub(super) fn create(path: &Path, overwrite: bool) -> Result<Self> {
        let target = AtomicFile::create(path, overwrite)?;
        let out = terrane_files::AppendWriter::of(&target, 0)?;
        Ok(Self { target, out })
    }

    /// Gives the file its name; its path and size.
    pub(super) fn commit(mut self) -> Result<(PathBuf, u64)> {
        self.out.flush()?;
        let path = self.target.path().to_path_buf();
        Ok((path, self.target.commit()?))
    }
}

impl Deref for VectorOutputFile {
    type Target = terrane_files::AppendWriter;

    fn deref(&self) -> &Self::Target {
        &self.out
    }
}

impl DerefMut for VectorOutputFile {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.out
    }
}
