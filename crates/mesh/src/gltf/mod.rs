//! Binary glTF 2.0: one mesh, Y up, positions in f32 relative to an origin kept in `asset.extras`; as it is,
//! or compressed without loss (EXT_meshopt_compression).

mod meshopt;
mod packed;
mod packer;
mod read;
mod write;

use std::path::Path;

use crate::{Carries, MeshFormat, MeshSource};
use terrane_base::error::Result;
use terrane_base::geom::Point3;

pub(super) const FORMAT: MeshFormat = MeshFormat {
    name: "GLB",
    extensions: &["glb"],
    about: "binary glTF 2.0, f32 relative to an origin in asset.extras, Y up",
    single_precision: true,
    carries: Carries::Colours,
    can_be_solid: false,
    states_unit: false,
    names_crs: true,
    admits: |_| Ok(()),
    most: write::most,
    create: |path, header, options| write::create(path, header, options, Packing::None),
    open,
    sniff,
};

/// The same numbers in some 36 % of the bytes. Triangles may begin with another of their corners.
pub(super) const PACKED: MeshFormat = MeshFormat {
    name: "GLB-meshopt",
    extensions: &["meshopt.glb"],
    about: "the same, compressed without loss (EXT_meshopt_compression)",
    create: |path, header, options| write::create(path, header, options, Packing::Meshopt),
    ..FORMAT
};

/// How vertices and triangles lie in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    None,
    Meshopt,
}

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BIN_CHUNK: &[u8; 4] = b"BIN\0";
/// Component types and modes of glTF that occur here.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const TRIANGLES: u32 = 4;
const POINTS: u32 = 0;

fn open(path: &Path) -> Result<Box<dyn MeshSource>> {
    Ok(Box::new(read::GlbSource::open(path)?))
}

fn sniff(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// World axes (x east, y north, z up) to those of glTF (x east, y up, z south).
fn to_y_up([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, z, 0.0 - y]
}

/// From the axes of glTF to those of the world.
fn to_z_up([x, y, z]: [f64; 3]) -> Point3 {
    [x, -z, y]
}
