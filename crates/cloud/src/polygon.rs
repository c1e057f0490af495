//! Polygons that clip points, in the coordinates of the cloud.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::ser::Error as _;
use serde::{Deserialize, Serialize, Serializer};

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, PointFrame, plane};
use terrane_files::is_made;

/// The union of polygons with holes, of one feature or several. A point is inside a feature if an odd number of its
/// rings surrounds it. A point on a border of two adjacent polygons is in exactly one of them: edges contain their
/// lower end but not their upper one, and points on an edge are right of it. The side of an edge is exact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterPolygon {
    /// Edges from the lower to the upper end, feature by feature.
    edges: Vec<[[f64; 2]; 2]>,
    /// The feature of each edge.
    features: Vec<u32>,
    /// x low, y low, x high, y high.
    bounds: [f64; 4],
    /// Horizontal bands of equal height from the lowest to the highest corner: start of the list of each band.
    starts: Vec<u32>,
    /// The edges that touch each band, band by band.
    lists: Vec<u32>,
    /// Source file and its CRS.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "wherever")]
    from: Option<(PathBuf, Crs)>,
}

/// Serialises the absolute path of a file.
fn wherever<S: Serializer>(
    from: &Option<(PathBuf, Crs)>,
    out: S,
) -> std::result::Result<S::Ok, S::Error> {
    let Some((path, crs)) = from else { return None::<(PathBuf, Crs)>.serialize(out) };
    let path = match is_made(&path.to_string_lossy()) {
        true => path.clone(),
        false => std::path::absolute(path).map_err(S::Error::custom)?,
    };
    Some((path, crs)).serialize(out)
}

/// Maximum number of bands. Fewer are used where long edges would be in many lists: an edge is in at most two lists
/// on average.
const MAX_BANDS: usize = 1024;
/// Maximum number of edges: indices in lists have 32 bits.
const MAX_EDGES: usize = (1 << 31) - 1;

/// Rings of polygons.
#[derive(Clone, Debug, Default)]
pub struct PolygonRings {
    edges: Vec<[[f64; 2]; 2]>,
    features: Vec<u32>,
    /// Number of features.
    begun: u32,
}

impl PolygonRings {
    /// Maximum bytes of an edge in polygons, in their own coordinates and in steps of a frame: the edge, its feature,
    /// two list entries, and the start of a list.
    pub const EDGE_BYTES: u64 = 2 * (size_of::<[[f64; 2]; 2]>() + 4 * size_of::<u32>()) as u64;

    /// Begins a feature; the following rings are its outer rings and holes.
    ///
    /// # Errors
    /// More than 2^32 features.
    pub fn begin_feature(&mut self) -> Result<()> {
        self.begun = self
            .begun
            .checked_add(1)
            .ok_or_else(|| Error::limit("number of polygons", "above 2^32", u32::MAX))?;
        Ok(())
    }

    /// Adds a ring to the last feature; open rings are closed.
    ///
    /// # Errors
    /// 2^31 edges or more.
    pub fn push(&mut self, ring: &[[f64; 2]]) -> Result<()> {
        let next = ring.iter().cycle().skip(1);
        // Level edges hold no height, as the upper end of an edge is left out: they never count.
        let pairs = ring.iter().zip(next).filter(|(a, b)| a[1] != b[1]);
        self.edges.extend(pairs.map(|(a, b)| if a[1] < b[1] { [*a, *b] } else { [*b, *a] }));
        if self.edges.len() > MAX_EDGES {
            return Err(Error::limit("number of polygon edges", "2^31 or more", MAX_EDGES)
                .remedy("simplify them with ‹terrane simplify›"));
        }
        self.features.resize(self.edges.len(), self.begun.saturating_sub(1));
        Ok(())
    }
}

impl FilterPolygon {
    /// From rings.
    pub fn new(rings: PolygonRings) -> Self {
        Self::of_edges(rings.edges, rings.features)
    }

    /// The same polygons in steps of a frame, in which the corners on its points are integers.
    pub fn in_steps(&self, frame: &PointFrame) -> Self {
        let rulers = [frame.ruler(0), frame.ruler(1)];
        let (mut edges, mut features) =
            (Vec::with_capacity(self.edges.len()), Vec::with_capacity(self.edges.len()));
        for (edge, feature) in self.edges.iter().zip(&self.features) {
            let [low, high] =
                edge.map(|corner| [0, 1].map(|axis| rulers[axis].place(corner[axis])));
            if low[1] < high[1] {
                edges.push([low, high]);
                features.push(*feature);
            }
        }
        Self::of_edges(edges, features)
    }

    fn of_edges(mut edges: Vec<[[f64; 2]; 2]>, mut features: Vec<u32>) -> Self {
        edges.shrink_to_fit();
        features.shrink_to_fit();
        let bounds = edges.iter().flatten().fold(EMPTY, |[west, south, east, north], [x, y]| {
            [west.min(*x), south.min(*y), east.max(*x), north.max(*y)]
        });
        let (starts, lists) = (Vec::new(), Vec::new());
        let mut polygon = Self { edges, features, bounds, starts, lists, from: None };
        polygon.fill_bands();
        polygon
    }

    /// Bytes held, in their own coordinates and in steps of a frame.
    pub fn bytes(&self) -> u64 {
        let places = self.features.len() + self.starts.len() + self.lists.len();
        2 * (size_of_val(&self.edges[..]) + places * size_of::<u32>()) as u64
    }

    /// The source file.
    pub fn path(&self) -> Option<&Path> {
        self.from.as_ref().map(|(path, _)| path.as_path())
    }

    /// Lists the edges of each band.
    fn fill_bands(&mut self) {
        let most = 2 * self.edges.len();
        let mut bands = self.edges.len().clamp(1, MAX_BANDS);
        while bands > 1
            && self.edges.iter().map(|edge| self.touched(edge, bands).len()).sum::<usize>() > most
        {
            bands /= 2;
        }
        let mut starts = vec![0; bands + 1];
        for edge in &self.edges {
            self.touched(edge, bands).for_each(|band| starts[band + 1] += 1);
        }
        (0..bands).for_each(|band| starts[band + 1] += starts[band]);
        let (mut ends, mut lists) = (starts.clone(), vec![0; starts[bands] as usize]);
        for (number, edge) in (0..).zip(&self.edges) {
            for band in self.touched(edge, bands) {
                lists[ends[band] as usize] = number;
                ends[band] += 1;
            }
        }
        (self.starts, self.lists) = (starts, lists);
    }

    /// Bands of an edge.
    fn touched(&self, [low, high]: &[[f64; 2]; 2], bands: usize) -> Range<usize> {
        self.band(low[1], bands)..self.band(high[1], bands) + 1
    }

    /// Band of a y coordinate within the bounds; monotone.
    fn band(&self, y: f64, bands: usize) -> usize {
        let [_, south, _, north] = self.bounds;
        ((y - south) / (north - south) * bands as f64).min((bands - 1) as f64) as usize
    }

    /// Attaches the source file and its CRS.
    pub fn of_file(self, path: &Path, crs: Crs) -> Self {
        Self { from: Some((path.to_path_buf(), crs)), ..self }
    }

    /// Fails if the polygons have another CRS than a cloud.
    ///
    /// # Errors
    /// Bad input: both CRSs.
    pub(crate) fn check(&self, cloud: &Crs) -> Result<()> {
        let Some((path, crs)) = &self.from else { return Ok(()) };
        cloud.check_same_of("cloud", crs, "polygons").map_err(|e| e.in_file(path))
    }

    /// Bounds: x min, y min, x max, y max; empty if no ring has an interior.
    pub fn bounds(&self) -> [f64; 4] {
        self.bounds
    }

    /// Whether a position is inside. Time linear in the edges of its band.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        self.around(x, y).next().is_some()
    }

    /// The number of the last feature that a position is inside of.
    pub fn last_around(&self, x: f64, y: f64) -> Option<u32> {
        self.around(x, y).last()
    }

    /// The features that a position is inside of, in order.
    fn around(&self, x: f64, y: f64) -> impl Iterator<Item = u32> + '_ {
        let [west, south, east, north] = self.bounds;
        let list = match west <= x && x <= east && south <= y && y <= north {
            true => {
                let band = self.band(y, self.starts.len() - 1);
                &self.lists[self.starts[band] as usize..self.starts[band + 1] as usize]
            }
            false => &[],
        };
        let feature = |edge: &u32| self.features[*edge as usize];
        // Edges of a feature are consecutive in a list.
        let by_feature = list.chunk_by(move |a, b| feature(a) == feature(b));
        by_feature.filter_map(move |edges| {
            let left = edges.iter().filter(|edge| is_left(&self.edges[**edge as usize], x, y));
            (left.count() % 2 == 1).then(|| feature(&edges[0]))
        })
    }
}

const EMPTY: [f64; 4] = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];

/// Whether an edge spans the y coordinate of a position and is left of it, or the position is on it.
fn is_left([low, high]: &[[f64; 2]; 2], x: f64, y: f64) -> bool {
    low[1] <= y && y < high[1] && plane::orient(*low, *high, [x, y]).is_le()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The twin of `last_around` that looks at all edges of a feature.
    fn is_inside(polygon: &FilterPolygon, x: f64, y: f64) -> Option<u32> {
        let features = polygon.features.last().map_or(0..0, |last| 0..last + 1);
        let crossed = |feature: u32| {
            let edges = polygon.edges.iter().zip(&polygon.features);
            edges.filter(|(edge, own)| **own == feature && is_left(edge, x, y)).count()
        };
        features.rev().find(|feature| crossed(*feature) % 2 == 1)
    }

    /// A comb with so many teeth as high as all of it, and a coast of so many short edges on one of its sides.
    fn comb(west: f64, teeth: u32, coast: u32) -> Vec<[f64; 2]> {
        let tooth = |i: u32| {
            let x = west + f64::from(i);
            [[x, 1000.0 - f64::from(i % 7)], [x + 0.5, f64::from(i % 3)]]
        };
        let far = west - 5.0;
        let along =
            |i: u32| [far + f64::from(i * i % 5), 1000.0 * f64::from(i) / f64::from(coast.max(1))];
        (0..teeth).flat_map(tooth).chain((0..coast).map(along)).collect()
    }

    #[test]
    fn lists_of_long_edges_are_bounded_and_tell_what_all_edges_tell() {
        for (teeth, coast) in [(2000, 0), (2000, 2000), (20, 4000), (1, 1), (0, 900)] {
            let rings = [comb(0.0, teeth, coast), comb(40.25, teeth, coast)];
            let mut all = PolygonRings::default();
            for ring in &rings {
                all.begin_feature().unwrap();
                all.push(ring).unwrap();
            }
            let polygon = FilterPolygon::new(all);
            let edges = polygon.edges.len();
            assert!(polygon.lists.len() <= 2 * edges, "{} of {edges}", polygon.lists.len());
            assert!(polygon.bytes() <= (edges as u64 + 1) * PolygonRings::EDGE_BYTES);
            let step = if teeth > 1000 { 9 } else { 3 };
            for (x, y) in (-20..=220).step_by(step).flat_map(|x| (0..64).map(move |y| (x, y))) {
                let (x, y) = (f64::from(x) / 4.0, 1000.0 * f64::from(y) / 63.0);
                let expected = is_inside(&polygon, x, y);
                assert_eq!(polygon.last_around(x, y), expected, "{teeth} {x} {y}");
                assert_eq!(polygon.contains(x, y), expected.is_some());
            }
        }
    }
}
