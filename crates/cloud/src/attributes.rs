//! Attributes of points as numeric columns, independent of the file format.

use terrane_base::attribute::{self, CLASS, RETURN, RETURNS};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, Ruler};

use super::column::PointColumn;
use super::raw::RawPoint;
use super::source::Each;

/// Attributes of every point source.
const COMMON: [(&str, AttributeReader); 3] = [
    (CLASS, AttributeReader::Class),
    (RETURN, AttributeReader::Number),
    (RETURNS, AttributeReader::Returns),
];

/// Location of an attribute of a point.
#[derive(Clone, Debug)]
pub(crate) enum AttributeReader {
    Class,
    Number,
    Returns,
    /// A field of the whole record.
    Field(PointColumn),
}

impl AttributeReader {
    /// Whether it needs whole records.
    pub(crate) fn needs_record(&self) -> bool {
        self.column().is_some()
    }

    /// Its column in the whole record, if it needs one.
    pub(crate) fn column(&self) -> Option<&PointColumn> {
        match self {
            Self::Field(column) => Some(column),
            _ => None,
        }
    }

    #[inline(always)]
    fn value<R: RawPoint>(&self, raw: R, record: &[u8]) -> f64 {
        match self {
            Self::Class => raw.class().into(),
            Self::Number => raw.returns()[0].into(),
            Self::Returns => raw.returns()[1].into(),
            Self::Field(column) => column.number(record),
        }
    }

    /// The value; scaled integers are returned as the decimal that they stand for.
    pub(crate) fn decimal<R: RawPoint>(&self, raw: R, record: &[u8], ruler: Option<&Ruler>) -> f64 {
        match (self, ruler) {
            (Self::Field(column), Some(ruler)) => column.decimal(record, ruler),
            _ => self.value(raw, record),
        }
    }
}

/// Readers of the named attributes for records with these columns.
///
/// # Errors
/// Errors of [`reader`].
pub(crate) fn readers(names: &[String], columns: &[PointColumn]) -> Result<Vec<AttributeReader>> {
    names.iter().map(|asked| reader(asked, columns)).collect()
}

/// The reader of the attribute with this name or alias, for records with these columns.
///
/// # Errors
/// An unknown attribute; the message lists the known ones.
pub(crate) fn reader(name: &str, columns: &[PointColumn]) -> Result<AttributeReader> {
    // Names of the file come before aliases, which may hide one of them.
    let by_name = reader_by_name(name, columns);
    let reader = by_name.or_else(|| reader_by_name(attribute::known(name.trim())?.name, columns));
    reader.ok_or_else(|| {
        let common = COMMON.iter().map(|(name, _)| *name);
        let fields = columns.iter().map(|column| column.name.as_str());
        let fields = fields.filter(|name| COMMON.iter().all(|(common, _)| common != name));
        let all: Vec<&str> = common.chain(fields).collect();
        Error::usage(format!("the points have no attribute \"{name}\""))
            .remedy(format!("available attributes: {}", all.join(", ")))
    })
}

/// As [`reader`], without aliases.
fn reader_by_name(name: &str, columns: &[PointColumn]) -> Option<AttributeReader> {
    if let Some((_, reader)) = COMMON.iter().find(|(common, _)| is_same_name(common, name)) {
        return Some(reader.clone());
    }
    let column = columns.iter().find(|column| is_same_name(&column.name, name))?;
    Some(AttributeReader::Field(column.clone()))
}

fn is_same_name(a: &str, b: &str) -> bool {
    a.trim().eq_ignore_ascii_case(b.trim())
}

/// A batch of points with their columns.
pub(crate) struct AttributeTable<'a> {
    readers: &'a [AttributeReader],
    points: Vec<Point>,
    columns: Vec<Vec<f64>>,
}

impl<'a> AttributeTable<'a> {
    pub(crate) fn new(readers: &'a [AttributeReader]) -> Self {
        Self { readers, points: Vec::new(), columns: vec![Vec::new(); readers.len()] }
    }

    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// Appends a point with its record, which only some readers need.
    #[inline(always)]
    pub(crate) fn push<R: RawPoint>(&mut self, point: Point, raw: R, record: &[u8]) {
        self.points.push(point);
        for (column, reader) in self.columns.iter_mut().zip(self.readers) {
            column.push(reader.value(raw, record));
        }
    }

    /// Passes the points on and clears the batch.
    pub(crate) fn flush(&mut self, each: &mut Each<'_>) -> Result<()> {
        let done = if self.points.is_empty() { Ok(()) } else { each(&self.points, &self.columns) };
        self.points.clear();
        self.columns.iter_mut().for_each(Vec::clear);
        done
    }
}
