//! Trees: each point belongs to the nearest tree top, within a crown that grows with the height of the tree.
//!
//! The crowns of Silva and others, "Imputation of individual longleaf pine (Pinus palustris Mill.) tree attributes from
//! field and LiDAR data" (2016), of points instead of a grid, as `silva2016` of lidR. Tops are those of the stage
//! `tree-tops`; heights are those above ground where z is one.

use std::collections::BTreeSet;
use std::str::FromStr;
use std::sync::Mutex;

use serde::{Deserialize, Serialize};

use super::neighborhoods::metric_space;
use super::tree_tops::{TopSearch, TreeTops};
use super::{OpenStage, Stage, StageContext, StageInput, StageName, StageOutput, StageReach};
use crate::grid::surface_model::MetricFrame;
use crate::records::selection::place;
use crate::records::{EachRecord, PointRecords};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Point, Ruler};
use terrane_cloud::{CloudInfo, NewDimension, NewDimensionValue};
use terrane_files::{lock, unlocked};

/// The stage in messages.
const STAGE: &str = "the stage trees";
/// The dimension of the numbers of trees.
const TREE: &str = "TreeID";
/// Bytes of a top: in the list, in the set that is made first, and in the order.
const TOP_BYTES: u64 = 96;

/// Numbers the trees, and tells of each point which one it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trees {
    /// The tops.
    pub tops: TreeTops,
    /// Largest radius of a crown, as a share of the height of its top.
    pub radius: f64,
    /// Lowest height of a crown, as a share of the height of its top.
    pub height: f64,
}

impl FromStr for Trees {
    type Err = String;

    /// "5", "4.5:min=1.3:radius=0.5:height=0.2".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (mut tops, mut radius, mut height) = (Vec::new(), None, None);
        for part in text.split(':') {
            let share = |text: &str| {
                let share = text.parse().ok().filter(|share: &f64| (0.0..=10.0).contains(share));
                share.ok_or_else(|| format!("expected a share from 0 to 10 in {part:?}"))
            };
            match part.trim().split_once('=') {
                Some(("radius", text)) if radius.is_none() => radius = Some(share(text)?),
                Some(("height", text)) if height.is_none() => height = Some(share(text)?),
                Some((key @ ("radius" | "height"), _)) => {
                    return Err(format!("{key} is given twice"));
                }
                Some((key, _)) if key != "min" => {
                    return Err(format!("expected min, radius or height, not {key}"));
                }
                _ => tops.push(part),
            }
        }
        let (radius, height) = (radius.unwrap_or(0.6), height.unwrap_or(0.3));
        Ok(Self { tops: tops.join(":").parse()?, radius, height })
    }
}

impl Trees {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "trees",
        "WINDOW[:min=HEIGHT][:radius=SHARE][:height=SHARE]",
        "assign points to the nearest tree top, as dimension TreeID: within radius (0.6) and above height (0.3) times the \
         height of the top",
    )];

    /// Most tops: no two are nearer than half a window, and there are no more than points.
    fn most_tops(&self, info: &CloudInfo, points: u64) -> u64 {
        let Some([low, high]) = info.bounds else { return 0 };
        let apart = self.tops.window / 2.0;
        let sides = [(low.x, high.x, info.frame.scale[0]), (low.y, high.y, info.frame.scale[1])];
        let sides = sides.map(|(low, high, scale)| f64::from(high.abs_diff(low)) * scale + apart);
        // Discs of half the distance are apart, and fill at most 0.91 of the plane.
        let most = 0.91 * sides[0] * sides[1] / (0.25 * std::f64::consts::PI * apart * apart);
        points.min(most.ceil() as u64)
    }
}

impl Stage for Trees {
    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Cloud { option: None, reason: "trees are numbered across the point cloud" })
    }

    fn needed(&self, info: &CloudInfo, points: u64) -> [u64; 2] {
        let [all, thread] = self.tops.needed(info, points);
        [all + TOP_BYTES * self.most_tops(info, points), thread]
    }

    fn dimensions(&self) -> Vec<NewDimension> {
        vec![NewDimension::new(TREE, "Number of the tree", NewDimensionValue::Whole)]
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        let (space, is_guess) = metric_space(input.info, STAGE)?;
        let search = self.tops.search(&input.info.frame);
        let frame = &input.info.frame;
        let (ruler, [x, y, z]) = (frame.ruler(2), space.step);
        let metres = z / frame.scale[2];
        let (radius, height) = (self.radius * metres, self.height);
        Ok(Box::new(TreeNumbering { search, ruler, step: [x, y], radius, height, is_guess }))
    }
}

/// The search for tops and crowns among points of one frame.
struct TreeNumbering {
    search: TopSearch,
    ruler: Ruler,
    /// Metres of a step along x and y.
    step: [f64; 2],
    /// Metres of radius for each unit of height.
    radius: f64,
    height: f64,
    is_guess: bool,
}

impl OpenStage for TreeNumbering {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let tops = Mutex::new(BTreeSet::new());
        self.search.run(records, around, |top, _| {
            lock(&tops).insert(top);
        })?;
        let crowns = TreeCrowns::new(self, unlocked(tops).into_iter().collect());
        let at = around.work.converter.added_at(TREE);
        let at =
            at.ok_or_else(|| Error::new(ErrorKind::Internal, "TreeID is not in the records"))?;
        let set = move |_, record: &mut [u8], (): &mut ()| {
            let number = crowns.of(place(record)).map_or(0, |index| index as u32 + 1);
            record[at..at + size_of::<u32>()].copy_from_slice(&number.to_le_bytes());
            Ok(true)
        };
        let records = Box::new(EachRecord::new(records, around.work.shares.flow.record, set));
        let notes = self.is_guess.then(|| MetricFrame::GUESS.to_owned());
        Ok(StageOutput { records, notes: notes.into_iter().collect() })
    }
}

/// The crowns of all trees.
struct TreeCrowns<'a> {
    numbering: &'a TreeNumbering,
    /// In the order of positions.
    tops: Vec<Point>,
    /// Indices of the tops, halved at the middle by x and by y in turn: a k-d tree.
    order: Vec<u32>,
    /// Lowest height of a crown.
    lowest: f64,
}

impl<'a> TreeCrowns<'a> {
    /// Takes O(n log n) for n tops.
    fn new(numbering: &'a TreeNumbering, tops: Vec<Point>) -> Self {
        let mut order: Vec<u32> = (0..tops.len() as u32).collect();
        halve(&tops, &mut order, 0);
        let heights = tops.iter().map(|top| numbering.height_of(*top));
        let lowest = heights.fold(f64::INFINITY, f64::min) * numbering.height;
        Self { numbering, tops, order, lowest }
    }

    /// The index of the tree of a point. Takes O(log n) for n tops where these are spread evenly.
    fn of(&self, point: Point) -> Option<usize> {
        let TreeNumbering { radius, height, .. } = *self.numbering;
        let z = self.numbering.height_of(point);
        if z < self.lowest {
            return None;
        }
        let mut best = (f64::INFINITY, u32::MAX);
        self.search(&self.order, 0, point, &mut best);
        let (square, index) = best;
        let top = self.numbering.height_of(*self.tops.get(index as usize)?).max(0.0);
        let is_in = square <= (top * radius).powi(2) && z >= top * height;
        is_in.then_some(index as usize)
    }

    /// Finds the nearest of some tops; of two as near, the first.
    fn search(&self, order: &[u32], axis: usize, point: Point, best: &mut (f64, u32)) {
        let Some(&middle) = order.get(order.len() / 2) else { return };
        let top = self.tops[middle as usize];
        let found = (self.numbering.square(point, top), middle);
        if found < *best {
            *best = found;
        }
        let (low, high) = (&order[..order.len() / 2], &order[order.len() / 2 + 1..]);
        let is_low = coordinate(point, axis) < coordinate(top, axis);
        let (near, far) = if is_low { (low, high) } else { (high, low) };
        self.search(near, 1 - axis, point, best);
        let border = match axis {
            0 => Point { y: point.y, ..top },
            _ => Point { x: point.x, ..top },
        };
        if self.numbering.square(point, border) <= best.0 {
            self.search(far, 1 - axis, point, best);
        }
    }
}

fn coordinate(point: Point, axis: usize) -> i32 {
    if axis == 0 { point.x } else { point.y }
}

/// Orders tops as a k-d tree: those before the middle are no greater along the axis, those behind it no less.
fn halve(tops: &[Point], order: &mut [u32], axis: usize) {
    if order.len() < 2 {
        return;
    }
    let middle = order.len() / 2;
    let key = |index: &u32| (coordinate(tops[*index as usize], axis), *index);
    let (low, _, high) = order.select_nth_unstable_by_key(middle, key);
    halve(tops, low, 1 - axis);
    halve(tops, high, 1 - axis);
}

impl TreeNumbering {
    fn height_of(&self, point: Point) -> f64 {
        self.ruler.at(point.z.into())
    }

    /// Squared distance in x and y, in metres. Steps are squared first: exact for some 10^8 steps, so that equal
    /// distances compare equal.
    fn square(&self, a: Point, b: Point) -> f64 {
        let apart = |a: i32, b: i32| (f64::from(a) - f64::from(b)).powi(2);
        let [x, y] = self.step;
        (apart(a.x, b.x) + apart(a.y, b.y) * (y / x).powi(2)) * x.powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crowns_have_shares_of_the_height() {
        let tops = TreeTops { window: 5.0, min: 2.0 };
        assert_eq!("5".parse(), Ok(Trees { tops, radius: 0.6, height: 0.3 }));
        let tops = TreeTops { window: 4.5, min: 1.0 };
        assert_eq!(
            "4.5:radius=0.5:min=1:height=0".parse(),
            Ok(Trees { tops, radius: 0.5, height: 0.0 })
        );
        for text in [
            "",
            "5:radius=1:radius=1",
            "5:radius=",
            "5:radius=-1",
            "5:height=nan",
            "5:wide=2",
            "radius=1",
        ] {
            assert!(text.parse::<Trees>().is_err(), "{text}");
        }
    }
}
