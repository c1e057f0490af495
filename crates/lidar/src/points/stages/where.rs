//! Keeps the records for which a condition holds, as the records are at this place of the chain.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::operand::RecordOperand;
use super::{OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput};
use crate::records::{EachRecord, PointRecords};
use terrane_base::error::Result;
use terrane_base::formula::Formula;
use terrane_cloud::Condition;

/// Keeps the points for which a condition on attributes holds, such as "HeightAboveGround > 2 and classification = 5".
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Where(pub Condition);

impl FromStr for Where {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        text.parse().map(Self)
    }
}

impl Where {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "where",
        "CONDITION",
        "keep points for which a condition on attributes, x, y and z holds",
    )];
}

impl Stage for Where {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Selects
    }

    fn is_spatial(&self) -> bool {
        false
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        let formula = self.0.formula().resolve(|name| RecordOperand::of(name, input))?;
        Ok(Box::new(RecordCondition(formula)))
    }
}

/// A condition on records of one format.
struct RecordCondition(Formula<RecordOperand>);

impl OpenStage for RecordCondition {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let record = around.work.shares.flow.record;
        let each = |_, record: &mut [u8], stack: &mut Vec<f64>| {
            Ok(self.0.holds(stack, |operand| operand.decimal(record)))
        };
        Ok(StageOutput::new(EachRecord::new(records, record, each)))
    }
}
