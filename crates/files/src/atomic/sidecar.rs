//! Small text sidecars of an output, such as `.prj`. A stale sidecar of an earlier output would apply to the
//! new one, so it is replaced, or removed if there is nothing to write, but only with permission to
//! overwrite.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{AtomicFile, refuse_existing, refuse_special};
use terrane_base::error::{Error, ErrorKind, Result};

/// Size limit, in bytes, of an existing sidecar that is compared with the new one.
const MAX_BYTES: u64 = 1 << 20;

/// A pending sidecar of an output.
#[derive(Debug)]
pub struct Sidecar {
    path: PathBuf,
    overwrite: bool,
    change: SidecarChange,
}

/// Change of the file at commit.
#[derive(Debug, PartialEq)]
enum SidecarChange {
    /// The existing file has the same content, or there is neither a file nor content.
    Nothing,
    Write(String),
    Remove,
}

impl Sidecar {
    /// Plans the file at `path` with the content `text`, or its removal if `text` is `None`. An existing file
    /// is kept if `says_so` holds for its content; it may belong to the input or to another output of the
    /// same name. Nothing is written before [`commit`](Self::commit).
    ///
    /// # Errors
    /// `Usage` if a different file exists and `overwrite` is false.
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

    /// Path and size of the sidecar, if there will be one.
    pub fn place(&self) -> Option<(PathBuf, u64)> {
        let bytes = match &self.change {
            SidecarChange::Write(text) => text.len() as u64,
            SidecarChange::Remove => return None,
            SidecarChange::Nothing => self.path.metadata().ok()?.len(),
        };
        Some((self.path.clone(), bytes))
    }

    /// Writes the file atomically, or removes it.
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
    let is_small = std::fs::metadata(path).is_ok_and(|meta| meta.len() <= MAX_BYTES);
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
