//! Rounds of tests of new pieces and splits of invalid ones.

use std::cmp::Ordering;

use super::chains::{Chains, Refine, RetainedChainVertices};
use super::region::farthest;
use super::scan::{ChainPiece, PieceLayer, PieceView, ScanConflicts, SidePoints};
use super::tree::ClosedBox;
use terrane_base::Cancel;
use terrane_base::bits::BitSet;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::plane::area_sign;

/// Rounds after which pieces are split in the middle, which bounds the number of rounds logarithmically.
const ROUNDS_AT_FARTHEST: u64 = 40;

/// Largest number of layers; more are merged.
const MAX_LAYERS: usize = 6;

/// State of the chains between rounds.
#[derive(Debug)]
pub(super) struct UntangleState<'a> {
    chains: Chains<'a>,
    /// All kept vertices.
    kept: BitSet,
    /// Last vertices of open chains.
    ends: BitSet,
    pieces: Vec<ChainPiece>,
    alive: Vec<bool>,
    /// Pieces of earlier rounds.
    layers: Vec<PieceLayer>,
    /// First piece made since the orientation of rings was checked.
    pub(super) unturned: usize,
    pub(super) crossings: Vec<[u32; 2]>,
    pub(super) refined: u64,
    pub(super) rounds: u64,
}

impl<'a> UntangleState<'a> {
    /// `kept` has rings with their original orientation.
    pub(super) fn new(chains: &Chains<'a>, kept: &RetainedChainVertices) -> Self {
        let n = chains.points.len();
        let mut settling = Self {
            chains: *chains,
            kept: BitSet::new(n),
            ends: BitSet::new(n),
            pieces: Vec::with_capacity(kept.vertices.len()),
            alive: Vec::new(),
            layers: Vec::new(),
            unturned: 0,
            crossings: Vec::new(),
            refined: 0,
            rounds: 0,
        };
        for chain in 0..chains.count() {
            settling.add(kept.of(chain));
            if let (false, Some(&last)) = (chains.closed[chain], kept.of(chain).last()) {
                settling.ends.insert(last as usize);
            }
        }
        settling.unturned = settling.pieces.len();
        settling
    }

    /// Adds the pieces between kept vertices; a chain of one vertex is a piece, too.
    fn add(&mut self, kept: &[u32]) {
        for &v in kept {
            self.kept.insert(v as usize);
        }
        let pieces = kept.windows(2).map(|pair| ChainPiece { from: pair[0], to: pair[1] });
        self.pieces.extend(pieces);
        if let &[v] = kept {
            self.pieces.push(ChainPiece { from: v, to: v });
        }
        self.alive.resize(self.pieces.len(), true);
    }

    /// Continues until no violation is left, or more than `most` pieces exist.
    pub(super) fn run(
        &mut self,
        points: &SidePoints<'_>,
        most: usize,
        cancel: Option<&Cancel>,
        refine: &mut Refine<'_>,
    ) -> Result<()> {
        let mut first = 0;
        while first < self.pieces.len() {
            if self.pieces.len() > most {
                let message = format!("one crossing search holds more than {most} pieces of lines");
                return Err(Error::new(ErrorKind::Resource, message));
            }
            let fresh = self.layer_from(first);
            let found = self.scan(&fresh, points, cancel)?;
            self.layers.push(fresh);
            self.rounds += 1;
            let mut wrong = self.judge(found);
            // The sign of an area tells the sense of a ring only where the ring does not cross itself, so
            // crossings are settled first.
            if wrong.is_empty() {
                wrong = self.turned();
            }
            first = self.pieces.len();
            for i in wrong {
                cancel.map_or(Ok(()), Cancel::check)?;
                self.split(i, refine);
            }
            if self.layers.len() > MAX_LAYERS {
                self.merge_layers();
            }
        }
        Ok(())
    }

    fn layer_from(&self, first: usize) -> PieceLayer {
        let fresh = self.pieces[first..].iter();
        let bounds = fresh.map(|piece| ClosedBox::of(self.chains.piece(piece.from, piece.to)));
        let items: Vec<_> = (first as u32..).zip(bounds).collect();
        PieceLayer::new(&items, &self.pieces, self.chains.points)
    }

    /// Merges all layers except the first.
    fn merge_layers(&mut self) {
        let mut items = Vec::new();
        for PieceLayer { tree, .. } in self.layers.drain(1..) {
            let all = tree.ids.iter().enumerate();
            items.extend(
                all.filter(|(_, id)| self.alive[**id as usize])
                    .map(|(at, &id)| (id, *tree.bounds(at))),
            );
        }
        // Boxes in one cell of the Hilbert curve stay in this order, so it must not depend on the layers.
        items.sort_by_key(|&(id, _)| id);
        let merged = PieceLayer::new(&items, &self.pieces, self.chains.points);
        self.layers.push(merged);
    }

    fn scan(
        &self,
        fresh: &PieceLayer,
        points: &SidePoints<'_>,
        cancel: Option<&Cancel>,
    ) -> Result<ScanConflicts> {
        let view = PieceView {
            chains: self.chains,
            pieces: &self.pieces,
            alive: &self.alive,
            ends: &self.ends,
            cancel,
        };
        let mut found = ScanConflicts::default();
        view.within(fresh, &mut found)?;
        for old in &self.layers {
            view.between(fresh, old, &mut found)?;
        }
        view.points(fresh, &points.tree, points.at, &mut found)?;
        view.test_deferred(&mut found, 0)?;
        Ok(found)
    }

    /// Pieces to split, ascending, without duplicates. A crossing is attributed to vertices on the wrong side,
    /// if any; otherwise to both pieces.
    fn judge(&mut self, found: ScanConflicts) -> Vec<u32> {
        let mut wrong = found.wrong;
        wrong.sort_unstable();
        wrong.dedup();
        let known = wrong.len();
        for (i, j) in found.crossings {
            let original = [i, j].map(|i| self.pieces[i as usize].is_original());
            if original == [true, true] {
                self.crossings.push([i, j].map(|i| self.pieces[i as usize].from));
            } else if ![i, j].iter().any(|i| wrong[..known].binary_search(i).is_ok()) {
                let blamed = [i, j].into_iter().zip(original).filter(|(_, whole)| !whole);
                wrong.extend(blamed.map(|(i, _)| i));
            }
        }
        wrong.sort_unstable();
        wrong.dedup();
        wrong
    }

    /// Pieces to split of rings with changed orientation, among those with new pieces.
    fn turned(&mut self) -> Vec<u32> {
        let first = std::mem::replace(&mut self.unturned, self.pieces.len());
        let fresh = self.pieces[first..].iter();
        let mut rings: Vec<usize> = fresh.map(|piece| self.chains.chain_of(piece.from)).collect();
        rings.dedup();
        rings.sort_unstable();
        rings.dedup();
        rings.retain(|&ring| self.chains.closed[ring] && self.has_turned(ring));
        if rings.is_empty() {
            return Vec::new();
        }
        let pieces = (0..).zip(&self.pieces).zip(&self.alive);
        let turned = pieces.filter(|((_, piece), is_alive)| {
            **is_alive
                && !piece.is_original()
                && rings.binary_search(&self.chains.chain_of(piece.from)).is_ok()
        });
        turned.map(|((i, _), _)| i).collect()
    }

    fn has_turned(&self, ring: usize) -> bool {
        let range = self.chains.range(ring);
        let at = |v: usize| self.chains.points[v];
        let now = area_sign(self.kept.within(range.clone()).map(at));
        let then = area_sign(range.map(at));
        now != then && then != Ordering::Equal
    }

    /// Replaces a piece by finer ones.
    fn split(&mut self, i: u32, refine: &mut Refine<'_>) {
        let ChainPiece { from, to } = self.pieces[i as usize];
        let chain = self.chains.chain_of(from);
        let middle = match self.rounds <= ROUNDS_AT_FARTHEST {
            true => from + farthest(self.chains.piece(from, to)) as u32,
            false => from + (to - from) / 2,
        };
        let mut kept = vec![from];
        for (a, b) in [(from, middle), (middle, to)] {
            if b - a > 1 {
                refine(chain, a, b, &mut kept);
            }
            kept.push(b);
        }
        // The piece keeps its number, which the trees of earlier layers hold.
        self.alive[i as usize] = false;
        self.add(&kept);
        self.refined += 1;
    }

    /// All kept vertices; `before` marks the chains without any.
    pub(super) fn into_retained(self, before: &RetainedChainVertices) -> RetainedChainVertices {
        let mut kept = RetainedChainVertices::new();
        for chain in 0..self.chains.count() {
            if !before.of(chain).is_empty() {
                let vertices = self.kept.within(self.chains.range(chain));
                kept.vertices.extend(vertices.map(|v| v as u32));
            }
            kept.close();
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::plane::Xy;

    /// Far off in one place, nearer to its begin.
    fn line() -> Vec<Xy> {
        (0..10).map(|i| [f64::from(i), if i == 3 { 5.0 } else { 0.0 }]).collect()
    }

    fn nothing(_: usize, _: u32, _: u32, _: &mut Vec<u32>) {}

    /// At the farthest vertex in 40 rounds, and in the middle from then on.
    #[test]
    fn pieces_are_split_at_the_farthest_vertex_and_late_ones_in_the_middle() {
        let line = line();
        let chains = Chains { points: &line, starts: &[0, 10], closed: &[false] };
        for (rounds, middle) in [(1, 3), (40, 3), (41, 5), (60, 5)] {
            let kept = RetainedChainVertices { vertices: vec![0, 2, 9], starts: vec![0, 3] };
            let mut settling = UntangleState::new(&chains, &kept);
            settling.rounds = rounds;
            settling.split(1, &mut nothing);
            let pieces: Vec<_> =
                settling.pieces.iter().map(|piece| [piece.from, piece.to]).collect();
            assert_eq!(pieces, [[0, 2], [2, 9], [2, middle], [middle, 9]], "round {rounds}");
            assert_eq!(settling.alive, [true, false, true, true]);
        }
    }

    /// Those that were split are among them: none more than so many, and no fewer.
    #[test]
    fn as_many_pieces_as_allowed_are_made() {
        let line = line();
        let chains = Chains { points: &line, starts: &[0, 10], closed: &[false] };
        let kept = RetainedChainVertices { vertices: vec![0, 9], starts: vec![0, 2] };
        // Below the peak: the line is split there, which makes two pieces of one.
        let below = [[3.0, 1.0]];
        let points = SidePoints::new(&below).expect("finite");
        for (most, is_enough) in [(0, false), (2, false), (3, true), (4, true)] {
            let mut settling = UntangleState::new(&chains, &kept);
            let result = settling.run(&points, most, None, &mut nothing);
            match result {
                Ok(()) => assert!(is_enough && settling.pieces.len() == 3, "{most}"),
                Err(error) => assert!(!is_enough && error.kind() == ErrorKind::Resource, "{most}"),
            }
        }
    }

    /// A piece that is halved again and again: the seventh layer is one too many, and those after the
    /// first become one.
    #[test]
    fn few_layers_are_kept_apart() {
        let line: Vec<Xy> = (0..=256).map(f64::from).map(|x| [x, x * (256.0 - x)]).collect();
        let chains = Chains { points: &line, starts: &[0, 257], closed: &[false] };
        let kept = RetainedChainVertices { vertices: vec![0, 256], starts: vec![0, 2] };
        // In the triangle of the first three vertices.
        let corner = [[0, 1].map(|axis| (line[0][axis] + line[1][axis] + line[2][axis]) / 3.0)];
        let points = SidePoints::new(&corner).expect("finite");
        let mut settling = UntangleState::new(&chains, &kept);
        settling.run(&points, usize::MAX, None, &mut nothing).expect("any number of pieces");
        assert_eq!((settling.rounds, settling.refined, settling.layers.len()), (9, 8, 4));
        let known: usize = settling.layers.iter().map(|layer| layer.tree.ids.len()).sum();
        assert!(known < settling.pieces.len(), "merged layers hold no piece that was split");
    }
}
