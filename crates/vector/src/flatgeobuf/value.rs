//! Property values: column index, and bytes of the column's type.

use crate::feature::FieldDefinition;
use crate::feature::{FeatureProperties, FieldKind, PropertyValue, is_date};
use crate::pages::RecordBytes;
use crate::table::push_text;
use terrane_base::error::{Error, Result};

/// Codes of the column types that are written.
const BOOL: u8 = 2;
const LONG: u8 = 7;
const DOUBLE: u8 = 10;
const TEXT: u8 = 11;
const JSON: u8 = 12;
const DATE_TIME: u8 = 13;
/// Binary data, skipped.
pub(super) const BINARY: u8 = 14;

/// The column type for a field type. Dates have no type of their own.
pub(super) fn type_of(kind: FieldKind) -> u8 {
    match kind {
        FieldKind::Bool => BOOL,
        FieldKind::Int => LONG,
        FieldKind::Real => DOUBLE,
        FieldKind::Text => TEXT,
        FieldKind::Json => JSON,
        FieldKind::Date | FieldKind::DateTime => DATE_TIME,
    }
}

/// Field type of a column type.
pub(super) fn kind_of(code: u8) -> Result<FieldKind> {
    match code {
        BOOL => Ok(FieldKind::Bool),
        0 | 1 | 3..=8 => Ok(FieldKind::Int),
        9 | DOUBLE => Ok(FieldKind::Real),
        TEXT | BINARY => Ok(FieldKind::Text),
        JSON => Ok(FieldKind::Json),
        DATE_TIME => Ok(FieldKind::DateTime),
        _ => Err(Error::unsupported(format!("column type {code} is not supported"))),
    }
}

/// The properties in `bytes`, one per column; missing ones are null. The last result is true if binary values
/// were skipped.
pub(super) fn properties(
    bytes: &[u8],
    fields: &[FieldDefinition],
    types: &[u8],
) -> Result<(FeatureProperties, bool)> {
    let nulls = fields.iter().map(|field| (field.name.clone(), PropertyValue::Null));
    let mut found = FeatureProperties(nulls.collect());
    let mut bytes = RecordBytes(bytes);
    let mut has_binary = false;
    while !bytes.0.is_empty() {
        let column = usize::from(bytes.u16()?);
        let code = types.get(column).ok_or_else(|| {
            Error::bad_input(format!(
                "property of column {column}, but the file has {} columns",
                types.len()
            ))
        })?;
        has_binary |= *code == BINARY;
        found.0[column].1 = value(*code, &mut bytes)?;
    }
    Ok((found, has_binary))
}

fn real(value: f64) -> PropertyValue {
    if value.is_finite() { PropertyValue::Real(value) } else { PropertyValue::Null }
}

fn value(code: u8, bytes: &mut RecordBytes<'_>) -> Result<PropertyValue> {
    Ok(match code {
        0 => PropertyValue::Int(i8::from_le_bytes(bytes.array()?).into()),
        1 => PropertyValue::Int(bytes.u8()?.into()),
        BOOL => PropertyValue::Bool(bytes.u8()? != 0),
        3 => PropertyValue::Int(i16::from_le_bytes(bytes.array()?).into()),
        4 => PropertyValue::Int(bytes.u16()?.into()),
        5 => PropertyValue::Int(i32::from_le_bytes(bytes.array()?).into()),
        6 => PropertyValue::Int(bytes.u32()?.into()),
        LONG => PropertyValue::Int(i64::from_le_bytes(bytes.array()?)),
        8 => {
            let value = bytes.u64()?;
            i64::try_from(value)
                .map_or_else(|_| PropertyValue::Json(value.to_string()), PropertyValue::Int)
        }
        9 => real(f32::from_le_bytes(bytes.array()?).into()),
        DOUBLE => real(bytes.f64()?),
        _ => {
            let length = bytes.u32()? as usize;
            let taken = bytes.take(length)?;
            if code == BINARY {
                return Ok(PropertyValue::Null);
            }
            let text = std::str::from_utf8(taken);
            let text = text.map_err(|_| Error::bad_input("text is not UTF-8"))?.to_owned();
            match code {
                JSON => PropertyValue::Json(sound(text)?),
                DATE_TIME if is_date(&text) => PropertyValue::Date(text),
                DATE_TIME => PropertyValue::DateTime(text),
                _ => PropertyValue::Text(text),
            }
        }
    })
}

/// Validated JSON on one line.
fn sound(json: String) -> Result<String> {
    match serde_json::from_str::<serde::de::IgnoredAny>(&json) {
        Ok(_) => Ok(crate::json::compact(&json)),
        Err(e) => Err(Error::bad_input(format!("property is not JSON: {e}"))),
    }
}

/// Appends a value of a column of `kind`; nothing for null.
pub(super) fn put(column: u16, kind: FieldKind, value: &PropertyValue, out: &mut Vec<u8>) {
    if *value == PropertyValue::Null {
        return;
    }
    out.extend_from_slice(&column.to_le_bytes());
    match (kind, value) {
        (FieldKind::Bool, PropertyValue::Bool(value)) => out.push(u8::from(*value)),
        (FieldKind::Int, PropertyValue::Int(value)) => out.extend_from_slice(&value.to_le_bytes()),
        (FieldKind::Real, PropertyValue::Real(value)) => {
            out.extend_from_slice(&value.to_le_bytes())
        }
        (FieldKind::Real, PropertyValue::Int(value)) => {
            out.extend_from_slice(&(*value as f64).to_le_bytes());
        }
        _ => {
            let at = out.len();
            out.extend_from_slice(&[0; 4]);
            push_text(value, out);
            // A text beyond 4 GiB fails with its feature, which is even longer.
            let length = (out.len() - at - 4) as u32;
            out[at..at + 4].copy_from_slice(&length.to_le_bytes());
        }
    }
}
