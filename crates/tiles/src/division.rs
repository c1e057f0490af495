//! Division of the work on tiles, from the georeference of a grid alone: rows to survey, regions whose samples
//! are read once, and the tiles above them.

use std::fmt;
use std::ops::Range;

use super::georeference::GridFootprint;
use terrane_engine::plan::Numbered;
use terrane_globe::{DEEPEST, GeodeticBounds, GlobeTileId, SampleBlocks, degrees};

/// Samples along a side of a region.
pub(super) const REGION: f64 = 1024.0;
/// Samples surveyed by one task, about.
const SURVEY_SAMPLES: u64 = 1 << 30;
/// Rows of a survey task are a multiple of this, which usually matches the blocks of files.
const SURVEY_ROWS: u32 = 1024;

/// A task by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum TilesTask {
    /// Surveys rows of the grid.
    Survey(u32),
    /// Makes the tiles of regions.
    Near(u32),
    /// Makes tiles that contain regions.
    Far(u32),
}

impl TilesTask {
    /// By name.
    pub(super) const NAMES: [Numbered<Self>; 3] =
        [("survey", Self::Survey), ("near", Self::Near), ("far", Self::Far)];
}

impl fmt::Display for TilesTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Survey(number) => write!(f, "survey-{number}"),
            Self::Near(number) => write!(f, "near-{number}"),
            Self::Far(number) => write!(f, "far-{number}"),
        }
    }
}

/// Tiles of a level in a rectangle, row by row from the north.
struct TileRows {
    level: u8,
    west: u32,
    north: u32,
    columns: u64,
    count: u64,
}

/// Tiles by number.
pub(super) struct TileNumbering(Vec<TileRows>);

impl TileNumbering {
    pub(super) fn len(&self) -> u64 {
        self.0.iter().map(|rows| rows.count).sum()
    }

    /// Number of tasks with `cut` tiles each.
    fn tasks(&self, cut: u32) -> u32 {
        self.len().div_ceil(u64::from(cut)) as u32
    }

    /// Tiles with these numbers, clipped to the existing ones.
    pub(super) fn slice(&self, numbers: Range<u64>) -> Vec<GlobeTileId> {
        let mut first = 0;
        let mut tiles = Vec::new();
        for rows in &self.0 {
            let [from, to] =
                [numbers.start, numbers.end].map(|i| i.clamp(first, first + rows.count) - first);
            tiles.extend((from..to).map(|i| rows.at(i)));
            first += rows.count;
        }
        tiles
    }

    pub(super) fn all(&self) -> Vec<GlobeTileId> {
        self.slice(0..self.len())
    }
}

impl TileRows {
    fn at(&self, i: u64) -> GlobeTileId {
        let [x, y] = [i % self.columns, i / self.columns].map(|at| at as u32);
        GlobeTileId { level: self.level, x: self.west + x, y: self.north - y }
    }
}

/// Division of the work.
#[derive(Clone, Debug)]
pub(super) struct TilesDivision {
    pub(super) place: GridFootprint,
    /// Maximum level.
    pub(super) last: u8,
    /// First level whose tiles are regions or parts of one. It may be deeper than the deepest level of the
    /// output, so the amount read at once does not depend on the options.
    pub(super) near: u8,
}

impl TilesDivision {
    /// Division for levels up to `last`.
    pub(super) fn new(place: GridFootprint, last: u8) -> Self {
        let near = (0..DEEPEST).find(|level| degrees(*level) <= REGION * place.spacing);
        Self { place, last, near: near.unwrap_or(DEEPEST) }
    }

    /// Level after the last with tiles that contain regions.
    pub(super) fn far_end(&self) -> u8 {
        self.near.min(self.last + 1)
    }

    /// Meridians and parallels that are tile borders of levels above the regions.
    pub(super) fn lines(&self) -> [Vec<f64>; 2] {
        let Some(level) = self.far_end().checked_sub(1) else { return [Vec::new(), Vec::new()] };
        let [cols, rows] = GlobeTileId::meeting(level, &self.place.bounds());
        let width = degrees(level);
        [(cols, -180.0), (rows, -90.0)].map(|([first, last], from)| {
            (first..=last + 1).map(|i| from + f64::from(i) * width).collect()
        })
    }

    /// Regions, from the north (the usual row order of grids).
    pub(super) fn regions(&self) -> TileNumbering {
        TileNumbering(vec![self.rows_of(self.near)])
    }

    /// All tiles of levels above `end`, with both tiles of level 0, which every client requests.
    pub(super) fn above(&self, end: u8) -> TileNumbering {
        let roots = TileRows { level: 0, west: 0, north: 0, columns: 2, count: 2 };
        TileNumbering(
            std::iter::once(roots).chain((1..end).map(|level| self.rows_of(level))).collect(),
        )
    }

    /// Tiles of a level.
    pub(super) fn level(&self, level: u8) -> TileNumbering {
        TileNumbering(vec![self.rows_of(level)])
    }

    fn rows_of(&self, level: u8) -> TileRows {
        let [[west, east], [south, north]] = GlobeTileId::meeting(level, &self.place.bounds());
        let [columns, rows] = [east - west, north - south].map(|last| u64::from(last) + 1);
        TileRows { level, west, north, columns, count: columns * rows }
    }

    /// Tasks of the three kinds, with `cut` tiles in each of the last two.
    pub(super) fn counts(&self, cut: u32) -> [u32; 3] {
        let surveys = self.place.size[1].div_ceil(self.survey_rows());
        [surveys, self.regions().tasks(cut), self.above(self.far_end()).tasks(cut)]
    }

    fn survey_rows(&self) -> u32 {
        let rows = SURVEY_SAMPLES / u64::from(self.place.size[0]);
        (rows as u32)
            .max(1)
            .next_multiple_of(SURVEY_ROWS.max(SampleBlocks::of(self.place.size).side))
    }

    /// Rows of a survey task: first, and one past the last.
    pub(super) fn rows(&self, survey: u32) -> [u32; 2] {
        let (rows, height) = (u64::from(self.survey_rows()), u64::from(self.place.size[1]));
        [survey, survey + 1].map(|survey| (u64::from(survey) * rows).min(height) as u32)
    }

    /// Approximate number of samples in a rectangle.
    pub(super) fn samples(&self, bounds: &GeodeticBounds) -> u64 {
        let (all, size) = (&self.place.bounds(), self.place.size);
        samples_along([bounds.west, bounds.east], [all.west, all.east], size[0])
            * samples_along([bounds.south, bounds.north], [all.south, all.north], size[1])
    }
}

/// Samples from `low` to `high` if `count` samples spread evenly over `from..to`.
fn samples_along([low, high]: [f64; 2], [from, to]: [f64; 2], count: u32) -> u64 {
    let step = ((to - from) / f64::from(count.max(2) - 1)).max(f64::MIN_POSITIVE);
    ((high.min(to) - low.max(from)).max(0.0) / step) as u64 + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Affine;

    fn division(side: u32, seconds: f64) -> TilesDivision {
        let step = seconds / 3600.0;
        let map = Affine { x0: 7.0, a: step, b: 0.0, y0: 46.0, d: 0.0, e: -step };
        let place = GridFootprint::of(&terrane_globe::GridGeolocation::straight(map, [side; 2]));
        TilesDivision::new(place, terrane_globe::deepest_for(step))
    }

    #[test]
    fn tasks_hold_all_there_is_to_do() {
        for (side, seconds) in [(2, 1.0), (500, 3600.0 / 8.0), (9000, 1.0), (80_000, 0.3)] {
            let division = division(side, seconds);
            for cut in [1, 7, 128] {
                let [surveys, near, far] = division.counts(cut).map(|count| count as usize);
                for (tasks, sweep) in
                    [(near, division.regions()), (far, division.above(division.far_end()))]
                {
                    let cut = u64::from(cut);
                    let parts: Vec<Vec<GlobeTileId>> =
                        (0..tasks as u64).map(|i| sweep.slice(i * cut..(i + 1) * cut)).collect();
                    assert!(parts.iter().all(|part| !part.is_empty()));
                    assert_eq!(parts.concat(), sweep.all());
                    let set: std::collections::BTreeSet<GlobeTileId> =
                        sweep.all().into_iter().collect();
                    assert_eq!(set.len() as u64, sweep.len());
                    // Whatever has a sample is among them.
                    let GeodeticBounds { west, south, east, north } = division.place.bounds();
                    for place in [[west, south], [east, north], [west, north]] {
                        let at = |id: &&GlobeTileId| {
                            id.bounds().holds(place) && id.level + 1 >= division.near
                        };
                        assert!(set.iter().any(|id| at(&id)) || division.near == 0);
                    }
                }
                let ends: Vec<[u32; 2]> = (0..surveys as u32).map(|i| division.rows(i)).collect();
                assert!(ends.windows(2).all(|pair| pair[0][1] == pair[1][0]));
                assert_eq!((ends[0][0], ends[surveys - 1][1]), (0, side));
                assert!(ends.iter().all(|[first, end]| first < end));
            }
        }
        assert!(division(80_000, 0.3).counts(1)[0] > 5);
    }
}
