//! Readers of mesh files, and the metadata of a mesh file.

use crate::promises::{Promises, is_mark, line};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;

/// Reads a mesh file out of core (with `pread`, without memory mapping).
pub trait MeshSource: Send + Sync {
    /// Metadata.
    fn info(&self) -> &MeshInfo;

    /// Reads vertices `first .. first + out.len()` in world coordinates (origin added back).
    /// For STL and DXF every triangle has three vertices of its own (`3 * triangle + corner`).
    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()>;

    /// Reads triangles `first .. first + out.len()` as vertex ids, in file order.
    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()>;

    /// Reads the channels of `out.len()`
    /// channels vertices from `first`, vertex by vertex.
    fn read_channels(&self, first: u64, _out: &mut [f64]) -> Result<()> {
        Err(Error::usage(format!("vertex {first} has no channels")))
    }

    /// Stated minimum and maximum of vertices, in world coordinates, if any.
    fn stated_bounds(&self) -> Option<[Point3; 2]> {
        None
    }
}

/// Metadata of a mesh file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshInfo {
    /// Number of vertices.
    pub vertices: u64,
    /// Number of triangles.
    pub triangles: u64,
    /// Short format name of the registry.
    pub format: &'static str,
    /// Origin that is added to every stored position.
    pub origin: Point3,
    /// Scale by which stored positions are divided before the origin is added: stored units per unit of x, y and z.
    pub scale: Point3,
    /// True when positions are stored in f32 (x and y carry rounding of the order of 1e-7 of the
    /// extent).
    pub single_precision: bool,
    /// True if triangles share vertices; false for STL and DXF.
    pub indexed: bool,
    /// True when the surface is closed with walls and a flat bottom.
    pub solid: bool,
    /// The `crs` comment, if any.
    pub crs: Option<String>,
    /// Other CRS definitions of the file: codes ("EPSG:32632") and WKT.
    pub systems: Vec<String>,
    /// Names of vertex channels: the three or four of a colour, or bands.
    pub channels: Vec<String>,
    /// Further facts for `terrane info`.
    pub details: Vec<(String, String)>,
}

impl MeshInfo {
    /// Metadata of an indexed mesh in double precision without further facts.
    pub fn plain(format: &'static str, vertices: u64, triangles: u64) -> Self {
        Self {
            vertices,
            triangles,
            format,
            origin: [0.0; 3],
            scale: [1.0; 3],
            single_precision: false,
            indexed: true,
            solid: false,
            crs: None,
            systems: Vec::new(),
            channels: Vec::new(),
            details: Vec::new(),
        }
    }

    /// Adds comments to the details, and their statements on the CRS and channels unless they are contradictory.
    pub(super) fn with_comments(mut self, comments: impl IntoIterator<Item = String>) -> Self {
        self.details.extend(comments.into_iter().map(|text| ("comment".to_owned(), text)));
        let promises = self.promises().unwrap_or_default();
        self.details.extend(facts(&self.channels, &promises));
        self.crs = self.crs.or(promises.crs);
        self
    }

    /// True if the file was written by this program: its name and version, or the recorded origin in STL.
    pub fn is_own(&self) -> bool {
        let keys = ["comment", "generator", "title"];
        self.details.iter().any(|(key, text)| keys.contains(&key.as_str()) && is_mark(text))
    }

    /// The statements of the file: comments, CRS, and details.
    ///
    /// # Errors
    /// Errors of [`Promises::parse`].
    pub fn promises(&self) -> Result<Promises> {
        let details = self.details.iter().filter_map(|(name, value)| match name.as_str() {
            "comment" => Some(value.clone()),
            name => Promises::KEYS.contains(&name).then(|| line(name, value)),
        });
        Promises::parse(self.crs.iter().map(|crs| line("crs", crs)).chain(details))
    }
}

/// Statements of meshes of several bands to list as facts: `info` shows only the last comment of a file.
const STATED: [&str; 4] = ["max error", "bands", "weights", "heights"];

/// Channels of a mesh and the statements on them, as facts.
fn facts(names: &[String], promises: &Promises) -> Vec<(String, String)> {
    if names.is_empty() {
        return Vec::new();
    }
    let stated = promises.statements().filter(|(key, _)| STATED.contains(key));
    let channels = std::iter::once(("channels", names.join(", ")));
    channels.chain(stated).map(|(key, text)| (key.to_owned(), text)).collect()
}
