//! Source paths of a VRT: files in its folder and below, unless the user allows others.

use std::path::{Component, Path, PathBuf};

use terrane_base::error::{Error, Result};
use terrane_files::{is_remote, name_of, without_query};

/// Environment variable that allows VRT sources anywhere.
const ALLOW: &str = "TERRANE_VRT_ALLOW_OUTSIDE";

/// The path of the source `name` of the VRT at `vrt`: relative to the folder of the VRT, or else to the
/// current folder. Symbolic links are trusted and followed.
pub(super) fn resolve(vrt: &Path, name: &str, is_relative: bool) -> Result<String> {
    let allowed = std::env::var_os(ALLOW).is_some_and(|value| value == "1");
    resolve_with(vrt, name, is_relative, allowed)
}

fn resolve_with(vrt: &Path, name: &str, is_relative: bool, allowed: bool) -> Result<String> {
    let is_url = is_remote(Path::new(name));
    if name.to_ascii_lowercase().starts_with("/vsi") && !is_url {
        return Err(Error::unsupported(format!("source {} is a GDAL virtual file", short(name)))
            .remedy("copy it to a file in the folder of the VRT"));
    }
    let folder = without_query(vrt).parent().unwrap_or(Path::new(""));
    let path = match (is_url, is_remote(vrt)) {
        (true, _) => PathBuf::from(name),
        // Never a file of this machine.
        (false, true) => PathBuf::from(format!("{}/{name}", folder.display())),
        (false, false) if is_relative => folder.join(name),
        (false, false) => PathBuf::from(name),
    };
    if !allowed && !is_inside(folder, &path) {
        return Err(Error::bad_input(format!(
            "source {} is outside the folder of the VRT",
            short(name)
        ))
        .remedy(format!("set {ALLOW}=1 if you trust this VRT")));
    }
    name_of(path)
}

fn is_inside(folder: &Path, path: &Path) -> bool {
    match (normal(folder), normal(path)) {
        (Some(folder), Some(path)) => path.starts_with(folder),
        _ => false,
    }
}

/// The absolute path without `.` and `..`; `None` if invalid.
fn normal(path: &Path) -> Option<PathBuf> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let mut normal = PathBuf::new();
    for part in std::path::absolute(path).ok()?.components() {
        match part {
            Component::ParentDir if !normal.pop() => return None,
            Component::ParentDir | Component::CurDir => {}
            part => normal.push(part),
        }
    }
    Some(normal)
}

fn short(name: &str) -> String {
    name.chars().take(200).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn describe(name: &str, is_relative: bool, allowed: bool) -> String {
        match resolve_with(Path::new("/d/e/x.vrt"), name, is_relative, allowed) {
            Ok(path) => path,
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn sources_stay_in_the_folder_unless_allowed() {
        assert_eq!(describe("a.tif", true, false), "/d/e/a.tif");
        assert_eq!(describe("f/../a.tif", true, false), "/d/e/f/../a.tif");
        assert_eq!(describe("/d/e/f/a.tif", false, false), "/d/e/f/a.tif");
        for outside in ["../a.tif", "f/../../a.tif", "/etc/passwd", "/d/eve/a.tif"] {
            let refused = describe(outside, true, false);
            assert!(
                refused.contains("outside") && refused.contains("ALLOW_OUTSIDE=1"),
                "{refused}"
            );
        }
        assert!(
            describe("a.tif", false, false).contains("outside"),
            "the current folder is another"
        );
        assert_eq!(describe("../a.tif", true, true), "/d/e/../a.tif");
        assert!(describe("/vsizip/a.zip/a.tif", true, true).contains("GDAL virtual file"));
    }
}
