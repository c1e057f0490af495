//! Cuts lines and rings at tile borders.

use super::tree::{LastTile, VertexQuadtree};
use terrane_base::geom::plane::Xy;

/// Consecutive vertices of a line or ring in one tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileRun {
    /// The tile.
    pub tile: u32,
    /// First vertex and count; runs of a ring may wrap around.
    pub first: usize,
    /// How many.
    pub count: usize,
}

/// Fills `runs` with the runs of a part in order. A part in one tile is one run with all vertices. Otherwise a
/// ring starts with the first run that starts inside it, without the closing vertex. O(n).
///
/// Every position has to be in a tile.
pub fn cut(
    part: &[Xy],
    is_ring: bool,
    quadtree: &VertexQuadtree,
    place: &mut LastTile,
    runs: &mut Vec<TileRun>,
) {
    runs.clear();
    if quadtree.count() == 1 {
        runs.push(TileRun { tile: 0, first: 0, count: part.len() });
        return;
    }
    for (at, &p) in part.iter().enumerate() {
        let tile = quadtree.of(p, place).unwrap_or_default();
        match runs.last_mut() {
            Some(run) if run.tile == tile => run.count += 1,
            _ => runs.push(TileRun { tile, first: at, count: 1 }),
        }
    }
    if let (true, [first, .., last]) = (is_ring, &mut runs[..]) {
        // Both are in the tile of the shared vertex.
        last.count += first.count - 1;
        runs.remove(0);
    }
}

/// Segments between the runs of a part, in order.
pub fn cross_overs<'a>(
    part: &'a [Xy],
    is_ring: bool,
    runs: &'a [TileRun],
) -> impl Iterator<Item = [Xy; 2]> + 'a {
    let next = runs.iter().skip(1).chain(runs.first().filter(|_| is_ring));
    let count = part.len() - usize::from(is_ring && part.len() > 1);
    let pairs = runs.iter().zip(next).filter(|_| runs.len() > 1);
    pairs.map(move |(run, next)| {
        [part[(run.first + run.count - 1) % count], part[next.first % count]]
    })
}
