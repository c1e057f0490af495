//! Temporary files, unnamed if the system supports it, and removal of leftovers of killed runs.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

/// Prefix of temporary names, by which leftovers of a killed run are recognised.
pub(super) const TEMP_PREFIX: &str = ".terrane-";
pub(super) const TEMP_SUFFIX: &str = ".tmp";

/// A file without its final name. Dropping it removes it.
#[derive(Debug)]
pub(super) enum TemporaryFile {
    /// Unnamed file: the kernel removes it when the process ends.
    Nameless(File),
    /// Named file, locked while open: an unlocked one is a leftover of a killed run.
    Named(NamedTempFile),
}

impl TemporaryFile {
    /// A file in `folder`, with the permissions of any new file.
    pub(super) fn new(folder: &Path) -> io::Result<Self> {
        match nameless(folder) {
            Some(file) => Ok(Self::Nameless(file)),
            None => named(folder).map(Self::Named),
        }
    }

    /// The open file.
    pub(super) fn file(&self) -> &File {
        match self {
            Self::Nameless(file) => file,
            Self::Named(temp) => temp.as_file(),
        }
    }

    /// Gives the file its name. An existing file is replaced or an error, depending on `overwrite`.
    pub(super) fn persist(self, target: &Path, overwrite: bool) -> io::Result<()> {
        match self {
            Self::Nameless(file) if !overwrite => link(&file, target),
            Self::Nameless(file) => {
                // A link does not replace an existing file, a rename does.
                let name = spare(parent(target))?;
                link(&file, &name)?;
                name.persist(target).map_err(|e| e.error)
            }
            Self::Named(temp) if overwrite => temp.persist(target).map(drop).map_err(|e| e.error),
            // Another process may have made the file since `create` looked.
            Self::Named(temp) => temp.persist_noclobber(target).map(drop).map_err(|e| e.error),
        }
    }
}

/// The folder that a path is in.
pub(super) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn builder<'a>() -> tempfile::Builder<'a, 'a> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMP_PREFIX).suffix(TEMP_SUFFIX);
    builder
}

/// An unused temporary name, removed on drop.
fn spare(folder: &Path) -> io::Result<TempPath> {
    let name = builder().make_in(folder, |path| match path.symlink_metadata() {
        Ok(_) => Err(io::ErrorKind::AlreadyExists.into()),
        Err(_) => Ok(()),
    })?;
    Ok(name.into_temp_path())
}

/// Folder in which the kernel lists open files as links.
#[cfg(target_os = "linux")]
const OPEN_FILES: &str = "/proc/self/fd";

/// An unnamed file; `None` if the file system supports none, or none that can be linked later.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    // A sandbox without /proc could open the file and never name it.
    if !Path::new(OPEN_FILES).exists() {
        return None;
    }
    // 0666 less the umask, as any new file. The 0600 of temporary files would stay on the output.
    openat(CWD, folder, flags, Mode::from_raw_mode(0o666)).ok().map(File::from)
}

/// Links an open file to an unused name.
#[cfg(target_os = "linux")]
fn link(file: &File, name: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    use std::os::fd::AsRawFd;
    // AT_EMPTY_PATH would name the descriptor itself, but asks for CAP_DAC_READ_SEARCH (linkat(2)).
    // The entry in /proc is a link, hence SYMLINK_FOLLOW.
    let open = PathBuf::from(OPEN_FILES).join(file.as_raw_fd().to_string());
    Ok(linkat(CWD, &open, CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

#[cfg(not(target_os = "linux"))]
fn nameless(_folder: &Path) -> Option<File> {
    None
}

#[cfg(not(target_os = "linux"))]
fn link(_file: &File, _name: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// A file under a temporary name.
fn named(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = builder();
    #[cfg(unix)]
    let anyone = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(anyone);
    loop {
        let temp = builder.tempfile_in(folder)?;
        // On a file system without locks, leftovers are not removed either.
        let is_taken = matches!(temp.as_file().try_lock(), Err(TryLockError::WouldBlock));
        // Another run may have removed the file as a leftover before it was locked.
        if !is_taken && temp.path().exists() {
            return Ok(temp);
        }
    }
}

/// Removes unlocked temporary files and folders: their run was killed. Best effort: failures are ignored. A
/// folder under construction is not searched: it has no leftovers, and scanning its many files for each new
/// one would take quadratic time.
pub(super) fn remove_leftovers(folder: &Path) {
    if folder.file_name().and_then(|name| name.to_str()).is_some_and(is_temporary) {
        return;
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        if !name.to_str().is_some_and(is_temporary) {
            continue;
        }
        // Locked until removed: its creator may be about to lock it.
        let Ok(file) = File::open(entry.path()) else { continue };
        if file.try_lock().is_ok() {
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            let remove = if is_folder { std::fs::remove_dir_all } else { std::fs::remove_file };
            let _ = remove(&entry.path());
        }
    }
}

/// True for names of temporary files and folders of this program.
pub fn is_temporary(name: &str) -> bool {
    name.starts_with(TEMP_PREFIX) && name.ends_with(TEMP_SUFFIX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn count(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    /// Both kinds, where there are both.
    fn kinds(folder: &Path) -> Vec<TemporaryFile> {
        let nameless = nameless(folder).map(TemporaryFile::Nameless);
        nameless.into_iter().chain([TemporaryFile::Named(named(folder).unwrap())]).collect()
    }

    #[test]
    fn both_kinds_are_named_alike() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.bin");
        for (number, temp) in kinds(folder.path()).into_iter().enumerate() {
            write!(temp.file(), "{number}").unwrap();
            temp.persist(&target, number > 0).unwrap();
            assert_eq!(std::fs::read_to_string(&target).unwrap(), number.to_string());
        }
        let mut refused = kinds(folder.path()).into_iter().map(|temp| temp.persist(&target, false));
        assert!(refused.all(|done| done.is_err()));
        for temp in kinds(folder.path()) {
            write!(temp.file(), "new").unwrap();
            temp.persist(&target, true).unwrap();
            assert_eq!(std::fs::read_to_string(&target).unwrap(), "new");
            std::fs::write(&target, "old").unwrap();
        }
        assert_eq!(count(folder.path()), 1, "nothing is left over");
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode =
            |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        std::fs::write(folder.path().join("usual"), "").unwrap();
        for temp in kinds(folder.path()) {
            temp.persist(&folder.path().join("ours"), true).unwrap();
            assert_eq!(mode("ours"), mode("usual"));
        }
    }

    #[test]
    fn a_file_in_the_making_is_no_leftover() {
        let folder = tempfile::tempdir().unwrap();
        let temp = TemporaryFile::Named(named(folder.path()).unwrap());
        remove_leftovers(folder.path());
        assert_eq!(count(folder.path()), 1);
        drop(temp);
        if let Some(_file) = nameless(folder.path()) {
            assert_eq!(count(folder.path()), 0, "a killed run leaves nothing");
        }
    }
}
