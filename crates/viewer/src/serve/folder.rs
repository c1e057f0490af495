//! Files to serve: the page, and files of the folder, found by names of [`request`](crate::serve::request).

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use terrane_base::error::{Error, Result};

/// The served page or folder.
#[derive(Clone, Debug)]
pub struct ServedSite {
    /// The HTML file at `/`.
    pub page: PathBuf,
    /// The folder whose files the page requests.
    pub folder: Option<PathBuf>,
}

/// Media types by file extension. Other files are not served.
const KINDS: &[(&str, &str)] = &[
    ("json", "application/json"),
    ("terrain", "application/vnd.quantized-mesh"),
    ("glb", "model/gltf-binary"),
    ("subtree", "application/octet-stream"),
];
const PAGE: &str = "text/html; charset=utf-8";
/// First bytes of a gzip file.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The page and the folder, as canonical paths.
#[derive(Debug)]
pub(crate) struct ServedFolder {
    page: PathBuf,
    root: Option<PathBuf>,
}

/// A file to send.
#[derive(Debug)]
pub(crate) struct ServedFile {
    pub(crate) file: File,
    pub(crate) size: u64,
    pub(crate) kind: &'static str,
    pub(crate) is_gzip: bool,
    pub(crate) is_page: bool,
    /// Entity tag from size and time of change.
    pub(crate) tag: String,
}

impl ServedFolder {
    pub(crate) fn open(site: &ServedSite) -> Result<Self> {
        let root = site.folder.as_deref().map(canonical).transpose()?;
        Ok(Self { page: canonical(&site.page)?, root })
    }

    /// The file of a name; `None` when there is none, or it lies elsewhere.
    pub(crate) fn find(&self, name: &[String]) -> Option<ServedFile> {
        if name.is_empty() {
            return ServedFile::open(&self.page, PAGE, true).ok();
        }
        let ending = name.last()?.rsplit_once('.')?.1;
        let (_, kind) = KINDS.iter().find(|(known, _)| *known == ending)?;
        let root = self.root.as_ref()?;
        // Resolves links part by part, so that no step leaves the folder.
        let path = name.iter().try_fold(root.clone(), |path, part| {
            path.join(part).canonicalize().ok().filter(|path| path.starts_with(root))
        })?;
        ServedFile::open(&path, kind, false).ok()
    }
}

fn canonical(path: &Path) -> Result<PathBuf> {
    path.canonicalize().map_err(|e| Error::read(path, e))
}

impl ServedFile {
    fn open(path: &Path, kind: &'static str, is_page: bool) -> io::Result<Self> {
        // Opening a pipe would block.
        if !std::fs::metadata(path)?.is_file() {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        let mut file = File::open(path)?;
        let about = file.metadata()?;
        let mut start = Vec::new();
        (&mut file).take(GZIP.len() as u64).read_to_end(&mut start)?;
        file.seek(SeekFrom::Start(0))?;
        let changed = about.modified()?.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let (size, is_gzip) = (about.len(), start == GZIP);
        Ok(Self { file, size, kind, is_gzip, is_page, tag: format!("\"{size:x}-{changed:x}\"") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        text.split('/').map(str::to_owned).collect()
    }

    #[test]
    fn files_of_the_folder_are_found_and_no_others() {
        let place = tempfile::tempdir().unwrap();
        let write =
            |name: &str, bytes: &[u8]| std::fs::write(place.path().join(name), bytes).unwrap();
        std::fs::create_dir_all(place.path().join("set/1/x.json")).unwrap();
        write("page.html", b"<!DOCTYPE html>");
        write("secret.json", b"{}");
        write("set/layer.json", b"{}");
        write("set/mine.txt", b"mine");
        write("set/1/0.terrain", &[0x1f, 0x8b, 8]);
        let (page, folder) = (place.path().join("page.html"), place.path().join("set"));
        let folder = ServedFolder::open(&ServedSite { page, folder: Some(folder) }).unwrap();
        assert!(folder.find(&[]).unwrap().is_page);
        let tile = folder.find(&names("1/0.terrain")).unwrap();
        assert!(tile.is_gzip && !tile.is_page && tile.size == 3);
        assert!(!folder.find(&names("layer.json")).unwrap().is_gzip);
        for other in ["mine.txt", "1/x.json", "1", "0.terrain", "../secret.json", "page.html"] {
            assert!(folder.find(&names(other)).is_none(), "{other}");
        }
        #[cfg(unix)]
        {
            let link = |to: &str, name: &str| {
                std::os::unix::fs::symlink(place.path().join(to), place.path().join(name)).unwrap();
            };
            link("secret.json", "set/out.json");
            link(".", "set/up");
            link("set/layer.json", "set/in.json");
            assert!(folder.find(&names("out.json")).is_none());
            assert!(folder.find(&names("up/secret.json")).is_none());
            assert!(folder.find(&names("in.json")).is_some(), "it stays inside");
        }
    }
}
