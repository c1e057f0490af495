//! Tiles of points grouped into regions of about equal work.

use serde::{Deserialize, Serialize};

use crate::point_index::{PointStore, Tiling};
use terrane_base::error::Error;
use terrane_delaunay::SiteWindow;

/// Most points of a region, unless a single tile holds more.
pub(super) const REGION_POINTS: u64 = 1 << 17;

/// A block of tiles that is processed as a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct CloudTinRegion {
    /// First column and row of tiles.
    pub(super) low: [u32; 2],
    /// Column and row after the last.
    pub(super) end: [u32; 2],
    /// Number of points and line pieces in it.
    pub(super) points: u64,
}

/// All regions that hold points or lines, in the order of a space-filling curve.
#[derive(Debug)]
pub(super) struct CloudTinRegions {
    pub(super) all: Vec<CloudTinRegion>,
    /// Region of each tile.
    of: Vec<u32>,
}

impl CloudTinRegion {
    /// Its tiles, row by row.
    pub(super) fn squares<'a>(&self, tiling: &'a Tiling) -> impl Iterator<Item = usize> + use<'a> {
        let Self { low, end, .. } = *self;
        (low[1]..end[1])
            .flat_map(move |row| (low[0]..end[0]).map(move |col| [col, row]))
            .map(|tile| tiling.square(tile))
    }

    /// True if a tile is in it.
    pub(super) fn contains(&self, tile: [u32; 2]) -> bool {
        (0..2).all(|axis| self.low[axis] <= tile[axis] && tile[axis] < self.end[axis])
    }

    /// Its window.
    pub(super) fn window(&self, tiling: &Tiling) -> SiteWindow {
        let first = tiling.window_of(tiling.square(self.low));
        first.union(&tiling.window_of(tiling.square(self.end.map(|end| end - 1))))
    }
}

impl CloudTinRegions {
    /// Divides the tiles of a store, with the number of line pieces in each (none if empty): halves both sides
    /// while there are more than `max_count` points and pieces, and more than one tile.
    pub(super) fn new(store: &PointStore, lines: &[u32], max_count: u64) -> Self {
        let counts = store.tiling().counts();
        let side = counts[0].max(counts[1]).next_power_of_two();
        let mut regions = Self::known(&[], store.tiling());
        let mut blocks = vec![([0; 2], side)];
        while let Some((low, side)) = blocks.pop() {
            let end = [0, 1].map(|axis| (low[axis] + side).min(counts[axis]));
            let mut region = CloudTinRegion { low, end, points: 0 };
            for square in region.squares(store.tiling()) {
                region.points += store.summary(square).map_or(0, |summary| summary.count);
                region.points += lines.get(square).copied().map_or(0, u64::from);
            }
            if region.points > max_count && side > 1 {
                blocks.extend(quarters(low, side / 2));
            } else if region.points > 0 {
                regions.push(region, store.tiling());
            }
        }
        regions
    }

    /// Regions from a plan.
    pub(super) fn known(all: &[CloudTinRegion], tiling: &Tiling) -> Self {
        let mut regions = Self { all: Vec::new(), of: vec![u32::MAX; tiling.count()] };
        all.iter().for_each(|region| regions.push(*region, tiling));
        regions
    }

    fn push(&mut self, region: CloudTinRegion, tiling: &Tiling) {
        let number = self.all.len() as u32;
        region.squares(tiling).for_each(|square| self.of[square] = number);
        self.all.push(region);
    }

    /// The region of a tile with points or lines.
    pub(super) fn of(&self, square: usize) -> usize {
        self.of[square] as usize
    }

    /// Points and pieces of lines of the fullest region.
    pub(super) fn max_points(&self) -> u64 {
        self.all.iter().map(|region| region.points).max().unwrap_or(0)
    }
}

/// The quarters of a block, in reverse order of processing.
fn quarters([col, row]: [u32; 2], side: u32) -> [([u32; 2], u32); 4] {
    [[1, 1], [0, 1], [1, 0], [0, 0]].map(|[x, y]| ([col + x * side, row + y * side], side))
}

/// The error of points without a surface.
pub(super) fn no_surface() -> Error {
    Error::bad_input("the points do not form a surface: fewer than three, or all collinear")
        .remedy("check the filters, or the files with `terrane info`")
}
