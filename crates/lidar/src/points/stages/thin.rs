//! Thinning to one point of each cell.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{
    OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput, StageReach,
};
use crate::records::PointRecords;
use crate::records::selection::{Group, Rank, RecordRanking, needed, place};
use terrane_base::bits::{mixed, ordered};
use terrane_base::error::{Error, Result};
use terrane_base::geom::PointFrame;
use terrane_cloud::CloudInfo;
use terrane_gridding::{CellEdgeRule, CellLattice, DistanceUnit};

/// Which point of a cell is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ThinningRule {
    /// The lowest.
    Lowest,
    /// The highest.
    Highest,
    /// The nearest to the cell's centre.
    #[default]
    Centre,
    /// A random point by seed, independent of points in other cells.
    Random(u64),
}

/// Thinning to one point of each cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellThinning {
    /// Side of the cells, in units of x and y; corners are at its multiples.
    pub cell: f64,
    /// The point to keep.
    pub keep: ThinningRule,
}

/// Names of the rules, with descriptions.
pub const KEPT: [(&str, &str); 4] = [
    ("centre", "the point nearest to the cell centre"),
    ("lowest", "the lowest point"),
    ("highest", "the highest point"),
    ("random", "a random point; random=SEED sets the seed [default: 0]"),
];

impl FromStr for CellThinning {
    type Err = String;

    /// "2.5", "2.5:lowest", "2.5:random=7".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (cell, keep) = text.split_once(':').unwrap_or((text, KEPT[0].0));
        let cell = cell.trim().parse().ok().filter(|cell: &f64| cell.is_finite() && *cell > 0.0);
        let cell = cell.ok_or("expected CELL[:WHICH], with CELL above 0")?;
        let keep = match keep.split_once('=').unwrap_or((keep, "0")) {
            ("centre" | "center", "0") => ThinningRule::Centre,
            ("lowest", "0") => ThinningRule::Lowest,
            ("highest", "0") => ThinningRule::Highest,
            ("random", seed) => ThinningRule::Random(
                seed.parse().map_err(|_| format!("the seed {seed} is not an integer"))?,
            ),
            _ => {
                return Err(format!(
                    "expected one of {}, not {keep}",
                    KEPT.map(|(name, _)| name).join(", ")
                ));
            }
        };
        Ok(Self { cell, keep })
    }
}

impl fmt::Display for CellThinning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.keep {
            ThinningRule::Centre => "centre".to_owned(),
            ThinningRule::Lowest => "lowest".to_owned(),
            ThinningRule::Highest => "highest".to_owned(),
            ThinningRule::Random(seed) => format!("random={seed}"),
        };
        write!(f, "{}:{name}", self.cell)
    }
}

impl CellThinning {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "thin",
        "CELL[:WHICH]",
        "keep one point per cell of this size: centre, lowest, highest, random=SEED",
    )];
}

impl Stage for CellThinning {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Selects
    }

    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Within(self.cell))
    }

    fn needed(&self, _: &CloudInfo, points: u64) -> [u64; 2] {
        [needed(points), 0]
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        Ok(Box::new(ThinningCells::new(*self, &input.info.frame)?))
    }
}

impl OpenStage for ThinningCells {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        around.select(records, self, "cells").map(StageOutput::new)
    }
}

/// Cells for thinning.
struct ThinningCells {
    lattice: CellLattice,
    unit: DistanceUnit,
    keep: ThinningRule,
}

impl ThinningCells {
    fn new(thin: CellThinning, frame: &PointFrame) -> Result<Self> {
        if frame.scale[..2].iter().any(|step| thin.cell < *step) {
            return Err(Error::usage(format!(
                "cells of {} are smaller than the coordinate resolution",
                thin.cell
            ))
            .remedy("pass a larger cell"));
        }
        let lattice = CellLattice::new(frame, [0.0; 2], [thin.cell; 2], CellEdgeRule::default());
        Ok(Self { unit: lattice.unit(thin.cell), lattice, keep: thin.keep })
    }
}

impl RecordRanking for ThinningCells {
    fn group_and_rank(&self, record: &[u8]) -> (Group, Rank) {
        let at = place(record);
        let CellLattice { x, y } = &self.lattice;
        let group = [x.index(at.x) as u64, y.index(at.y) as u64, 0];
        let rank = match self.keep {
            ThinningRule::Lowest => [ordered(at.z), 0],
            ThinningRule::Highest => [u64::MAX - ordered(at.z), 0],
            ThinningRule::Random(seed) => {
                let [x, y, z] = [at.x, at.y, at.z].map(ordered);
                [mixed(&[seed, x, y, z]), 0]
            }
            ThinningRule::Centre => {
                let square = x.square(at.x, self.unit) + y.square(at.y, self.unit);
                [(square >> 64) as u64, square as u64]
            }
        };
        (group, rank)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_is_read_as_it_is_written() {
        for text in ["2.5:centre", "1:lowest", "0.5:highest", "10:random=7"] {
            assert_eq!(text.parse::<CellThinning>().unwrap().to_string(), text);
        }
        assert_eq!("3".parse::<CellThinning>().unwrap().to_string(), "3:centre");
        assert_eq!("3:random".parse::<CellThinning>().unwrap().to_string(), "3:random=0");
        for text in ["", "0", "-1", "nan", "1:best", "1:lowest=2", "1:random=x"] {
            assert!(text.parse::<CellThinning>().is_err(), "{text}");
        }
    }
}
