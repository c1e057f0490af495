//! Matching of the vertices of the result with those of the original.

use super::exact::Xy;
use super::measure::ProofDistance;

/// Vertices at one position that are tried for one of the result. If the tolerance is exceeded, more are tried,
/// and all those of a short part.
const FEW_TRIED: usize = 8;
const MANY_TRIED: usize = 64;
const SHORT: usize = 512;

/// A vertex of the original tried for one of the result.
#[derive(Clone, Copy, Debug)]
struct MatchingNode {
    at: u32,
    /// The largest distance up to here.
    worst: f64,
    /// The node before, in the list of all.
    back: u32,
}

/// A position, height and measure as bits that are the same for the same numbers, -0 and 0 among them.
type Key = [u64; 4];

fn bits(value: f64) -> u64 {
    if value.is_nan() { f64::NAN.to_bits() } else { (value + 0.0).to_bits() }
}

fn is_same(p: &[f64; 2], q: &[f64; 2]) -> bool {
    p.map(bits) == q.map(bits)
}

/// The vertices of a part.
#[derive(Clone, Copy, Debug, Default)]
pub struct PartVertices<'a> {
    /// x, y and z; z is 0 where there is none.
    pub points: &'a [[f64; 3]],
    /// Heights and measures to be compared with the original, NaN where there is none; empty without a
    /// comparison.
    pub extras: &'a [[f64; 2]],
    /// The outer ring of a hole, where that ring is missing.
    pub outer: &'a [[f64; 3]],
}

impl<'a> PartVertices<'a> {
    /// Vertices whose heights and measures are not compared.
    pub fn of(points: &'a [[f64; 3]]) -> Self {
        Self { points, ..Self::default() }
    }
}

/// A part of the result.
#[derive(Debug)]
pub(super) struct ResultPart {
    pub(super) points: Vec<[f64; 3]>,
    /// As in [`PartVertices`].
    pub(super) extras: Vec<[f64; 2]>,
    /// Vertices match only with equal heights and measures.
    pub(super) with_extras: bool,
}

impl ResultPart {
    /// The keys of vertices, whose heights and measures may be missing.
    fn keys(&self, points: &[[f64; 3]], extras: &[[f64; 2]]) -> impl Iterator<Item = Key> {
        points.iter().enumerate().map(move |(at, point)| {
            let extras = extras.get(at).filter(|_| self.with_extras);
            let [z, m] = extras.copied().unwrap_or_default();
            [point[0], point[1], z, m].map(bits)
        })
    }
}

/// A part of the result and its original.
pub(super) struct PartMatching<'a> {
    distance: ProofDistance,
    /// Vertices of the original, a ring's last left out.
    old: &'a [[f64; 3]],
    result: ResultPart,
    /// Keys of the vertices of the result; a ring begins and ends with the vertex that is rarest in the original,
    /// number `first` of the result.
    new: Vec<Key>,
    first: usize,
    is_ring: bool,
    /// Keys and indices of the vertices of the original, sorted.
    places: Vec<(Key, u32)>,
}

impl<'a> PartMatching<'a> {
    /// O(n log n).
    pub(super) fn new(
        distance: ProofDistance,
        before: PartVertices<'a>,
        result: ResultPart,
        is_ring: bool,
    ) -> Self {
        let all = before.points;
        let old = if is_ring && all.len() > 1 { &all[..all.len() - 1] } else { all };
        let mut places: Vec<(Key, u32)> = result.keys(old, before.extras).zip(0..).collect();
        places.sort_unstable();
        let mut new: Vec<Key> = result.keys(&result.points, &result.extras).collect();
        let mut first = 0;
        if is_ring && new.len() > 1 {
            new.pop();
            let rarest = (0..new.len()).min_by_key(|&at| places_of(&places, &new[at]).len());
            first = rarest.unwrap_or(0);
            new.rotate_left(first);
            new.push(new[0]);
        }
        Self { distance, old, result, new, first, is_ring, places }
    }

    /// The indices of a vertex of the result in the original.
    fn places_of(&self, key: &Key) -> &[(Key, u32)] {
        places_of(&self.places, key)
    }

    /// A vertex of the original; a ring goes on from its beginning.
    pub(super) fn vertex(&self, index: u32) -> [f64; 3] {
        self.old[self.wrapped(index)]
    }

    fn wrapped(&self, index: u32) -> usize {
        let index = index as usize;
        if index < self.old.len() { index } else { index - self.old.len() }
    }

    /// The vertices of the result.
    pub(super) fn new_points(&self) -> &[[f64; 3]] {
        &self.result.points
    }

    /// The largest distance and, for each vertex of the result in order, its index in the original; a ring may
    /// begin anywhere, and indices continue beyond its end. Where positions repeat, the match minimizes the
    /// largest distance, unless the first one found is within the tolerance; without a choice the distance is
    /// 0. `None` if the result does not match.
    pub(super) fn best(&self, tolerance: Option<f64>) -> Option<(f64, Vec<u32>)> {
        if self.old.is_empty() {
            return None;
        }
        if self.places.windows(2).all(|pair| pair[0].0 != pair[1].0) {
            return self.only().map(|places| (0.0, places));
        }
        if let Some(places) = self.rotated() {
            return Some((0.0, places));
        }
        let found = self.tried(FEW_TRIED);
        let is_enough = found
            .as_ref()
            .is_some_and(|(worst, _)| tolerance.is_none_or(|tolerance| *worst <= tolerance));
        let max_tried = if self.old.len() <= SHORT { 2 * SHORT } else { MANY_TRIED };
        if is_enough { found } else { self.tried(max_tried).or(found) }
    }

    /// The match of a ring of which nothing was left out. O(n).
    fn rotated(&self) -> Option<Vec<u32>> {
        let count = self.old.len();
        if !self.is_ring || self.new.len() != count + 1 {
            return None;
        }
        let mut old = vec![Key::default(); count];
        self.places.iter().for_each(|(key, at)| old[*at as usize] = *key);
        let new = &self.new[..count];
        // For each prefix of the ring, its longest proper suffix that is a prefix, too.
        let mut borders = vec![0; count];
        for at in 1..count {
            borders[at] = next_match(new, &borders, borders[at - 1], &new[at]);
        }
        let mut length = 0;
        // Twice around the original, so that every start is met (Knuth, Morris & Pratt 1977): linear, where a
        // comparison from each start is quadratic for rings that come to positions again and again.
        for at in 0..2 * count {
            length = next_match(new, &borders, length, &old[at % count]);
            if length == count {
                let start = (at + 1 - count) as u32;
                return Some((start..=start + count as u32).collect());
            }
        }
        None
    }

    /// The best match that tries at most `max_tried` vertices at one position.
    fn tried(&self, max_tried: usize) -> Option<(f64, Vec<u32>)> {
        let last = (self.old.len() as u32).checked_sub(1)?;
        let starts: Vec<u32> = match self.is_ring {
            true => self.places_of(&self.new[0]).iter().map(|p| p.1).take(max_tried).collect(),
            false => vec![0],
        };
        let tried = starts.into_iter().filter_map(|start| {
            self.from(start, if self.is_ring { start + last + 1 } else { last }, max_tried)
        });
        tried.min_by(|p, q| p.0.total_cmp(&q.0))
    }

    /// Positions of changed heights and measures.
    pub(super) fn changed(&self, places: &[u32], before: PartVertices<'_>) -> Vec<Xy> {
        let ResultPart { points, extras, .. } = &self.result;
        let count = if self.is_ring { points.len() - 1 } else { points.len() };
        let mut changed: Vec<usize> = (0..count)
            .filter(|at| {
                let place = places[(at + count - self.first) % count];
                !is_same(&extras[*at], &before.extras[self.wrapped(place)])
            })
            .collect();
        let [first, last] = ends(extras);
        // A ring is closed in height, unless the original is not and begins there, too.
        if self.is_ring && !is_same(&first, &last) {
            let begins_there = (0..2).all(|k| points[0][k] == before.points[0][k]);
            let [old_first, old_last] = ends(before.extras);
            if !(begins_there && is_same(&first, &old_first) && is_same(&last, &old_last)) {
                changed.push(count);
            }
        }
        changed.into_iter().map(|at| [points[at][0], points[at][1]]).collect()
    }

    /// The only match of a part without repeated positions.
    fn only(&self) -> Option<Vec<u32>> {
        let count = self.old.len() as u32;
        let mut places: Vec<u32> = Vec::with_capacity(self.new.len());
        for vertex in &self.new {
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
        self.new.len() == 1 && self.places.iter().all(|(key, _)| *key == self.new[0])
    }

    /// The largest distance of the best match from one vertex of the original to another, and the match.
    fn from(&self, start: u32, end: u32, max_tried: usize) -> Option<(f64, Vec<u32>)> {
        let count = self.old.len() as u32;
        let mut nodes = vec![MatchingNode { at: start, worst: 0.0, back: 0 }];
        let mut layer = 0..1;
        if self.places_of(&self.new[0]).iter().all(|place| place.1 != start) {
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
            candidates.truncate(max_tried);
            let next = nodes.len();
            nodes.extend(self.reached(&nodes[layer.clone()], layer.start, &candidates));
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

    /// The candidates, all at one position, that are reachable from a layer of nodes at one position, each with
    /// its best predecessor; `first` is the number of the first node of the layer. O(n).
    fn reached(
        &self,
        layer: &[MatchingNode],
        first: usize,
        candidates: &[u32],
    ) -> Vec<MatchingNode> {
        let mut all: Vec<MatchingNode> = candidates
            .iter()
            .map(|&at| MatchingNode { at, worst: f64::INFINITY, back: u32::MAX })
            .collect();
        let from = self.heights(layer.iter().map(|node| node.at));
        let to = self.heights(candidates.iter().copied());
        for (&a, &b) in from.iter().flat_map(|a| to.iter().map(move |b| (a, b))) {
            self.sweep(layer, first, [a, b], &mut all);
        }
        all.retain(|node| node.back != u32::MAX);
        all
    }

    /// Walks along the original from the first node of a layer to the last candidate, and joins nodes at `a`
    /// with candidates at `b`: all have the same segment, so the largest distance is updated incrementally.
    fn sweep(
        &self,
        layer: &[MatchingNode],
        first: usize,
        [a, b]: [[f64; 3]; 2],
        all: &mut [MatchingNode],
    ) {
        let (mut left, mut next) =
            ((first as u32..).zip(layer).peekable(), all.iter_mut().peekable());
        let mut best: Option<(f64, u32)> = None;
        for at in layer[0].at.. {
            if let Some(node) = next.next_if(|node| node.at == at)
                && self.place(at) == b
                && let Some((worst, back)) = best.filter(|best| best.0 < node.worst)
            {
                (node.worst, node.back) = (worst, back);
            }
            if next.peek().is_none() {
                return;
            }
            if let Some((worst, _)) = &mut best {
                *worst = worst.max(self.distance.of(self.vertex(at), a, b));
            }
            let node = left.next_if(|(_, node)| node.at == at).filter(|_| self.place(at) == a);
            if let Some((back, node)) =
                node.filter(|(_, node)| best.is_none_or(|best| node.worst < best.0))
            {
                best = Some((node.worst, back));
            }
        }
    }

    /// The places of vertices, each once.
    fn heights(&self, vertices: impl Iterator<Item = u32>) -> Vec<[f64; 3]> {
        let mut places = Vec::new();
        for place in vertices.map(|at| self.place(at)) {
            if !places.contains(&place) {
                places.push(place);
            }
        }
        places
    }

    /// The coordinates of a vertex that count in distances.
    fn place(&self, at: u32) -> [f64; 3] {
        let [x, y, z] = self.vertex(at);
        [x, y, if self.distance == ProofDistance::Space { z } else { 0.0 }]
    }

    /// The largest distance strictly between two vertices, and the vertex that has it.
    pub(super) fn farthest(&self, from: u32, to: u32) -> (f64, u32) {
        let (a, b) = (self.vertex(from), self.vertex(to));
        (from + 1..to).fold((0.0, from), |farthest, v| {
            let distance = self.distance.of(self.vertex(v), a, b);
            if distance > farthest.0 { (distance, v) } else { farthest }
        })
    }
}

/// The length of the prefix of `pattern` that is matched after one more key, when `length` were matched before.
fn next_match(pattern: &[Key], borders: &[usize], mut length: usize, key: &Key) -> usize {
    while length > 0 && pattern[length] != *key {
        length = borders[length - 1];
    }
    length + usize::from(pattern[length] == *key)
}

/// The first and the last of some heights and measures.
fn ends(extras: &[[f64; 2]]) -> [[f64; 2]; 2] {
    [extras[0], extras[extras.len() - 1]]
}

fn places_of<'a>(places: &'a [(Key, u32)], key: &Key) -> &'a [(Key, u32)] {
    let first = places.partition_point(|(other, _)| other < key);
    let count = places[first..].iter().take_while(|(other, _)| other == key).count();
    &places[first..first + count]
}
