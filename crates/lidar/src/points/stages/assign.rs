//! Assigns attributes of points by formulas of other attributes.

use std::cell::Cell;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::lookup::{attribute_name, dimension_of};
use super::operand::{RecordOperand, at_record, column};
use super::{OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput};
use crate::records::{EachRecord, PointRecords, RecordAt};
use terrane_base::error::{Error, Result};
use terrane_base::formula::Formula;
use terrane_base::geom::Ruler;
use terrane_cloud::write::PointColumn;
use terrane_cloud::{AXES, NewDimension, PointCloud, PointSource};
use terrane_files::path_of;

/// Sets an attribute to the value of a formula.
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
                "{name} is a coordinate, not an attribute: pass ‹to_crs› to transform coordinates, or ‹height_above_ground› z"
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

impl Assign {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "assign",
        "NAME=FORMULA",
        "set an attribute to a number or a formula of attributes, x, y and z",
    )];
}

/// Sets or adds a dimension with the value of a formula; points where an operand is NaN keep their value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AddDimension(Assign);

impl FromStr for AddDimension {
    type Err = String;

    /// "NAME=FORMULA", such as "Change = z - Before".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let assign: Assign = text.parse()?;
        match dimension_of(&attribute_name(&assign.name)?, "") {
            Some(_) => Ok(Self(assign)),
            None => Err(format!("{} is an attribute of LAS: use assign", assign.name)),
        }
    }
}

impl AddDimension {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "dimension",
        "NAME=FORMULA",
        "set or add a dimension with the value of a formula of attributes, x, y and z",
    )];
}

impl Stage for AddDimension {
    fn is_spatial(&self) -> bool {
        false
    }

    fn dimensions(&self) -> Vec<NewDimension> {
        dimension_of(&self.0.name, "Of a formula").into_iter().collect()
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        Ok(Box::new(AttributeAssigner {
            skips_nodata: true,
            ..AttributeAssigner::new(&self.0, input)?
        }))
    }
}

impl Stage for Assign {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Unchanged
    }

    fn is_spatial(&self) -> bool {
        false
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        Ok(Box::new(AttributeAssigner::new(self, input)?))
    }
}

impl OpenStage for AttributeAssigner {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let (record, cloud) = (around.work.shares.flow.record, around.work.input);
        let each = move |at: RecordAt, record: &mut [u8], stack: &mut Vec<f64>| {
            let set = self.set(record, stack);
            set.map_err(|what| self.failure(file_of(records, at.unit, cloud), record, &what))?;
            Ok(true)
        };
        Ok(StageOutput::new(EachRecord::new(records, record, each)))
    }
}

/// An assignment to records of one format.
struct AttributeAssigner {
    rulers: [Ruler; 3],
    column: PointColumn,
    formula: Formula<RecordOperand>,
    /// Whether points without a value of an operand stay as they are, instead of being an error.
    skips_nodata: bool,
}

impl AttributeAssigner {
    /// # Errors
    /// Unknown names.
    fn new(Assign { name, formula, .. }: &Assign, input: &StageInput<'_>) -> Result<Self> {
        Ok(Self {
            rulers: [0, 1, 2].map(|axis| input.info.frame.ruler(axis)),
            column: column(name, input.format, input.added)?,
            formula: formula.resolve(|name| RecordOperand::of(name, input))?,
            skips_nodata: false,
        })
    }

    fn set(&self, record: &mut [u8], stack: &mut Vec<f64>) -> std::result::Result<(), String> {
        let is_missing = Cell::new(false);
        let number = self.formula.compute(stack, |operand| match operand.number(record) {
            number if number.is_finite() => Ok(number),
            _ => {
                is_missing.set(true);
                Err(format!("{} has no value", operand.name()))
            }
        });
        if self.skips_nodata && is_missing.get() {
            return Ok(());
        }
        let number = number.map_err(|what| format!("{}: {what}", self.column.name()))?;
        self.column.set(record, number)
    }

    fn failure(&self, file: Option<&str>, record: &[u8], what: &str) -> Error {
        let error = at_record(Error::bad_input(what), &self.rulers, record);
        let error = error.remedy("change the formula, or exclude such points with ‹where›");
        match file {
            Some(name) => error.in_file(&path_of(name)),
            None => error,
        }
    }
}

/// The file of a unit, if it is of one.
fn file_of<'a>(
    records: &'a dyn PointRecords,
    unit: usize,
    cloud: &'a PointCloud,
) -> Option<&'a str> {
    match (records.unit(unit).file, cloud.files()) {
        (Some(file), _) => Some(file.name),
        (None, [only]) => Some(only),
        (None, _) => None,
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
        for text in ["z=1", "intensity=1", "a:b=1", "=1"] {
            assert!(text.parse::<AddDimension>().is_err(), "{text}");
        }
        assert!("Change = z - Before".parse::<AddDimension>().is_ok());
    }
}
