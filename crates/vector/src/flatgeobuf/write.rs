//! Writer: features are buffered until all columns and bounding boxes are known; then the header, the index
//! and the features are written in index order.

use std::path::{Path, PathBuf};

use super::build::{FlatbufferBuilder, FlatbufferField};
use super::schema::{self, KINDS, MAGIC};
use super::value;
use crate::crs;
use crate::feature::{Feature, FieldKind, JsonMember, LayerHeader};
use crate::geometry::{CoordinateSequence, Geometry, GeometryType};
use crate::out::VectorOutputFile;
use crate::sink::{FeatureSink, VectorWriteOptions, WrittenFeatures};
use crate::table::{FeatureColumn, FeatureRow, FeatureRows, FeatureTable};
use crate::tree::{Bounds, NODE, NOTHING, PackedRTree, around, hilbert_order};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Crs;

/// Starts a file.
pub(super) fn create(
    path: &Path,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    Ok(Box::new(FlatGeobufSink {
        out: VectorOutputFile::create(path, options.overwrite)?,
        table: FeatureTable::new(path, layer, options.temp_dir.as_deref())?,
        name: layer.name.clone().unwrap_or_else(|| stem(path)),
        crs: layer.crs.clone(),
        bounds: Vec::new(),
        shape: GeometryTally::default(),
        is_indexed: options.index,
        path: path.to_path_buf(),
    }))
}

struct FlatGeobufSink {
    out: VectorOutputFile,
    table: FeatureTable,
    name: String,
    crs: Crs,
    /// Bounding box of each feature.
    bounds: Vec<Bounds>,
    shape: GeometryTally,
    is_indexed: bool,
    path: PathBuf,
}

impl FeatureSink for FlatGeobufSink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        let geometry = &feature.geometry;
        self.shape.add(geometry);
        self.bounds.push(geometry.bounds().unwrap_or(NOTHING));
        let number = self.table.len() + 1;
        let pushed = self.table.push(feature, u32::MAX as usize);
        pushed.map_err(|e| e.at(format!("feature {number}")).in_file(&self.path))
    }

    fn finish(self: Box<Self>, _: &[JsonMember]) -> Result<WrittenFeatures> {
        let this = *self;
        let mut rows = this.table.finish()?;
        if u32::try_from(rows.len()).is_err() || rows.columns.len() > usize::from(u16::MAX) {
            let message = "number of features or properties exceeds the limits of FlatGeobuf";
            return Err(too_large(&this.path, message));
        }
        let form = this.shape.form();
        rows.notes.extend(this.shape.notes());
        let extent = this.bounds.iter().fold(NOTHING, |all, one| around(&all, one));
        let is_indexed = this.is_indexed && !this.bounds.is_empty();
        let order = match is_indexed {
            true => hilbert_order(&this.bounds, &extent),
            false => (0..rows.len() as u32).collect(),
        };
        let head = FlatGeobufHead {
            name: &this.name,
            extent: (extent[0] <= extent[2]).then_some(extent),
            form,
            columns: &rows.columns,
            count: rows.len() as u64,
            is_indexed,
            crs: &this.crs,
        };
        let header = head
            .bytes()
            .ok_or_else(|| too_large(&this.path, "header exceeds the limits of FlatGeobuf"))?;
        let mut out = this.out;
        let kinds: Vec<FieldKind> =
            rows.columns.iter().map(|column| column.kind.unwrap_or(FieldKind::Text)).collect();
        // Feature offsets precede the features: each feature is encoded twice to get its length, which needs
        // less memory than keeping them all.
        let encoder = RowEncoder { path: &this.path, kinds: &kinds, form };
        out.buffer.extend_from_slice(&MAGIC);
        out.buffer.extend_from_slice(&header);
        if is_indexed {
            let mut place = 0;
            let mut places = Vec::with_capacity(order.len());
            for &row in &order {
                places.push(place);
                place += encoder.encode(&mut rows, row)?.len() as u64;
            }
            let bounds: Vec<Bounds> = order.iter().map(|&row| this.bounds[row as usize]).collect();
            for (bounds, to, is_leaf) in PackedRTree::new(&bounds).nodes() {
                let to = if is_leaf { places[to] } else { to as u64 };
                out.buffer.extend(bounds.iter().flat_map(|bound| bound.to_le_bytes()));
                out.buffer.extend_from_slice(&to.to_le_bytes());
                out.settle()?;
            }
        }
        for &row in &order {
            let bytes = encoder.encode(&mut rows, row)?;
            out.buffer.extend_from_slice(&bytes);
            out.settle()?;
        }
        let (path, bytes) = out.commit()?;
        let features = order.len() as u64;
        let notes = [crs::notes(&this.crs), std::mem::take(&mut rows.notes)].concat();
        Ok(WrittenFeatures { features, bytes, files: vec![path], notes })
    }
}

fn too_large(path: &Path, message: &str) -> Error {
    Error::new(ErrorKind::CannotWrite, message)
        .in_file(path)
        .remedy("write GeoJSON, or split the output")
}

/// Encodes the rows of a table as features.
struct RowEncoder<'a> {
    path: &'a Path,
    kinds: &'a [FieldKind],
    form: FlatGeobufGeometryType,
}

impl RowEncoder<'_> {
    fn encode(&self, rows: &mut FeatureRows, row: u32) -> Result<Vec<u8>> {
        let bytes = feature(&rows.get(row as usize)?, self.kinds, self.form);
        bytes.ok_or_else(|| {
            too_large(self.path, "feature exceeds 4 GiB").at(format!("feature {}", row + 1))
        })
    }
}

/// File name without its extension.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Common geometry type of a layer, as declared in the header; programs rely on the header rather than on
/// each feature.
#[derive(Clone, Copy)]
struct FlatGeobufGeometryType {
    /// Null if there are several types.
    kind: GeometryType,
    has_z: bool,
    has_m: bool,
}

/// Statistics of the geometries of a layer.
#[derive(Default)]
struct GeometryTally {
    /// Number of features by geometry type, in the order of [`GeometryType::ALL`].
    kinds: [u64; GeometryType::ALL.len()],
    /// Number of features with vertices, of those with heights, and of those with measures.
    placed: u64,
    with_z: u64,
    with_m: u64,
}

impl GeometryTally {
    fn add(&mut self, geometry: &Geometry) {
        let at = GeometryType::ALL.iter().position(|kind| *kind == geometry.kind());
        self.kinds[at.unwrap_or_default()] += 1;
        self.placed += u64::from(!geometry.is_empty());
        self.with_z += u64::from(geometry.has_z());
        self.with_m += u64::from(geometry.has_m());
    }

    fn count(&self, kind: GeometryType) -> u64 {
        GeometryType::ALL
            .iter()
            .zip(self.kinds)
            .find(|(known, _)| **known == kind)
            .map_or(0, |(_, n)| n)
    }

    /// The geometry type to declare. Null geometries match any type. With heights or measures, mixed single
    /// and multi geometries are declared as multi, because few programs open layers of unknown type with
    /// heights.
    fn form(&self) -> FlatGeobufGeometryType {
        let (has_z, has_m) = (self.with_z > 0, self.with_m > 0);
        let present: Vec<GeometryType> = GeometryType::ALL
            .into_iter()
            .filter(|&k| k != GeometryType::Null && self.count(k) > 0)
            .collect();
        let mut kind = present.first().copied().unwrap_or_default();
        if has_z || has_m {
            kind = present.iter().copied().find(|k| several(*k) == *k).unwrap_or(kind);
        }
        let is_uniform =
            present.iter().all(|&k| k == kind || ((has_z || has_m) && several(k) == kind));
        FlatGeobufGeometryType {
            kind: if is_uniform { kind } else { GeometryType::Null },
            has_z,
            has_m,
        }
    }

    /// Notes on geometries that are changed.
    fn notes(&self) -> Vec<String> {
        let form = self.form();
        let mut notes = Vec::new();
        let has_more = if form.has_z { "heights" } else { "measures" };
        for (there, with, what) in
            [(form.has_z, self.with_z, "heights"), (form.has_m, self.with_m, "measures")]
        {
            if there && with < self.placed {
                let count = self.placed - with;
                notes.push(format!("{count} features without {what} are written with NaN"));
            }
        }
        let single = [GeometryType::Point, GeometryType::LineString, GeometryType::Polygon];
        for kind in single.into_iter().filter(|k| several(*k) == form.kind && self.count(*k) > 0) {
            let (count, name, more) = (self.count(kind), kind.name(), form.kind.name());
            notes.push(format!(
                "{count} {name} features are written as {more}: a layer with {has_more} has one geometry type"
            ));
        }
        let kinds = self
            .kinds
            .iter()
            .zip(GeometryType::ALL)
            .filter(|(n, k)| **n > 0 && *k != GeometryType::Null);
        if form.kind == GeometryType::Null && (form.has_z || form.has_m) && kinds.count() > 1 {
            notes.push(format!(
                "mixed geometry types in a layer with {has_more}: some programs cannot open it; write one file per type"
            ));
        }
        notes
    }
}

/// The multi type of a single type; other types are returned unchanged.
fn several(kind: GeometryType) -> GeometryType {
    match kind {
        GeometryType::Point => GeometryType::MultiPoint,
        GeometryType::LineString => GeometryType::MultiLineString,
        GeometryType::Polygon => GeometryType::MultiPolygon,
        other => other,
    }
}

fn code_of(kind: GeometryType) -> u8 {
    KINDS.iter().find(|(_, known)| *known == kind).map_or(0, |(code, _)| *code)
}

/// Content of the header.
struct FlatGeobufHead<'a> {
    name: &'a str,
    extent: Option<Bounds>,
    form: FlatGeobufGeometryType,
    columns: &'a [FeatureColumn],
    count: u64,
    is_indexed: bool,
    crs: &'a Crs,
}

impl FlatGeobufHead<'_> {
    fn bytes(&self) -> Option<Vec<u8>> {
        let mut build = FlatbufferBuilder::new();
        let has_crs = self.crs.is_named();
        let link =
            |is_there: bool| if is_there { FlatbufferField::Link } else { FlatbufferField::None };
        let (root, places) = build.table(&[
            FlatbufferField::Link,
            link(self.extent.is_some()),
            FlatbufferField::U8(code_of(self.form.kind)),
            FlatbufferField::U8(self.form.has_z.into()),
            FlatbufferField::U8(self.form.has_m.into()),
            FlatbufferField::None,
            FlatbufferField::None,
            FlatbufferField::Link,
            FlatbufferField::U64(self.count),
            FlatbufferField::U16(if self.is_indexed { NODE as u16 } else { 0 }),
            link(has_crs),
        ]);
        build.set_root(root);
        build.text(places[schema::HEADER_NAME], self.name);
        if let Some(extent) = self.extent {
            build.numbers(places[schema::HEADER_ENVELOPE], &extent);
        }
        let links = build.links(places[schema::HEADER_COLUMNS], self.columns.len());
        for (column, link) in self.columns.iter().zip(links) {
            let code = value::type_of(column.kind.unwrap_or(FieldKind::Text));
            let (table, places) = build.table(&[FlatbufferField::Link, FlatbufferField::U8(code)]);
            build.link(link, table);
            build.text(places[schema::COLUMN_NAME], &column.name);
        }
        if has_crs {
            self.put_crs(&mut build, places[schema::HEADER_CRS]);
        }
        build.finish()
    }

    fn put_crs(&self, build: &mut FlatbufferBuilder, place: usize) {
        let text = self.crs.to_wkt();
        let link =
            |is_there: bool| if is_there { FlatbufferField::Link } else { FlatbufferField::None };
        // Readers that find a code ignore the WKT, and a code has no vertical CRS.
        let code = self.crs.epsg.filter(|_| self.crs.vertical_epsg.is_none() || text.is_none());
        let code = code.and_then(|code| i32::try_from(code).ok());
        let (table, places) = build.table(&[
            link(code.is_some()),
            code.map_or(FlatbufferField::None, FlatbufferField::I32),
            link(self.crs.citation.is_some()),
            FlatbufferField::None,
            link(text.is_some()),
        ]);
        build.link(place, table);
        if code.is_some() {
            build.text(places[schema::CRS_ORG], "EPSG");
        }
        if let Some(name) = &self.crs.citation {
            build.text(places[schema::CRS_NAME], name);
        }
        if let Some(text) = text {
            build.text(places[schema::CRS_WKT], &text);
        }
    }
}

/// A size-prefixed feature; `None` beyond 4 GiB.
fn feature(row: &FeatureRow, kinds: &[FieldKind], form: FlatGeobufGeometryType) -> Option<Vec<u8>> {
    let mut properties = Vec::new();
    for (column, value) in &row.values {
        value::put(*column as u16, kinds[*column], value, &mut properties);
    }
    let mut build = FlatbufferBuilder::new();
    let is_null = row.geometry.kind() == GeometryType::Null;
    let (root, places) = build.table(&[
        if is_null { FlatbufferField::None } else { FlatbufferField::Link },
        if properties.is_empty() { FlatbufferField::None } else { FlatbufferField::Link },
    ]);
    build.set_root(root);
    if !is_null {
        let kind = if form.kind == GeometryType::Null { row.geometry.kind() } else { form.kind };
        let form = FlatGeobufGeometryType { kind, ..form };
        put_geometry(&mut build, places[schema::FEATURE_GEOMETRY], &row.geometry, form);
    }
    if !properties.is_empty() {
        let place = places[schema::FEATURE_PROPERTIES];
        build.list(place, properties.len(), 1, properties.into_iter());
    }
    build.finish()
}

/// Appends a geometry as the type of the layer. The depth of collections is limited by their constructor.
fn put_geometry(
    build: &mut FlatbufferBuilder,
    place: usize,
    geometry: &Geometry,
    form: FlatGeobufGeometryType,
) {
    let kind = form.kind;
    match kind {
        GeometryType::Collection => {
            for (link, member) in parts(build, place, kind, geometry.members().len())
                .into_iter()
                .zip(geometry.members())
            {
                put_geometry(
                    build,
                    link,
                    member,
                    FlatGeobufGeometryType { kind: member.kind(), ..form },
                );
            }
        }
        GeometryType::MultiPolygon => {
            let from = geometry.coordinates();
            let links = parts(build, place, kind, from.polygons.len());
            let mut first = 0;
            for (link, &end) in links.into_iter().zip(&from.polygons) {
                put_leaf(
                    build,
                    link,
                    FlatGeobufGeometryType { kind: GeometryType::Polygon, ..form },
                    from,
                    first..end,
                );
                first = end;
            }
        }
        _ => {
            let from = geometry.coordinates();
            put_leaf(build, place, form, from, 0..from.ends.len());
        }
    }
}

/// Appends a geometry with `count` parts; returns the position of each.
fn parts(
    build: &mut FlatbufferBuilder,
    place: usize,
    kind: GeometryType,
    count: usize,
) -> Vec<usize> {
    let mut slots = [const { FlatbufferField::None }; 8];
    slots[schema::GEOMETRY_KIND] = FlatbufferField::U8(code_of(kind));
    slots[schema::GEOMETRY_PARTS] = FlatbufferField::Link;
    let (table, places) = build.table(&slots);
    build.link(place, table);
    build.links(places[schema::GEOMETRY_PARTS], count)
}

/// Appends a geometry of some parts of `from`, or of all positions if it has no parts. In a layer with
/// heights or measures every position has a value, as readers require.
fn put_leaf(
    build: &mut FlatbufferBuilder,
    place: usize,
    form: FlatGeobufGeometryType,
    from: &CoordinateSequence,
    parts: std::ops::Range<usize>,
) {
    let start = if parts.start == 0 { 0 } else { from.ends[parts.start - 1] };
    let ends = &from.ends[parts];
    let end =
        ends.last().copied().unwrap_or(if from.ends.is_empty() { from.xy.len() } else { start });
    let link =
        |is_there: bool| if is_there { FlatbufferField::Link } else { FlatbufferField::None };
    // The ends of a single ring are optional; some readers require those of a single line.
    let has_ends = ends.len() > 1 || form.kind == GeometryType::MultiLineString;
    let (table, places) = build.table(&[
        link(has_ends),
        FlatbufferField::Link,
        link(form.has_z),
        link(form.has_m),
        FlatbufferField::None,
        FlatbufferField::None,
        FlatbufferField::U8(code_of(form.kind)),
    ]);
    build.link(place, table);
    if has_ends {
        let bytes = ends.iter().flat_map(|end| ((end - start) as u32).to_le_bytes());
        build.list(places[schema::GEOMETRY_ENDS], ends.len(), 4, bytes);
    }
    build.numbers(places[schema::GEOMETRY_XY], from.xy[start..end].as_flattened());
    for (is_stored, slot, values) in
        [(form.has_z, schema::GEOMETRY_Z, &from.z), (form.has_m, schema::GEOMETRY_M, &from.m)]
    {
        match values.is_empty() {
            _ if !is_stored => {}
            true => build.numbers(places[slot], &vec![f64::NAN; end - start]),
            false => build.numbers(places[slot], &values[start..end]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flatgeobuf::view::FlatbufferTable;
    use crate::{VectorOpenOptions, open};

    /// Kinds of features, whether each has heights and measures, and the type of the layer with the kinds
    /// that come back.
    type Case<'a> =
        (&'a [(GeometryType, bool, bool)], (GeometryType, bool, bool), &'a [GeometryType]);

    fn geometry(kind: GeometryType, has_z: bool, has_m: bool) -> Geometry {
        let mut found = CoordinateSequence::default();
        for (at, [x, y]) in [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 0.0]].into_iter().enumerate()
        {
            if at == 0 || kind != GeometryType::Point {
                found.push([x, y], has_z.then_some(x + 1.0), has_m.then_some(y));
            }
        }
        if kind == GeometryType::Null {
            Geometry::null()
        } else {
            Geometry::new(kind, found).unwrap()
        }
    }

    fn written(path: &Path, features: &[(GeometryType, bool, bool)]) -> WrittenFeatures {
        let mut sink =
            create(path, &LayerHeader::default(), &VectorWriteOptions::default()).unwrap();
        for &(kind, has_z, has_m) in features {
            let geometry = geometry(kind, has_z, has_m);
            sink.write(&Feature { geometry, ..Feature::default() }).unwrap();
        }
        sink.finish(&[]).unwrap()
    }

    #[test]
    fn a_layer_is_what_readers_go_by() {
        use GeometryType::{LineString, MultiLineString, MultiPolygon, Null, Point, Polygon};
        let cases: &[Case<'_>] = &[
            (&[(LineString, false, false)], (LineString, false, false), &[LineString]),
            (
                &[(LineString, false, false), (LineString, true, false)],
                (LineString, true, false),
                &[LineString, LineString],
            ),
            (
                &[(Polygon, true, false), (MultiPolygon, false, false), (Null, false, false)],
                (MultiPolygon, true, false),
                &[MultiPolygon, MultiPolygon, Null],
            ),
            (
                &[(MultiLineString, false, true), (LineString, false, false)],
                (MultiLineString, false, true),
                &[MultiLineString, MultiLineString],
            ),
            (
                &[(LineString, false, false), (MultiLineString, false, false)],
                (Null, false, false),
                &[LineString, MultiLineString],
            ),
            (&[(Point, true, true), (Polygon, true, false)], (Null, true, true), &[Point, Polygon]),
        ];
        let folder = tempfile::tempdir().unwrap();
        for (features, layer, kinds) in cases {
            let path = folder.path().join("name of it.fgb");
            let notes = written(&path, features).notes;
            let bytes = std::fs::read(&path).unwrap();
            let header = FlatbufferTable::root(&bytes[12..]).unwrap();
            let flag = |slot: usize| header.u8(slot).unwrap() == 1;
            let type_of = header.u8(schema::HEADER_KIND).unwrap();
            let (kind, has_z, has_m) = *layer;
            assert_eq!((type_of, flag(3), flag(4)), (code_of(kind), has_z, has_m), "{features:?}");
            assert_eq!(header.text(schema::HEADER_NAME).unwrap(), Some("name of it"));
            let is_as_it_was = features.iter().zip(*kinds).all(|((was, z, m), is)| {
                was == is && ((*z, *m) == (has_z, has_m) || *was == GeometryType::Null)
            });
            let is_plain = (is_as_it_was && kind != GeometryType::Null) || (!has_z && !has_m);
            assert_eq!(notes.is_empty(), is_plain, "{notes:?}");
            let mut source = open(&path, &VectorOpenOptions::default()).unwrap();
            let mut found = Vec::new();
            while let Some(feature) = source.next().unwrap() {
                found.push(feature.geometry);
            }
            let tell = |g: &Geometry| format!("{:?} {:?} {:?}", g.kind(), g.has_z(), g.has_m());
            let mut told: Vec<String> = found.iter().map(tell).collect();
            let mut wanted: Vec<String> = features
                .iter()
                .zip(*kinds)
                .map(|((was, z, m), kind)| {
                    format!("{kind:?} {:?} {:?}", *z && *was != Null, *m && *was != Null)
                })
                .collect();
            told.sort();
            wanted.sort();
            assert_eq!(told, wanted);
            std::fs::remove_file(&path).unwrap();
        }
    }

    #[test]
    fn every_vertex_of_a_layer_with_heights_has_a_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.fgb");
        let mut sink = create(
            &path,
            &LayerHeader::default(),
            &VectorWriteOptions { index: false, ..Default::default() },
        )
        .unwrap();
        for has_z in [false, true] {
            let geometry = geometry(GeometryType::LineString, has_z, false);
            sink.write(&Feature { geometry, ..Feature::default() }).unwrap();
        }
        sink.finish(&[]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let size = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let first = 12 + size(8);
        for at in [first, first + 4 + size(first)] {
            let feature = FlatbufferTable::root(&bytes[at + 4..]).unwrap();
            let geometry = feature.table(schema::FEATURE_GEOMETRY).unwrap().unwrap();
            assert_eq!(geometry.list(schema::GEOMETRY_Z, 8).unwrap().len(), 4 * 8);
        }
    }
}
