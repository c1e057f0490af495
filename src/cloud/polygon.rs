//! Polygons that points are cut by, from GeoJSON (RFC 7946), in the coordinates of the cloud.

use std::path::Path;

use serde_json::Value;

use crate::error::{Error, Result};
use crate::limits;

/// Polygons with holes: inside is where an odd number of rings goes around. Of two polygons that
/// share a border each point on it is in one only, as edges hold their lower end and not their upper
/// one, and points on an edge count as right of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    /// From the lower to the upper end.
    edges: Vec<[[f64; 2]; 2]>,
}

impl Polygon {
    /// Of closed rings; a ring that ends off its start is closed.
    pub fn new(rings: &[Vec<[f64; 2]>]) -> Self {
        let mut edges = Vec::new();
        for ring in rings {
            let next = ring.iter().cycle().skip(1);
            let pairs = ring.iter().zip(next).filter(|(a, b)| a[1] != b[1]);
            edges.extend(pairs.map(|(a, b)| if a[1] < b[1] { [*a, *b] } else { [*b, *a] }));
        }
        Self { edges }
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
        if rings.is_empty() {
            let remedy = "name a file with a Polygon or MultiPolygon";
            return Err(Error::bad_input("holds no polygon").remedy(remedy));
        }
        Ok(Self::new(&rings))
    }

    /// The box around it: x low, y low, x high, y high; empty where no ring has an inside.
    pub fn bounds(&self) -> [f64; 4] {
        let empty = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        self.edges.iter().flatten().fold(empty, |[west, south, east, north], [x, y]| {
            [west.min(*x), south.min(*y), east.max(*x), north.max(*y)]
        })
    }

    /// Whether the place is inside.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let crossed = self.edges.iter().filter(|[low, high]| {
            low[1] <= y && y < high[1] && {
                let across = (high[0] - low[0]) * (y - low[1]) - (x - low[0]) * (high[1] - low[1]);
                across >= 0.0
            }
        });
        crossed.count() % 2 == 1
    }
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

fn corner(value: &Value) -> Option<[f64; 2]> {
    Some([value.get(0)?.as_f64()?, value.get(1)?.as_f64()?])
}

fn list(value: &Value) -> Result<&Vec<Value>> {
    value.as_array().ok_or_else(|| Error::bad_input("is not GeoJSON: a list is missing"))
}
