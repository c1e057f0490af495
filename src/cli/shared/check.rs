//! Checks before any work: missing inputs, existing outputs.

use std::borrow::Cow;
use std::io;
use std::path::Path;

use crate::cli::shared::pipes;
use terrane_base::error::{Error, ErrorKind, Result, all, is_address};
pub(crate) use terrane_engine::outputs::not_among;
use terrane_engine::outputs::{is_same, place};
use terrane_files::atomic;
use terrane_files::{companions, is_file, is_made, is_there, path_of};
use terrane_raster as raster;

/// As [`input`], for all `inputs`.
pub(crate) fn inputs(inputs: &[String]) -> Result<()> {
    all(inputs.iter().map(|name| input(name)).collect()).map(drop)
}

/// The same for features.
pub(crate) fn features(inputs: &[String]) -> Result<()> {
    let checks = inputs.iter().map(|name| there(name, Some("name a file of lines")));
    all(checks.collect()).map(drop)
}

/// Fails if `input` is neither existing files nor the name of a synthetic terrain.
pub(crate) fn input(input: &str) -> Result<()> {
    there(input, Some("use a synthetic terrain such as synth:rough,size=2049"))
}

/// Fails for a missing output.
pub(crate) fn written(file: &str) -> Result<()> {
    there(file, None)
}

/// Fails if `input` is neither existing files nor synthetic; `or` is an alternative remedy for missing files.
fn there(input: &str, or: Option<&str>) -> Result<()> {
    pipes::refuse_input(input)?;
    let path = &*path_of(raster::file_name(input));
    if is_made(input) || is_file(path) || raster::is_collection(input) {
        return Ok(());
    }
    Err(match std::fs::metadata(path) {
        Ok(_) => Error::bad_input("is not a regular file").in_file(path).remedy("name a file"),
        Err(e) if is_nowhere(e.kind()) => match or.filter(|_| !is_address(path)) {
            Some(or) => Error::missing(path).or(or),
            None => Error::missing(path),
        },
        Err(e) => Error::read(path, e),
    })
}

/// Fails for a missing auxiliary file.
pub(crate) fn check_sidecars(files: &[String]) -> Result<()> {
    files.iter().try_for_each(|name| pipes::refuse_input(name))?;
    match files.iter().find(|file| is_missing(file)) {
        Some(file) => Err(Error::missing(&path_of(file))),
        None => Ok(()),
    }
}

fn is_missing(file: &str) -> bool {
    let path = path_of(raster::file_name(file));
    !(is_made(file) || is_there(&path))
}

/// True for a missing path; false for other errors, such as missing permissions.
fn is_nowhere(kind: io::ErrorKind) -> bool {
    matches!(kind, io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

/// Fails if `path` cannot be a new file: it exists, or its folder is missing.
pub(crate) fn new_file(path: &Path, overwrite: bool) -> Result<()> {
    atomic::refuse_existing(path, overwrite)?;
    if path.is_dir() {
        return Err(Error::usage("is a folder").in_file(path).remedy("name a file in it"));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    refuse_address(path)?;
    if folder.is_some_and(|p| !p.is_dir()) {
        return Err(Error::new(ErrorKind::CannotWrite, "its folder does not exist")
            .in_file(path)
            .remedy("create the folder first"));
    }
    Ok(())
}

/// Fails for an address, which cannot be an output.
fn refuse_address(path: &Path) -> Result<()> {
    if path.exists() || !is_address(path) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::CannotWrite, "cannot write to URLs")
        .in_file(path)
        .remedy("name a local file or folder"))
}

/// Fails if `path` cannot be a folder because it is a file.
pub(crate) fn folder(path: &Path) -> Result<()> {
    if path.exists() && !path.is_dir() {
        return Err(Error::usage("is a file, not a folder")
            .in_file(path)
            .remedy("name a new or existing folder"));
    }
    refuse_address(path)
}

/// Fails if `report` cannot be a new file that is distinct from the files `read`, the `results`, their sidecar
/// files and the files in them.
pub(crate) fn report(
    report: Option<&Path>,
    read: &[String],
    results: &[&Path],
    overwrite: bool,
) -> Result<()> {
    let Some(report) = report else { return Ok(()) };
    let resolved = place(report);
    let read = read.iter().map(|name| path_of(raster::file_name(name)));
    let mut files = results.iter().map(|&path| Cow::Borrowed(path)).chain(read);
    if let Some(file) = files.find(|file| is_part_of(report, &resolved, file)) {
        return Err(Error::usage(format!("is {} itself or a part of it", file.display()))
            .in_file(report)
            .remedy("choose another name for the report"));
    }
    new_file(report, overwrite)
}

/// True if a report, at the place `resolved`, is `file`, a sidecar file of it, or in it.
fn is_part_of(report: &Path, resolved: &Path, file: &Path) -> bool {
    resolved.starts_with(place(file))
        || companions(file)
            .iter()
            // Resolving every possible name would take far longer.
            .filter(|path| path.file_name() == resolved.file_name() || path.is_symlink())
            .any(|path| is_same(path, report))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_files_are_told_with_their_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.tif");
        std::fs::write(&file, b"x").unwrap();
        let name = |p: &Path| p.to_str().unwrap().to_owned();
        assert!(input(&name(&file)).is_ok() && input("synth:rough").is_ok());
        for nowhere in ["nowhere.tif".to_owned(), name(&file) + "/b.tif"] {
            let told = input(&nowhere).unwrap_err().to_string();
            assert!(told.contains("no such file"), "{told}");
        }
        let told = input(&"n".repeat(300)).unwrap_err().to_string();
        assert!(told.contains("cannot read"), "a name that no file can have: {told}");
        assert!(input(&name(folder.path())).is_ok(), "a folder of grids");
        assert_eq!(new_file(&file, false).unwrap_err().kind(), ErrorKind::Usage);
        assert!(new_file(&file, true).is_ok());
        assert!(new_file(folder.path(), true).is_err());
        let lost = folder.path().join("no/such/b.ply");
        assert_eq!(new_file(&lost, false).unwrap_err().kind(), ErrorKind::CannotWrite);
    }
}
