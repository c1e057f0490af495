//! Borders that parts share before, and after.

use super::matching::Piece;
use super::{Question, Report};

/// Counts segments that are in more parts, or fewer, than a segment of the original that they replace.
/// O(n log n).
pub(super) fn check(
    question: &Question<'_>,
    ids: &[Vec<u32>; 2],
    pieces: &[Piece],
    report: &mut Report,
) {
    let edges = |piece: &Piece| {
        let start = question.original.range(piece.part as usize).start;
        let count = question.original.range(piece.part as usize).len() as u32;
        // A ring's closing vertex is its first.
        let around = if question.original.closed[piece.part as usize] { count - 1 } else { count };
        let at = move |v: u32| start + (v % around) as usize;
        (piece.from..piece.to).map(move |v| edge(ids[0][at(v)], ids[0][at(v + 1)]))
    };
    let replacing =
        |piece: &Piece| edge(ids[1][piece.first as usize], ids[1][piece.first as usize + 1]);
    let before = counted(pieces.iter().flat_map(edges).filter(|e| e[0] != e[1]).collect());
    let after = counted(pieces.iter().map(replacing).collect());
    for piece in pieces.iter().filter(|piece| replacing(piece)[0] != replacing(piece)[1]) {
        let uses = count(&after, replacing(piece));
        if edges(piece).any(|e| e[0] != e[1] && count(&before, e) != uses) {
            let at = question.simplified.at(piece.first as usize);
            report.torn.add(piece.part as usize, at);
        }
    }
}

fn edge(p: u32, q: u32) -> [u32; 2] {
    [p.min(q), p.max(q)]
}

/// Edges and how often each was there, sorted.
fn counted(mut edges: Vec<[u32; 2]>) -> Vec<([u32; 2], u32)> {
    edges.sort_unstable();
    edges.chunk_by(|p, q| p == q).map(|run| (run[0], run.len() as u32)).collect()
}

fn count(counted: &[([u32; 2], u32)], edge: [u32; 2]) -> u32 {
    counted.binary_search_by_key(&edge, |c| c.0).map_or(0, |at| counted[at].1)
}
