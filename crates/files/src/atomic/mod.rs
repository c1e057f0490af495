//! Atomic output files: a temporary file in the same folder, synced and renamed. On systems with unnamed
//! files (`O_TMPFILE`) the file has no name until then, so a killed run leaves nothing. Symbolic links are
//! followed: the target is replaced, the link stays.

mod folder;
mod sidecar;
mod temporary;

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::fault::{self, FaultPoint};
use terrane_base::error::{Error, ErrorKind, Result};

pub use folder::AtomicFolder;
pub use sidecar::Sidecar;
pub use temporary::is_temporary;
use temporary::{TemporaryFile, parent, remove_leftovers};

/// The name of stdout as an output. Files and folders of this name are rejected.
pub const STDOUT: &str = "-";

/// True if `path` is the name of stdout.
pub fn is_stdout(path: &Path) -> bool {
    path == Path::new(STDOUT)
}

/// An output file under construction. Dropping it removes the temporary file.
#[derive(Debug)]
pub struct AtomicFile {
    temp: TemporaryFile,
    path: PathBuf,
    /// `path` with symbolic links resolved.
    target: PathBuf,
    overwrite: bool,
}

impl AtomicFile {
    /// Starts a file that will appear at `path`. Fails at once if `path` exists and `overwrite` is false, or
    /// if its folder is missing or not writable.
    pub fn create(path: &Path, overwrite: bool) -> Result<Self> {
        refuse_existing(path, overwrite)?;
        refuse_special(path)?;
        let target = resolve(path)?;
        let folder = parent(&target);
        remove_leftovers(folder);
        let temp = fault::point(FaultPoint::Create).and_then(|()| TemporaryFile::new(folder));
        let temp = temp.map_err(|e| Error::write(path, plain(e)))?;
        Ok(Self { temp, path: path.to_path_buf(), target, overwrite })
    }

    /// The final path, as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The open temporary file.
    pub fn file(&self) -> &File {
        self.temp.file()
    }

    /// Syncs the file and renames it to its final name; returns its size in bytes.
    pub fn commit(self) -> Result<u64> {
        let Self { temp, path, target, overwrite } = self;
        let fail = |e: io::Error| Error::write(&path, e);
        // Data before the name: after a power cut a renamed file without its data would look whole.
        fault::point(FaultPoint::Sync).and_then(|()| temp.file().sync_all()).map_err(fail)?;
        let bytes = temp.file().metadata().map_err(fail)?.len();
        fault::point(FaultPoint::Rename).map_err(fail)?;
        temp.persist(&target, overwrite).map_err(fail)?;
        // The new name is an entry of the folder, which is a file of its own to be synced.
        sync_folder(parent(&target));
        Ok(bytes)
    }
}

// Straight to the file: the wrapper would add the temporary name to every error.
impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        fault::point(FaultPoint::Write)?;
        self.temp.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.temp.file().flush()
    }
}

impl Read for AtomicFile {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.temp.file().read(bytes)
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.temp.file().seek(to)
    }
}

/// Fails if `path` is stdout, or if something exists there and `overwrite` is false.
pub fn refuse_existing(path: &Path, overwrite: bool) -> Result<()> {
    refuse_stdout(path)?;
    // `exists` follows links and takes a link that leads nowhere for a free name.
    if !overwrite && path.symlink_metadata().is_ok() {
        return Err(Error::new(ErrorKind::Usage, "output already exists")
            .in_file(path)
            .remedy("choose another name or pass ‹overwrite›"));
    }
    Ok(())
}

/// Fails if `path` is the name of stdout.
pub fn refuse_stdout(path: &Path) -> Result<()> {
    if !is_stdout(path) {
        return Ok(());
    }
    Err(Error::usage("this output cannot be written to stdout")
        .in_file(path)
        .remedy("choose another name (./- for a file named -)"))
}

/// Creates the folder `path` and its missing parents.
pub fn create_folders(path: &Path) -> Result<()> {
    refuse_stdout(path)?;
    std::fs::create_dir_all(path).map_err(|e| Error::write(path, e))
}

/// Fails if `path` is a folder or a device: a rename would replace it, or fail only at the end.
fn refuse_special(path: &Path) -> Result<()> {
    match std::fs::metadata(path) {
        Ok(meta) if !meta.is_file() => {
            Err(Error::new(ErrorKind::Usage, "output is a folder or a device, not a file")
                .in_file(path)
                .remedy("choose another name"))
        }
        _ => Ok(()),
    }
}

/// Limit of symbolic links to follow, as on Linux.
const MAX_LINKS: usize = 40;

/// `path` with symbolic links resolved; the target need not exist.
pub fn resolve(path: &Path) -> Result<PathBuf> {
    let mut target = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        // `canonicalize` fails for a file that does not exist yet, which is the usual case here.
        match std::fs::read_link(&target) {
            Ok(next) => target = parent(&target).join(next),
            Err(_) => return Ok(target),
        }
    }
    Err(Error::new(ErrorKind::CannotWrite, "is a symbolic link in a loop")
        .in_file(path)
        .remedy("choose another name"))
}

/// The underlying error of the system, without the name of the temporary file that `tempfile` appends.
pub fn plain(error: io::Error) -> io::Error {
    match error.to_string().split_once(" at path ") {
        Some((own, _)) => io::Error::new(error.kind(), own),
        None => error,
    }
}

fn sync_folder(folder: &Path) {
    // Best effort: not every system opens folders, and the file is whole without it.
    if let Ok(handle) = File::open(folder) {
        let _ = handle.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::temporary::TEMP_PREFIX;
    use super::*;

    #[test]
    fn appears_only_on_commit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        let mut file = AtomicFile::create(&path, false).unwrap();
        file.write_all(b"abc").unwrap();
        assert!(!path.exists());
        assert_eq!(file.commit().unwrap(), 3);
        assert_eq!(std::fs::read(&path).unwrap(), b"abc");
        let refused = AtomicFile::create(&path, false).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::Usage);
        AtomicFile::create(&path, true).unwrap().commit().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"");
    }

    #[test]
    fn what_has_come_there_meanwhile_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        let file = AtomicFile::create(&path, false).unwrap();
        std::fs::write(&path, b"another's").unwrap();
        assert!(file.commit().is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"another's");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left over");
    }

    #[test]
    fn nothing_gets_the_name_of_stdout() {
        let path = Path::new(STDOUT);
        let refused = [
            AtomicFile::create(path, true).map(drop),
            AtomicFolder::create(path, true, |_| true).map(drop),
            create_folders(path),
        ];
        for refused in refused {
            assert_eq!(refused.unwrap_err().kind(), ErrorKind::Usage);
        }
        assert!(!path.exists());
    }

    #[test]
    fn folders_and_devices_are_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let error = AtomicFile::create(folder.path(), true).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
        #[cfg(unix)]
        assert!(AtomicFile::create(Path::new("/dev/null"), true).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_its_target_is_replaced() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("there")).unwrap();
        std::fs::write(at("there/old.bin"), b"old").unwrap();
        symlink("there/old.bin", at("to-file")).unwrap();
        symlink("to-file", at("to-link")).unwrap();
        symlink(at("there/new.bin"), at("dangling")).unwrap();
        for (link, target) in [("to-link", "there/old.bin"), ("dangling", "there/new.bin")] {
            let refused = AtomicFile::create(&at(link), false).unwrap_err();
            assert_eq!(refused.kind(), ErrorKind::Usage);
            let mut file = AtomicFile::create(&at(link), true).unwrap();
            file.write_all(link.as_bytes()).unwrap();
            assert_eq!(file.path(), at(link));
            file.commit().unwrap();
            assert!(at(link).symlink_metadata().unwrap().is_symlink());
            assert_eq!(std::fs::read(at(target)).unwrap(), link.as_bytes());
        }
        symlink("nowhere/lost.bin", at("lost")).unwrap();
        let lost = AtomicFile::create(&at("lost"), true).unwrap_err();
        assert_eq!((lost.kind(), lost.path()), (ErrorKind::CannotWrite, Some(&*at("lost"))));
        symlink("loop", at("loop")).unwrap();
        let looped = AtomicFile::create(&at("loop"), true).unwrap_err();
        assert_eq!(looped.kind(), ErrorKind::CannotWrite);
    }

    #[test]
    fn errors_never_name_the_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let lost = AtomicFile::create(&folder.path().join("no/such/out.bin"), true).unwrap_err();
        assert!(!lost.to_string().contains(TEMP_PREFIX), "{lost}");
    }

    #[test]
    fn dropped_or_orphaned_temporaries_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let orphan = folder.path().join(".terrane-4294967294-abc.tmp");
        std::fs::write(&orphan, b"left by a killed run").unwrap();
        let path = folder.path().join("out.bin");
        drop(AtomicFile::create(&path, false).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
