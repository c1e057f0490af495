//! Segments and lines in whole numbers: where they meet, and what they go around.

use std::collections::BTreeSet;

use super::lattice::{Cell, Segment, cross, dot, square, sub};

/// Whether a position is within a distance of a segment.
pub(crate) fn is_within(p: Cell, [a, b]: Segment, distance: i64) -> bool {
    let (along, out) = (sub(b, a), sub(p, a));
    let (t, length2, most) = (dot(out, along), square(along), i128::from(distance).pow(2));
    if t <= 0 {
        square(out) <= most
    } else if t >= length2 {
        square(sub(p, b)) <= most
    } else {
        cross(along, out).pow(2) <= most * length2
    }
}

/// Whether two segments, neither of them a point, have more in common than an end.
pub(crate) fn meet(s: Segment, t: Segment) -> bool {
    let (u, v, w) = (sub(s[1], s[0]), sub(t[1], t[0]), sub(t[0], s[0]));
    let shared = s.iter().filter(|p| t.contains(p)).count();
    let den = cross(u, v);
    if den != 0 {
        let whole = 0..=den.abs();
        let at = [cross(w, v), cross(w, u)].map(|c| c * den.signum());
        return shared == 0 && at.iter().all(|c| whole.contains(c));
    }
    if cross(w, u) != 0 {
        return false;
    }
    let span = |r: Segment| {
        let [a, b] = r.map(|p| dot(p, u));
        (a.min(b), a.max(b))
    };
    let ((a, b), (c, d)) = (span(s), span(t));
    let common = b.min(d) - a.max(c);
    common > 0 || (common == 0 && shared == 0)
}

pub(crate) fn segments(line: &[Cell]) -> impl Iterator<Item = Segment> + Clone + '_ {
    line.windows(2).map(|w| [w[0], w[1]]).filter(|[a, b]| a != b)
}

pub(crate) fn is_on(line: &[Cell], p: Cell) -> bool {
    line.contains(&p) || segments(line).any(|s| is_within(p, s, 0))
}

/// How often a line goes around a position that is not on it: whole turns for a ring; for another line
/// it is told by the ray to the right alone.
pub(crate) fn turns(line: &[Cell], p: Cell) -> i64 {
    let step = |[a, b]: Segment| {
        let side = cross(sub(b, a), sub(p, a));
        match (a[1] <= p[1], b[1] <= p[1]) {
            (true, false) if side > 0 => 1,
            (false, true) if side < 0 => -1,
            _ => 0,
        }
    };
    segments(line).map(step).sum()
}

pub(crate) fn area(ring: &[Cell]) -> i128 {
    segments(ring).map(|[a, b]| cross(a, b)).sum()
}

pub(crate) fn without_repeats(line: &[Cell]) -> Vec<Cell> {
    let mut line = line.to_vec();
    line.dedup();
    line
}

/// Whether a ring touches itself nowhere.
pub(crate) fn is_simple(ring: &[Cell]) -> bool {
    let line = without_repeats(ring);
    let all: Vec<Segment> = segments(&line).collect();
    let distinct: BTreeSet<&Cell> = line.iter().collect();
    let apart = all.iter().enumerate().all(|(i, s)| all[..i].iter().all(|t| !meet(*s, *t)));
    distinct.len() > 2 && distinct.len() + 1 == line.len() && apart
}
