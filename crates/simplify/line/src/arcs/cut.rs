//! Junctions, and the arcs between them.

use std::collections::HashMap;

use super::bins::PositionBins;
use crate::topology::Chains;
use terrane_base::error::{Error, Result};
use terrane_base::geom::plane::Xy;

/// No known neighbour, or no arc.
const NONE: u32 = u32::MAX;

/// Neighbour before the first and after the last vertex of a line; equals no real neighbour.
const END: u32 = u32::MAX - 1;

/// An arc of a ring or line, with its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArcPassage(u32);

impl ArcPassage {
    fn new(arc: u32, backward: bool) -> Self {
        Self(arc << 1 | u32::from(backward))
    }

    /// The arc.
    pub fn arc(self) -> usize {
        (self.0 >> 1) as usize
    }

    /// Whether it is traversed from its last vertex to its first.
    pub fn is_backward(self) -> bool {
        self.0 & 1 == 1
    }
}

/// Arcs of a coverage, and the parts composed of them.
#[derive(Clone, Debug, Default)]
pub struct CoverageArcs {
    /// The vertices of all arcs, arc by arc.
    pub points: Vec<Xy>,
    /// For each of them the first input vertex at its position, for z and m.
    pub sources: Vec<u32>,
    /// First vertex of each arc, and the number of all vertices.
    pub starts: Vec<usize>,
    /// Whether each arc is closed.
    pub closed: Vec<bool>,
    /// Whether a closed arc has no junction and may start anywhere.
    pub free: Vec<bool>,
    /// Arcs of each part in the order of traversal.
    pub passages: Vec<ArcPassage>,
    /// Start of each part in `passages`, and the total number.
    pub parts: Vec<usize>,
}

/// The arcs of all parts.
pub(super) fn cut(parts: &Chains<'_>) -> Result<CoverageArcs> {
    let position = PositionBins::new(parts.points, 0.0).same(parts.points);
    let mut cutter = ArcCutter::new(parts, &position);
    (0..parts.count()).for_each(|part| cutter.scan(part));
    (0..parts.count()).try_for_each(|part| cutter.cut(part))?;
    Ok(cutter.finish())
}

/// Parts while they are cut. A position is identified by its lowest vertex.
#[derive(Debug)]
struct ArcCutter<'a> {
    parts: &'a Chains<'a>,
    /// The position of each vertex.
    position: &'a [u32],
    /// Neighbours of each position, the lower first; after all parts are known, the first is the arc whose end
    /// is next to the position.
    near: Vec<[u32; 2]>,
    junction: Vec<bool>,
    /// Arcs of two vertices, the lower first.
    short: HashMap<[u32; 2], u32>,
    arcs: CoverageArcs,
    /// Positions of the current part, without the closing vertex of a ring.
    part: Vec<u32>,
}

impl<'a> ArcCutter<'a> {
    fn new(parts: &'a Chains<'a>, position: &'a [u32]) -> Self {
        let n = parts.points.len();
        let mut arcs = CoverageArcs::default();
        arcs.starts.push(0);
        arcs.parts.push(0);
        let (near, junction) = (vec![[NONE; 2]; n], vec![false; n]);
        Self { parts, position, near, junction, short: HashMap::new(), arcs, part: Vec::new() }
    }

    /// Fills `part` with the positions of a part; returns whether it is a ring.
    fn take(&mut self, part: usize) -> bool {
        self.part.clear();
        self.part.extend_from_slice(&self.position[self.parts.range(part)]);
        self.part.dedup();
        let is_ring = self.parts.closed[part] && self.part.len() > 1;
        if is_ring {
            self.part.pop();
        }
        is_ring
    }

    /// Finds the junctions of a part.
    fn scan(&mut self, part: usize) {
        let is_ring = self.take(part);
        let Some(last) = self.part.len().checked_sub(1) else { return };
        let (mut before, first) =
            if is_ring { (self.part[last], self.part[0]) } else { (END, END) };
        for i in 0..=last {
            let at = self.part[i];
            let after = if i < last { self.part[i + 1] } else { first };
            let pair = [before.min(after), before.max(after)];
            let known = &mut self.near[at as usize];
            if known[0] == NONE {
                *known = pair;
            }
            if *known != pair || pair[0] == pair[1] || pair[1] == END {
                self.junction[at as usize] = true;
            }
            before = at;
        }
    }

    /// Cuts a part into arcs, after all parts are known.
    fn cut(&mut self, part: usize) -> Result<()> {
        if part == 0 {
            self.near.fill([NONE; 2]);
        }
        let is_ring = self.take(part);
        let mut whole = std::mem::take(&mut self.part);
        if is_ring {
            self.close(&mut whole);
        }
        let mut first = 0;
        for i in 1..whole.len() {
            // A ring without a junction that comes back to its first goes around once more; the ends of a
            // line are junctions.
            if self.junction[whole[i] as usize] || whole[i] == whole[0] {
                self.pass(&whole[first..=i])?;
                first = i;
            }
        }
        if whole.len() == 1 {
            self.pass(&whole)?;
        }
        self.part = whole;
        self.arcs.parts.push(self.arcs.passages.len());
        Ok(())
    }

    /// Rotates a ring to start and end at its first junction, or at its lowest position.
    fn close(&self, ring: &mut Vec<u32>) {
        let junction = ring.iter().position(|&v| self.junction[v as usize]);
        let start = junction.unwrap_or_else(|| {
            (1..ring.len()).fold(0, |low, i| {
                let [p, q] = [i, low].map(|i| self.parts.points[ring[i] as usize]);
                if p[0] < q[0] || (p[0] == q[0] && p[1] < q[1]) { i } else { low }
            })
        });
        ring.rotate_left(start);
        ring.push(ring[0]);
    }

    /// Adds the arc of these positions to the current part, new or existing.
    fn pass(&mut self, arc: &[u32]) -> Result<()> {
        let known = match *arc {
            [v] => self.near[v as usize][0],
            [a, b] => *self.short.get(&[a.min(b), a.max(b)]).unwrap_or(&NONE),
            [_, second, ..] => self.near[second as usize][0],
            [] => return Ok(()),
        };
        let id = if known == NONE { self.add(arc)? } else { known };
        let there = &self.arcs.sources[self.arcs.starts[id as usize]..];
        let forward = there[0] == arc[0] && (arc.len() == 1 || there[1] == arc[1]);
        self.arcs.passages.push(ArcPassage::new(id, !forward));
        Ok(())
    }

    /// Adds a new arc. Positions next to its ends are not junctions, so they belong to no other arc.
    fn add(&mut self, arc: &[u32]) -> Result<u32> {
        let id = u32::try_from(self.arcs.closed.len())
            .ok()
            .filter(|&id| id < NONE / 2)
            .ok_or_else(|| Error::limit("the number of arcs", NONE / 2, NONE / 2 - 1))?;
        match *arc {
            [v] => self.near[v as usize][0] = id,
            [a, b] => {
                self.short.insert([a.min(b), a.max(b)], id);
            }
            _ => [1, arc.len() - 2].iter().for_each(|&i| self.near[arc[i] as usize][0] = id),
        }
        self.arcs.sources.extend_from_slice(arc);
        self.arcs.starts.push(self.arcs.sources.len());
        let closed = arc.len() > 2 && arc[0] == arc[arc.len() - 1];
        self.arcs.closed.push(closed);
        self.arcs.free.push(closed && !self.junction[arc[0] as usize]);
        Ok(id)
    }

    fn finish(self) -> CoverageArcs {
        let (mut arcs, points) = (self.arcs, self.parts.points);
        drop((self.near, self.junction, self.short));
        arcs.points = arcs.sources.iter().map(|&v| points[v as usize]).collect();
        arcs
    }
}
