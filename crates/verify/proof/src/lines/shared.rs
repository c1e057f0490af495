//! Borders shared by parts, before and after.

use super::exact::{Xy, by_ends, upward};
use super::pieces::{LineProofPiece, LineProofPieces, PieceKind, XRange};
use super::report::LineCheckReport;

/// Counts, in a band, segments of the original that several parts shared and that different segments
/// have replaced (a border is torn apart), and segments of the result that replace different stretches
/// (borders have run together). Each place counts once, in the band of its least x. O(n log n).
pub(super) fn count(pieces: &LineProofPieces, band: XRange, report: &mut LineCheckReport) {
    let all: Vec<LineProofPiece<'_>> =
        pieces.of(band).filter(|piece| piece.kind == PieceKind::Kept).collect();
    let numbered = (0u32..).zip(&all);
    let old = numbered.clone().flat_map(|(i, p)| p.segments().map(move |s| (upward(s), i)));
    torn(
        old.collect(),
        |p, q| p.replacing().map(upward) != q.replacing().map(upward),
        &all,
        band,
        report,
    );
    let new = numbered.filter_map(|(i, p)| Some((upward(p.replacing()?), i)));
    let new = new.filter(|(ends, _)| ends[0] != ends[1]);
    torn(new.collect(), |p, q| !are_same(p.points, q.points), &all, band, report);
}

/// Counts the places of `segments` whose pieces differ; each segment has the number of its piece.
fn torn(
    mut segments: Vec<([Xy; 2], u32)>,
    differ: fn(&LineProofPiece<'_>, &LineProofPiece<'_>) -> bool,
    all: &[LineProofPiece<'_>],
    band: XRange,
    report: &mut LineCheckReport,
) {
    segments.retain(|(ends, _)| band.holds(ends[0][0]));
    segments.sort_unstable_by(|p, q| by_ends(&p.0, &q.0).then(p.1.cmp(&q.1)));
    for place in segments.chunk_by(|p, q| p.0 == q.0) {
        let (ends, first) = place[0];
        let mut others = place.iter().map(|&(_, other)| &all[other as usize]);
        if let Some(other) = others.find(|other| differ(&all[first as usize], other)) {
            report.torn.add(other.part, ends[0]);
        }
    }
}

/// Whether two stretches have the same vertices in the same or the opposite order; repeated ones count
/// once.
fn are_same(p: &[Xy], q: &[Xy]) -> bool {
    let [p, q] = [p, q]
        .map(|vertices| vertices.chunk_by(|a, b| a == b).map(|run| run[0]).collect::<Vec<_>>());
    p == q || p.iter().eq(q.iter().rev())
}
