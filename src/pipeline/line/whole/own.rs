//! What is left of a part's arcs, found among its own vertices.

use crate::line::Xy;
use crate::pipeline::line::part::chosen;
use crate::vector::Kept;

/// What a part keeps of its own vertices, to pass through `left` in order; all of it, where it has no
/// area of its own. `None` when there is no such way.
pub(super) fn own_vertices(
    own: &[Xy],
    is_ring: bool,
    left: impl Iterator<Item = Xy> + Clone,
) -> Option<Kept> {
    let Some(first) = left.clone().next() else { return Some(Kept::Nothing) };
    let starts = (0..own.len()).filter(|at| own[*at] == first);
    // A ring may come by its first vertex again, on another way.
    let mut found = starts.filter_map(|start| passing(own, is_ring, start, left.clone()));
    let kept = found.next()?;
    Some(if is_ring && is_flat(own, &kept) { Kept::All } else { chosen(&kept) })
}

/// Whether fewer than three vertices that differ are kept of a ring.
pub(super) fn is_flat(own: &[Xy], kept: &[u32]) -> bool {
    match kept.iter().map(|at| own[*at as usize]).collect::<Vec<_>>()[..] {
        [a, b, c] => a == b || b == c || a == c,
        ref all => all.len() < 3,
    }
}

/// The vertices of a part, from number `start` on and of a ring once around, that lie at `left` one
/// after the other.
fn passing(
    own: &[Xy],
    is_ring: bool,
    start: usize,
    left: impl Iterator<Item = Xy>,
) -> Option<Vec<u32>> {
    let count = own.len() - usize::from(is_ring);
    let round = if is_ring { start..start + count + 1 } else { start..count };
    let mut ahead = round.map(|at| at % count.max(1));
    let find = |at: Xy| ahead.find(|own_at| own[*own_at] == at).map(|found| found as u32);
    let mut kept = left.map(find).collect::<Option<Vec<u32>>>()?;
    if is_ring && kept.len() > 1 && kept.first() == kept.last() {
        kept.pop();
    }
    kept.sort_unstable();
    Some(kept)
}
