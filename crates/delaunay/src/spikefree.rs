//! A surface of all returns without spikes: points are added from the highest down, and triangles freeze.
//!
//! After Khosravipour, Skidmore & Isenburg, "Generating spike-free digital surface models using LiDAR raw point
//! clouds: a new approach for forestry applications" (2016). Returns from deep in a crown, or from the ground below
//! it, leave spikes in a triangulation. So points come in the order of their heights. A triangle with no edge longer
//! than some length is *frozen* once the points to come are lower than its lowest corner by more than some buffer:
//! it takes no point, and its sides are flipped no more.
//!
//! Whether a triangle is frozen is a function of its corners and of how low the points have come, so nothing is
//! noted: one that is frozen stays in the triangulation, and frozen.

use std::cmp::Reverse;

use super::position::FixedPosition;
use super::predicates::Site;
use super::query::from_lowest;
use super::triangulation::Triangulation;
use super::window::SiteWindow;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, is_within};

/// When a triangle is frozen, in the unit of `step`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreezeRule {
    /// Its longest edge, across, is no longer than this.
    pub edge: f64,
    /// Its lowest corner is higher than the points to come by more than this, 0 at least.
    pub buffer: f64,
    /// Sizes of steps.
    pub step: [f64; 3],
}

impl FreezeRule {
    /// True if a triangle is small enough.
    fn is_small(&self, [a, b, c]: &[Point; 3]) -> bool {
        let [x, y, _] = self.step;
        [(a, b), (b, c), (c, a)].into_iter().all(|(p, q)| is_within(*p, *q, [x, y], self.edge))
    }

    /// True if a triangle is frozen for points no higher than `z`.
    fn holds(&self, corners: &[Point; 3], z: i32) -> bool {
        let [a, b, c] = corners.map(|p| i64::from(p.z));
        let above = a.min(b).min(c) - i64::from(z);
        above as f64 * self.step[2] > self.buffer && self.is_small(corners)
    }
}

/// Vertices around the points, which the first triangles have: they are as far away as the window is wide, so
/// triangles of all but the border have none of them. Their numbers come before those of the points.
const FRAME: u32 = 4;
/// Steps along the widest window: the frame reaches as far on both sides.
const WIDEST: i64 = terrane_base::geom::REACH as i64 / 2;

/// The spike-free triangulation of the points of a window.
///
/// It is a function of the set of points, whatever their order: equally high ones come by x, then y, and of
/// several at one (x, y) the highest counts. n log n for points that lie evenly; about 80 bytes a point.
#[derive(Debug)]
pub struct SpikeFree {
    /// From the window's corner on.
    points: Vec<Point>,
    triangulation: Triangulation,
    freeze: FreezeRule,
    low: Site,
}

impl SpikeFree {
    /// Triangulates points, all of which lie in `window`.
    ///
    /// # Errors
    /// A limit: a window of 2^28 steps or more along a side.
    pub fn new(points: Vec<Point>, window: &SiteWindow, freeze: FreezeRule) -> Result<Self> {
        let [width, height] =
            [0, 1].map(|axis| i64::from(window.high[axis]) - i64::from(window.low[axis]) + 1);
        let side = width.max(height);
        if side > WIDEST {
            let what = "the extent of a spike-free tile in coordinate steps";
            return Err(Error::limit(what, side as u64, WIDEST as u64));
        }
        let (side, low) = (side as i32, window.low);
        let mut points = sorted(points);
        points.iter_mut().for_each(|p| (p.x, p.y) = (p.x - low[0], p.y - low[1]));
        let mut triangulation = Triangulation::new(&frame(side))?;
        triangulation.reserve(points.len());
        let mut made = Self { points, triangulation, freeze, low };
        let mut hints = WalkHints::new(side, made.points.len());
        (0..made.points.len() as u32).for_each(|number| made.add(number, &mut hints));
        Ok(made)
    }

    fn add(&mut self, number: u32, hints: &mut WalkHints) {
        let Self { points, triangulation, freeze, .. } = self;
        let point = points[number as usize];
        let at = [point.x, point.y];
        let Some(triangle) = triangulation.find(at, hints.near(at)) else { return };
        triangulation.insert_beside(
            at,
            FRAME + number,
            triangle,
            |ids| corners(points, ids).is_some_and(|corners| freeze.holds(&corners, point.z)),
            &mut |_| {},
        );
        hints.note(at, triangle);
    }

    /// The corners of the triangle that holds a position, from the lowest (x, then y) on, and whether it is as
    /// small as those that freeze; `None` beyond the points, or near their border. The walk begins at the triangle
    /// `last`, and leaves there the one it ends at: 0 for the first. Of a position on a side it is the one in the east
    /// of it (in the north, along x), with `back` the other.
    pub fn find(
        &self,
        at: FixedPosition,
        last: &mut u32,
        back: bool,
    ) -> Option<([Point; 3], bool)> {
        let low = FixedPosition::of(self.low);
        let at = FixedPosition { x: at.x - low.x, y: at.y - low.y };
        *last = self.triangulation.find_at(at, *last, back)?;
        let corners = corners(&self.points, self.triangulation.corners(*last)?)?;
        let placed = corners.map(|p| Point { x: p.x + self.low[0], y: p.y + self.low[1], ..p });
        Some((from_lowest(placed), self.freeze.is_small(&corners)))
    }
}

/// The vertices around a window.
fn frame(side: i32) -> [Point; FRAME as usize] {
    let [near, far] = [-side, 2 * side];
    [[near, near], [far, near], [near, far], [far, far]].map(|[x, y]| Point::new(x, y, 0))
}

/// The corners of a triangle; `None` for one that has a vertex of the frame.
fn corners(points: &[Point], ids: [u32; 3]) -> Option<[Point; 3]> {
    let has_frame = ids.iter().any(|id| *id < FRAME);
    (!has_frame).then(|| ids.map(|id| points[(id - FRAME) as usize]))
}

/// From the highest down, then by x, then y; of several at one position the highest.
fn sorted(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_unstable_by_key(|p| (p.x, p.y, Reverse(p.z)));
    points.dedup_by_key(|p| (p.x, p.y));
    points.sort_unstable_by_key(|p| (Reverse(p.z), p.x, p.y));
    points
}

/// Starting triangles of walks: one near each cell of a quadtree. Cells halve those of the previous level, down to
/// about two points.
struct WalkHints {
    /// Cells row by row, per level except the first, which is one cell.
    levels: Vec<Vec<u32>>,
    /// Bits of a coordinate.
    bits: u32,
}

/// Marks a cell without a known triangle.
const NOWHERE: u32 = u32::MAX;
/// Most levels.
const DEEPEST: u32 = 12;

impl WalkHints {
    fn new(side: i32, points: usize) -> Self {
        let bits = 32 - side.leading_zeros();
        let depth = (points / 2 + 1).ilog2().div_ceil(2).min(bits).min(DEEPEST);
        let levels = (1..=depth).map(|level| vec![NOWHERE; 1 << (2 * level)]);
        Self { levels: levels.collect(), bits }
    }

    /// The cell of a level that contains a site.
    fn cell(&self, level: usize, at: Site) -> usize {
        let level = level as u32 + 1;
        let [col, row] = at.map(|v| (v >> (self.bits - level)) as usize);
        (row << level) + col
    }

    /// A triangle near a site, from the finest cell that has one.
    fn near(&self, at: Site) -> u32 {
        let levels = (0..self.levels.len()).rev();
        let mut hints = levels.map(|level| self.levels[level][self.cell(level, at)]);
        hints.find(|hint| *hint != NOWHERE).unwrap_or(0)
    }

    /// Records a triangle for the cells around a site: the finest, and those that have none yet.
    fn note(&mut self, at: Site, triangle: u32) {
        for level in (0..self.levels.len()).rev() {
            let cell = self.cell(level, at);
            let before = std::mem::replace(&mut self.levels[level][cell], triangle);
            if before != NOWHERE {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests;
