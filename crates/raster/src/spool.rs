//! Decoded samples kept in an unnamed temporary file, for formats that cannot be read by window.

use std::io;
use std::path::{Path, PathBuf};

use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::limits;
use terrane_files::RawFile;
use terrane_files::{AppendWriter, atomic};

/// Bytes written at a time when filling.
const FILL_BYTES: usize = 64 << 10;

/// Samples of an input file, up to a size limit.
pub(super) struct SampleSpool {
    out: AppendWriter,
    /// Path of the input.
    path: PathBuf,
}

impl SampleSpool {
    /// An empty spool in `folder`, or else in the system's temporary folder; `path` is the input.
    pub(super) fn new(path: &Path, folder: Option<&Path>) -> Result<Self> {
        let folder = folder.map_or_else(std::env::temp_dir, Path::to_path_buf);
        Ok(Self { out: AppendWriter::spool(&folder).map_err(or_tmpdir)?, path: path.to_path_buf() })
    }

    /// Appends `bytes`.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let all = self.out.bytes() + bytes.len() as u64;
        limits::check("unpacked size in bytes", all, limits::MAX_UNPACKED_BYTES)?;
        self.out.write(bytes).map_err(or_tmpdir)
    }

    /// Appends `count` copies of `sample`.
    pub(super) fn fill(&mut self, sample: &[u8], count: u64) -> Result<()> {
        let at_once = (FILL_BYTES / sample.len()) as u64;
        let bytes = sample.repeat(at_once.min(count) as usize);
        let mut left = count;
        while left > 0 {
            let now = left.min(at_once);
            self.write(&bytes[..now as usize * sample.len()])?;
            left -= now;
        }
        Ok(())
    }

    /// Overwrites the bytes at `offset`.
    pub(super) fn replace(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        self.out.replace(offset, bytes).map_err(or_tmpdir)
    }

    /// The complete file for reading.
    pub(super) fn finish(self) -> Result<RawFile> {
        RawFile::of(self.out.into_file().map_err(or_tmpdir)?, &self.path)
    }
}

/// Adds a remedy that names TMPDIR, because not all readers of grids have an option for the folder.
fn or_tmpdir(error: Error) -> Error {
    error.remedy("pass a folder with enough free space as ‹temp_dir›, or set TMPDIR")
}

/// Error of writing decompressed files.
pub(super) fn cannot_unpack(source: io::Error) -> Error {
    let action = "unpack into the temporary folder";
    or_tmpdir(Error::io(ErrorKind::Io, action, atomic::plain(source)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filled_and_replaced() {
        let mut spool = SampleSpool::new(Path::new("t"), None).unwrap();
        spool.fill(&[7, 8, 9], 30_000).unwrap();
        spool.replace(3, &[1, 2, 3]).unwrap();
        spool.write(&[4]).unwrap();
        let file = spool.finish().unwrap();
        assert_eq!(file.size(), 90_001);
        assert_eq!(file.head(9).unwrap(), [7, 8, 9, 1, 2, 3, 7, 8, 9]);
        assert_eq!(file.read_vec(89_997, 4).unwrap(), [7, 8, 9, 4]);
    }
}
