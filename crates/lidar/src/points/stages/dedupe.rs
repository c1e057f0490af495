//! Removal of duplicate points: of those with the same position and time the first is kept.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput};
use crate::records::PointRecords;
use crate::records::selection::{ChosenRecords, Group, Rank, RecordRanking, needed, place};
use terrane_base::bits::ordered;
use terrane_base::error::Result;
use terrane_cloud::CloudInfo;

/// Keeps one of the points with the same position and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dedupe;

impl FromStr for Dedupe {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        if text.is_empty() { Ok(Self) } else { Err("expected no arguments") }
    }
}

impl Dedupe {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "dedupe",
        "",
        "drop duplicates: of points with the same position and time the first is kept",
    )];

    /// The records without duplicates.
    pub(in crate::points) fn select<'r>(
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<ChosenRecords<'r>> {
        let key = DuplicateKey { time: around.work.options.format.time_at() };
        around.select(records, &key, "duplicate points")
    }
}

impl Stage for Dedupe {
    fn is_spatial(&self) -> bool {
        false
    }

    fn effect(&self) -> PointSetEffect {
        PointSetEffect::DropsDuplicates
    }

    fn needed(&self, _: &CloudInfo, points: u64) -> [u64; 2] {
        [needed(points), 0]
    }

    fn open(&self, _: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        Ok(Box::new(Self))
    }
}

impl OpenStage for Dedupe {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        Self::select(records, around).map(StageOutput::new)
    }
}

/// Key of points with the same position and time.
struct DuplicateKey {
    /// Offset of the time in a record.
    time: Option<usize>,
}

impl RecordRanking for DuplicateKey {
    fn group_and_rank(&self, record: &[u8]) -> (Group, Rank) {
        let at = place(record);
        let time = self
            .time
            .and_then(|at| record[at..].first_chunk())
            .map_or(0, |t| u64::from_le_bytes(*t));
        ([ordered(at.x) << 32 | ordered(at.y), ordered(at.z), time], [0; 2])
    }
}
