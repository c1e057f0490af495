//! Mesh files: one file per format (sink and reader side by side), and the registry that names them.

use std::path::Path;

use crate::error::Result;
use crate::geom::{Crs, Point3};

/// What a sink is told before the first batch.
#[derive(Clone, Debug)]
pub struct MeshHeader {
    /// Coordinate reference system of the source.
    pub crs: Crs,
    /// Origin for formats that cannot hold f64 coordinates: they store `position - origin` in f32
    /// and record the origin. z of the origin is always 0, so f32 heights stay exact.
    pub origin: Point3,
    /// World bounding box of everything that can come: (min, max), x and y from the grid;
    /// z may be NaN when unknown.
    pub bounds: [Point3; 2],
    /// Free text lines for the file's comments ("max error 1.5 metre", "source a.tif").
    pub comments: Vec<String>,
}

/// A run of a mesh. Vertex ids count from 0 in the order vertices are pushed; a triangle may refer
/// to vertices of this or earlier batches only. Triangles are counter-clockwise seen from above in
/// world coordinates.
#[derive(Clone, Copy, Debug)]
pub struct MeshBatch<'a> {
    /// New vertices.
    pub vertices: &'a [Point3],
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
    /// True for formats that store triangles by position (STL).
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
    /// For STL every triangle has three vertices of its own (`3 * triangle + corner`).
    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()>;

    /// Reads triangles `first .. first + out.len()` as vertex ids, in file order.
    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()>;
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
    /// True when positions are stored in f32 (x and y carry rounding of the order of 1e-7 of the
    /// extent).
    pub single_precision: bool,
    /// True when vertices have an identity of their own (PLY, OBJ, GLB), false for STL.
    pub indexed: bool,
    /// The `crs` comment, where the file has one.
    pub crs: Option<String>,
    /// Free facts for `terrane info`.
    pub details: Vec<(String, String)>,
}

/// Options of a sink, from the command line (`--co KEY=VAL`) and the job.
#[derive(Clone, Debug, Default)]
pub struct SinkOptions {
    /// Replace an existing file.
    pub overwrite: bool,
    /// STL: close the surface with walls and a flat bottom at this height.
    pub solid_base: Option<f64>,
    /// Directory for spools; the output's own directory when `None`.
    pub temp_dir: Option<std::path::PathBuf>,
}

/// One mesh format: an entry of [`FORMATS`].
pub struct MeshFormat {
    /// Short name for `--format` and messages ("PLY").
    pub name: &'static str,
    /// File name endings, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// True when z is stored as f32 (heights are then rounded before the error is bounded).
    pub single_precision: bool,
    /// Most vertices and triangles the format can hold.
    pub most: fn() -> MeshCapacity,
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

/// Placeholder until the mesh registry is in place.
pub fn open(path: &Path) -> Result<Box<dyn MeshSource>> {
    Err(crate::Error::unsupported("no mesh format is known").in_file(path))
}
