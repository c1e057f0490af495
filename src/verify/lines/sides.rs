//! Rings that collapsed or turned over, and positions on another side of a part than before.

use super::sweep::{area_sign, side};
use super::{Lines, Question, Report};

type Xy = [f64; 2];

/// Segments that begin in a strip, at the mean.
const TO_A_STRIP: usize = 64;

/// Counts rings without area that had some, and those whose area changed its sign. O(n).
pub(super) fn rings(question: &Question<'_>, report: &mut Report) {
    for part in (0..question.original.count()).filter(|&part| question.original.closed[part]) {
        let range = question.simplified.range(part);
        let before = area_sign(&question.original.points[question.original.range(part)]);
        let after = area_sign(&question.simplified.points[range.clone()]);
        if range.is_empty() || before == 0 || before == after {
            continue;
        }
        let defect = if after == 0 { &mut report.collapsed } else { &mut report.turned };
        defect.add(part, question.simplified.at(range.start));
    }
}

/// Counts vertices of the result and given points that the upward ray from them crosses a part an odd
/// number of times before, and an even number after, or the other way round. What lies on a part
/// before has no side of it.
pub(super) fn moved(question: &Question<'_>, report: &mut Report) {
    let before = Strips::new(&question.original, &question.simplified);
    let after = Strips::new(&question.simplified, &question.simplified);
    let vertices = (0..question.simplified.points.len()).map(|v| question.simplified.at(v));
    let (mut on, mut was, mut is) = (Vec::new(), Vec::new(), Vec::new());
    for p in vertices.chain(question.points.iter().copied()) {
        on.clear();
        before.odd(p, &mut was, &mut on);
        on.sort_unstable();
        let had_side = |part: &u32| on.binary_search(part).is_err();
        let mut touched = Vec::new();
        after.odd(p, &mut is, &mut touched);
        touched.sort_unstable();
        touched.dedup();
        touched.retain(had_side);
        was.retain(had_side);
        is.retain(had_side);
        // Parts in one list only, or touched where they were not.
        touched.extend(was.iter().filter(|part| is.binary_search(part).is_err()));
        touched.extend(is.iter().filter(|part| was.binary_search(part).is_err()));
        touched.sort_unstable();
        touched.dedup();
        touched.iter().for_each(|&part| report.moved.add(part as usize, p));
    }
}

/// Segments by the strips of x that they reach into.
struct Strips {
    /// The least x of each strip but the first.
    borders: Vec<f64>,
    starts: Vec<usize>,
    /// Segments, and their parts.
    segments: Vec<([Xy; 2], u32)>,
}

impl Strips {
    /// Of the parts that `there` has.
    fn new(lines: &Lines<'_>, there: &Lines<'_>) -> Self {
        let parts = (0..lines.count()).filter(|&part| !there.range(part).is_empty());
        let all = || {
            parts.clone().flat_map(|part| {
                let range = lines.range(part);
                (range.start..range.end.saturating_sub(1))
                    .map(move |v| ([lines.at(v), lines.at(v + 1)], part as u32))
            })
        };
        let mut lows: Vec<f64> = all().map(|([p, q], _)| p[0].min(q[0])).collect();
        lows.sort_unstable_by(f64::total_cmp);
        let mut borders: Vec<f64> = lows.into_iter().step_by(TO_A_STRIP).skip(1).collect();
        borders.dedup();
        let strip = |x: f64| borders.partition_point(|&border| border <= x);
        let reach = |s: [Xy; 2]| strip(s[0][0].min(s[1][0]))..strip(s[0][0].max(s[1][0])) + 1;
        let mut starts = vec![0; borders.len() + 2];
        for (segment, _) in all() {
            reach(segment).for_each(|at| starts[at + 1] += 1);
        }
        for at in 1..starts.len() {
            starts[at] += starts[at - 1];
        }
        let mut next = starts.clone();
        let mut segments = vec![([[0.0; 2]; 2], 0); starts[starts.len() - 1]];
        for (segment, part) in all() {
            for at in reach(segment) {
                segments[next[at]] = (segment, part);
                next[at] += 1;
            }
        }
        Self { borders, starts, segments }
    }

    /// Fills `odd` with the parts that the ray from `p` upwards crosses an odd number of times,
    /// ascending, and adds to `on` those it lies on.
    fn odd(&self, p: Xy, odd: &mut Vec<u32>, on: &mut Vec<u32>) {
        let at = self.borders.partition_point(|&border| border <= p[0]);
        let mut crossed = Vec::new();
        for &([a, b], part) in &self.segments[self.starts[at]..self.starts[at + 1]] {
            let (left, right) = if a[0] <= b[0] { (a, b) } else { (b, a) };
            if p[0] < left[0] || right[0] < p[0] || p[1] > a[1].max(b[1]) {
                continue;
            }
            let turn = side([left, right], p);
            if turn == 0 && p[1] >= a[1].min(b[1]) {
                on.push(part);
            } else if turn < 0 && left[0] <= p[0] && p[0] < right[0] {
                crossed.push(part);
            }
        }
        crossed.sort_unstable();
        odd.clear();
        odd.extend(crossed.chunk_by(|p, q| p == q).filter(|c| c.len() % 2 == 1).map(|c| c[0]));
    }
}
