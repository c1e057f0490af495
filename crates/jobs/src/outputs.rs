//! Outputs that would take the place of what is read.

use std::path::{Path, PathBuf};

use terrane_base::error::{Error, Result};
use terrane_files::{atomic, path_of};
use terrane_raster::{self as raster, GridSource};

/// Fails when one of `outputs` is one of `files`, or another output.
pub fn not_among(files: &[String], outputs: &[&Path]) -> Result<()> {
    distinct(outputs)?;
    outputs.iter().try_for_each(|output| {
        let is_it = |file: &String| is_same(&path_of(raster::file_name(file)), output);
        if files.iter().any(is_it) { Err(taken(output)) } else { Ok(()) }
    })
}

/// Fails when two of the files are one and the same: one would be replaced by the other. Outputs
/// need not exist yet.
fn distinct(files: &[&Path]) -> Result<()> {
    for (i, &file) in files.iter().enumerate() {
        if files[..i].iter().any(|&other| is_same(file, other)) {
            return Err(taken(file));
        }
    }
    Ok(())
}

/// Fails when an output is a file that a grid is made of, however that is named.
pub(crate) fn not_member(source: &dyn GridSource, output: &Path) -> Result<()> {
    match source.members().iter().any(|member| is_same(member, output)) {
        true => Err(taken(output)),
        false => Ok(()),
    }
}

fn taken(file: &Path) -> Error {
    Error::usage("output is the input itself, or two outputs have this name")
        .in_file(file)
        .remedy("choose another name")
}

/// True for two names of one file.
pub fn is_same(a: &Path, b: &Path) -> bool {
    place(a) == place(b)
}

/// Where a file really is, links followed; one that is not there yet by its folder.
pub fn place(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| {
        let path = atomic::resolve(path).unwrap_or_else(|_| path.to_path_buf());
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = std::fs::canonicalize(folder.unwrap_or(Path::new("."))).unwrap_or_default();
        folder.join(path.file_name().unwrap_or_default())
    })
}

/// Fails when `path` does not end in one of `endings`.
pub(crate) fn check_ending(path: &Path, endings: &[&str], what: &str) -> Result<()> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if endings.contains(&ending.as_str()) {
        return Ok(());
    }
    let known: Vec<String> = endings.iter().map(|e| format!(".{e}")).collect();
    Err(Error::usage(format!("{what} cannot have this ending"))
        .in_file(path)
        .remedy(format!("end the name in {}", known.join(" or "))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_names_of_one_file_are_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a.tif"), b"x").unwrap();
        let [here, there, new, again] = ["a.tif", "./a.tif", "c.json", "./c.json"].map(path);
        assert!(distinct(&[&here, &new, &there]).is_err() && distinct(&[&new, &again]).is_err());
        assert!(distinct(&[&here, &new]).is_ok());
        let read = [here.to_str().unwrap().to_owned()];
        assert!(not_among(&read, &[&there]).is_err() && not_among(&read, &[&new]).is_ok());
    }
}
