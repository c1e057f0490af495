//! The quadtree of squares: which square a position is in, and through which ones a segment goes.

use std::cmp::Ordering;

use super::census::{SummedVertexCounts, VertexHistogram, cell, power};
use terrane_base::error::{Error, Result};
use terrane_base::geom::plane::{Xy, orient};

/// Levels between a cell that has too many vertices and the cells of its finer count.
const FINER: i32 = 6;

/// What a node of the tree is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum QuadtreeNodeState {
    /// Not known yet.
    Open,
    /// The square of this number.
    Square(u32),
    /// Divided: its first of four children, which follow each other.
    Divided(u32),
    /// It has too many vertices, and will be divided once they are counted: which of those it is.
    Crowded(u32),
}

#[derive(Clone, Copy, Debug)]
struct QuadtreeNode {
    /// The cell of side 2^level that it is.
    cell: [i64; 2],
    level: i32,
    kind: QuadtreeNodeState,
}

impl QuadtreeNode {
    /// Its lowest position. All corners and centres are exact.
    fn low(&self) -> Xy {
        self.cell.map(|c| c as f64 * power(self.level))
    }

    fn high(&self) -> Xy {
        self.cell.map(|c| (c + 1) as f64 * power(self.level))
    }

    fn holds(&self, p: Xy) -> bool {
        let (low, high) = (self.low(), self.high());
        (0..2).all(|axis| low[axis] <= p[axis] && p[axis] < high[axis])
    }

    /// Whether a segment has a point in common with the closed square. Exact.
    fn meets(&self, [a, b]: [Xy; 2]) -> bool {
        let (low, high) = (self.low(), self.high());
        let apart = |axis: usize| {
            (a[axis] < low[axis] && b[axis] < low[axis])
                || (a[axis] > high[axis] && b[axis] > high[axis])
        };
        if apart(0) || apart(1) {
            return false;
        }
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
        let first = orient(a, b, corners[0]);
        first == Ordering::Equal || corners.iter().any(|&corner| orient(a, b, corner) != first)
    }
}

/// Squares with at most so many vertices each, known by number. Some have none: segments may meet there.
#[derive(Clone, Debug)]
pub struct VertexQuadtree {
    /// Up to four roots, then children.
    nodes: Vec<QuadtreeNode>,
    roots: usize,
    /// The cells that have too many vertices, and their levels.
    crowded: Vec<([i64; 2], i32)>,
    /// Vertices of each square.
    counts: Vec<u64>,
    /// Most vertices of a square.
    most: u64,
    /// The lowest level that cells may have.
    lowest: i32,
}

/// The square that was found last, which is the next one's, too, more often than not.
#[derive(Clone, Copy, Debug, Default)]
pub struct LastTile {
    square: u32,
    low: Xy,
    high: Xy,
}

impl VertexQuadtree {
    /// Squares with up to `most` vertices each: one, if there are no more in all. Some may have
    /// more as long as there are [`finer`](Self::finer) counts to be made.
    ///
    /// # Errors
    /// `Limit` where more than `most` vertices are nearly in one place.
    pub fn new(census: &VertexHistogram, most: u64) -> Result<Self> {
        let mut all = Self {
            nodes: Vec::new(),
            roots: 0,
            crowded: Vec::new(),
            counts: Vec::new(),
            most,
            lowest: census.lowest_level(),
        };
        if census.total() <= most {
            all.counts.push(census.total());
            return Ok(all);
        }
        let counts = census.counts();
        let [low, high] = counts.range();
        let up = (0..).find(|up| (0..2).all(|axis| (high[axis] >> up) - (low[axis] >> up) <= 1));
        let level = counts.level + up.unwrap_or_default();
        let [low, high] = [low, high].map(|at| at.map(|c| c >> (level - counts.level)));
        for (y, x) in (low[1]..=high[1]).flat_map(|y| (low[0]..=high[0]).map(move |x| (y, x))) {
            all.nodes.push(QuadtreeNode { cell: [x, y], level, kind: QuadtreeNodeState::Open });
        }
        all.roots = all.nodes.len();
        all.divide((0..all.roots).collect(), &counts)?;
        Ok(all)
    }

    /// What has to be counted before all squares are known, if anything.
    pub fn finer(&self) -> Option<RefinedCounts<'_>> {
        let levels = self.crowded.iter().map(|(_, level)| *level);
        (!self.crowded.is_empty()).then(|| RefinedCounts::new(self, levels))
    }

    /// These squares with those divided that had too many vertices, as far as the counts tell.
    ///
    /// # Errors
    /// `Limit` where too many vertices are nearly in one place.
    pub fn refined(finer: RefinedCounts<'_>, squares: &Self) -> Result<Self> {
        let counts = finer.into_counts(&squares.crowded);
        let mut all = squares.clone();
        all.crowded.clear();
        for (at, node) in squares.nodes.iter().enumerate() {
            if let QuadtreeNodeState::Crowded(crowded) = node.kind {
                all.divide(vec![at], &counts[crowded as usize])?;
            }
        }
        Ok(all)
    }

    /// Divides nodes as far as counts tell.
    fn divide(&mut self, mut open: Vec<usize>, counts: &SummedVertexCounts) -> Result<()> {
        open.reverse();
        while let Some(at) = open.pop() {
            let QuadtreeNode { cell, level, .. } = self.nodes[at];
            let count = counts.of(cell, level);
            self.nodes[at].kind = if count <= self.most {
                self.counts.push(count);
                QuadtreeNodeState::Square(self.counts.len() as u32 - 1)
            } else if level > counts.level {
                let first = self.nodes.len();
                for [x, y] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                    let cell = [2 * cell[0] + x, 2 * cell[1] + y];
                    self.nodes.push(QuadtreeNode {
                        cell,
                        level: level - 1,
                        kind: QuadtreeNodeState::Open,
                    });
                }
                open.extend((first..first + 4).rev());
                QuadtreeNodeState::Divided(first as u32)
            } else if level > self.lowest {
                self.crowded.push((cell, level));
                QuadtreeNodeState::Crowded(self.crowded.len() as u32 - 1)
            } else {
                let at = self.nodes[at].low();
                return Err(Error::limit(
                    "the number of vertices at one position",
                    count,
                    self.most,
                )
                .at(format!("near {}, {}", at[0], at[1]))
                .remedy("remove duplicate vertices"));
            };
        }
        Ok(())
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.counts.len()
    }

    /// The vertices of a square.
    pub fn vertices(&self, square: usize) -> u64 {
        self.counts[square]
    }

    /// The node without children that a position is in.
    fn leaf(&self, p: Xy) -> Option<&QuadtreeNode> {
        let mut node = self.nodes[..self.roots].iter().find(|node| node.holds(p))?;
        while let QuadtreeNodeState::Divided(first) = node.kind {
            // The low corner of the last child is the centre.
            let centre = self.nodes[first as usize + 3].low();
            let child = usize::from(p[0] >= centre[0]) + 2 * usize::from(p[1] >= centre[1]);
            node = &self.nodes[first as usize + child];
        }
        Some(node)
    }

    /// Which crowded cell a position is in, and its level.
    fn crowded_at(&self, p: Xy) -> Option<(usize, i32)> {
        let node = self.leaf(p)?;
        match node.kind {
            QuadtreeNodeState::Crowded(crowded) => Some((crowded as usize, node.level)),
            _ => None,
        }
    }

    /// The square that a position is in; `None` beyond all vertices. O(depth) where it is not that
    /// of `place`.
    #[inline]
    pub fn of(&self, p: Xy, place: &mut LastTile) -> Option<u32> {
        let (low, high) = (place.low, place.high);
        if low[0] <= p[0] && p[0] < high[0] && low[1] <= p[1] && p[1] < high[1] {
            return Some(place.square);
        }
        self.find(p, place)
    }

    fn find(&self, p: Xy, place: &mut LastTile) -> Option<u32> {
        if self.roots == 0 {
            return Some(0);
        }
        let node = self.leaf(p)?;
        let QuadtreeNodeState::Square(square) = node.kind else { return None };
        *place = LastTile { square, low: node.low(), high: node.high() };
        Some(square)
    }

    /// Fills `found` with the squares that a position within `reach` of `p` may be in, ascending.
    pub fn around(&self, p: Xy, reach: f64, found: &mut Vec<u32>) {
        found.clear();
        let is_near = |node: &QuadtreeNode| {
            let (low, high) = (node.low(), node.high());
            (0..2).all(|axis| low[axis] <= p[axis] + reach && p[axis] - reach < high[axis])
        };
        self.find_all(is_near, found);
    }

    /// Fills `found` with the squares that a segment has a point in common with, their borders
    /// included, ascending. Exact; O(squares found and their parents).
    pub fn meeting(&self, segment: [Xy; 2], found: &mut Vec<u32>) {
        found.clear();
        self.find_all(|node| node.meets(segment), found);
    }

    /// Appends the squares for which, and for whose parents, something holds; ascending.
    fn find_all(&self, holds: impl Fn(&QuadtreeNode) -> bool, found: &mut Vec<u32>) {
        let mut open: Vec<usize> = (0..self.roots).collect();
        while let Some(at) = open.pop() {
            let node = &self.nodes[at];
            match node.kind {
                QuadtreeNodeState::Open | QuadtreeNodeState::Crowded(_) => {}
                _ if !holds(node) => {}
                QuadtreeNodeState::Square(square) => found.push(square),
                QuadtreeNodeState::Divided(first) => {
                    open.extend(first as usize..first as usize + 4)
                }
            }
        }
        found.sort_unstable();
    }
}

/// Counts by finer cells, where squares would have too many vertices and cannot be divided by the
/// counts that are known. 32 KiB for each.
#[derive(Clone, Debug)]
pub struct RefinedCounts<'a> {
    squares: &'a VertexQuadtree,
    /// For each square that is to be divided: the level of its finer cells, and their counts.
    counts: Vec<(i32, Vec<u64>)>,
}

impl<'a> RefinedCounts<'a> {
    /// For the crowded cells of `squares`, of these levels.
    fn new(squares: &'a VertexQuadtree, levels: impl Iterator<Item = i32>) -> Self {
        let room = |level: i32| {
            let finer = (level - FINER).max(squares.lowest);
            (finer, vec![0; 1 << (2 * (level - finer))])
        };
        Self { squares, counts: levels.map(room).collect() }
    }

    /// Counts vertices; those that lie elsewhere are left out.
    pub fn add(&mut self, points: &[Xy]) {
        for &p in points {
            if let Some((crowded, level)) = self.squares.crowded_at(p) {
                let (finer, counts) = &mut self.counts[crowded];
                let side = 1 << (level - *finer);
                let at = cell(p, *finer).map(|c| c & (side - 1));
                counts[(at[1] * side + at[0]) as usize] += 1;
            }
        }
    }

    /// The counts of each crowded cell, given with its level.
    fn into_counts(self, cells: &[([i64; 2], i32)]) -> Vec<SummedVertexCounts> {
        let counts = self.counts.into_iter().zip(cells);
        let made = counts.map(|((finer, counts), (cell, level))| {
            let up = level - finer;
            let low = cell.map(|c| c << up);
            let high = low.map(|c| c + (1 << up) - 1);
            let count = |at: [i64; 2]| counts[(((at[1] - low[1]) << up) + at[0] - low[0]) as usize];
            SummedVertexCounts::new(finer, [low, high], count)
        });
        made.collect()
    }
}
