//! Which vertices of the original those of the result are, and how far off the others are.

use super::positions::FOREIGN;
use super::{Farthest, Question, Report};

/// Vertices at one position that are tried for one of the result; lines pass few positions so often.
const MOST_TRIED: usize = 8;

/// A segment of the result, and what it stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) part: u32,
    /// The segment's first vertex in the result.
    pub(super) first: u32,
    /// Vertices of the original, counted within the part; beyond its end a ring begins again.
    pub(super) from: u32,
    pub(super) to: u32,
}

/// A vertex of the original tried for one of the result.
#[derive(Clone, Copy, Debug)]
struct Node {
    at: u32,
    /// The largest distance up to here.
    worst: f64,
    /// The node before, in the list of all.
    back: u32,
}

/// Finds the vertices of the result in the original, in order and from any start of a ring; where a
/// position comes repeatedly, so that the largest distance is least. Measures distances.
pub(super) fn pieces(
    question: &Question<'_>,
    ids: &[Vec<u32>; 2],
    report: &mut Report,
) -> Vec<Piece> {
    let mut pieces = Vec::with_capacity(question.simplified.points.len());
    for part in 0..question.original.count() {
        let range = question.simplified.range(part);
        if range.is_empty() {
            continue;
        }
        let matching = Matching::new(question, ids, part);
        let Some(places) = matching.best() else {
            report.foreign.add(part, question.simplified.at(range.start));
            continue;
        };
        for (pair, first) in places.windows(2).zip(range.start as u32..) {
            let piece = Piece { part: part as u32, first, from: pair[0], to: pair[1] };
            matching.measure(piece, report);
            pieces.push(piece);
        }
    }
    pieces
}

struct Matching<'a> {
    question: &'a Question<'a>,
    part: usize,
    /// Positions of the original, a ring's last left out, and of the result.
    old: &'a [u32],
    new: &'a [u32],
    /// `(position, index)` of the original, sorted.
    places: Vec<(u32, u32)>,
}

impl<'a> Matching<'a> {
    fn new(question: &'a Question<'a>, ids: &'a [Vec<u32>; 2], part: usize) -> Self {
        let mut old = &ids[0][question.original.range(part)];
        let new = &ids[1][question.simplified.range(part)];
        if question.original.closed[part] && old.len() > 1 {
            old = &old[..old.len() - 1];
        }
        let mut places: Vec<(u32, u32)> = old.iter().copied().zip(0..).collect();
        places.sort_unstable();
        Self { question, part, old, new, places }
    }

    /// The indices of a position in the original.
    fn places_of(&self, id: u32) -> &[(u32, u32)] {
        let first = self.places.partition_point(|&(other, _)| other < id);
        let end = self.places.partition_point(|&(other, _)| other <= id);
        &self.places[first..end]
    }

    /// A vertex of the original; a ring goes on from its beginning.
    fn vertex(&self, index: u32) -> [f64; 3] {
        let start = self.question.original.range(self.part).start;
        self.question.original.points[start + index as usize % self.old.len()]
    }

    /// The best match from any start.
    fn best(&self) -> Option<Vec<u32>> {
        if self.new.contains(&FOREIGN) || self.old.is_empty() {
            return None;
        }
        let is_ring = self.question.original.closed[self.part];
        let last = self.old.len() as u32 - 1;
        let starts: Vec<u32> = match is_ring {
            true => self.places_of(self.new[0]).iter().map(|p| p.1).take(MOST_TRIED).collect(),
            false => vec![0],
        };
        let tried = starts
            .into_iter()
            .filter_map(|start| self.from(start, if is_ring { start + last + 1 } else { last }));
        tried.min_by(|p, q| p.0.total_cmp(&q.0)).map(|(_, places)| places)
    }

    /// The best match from one vertex of the original to another, and its largest distance.
    fn from(&self, start: u32, end: u32) -> Option<(f64, Vec<u32>)> {
        let count = self.old.len() as u32;
        let mut nodes = vec![Node { at: start, worst: 0.0, back: 0 }];
        let mut layer = 0..1;
        if self.new[0] != self.old[start as usize] {
            return None;
        }
        for (j, &id) in self.new.iter().enumerate().skip(1) {
            let is_last = j + 1 == self.new.len();
            let after = nodes[layer.clone()].iter().map(|node| node.at).min()?;
            let candidates = self.places_of(id).iter().flat_map(|p| [p.1, p.1 + count]);
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
        let is_point = self.new.len() == 1 && self.old.iter().all(|&id| id == self.new[0]);
        if nodes[at].at != end && !is_point {
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
    fn farthest(&self, from: u32, to: u32) -> (f64, u32) {
        let (a, b) = (self.vertex(from), self.vertex(to));
        let off = |v: u32| self.question.distance.of(self.vertex(v), a, b);
        (from + 1..to).fold((0.0, from), |most, v| {
            let off = off(v);
            if off > most.0 { (off, v) } else { most }
        })
    }

    fn measure(&self, piece: Piece, report: &mut Report) {
        let (distance, vertex) = self.farthest(piece.from, piece.to);
        let place = |v: u32| [self.vertex(v)[0], self.vertex(v)[1]];
        if piece.to - piece.from > 1 && report.farthest.is_none_or(|f| distance > f.distance) {
            report.farthest = Some(Farthest { distance, part: self.part, at: place(vertex) });
        }
        let Some(tolerance) = self.question.tolerance.filter(|&t| distance > t) else { return };
        let (a, b) = (self.vertex(piece.from), self.vertex(piece.to));
        for v in piece.from + 1..piece.to {
            if self.question.distance.of(self.vertex(v), a, b) > tolerance {
                report.beyond.add(self.part, place(v));
            }
        }
    }
}
