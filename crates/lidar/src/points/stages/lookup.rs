//! Attributes by the place of each point: what a stage looks up in polygons or grids.

use std::path::Path;

use super::operand::column;
use super::{OpenStage, StageContext, StageInput, StageOutput};
use crate::records::selection::place;
use crate::records::{EachRecord, PointRecords};
use terrane_base::attribute;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::AXES;
use terrane_cloud::write::PointColumn;
use terrane_cloud::{NewDimension, NewDimensionValue};

/// Longest name of a new dimension, in bytes.
const MAX_NAME: usize = 32;

/// What has values at places.
pub(super) trait PlaceValues: Send + Sync {
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
    path: std::path::PathBuf,
}

impl<V: PlaceValues> ValueLookup<V> {
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
        Ok(Self { columns, values, path: path.to_path_buf() })
    }
}

impl<V: PlaceValues> OpenStage for ValueLookup<V> {
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
                    let set = column.set(record, *value);
                    set.map_err(|what| Error::bad_input(what).in_file(&self.path))?;
                }
            }
            Ok(true)
        };
        Ok(StageOutput::new(EachRecord::new(records, around.work.shares.flow.record, each)))
    }
}

/// The dimension of a name, unless it is an attribute of LAS.
pub(super) fn dimension_of(name: &str, about: &str) -> Option<NewDimension> {
    let new = NewDimension::new(name, about, NewDimensionValue::Double);
    attribute::field(name).is_none().then_some(new)
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
        false => {
            Err(format!("{name:?} is not a name of an attribute, of at most {MAX_NAME} bytes"))
        }
    }
}
