//! Meshes in files.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json};
use terrane_base::Result;
use terrane_mesh as mesh;
use terrane_raster::Inputs;

use super::Data;

/// A triangle mesh in a file, or in a folder of pieces. Nothing is held in memory.
#[derive(Clone, Debug)]
pub struct Mesh {
    path: PathBuf,
}

/// Opens a mesh: PLY, OBJ, STL, glTF (GLB) or a folder of pieces, written by terrane or by other programs. A
/// mesh in memory is a [`Tin`](crate::Tin).
///
/// # Errors
/// A missing file, a damaged header, or an unknown format.
///
/// ```
/// # fn main() -> terrane::Result<()> {
/// use terrane::prelude::*;
/// # let folder = tempfile::tempdir().unwrap();
/// # let [path, picture, page] = ["mesh.ply", "mesh.png", "mesh.html"].map(|name| folder.path().join(name));
/// let dem = terrane::open("synth:rough,size=129,seed=7")?;
/// let made = dem.tin().max_error(5.0).write(&path)?;
/// let mesh = terrane::open_mesh(&path)?;
/// let known = mesh.inspect().quality(true).run()?;
/// assert_eq!(known.triangles, made.triangles);
/// assert!(known.quality.unwrap().delaunay_share.unwrap() > 0.99);
/// mesh.picture().width(200).edges(true).write(&picture)?;
/// let page = mesh.page().against("synth:rough,size=129,seed=7").write(&page)?;
/// assert!(page.max_error.unwrap() <= 5.0);
/// # Ok(())
/// # }
/// ```
pub fn open_mesh(path: impl AsRef<Path>) -> Result<Mesh> {
    let path = path.as_ref().to_path_buf();
    mesh::open(&path)?;
    Ok(Mesh { path })
}

impl Data for Mesh {
    fn inputs(&self) -> Inputs {
        Inputs::from(self.path.clone())
    }

    fn reading(&self) -> Map<String, Json> {
        Map::new()
    }
}
