//! The lattice of the cells of a grid: the cell of a point, and its distance from the centre of a cell,
//! independent of the origin of the grid.

use std::ops::Range;

use terrane_base::geom::{Affine, Decimal, Point, PointFrame};

/// The two borders that belong to a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CellEdgeRule {
    /// The lower ones: [W, E) x [S, N).
    #[default]
    LowerClosed,
    /// The western and the northern one: [W, E) x (S, N].
    NorthClosed,
}

/// A lattice of cells: all cells of one size that share their corners with a given one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellLattice {
    /// From west to east.
    pub x: LatticeAxis,
    /// From north to south; its lattice indices increase to the north nevertheless.
    pub y: LatticeAxis,
}

impl CellLattice {
    /// Cells of `cell` (x, y) world units with a corner at `anchor`, over points of `frame`.
    pub fn new(frame: &PointFrame, anchor: [f64; 2], cell: [f64; 2], edges: CellEdgeRule) -> Self {
        let x = LatticeAxis::new(frame, 0, anchor[0], cell[0]);
        let y = LatticeAxis::new(frame, 1, anchor[1], cell[1]).down();
        let y = if edges == CellEdgeRule::NorthClosed { y.upper_closed() } else { y };
        let a = x.decimals(frame.scale[0], frame.offset[0]);
        let b = y.decimals(frame.scale[1], frame.offset[1]);
        let Some((a, b)) = a.zip(b) else { return Self { x, y } };
        let digits = a.digits().max(b.digits());
        Self {
            x: LatticeAxis { units: a.units(digits), ..x },
            y: LatticeAxis { units: b.units(digits), ..y },
        }
    }

    /// The unit of distances up to `reach`.
    pub fn unit(&self, reach: f64) -> DistanceUnit {
        let exact = self.x.units.zip(self.y.units).map(|(x, _)| DistanceUnit::exact(x.digits));
        exact
            .filter(|unit| reach / unit.size < MAX_UNITS)
            .unwrap_or(DistanceUnit { size: reach / COARSE_UNITS, digits: None })
    }

    /// The lattice indices of the cells (x, y) that hold the lowest and highest of two points.
    pub fn span(&self, [low, high]: [Point; 2]) -> [[i64; 2]; 2] {
        [[self.x.index(low.x), self.x.index(high.x)], [self.y.index(low.y), self.y.index(high.y)]]
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.x.count, self.y.count)
    }

    /// World position of the centres of cells.
    pub fn transform(&self) -> Affine {
        let [x0, y0] = [self.x.world_centre(0), self.y.world_centre(0)];
        Affine { x0, a: self.x.world_cell, b: 0.0, y0, d: 0.0, e: -self.y.world_cell }
    }

    /// World area of a cell.
    pub fn area(&self) -> f64 {
        self.x.world_cell * self.y.world_cell
    }
}

/// Unit of distances from points to the centres of cells, in which they are integers and compared exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceUnit {
    /// World units.
    pub size: f64,
    /// Number of decimals of all points, borders and centres; the unit is half of the last one. `None` if there
    /// are too many: then distances are rounded to units.
    digits: Option<u32>,
}

/// Twice the square of this number of units fits into `u128`.
const MAX_UNITS: f64 = (1_u64 << 61) as f64;
/// Units of a radius if decimals cannot be used.
const COARSE_UNITS: f64 = (1_u64 << 48) as f64;

impl DistanceUnit {
    fn exact(digits: u32) -> Self {
        Self { size: Decimal::new(1, digits).value() / 2.0, digits: Some(digits) }
    }

    /// The smallest squared distance that is not below that of `radius`, at most `MAX_UNITS`.
    pub fn square(&self, radius: f64) -> u128 {
        let exact = self.digits.zip(Decimal::of(radius));
        exact.and_then(|(digits, radius)| square(radius, digits)).unwrap_or_else(|| {
            let units = (radius / self.size).ceil();
            (units * units) as u128
        })
    }
}

/// The square of twice a number in units of 10^-`digits`, rounded up.
fn square(number: Decimal, digits: u32) -> Option<u128> {
    let finest = number.digits().max(digits);
    let units = number.units(finest)?.checked_mul(2)?.unsigned_abs();
    let ten = 10_u128.checked_pow(2 * (finest - digits))?;
    Some(units.checked_mul(units)?.div_ceil(ten))
}

/// One axis of a lattice, and the stretch of it that a grid covers.
///
/// Where the cell size is a whole number of steps, points are put into cells in whole numbers. Elsewhere the
/// cell of a point with world coordinate w has the lattice index floor((w - anchor) / cell). Where the upper
/// border belongs to a cell, it has the index ceil((w - anchor) / cell) minus one. The rule does not depend on
/// the origin of the grid, so that it is the same for a grid and for parts of it. It is evaluated in `f64`,
/// and near borders in integers of the last decimal of all inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeAxis {
    rule: BorderComparison,
    /// The same in integers, if all decimals fit.
    units: Option<DecimalAxis>,
    world_anchor: f64,
    world_cell: f64,
    upper_closed: bool,
    down: bool,
    /// Lattice index of the lowest cell of the grid.
    first: i64,
    /// Cells of the grid.
    count: u32,
}

/// How a coordinate in steps is compared with cell borders.
#[derive(Clone, Copy, Debug, PartialEq)]
enum BorderComparison {
    /// In steps: the anchor is at `anchor`, which need not be whole, and `cell` is.
    Steps { anchor: f64, cell: i64, scale: f64 },
    /// In world coordinates: steps * scale + offset.
    World { scale: f64, offset: f64 },
}

/// An axis in decimals.
struct DecimalLattice {
    scale: Decimal,
    offset: Decimal,
    anchor: Decimal,
    cell: Decimal,
}

impl DecimalLattice {
    fn digits(&self) -> u32 {
        let all = [self.scale, self.offset, self.anchor, self.cell];
        all.into_iter().map(Decimal::digits).max().unwrap_or(0)
    }

    fn units(&self, digits: u32) -> Option<DecimalAxis> {
        let [offset, anchor, scale, cell] = [self.offset, self.anchor, self.scale, self.cell]
            .map(|number| number.units(digits)?.checked_mul(2));
        let (shift, scale, cell) = (offset?.checked_sub(anchor?)?, scale?, cell?);
        let fits = scale < MAX_SCALE && cell < MAX_SCALE && shift.abs() < MAX_SHIFT;
        fits.then_some(DecimalAxis { digits, scale, shift, cell })
    }
}

/// An axis in integers: in halves of the last decimal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DecimalAxis {
    digits: u32,
    /// From a step to the next.
    scale: i128,
    /// From the anchor to step 0.
    shift: i128,
    /// From a cell to the next; even.
    cell: i128,
}

/// Bounds of units below which no product with a step or the index of a cell overflows.
const MAX_SCALE: i128 = 1 << 84;
const MAX_SHIFT: i128 = 1 << 125;
/// Fraction of a cell beside a border where floats are not reliable.
const DOUBT: f64 = 1e-6;

impl DecimalAxis {
    /// From the anchor to a step.
    fn at(&self, steps: i32) -> i128 {
        i128::from(steps) * self.scale + self.shift
    }

    fn index(&self, steps: i32, upper_closed: bool) -> i64 {
        let at = self.at(steps) - i128::from(upper_closed);
        at.div_euclid(self.cell).clamp(-i128::from(FAR), i128::from(FAR)) as i64
    }

    /// From the centre of a cell to a step.
    fn apart(&self, steps: i32, index: i64) -> i64 {
        let apart = self.at(steps) - i128::from(index) * self.cell - self.cell / 2;
        apart.clamp(i64::MIN.into(), i64::MAX.into()) as i64
    }
}

/// Largest relative difference from a whole number that is rounding: over the 2^30 steps that
/// points can lie apart it grows to a thousandth of a step.
const WHOLE: f64 = 1e-12;
/// An anchor within this distance of a step (in steps) is taken to lie on it.
const NEAR_STEP: f64 = 1e-4;
/// Cells of more steps than this are measured in world coordinates.
const MAX_STEPS: f64 = (1_u64 << 31) as f64;
/// Lattice indices beyond this are cut off: no grid may reach so far.
pub const FAR: i64 = 1 << 40;

impl LatticeAxis {
    fn new(frame: &PointFrame, axis: usize, anchor: f64, cell: f64) -> Self {
        let (scale, offset) = (frame.scale[axis], frame.offset[axis]);
        let steps = (cell / scale).round();
        let is_whole =
            (1.0..MAX_STEPS).contains(&steps) && (cell / scale / steps - 1.0).abs() < WHOLE;
        let at = (anchor - offset) / scale;
        let at = if (at - at.round()).abs() < NEAR_STEP { at.round() } else { at };
        let rule = match is_whole && at.abs() < 1e15 {
            true => BorderComparison::Steps { anchor: at, cell: steps as i64, scale },
            false => BorderComparison::World { scale, offset },
        };
        let (upper_closed, down) = (false, false);
        Self {
            rule,
            units: None,
            world_anchor: anchor,
            world_cell: cell,
            upper_closed,
            down,
            first: 0,
            count: 0,
        }
    }

    /// The axis in decimals, if all its numbers are whole steps.
    fn decimals(&self, scale: f64, offset: f64) -> Option<DecimalLattice> {
        let (scale, offset) = (Decimal::of(scale)?, Decimal::of(offset)?);
        let zero = Decimal::new(0, 0);
        let (anchor, cell) = match self.rule {
            BorderComparison::Steps { anchor, cell, .. } if anchor.fract() == 0.0 => {
                (steps_from(offset, anchor as i64, scale)?, steps_from(zero, cell, scale)?)
            }
            BorderComparison::Steps { cell, .. } => {
                (Decimal::of(self.world_anchor)?, steps_from(zero, cell, scale)?)
            }
            BorderComparison::World { .. } => {
                (Decimal::of(self.world_anchor)?, Decimal::of(self.world_cell)?)
            }
        };
        Some(DecimalLattice { scale, offset, anchor, cell })
    }

    /// The upper border belongs to a cell, not the lower one.
    fn upper_closed(self) -> Self {
        Self { upper_closed: true, ..self }
    }

    /// Cells are numbered from the upper end of the grid.
    fn down(self) -> Self {
        Self { down: true, ..self }
    }

    /// The same lattice, for a grid of the `count` cells from lattice index `first` upwards.
    pub fn covering(self, first: i64, count: u32) -> Self {
        Self { first, count, ..self }
    }

    /// Lattice index of the grid's lowest cell.
    pub fn first(&self) -> i64 {
        self.first
    }

    /// World size of a cell.
    pub fn world_cell(&self) -> f64 {
        self.world_cell
    }

    /// True when points are put into cells in whole numbers.
    pub fn is_exact(&self) -> bool {
        matches!(self.rule, BorderComparison::Steps { .. })
    }

    /// Lattice index of the cell that a coordinate in steps lies in.
    pub fn index(&self, steps: i32) -> i64 {
        match self.rule {
            BorderComparison::Steps { cell, .. } => {
                (i64::from(steps) - self.border()).div_euclid(cell)
            }
            BorderComparison::World { scale, offset } => {
                let cells =
                    (f64::from(steps) * scale + offset - self.world_anchor) / self.world_cell;
                if let Some(units) = &self.units
                    && (cells - cells.round()).abs() < DOUBT
                {
                    return units.index(steps, self.upper_closed);
                }
                let index = if self.upper_closed { cells.ceil() - 1.0 } else { cells.floor() };
                (index as i64).clamp(-FAR, FAR)
            }
        }
    }

    /// First whole step of the cell of lattice index 0.
    fn border(&self) -> i64 {
        match self.rule {
            BorderComparison::Steps { anchor, .. } if self.upper_closed => {
                anchor.floor() as i64 + 1
            }
            BorderComparison::Steps { anchor, .. } => anchor.ceil() as i64,
            BorderComparison::World { .. } => 0,
        }
    }

    /// Converts the lattice index of a cell to its number in the grid, and back.
    fn turned(&self, number: i64) -> i64 {
        if self.down { i64::from(self.count) - 1 - number } else { number }
    }

    /// Numbers of the grid's cells (columns, or rows from the north) that coordinates lie in;
    /// negative, or not less than the number of cells, for those outside.
    pub fn numbers(&self, steps: impl Iterator<Item = i32>, out: &mut Vec<i32>) {
        out.clear();
        match self.rule {
            BorderComparison::Steps { cell, .. } => {
                let low = self.border() + self.first * cell;
                let within = u64::from(self.count) * cell as u64;
                let divide = ExactDivisor::by(cell as u64);
                out.extend(steps.map(|steps| {
                    let from = (i64::from(steps) - low) as u64;
                    match from < within.min(1 << 32) {
                        true => self.turned(divide.quotient(from) as i64) as i32,
                        false => self.number(steps),
                    }
                }));
            }
            BorderComparison::World { .. } => out.extend(steps.map(|steps| self.number(steps))),
        }
    }

    fn number(&self, steps: i32) -> i32 {
        let number = self.turned(self.index(steps) - self.first);
        number.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
    }

    /// Squared distances along the axis from a coordinate to the centres of cells, in `unit`, into `out`
    /// (emptied first). Each is computed by itself, so that it is the same for any grid on this
    /// lattice.
    pub fn squares(
        &self,
        steps: i32,
        numbers: Range<i64>,
        unit: DistanceUnit,
        out: &mut Vec<u128>,
    ) {
        out.clear();
        let indices = numbers.map(|number| self.turned(number) + self.first);
        match self.units.filter(|_| unit.digits.is_some()) {
            Some(units) => out.extend(indices.map(|index| squared(units.apart(steps, index)))),
            None => out.extend(
                indices.map(|index| squared((self.apart(steps, index) / unit.size).round() as i64)),
            ),
        }
    }

    /// Squared distance along the axis from a coordinate to the centre of the cell it lies in, in `unit`.
    pub fn square(&self, steps: i32, unit: DistanceUnit) -> u128 {
        let index = self.index(steps);
        let apart = match self.units.filter(|_| unit.digits.is_some()) {
            Some(units) => units.apart(steps, index),
            None => (self.apart(steps, index) / unit.size).round() as i64,
        };
        squared(apart)
    }

    /// From the centre of a cell to a coordinate in steps, in world units, rounded.
    fn apart(&self, steps: i32, index: i64) -> f64 {
        let (steps, index) = (f64::from(steps), index as f64 + 0.5);
        match self.rule {
            BorderComparison::Steps { anchor, cell, scale } => {
                (steps - (anchor + index * cell as f64)) * scale
            }
            BorderComparison::World { scale, offset } => {
                steps * scale + offset - (self.world_anchor + index * self.world_cell)
            }
        }
    }

    /// World coordinate of the centre of cell `number`.
    pub fn world_centre(&self, number: i64) -> f64 {
        let index = (self.turned(number) + self.first) as f64 + 0.5;
        self.world_anchor + index * self.world_cell
    }
}

/// The decimal `steps` times `scale` away from another; `None` if it does not fit.
fn steps_from(from: Decimal, steps: i64, scale: Decimal) -> Option<Decimal> {
    let digits = scale.digits().max(from.digits());
    let steps = scale.units(digits)?.checked_mul(steps.into())?;
    Some(Decimal::new(steps.checked_add(from.units(digits)?)?, digits))
}

#[inline]
fn squared(apart: i64) -> u128 {
    u128::from(apart.unsigned_abs()).pow(2)
}

/// Division of numbers below 2^32 by a constant, by multiplication.
#[derive(Clone, Copy)]
struct ExactDivisor {
    by: u64,
    inverse: u64,
}

impl ExactDivisor {
    fn by(by: u64) -> Self {
        // Of 1 the inverse, 2^64, wraps to 0: `quotient` does without it.
        Self { by, inverse: (u64::MAX / by).wrapping_add(1) }
    }

    /// Exact: the inverse is too large by less than 2^-64 of a unit, and the dividend below 2^32.
    #[inline(always)]
    fn quotient(self, value: u64) -> u64 {
        match self.by {
            1 => value,
            _ => ((u128::from(value) * u128::from(self.inverse)) >> 64) as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(scale: f64, offset: f64) -> PointFrame {
        PointFrame { scale: [scale; 3], offset: [offset; 3] }
    }

    #[test]
    fn quotients_are_exact() {
        for by in [1_u64, 2, 3, 7, 100, 1000, 65_537, (1 << 31) - 1] {
            let divide = ExactDivisor::by(by);
            for value in [0, 1, by - 1, by, by + 1, 3 * by - 1, 3 * by, u64::from(u32::MAX)] {
                assert_eq!(divide.quotient(value), value / by, "{value} / {by}");
            }
        }
    }

    #[test]
    fn numbers_too_large_to_count_are_not_counted() {
        let decimals = |scale: i128, cell: i128, offset: i128| DecimalLattice {
            scale: Decimal::new(scale, 0),
            offset: Decimal::new(offset, 0),
            anchor: Decimal::new(0, 0),
            cell: Decimal::new(cell, 0),
        };
        let is_counted = |scale, cell, offset| decimals(scale, cell, offset).units(0).is_some();
        assert!(is_counted(1, 1, 0) && is_counted(1 << 82, 1 << 82, 1 << 123));
        assert!(!is_counted(1 << 83, 1, 0));
        assert!(!is_counted(1, 1 << 83, 0));
        assert!(!is_counted(1, 1, 1 << 124) && !is_counted(1, 1, -(1 << 124)));
    }

    #[test]
    fn an_anchor_a_hair_off_a_step_is_on_it() {
        let at = |anchor: f64| {
            let lattice = CellLattice::new(
                &frame(0.1, 0.0),
                [anchor; 2],
                [0.5; 2],
                CellEdgeRule::LowerClosed,
            );
            let x = lattice.x.covering(0, 9);
            let mut squares = Vec::new();
            x.squares(7, 0..9, lattice.unit(2.0), &mut squares);
            (squares, lattice.unit(2.0))
        };
        assert_ne!(0.1 + 0.2, 0.3);
        assert_eq!(at(0.1 + 0.2), at(0.3));
        // Twentieths: the centre of the first cell is at 0.55, and the step at 0.7.
        assert_eq!(at(0.3).0[0], 9);
    }

    #[test]
    fn a_span_is_from_the_cell_of_the_lowest_to_that_of_the_highest() {
        let lattice =
            CellLattice::new(&frame(1.0, 0.0), [0.0; 2], [10.0, 3.0], CellEdgeRule::NorthClosed);
        let points = [Point::new(-11, 3, 0), Point::new(30, 4, 0)];
        assert_eq!(lattice.span(points), [[-2, 3], [0, 1]]);
    }

    #[test]
    fn borders_belong_to_one_cell() {
        // Cells of 1 in steps of 0.01, from -3 to 4.
        let lattice =
            CellLattice::new(&frame(0.01, 0.0), [0.0; 2], [1.0; 2], CellEdgeRule::LowerClosed);
        let north =
            CellLattice::new(&frame(0.01, 0.0), [0.0; 2], [1.0; 2], CellEdgeRule::NorthClosed);
        let [x, y, z] = [lattice.x, lattice.y, north.y].map(|axis| axis.covering(-3, 7));
        assert!(x.is_exact());
        let numbers = |axis: LatticeAxis, steps: &[i32]| {
            let mut out = Vec::new();
            axis.numbers(steps.iter().copied(), &mut out);
            out
        };
        let steps = [-301, -300, -201, -200, 0, 99, 100, 399, 400];
        assert_eq!(numbers(x, &steps), [-1, 0, 0, 1, 3, 3, 4, 6, 7]);
        assert_eq!(numbers(y, &steps), [7, 6, 6, 5, 3, 3, 2, 0, -1]);
        assert_eq!(numbers(z, &steps), [7, 7, 6, 6, 4, 3, 3, 0, 0]);
        assert_eq!(north.x, lattice.x);
    }

    #[test]
    fn anchors_between_steps_leave_membership_whole() {
        let lattice =
            CellLattice::new(&frame(1.0, 0.0), [0.5; 2], [3.0; 2], CellEdgeRule::LowerClosed);
        let x = lattice.x.covering(0, 2);
        assert!(x.is_exact());
        assert_eq!([0, 1, 3, 4, 6, 7].map(|steps| x.number(steps)), [-1, 0, 0, 1, 1, 2]);
        let (unit, mut squares) = (lattice.unit(10.0), Vec::new());
        x.squares(2, 0..2, unit, &mut squares);
        // In tenths, halved.
        assert_eq!((unit.size, squares), (0.05, vec![0, 3600]));
        let north =
            CellLattice::new(&frame(1.0, 0.0), [0.5; 2], [3.0; 2], CellEdgeRule::NorthClosed);
        let y = north.y.covering(0, 2);
        assert_eq!([0, 1, 3, 4, 6, 7].map(|steps| y.number(steps)), [2, 1, 1, 0, 0, -1]);
    }

    #[test]
    fn borders_on_steps_belong_to_one_cell_where_cells_are_no_whole_steps() {
        // Cells of one and a half steps: every second border lies on a step.
        let new = |edges| CellLattice::new(&frame(0.5, 0.0), [0.0; 2], [0.75; 2], edges).y;
        let [south, north] = [CellEdgeRule::LowerClosed, CellEdgeRule::NorthClosed].map(new);
        assert!(!south.is_exact() && !north.is_exact());
        assert_eq!([-3, 0, 1, 2, 3, 6].map(|steps| south.index(steps)), [-2, 0, 0, 1, 2, 4]);
        assert_eq!([-3, 0, 1, 2, 3, 6].map(|steps| north.index(steps)), [-3, -1, 0, 1, 1, 3]);
    }

    #[test]
    fn a_part_sees_what_the_whole_sees() {
        for (scale, cell) in [(0.01, 1.0), (0.01, 0.333), (0.3, 0.7), (1e-7, 1.0 / 3600.0)] {
            for edges in [CellEdgeRule::LowerClosed, CellEdgeRule::NorthClosed] {
                let lattice = CellLattice::new(&frame(scale, 12.34), [0.1; 2], [cell; 2], edges);
                let unit = lattice.unit(1000.0 * cell);
                let [whole, part] = [(-500, 1000), (-20, 100)]
                    .map(|(first, count)| lattice.y.covering(first, count));
                for steps in (-70_000..70_000).step_by(7) {
                    let number = whole.number(steps);
                    assert_eq!(part.number(steps), number - 420, "{scale} {cell}");
                    let [mut a, mut b] = [Vec::new(), Vec::new()];
                    whole.squares(steps, 400..403, unit, &mut a);
                    part.squares(steps, 400 - 420..403 - 420, unit, &mut b);
                    assert_eq!(a, b);
                }
            }
        }
    }

    #[test]
    fn both_rules_agree_between_borders() {
        let exact =
            CellLattice::new(&frame(0.01, 0.0), [0.0; 2], [0.25; 2], CellEdgeRule::LowerClosed);
        let near = CellLattice::new(
            &frame(0.01, 0.0),
            [0.0; 2],
            [0.25 + 1e-9; 2],
            CellEdgeRule::LowerClosed,
        );
        assert!(exact.x.is_exact() && !near.x.is_exact());
        for steps in (1..100_000).filter(|steps| steps % 25 != 0) {
            assert_eq!(exact.x.index(steps), near.x.index(steps), "{steps}");
        }
    }
}
