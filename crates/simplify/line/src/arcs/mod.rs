//! Coverages: borders that parts share, found, cut where they meet, and kept once.
//!
//! Parts are rings and lines of any number of layers. Vertices at one position are one. A *junction* is
//! a position that parts do not all pass in the same way: not with the same two neighbours before and
//! after it, in either direction; where one turns back on itself; and each end of a line. This is the rule
//! of TopoJSON (Bostock 2013), but for the turning points, of which it makes nothing.
//! An *arc* is what lies between two junctions of a part; arcs of the same vertices, forward or
//! backward, are one. A ring without a junction is an arc by itself that begins at its lowest vertex
//! (x, then y), so rings that are the same from different starts are one arc. What is simplified are
//! arcs, each once; junctions stay, and neighbours have the same border, bit for bit.

mod bins;
mod cut;
mod snap;
#[cfg(test)]
mod tests;

pub use cut::{ArcPassage, CoverageArcs};

use terrane_base::error::{Error, Result};
use terrane_base::geom::plane::Xy;

use super::topology::{Chains, KeptChainVertices, open_at};
use cut::cut;

/// Parts put together again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JoinedParts {
    /// Numbers of vertices of [`CoverageArcs`], part by part; rings end with the vertex they begin with.
    pub vertices: Vec<u32>,
    /// Where each part's begin in `vertices`, and at the end how many there are.
    pub starts: Vec<usize>,
}

/// Moves positions onto others no farther than `distance`, as [`CoverageArcs::new`] does; `anchors` have stayed
/// before all of them.
///
/// # Errors
/// `Usage` for a distance that is not above 0 and finite.
pub fn snap(points: &mut [Xy], anchors: &[Xy], distance: f64) -> Result<()> {
    if !(distance > 0.0 && distance.is_finite()) {
        return Err(Error::usage(format!("snap distance {distance} is not positive and finite")));
    }
    snap::snap(points, anchors, distance);
    Ok(())
}

impl CoverageArcs {
    /// Cuts parts into arcs. A vertex that repeats the one before it is dropped. With a `snap`
    /// distance above 0, positions no farther apart are made the same first: taken from the lowest on
    /// (x, then y), one moves to the lowest before it that stayed, if any is so near.
    ///
    /// O(n log n) at worst and O(n) for positions that are spread out; about 40 bytes a vertex in
    /// passing, and 20 a vertex of an arc.
    ///
    /// # Errors
    /// Those of [`Chains::check`]; `Usage` for a snap distance that is negative or not finite; `Limit`
    /// for 2^31 arcs and more.
    pub fn new(parts: &Chains<'_>, snap: f64) -> Result<Self> {
        parts.check()?;
        if snap == 0.0 {
            return cut(parts);
        }
        let mut points = parts.points.to_vec();
        self::snap(&mut points, &[], snap)?;
        cut(&Chains { points: &points, ..*parts })
    }

    /// The arcs as chains to be simplified.
    pub fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }

    /// Lets an arc that is [free](Self::free) begin at another of its vertices, `at` from its first.
    pub fn open_at(&mut self, arc: usize, at: usize) {
        let range = self.starts[arc]..self.starts[arc + 1];
        open_at(&mut self.points[range.clone()], at);
        open_at(&mut self.sources[range], at);
    }

    /// The parts, of what is kept of the arcs. A ring begins with its first arc. O(output).
    pub fn rebuild(&self, kept: &KeptChainVertices) -> JoinedParts {
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

    /// Fills `out` with what a part keeps of its `own` vertices, of a ring without the last one, which
    /// is its first again: indices, ascending. Of vertices that repeat each other it is the first, but
    /// at the end of a line the last. O(vertices of the part).
    pub fn own(
        &self,
        part: usize,
        own: &[Xy],
        is_ring: bool,
        kept: &KeptChainVertices,
        out: &mut Vec<u32>,
    ) {
        out.clear();
        let passages = &self.passages[self.parts[part]..self.parts[part + 1]];
        let [first, ..] = passages else { return };
        let way = without_repeats(own, is_ring);
        let range =
            |passage: &ArcPassage| self.starts[passage.arc()]..self.starts[passage.arc() + 1];
        let begin = if first.is_backward() { range(first).end - 1 } else { range(first).start };
        let is_begin = |at: &u32| own[*at as usize] == self.points[begin];
        let mut steps = way.iter().position(is_begin).unwrap_or_default();
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

/// The indices of a part's vertices, one of each run at one position, without a ring's last.
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
