//! A tree of regions over a line: the farthest vertex from a segment without looking at all of them.
//!
//! Regions of 16 vertices, then of eight times as many, and so on. A region whose most distant place is
//! not farther than what is known is passed over as a whole. [`Metric::reach_most`] bounds distances as
//! they are computed, so the vertex found is that of a plain scan, ties included.

use super::metric::Metric;

/// Vertices in a region of the lowest level.
const LEAF: usize = 16;

/// Regions in one of the next level.
const FAN: usize = 8;

/// Lines shorter than this have no tree.
const SHORTEST: usize = 4 * LEAF;

/// The farthest vertex known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Farthest {
    pub(super) index: usize,
    /// Its distance, as [`Metric::reach`] has it.
    pub(super) reach: f64,
}

/// Vertices whose distances are computed side by side.
const LANES: usize = 8;

/// Updates `farthest` with the vertices `from..to`: only larger distances count, so the lowest index
/// among equals is found when ranges come in order.
#[inline]
pub(super) fn scan<V: Copy, M: Metric<V>>(
    segment: &M::Segment,
    points: &[V],
    from: usize,
    to: usize,
    farthest: &mut Farthest,
) {
    let chunks = points[from..to].chunks_exact(LANES);
    let rest = chunks.remainder();
    let mut at = from;
    for chunk in chunks {
        let mut reaches = [0.0; LANES];
        for (reach, p) in reaches.iter_mut().zip(chunk) {
            *reach = M::reach(segment, p);
        }
        if is_any_above(&reaches, farthest.reach) {
            raise(&reaches, at, farthest);
        }
        at += LANES;
    }
    for (i, p) in rest.iter().enumerate() {
        raise(&[M::reach(segment, p)], at + i, farthest);
    }
}

#[inline(always)]
fn is_any_above(reaches: &[f64; LANES], limit: f64) -> bool {
    reaches.iter().fold(false, |any, reach| any | (*reach > limit))
}

#[inline(always)]
fn raise(reaches: &[f64], at: usize, farthest: &mut Farthest) {
    for (i, reach) in reaches.iter().enumerate() {
        if *reach > farthest.reach {
            *farthest = Farthest { index: at + i, reach: *reach };
        }
    }
}

/// The first vertex of `from..to` whose reach is above `limit`.
#[inline]
pub(super) fn first_above<V: Copy, M: Metric<V>>(
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
        let mut reaches = [0.0; LANES];
        for (reach, p) in reaches.iter_mut().zip(chunk) {
            *reach = M::reach(segment, p);
        }
        if is_any_above(&reaches, limit) {
            let lane = reaches.iter().position(|reach| *reach > limit)?;
            return Some(from + n * LANES + lane);
        }
    }
    rest.iter().position(|p| M::reach(segment, p) > limit).map(|i| rest_at + i)
}

/// A reach which is surely within `tolerance2`: [`Metric::squared`] of it, and of anything below, is
/// at most that. Reaches between it and the tolerance have to be squared to know.
#[inline(always)]
pub(super) fn surely_within<V: Copy, M: Metric<V>>(segment: &M::Segment, tolerance2: f64) -> f64 {
    let unit = M::squared(segment, 1.0);
    tolerance2 / unit * (1.0 - 1e-14)
}

/// The vertex farthest from `segment` among `from..to`, and its squared distance, if that is above
/// `tolerance2`; the lowest index among equals.
pub(super) fn farthest_beyond<V: Copy, M: Metric<V>>(
    segment: &M::Segment,
    points: &[V],
    tree: &Regions<M::Region>,
    from: usize,
    to: usize,
    tolerance2: f64,
) -> Option<(usize, f64)> {
    let within = surely_within::<V, M>(segment, tolerance2);
    let mut farthest = Farthest { index: from, reach: within };
    tree.farthest::<V, M>(segment, points, from, to, &mut farthest);
    if farthest.reach <= within {
        return None;
    }
    let squared = M::squared(segment, farthest.reach);
    (squared > tolerance2).then_some((farthest.index, squared))
}

/// Regions of a line's vertices, level by level.
#[derive(Clone, Debug)]
pub(super) struct Regions<R> {
    /// The lowest level first.
    levels: Vec<Vec<R>>,
}

impl<R: Copy> Regions<R> {
    /// The tree of a line; linear in its vertices.
    pub(super) fn new<V: Copy, M: Metric<V, Region = R>>(points: &[V]) -> Self {
        let mut levels = Vec::new();
        if points.len() < SHORTEST {
            return Self { levels };
        }
        let whole = |run: &[V]| {
            let first = M::region(&run[0]);
            run[1..].iter().fold(first, |region, p| M::join(&region, &M::region(p)))
        };
        levels.push(points.chunks_exact(LEAF).map(whole).collect::<Vec<R>>());
        while let Some(below) = levels.last().filter(|level| level.len() >= 2 * FAN) {
            let join = |run: &[R]| run[1..].iter().fold(run[0], |a, b| M::join(&a, b));
            let level = below.chunks_exact(FAN).map(join).collect();
            levels.push(level);
        }
        Self { levels }
    }

    /// As [`scan`].
    pub(super) fn farthest<V: Copy, M: Metric<V, Region = R>>(
        &self,
        segment: &M::Segment,
        points: &[V],
        from: usize,
        to: usize,
        farthest: &mut Farthest,
    ) {
        let start = from.next_multiple_of(LEAF);
        if self.levels.is_empty() || start + LEAF > to {
            return scan::<V, M>(segment, points, from, to, farthest);
        }
        scan::<V, M>(segment, points, from, start, farthest);
        let mut at = start;
        while at + LEAF <= to {
            at = match self.passed_over::<V, M>(segment, at, to, farthest.reach) {
                Some(next) => next,
                None => {
                    scan::<V, M>(segment, points, at, at + LEAF, farthest);
                    at + LEAF
                }
            };
        }
        scan::<V, M>(segment, points, at, to, farthest);
    }

    /// The end of the largest region from `at` on, within `to`, that holds nothing above `limit`.
    #[inline(always)]
    fn passed_over<V: Copy, M: Metric<V, Region = R>>(
        &self,
        segment: &M::Segment,
        at: usize,
        to: usize,
        limit: f64,
    ) -> Option<usize> {
        let (mut size, mut top) = (LEAF, 0);
        while top + 1 < self.levels.len() && at % (size * FAN) == 0 && at + size * FAN <= to {
            size *= FAN;
            top += 1;
        }
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
pub(super) fn last_above<V: Copy, M: Metric<V>>(
    segment: &M::Segment,
    points: &[V],
    from: usize,
    to: usize,
    limit: f64,
) -> Option<usize> {
    let chunks = points[from..to].rchunks_exact(LANES);
    let rest = chunks.remainder().len();
    for (n, chunk) in chunks.enumerate() {
        let mut reaches = [0.0; LANES];
        for (reach, p) in reaches.iter_mut().zip(chunk) {
            *reach = M::reach(segment, p);
        }
        if is_any_above(&reaches, limit) {
            let lane = reaches.iter().rposition(|reach| *reach > limit)?;
            return Some(to - (n + 1) * LANES + lane);
        }
    }
    points[from..from + rest].iter().rposition(|p| M::reach(segment, p) > limit).map(|i| from + i)
}
