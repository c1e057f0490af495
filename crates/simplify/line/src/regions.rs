//! A tree of regions over a line: finds the vertex farthest from a segment without testing all.
//!
//! Regions of 16 vertices, then of eight times as many, and so on. A region is skipped if its upper bound does
//! not exceed the current maximum. [`DistanceMetric::reach_most`] bounds distances as computed, so the result
//! equals that of a plain scan, ties included.

use super::metric::DistanceMetric;
use super::metric::range::larger;

/// Vertices in a region of the lowest level.
const LEAF: usize = 16;

/// Regions in a region of the next level.
const FAN: usize = 8;

/// Number of vertices below which a plain scan is used.
pub(super) const SHORTEST: usize = 6 * LEAF;

/// Vertices scanned per tested region, at most.
pub(super) const LOOK: u64 = LEAF as u64;

/// Smallest range for which a distant vertex is searched first.
const LONG: usize = 4 * LEAF * FAN;

/// The farthest vertex so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct FarthestVertex {
    pub(super) index: usize,
    /// Its distance as from [`DistanceMetric::reach`].
    pub(super) reach: f64,
}

/// Vertices whose distances are computed side by side.
const LANES: usize = 8;

/// Updates `farthest` with vertices `from..to`. Only larger distances count, so the lowest index among equals
/// is found if ranges come in order.
///
/// Eight vertices at a time without branches; the lane of the maximum is determined at the end.
#[inline]
pub(super) fn scan<V: Copy, M: DistanceMetric<V>>(
    segment: &M::Segment,
    points: &[V],
    from: usize,
    to: usize,
    farthest: &mut FarthestVertex,
) {
    let (mut most, mut place) = (farthest.reach, to);
    let chunks = points[from..to].chunks_exact(LANES);
    let rest = chunks.remainder();
    let mut at = from;
    for chunk in chunks {
        let reach = largest(&reaches::<V, M>(segment, chunk));
        if reach > most {
            (most, place) = (reach, at);
        }
        at += LANES;
    }
    let reach = rest.iter().fold(most, |most, p| larger(M::reach(segment, p), most));
    if reach > most {
        (most, place) = (reach, at);
    }
    let run = &points[place..to.min(place + LANES)];
    if let Some(lane) = run.iter().position(|p| M::reach(segment, p) == most) {
        *farthest = FarthestVertex { index: place + lane, reach: most };
    }
}

#[inline(always)]
fn reaches<V: Copy, M: DistanceMetric<V>>(segment: &M::Segment, chunk: &[V]) -> [f64; LANES] {
    let mut reaches = [0.0; LANES];
    for (reach, p) in reaches.iter_mut().zip(chunk) {
        *reach = M::reach(segment, p);
    }
    reaches
}

#[inline(always)]
fn largest(r: &[f64; LANES]) -> f64 {
    let four = [larger(r[0], r[4]), larger(r[1], r[5]), larger(r[2], r[6]), larger(r[3], r[7])];
    larger(larger(four[0], four[2]), larger(four[1], four[3]))
}

/// The first vertex of `from..to` whose reach is above `limit`.
#[inline]
pub(super) fn first_above<V: Copy, M: DistanceMetric<V>>(
    segment: &M::Segment,
    points: &[V],
    from: usize,
    to: usize,
    limit: f64,
) -> Option<usize> {
    let chunks = points[from..to].chunks_exact(LANES);
    let rest = chunks.remainder();
    let rest_at = to - rest.len();
    for (n, chunk) in chunks.enumerate() {
        let reaches = reaches::<V, M>(segment, chunk);
        if largest(&reaches) > limit {
            let lane = reaches.iter().position(|reach| *reach > limit)?;
            return Some(from + n * LANES + lane);
        }
    }
    rest.iter().position(|p| M::reach(segment, p) > limit).map(|i| rest_at + i)
}

/// The first vertex between `from` and `to` beyond the tolerance from their segment.
pub(super) fn first_beyond<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    from: usize,
    to: usize,
    tolerance2: f64,
) -> Option<usize> {
    let segment = metric.segment(&points[from], &points[to]);
    let limit = M::within(&segment, tolerance2);
    let mut at = from + 1;
    while let Some(found) = first_above::<V, M>(&segment, points, at, to, limit) {
        if M::squared(&segment, M::reach(&segment, &points[found])) > tolerance2 {
            return Some(found);
        }
        at = found + 1;
    }
    None
}

/// The vertex farthest from `segment` among `from..to`, and its squared distance, if that is above
/// `tolerance2`; the lowest index among equals.
pub(super) fn farthest_beyond<V: Copy, M: DistanceMetric<V>>(
    segment: &M::Segment,
    points: &[V],
    tree: &VertexRegions<M::Region>,
    from: usize,
    to: usize,
    tolerance2: f64,
) -> Option<(usize, f64)> {
    beyond::<V, M>(segment, tolerance2, |farthest| {
        tree.farthest::<V, M>(segment, points, from, to, farthest);
    })
}

/// The farthest vertex found by `find`, and its squared distance, if above `tolerance2`.
#[inline(always)]
pub(super) fn beyond<V: Copy, M: DistanceMetric<V>>(
    segment: &M::Segment,
    tolerance2: f64,
    find: impl FnOnce(&mut FarthestVertex),
) -> Option<(usize, f64)> {
    let within = M::within(segment, tolerance2);
    let mut farthest = FarthestVertex { index: 0, reach: within };
    find(&mut farthest);
    if farthest.reach <= within {
        return None;
    }
    let squared = M::squared(segment, farthest.reach);
    (squared > tolerance2).then_some((farthest.index, squared))
}

/// Regions of a line's vertices, level by level.
#[derive(Clone, Debug)]
pub(super) struct VertexRegions<R> {
    /// The lowest level first.
    levels: Vec<Vec<R>>,
}

impl<R: Copy> VertexRegions<R> {
    /// The tree of a line; linear in its vertices.
    pub(super) fn new<V: Copy, M: DistanceMetric<V, Region = R>>(points: &[V]) -> Self {
        let mut levels = Vec::new();
        if points.len() < SHORTEST {
            return Self { levels };
        }
        let leaves = points.chunks_exact(LEAF).map(|run| {
            let first = M::region(&run[0]);
            run[1..].iter().fold(first, |region, p| M::join(&region, &M::region(p)))
        });
        levels.push(leaves.collect::<Vec<R>>());
        while let Some(below) = levels.last().filter(|level| level.len() >= 2 * FAN) {
            let regions = below.chunks_exact(FAN);
            let regions = regions.map(|run| run[1..].iter().fold(run[0], |a, b| M::join(&a, b)));
            levels.push(regions.collect());
        }
        Self { levels }
    }

    /// As [`scan`]. Returns the number of regions tested or skipped.
    pub(super) fn farthest<V: Copy, M: DistanceMetric<V, Region = R>>(
        &self,
        segment: &M::Segment,
        points: &[V],
        from: usize,
        to: usize,
        farthest: &mut FarthestVertex,
    ) -> u64 {
        if self.levels.is_empty() || to - from < SHORTEST {
            scan::<V, M>(segment, points, from, to, farthest);
            return 0;
        }
        let start = from.next_multiple_of(LEAF);
        // Regions below a known distance are skipped.
        let likely = match to - from < LONG {
            true => f64::NEG_INFINITY,
            false => self.likely::<V, M>(segment, points, start, to).next_down(),
        };
        scan::<V, M>(segment, points, from, start, farthest);
        let (mut at, mut looks) = (start, 0);
        while at + LEAF <= to {
            looks += 1;
            let limit = larger(farthest.reach, likely);
            at = match self.passed_over::<V, M>(segment, at, to, limit) {
                Some(next) => next,
                None => {
                    scan::<V, M>(segment, points, at, at + LEAF, farthest);
                    at + LEAF
                }
            };
        }
        scan::<V, M>(segment, points, at, to, farthest);
        looks
    }

    /// Largest reach in the lowest region with the largest bound, descending from the top.
    fn likely<V: Copy, M: DistanceMetric<V, Region = R>>(
        &self,
        segment: &M::Segment,
        points: &[V],
        start: usize,
        to: usize,
    ) -> f64 {
        let mut most = f64::NEG_INFINITY;
        let (mut place, mut level) = (start, 0);
        let mut at = start;
        while at + LEAF <= to {
            let (top, size) = self.largest_at(at, to);
            let reach = M::reach_most(segment, &self.levels[top][at / size]);
            if reach > most {
                (most, place, level) = (reach, at / size, top);
            }
            at += size;
        }
        while level > 0 {
            level -= 1;
            let first = place * FAN;
            let children = &self.levels[level][first..first + FAN];
            let (mut best, mut largest) = (0, f64::NEG_INFINITY);
            for (i, child) in children.iter().enumerate() {
                let reach = M::reach_most(segment, child);
                if reach > largest {
                    (best, largest) = (i, reach);
                }
            }
            place = first + best;
        }
        let mut farthest = FarthestVertex { index: 0, reach: f64::NEG_INFINITY };
        scan::<V, M>(segment, points, place * LEAF, place * LEAF + LEAF, &mut farthest);
        farthest.reach
    }

    /// Level of the largest region that starts at `at` and ends within `to`, and its vertices.
    #[inline(always)]
    fn largest_at(&self, at: usize, to: usize) -> (usize, usize) {
        let (mut size, mut top) = (LEAF, 0);
        while top + 1 < self.levels.len() && at.is_multiple_of(size * FAN) && at + size * FAN <= to
        {
            size *= FAN;
            top += 1;
        }
        (top, size)
    }

    /// End of the largest region from `at` within `to` with nothing above `limit`.
    #[inline(always)]
    fn passed_over<V: Copy, M: DistanceMetric<V, Region = R>>(
        &self,
        segment: &M::Segment,
        at: usize,
        to: usize,
        limit: f64,
    ) -> Option<usize> {
        let (mut top, mut size) = self.largest_at(at, to);
        loop {
            if M::reach_most(segment, &self.levels[top][at / size]) <= limit {
                return Some(at + size);
            }
            if top == 0 {
                return None;
            }
            top -= 1;
            size /= FAN;
        }
    }
}

/// The last vertex of `from..to` whose reach is above `limit`.
#[inline]
pub(super) fn last_above<V: Copy, M: DistanceMetric<V>>(
    segment: &M::Segment,
    points: &[V],
    from: usize,
    to: usize,
    limit: f64,
) -> Option<usize> {
    let chunks = points[from..to].rchunks_exact(LANES);
    let rest = chunks.remainder().len();
    for (n, chunk) in chunks.enumerate() {
        let reaches = reaches::<V, M>(segment, chunk);
        if largest(&reaches) > limit {
            let lane = reaches.iter().rposition(|reach| *reach > limit)?;
            return Some(to - (n + 1) * LANES + lane);
        }
    }
    points[from..from + rest].iter().rposition(|p| M::reach(segment, p) > limit).map(|i| from + i)
}
