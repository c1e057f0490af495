//! Tests of segments before they are accepted.

use super::chains::{Chains, Refine, RetainedChainVertices};
use super::region::farthest;
use super::scan::{SidePoints, holds_any};
use super::tree::{ClosedBox, HilbertRTree};
use terrane_base::Cancel;
use terrane_base::bits::BitSet;
use terrane_base::error::Result;
use terrane_base::geom::plane::Xy;

/// Vertices of a chain that share a box.
const RUN: usize = 16;

/// Chains while they are simplified, with the current vertices.
///
/// As long as the chains cross nothing, and a shortcut's region has no vertex that is there, nothing
/// crosses the shortcut either: a segment that did would enter the region through it and would have to
/// leave it through the chain, or through the shortcut a second time. So vertices are all that has
/// to be looked at. (De Berg, van Kreveld & Schirra 1998, section 3.)
#[derive(Debug)]
pub(super) struct LivingChains<'a> {
    chains: Chains<'a>,
    there: BitSet,
    /// Boxes of runs of vertices, known by their first vertex.
    tree: HilbertRTree,
    points: &'a SidePoints<'a>,
    groups: Vec<usize>,
    near: Vec<Xy>,
}

impl<'a> LivingChains<'a> {
    /// All vertices of the chains that have any in `kept`.
    fn new(chains: &Chains<'a>, kept: &RetainedChainVertices, points: &'a SidePoints<'a>) -> Self {
        let mut there = BitSet::new(chains.points.len());
        let mut runs = Vec::new();
        for chain in (0..chains.count()).filter(|&chain| !kept.of(chain).is_empty()) {
            let range = chains.range(chain);
            for first in range.clone().step_by(RUN) {
                let end = (first + RUN).min(range.end);
                for v in first..end {
                    there.insert(v);
                }
                runs.push((first as u32, ClosedBox::of(&chains.points[first..end])));
            }
        }
        let (groups, near) = (Vec::new(), Vec::new());
        Self { chains: *chains, there, tree: HilbertRTree::new(&runs), points, groups, near }
    }

    /// Whether no current vertex lies between a chain's part and the segment of its ends.
    fn is_free(&mut self, from: u32, to: u32) -> bool {
        let chain = self.chains.piece(from, to);
        let bounds = ClosedBox::of(chain);
        let ends = [chain[0], chain[chain.len() - 1]];
        self.near.clear();
        self.tree.groups_meeting(&bounds, 0, &mut self.groups);
        for at in self.groups.iter().flat_map(|&g| self.tree.group(g)) {
            if self.tree.bounds(at).meets(&bounds) {
                let run = self.run(self.tree.ids[at] as usize);
                let others = run.filter(|&v| v < from as usize || v > to as usize);
                let there =
                    others.filter(|&v| self.there.contains(v)).map(|v| self.chains.points[v]);
                self.near.extend(there.filter(|&p| bounds.holds(p) && !ends.contains(&p)));
            }
        }
        self.points.tree.groups_meeting(&bounds, 0, &mut self.groups);
        for at in self.groups.iter().flat_map(|&g| self.points.tree.group(g)) {
            let p = self.points.at[self.points.tree.ids[at] as usize];
            self.near.extend(Some(p).filter(|&p| bounds.holds(p) && !ends.contains(&p)));
        }
        !holds_any(chain, self.near.iter().copied())
    }

    /// The vertices of the run that begins with `first`.
    fn run(&self, first: usize) -> std::ops::Range<usize> {
        let chain = self.chains.chain_of(first as u32);
        first..(first + RUN).min(self.chains.starts[chain + 1])
    }

    /// Removes the vertices strictly between two others.
    fn remove(&mut self, from: u32, to: u32) {
        (from as usize + 1..to as usize).for_each(|v| self.there.remove(v));
    }
}

/// Simplifies one chain after the other; `kept` is the result of the method. Returns the kept vertices and the
/// number of split pieces.
pub(super) fn accept(
    chains: &Chains<'_>,
    kept: &RetainedChainVertices,
    points: &SidePoints<'_>,
    cancel: Option<&Cancel>,
    refine: &mut Refine<'_>,
) -> Result<(RetainedChainVertices, u64)> {
    let mut living = LivingChains::new(chains, kept, points);
    let (mut accepted, mut refined) = (RetainedChainVertices::new(), 0);
    let mut halves = Vec::new();
    for chain in 0..chains.count() {
        // Pieces to test are between neighbours on the stack; the next one is on top.
        cancel.map_or(Ok(()), Cancel::check)?;
        let mut open: Vec<u32> = kept.of(chain).iter().rev().copied().collect();
        while let [.., to, from] = open[..] {
            if to - from == 1 || living.is_free(from, to) {
                living.remove(from, to);
                accepted.vertices.push(from);
                open.pop();
                continue;
            }
            let middle = from + farthest(chains.piece(from, to)) as u32;
            halves.clear();
            for (a, b) in [(from, middle), (middle, to)] {
                if b - a > 1 {
                    refine(chain, a, b, &mut halves);
                }
                halves.push(b);
            }
            halves.pop();
            open.pop();
            open.extend(halves.iter().rev());
            open.push(from);
            refined += 1;
        }
        accepted.vertices.extend(open);
        accepted.close();
    }
    Ok((accepted, refined))
}
