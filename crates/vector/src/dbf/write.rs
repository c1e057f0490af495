//! Writer of dBASE tables with known columns.

use super::read::{HEADER_BYTES, HEADER_END};
use crate::feature::{FieldKind, PropertyValue};
use crate::out::VectorOutputFile;
use crate::table::{FeatureColumn, push_text};
use terrane_base::error::{Error, ErrorKind, Result};

/// Mapping of columns to fields.
pub(crate) struct DbfTablePlan {
    fields: Vec<FieldPlan>,
    /// Record length in bytes.
    record: usize,
    /// True if there are no columns: the table gets a numbered field, since it needs one.
    is_numbered: bool,
}

struct FieldPlan {
    name: String,
    letter: u8,
    width: usize,
    decimals: usize,
    kind: FieldKind,
}

impl DbfTablePlan {
    /// Maximum length of a value as text, in bytes.
    pub(crate) const MOST: usize = 254;

    /// Plans the fields for `columns`; notes list renamed fields.
    pub(crate) fn new(columns: &[FeatureColumn], notes: &mut Vec<String>) -> Result<Self> {
        let number = FeatureColumn {
            name: "FID".into(),
            kind: Some(FieldKind::Int),
            width: 11,
            decimals: 0,
        };
        let is_numbered = columns.is_empty();
        let columns = if is_numbered { std::slice::from_ref(&number) } else { columns };
        let mut fields: Vec<FieldPlan> = Vec::new();
        let mut renamed = Vec::new();
        for column in columns {
            let name = unique(&column.name, &fields)?;
            if *name != *column.name {
                renamed.push(format!("{} is {name}", column.name));
            }
            fields.push(plan(column, name)?);
        }
        if !renamed.is_empty() {
            notes.push(format!("field names truncated to 10 bytes: {}", renamed.join(", ")));
        }
        let record = 1 + fields.iter().map(|field| field.width).sum::<usize>();
        let header = HEADER_BYTES as usize * (fields.len() + 1) + 1;
        if record.max(header) > usize::from(u16::MAX) {
            let message = format!("{} properties exceed the record size of dBASE", fields.len());
            return Err(
                Error::new(ErrorKind::CannotWrite, message).remedy("write FlatGeobuf or GeoJSON")
            );
        }
        Ok(Self { fields, record, is_numbered })
    }
}

/// A unique field name of at most ten bytes.
fn unique(name: &str, fields: &[FieldPlan]) -> Result<String> {
    let numbered = (1..10_000).map(|n| {
        let tail = format!("_{n}");
        format!("{}{tail}", truncated(name, 10 - tail.len()))
    });
    let mut names = std::iter::once(truncated(name, 10).to_owned()).chain(numbered);
    let free = names.find(|name| {
        !name.is_empty() && !fields.iter().any(|field| field.name.eq_ignore_ascii_case(name))
    });
    free.ok_or_else(|| {
        Error::new(
            ErrorKind::CannotWrite,
            format!("no unique field name of 10 bytes is available for {name:?}"),
        )
    })
}

/// The characters of a name that fit in `max` bytes.
fn truncated(name: &str, max: usize) -> &str {
    let ends = name.char_indices().map(|(at, c)| at + c.len_utf8());
    &name[..ends.take_while(|&end| end <= max).last().unwrap_or(0)]
}

fn plan(column: &FeatureColumn, name: String) -> Result<FieldPlan> {
    let kind = column.kind.unwrap_or(FieldKind::Text);
    let (letter, width, decimals) = match kind {
        FieldKind::Bool => (b'L', 1, 0),
        FieldKind::Date => (b'D', 8, 0),
        FieldKind::Int => (b'N', column.width.max(1), 0),
        FieldKind::Real => {
            let decimals = column.decimals.clamp(1, 15);
            (b'N', column.width.max(decimals + 2), decimals)
        }
        FieldKind::Text | FieldKind::DateTime | FieldKind::Json => {
            (b'C', column.width.clamp(1, DbfTablePlan::MOST), 0)
        }
    };
    Ok(FieldPlan { name, letter, width: width.min(255), decimals, kind })
}

/// Writes a table of `records` records; values are requested record by record.
pub(crate) fn write(
    out: &mut VectorOutputFile,
    plan: &DbfTablePlan,
    records: u32,
    mut values: impl FnMut(u32) -> Result<Vec<(usize, PropertyValue)>>,
) -> Result<()> {
    head(&mut out.buffer, plan, records);
    let mut offsets = Vec::new();
    let mut end = 1;
    for field in &plan.fields {
        offsets.push(end);
        end += field.width;
    }
    let mut text = Vec::new();
    for record in 0..records {
        let mut values = values(record)?;
        if plan.is_numbered {
            values.push((0, PropertyValue::Int(record.into())));
        }
        let start = out.buffer.len();
        out.buffer.resize(start + plan.record, b' ');
        for (at, value) in values {
            let (field, offset) = (&plan.fields[at], start + offsets[at]);
            text.clear();
            field_text(field, &value, &mut text);
            if text.len() > field.width {
                let (name, width) = (&field.name, field.width);
                let message = format!("field {name:?}: value exceeds {width} bytes");
                return Err(Error::new(ErrorKind::CannotWrite, message)
                    .at(format!("feature {}", record + 1))
                    .remedy("write FlatGeobuf or GeoJSON"));
            }
            // Numbers are right-aligned.
            let indent = if field.letter == b'N' { field.width - text.len() } else { 0 };
            out.buffer[offset + indent..][..text.len()].copy_from_slice(&text);
        }
        out.settle()?;
    }
    // End-of-file marker.
    out.buffer.push(0x1a);
    out.settle()
}

fn field_text(field: &FieldPlan, value: &PropertyValue, text: &mut Vec<u8>) {
    match (field.kind, value) {
        (FieldKind::Bool, PropertyValue::Bool(value)) => {
            text.push(if *value { b'T' } else { b'F' })
        }
        (FieldKind::Bool, _) => text.push(b'?'),
        (FieldKind::Date, PropertyValue::Date(day)) => {
            text.extend(day.bytes().filter(|&b| b != b'-'))
        }
        _ => push_text(value, text),
    }
}

fn head(out: &mut Vec<u8>, plan: &DbfTablePlan, records: u32) {
    let header = HEADER_BYTES as usize * (plan.fields.len() + 1) + 1;
    // A fixed date of last update (1 January 2000) makes output reproducible.
    out.extend_from_slice(&[3, 100, 1, 1]);
    out.extend_from_slice(&records.to_le_bytes());
    out.extend_from_slice(&(header as u16).to_le_bytes());
    out.extend_from_slice(&(plan.record as u16).to_le_bytes());
    out.resize(out.len() + 20, 0);
    for field in &plan.fields {
        let mut description = [0; HEADER_BYTES as usize];
        description[..field.name.len()].copy_from_slice(field.name.as_bytes());
        description[11] = field.letter;
        description[16] = field.width as u8;
        description[17] = field.decimals as u8;
        out.extend_from_slice(&description);
    }
    out.push(HEADER_END);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str) -> FeatureColumn {
        FeatureColumn { name: name.into(), kind: None, width: 0, decimals: 0 }
    }

    #[test]
    fn names_are_cut_and_stay_different() {
        let names =
            ["population_total", "population_today", "POPULATION", "éééééééé", "", "", "id"];
        let columns: Vec<FeatureColumn> = names.iter().map(|name| column(name)).collect();
        let mut notes = Vec::new();
        let plan = DbfTablePlan::new(&columns, &mut notes).unwrap();
        let found: Vec<&str> = plan.fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(found, ["population", "populati_1", "POPULATI_2", "ééééé", "_1", "_2", "id"]);
        assert!(notes[0].contains("population_today is populati_1"), "{notes:?}");
    }

    #[test]
    fn too_many_fields_are_refused() {
        let columns: Vec<FeatureColumn> = (0..3000).map(|n| column(&format!("f{n}"))).collect();
        assert!(DbfTablePlan::new(&columns, &mut Vec::new()).is_err());
    }
}
