//! Whether a ring that is gone could go: a segment between two of its vertices has all others within
//! the tolerance.

use super::exact::Xy;
use super::measure::ProofDistance;

/// Most distances that are measured for one ring.
const MAX_LOOKS: u64 = 1 << 25;

/// Directions in which the outermost vertices of a ring too large for that are looked for.
const DIRECTIONS: usize = 16;

/// Whether `ring` and `others` (holes that went with it) lie along a segment between two vertices of
/// `ring`; `None` where there are too many to tell.
pub(super) fn lies_along_a_segment(
    distance: ProofDistance,
    ring: &[[f64; 3]],
    others: &[[f64; 3]],
    tolerance: f64,
) -> Option<bool> {
    let mut all: Vec<[f64; 3]> = ring.iter().chain(others).copied().collect();
    let mut looks = 0;
    // The vertex that was too far off the last time is looked at first.
    let mut is_along = |a: [f64; 3], b: [f64; 3], all: &mut Vec<[f64; 3]>| {
        let off = all.iter().position(|&p| {
            looks += 1;
            distance.of(p, a, b) > tolerance
        });
        if let Some(at) = off {
            all[..=at].rotate_right(1);
        }
        (off.is_none(), looks)
    };
    let Some(&first) = ring.first() else { return Some(true) };
    let far = farthest(distance, ring, first);
    let farther = farthest(distance, ring, far);
    if is_along(far, farther, &mut all).0 || is_along(first, far, &mut all).0 {
        return Some(true);
    }
    if is_wide(distance, &all, tolerance) {
        return Some(false);
    }
    for (i, &a) in ring.iter().enumerate() {
        for &b in &ring[i..] {
            match is_along(a, b, &mut all) {
                (true, _) => return Some(true),
                (false, looks) if looks > MAX_LOOKS => return None,
                _ => {}
            }
        }
    }
    Some(false)
}

fn farthest(distance: ProofDistance, ring: &[[f64; 3]], from: [f64; 3]) -> [f64; 3] {
    let off = |p: &[f64; 3]| distance.of(*p, from, from);
    ring.iter().copied().max_by(|p, q| off(p).total_cmp(&off(q))).unwrap_or(from)
}

/// True where some vertices are in no strip twice as wide as the tolerance (and a hair more: degrees
/// are not everywhere of one length), so that no segment is near all of them.
fn is_wide(distance: ProofDistance, all: &[[f64; 3]], tolerance: f64) -> bool {
    let origin = all[0];
    let flat: Vec<Xy> = all.iter().map(|p| distance.flat(*p, origin)).collect();
    let outermost = |k: usize| {
        let angle = k as f64 / DIRECTIONS as f64 * std::f64::consts::TAU;
        let along = |p: &Xy| p[0] * angle.cos() + p[1] * angle.sin();
        flat.iter().copied().max_by(|p, q| along(p).total_cmp(&along(q)))
    };
    let some: Vec<Xy> = (0..DIRECTIONS).filter_map(outermost).collect();
    let pairs = some.iter().enumerate().flat_map(|(i, a)| some[..i].iter().map(move |b| (a, b)));
    let width = |(a, b): (&Xy, &Xy)| {
        let (x, y) = (b[0] - a[0], b[1] - a[1]);
        let off = |p: &Xy| ((p[0] - a[0]) * y - (p[1] - a[1]) * x) / x.hypot(y);
        let (low, high) = some
            .iter()
            .map(off)
            .fold((0.0, 0.0), |(low, high): (f64, f64), off| (low.min(off), high.max(off)));
        high - low
    };
    // The narrowest strip has two of the outermost vertices on its border.
    let widths = pairs.filter(|(a, b)| a != b).map(width);
    widths.min_by(f64::total_cmp).is_some_and(|width| width > 2.1 * tolerance)
}
