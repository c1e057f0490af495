//! Attributes by the position of each point: values of polygons or grids.

use std::path::{Path, PathBuf};

use super::operand::{at_record, column};
use super::{OpenStage, StageContext, StageInput, StageOutput};
use crate::records::selection::place;
use crate::records::{EachRecord, PointRecords};
use terrane_base::attribute;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, Ruler};
use terrane_cloud::write::PointColumn;
use terrane_cloud::{AXES, NewDimension, NewDimensionValue};

/// Longest name of a new dimension, in bytes.
const MAX_NAME: usize = 32;

/// Values by x and y, such as those of polygons or a grid.
pub(super) trait PositionValues: Send + Sync {
    /// The values at the place of a point, in the order of the columns; NaN for none, which changes nothing.
    ///
    /// # Errors
    /// Those of reading.
    fn values(&self, at: Point, out: &mut [f64]) -> Result<()>;

    /// Bytes that it holds.
    fn bytes(&self) -> u64;
}

/// A stage that sets columns to values of a file.
pub(super) struct ValueLookup<V> {
    columns: Vec<PointColumn>,
    values: V,
    path: PathBuf,
    rulers: [Ruler; 3],
    notes: Vec<String>,
}

impl<V: PositionValues> ValueLookup<V> {
    /// Sets the attributes of these names to values of the file.
    ///
    /// # Errors
    /// An unknown name.
    pub(super) fn new(
        names: &[impl AsRef<str>],
        values: V,
        path: &Path,
        input: &StageInput<'_>,
    ) -> Result<Self> {
        let columns = names.iter().map(|name| column(name.as_ref(), input.format, input.added));
        let columns = columns.collect::<Result<_>>()?;
        let new = names.iter().filter(|name| (input.is_new)(name.as_ref()));
        // The name may be mistyped.
        let notes = new.map(|name| format!("stages: {} is a new dimension", name.as_ref()));
        let notes = notes.collect();
        let rulers = [0, 1, 2].map(|axis| input.info.frame.ruler(axis));
        Ok(Self { columns, values, path: path.to_path_buf(), rulers, notes })
    }

    /// The error of a value that does not fit.
    fn failure(&self, record: &[u8], what: String) -> Error {
        at_record(Error::bad_input(what), &self.rulers, record)
            .in_file(&self.path)
            .remedy("choose another attribute or value in the stage")
    }
}

impl<V: PositionValues> OpenStage for ValueLookup<V> {
    fn bytes(&self) -> u64 {
        self.values.bytes()
    }

    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let each = |_, record: &mut [u8], values: &mut Vec<f64>| {
            values.resize(self.columns.len(), 0.0);
            self.values.values(place(record), values)?;
            for (column, value) in self.columns.iter().zip(values) {
                if !value.is_nan() {
                    column.set(record, *value).map_err(|what| self.failure(record, what))?;
                }
            }
            Ok(true)
        };
        let records = Box::new(EachRecord::new(records, around.work.shares.flow.record, each));
        Ok(StageOutput { records, notes: self.notes.clone() })
    }
}

/// The dimension of a name, unless it is an attribute of LAS: one that the files have, or a new one.
pub(super) fn dimension_of(name: &str, about: &str) -> Option<NewDimension> {
    let new = NewDimension::new(name, about, NewDimensionValue::Double);
    attribute::field(name).is_none().then_some(NewDimension { is_kept: true, ..new })
}

/// The name of an attribute or of a new dimension.
///
/// # Errors
/// Coordinates, and names that a file cannot hold.
pub(super) fn attribute_name(name: &str) -> std::result::Result<String, String> {
    let name = name.trim().trim_matches('"');
    if AXES.iter().any(|axis| name.eq_ignore_ascii_case(axis)) {
        return Err(format!("{name} is a coordinate, not an attribute"));
    }
    match (1..=MAX_NAME).contains(&name.len()) && !name.contains(['\0', ':', '=']) {
        true => Ok(name.to_owned()),
        false => Err(format!(
            "{name:?} is not the name of an attribute: new ones have 1 to {MAX_NAME} bytes without : and ="
        )),
    }
}
