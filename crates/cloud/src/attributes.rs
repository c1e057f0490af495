//! Points in batches: positions, and the attributes that were asked for as columns of numbers.

use terrane_base::attribute::{self, CLASS, RETURN, RETURNS};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, Ruler};

use super::column::PointColumn;
use super::raw::RawPoint;
use super::source::{BATCH, PointConsumer};

/// Attributes of every point source.
const COMMON: [(&str, AttributeReader); 4] = [
    (CLASS, AttributeReader::Class),
    (RETURN, AttributeReader::Number),
    (RETURNS, AttributeReader::Returns),
    (CLASS_FLAGS, AttributeReader::Flags),
];

/// Name of the attribute of the [`Flags`](crate::Flags) of a point.
pub const CLASS_FLAGS: &str = "class_flags";

/// A batch of points with the selected attributes.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointBatch<'a> {
    /// Positions in the frame of the cloud, at most [`BATCH`].
    pub positions: &'a [Point],
    /// A column for each selected attribute, in the order of their names; NaN is nodata.
    pub attributes: &'a [Vec<f64>],
}

/// Attributes selected from a source of points; none by default.
#[derive(Clone, Debug, Default)]
pub struct AttributeSelection {
    /// For each file; all are equally long.
    files: Vec<Vec<AttributeReader>>,
}

impl AttributeSelection {
    /// For the files of a source.
    pub(crate) fn new(files: Vec<Vec<AttributeReader>>) -> Self {
        Self { files }
    }

    /// For a source that is one file.
    pub(crate) fn of_one(names: &[String], columns: &[PointColumn]) -> Result<Self> {
        Ok(Self { files: vec![readers(names, columns)?] })
    }

    /// The readers of a file.
    pub(crate) fn of_file(&self, file: usize) -> &[AttributeReader] {
        self.files.get(file).map_or(&[], Vec::as_slice)
    }

    /// The columns of whole records that are read.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &PointColumn> {
        self.files.iter().flatten().filter_map(AttributeReader::column)
    }
}

/// Location of an attribute of a point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum AttributeReader {
    Class,
    Number,
    Returns,
    Flags,
    /// An attribute that a file lacks.
    Absent,
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
            Self::Flags => raw.flags().0.into(),
            Self::Absent => f64::NAN,
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

/// As [`readers`], where an attribute may be absent.
pub(crate) fn readers_or_absent(names: &[String], columns: &[PointColumn]) -> Vec<AttributeReader> {
    let readers = names.iter().map(|asked| reader(asked, columns));
    readers.map(|reader| reader.unwrap_or(AttributeReader::Absent)).collect()
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

/// The points of a batch, while it is filled.
pub(crate) struct PointTable<'a> {
    pub(crate) positions: Vec<Point>,
    readers: &'a [AttributeReader],
    columns: Vec<Vec<f64>>,
}

impl<'a> PointTable<'a> {
    /// An empty one; `positions` is a buffer.
    pub(crate) fn new(mut positions: Vec<Point>, readers: &'a [AttributeReader]) -> Self {
        positions.clear();
        Self { positions, readers, columns: vec![Vec::new(); readers.len()] }
    }

    /// Whether it has positions alone.
    pub(crate) fn is_plain(&self) -> bool {
        self.readers.is_empty()
    }

    /// Appends a point with its record, which only some readers need; passes on a full batch.
    #[inline(always)]
    pub(crate) fn push<R: RawPoint>(
        &mut self,
        point: Point,
        raw: R,
        record: &[u8],
        each: &mut PointConsumer<'_>,
    ) -> Result<()> {
        self.positions.push(point);
        for (column, reader) in self.columns.iter_mut().zip(self.readers) {
            column.push(reader.value(raw, record));
        }
        if self.positions.len() < BATCH { Ok(()) } else { self.flush(each) }
    }

    /// Passes the points on and removes them.
    pub(crate) fn flush(&mut self, each: &mut PointConsumer<'_>) -> Result<()> {
        // Without attributes there may be more points than in a batch.
        let done = self
            .positions
            .chunks(BATCH)
            .try_for_each(|positions| each(PointBatch { positions, attributes: &self.columns }));
        self.positions.clear();
        self.columns.iter_mut().for_each(Vec::clear);
        done
    }
}
