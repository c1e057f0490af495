//! Intersection tests of segments.

use std::cmp::Ordering;

use terrane_base::geom::plane::{Xy, orient};

/// Whether segments `s` and `t`, neither of them a point, meet anywhere but in one common end
/// vertex: they cross, an end of one lies in the other, or they overlap. Exact.
#[inline]
pub fn conflict(s: [Xy; 2], t: [Xy; 2]) -> bool {
    if !spans_meet(s, t, 0) || !spans_meet(s, t, 1) {
        return false;
    }
    let [[a, b], [c, d]] = [s, t];
    match (a == c, a == d, b == c, b == d) {
        (false, false, false, false) => intersect(a, b, c, d),
        (true, _, _, true) | (_, true, true, _) => true,
        (true, ..) => same_way(a, b, d),
        (_, true, ..) => same_way(a, b, c),
        (_, _, true, _) => same_way(b, a, d),
        (.., true) => same_way(b, a, c),
    }
}

/// Whether two segments, either of which may be a point, intersect. Exact.
pub(super) fn touch(s: [Xy; 2], t: [Xy; 2]) -> bool {
    let [[a, b], [c, d]] = [s, t];
    spans_meet(s, t, 0) && spans_meet(s, t, 1) && intersect(a, b, c, d)
}

/// Whether the extents of two segments along an axis overlap.
#[inline(always)]
fn spans_meet(s: [Xy; 2], t: [Xy; 2], axis: usize) -> bool {
    let ([a, b], [c, d]) = (s.map(|p| p[axis]), t.map(|p| p[axis]));
    !((a < c && a < d && b < c && b < d) || (a > c && a > d && b > c && b > d))
}

/// Whether closed segments with intersecting boxes intersect.
fn intersect(a: Xy, b: Xy, c: Xy, d: Xy) -> bool {
    let (at_c, at_d) = (orient(a, b, c), orient(a, b, d));
    if at_c == at_d && at_c != Ordering::Equal {
        return false;
    }
    let (at_a, at_b) = (orient(c, d, a), orient(c, d, b));
    at_a != at_b || at_a == Ordering::Equal
}

/// Whether `p` and `q` lie in the same direction from `o`.
pub(super) fn same_way(o: Xy, p: Xy, q: Xy) -> bool {
    let axis = usize::from(p[0] == o[0]);
    orient(o, p, q) == Ordering::Equal && (p[axis] > o[axis]) == (q[axis] > o[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn cases() {
        let [o, e, n, ee, m] = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [4.0, 0.0], [1.0, 0.0]];
        assert!(!conflict([o, e], [o, n]), "a common end");
        assert!(!conflict([o, e], [e, ee]), "straight on");
        assert!(conflict([o, e], [o, ee]), "over each other");
        assert!(conflict([ee, o], [e, o]), "over each other, backwards");
        assert!(conflict([o, e], [e, o]), "the same");
        assert!(conflict([o, e], [m, n]), "an end inside");
        assert!(conflict([o, ee], [m, e]), "one within the other");
        assert!(conflict([[1.0, -1.0], [1.0, 1.0]], [o, e]), "a crossing");
        assert!(!conflict([[1.0, 0.5], [1.0, 1.0]], [o, e]), "apart");
        assert!(!conflict([o, m], [e, ee]), "apart on a line");
    }

    /// All points of a segment with ends on multiples of 1, at steps fine enough to have every
    /// point where two such segments of size up to 3 can meet: in units of 1/u for all u.
    fn meets_off_ends(s: [[i64; 2]; 2], t: [[i64; 2]; 2]) -> bool {
        let sub = |p: [i64; 2], q: [i64; 2]| [p[0] - q[0], p[1] - q[1]];
        let cross = |p: [i64; 2], q: [i64; 2]| p[0] * q[1] - p[1] * q[0];
        let (u, v, w) = (sub(s[1], s[0]), sub(t[1], t[0]), sub(t[0], s[0]));
        let den = cross(u, v);
        let shared = s.iter().filter(|p| t.contains(p)).count();
        if den != 0 {
            let (p, q) = (cross(w, v) * den.signum(), cross(w, u) * den.signum());
            let meet = (0..=den.abs()).contains(&p) && (0..=den.abs()).contains(&q);
            return meet && shared == 0;
        }
        if cross(w, u) != 0 {
            return false;
        }
        let key = |p: [i64; 2]| p[0] * u[0] + p[1] * u[1];
        let span = |r: [[i64; 2]; 2]| (key(r[0]).min(key(r[1])), key(r[0]).max(key(r[1])));
        let ((a, b), (c, d)) = (span(s), span(t));
        let common = b.min(d) - a.max(c);
        common > 0 || (common == 0 && shared == 0)
    }

    proptest! {
        #[test]
        fn agrees_with_whole_numbers(v in proptest::array::uniform8(0i64..4)) {
            let s = [[v[0], v[1]], [v[2], v[3]]];
            let t = [[v[4], v[5]], [v[6], v[7]]];
            prop_assume!(s[0] != s[1] && t[0] != t[1]);
            let float = |r: [[i64; 2]; 2]| r.map(|p| p.map(|c| c as f64));
            prop_assert_eq!(conflict(float(s), float(t)), meets_off_ends(s, t));
        }
    }
}
