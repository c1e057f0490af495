//! What is left of a ring among its own vertices, and whether it is still that ring.

use std::cmp::Ordering;

use crate::part::chosen;
use terrane_base::geom::plane::area_sign;
use terrane_line::Xy;
use terrane_line::topology::RingCollapse;
use terrane_vector::KeptVertices;

/// What is written of a ring that keeps `left` of its own vertices; `None` where it has to stay whole, as
/// it has turned over, or lost what area it had.
pub(super) fn ring(own: &[Xy], left: &[u32], collapse: RingCollapse) -> Option<KeptVertices> {
    let kept = left.iter().map(|at| own[*at as usize]);
    if is_flat(own.iter().copied()) {
        // It had no area to begin with.
        return Some(if collapse == RingCollapse::Drop {
            KeptVertices::Nothing
        } else {
            KeptVertices::All
        });
    }
    let then = area_sign(own.iter().copied());
    let is_ring = !is_flat(kept.clone()) && (then == Ordering::Equal || then == area_sign(kept));
    (is_ring || left.is_empty()).then(|| chosen(left))
}

/// Whether there are fewer than three different positions.
fn is_flat(mut ring: impl Iterator<Item = Xy>) -> bool {
    let Some(first) = ring.next() else { return true };
    let Some(second) = ring.find(|p| *p != first) else { return true };
    ring.all(|p| p == first || p == second)
}
