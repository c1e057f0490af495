//! A tree of convex hulls over a line: the farthest vertex where boxes do not tell.
//!
//! Hershberger & Snoeyink, "Speeding Up the Douglas-Peucker Line-Simplification Algorithm" (1992), find
//! the vertex farthest from a line on convex hulls, by binary search, and so need O(n log n) for all
//! splits. Here the hulls are those of runs of 32 vertices, of four runs, and so on. A hull gives the
//! extremes across the segment, and along it where its box reaches beyond an end: a box turned with the
//! segment. Runs whose turned box holds nothing farther than a vertex known are passed over, the others
//! opened, down to their vertices, which are compared as in a plain scan. So the result is that of a
//! plain scan, bit for bit.
//!
//! What holds, for `n` vertices: making the tree takes O(n log n). A query takes O(log^2 n), and
//! as much again for each run that has to be opened. Those are, where no vertex of a run lies beyond an end,
//! the ones with a vertex as far as the farthest: of these only the first when differences
//! of coordinates are whole multiples of some power of two below 2^26 of it (nothing is rounded then), else
//! all with one within rounding (about 2^-49 of the products in it) of the farthest. All splits of such
//! a line take O(n log^2 n). A run with vertices beyond an end is opened as well when the corners of
//! its turned box are farther than the farthest vertex, up to the square root of two times as far as its
//! own; how often, nothing bounds.

use std::cmp::Ordering;
use std::ops::Range as Indices;

use super::Xy;
use super::metric::{Metric, Plane, PlaneBox, PlaneSegment, larger};
use super::regions::{Farthest, scan};
use terrane_base::geom::plane::orient;

/// Vertices in a run of the lowest level.
const LEAF: usize = 32;

/// Runs in one of the next level.
const FAN: usize = 4;

/// In fewer vertices than this every one is looked at.
const SHORTEST: usize = 3 * LEAF;

/// All corners of a hull are looked at where its run has so many times as many vertices.
const WORTH: usize = 4;

/// Hulls of the runs of a line, level by level.
#[derive(Clone, Debug)]
pub(super) struct Hulls {
    /// The lowest level first.
    levels: Vec<Level>,
    /// Whether differences and their products come out exact.
    is_exact: bool,
}

/// The hulls of runs of one length.
#[derive(Clone, Debug)]
struct Level {
    /// Vertices of a run.
    length: usize,
    hulls: Vec<Hull>,
    /// The vertices of all their chains.
    chains: Vec<u32>,
}

/// The convex hull of a run: two chains, both from its lowest vertex by x and y to its highest.
#[derive(Clone, Copy, Debug)]
struct Hull {
    around: PlaneBox,
    /// Where the lower chain begins, the upper one, and where that ends.
    lower: usize,
    upper: usize,
    end: usize,
}

/// A run that a query has yet to look at: its level, its place there, and the most that its vertices
/// reach.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    level: usize,
    place: usize,
    most: f64,
}

/// A query: the farthest from `segment`, of vertices that reach above `limit`.
struct Query<'a> {
    hulls: &'a Hulls,
    segment: &'a PlaneSegment,
    points: &'a [Xy],
    limit: f64,
}

impl Hulls {
    /// The hulls of a line. O(n log n), in memory as well; mostly linear.
    pub(super) fn new(points: &[Xy]) -> Self {
        let mut levels: Vec<Level> = Vec::new();
        let mut lowest = Level::new(LEAF);
        let mut sorted = Vec::new();
        for first in (0..points.len() / LEAF).map(|run| run * LEAF) {
            sorted.clear();
            sorted.extend(first as u32..(first + LEAF) as u32);
            lowest.push(points, &mut sorted);
        }
        levels.push(lowest);
        while let Some(below) = levels.last().filter(|level| level.hulls.len() >= 2 * FAN) {
            let mut level = Level::new(below.length * FAN);
            for run in below.hulls.chunks_exact(FAN) {
                sorted.clear();
                sorted.extend_from_slice(&below.chains[run[0].lower..run[FAN - 1].end]);
                level.push(points, &mut sorted);
            }
            levels.push(level);
        }
        Self { levels, is_exact: is_exact(points) }
    }

    /// As [`scan`]; `open` is memory kept between calls.
    pub(super) fn farthest(
        &self,
        segment: &PlaneSegment,
        points: &[Xy],
        vertices: Indices<usize>,
        open: &mut Vec<Run>,
        farthest: &mut Farthest,
    ) {
        let (from, to) = (vertices.start, vertices.end);
        if to - from < SHORTEST {
            return scan::<Xy, Plane>(segment, points, from, to, farthest);
        }
        let (start, end) = (from.next_multiple_of(LEAF), to / LEAF * LEAF);
        let mut query = Query { hulls: self, segment, points, limit: farthest.reach };
        open.clear();
        open.extend(self.runs(start..end).map(|(level, place)| query.run(level, place)));
        open.reverse();
        scan::<Xy, Plane>(segment, points, from, start, farthest);
        while let Some(run) = open.pop() {
            query.open(run, open, farthest);
        }
        scan::<Xy, Plane>(segment, points, end, to, farthest);
    }

    /// The largest runs that make up `within`, whose ends are multiples of [`LEAF`].
    fn runs(&self, within: Indices<usize>) -> impl Iterator<Item = (usize, usize)> + '_ {
        let mut at = within.start;
        std::iter::from_fn(move || {
            if at >= within.end {
                return None;
            }
            let (mut level, mut size) = (0, LEAF);
            while level + 1 < self.levels.len()
                && at.is_multiple_of(size * FAN)
                && at + size * FAN <= within.end
            {
                size *= FAN;
                level += 1;
            }
            at += size;
            Some((level, at / size - 1))
        })
    }
}

impl Query<'_> {
    /// Looks at the vertices of a run of the lowest level, or puts off those of which another is made
    /// up, unless nothing in it is farther.
    fn open(&mut self, run: Run, open: &mut Vec<Run>, farthest: &mut Farthest) {
        self.limit = larger(self.limit, farthest.reach);
        if run.most <= self.limit {
            return;
        }
        if run.level == 0 {
            let first = run.place * LEAF;
            return scan::<Xy, Plane>(self.segment, self.points, first, first + LEAF, farthest);
        }
        let first = run.place * FAN;
        for place in (first..first + FAN).rev() {
            open.push(self.run(run.level - 1, place));
        }
    }

    /// A run with the most that its vertices reach, or anything not above the limit.
    fn run(&mut self, level: usize, place: usize) -> Run {
        let hulls = &self.hulls.levels[level];
        let hull = &hulls.hulls[place];
        let most = Plane::reach_most(self.segment, &hull.around);
        let most = if most > self.limit { self.most(hulls, hull).min(most) } else { most };
        Run { level, place, most }
    }

    /// As [`Query::run`], by the hull.
    fn most(&mut self, level: &Level, hull: &Hull) -> f64 {
        let slack = match self.hulls.is_exact {
            true => 0.0,
            false => self.segment.rounding(&hull.around),
        };
        let [x, y] = self.segment.direction();
        let across = self.extremes(level, hull, [y, -x]);
        let square = self.segment.most_across(&across, slack);
        let over = self.segment.most_over(&hull.around);
        if over == 0.0 || square + over <= self.limit {
            return square + over;
        }
        let along = self.extremes(level, hull, [x, y]);
        let most = square + self.segment.most_along(&along, slack);
        let is_worth_it = WORTH * (hull.end - hull.lower) <= level.length;
        if most <= self.limit || !is_worth_it {
            return most;
        }
        most.min(self.segment.most_around(self.farthest_corner(level, hull), slack))
    }

    /// What the farthest corner of a hull reaches, which raises the limit.
    fn farthest_corner(&mut self, level: &Level, hull: &Hull) -> f64 {
        let corners = &level.chains[hull.lower..hull.end];
        let reach = |i: &u32| Plane::reach(self.segment, &self.points[*i as usize]);
        let reach = corners.iter().map(reach).fold(0.0, larger);
        self.limit = larger(self.limit, reach.next_down());
        reach
    }

    /// The vertices of a hull that are farthest against and along `direction`; what they reach raises
    /// the limit.
    fn extremes(&mut self, level: &Level, hull: &Hull, direction: Xy) -> [Xy; 2] {
        let lower = &level.chains[hull.lower..hull.upper];
        let upper = &level.chains[hull.upper..hull.end];
        let back = [-direction[0], -direction[1]];
        let (with, against) = if direction[1] >= 0.0 { (upper, lower) } else { (lower, upper) };
        let extremes = [self.extreme(against, back), self.extreme(with, direction)];
        for vertex in &extremes {
            // Not itself, so that the first that is as far as it is found.
            self.limit = larger(self.limit, Plane::reach(self.segment, vertex).next_down());
        }
        extremes
    }

    /// The vertex of a chain that is farthest in `direction`, which is the chain's own side.
    fn extreme(&self, chain: &[u32], direction: Xy) -> Xy {
        let at = |i: usize| self.points[chain[i] as usize];
        let (mut low, mut high) = (0, chain.len() - 1);
        while low < high {
            let middle = (low + high) / 2;
            let (a, b) = (at(middle), at(middle + 1));
            let gain = (b[0] - a[0]) * direction[0] + (b[1] - a[1]) * direction[1];
            match gain > 0.0 {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        at(low)
    }
}

impl Level {
    fn new(length: usize) -> Self {
        Self { length, hulls: Vec::new(), chains: Vec::new() }
    }

    /// Adds the hull of the vertices in `run`, which it sorts.
    fn push(&mut self, points: &[Xy], run: &mut [u32]) {
        let at = |i: &u32| points[*i as usize];
        run.sort_unstable_by(|i, j| at(i).partial_cmp(&at(j)).unwrap_or(Ordering::Equal));
        let around = run[1..].iter().fold(Plane::region(&at(&run[0])), |around, i| {
            Plane::join(&around, &Plane::region(&at(i)))
        });
        let lower = self.chains.len();
        self.push_chain(points, run, Ordering::Greater);
        let upper = self.chains.len();
        self.push_chain(points, run, Ordering::Less);
        self.hulls.push(Hull { around, lower, upper, end: self.chains.len() });
    }

    /// Adds the chain of a sorted run that turns `turn` at each of its vertices (Andrew, 1979).
    fn push_chain(&mut self, points: &[Xy], run: &[u32], turn: Ordering) {
        let first = self.chains.len();
        let at = |i: u32| points[i as usize];
        for &next in run {
            while let [.., a, b] = self.chains[first..]
                && orient(at(a), at(b), at(next)) != turn
            {
                self.chains.pop();
            }
            if self.chains[first..].last().is_none_or(|last| at(*last) != at(next)) {
                self.chains.push(next);
            }
        }
    }
}

/// True when differences of coordinates, and differences and sums of two products of those, are not
/// rounded: coordinates are whole multiples of a power of two, and differ by less than 2^26 of it.
fn is_exact(points: &[Xy]) -> bool {
    let unit = points.iter().flatten().map(|v| unit(*v)).min().unwrap_or(0);
    let span = |axis: usize| {
        let values = points.iter().map(|p| p[axis]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    span(0).max(span(1)) * 2.0_f64.powi(-unit) < 67_108_864.0
}

/// The exponent of the largest power of two of which a number is a whole multiple.
fn unit(value: f64) -> i32 {
    let bits = value.to_bits();
    let (exponent, fraction) = (bits >> 52 & 0x7FF, bits & ((1 << 52) - 1));
    match (exponent, fraction) {
        (0, 0) => i32::MAX,
        (0, _) => fraction.trailing_zeros() as i32 - 1074,
        _ => (fraction | 1 << 52).trailing_zeros() as i32 + exponent as i32 - 1075,
    }
}
