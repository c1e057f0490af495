//! Atomic creation of folders.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::temporary::{TEMP_PREFIX, TEMP_SUFFIX, parent, remove_leftovers};
use super::{plain, refuse_existing, resolve, sync_folder};
use crate::fault::{self, FaultPoint};
use terrane_base::error::{Error, Result};

/// Error message for a folder that cannot be replaced.
const NOT_OURS: &str = "folder exists and was not created by terrane, or contains other files";

/// A folder under construction. Dropping it removes its content.
#[derive(Debug)]
pub struct AtomicFolder {
    temp: TempDir,
    path: PathBuf,
    /// `path` with symbolic links resolved.
    target: PathBuf,
    /// Lock that marks the temporary folder as in use.
    _lock: Option<File>,
}

impl AtomicFolder {
    /// Starts a folder that will appear at `path`. Fails at once if it cannot be created, or if something
    /// exists there, unless `overwrite` is true and `is_ours` accepts the existing folder.
    pub fn create(path: &Path, overwrite: bool, is_ours: impl Fn(&Path) -> bool) -> Result<Self> {
        refuse_existing(path, overwrite)?;
        if path.symlink_metadata().is_ok() && !is_ours(path) {
            return Err(Error::usage(NOT_OURS).in_file(path).remedy("choose another name"));
        }
        let target = resolve(path)?;
        let beside = parent(&target);
        remove_leftovers(beside);
        let made = fault::point(FaultPoint::Create).and_then(|()| temporary(beside));
        let (temp, lock) = made.map_err(|e| Error::write(path, plain(e)))?;
        Ok(Self { temp, path: path.to_path_buf(), target, _lock: lock })
    }

    /// Path of the temporary folder to write files to.
    pub fn inside(&self) -> &Path {
        self.temp.path()
    }

    /// Renames the folder to its final name and replaces an existing one.
    pub fn commit(self) -> Result<()> {
        let Self { temp, path, target, _lock } = self;
        let fail = |e| Error::write(&path, e);
        sync_folder(temp.path());
        fault::point(FaultPoint::Rename).map_err(fail)?;
        if exchange(temp.path(), &target) {
            // The old folder now has the temporary name and is removed with it.
            sync_folder(parent(&target));
            return Ok(());
        }
        // The name keeps prefix and suffix of temporary ones: what a killed run leaves under it is found.
        let replaced = target.exists().then(|| temp.path().with_extension("old.tmp"));
        if let Some(old) = &replaced {
            std::fs::rename(&target, old).map_err(fail)?;
        }
        let renamed = std::fs::rename(temp.path(), &target);
        if let (Err(_), Some(old)) = (&renamed, &replaced) {
            let _back = std::fs::rename(old, &target);
        }
        renamed.map_err(fail)?;
        // The folder has left this name; the guard would remove whatever has it next.
        let _gone = temp.keep();
        sync_folder(parent(&target));
        replaced.map_or(Ok(()), std::fs::remove_dir_all).map_err(fail)
    }
}

/// Atomically exchanges two names if the system supports it; false if it does not, or if one of them is
/// missing.
#[cfg(target_os = "linux")]
fn exchange(a: &Path, b: &Path) -> bool {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE).is_ok()
}

#[cfg(not(target_os = "linux"))]
fn exchange(_a: &Path, _b: &Path) -> bool {
    false
}

/// A temporary folder in `folder`, locked if the file system supports it.
fn temporary(folder: &Path) -> io::Result<(TempDir, Option<File>)> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMP_PREFIX).suffix(TEMP_SUFFIX);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    loop {
        let temp = builder.tempdir_in(folder)?;
        let lock = File::open(temp.path()).ok();
        let lock_result = lock.as_ref().map(File::try_lock);
        let is_taken = matches!(lock_result, Some(Err(TryLockError::WouldBlock)));
        // Another run may have removed the folder as a leftover before it was locked.
        if !is_taken && temp.path().exists() {
            return Ok((temp, lock));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap().flatten();
        entries.map(|entry| entry.file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn appears_whole_replaces_only_its_own_and_leaves_nothing() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        let make = |text: &str, overwrite, is_ours: fn(&Path) -> bool| {
            let folder = AtomicFolder::create(&path, overwrite, is_ours)?;
            std::fs::write(folder.inside().join("a"), text).unwrap();
            folder.commit()
        };
        make("one", false, |_| false).unwrap();
        assert_eq!(make("two", false, |_| true).unwrap_err().kind(), ErrorKind::Usage);
        assert_eq!(make("two", true, |_| false).unwrap_err().kind(), ErrorKind::Usage);
        make("two", true, |_| true).unwrap();
        assert_eq!(std::fs::read(path.join("a")).unwrap(), b"two");
        drop(AtomicFolder::create(&place.path().join("other"), false, |_| false).unwrap());
        assert_eq!(names(place.path()), ["out"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn there_is_always_a_folder_while_one_is_replaced() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        std::fs::create_dir(&path).unwrap();
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            let gone = scope.spawn(|| {
                let is_done = || done.load(std::sync::atomic::Ordering::Relaxed);
                std::iter::repeat_with(|| !is_done()).take_while(|go| *go).any(|_| !path.exists())
            });
            for _ in 0..1000 {
                AtomicFolder::create(&path, true, |_| true).unwrap().commit().unwrap();
            }
            done.store(true, std::sync::atomic::Ordering::Relaxed);
            assert!(!gone.join().unwrap());
        });
        assert_eq!(names(place.path()), ["out"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn others_who_tidy_up_never_take_a_new_folder() {
        let place = tempfile::tempdir().unwrap();
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            let tidy = || {
                while !done.load(std::sync::atomic::Ordering::Relaxed) {
                    remove_leftovers(place.path());
                }
            };
            scope.spawn(tidy);
            let lost = (0..3000).filter(|_| {
                let made = AtomicFolder::create(&place.path().join("out"), false, |_| false);
                !made.unwrap().inside().exists()
            });
            let lost = lost.count();
            done.store(true, std::sync::atomic::Ordering::Relaxed);
            assert_eq!(lost, 0);
        });
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_its_target_is_replaced() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        std::fs::create_dir_all(at("there/old")).unwrap();
        std::fs::write(at("there/old/a"), b"old").unwrap();
        std::os::unix::fs::symlink("there/old", at("link")).unwrap();
        let folder = AtomicFolder::create(&at("link"), true, |_| true).unwrap();
        assert_eq!(names(&at("there")).len(), 2, "beside the target");
        folder.commit().unwrap();
        assert!(at("link").symlink_metadata().unwrap().is_symlink());
        assert!(at("there/old").is_dir() && !at("there/old/a").exists());
        assert_eq!(names(&at("there")), ["old"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn leftovers_go_and_folders_in_use_stay() {
        let place = tempfile::tempdir().unwrap();
        let left = place.path().join(".terrane-left.tmp");
        std::fs::create_dir(&left).unwrap();
        std::fs::write(left.join("a"), b"x").unwrap();
        let one = AtomicFolder::create(&place.path().join("one"), false, |_| false).unwrap();
        let two = AtomicFolder::create(&place.path().join("two"), false, |_| false).unwrap();
        assert!(!left.exists() && one.inside().exists() && two.inside().exists());
    }
}
