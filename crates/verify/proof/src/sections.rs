//! Intersections of lattice rows with a triangle: exact, by incremental division.

use std::ops::{Add, Mul, RangeInclusive, Sub};

use super::triangle::{ProofPosition, ProofTriangle};

/// The part of a row of the lattice that lies in a triangle, in columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RowSection {
    /// Left end, rounded down, and whether it has a fraction.
    pub(crate) left: (i64, bool),
    /// Right end likewise.
    pub(crate) right: (i64, bool),
}

impl RowSection {
    /// Samples in the closed triangle: first, and one past the last.
    pub(crate) fn samples(&self) -> [i64; 2] {
        [self.left.0 + i64::from(self.left.1), self.right.0 + 1]
    }

    /// Samples strictly between the ends.
    pub(crate) fn inner(&self) -> [i64; 2] {
        [self.left.0 + 1, self.right.0 + i64::from(self.right.1)]
    }

    /// Cells between the ends.
    pub(crate) fn cells(&self) -> [i64; 2] {
        [self.left.0, self.right.0 + i64::from(self.right.1)]
    }
}

/// The integer arithmetic needed: `i64` for samples in reach, `i128` for everything.
pub(crate) trait SectionInt:
    Copy + Ord + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// Fraction bits of coordinates.
    const FRACTION: u32;
    /// A coordinate from 2^-30 cell.
    fn coordinate(fixed: i64) -> Self;
    /// A whole number of cells.
    fn whole(value: i64) -> Self;
    /// Quotient rounded down and remainder, for a positive divisor.
    fn div_floor(self, by: Self) -> (Self, Self);
    /// As a column.
    fn column(self) -> i64;
    /// As a float, rounded.
    fn float(self) -> f64;
    /// Without loss, as `i128`.
    fn wide(self) -> i128;
}

impl SectionInt for i64 {
    const FRACTION: u32 = 0;
    fn coordinate(fixed: i64) -> Self {
        fixed >> ProofPosition::FRACTION
    }
    fn whole(value: i64) -> Self {
        value
    }
    fn div_floor(self, by: Self) -> (Self, Self) {
        (self.div_euclid(by), self.rem_euclid(by))
    }
    fn column(self) -> i64 {
        self
    }
    fn float(self) -> f64 {
        self as f64
    }
    fn wide(self) -> i128 {
        self.into()
    }
}

impl SectionInt for i128 {
    const FRACTION: u32 = ProofPosition::FRACTION;
    fn coordinate(fixed: i64) -> Self {
        Self::from(fixed)
    }
    fn whole(value: i64) -> Self {
        Self::from(value)
    }
    fn div_floor(self, by: Self) -> (Self, Self) {
        (self.div_euclid(by), self.rem_euclid(by))
    }
    fn column(self) -> i64 {
        self as i64
    }
    fn float(self) -> f64 {
        self as f64
    }
    fn wide(self) -> i128 {
        self
    }
}

/// True when `i64` is enough: all are samples, less than 2^30 cells apart.
pub(crate) fn is_small(corners: &[ProofPosition]) -> bool {
    let first = corners[0];
    corners.iter().all(|p| {
        let offset = [p.col - first.col, p.row - first.row];
        p.is_sample() && offset.iter().all(|&d| floor(d).unsigned_abs() < 1 << 29)
    })
}

/// The crossing of an edge with one row after the other: at `column` and `rest / divisor` of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeRowWalk<N> {
    pub(crate) column: i64,
    pub(crate) rest: N,
    pub(crate) divisor: N,
    step: i64,
    step_rest: N,
}

impl<N: SectionInt> EdgeRowWalk<N> {
    /// Starts on the edge from `a` down to `b` (`a.row < b.row`) at `row`.
    #[inline]
    pub(crate) fn new(a: ProofPosition, b: ProofPosition, row: i64) -> Self {
        let (x, y) = (N::coordinate(a.col), N::coordinate(a.row));
        let (dx, dy) = (N::coordinate(b.col) - x, N::coordinate(b.row) - y);
        let cell = N::whole(1 << N::FRACTION);
        let divisor = cell * dy;
        let (column, rest) = (x * dy + (cell * N::whole(row) - y) * dx).div_floor(divisor);
        let (step, step_rest) = (cell * dx).div_floor(divisor);
        Self { column: column.column(), rest, step: step.column(), step_rest, divisor }
    }

    #[inline(always)]
    fn at(&self) -> (i64, bool) {
        (self.column, self.rest > N::whole(0))
    }

    #[inline(always)]
    pub(crate) fn advance(&mut self) {
        self.column += self.step;
        self.rest = self.rest + self.step_rest;
        if self.rest >= self.divisor {
            self.rest = self.rest - self.divisor;
            self.column += 1;
        }
    }
}

/// Calls `visit` with each row of the lattice in `from ..= to` that crosses the closed triangle
/// (of non-zero area).
#[inline]
pub(crate) fn sections<N: SectionInt>(
    triangle: &ProofTriangle,
    from: i64,
    to: i64,
    mut visit: impl FnMut(i64, RowSection),
) {
    let mut p = triangle.positions();
    p.sort_unstable();
    let [top, middle, bottom] = p;
    let from = from.max(ceil(top.row));
    let to = to.min(floor(bottom.row));
    if from > to {
        return;
    }
    let bend_right = super::exact::double_area(top, bottom, middle) < 0;
    let mut long = EdgeRowWalk::<N>::new(top, bottom, from);
    // The row of the middle corner belongs to the upper edge, unless that edge is a row.
    let bend = if top.row < middle.row { floor(middle.row) } else { from - 1 };
    let (upper, lower) = (from..=to.min(bend), from.max(bend + 1)..=to);
    rows_between(upper, &mut long, [top, middle], bend_right, &mut visit);
    rows_between(lower, &mut long, [middle, bottom], bend_right, &mut visit);
}

/// Visits `rows` between the longest edge of a triangle and another one.
#[inline]
fn rows_between<N: SectionInt>(
    rows: RangeInclusive<i64>,
    long: &mut EdgeRowWalk<N>,
    [a, b]: [ProofPosition; 2],
    bend_right: bool,
    visit: &mut impl FnMut(i64, RowSection),
) {
    if rows.is_empty() {
        return;
    }
    let mut short = EdgeRowWalk::<N>::new(a, b, *rows.start());
    for row in rows {
        let (left, right) =
            if bend_right { (long.at(), short.at()) } else { (short.at(), long.at()) };
        visit(row, RowSection { left, right });
        long.advance();
        short.advance();
    }
}

/// The cells between rows `row` and `row + 1` that overlap the triangle (of non-zero area), first
/// and one past the last; `None` when there are none. For triangles of any position.
pub(crate) fn strip(triangle: &ProofTriangle, row: i64) -> Option<[i64; 2]> {
    let (mut first, mut end) = (i64::MAX, i64::MIN);
    sections::<i128>(triangle, row, row + 1, |_, section| {
        let [from, to] = section.cells();
        (first, end) = (first.min(from), end.max(to));
    });
    for corner in triangle.positions() {
        if floor(corner.row) == row && ceil(corner.row) == row + 1 {
            (first, end) = (first.min(floor(corner.col)), end.max(ceil(corner.col)));
        }
    }
    let [low, high] = triangle.bounds();
    let overlaps = floor(high.row - 1) >= row && low.row < (row + 1) << ProofPosition::FRACTION;
    (overlaps && first <= end).then_some([first, end])
}

/// True for a whole number of cells.
pub(crate) fn is_whole(fixed: i64) -> bool {
    fixed & (ProofPosition::CELL - 1) == 0
}

/// Whole part.
pub(crate) fn floor(fixed: i64) -> i64 {
    fixed >> ProofPosition::FRACTION
}

/// Rounded up.
pub(crate) fn ceil(fixed: i64) -> i64 {
    -(-fixed >> ProofPosition::FRACTION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::double_area;
    use crate::triangle::ProofVertex;
    use proptest::prelude::*;

    /// Halves of cells, so that lattice and other corners mix.
    fn triangle(points: [[i64; 2]; 3]) -> ProofTriangle {
        let at = |[c, r]: [i64; 2]| ProofPosition {
            col: c * ProofPosition::CELL / 2,
            row: r * ProofPosition::CELL / 2,
        };
        ProofTriangle { corners: points.map(|p| ProofVertex { at: at(p), z: 0.0 }) }
    }

    fn side(t: &ProofTriangle, at: ProofPosition) -> [i128; 3] {
        let [a, b, c] = t.positions();
        let sign = t.double_area().signum();
        [double_area(at, b, c), double_area(a, at, c), double_area(a, b, at)].map(|w| w * sign)
    }

    fn found<N: SectionInt>(t: &ProofTriangle) -> (Vec<[i64; 2]>, Vec<[i64; 2]>) {
        let (mut closed, mut strict) = (Vec::new(), Vec::new());
        let [low, high] = t.bounds();
        sections::<N>(t, -100, 100, |row, s| {
            closed.extend((s.samples()[0]..s.samples()[1]).map(|col| [row, col]));
            let inside = low.row < row << ProofPosition::FRACTION
                && row << ProofPosition::FRACTION < high.row;
            strict.extend((s.inner()[0]..s.inner()[1]).filter(|_| inside).map(|col| [row, col]));
        });
        (closed, strict)
    }

    proptest! {
        #[test]
        fn sections_hold_the_samples_inside(
            points in prop::array::uniform3([-20i64..20, -20i64..20]), doubled in any::<bool>(),
        ) {
            let points = if doubled { points.map(|p| p.map(|v| v * 2)) } else { points };
            let t = triangle(points);
            prop_assume!(t.double_area() != 0);
            let all = (-21..=21).flat_map(|r| (-21..=21).map(move |c| [r, c]));
            let in_triangle = |strict: bool| {
                let inside = |w: i128| if strict { w > 0 } else { w >= 0 };
                let keep = |p: &[i64; 2]| side(&t, ProofPosition::sample(p[1], p[0])).into_iter().all(inside);
                all.clone().filter(keep).collect::<Vec<_>>()
            };
            let wide = found::<i128>(&t);
            prop_assert_eq!(&wide, &(in_triangle(false), in_triangle(true)));
            if is_small(&t.positions()) {
                prop_assert_eq!(found::<i64>(&t), wide);
            }
        }

        #[test]
        fn strips_hold_the_cells_overlapped(points in prop::array::uniform3([-8i64..8, -8i64..8])) {
            let t = triangle(points);
            prop_assume!(t.double_area() != 0);
            for row in -6..6 {
                let cells = strip(&t, row).unwrap_or([0, 0]);
                for col in -6..6 {
                    // A cell overlaps when some point of a fine net inside it is strictly inside.
                    let net = (1..24).flat_map(|i| (1..24).map(move |j| (i, j)));
                    let step = ProofPosition::CELL / 24;
                    let hit = net.into_iter().any(|(i, j)| {
                        let corner = ProofPosition::sample(col, row);
                        let at = ProofPosition { row: corner.row + j * step, col: corner.col + i * step };
                        side(&t, at).into_iter().all(|w| w > 0)
                    });
                    let marked = (cells[0]..cells[1]).contains(&col);
                    prop_assert!(marked || !hit, "cell {},{} missed", col, row);
                    if !hit && marked {
                        // Too thin for the net: the exact overlap must still have area.
                        prop_assert!(clipped_area(points, col, row) > 1e-12);
                    }
                }
            }
        }
    }

    /// Area of the triangle (in half cells) within a cell, by clipping in `f64`.
    fn clipped_area(points: [[i64; 2]; 3], col: i64, row: i64) -> f64 {
        let mut polygon: Vec<[f64; 2]> =
            points.iter().map(|p| [p[0] as f64 / 2.0, p[1] as f64 / 2.0]).collect();
        for (axis, bound, sign) in
            [(0, col, 1.0), (0, col + 1, -1.0), (1, row, 1.0), (1, row + 1, -1.0)]
        {
            let depth = |p: &[f64; 2]| sign * (p[axis] - bound as f64);
            let mut next = Vec::new();
            for i in 0..polygon.len() {
                let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
                let (a, b) = (depth(&p), depth(&q));
                if a >= 0.0 {
                    next.push(p);
                }
                if a * b < 0.0 {
                    let t = a / (a - b);
                    next.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
                }
            }
            polygon = next;
        }
        let cross = |i: usize| {
            let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            p[0] * q[1] - p[1] * q[0]
        };
        (0..polygon.len()).map(cross).sum::<f64>().abs() / 2.0
    }
}
