//! Removal of flight line overlap: keeps the points of one flight line in each cell.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{
    AnyStage, OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput,
    StageReach,
};
use crate::records::PointRecords;
use crate::records::selection::{Group, Rank, RecordRanking, needed, place};
use terrane_base::error::{Error, Result};
use terrane_base::geom::PointFrame;
use terrane_cloud::{CloudInfo, PointFormat, round_side};
use terrane_gridding::{CellEdgeRule, CellLattice};

/// Keeps the flight line with the smallest scan angle in each cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Overlap {
    /// Cell size, in units of x and y; by default twice the point spacing, rounded up to 1, 2 or 5 times a
    /// power of ten.
    pub cell: Option<f64>,
}

/// The value for a cell size derived from the point spacing.
const AUTO: &str = "auto";

impl FromStr for Overlap {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let cell = text.trim().parse().ok().filter(|side: &f64| *side > 0.0 && side.is_finite());
        match (text, cell) {
            (AUTO, _) => Ok(Self::default()),
            (_, Some(_)) => Ok(Self { cell }),
            (_, None) => Err("expected a number above 0, or auto".to_owned()),
        }
    }
}

impl fmt::Display for Overlap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.cell {
            None => f.write_str(AUTO),
            Some(side) => side.fmt(f),
        }
    }
}

impl Overlap {
    pub(super) const NAMES: [StageName; 1] = [StageName {
        name: "drop-overlap",
        arguments: "[CELL]",
        about: "in each cell keep the flight line (point source) with the smallest scan angle",
        parse: |text| match text {
            "" => Ok(Self::default().into()),
            _ => text.parse::<Self>().map(Into::into),
        },
    }];

    /// The side of cells over a cloud.
    fn side(&self, info: &CloudInfo) -> f64 {
        self.cell.unwrap_or_else(|| round_side(info, info.bounds.unwrap_or_default()))
    }
}

impl Stage for Overlap {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Selects
    }

    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Within(self.cell.unwrap_or_default()))
    }

    fn needed(&self, _: &CloudInfo, points: u64) -> [u64; 2] {
        [needed(points), 0]
    }

    fn resolved(&self, info: &CloudInfo) -> Result<Option<AnyStage>> {
        Ok(Some(Self { cell: Some(self.side(info)) }.into()))
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        let side = self.side(input.info);
        Ok(Box::new(FlightLines::new(side, &input.info.frame, input.format)?))
    }
}

impl OpenStage for FlightLines {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let lines = around.select(records, self, "flight lines")?;
        let (side, left_out) = (self.side, lines.left_out());
        let note =
            format!("overlap: {left_out} points of other flight lines dropped, in cells of {side}");
        Ok(StageOutput { records: Box::new(lines), notes: vec![note] })
    }
}

/// Cells with one flight line each.
struct FlightLines {
    side: f64,
    lattice: CellLattice,
    format: PointFormat,
}

impl FlightLines {
    fn new(side: f64, frame: &PointFrame, format: PointFormat) -> Result<Self> {
        if frame.scale[..2].iter().any(|step| side < *step) {
            return Err(Error::usage(format!(
                "cells of {side} are smaller than the coordinate resolution"
            ))
            .remedy("pass a larger cell"));
        }
        Ok(Self {
            side,
            lattice: CellLattice::new(frame, [0.0; 2], [side; 2], CellEdgeRule::default()),
            format,
        })
    }
}

impl RecordRanking for FlightLines {
    fn group_and_rank(&self, record: &[u8]) -> (Group, Rank) {
        let (at, CellLattice { x, y }) = (place(record), &self.lattice);
        let group = [x.index(at.x) as u64, y.index(at.y) as u64, 0];
        (
            group,
            [self.format.angle(record).unsigned_abs().into(), self.format.source(record).into()],
        )
    }

    fn keeps_alike(&self) -> bool {
        true
    }
}
