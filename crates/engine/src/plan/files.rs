//! The input files of a plan, and the check that they are unchanged.
//!
//! Of remote files, length and version are those that the server tells. Small files are hashed whole. Of large ones [`PIECES`] pieces are hashed, because reading a terabyte only to
//! identify it would cost as much as the work itself; their modification time must be unchanged as well.

use std::borrow::Cow;
use std::collections::HashSet;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::digest::Digest;
use terrane_base::error::{Error, Result};
use terrane_files::{self as files, RawFile, is_remote, name_of, path_of};

/// Number of hashed pieces of a large file, spread evenly from its first byte to its last.
const PIECES: u64 = 16;
/// Size of a hashed piece in bytes.
const PIECE: u64 = 16 << 10;
/// Files are hashed whole if their total size is at most this, or at most the size of all pieces.
const WHOLE: u64 = 1 << 30;

/// State of a file when the plan was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct InputFile {
    name: String,
    bytes: u64,
    /// Modification time, in nanoseconds since 1970.
    modified: u64,
    /// True if the digest covers all bytes.
    whole: bool,
    digest: Digest,
}

/// Reads the state of `paths`, in parallel.
pub(crate) fn stat(paths: &[PathBuf]) -> Result<Vec<InputFile>> {
    let sizes = paths.par_iter().map(|path| std::fs::metadata(path).map_or(0, |meta| meta.len()));
    let is_small = sizes.sum::<u64>() <= WHOLE;
    paths.par_iter().map(|path| InputFile::of(path, is_small)).collect()
}

/// Fails if one of `files` has changed; the error names the file and the difference. Compares digests if `by_content`
/// is set, else sizes and times only.
pub(super) fn check(files: &[InputFile], by_content: bool) -> Result<()> {
    files.par_iter().try_for_each(|file| file.check(by_content))
}

impl InputFile {
    pub(super) fn path(&self) -> Cow<'_, Path> {
        path_of(&self.name)
    }

    fn of(path: &Path, whole: bool) -> Result<Self> {
        if is_remote(path) {
            return Self::of_remote(path);
        }
        let fail = |e| Error::read(path, e);
        let mut file = File::open(path).map_err(fail)?;
        let (bytes, modified) = facts(&file).map_err(fail)?;
        let whole = whole || bytes <= PIECES * PIECE;
        let digest = digest(&mut file, bytes, whole).map_err(fail)?;
        Ok(Self { name: name_of(path.to_path_buf())?, bytes, modified, whole, digest })
    }

    /// The state that a server tells of.
    fn of_remote(path: &Path) -> Result<Self> {
        let file = RawFile::open(path)?;
        let version = file.version().ok_or_else(|| {
            Error::unsupported("the server sends no strong ETag or Last-Modified, which plans need")
                .in_file(path)
                .remedy("download the file (curl -LO URL) and pass the local copy")
        })?;
        let digest = Digest::of(version.as_bytes());
        let name = name_of(path.to_path_buf())?;
        Ok(Self { name, bytes: file.size(), modified: 0, whole: false, digest })
    }

    pub(crate) fn check(&self, by_content: bool) -> Result<()> {
        let path = self.path();
        if is_remote(&path) {
            return match Self::of_remote(&path)? == *self {
                true => Ok(()),
                false => Err(self.changed("on the server")),
            };
        }
        let fail = |e| Error::read(&path, e);
        let mut file = File::open(&path).map_err(fail)?;
        let (bytes, modified) = facts(&file).map_err(fail)?;
        if bytes != self.bytes {
            return Err(self.changed(&format!("size changed from {} to {bytes} bytes", self.bytes)));
        }
        let touched = modified != self.modified;
        if touched && !self.whole {
            return Err(self.changed("modified later"));
        }
        let is_read = touched || by_content;
        if is_read && digest(&mut file, bytes, self.whole).map_err(fail)? != self.digest {
            return Err(self.changed("content changed"));
        }
        Ok(())
    }

    /// Adopts the modification time of `other` if both are known to have the same bytes.
    pub(crate) fn forgive_time(&mut self, other: &Self) {
        if self.whole && self.digest == other.digest {
            self.modified = other.modified;
        }
    }

    fn changed(&self, how: &str) -> Error {
        Error::bad_input(format!("changed since the plan was made: {how}"))
            .in_file(&self.path())
            .remedy("restore it, or make a new plan in another folder")
    }
}

/// Size in bytes, and modification time in nanoseconds since 1970.
fn facts(file: &File) -> io::Result<(u64, u64)> {
    let meta = file.metadata()?;
    let since = meta.modified()?.duration_since(UNIX_EPOCH).unwrap_or_default();
    Ok((meta.len(), since.as_nanos() as u64))
}

fn digest(file: &mut File, bytes: u64, whole: bool) -> io::Result<Digest> {
    if whole || bytes <= PIECES * PIECE {
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(file)?;
        return Ok(Digest(*hasher.finalize().as_bytes()));
    }
    let mut pieces = vec![0; (PIECES * PIECE) as usize];
    for (i, piece) in (0..).zip(pieces.chunks_exact_mut(PIECE as usize)) {
        // The first piece begins with the file and the last one ends with it, where headers and tables are.
        file.seek(SeekFrom::Start((bytes - PIECE) * i / (PIECES - 1)))?;
        file.read_exact(piece)?;
    }
    Ok(Digest::of(&pieces))
}

/// The `paths` and their companion files, without duplicates. Excludes `.prj`: runs write one beside their meshes, and
/// its CRS is checked with the grid.
pub fn with_companions(mut paths: Vec<PathBuf>) -> Vec<PathBuf> {
    // Folders are listed: to ask for every name that might be there takes far longer.
    let folders: HashSet<&Path> = paths.iter().filter_map(|path| path.parent()).collect();
    let there: HashSet<PathBuf> = folders.into_iter().flat_map(listed).collect();
    let companions = paths.par_iter().flat_map_iter(|path| files::beside_grid(path));
    let companions = companions.filter(|path| there.contains(path) && path.is_file());
    let companions: Vec<PathBuf> = companions.collect();
    paths.extend(companions);
    paths.sort();
    paths.dedup_by(|a, b| a.as_os_str() == b.as_os_str());
    paths
}

fn listed(folder: &Path) -> Vec<PathBuf> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(here).into_iter().flatten().flatten();
    entries.map(|entry| folder.join(entry.file_name())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(files: &[InputFile], by_content: bool) -> String {
        check(files, by_content).map_or_else(|e| e.to_string(), |()| String::new())
    }

    #[test]
    fn every_kind_of_change_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let put = |bytes: &[u8], seconds: u64| {
            std::fs::write(&path, bytes).unwrap();
            let time = UNIX_EPOCH + std::time::Duration::from_secs(seconds);
            File::options().write(true).open(&path).unwrap().set_modified(time).unwrap();
        };
        put(b"one", 5);
        let files = stat(std::slice::from_ref(&path)).unwrap();
        assert_eq!(refusal(&files, true), "");
        put(b"one", 6);
        assert_eq!(refusal(&files, false), "", "written again, the same bytes");
        put(b"two", 6);
        assert!(refusal(&files, false).contains("content changed"));
        put(b"two", 5);
        assert_eq!(refusal(&files, false), "", "a quick look does not see it");
        assert!(refusal(&files, true).contains("content changed"));
        put(b"three", 5);
        assert!(refusal(&files, false).contains("size changed from 3 to 5 bytes"));
        std::fs::remove_file(&path).unwrap();
        assert!(refusal(&files, false).contains("a.tif: cannot read"));
    }

    #[test]
    fn pieces_reach_from_the_first_byte_to_the_last() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large.tif");
        let mut bytes = vec![7_u8; (PIECES * PIECE) as usize * 3 + 17];
        std::fs::write(&path, &bytes).unwrap();
        let file = InputFile::of(&path, false).unwrap();
        assert!(!file.whole && InputFile::of(&path, true).unwrap().digest != file.digest);
        let last = bytes.len() - 1;
        for at in [0, last] {
            bytes[at] ^= 1;
            std::fs::write(&path, &bytes).unwrap();
            assert_ne!(InputFile::of(&path, false).unwrap().digest, file.digest, "byte {at}");
            bytes[at] ^= 1;
        }
        std::fs::write(&path, &bytes).unwrap();
        assert!(refusal(&[InputFile { modified: 1, ..file }], false).contains("modified later"));
    }

    #[test]
    fn companions_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let there = [
            "a.HDR",
            "a.flt",
            "a.flt.aux.xml",
            "a.flt.hdr",
            "a.prj",
            "b.hdr",
            "c.asc.aux.xml",
            "c.asc.gz",
            "c.wld",
            "d.tif",
            "d.tif.MSK",
            "d.tiffw",
        ];
        for name in there {
            std::fs::write(folder.path().join(name), name).unwrap();
        }
        std::fs::create_dir(folder.path().join("d.hdr")).unwrap();
        let grids = ["d.tif", "a.flt", "c.asc.gz"].map(|name| folder.path().join(name));
        let found = with_companions(grids.to_vec());
        let names: Vec<_> =
            found.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
        let is_read = |name: &&str| !["a.prj", "b.hdr"].contains(name);
        assert_eq!(names, there.into_iter().filter(is_read).collect::<Vec<_>>());
    }
}
