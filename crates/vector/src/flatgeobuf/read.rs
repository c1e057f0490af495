//! Reader: the header, then features in file order; the spatial index is skipped.

use std::path::Path;

use super::schema::{self, KINDS, MAGIC};
use super::value;
use super::view::FlatbufferTable;
use crate::feature::{Feature, FieldDefinition, LayerHeader};
use crate::geometry::{CoordinateSequence, Geometry, GeometryType};
use crate::pages::{PagedFile, numbers, pairs};
use crate::source::{FeatureSource, VectorOpenOptions};
use crate::tree::levels;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, wkt};
use terrane_base::limits;

/// Size of an index node in bytes.
const NODE_BYTES: u64 = 40;

/// Opens a file.
pub(super) fn open(path: &Path, _: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    let mut pages = PagedFile::open(path)?;
    let head = pages.get(0, 12)?;
    if head[..4] != MAGIC[..4] {
        let message = "is not a FlatGeobuf file of version 3";
        return Err(Error::unsupported(message).remedy("rewrite the file with GDAL 3.1 or later"));
    }
    let bytes = u64::from(u32::from_le_bytes([head[8], head[9], head[10], head[11]]));
    limits::check("header size in bytes", bytes, limits::MAX_HEADER_BYTES)?;
    let header = FlatGeobufHeader::read(FlatbufferTable::root(pages.get(12, bytes)?)?)?;
    let offset = 12 + bytes + header.index_bytes()?;
    if offset > pages.len() {
        return Err(Error::bad_input("file is truncated: it ends inside the spatial index"));
    }
    Ok(Box::new(FlatGeobufSource { pages, header, offset, at: 0, count: 0, has_binary: false }))
}

struct FlatGeobufHeader {
    layer: LayerHeader,
    types: Vec<u8>,
    kind: Option<GeometryType>,
    count: u64,
    node: u64,
}

impl FlatGeobufHeader {
    fn read(view: FlatbufferTable<'_>) -> Result<Self> {
        let mut fields = Vec::new();
        let mut types = Vec::new();
        for column in view.tables(schema::HEADER_COLUMNS)? {
            let (field, code) = column_of(column?)?;
            fields.push(field);
            types.push(code);
            limits::check("number of table fields", fields.len() as u64, limits::MAX_FIELDS)?;
        }
        let envelope = numbers(view.list(schema::HEADER_ENVELOPE, 8)?);
        let extent = envelope.first_chunk().copied();
        let count = view.number(schema::HEADER_COUNT)?.map_or(0, u64::from_le_bytes);
        let node = view.number(schema::HEADER_NODE)?.map_or(16, u16::from_le_bytes);
        let layer = LayerHeader {
            name: view
                .text(schema::HEADER_NAME)?
                .filter(|name| !name.is_empty())
                .map(str::to_owned),
            crs: view.table(schema::HEADER_CRS)?.map_or(Ok(Crs::default()), crs)?,
            schema: Some(fields),
            extent: extent.filter(|b: &[f64; 4]| b[0] <= b[2] && b[1] <= b[3]),
            features: (count > 0).then_some(count),
            ..LayerHeader::default()
        };
        let kind = kind_of(view.u8(schema::HEADER_KIND)?)?;
        Ok(Self { layer, types, kind, count, node: node.into() })
    }

    fn index_bytes(&self) -> Result<u64> {
        if self.node == 0 || self.count == 0 {
            return Ok(0);
        }
        if self.node == 1 {
            return Err(Error::bad_input(
                "node size of the spatial index is 1, expected 2 or more",
            ));
        }
        let most = u64::MAX / NODE_BYTES / 4;
        limits::check("number of features", self.count, most)?;
        Ok(levels(self.count, self.node).iter().sum::<u64>() * NODE_BYTES)
    }
}

fn column_of(view: FlatbufferTable<'_>) -> Result<(FieldDefinition, u8)> {
    let name = view.text(schema::COLUMN_NAME)?;
    let name = name.ok_or_else(|| Error::bad_input("column without a name"))?;
    let code = view.u8(schema::COLUMN_TYPE)?;
    let [width, decimals] =
        [schema::COLUMN_WIDTH, schema::COLUMN_SCALE].map(|slot| view.number(slot));
    // Negative numbers stand for unknown ones.
    let [width, decimals] = [width?, decimals?]
        .map(|number| number.and_then(|n| u32::try_from(i32::from_le_bytes(n)).ok()));
    Ok((FieldDefinition { name: name.into(), kind: value::kind_of(code)?, width, decimals }, code))
}

fn crs(view: FlatbufferTable<'_>) -> Result<Crs> {
    let code = view.number(schema::CRS_CODE)?.map_or(0, i32::from_le_bytes);
    let org = view.text(schema::CRS_ORG)?.unwrap_or("EPSG");
    if code > 0 && org.eq_ignore_ascii_case("EPSG") {
        return Ok(wkt::of_srs(&format!("EPSG:{code}")));
    }
    Ok(match (view.text(schema::CRS_WKT)?, view.text(schema::CRS_NAME)?) {
        (Some(text), _) if !text.is_empty() => wkt::of_srs(text),
        (_, name) => Crs { citation: name.map(str::to_owned), ..Crs::default() },
    })
}

/// Geometry type of a code; `None` for 0.
fn kind_of(code: u8) -> Result<Option<GeometryType>> {
    match KINDS.iter().find(|(known, _)| *known == code) {
        Some((_, kind)) => Ok(Some(*kind)),
        None if code == 0 => Ok(None),
        None => Err(Error::unsupported(format!("geometry type {code} is not supported")).remedy(
            "convert curves and surfaces to lines and polygons: ogr2ogr -nlt CONVERT_TO_LINEAR",
        )),
    }
}

struct FlatGeobufSource {
    pages: PagedFile,
    header: FlatGeobufHeader,
    /// Offset of the next feature.
    offset: u64,
    /// Offset of the last feature.
    at: u64,
    count: u64,
    has_binary: bool,
}

impl FeatureSource for FlatGeobufSource {
    fn next(&mut self) -> Result<Option<Feature>> {
        self.at = self.offset;
        if self.offset == self.pages.len() {
            let (count, claimed) = (self.count, self.header.count);
            if claimed > count {
                let message = format!("file is truncated: {count} features of {claimed}");
                return Err(Error::bad_input(message).remedy("copy it again"));
            }
            return Ok(None);
        }
        let size = self.pages.get(self.offset, 4)?;
        let size = u64::from(u32::from_le_bytes([size[0], size[1], size[2], size[3]]));
        let bytes = self.pages.get(self.offset + 4, size)?;
        let view = FlatbufferTable::root(bytes)?;
        let mut budget = bytes.len();
        let geometry = match view.table(schema::FEATURE_GEOMETRY)? {
            Some(table) => geometry(table, self.header.kind, 0, &mut budget)?,
            None => Geometry::null(),
        };
        let layer = &self.header.layer;
        let (mut fields, mut types) =
            (layer.schema.as_deref().unwrap_or_default(), &self.header.types);
        // A feature may have its own columns.
        let mut own = (Vec::new(), Vec::new());
        for column in view.tables(schema::FEATURE_COLUMNS)? {
            let (field, code) = column_of(column?)?;
            own.0.push(field);
            own.1.push(code);
        }
        if !own.0.is_empty() {
            (fields, types) = (&own.0, &own.1);
        }
        let bytes = view.list(schema::FEATURE_PROPERTIES, 1)?;
        let (properties, has_binary) = value::properties(bytes, fields, types)?;
        self.has_binary |= has_binary;
        self.offset += 4 + size;
        self.count += 1;
        Ok(Some(Feature { properties, geometry, ..Feature::default() }))
    }

    fn layer(&self) -> &LayerHeader {
        &self.header.layer
    }

    fn location(&self) -> String {
        format!("byte {}", self.at)
    }

    fn notes(&self) -> Vec<String> {
        let note = "values of type Binary omitted".to_owned();
        self.has_binary.then_some(note).into_iter().collect()
    }
}

/// A geometry inside `depth` nested collections, limited to the allowed depth. Tables may be shared, so a
/// small feature could expand to a huge one: `budget` is the number of bytes of the feature left, each of
/// which may be used once.
fn geometry(
    view: FlatbufferTable<'_>,
    known: Option<GeometryType>,
    depth: u64,
    budget: &mut usize,
) -> Result<Geometry> {
    limits::check("depth of a geometry collection", depth, limits::MAX_COLLECTION_DEPTH)?;
    let own = kind_of(view.u8(schema::GEOMETRY_KIND)?)?;
    let Some(kind) = own.or(known) else { return Ok(Geometry::null()) };
    // A MultiPolygon with one polygon may store it without a table of parts.
    let is_flat = kind == GeometryType::MultiPolygon
        && !view.list(schema::GEOMETRY_XY, 8)?.is_empty()
        && view.tables(schema::GEOMETRY_PARTS)?.next().is_none();
    if matches!(kind, GeometryType::Collection | GeometryType::MultiPolygon) && !is_flat {
        let part = (kind == GeometryType::MultiPolygon).then_some(GeometryType::Polygon);
        let mut parts = Vec::new();
        for table in view.tables(schema::GEOMETRY_PARTS)? {
            spend(budget, 8)?;
            let count = parts.len() as u64;
            limits::check(
                "number of members of a geometry collection",
                count,
                limits::MAX_COLLECTION_MEMBERS,
            )?;
            parts.push(geometry(table?, part, depth + 1, budget)?);
        }
        return match kind {
            GeometryType::Collection => Geometry::collection(parts),
            _ => joined(&parts),
        };
    }
    let xy = view.list(schema::GEOMETRY_XY, 8)?;
    let (z, m) = (view.list(schema::GEOMETRY_Z, 8)?, view.list(schema::GEOMETRY_M, 8)?);
    let ends = view.list(schema::GEOMETRY_ENDS, 4)?;
    spend(budget, xy.len() + z.len() + m.len() + ends.len())?;
    let wrong =
        || Error::bad_input("lengths of the coordinate arrays of a geometry are inconsistent");
    let mut found = CoordinateSequence {
        xy: pairs(xy),
        z: numbers(z),
        m: numbers(m),
        ..CoordinateSequence::default()
    };
    let count = found.xy.len();
    let fits = |values: &[f64]| values.is_empty() || values.len() == count;
    if !fits(&found.z) || !fits(&found.m) || xy.len() % 16 != 0 {
        return Err(wrong());
    }
    if matches!(
        kind,
        GeometryType::Polygon | GeometryType::MultiPolygon | GeometryType::MultiLineString
    ) {
        let mut last = 0;
        for end in ends.as_chunks().0 {
            let end = u32::from_le_bytes(*end) as usize;
            if end < last || end > count {
                return Err(wrong());
            }
            if end > last {
                found.ends.push(end);
            }
            last = end;
        }
        if !ends.is_empty() && last != count {
            return Err(wrong());
        }
    }
    // In a layer with heights every vertex has a value, NaN if there is no height.
    for values in [&mut found.z, &mut found.m] {
        if values.iter().all(|value| value.is_nan()) {
            values.clear();
        }
    }
    // GDAL writes an empty point as NaN.
    if kind == GeometryType::Point
        && found.xy.first().is_some_and(|xy| xy.iter().all(|c| c.is_nan()))
    {
        found = CoordinateSequence::default();
    }
    Geometry::new(kind, found)
}

fn spend(budget: &mut usize, bytes: usize) -> Result<()> {
    *budget = budget.checked_sub(bytes).ok_or_else(|| {
        Error::bad_input("geometry parts with shared coordinates are not supported")
    })?;
    Ok(())
}

/// Polygons joined into one geometry.
fn joined(parts: &[Geometry]) -> Result<Geometry> {
    let has_z = parts.iter().any(Geometry::has_z);
    let has_m = parts.iter().any(Geometry::has_m);
    let mut found = CoordinateSequence::default();
    for part in parts {
        if part.kind() != GeometryType::Polygon {
            return Err(Error::bad_input("part of a MultiPolygon is not a Polygon"));
        }
        let from = part.coordinates();
        let first = found.xy.len();
        found.xy.extend_from_slice(&from.xy);
        let there = |values: &[f64], at: usize| values.get(at).copied().unwrap_or(f64::NAN);
        for at in 0..from.xy.len() {
            if has_z {
                found.z.push(there(&from.z, at));
            }
            if has_m {
                found.m.push(there(&from.m, at));
            }
        }
        found.ends.extend(from.ends.iter().map(|end| first + end));
        found.end_polygon();
    }
    Geometry::new(GeometryType::MultiPolygon, found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flatgeobuf::build::{FlatbufferBuilder, FlatbufferField};

    /// Collections within one another, each with ten members that are one and the same table.
    fn shared(levels: usize) -> Vec<u8> {
        let mut build = FlatbufferBuilder::new();
        let collection = |build: &mut FlatbufferBuilder| {
            let none = || FlatbufferField::None;
            let slots = [
                none(),
                none(),
                none(),
                none(),
                none(),
                none(),
                FlatbufferField::U8(7),
                FlatbufferField::Link,
            ];
            build.table(&slots)
        };
        let (table, mut places) = collection(&mut build);
        build.set_root(table);
        for _ in 0..levels {
            let links = build.links(places[schema::GEOMETRY_PARTS], 10);
            let (table, inner) = collection(&mut build);
            links.into_iter().for_each(|link| build.link(link, table));
            places = inner;
        }
        build.links(places[schema::GEOMETRY_PARTS], 0);
        build.finish().unwrap()
    }

    #[test]
    fn shared_parts_and_deep_ones_are_refused() {
        let read = |bytes: &[u8]| {
            geometry(FlatbufferTable::root(&bytes[4..]).unwrap(), None, 0, &mut (bytes.len() - 4))
        };
        assert_eq!(read(&shared(1)).unwrap().members().len(), 10);
        assert!(read(&shared(9)).unwrap_err().to_string().contains("share"));
        assert!(read(&shared(40)).unwrap_err().to_string().contains("depth"));
    }
}
