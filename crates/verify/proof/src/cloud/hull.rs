//! The convex hull of a stream of points, and tests of positions and edges against it.

use crate::ProofPosition;
use crate::exact::double_area;

/// Positions after which a pool is worth reducing, at least.
const MIN_POOL: usize = 4096;
/// Directions whose outermost positions guard a pool, counter-clockwise.
const COMPASS: [[i64; 2]; 8] =
    [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];

/// A position in whole steps: column, row.
type Spot = [i32; 2];

/// Twice the area of (a, b, c); exact for coordinates from 0 to below 2^30.
fn turn(a: Spot, b: Spot, c: Spot) -> i64 {
    let [u, v] = [b, c].map(|p| [0, 1].map(|axis| i64::from(p[axis]) - i64::from(a[axis])));
    u[0] * v[1] - u[1] * v[0]
}

/// Gathers the convex hull of positions as they come. Memory: in proportion to the hull. Any order
/// and any grouping give the same hull.
#[derive(Clone, Debug, Default)]
pub struct HullGatherer {
    pool: Vec<Spot>,
    /// A convex polygon, counter-clockwise; positions strictly inside are not corners of the hull.
    guard: Vec<Spot>,
    reduced: usize,
}

impl HullGatherer {
    /// Adds a position, whose coordinates are from 0 to below 2^30.
    pub fn add(&mut self, at: [i32; 2]) {
        if self.is_inside(at) {
            return;
        }
        self.pool.push(at);
        // Doubled since the last time, so that all reductions together take O(n log n).
        if self.pool.len() >= MIN_POOL.max(2 * self.reduced) {
            self.reduce();
        }
    }

    /// Adds the positions of another one.
    pub fn merge(&mut self, other: Self) {
        other.pool.into_iter().for_each(|at| self.add(at));
    }

    /// The hull of everything added; `None` when that has no area.
    pub fn finish(mut self) -> Option<ProofHull> {
        self.reduce();
        (self.pool.len() > 2).then(|| ProofHull::new(&self.pool))
    }

    fn is_inside(&self, at: Spot) -> bool {
        let next = self.guard.iter().cycle().skip(1);
        self.guard.len() > 2 && self.guard.iter().zip(next).all(|(&a, &b)| turn(a, b, at) > 0)
    }

    fn reduce(&mut self) {
        self.pool = ring(std::mem::take(&mut self.pool));
        self.reduced = self.pool.len();
        self.guard = COMPASS.into_iter().filter_map(|way| farthest(&self.pool, way)).collect();
        self.guard.dedup();
        if self.guard.first() == self.guard.last() {
            self.guard.pop();
        }
    }
}

/// The position farthest in a direction; of several the last by column and row.
fn farthest(pool: &[Spot], [x, y]: [i64; 2]) -> Option<Spot> {
    pool.iter().copied().max_by_key(|at| (i64::from(at[0]) * x + i64::from(at[1]) * y, *at))
}

/// The corners of the convex hull, counter-clockwise from the lowest row, then column; without those
/// inside a side. A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions"
/// (1979), with rows in place of columns.
fn ring(mut spots: Vec<Spot>) -> Vec<Spot> {
    spots.sort_unstable_by_key(|&[col, row]| (row, col));
    spots.dedup();
    if spots.len() < 3 {
        return spots;
    }
    let mut ring = chain(spots.iter().copied());
    ring.pop();
    let mut back = chain(spots.iter().rev().copied());
    back.pop();
    ring.append(&mut back);
    ring
}

/// Half of a hull: turns left at every position.
fn chain(spots: impl Iterator<Item = Spot>) -> Vec<Spot> {
    let mut chain: Vec<Spot> = Vec::new();
    for spot in spots {
        while let [.., a, b] = chain[..]
            && turn(a, b, spot) <= 0
        {
            chain.pop();
        }
        chain.push(spot);
    }
    chain
}

/// A side of a hull, the hull on its left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ProofHullSide {
    from: ProofPosition,
    to: ProofPosition,
}

impl ProofHullSide {
    /// True when this side runs back: by its angle it comes in the second half of a turn that begins
    /// eastward.
    fn runs_back(&self) -> bool {
        let (rows, cols) = (self.to.row - self.from.row, self.to.col - self.from.col);
        rows < 0 || rows == 0 && cols < 0
    }

    /// True when it comes before `other` by its angle.
    fn is_before(&self, other: &Self) -> bool {
        match (self.runs_back(), other.runs_back()) {
            (false, true) => true,
            (true, false) => false,
            _ => self.cross(other) > 0,
        }
    }

    fn cross(&self, other: &Self) -> i128 {
        let [u, v] = [self, other].map(|side| {
            let (from, to) = (side.from, side.to);
            [to.col - from.col, to.row - from.row].map(i128::from)
        });
        u[0] * v[1] - u[1] * v[0]
    }

    /// True for positions on the side, its ends included.
    fn holds(&self, at: ProofPosition) -> bool {
        let (from, to) = (self.from, self.to);
        double_area(from, to, at) == 0
            && (from.col.min(to.col)..=from.col.max(to.col)).contains(&at.col)
            && (from.row.min(to.row)..=from.row.max(to.row)).contains(&at.row)
    }
}

/// A convex polygon with an area.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProofHull {
    /// By angle, from eastward round; the first begins at the lowest corner.
    sides: Vec<ProofHullSide>,
}

impl ProofHull {
    fn new(ring: &[Spot]) -> Self {
        let corners = ring.iter().map(|at| ProofPosition::sample(at[0].into(), at[1].into()));
        let next = corners.clone().cycle().skip(1);
        let sides = corners.zip(next).map(|(from, to)| ProofHullSide { from, to });
        Self { sides: sides.collect() }
    }

    /// Its corners, counter-clockwise from the lowest row, then column.
    pub fn corners(&self) -> impl Iterator<Item = ProofPosition> {
        self.sides.iter().map(|side| side.from)
    }

    /// Its sides: a corner in steps (column, row), and the direction inward, of length 1.
    pub(super) fn lines(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
        self.sides.iter().map(|side| {
            let [dx, dy] = side.to.minus(side.from);
            let length = (dx * dx + dy * dy).sqrt();
            ([side.from.cols(), side.from.rows()], [-dy / length, dx / length])
        })
    }

    /// Twice its area, in the unit of [`ProofTally::double_area`](crate::ProofTally::double_area).
    pub fn double_area(&self) -> i128 {
        let first = self.sides[0].from;
        self.sides.iter().map(|side| double_area(first, side.from, side.to)).sum()
    }

    /// True when the edge between `ends` is (part of) a side, with `apex` on the inner side of it.
    /// O(log corners).
    pub(super) fn has_edge(&self, [p, q]: [ProofPosition; 2], apex: ProofPosition) -> bool {
        let edge = match double_area(p, q, apex).signum() {
            0 => return false,
            1 => ProofHullSide { from: p, to: q },
            _ => ProofHullSide { from: q, to: p },
        };
        // Sides are sorted by angle: only the one parallel to the edge can have it.
        let same = self.sides.partition_point(|side| side.is_before(&edge));
        self.sides.get(same).is_some_and(|side| side.holds(p) && side.holds(q))
    }

    /// True inside and on the outline. O(log corners).
    pub fn contains(&self, at: ProofPosition) -> bool {
        let (right, left) = self.sides.split_at(self.sides.partition_point(|s| !s.runs_back()));
        let rising = right.partition_point(|side| side.to.row <= at.row);
        let falling = left.partition_point(|side| side.to.row >= at.row);
        let east = right[rising.min(right.len() - 1)];
        let west = left[falling.min(left.len() - 1)];
        let rows = self.sides[0].from.row..=west_top(left).row;
        rows.contains(&at.row)
            && [east, west].iter().all(|side| double_area(side.from, side.to, at) >= 0)
    }
}

/// Where the sides that run back begin: the top of the hull.
fn west_top(left: &[ProofHullSide]) -> ProofPosition {
    left[0].from
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hull(spots: &[Spot]) -> Option<ProofHull> {
        let mut wrap = HullGatherer::default();
        spots.iter().for_each(|&at| wrap.add(at));
        wrap.finish()
    }

    /// Positions with every other on one side of some line through them.
    fn slow_corners(spots: &[Spot]) -> Vec<Spot> {
        let is_corner = |&p: &Spot| {
            let others = || spots.iter().copied().filter(move |&q| q != p);
            // A corner sees all others within less than half a turn.
            let first = others().find(|&a| others().all(|b| turn(p, a, b) >= 0));
            first.is_some_and(|a| {
                let ahead = |b: Spot| {
                    let d = |i: usize| i64::from(a[i] - p[i]) * i64::from(b[i] - p[i]);
                    d(0) + d(1) > 0
                };
                others().all(|b| turn(p, a, b) > 0 || ahead(b))
            })
        };
        let mut corners: Vec<Spot> = spots.iter().copied().filter(is_corner).collect();
        corners.sort_unstable();
        corners.dedup();
        corners
    }

    fn at([col, row]: Spot) -> ProofPosition {
        ProofPosition::sample(i64::from(col), i64::from(row))
    }

    #[test]
    fn no_area_no_hull() {
        assert_eq!(hull(&[]), None);
        assert_eq!(hull(&[[3, 4]; 5]), None);
        assert_eq!(hull(&[[0, 0], [2, 2], [1, 1], [7, 7]]), None);
    }

    #[test]
    fn sides_and_parts_of_them_are_edges_of_the_hull_and_no_others() {
        let hull = hull(&[[0, 0], [8, 0], [8, 4], [0, 4], [3, 1]]).unwrap();
        let has = |p, q, apex| hull.has_edge([at(p), at(q)], at(apex));
        assert!(has([0, 0], [8, 0], [1, 1]) && has([2, 4], [5, 4], [1, 1]));
        assert!(has([0, 1], [0, 3], [1, 1]) && has([8, 0], [8, 4], [1, 1]));
        assert!(!has([0, 0], [9, 0], [1, 1]), "beyond its end");
        assert!(!has([0, 0], [8, 0], [1, -1]), "on the outer side");
        assert!(!has([0, 0], [8, 4], [8, 0]) && !has([0, 1], [8, 1], [1, 2]));
        assert!(!has([0, 0], [8, 0], [4, 0]), "no triangle");
    }

    #[test]
    fn a_large_stream_is_reduced_on_the_way() {
        let mut wrap = HullGatherer::default();
        for i in 0..200_000i64 {
            wrap.add([i * 7919 % 1_000_003, i * 104_729 % 999_983].map(|v| v as i32));
        }
        assert!(wrap.pool.len() < 2 * MIN_POOL, "{}", wrap.pool.len());
    }

    proptest! {
        #[test]
        fn a_hull_has_the_corners_that_the_definition_says(
            spots in prop::collection::vec([0..12i32, 0..12i32], 1..40), cut in 0..40usize
        ) {
            let cut = cut.min(spots.len());
            let (mut one, mut two) = (HullGatherer::default(), HullGatherer::default());
            spots[..cut].iter().for_each(|&at| one.add(at));
            one.reduce();
            spots[cut..].iter().for_each(|&at| two.add(at));
            two.reduce();
            one.merge(two);
            let found = one.finish();
            prop_assert_eq!(&found, &hull(&spots));
            let Some(hull) = found else { return Ok(()) };
            let mut corners: Vec<ProofPosition> = hull.corners().collect();
            corners.sort_unstable_by_key(|at| (at.col, at.row));
            let slow: Vec<ProofPosition> = slow_corners(&spots).into_iter().map(at).collect();
            prop_assert_eq!(corners, slow);
            for (col, row) in (-1..13).flat_map(|c| (-1..13).map(move |r| (c, r))) {
                let inside = hull.sides.iter().all(|s| double_area(s.from, s.to, at([col, row])) >= 0);
                prop_assert_eq!(hull.contains(at([col, row])), inside, "{} {}", col, row);
            }
        }
    }
}
