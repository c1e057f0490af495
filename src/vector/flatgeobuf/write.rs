//! Writing: features wait until all columns and rectangles are known, then the header, the index and
//! the features are written, in the order of the index.

use std::path::{Path, PathBuf};

use super::build::{Build, Slot};
use super::{KINDS, MAGIC, slot, value};
use crate::error::{Error, ErrorKind, Result};
use crate::geom::Crs;
use crate::vector::crs;
use crate::vector::feature::{Feature, FieldKind, Layer, Member};
use crate::vector::geometry::{Coordinates, Geometry, Kind};
use crate::vector::out::Out;
use crate::vector::sink::{FeatureSink, WriteOptions, Written};
use crate::vector::table::{Column, Row, Table};
use crate::vector::tree::{Bounds, NODE, NOTHING, Tree, around, hilbert_order};

/// Starts a file.
pub(super) fn create(
    path: &Path,
    layer: &Layer,
    options: &WriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    Ok(Box::new(Sink {
        out: Out::create(path, options.overwrite)?,
        table: Table::new(path, layer, options.temp_dir.as_deref())?,
        name: layer.name.clone(),
        crs: layer.crs.clone(),
        bounds: Vec::new(),
        kind: None,
        has_z: false,
        has_m: false,
        is_indexed: options.index,
        path: path.to_path_buf(),
    }))
}

struct Sink {
    out: Out,
    table: Table,
    name: Option<String>,
    crs: Crs,
    /// Of each feature.
    bounds: Vec<Bounds>,
    /// The kind of all features, or null where there are several; `None` before the first.
    kind: Option<Kind>,
    has_z: bool,
    has_m: bool,
    is_indexed: bool,
    path: PathBuf,
}

impl FeatureSink for Sink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        let geometry = &feature.geometry;
        // A feature without a place is one of any kind.
        if geometry.kind() != Kind::Null {
            let kind = *self.kind.get_or_insert(geometry.kind());
            self.kind = Some(if kind == geometry.kind() { kind } else { Kind::Null });
        }
        self.has_z |= geometry.has_z();
        self.has_m |= geometry.has_m();
        self.bounds.push(geometry.bounds().unwrap_or(NOTHING));
        let number = self.table.len() + 1;
        let pushed = self.table.push(feature, u32::MAX as usize);
        pushed.map_err(|e| e.at(format!("feature {number}")).in_file(&self.path))
    }

    fn finish(self: Box<Self>, _: &[Member]) -> Result<Written> {
        let this = *self;
        let mut rows = this.table.finish()?;
        let too_large = |message: &str| {
            Error::new(ErrorKind::CannotWrite, message)
                .in_file(&this.path)
                .remedy("write GeoJSON, or divide it")
        };
        if u32::try_from(rows.len()).is_err() || rows.columns.len() > usize::from(u16::MAX) {
            return Err(too_large("more features or properties than a FlatGeobuf can hold"));
        }
        let extent = this.bounds.iter().fold(NOTHING, |all, one| around(&all, one));
        let is_indexed = this.is_indexed && !this.bounds.is_empty();
        let order = match is_indexed {
            true => hilbert_order(&this.bounds, &extent),
            false => (0..rows.len() as u32).collect(),
        };
        let head = Head {
            name: this.name.as_deref().unwrap_or_default(),
            extent: (extent[0] <= extent[2]).then_some(extent),
            kind: this.kind.unwrap_or_default(),
            has_z: this.has_z,
            has_m: this.has_m,
            columns: &rows.columns,
            count: rows.len() as u64,
            is_indexed,
            crs: &this.crs,
        };
        let header = head.bytes().ok_or_else(|| too_large("its header is too long"))?;
        let mut out = this.out;
        let kinds: Vec<FieldKind> =
            rows.columns.iter().map(|column| column.kind.unwrap_or(FieldKind::Text)).collect();
        // Places of features come before the features: their lengths are found by making each twice,
        // which takes less than keeping them.
        let mut encode = |row: u32| -> Result<Vec<u8>> {
            let bytes = feature(&rows.get(row as usize)?, &kinds);
            bytes.ok_or_else(|| {
                too_large("a feature takes more than 4 GiB").at(format!("feature {}", row + 1))
            })
        };
        out.buffer.extend_from_slice(&MAGIC);
        out.buffer.extend_from_slice(&header);
        if is_indexed {
            let mut place = 0;
            let mut places = Vec::with_capacity(order.len());
            for &row in &order {
                places.push(place);
                place += encode(row)?.len() as u64;
            }
            let bounds: Vec<Bounds> = order.iter().map(|&row| this.bounds[row as usize]).collect();
            for (bounds, to, is_leaf) in Tree::new(&bounds).nodes() {
                let to = if is_leaf { places[to] } else { to as u64 };
                out.buffer.extend(bounds.iter().flat_map(|bound| bound.to_le_bytes()));
                out.buffer.extend_from_slice(&to.to_le_bytes());
                out.settle()?;
            }
        }
        for &row in &order {
            let bytes = encode(row)?;
            out.buffer.extend_from_slice(&bytes);
            out.settle()?;
        }
        let (path, bytes) = out.commit()?;
        let features = order.len() as u64;
        let notes = [crs::notes(&this.crs), std::mem::take(&mut rows.notes)].concat();
        Ok(Written { features, bytes, files: vec![path], notes })
    }
}

fn code_of(kind: Kind) -> u8 {
    KINDS.iter().find(|(_, known)| *known == kind).map_or(0, |(code, _)| *code)
}

/// What the header says.
struct Head<'a> {
    name: &'a str,
    extent: Option<Bounds>,
    kind: Kind,
    has_z: bool,
    has_m: bool,
    columns: &'a [Column],
    count: u64,
    is_indexed: bool,
    crs: &'a Crs,
}

impl Head<'_> {
    fn bytes(&self) -> Option<Vec<u8>> {
        let mut build = Build::new();
        let has_crs = self.crs.is_named();
        let link = |is_there: bool| if is_there { Slot::Link } else { Slot::None };
        let (root, places) = build.table(&[
            Slot::Link,
            link(self.extent.is_some()),
            Slot::U8(code_of(self.kind)),
            Slot::U8(self.has_z.into()),
            Slot::U8(self.has_m.into()),
            Slot::None,
            Slot::None,
            Slot::Link,
            Slot::U64(self.count),
            Slot::U16(if self.is_indexed { NODE as u16 } else { 0 }),
            link(has_crs),
        ]);
        build.set_root(root);
        build.text(places[slot::HEADER_NAME], self.name);
        if let Some(extent) = self.extent {
            build.numbers(places[slot::HEADER_ENVELOPE], &extent);
        }
        let links = build.links(places[slot::HEADER_COLUMNS], self.columns.len());
        for (column, link) in self.columns.iter().zip(links) {
            let code = value::type_of(column.kind.unwrap_or(FieldKind::Text));
            let (table, places) = build.table(&[Slot::Link, Slot::U8(code)]);
            build.link(link, table);
            build.text(places[slot::COLUMN_NAME], &column.name);
        }
        if has_crs {
            self.put_crs(&mut build, places[slot::HEADER_CRS]);
        }
        build.finish()
    }

    fn put_crs(&self, build: &mut Build, place: usize) {
        let text = self.crs.to_wkt();
        let link = |is_there: bool| if is_there { Slot::Link } else { Slot::None };
        // Readers that find a code ask for no text, and a code says nothing of heights.
        let code = self.crs.epsg.filter(|_| self.crs.vertical_epsg.is_none() || text.is_none());
        let code = code.and_then(|code| i32::try_from(code).ok());
        let (table, places) = build.table(&[
            link(code.is_some()),
            code.map_or(Slot::None, Slot::I32),
            link(self.crs.citation.is_some()),
            Slot::None,
            link(text.is_some()),
        ]);
        build.link(place, table);
        if code.is_some() {
            build.text(places[slot::CRS_ORG], "EPSG");
        }
        if let Some(name) = &self.crs.citation {
            build.text(places[slot::CRS_NAME], name);
        }
        if let Some(text) = text {
            build.text(places[slot::CRS_WKT], &text);
        }
    }
}

/// A feature with its size; `None` beyond 4 GiB.
fn feature(row: &Row, kinds: &[FieldKind]) -> Option<Vec<u8>> {
    let mut properties = Vec::new();
    for (column, value) in &row.values {
        value::put(*column as u16, kinds[*column], value, &mut properties);
    }
    let mut build = Build::new();
    let is_null = row.geometry.kind() == Kind::Null;
    let (root, places) = build.table(&[
        if is_null { Slot::None } else { Slot::Link },
        if properties.is_empty() { Slot::None } else { Slot::Link },
    ]);
    build.set_root(root);
    if !is_null {
        put_geometry(&mut build, places[slot::FEATURE_GEOMETRY], &row.geometry);
    }
    if !properties.is_empty() {
        let place = places[slot::FEATURE_PROPERTIES];
        build.list(place, properties.len(), 1, properties.into_iter());
    }
    build.finish()
}

// Collections are nested no deeper than their constructor allows.
fn put_geometry(build: &mut Build, place: usize, geometry: &Geometry) {
    let kind = geometry.kind();
    match kind {
        Kind::Collection => {
            for (link, member) in parts(build, place, kind, geometry.members().len())
                .into_iter()
                .zip(geometry.members())
            {
                put_geometry(build, link, member);
            }
        }
        Kind::MultiPolygon => {
            let from = geometry.coordinates();
            let links = parts(build, place, kind, from.polygons.len());
            let mut first = 0;
            for (link, &end) in links.into_iter().zip(&from.polygons) {
                put_leaf(build, link, Kind::Polygon, from, first..end);
                first = end;
            }
        }
        _ => {
            let from = geometry.coordinates();
            put_leaf(build, place, kind, from, 0..from.ends.len());
        }
    }
}

/// A geometry of `count` others; gives the place of each.
fn parts(build: &mut Build, place: usize, kind: Kind, count: usize) -> Vec<usize> {
    let none = || Slot::None;
    let code = Slot::U8(code_of(kind));
    let slots = [none(), none(), none(), none(), none(), none(), code, Slot::Link];
    let (table, places) = build.table(&slots);
    build.link(place, table);
    build.links(places[slot::GEOMETRY_PARTS], count)
}

/// A geometry of some parts of `from`, or of all its positions where it has no parts.
fn put_leaf(
    build: &mut Build,
    place: usize,
    kind: Kind,
    from: &Coordinates,
    parts: std::ops::Range<usize>,
) {
    let start = if parts.start == 0 { 0 } else { from.ends[parts.start - 1] };
    let ends = &from.ends[parts];
    let end =
        ends.last().copied().unwrap_or(if from.ends.is_empty() { from.xy.len() } else { start });
    let link = |is_there: bool| if is_there { Slot::Link } else { Slot::None };
    // Of one part the end needs no word.
    let has_ends = ends.len() > 1;
    let (table, places) = build.table(&[
        link(has_ends),
        Slot::Link,
        link(!from.z.is_empty()),
        link(!from.m.is_empty()),
        Slot::None,
        Slot::None,
        Slot::U8(code_of(kind)),
    ]);
    build.link(place, table);
    if has_ends {
        let bytes = ends.iter().flat_map(|end| ((end - start) as u32).to_le_bytes());
        build.list(places[slot::GEOMETRY_ENDS], ends.len(), 4, bytes);
    }
    build.numbers(places[slot::GEOMETRY_XY], from.xy[start..end].as_flattened());
    if !from.z.is_empty() {
        build.numbers(places[slot::GEOMETRY_Z], &from.z[start..end]);
    }
    if !from.m.is_empty() {
        build.numbers(places[slot::GEOMETRY_M], &from.m[start..end]);
    }
}
