//! Simplification of closed rings, which have no fixed end vertex.
//!
//! A ring is given with its closing vertex, and returned without it as ascending indices of kept vertices.
//! Every method starts from the vertex that is lowest in x, then y, then z: it is on the convex hull, and does
//! not depend on the given start.
//!
//! - Ramer-Douglas-Peucker splits first at the vertex farthest from that one, so it is anchored at two
//!   vertices far apart.
//! - The cone and Imai-Iri may drop the start as well: once a ring is closed, the part around the start
//!   is done again, from a vertex kept before it to one kept after it. The result never has more vertices,
//!   and where it was the fewest between those two, it is now the fewest that pass through them: near the
//!   fewest of all, which would need a search from every vertex that one segment can pass over.
//! - Visvalingam-Whyatt needs no start.
//!
//! A ring *collapses* if fewer than three vertices would be left. The result is then the start, the vertex
//! farthest from it, the vertex farthest from the segment between them, and the vertices required by the
//! tolerance; the caller decides about its use.

use super::metric::DistanceMetric;
use super::rdp::rdp;
use super::regions::{VertexRegions, farthest_beyond};
use super::scratch::SimplifyScratch;
use super::visvalingam::{AreaWeight, EffectiveAreas};

/// Result of a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingFate {
    /// At least three vertices are required.
    Kept,
    /// Fewer would suffice; the returned ring is minimal. It has fewer than three vertices only if the input
    /// had fewer distinct positions.
    Collapsed,
}

/// Kept vertices on either side of the start between which the ring is simplified again.
const AROUND: usize = 64;

/// Simplifies a ring, first and last vertex the same, with a method for lines.
///
/// `can_move` allows dropping the start: true for all methods except those that split.
pub fn simplify<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    ring: &[V],
    tolerance: f64,
    can_move: bool,
    mut method: impl FnMut(&[V], &mut SimplifyScratch, &mut Vec<u32>),
    scratch: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) -> RingFate {
    let count = ring.len().saturating_sub(1);
    if count < 3 {
        kept.extend(0..count as u32);
        return RingFate::Collapsed;
    }
    let start = lowest::<V, M>(&ring[..count]);
    let line = unrolled(ring, start, start + count);
    let mut chosen = Vec::new();
    method(&line, scratch, &mut chosen);
    chosen.pop();
    if can_move && chosen.len() > 3 {
        let before = chosen.len();
        let moved = around_start(&line, &chosen, |part, kept| method(part, scratch, kept));
        if moved.len() <= before {
            chosen = moved;
        }
    }
    let fate = if chosen.len() < 3 { RingFate::Collapsed } else { RingFate::Kept };
    if fate == RingFate::Collapsed {
        chosen = minimal(metric, &line, tolerance, scratch);
    }
    let from = kept.len();
    kept.extend(chosen.iter().map(|i| ((*i as usize + start) % count) as u32));
    kept[from..].sort_unstable();
    fate
}

/// Visvalingam-Whyatt on a ring: drops vertices with an effective area of at most `area`.
///
/// A ring collapses when three vertices are left and their triangle has at most that area.
pub fn visvalingam<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    ring: &[V],
    area: f64,
    weight: AreaWeight,
    kept: &mut Vec<u32>,
) -> RingFate {
    let count = ring.len().saturating_sub(1);
    let from = kept.len();
    EffectiveAreas::of_ring(metric, &ring[..count], weight).filter(area, kept);
    match kept[from..] {
        [a, b, c] => {
            let [a, b, c] = [a, b, c].map(|i| &ring[i as usize]);
            if metric.area(a, b, c) <= area { RingFate::Collapsed } else { RingFate::Kept }
        }
        [] | [_] | [_, _] => RingFate::Collapsed,
        _ => RingFate::Kept,
    }
}

/// The first of the vertices that are lowest by x, y and z.
fn lowest<V: Copy, M: DistanceMetric<V>>(points: &[V]) -> usize {
    let mut lowest = 0;
    for i in 1..points.len() {
        if M::coordinates(&points[i]) < M::coordinates(&points[lowest]) {
            lowest = i;
        }
    }
    lowest
}

/// The vertices from `from` to `to`, both included, round the ring.
fn unrolled<V: Copy>(ring: &[V], from: usize, to: usize) -> Vec<V> {
    let count = ring.len() - 1;
    (from..=to).map(|i| ring[i % count]).collect()
}

/// Simplifies the part around the start again, from a kept vertex before it to one after it.
fn around_start<V: Copy>(
    line: &[V],
    chosen: &[u32],
    mut method: impl FnMut(&[V], &mut Vec<u32>),
) -> Vec<u32> {
    let count = line.len() - 1;
    let reach = (chosen.len() / 2).min(AROUND);
    let (first, last) = (chosen[reach], chosen[chosen.len() - reach]);
    let part = unrolled(line, last as usize, first as usize + count);
    let mut again = Vec::new();
    method(&part, &mut again);
    again.pop();
    let inner = again.iter().map(|i| ((i + last) as usize % count) as u32);
    let mut moved: Vec<u32> = inner.collect();
    moved.extend(&chosen[reach..chosen.len() - reach]);
    moved
}

/// The start of a closed line, the vertex farthest from it, the vertex farthest from their segment, and the
/// vertices required by the tolerance between them.
fn minimal<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    line: &[V],
    tolerance: f64,
    scratch: &mut SimplifyScratch,
) -> Vec<u32> {
    let last = line.len() - 1;
    let tree = VertexRegions::new::<V, M>(line);
    let mut corners = vec![0, last];
    if let Some((far, _)) = farthest(metric, line, &tree, 0, last) {
        corners.push(far);
        let sides =
            [(0, far), (far, last)].map(|(from, to)| farthest(metric, line, &tree, from, to));
        let [first, second] = sides.map(|side| side.map_or(-1.0, |(_, square)| square));
        let widest = if second > first { sides[1] } else { sides[0] };
        corners.extend(widest.map(|(third, _)| third));
    }
    corners.sort_unstable();
    let mut chosen = Vec::new();
    for pair in corners.windows(2) {
        let at = chosen.len();
        rdp(metric, &line[pair[0]..=pair[1]], tolerance, scratch, &mut chosen);
        chosen[at..].iter_mut().for_each(|i| *i += pair[0] as u32);
        chosen.pop();
    }
    chosen
}

/// The vertex farthest from the segment between two others, and its squared distance; `None` if all lie on it.
fn farthest<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    line: &[V],
    tree: &VertexRegions<M::Region>,
    from: usize,
    to: usize,
) -> Option<(usize, f64)> {
    let segment = metric.segment(&line[from], &line[to]);
    farthest_beyond::<V, M>(&segment, line, tree, from + 1, to, 0.0)
}
