//! Checks that outputs do not overwrite inputs.

use std::path::{Path, PathBuf};

use terrane_base::error::{Error, Result};
use terrane_files::format::FileFormat;
use terrane_files::{atomic, path_of};
use terrane_mesh as mesh;
use terrane_raster::{self as raster, GridSource};
use terrane_vector as vector;

/// Fails when one of `outputs` is one of `files`, or another output.
pub fn not_among(files: &[String], outputs: &[&Path]) -> Result<()> {
    distinct(outputs)?;
    outputs.iter().try_for_each(|output| {
        match files.iter().any(|file| is_same(&path_of(raster::file_name(file)), output)) {
            true => Err(taken(output)),
            false => Ok(()),
        }
    })
}

/// Fails if two of the files are the same, as one would replace the other. Outputs need not exist yet.
fn distinct(files: &[&Path]) -> Result<()> {
    for (i, &file) in files.iter().enumerate() {
        if files[..i].iter().any(|&other| is_same(file, other)) {
            return Err(taken(file));
        }
    }
    Ok(())
}

/// Fails if an output is a file of a grid, under any name.
pub fn not_member(source: &dyn GridSource, output: &Path) -> Result<()> {
    match source.members().iter().any(|member| is_same(member, output)) {
        true => Err(taken(output)),
        false => Ok(()),
    }
}

fn taken(file: &Path) -> Error {
    Error::usage("output is also an input or another output")
        .in_file(file)
        .remedy("choose another name")
}

/// File extensions of point clouds, tilesets and tiles.
const OF_FILES: [&str; 11] =
    ["las", "laz", "copc", "pmtiles", "mbtiles", "3tz", "zip", "tar", "terrain", "b3dm", "subtree"];

/// The extension of a name, if it belongs to a known format.
fn known_ending(output: &Path) -> Option<String> {
    let ending = output.extension()?.to_str()?.to_lowercase();
    let all = [
        raster::FORMATS.iter().flat_map(|known| known.extensions).collect::<Vec<_>>(),
        mesh::FORMATS.iter().flat_map(|known| known.extensions).collect(),
        vector::FORMATS.iter().flat_map(|known| known.extensions).collect(),
        OF_FILES.iter().collect(),
    ];
    all.concat().into_iter().any(|known| *known == ending).then_some(ending)
}

/// Fails if the name of a folder has a file extension.
pub fn refuse_file_name(output: &Path) -> Result<()> {
    let Some(ending) = known_ending(output) else { return Ok(()) };
    Err(Error::usage(format!(
        "the output is a folder, but .{ending} is the extension of a file format"
    ))
    .in_file(output)
    .remedy("name a folder without this extension"))
}

/// Fails if the extension of a name differs from the file's format.
pub fn refuse_other_name<F: FileFormat>(format: &F, output: &Path) -> Result<()> {
    let is_other = known_ending(output).is_some() && !format.has_extension_of(output);
    if is_other { Err(format.wrong_ending(output)) } else { Ok(()) }
}

/// True if both names refer to one file.
pub fn is_same(a: &Path, b: &Path) -> bool {
    place(a) == place(b)
}

/// The resolved path of a file, links followed; for a missing file by its folder.
pub fn place(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| {
        let path = atomic::resolve(path).unwrap_or_else(|_| path.to_path_buf());
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = std::fs::canonicalize(folder.unwrap_or(Path::new("."))).unwrap_or_default();
        folder.join(path.file_name().unwrap_or_default())
    })
}

/// Fails if `path` does not end in one of `endings`.
pub fn check_ending(path: &Path, endings: &[&str], what: &str) -> Result<()> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if endings.contains(&ending.as_str()) {
        return Ok(());
    }
    let known: Vec<String> = endings.iter().map(|e| format!(".{e}")).collect();
    Err(Error::usage(format!("{what} cannot have this extension"))
        .in_file(path)
        .remedy(format!("use {}", known.join(" or "))))
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
