//! Exact predicates on floats: side of a segment, intersection, orientation.

use std::cmp::Ordering;

use crate::expansion::ProofExpansion;

/// A position.
pub(super) type Xy = [f64; 2];

/// A segment with the end of the lesser x (then y) first, and zeros of both signs the same.
pub(super) fn upward(ends: [Xy; 2]) -> [Xy; 2] {
    let [p, q] = ends.map(|p| p.map(|v| v + 0.0));
    if p <= q { [p, q] } else { [q, p] }
}

/// The order of segments by their ends.
pub(super) fn by_ends(s: &[Xy; 2], t: &[Xy; 2]) -> Ordering {
    let pairs = s.as_flattened().iter().zip(t.as_flattened());
    pairs.map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

/// Whether two different segments have a point in common that is not an end of both.
pub(super) fn meet(s: [Xy; 2], t: [Xy; 2]) -> bool {
    let [a, b] = t.map(|p| side(s, p));
    let [c, d] = s.map(|p| side(t, p));
    if a * b < 0 && c * d < 0 {
        return true;
    }
    [(t[0], s, a), (t[1], s, b), (s[0], t, c), (s[1], t, d)]
        .into_iter()
        .any(|(p, r, side)| side == 0 && p != r[0] && p != r[1] && in_box(p, r))
}

pub(super) fn in_box(p: Xy, [a, b]: [Xy; 2]) -> bool {
    (0..2).all(|k| a[k].min(b[k]) <= p[k] && p[k] <= a[k].max(b[k]))
}

/// 1 where `p` is to the left of a segment, -1 to the right, 0 on its line. Exact.
pub(super) fn side([a, b]: [Xy; 2], p: Xy) -> i32 {
    if p == a || p == b {
        return 0;
    }
    let (one, other) = ((b[0] - a[0]) * (p[1] - a[1]), (b[1] - a[1]) * (p[0] - a[0]));
    let safe = 8.0 * f64::EPSILON * (one.abs() + other.abs());
    match one - other {
        det if det > safe => 1,
        det if det < -safe => -1,
        _ => {
            let mut sum = ProofExpansion::default();
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
    let mut exact = ProofExpansion::default();
    for pair in ring.windows(2) {
        exact.add_floats(pair[0][0], pair[1][1]);
        exact.add_floats(-pair[0][1], pair[1][0]);
    }
    exact.sign()
}
