//! Variable-size blocks written sequentially, with their sizes.

use std::path::{Path, PathBuf};

use terrane_base::error::{Error, Result};
use terrane_files::{AppendWriter, atomic, folder_for};

/// Folder for temporary files of the output at `path`, with symbolic links resolved.
pub(super) fn temporary_path(path: &Path, folder: Option<&Path>) -> Result<PathBuf> {
    Ok(folder_for(&atomic::resolve(path)?, folder).to_path_buf())
}

/// Sequentially written blocks.
pub(super) struct PackedBlocks {
    out: AppendWriter,
    /// Size of each block in bytes.
    sizes: Vec<u32>,
    /// Total size in bytes.
    bytes: u64,
}

impl PackedBlocks {
    /// No blocks yet.
    pub(super) fn new(out: AppendWriter) -> Self {
        Self { out, sizes: Vec::new(), bytes: 0 }
    }

    /// Appends a block of less than 4 GiB.
    pub(super) fn append(&mut self, block: &[u8]) -> Result<()> {
        let size = u32::try_from(block.len()).map_err(|_| {
            Error::limit("block size in bytes", block.len(), u32::MAX).in_file(self.out.path())
        })?;
        self.sizes.push(size);
        self.bytes += u64::from(size);
        self.out.write(block)
    }

    /// Total size of the blocks so far in bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Fails unless there are `blocks` blocks; returns the writer and the block sizes.
    pub(super) fn finish(mut self, blocks: u64) -> Result<(AppendWriter, Vec<u32>)> {
        let found = self.sizes.len() as u64;
        if found != blocks {
            let message = format!("{found} of {blocks} blocks were written");
            return Err(Error::usage(message).in_file(self.out.path()));
        }
        self.out.flush()?;
        Ok((self.out, self.sizes))
    }
}
