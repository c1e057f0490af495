//! Expands inputs to vector files.

use std::path::Path;

use super::FORMATS;
use terrane_base::error::Result;
use terrane_files::FileKind;
use terrane_files::format::by_extension;

/// Extensions that files other than vector files have, too: lists, tables, notes.
const AMBIGUOUS_ENDINGS: [&str; 4] = ["txt", "csv", "tsv", "json"];

/// Vector files as inputs.
const FEATURES: FileKind =
    FileKind { what: "vector file", is_member: is_feature_file, file_name: |input| input };

/// The files that `inputs` stand for, in order: those of a folder or pattern sorted by name.
///
/// # Errors
/// Unreadable folders, lists or patterns, or ones without files; more than
/// [`limits::MAX_MEMBERS`](terrane_base::limits::MAX_MEMBERS) files.
pub fn files(inputs: &[String]) -> Result<Vec<String>> {
    FEATURES.files(inputs)
}

/// True if `input` stands for other files: a folder, a list of files, or a pattern.
pub fn is_collection(input: &str) -> bool {
    FEATURES.is_collection(input)
}

/// As [`files`], including subfolders.
///
/// # Errors
/// As [`files`].
pub fn files_below(inputs: &[String]) -> Result<Vec<String>> {
    FEATURES.files_below(inputs)
}

fn is_feature_file(path: &Path) -> bool {
    let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    by_extension(FORMATS, path).is_some()
        && !hidden
        && !AMBIGUOUS_ENDINGS.contains(&ending.as_str())
}
