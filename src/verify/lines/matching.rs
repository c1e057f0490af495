//! Which vertices of the original those of the result are.

use super::Distance;

/// Vertices at one position that are tried for one of the result; lines pass few positions so often.
const MOST_TRIED: usize = 8;

/// A vertex of the original tried for one of the result.
#[derive(Clone, Copy, Debug)]
struct Node {
    at: u32,
    /// The largest distance up to here.
    worst: f64,
    /// The node before, in the list of all.
    back: u32,
}

/// A position as bits that are the same for the same numbers, -0 and 0 among them.
type Key = [u64; 2];

fn key(p: &[f64; 3]) -> Key {
    [p[0], p[1]].map(|v| (v + 0.0).to_bits())
}

/// A part, and the one it was made from.
pub(super) struct Matching<'a> {
    distance: Distance,
    /// Vertices of the original, a ring's last left out, and of the result.
    old: &'a [[f64; 3]],
    new: &'a [[f64; 3]],
    is_ring: bool,
    /// Where which position is in the original, sorted.
    places: Vec<(Key, u32)>,
}

impl<'a> Matching<'a> {
    /// O(n log n).
    pub(super) fn new(
        distance: Distance,
        before: &'a [[f64; 3]],
        new: &'a [[f64; 3]],
        is_ring: bool,
    ) -> Self {
        let old = if is_ring && before.len() > 1 { &before[..before.len() - 1] } else { before };
        let mut places: Vec<(Key, u32)> = old.iter().map(key).zip(0..).collect();
        places.sort_unstable();
        Self { distance, old, new, is_ring, places }
    }

    /// The indices of a position in the original.
    fn places_of(&self, at: &[f64; 3]) -> &[(Key, u32)] {
        let key = key(at);
        let first = self.places.partition_point(|&(other, _)| other < key);
        let count = self.places[first..].iter().take_while(|&&(other, _)| other == key).count();
        &self.places[first..first + count]
    }

    /// A vertex of the original; a ring goes on from its beginning.
    pub(super) fn vertex(&self, index: u32) -> [f64; 3] {
        let index = index as usize;
        self.old[if index < self.old.len() { index } else { index - self.old.len() }]
    }

    /// The vertices of the original that those of the result are, in order and from any start of a ring;
    /// where a position comes repeatedly, so that the largest distance is least. Beyond its end a ring
    /// begins again. `None` when the result was not made from it.
    pub(super) fn best(&self) -> Option<Vec<u32>> {
        let last = (self.old.len() as u32).checked_sub(1)?;
        if self.places.windows(2).all(|pair| pair[0].0 != pair[1].0) {
            return self.only();
        }
        let starts: Vec<u32> = match self.is_ring {
            true => self.places_of(&self.new[0]).iter().map(|p| p.1).take(MOST_TRIED).collect(),
            false => vec![0],
        };
        let tried = starts.into_iter().filter_map(|start| {
            self.from(start, if self.is_ring { start + last + 1 } else { last })
        });
        tried.min_by(|p, q| p.0.total_cmp(&q.0)).map(|(_, places)| places)
    }

    /// The one match of a part that comes to no position twice.
    fn only(&self) -> Option<Vec<u32>> {
        let count = self.old.len() as u32;
        let mut places: Vec<u32> = Vec::with_capacity(self.new.len());
        for vertex in self.new {
            let at = self.places_of(vertex).first()?.1;
            let is_back = places.last().is_some_and(|&before| at <= before);
            places.push(if self.is_ring && is_back { at + count } else { at });
        }
        let [from, to] = [places[0], places[places.len() - 1]];
        let is_whole = match self.is_ring {
            true => to == from + count || self.is_point(),
            false => from == 0 && to + 1 == count,
        };
        (is_whole && places.windows(2).all(|pair| pair[0] < pair[1])).then_some(places)
    }

    /// One position, before and after.
    fn is_point(&self) -> bool {
        self.new.len() == 1 && self.old.iter().all(|p| key(p) == key(&self.new[0]))
    }

    /// The best match from one vertex of the original to another, and its largest distance.
    fn from(&self, start: u32, end: u32) -> Option<(f64, Vec<u32>)> {
        let count = self.old.len() as u32;
        let mut nodes = vec![Node { at: start, worst: 0.0, back: 0 }];
        let mut layer = 0..1;
        if key(&self.new[0]) != key(&self.old[start as usize]) {
            return None;
        }
        for (j, vertex) in self.new.iter().enumerate().skip(1) {
            let is_last = j + 1 == self.new.len();
            let after = nodes[layer.clone()].iter().map(|node| node.at).min()?;
            let candidates = self.places_of(vertex).iter().flat_map(|p| [p.1, p.1 + count]);
            let mut candidates: Vec<u32> = candidates
                .filter(|&at| at > after && if is_last { at == end } else { at < end })
                .collect();
            candidates.sort_unstable();
            candidates.truncate(MOST_TRIED);
            let next = nodes.len();
            for at in candidates {
                let best = self.reach(&nodes, layer.clone(), at);
                nodes.extend(best);
            }
            layer = next..nodes.len();
        }
        let mut at = layer.min_by(|&p, &q| nodes[p].worst.total_cmp(&nodes[q].worst))?;
        if nodes[at].at != end && !self.is_point() {
            return None;
        }
        let (worst, mut places) = (nodes[at].worst, vec![nodes[at].at]);
        for _ in 1..self.new.len() {
            at = nodes[at].back as usize;
            places.push(nodes[at].at);
        }
        places.reverse();
        Some((worst, places))
    }

    /// The node at `at` that comes best from one of a layer.
    fn reach(&self, nodes: &[Node], layer: std::ops::Range<usize>, at: u32) -> Option<Node> {
        let ways = layer.filter(|&k| nodes[k].at < at).map(|k| {
            let off = self.farthest(nodes[k].at, at).0;
            Node { at, worst: nodes[k].worst.max(off), back: k as u32 }
        });
        ways.min_by(|p, q| p.worst.total_cmp(&q.worst))
    }

    /// The largest distance strictly between two vertices, and whose it is.
    pub(super) fn farthest(&self, from: u32, to: u32) -> (f64, u32) {
        let (a, b) = (self.vertex(from), self.vertex(to));
        let off = |v: u32| self.distance.of(self.vertex(v), a, b);
        (from + 1..to).fold((0.0, from), |most, v| {
            let off = off(v);
            if off > most.0 { (off, v) } else { most }
        })
    }
}
