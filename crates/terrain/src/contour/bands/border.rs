//! The border of the area with heights: lattice edges with a cell of four heights on one side only.

use crate::contour::tiles::ContourTiles;
use terrane_base::geom::Rect;
use terrane_window::contour::ContourLevels;

/// Direction of a border, which has the area on its left where the first row is in the north.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::contour) enum Heading {
    East,
    South,
    West,
    North,
}

impl Heading {
    pub(super) fn is_down(self) -> bool {
        matches!(self, Self::South | Self::North)
    }

    /// True if column or row increases.
    pub(super) fn is_upward(self) -> bool {
        matches!(self, Self::East | Self::South)
    }

    pub(super) fn left(self) -> Self {
        match self {
            Self::East => Self::North,
            Self::South => Self::East,
            Self::West => Self::South,
            Self::North => Self::West,
        }
    }
}

/// A straight part of the border, from sample to sample.
#[derive(Clone, Copy, Debug)]
pub(in crate::contour) struct BorderRun {
    /// Its sample of lowest column and row.
    pub(super) col: u32,
    pub(super) row: u32,
    /// Number of edges.
    pub(super) len: u32,
    /// Rank of one of its samples.
    pub(super) rank: i32,
    pub(super) heading: Heading,
}

impl BorderRun {
    /// The sample `along` edges from its start.
    pub(super) fn sample(&self, along: u32) -> (u32, u32) {
        let from_lowest = if self.heading.is_upward() { along } else { self.len - along };
        match self.heading.is_down() {
            true => (self.col, self.row + from_lowest),
            false => (self.col + from_lowest, self.row),
        }
    }

    /// Distance of a sample or crossing from its start; `from_lowest` is that from its lowest sample.
    pub(super) fn along(&self, from_lowest: f64) -> f64 {
        if self.heading.is_upward() { from_lowest } else { f64::from(self.len) - from_lowest }
    }

    /// The lattice line that it is on, and where it begins and ends there.
    pub(super) fn span(&self) -> (u32, [u32; 2]) {
        match self.heading.is_down() {
            true => (self.col, [self.row, self.row + self.len]),
            false => (self.row, [self.col, self.col + self.len]),
        }
    }

    fn part(&self, from: u32, to: u32) -> Self {
        match self.heading.is_down() {
            true => Self { row: from, len: to - from, ..*self },
            false => Self { col: from, len: to - from, ..*self },
        }
    }
}

/// The border in a tile.
#[derive(Debug, Default)]
pub(in crate::contour) struct GridBorder {
    pub(super) runs: Vec<BorderRun>,
    /// Rims with a cell of four heights in this tile; border if the cell beyond has a void. The samples of each
    /// but the last have one rank.
    pub(super) rims: Vec<BorderRun>,
    above: Vec<bool>,
    below: Vec<bool>,
    /// Runs down each column that have not ended.
    down: Vec<Option<OpenRun>>,
}

/// A run that has not ended.
#[derive(Clone, Copy, Debug)]
struct OpenRun {
    heading: Heading,
    start: u32,
    rank: i32,
}

/// The samples of a tile.
pub(super) struct BorderTile<'a, H> {
    pub(super) rect: Rect,
    pub(super) tiles: ContourTiles,
    pub(super) heights: &'a [H],
    pub(super) levels: &'a ContourLevels,
}

impl<H: Copy + Into<f64>> BorderTile<'_, H> {
    pub(super) fn height(&self, col: u32, row: u32) -> f64 {
        let (col, row) = ((col - self.rect.col) as usize, (row - self.rect.row) as usize);
        self.heights[row * self.rect.width as usize + col].into()
    }

    /// The rank of a sample; samples of whole cells have one, as they have been traced.
    fn rank(&self, col: u32, row: u32) -> i32 {
        self.levels.rank_of(self.height(col, row)).unwrap_or_default()
    }

    /// True if the four samples of a cell, given by its first, have heights.
    pub(super) fn is_whole(&self, col: u32, row: u32) -> bool {
        [(0, 0), (1, 0), (0, 1), (1, 1)]
            .iter()
            .all(|(right, down)| !self.height(col + right, row + down).is_nan())
    }
}

impl GridBorder {
    /// Fills itself. O(samples).
    pub(super) fn fill<H: Copy + Into<f64>>(&mut self, tile: &BorderTile<'_, H>) {
        let Rect { col, row, width, .. } = tile.rect;
        self.runs.clear();
        self.rims.clear();
        let cells = width as usize - 1;
        for whole in [&mut self.above, &mut self.below] {
            whole.clear();
            whole.resize(cells, false);
        }
        self.down.clear();
        self.down.resize(cells + 1, None);
        let end_row = tile.rect.end_row();
        for at in row..end_row {
            std::mem::swap(&mut self.above, &mut self.below);
            for (right, whole) in self.below.iter_mut().enumerate() {
                *whole = at + 1 < end_row && tile.is_whole(col + right as u32, at);
            }
            self.along(tile, at);
            for right in 0..=cells {
                let west = right > 0 && self.below[right - 1];
                let east = right < cells && self.below[right];
                let heading = match (west, east) {
                    (true, false) => Some(Heading::North),
                    (false, true) => Some(Heading::South),
                    _ => None,
                };
                self.go_down(tile, col + right as u32, at, heading);
            }
        }
    }

    /// Runs along row `row`.
    fn along<H: Copy + Into<f64>>(&mut self, tile: &BorderTile<'_, H>, row: u32) {
        let is_rim = tile.tiles.is_rim_row(row);
        let mut open = None;
        for right in 0..=self.below.len() {
            let heading = match (self.above.get(right), self.below.get(right)) {
                (Some(true), Some(false)) => Some(Heading::East),
                (Some(false), Some(true)) => Some(Heading::West),
                _ => None,
            };
            let col = tile.rect.col + right as u32;
            let ended = next(&mut open, heading, col, || tile.rank(col, row), is_rim);
            if let Some(OpenRun { heading, start, rank }) = ended {
                let run = BorderRun { col: start, row, len: col - start, rank, heading };
                self.push(run, is_rim);
            }
        }
    }

    fn go_down<H: Copy + Into<f64>>(
        &mut self,
        tile: &BorderTile<'_, H>,
        col: u32,
        row: u32,
        heading: Option<Heading>,
    ) {
        let is_rim = tile.tiles.is_rim_col(col);
        let open = &mut self.down[(col - tile.rect.col) as usize];
        let ended = next(open, heading, row, || tile.rank(col, row), is_rim);
        if let Some(OpenRun { heading, start, rank }) = ended {
            self.push(BorderRun { col, row: start, len: row - start, rank, heading }, is_rim);
        }
    }

    fn push(&mut self, run: BorderRun, is_rim: bool) {
        if is_rim { self.rims.push(run) } else { self.runs.push(run) }
    }
}

/// Goes on with a run by an edge with a heading; returns the run that ended before.
fn next(
    open: &mut Option<OpenRun>,
    heading: Option<Heading>,
    at: u32,
    rank: impl Fn() -> i32,
    is_rim: bool,
) -> Option<OpenRun> {
    let goes_on = open.is_some_and(|run| Some(run.heading) == heading);
    if goes_on && !(is_rim && open.is_some_and(|run| run.rank != rank())) {
        return None;
    }
    let opened = heading.map(|heading| OpenRun { heading, start: at, rank: rank() });
    std::mem::replace(open, opened)
}

/// The border among the rims of all tiles: where only one of the two tiles has a whole cell.
pub(super) fn unpaired(mut rims: Vec<BorderRun>) -> Vec<BorderRun> {
    let line = |run: &BorderRun| (run.heading.is_down(), run.span().0);
    rims.sort_unstable_by_key(|run| (line(run), run.heading.is_upward(), run.span().1));
    let mut border = Vec::new();
    for rims in rims.chunk_by(|a, b| line(a) == line(b)) {
        let (back, forth) = rims.split_at(rims.partition_point(|run| !run.heading.is_upward()));
        subtract(back, forth, &mut border);
        subtract(forth, back, &mut border);
    }
    border
}

/// Appends the parts of `runs` that are in none of `others`; both are sorted and disjoint.
fn subtract(runs: &[BorderRun], others: &[BorderRun], parts: &mut Vec<BorderRun>) {
    let mut first = 0;
    for run in runs {
        let (_, [mut from, to]) = run.span();
        while first < others.len() && others[first].span().1[1] <= from {
            first += 1;
        }
        for other in &others[first..] {
            let (_, [start, end]) = other.span();
            if start >= to {
                break;
            }
            if start > from {
                parts.push(run.part(from, start));
            }
            from = end;
        }
        if from < to {
            parts.push(run.part(from, to));
        }
    }
}
