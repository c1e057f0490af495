//! The error of every sample: each triangle's plane against the heights it covers.
//!
//! Planes are evaluated in `f64` with a bound on the rounding; wherever that leaves any doubt
//! about the tolerance, the sample is decided exactly. Of several triangles that cover a sample
//! the largest error counts.

use terrane_base::geom::Rect;

use super::bits::{BitGrid, masks, ones};
use super::domain::GridDomain;
use super::exact::exceeds;
use super::part::GridProofPart;
use super::sections::{ceil, floor, is_small, sections, strip};
use super::surface::{ProofSurface, columns};
use super::totals::{ErrorSpot, ProofTally};
use super::triangle::{ProofPosition, ProofTriangle};
use super::unit::{ErrorRun, ErrorSums, Histogram};

/// Height and largest error of a sample, and a handful of bits.
pub(crate) const BYTES_PER_SAMPLE: u64 = 18;

/// Samples this close (relative) to the tolerance are decided exactly.
const RELATIVE_DOUBT: f64 = 1e-9;

/// Largest error of every sample of a part, and coverage of samples and cells.
pub(crate) struct WorstErrors<'a> {
    part: &'a GridProofPart<'a>,
    surface: &'a ProofSurface,
    window: Rect,
    /// Largest error by sample of the window; -1 where no triangle covers it.
    errors: Vec<f64>,
    over: BitGrid,
    inside: BitGrid,
    inside_twice: BitGrid,
    cells: BitGrid,
}

/// The plane of a triangle: heights by column and row relative to a corner.
struct ProofPlane {
    origin: ProofPosition,
    z: f64,
    per_col: f64,
    per_row: f64,
    /// Bound on the rounding error of a height on the plane within the triangle.
    doubt: f64,
}

impl ProofPlane {
    fn new(triangle: &ProofTriangle) -> Self {
        let [a, b, c] = triangle.corners;
        let ([bx, by], [cx, cy]) = (b.at.minus(a.at), c.at.minus(a.at));
        let (bz, cz) = (b.z - a.z, c.z - a.z);
        let area = triangle.double_area() as f64
            / (ProofPosition::CELL as f64 * ProofPosition::CELL as f64);
        let wide = bx.abs().max(cx.abs()).max((bx - cx).abs()) + 1.0;
        let high = by.abs().max(cy.abs()).max((by - cy).abs()) + 1.0;
        // Bounds on the gradient without cancellation.
        let steepest_col = ((bz * cy).abs() + (cz * by).abs()) / area.abs();
        let steepest_row = ((bz * cx).abs() + (cz * bx).abs()) / area.abs();
        let size = a.z.abs() + steepest_col * wide + steepest_row * high;
        if !size.is_finite() {
            return Self::overflown(a.at);
        }
        Self {
            origin: a.at,
            z: a.z,
            per_col: (bz * cy - cz * by) / area,
            per_row: (cz * bx - bz * cx) / area,
            // Fewer than 16 roundings of 2^-53 of the magnitudes above.
            doubt: 16.0 * f64::EPSILON * size + f64::MIN_POSITIVE,
        }
    }

    /// Stands for heights beyond the range of floats: infinitely far from every sample.
    fn overflown(origin: ProofPosition) -> Self {
        Self { origin, z: f64::INFINITY, per_col: 0.0, per_row: 0.0, doubt: f64::INFINITY }
    }

    /// Height at a sample.
    fn at(&self, col: i64, row: i64) -> f64 {
        let [x, y] = ProofPosition::sample(col, row).minus(self.origin);
        self.z + self.per_row * y + self.per_col * x
    }

    /// Errors from `floor` up may be over the tolerance.
    fn suspicious(&self, tolerance: Option<f64>) -> f64 {
        tolerance.map_or(f64::INFINITY, |t| t - (RELATIVE_DOUBT * t).max(self.doubt))
    }
}

/// Raises `errors` to the distances of `heights` from a line; true when any distance is `floor`
/// or more. A NaN among the heights changes nothing.
#[inline]
fn raise(errors: &mut [f64], heights: &[f64], start: f64, step: f64, floor: f64) -> bool {
    let mut suspicious = false;
    for (i, (error, height)) in errors.iter_mut().zip(heights).enumerate() {
        // A product for each sample: steps added one after the other would add up their rounding.
        let distance = (height - (start + step * f64::from(i as i32))).abs();
        *error = if distance > *error { distance } else { *error };
        suspicious |= distance >= floor;
    }
    suspicious
}

impl<'a> WorstErrors<'a> {
    pub(crate) fn new(part: &'a GridProofPart<'a>, surface: &'a ProofSurface) -> Self {
        let window = part.domain.apron();
        let clear = BitGrid::new(window.width as usize, window.height as usize);
        Self {
            part,
            surface,
            window,
            errors: vec![-1.0; window.len()],
            over: clear.clone(),
            inside: clear.clone(),
            inside_twice: clear.clone(),
            cells: clear,
        }
    }

    /// Rasterises one triangle.
    pub(crate) fn add(&mut self, triangle: &ProofTriangle) {
        if triangle.double_area() == 0 {
            return;
        }
        let plane = ProofPlane::new(triangle);
        if is_small(&triangle.positions()) {
            self.scan::<i64>(triangle, &plane);
        } else {
            self.scan::<i128>(triangle, &plane);
        }
        if !triangle.is_lattice() {
            self.scan_strips(triangle);
        }
    }

    fn scan<N: super::sections::SectionInt>(
        &mut self,
        triangle: &ProofTriangle,
        plane: &ProofPlane,
    ) {
        let rect = self.part.domain.rect;
        let end = i64::from(rect.end_row());
        let suspicious = plane.suspicious(self.part.tolerance);
        let [low, high] = triangle.bounds();
        let lattice = triangle.is_lattice();
        let mut above: Option<[i64; 2]> = None;
        sections::<N>(triangle, i64::from(rect.row), end, |row, section| {
            if let (Some([a, b]), [c, d], true) = (above, section.cells(), lattice) {
                self.mark_cells(row - 1, a.min(c), b.max(d));
            }
            above = Some(section.cells());
            if row == end {
                return;
            }
            let [from, to] = section.samples();
            self.measure(triangle, plane, suspicious, row, self.clip(from, to));
            if low.row < row << ProofPosition::FRACTION && row << ProofPosition::FRACTION < high.row
            {
                let [from, to] = section.inner();
                self.mark_inside(row, self.clip(from, to));
            }
        });
    }

    /// Marks the cells of a triangle with corners that are not samples.
    fn scan_strips(&mut self, triangle: &ProofTriangle) {
        let rect = self.part.domain.rect;
        let [low, high] = triangle.bounds();
        let first = floor(low.row).max(i64::from(rect.row));
        for row in first..ceil(high.row).min(i64::from(rect.end_row())) {
            if let Some([from, to]) = strip(triangle, row) {
                self.mark_cells(row, from, to);
            }
        }
    }

    /// Columns `from .. to` of the grid that the part owns, as columns of the window.
    #[inline]
    fn clip(&self, from: i64, to: i64) -> [usize; 2] {
        let rect = self.part.domain.rect;
        let (first, end) = (i64::from(rect.col), i64::from(rect.end_col()));
        let from = from.clamp(first, end);
        let to = to.clamp(from, end);
        [from, to].map(|col| (col - i64::from(self.window.col)) as usize)
    }

    /// An owned row of the grid as row of the window.
    #[inline]
    fn line(&self, row: i64) -> usize {
        (row - i64::from(self.window.row)) as usize
    }

    #[inline]
    fn measure(
        &mut self,
        triangle: &ProofTriangle,
        plane: &ProofPlane,
        suspicious: f64,
        row: i64,
        [from, to]: [usize; 2],
    ) {
        let line = self.line(row) * self.window.width as usize;
        let start = plane.at(from as i64 + i64::from(self.window.col), row);
        let errors = &mut self.errors[line + from..line + to];
        let heights = &self.part.heights[line + from..line + to];
        if from < to && raise(errors, heights, start, plane.per_col, suspicious) {
            self.decide(triangle, plane, suspicious, row, [from, to]);
        }
    }

    /// Decides the samples of a section that are at or above the suspicious error.
    #[cold]
    fn decide(
        &mut self,
        triangle: &ProofTriangle,
        plane: &ProofPlane,
        suspicious: f64,
        row: i64,
        [from, to]: [usize; 2],
    ) {
        let Some(tolerance) = self.part.tolerance else { return };
        let line = self.line(row);
        let first = i64::from(self.window.col);
        let start = plane.at(from as i64 + first, row);
        // As far above the tolerance as `suspicious` is below it: beyond, rounding cannot matter.
        let clear = 2.0 * tolerance - suspicious;
        for col in from..to {
            let height = self.part.heights[line * self.window.width as usize + col];
            let distance = (height - (start + plane.per_col * (col - from) as f64)).abs();
            let at = ProofPosition::sample(col as i64 + first, row);
            if distance >= suspicious
                && (distance > clear || exceeds(triangle, at, height, tolerance))
            {
                self.over.set(col, line);
            }
        }
    }

    #[inline]
    fn mark_inside(&mut self, row: i64, [from, to]: [usize; 2]) {
        let line = self.line(row);
        let (once, twice) = (self.inside.row_mut(line), self.inside_twice.row_mut(line));
        for (word, mask) in masks(from, to) {
            twice[word] |= once[word] & mask;
            once[word] |= mask;
        }
    }

    #[inline]
    fn mark_cells(&mut self, row: i64, from: i64, to: i64) {
        let [width, height] = self.part.domain.grid.map(i64::from);
        if row < height - 1 {
            let [from, to] = self.clip(from, to.min(width - 1));
            self.cells.set_range(self.line(row), from, to);
        }
    }

    /// Adds everything to the tally.
    pub(crate) fn finish(mut self, tally: &mut ProofTally) {
        let rect = self.part.domain.rect;
        let mut sums = vec![ErrorSums::default(); rect.width.div_ceil(GridDomain::UNIT) as usize];
        let mut histogram = self.part.tolerance.map(Histogram::new);
        let over = tally.over.count;
        let mut samples = Vec::new();
        for row in rect.row..rect.end_row() {
            self.surface.samples(self.line(i64::from(row)), &mut samples);
            self.finish_cells(row, tally);
            self.settle(row, &samples, tally);
            self.finish_row(row, &samples, &mut sums, histogram.as_mut(), tally);
            if (row + 1) % GridDomain::UNIT == 0 || row + 1 == rect.end_row() {
                sums.iter_mut().for_each(|sums| sums.flush(tally));
            }
        }
        if let Some(histogram) = histogram {
            histogram.flush(tally.over.count - over, tally);
        }
    }

    /// Mask-by-mask view of the owned columns of a row.
    fn owned(&self) -> impl Iterator<Item = (usize, u64)> + use<> {
        let [from, to] = self.clip(0, i64::MAX);
        masks(from, to)
    }

    fn finish_cells(&self, row: u32, tally: &mut ProofTally) {
        let line = self.line(i64::from(row));
        for (word, mask) in self.owned() {
            let (found, due) = (self.cells.row(line)[word], self.surface.cells(line)[word]);
            let twice = self.inside_twice.row(line)[word];
            for (bits, fault) in [
                (due & !found, &mut tally.uncovered_cells),
                (found & !due, &mut tally.void_cells),
                (twice, &mut tally.overlaps),
            ] {
                ones(mask & bits).for_each(|bit| fault.add(self.place(word * 64 + bit, row)));
            }
        }
    }

    /// Position of a column of the window in a row of the grid.
    fn place(&self, col: usize, row: u32) -> ProofPosition {
        ProofPosition::sample(col as i64 + i64::from(self.window.col), i64::from(row))
    }

    fn finish_row(
        &self,
        row: u32,
        samples: &[u64],
        sums: &mut [ErrorSums],
        mut histogram: Option<&mut Histogram>,
        tally: &mut ProofTally,
    ) {
        let [mut from, end] = self.clip(0, i64::MAX);
        let line = self.line(i64::from(row)) * self.window.width as usize;
        for sums in sums {
            let to = (from + GridDomain::UNIT as usize).min(end);
            let due = bits_at(samples, from, to);
            let run = ErrorRun::new(&self.errors[line + from..line + to], due);
            sums.add(&run);
            if let Some(histogram) = &mut histogram {
                histogram.add(&run);
            }
            tally.covered += u64::from(run.counted().count_ones());
            let missing = u64::from(due & !run.counted());
            ones(missing).for_each(|bit| tally.uncovered.add(self.place(from + bit, row)));
            self.note_worst(&run, from, row, tally);
            from = to;
        }
    }

    /// Keeps the largest error of a run that begins with column `from` of the window.
    #[inline]
    fn note_worst(&self, run: &ErrorRun, from: usize, row: u32, tally: &mut ProofTally) {
        let error = run.max();
        if tally.worst.is_some_and(|worst| worst.error > error) {
            return;
        }
        if let Some(bit) = run.find(error) {
            tally.spot(ErrorSpot { error, at: self.place(from + bit, row) });
        }
    }

    /// Makes errors consistent with the exact decisions: samples over the tolerance exceed it by at least one
    /// float, all others are at most equal to it. Counts the samples over.
    fn settle(&mut self, row: u32, samples: &[u64], tally: &mut ProofTally) {
        let Some(tolerance) = self.part.tolerance else { return };
        let line = self.line(i64::from(row));
        let width = self.window.width as usize;
        let errors = &mut self.errors[line * width..][..width];
        if errors.iter().fold(false, |any, &error| any | (error > tolerance)) {
            for (col, error) in errors.iter_mut().enumerate() {
                if *error > tolerance && !self.over.get(col, line) {
                    *error = tolerance;
                }
            }
        }
        for col in columns(self.over.row(line)) {
            errors[col] = errors[col].max(tolerance.next_up());
        }
        for (word, mask) in self.owned() {
            let over = self.over.row(line)[word] & samples[word] & mask;
            ones(over).for_each(|bit| tally.over.add(self.place(word * 64 + bit, row)));
        }
    }
}

/// The bits `from .. to` (at most 32 of them) of a row of words.
fn bits_at(words: &[u64], from: usize, to: usize) -> u32 {
    let (word, shift) = (from / 64, from % 64);
    let next = words.get(word + 1).map_or(0, |&next| u128::from(next) << 64);
    let bits = (u128::from(words[word]) | next) >> shift;
    (bits as u64 & ((1 << (to - from)) - 1)) as u32
}
