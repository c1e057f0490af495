//! Files that this project did not write, for tests that are run where they are at hand.
//!
//! `TERRANE_DATA` names their folder. Tests that need them are ignored unless asked for
//! (`cargo test -- --ignored`), and fail where they are not there.
#![allow(dead_code, reason = "each test file uses some of these")]

use std::path::PathBuf;

/// Why a test is not run by `cargo test` alone is said as `#[ignore = "needs TERRANE_DATA"]`.
const FOLDER: &str = "TERRANE_DATA";

/// The folder, if it is named.
pub(crate) fn at_hand() -> Option<PathBuf> {
    std::env::var_os(FOLDER).map(PathBuf::from)
}

/// A file or folder in it.
pub(crate) fn at(name: &str) -> PathBuf {
    let folder =
        at_hand().unwrap_or_else(|| panic!("{FOLDER} does not name the folder of the data"));
    let path = folder.join(name);
    assert!(path.exists(), "{} is not there: {FOLDER} names another folder", path.display());
    path
}

/// Files of a folder in it, sorted.
pub(crate) fn files(name: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(at(name)).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.filter(|path| path.is_file()).collect();
    files.sort();
    files
}
