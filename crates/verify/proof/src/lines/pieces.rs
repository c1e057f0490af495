//! Lines before and after, side by side: stretches of the original and the segments in their place.

use std::ops::Range;

use super::exact::Xy;
use super::parts::flat;

/// A range of x, half-open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct XRange {
    /// The minimum x.
    pub from: f64,
    /// The x where it ends, exclusive.
    pub to: f64,
}

impl XRange {
    /// All of the plane.
    pub const ALL: Self = Self { from: f64::NEG_INFINITY, to: f64::INFINITY };

    /// Whether `x` is in it.
    pub(super) fn holds(&self, x: f64) -> bool {
        self.from <= x && x < self.to
    }

    /// Whether something from x = `low` to x = `high` reaches into it.
    pub(super) fn meets(&self, [low, high]: [f64; 2]) -> bool {
        low < self.to && self.from <= high
    }
}

/// Kind of a run of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PieceKind {
    /// Vertices of an original part; between those that were kept, a segment replaces a stretch.
    Kept,
    /// An original part without a known replacement.
    Gone,
    /// A part of the result without an original.
    Stranger,
}

/// Consecutive vertices of a part; pieces of it that reach into no band of interest are cut out.
#[derive(Clone, Copy, Debug)]
struct PieceRun {
    part: u32,
    kind: PieceKind,
    end: usize,
    span: [f64; 2],
}

/// A stretch of a part, and the segment in its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineProofPiece<'a> {
    pub(super) part: u32,
    pub(super) kind: PieceKind,
    /// Its vertices, at least two; of a [`PieceKind::Kept`] one the first and last were kept and those
    /// between were not.
    pub(super) points: &'a [Xy],
}

impl<'a> LineProofPiece<'a> {
    /// The segment of the result, if there is one.
    pub(super) fn replacing(&self) -> Option<[Xy; 2]> {
        (self.kind != PieceKind::Gone).then(|| [self.points[0], self.points[self.points.len() - 1]])
    }

    /// The segments of the original, none of a [`PieceKind::Stranger`].
    pub(super) fn segments(self) -> impl Iterator<Item = [Xy; 2]> + use<'a> {
        let there = if self.kind == PieceKind::Stranger { &[] } else { self.points };
        there.windows(2).map(|pair| [pair[0], pair[1]]).filter(|s| s[0] != s[1])
    }
}

/// All pieces that reach into a band. 17 bytes a vertex and 40 a part.
#[derive(Debug)]
pub struct LineProofPieces {
    band: XRange,
    points: Vec<Xy>,
    /// Vertices that end a piece.
    is_end: Vec<bool>,
    runs: Vec<PieceRun>,
}

impl LineProofPieces {
    /// Without pieces yet, for those that reach into `band`.
    pub fn new(band: XRange) -> Self {
        Self { band, points: Vec::new(), is_end: Vec::new(), runs: Vec::new() }
    }

    /// The band whose pieces are all here.
    pub fn band(&self) -> XRange {
        self.band
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> u64 {
        let vertices = self.points.len() * (size_of::<Xy>() + size_of::<bool>());
        (vertices + self.runs.len() * size_of::<PieceRun>()) as u64
    }

    /// Adds vertices of a part; marks say which end pieces, the first and the last included.
    pub(super) fn push(
        &mut self,
        part: u32,
        kind: PieceKind,
        vertices: impl Iterator<Item = (Xy, bool)>,
    ) {
        let first = self.points.len();
        for (point, is_end) in vertices {
            self.points.push(point);
            self.is_end.push(is_end);
        }
        let end = self.points.len();
        if first < end {
            let span = span(&self.points[first..]);
            self.runs.push(PieceRun { part, kind, end, span });
            if span[0] < self.band.from || self.band.to <= span[1] {
                self.cut(self.runs.len() - 1);
            }
        }
    }

    /// Adds a part without a counterpart: each of its segments is a piece.
    pub(super) fn push_unmatched(&mut self, part: u32, kind: PieceKind, points: &[[f64; 3]]) {
        self.push(part, kind, points.iter().map(|&p| (flat(p), true)));
    }

    /// Narrows the band to the median of where pieces begin; false when no piece begins within it. O(n).
    pub fn halve(&mut self) -> bool {
        /// Every so many pieces one is sampled.
        const SAMPLED: usize = 16;
        let lows = self.pieces(0..self.runs.len()).map(|piece| span(piece.points)[0]);
        let within = lows.filter(|&x| self.band.from < x);
        let mut sample: Vec<f64> = within.step_by(SAMPLED).collect();
        sample.sort_unstable_by(f64::total_cmp);
        let Some(&to) = sample.get(sample.len() / 2) else { return false };
        self.band.to = to;
        self.cut(0);
        true
    }

    /// Bands that divide this one, with about `size` vertices in each.
    pub fn bands(&self, size: usize) -> Vec<XRange> {
        /// Every so many vertices one is sampled.
        const SAMPLED: usize = 64;
        let mut sample: Vec<f64> = self.points.iter().step_by(SAMPLED).map(|p| p[0]).collect();
        sample.sort_unstable_by(f64::total_cmp);
        let mut borders = vec![self.band.from];
        borders.extend(sample.into_iter().step_by((size / SAMPLED).max(1)).skip(1));
        borders.retain(|&x| self.band.from <= x && x < self.band.to);
        borders.push(self.band.to);
        borders.dedup();
        borders.windows(2).map(|pair| XRange { from: pair[0], to: pair[1] }).collect()
    }

    /// The pieces that reach into `band`, part by part.
    pub(super) fn of(&self, band: XRange) -> impl Iterator<Item = LineProofPiece<'_>> + Clone {
        let near = (0..self.runs.len()).filter(move |&run| band.meets(self.runs[run].span));
        near.flat_map(|run| self.pieces(run..run + 1))
            .filter(move |piece| band.meets(span(piece.points)))
    }

    /// The vertices of the result in `band`.
    pub(super) fn vertices(&self, band: XRange) -> impl Iterator<Item = Xy> {
        let near = (0..self.runs.len()).filter(move |&run| {
            band.meets(self.runs[run].span) && self.runs[run].kind != PieceKind::Gone
        });
        let kept = near.flat_map(|run| self.range(run)).filter(|&vertex| self.is_end[vertex]);
        kept.map(|vertex| self.points[vertex]).filter(move |p| band.holds(p[0]))
    }

    fn range(&self, run: usize) -> Range<usize> {
        let first = run.checked_sub(1).map_or(0, |before| self.runs[before].end);
        first..self.runs[run].end
    }

    fn pieces(&self, runs: Range<usize>) -> impl Iterator<Item = LineProofPiece<'_>> + Clone {
        runs.flat_map(move |run| {
            let PieceRun { part, kind, .. } = self.runs[run];
            self.stretches(self.range(run)).map(move |range| LineProofPiece {
                part,
                kind,
                points: &self.points[range],
            })
        })
    }

    /// The vertices of each piece of a run, its last the first of the next.
    fn stretches(&self, run: Range<usize>) -> impl Iterator<Item = Range<usize>> + Clone {
        let mut first = run.start;
        run.skip(1).filter(|&vertex| self.is_end[vertex]).map(move |last| {
            let stretch = first..last + 1;
            first = last;
            stretch
        })
    }

    /// Removes pieces outside the band from the runs from `first` on.
    fn cut(&mut self, first: usize) {
        let runs = self.runs.split_off(first);
        let mut start = self.runs.last().map_or(0, |run| run.end);
        let mut end = start;
        for run in runs {
            for left in self.inside(start..run.end) {
                self.points.copy_within(left.clone(), end);
                self.is_end.copy_within(left.clone(), end);
                let first = end;
                end += left.len();
                self.runs.push(PieceRun { end, span: span(&self.points[first..end]), ..run });
            }
            start = run.end;
        }
        self.points.truncate(end);
        self.is_end.truncate(end);
    }

    /// True when vertices reach into the band.
    fn is_near(&self, vertices: &Range<usize>) -> bool {
        self.band.meets(span(&self.points[vertices.clone()]))
    }

    /// The longest ranges of a run's vertices whose pieces all reach into the band.
    fn inside(&self, run: Range<usize>) -> Vec<Range<usize>> {
        if run.len() == 1 {
            return Some(run).filter(|run| self.is_near(run)).into_iter().collect();
        }
        let mut inside: Vec<Range<usize>> = Vec::new();
        for stretch in self.stretches(run).filter(|stretch| self.is_near(stretch)) {
            match inside.last_mut().filter(|last| last.end == stretch.start + 1) {
                Some(last) => last.end = stretch.end,
                None => inside.push(stretch),
            }
        }
        inside
    }
}

/// The minimum and the maximum x.
fn span(points: &[Xy]) -> [f64; 2] {
    points
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| [low.min(p[0]), high.max(p[0])])
}
