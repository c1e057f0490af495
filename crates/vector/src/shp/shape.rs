//! Decoding and encoding of shape records.

use crate::geometry::{CoordinateSequence, Geometry, GeometryType, PartRole};
use crate::pages::RecordBytes;
use crate::rings;
use crate::tree::{Bounds, NOTHING};
use terrane_base::error::{Error, Result};

/// Measures below this value mean "no data".
pub(super) const NO_MEASURE: f64 = -1e38;

/// Shape types without Z and M variants, by their codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShapeType {
    Point = 1,
    Line = 3,
    Polygon = 5,
    MultiPoint = 8,
}

/// The type of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ShapefileType {
    pub(super) base: ShapeType,
    pub(super) has_z: bool,
    pub(super) has_m: bool,
}

impl ShapefileType {
    /// The type of a code; `None` for the null shape.
    pub(super) fn of_code(code: u32) -> Result<Option<Self>> {
        let base = match code % 10 {
            0 if code == 0 => return Ok(None),
            1 if code != 31 => ShapeType::Point,
            3 => ShapeType::Line,
            5 => ShapeType::Polygon,
            8 => ShapeType::MultiPoint,
            _ => return Err(unknown(code)),
        };
        match code / 10 {
            0 => Ok(Some(Self { base, has_z: false, has_m: false })),
            // Shapes with heights may have measures, depending on the record length.
            1 => Ok(Some(Self { base, has_z: true, has_m: true })),
            2 => Ok(Some(Self { base, has_z: false, has_m: true })),
            _ => Err(unknown(code)),
        }
    }

    /// The code of the type.
    pub(super) fn code(self) -> u32 {
        let level = if self.has_z {
            10
        } else if self.has_m {
            20
        } else {
            0
        };
        self.base as u32 + level
    }

    /// The shape type for a geometry type; `None` for null, an error for collections.
    pub(super) fn base_of(kind: GeometryType) -> Result<Option<ShapeType>> {
        match kind {
            GeometryType::Null => Ok(None),
            GeometryType::Point => Ok(Some(ShapeType::Point)),
            GeometryType::MultiPoint => Ok(Some(ShapeType::MultiPoint)),
            GeometryType::LineString | GeometryType::MultiLineString => Ok(Some(ShapeType::Line)),
            GeometryType::Polygon | GeometryType::MultiPolygon => Ok(Some(ShapeType::Polygon)),
            GeometryType::Collection => {
                Err(Error::usage("Shapefile does not support geometry collections")
                    .remedy("write GeoJSON or FlatGeobuf"))
            }
        }
    }
}

fn unknown(code: u32) -> Error {
    let what = if code == 31 { " (MultiPatch)" } else { "" };
    Error::unsupported(format!("shape type {code}{what} is not supported"))
}

/// Decodes the content of a record. O(bytes), except for polygons of many rings, see [`rings::group`].
pub(super) fn decode(record: &[u8]) -> Result<Geometry> {
    let mut bytes = RecordBytes(record);
    let Some(kind) = ShapefileType::of_code(bytes.u32()?)? else { return Ok(Geometry::null()) };
    match kind.base {
        ShapeType::Point => point(kind, bytes),
        ShapeType::MultiPoint => {
            bytes.take(32)?;
            let count = bytes.u32()? as usize;
            Geometry::new(GeometryType::MultiPoint, positions(kind, &mut bytes, count)?)
        }
        ShapeType::Line | ShapeType::Polygon => {
            bytes.take(32)?;
            let (parts, count) = (bytes.u32()? as usize, bytes.u32()? as usize);
            let starts = bytes.take(parts.saturating_mul(4))?;
            let mut coordinates = positions(kind, &mut bytes, count)?;
            coordinates.ends = ends(starts, count)?;
            match kind.base {
                ShapeType::Line if coordinates.ends.len() <= 1 => {
                    Geometry::new(GeometryType::LineString, coordinates)
                }
                ShapeType::Line => Geometry::new(GeometryType::MultiLineString, coordinates),
                // Rings are closed before they are compared.
                _ => rings::group(
                    Geometry::new(GeometryType::Polygon, coordinates)?.into_coordinates(),
                ),
            }
        }
    }
}

fn point(kind: ShapefileType, mut bytes: RecordBytes<'_>) -> Result<Geometry> {
    let mut found = CoordinateSequence { xy: bytes.pairs(1)?, ..CoordinateSequence::default() };
    if kind.has_z {
        found.z = bytes.numbers(1)?;
    }
    if kind.has_m && bytes.0.len() >= 8 {
        found.m = measures(bytes.numbers(1)?);
    }
    check_heights(&found.z)?;
    Geometry::new(GeometryType::Point, found)
}

/// `count` positions with their heights and measures, which follow the positions.
fn positions(
    kind: ShapefileType,
    bytes: &mut RecordBytes<'_>,
    count: usize,
) -> Result<CoordinateSequence> {
    let mut found = CoordinateSequence { xy: bytes.pairs(count)?, ..CoordinateSequence::default() };
    if kind.has_z {
        bytes.take(16)?;
        found.z = bytes.numbers(count)?;
        check_heights(&found.z)?;
    }
    // Measures are optional.
    if kind.has_m && !bytes.0.is_empty() {
        bytes.take(16)?;
        found.m = measures(bytes.numbers(count)?);
    }
    Ok(found)
}

fn check_heights(z: &[f64]) -> Result<()> {
    match z.iter().position(|z| !z.is_finite()) {
        None => Ok(()),
        Some(at) => Err(Error::bad_input(format!("vertex {at}: height is not finite"))
            .remedy("correct the vertex, or remove it or the feature")),
    }
}

/// Measures with NaN for missing ones; empty if all are missing.
fn measures(mut m: Vec<f64>) -> Vec<f64> {
    m.iter_mut().filter(|m| **m < NO_MEASURE).for_each(|m| *m = f64::NAN);
    if m.iter().all(|m| m.is_nan()) { Vec::new() } else { m }
}

/// Ends of parts from their starts; empty parts are dropped.
fn ends(starts: &[u8], count: usize) -> Result<Vec<usize>> {
    let starts = starts.as_chunks().0.iter().map(|four| u32::from_le_bytes(*four) as usize);
    let first = starts.clone().next();
    let mut ends: Vec<usize> = starts.skip(1).chain(first.map(|_| count)).collect();
    let rises = ends.iter().try_fold(0, |last, &end| (last <= end && end <= count).then_some(end));
    if rises.is_none() || first.unwrap_or(0) != 0 || (first.is_none() && count > 0) {
        let message = format!("part offsets do not match the {count} vertices");
        return Err(Error::bad_input(message).remedy("repair the file, or remove the feature"));
    }
    ends.dedup();
    if ends.first() == Some(&0) {
        ends.remove(0);
    }
    Ok(ends)
}

/// Appends `geometry` as a shape of type `kind`. Outer rings are written clockwise, holes counterclockwise.
/// An empty geometry is a null shape.
pub(super) fn encode(geometry: &Geometry, kind: ShapefileType, out: &mut Vec<u8>) -> Result<()> {
    let coordinates = geometry.coordinates();
    if coordinates.xy.is_empty() {
        out.extend_from_slice(&0_u32.to_le_bytes());
        return Ok(());
    }
    if !coordinates.z.is_empty() && coordinates.z.iter().any(|z| z.is_nan()) {
        let message = "some vertices lack a height";
        return Err(Error::usage(message).remedy("write GeoJSON or FlatGeobuf"));
    }
    let turned = turned(geometry);
    let CoordinateSequence { xy, z, m, ends, .. } = turned.as_ref().unwrap_or(coordinates);
    out.extend_from_slice(&kind.code().to_le_bytes());
    if kind.base != ShapeType::Point {
        put(&geometry.bounds().unwrap_or(NOTHING), out);
        if kind.base != ShapeType::MultiPoint {
            out.extend_from_slice(&count(ends.len())?.to_le_bytes());
        }
        out.extend_from_slice(&count(xy.len())?.to_le_bytes());
        if kind.base != ShapeType::MultiPoint {
            for start in std::iter::once(&0).chain(&ends[..ends.len() - 1]) {
                out.extend_from_slice(&count(*start)?.to_le_bytes());
            }
        }
    }
    put(xy.as_flattened(), out);
    let with_range = kind.base != ShapeType::Point;
    if kind.has_z {
        put_values(z, xy.len(), 0.0, with_range, out);
    }
    if kind.has_m {
        put_values(m, xy.len(), NO_MEASURE * 10.0, with_range, out);
    }
    Ok(())
}

pub(super) fn too_large() -> Error {
    Error::new(
        terrane_base::error::ErrorKind::CannotWrite,
        "output exceeds the 4 GiB limit of Shapefile",
    )
    .remedy("write FlatGeobuf or GeoJSON")
}

fn put(values: &[f64], out: &mut Vec<u8>) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

/// Appends the range of `values` and the values; `none` replaces missing ones.
fn put_values(values: &[f64], count: usize, none: f64, with_range: bool, out: &mut Vec<u8>) {
    if with_range {
        let (low, high) = range(values).unwrap_or((none, none));
        put(&[low, high], out);
    }
    match values.is_empty() {
        true => (0..count).for_each(|_| put(&[none], out)),
        false => values.iter().for_each(|v| put(&[if v.is_nan() { none } else { *v }], out)),
    }
}

/// A count as stored: signed, in 32 bits.
fn count(n: usize) -> Result<u32> {
    i32::try_from(n).map(i32::cast_unsigned).map_err(|_| too_large())
}

/// The lowest and the highest value.
pub(super) fn range(values: &[f64]) -> Option<(f64, f64)> {
    let there = values.iter().filter(|value| !value.is_nan());
    there.fold(None, |range, &v| {
        let (low, high) = range.unwrap_or((v, v));
        Some((f64::min(low, v), f64::max(high, v)))
    })
}

/// The coordinates with rings oriented as shapefiles require; `None` if they already are.
fn turned(geometry: &Geometry) -> Option<CoordinateSequence> {
    let wrong = geometry.parts().map(|part| match part.role {
        PartRole::Line => false,
        PartRole::Outer => rings::area(part.xy) > 0.0,
        PartRole::Hole => rings::area(part.xy) < 0.0,
    });
    let wrong: Vec<bool> = wrong.collect();
    if !wrong.contains(&true) {
        return None;
    }
    let from = geometry.coordinates();
    let mut to = CoordinateSequence::default();
    let mut start = 0;
    for (&end, is_wrong) in from.ends.iter().zip(wrong) {
        match is_wrong {
            true => to.extend(from, (start..end).rev()),
            false => to.extend(from, start..end),
        }
        to.end_part();
        start = end;
    }
    Some(to)
}

/// The bounding box of `all` and `geometry`.
pub(super) fn union(all: Bounds, geometry: &Geometry) -> Bounds {
    geometry.bounds().map_or(all, |own| crate::tree::around(&all, &own))
}
