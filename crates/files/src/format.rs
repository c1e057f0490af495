//! Formats of files, found by name or by the endings of files.

use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_base::registry::{self, RegistryEntry};

/// A format of files.
pub trait FileFormat: RegistryEntry {
    /// Endings of its files, in lower case and without the dot; the usual one first.
    fn extensions(&self) -> &'static [&'static str];

    /// True when the name of `path` ends in one of them, in any case.
    fn has_extension_of(&self, path: &Path) -> bool {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let is_it =
            |ending: &&str| name.strip_suffix(ending).is_some_and(|stem| stem.ends_with('.'));
        self.extensions().iter().any(is_it)
    }

    /// The error of a file of it whose name has another ending.
    fn wrong_ending(&self, path: &Path) -> Error {
        Error::usage(format!("file name extension does not match format {}", self.name()))
            .in_file(path)
            .remedy(format!("use the extension {}", self.endings()))
    }

    /// Its endings in words.
    fn endings(&self) -> String {
        self.extensions().iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" or ")
    }
}

/// The first format that the ending of `path` stands for.
pub fn by_extension<F: FileFormat>(all: &'static [F], path: &Path) -> Option<&'static F> {
    all.iter().find(|format| format.has_extension_of(path))
}

/// The format called `name`, or else the first that the ending of `path` stands for.
///
/// # Errors
/// Usage: an unknown name or ending; the known ones are listed.
pub fn by_path<F: FileFormat>(
    all: &'static [F],
    path: &Path,
    name: Option<&str>,
) -> Result<&'static F> {
    if let Some(name) = name {
        return registry::named(all, name);
    }
    by_extension(all, path).ok_or_else(|| {
        let endings = registry::offered(all, F::endings);
        Error::usage(format!("file name extension matches no {}", F::KIND))
            .in_file(path)
            .remedy(format!("use the extension {endings}, or pass a format"))
    })
}
