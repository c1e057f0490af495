//! Binary glTF 2.0: one mesh, Y up, positions in f32 relative to an origin in `asset.extras`; plain or with lossless
//! compression (EXT_meshopt_compression).

mod layout;
mod meshopt;
mod packed;
mod packer;
mod read;
mod write;

use std::path::Path;

use self::layout::{GltfCompression, MAGIC, NAME, PACKED_NAME};
use crate::channels::VertexCapabilities;
use crate::format::MeshFormat;
use crate::source::MeshSource;
use terrane_base::error::Result;

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: NAME,
    extensions: &["glb"],
    about: "binary glTF 2.0, f32 relative to an origin in asset.extras, Y up",
    single_precision: true,
    carries: VertexCapabilities::Colours,
    can_be_solid: false,
    states_unit: false,
    names_crs: true,
    admits: |_| Ok(()),
    capacity: || write::CAPACITY,
    create: |path, header, options| write::create(path, header, options, GltfCompression::None),
    open,
    sniff,
};

/// The same values in some 36 % of the bytes. The first corner of triangles may change.
pub(super) const PACKED: MeshFormat = MeshFormat {
    name: PACKED_NAME,
    extensions: &["meshopt.glb"],
    about: "GLB with lossless compression (EXT_meshopt_compression)",
    create: |path, header, options| write::create(path, header, options, GltfCompression::Meshopt),
    ..FORMAT
};

fn open(path: &Path) -> Result<Box<dyn MeshSource>> {
    Ok(Box::new(read::GlbSource::open(path)?))
}

fn sniff(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}
