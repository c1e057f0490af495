//! Decoded samples kept in an unnamed temporary file, for formats that cannot be read by window.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::file::RawFile;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::limits;

/// Bytes written at a time when filling.
const FILL_BYTES: usize = 64 << 10;

/// A temporary file being written. It has no name, so it goes with the process.
pub(super) struct Spool {
    out: BufWriter<File>,
    path: PathBuf,
    written: u64,
}

impl Spool {
    /// An empty one in `folder`, or else in the system's; `path` is the input it is made from.
    pub(super) fn new(path: &Path, folder: Option<&Path>) -> Result<Self> {
        let file = tempfile::tempfile_in(folder.map_or_else(std::env::temp_dir, Path::to_path_buf));
        let file = file.map_err(cannot_unpack)?;
        Ok(Self { out: BufWriter::new(file), path: path.to_path_buf(), written: 0 })
    }

    /// Appends `bytes`.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.written += bytes.len() as u64;
        limits::check("bytes unpacked", self.written, limits::MAX_UNPACKED_BYTES)?;
        self.out.write_all(bytes).map_err(cannot_unpack)
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

    /// Replaces what was written at `offset`.
    pub(super) fn replace(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        let replaced =
            self.out.seek(SeekFrom::Start(offset)).and_then(|_| self.out.write_all(bytes));
        replaced.and_then(|()| self.out.seek(SeekFrom::End(0))).map(|_| ()).map_err(cannot_unpack)
    }

    /// Everything written, to be read.
    pub(super) fn finish(self) -> Result<RawFile> {
        let file = self.out.into_inner().map_err(|e| cannot_unpack(e.into_error()))?;
        RawFile::of(file, &self.path)
    }
}

/// Failure to keep unpacked samples.
pub(super) fn cannot_unpack(source: io::Error) -> Error {
    Error::io(
        ErrorKind::Io,
        "unpack into the temporary folder",
        terrane_files::atomic::plain(source),
    )
    .remedy("choose a folder with room with --temp-dir, or set TMPDIR")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filled_and_replaced() {
        let mut spool = Spool::new(Path::new("t"), None).unwrap();
        spool.fill(&[7, 8, 9], 30_000).unwrap();
        spool.replace(3, &[1, 2, 3]).unwrap();
        spool.write(&[4]).unwrap();
        let file = spool.finish().unwrap();
        assert_eq!(file.size(), 90_001);
        assert_eq!(file.head(9).unwrap(), [7, 8, 9, 1, 2, 3, 7, 8, 9]);
        assert_eq!(file.read_vec(89_997, 4).unwrap(), [7, 8, 9, 4]);
    }
}
