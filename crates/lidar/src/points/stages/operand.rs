//! Operands of formulas over records: coordinates and columns by name.

use super::StageInput;
use crate::records::selection::place;
use terrane_base::attribute;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, Ruler};
use terrane_cloud::write::PointColumn;
use terrane_cloud::{AXES, PointFormat};

/// An error at the place of a record.
pub(super) fn at_record(error: Error, rulers: &[Ruler; 3], record: &[u8]) -> Error {
    let Point { x, y, z } = place(record);
    let [x, y, z] = [(0, x), (1, y), (2, z)].map(|(axis, at)| rulers[axis].at(at.into()));
    error.at(format_args!("the point at {x}, {y}, {z}"))
}

/// An operand of a formula.
pub(super) enum RecordOperand {
    Axis(usize, Ruler),
    /// A column, with the decimals that it stands for if it is a scaled integer.
    Field(PointColumn, Option<Ruler>),
}

impl RecordOperand {
    /// The coordinate or the column of a name.
    ///
    /// # Errors
    /// An unknown name.
    pub(super) fn of(name: &str, input: &StageInput<'_>) -> Result<Self> {
        match AXES.iter().position(|axis| name.eq_ignore_ascii_case(axis)) {
            Some(axis) => Ok(Self::Axis(axis, input.info.frame.ruler(axis))),
            None => {
                let column = column(name, input.format, input.columns)?;
                let ruler = column.ruler();
                Ok(Self::Field(column, ruler))
            }
        }
    }

    /// Its name.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Axis(axis, _) => AXES[*axis],
            Self::Field(column, _) => column.name(),
        }
    }

    /// The value of a record; NaN for nodata.
    pub(super) fn number(&self, record: &[u8]) -> f64 {
        match self {
            Self::Axis(axis, ruler) => {
                let at = place(record);
                ruler.at([at.x, at.y, at.z][*axis].into())
            }
            Self::Field(column, _) => column.number(record),
        }
    }

    /// The same, of scaled integers as the decimal that they stand for.
    pub(super) fn decimal(&self, record: &[u8]) -> f64 {
        match self {
            Self::Field(column, Some(ruler)) => column.decimal(record, ruler),
            _ => self.number(record),
        }
    }
}

/// The column of an attribute in records of a format: a standard attribute by any of its names, or extra bytes.
///
/// # Errors
/// An unknown name.
pub(in crate::points) fn column(
    name: &str,
    format: PointFormat,
    columns: &[PointColumn],
) -> Result<PointColumn> {
    let known = attribute::field(name.trim()).unwrap_or(name.trim());
    let found = columns.iter().find(|column| column.name().trim().eq_ignore_ascii_case(known));
    found.cloned().ok_or_else(|| {
        let number = format.number();
        let names: Vec<&str> = columns.iter().map(PointColumn::name).collect();
        Error::usage(format!("points of format {number} have no attribute {name:?}"))
            .remedy(format!("pass one of {}, or another ‹point_format›", names.join(", ")))
    })
}
