//! Mesh files: one file per format (sink and reader side by side), and the registry that names them.

mod capacity;
mod channels;
mod dxf;
mod gltf;
mod input;
mod landxml;
mod local;
mod obj;
mod obj_index;
mod ply;
mod ply_header;
mod promises;
mod sidecar;
mod sink;
mod solid;
pub mod split;
mod stl;
mod text;
mod threemf;
mod xml;

use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point3};
use terrane_base::registry::{Named, offered};
use terrane_files::format::{self, Format};

pub use channels::{Carries, Channel, ChannelKind, is_colour};
pub use promises::{FittedHeights, HeightBand, MaxError, Promises};
pub use sidecar::{check_prj, prj_path, write_prj};
pub use text::plain;

/// Every mesh format. A new one is a file in this folder and a line here. Of two whose endings fit, the first
/// is meant.
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

/// The format called `name`, or else the one that `path`'s extension stands for (letter case does
/// not matter). Unknown names and extensions are usage errors that list the known ones.
pub fn by_path(path: &Path, name: Option<&str>) -> Result<&'static MeshFormat> {
    format::by_path(FORMATS, path, name)
}

/// The format of an existing file: by its first bytes, or else by its extension. `None` when it
/// is no mesh.
pub fn identify(path: &Path) -> Result<Option<&'static MeshFormat>> {
    let head = input::Input::open(path)?.head(SNIFF_BYTES)?;
    Ok(FORMATS
        .iter()
        .find(|format| (format.sniff)(&head))
        .or_else(|| format::by_extension(FORMATS, path)))
}

/// Opens a mesh file of any known format, or a folder of meshes that are one.
pub fn open(path: &Path) -> Result<Box<dyn MeshSource>> {
    if path.is_dir() { split::open(path) } else { open_file(path) }
}

/// Opens a mesh file of any known format.
fn open_file(path: &Path) -> Result<Box<dyn MeshSource>> {
    let format = identify(path)?.ok_or_else(|| {
        Error::bad_input("not a mesh of a known format")
            .in_file(path)
            .remedy(format!("known formats are {}", offered(FORMATS, |f| f.name.to_owned())))
    })?;
    (format.open)(path)
}

/// Bytes of a file that [`MeshFormat::sniff`] gets to see.
const SNIFF_BYTES: usize = 512;

impl Named for MeshFormat {
    const KIND: &'static str = "mesh format";

    fn name(&self) -> &'static str {
        self.name
    }

    fn aliases(&self) -> &'static [&'static str] {
        self.extensions
    }
}

impl Format for MeshFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }
}

/// What a sink is told before the first batch.
#[derive(Clone, Debug)]
pub struct MeshHeader {
    /// Coordinate reference system of the source.
    pub crs: Crs,
    /// Origin for formats that cannot hold f64 coordinates: they store `position - origin` in f32
    /// and record the origin. Heights that are f32 stay exact when z of the origin is 0; otherwise
    /// it is near the heights, so that they lose little.
    pub origin: Point3,
    /// Stored units in one unit of x, y and z, for these formats: they store
    /// `(position - origin) * scale`, and record the scale where it is not 1.
    pub scale: Point3,
    /// The stored unit, "metre" or "millimetre", where it is not that of the coordinates.
    pub unit: Option<String>,
    /// World bounding box of everything that can come: (min, max), x and y from the grid;
    /// z may be NaN when unknown.
    pub bounds: [Point3; 2],
    /// What the file's comments state.
    pub promises: Promises,
    /// What vertices have beside their positions.
    pub channels: Vec<Channel>,
}

/// A run of a mesh. Vertex ids count from 0 in the order vertices are pushed; a triangle may refer
/// to vertices of this or earlier batches only. Triangles are counter-clockwise seen from above in
/// world coordinates.
#[derive(Clone, Copy, Debug)]
pub struct MeshBatch<'a> {
    /// New vertices.
    pub vertices: &'a [Point3],
    /// The values of the header's channels, vertex by vertex.
    pub values: &'a [f64],
    /// Triangles, as vertex ids.
    pub triangles: &'a [[u64; 3]],
    /// World positions of the triangles' corners, aligned with `triangles`; empty unless
    /// [`MeshSink::wants_corners`].
    pub corners: &'a [[Point3; 3]],
}

/// Receives a mesh batch by batch, never holding it in memory, and writes it whole or not at all:
/// the file appears under its final name in [`finish`](MeshSink::finish); dropping the sink
/// before that leaves nothing.
pub trait MeshSink: Send {
    /// True for formats that store triangles by position (STL, DXF), and for solids.
    fn wants_corners(&self) -> bool {
        false
    }

    /// Appends a batch.
    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()>;

    /// Completes the file, puts it at its final name, and returns its size in bytes.
    fn finish(self: Box<Self>) -> Result<u64>;
}

/// Reads a mesh file out of core (with `pread`, never mapped).
pub trait MeshSource: Send + Sync {
    /// What the mesh is.
    fn info(&self) -> &MeshInfo;

    /// Reads vertices `first .. first + out.len()` in world coordinates (origin added back).
    /// For STL and DXF every triangle has three vertices of its own (`3 * triangle + corner`).
    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()>;

    /// Reads triangles `first .. first + out.len()` as vertex ids, in file order.
    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()>;

    /// Reads the channels of vertices from `first` on, vertex by vertex: as many values as there are channels,
    /// for each of `out.len()` / channels vertices.
    fn read_channels(&self, first: u64, _out: &mut [f64]) -> Result<()> {
        Err(Error::usage(format!("vertex {first} has no channels")))
    }

    /// The least and the greatest coordinates of vertices, in world coordinates, where the file states them.
    fn stated_bounds(&self) -> Option<[Point3; 2]> {
        None
    }
}

/// What a mesh file says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshInfo {
    /// Vertices stored.
    pub vertices: u64,
    /// Triangles stored.
    pub triangles: u64,
    /// Short format name of the registry.
    pub format: &'static str,
    /// The origin that has been added back to every position read.
    pub origin: Point3,
    /// What positions were divided by before the origin was added: stored units in one unit of x, y
    /// and z.
    pub scale: Point3,
    /// True when positions are stored in f32 (x and y carry rounding of the order of 1e-7 of the
    /// extent).
    pub single_precision: bool,
    /// True when vertices have an identity of their own, false for STL and DXF.
    pub indexed: bool,
    /// True when the surface is closed with walls and a flat bottom.
    pub solid: bool,
    /// The `crs` comment, where the file has one.
    pub crs: Option<String>,
    /// Where else the file names its reference system: codes ("EPSG:32632") and well-known text.
    pub systems: Vec<String>,
    /// What vertices have beside their positions, by name: the three or four of a colour, or bands.
    pub channels: Vec<String>,
    /// Free facts for `terrane info`.
    pub details: Vec<(String, String)>,
}

/// Options of a sink, from the command line (`--co KEY=VAL`) and the job.
#[derive(Clone, Debug, Default)]
pub struct SinkOptions {
    /// Replace an existing file.
    pub overwrite: bool,
    /// For formats that [can be solids](MeshFormat::can_be_solid): close the surface with walls and a flat bottom at this height.
    pub solid_base: Option<f64>,
    /// Directory for spools; the output's own directory when `None`.
    pub temp_dir: Option<std::path::PathBuf>,
}

/// One mesh format: an entry of [`FORMATS`].
#[derive(Debug)]
pub struct MeshFormat {
    /// Short name for `--format` and messages ("PLY").
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// True when z is stored as f32 (heights are then rounded before the error is bounded).
    pub single_precision: bool,
    /// True when the surface can be closed with walls and a bottom: it is a format of printers, and a print is
    /// stored in millimetres.
    pub can_be_solid: bool,
    /// True when the file always says which length its unit is.
    pub states_unit: bool,
    /// True when the file has room for the name of its reference system.
    pub names_crs: bool,
    /// Fails where the format cannot say what the coordinates of a system are.
    pub admits: fn(&Crs) -> Result<()>,
    /// Most vertices and triangles the format can hold.
    pub most: fn() -> MeshCapacity,
    /// What vertices can have beside their positions.
    pub carries: Carries,
    /// Starts a file.
    pub create: fn(&Path, &MeshHeader, &SinkOptions) -> Result<Box<dyn MeshSink>>,
    /// Opens a file for reading.
    pub open: fn(&Path) -> Result<Box<dyn MeshSource>>,
    /// True when the first bytes (up to 512) of a file are this format's.
    pub sniff: fn(&[u8]) -> bool,
}

/// What a format can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshCapacity {
    /// Most vertices.
    pub vertices: u64,
    /// Most triangles.
    pub triangles: u64,
    /// Most bytes of file, with the bytes taken by each vertex and triangle.
    pub bytes: u64,
    /// Bytes of one vertex.
    pub vertex_bytes: u64,
    /// Bytes of one triangle.
    pub triangle_bytes: u64,
}
