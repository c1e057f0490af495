//! Rounding of kept vertices without touching, crossing or changing sides.
//!
//! Vertices move one by one, those closest to their target first. A vertex that moves from p to q takes the
//! segments to its neighbours with it; each sweeps a triangle. It moves only if these triangles intersect no
//! other segment, except at the neighbour where they end. So the drawing is deformed without touching itself:
//! points stay inside rings, rings keep their orientation, shared borders stay shared. Vertices may coincide
//! only where a segment between them shrinks to a point and no two junctions meet, so no ring is pinched.
//!
//! **Why last**, and not before simplification: the kept vertices are spread out, so they rarely block each
//! other, and omitted vertices need no rounding.

use std::cmp::Ordering;
use std::collections::HashSet;

use super::chains::{Chains, RetainedChainVertices};
use super::cross::{same_way, touch};
use super::tree::{ClosedBox, HilbertRTree};
use terrane_base::Cancel;
use terrane_base::error::Result;
use terrane_base::geom::plane::{Xy, key, orient};

/// Segments tested before a vertex is left in place: many are near only if a cluster of vertices is rounded to
/// few positions.
const MAX_LOOKS: usize = 4096;
/// Attempts for vertices that block each other.
const PASSES: usize = 8;

/// Kept positions after rounding.
#[derive(Clone, Debug, Default)]
pub struct RoundedPositions {
    /// Keys of the original positions, ascending.
    old: Vec<[u64; 2]>,
    now: Vec<Xy>,
}

impl RoundedPositions {
    /// Current position of a kept position.
    pub fn of(&self, at: Xy) -> Xy {
        self.old.binary_search(&key(at)).map_or(at, |node| self.now[node])
    }
}

/// Moves the `kept` vertices of `chains` to the positions of `place`, as far as the rules of this module allow;
/// `points` keep their positions and sides. Vertices at one position move together.
///
/// O(n log n) for n spread kept vertices; about 150 bytes each.
///
/// # Errors
/// `Interrupted` on cancellation.
pub fn round(
    chains: &Chains<'_>,
    kept: &RetainedChainVertices,
    points: &[Xy],
    place: impl Fn(Xy) -> Xy,
    cancel: Option<&Cancel>,
) -> Result<RoundedPositions> {
    let mut still: Vec<_> = points.iter().map(|at| key(*at)).collect();
    still.sort_unstable();
    // A vertex at a given point stays with it: moved alone, it would change sides with the point.
    let place = |at: Xy| if still.binary_search(&key(at)).is_ok() { at } else { place(at) };
    let mut net = RetainedSegments::new(chains, kept, points, place);
    let mut waiting: Vec<(f64, u32, Xy)> = (0..)
        .zip(&net.now)
        .map(|(node, at)| (node, *at, place(*at)))
        .filter(|(_, at, to)| at != to)
        .map(|(node, [x, y], to)| ((to[0] - x).hypot(to[1] - y), node, to))
        .collect();
    // A vertex that has moved can be in the way of the next, so the order decides the result; equal
    // distances go by number.
    waiting.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for _ in 0..PASSES {
        let before = waiting.len();
        let mut failed = Ok(());
        waiting.retain(|&(_, node, to)| {
            if failed.is_err() {
                return true;
            }
            if node % 1024 == 0 {
                failed = cancel.map_or(Ok(()), Cancel::check);
            }
            let is_free = net.is_free(node, to);
            if is_free {
                net.go(node, to);
            }
            !is_free
        });
        failed?;
        if waiting.len() == before {
            break;
        }
    }
    Ok(RoundedPositions { old: net.old, now: net.now })
}

/// Kept positions and the segments between them.
struct RetainedSegments {
    old: Vec<[u64; 2]>,
    now: Vec<Xy>,
    /// Pairs of distinct positions, and single positions without a segment.
    segments: Vec<[u32; 2]>,
    /// Boxes around all possible positions of a segment.
    tree: HilbertRTree,
    /// Neighbours of each position.
    ends: Vec<u32>,
    /// Start of each position's neighbours, and the total number.
    starts: Vec<u32>,
    /// Positions with more than two segments, now or before.
    junctions: HashSet<[u64; 2]>,
}

impl RetainedSegments {
    fn new(
        chains: &Chains<'_>,
        kept: &RetainedChainVertices,
        points: &[Xy],
        place: impl Fn(Xy) -> Xy,
    ) -> Self {
        let vertices = kept.vertices.iter().map(|vertex| chains.points[*vertex as usize]);
        let mut now: Vec<Xy> = vertices.chain(points.iter().copied()).collect();
        now.sort_unstable_by_key(|at| key(*at));
        now.dedup_by_key(|at| key(*at));
        let old: Vec<[u64; 2]> = now.iter().map(|at| key(*at)).collect();
        let mut segments: Vec<[u32; 2]> = Vec::with_capacity(kept.vertices.len());
        for range in kept.starts.windows(2) {
            for pair in kept.vertices[range[0]..range[1]].windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|vertex| {
                    let position = key(chains.points[vertex as usize]);
                    old.binary_search(&position).unwrap_or_default() as u32
                });
                segments.push([a.min(b), a.max(b)]);
            }
        }
        segments.retain(|[a, b]| a != b);
        segments.sort_unstable();
        segments.dedup();
        let mut starts = vec![0; now.len() + 1];
        segments.iter().flatten().for_each(|node| starts[*node as usize + 1] += 1);
        (1..starts.len()).for_each(|node| starts[node] += starts[node - 1]);
        let mut next = starts.clone();
        let mut ends = vec![0; segments.len() * 2];
        for &[a, b] in &segments {
            for (node, end) in [(a, b), (b, a)] {
                ends[next[node as usize] as usize] = end;
                next[node as usize] += 1;
            }
        }
        for (node, range) in (0..).zip(starts.windows(2)) {
            if range[0] == range[1] {
                segments.push([node; 2]);
            }
        }
        let boxes: Vec<_> = (0..)
            .zip(&segments)
            .map(|(number, ends)| {
                let [a, b] = ends.map(|end| now[end as usize]);
                (number, ClosedBox::of(&[a, b, place(a), place(b)]))
            })
            .collect();
        let junctions = old.iter().zip(starts.windows(2));
        let junctions = junctions.filter(|(_, range)| range[1] - range[0] > 2);
        let junctions = junctions.map(|(position, _)| *position).collect();
        Self { old, segments, tree: HilbertRTree::new(&boxes), ends, starts, junctions, now }
    }

    /// Neighbours of a position.
    fn ends(&self, node: u32) -> &[u32] {
        let range = self.starts[node as usize]..self.starts[node as usize + 1];
        &self.ends[range.start as usize..range.end as usize]
    }

    fn go(&mut self, node: u32, to: Xy) {
        self.now[node as usize] = to;
        if self.ends(node).len() > 2 {
            self.junctions.insert(key(to));
        }
    }

    fn at(&self, node: u32) -> Xy {
        self.now[node as usize]
    }

    /// Whether a vertex may move to a position.
    fn is_free(&self, node: u32, to: Xy) -> bool {
        let (ends, from) = (self.ends(node), self.at(node));
        let joins = ends.iter().any(|end| self.at(*end) == to);
        if joins && ends.len() > 2 && self.junctions.contains(&key(to)) {
            return false;
        }
        let is_clear = |apex| self.is_clear(node, &SweptTriangle { apex, from, to, joins });
        match ends {
            [] => is_clear(from),
            _ => ends.iter().all(|end| is_clear(self.at(*end))),
        }
    }

    /// Whether the triangle swept by a segment of the vertex is empty.
    fn is_clear(&self, node: u32, swept: &SweptTriangle) -> bool {
        let around = ClosedBox::of(&[swept.apex, swept.from, swept.to]);
        let (mut groups, mut looks) = (Vec::new(), 0);
        self.tree.groups_meeting(&around, 0, &mut groups);
        for group in groups {
            for at in self.tree.group(group).filter(|at| self.tree.bounds(*at).meets(&around)) {
                looks += 1;
                let [a, b] = self.segments[self.tree.ids[at] as usize];
                let is_met = match (a == node, b == node) {
                    (true, true) => false,
                    (true, false) => swept.has_end(self.at(b)),
                    (false, true) => swept.has_end(self.at(a)),
                    (false, false) => swept.meets([self.at(a), self.at(b)]),
                };
                if is_met || looks > MAX_LOOKS {
                    return false;
                }
            }
        }
        true
    }
}

/// Triangle swept by a segment: one end is fixed at its apex, the other moves.
struct SweptTriangle {
    apex: Xy,
    from: Xy,
    to: Xy,
    /// The vertex moves onto this neighbour.
    joins: bool,
}

impl SweptTriangle {
    /// Whether contact is allowed here: at the end of the segment, or where it shrinks to a point.
    fn is_open(&self, at: Xy) -> bool {
        at == self.apex || (self.joins && at == self.to)
    }

    /// Whether it contains the end of another segment of the vertex.
    fn has_end(&self, end: Xy) -> bool {
        !self.is_open(end) && self.holds(end)
    }

    /// Whether it has a forbidden intersection with a segment. A segment that the moving one crosses before and
    /// after is crossed throughout.
    fn meets(&self, [c, d]: [Xy; 2]) -> bool {
        match (self.is_open(c), self.is_open(d)) {
            (true, true) => c != d,
            (true, false) => self.is_entered(c, d),
            (false, true) => self.is_entered(d, c),
            (false, false) => {
                let [before, path, after] = self.sides().map(|side| touch(side, [c, d]));
                path || before != after || self.holds(c) || self.holds(d)
            }
        }
    }

    /// Segment before, path of its end, and segment after.
    fn sides(&self) -> [[Xy; 2]; 3] {
        [[self.apex, self.from], [self.from, self.to], [self.to, self.apex]]
    }

    /// Whether the path from one of its corners to `end` starts in it or on its border.
    fn is_entered(&self, corner: Xy, end: Xy) -> bool {
        let other = if corner == self.apex { self.to } else { self.apex };
        let is_along = |side: Xy| side != corner && same_way(corner, side, end);
        let turn = orient(corner, self.from, other);
        let is_between =
            || orient(corner, self.from, end) == turn && orient(corner, end, other) == turn;
        is_along(self.from) || is_along(other) || (turn != Ordering::Equal && is_between())
    }

    /// Whether a position is in it, borders included.
    fn holds(&self, p: Xy) -> bool {
        let [first, second, third] = [
            orient(self.apex, self.from, p),
            orient(self.from, self.to, p),
            orient(self.to, self.apex, p),
        ];
        let is_within = first != Ordering::Equal && first == second && second == third;
        is_within || self.sides().iter().any(|side| touch(*side, [p, p]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the vertices of some lines go when they are rounded to whole numbers.
    fn rounded(lines: &[&[Xy]]) -> Vec<Vec<Xy>> {
        let points: Vec<Xy> = lines.concat();
        let mut starts = vec![0];
        lines.iter().for_each(|line| starts.push(starts[starts.len() - 1] + line.len()));
        let closed = vec![false; lines.len()];
        let chains = Chains { points: &points, starts: &starts, closed: &closed };
        let place = |at: Xy| at.map(f64::round);
        let rounded =
            round(&chains, &RetainedChainVertices::all(&chains), &[], place, None).unwrap();
        lines.iter().map(|line| line.iter().map(|at| rounded.of(*at)).collect()).collect()
    }

    #[test]
    fn what_has_room_is_rounded() {
        let line = [[0.1, 0.2], [10.4, 0.3], [20.6, 9.7]];
        assert_eq!(rounded(&[&line]), [[[0.0, 0.0], [10.0, 0.0], [21.0, 10.0]]]);
        // A dense line shrinks to few places.
        let dense: Vec<Xy> = (0..100).map(|i| [f64::from(i) * 0.07, 0.2]).collect();
        assert!(rounded(&[&dense])[0].iter().all(|[x, y]| x.fract() == 0.0 && *y == 0.0));
        // Lines that cross go on to cross.
        let cross = rounded(&[&[[0.1, 0.1], [9.9, 9.9]], &[[0.1, 9.9], [9.9, 0.1]]]);
        assert_eq!(cross, [[[0.0, 0.0], [10.0, 10.0]], [[0.0, 10.0], [10.0, 0.0]]]);
    }

    #[test]
    fn what_is_in_the_way_keeps_digits() {
        let floor = [[0.0, 0.0], [10.0, 0.0]];
        // A tip just above a segment would touch it.
        let tip = [[0.0, 5.0], [5.1, 0.4], [10.0, 5.0]];
        assert_eq!(rounded(&[&floor, &tip])[1][1], [5.1, 0.4]);
        // A point would change sides.
        let slope = [[0.0, 0.0], [10.0, 1.0]];
        assert_eq!(rounded(&[&slope, &[[5.4, 0.52]]])[1], [[5.4, 0.52]]);
        // A triangle in one cell does not vanish.
        let ring = rounded(&[&[[5.1, 5.1], [5.3, 5.1], [5.2, 5.3], [5.1, 5.1]]]).remove(0);
        assert!(ring[0] != ring[1] && ring[1] != ring[2] && ring[2] != ring[0], "{ring:?}");
    }

    #[test]
    fn a_ring_is_not_pinched_where_its_inlet_is_filled() {
        let mouth = [[4.8, 0.0], [5.2, 0.0]];
        let coast = [[0.0, 0.0], mouth[0], [3.0, 5.0], [7.0, 5.0], mouth[1], [9.0, 0.0]];
        let [_, lid] = &rounded(&[&coast, &mouth])[..] else { unreachable!() };
        assert_ne!(lid[0], lid[1]);
    }
}
