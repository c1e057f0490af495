//! Assigns attributes of points by formulas of other attributes.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::records::selection::place;
use crate::records::{PointRecords, RecordUnit, Take};
use terrane_base::attribute;
use terrane_base::error::{Error, Result};
use terrane_base::formula::Formula;
use terrane_base::geom::{PointFrame, Ruler};
use terrane_cloud::write::PointColumn;
use terrane_cloud::{AXES, PointCloud, PointFormat, PointSource};
use terrane_files::path_of;

/// An attribute and its formula.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Assign {
    /// The input text.
    text: String,
    name: String,
    formula: Formula<String>,
}

impl FromStr for Assign {
    type Err = String;

    /// "NAME=FORMULA", such as "intensity = intensity / 256".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (name, formula) = text.split_once('=').ok_or("expected NAME=FORMULA")?;
        let name = name.trim().trim_matches('"').to_owned();
        if AXES.iter().any(|axis| name.eq_ignore_ascii_case(axis)) {
            return Err(format!(
                "{name} is a coordinate, not an attribute: pass ‹to_crs› to transform coordinates"
            ));
        }
        Ok(Self { text: text.to_owned(), name, formula: Formula::number(formula)? })
    }
}

impl TryFrom<String> for Assign {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl From<Assign> for String {
    fn from(assign: Assign) -> Self {
        assign.text
    }
}

impl fmt::Display for Assign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// An operand of a formula.
#[derive(Clone)]
enum AssignOperand {
    Axis(usize),
    Field(PointColumn),
}

impl AssignOperand {
    /// The coordinate or the column of a name.
    fn of(name: &str, format: PointFormat, columns: &[PointColumn]) -> Result<Self> {
        match AXES.iter().position(|axis| name.eq_ignore_ascii_case(axis)) {
            Some(axis) => Ok(Self::Axis(axis)),
            None => column(name, format, columns).map(Self::Field),
        }
    }
}

/// Assignments, in order.
pub(super) struct AttributeAssigner {
    rulers: [Ruler; 3],
    steps: Vec<(PointColumn, Formula<AssignOperand>)>,
}

impl AttributeAssigner {
    /// Assignments for records of a format with these columns, in a frame.
    ///
    /// # Errors
    /// Unknown names.
    pub(super) fn new(
        assignments: &[Assign],
        format: PointFormat,
        columns: &[PointColumn],
        frame: &PointFrame,
    ) -> Result<Self> {
        let mut steps = Vec::with_capacity(assignments.len());
        for Assign { name, formula, .. } in assignments {
            let column = column(name, format, columns)?;
            let formula = formula.resolve(|name| AssignOperand::of(name, format, columns))?;
            steps.push((column, formula));
        }
        Ok(Self { rulers: [0, 1, 2].map(|axis| frame.ruler(axis)), steps })
    }

    fn set(&self, record: &mut [u8], stack: &mut Vec<f64>) -> std::result::Result<(), String> {
        for (column, formula) in &self.steps {
            let number = formula.compute(stack, |source| self.value(source, record));
            let number = number.map_err(|what| format!("{}: {what}", column.name()))?;
            column.set(record, number)?;
        }
        Ok(())
    }

    fn value(&self, source: &AssignOperand, record: &[u8]) -> std::result::Result<f64, String> {
        match source {
            AssignOperand::Axis(axis) => Ok(self.place(record)[*axis]),
            AssignOperand::Field(column) => match column.number(record) {
                number if number.is_finite() => Ok(number),
                _ => Err(format!("{} has no value", column.name())),
            },
        }
    }

    fn place(&self, record: &[u8]) -> [f64; 3] {
        let at = place(record);
        [0, 1, 2].map(|axis| self.rulers[axis].at([at.x, at.y, at.z][axis].into()))
    }
}

/// The column of an attribute in records of a format: a standard attribute by any of its names, or extra bytes.
///
/// # Errors
/// An unknown name.
pub(super) fn column(
    name: &str,
    format: PointFormat,
    columns: &[PointColumn],
) -> Result<PointColumn> {
    let known = attribute::known(name.trim()).map_or(name.trim(), |attribute| attribute.name);
    let found = columns.iter().find(|column| column.name().trim().eq_ignore_ascii_case(known));
    found.cloned().ok_or_else(|| {
        let number = format.number();
        let names: Vec<&str> = columns.iter().map(PointColumn::name).collect();
        Error::usage(format!("points of format {number} have no attribute {name:?}"))
            .remedy(format!("pass one of {}, or another ‹point_format›", names.join(", ")))
    })
}

/// Records with assigned attributes.
pub(super) struct AssignedRecords<'a> {
    pub(super) records: &'a dyn PointRecords,
    pub(super) assigning: &'a AttributeAssigner,
    /// Bytes of a record.
    pub(super) record: usize,
    /// The point cloud whose parts are the units.
    pub(super) cloud: &'a PointCloud,
}

impl AssignedRecords<'_> {
    fn failure(&self, unit: usize, record: &[u8], what: &str) -> Error {
        let [x, y, z] = self.assigning.place(record);
        let error = Error::bad_input(what).at(format_args!("the point at {x}, {y}, {z}"));
        let error = error.remedy("change ‹attribute›, or exclude such points with ‹where›");
        match self.cloud.file_of(unit).and_then(|number| self.cloud.files().get(number)) {
            Some(name) => error.in_file(&path_of(name)),
            None => error,
        }
    }
}

impl PointRecords for AssignedRecords<'_> {
    fn units(&self) -> usize {
        self.records.units()
    }

    fn unit(&self, unit: usize) -> RecordUnit<'_> {
        self.records.unit(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let (mut set, mut stack) = (Vec::new(), Vec::new());
        self.records.read(unit, &mut |bytes| {
            set.clear();
            set.extend_from_slice(bytes);
            for record in set.chunks_exact_mut(self.record) {
                let done = self.assigning.set(record, &mut stack);
                done.map_err(|what| self.failure(unit, record, &what))?;
            }
            take(&set)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_and_what_names_nothing_are_refused() {
        for text in ["z=1", "X = 2", "intensity", "intensity=", "=2*"] {
            assert!(text.parse::<Assign>().is_err(), "{text}");
        }
        let quoted: Assign = "\"my own\" = z / 2".parse().unwrap();
        assert_eq!(quoted.name, "my own");
    }
}
