//! Breaklines: edges that go from sample to sample along a line.
//!
//! A segment between two samples stands for a path of samples, each a step along a row or a column from the one
//! before, that are nearest to it in this sense: with n steps in all, of which c are along rows, the sample
//! after k of them is round(k c / n) columns on, halves rounded up. It begins at the end that comes first by
//! row and column. The mesh follows it if every vertex on the path has an edge to a vertex further on along it,
//! and if all samples are vertices where the path, or the surface under it, begins or ends. Then edges run
//! along the whole of it.

use super::Part;
use super::domain::Domain;
use super::surface::Surface;
use super::tally::Tally;
use super::triangle::Position;

/// A segment of a breakline, by the columns and rows of its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Line {
    start: [i64; 2],
    end: [i64; 2],
}

impl Line {
    /// Between two samples, in either order.
    pub fn between(a: [u32; 2], b: [u32; 2]) -> Self {
        let [a, b] = [a, b].map(|at| at.map(i64::from));
        let (start, end) = if [a[1], a[0]] <= [b[1], b[0]] { (a, b) } else { (b, a) };
        Self { start, end }
    }

    /// Most bytes that it takes in a domain.
    pub fn bytes_in(self, domain: &Domain) -> u64 {
        let steps = [0, 1].map(|axis| self.end[axis].abs_diff(self.start[axis]));
        let sides = u64::from(domain.rect.width) + u64::from(domain.rect.height);
        size_of::<Self>() as u64 + (steps[0] + steps[1] + 1).min(sides) * size_of::<Stop>() as u64
    }

    /// Columns and rows gone from the start, where a sample is on the way to the end.
    fn gone(&self, at: [i64; 2]) -> Option<[i64; 2]> {
        let along = |axis: usize| {
            let [whole, gone] = [self.end[axis], at[axis]].map(|to| to - self.start[axis]);
            let gone = gone * whole.signum();
            let rest = whole.abs() - gone;
            (gone >= 0 && rest >= 0 && (whole != 0 || at[axis] == self.start[axis])).then_some(gone)
        };
        Some([along(0)?, along(1)?])
    }

    /// True when the path has gone so many columns and rows at some time.
    fn comes_to(&self, [cols, rows]: [i64; 2]) -> bool {
        let whole = [0, 1].map(|axis| i128::from(self.end[axis] - self.start[axis]).abs());
        let (steps, all) = (i128::from(cols + rows), whole[0] + whole[1]);
        let twice_off = 2 * (steps * whole[0] - i128::from(cols) * all);
        all == 0 || (-all <= twice_off && twice_off < all)
    }

    /// After how many steps the path comes to a sample, if it does.
    fn place(&self, at: [i64; 2]) -> Option<i64> {
        let gone = self.gone(at).filter(|&gone| self.comes_to(gone))?;
        Some(gone[0] + gone[1])
    }

    /// All samples of the path, step by step.
    fn samples(self) -> impl Iterator<Item = [i64; 2]> {
        let mut next = Some(self.start);
        std::iter::from_fn(move || {
            let at = next?;
            let steps = [0, 1].map(|axis| {
                let mut on = at;
                on[axis] += (self.end[axis] - self.start[axis]).signum();
                on
            });
            next = steps.into_iter().find(|&on| on != at && self.place(on).is_some());
            Some(at)
        })
    }
}

/// A sample of a part on one of its lines.
#[derive(Clone, Copy, Debug)]
struct Stop {
    at: Position,
    /// Number of the line, and steps from its start.
    line: usize,
    step: i64,
    /// The surface goes on here along the line.
    goes_on: bool,
    /// All there is to it: it may be no vertex.
    has_to_be: bool,
    is_vertex: bool,
    has_edge: bool,
}

/// What a part has of lines.
pub(crate) struct Follow<'a> {
    part: &'a Part<'a>,
    /// Sorted by position.
    stops: Vec<Stop>,
}

impl<'a> Follow<'a> {
    pub(crate) fn new(part: &'a Part<'a>, surface: &Surface) -> Self {
        let mut stops = Vec::new();
        for (line, &path) in part.lines.iter().enumerate() {
            let mut before = false;
            let mut samples = path.samples().peekable();
            let mut step = 0;
            while let Some([col, row]) = samples.next() {
                let at = Position::sample(col, row);
                if !part.domain.owns(at) {
                    // What led here is seen again where it matters: a step is judged from both of its ends.
                    before = samples.peek().is_some_and(|&to| {
                        part.domain.owns(Position::sample(to[0], to[1]))
                            && surface.borders([col, row], to)
                    });
                    step += 1;
                    continue;
                }
                let goes_on = samples.peek().is_some_and(|&to| surface.borders([col, row], to));
                let has_to_be = surface.has_sample(at) && !(before && goes_on);
                stops.push(Stop {
                    at,
                    line,
                    step,
                    goes_on,
                    has_to_be,
                    is_vertex: false,
                    has_edge: false,
                });
                before = goes_on;
                step += 1;
            }
        }
        stops.sort_unstable_by_key(|stop| (stop.at, stop.line));
        Self { part, stops }
    }

    fn at(&mut self, at: Position) -> &mut [Stop] {
        let first = self.stops.partition_point(|stop| stop.at < at);
        let count = self.stops[first..].partition_point(|stop| stop.at == at);
        &mut self.stops[first..first + count]
    }

    /// Takes note of a vertex.
    pub(crate) fn corner(&mut self, at: Position) {
        self.at(at).iter_mut().for_each(|stop| stop.is_vertex = true);
    }

    /// Takes note of an edge.
    pub(crate) fn edge(&mut self, [a, b]: [Position; 2]) {
        let lines = self.part.lines;
        for (from, to) in [(a, b), (b, a)] {
            let stops = self.at(from);
            if stops.is_empty() || !to.is_sample() {
                continue;
            }
            let to = [to.col, to.row].map(|fixed| fixed >> Position::FRACTION);
            for stop in stops {
                stop.has_edge |= lines[stop.line].place(to).is_some_and(|step| step > stop.step);
            }
        }
    }

    /// Counts the vertices on lines, and the samples where the mesh does not follow them.
    pub(crate) fn finish(self, tally: &mut Tally) {
        for at in self.stops.chunk_by(|a, b| a.at == b.at) {
            tally.on_lines += u64::from(at[0].is_vertex);
        }
        for stop in self.stops {
            let is_missing = stop.has_to_be && !stop.is_vertex;
            if is_missing || stop.is_vertex && stop.goes_on && !stop.has_edge {
                tally.not_followed.add(stop.at);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_keeps_to_the_nearest_columns() {
        let samples = |a, b| Line::between(a, b).samples().collect::<Vec<_>>();
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
        let line = Line::between([0, 0], [2, 5]);
        let on: Vec<_> = line.samples().collect();
        for (col, row) in (-2..5).flat_map(|col| (-2..8).map(move |row| (col, row))) {
            let expected = on.iter().position(|&at| at == [col, row]).map(|step| step as i64);
            assert_eq!(line.place([col, row]), expected, "{col} {row}");
        }
    }
}
