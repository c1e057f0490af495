//! File formats, found by name or by file name extension.

use std::path::Path;

use crate::without_query;
use terrane_base::error::{Error, Result};
use terrane_base::registry::{self, RegistryEntry};

/// A file format.
pub trait FileFormat: RegistryEntry {
    /// File name extensions, in lower case and without the dot; the usual one first.
    fn extensions(&self) -> &'static [&'static str];

    /// True if `path` has one of the extensions, in any case.
    fn has_extension_of(&self, path: &Path) -> bool {
        let name = without_query(path).file_name().unwrap_or_default();
        let name = name.to_string_lossy().to_lowercase();
        let mut stems = self.extensions().iter().filter_map(|ending| name.strip_suffix(ending));
        stems.any(|stem| stem.ends_with('.'))
    }

    /// Error of a file name with another extension.
    fn wrong_ending(&self, path: &Path) -> Error {
        Error::usage(format!("file name extension does not match format {}", self.name()))
            .in_file(path)
            .remedy(format!("use the extension {}", self.endings()))
    }

    /// The extensions as text.
    fn endings(&self) -> String {
        self.extensions().iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" or ")
    }
}

/// The first format with the extension of `path`.
pub fn by_extension<F: FileFormat>(all: &'static [F], path: &Path) -> Option<&'static F> {
    all.iter().find(|format| format.has_extension_of(path))
}

/// The format called `name`, or else the first with the extension of `path`.
///
/// # Errors
/// Usage: unknown name or extension; the message lists the known ones.
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
