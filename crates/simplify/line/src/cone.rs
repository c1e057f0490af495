//! The greedy double cone: each segment goes as far as a wedge of directions allows.
//!
//! From an anchor, the wedge of the directions that pass every vertex so far within the tolerance is
//! narrowed vertex by vertex (Williams 1978, Sklansky & Gonzalez 1980, Reumann & Witkam's strip made
//! exact); a vertex in the wedge may end the segment. The wedge does not see vertices that lie beyond
//! the end, so the last vertex that may end the segment is tested against all it replaces, by the
//! formula of [`super::metric`], then the one before it, and so on. The look ahead ends at a few times
//! the longest segment that is known to hold, so lines that keep running back on themselves, and
//! tolerances below what rounding makes of a line, cost O(n log n) too.
//!
//! The furthest end is not always the best, because the next segment starts there. So two ends are tested, the
//! furthest and the last one at least an eighth of the segment before it, and the one whose next segment ends
//! further is taken. That segment is computed once, because it is needed next: twice the work of one end, for a
//! third to two thirds fewer vertices above the minimum.

use super::metric::DistanceMetric;
use super::regions::first_beyond;
use super::scratch::{SimplifyScratch, keep_short};
use super::wedge::{Wedge, WedgeStep};

/// Smallest look-ahead.
const LOOK: usize = 64;

/// Look-ahead in lengths of the longest valid segment.
const PATIENCE: usize = 4;

/// Vertices tested one by one before steps are doubled.
const TRIES: usize = 8;

/// Appends the segment ends of the double cone to `kept`.
pub fn cone<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
    scratch: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) {
    if keep_short(points.len(), kept) {
        return;
    }
    let end = points.len() - 1;
    // Candidates of the current segment, of one from its furthest end, and of one from the other end.
    let [ends, from_furthest, from_nearer] = &mut scratch.candidates;
    let (mut anchor, mut furthest) = (0, furthest_end(metric, points, 0, tolerance, ends));
    kept.push(0);
    while furthest < end {
        let next = furthest_end(metric, points, furthest, tolerance, from_furthest);
        let nearer = nearer_end(metric, points, anchor, furthest, tolerance * tolerance, ends);
        (anchor, furthest) = (furthest, next);
        std::mem::swap(ends, from_furthest);
        if let Some(nearer) = nearer.filter(|_| next < end) {
            let beyond = furthest_end(metric, points, nearer, tolerance, from_nearer);
            if beyond > next {
                (anchor, furthest) = (nearer, beyond);
                std::mem::swap(ends, from_nearer);
            }
        }
        kept.push(anchor as u32);
    }
    kept.push(end as u32);
}

/// Furthest valid segment end from `anchor`; fills `candidates` with the possible ones.
fn furthest_end<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    anchor: usize,
    tolerance: f64,
    candidates: &mut Vec<u32>,
) -> usize {
    look_ahead(metric, points, anchor, tolerance, candidates);
    last_valid(metric, points, anchor, tolerance * tolerance, candidates)
}

/// Last valid end at least an eighth of the segment before the furthest one.
fn nearer_end<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    anchor: usize,
    furthest: usize,
    tolerance2: f64,
    candidates: &[u32],
) -> Option<usize> {
    let last = furthest - (furthest - anchor).div_ceil(8);
    let count = candidates.partition_point(|&end| end as usize <= last);
    let candidates = &candidates[..count];
    (!candidates.is_empty()).then(|| last_valid(metric, points, anchor, tolerance2, candidates))
}

/// Fills `candidates` with possible segment ends from `anchor` within the look-ahead.
fn look_ahead<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    anchor: usize,
    tolerance: f64,
    candidates: &mut Vec<u32>,
) {
    candidates.clear();
    let from = &points[anchor];
    let mut wedge = M::Wedge::new(from, tolerance);
    let tolerance2 = tolerance * tolerance;
    // The vertex farthest from the anchor is the most likely to lie beyond an end.
    let (mut outermost, mut span2) = (anchor, 0.0);
    let (mut limit, mut proof) = (anchor + LOOK, anchor + LOOK / 2);
    for (i, p) in points.iter().enumerate().skip(anchor + 1) {
        let step = wedge.step(p);
        if step == WedgeStep::Stops || i > limit {
            break;
        }
        let span = wedge.span2(p);
        if span >= span2 {
            (outermost, span2) = (i, span);
        } else if step == WedgeStep::Ends
            && metric.distance2(&points[outermost], from, p) > tolerance2
        {
            continue;
        }
        if step == WedgeStep::Ends {
            candidates.push(i as u32);
            if i >= proof {
                proof = i + (i - anchor) / 2;
                if first_beyond(metric, points, anchor, i, tolerance2).is_none() {
                    limit = anchor + PATIENCE * (i - anchor);
                }
            }
        }
    }
}

/// The last candidate that is valid for all vertices it passes. The first candidate always is, because it
/// follows the anchor.
fn last_valid<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    anchor: usize,
    tolerance2: f64,
    candidates: &[u32],
) -> usize {
    let mut left = candidates.len();
    for tried in 0.. {
        left -= 1;
        let end = candidates[left] as usize;
        if left == 0 || first_beyond(metric, points, anchor, end, tolerance2).is_none() {
            return end;
        }
        if tried >= TRIES {
            left = left.div_ceil(2);
        }
    }
    anchor + 1
}
