//! A file in the making, without a name where the system can, else under a temporary one; and those that killed
//! runs left.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

/// Prefix of temporary names, so that leftovers of a killed run can be told and removed.
pub(super) const TEMP_PREFIX: &str = ".terrane-";
pub(super) const TEMP_SUFFIX: &str = ".tmp";

/// A file that has not got its name yet. Dropping it removes it.
#[derive(Debug)]
pub(super) enum TemporaryFile {
    /// The kernel removes it with the process, however that ends.
    Nameless(File),
    /// Locked as long as it is open, so that what nobody has locked is left by a killed run.
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

    /// Gives it its name; what has it already is replaced, or an error.
    pub(super) fn persist(self, target: &Path, overwrite: bool) -> io::Result<()> {
        match self {
            Self::Nameless(file) if !overwrite => link(&file, target),
            Self::Nameless(file) => {
                // A link replaces nothing, a rename does.
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

/// A temporary name that nothing has, removed when it is dropped.
fn spare(folder: &Path) -> io::Result<TempPath> {
    let name = builder().make_in(folder, |path| match path.symlink_metadata() {
        Ok(_) => Err(io::ErrorKind::AlreadyExists.into()),
        Err(_) => Ok(()),
    })?;
    Ok(name.into_temp_path())
}

/// Where the kernel has links to open files.
#[cfg(target_os = "linux")]
const OPEN_FILES: &str = "/proc/self/fd";

/// A file without a name; `None` where the file system has none, or where it could not get one later.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    // A sandbox without /proc could open the file and never name it.
    let can_be_named = Path::new(OPEN_FILES).exists();
    // 0666 less the umask, as any new file. The 0600 of temporary files would stay on the output.
    let open = || openat(CWD, folder, flags, Mode::from_raw_mode(0o666)).ok().map(File::from);
    can_be_named.then(open).flatten()
}

/// Gives an open file a name that nothing has.
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
        // A file system without locks has no leftovers removed either.
        let is_taken = matches!(temp.as_file().try_lock(), Err(TryLockError::WouldBlock));
        // Another run may have taken the file for a leftover before it was locked.
        if !is_taken && temp.path().exists() {
            return Ok(temp);
        }
    }
}

/// Removes temporary files and folders that nobody has locked any more: their run was killed. Best effort:
/// failures are not the user's problem. A folder in the making has no leftovers, and may have so many
/// files that to look at all of them for each new one would take ever longer.
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
        // Locked until it is gone: its maker may be about to lock it.
        let Ok(file) = File::open(entry.path()) else { continue };
        if file.try_lock().is_ok() {
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            let remove = if is_folder { std::fs::remove_dir_all } else { std::fs::remove_file };
            let _ = remove(&entry.path());
        }
    }
}

/// True for the name of a temporary file or folder of ours.
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
