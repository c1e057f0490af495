//! Writing to a file that appears when it is complete.

use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};

use terrane_base::error::Result;
use terrane_files::atomic::AtomicFile;

/// An output file.
pub(super) struct Out {
    target: AtomicFile,
    out: terrane_files::Out,
}

impl Out {
    pub(super) fn create(path: &Path, overwrite: bool) -> Result<Self> {
        let target = AtomicFile::create(path, overwrite)?;
        let out = terrane_files::Out::of(&target, 0)?;
        Ok(Self { target, out })
    }

    /// Gives the file its name; its path and size.
    pub(super) fn commit(mut self) -> Result<(PathBuf, u64)> {
        self.out.flush()?;
        let path = self.target.path().to_path_buf();
        Ok((path, self.target.commit()?))
    }
}

impl Deref for Out {
    type Target = terrane_files::Out;

    fn deref(&self) -> &Self::Target {
        &self.out
    }
}

impl DerefMut for Out {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.out
    }
}
