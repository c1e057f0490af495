//! Error between samples, at the intersections of mesh edges with the lines between neighbouring samples.
//!
//! Along such a line the grid is straight, however it is read, and the mesh bends only where one of its
//! edges crosses. So the two are furthest apart at a sample or at a crossing, and a mesh that keeps to the
//! tolerance at both keeps to it along every line. An edge that rises `n` rows crosses `n - 1` of them
//! between its ends, each where the whole numbers of a division say; so with columns. The difference at a
//! crossing, times `n`, is a sum of four heights with whole weights, and is decided like that of a sample
//! (see [`exact`](super::exact)).
//!
//! Edges along a line of the lattice, and those at 45 degrees, cross nothing between samples. Neither does
//! any edge cross one of the unit lattice, which is in every Delaunay triangulation of the samples at its
//! ends: to insert both ends of a line mends it, whatever else is inserted.

use super::exact::is_at_most;
use super::heights::HeightField;
use super::lattice_position::TilePosition;

/// An intersection beyond the tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EdgeCrossing {
    /// Vertical distance.
    pub(super) error: f64,
    /// The two neighbouring samples, the nearer one first.
    pub(super) samples: [TilePosition; 2],
}

/// Tests intersections of edges with lattice lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrossingJudge<'a> {
    field: &'a HeightField,
    tolerance: f64,
    /// Bound on the rounding error of a difference.
    hair: f64,
}

/// One of the two kinds of lines of the lattice.
#[derive(Clone, Copy)]
enum LineDirection {
    Rows,
    Columns,
}

impl<'a> CrossingJudge<'a> {
    pub(super) fn new(field: &'a HeightField, tolerance: f64) -> Self {
        // Some ten roundings of heights and of sums of them.
        let hair = 32.0 * f64::EPSILON * (field.largest() + tolerance);
        Self { field, tolerance, hair }
    }

    /// True once the work is cancelled.
    pub(super) fn is_stopped(&self) -> bool {
        self.field.is_stopped()
    }

    /// The same, tested in every thousandth round of a loop.
    pub(super) fn is_stopped_in(&self, round: usize) -> bool {
        self.field.is_stopped_in(round)
    }

    /// The worst intersection of the edge between `a` and `b`, if it is beyond the tolerance. All samples beside the
    /// edge must be valid. The result does not depend on the direction; time linear in the length of the edge.
    #[inline]
    pub(super) fn worst(&self, a: TilePosition, b: TilePosition) -> Option<EdgeCrossing> {
        let (a, b) = (a.min(b), a.max(b));
        let [dx, dy] = [b.col().abs_diff(a.col()), b.row() - a.row()];
        if dx == 0 || dy == 0 || dx == dy {
            return None;
        }
        let rows = self.worst_of(LineDirection::Rows, a, b);
        let columns = match a.col() < b.col() {
            true => self.worst_of(LineDirection::Columns, a, b),
            false => self.worst_of(LineDirection::Columns, b, a),
        };
        match (rows, columns) {
            (Some(rows), Some(columns)) if columns.error > rows.error => Some(columns),
            (None, columns) => columns,
            (rows, _) => rows,
        }
    }

    /// As [`Self::worst`], of the lines of one kind that lie between `from` and `to`, the later of them.
    fn worst_of(
        &self,
        lines: LineDirection,
        from: TilePosition,
        to: TilePosition,
    ) -> Option<EdgeCrossing> {
        let walk = EdgeWalk::new(lines.place(from), lines.place(to));
        let [line_stride, stride] = lines.strides(self.field.width() as usize);
        let ends = [self.field.vertex(from), self.field.vertex(to)];
        let share = 1.0 / f64::from(walk.n);
        let slope = (ends[1] - ends[0]) * share;
        let mut threshold = self.tolerance - self.hair;
        let mut worst = None;
        for EdgeCut { k, line, along, rest } in walk {
            let at = line as usize * line_stride + along as usize * stride;
            let line_ends = [self.field.at(at), self.field.at(at + stride)];
            let grid = line_ends[0] + (line_ends[1] - line_ends[0]) * (f64::from(rest) * share);
            let error = (ends[0] + slope * f64::from(k) - grid).abs();
            if error <= threshold || self.is_within(error, [k, rest, walk.n], ends, line_ends) {
                continue;
            }
            let near = along + i32::from(2 * rest > walk.n);
            let far = 2 * along + 1 - near;
            worst =
                Some(EdgeCrossing { error, samples: [near, far].map(|at| lines.local(line, at)) });
            threshold = error;
        }
        worst
    }

    /// Tests an intersection at the fraction `k / n` of an edge and `rest / n` of a line between two samples, given the
    /// heights at their ends and their approximate distance.
    #[inline]
    fn is_within(
        &self,
        error: f64,
        [k, rest, n]: [i32; 3],
        [a, b]: [f64; 2],
        [low, high]: [f64; 2],
    ) -> bool {
        // Times n, all weights are whole, so the exact test has no division to round.
        let weights = [n - k, k, rest - n, -rest].map(f64::from);
        let terms = [(weights[0], a), (weights[1], b), (weights[2], low), (weights[3], high)];
        error <= self.tolerance + self.hair && is_at_most(terms, self.tolerance, f64::from(n))
    }
}

impl LineDirection {
    /// A position as line number and offset along the line.
    fn place(self, p: TilePosition) -> [i32; 2] {
        match self {
            Self::Rows => [p.row() as i32, p.col() as i32],
            Self::Columns => [p.col() as i32, p.row() as i32],
        }
    }

    /// The inverse of [`Self::place`].
    fn local(self, line: i32, along: i32) -> TilePosition {
        match self {
            Self::Rows => TilePosition::new(along as u32, line as u32),
            Self::Columns => TilePosition::new(line as u32, along as u32),
        }
    }

    /// Samples from one line to the next, and from one sample of a line to the next, in rows of `width`.
    fn strides(self, width: usize) -> [usize; 2] {
        match self {
            Self::Rows => [width, 1],
            Self::Columns => [1, width],
        }
    }
}

/// The lattice lines that an edge crosses, from one end to the other.
#[derive(Clone, Copy)]
struct EdgeWalk {
    line: i32,
    along: i32,
    rest: i32,
    k: i32,
    /// Number of lines spanned by the edge.
    n: i32,
    step: i32,
    step_rest: i32,
}

/// Intersection of an edge and a line: at the fraction `k / n` of the edge, `rest / n` after the sample `along`.
struct EdgeCut {
    k: i32,
    line: i32,
    along: i32,
    rest: i32,
}

impl EdgeWalk {
    /// Both ends as line number and offset; the line of the first is the lower one.
    fn new([line, along]: [i32; 2], [last, end]: [i32; 2]) -> Self {
        let (n, shift) = (last - line, end - along);
        let (step, step_rest) = (shift.div_euclid(n), shift.rem_euclid(n));
        // Without a remainder it cuts at samples only: at the end of the walk at once.
        let k = if step_rest == 0 { n } else { 0 };
        Self { line, along, rest: 0, k, n, step, step_rest }
    }
}

impl Iterator for EdgeWalk {
    type Item = EdgeCut;

    #[inline(always)]
    fn next(&mut self) -> Option<EdgeCut> {
        loop {
            self.k += 1;
            if self.k >= self.n {
                return None;
            }
            self.line += 1;
            self.along += self.step;
            self.rest += self.step_rest;
            if self.rest >= self.n {
                self.rest -= self.n;
                self.along += 1;
            }
            if self.rest > 0 {
                let Self { k, line, along, rest, .. } = *self;
                return Some(EdgeCut { k, line, along, rest });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::HeightWindow;
    use proptest::prelude::*;

    /// Every line between two neighbouring samples, intersected with the edge in whole numbers: the largest
    /// error as a fraction, if it is beyond the tolerance.
    fn worst_twin(
        heights: &[i64],
        width: i64,
        [a, b]: [[i64; 2]; 2],
        tolerance: i64,
    ) -> Option<(i64, i64)> {
        let height = |[col, row]: [i64; 2]| heights[(row * width + col) as usize];
        let mut worst: Option<(i64, i64)> = None;
        for axis in [0, 1] {
            for line in a[axis].min(b[axis]) + 1..a[axis].max(b[axis]) {
                let n = (b[axis] - a[axis]).abs();
                let k = (line - a[axis]).abs();
                let along = a[1 - axis] * (n - k) + b[1 - axis] * k; // in n-ths
                let (first, rest) = (along.div_euclid(n), along.rem_euclid(n));
                if rest == 0 {
                    continue;
                }
                let sample = |along| if axis == 0 { [line, along] } else { [along, line] };
                let mesh = height(a) * (n - k) + height(b) * k;
                let grid = height(sample(first)) * (n - rest) + height(sample(first + 1)) * rest;
                let error = (mesh - grid).abs();
                let is_larger = worst.is_none_or(|(most, of)| error * of > most * n);
                if error > tolerance * n && is_larger {
                    worst = Some((error, n));
                }
            }
        }
        worst
    }

    proptest! {
        #[test]
        fn the_worst_crossing_is_that_of_whole_numbers(
            heights in proptest::collection::vec(-40_i64..40, 17 * 13),
            a in (0_u32..17, 0_u32..13), b in (0_u32..17, 0_u32..13), tolerance in 0_i64..60,
        ) {
            let values: Vec<f32> = heights.iter().map(|&z| z as f32).collect();
            let view = HeightWindow { width: 17, height: 13, f32: &values, f64: None };
            let mut field = HeightField::default();
            field.load(&view, [0, 0, 17, 13], [0; 4], None);
            let crossings = CrossingJudge::new(&field, tolerance as f64);
            let [p, q] = [a, b].map(|(col, row)| TilePosition::new(col, row));
            let found = crossings.worst(p, q);
            prop_assert_eq!(found, crossings.worst(q, p));
            let ends = [a, b].map(|(col, row)| [i64::from(col), i64::from(row)]);
            let expected = worst_twin(&heights, 17, ends, tolerance);
            prop_assert_eq!(found.is_some(), expected.is_some());
            if let (Some(found), Some((error, of))) = (found, expected) {
                prop_assert!((found.error - error as f64 / of as f64).abs() < 1e-9);
                let [near, far] = found.samples.map(TilePosition::lattice);
                prop_assert_eq!((near[0] - far[0]).abs() + (near[1] - far[1]).abs(), 1);
                // The edge meets their line no further from the nearer one, and the lower one of equals.
                let axis = usize::from(near[0] == far[0]);
                let ends = ends.map(|end| [end[0] as i32, end[1] as i32]);
                let n = ends[1][1 - axis] - ends[0][1 - axis];
                let k = near[1 - axis] - ends[0][1 - axis];
                let along = (ends[0][axis] * (n - k) + ends[1][axis] * k) * n.signum();
                let away = |sample: [i32; 2]| (sample[axis] * n.abs() - along).abs();
                prop_assert!((away(near), near[axis]) < (away(far), far[axis]));
                prop_assert!(away(near) + away(far) == n.abs(), "the edge passes beside the samples");
            }
        }
    }

    #[test]
    fn the_tolerance_itself_is_within_and_the_next_number_is_not() {
        // The edge from (0, 0) to (1, 2) crosses row 1 half way between its samples. All are far from
        // zero, which makes no difference.
        let heights = [0.0, 0.0, 1.0, 2.0, 0.0, 0.0_f32].map(|z| z + 10.0);
        let view = HeightWindow { width: 2, height: 3, f32: &heights, f64: None };
        let mut field = HeightField::default();
        field.load(&view, [0, 0, 2, 3], [0; 4], None);
        let worst = |tolerance| {
            CrossingJudge::new(&field, tolerance)
                .worst(TilePosition::new(0, 0), TilePosition::new(1, 2))
        };
        assert_eq!(worst(1.5), None);
        let found = worst(1.5_f64.next_down()).unwrap();
        assert_eq!(found.samples, [TilePosition::new(0, 1), TilePosition::new(1, 1)]);
    }
}
