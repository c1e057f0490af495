//! The registry of mesh formats, and format detection.

use std::path::Path;

use crate::format::MeshFormat;
use crate::source::{MeshInfo, MeshSource};
use crate::{dxf, gltf, input, landxml, obj, ply, stl, threemf};
use terrane_base::error::{Error, Result};
use terrane_base::registry::offered;
use terrane_files::format;

/// All mesh formats. A new one is a file in this folder and a line here. If several extensions match, the first
/// format counts.
pub const FORMATS: &[MeshFormat] = &[
    ply::FORMAT,
    obj::FORMAT,
    stl::FORMAT,
    threemf::FORMAT,
    gltf::PACKED,
    gltf::FORMAT,
    landxml::FORMAT,
    dxf::FORMAT,
];

/// The format called `name`, or the format of the extension of `path` (ignoring letter case). Unknown names and
/// extensions are usage errors that list the known ones.
pub fn by_path(path: &Path, name: Option<&str>) -> Result<&'static MeshFormat> {
    format::by_path(FORMATS, path, name)
}

/// Format of an existing file: by its first bytes, else by its extension. `None` if it is not a mesh.
pub fn identify(path: &Path) -> Result<Option<&'static MeshFormat>> {
    let head = input::MeshFile::open(path)?.head(SNIFF_BYTES)?;
    Ok(FORMATS
        .iter()
        .find(|format| (format.sniff)(&head))
        .or_else(|| format::by_extension(FORMATS, path)))
}

/// Opens a mesh file of any known format.
pub(super) fn open_file(path: &Path) -> Result<Box<dyn MeshSource>> {
    let format = identify(path)?.ok_or_else(|| {
        Error::bad_input("unknown mesh format")
            .in_file(path)
            .remedy(format!("known formats are {}", offered(FORMATS, |f| f.name.to_owned())))
    })?;
    (format.open)(path)
}

/// Bytes of a file passed to [`MeshFormat::sniff`].
const SNIFF_BYTES: usize = 512;

impl MeshInfo {
    /// True if the format can store the name of the CRS and all statements.
    pub fn names_crs(&self) -> bool {
        FORMATS.iter().all(|format| format.name != self.format || format.names_crs)
    }
}
