//! Polygons that points are cut by, from GeoJSON (RFC 7946), in the coordinates of the cloud.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Frame, plane};
use terrane_base::limits;

/// Polygons with holes: inside is where an odd number of rings goes around. Of two polygons that
/// share a border each point on it is in one only, as edges hold their lower end and not their upper
/// one, and points on an edge are right of it. Which side of an edge a point is on is exact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Polygon {
    /// From the lower to the upper end.
    edges: Vec<[[f64; 2]; 2]>,
    /// x low, y low, x high, y high.
    bounds: [f64; 4],
    /// Bands of equal height from the lowest to the highest corner: where the list of each begins.
    starts: Vec<u32>,
    /// The edges that touch each band, band by band.
    lists: Vec<u32>,
}

/// Most bands: lists of long edges stay short against the edges.
const MOST_BANDS: usize = 1024;
/// Most corners.
const MOST_CORNERS: u64 = 1 << 24;

impl Polygon {
    /// Of closed rings; a ring that ends off its start is closed.
    pub fn new(rings: &[Vec<[f64; 2]>]) -> Self {
        let mut edges = Vec::new();
        for ring in rings {
            let next = ring.iter().cycle().skip(1);
            let pairs = ring.iter().zip(next).filter(|(a, b)| a[1] != b[1]);
            edges.extend(pairs.map(|(a, b)| if a[1] < b[1] { [*a, *b] } else { [*b, *a] }));
        }
        Self::of_edges(edges)
    }

    /// The same polygons in steps of a frame: corners on its points are whole numbers.
    pub fn in_steps(&self, frame: &Frame) -> Self {
        let rulers = [frame.ruler(0), frame.ruler(1)];
        let place = |corner: [f64; 2]| [0, 1].map(|axis| rulers[axis].place(corner[axis]));
        let edges = self.edges.iter().map(|edge| edge.map(place));
        Self::of_edges(edges.filter(|[low, high]| low[1] < high[1]).collect())
    }

    fn of_edges(edges: Vec<[[f64; 2]; 2]>) -> Self {
        let bounds = edges.iter().flatten().fold(EMPTY, |[west, south, east, north], [x, y]| {
            [west.min(*x), south.min(*y), east.max(*x), north.max(*y)]
        });
        let mut polygon = Self { edges, bounds, starts: Vec::new(), lists: Vec::new() };
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

    /// The polygons of a GeoJSON file, all of them together.
    ///
    /// # Errors
    /// A file that cannot be read or holds no polygon.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::metadata(path).map_err(|e| Error::read(path, e))?.len();
        limits::check("bytes of a polygon file", bytes, limits::MAX_HEADER_BYTES)
            .map_err(|e| e.in_file(path))?;
        let text = std::fs::read_to_string(path).map_err(|e| Error::read(path, e))?;
        Self::from_geojson(&text).map_err(|e| e.in_file(path))
    }

    /// The polygons of GeoJSON text.
    ///
    /// # Errors
    /// Text that is not GeoJSON, or holds no polygon.
    pub fn from_geojson(text: &str) -> Result<Self> {
        let value: Value = serde_json::from_str(text)
            .map_err(|e| Error::bad_input(format!("is not GeoJSON: {e}")))?;
        let mut rings = Vec::new();
        collect(&value, &mut rings)?;
        let corners = rings.iter().map(|ring| ring.len() as u64).sum();
        limits::check("corners of polygons", corners, MOST_CORNERS)?;
        if rings.is_empty() {
            let remedy = "name a file with a Polygon or MultiPolygon";
            return Err(Error::bad_input("holds no polygon").remedy(remedy));
        }
        Ok(Self::new(&rings))
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
        let edges = list.iter().map(|edge| &self.edges[*edge as usize]);
        edges.filter(|edge| is_left(edge, x, y)).count() % 2 == 1
    }
}

const EMPTY: [f64; 4] = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];

/// Whether an edge holds the height of a place and is left of it, or the place is on it.
fn is_left([low, high]: &[[f64; 2]; 2], x: f64, y: f64) -> bool {
    low[1] <= y && y < high[1] && plane::orient(*low, *high, [x, y]).is_le()
}

/// Gathers the rings of all polygons in a GeoJSON object. The parser bounds its depth.
fn collect(value: &Value, rings: &mut Vec<Vec<[f64; 2]>>) -> Result<()> {
    match value["type"].as_str() {
        Some("FeatureCollection") => collect_all(&value["features"], rings),
        Some("GeometryCollection") => collect_all(&value["geometries"], rings),
        Some("Feature") if value["geometry"].is_null() => Ok(()),
        Some("Feature") => collect(&value["geometry"], rings),
        Some("Polygon") => collect_rings(&value["coordinates"], rings),
        Some("MultiPolygon") => list(&value["coordinates"])?
            .iter()
            .try_for_each(|polygon| collect_rings(polygon, rings)),
        Some("Point" | "MultiPoint" | "LineString" | "MultiLineString") => Ok(()),
        _ => Err(Error::bad_input("is not GeoJSON: an object has no known type")),
    }
}

fn collect_all(values: &Value, rings: &mut Vec<Vec<[f64; 2]>>) -> Result<()> {
    list(values)?.iter().try_for_each(|value| collect(value, rings))
}

fn collect_rings(polygon: &Value, rings: &mut Vec<Vec<[f64; 2]>>) -> Result<()> {
    for ring in list(polygon)? {
        let corners: Option<Vec<_>> = list(ring)?.iter().map(corner).collect();
        rings.push(corners.ok_or_else(|| Error::bad_input("a corner of a polygon is no x, y"))?);
    }
    Ok(())
}

/// Its magnitude is bounded so that areas are finite.
fn corner(value: &Value) -> Option<[f64; 2]> {
    let number = |i: usize| value.get(i)?.as_f64().filter(|v| v.abs() < 1e100);
    Some([number(0)?, number(1)?])
}

fn list(value: &Value) -> Result<&Vec<Value>> {
    value.as_array().ok_or_else(|| Error::bad_input("is not GeoJSON: a list is missing"))
}
