//! Writes records into a folder of files, one for each value of an attribute.

use std::collections::HashMap;
use std::path::Path;

use super::stages::column;
use super::tiled_output::holds_only;
use crate::records::{PointRecords, RecordFlow, total};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Ruler;
use terrane_cloud::write::{PointColumn, PointPacking};
use terrane_cloud::{AXES, PointFormat};
use terrane_engine::plan::RunControl;
use terrane_files::Buckets;

/// Most files: the number of 16-bit values, for point source ids.
pub(super) const MAX_FILES: usize = 1 << 16;
/// Longest name of a value; longer ones are written with an exponent.
const LONGEST: usize = 24;
/// Part of the file name for points without a value.
const NONE: &str = "none";

/// A split of points by an attribute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AttributeSplit {
    /// Name of a standard attribute or of extra bytes.
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

/// The column of the attribute.
pub(super) struct SplitColumn {
    column: PointColumn,
    ruler: Option<Ruler>,
}

impl SplitColumn {
    /// The column of records of a format with these columns.
    ///
    /// # Errors
    /// An unknown name, or a coordinate.
    pub(super) fn new(
        split: &AttributeSplit,
        format: PointFormat,
        columns: &[PointColumn],
    ) -> Result<Self> {
        let name = split.attribute.trim().trim_matches('"');
        if AXES.iter().any(|axis| name.eq_ignore_ascii_case(axis)) {
            return Err(Error::usage(format!("{name} is a coordinate, not an attribute"))
                .remedy("pass ‹tile› SIDE to split by position"));
        }
        let column = column(name, format, columns)?;
        Ok(Self { ruler: column.ruler(), column })
    }

    /// The key of the value of a record: both zeros are the same, and so are missing values.
    fn key(&self, record: &[u8]) -> u64 {
        let value = match &self.ruler {
            Some(ruler) => self.column.decimal(record, ruler),
            None => self.column.number(record),
        };
        // NaN has many bits: each would be a file, all of one name. -0 + 0 is 0.
        (if value.is_nan() { f64::NAN } else { value + 0.0 }).to_bits()
    }

    /// The file name of a value, without extension.
    fn name(&self, key: u64) -> String {
        let value = f64::from_bits(key);
        let value = match value.to_string() {
            _ if value.is_nan() => NONE.to_owned(),
            text if text.len() > LONGEST => format!("{value:e}"),
            text => text,
        };
        format!("{}{value}", self.prefix())
    }

    /// Prefix of file names: the attribute.
    fn prefix(&self) -> String {
        let name = self.column.name().trim();
        name.replace(|c: char| !c.is_alphanumeric() && !"-.".contains(c), "_") + "_"
    }

    /// Whether a folder only has files of values of this attribute written by terrane.
    pub(super) fn is_ours(&self, folder: &Path) -> bool {
        let prefix = self.prefix();
        holds_only(folder, |stem| {
            let value = stem.strip_prefix(&prefix);
            value.is_some_and(|value| value == NONE || value.parse::<f64>().is_ok())
        })
    }

    /// Distributes all records to buckets, one for each value; returns the values as file names without
    /// extension, by bucket.
    pub(super) fn distribute(
        &self,
        records: &dyn PointRecords,
        flow: RecordFlow,
        buckets: &Buckets<u8>,
        at: RunControl<'_>,
    ) -> Result<Vec<String>> {
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
                if number >= MAX_FILES {
                    return Err(self.too_many());
                }
                buckets.push(number, record)
            })
        })?;
        at.progress.end();
        Ok(keys.into_iter().map(|key| self.name(key)).collect())
    }

    fn too_large(&self) -> Error {
        let name = self.column.name();
        Error::unsupported(format!(
            "‹split›: {name} has integers beyond 2^53, which doubles do not hold exactly"
        ))
        .remedy("split by an attribute with smaller values, such as point_source_id")
    }

    fn too_many(&self) -> Error {
        let name = self.column.name();
        Error::usage(format!("‹split›: {name} has more than {MAX_FILES} values (one file each)"))
            .remedy("split by an attribute with fewer values, such as point_source_id")
    }
}
