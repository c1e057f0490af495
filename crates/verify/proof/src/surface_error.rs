//! The error between samples: where the mesh breaks on the lines between neighbouring samples.
//!
//! Between two samples of the surface the grid is a straight line, and so is a triangle over it. The two are
//! furthest apart at an end of what the triangle covers of the line: at a sample, which is judged as such,
//! or at a *break*, where a side of the triangle crosses the line or a corner lies on it. So all breaks of all
//! triangles are judged.
//!
//! A break belongs to the domain of the first sample of its line. It counts once for each height of the
//! triangles that meet there.

use std::ops::Range;

use terrane_base::geom::Rect;

use super::bits::BitGrid;
use super::exact::InterpolatedHeight;
use super::part::GridProofPart;
use super::sections::{EdgeRowWalk, SectionInt, ceil, floor, is_small, is_whole};
use super::surface::ProofSurface;
use super::totals::{ErrorSpot, ProofTally};
use super::triangle::ProofPosition;

/// Bound on the rounding of an error, by the heights it comes from: for each fewer than 16 roundings of
/// 2^-53.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Judges the breaks of a part.
pub(crate) struct BreakJudge<'a> {
    part: &'a GridProofPart<'a>,
    window: Rect,
    /// Lines of the surface by their first sample: those along rows, and those along columns.
    lines: [BitGrid; 2],
    /// Heights of the two ends of an edge, as its triangles have them.
    heights: Vec<[f64; 2]>,
}

/// Lines along rows or, upright, along columns, for which rows and columns are swapped.
#[derive(Clone, Copy)]
struct SampleLineAxis {
    upright: bool,
}

impl SampleLineAxis {
    fn turned(self, at: ProofPosition) -> ProofPosition {
        if self.upright { ProofPosition { row: at.col, col: at.row } } else { at }
    }
}

/// A break on the way from sample `unit` of a line to the next, at `rest` of `whole`. Of the edge that the
/// mesh breaks at, `part` of `whole` lies before it.
struct ProfileBreak<N> {
    lines: SampleLineAxis,
    line: i64,
    unit: i64,
    rest: N,
    part: N,
    whole: N,
}

impl<N: SectionInt> ProfileBreak<N> {
    /// Where it is, rounded down.
    fn position(&self) -> ProofPosition {
        let fraction = (self.rest.wide() << ProofPosition::FRACTION) / self.whole.wide();
        let unit = ProofPosition::sample(self.unit, self.line);
        self.lines.turned(ProofPosition { col: unit.col + fraction as i64, ..unit })
    }
}

impl<'a> BreakJudge<'a> {
    pub(crate) fn new(part: &'a GridProofPart<'a>, surface: &ProofSurface) -> Self {
        let (window, lines) = (part.domain.apron(), surface.lines());
        Self { part, window, lines, heights: Vec::new() }
    }

    /// Ranges of the lines with samples of the domain, and of these samples along the lines.
    fn owned(&self, lines: SampleLineAxis) -> [Range<i64>; 2] {
        let rect = self.part.domain.rect;
        let [cols, rows] = [rect.col..rect.end_col(), rect.row..rect.end_row()]
            .map(|range| range.start.into()..range.end.into());
        if lines.upright { [cols, rows] } else { [rows, cols] }
    }

    /// Judges a position where corners have these heights, if it lies on a line between samples.
    pub(crate) fn corner(&mut self, at: ProofPosition, heights: &[f64], tally: &mut ProofTally) {
        if is_whole(at.col) == is_whole(at.row) {
            return;
        }
        let lines = SampleLineAxis { upright: is_whole(at.col) };
        let ProofPosition { row, col } = lines.turned(at);
        let (line, unit, whole) = (floor(row), floor(col), i128::from(ProofPosition::CELL));
        let rest = i128::from(col - (unit << ProofPosition::FRACTION));
        let [across, along] = self.owned(lines);
        if !across.contains(&line) || !along.contains(&unit) {
            return;
        }
        self.heights.clear();
        self.heights.extend(heights.iter().map(|&z| [z, z]));
        distinct(&mut self.heights);
        self.judge(&ProfileBreak { lines, line, unit, rest, part: 0, whole }, tally);
    }

    /// Judges where an edge crosses lines strictly between its ends, where triangles have these heights.
    pub(crate) fn edge(
        &mut self,
        ends: [ProofPosition; 2],
        heights: impl Iterator<Item = [f64; 2]>,
        tally: &mut ProofTally,
    ) {
        let [a, b] = ends;
        if !crosses_line(a.row, b.row) && !crosses_line(a.col, b.col) {
            return;
        }
        self.heights.clear();
        self.heights.extend(heights);
        distinct(&mut self.heights);
        for upright in [false, true] {
            let lines = SampleLineAxis { upright };
            let [mut a, mut b] = ends.map(|at| lines.turned(at));
            if a.row > b.row {
                std::mem::swap(&mut a, &mut b);
                self.heights.iter_mut().for_each(|ends| ends.reverse());
            }
            if is_small(&ends) {
                self.cross::<i64>(lines, [a, b], tally);
            } else {
                self.cross::<i128>(lines, [a, b], tally);
            }
        }
    }

    /// Judges where an edge crosses lines of one kind, from its end before them (`a`) to that behind.
    fn cross<N: SectionInt>(
        &self,
        lines: SampleLineAxis,
        [a, b]: [ProofPosition; 2],
        tally: &mut ProofTally,
    ) {
        let [across, along] = self.owned(lines);
        let first = (floor(a.row) + 1).max(across.start);
        let end = ceil(b.row).min(across.end);
        if first >= end {
            return;
        }
        let cell = N::whole(1 << N::FRACTION);
        let mut walk = EdgeRowWalk::<N>::new(a, b, first);
        for line in first..end {
            let EdgeRowWalk { column: unit, rest, divisor: whole, .. } = walk;
            if rest > N::whole(0) && along.contains(&unit) {
                let part = cell * (cell * N::whole(line) - N::coordinate(a.row));
                self.judge(&ProfileBreak { lines, line, unit, rest, part, whole }, tally);
            }
            walk.advance();
        }
    }

    /// Judges a break, of an edge with the heights noted, where there is surface along its line.
    #[inline]
    fn judge<N: SectionInt>(&self, at: &ProfileBreak<N>, tally: &mut ProofTally) {
        let Some(ground) = self.ground(at) else { return };
        let each = 1.0 / at.whole.float();
        let ground_height = interpolated(ground, at.rest.float() * each);
        for &mesh in &self.heights {
            tally.breaks += 1;
            let error = (interpolated(mesh, at.part.float() * each) - ground_height).abs();
            let size = mesh[0].abs() + mesh[1].abs() + (ground[0].abs() + ground[1].abs());
            let doubt = ROUNDING * size + f64::MIN_POSITIVE;
            let worst = tally.worst_between.map_or(0.0, |worst| worst.error);
            let threshold = self.part.tolerance.map_or(worst, |tolerance| tolerance.min(worst));
            // Negated, so that NaN is not clear.
            let is_clear = error + doubt < threshold;
            if !is_clear {
                self.note(at, [mesh, ground], error, doubt, tally);
            }
        }
    }

    /// Heights of the samples before and behind a break, where there is surface along the line between them.
    #[inline]
    fn ground<N>(&self, at: &ProfileBreak<N>) -> Option<[f64; 2]> {
        let Self { window, lines: [right, down], .. } = self;
        let width = window.width as usize;
        let upright = at.lines.upright;
        let (col, row) = if upright { (at.line, at.unit) } else { (at.unit, at.line) };
        let [col, row] = [col - i64::from(window.col), row - i64::from(window.row)];
        let [col, row] = [col as usize, row as usize];
        let (lines, next) = if upright { (down, width) } else { (right, 1) };
        let first = row * width + col;
        lines.get(col, row).then(|| [first, first + next].map(|i| self.part.heights[i]))
    }

    /// Counts an error that may exceed the tolerance or the largest error so far.
    #[cold]
    fn note<N: SectionInt>(
        &self,
        at: &ProfileBreak<N>,
        [mesh, ground]: [[f64; 2]; 2],
        error: f64,
        doubt: f64,
        tally: &mut ProofTally,
    ) {
        // Heights beyond the range of floats are infinitely far from everything.
        let mut error = if error.is_nan() { f64::INFINITY } else { error };
        let place = at.position();
        if let Some(tolerance) = self.part.tolerance {
            let mesh = InterpolatedHeight { ends: mesh, part: at.part.wide() };
            let ground = InterpolatedHeight { ends: ground, part: at.rest.wide() };
            let is_within = error + doubt < tolerance;
            // Exact only where rounding leaves a doubt.
            if !is_within
                && (error - doubt > tolerance || mesh.is_far(ground, at.whole.wide(), tolerance))
            {
                tally.over_between.add(place);
                error = error.max(tolerance.next_up());
            } else {
                error = error.min(tolerance);
            }
        }
        tally.spot_between(ErrorSpot { error, at: place });
    }
}

/// True when there is a line strictly between two rows, or two columns.
fn crosses_line(a: i64, b: i64) -> bool {
    floor(a.min(b)) + 1 < ceil(a.max(b))
}

#[inline]
fn interpolated([a, b]: [f64; 2], share: f64) -> f64 {
    a + (b - a) * share
}

/// Removes duplicates.
fn distinct(heights: &mut Vec<[f64; 2]>) {
    heights.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    heights.dedup();
}
