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

use crate::error::{Error, Result};
use crate::geom::plane::Xy;

use super::topology::{Chains, Kept, open_at};
use bins::Bins;
use cut::Cutter;

/// An arc as part of a ring or line: which, and in which direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passage(u32);

impl Passage {
    fn new(arc: u32, backward: bool) -> Self {
        Self(arc << 1 | u32::from(backward))
    }

    /// The arc.
    pub fn arc(self) -> usize {
        (self.0 >> 1) as usize
    }

    /// Whether it is passed from its last vertex to its first.
    pub fn is_backward(self) -> bool {
        self.0 & 1 == 1
    }
}

/// The arcs of a coverage, and the parts that are made of them.
#[derive(Clone, Debug, Default)]
pub struct Arcs {
    /// The vertices of all arcs, arc by arc.
    pub points: Vec<Xy>,
    /// For each of them the input's first vertex at its position: where z and m are to be found.
    pub sources: Vec<u32>,
    /// The number of each arc's first vertex, and at the end the number of all.
    pub starts: Vec<usize>,
    /// Which arcs end where they begin.
    pub closed: Vec<bool>,
    /// Which of these have no junction: they may begin anywhere.
    pub free: Vec<bool>,
    /// The arcs of each part, part by part, in the order in which it passes them.
    pub passages: Vec<Passage>,
    /// Where each part's begin in `passages`, and at the end how many there are.
    pub parts: Vec<usize>,
}

/// Parts put together again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Numbers of vertices of [`Arcs`], part by part; rings end with the vertex they begin with.
    pub vertices: Vec<u32>,
    /// Where each part's begin in `vertices`, and at the end how many there are.
    pub starts: Vec<usize>,
}

/// Moves positions onto others no farther than `distance`, as [`Arcs::new`] does.
///
/// # Errors
/// `Usage` for a distance that is not above 0 and finite.
pub fn snap(points: &mut [Xy], distance: f64) -> Result<()> {
    if !(distance > 0.0 && distance.is_finite()) {
        return Err(Error::usage(format!("snap distance {distance} is not one")));
    }
    snap::snap(points, distance);
    Ok(())
}

impl Arcs {
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
        self::snap(&mut points, snap)?;
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
    pub fn rebuild(&self, kept: &Kept) -> Parts {
        let mut parts =
            Parts { vertices: Vec::with_capacity(kept.vertices.len()), starts: vec![0] };
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
}

fn cut(parts: &Chains<'_>) -> Result<Arcs> {
    let position = Bins::new(parts.points, 0.0).same(parts.points);
    let mut cutter = Cutter::new(parts, &position);
    (0..parts.count()).for_each(|part| cutter.look(part));
    (0..parts.count()).try_for_each(|part| cutter.cut(part))?;
    Ok(cutter.finish())
}
