//! Polygons that points are cut by, in the coordinates of the cloud.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use terrane_base::error::Result;
use terrane_base::geom::{Crs, Frame, plane};

/// Polygons with holes, of one feature or several, which are united: inside of one is where an odd number of its rings goes
/// around. Of two polygons that
/// share a border each point on it is in one only, as edges hold their lower end and not their upper
/// one, and points on an edge are right of it. Which side of an edge a point is on is exact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Polygon {
    /// From the lower to the upper end, feature by feature.
    edges: Vec<[[f64; 2]; 2]>,
    /// The feature of each edge.
    features: Vec<u32>,
    /// x low, y low, x high, y high.
    bounds: [f64; 4],
    /// Bands of equal height from the lowest to the highest corner: where the list of each begins.
    starts: Vec<u32>,
    /// The edges that touch each band, band by band.
    lists: Vec<u32>,
    /// The file that they are from, and its reference system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    from: Option<(PathBuf, Crs)>,
}

/// Most bands: lists of long edges stay short against the edges.
const MOST_BANDS: usize = 1024;

impl Polygon {
    /// Bytes that an edge takes.
    pub const EDGE_BYTES: u64 = (size_of::<[[f64; 2]; 2]>() + 3 * size_of::<u32>()) as u64;

    /// Of the closed rings of a feature; a ring that ends off its start is closed.
    pub fn new(rings: &[Vec<[f64; 2]>]) -> Self {
        Self::united(rings.iter().map(|ring| (0, ring.as_slice())))
    }

    /// Of rings of several features, by the numbers of these, which do not fall.
    pub fn united<'a>(rings: impl IntoIterator<Item = (u32, &'a [[f64; 2]])>) -> Self {
        let mut edges = Vec::new();
        for (feature, ring) in rings {
            let next = ring.iter().cycle().skip(1);
            let pairs = ring.iter().zip(next).filter(|(a, b)| a[1] != b[1]);
            let upright = pairs.map(|(a, b)| if a[1] < b[1] { [*a, *b] } else { [*b, *a] });
            edges.extend(upright.map(|edge| (edge, feature)));
        }
        Self::of_edges(edges)
    }

    /// The same polygons in steps of a frame: corners on its points are whole numbers.
    pub fn in_steps(&self, frame: &Frame) -> Self {
        let rulers = [frame.ruler(0), frame.ruler(1)];
        let place = |corner: [f64; 2]| [0, 1].map(|axis| rulers[axis].place(corner[axis]));
        let edges =
            self.edges.iter().map(|edge| edge.map(place)).zip(self.features.iter().copied());
        Self::of_edges(edges.filter(|([low, high], _)| low[1] < high[1]).collect())
    }

    fn of_edges(edges: Vec<([[f64; 2]; 2], u32)>) -> Self {
        let (edges, features): (Vec<_>, Vec<_>) = edges.into_iter().unzip();
        let bounds = edges.iter().flatten().fold(EMPTY, |[west, south, east, north], [x, y]| {
            [west.min(*x), south.min(*y), east.max(*x), north.max(*y)]
        });
        let (starts, lists) = (Vec::new(), Vec::new());
        let mut polygon = Self { edges, features, bounds, starts, lists, from: None };
        polygon.fill_bands();
        polygon
    }

    /// Lists the edges of each band, in O(edges x bands they touch).
    fn fill_bands(&mut self) {
        let bands = self.edges.len().clamp(1, MOST_BANDS);
        let mut lists = vec![Vec::new(); bands];
        for (number, [low, high]) in (0_u32..).zip(&self.edges) {
            let touched = self.band(low[1], bands)..=self.band(high[1], bands);
            lists[touched].iter_mut().for_each(|list| list.push(number));
        }
        self.starts = std::iter::once(0)
            .chain(lists.iter().scan(0, |end, list| {
                *end += list.len() as u32;
                Some(*end)
            }))
            .collect();
        self.lists = lists.concat();
    }

    /// The band of a height within the bounds; it rises with the height.
    fn band(&self, y: f64, bands: usize) -> usize {
        let [_, south, _, north] = self.bounds;
        ((y - south) / (north - south) * bands as f64).min((bands - 1) as f64) as usize
    }

    /// The same from a file, in the reference system that it says.
    pub fn of_file(self, path: &Path, crs: Crs) -> Self {
        Self { from: Some((path.to_path_buf(), crs)), ..self }
    }

    /// Fails where the polygons are in another reference system than a cloud.
    ///
    /// # Errors
    /// Bad input: both systems.
    pub(crate) fn check(&self, cloud: &Crs) -> Result<()> {
        let Some((path, crs)) = &self.from else { return Ok(()) };
        cloud.check_same_of("cloud", crs, "polygons").map_err(|e| e.in_file(path))
    }

    /// The box around it: x low, y low, x high, y high; empty where no ring has an inside.
    pub fn bounds(&self) -> [f64; 4] {
        self.bounds
    }

    /// Whether the place is inside. Time: the edges at its height.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let [west, south, east, north] = self.bounds;
        if !(west <= x && x <= east && south <= y && y <= north) {
            return false;
        }
        let band = self.band(y, self.starts.len() - 1);
        let list = &self.lists[self.starts[band] as usize..self.starts[band + 1] as usize];
        let left = list.iter().filter(|edge| is_left(&self.edges[**edge as usize], x, y));
        // Edges of a feature are beside each other in a list.
        let (mut feature, mut is_odd) = (None, false);
        for edge in left {
            let own = Some(self.features[*edge as usize]);
            if own != feature && is_odd {
                return true;
            }
            is_odd = own != feature || !is_odd;
            feature = own;
        }
        is_odd
    }
}

const EMPTY: [f64; 4] = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];

/// Whether an edge holds the height of a place and is left of it, or the place is on it.
fn is_left([low, high]: &[[f64; 2]; 2], x: f64, y: f64) -> bool {
    low[1] <= y && y < high[1] && plane::orient(*low, *high, [x, y]).is_le()
}
