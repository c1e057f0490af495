//! Conditions on the attributes of points: `intensity > 100 and point_source_id = 7`.

use std::cell::RefCell;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use terrane_base::error::Result;
use terrane_base::formula::Formula;
use terrane_base::geom::{Point, PointFrame, Ruler};

use super::attributes::{AttributeReader, reader};
use super::column::PointColumn;
use super::raw::RawPoint;

/// Names of the coordinates.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// A condition as written. Names are those of [`terrane_base::attribute`], of extra bytes, and x, y and z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Condition {
    text: String,
    formula: Formula<String>,
}

impl FromStr for Condition {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        Ok(Self { text: text.to_owned(), formula: Formula::condition(text)? })
    }
}

impl TryFrom<String> for Condition {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl From<Condition> for String {
    fn from(condition: Condition) -> Self {
        condition.text
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Condition {
    /// The formula, with names as written.
    pub fn formula(&self) -> &Formula<String> {
        &self.formula
    }

    /// Compiles the condition for records with these columns and points in `frame`.
    ///
    /// # Errors
    /// Unknown attributes.
    pub(crate) fn bind(
        &self,
        columns: &[PointColumn],
        frame: &PointFrame,
    ) -> Result<CompiledCondition> {
        let formula = self.formula.resolve(|name| ConditionOperand::of(name, columns, frame))?;
        Ok(CompiledCondition(formula))
    }
}

/// Operand of a condition.
#[derive(Clone, Debug)]
enum ConditionOperand {
    Axis(usize, Ruler),
    /// An attribute, with its decimal lattice if it is a scaled integer.
    Attribute(AttributeReader, Option<Ruler>),
}

impl ConditionOperand {
    /// The coordinate or attribute called `name`.
    fn of(name: &str, columns: &[PointColumn], frame: &PointFrame) -> Result<Self> {
        if let Some(axis) = AXES.iter().position(|axis| name.eq_ignore_ascii_case(axis)) {
            return Ok(Self::Axis(axis, frame.ruler(axis)));
        }
        let reader = reader(name, columns)?;
        let ruler = reader.column().and_then(PointColumn::ruler);
        Ok(Self::Attribute(reader, ruler))
    }

    #[inline]
    fn value<R: RawPoint>(&self, point: Point, raw: R, record: &[u8]) -> f64 {
        match self {
            Self::Axis(axis, ruler) => ruler.at([point.x, point.y, point.z][*axis].into()),
            Self::Attribute(reader, ruler) => reader.decimal(raw, record, ruler.as_ref()),
        }
    }
}

/// A condition compiled for the records of one file.
#[derive(Clone, Debug)]
pub(crate) struct CompiledCondition(Formula<ConditionOperand>);

impl CompiledCondition {
    /// Whether it holds for a point with this record.
    pub(crate) fn holds<R: RawPoint>(&self, point: Point, raw: R, record: &[u8]) -> bool {
        thread_local! {
            static STACK: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
        }
        STACK.with_borrow_mut(|stack| {
            self.0.holds(stack, |operand: &ConditionOperand| operand.value(point, raw, record))
        })
    }
}
