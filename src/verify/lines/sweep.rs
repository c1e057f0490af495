//! Pairs of segments that meet where they should not.

use super::positions::FOREIGN;
use super::{Lines, Question, Report};
use crate::verify::expansion::Expansion;

type Xy = [f64; 2];

/// Segments to a strip, at the mean.
const TO_A_STRIP: usize = 256;

/// A segment between two positions, the lower number first.
#[derive(Clone, Copy, Debug)]
struct Segment {
    ids: [u32; 2],
    ends: [Xy; 2],
    part: u32,
}

impl Segment {
    fn span(&self, axis: usize) -> [f64; 2] {
        let [p, q] = self.ends.map(|p| p[axis]);
        [p.min(q), p.max(q)]
    }
}

/// Counts the pairs of segments that meet off a common end, before and after; segments at the same
/// place are one.
pub(super) fn crossings(question: &Question<'_>, ids: &[Vec<u32>; 2], report: &mut Report) {
    let old = segments(&question.original, &ids[0]);
    each_pair(&old, &mut |_, _| report.original_crossings += 1);
    let is_old = |s: &Segment| {
        !s.ids.contains(&FOREIGN) && old.binary_search_by_key(&s.ids, |o| o.ids).is_ok()
    };
    let new = segments(&question.simplified, &ids[1]);
    each_pair(&new, &mut |s, t| {
        report.crossings += 1;
        if !is_old(s) || !is_old(t) {
            report.new_crossings.add(s.part as usize, s.ends[0]);
        }
    });
}

/// The segments of all parts, each place once, by their positions' numbers.
fn segments(lines: &Lines<'_>, ids: &[u32]) -> Vec<Segment> {
    let mut all = Vec::with_capacity(ids.len());
    for part in 0..lines.count() {
        let range = lines.range(part);
        for v in range.start..range.end.saturating_sub(1) {
            let (mut ends, mut pair) = ([lines.at(v), lines.at(v + 1)], [ids[v], ids[v + 1]]);
            if pair[0] > pair[1] {
                (ends, pair) = ([ends[1], ends[0]], [pair[1], pair[0]]);
            }
            if ends[0] != ends[1] {
                all.push(Segment { ids: pair, ends, part: part as u32 });
            }
        }
    }
    all.sort_by_key(|s| s.ids);
    all.dedup_by(|p, q| p.ids == q.ids && p.ends == q.ends);
    all
}

/// Calls `found` for each pair that meets off a common end, once.
///
/// The plane is cut into strips of y with about as many segments in each. In a strip, segments come in
/// the order of their least x and are compared with those before them that reach as far. A pair counts
/// in the strip that has the lowest y the two share.
fn each_pair(segments: &[Segment], found: &mut impl FnMut(&Segment, &Segment)) {
    let mut lows: Vec<f64> = segments.iter().map(|s| s.span(1)[0]).collect();
    lows.sort_unstable_by(f64::total_cmp);
    let mut borders: Vec<f64> = lows.into_iter().step_by(TO_A_STRIP).skip(1).collect();
    borders.dedup();
    let strip = |y: f64| borders.partition_point(|&border| border <= y);
    let mut entries = Vec::with_capacity(segments.len() * 5 / 4);
    for (i, segment) in (0u32..).zip(segments) {
        let [low, high] = segment.span(1);
        entries.extend((strip(low)..=strip(high)).map(|s| (s as u32, segment.span(0)[0], i)));
    }
    entries.sort_unstable_by(|p, q| p.0.cmp(&q.0).then(p.1.total_cmp(&q.1)).then(p.2.cmp(&q.2)));
    let mut active: Vec<u32> = Vec::new();
    for entry in entries.chunk_by(|p, q| p.0 == q.0) {
        active.clear();
        for &(at, x, i) in entry {
            let s = &segments[i as usize];
            active.retain(|&j| segments[j as usize].span(0)[1] >= x);
            for t in active.iter().map(|&j| &segments[j as usize]) {
                let ([low, high], [other_low, other_high]) = (s.span(1), t.span(1));
                let common = low.max(other_low);
                let near = common <= high.min(other_high) && strip(common) == at as usize;
                if near && meet(s.ends, t.ends) {
                    found(s, t);
                }
            }
            active.push(i);
        }
    }
}

/// Whether two different segments have a point in common that is not an end of both.
pub(super) fn meet(s: [Xy; 2], t: [Xy; 2]) -> bool {
    let [a, b] = t.map(|p| side(s, p));
    let [c, d] = s.map(|p| side(t, p));
    if a * b < 0 && c * d < 0 {
        return true;
    }
    let within = |p: Xy, r: [Xy; 2], side: i32| side == 0 && p != r[0] && p != r[1] && in_box(p, r);
    within(t[0], s, a) || within(t[1], s, b) || within(s[0], t, c) || within(s[1], t, d)
}

fn in_box(p: Xy, [a, b]: [Xy; 2]) -> bool {
    (0..2).all(|k| a[k].min(b[k]) <= p[k] && p[k] <= a[k].max(b[k]))
}

/// 1 where `p` is to the left of a segment, -1 to the right, 0 on its line. Exact.
pub(super) fn side([a, b]: [Xy; 2], p: Xy) -> i32 {
    let (one, other) = ((b[0] - a[0]) * (p[1] - a[1]), (b[1] - a[1]) * (p[0] - a[0]));
    let safe = 8.0 * f64::EPSILON * (one.abs() + other.abs());
    match one - other {
        det if det > safe => 1,
        det if det < -safe => -1,
        _ => {
            let mut sum = Expansion::default();
            for [p, q] in [[a, b], [b, p], [p, a]] {
                sum.add_floats(p[0], q[1]);
                sum.add_floats(-p[1], q[0]);
            }
            sum.sign()
        }
    }
}

/// The sign of a ring's area, exact.
pub(super) fn area_sign(ring: &[[f64; 3]]) -> i32 {
    let (mut sum, mut size) = (0.0, 0.0);
    for pair in ring.windows(2) {
        let (one, other) = (pair[0][0] * pair[1][1], pair[0][1] * pair[1][0]);
        sum += one - other;
        size += one.abs() + other.abs();
    }
    let safe = (ring.len() + 8) as f64 * 2.0 * f64::EPSILON * size;
    if f64::abs(sum) > safe {
        return if sum > 0.0 { 1 } else { -1 };
    }
    let mut exact = Expansion::default();
    for pair in ring.windows(2) {
        exact.add_floats(pair[0][0], pair[1][1]);
        exact.add_floats(-pair[0][1], pair[1][0]);
    }
    exact.sign()
}
