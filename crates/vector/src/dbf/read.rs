//! Reader of dBASE tables.

use std::path::{Path, PathBuf};

use super::encoding::TextEncoding;
use crate::decimal;
use crate::feature::{FeatureProperties, FieldDefinition, FieldKind, PropertyValue, is_date};
use crate::pages::PagedFile;
use terrane_base::error::{Error, Result};
use terrane_base::limits;

/// Size in bytes of the table header, and of each field descriptor after it.
pub(super) const HEADER_BYTES: u64 = 32;
/// Terminator of the field descriptors.
pub(super) const HEADER_END: u8 = 0x0d;
/// Flag of a deleted record.
const DELETED: u8 = b'*';

/// A table being read.
pub(crate) struct DbfReader {
    pages: PagedFile,
    path: PathBuf,
    schema: Vec<FieldDefinition>,
    /// Type of each field, and the offset of its end in a record.
    columns: Vec<(u8, usize)>,
    encoding: TextEncoding,
    header_bytes: u64,
    record_bytes: u64,
    records: u64,
    deleted: u64,
}

impl DbfReader {
    pub(crate) fn open(path: &Path) -> Result<Self> {
        Self::try_open(path).map_err(|e| e.in_file(path))
    }

    fn try_open(path: &Path) -> Result<Self> {
        let mut pages = PagedFile::open(path)?;
        let head = pages.get(0, HEADER_BYTES)?;
        let records = u64::from(u32::from_le_bytes([head[4], head[5], head[6], head[7]]));
        let header_bytes = u64::from(u16::from_le_bytes([head[8], head[9]]));
        let record_bytes = u64::from(u16::from_le_bytes([head[10], head[11]]));
        let encoding = TextEncoding::find(path, head[29]);
        let fields = header_bytes.checked_sub(HEADER_BYTES);
        let fields = fields.ok_or_else(|| Error::bad_input("is not a dBASE table"))?;
        let descriptions = pages.get(HEADER_BYTES, fields)?;
        let mut end = 1;
        let (mut schema, mut columns) = (Vec::new(), Vec::new());
        for description in descriptions.as_chunks::<32>().0 {
            if description[0] == HEADER_END {
                break;
            }
            let width = usize::from(description[16]);
            end += width;
            columns.push((description[11].to_ascii_uppercase(), end));
            schema.push(field(description, &encoding)?);
        }
        limits::check("number of table fields", schema.len() as u64, limits::MAX_FIELDS)?;
        if end as u64 > record_bytes {
            return Err(Error::bad_input(format!(
                "fields take {end} bytes, more than the record length of {record_bytes}"
            )));
        }
        let path = path.to_path_buf();
        let deleted = 0;
        Ok(Self {
            pages,
            path,
            schema,
            columns,
            encoding,
            header_bytes,
            record_bytes,
            records,
            deleted,
        })
    }

    pub(crate) fn schema(&self) -> &[FieldDefinition] {
        &self.schema
    }

    /// Number of deleted records skipped.
    pub(crate) fn deleted(&self) -> u64 {
        self.deleted
    }

    /// The values of a record; `None` if it is deleted.
    pub(crate) fn get(&mut self, record: u64) -> Result<Option<FeatureProperties>> {
        self.try_get(record).map_err(|e| e.in_file(&self.path))
    }

    fn try_get(&mut self, record: u64) -> Result<Option<FeatureProperties>> {
        if record >= self.records {
            return Err(Error::bad_input(format!(
                "has {} records, fewer than the .shp has shapes",
                self.records
            ))
            .remedy("repair the files, or move the .dbf away to read geometries only"));
        }
        let offset = self.header_bytes + record * self.record_bytes;
        let bytes = self.pages.get(offset, self.record_bytes)?;
        if bytes[0] == DELETED {
            self.deleted += 1;
            return Ok(None);
        }
        let mut properties = FeatureProperties::default();
        properties.0.reserve(self.schema.len());
        let mut start = 1;
        for (field, &(kind, end)) in self.schema.iter().zip(&self.columns) {
            let value = value(field, kind, &bytes[start..end], &self.encoding);
            let value = value.map_err(|e| match e.kind() {
                terrane_base::ErrorKind::BadInput => {
                    Error::bad_input(format!("field {:?}: {e}", field.name))
                }
                _ => e,
            })?;
            properties.0.push((field.name.clone(), value));
            start = end;
        }
        Ok(Some(properties))
    }
}

/// The field of a descriptor.
fn field(description: &[u8; 32], encoding: &TextEncoding) -> Result<FieldDefinition> {
    let name = description[..11].split(|&byte| byte == 0).next().unwrap_or_default();
    let name = encoding.text(name)?.trim().into();
    let (width, decimals) = (u32::from(description[16]), u32::from(description[17]));
    let kind = match description[11].to_ascii_uppercase() {
        b'L' => FieldKind::Bool,
        b'D' => FieldKind::Date,
        b'N' if decimals == 0 => FieldKind::Int,
        b'N' | b'F' => FieldKind::Real,
        b'C' => FieldKind::Text,
        other => {
            let other = char::from(other);
            return Err(Error::unsupported(format!("fields of type {other:?} are not supported"))
                .remedy("move the .dbf away to read geometries only"));
        }
    };
    Ok(FieldDefinition { name, kind, width: Some(width), decimals: Some(decimals) })
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | 0)
}

fn wrong(bytes: &[u8], what: &str) -> Error {
    let text: String = String::from_utf8_lossy(bytes).chars().take(40).collect();
    Error::bad_input(format!("{text:?} is not a {what}"))
}

fn value(
    field: &FieldDefinition,
    kind: u8,
    bytes: &[u8],
    encoding: &TextEncoding,
) -> Result<PropertyValue> {
    let end = bytes.iter().rposition(|byte| !is_blank(*byte)).map_or(0, |last| last + 1);
    // Numbers are right-aligned, text left-aligned.
    let bytes = &bytes[..end];
    let plain = &bytes[bytes.iter().take_while(|byte| is_blank(**byte)).count()..];
    match kind {
        b'C' if bytes.is_empty() => Ok(PropertyValue::Null),
        b'C' => Ok(PropertyValue::Text(encoding.text(bytes)?.into_owned())),
        b'L' => match plain {
            b"T" | b"t" | b"Y" | b"y" | b"1" => Ok(PropertyValue::Bool(true)),
            b"F" | b"f" | b"N" | b"n" | b"0" => Ok(PropertyValue::Bool(false)),
            b"" | b"?" => Ok(PropertyValue::Null),
            _ => Err(wrong(plain, "logical value")),
        },
        b'D' => match plain {
            b"" | b"00000000" => Ok(PropertyValue::Null),
            _ => date(plain).map(PropertyValue::Date).ok_or_else(|| {
                wrong(plain, "valid date (YYYYMMDD)").remedy("correct the date, or clear the field")
            }),
        },
        // dBASE writes asterisks for numbers that do not fit.
        _ if plain.iter().all(|&byte| byte == b'*') => Ok(PropertyValue::Null),
        _ => number(plain, field.kind).ok_or_else(|| wrong(plain, "number")),
    }
}

/// A date from its eight digits.
fn date(digits: &[u8]) -> Option<String> {
    let digits = std::str::from_utf8(digits).ok().filter(|digits| digits.len() == 8)?;
    let day = format!("{}-{}-{}", digits.get(..4)?, digits.get(4..6)?, digits.get(6..)?);
    is_date(&day).then_some(day)
}

/// A number of a numeric field; an integer if it is written as one in an integer field.
fn number(text: &[u8], kind: FieldKind) -> Option<PropertyValue> {
    let whole = std::str::from_utf8(text).ok().and_then(|text| text.parse().ok());
    match whole {
        Some(whole) if kind == FieldKind::Int => Some(PropertyValue::Int(whole)),
        _ => decimal::whole(text).filter(|v| v.is_finite()).map(PropertyValue::Real),
    }
}
