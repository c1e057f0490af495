//! Readers of mesh files, and the metadata of a mesh file.

use crate::promises::{Promises, is_mark, line};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;

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

impl MeshInfo {
    /// Shared vertices in double precision, as they are stored, and nothing else known.
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

    /// With comments among the details, and with what they state of the CRS and of channels, unless they contradict
    /// each other.
    pub(super) fn with_comments(mut self, comments: impl IntoIterator<Item = String>) -> Self {
        self.details.extend(comments.into_iter().map(|text| ("comment".to_owned(), text)));
        let promises = self.promises().unwrap_or_default();
        self.details.extend(facts(&self.channels, &promises));
        self.crs = self.crs.or(promises.crs);
        self
    }

    /// True when the file bears this program's mark: its name and version, or in STL the recorded
    /// origin.
    pub fn is_own(&self) -> bool {
        let keys = ["comment", "generator", "title"];
        self.details.iter().any(|(key, text)| keys.contains(&key.as_str()) && is_mark(text))
    }

    /// What the file states: its comments, its reference system, and details under the name of a key.
    ///
    /// # Errors
    /// Those of [`Promises::parse`].
    pub fn promises(&self) -> Result<Promises> {
        let details = self.details.iter().filter_map(|(name, value)| match name.as_str() {
            "comment" => Some(value.clone()),
            name => Promises::KEYS.contains(&name).then(|| line(name, value)),
        });
        Promises::parse(self.crs.iter().map(|crs| line("crs", crs)).chain(details))
    }
}

/// What a mesh of several bands states, fact by fact: `info` tells the last comment of a file only.
const STATED: [&str; 4] = ["max error", "bands", "weights", "heights"];

/// The channels of a mesh and what it states of them, as facts.
fn facts(names: &[String], promises: &Promises) -> Vec<(String, String)> {
    if names.is_empty() {
        return Vec::new();
    }
    let stated = promises.statements().filter(|(key, _)| STATED.contains(key));
    let channels = std::iter::once(("channels", names.join(", ")));
    channels.chain(stated).map(|(key, text)| (key.to_owned(), text)).collect()
}
