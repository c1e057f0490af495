//! Looking for what is wrong among pieces: crossings, and vertices on another side.

use super::chains::{Bits, Chains};
use super::cross::conflict;
use super::region::{Bands, holds};
use super::tree::{Bounds, Tree};
use crate::geom::plane::Xy;

/// A chain's part from one kept vertex to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) from: u32,
    pub(super) to: u32,
}

impl Piece {
    /// True when the piece is a segment of the chain, with nothing left out.
    pub(super) fn is_original(self) -> bool {
        self.to - self.from <= 1
    }
}

/// Pieces with more vertices than this have their candidates tested together.
const LONG: u32 = 48;

/// Candidates of long pieces that are held before they are tested.
const MOST_HELD: usize = 1 << 20;

/// What a scan found.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Pairs of pieces whose segments meet off a common end.
    pub(super) crossings: Vec<(u32, u32)>,
    /// Pieces with a kept vertex or a point between chain and segment; may hold one repeatedly.
    pub(super) wrong: Vec<u32>,
    /// Candidates of long pieces, not tested yet.
    held: Vec<(u32, Xy)>,
}

/// All pieces, dead or alive, for reading only: scans of different groups can go on at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a> {
    pub(super) chains: Chains<'a>,
    pub(super) pieces: &'a [Piece],
    /// Which pieces have not been replaced by finer ones.
    pub(super) alive: &'a [bool],
    /// The last vertices of open chains: those that no piece begins with.
    pub(super) ends: &'a Bits,
}

impl View<'_> {
    /// Tests every pair of pieces of `tree` once.
    pub(super) fn within(&self, tree: &Tree, found: &mut Found) {
        let mut groups = Vec::new();
        for group in 0..tree.groups() {
            tree.groups_meeting(&tree.around(group), group, &mut groups);
            for &other in &groups {
                self.groups((tree, group), (tree, other), found);
            }
            self.test_held(found, MOST_HELD);
        }
    }

    /// Tests every piece of `fresh` against every living one of `old`.
    pub(super) fn between(&self, fresh: &Tree, old: &Tree, found: &mut Found) {
        let mut groups = Vec::new();
        for group in 0..fresh.groups() {
            old.groups_meeting(&fresh.around(group), 0, &mut groups);
            for &other in &groups {
                self.groups((fresh, group), (old, other), found);
            }
            self.test_held(found, MOST_HELD);
        }
    }

    /// Tests every piece of `fresh` against given points; the ids of `tree` are their numbers.
    pub(super) fn points(&self, fresh: &Tree, tree: &Tree, points: &[Xy], found: &mut Found) {
        let mut groups = Vec::new();
        for group in 0..fresh.groups() {
            tree.groups_meeting(&fresh.around(group), 0, &mut groups);
            for at in fresh.group(group) {
                for other in groups.iter().flat_map(|&g| tree.group(g)) {
                    let point = points[tree.ids[other] as usize];
                    self.candidate(fresh.ids[at], fresh.bounds(at), point, found);
                }
            }
            self.test_held(found, MOST_HELD);
        }
    }

    /// Tests the pairs of two groups, or those within one.
    fn groups(&self, (tree, g): (&Tree, usize), (other, h): (&Tree, usize), found: &mut Found) {
        let around = tree.around(g);
        let same = std::ptr::eq(tree, other) && g == h;
        for q in other.group(h) {
            let id = other.ids[q];
            if !other.bounds(q).meets(&around) || !self.alive[id as usize] {
                continue;
            }
            let first = if same { q + 1 } else { tree.group(g).start };
            for p in first..tree.group(g).end {
                if tree.bounds(p).meets(other.bounds(q)) {
                    self.pair((tree.ids[p], tree.bounds(p)), (id, other.bounds(q)), found);
                }
            }
        }
    }

    #[inline]
    fn pair(&self, (i, in_i): (u32, &Bounds), (j, in_j): (u32, &Bounds), found: &mut Found) {
        let (p, q) = (self.pieces[i as usize], self.pieces[j as usize]);
        let (s, t) = (self.segment(p), self.segment(q));
        if conflict(s, t) && s[0] != s[1] && t[0] != t[1] {
            found.crossings.push((i, j));
        }
        self.side((i, p, in_i), q, found);
        self.side((j, q, in_j), p, found);
    }

    /// Tests the kept vertices that `q` stands for against piece `p`.
    #[inline]
    fn side(&self, (i, p, bounds): (u32, Piece, &Bounds), q: Piece, found: &mut Found) {
        if p.is_original() {
            return;
        }
        if q.from != p.to {
            self.candidate(i, bounds, self.chains.points[q.from as usize], found);
        }
        if self.ends.has(q.to as usize) {
            self.candidate(i, bounds, self.chains.points[q.to as usize], found);
        }
    }

    /// Tests a position that must not lie between chain and segment of piece `i`.
    #[inline]
    fn candidate(&self, i: u32, bounds: &Bounds, v: Xy, found: &mut Found) {
        let piece = self.pieces[i as usize];
        let [a, b] = self.segment(piece);
        if !bounds.holds(v) || v == a || v == b || found.wrong.last() == Some(&i) {
            return;
        }
        if piece.to - piece.from > LONG {
            found.held.push((i, v));
        } else if holds(self.chains.piece(piece.from, piece.to), v) {
            found.wrong.push(i);
        }
    }

    /// Tests the candidates of long pieces, once there are more than `most` of them.
    pub(super) fn test_held(&self, found: &mut Found, most: usize) {
        if found.held.len() <= most {
            return;
        }
        let mut held = std::mem::take(&mut found.held);
        held.sort_by_key(|&(i, _)| i);
        for run in held.chunk_by(|p, q| p.0 == q.0) {
            let piece = self.pieces[run[0].0 as usize];
            if any_held(self.chains.piece(piece.from, piece.to), run.iter().map(|c| c.1)) {
                found.wrong.push(run[0].0);
            }
        }
    }

    fn segment(&self, piece: Piece) -> [Xy; 2] {
        [piece.from, piece.to].map(|v| self.chains.points[v as usize])
    }
}

/// Whether any of several positions lies between a chain and its segment, as [`holds`] has it.
pub(super) fn any_held(chain: &[Xy], mut candidates: impl ExactSizeIterator<Item = Xy>) -> bool {
    if candidates.len() < 4 {
        return candidates.any(|v| holds(chain, v));
    }
    let bands = Bands::new(chain, &Bounds::of(chain));
    candidates.any(|v| bands.holds(chain, v))
}
