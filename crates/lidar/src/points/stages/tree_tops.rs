//! Tree tops: local maxima of z in a circular window.
//!
//! The local maximum filter of Popescu & Wynne, "Seeing the trees in the forest" (2004), on points instead of a grid, as
//! `locate_trees(lmf())` of lidR. Heights are those above ground where z is one.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::str::FromStr;
use std::sync::Mutex;

use serde::{Deserialize, Serialize};

use super::neighborhoods::{self, Neighborhood, Neighborhoods};
use super::{
    OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput, StageReach,
};
use crate::records::numbered::RecordNumbers;
use crate::records::selection::{ChosenRecords, place};
use crate::records::{PointRecords, total};
use terrane_base::bits::BitSet;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{DistancePredicate, Point, PointFrame};
use terrane_cloud::CloudInfo;
use terrane_files::{lock, unlocked};
use terrane_ground::neighbors::{MetricSpace, NeighborParts};

/// Lowest top, unless another is given: that of low vegetation, in units of z.
const LOWEST: f64 = 2.0;

/// Keeps the highest point within each circle of this diameter around a point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TreeTops {
    /// Diameter of the circle, in units of x and y.
    pub window: f64,
    /// Lowest z of a top.
    pub min: f64,
}

impl FromStr for TreeTops {
    type Err = String;

    /// "5", "4.5:min=1.3".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (window, min) = text.split_once(':').unwrap_or((text, ""));
        let window = window.trim().parse().ok().filter(|w: &f64| *w > 0.0 && w.is_finite());
        let window = window.ok_or("expected WINDOW[:min=HEIGHT], with WINDOW above 0")?;
        let min = match min.trim() {
            "" => Some(LOWEST),
            min => min.strip_prefix("min=").and_then(|min| min.parse().ok()),
        };
        let min =
            min.filter(|min: &f64| min.is_finite()).ok_or("expected min=HEIGHT after WINDOW")?;
        Ok(Self { window, min })
    }
}

impl TreeTops {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "tree-tops",
        "WINDOW[:min=HEIGHT]",
        "keep local maxima of z in a circle of this diameter, at least HEIGHT (default 2)",
    )];
}

impl Stage for TreeTops {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Selects
    }

    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Within(self.window / 2.0))
    }

    fn needed(&self, _: &CloudInfo, points: u64) -> [u64; 2] {
        // Points of a part and around it, as they are and by cell.
        let [all, thread] =
            neighborhoods::needed(points, |points| 8 * points * size_of::<Point>() as u64);
        [points / 8 + all, thread]
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        if input.info.crs.horizontal_unit() == "degree" {
            return Err(Error::usage(
                "the stage tree-tops requires projected coordinates; these are in degrees",
            )
            .remedy("reproject the points first, for example with the stage reproject:CRS"));
        }
        Ok(Box::new(self.search(&input.info.frame)))
    }
}

impl TreeTops {
    /// The search for tops among points of a frame.
    pub(super) fn search(&self, frame: &PointFrame) -> TopSearch {
        let [x, y, _] = frame.scale;
        TopSearch {
            // Distances are those of x and y.
            space: MetricSpace { step: [x, y, 0.0], zero: [0; 3] },
            circle: DistancePredicate::new([x, y, 1.0], self.window / 2.0),
            lowest: frame.ruler(2).place(self.min),
        }
    }
}

/// The search for tops among points of one frame.
pub(super) struct TopSearch {
    space: MetricSpace,
    circle: DistancePredicate,
    /// In steps.
    lowest: f64,
}

impl OpenStage for TopSearch {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let most = total(records);
        let tops = Mutex::new(BitSet::new(most as usize));
        let numbers = self.run(records, around, |_, number| {
            lock(&tops).insert(number as usize);
        })?;
        let (tops, record) = (unlocked(tops), around.work.shares.flow.record);
        Ok(StageOutput::new(ChosenRecords::of(records, record, numbers, tops)))
    }
}

impl TopSearch {
    /// Calls `take` with each top and the number of its record, in any order.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn run(
        &self,
        records: &dyn PointRecords,
        around: &StageContext<'_>,
        take: impl Fn(Point, u64) + Sync,
    ) -> Result<RecordNumbers> {
        let is_high = |record: &[u8]| f64::from(place(record).z) >= self.lowest;
        let memory = around.memory() / 2;
        let points = Neighborhoods::new(records, &self.space, around, memory, is_high)?;
        points.each(
            "tree tops",
            |(): &mut (), mut near: Neighborhood<'_>| {
                let found = self.tops(&near.points, &mut near.around)?;
                let all = near.points.iter().zip(&near.numbers).zip(found);
                for ((point, number), _) in all.filter(|(_, is_top)| *is_top) {
                    take(*point, *number);
                }
                Ok(())
            },
            |()| Ok(()),
        )?;
        Ok(points.numbers)
    }

    /// Which points of a part are tops.
    fn tops(&self, own: &[Point], around: &mut dyn NeighborParts) -> Result<Vec<bool>> {
        let mut is_top = vec![true; own.len()];
        self.drop_lower(own, own, &mut is_top);
        // A margin for what is rounded; the comparison itself is exact.
        let within = self.circle.least() * self.circle.least() * (1.0 + 1e-9);
        let mut others = Vec::new();
        while around.next(within.next_up()).is_some() {
            others.clear();
            around.load(&mut others)?;
            self.drop_lower(own, &others, &mut is_top);
        }
        Ok(is_top)
    }

    /// Unmarks the points that one of the others is above.
    fn drop_lower(&self, own: &[Point], others: &[Point], is_top: &mut [bool]) {
        let [x, y, _] = self.circle.steps();
        let cell = |at: Point| [i64::from(at.x).div_euclid(x), i64::from(at.y).div_euclid(y)];
        let mut by_cell: HashMap<[i64; 2], Vec<Point>> = HashMap::new();
        for other in others {
            by_cell.entry(cell(*other)).or_default().push(*other);
        }
        // The highest first: few points are not below one of the first.
        for points in by_cell.values_mut() {
            points.sort_unstable_by_key(|point| Reverse(height(*point)));
        }
        for (point, is_top) in own.iter().zip(is_top).filter(|(_, is_top)| **is_top) {
            let [col, row] = cell(*point);
            let cells =
                (row - 1..=row + 1).flat_map(|row| (col - 1..=col + 1).map(move |col| [col, row]));
            let near = cells.filter_map(|cell| by_cell.get(&cell));
            let mut above = near.flat_map(|points| {
                points.iter().take_while(|other| height(**other) > height(*point))
            });
            *is_top = !above.any(|other| {
                let level = Point { z: point.z, ..*other };
                self.circle.is_nearer(*point, level)
            });
        }
    }
}

/// The order of heights: of equally high points one is above the others.
fn height(Point { x, y, z }: Point) -> [i32; 3] {
    [z, x, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_have_a_size_and_may_have_a_least_height() {
        for (text, window, min) in [("5", 5.0, LOWEST), ("0.5:min=-1.5", 0.5, -1.5)] {
            assert_eq!(text.parse(), Ok(TreeTops { window, min }));
        }
        for text in ["", "0", "-1", "5:2", "5:min=", "5:min=x", "nan", "5:max=3"] {
            assert!(text.parse::<TreeTops>().is_err(), "{text}");
        }
    }
}
