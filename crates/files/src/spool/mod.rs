//! Temporary storage outside memory: extents of one unnamed file in the temporary folder. The file is created
//! with the first extent and removed by the system when the process ends. [`Buckets`] keeps records in memory
//! up to a budget and then in extents; [`AggregatedRecords`] sorts them by key and merges those of equal keys. For
//! data written sequentially and read once see [`AppendWriter`](crate::AppendWriter).
//!
//! What is written from front to back and then read once, without a share of memory, is no spool: see
//! [`AppendWriter`](crate::AppendWriter).

mod aggregated;
mod buckets;

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

use crate::atomic::plain;
use crate::fault::{self, FaultPoint};
use crate::{lock, read_exact_at, write_all_at};
use terrane_base::error::{Error, ErrorKind, Result};

pub use aggregated::{AggregatedRecords, KeyedRecord};
pub use buckets::{BucketWriter, Buckets};

/// Folder for temporary files of the output at `path`: `asked` if given, else the folder of the output.
pub fn folder_for<'a>(path: &'a Path, asked: Option<&'a Path>) -> &'a Path {
    let beside = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    asked.or(beside).unwrap_or(Path::new("."))
}

/// An unnamed file in `folder`, removed with its last handle.
pub fn nameless(folder: &Path) -> Result<File> {
    tempfile::tempfile_in(folder).map_err(|e| failure(folder, "write to", e))
}

/// Error of an unnamed file in `folder`.
pub(crate) fn failure(folder: &Path, action: &str, source: io::Error) -> Error {
    use io::ErrorKind::{NotADirectory, NotFound, PermissionDenied, ReadOnlyFilesystem};
    let kind = match source.kind() {
        NotADirectory | NotFound | PermissionDenied | ReadOnlyFilesystem => ErrorKind::CannotWrite,
        _ => ErrorKind::Io,
    };
    Error::io(kind, &format!("{action} the temporary folder"), plain(source))
        .in_file(folder)
        .remedy("pass a folder with enough free space as ‹temp_dir›")
}

/// Size in bytes up to which a file is closed quickly.
const LARGE: u64 = 64 << 20;

/// Location of bytes in a [`SpoolFile`].
#[derive(Debug)]
pub struct SpoolExtent {
    offset: u64,
    len: u64,
}

/// Extents in one unnamed file, written and read by any thread. Freed space is reused.
#[derive(Debug)]
pub struct SpoolFile {
    folder: PathBuf,
    file: OnceLock<File>,
    space: Mutex<SpoolFreeSpace>,
}

impl SpoolFile {
    /// A spool whose file will be in `folder`.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_path_buf(), file: OnceLock::new(), space: Mutex::default() }
    }

    /// Stores `parts` one after the other.
    pub fn put(&self, parts: &[&[u8]]) -> Result<SpoolExtent> {
        let len = parts.iter().map(|part| part.len() as u64).sum();
        let (file, offset) = self.reserve(len)?;
        let mut at = offset;
        let written = parts.iter().try_for_each(|part| {
            fault::point(FaultPoint::Write)?;
            write_all_at(file, part, at)?;
            at += part.len() as u64;
            Ok(())
        });
        let extent = SpoolExtent { offset, len };
        match written {
            Ok(()) => Ok(extent),
            Err(e) => {
                self.free(extent);
                Err(self.failure("write to", e))
            }
        }
    }

    /// The file and the offset of `len` free bytes in it.
    fn reserve(&self, len: u64) -> Result<(&File, u64)> {
        let mut space = lock(&self.space);
        // `get_or_init` takes no function that fails. The lock on the space keeps a second thread from
        // making a second file.
        let file = match self.file.get() {
            Some(file) => file,
            None => {
                let made = nameless(&self.folder).map_err(allow_memory)?;
                self.file.get_or_init(|| made)
            }
        };
        space.written += len;
        Ok((file, space.take(len)))
    }

    /// Fills `parts` one after the other with the bytes of `extent` from offset `from` on.
    pub fn get(&self, extent: &SpoolExtent, from: u64, parts: &mut [&mut [u8]]) -> Result<()> {
        let mut at = extent.offset + from;
        let read = parts.iter_mut().try_for_each(|part| {
            fault::point(FaultPoint::Read)?;
            let file = self.file.get().ok_or(io::ErrorKind::UnexpectedEof)?;
            read_exact_at(file, part, at)?;
            at += part.len() as u64;
            Ok(())
        });
        read.map_err(|e| self.failure("read back from", e))
    }

    /// Fills `parts`, of the same total length, with the bytes of `extent`, and frees it.
    pub fn take(&self, extent: SpoolExtent, parts: &mut [&mut [u8]]) -> Result<()> {
        let got = self.get(&extent, 0, parts);
        self.free(extent);
        got
    }

    /// Frees the space of `extent`.
    pub fn free(&self, extent: SpoolExtent) {
        lock(&self.space).put_back(extent);
    }

    /// Bytes written so far.
    pub fn written(&self) -> u64 {
        lock(&self.space).written
    }

    fn failure(&self, action: &str, source: io::Error) -> Error {
        allow_memory(failure(&self.folder, action, source))
    }
}

impl Drop for SpoolFile {
    /// Closing a large file takes a while (0.1 s for 2 GB), so it happens in the background.
    fn drop(&mut self) {
        let written = lock(&self.space).written;
        if let Some(file) = self.file.take().filter(|_| written > LARGE) {
            // If no thread can be started, the file is closed here.
            let _ = std::thread::Builder::new().spawn(|| drop(file));
        }
    }
}

/// Adds the remedy for spools, which store data that exceeds the memory budget.
fn allow_memory(error: Error) -> Error {
    error.remedy("pass a folder with enough free space as ‹temp_dir›, or raise ‹memory›")
}

/// Free space in the file.
#[derive(Debug, Default)]
struct SpoolFreeSpace {
    end: u64,
    /// Free runs before the end: length by offset, never touching each other.
    free: BTreeMap<u64, u64>,
    written: u64,
}

impl SpoolFreeSpace {
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
    fn put_back(&mut self, SpoolExtent { mut offset, mut len }: SpoolExtent) {
        if let Some((&before, &size)) = self.free.range(..offset).next_back()
            && before + size == offset
        {
            self.free.remove(&before);
            (offset, len) = (before, size + len);
        }
        if let Some(size) = self.free.remove(&(offset + len)) {
            len += size;
        }
        // A free run at the end is no hole: the end moves back, which also keeps runs from touching it.
        if offset + len == self.end {
            self.end = offset;
        } else if len > 0 {
            self.free.insert(offset, len);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Beside a list of byte strings.
        #[test]
        fn every_extent_comes_back_whatever_is_put_and_freed_meanwhile(
            steps in prop::collection::vec((any::<bool>(), any::<prop::sample::Index>(), 0_usize..300), 1..80),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let spool = SpoolFile::new(folder.path());
            let mut all: Vec<(SpoolExtent, Vec<u8>)> = Vec::new();
            let (mut written, mut most) = (0, 0);
            for (number, (is_put, which, len)) in steps.into_iter().enumerate() {
                if is_put || all.is_empty() {
                    let bytes: Vec<u8> = (0..len).map(|i| (number * 31 + i) as u8).collect();
                    let parts: Vec<&[u8]> = bytes.chunks(100).collect();
                    all.push((spool.put(&parts).unwrap(), bytes));
                    written += len as u64;
                } else {
                    let (extent, bytes) = all.swap_remove(which.index(all.len()));
                    let from = len.min(bytes.len());
                    let mut tail = vec![0; bytes.len() - from];
                    spool.get(&extent, from as u64, &mut [&mut tail]).unwrap();
                    prop_assert_eq!(&tail, &bytes[from..]);
                    let (mut first, mut second) = (vec![0; from], vec![0; bytes.len() - from]);
                    spool.take(extent, &mut [&mut first, &mut second]).unwrap();
                    prop_assert_eq!([first, second].concat(), bytes);
                }
                most = most.max(all.iter().map(|(_, bytes)| bytes.len() as u64).sum());
                prop_assert_eq!(spool.written(), written);
            }
            for (extent, bytes) in all {
                let mut found = vec![0; bytes.len()];
                spool.take(extent, &mut [&mut found]).unwrap();
                prop_assert_eq!(found, bytes);
            }
            let space = lock(&spool.space);
            prop_assert_eq!((space.end, space.free.len()), (0, 0));
            prop_assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "no name");
        }
    }

    #[test]
    fn holes_are_split_and_joined() {
        let mut space = SpoolFreeSpace::default();
        let offsets: Vec<u64> = [10, 20, 30, 40].into_iter().map(|len| space.take(len)).collect();
        assert_eq!(offsets, [0, 10, 30, 60]);
        space.put_back(SpoolExtent { offset: 10, len: 20 });
        space.put_back(SpoolExtent { offset: 30, len: 30 });
        assert_eq!(space.free, BTreeMap::from([(10, 50)]));
        assert_eq!(space.take(45), 10);
        assert_eq!(space.free, BTreeMap::from([(55, 5)]));
        space.put_back(SpoolExtent { offset: 60, len: 40 });
        assert_eq!((space.end, space.free.len()), (55, 0));
    }

    #[test]
    fn a_missing_folder_is_named_with_a_remedy() {
        let missing = Path::new("/nonexistent/terrane");
        let spool = SpoolFile::new(missing);
        for error in [spool.put(&[b"x"]).unwrap_err(), nameless(missing).unwrap_err()] {
            assert_eq!((error.kind(), error.path()), (ErrorKind::CannotWrite, Some(missing)));
            let told = error.to_string();
            assert!(told.contains("‹temp_dir›") && !told.contains("at path"), "{told}");
        }
        assert_eq!(spool.written(), 0);
    }

    /// Faults are ordered for a whole process, so this test runs itself again with each.
    #[cfg(debug_assertions)]
    #[test]
    fn a_call_that_fails_is_told_and_nothing_else_is_lost() {
        const FAULT: &str = "TERRANE_FAULT";
        if std::env::var_os(FAULT).is_none() {
            let name = "spool::tests::a_call_that_fails_is_told_and_nothing_else_is_lost";
            for fault in ["write:1", "write:4", "read:1", "read:5"] {
                let mut again = std::process::Command::new(std::env::current_exe().unwrap());
                let ran = again.args(["--exact", name]).env(FAULT, fault).output().unwrap();
                let told = String::from_utf8_lossy(&ran.stdout).into_owned();
                assert!(ran.status.success() && told.contains("1 passed"), "{fault}: {told}");
            }
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let spool = SpoolFile::new(folder.path());
        let mut failures = Vec::new();
        let mut all = Vec::new();
        for number in 0..8_u8 {
            let put = spool.put(&[&[number; 100], &[number; 50]]);
            all.extend(put.map(|extent| (extent, number)).map_err(|e| failures.push(e)));
        }
        for (extent, number) in &all {
            let mut found = [0; 150];
            let mut get = || spool.get(extent, 0, &mut [&mut found]);
            get()
                .or_else(|e| {
                    failures.push(e);
                    get()
                })
                .unwrap();
            assert_eq!(found, [*number; 150]);
        }
        let [error] = &failures[..] else { panic!("{} failures", failures.len()) };
        assert_eq!((error.kind(), error.path()), (ErrorKind::Io, Some(folder.path())));
        assert!(error.to_string().contains("‹memory›"), "{error}");
        let room = lock(&spool.space).end;
        assert_eq!(room, 150 * all.len() as u64, "the room of what failed is used again");
    }
}
