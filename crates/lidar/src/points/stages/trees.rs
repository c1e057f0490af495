//! Trees: each point belongs to the nearest tree top, within a crown that grows with the height of the tree.
//!
//! The crowns of Silva and others, "Imputation of individual longleaf pine (Pinus palustris Mill.) tree attributes from
//! field and LiDAR data" (2016), of points instead of a grid, as `silva2016` of lidR. Tops are those of the stage
//! `tree-tops`; heights are those above ground where z is one.

use std::collections::{BTreeSet, HashMap};
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
/// Bytes of a top: in the list, in the set that is made first, and in the index.
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
        let (mut tops, mut radius, mut height) = (Vec::new(), 0.6, 0.3);
        for part in text.split(':') {
            let share = |text: &str| {
                let share = text.parse().ok().filter(|share: &f64| (0.0..=10.0).contains(share));
                share.ok_or_else(|| format!("expected a share from 0 to 10 in {part:?}"))
            };
            match part.trim().split_once('=') {
                Some(("radius", text)) => radius = share(text)?,
                Some(("height", text)) => height = share(text)?,
                Some((key, _)) if key != "min" => {
                    return Err(format!("expected min, radius or height, not {key}"));
                }
                _ => tops.push(part),
            }
        }
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
        let cell = self.tops.window * x / frame.scale[0];
        Ok(Box::new(TreeNumbering { search, ruler, step: [x, y], cell, radius, height, is_guess }))
    }
}

/// The search for tops and crowns among points of one frame.
struct TreeNumbering {
    search: TopSearch,
    ruler: Ruler,
    /// Metres of a step along x and y.
    step: [f64; 2],
    /// Side of a cell of the index, in metres.
    cell: f64,
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
    /// Indices of the tops of each cell.
    by_cell: HashMap<[i32; 2], Vec<u32>>,
    /// Largest radius, in cells.
    reach: i32,
    /// Lowest height of a crown.
    lowest: f64,
}

impl<'a> TreeCrowns<'a> {
    fn new(numbering: &'a TreeNumbering, tops: Vec<Point>) -> Self {
        let mut by_cell: HashMap<_, Vec<_>> = HashMap::new();
        for (index, top) in tops.iter().enumerate() {
            by_cell.entry(numbering.cell_of(*top)).or_default().push(index as u32);
        }
        let heights = || tops.iter().map(|top| numbering.height_of(*top));
        let widest = heights().fold(0.0, f64::max) * numbering.radius;
        let lowest = heights().fold(f64::INFINITY, f64::min) * numbering.height;
        // All cells may be nearer than the radius.
        let reach = (widest / numbering.cell).ceil().min(f64::from(i32::MAX / 4)) as i32 + 1;
        Self { numbering, tops, by_cell, reach, lowest }
    }

    /// The index of the tree of a point.
    fn of(&self, point: Point) -> Option<usize> {
        let TreeNumbering { cell, radius, height, .. } = *self.numbering;
        let z = self.numbering.height_of(point);
        if z < self.lowest {
            return None;
        }
        let [col, row] = self.numbering.cell_of(point);
        let mut best: Option<(f64, u32)> = None;
        for ring in 0..=self.reach {
            // The nearest of this ring of cells are as far as the cells within.
            let nearest = f64::from((ring - 1).max(0)) * cell;
            if best.is_some_and(|(square, _)| square < nearest * nearest) {
                break;
            }
            for index in ring_of(col, row, ring).filter_map(|at| self.by_cell.get(&at)).flatten() {
                let square = self.numbering.square(point, self.tops[*index as usize]);
                // Of two as near, the first.
                if best.is_none_or(|best| (square, *index) < best) {
                    best = Some((square, *index));
                }
            }
        }
        let (square, index) = best?;
        let top = self.numbering.height_of(self.tops[index as usize]).max(0.0);
        let is_in = square <= (top * radius).powi(2) && z >= top * height;
        is_in.then_some(index as usize)
    }
}

/// The cells at this distance in columns or rows.
fn ring_of(col: i32, row: i32, ring: i32) -> impl Iterator<Item = [i32; 2]> {
    (row.saturating_sub(ring)..=row.saturating_add(ring)).flat_map(move |at| {
        let is_edge = at.abs_diff(row) as i32 == ring;
        let step = if is_edge || ring == 0 { 1 } else { 2 * ring };
        let cols = col.saturating_sub(ring)..=col.saturating_add(ring);
        cols.step_by(step as usize).map(move |col| [col, at])
    })
}

impl TreeNumbering {
    fn height_of(&self, point: Point) -> f64 {
        self.ruler.at(point.z.into())
    }

    fn cell_of(&self, Point { x, y, .. }: Point) -> [i32; 2] {
        let [x, y] = [(x, self.step[0]), (y, self.step[1])];
        [x, y].map(|(at, step)| (f64::from(at) * step / self.cell).floor() as i32)
    }

    /// Squared distance in x and y, in metres.
    fn square(&self, a: Point, b: Point) -> f64 {
        let apart = [(a.x, b.x), (a.y, b.y)].map(|(a, b)| f64::from(a) - f64::from(b));
        (apart[0] * self.step[0]).powi(2) + (apart[1] * self.step[1]).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_are_the_cells_at_a_distance() {
        for ring in 0..5 {
            let mut found: Vec<_> = ring_of(7, -3, ring).collect();
            let around = (-9..=9).flat_map(|row| (-9..=9).map(move |col| [7 + col, -3 + row]));
            let is_in = |[col, row]: &[i32; 2]| (col - 7).abs().max((row + 3).abs()) == ring;
            let mut expected: Vec<_> = around.filter(is_in).collect();
            found.sort_unstable();
            expected.sort_unstable();
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn crowns_have_shares_of_the_height() {
        let tops = TreeTops { window: 5.0, min: 2.0 };
        assert_eq!("5".parse(), Ok(Trees { tops, radius: 0.6, height: 0.3 }));
        let tops = TreeTops { window: 4.5, min: 1.0 };
        assert_eq!(
            "4.5:radius=0.5:min=1:height=0".parse(),
            Ok(Trees { tops, radius: 0.5, height: 0.0 })
        );
        for text in ["", "5:radius=", "5:radius=-1", "5:height=nan", "5:wide=2", "radius=1"] {
            assert!(text.parse::<Trees>().is_err(), "{text}");
        }
    }
}
