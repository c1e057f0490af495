//! Breaklines: edges that go from sample to sample along a line.
//!
//! A segment between two samples stands for a path of samples, each a step along a row or a column from the one
//! before, that are nearest to it in this sense: with n steps in all, of which c are along rows, the sample
//! after k of them is round(k c / n) columns on, halves rounded up. It begins at the end that comes first by
//! row and column. The mesh follows it if every vertex on the path has an edge to a vertex further on along it,
//! and if all samples are vertices where the path, or the surface under it, begins or ends. Then edges run
//! along the whole of it.

use std::ops::Range;

use super::domain::GridDomain;
use super::surface::ProofSurface;
use super::totals::ProofTally;
use super::triangle::ProofPosition;

/// A segment of a breakline, by the columns and rows of its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ProofBreakline {
    start: [i64; 2],
    end: [i64; 2],
}

impl ProofBreakline {
    /// Between two samples, in either order.
    pub fn between(a: [u32; 2], b: [u32; 2]) -> Self {
        let [a, b] = [a, b].map(|at| at.map(i64::from));
        let (start, end) = if [a[1], a[0]] <= [b[1], b[0]] { (a, b) } else { (b, a) };
        Self { start, end }
    }

    /// Columns and rows from start to end.
    fn span(&self) -> [i64; 2] {
        [0, 1].map(|axis| self.end[axis] - self.start[axis])
    }

    pub(crate) fn steps(&self) -> i64 {
        self.span().iter().map(|span| span.abs()).sum()
    }

    /// The sample after so many steps.
    pub(crate) fn at(&self, step: i64) -> [i64; 2] {
        // Twice a step times a span does not fit 64 bits for the largest grids.
        let (span, steps) = (self.span(), i128::from(self.steps().max(1)));
        let cols = (2 * i128::from(step) * i128::from(span[0].abs()) + steps) / (2 * steps);
        let offset = [cols as i64, step - cols as i64];
        [0, 1].map(|axis| self.start[axis] + offset[axis] * span[axis].signum())
    }

    /// The step of a sample on the path; `None` off the path.
    pub(crate) fn place(&self, at: [i64; 2]) -> Option<i64> {
        let step = (at[0] - self.start[0]).abs() + (at[1] - self.start[1]).abs();
        (step <= self.steps() && self.at(step) == at).then_some(step)
    }

    /// The steps that are in a domain: rows and columns only grow, or only fall, along a path.
    pub(crate) fn steps_in(&self, domain: &GridDomain) -> Range<i64> {
        let rect = domain.rect;
        let first = [rect.col, rect.row].map(i64::from);
        let beyond = [rect.end_col(), rect.end_row()].map(i64::from);
        let (mut from, mut to) = (0, self.steps() + 1);
        for axis in [0, 1] {
            // With the sign of the direction, coordinates grow along the path and can be bisected.
            let (sign, [low, high]) = if self.span()[axis] < 0 {
                (-1, [1 - beyond[axis], 1 - first[axis]])
            } else {
                (1, [first[axis], beyond[axis]])
            };
            from = first_where(from, to, |step| sign * self.at(step)[axis] >= low);
            to = first_where(from, to, |step| sign * self.at(step)[axis] >= high);
        }
        from..to
    }

    /// True when the path has this step, and surface beside it.
    fn borders(&self, step: i64, surface: &ProofSurface) -> bool {
        (0..self.steps()).contains(&step) && surface.borders(self.at(step), self.at(step + 1))
    }

    /// Maximum number of bytes for it in a domain.
    pub fn bytes_in(&self, domain: &GridDomain) -> u64 {
        let steps = self.steps_in(domain);
        size_of::<Self>() as u64
            + (steps.end - steps.start) as u64 * size_of::<BreaklineStop>() as u64
    }
}

/// The first number of a range from which on a monotone test holds; the end of the range if there is none.
fn first_where(from: i64, to: i64, holds: impl Fn(i64) -> bool) -> i64 {
    let (mut from, mut to) = (from, to);
    while from < to {
        let middle = from.midpoint(to);
        if holds(middle) { to = middle } else { from = middle + 1 }
    }
    from
}

/// A sample of a part on one of its lines.
#[derive(Clone, Copy, Debug)]
struct BreaklineStop {
    at: ProofPosition,
    /// Number of the line, and steps from its start.
    line: usize,
    step: i64,
    /// The surface goes on here along the line.
    goes_on: bool,
    /// The surface begins or ends here along the line, so it must be a vertex.
    is_required: bool,
    is_vertex: bool,
    has_edge: bool,
}

/// Samples of a part on breaklines, and their vertices and edges.
pub(crate) struct BreaklineCheck<'a> {
    lines: &'a [ProofBreakline],
    /// Sorted by position.
    stops: Vec<BreaklineStop>,
}

impl<'a> BreaklineCheck<'a> {
    pub(crate) fn new(
        lines: &'a [ProofBreakline],
        domain: &GridDomain,
        surface: &ProofSurface,
    ) -> Self {
        let mut stops = Vec::new();
        for (line, path) in lines.iter().enumerate() {
            stops.extend(path.steps_in(domain).map(|step| {
                let [col, row] = path.at(step);
                let (at, goes_on) = (ProofPosition::sample(col, row), path.borders(step, surface));
                BreaklineStop {
                    at,
                    line,
                    step,
                    goes_on,
                    is_required: surface.has_sample(at)
                        && !(goes_on && path.borders(step - 1, surface)),
                    is_vertex: false,
                    has_edge: false,
                }
            }));
        }
        stops.sort_unstable_by_key(|stop| (stop.at, stop.line));
        Self { lines, stops }
    }

    fn at(&mut self, at: ProofPosition) -> &mut [BreaklineStop] {
        let first = self.stops.partition_point(|stop| stop.at < at);
        let count = self.stops[first..].partition_point(|stop| stop.at == at);
        &mut self.stops[first..first + count]
    }

    /// Takes note of a vertex.
    pub(crate) fn corner(&mut self, at: ProofPosition) {
        self.at(at).iter_mut().for_each(|stop| stop.is_vertex = true);
    }

    /// Takes note of an edge.
    pub(crate) fn edge(&mut self, [a, b]: [ProofPosition; 2]) {
        let lines = self.lines;
        for (from, to) in [(a, b), (b, a)] {
            let stops = self.at(from);
            if stops.is_empty() || !to.is_sample() {
                continue;
            }
            let to = [to.col, to.row].map(|fixed| fixed >> ProofPosition::FRACTION);
            for stop in stops {
                stop.has_edge |= lines[stop.line].place(to).is_some_and(|step| step > stop.step);
            }
        }
    }

    /// Counts the vertices on lines, and the samples where the mesh does not follow them.
    pub(crate) fn finish(self, tally: &mut ProofTally) {
        for at in self.stops.chunk_by(|a, b| a.at == b.at) {
            tally.on_lines += u64::from(at[0].is_vertex);
        }
        for stop in self.stops {
            let is_missing = stop.is_required && !stop.is_vertex;
            if is_missing || stop.is_vertex && stop.goes_on && !stop.has_edge {
                tally.not_followed.add(stop.at);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Rect;

    fn samples(a: [u32; 2], b: [u32; 2]) -> Vec<[i64; 2]> {
        let line = ProofBreakline::between(a, b);
        (0..=line.steps()).map(|step| line.at(step)).collect()
    }

    #[test]
    fn a_path_keeps_to_the_nearest_columns() {
        assert_eq!(samples([4, 7], [4, 7]), [[4, 7]]);
        assert_eq!(samples([2, 5], [4, 5]), [[2, 5], [3, 5], [4, 5]]);
        assert_eq!(samples([2, 7], [2, 5]), [[2, 5], [2, 6], [2, 7]]);
        // Halves are rounded up: the column comes first.
        assert_eq!(samples([0, 0], [2, 2]), [[0, 0], [1, 0], [1, 1], [2, 1], [2, 2]]);
        assert_eq!(samples([9, 0], [7, 2]), [[9, 0], [8, 0], [8, 1], [7, 1], [7, 2]]);
        assert_eq!(
            samples([0, 0], [2, 5]),
            [[0, 0], [0, 1], [1, 1], [1, 2], [1, 3], [1, 4], [2, 4], [2, 5]]
        );
        for step in samples([3, 40], [31, 2]).windows(2) {
            let off = [0, 1].map(|axis| (step[1][axis] - step[0][axis]).abs());
            assert_eq!(off[0] + off[1], 1);
        }
    }

    #[test]
    fn a_sample_beside_a_path_is_not_on_it() {
        let line = ProofBreakline::between([0, 0], [2, 5]);
        let on = samples([0, 0], [2, 5]);
        for (col, row) in (-2..5).flat_map(|col| (-2..8).map(move |row| (col, row))) {
            let expected = on.iter().position(|&at| at == [col, row]).map(|step| step as i64);
            assert_eq!(line.place([col, row]), expected, "{col} {row}");
        }
    }

    #[test]
    fn a_domain_has_the_steps_over_its_samples() {
        let ends = [[3, 40], [31, 2], [90, 61], [0, 0], [50, 2], [3, 3], [31, 90]];
        for (a, b) in ends.into_iter().flat_map(|a| ends.map(|b| (a, b))) {
            let line = ProofBreakline::between(a, b);
            for rect in [Rect::new(5, 7, 20, 30), Rect::new(0, 0, 4, 4), Rect::new(30, 60, 61, 40)]
            {
                let domain = GridDomain { rect, grid: [100, 100] };
                let inside = |&step: &i64| {
                    let [col, row] = line.at(step);
                    rect.contains(col as u32, row as u32)
                };
                let expected: Vec<_> = (0..=line.steps()).filter(inside).collect();
                assert_eq!(line.steps_in(&domain).collect::<Vec<_>>(), expected, "{a:?} {b:?}");
            }
        }
    }
}
