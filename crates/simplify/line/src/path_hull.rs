//! A tree of convex hulls over a line: finds the farthest vertex where bounding boxes are not sufficient.
//!
//! Hershberger & Snoeyink, "Speeding Up the Douglas-Peucker Line-Simplification Algorithm" (1992), find the
//! vertex farthest from an infinite line on two hulls that grow from a vertex between them and shrink as their
//! history is undone: O(n log n) for all splits of lines without self-intersections (Melkman's hulls). Here the
//! hulls are those of runs of 32 vertices, of four runs, and so on: one logarithm more, but for any line, with
//! distances from segments, and the first of equals. A hull gives the extremes across and along the segment.
//! Runs without anything farther than the current maximum are skipped, the others are opened down to their
//! vertices, which are compared as in a plain scan. So the result equals that of a plain scan.
//!
//! Complexity for `n` vertices, with or without self-intersections: all splits take O(n log^2 n + K + R), K and
//! R below.
//!
//! - *Construction*, O(n log n): both chains of a hull are sorted, so the hull of four runs merges eight sorted
//!   chains.
//! - *Bound of a run*, O(log n): nothing in a hull is farther from the segment than its corners, as distances
//!   are convex. Corners beside the segment are bounded by the extreme across it, found by binary search. Corners
//!   beyond an end are consecutive on the hull and are walked: K.
//! - *Opening of runs*, O(log^2 n) per query: all O(log n) runs of the query are bounded before the first is
//!   opened, and corners raise the limit to just below their reach. So a run is opened only if its bound is that
//!   of the farthest vertex, which is charged to the split vertex: it lies in the first such run, and afterwards
//!   equal bounds are not above it. Opened are its O(log n) ancestors, and runs that are ambiguous because of
//!   rounding: R.
//!
//! **R**, runs opened in vain. None if the coordinates of run and segment are multiples of a power of two, less
//! than 2^26 of it apart, and nothing lies beyond an end (or less than 2^12 of it apart): then nothing is
//! rounded, and bounds are exact; nor in runs with 32 positions or fewer, which are all tested. So collinear
//! vertices on a lattice and repeated positions cost nothing. Otherwise all runs with a vertex within rounding
//! error (about 2^-49 of the products) of the farthest are opened, as the rounding of each vertex decides: this
//! is quadratic for lines with a share of all vertices that close to one line at every split, such as a slanted
//! zigzag of rounded coordinates.
//!
//! **K**, corners beyond ends. None if nothing lies beyond an end. When walks of a run from one end have taken
//! a quarter of its corners, the corner farthest from that end is stored, and the run is not walked if it is
//! within the limit: a fixed end with vertices removed one by one costs O(n log n) in all, as long as nothing
//! beside the segment is farther from the end than the farthest vertex. If ends are always new, and many
//! corners lie beyond them almost as far as the farthest, K is bounded only by the corners of the hulls: the
//! vertex farthest from a point cannot be found by binary search, and the required diagrams would have to be
//! stored for parts of hulls, too.

use std::cell::Cell;
use std::cmp::Ordering;
use std::ops::Range;

use super::metric::range::larger;
use super::metric::{DistanceMetric, PlaneBox, PlaneMetric, PlaneSegment};
use super::regions::{FarthestVertex, scan};
use terrane_base::geom::plane::Xy;
use terrane_base::geom::plane::orient;

/// Vertices in a run of the lowest level.
const LEAF: usize = 32;

/// Runs in a run of the next level.
const FAN: usize = 4;

/// Number of vertices below which all are tested.
const SHORTEST: usize = 3 * LEAF;

/// Corners of a hull per walked corner of one end; beyond that all are tested, and the farthest from that end
/// is stored.
const WORTH: usize = 4;

/// Number of positions of a run below which all are kept beside the hull.
const FEW: usize = LEAF;

/// Limit in units below which differences of coordinates and sums of two products are exact.
const EXACT: f64 = 67_108_864.0;

/// Limit in units below which reaches (sums of two squares of sums of two products) are exact.
const WHOLE: f64 = 4096.0;

/// Hulls of the runs of a line by level.
#[derive(Clone, Debug)]
pub(super) struct Hulls {
    /// The lowest level first.
    levels: Vec<HullLevel>,
}

/// The hulls of runs of one length.
#[derive(Clone, Debug)]
struct HullLevel {
    /// Vertices of a run.
    length: usize,
    hulls: Vec<RunHull>,
    /// The vertices of all their chains.
    chains: Vec<u32>,
    /// One vertex per position, for runs with few positions.
    few: Vec<u32>,
}

/// The convex hull of a run: two chains, both from its lowest vertex by x and y to its highest.
#[derive(Clone, Debug)]
struct RunHull {
    around: PlaneBox,
    /// Unit: the coordinates of the run are multiples of this power of two.
    unit: i32,
    /// Stored farthest corners from a start and from an end.
    far: [Cell<FarthestBound>; 2],
    /// Start of the lower chain, of the upper chain, and its end.
    lower: usize,
    upper: usize,
    end: usize,
    /// Range of its positions in the level; empty if there are many.
    few: [usize; 2],
}

/// Largest squared distance of a run's vertices from an end, and number of walked corners.
#[derive(Clone, Copy, Debug)]
struct FarthestBound {
    from: Xy,
    square: f64,
    walked: usize,
}

impl FarthestBound {
    /// Unknown.
    const fn new(from: Xy) -> Self {
        Self { from, square: f64::INFINITY, walked: 0 }
    }
}

/// Rounding errors of a run.
#[derive(Clone, Copy, Debug)]
struct RoundingBound {
    /// Of products.
    slack: f64,
    /// Reaches are exact.
    is_whole: bool,
}

/// A pending run of a query: level, index, and upper bound of its reach.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingRun {
    level: usize,
    place: usize,
    most: f64,
}

/// A query: the vertex farthest from `segment` with a reach above `limit`.
struct FarthestQuery<'a> {
    hulls: &'a Hulls,
    segment: &'a PlaneSegment,
    points: &'a [Xy],
    limit: f64,
    /// Ends of the segment, and their common unit.
    ends: [Xy; 2],
    unit: i32,
    /// Number of bounded runs, search steps, and tested corners and vertices.
    looks: u64,
}

impl Hulls {
    /// The hulls of a line. O(n log n), in memory as well; mostly linear.
    pub(super) fn new(points: &[Xy]) -> Self {
        let mut levels: Vec<HullLevel> = Vec::new();
        let mut lowest = HullLevel::new(LEAF);
        let mut sorted = Vec::with_capacity(LEAF);
        for first in (0..points.len() / LEAF).map(|run| run * LEAF) {
            sorted.clear();
            sorted.extend(first as u32..(first + LEAF) as u32);
            let unit = coarsest(points[first..first + LEAF].iter());
            lowest.push(points, &mut sorted, unit);
        }
        levels.push(lowest);
        while let Some(below) = levels.last().filter(|level| level.hulls.len() >= 2 * FAN) {
            let level = HullLevel::above(points, below);
            levels.push(level);
        }
        Self { levels }
    }

    /// Number of corners of all hulls.
    pub(super) fn corners(&self) -> u64 {
        self.levels.iter().map(|level| level.chains.len() as u64).sum()
    }

    /// As [`scan`]; `open` is reused memory. `vertices` are those between the ends of the segment. Returns the
    /// number of tests.
    pub(super) fn farthest(
        &self,
        segment: &PlaneSegment,
        points: &[Xy],
        vertices: Range<usize>,
        open: &mut Vec<PendingRun>,
        farthest: &mut FarthestVertex,
    ) -> u64 {
        let (from, to) = (vertices.start, vertices.end);
        if to - from < SHORTEST {
            scan::<Xy, PlaneMetric>(segment, points, from, to, farthest);
            return (to - from) as u64;
        }
        let (start, end) = (from.next_multiple_of(LEAF), to / LEAF * LEAF);
        let looks = (start - from + to - end) as u64;
        let (limit, ends) = (farthest.reach, [points[from - 1], points[to]]);
        let unit = coarsest(ends.iter());
        let mut query = FarthestQuery { hulls: self, segment, points, limit, ends, unit, looks };
        open.clear();
        open.extend(self.runs(start..end).map(|(level, place)| query.run(level, place)));
        // Runs are popped from the end. The first of the line has to come first, so that of vertices
        // equally far the one with the lowest index is found.
        open.reverse();
        scan::<Xy, PlaneMetric>(segment, points, from, start, farthest);
        while let Some(run) = open.pop() {
            query.open(run, open, farthest);
        }
        scan::<Xy, PlaneMetric>(segment, points, end, to, farthest);
        query.looks
    }

    /// Largest runs that compose `within`, whose ends are multiples of [`LEAF`].
    fn runs(&self, within: Range<usize>) -> impl Iterator<Item = (usize, usize)> + '_ {
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

impl FarthestQuery<'_> {
    /// Tests the vertices of a run of the lowest level, or queues its children, unless nothing in it is
    /// farther.
    fn open(&mut self, run: PendingRun, open: &mut Vec<PendingRun>, farthest: &mut FarthestVertex) {
        self.limit = larger(self.limit, farthest.reach);
        if run.most <= self.limit {
            return;
        }
        if run.level == 0 {
            let first = run.place * LEAF;
            self.looks += LEAF as u64;
            return scan::<Xy, PlaneMetric>(
                self.segment,
                self.points,
                first,
                first + LEAF,
                farthest,
            );
        }
        let first = run.place * FAN;
        for place in (first..first + FAN).rev() {
            open.push(self.run(run.level - 1, place));
        }
    }

    /// A run with its upper bound, or anything not above the limit.
    fn run(&mut self, level: usize, place: usize) -> PendingRun {
        let hulls = &self.hulls.levels[level];
        let hull = &hulls.hulls[place];
        self.looks += 1;
        let most = PlaneMetric::reach_most(self.segment, &hull.around);
        let most = if most > self.limit { self.most(hulls, hull).min(most) } else { most };
        let most = if most > self.limit { self.most_of_few(hulls, hull).min(most) } else { most };
        PendingRun { level, place, most }
    }

    /// As [`FarthestQuery::run`], by the hull.
    fn most(&mut self, level: &HullLevel, hull: &RunHull) -> f64 {
        let doubt = self.doubt(hull);
        let [x, y] = self.segment.direction();
        let across = self.extremes(level, hull, [y, -x]);
        let across = across.map(|place| self.corner(level, place));
        let square = self.segment.max_across(&across, doubt.slack);
        let over = self.segment.most_over(&hull.around);
        if over == 0.0 || square + over <= self.limit {
            return square + over;
        }
        let places = self.extremes(level, hull, [x, y]);
        let along = places.map(|place| self.corner(level, place));
        let most = square + self.segment.max_along(&along, doubt.slack);
        if most <= self.limit {
            return most;
        }
        // Corners that rounding alone puts beyond an end, or not.
        let square = square + 4.0 * doubt.slack * doubt.slack;
        let beyond = [0, 1].map(|side| self.beyond(level, hull, side, places[side], doubt));
        most.min(larger(square, larger(beyond[0], beyond[1])))
    }

    /// As [`FarthestQuery::most`] for a run with few positions: their computed reach.
    fn most_of_few(&mut self, level: &HullLevel, hull: &RunHull) -> f64 {
        let few = &level.few[hull.few[0]..hull.few[1]];
        self.looks += few.len() as u64;
        let reaches =
            few.iter().map(|i| PlaneMetric::reach(self.segment, &self.points[*i as usize]));
        let reach = reaches.fold(0.0, larger);
        self.limit = larger(self.limit, reach.next_down());
        if few.is_empty() { f64::INFINITY } else { reach }
    }

    /// Rounding error of run and segment together.
    fn doubt(&self, hull: &RunHull) -> RoundingBound {
        let span = self.segment.span(&hull.around);
        // A run of zeros has the unit i32::MAX; beyond 1000 the power would be 0 or infinite.
        let units = span * 2.0_f64.powi(-hull.unit.min(self.unit).clamp(-1000, 1000));
        let slack = if units < EXACT { 0.0 } else { self.segment.rounding(&hull.around) };
        RoundingBound { slack, is_whole: units < WHOLE }
    }

    /// Upper bound of a run's vertices beyond the start (`side` 0) or the end (1), if none is beyond the one at
    /// `place`. These corners are consecutive on the hull.
    fn beyond(
        &mut self,
        level: &HullLevel,
        hull: &RunHull,
        side: usize,
        place: usize,
        doubt: RoundingBound,
    ) -> f64 {
        let wider = |reach: f64| match doubt.is_whole {
            true => reach,
            false => self.segment.max_around(reach, doubt.slack),
        };
        if !self.segment.is_beyond(&self.corner(level, place), side) {
            return 0.0;
        }
        let mut far = hull.far[side].get();
        if far.from != self.ends[side] {
            far = FarthestBound::new(self.ends[side]);
        }
        let known = wider(self.segment.reach_from_end(far.square));
        if known <= self.limit {
            return known;
        }
        let (reach, count) = self.walk(level, hull, side, place);
        far.walked += count;
        if far.square == f64::INFINITY && WORTH * far.walked >= hull.end - hull.lower {
            far.square = self.farthest_from(level, hull, far.from);
        }
        hull.far[side].set(far);
        self.looks += count as u64;
        self.limit = larger(self.limit, reach.next_down());
        wider(reach)
    }

    /// Largest reach of the corners beyond an end, in both directions from `place`, and number of tests.
    fn walk(&self, level: &HullLevel, hull: &RunHull, side: usize, place: usize) -> (f64, usize) {
        let mut reach = PlaneMetric::reach(self.segment, &self.corner(level, place));
        let (mut count, corners) = (1, hull.end - hull.lower);
        for next in [RunHull::after, RunHull::before] {
            let mut at = next(hull, place);
            // The two ways together see each corner once at most, so a hull all of whose corners lie beyond
            // the end does not go round for ever.
            while count < corners {
                count += 1;
                let corner = self.corner(level, at);
                if !self.segment.is_beyond(&corner, side) {
                    break;
                }
                reach = larger(reach, PlaneMetric::reach(self.segment, &corner));
                at = next(hull, at);
            }
        }
        (reach, count)
    }

    /// Largest squared distance of a corner from `place`.
    fn farthest_from(&mut self, level: &HullLevel, hull: &RunHull, place: Xy) -> f64 {
        let corners = &level.chains[hull.lower..hull.end];
        self.looks += corners.len() as u64;
        let squares = corners.iter().map(|i| {
            let at = self.points[*i as usize];
            let q = [at[0] - place[0], at[1] - place[1]];
            q[0] * q[0] + q[1] * q[1]
        });
        squares.fold(0.0, larger)
    }

    /// Extreme vertices of a hull against and along `direction`; their reach raises the limit.
    fn extremes(&mut self, level: &HullLevel, hull: &RunHull, direction: Xy) -> [usize; 2] {
        let (lower, upper) = (hull.lower..hull.upper, hull.upper..hull.end);
        let back = [-direction[0], -direction[1]];
        let (with, against) = if direction[1] >= 0.0 { (upper, lower) } else { (lower, upper) };
        let extremes = [self.extreme(level, against, back), self.extreme(level, with, direction)];
        for place in extremes {
            // Excludes the region itself, so that the first of equals is found.
            let reach = PlaneMetric::reach(self.segment, &self.corner(level, place));
            self.limit = larger(self.limit, reach.next_down());
        }
        extremes
    }

    /// Extreme vertex of a chain in `direction`, on the chain's side.
    fn extreme(&mut self, level: &HullLevel, chain: Range<usize>, direction: Xy) -> usize {
        let (mut low, mut high) = (chain.start, chain.end - 1);
        while low < high {
            self.looks += 1;
            let middle = (low + high) / 2;
            let (a, b) = (self.corner(level, middle), self.corner(level, middle + 1));
            let gain = (b[0] - a[0]) * direction[0] + (b[1] - a[1]) * direction[1];
            match gain > 0.0 {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        low
    }

    fn corner(&self, level: &HullLevel, place: usize) -> Xy {
        self.points[level.chains[place] as usize]
    }
}

impl RunHull {
    /// Next place around the hull: along the lower chain and back along the upper.
    fn after(&self, place: usize) -> usize {
        match place < self.upper {
            true if place + 1 < self.upper => place + 1,
            true => self.end - 1,
            false if place > self.upper => place - 1,
            false => self.lower,
        }
    }

    /// Previous place.
    fn before(&self, place: usize) -> usize {
        match place < self.upper {
            true if place > self.lower => place - 1,
            true => self.upper,
            false if place + 1 < self.end => place + 1,
            false => self.upper - 1,
        }
    }
}

impl HullLevel {
    fn new(length: usize) -> Self {
        Self { length, hulls: Vec::new(), chains: Vec::new(), few: Vec::new() }
    }

    /// Next level: hulls of the corners of hulls.
    fn above(points: &[Xy], below: &Self) -> Self {
        let mut level = Self::new(below.length * FAN);
        let mut sorted = Vec::new();
        for (place, run) in below.hulls.chunks_exact(FAN).enumerate() {
            sorted.clear();
            sorted.extend_from_slice(&below.chains[run[0].lower..run[FAN - 1].end]);
            let unit = run.iter().map(|hull| hull.unit).min().unwrap_or(i32::MAX);
            level.push(points, &mut sorted, unit);
            sorted.clear();
            if below.length == LEAF {
                sorted.extend((place * level.length) as u32..((place + 1) * level.length) as u32);
            } else if run.iter().all(|hull| hull.few[0] < hull.few[1]) {
                sorted.extend_from_slice(&below.few[run[0].few[0]..run[FAN - 1].few[1]]);
            } else {
                continue;
            }
            level.push_few(points, &mut sorted);
        }
        level
    }

    /// Adds the hull of the vertices in `run`, which is sorted; `unit` is that of the whole run.
    fn push(&mut self, points: &[Xy], run: &mut [u32], unit: i32) {
        let at = |i: &u32| points[*i as usize];
        // Stable: chains come sorted, and are merged in linear time.
        run.sort_by(|i, j| at(i).partial_cmp(&at(j)).unwrap_or(Ordering::Equal));
        let around = run[1..].iter().fold(PlaneMetric::region(&at(&run[0])), |around, i| {
            PlaneMetric::join(&around, &PlaneMetric::region(&at(i)))
        });
        let lower = self.chains.len();
        self.push_chain(points, run, Ordering::Greater);
        let upper = self.chains.len();
        self.push_chain(points, run, Ordering::Less);
        // NaN equals no end, so the first query takes nothing for known.
        let far = [(); 2].map(|()| Cell::new(FarthestBound::new([f64::NAN; 2])));
        let (end, few) = (self.chains.len(), [self.few.len(); 2]);
        self.hulls.push(RunHull { around, unit, far, lower, upper, end, few });
    }

    /// Keeps one vertex per position of `run` for the last hull, if they are few.
    fn push_few(&mut self, points: &[Xy], run: &mut Vec<u32>) {
        let at = |i: &u32| points[*i as usize];
        run.sort_by(|i, j| at(i).partial_cmp(&at(j)).unwrap_or(Ordering::Equal));
        run.dedup_by(|i, j| at(i) == at(j));
        if run.len() <= FEW
            && let Some(hull) = self.hulls.last_mut()
        {
            self.few.extend_from_slice(run);
            hull.few[1] = self.few.len();
        }
    }

    /// Adds the chain of a sorted run that turns `turn` at each of its vertices (Andrew, 1979).
    fn push_chain(&mut self, points: &[Xy], run: &[u32], turn: Ordering) {
        let first = self.chains.len();
        let at = |i: u32| points[i as usize];
        for &next in run {
            while let [.., a, b] = self.chains[first..]
                // Collinear vertices go as well: binary search needs chains that turn strictly.
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

/// Exponent of the largest power of two that divides all coordinates.
fn coarsest<'a>(places: impl Iterator<Item = &'a Xy>) -> i32 {
    places.flatten().map(|v| unit(*v)).min().unwrap_or(i32::MAX)
}

/// Exponent of the largest power of two that divides a number.
fn unit(value: f64) -> i32 {
    let bits = value.to_bits();
    let (exponent, fraction) = (bits >> 52 & 0x7FF, bits & ((1 << 52) - 1));
    match (exponent, fraction) {
        (0, 0) => i32::MAX,
        // Subnormals have no hidden bit and the exponent of the smallest normal number.
        (0, _) => fraction.trailing_zeros() as i32 - 1074,
        _ => (fraction | 1 << 52).trailing_zeros() as i32 + exponent as i32 - 1075,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_those_of_the_last_bit() {
        let units = [0.0, -0.0, 1.0, -0.75, 6.0, 1e3, f64::MIN_POSITIVE, 5e-324, 3e-323].map(unit);
        assert_eq!(units, [i32::MAX, i32::MAX, 0, -2, 1, 3, -1022, -1074, -1073]);
        assert_eq!(unit(0.1), -55);
        assert_eq!(coarsest([[0.0, 6.0], [0.5, 8.0]].iter()), -1);
        assert_eq!(coarsest([[0.0, 6.0], [4.0, 8.0]].iter()), 1);
        assert_eq!(coarsest([].iter()), i32::MAX);
    }

    /// Around a hull both ways, every corner once; those of a segment and of one position, too.
    #[test]
    fn corners_follow_one_another() {
        let round: Vec<Xy> = (0..32).map(|i| (f64::from(i) * 0.7).sin_cos().into()).collect();
        let flat: Vec<Xy> = (0..32).map(|i| [f64::from(i), 0.0]).collect();
        for (points, count) in [(round, 32), (flat, 2)] {
            let hulls = Hulls::new(&points);
            let (level, hull) = (&hulls.levels[0], &hulls.levels[0].hulls[0]);
            assert_eq!((hull.lower, hull.end), (0, count + 2));
            let corner = |place: usize| level.chains[place];
            for next in [RunHull::after, RunHull::before] {
                let mut at = hull.lower;
                let mut seen = Vec::new();
                for _ in 0..count + 2 {
                    seen.push(corner(at));
                    at = next(hull, at);
                }
                assert_eq!(at, hull.lower);
                seen.dedup();
                if seen.first() == seen.last() {
                    seen.pop();
                }
                let turns = seen.len();
                seen.sort_unstable();
                seen.dedup();
                assert_eq!((turns, seen.len()), (count, count));
            }
        }
    }
}
