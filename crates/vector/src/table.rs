//! Features buffered in a temporary file until all columns are known, for formats whose header precedes the
//! features and lists the columns.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::decimal;
use super::feature::{Feature, FieldDefinition, FieldKind, Id, LayerHeader, PropertyValue};
use super::geometry::{CoordinateSequence, Geometry, GeometryType};
use super::pages::{PagedFile, RecordBytes};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::limits;
use terrane_files::{AppendWriter, folder_for};

/// Name of the column for ids in formats that do not store ids separately.
const ID: &str = "id";

/// One column of the table.
#[derive(Clone, Debug)]
pub(super) struct FeatureColumn {
    pub(super) name: Arc<str>,
    /// Common type of its values; `None` while all are null.
    pub(super) kind: Option<FieldKind>,
    /// Maximum length of a value as text in bytes.
    pub(super) width: usize,
    /// Maximum number of decimals of a value as text.
    pub(super) decimals: usize,
}

/// Features in a temporary file.
pub(super) struct FeatureTable {
    columns: Vec<FeatureColumn>,
    /// Column index by name; only looked up, so its order does not matter.
    index: HashMap<Arc<str>, usize>,
    spool: AppendWriter,
    /// Offset of each feature.
    starts: Vec<u64>,
    /// Number of ids dropped because a property has the name of the id column.
    lost_ids: u64,
    scratch: Vec<u8>,
}

/// A complete table.
pub(super) struct FeatureRows {
    pub(super) columns: Vec<FeatureColumn>,
    pages: Option<PagedFile>,
    starts: Vec<u64>,
    pub(super) notes: Vec<String>,
}

/// A feature of a table: geometry, and values by column.
pub(super) struct FeatureRow {
    pub(super) geometry: Geometry,
    pub(super) values: Vec<(usize, PropertyValue)>,
}

impl FeatureTable {
    /// An empty table with the columns of `layer`, for the output at `path`.
    pub(super) fn new(path: &Path, layer: &LayerHeader, folder: Option<&Path>) -> Result<Self> {
        let mut table = Self {
            columns: Vec::new(),
            index: HashMap::new(),
            spool: AppendWriter::spool(folder_for(path, folder))?,
            starts: Vec::new(),
            lost_ids: 0,
            scratch: Vec::new(),
        };
        for field in layer.schema.iter().flatten() {
            let at = table.column(&field.name)?;
            table.columns[at].widen_by(field);
        }
        Ok(table)
    }

    /// Number of features so far.
    pub(super) fn len(&self) -> u64 {
        self.starts.len() as u64
    }

    /// Appends a feature. `most` is the maximum length of a value as text in bytes.
    pub(super) fn push(&mut self, feature: &Feature, most: usize) -> Result<()> {
        self.starts.push(self.spool.bytes());
        let id = feature.id.as_ref().map(value_of);
        let is_named = feature.properties.get(ID).is_some();
        let has_lost =
            is_named && id.as_ref().is_some_and(|id| feature.properties.get(ID) != Some(id));
        self.lost_ids += u64::from(has_lost);
        let id = id.filter(|_| !is_named);
        let mut values = std::mem::take(&mut self.scratch);
        values.clear();
        let name: Arc<str> = ID.into();
        let all = id.iter().map(|id| (&name, id)).chain(feature.properties.iter());
        for (name, value) in all {
            let at = self.column(name)?;
            self.columns[at].widen(value, most)?;
            put_value(at as u32, value, &mut values);
        }
        let buffer = &mut self.spool.buffer;
        put_geometry(&feature.geometry, buffer);
        buffer.extend_from_slice(&values);
        self.scratch = values;
        self.spool.settle()
    }

    fn column(&mut self, name: &Arc<str>) -> Result<usize> {
        if let Some(&at) = self.index.get(name) {
            return Ok(at);
        }
        let at = self.columns.len();
        limits::check("number of table fields", at as u64 + 1, limits::MAX_FIELDS)?;
        self.columns.push(FeatureColumn { name: name.clone(), kind: None, width: 0, decimals: 0 });
        self.index.insert(name.clone(), at);
        Ok(at)
    }

    /// Completes the table for reading.
    pub(super) fn finish(self) -> Result<FeatureRows> {
        let end = self.spool.bytes();
        let pages = match end {
            0 => None,
            _ => Some(PagedFile::of(self.spool.into_raw()?)),
        };
        let mut starts = self.starts;
        starts.push(end);
        let lost = self.lost_ids;
        let note = format!("{lost} ids omitted: property \"{ID}\" exists");
        let notes = (lost > 0).then_some(note).into_iter().collect();
        Ok(FeatureRows { columns: self.columns, pages, starts, notes })
    }
}

impl FeatureRows {
    /// Number of features.
    pub(super) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// A feature.
    pub(super) fn get(&mut self, row: usize) -> Result<FeatureRow> {
        let (start, end) = (self.starts[row], self.starts[row + 1]);
        let pages = self.pages.as_mut();
        let pages =
            pages.ok_or_else(|| Error::new(ErrorKind::Internal, "spooled features are lost"))?;
        let mut bytes = RecordBytes(pages.get(start, end - start)?);
        let geometry = take_geometry(&mut bytes)?;
        let mut values = Vec::new();
        while !bytes.0.is_empty() {
            let column = bytes.u32()? as usize;
            values.push((column, take_value(&mut bytes)?));
        }
        Ok(FeatureRow { geometry, values })
    }
}

impl FeatureColumn {
    /// Widens the column for the values of a field of another file.
    fn widen_by(&mut self, field: &FieldDefinition) {
        self.kind = Some(self.kind.map_or(field.kind, |kind| kind.with(field.kind)));
        self.width = self.width.max(field.width.unwrap_or(0) as usize);
        self.decimals = self.decimals.max(field.decimals.unwrap_or(0) as usize);
    }

    /// Widens the column for a value of at most `most` bytes.
    fn widen(&mut self, value: &PropertyValue, most: usize) -> Result<()> {
        let Some(kind) = value.kind() else { return Ok(()) };
        self.kind = Some(self.kind.map_or(kind, |found| found.with(kind)));
        let mut text = Vec::new();
        let bytes = match value {
            PropertyValue::Text(text) | PropertyValue::Json(text) => text.len(),
            _ => {
                push_text(value, &mut text);
                text.len()
            }
        };
        if bytes > most {
            let message =
                format!("value of {:?} is {bytes} bytes long, at most {most} allowed", self.name);
            return Err(Error::new(ErrorKind::CannotWrite, message)
                .remedy("shorten the value, or write FlatGeobuf or GeoJSON"));
        }
        self.width = self.width.max(bytes);
        if let (PropertyValue::Real(_), Some(point)) = (value, text.iter().position(|&b| b == b'.'))
        {
            let digits = text[point + 1..].iter().take_while(|b| b.is_ascii_digit()).count();
            self.decimals = self.decimals.max(digits);
        }
        Ok(())
    }
}

/// Value of the id column of a feature: a property of that name takes precedence over the id.
pub(super) fn id_of(feature: &Feature) -> Option<PropertyValue> {
    feature.properties.get(ID).cloned().or_else(|| feature.id.as_ref().map(value_of))
}

fn value_of(id: &Id) -> PropertyValue {
    match id {
        Id::Int(id) => PropertyValue::Int(*id),
        Id::Real(id) => PropertyValue::Real(*id),
        Id::Text(id) => PropertyValue::Text(id.clone()),
    }
}

/// Appends a value as text; nothing for null.
pub(super) fn push_text(value: &PropertyValue, text: &mut Vec<u8>) {
    match value {
        PropertyValue::Null => {}
        PropertyValue::Bool(value) => text.extend_from_slice(value.to_string().as_bytes()),
        PropertyValue::Int(value) => text.extend_from_slice(value.to_string().as_bytes()),
        PropertyValue::Real(value) => decimal::push(*value, text),
        PropertyValue::Text(value)
        | PropertyValue::Date(value)
        | PropertyValue::DateTime(value)
        | PropertyValue::Json(value) => {
            text.extend_from_slice(value.as_bytes());
        }
    }
}

fn put_value(column: u32, value: &PropertyValue, out: &mut Vec<u8>) {
    out.extend_from_slice(&column.to_le_bytes());
    match value {
        PropertyValue::Text(value) => put_text(5, value, out),
        PropertyValue::Date(value) => put_text(6, value, out),
        PropertyValue::DateTime(value) => put_text(7, value, out),
        PropertyValue::Json(value) => put_text(8, value, out),
        PropertyValue::Null => out.push(0),
        PropertyValue::Bool(value) => out.push(1 + u8::from(*value)),
        PropertyValue::Int(value) => {
            out.push(3);
            out.extend_from_slice(&value.to_le_bytes());
        }
        PropertyValue::Real(value) => {
            out.push(4);
            out.extend_from_slice(&value.to_le_bytes());
        }
    }
}

fn put_text(tag: u8, text: &str, out: &mut Vec<u8>) {
    out.push(tag);
    out.extend_from_slice(&(text.len() as u64).to_le_bytes());
    out.extend_from_slice(text.as_bytes());
}

fn take_text(bytes: &mut RecordBytes<'_>) -> Result<String> {
    let length = bytes.u64()? as usize;
    Ok(String::from_utf8_lossy(bytes.take(length)?).into_owned())
}

fn take_value(bytes: &mut RecordBytes<'_>) -> Result<PropertyValue> {
    let tag = bytes.u8()?;
    match tag {
        0 => Ok(PropertyValue::Null),
        1 | 2 => Ok(PropertyValue::Bool(tag == 2)),
        3 => bytes.u64().map(|value| PropertyValue::Int(value as i64)),
        4 => bytes.f64().map(PropertyValue::Real),
        5 => take_text(bytes).map(PropertyValue::Text),
        6 => take_text(bytes).map(PropertyValue::Date),
        7 => take_text(bytes).map(PropertyValue::DateTime),
        _ => take_text(bytes).map(PropertyValue::Json),
    }
}

// Collections are nested no deeper than their constructor allows.
fn put_geometry(geometry: &Geometry, out: &mut Vec<u8>) {
    let CoordinateSequence { xy, z, m, ends, polygons } = geometry.coordinates();
    let kind =
        GeometryType::ALL.iter().position(|kind| *kind == geometry.kind()).unwrap_or_default();
    out.push(kind as u8);
    let members = geometry.members();
    for count in [members.len(), xy.len(), z.len(), m.len(), ends.len(), polygons.len()] {
        out.extend_from_slice(&(count as u64).to_le_bytes());
    }
    members.iter().for_each(|member| put_geometry(member, out));
    let numbers = xy.as_flattened().iter().chain(z).chain(m);
    out.extend(numbers.flat_map(|value| value.to_le_bytes()));
    out.extend(ends.iter().chain(polygons).flat_map(|&end| (end as u64).to_le_bytes()));
}

fn take_ends(bytes: &mut RecordBytes<'_>, count: usize) -> Result<Vec<usize>> {
    (0..count).map(|_| bytes.u64().map(|end| end as usize)).collect()
}

fn take_geometry(bytes: &mut RecordBytes<'_>) -> Result<Geometry> {
    let kind = GeometryType::ALL[usize::from(bytes.u8()?) % GeometryType::ALL.len()];
    let mut counts = [0; 6];
    for count in &mut counts {
        *count = bytes.u64()? as usize;
    }
    let [members, xy, z, m, ends, polygons] = counts;
    let members: Result<Vec<Geometry>> = (0..members).map(|_| take_geometry(bytes)).collect();
    let members = members?;
    let (xy, z, m) = (bytes.pairs(xy)?, bytes.numbers(z)?, bytes.numbers(m)?);
    let (ends, polygons) = (take_ends(bytes, ends)?, take_ends(bytes, polygons)?);
    match kind {
        GeometryType::Collection => Ok(Geometry::with_members(members)),
        _ => Ok(Geometry::of_kind(kind, CoordinateSequence { xy, z, m, ends, polygons })),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_kept_comes_back(features in prop::collection::vec(sample::feature(), 0..6)) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a");
            let mut table = FeatureTable::new(&path, &LayerHeader::default(), None).unwrap();
            features.iter().for_each(|feature| table.push(feature, usize::MAX).unwrap());
            let mut rows = table.finish().unwrap();
            prop_assert_eq!(rows.len(), features.len());
            for (at, feature) in features.iter().enumerate().rev() {
                let row = rows.get(at).unwrap();
                prop_assert_eq!(format!("{:?}", row.geometry), format!("{:?}", feature.geometry));
                for (name, value) in feature.properties.iter() {
                    let found = row.values.iter().find(|(at, _)| rows.columns[*at].name == *name);
                    prop_assert_eq!(&found.unwrap().1, value);
                }
            }
        }
    }
}
