//! Input files of a grid: one file, or the files of a mosaic from bottom to top.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::raw;
use crate::registry::{FORMATS, file_name};
use terrane_base::error::Result;
use terrane_files::format::by_extension;
use terrane_files::{FileKind, is_made, name_of, path_of, shown};

/// Extensions of compressed files.
const PACKED_ENDINGS: [&str; 2] = ["gz", "zip"];
/// Extensions that files other than grids have, too: lists, tables, mosaics of the files of a folder.
const AMBIGUOUS_ENDINGS: [&str; 3] = ["txt", "csv", "vrt"];

/// Input names of one grid, as given by the user; several names form one mosaic.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    names: Vec<String>,
    label: Option<String>,
}

impl Inputs {
    /// The names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Display label instead of the names.
    pub fn label(&self) -> Option<&str> {
        self.label.as_deref()
    }

    /// The files of the inputs with absolute paths; display names are unchanged.
    ///
    /// # Errors
    /// As [`files`]; paths that cannot be made absolute.
    pub fn resolve(&self) -> Result<Self> {
        let names = files(&self.names)?.iter().map(|name| absolute(name)).collect::<Result<_>>()?;
        Ok(Self::labelled(names, self.to_string()))
    }

    /// The same names with the display label `label`.
    pub fn called(&self, label: String) -> Self {
        Self::labelled(self.names.clone(), label)
    }

    /// Names with the display label `label`.
    pub fn labelled(names: Vec<String>, label: String) -> Self {
        Self { names, label: Some(label) }
    }
}

/// `input` with an absolute path, if it is a file.
fn absolute(input: &str) -> Result<String> {
    if is_made(input) {
        return Ok(input.to_owned());
    }
    let name = file_name(input);
    let path = path_of(name);
    Ok(input[..input.len() - name.len()].to_owned() + &name_of(terrane_files::absolute(&path)?)?)
}

impl From<Vec<String>> for Inputs {
    fn from(names: Vec<String>) -> Self {
        Self { names, label: None }
    }
}

impl From<String> for Inputs {
    fn from(name: String) -> Self {
        Self::from(vec![name])
    }
}

impl From<&str> for Inputs {
    fn from(name: &str) -> Self {
        Self::from(vec![name.to_owned()])
    }
}

impl From<&String> for Inputs {
    fn from(name: &String) -> Self {
        Self::from(vec![name.clone()])
    }
}

impl From<&Path> for Inputs {
    fn from(path: &Path) -> Self {
        // A name that must be text and is not names no file.
        let name = name_of(path.to_owned());
        Self::from(name.unwrap_or_else(|_| path.to_string_lossy().into_owned()))
    }
}

impl From<&PathBuf> for Inputs {
    fn from(path: &PathBuf) -> Self {
        Self::from(path.as_path())
    }
}

impl From<PathBuf> for Inputs {
    fn from(path: PathBuf) -> Self {
        Self::from(path.as_path())
    }
}

/// The first name and the number of others: "a.tif and 2 more".
impl fmt::Display for Inputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(label) = &self.label {
            return f.write_str(label);
        }
        match self.names.as_slice() {
            [] => write!(f, "nothing"),
            [one] => write!(f, "{}", shown(one)),
            [first, rest @ ..] => write!(f, "{} and {} more", shown(first), rest.len()),
        }
    }
}

/// Grids as inputs.
const GRIDS: FileKind = FileKind { what: "grid", is_member: is_grid_name, file_name };

/// True if `input` stands for other files: a folder, a list of files, or a pattern. A `.txt` or `.csv` file
/// is a list if its first line (except empty lines and comments) names an existing file, and else a grid of
/// points; the prefix `@` makes any file a list.
pub fn is_collection(input: &str) -> bool {
    GRIDS.is_collection(input)
}

/// The files that `inputs` stand for, in order; the files of a folder or pattern are sorted by name.
///
/// # Errors
/// Unreadable folders, lists or patterns, or ones without files; more than
/// [`limits::MAX_MEMBERS`](terrane_base::limits::MAX_MEMBERS) files.
pub fn files(inputs: &[String]) -> Result<Vec<String>> {
    GRIDS.files(inputs)
}

/// As [`files`], including subfolders.
///
/// # Errors
/// As [`files`].
pub fn files_below(inputs: &[String]) -> Result<Vec<String>> {
    GRIDS.files_below(inputs)
}

/// True for names that only grids have: not lists, archives of unknown content, raw headers or hidden files.
fn is_grid_name(path: &Path) -> bool {
    let extension =
        path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    if hidden || AMBIGUOUS_ENDINGS.contains(&extension.as_str()) || raw::is_header_name(path) {
        return false;
    }
    if PACKED_ENDINGS.contains(&extension.as_str()) {
        return is_grid_name(&path.with_extension(""));
    }
    by_extension(FORMATS, path).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Place(tempfile::TempDir);

    impl Place {
        fn new(names: &[&str]) -> Self {
            let place = Self(tempfile::tempdir().unwrap());
            names.iter().for_each(|name| place.write(name, "x"));
            place
        }

        fn write(&self, name: &str, text: &str) {
            std::fs::write(self.0.path().join(name), text).unwrap();
        }

        fn at(&self, name: &str) -> String {
            self.0.path().join(name).display().to_string()
        }

        /// Names below the folder.
        fn files(&self, inputs: &[&str]) -> Vec<String> {
            let found = files(&inputs.iter().map(|i| (*i).to_owned()).collect::<Vec<_>>()).unwrap();
            let start = format!("{}/", self.0.path().display());
            found.iter().map(|name| name.strip_prefix(&start).unwrap_or(name).to_owned()).collect()
        }

        fn refused(&self, input: &str) -> String {
            files(&[input.to_owned()]).unwrap_err().to_string()
        }
    }

    #[test]
    fn a_folder_gives_its_grids_by_name() {
        let place = Place::new(&[
            "b.TIF",
            "a.hgt",
            "c.hgt.zip",
            "d.zip",
            "readme.txt",
            "all.vrt",
            ".e.tif",
            "f.tif.ovr",
            "g.bil",
            "g.hdr",
            "g.prj",
            "h.asc.gz",
        ]);
        std::fs::create_dir(place.0.path().join("sub.tif")).unwrap();
        let folder = place.at("");
        assert!(is_collection(&folder));
        assert_eq!(place.files(&[&folder]), ["a.hgt", "b.TIF", "c.hgt.zip", "g.bil", "h.asc.gz"]);
        let empty = Place::new(&["x.md"]);
        assert!(empty.refused(&empty.at("")).contains("holds no grid"));
    }

    #[test]
    fn a_list_is_told_from_points_by_what_it_names() {
        let place = Place::new(&["a.tif", "b.tif"]);
        place.write("list.txt", "\n# tiles\nb.tif\r\n  a.tif \n");
        place.write("points.txt", "1 2 3\n2 2 4\n");
        place.write("odd", "a.tif\n");
        assert!(is_collection(&place.at("list.txt")) && !is_collection(&place.at("points.txt")));
        assert_eq!(place.files(&[&place.at("list.txt")]), ["b.tif", "a.tif"]);
        assert!(!is_collection(&place.at("odd")));
        assert_eq!(place.files(&[&format!("@{}", place.at("odd"))]), ["a.tif"]);
        place.write("list.txt", "a.tif\nnone.tif\n");
        let told = place.refused(&place.at("list.txt"));
        assert!(told.contains("line 2: lists none.tif, which does not exist"), "{told}");
        assert!(place.refused("@nowhere").contains("cannot read"));
        std::fs::write(place.0.path().join("raw"), [b'a', 0, 0xfe]).unwrap();
        assert!(place.refused(&format!("@{}", place.at("raw"))).contains("not a text file"));
    }

    #[test]
    fn several_inputs_keep_their_order() {
        let place = Place::new(&["a.tif", "b.tif", "c.tif", "x[1].tif"]);
        let (c, pattern) = (place.at("c.tif"), place.at("[ab].tif"));
        assert_eq!(
            place.files(&[&c, &pattern, "synth:rough"]),
            ["c.tif", "a.tif", "b.tif", "synth:rough"]
        );
        assert!(
            is_collection(&pattern) && !is_collection(&place.at("x[1].tif")),
            "a file is a file"
        );
        assert!(place.refused(&place.at("z*.tif")).contains("matches no file"));
    }

    #[test]
    fn inputs_are_told_in_short() {
        assert_eq!(Inputs::from("a").to_string(), "a");
        let three = Inputs::from(["a", "b", "c"].map(str::to_owned).to_vec());
        assert_eq!(three.to_string(), "a and 2 more");
    }
}
