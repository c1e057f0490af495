//! Folders that appear whole or not at all.

use std::fs::File;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::{
    TEMP_PREFIX, TEMP_SUFFIX, parent, plain, refuse_existing, remove_leftovers, sync_folder,
};
use crate::error::{Error, Result};
use crate::fault::{self, Point};

/// A folder in the making. Dropping it removes all that was put into it.
#[derive(Debug)]
pub struct AtomicFolder {
    temp: TempDir,
    path: PathBuf,
    /// Held so that no other run takes the folder for a leftover.
    _lock: Option<File>,
}

impl AtomicFolder {
    /// Starts a folder that will appear at `path`. Fails at once when something is there, unless
    /// `overwrite` is true and `is_ours` knows it, and when it cannot be made.
    pub fn create(path: &Path, overwrite: bool, is_ours: fn(&Path) -> bool) -> Result<Self> {
        refuse_existing(path, overwrite)?;
        if path.symlink_metadata().is_ok() && !is_ours(path) {
            return Err(Error::usage("exists and was not made by terrane, so it is not replaced")
                .in_file(path)
                .remedy("choose another name"));
        }
        let beside = parent(path);
        remove_leftovers(beside);
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMP_PREFIX).suffix(TEMP_SUFFIX);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let temp = fault::point(Point::Create).and_then(|()| builder.tempdir_in(beside));
        let temp = temp.map_err(|e| Error::write(path, plain(e)))?;
        let lock = File::open(temp.path()).ok().filter(|folder| folder.try_lock().is_ok());
        Ok(Self { temp, path: path.to_path_buf(), _lock: lock })
    }

    /// Where files are to be put.
    pub fn inside(&self) -> &Path {
        self.temp.path()
    }

    /// Gives the folder its final name, in place of one that is there.
    pub fn commit(self) -> Result<()> {
        let Self { temp, path, _lock } = self;
        let fail = |e| Error::write(&path, e);
        sync_folder(temp.path());
        fault::point(Point::Rename).map_err(fail)?;
        let replaced = path.exists().then(|| temp.path().with_extension("old.tmp"));
        if let Some(old) = &replaced {
            std::fs::rename(&path, old).map_err(fail)?;
        }
        std::fs::rename(temp.path(), &path).map_err(fail)?;
        let _gone = temp.keep();
        sync_folder(parent(&path));
        replaced.map_or(Ok(()), std::fs::remove_dir_all).map_err(fail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap().flatten();
        entries.map(|entry| entry.file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn appears_whole_replaces_only_its_own_and_leaves_nothing() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        let make = |text: &str, overwrite, is_ours| {
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
