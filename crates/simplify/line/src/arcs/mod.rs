//! Coverages: detection of shared borders, which are cut at junctions and stored once.
//!
//! Parts are rings and lines of any number of layers. Vertices at one position are identical. A *junction* is a
//! position that parts do not all pass in the same way (with the same two neighbours, in either direction), a
//! position where a part turns back on itself, or an end of a line. This is the rule of TopoJSON (Bostock
//! 2013), extended by turning points. An *arc* is the part between two junctions; arcs with the same vertices,
//! forward or backward, are identical. A ring without a junction is one arc that starts at its lowest vertex
//! (x, then y), so equal rings with different starts are one arc. Each arc is simplified once; junctions stay,
//! and neighbours have identical borders.

mod bins;
mod cut;
mod snapping;
#[cfg(test)]
mod tests;

pub use cut::{ArcPassage, CoverageArcs};

use terrane_base::error::{Error, Result};
use terrane_base::geom::plane::Xy;

use super::topology::{Chains, RetainedChainVertices, open_at};
use cut::cut;

/// Reassembled parts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JoinedParts {
    /// Vertices of [`CoverageArcs`], part by part; rings end with their first vertex.
    pub vertices: Vec<u32>,
    /// Start of each part in `vertices`, and the total number.
    pub starts: Vec<usize>,
}

/// Snaps positions within `distance`, as [`CoverageArcs::new`]; `anchors` are fixed and have priority.
///
/// # Errors
/// `Usage` for a distance that is not positive and finite.
pub fn snap(points: &mut [Xy], anchors: &[Xy], distance: f64) -> Result<()> {
    if !(distance > 0.0 && distance.is_finite()) {
        return Err(Error::usage(format!("snap distance {distance} is not positive and finite")));
    }
    snapping::snap(points, anchors, distance);
    Ok(())
}

impl CoverageArcs {
    /// Cuts parts into arcs. Consecutive duplicate vertices are dropped. With a positive `snap` distance,
    /// positions are snapped first: in order of x, then y, a position moves to the lowest fixed position before
    /// it within the distance, if any.
    ///
    /// O(n log n) at worst and O(n) for spread positions; about 40 bytes per vertex temporarily, and 20 per
    /// vertex of an arc.
    ///
    /// # Errors
    /// Errors of [`Chains::check`]; `Usage` for a negative or infinite snap distance; `Limit` for 2^31 arcs or
    /// more.
    pub fn new(parts: &Chains<'_>, snap: f64) -> Result<Self> {
        parts.check()?;
        if snap == 0.0 {
            return cut(parts);
        }
        let mut points = parts.points.to_vec();
        self::snap(&mut points, &[], snap)?;
        cut(&Chains { points: &points, ..*parts })
    }

    /// The arcs as chains for simplification.
    pub fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }

    /// Rotates a [free](Self::free) arc to start at vertex `at`.
    pub fn open_at(&mut self, arc: usize, at: usize) {
        let range = self.starts[arc]..self.starts[arc + 1];
        open_at(&mut self.points[range.clone()], at);
        open_at(&mut self.sources[range], at);
    }

    /// Parts from the kept vertices of arcs. A ring starts with its first arc. O(output).
    pub fn rebuild(&self, kept: &RetainedChainVertices) -> JoinedParts {
        let mut parts =
            JoinedParts { vertices: Vec::with_capacity(kept.vertices.len()), starts: vec![0] };
        for pair in self.parts.windows(2) {
            let start = parts.vertices.len();
            for passage in &self.passages[pair[0]..pair[1]] {
                let vertices = kept.of(passage.arc());
                // All but the first arc begin where the one before them ends.
                let skip = usize::from(parts.vertices.len() > start && !vertices.is_empty());
                match passage.is_backward() {
                    false => parts.vertices.extend(&vertices[skip..]),
                    true => parts.vertices.extend(vertices.iter().rev().skip(skip)),
                }
            }
            parts.starts.push(parts.vertices.len());
        }
        parts
    }

    /// Fills `out` with the kept indices, ascending, of a part's `own` vertices (a ring without its closing
    /// vertex). Of consecutive duplicates the first index is used, at the end of a line the last. O(vertices of
    /// the part).
    pub fn own(
        &self,
        part: usize,
        own: &[Xy],
        is_ring: bool,
        kept: &RetainedChainVertices,
        out: &mut Vec<u32>,
    ) {
        out.clear();
        let passages = &self.passages[self.parts[part]..self.parts[part + 1]];
        let [first, ..] = passages else { return };
        let way = without_repeats(own, is_ring);
        let range =
            |passage: &ArcPassage| self.starts[passage.arc()]..self.starts[passage.arc() + 1];
        let begin = if first.is_backward() { range(first).end - 1 } else { range(first).start };
        let start = way.iter().position(|at| own[*at as usize] == self.points[begin]);
        let mut steps = start.unwrap_or_default();
        for (number, passage) in passages.iter().enumerate() {
            let (start, last) = (range(passage).start, range(passage).len() - 1);
            // Where one ends, the next one begins; a ring's first with its last.
            let has_end = last == 0 || (!is_ring && number + 1 == passages.len());
            for &vertex in kept.of(passage.arc()) {
                let step = vertex as usize - start;
                let step = if passage.is_backward() { last - step } else { step };
                if step < last || has_end {
                    out.push(way[(steps + step) % way.len()]);
                }
            }
            steps += last;
        }
        if let ([0], false, 2..) = (&out[..], is_ring, own.len()) {
            out.push(own.len() as u32 - 1);
        }
        out.sort_unstable();
    }
}

/// Indices of a part's vertices, one per run of duplicates, without the closing vertex of a ring.
fn without_repeats(own: &[Xy], is_ring: bool) -> Vec<u32> {
    let is_new = |at: &u32| *at == 0 || own[*at as usize] != own[*at as usize - 1];
    let mut way: Vec<u32> = (0..own.len() as u32).filter(is_new).collect();
    match way[..] {
        [] | [_] => {}
        [.., last] if is_ring && own[last as usize] == own[0] => {
            way.pop();
        }
        [.., ref mut last] => *last = own.len() as u32 - 1,
    }
    way
}
