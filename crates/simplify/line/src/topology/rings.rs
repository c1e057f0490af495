//! Rings that collapse or change orientation.

use std::cmp::Ordering;

use super::chains::{Chains, Refine, RetainedChainVertices};
use super::options::{RingCollapse, UntangleOptions};
use super::region::farthest;
use terrane_base::geom::plane::{Xy, area_sign, orient};

/// Statistics of rings.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MendedRings {
    /// Collapsed rings.
    pub(super) collapsed: u64,
    /// Rings without area in the input.
    pub(super) flat: u64,
}

/// Restores the orientation of every ring, or removes collapsed rings, as the options say.
///
/// O(vertices) plus the calls of `refine`.
pub(super) fn mend(
    chains: &Chains<'_>,
    kept: &RetainedChainVertices,
    options: &UntangleOptions<'_>,
    refine: &mut Refine<'_>,
) -> (RetainedChainVertices, MendedRings) {
    let mut result = RetainedChainVertices::new();
    result.vertices.reserve(kept.vertices.len() + 2 * chains.count());
    let mut mended = MendedRings::default();
    for chain in 0..chains.count() {
        let old = kept.of(chain);
        match chains.closed[chain] && !old.is_empty() {
            true => {
                let mut ring = ChainRing { chains, chain, refine, out: &mut result.vertices };
                let is_loop = options.loops.get(chain) == Some(&true);
                let collapse = match options.collapse {
                    RingCollapse::Drop if is_loop => RingCollapse::Minimal,
                    other => other,
                };
                ring.mend(old, collapse, &mut mended);
            }
            false => result.vertices.extend_from_slice(old),
        }
        result.close();
    }
    (result, mended)
}

/// One ring, and the destination of its kept vertices.
struct ChainRing<'a, 'b> {
    chains: &'a Chains<'a>,
    chain: usize,
    refine: &'a mut Refine<'b>,
    out: &'a mut Vec<u32>,
}

impl ChainRing<'_, '_> {
    fn mend(&mut self, kept: &[u32], collapse: RingCollapse, mended: &mut MendedRings) {
        let sign = area_sign(self.chains.points[self.chains.range(self.chain)].iter().copied());
        let (has_collapsed, is_flat) = (kept.len() < 4, sign == Ordering::Equal);
        match (has_collapsed, collapse) {
            (false, _) if is_flat => self.out.extend_from_slice(kept),
            (false, _) => self.turn(kept.to_vec(), sign),
            (true, RingCollapse::Drop) => {}
            (true, RingCollapse::Minimal) if !is_flat => self.least(kept, sign),
            (true, _) => self.all(),
        }
        mended.collapsed += u64::from(has_collapsed);
        mended.flat += u64::from(is_flat);
    }

    /// Sign of the area of vertices that start and end with the ring's first.
    fn sign(&self, kept: &[u32]) -> Ordering {
        area_sign(kept.iter().map(|&v| self.at(v)))
    }

    fn at(&self, v: u32) -> Xy {
        self.chains.points[v as usize]
    }

    fn all(&mut self) {
        let range = self.chains.range(self.chain);
        self.out.extend(range.start as u32..range.end as u32);
    }

    /// Keeps the ring's first vertex, the kept vertex or the farthest one, and the vertex of the largest
    /// triangle with the right sign; and the method's vertices between them.
    fn least(&mut self, kept: &[u32], sign: Ordering) {
        let (first, last) = (kept[0], kept[kept.len() - 1]);
        if last - first == 3 {
            return self.all();
        }
        let far = match kept {
            [_, far, _] => *far,
            _ => first + farthest(self.chains.piece(first, last)) as u32,
        };
        let apex = self.apex([first, far, last], sign);
        let mut corners = vec![first, far, last];
        corners.extend(apex);
        corners.sort_unstable();
        let kept = self.refined(&corners);
        self.turn(kept, sign)
    }

    /// Vertex besides `far` of the largest triangle with the given sign, if any.
    fn apex(&self, [first, far, last]: [u32; 3], sign: Ordering) -> Option<u32> {
        let (a, b) = (self.at(first), self.at(far));
        let way = if sign == Ordering::Less { -1.0 } else { 1.0 };
        let (mut most, mut best) = (0.0, None);
        for v in (first + 1..last).filter(|&v| v != far) {
            let p = self.at(v);
            let area = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
            let area = if v > far { area * way } else { -area * way };
            if area > most {
                (most, best) = (area, Some(v));
            }
        }
        best.filter(|&v| {
            let p = self.at(v);
            sign == if v > far { orient(a, b, p) } else { orient(a, p, b) }
        })
    }

    /// `corners` and the method's vertices between them.
    fn refined(&mut self, corners: &[u32]) -> Vec<u32> {
        let mut all = vec![corners[0]];
        for pair in corners.windows(2) {
            if pair[1] - pair[0] > 1 {
                (self.refine)(self.chain, pair[0], pair[1], &mut all);
            }
            all.push(pair[1]);
        }
        all
    }

    /// Refines every piece until the area has the sign, which the whole ring has.
    fn turn(&mut self, mut kept: Vec<u32>, sign: Ordering) {
        while kept.len() < 4 || self.sign(&kept) != sign {
            let mut corners = vec![kept[0]];
            for pair in kept.windows(2) {
                if pair[1] - pair[0] > 1 {
                    let middle = farthest(self.chains.piece(pair[0], pair[1]));
                    corners.push(pair[0] + middle as u32);
                }
                corners.push(pair[1]);
            }
            kept = self.refined(&corners);
        }
        self.out.append(&mut kept);
    }
}
