//! Borders that parts share before, and after.

use super::exact::{Xy, by_ends, upward};
use super::pieces::{LineProofPiece, LineProofPieces, PieceKind, XRange};
use super::report::LineCheckReport;

/// Counts, in a band, segments of the original that several parts shared and that different segments
/// have replaced (a border is torn apart), and segments of the result that replace different stretches
/// (borders have run together). Each place counts once, in the band of its least x. O(n log n).
pub(super) fn count(pieces: &LineProofPieces, band: XRange, report: &mut LineCheckReport) {
    let all: Vec<LineProofPiece<'_>> =
        pieces.of(band).filter(|piece| piece.kind == PieceKind::Kept).collect();
    let numbered = || (0u32..).zip(&all);
    let replacing = |piece: u32| all[piece as usize].replacing().map(upward);
    let old = numbered().flat_map(|(i, p)| p.segments().map(move |s| (upward(s), i)));
    let differ = |p: u32, q: u32| replacing(p) != replacing(q);
    torn(old.collect(), differ, &all, band, report);
    let new = numbered().filter_map(|(i, p)| Some((upward(p.replacing()?), i)));
    let new = new.filter(|(ends, _)| ends[0] != ends[1]);
    let differ = |p: u32, q: u32| !are_same(all[p as usize].points, all[q as usize].points);
    torn(new.collect(), differ, &all, band, report);
}

/// Counts the places of `segments` whose pieces differ.
fn torn(
    mut segments: Vec<([Xy; 2], u32)>,
    differ: impl Fn(u32, u32) -> bool,
    all: &[LineProofPiece<'_>],
    band: XRange,
    report: &mut LineCheckReport,
) {
    segments.retain(|(ends, _)| band.holds(ends[0][0]));
    segments.sort_unstable_by(|p, q| by_ends(&p.0, &q.0).then(p.1.cmp(&q.1)));
    for place in segments.chunk_by(|p, q| p.0 == q.0) {
        let (ends, first) = place[0];
        if let Some((_, other)) = place.iter().find(|(_, other)| differ(first, *other)) {
            report.torn.add(all[*other as usize].part, ends[0]);
        }
    }
}

/// Whether two stretches have the same vertices in the same or the opposite order; repeated ones count
/// once.
fn are_same(p: &[Xy], q: &[Xy]) -> bool {
    let forward = |of: &[Xy]| of.chunk_by(|a, b| a == b).map(|run| run[0]).collect::<Vec<_>>();
    let (p, q) = (forward(p), forward(q));
    p == q || p.iter().eq(q.iter().rev())
}
