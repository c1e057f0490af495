//! Lines and rings cut where they go from one square to another.

use super::tree::{LastTile, VertexQuadtree};
use terrane_base::geom::plane::Xy;

/// Vertices of a line or ring that follow each other in one square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileRun {
    /// The square.
    pub square: u32,
    /// The first vertex, and how many there are; those of a ring go on from its beginning.
    pub first: usize,
    /// How many.
    pub count: usize,
}

/// Fills `runs` with those of a part, in order. A part that stays in one square is one run with all of
/// its vertices. A ring that does not begins with the first run that begins within it, and its last
/// vertex, which is its first again, is left out. O(n).
///
/// Every position has to be in a square.
pub fn cut(
    part: &[Xy],
    is_ring: bool,
    squares: &VertexQuadtree,
    place: &mut LastTile,
    runs: &mut Vec<TileRun>,
) {
    runs.clear();
    if squares.count() == 1 {
        runs.push(TileRun { square: 0, first: 0, count: part.len() });
        return;
    }
    for (at, &p) in part.iter().enumerate() {
        let square = squares.of(p, place).unwrap_or_default();
        match runs.last_mut() {
            Some(run) if run.square == square => run.count += 1,
            _ => runs.push(TileRun { square, first: at, count: 1 }),
        }
    }
    if let (true, [first, .., last]) = (is_ring, &mut runs[..]) {
        // Both are in the square of the vertex that they share.
        last.count += first.count - 1;
        runs.remove(0);
    }
}

/// The segments between runs of a part that go from square to square, in order.
pub fn cross_overs<'a>(
    part: &'a [Xy],
    is_ring: bool,
    runs: &'a [TileRun],
) -> impl Iterator<Item = [Xy; 2]> + 'a {
    let next = runs.iter().skip(1).chain(runs.first().filter(|_| is_ring));
    let count = part.len() - usize::from(is_ring && part.len() > 1);
    let ends = move |(run, next): (&TileRun, &TileRun)| {
        [part[(run.first + run.count - 1) % count], part[next.first % count]]
    };
    runs.iter().zip(next).filter(|_| runs.len() > 1).map(ends)
}
