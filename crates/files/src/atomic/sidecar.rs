//! Small text files beside an output that readers read along with it. One that an earlier output left
//! there would speak for the new one: it is replaced, or removed where there is nothing to say, but
//! never unasked.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{AtomicFile, refuse_existing, refuse_special};
use terrane_base::error::{Error, ErrorKind, Result};

/// Most bytes of a file that is looked at for what it says.
const MOST_BYTES: u64 = 1 << 20;

/// A file beside an output, in the making.
#[derive(Debug)]
pub struct Sidecar {
    path: PathBuf,
    overwrite: bool,
    change: SidecarChange,
}

/// What is to be done.
#[derive(Debug, PartialEq)]
enum SidecarChange {
    /// What is there says the same already, or nothing is there and nothing is to be said.
    Nothing,
    Write(String),
    Remove,
}

impl Sidecar {
    /// The file at `path`, which is to say `text`, or not to be there at all. A file that is there
    /// stays if `says_so` is true of it: it may be the input's, or another output's of the same name.
    /// Nothing is touched before [`commit`](Self::commit).
    ///
    /// # Errors
    /// `Usage` where something else is there and `overwrite` is false.
    pub fn new(
        path: PathBuf,
        text: Option<String>,
        says_so: impl Fn(&str) -> bool,
        overwrite: bool,
    ) -> Result<Self> {
        let found = read(&path);
        let is_there = path.symlink_metadata().is_ok();
        let change = match text {
            _ if found.is_some_and(|found| says_so(&found)) => SidecarChange::Nothing,
            Some(text) => {
                refuse_existing(&path, overwrite)?;
                refuse_special(&path)?;
                SidecarChange::Write(text)
            }
            None if is_there && overwrite => SidecarChange::Remove,
            None if is_there => return Err(foreign(&path)),
            None => SidecarChange::Nothing,
        };
        Ok(Self { path, overwrite, change })
    }

    /// Where it is, if it is to be there: its path and its size.
    pub fn place(&self) -> Option<(PathBuf, u64)> {
        let bytes = match &self.change {
            SidecarChange::Write(text) => text.len() as u64,
            SidecarChange::Remove => return None,
            SidecarChange::Nothing => self.path.metadata().ok()?.len(),
        };
        Some((self.path.clone(), bytes))
    }

    /// Puts it into place, whole or not at all, or takes it away.
    pub fn commit(&self) -> Result<()> {
        let fail = |e| Error::write(&self.path, e);
        match &self.change {
            SidecarChange::Nothing => Ok(()),
            SidecarChange::Remove => std::fs::remove_file(&self.path).map_err(fail),
            SidecarChange::Write(text) => {
                let mut file = AtomicFile::create(&self.path, self.overwrite)?;
                file.write_all(text.as_bytes()).map_err(fail)?;
                file.commit().map(drop)
            }
        }
    }
}

/// The text of a small file.
fn read(path: &Path) -> Option<String> {
    let is_small = std::fs::metadata(path).is_ok_and(|meta| meta.len() <= MOST_BYTES);
    is_small
        .then(|| std::fs::read(path).ok())
        .flatten()
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
}

fn foreign(path: &Path) -> Error {
    let message = "sidecar of an earlier file exists and would apply to the new one";
    Error::new(ErrorKind::Usage, message)
        .in_file(path)
        .remedy("choose another output name, or pass ‹overwrite› to remove it")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_foreign_stays_and_nothing_goes_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.prj");
        let make = |text: Option<&str>, overwrite| {
            let made = Sidecar::new(
                path.clone(),
                text.map(str::to_owned),
                |found| Some(found) == text,
                overwrite,
            );
            made.and_then(|sidecar| sidecar.commit().map(|()| sidecar.place()))
        };
        let found = || std::fs::read_to_string(&path).ok();
        assert_eq!((make(None, false).unwrap(), found()), (None, None));
        assert_eq!(make(Some("one"), false).unwrap(), Some((path.clone(), 3)));
        assert_eq!(
            make(Some("one"), false).unwrap(),
            Some((path.clone(), 3)),
            "it says so already"
        );
        for text in [Some("two"), None] {
            assert_eq!(make(text, false).unwrap_err().kind(), ErrorKind::Usage);
            assert_eq!(found().as_deref(), Some("one"));
        }
        make(Some("two"), true).unwrap();
        assert_eq!(found().as_deref(), Some("two"));
        assert_eq!((make(None, true).unwrap(), found()), (None, None));
    }
}
