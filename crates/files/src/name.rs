//! Lossless conversion of file names to text.
//!
//! Inputs are strings: a name may carry a prefix, and is stored in plans, lists and reports. Unix file
//! names are arbitrary bytes. Bytes that are not UTF-8 are mapped to characters of a private plane, one
//! for each byte, and so are the bytes of such characters in a name. The mapping is reversible, like
//! Python's surrogate escapes (PEP 383).

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use terrane_base::error::{Error, Result, is_address};

/// The character that stands for byte 0; those of bytes below 128 are not used.
#[cfg(unix)]
const FIRST: u32 = 0x10_FE00;

/// The text of a path.
///
/// # Errors
/// On platforms whose paths are not bytes: a name that is not Unicode.
#[cfg(unix)]
pub fn name_of(path: PathBuf) -> Result<String> {
    use std::os::unix::ffi::OsStrExt;
    if let Some(text) = path.to_str().filter(|text| !text.contains(is_byte)) {
        return Ok(text.to_owned());
    }
    let mut name = String::new();
    for chunk in path.as_os_str().as_bytes().utf8_chunks() {
        for c in chunk.valid().chars() {
            match is_byte(c) {
                true => push_bytes(c.encode_utf8(&mut [0; 4]).as_bytes(), &mut name),
                false => name.push(c),
            }
        }
        push_bytes(chunk.invalid(), &mut name);
    }
    Ok(name)
}

#[cfg(not(unix))]
pub fn name_of(path: PathBuf) -> Result<String> {
    path.into_os_string().into_string().map_err(|path| {
        terrane_base::error::Error::bad_input("file name is not valid Unicode")
            .in_file(Path::new(&path))
            .remedy("rename it")
    })
}

/// The path that a text stands for.
#[cfg(unix)]
pub fn path_of(name: &str) -> Cow<'_, Path> {
    use std::os::unix::ffi::OsStringExt;
    if !name.contains(is_byte) {
        return Cow::Borrowed(Path::new(name));
    }
    let mut bytes = Vec::with_capacity(name.len());
    for c in name.chars() {
        match is_byte(c) {
            true => bytes.push((u32::from(c) - FIRST) as u8),
            false => bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    Cow::Owned(std::ffi::OsString::from_vec(bytes).into())
}

#[cfg(not(unix))]
pub fn path_of(name: &str) -> Cow<'_, Path> {
    Cow::Borrowed(Path::new(name))
}

/// The absolute path of a file; URLs stay as they are.
///
/// # Errors
/// An empty path, or a current folder that does not exist.
pub fn absolute(path: &Path) -> Result<PathBuf> {
    match is_address(path) {
        true => Ok(path.to_owned()),
        false => std::path::absolute(path).map_err(|error| Error::read(path, error)),
    }
}

/// Whether there is something at a path, or it is a URL, which is not requested.
pub fn is_there(path: &Path) -> bool {
    path.exists() || is_remote(path)
}

/// Whether a path may name a file that can be read: one that exists, or a URL.
pub fn is_file(path: &Path) -> bool {
    path.is_file() || is_remote(path)
}

/// Whether a path is a URL that can be read.
pub fn is_remote(path: &Path) -> bool {
    crate::remote::is_remote(path)
}

/// The path of a URL without its query, which may hold a signature; other paths as they are.
pub fn without_query(path: &Path) -> &Path {
    let name = path.to_str().filter(|_| is_remote(path));
    name.and_then(|name| name.split(['?', '#']).next()).map_or(path, Path::new)
}

/// A name for display; bytes that are not text are shown as the replacement character.
pub fn shown(name: &str) -> String {
    path_of(name).display().to_string()
}

/// Names for display, separated by commas.
pub fn shown_all(names: &[String]) -> String {
    names.iter().map(|name| shown(name)).collect::<Vec<_>>().join(", ")
}

/// True for the characters that stand for bytes.
#[cfg(unix)]
fn is_byte(c: char) -> bool {
    (FIRST + 0x80..=FIRST + 0xFF).contains(&u32::from(c))
}

#[cfg(unix)]
fn push_bytes(bytes: &[u8], name: &mut String) {
    name.extend(bytes.iter().filter_map(|&byte| char::from_u32(FIRST + u32::from(byte))));
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::ffi::OsStringExt;

    use super::*;
    use proptest::prelude::*;

    #[test]
    fn plain_names_stay_as_they_are() {
        for name in ["a.tif", "d\u{e9}m.tif", "\u{10ffff}", ""] {
            assert_eq!(name_of(name.into()).unwrap(), name);
            assert_eq!(*path_of(name), *Path::new(name));
        }
        let latin = PathBuf::from(std::ffi::OsString::from_vec(b"d\xe9m.tif".to_vec()));
        assert_eq!(shown(&name_of(latin).unwrap()), "d\u{fffd}m.tif");
    }

    proptest! {
        #[test]
        fn every_name_comes_back(bytes in prop::collection::vec(any::<u8>(), 0..40), private in 0_u32..256) {
            let mut bytes = bytes;
            let c = char::from_u32(FIRST + private).unwrap();
            bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes());
            let path = PathBuf::from(std::ffi::OsString::from_vec(bytes));
            let name = name_of(path.clone()).unwrap();
            prop_assert_eq!(path_of(&name).into_owned(), path);
        }
    }
}
