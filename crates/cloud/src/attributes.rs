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
pub(crate) fn reader(asked: &str, columns: &[PointColumn]) -> Result<AttributeReader> {
    let own = |name: &str| {
        let is_it = |own: &str| own.trim().eq_ignore_ascii_case(name.trim());
        let common = COMMON.iter().find(|(own, _)| is_it(own)).map(|(_, reader)| reader.clone());
        let field = || columns.iter().find(|column| is_it(&column.name)).cloned();
        common.or_else(|| field().map(AttributeReader::Field))
    };
    let known = || own(attribute::known(asked.trim())?.name);
    own(asked).or_else(known).ok_or_else(|| {
        let common = COMMON.iter().map(|(name, _)| *name);
        let own = columns.iter().map(|column| column.name.as_str());
        let own = own.filter(|name| COMMON.iter().all(|(common, _)| common != name));
        let all: Vec<&str> = common.chain(own).collect();
        Error::usage(format!("the points have no attribute \"{asked}\""))
            .remedy(format!("available attributes: {}", all.join(", ")))
    })
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
