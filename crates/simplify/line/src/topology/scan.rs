//! Search for violations among pieces: crossings, and vertices on the wrong side.

use std::ops::Range;

use super::chains::Chains;
use super::cross::conflict;
use super::region::{EdgeBands, holds};
use super::tree::{ClosedBox, HilbertRTree};
use terrane_base::Cancel;
use terrane_base::bits::BitSet;
use terrane_base::error::Result;
use terrane_base::geom::plane::Xy;

/// Part of a chain between consecutive kept vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChainPiece {
    pub(super) from: u32,
    pub(super) to: u32,
}

impl ChainPiece {
    /// True if the piece is a segment of the chain without omitted vertices.
    pub(super) fn is_original(self) -> bool {
        self.to - self.from <= 1
    }
}

/// Size of pieces whose candidates are tested together.
const LONG: u32 = 48;

/// Largest number of buffered candidates of long pieces.
const MAX_DEFERRED: usize = 1 << 20;

/// Fixed points with a spatial index.
#[derive(Debug)]
pub(super) struct SidePoints<'a> {
    pub(super) at: &'a [Xy],
    pub(super) tree: HilbertRTree,
}

impl<'a> SidePoints<'a> {
    pub(super) fn new(at: &'a [Xy]) -> Result<Self> {
        let alone = Chains { points: at, starts: &[0, at.len()], closed: &[false] };
        alone.check().map_err(|e| e.at("points with fixed sides"))?;
        let boxes: Vec<_> = (0..).zip(at.iter().map(|&p| ClosedBox { low: p, high: p })).collect();
        Ok(Self { at, tree: HilbertRTree::new(&boxes) })
    }
}

/// Result of a scan.
#[derive(Debug, Default)]
pub(super) struct ScanConflicts {
    /// Pairs of pieces whose segments meet off a common end.
    pub(super) crossings: Vec<(u32, u32)>,
    /// Pieces with a kept vertex or a point between chain and segment; possibly repeated.
    pub(super) wrong: Vec<u32>,
    /// Candidates of long pieces, not yet tested.
    deferred: Vec<(u32, Xy)>,
}

/// Pieces of one round: boxes of their chains' parts, with the data of tests.
#[derive(Debug)]
pub(super) struct PieceLayer {
    pub(super) tree: HilbertRTree,
    /// In the order of the tree.
    spans: Vec<PieceSegment>,
}

/// A piece and its segment.
#[derive(Clone, Copy, Debug)]
struct PieceSegment {
    piece: ChainPiece,
    ends: [Xy; 2],
}

impl PieceLayer {
    /// Of `(number, box)`.
    pub(super) fn new(items: &[(u32, ClosedBox)], pieces: &[ChainPiece], points: &[Xy]) -> Self {
        let tree = HilbertRTree::new(items);
        let spans = tree.ids.iter().map(|&id| {
            let piece = pieces[id as usize];
            PieceSegment { piece, ends: [piece.from, piece.to].map(|v| points[v as usize]) }
        });
        Self { spans: spans.collect(), tree }
    }

    #[inline(always)]
    fn item(&self, at: usize) -> LayerPiece<'_> {
        LayerPiece { id: self.tree.ids[at], bounds: self.tree.bounds(at), span: &self.spans[at] }
    }
}

/// A piece in a layer.
#[derive(Clone, Copy, Debug)]
struct LayerPiece<'a> {
    id: u32,
    bounds: &'a ClosedBox,
    span: &'a PieceSegment,
}

/// All pieces, active or replaced, read-only: groups are scanned concurrently.
#[derive(Clone, Copy, Debug)]
pub(super) struct PieceView<'a> {
    pub(super) chains: Chains<'a>,
    pub(super) pieces: &'a [ChainPiece],
    /// Whether each piece is active (not replaced by finer ones).
    pub(super) alive: &'a [bool],
    /// Last vertices of open chains, which start no piece.
    pub(super) ends: &'a BitSet,
    /// Cancellation.
    pub(super) cancel: Option<&'a Cancel>,
}

impl PieceView<'_> {
    /// Tests every pair of pieces of a layer, all active, once.
    pub(super) fn within(&self, layer: &PieceLayer, found: &mut ScanConflicts) -> Result<()> {
        let tree = &layer.tree;
        let mut groups = Vec::new();
        for group in 0..tree.groups() {
            let around = tree.around(group);
            tree.groups_meeting(&around, group + 1, &mut groups);
            for q in tree.group(group) {
                let rest = q + 1..tree.group(group).end;
                self.pair_with_range(layer.item(q), layer, rest, found);
            }
            for q in groups.iter().flat_map(|&g| tree.group(g)) {
                if tree.bounds(q).meets(&around) {
                    self.pair_with_range(layer.item(q), layer, tree.group(group), found);
                }
            }
            self.test_deferred(found, MAX_DEFERRED)?;
        }
        Ok(())
    }

    /// Tests every piece of `fresh` against every active one of `old`. Fresh pieces are few and scattered, so
    /// each searches separately.
    pub(super) fn between(
        &self,
        fresh: &PieceLayer,
        old: &PieceLayer,
        found: &mut ScanConflicts,
    ) -> Result<()> {
        let mut groups = Vec::new();
        for item in (0..fresh.spans.len()).map(|at| fresh.item(at)) {
            old.tree.groups_meeting(item.bounds, 0, &mut groups);
            for q in groups.iter().flat_map(|&g| old.tree.group(g)) {
                if old.tree.bounds(q).meets(item.bounds) && self.alive[old.tree.ids[q] as usize] {
                    self.pair(item, old.item(q), found);
                }
            }
            self.test_deferred(found, MAX_DEFERRED)?;
        }
        Ok(())
    }

    /// Tests every piece of `fresh` against fixed points; the ids of `tree` are their numbers.
    pub(super) fn points(
        &self,
        fresh: &PieceLayer,
        tree: &HilbertRTree,
        points: &[Xy],
        found: &mut ScanConflicts,
    ) -> Result<()> {
        let mut groups = Vec::new();
        for group in 0..fresh.tree.groups() {
            tree.groups_meeting(&fresh.tree.around(group), 0, &mut groups);
            for other in groups.iter().flat_map(|&g| tree.group(g)) {
                for at in fresh.tree.group(group) {
                    self.candidate(fresh.item(at), points[tree.ids[other] as usize], found);
                }
            }
            self.test_deferred(found, MAX_DEFERRED)?;
        }
        Ok(())
    }

    #[inline(always)]
    fn pair_with_range(
        &self,
        item: LayerPiece<'_>,
        layer: &PieceLayer,
        range: Range<usize>,
        found: &mut ScanConflicts,
    ) {
        for p in range {
            if layer.tree.bounds(p).meets(item.bounds) {
                self.pair(layer.item(p), item, found);
            }
        }
    }

    #[inline]
    fn pair(&self, p: LayerPiece<'_>, q: LayerPiece<'_>, found: &mut ScanConflicts) {
        let (s, t) = (p.span.ends, q.span.ends);
        if conflict(s, t) && s[0] != s[1] && t[0] != t[1] {
            found.crossings.push((p.id, q.id));
        }
        self.side(p, q.span, found);
        self.side(q, p.span, found);
    }

    /// Tests the kept vertices of `other` against a piece.
    #[inline]
    fn side(&self, item: LayerPiece<'_>, other: &PieceSegment, found: &mut ScanConflicts) {
        self.candidate(item, other.ends[0], found);
        if self.ends.contains(other.piece.to as usize) {
            self.candidate(item, other.ends[1], found);
        }
    }

    /// Tests a position that must not lie between chain and segment of a piece.
    #[inline]
    fn candidate(&self, item: LayerPiece<'_>, v: Xy, found: &mut ScanConflicts) {
        let PieceSegment { piece, ends } = *item.span;
        if piece.is_original()
            || !item.bounds.holds(v)
            || ends.contains(&v)
            // One witness is enough. Only the last entry is compared: candidates of a piece mostly follow one
            // another, and a search in the list costs more than a second test.
            || found.wrong.last() == Some(&item.id)
        {
            return;
        }
        // A test is linear in the piece. Candidates of a long one are tested together, against edges in
        // bands, where the sum would be quadratic.
        if piece.to - piece.from > LONG {
            found.deferred.push((item.id, v));
        } else if holds(self.chains.piece(piece.from, piece.to), v) {
            found.wrong.push(item.id);
        }
    }

    /// Tests the candidates of long pieces above `most` of them; fails on cancellation.
    pub(super) fn test_deferred(&self, found: &mut ScanConflicts, most: usize) -> Result<()> {
        self.cancel.map_or(Ok(()), Cancel::check)?;
        if found.deferred.len() <= most {
            return Ok(());
        }
        let mut deferred = std::mem::take(&mut found.deferred);
        deferred.sort_by_key(|&(i, _)| i);
        for run in deferred.chunk_by(|p, q| p.0 == q.0) {
            let piece = self.pieces[run[0].0 as usize];
            if holds_any(self.chains.piece(piece.from, piece.to), run.iter().map(|c| c.1)) {
                found.wrong.push(run[0].0);
            }
        }
        Ok(())
    }
}

/// Whether any of several positions lies between a chain and its segment, as by [`holds`].
pub(super) fn holds_any(chain: &[Xy], mut candidates: impl ExactSizeIterator<Item = Xy>) -> bool {
    if candidates.len() < 4 {
        return candidates.any(|v| holds(chain, v));
    }
    let bands = EdgeBands::new(chain, &ClosedBox::of(chain));
    candidates.any(|v| bands.holds(chain, v))
}
