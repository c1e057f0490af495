//! Writer: features are buffered until all columns are known.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use crate::crs;
use crate::decimal;
use crate::feature::{Feature, JsonMember, LayerHeader, PropertyValue};
use crate::geometry::GeometryType;
use crate::out::VectorOutputFile;
use crate::sink::{FeatureSink, VectorWriteOptions, WrittenFeatures};
use crate::table::{FeatureRow, FeatureRows, FeatureTable, id_of, push_text};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Crs;
use terrane_files::atomic::Sidecar;

/// Starts a file.
pub(super) fn create(
    path: &Path,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    // Nothing in a table has a position.
    let no_crs = Crs::default();
    Ok(Box::new(CsvFeatureSink {
        out: VectorOutputFile::create(path, options.overwrite)?,
        prj: crs::prj(path, if options.table { &no_crs } else { &layer.crs }, options.overwrite)?,
        notes: if options.table { Vec::new() } else { crs::notes(&layer.crs) },
        is_table: options.table,
        table: FeatureTable::new(path, layer, options.temp_dir.as_deref())?,
        ids: CsvFeatureIds::default(),
        has_z: false,
        has_m: false,
        path: path.to_path_buf(),
    }))
}

struct CsvFeatureSink {
    out: VectorOutputFile,
    prj: Sidecar,
    notes: Vec<String>,
    table: FeatureTable,
    ids: CsvFeatureIds,
    is_table: bool,
    has_z: bool,
    has_m: bool,
    path: PathBuf,
}

impl FeatureSink for CsvFeatureSink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        let kind = feature.geometry.kind();
        let place = format!("feature {}", self.table.len() + 1);
        if self.is_table {
            self.ids.add(feature);
            let Feature { id, properties, .. } = feature;
            let (id, properties) = (id.clone(), properties.clone());
            let feature = Feature { id, properties, ..Feature::default() };
            return self
                .table
                .push(&feature, usize::MAX)
                .map_err(|e| e.at(place).in_file(&self.path));
        }
        if !matches!(
            kind,
            GeometryType::Null
                | GeometryType::Point
                | GeometryType::LineString
                | GeometryType::MultiLineString
        ) {
            return Err(Error::usage(format!(
                "CSV supports points and lines, not {}",
                kind.name()
            ))
            .in_file(&self.path)
            .at(place)
            .remedy("write GeoJSON or FlatGeobuf"));
        }
        self.has_z |= feature.geometry.has_z();
        self.has_m |= feature.geometry.has_m();
        if !feature.geometry.is_empty() {
            self.ids.add(feature);
        }
        self.table.push(feature, usize::MAX).map_err(|e| e.at(place).in_file(&self.path))
    }

    fn finish(self: Box<Self>, _: &[JsonMember]) -> Result<WrittenFeatures> {
        let this = *self;
        let mut rows = this.table.finish()?;
        let mut out = this.out;
        let numbers = this.ids.numbers(rows.len());
        let mut notes = this.notes;
        notes.append(&mut rows.notes);
        for own in rows.columns.iter().map(|column| &*column.name) {
            let name = free_name(&rows, own);
            if name != own && !this.is_table {
                notes.push(format!("the property {own} is in column {name}"));
            }
        }
        if numbers.is_none() {
            notes.push(format!(
                "ids are not unique: features are renumbered, original ids are in column {}",
                own_name(&rows)
            ));
        }
        let mut pen = CsvRowWriter::new(&rows, numbers);
        (pen.has_z, pen.has_m, pen.is_table) = (this.has_z, this.has_m, this.is_table);
        pen.head(&rows, &mut out.buffer);
        let (mut empty, mut single) = (0, 0);
        for at in 0..rows.len() {
            let row = rows.get(at)?;
            empty += u64::from(row.geometry.is_empty() && !this.is_table);
            let is_line = !row.geometry.kind().is_points();
            single += u64::from(is_line && row.geometry.vertices() == 1);
            pen.row(at, &row, &mut out.buffer);
            out.settle()?;
        }
        if empty > 0 {
            notes.push(format!("{empty} empty features omitted: CSV stores one row per vertex"));
        }
        if single > 0 {
            notes.push(format!("{single} lines of one vertex will be read back as points"));
        }
        let (path, mut bytes) = out.commit()?;
        let mut files = vec![path];
        this.prj.commit()?;
        if let Some((path, more)) = this.prj.place() {
            files.push(path);
            bytes += more;
        }
        Ok(WrittenFeatures { features: rows.len() as u64 - empty, bytes, files, notes })
    }
}

/// Uniqueness of ids: rows with one id form one feature.
#[derive(Default)]
struct CsvFeatureIds {
    /// Hashes of all ids; a collision only causes unneeded renumbering.
    seen: HashSet<u64>,
    repeat: bool,
    /// The largest integer id.
    largest: i64,
}

impl CsvFeatureIds {
    fn add(&mut self, feature: &Feature) {
        let Some(id) = id_of(feature) else { return };
        let mut cell = Vec::new();
        push_text(&id, &mut cell);
        let text = String::from_utf8_lossy(&cell);
        let (text, whole) = (text.trim(), text.trim().parse::<i64>());
        if text.is_empty() {
            return;
        }
        // 03 is read back as 3.
        let text = whole.as_ref().map_or_else(|_| text.to_owned(), i64::to_string);
        let mut hasher = DefaultHasher::new();
        text.hash(&mut hasher);
        self.repeat |= !self.seen.insert(hasher.finish());
        self.largest = self.largest.max(whole.unwrap_or(0));
    }

    /// Offset of the numbers given to features without an id, so that they are unique; `None` if ids are not
    /// unique and all features are renumbered.
    fn numbers(&self, features: usize) -> Option<i64> {
        let has_room = self.largest.checked_add(features as i64).is_some();
        (!self.repeat && has_room).then_some(self.largest)
    }
}

/// Name of the column with the original ids of renumbered features.
fn own_name(rows: &FeatureRows) -> String {
    let name = ORIGINAL_ID;
    match rows.columns.iter().any(|column| column.name.eq_ignore_ascii_case(name)) {
        true => with_underscores(rows, name),
        false => name.to_owned(),
    }
}

/// Names of the columns of vertices.
const OF_VERTICES: [&str; 5] = ["x", "y", "z", "m", "part"];

/// Name of the column of a property: its own, unless a column of vertices has it.
fn free_name(rows: &FeatureRows, name: &str) -> String {
    match OF_VERTICES.iter().any(|other| other.eq_ignore_ascii_case(name)) {
        true => with_underscores(rows, name),
        false => name.to_owned(),
    }
}

/// A name with as many underscores as no other column has.
fn with_underscores(rows: &FeatureRows, name: &str) -> String {
    let mut name = format!("{name}_");
    while rows.columns.iter().any(|column| column.name.eq_ignore_ascii_case(&name)) {
        name.push('_');
    }
    name
}

/// Name of the column with the original ids of renumbered features; underscores are appended if a property
/// has the name.
const ORIGINAL_ID: &str = "original_id";

struct CsvRowWriter {
    /// The column with ids.
    id: Option<usize>,
    /// Offset of the numbers given to features without an id; `None` if all are renumbered.
    numbers: Option<i64>,
    columns: usize,
    has_z: bool,
    has_m: bool,
    is_table: bool,
    /// The cells after the coordinates of a vertex.
    tail: Vec<u8>,
}

impl CsvRowWriter {
    fn new(rows: &FeatureRows, numbers: Option<i64>) -> Self {
        let id = rows.columns.iter().position(|column| *column.name == *"id");
        let columns = rows.columns.len();
        let [has_z, has_m, is_table] = [false; 3];
        Self { id, numbers, columns, has_z, has_m, is_table, tail: Vec::new() }
    }

    /// True if a column follows the coordinates.
    fn is_behind(&self, column: usize) -> bool {
        self.numbers.is_none() || Some(column) != self.id
    }

    /// Name of the column of a property.
    fn name(&self, rows: &FeatureRows, own: &str) -> String {
        if self.is_table { own.to_owned() } else { free_name(rows, own) }
    }

    fn head(&self, rows: &FeatureRows, text: &mut Vec<u8>) {
        text.extend_from_slice(if self.is_table { b"id" } else { b"id,part,x,y" });
        if self.has_z {
            text.extend_from_slice(b",z");
        }
        if self.has_m {
            text.extend_from_slice(b",m");
        }
        for (at, column) in rows.columns.iter().enumerate() {
            if self.is_behind(at) {
                text.push(b',');
                match Some(at) == self.id {
                    true => text.extend_from_slice(own_name(rows).as_bytes()),
                    false => push_cell(self.name(rows, &column.name).as_bytes(), text),
                }
            }
        }
        text.push(b'\n');
    }

    fn row(&mut self, number: usize, row: &FeatureRow, text: &mut Vec<u8>) {
        let mut cells = vec![Vec::new(); self.columns];
        row.values.iter().for_each(|(at, value)| push_text(value, &mut cells[*at]));
        let mut id = Vec::new();
        let own = self.id.filter(|_| self.numbers.is_some()).map(|at| &cells[at]);
        match own.filter(|cell| !String::from_utf8_lossy(cell).trim().is_empty()) {
            Some(own) => push_cell(own, &mut id),
            None => {
                let number = self.numbers.unwrap_or(0) + number as i64 + 1;
                push_text(&PropertyValue::Int(number), &mut id);
            }
        }
        self.tail.clear();
        for (at, cell) in cells.iter().enumerate() {
            if self.is_behind(at) {
                self.tail.push(b',');
                push_cell(cell, &mut self.tail);
            }
        }
        if self.is_table {
            text.extend_from_slice(&id);
            text.extend_from_slice(&self.tail);
            text.push(b'\n');
        }
        let found = row.geometry.coordinates();
        let mut part = 0;
        for at in 0..found.xy.len() {
            part += usize::from(found.ends.get(part) == Some(&at));
            text.extend_from_slice(&id);
            text.push(b',');
            push_text(&PropertyValue::Int(part as i64), text);
            for value in found.xy[at] {
                text.push(b',');
                decimal::push(value, text);
            }
            for (is_there, values) in [(self.has_z, &found.z), (self.has_m, &found.m)] {
                if is_there {
                    text.push(b',');
                    if let Some(value) = values.get(at).filter(|value| !value.is_nan()) {
                        decimal::push(*value, text);
                    }
                }
            }
            text.extend_from_slice(&self.tail);
            text.push(b'\n');
        }
    }
}

/// Appends a cell, quoted if necessary (RFC 4180; also a leading # and surrounding white space).
fn push_cell(cell: &[u8], text: &mut Vec<u8>) {
    let has_special =
        cell.iter().any(|byte| matches!(byte, b',' | b'"' | b'\n' | b'\r' | b';' | b'\t'));
    let is_trimmed = String::from_utf8_lossy(cell).trim().len() == cell.len();
    if is_trimmed && !cell.starts_with(b"#") && !has_special {
        text.extend_from_slice(cell);
        return;
    }
    text.push(b'"');
    for &byte in cell {
        match byte {
            b'"' => text.extend_from_slice(b"\"\""),
            byte => text.push(byte),
        }
    }
    text.push(b'"');
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{CoordinateSequence, FeatureProperties, Geometry, Id, VectorOpenOptions, open};

    fn feature(at: usize, id: Option<Id>, as_property: bool) -> Feature {
        let x = at as f64;
        let kind =
            if at.is_multiple_of(3) { GeometryType::Point } else { GeometryType::LineString };
        let xy =
            vec![[x, 0.5], [x, 7.0]][..if kind == GeometryType::Point { 1 } else { 2 }].to_vec();
        let ends = vec![xy.len()];
        let geometry =
            Geometry::new(kind, CoordinateSequence { xy, ends, ..CoordinateSequence::default() });
        let mut properties = FeatureProperties(vec![("n;o".into(), PropertyValue::Int(at as i64))]);
        if let Some(id) = id.clone().filter(|_| as_property) {
            let value = match id {
                Id::Int(id) => PropertyValue::Int(id),
                Id::Real(id) => PropertyValue::Real(id),
                Id::Text(id) => PropertyValue::Text(id),
            };
            properties.0.push(("id".into(), value));
        }
        let id = id.filter(|_| !as_property);
        Feature { id, properties, geometry: geometry.unwrap(), foreign: Vec::new() }
    }

    fn there_and_back(features: &[Feature]) -> (Vec<Feature>, WrittenFeatures) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut sink =
            create(&path, &LayerHeader::default(), &VectorWriteOptions::default()).unwrap();
        features.iter().for_each(|feature| sink.write(feature).unwrap());
        let written = sink.finish(&[]).unwrap();
        let mut source = open(&path, &VectorOpenOptions::default()).unwrap();
        (std::iter::from_fn(|| source.next().unwrap()).collect(), written)
    }

    /// What a table says of an id.
    fn shown(value: Option<PropertyValue>) -> String {
        let mut text = Vec::new();
        value.iter().for_each(|value| push_text(value, &mut text));
        String::from_utf8(text).unwrap().trim().to_owned()
    }

    fn ids() -> impl Strategy<Value = Option<Id>> {
        let texts = ["a", " a", "#a", " ", "\u{a0}", "", "2", "x,\"y\"", "b\nc", "b c", "03"];
        prop_oneof![
            2 => Just(None),
            3 => (0..9_i64).prop_map(|id| Some(Id::Int(id))),
            3 => prop::sample::select(texts.to_vec()).prop_map(|id| Some(Id::Text(id.to_owned()))),
            1 => prop::sample::select(vec![i64::MAX, i64::MIN, -1]).prop_map(|id| Some(Id::Int(id))),
            1 => prop::sample::select(vec![1.0, 2.5]).prop_map(|id| Some(Id::Real(id))),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(600))]
        #[test]
        fn features_with_any_ids_stay_apart(
            ids in prop::collection::vec((ids(), any::<bool>()), 1..7)
        ) {
            let features: Vec<Feature> =
                (0..).zip(ids).map(|(at, (id, with))| feature(at, id, with)).collect();
            let (found, written) = there_and_back(&features);
            prop_assert_eq!(found.len(), features.len());
            prop_assert_eq!(written.features, features.len() as u64);
            let mut known = HashSet::new();
            for (old, new) in features.iter().zip(&found) {
                prop_assert_eq!(
                    &new.geometry.coordinates().xy, &old.geometry.coordinates().xy
                );
                prop_assert_eq!(new.properties.get("n;o"), old.properties.get("n;o"));
                let id = shown(new.id.as_ref().map(|_| id_of(new).unwrap()));
                let own = shown(id_of(old));
                let moved = new.properties.get(ORIGINAL_ID);
                // Its own, in the one column or the other; a number where it has none.
                match moved {
                    Some(moved) => prop_assert_eq!(number(&shown(Some(moved.clone()))), number(&own)),
                    None if own.is_empty() => prop_assert!(id.parse::<i64>().is_ok()),
                    None => prop_assert_eq!(number(&id), number(&own)),
                }
                prop_assert!(known.insert(id), "an id comes twice");
            }
        }
    }

    /// Cells are all alike: 03 is read as 3.
    fn number(text: &str) -> String {
        text.parse::<f64>().map_or_else(|_| text.to_owned(), |number| number.to_string())
    }

    #[test]
    fn ids_stay_in_their_column_where_they_tell_features_apart() {
        let ids = |all: &[Option<i64>]| -> Vec<(String, String)> {
            let features: Vec<Feature> =
                (0..).zip(all).map(|(at, id)| feature(at, id.map(Id::Int), false)).collect();
            let of = |found: &Feature| {
                let moved = found.properties.get(ORIGINAL_ID).cloned();
                (shown(id_of(found)), shown(moved))
            };
            there_and_back(&features).0.iter().map(of).collect()
        };
        let plain = |all: &[&str]| -> Vec<(String, String)> {
            all.iter().map(|id| ((*id).to_owned(), String::new())).collect()
        };
        assert_eq!(ids(&[None, None]), plain(&["1", "2"]));
        assert_eq!(ids(&[Some(7), Some(3)]), plain(&["7", "3"]));
        assert_eq!(ids(&[Some(2), None]), plain(&["2", "4"]), "2 is its neighbour's");
        let numbered = [("1", "5"), ("2", ""), ("3", "5")];
        let numbered = numbered.map(|(id, own)| (id.to_owned(), own.to_owned()));
        assert_eq!(ids(&[Some(5), None, Some(5)]), numbered);
    }
}
