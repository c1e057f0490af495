//! Keeps the records for which a condition holds, as the records are at this place of the chain.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::operand::RecordOperand;
use super::{OpenStage, Stage, StageContext, StageInput, StageName, StageOutput};
use crate::records::{PointRecords, RecordUnit, Take};
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
    fn option(&self) -> &'static str {
        "stage"
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
        Ok(StageOutput::new(MatchingRecords { records, condition: &self.0, record }))
    }
}

/// The records for which a condition holds.
struct MatchingRecords<'a> {
    records: &'a dyn PointRecords,
    condition: &'a Formula<RecordOperand>,
    /// Bytes of a record.
    record: usize,
}

impl PointRecords for MatchingRecords<'_> {
    fn units(&self) -> usize {
        self.records.units()
    }

    fn unit(&self, unit: usize) -> RecordUnit<'_> {
        self.records.unit(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let (mut kept, mut stack) = (Vec::new(), Vec::new());
        self.records.read(unit, &mut |bytes| {
            kept.clear();
            for record in bytes.chunks_exact(self.record) {
                if self.condition.holds(&mut stack, |operand| operand.decimal(record)) {
                    kept.extend_from_slice(record);
                }
            }
            take(&kept)
        })
    }
}
