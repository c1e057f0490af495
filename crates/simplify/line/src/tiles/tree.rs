//! Quadtree of tiles: lookup of positions and segments.

use std::cmp::Ordering;

use super::vertex_counts::{SummedVertexCounts, VertexHistogram, cell, power};
use terrane_base::error::{Error, Result};
use terrane_base::geom::plane::{Xy, orient};

/// Levels between a crowded cell and the cells of its finer count.
const FINER: i32 = 6;

/// State of a tree node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum QuadtreeNodeState {
    /// Unknown.
    Open,
    /// A tile, by number.
    Tile(u32),
    /// Divided: index of the first of four consecutive children.
    Divided(u32),
    /// Too many vertices; divided after counting, by index in the crowded cells.
    Crowded(u32),
}

#[derive(Clone, Copy, Debug)]
struct QuadtreeNode {
    /// Its cell of side 2^level.
    cell: [i64; 2],
    level: i32,
    kind: QuadtreeNodeState,
}

impl QuadtreeNode {
    /// Its lowest position. Corners and centres are exact.
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

    /// Whether the cell has positions within `reach` of `p` in x and in y.
    fn is_near(&self, p: Xy, reach: f64) -> bool {
        let (low, high) = (self.low(), self.high());
        (0..2).all(|axis| low[axis] <= p[axis] + reach && p[axis] - reach < high[axis])
    }

    /// Whether a segment intersects the closed cell. Exact.
    fn meets(&self, [a, b]: [Xy; 2]) -> bool {
        let (low, high) = (self.low(), self.high());
        let is_apart = (0..2).any(|axis| {
            (a[axis] < low[axis] && b[axis] < low[axis])
                || (a[axis] > high[axis] && b[axis] > high[axis])
        });
        if is_apart {
            return false;
        }
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
        let first = orient(a, b, corners[0]);
        first == Ordering::Equal || corners.iter().any(|&corner| orient(a, b, corner) != first)
    }
}

/// Tiles with a limited number of vertices, by number. Some may be empty; segments may meet there.
#[derive(Clone, Debug)]
pub struct VertexQuadtree {
    /// Up to four roots, then children.
    nodes: Vec<QuadtreeNode>,
    roots: usize,
    /// Crowded cells with their levels.
    crowded: Vec<([i64; 2], i32)>,
    /// Number of vertices of each tile.
    counts: Vec<u64>,
    /// Largest number of vertices of a tile.
    most: u64,
    /// Lowest level of cells.
    lowest: i32,
}

/// The tile found last, usually the next one as well.
#[derive(Clone, Copy, Debug, Default)]
pub struct LastTile {
    tile: u32,
    low: Xy,
    high: Xy,
}

impl VertexQuadtree {
    /// Tiles with up to `most` vertices each: one tile if all fit. Some may exceed the limit until
    /// [`finer`](Self::finer) counts are made.
    ///
    /// # Errors
    /// `Limit` if more than `most` vertices are almost at one position.
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

    /// Cells to count before all tiles are known, if any.
    pub fn finer(&self) -> Option<RefinedCounts<'_>> {
        let levels = self.crowded.iter().map(|(_, level)| *level);
        (!self.crowded.is_empty()).then(|| RefinedCounts::new(self, levels))
    }

    /// Tiles with crowded cells divided as far as the counts allow.
    ///
    /// # Errors
    /// `Limit` if too many vertices are almost at one position.
    pub fn refined(finer: RefinedCounts<'_>, quadtree: &Self) -> Result<Self> {
        let counts = finer.into_counts(&quadtree.crowded);
        let mut all = quadtree.clone();
        all.crowded.clear();
        for (at, node) in quadtree.nodes.iter().enumerate() {
            if let QuadtreeNodeState::Crowded(crowded) = node.kind {
                all.divide(vec![at], &counts[crowded as usize])?;
            }
        }
        Ok(all)
    }

    /// Divides nodes as far as the counts allow.
    fn divide(&mut self, mut open: Vec<usize>, counts: &SummedVertexCounts) -> Result<()> {
        // Popped from the end in the order of cells, so tiles get the numbers that a recursion would give.
        open.reverse();
        while let Some(at) = open.pop() {
            let QuadtreeNode { cell, level, .. } = self.nodes[at];
            let count = counts.of(cell, level);
            self.nodes[at].kind = if count <= self.most {
                self.counts.push(count);
                QuadtreeNodeState::Tile(self.counts.len() as u32 - 1)
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

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.counts.len()
    }

    /// Number of vertices of a tile.
    pub fn vertices(&self, tile: usize) -> u64 {
        self.counts[tile]
    }

    /// Leaf node of a position.
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

    /// Crowded cell of a position, and its level.
    fn crowded_at(&self, p: Xy) -> Option<(usize, i32)> {
        let node = self.leaf(p)?;
        match node.kind {
            QuadtreeNodeState::Crowded(crowded) => Some((crowded as usize, node.level)),
            _ => None,
        }
    }

    /// Tile of a position; `None` outside all vertices. O(depth) unless it is that of `place`.
    #[inline]
    pub fn of(&self, p: Xy, place: &mut LastTile) -> Option<u32> {
        let (low, high) = (place.low, place.high);
        if low[0] <= p[0] && p[0] < high[0] && low[1] <= p[1] && p[1] < high[1] {
            return Some(place.tile);
        }
        self.find(p, place)
    }

    fn find(&self, p: Xy, place: &mut LastTile) -> Option<u32> {
        if self.roots == 0 {
            return Some(0);
        }
        let node = self.leaf(p)?;
        let QuadtreeNodeState::Tile(tile) = node.kind else { return None };
        *place = LastTile { tile, low: node.low(), high: node.high() };
        Some(tile)
    }

    /// Fills `found` with the tiles of positions within `reach` of `p`, ascending.
    pub fn around(&self, p: Xy, reach: f64, found: &mut Vec<u32>) {
        found.clear();
        self.find_all(|node| node.is_near(p, reach), found);
    }

    /// Fills `found` with the tiles that a segment intersects, borders included, ascending. Exact; O(tiles
    /// found and their parents).
    pub fn meeting(&self, segment: [Xy; 2], found: &mut Vec<u32>) {
        found.clear();
        self.find_all(|node| node.meets(segment), found);
    }

    /// Appends the tiles for which, and for whose parents, a predicate holds; ascending.
    fn find_all(&self, holds: impl Fn(&QuadtreeNode) -> bool, found: &mut Vec<u32>) {
        let mut open: Vec<usize> = (0..self.roots).collect();
        while let Some(at) = open.pop() {
            let node = &self.nodes[at];
            match node.kind {
                QuadtreeNodeState::Open | QuadtreeNodeState::Crowded(_) => {}
                _ if !holds(node) => {}
                QuadtreeNodeState::Tile(tile) => found.push(tile),
                QuadtreeNodeState::Divided(first) => {
                    open.extend(first as usize..first as usize + 4)
                }
            }
        }
        found.sort_unstable();
    }
}

/// Counts in finer cells for tiles with too many vertices. 32 KiB each.
#[derive(Clone, Debug)]
pub struct RefinedCounts<'a> {
    quadtree: &'a VertexQuadtree,
    /// For each crowded cell: the level of its finer cells, and their counts.
    counts: Vec<(i32, Vec<u64>)>,
}

impl<'a> RefinedCounts<'a> {
    /// For the crowded cells of `quadtree`, of these levels.
    fn new(quadtree: &'a VertexQuadtree, levels: impl Iterator<Item = i32>) -> Self {
        let counts = levels.map(|level| {
            let finer = (level - FINER).max(quadtree.lowest);
            (finer, vec![0; 1 << (2 * (level - finer))])
        });
        Self { quadtree, counts: counts.collect() }
    }

    /// Counts vertices; others are ignored.
    pub fn add(&mut self, points: &[Xy]) {
        for &p in points {
            if let Some((crowded, level)) = self.quadtree.crowded_at(p) {
                let (finer, counts) = &mut self.counts[crowded];
                let side = 1 << (level - *finer);
                let at = cell(p, *finer).map(|c| c & (side - 1));
                counts[(at[1] * side + at[0]) as usize] += 1;
            }
        }
    }

    /// Counts of each crowded cell, with its level.
    fn into_counts(self, cells: &[([i64; 2], i32)]) -> Vec<SummedVertexCounts> {
        let counts = self.counts.into_iter().zip(cells);
        let made = counts.map(|((finer, counts), (cell, level))| {
            let up = level - finer;
            let low = cell.map(|c| c << up);
            let high = low.map(|c| c + (1 << up) - 1);
            SummedVertexCounts::new(finer, [low, high], |at| {
                counts[(((at[1] - low[1]) << up) + at[0] - low[0]) as usize]
            })
        });
        made.collect()
    }
}
