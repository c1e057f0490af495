//! Result of a ring from its own vertices, with a check of its orientation.

use std::cmp::Ordering;

use crate::feature::chosen;
use terrane_base::geom::plane::area_sign;
use terrane_line::Xy;
use terrane_line::topology::RingCollapse;
use terrane_vector::RetainedVertices;

/// Output of a ring that keeps the vertices `left`; `None` if it has to stay whole because it changed
/// orientation or lost its area.
pub(super) fn ring(own: &[Xy], left: &[u32], collapse: RingCollapse) -> Option<RetainedVertices> {
    let kept = left.iter().map(|at| own[*at as usize]);
    if is_flat(own.iter().copied()) {
        // The input ring had no area.
        return Some(if collapse == RingCollapse::Drop {
            RetainedVertices::Nothing
        } else {
            RetainedVertices::All
        });
    }
    let then = area_sign(own.iter().copied());
    let is_ring = !is_flat(kept.clone()) && (then == Ordering::Equal || then == area_sign(kept));
    (is_ring || left.is_empty()).then(|| chosen(left))
}

/// Whether there are fewer than three distinct positions.
fn is_flat(mut ring: impl Iterator<Item = Xy>) -> bool {
    let Some(first) = ring.next() else { return true };
    let Some(second) = ring.find(|p| *p != first) else { return true };
    ring.all(|p| p == first || p == second)
}
