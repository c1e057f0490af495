//! Records into a folder of files, one for each value of an attribute.

use std::collections::HashMap;
use std::path::Path;

use super::assign::column;
use super::squares::{FilledBuckets, SplitFiles, ending, holds_only};
use crate::records::{PointRecords, RecordFlow, total};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Ruler;
use terrane_cloud::write::{CloudWriteOptions, PointColumn, PointPacking};
use terrane_cloud::{AXES, PointFormat};
use terrane_engine::plan::RunControl;
use terrane_files::Buckets;

/// Most files: as many as there are values of 16 bits, which point sources have.
const MOST_FILES: usize = 1 << 16;
/// Longest name of a value; longer ones are written with an exponent.
const LONGEST: usize = 24;
/// What stands in a name for the points without a value.
const NONE: &str = "none";

/// How points are divided by an attribute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AttributeSplit {
    /// Its name: of the standard, or of extra bytes.
    pub attribute: String,
    /// True for files that are not compressed.
    pub is_plain: bool,
}

impl AttributeSplit {
    /// How the files are packed.
    pub(super) fn packing(&self) -> PointPacking {
        if self.is_plain { PointPacking::Plain } else { PointPacking::Chunks }
    }
}

/// Where the values are that records are divided by.
pub(super) struct SplitColumn {
    column: PointColumn,
    ruler: Option<Ruler>,
}

impl SplitColumn {
    /// Of records of a format that have these columns.
    ///
    /// # Errors
    /// A name of none of them, or of a coordinate.
    pub(super) fn new(
        split: &AttributeSplit,
        (format, columns): (PointFormat, &[PointColumn]),
    ) -> Result<Self> {
        let name = split.attribute.trim().trim_matches('"');
        if AXES.iter().any(|axis| name.eq_ignore_ascii_case(axis)) {
            return Err(Error::usage(format!("{name} is a coordinate, not an attribute"))
                .remedy("divide points by place with ‹tile› SIDE"));
        }
        let column = column(name, format, columns)?;
        Ok(Self { ruler: column.ruler(), column })
    }

    /// The value of a record, as it is told apart from others: zeros are one, and so are missing values.
    fn key(&self, record: &[u8]) -> u64 {
        let value = match &self.ruler {
            Some(ruler) => self.column.decimal(record, ruler),
            None => self.column.number(record),
        };
        // NaN has many bits: each would be a file, all of one name. -0 + 0 is 0.
        (if value.is_nan() { f64::NAN } else { value + 0.0 }).to_bits()
    }

    /// The name of the file with a value, without its ending.
    fn name(&self, key: u64) -> String {
        let value = f64::from_bits(key);
        let value = match value.to_string() {
            _ if value.is_nan() => NONE.to_owned(),
            text if text.len() > LONGEST => format!("{value:e}"),
            text => text,
        };
        format!("{}{value}", self.prefix())
    }

    /// What names of files begin with: the attribute.
    fn prefix(&self) -> String {
        let plain = |c: char| if c.is_alphanumeric() || "-.".contains(c) { c } else { '_' };
        self.column.name().trim().chars().map(plain).chain(['_']).collect()
    }

    /// Whether a folder holds nothing but files of values of this attribute that terrane wrote.
    pub(super) fn is_ours(&self, folder: &Path) -> bool {
        let (prefix, is_value) =
            (self.prefix(), |value: &str| value == NONE || value.parse::<f64>().is_ok());
        holds_only(folder, |stem| stem.strip_prefix(&prefix).is_some_and(is_value))
    }

    /// Writes all records into a folder; they wait in `waiting` beyond so many bytes.
    pub(super) fn write(
        &self,
        records: &dyn PointRecords,
        (flow, threads): (RecordFlow, usize),
        (folder, options): (&Path, &CloudWriteOptions),
        (waiting, memory): (&Path, u64),
        at: RunControl<'_>,
    ) -> Result<SplitFiles> {
        let buckets = Buckets::new(waiting, MOST_FILES, memory);
        let (mut numbers, mut keys) = (HashMap::new(), Vec::new());
        at.progress.begin("values", total(records));
        flow.run(records, at, &mut |bytes| {
            bytes.chunks_exact(flow.record).try_for_each(|record| {
                if !self.column.is_exact(record) {
                    return Err(self.too_large());
                }
                let key = self.key(record);
                let number = *numbers.entry(key).or_insert_with(|| {
                    keys.push(key);
                    keys.len() - 1
                });
                if number >= MOST_FILES {
                    return Err(self.too_many());
                }
                buckets.push(number, record)
            })
        })?;
        at.progress.end();
        let ending = ending(options.packing);
        let name = |number: usize| folder.join(format!("{}.{ending}", self.name(keys[number])));
        let all = FilledBuckets { buckets: &buckets, count: keys.len(), options };
        all.write((flow.record, threads), name, at)
    }

    fn too_large(&self) -> Error {
        let name = self.column.name();
        Error::unsupported(format!(
            "‹split›: {name} has whole numbers beyond 2^53, where doubles skip some"
        ))
        .remedy("split by an attribute of smaller numbers, such as point_source_id")
    }

    fn too_many(&self) -> Error {
        let name = self.column.name();
        Error::usage(format!("‹split›: {name} has more than {MOST_FILES} values, each a file"))
            .remedy("split by an attribute of fewer values, such as point_source_id")
    }
}
