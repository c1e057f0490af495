//! World coordinates of stored vertices to whole steps, for meshes without a grid.
//!
//! A step is 2^-58 of the power of two above the furthest coordinate: every coordinate of more than a
//! 32nd of that is a whole number of steps, and the smaller ones lose less than the storage of the others
//! did. So all decisions about positions are exact, in whole numbers.

use crate::lattice_position::{farthest, storage_rounding};
use crate::{ProofPosition, ProofVertex, Snap, SnapOutcome};
use terrane_base::geom::Point3;

/// Bits of the steps to the furthest coordinate.
const BITS: i32 = 58;
/// Coordinates below 2 to this are all 0.
const MIN_EXPONENT: i32 = -900;

/// Maps stored vertices to a lattice that covers the mesh, columns along x and rows along y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QualityLattice {
    /// World units of a step: a power of two.
    step: f64,
    /// Lowest x and y, in steps.
    low: [i64; 2],
    /// Extent in x and y, in steps.
    size: [i64; 2],
    rounding: [f64; 2],
}

impl QualityLattice {
    /// For a mesh within `bounds`, and vertices stored relative to `origin`, in f32 when
    /// `single_precision`.
    pub fn new(bounds: [Point3; 2], origin: Point3, single_precision: bool) -> Self {
        let [xs, ys] = [0, 1].map(|axis| bounds.map(|corner| corner[axis]));
        let largest = farthest(&xs, 0.0).max(farthest(&ys, 0.0));
        let step = 2f64.powi(exponent(largest) - BITS);
        let [low, high] = bounds.map(|[x, y, _]| [x, y].map(|world| whole(world, step)));
        let rounding = [
            storage_rounding(&xs, origin[0], single_precision) / step,
            storage_rounding(&ys, origin[1], single_precision) / step,
        ];
        let size = [0, 1].map(|axis| high[axis] - low[axis]);
        Self { step, low, size, rounding }
    }

    /// Columns and rows of the lattice.
    pub fn grid(&self) -> [u32; 2] {
        // Below 2^29.
        self.size.map(|steps| (steps >> ProofPosition::FRACTION) as u32 + 1)
    }

    /// World units of a cell.
    pub fn cell(&self) -> f64 {
        self.step * ProofPosition::CELL as f64
    }

    /// Bound on the rounding of positions by computation and storage, in steps (column, row).
    pub fn rounding(&self) -> [f64; 2] {
        self.rounding
    }

    /// World position of a place on the lattice.
    pub fn world(&self, at: ProofPosition) -> [f64; 2] {
        [(at.col, 0), (at.row, 1)].map(|(steps, axis)| (steps + self.low[axis]) as f64 * self.step)
    }
}

impl Snap for QualityLattice {
    fn snap(&self, [x, y, z]: Point3) -> SnapOutcome {
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            return SnapOutcome::Unusable;
        }
        let [col, row] = [(x, 0), (y, 1)].map(|(v, axis)| whole(v, self.step) - self.low[axis]);
        match (0..=self.size[0]).contains(&col) && (0..=self.size[1]).contains(&row) {
            true => SnapOutcome::Free(ProofVertex { at: ProofPosition { row, col }, z }),
            false => SnapOutcome::Unusable,
        }
    }
}

/// The nearest whole number of steps; beyond them, the last.
fn whole(world: f64, step: f64) -> i64 {
    let max = (1i64 << BITS) as f64;
    (world / step).round().clamp(-max, max) as i64
}

/// The exponent of the least power of two above `value`, which is not negative.
fn exponent(value: f64) -> i32 {
    // At most 2047.
    let biased = (value.to_bits() >> 52) as i32;
    (biased - 1022).max(MIN_EXPONENT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn place(plan: &QualityLattice, [x, y]: [f64; 2]) -> ProofPosition {
        plan.snap([x, y, 0.0]).vertex().unwrap().at
    }

    #[test]
    fn exponents_are_those_of_the_next_power_of_two() {
        for (value, expected) in [(1.0, 1), (0.75, 0), (3.0, 2), (4.0, 3), (f64::MAX, 1024)] {
            assert_eq!(exponent(value), expected, "{value}");
        }
        assert_eq!(exponent(0.0), MIN_EXPONENT);
        assert_eq!(exponent(5e-324), MIN_EXPONENT);
    }

    #[test]
    fn extreme_bounds_have_a_lattice() {
        for most in [0.0, 5e-324, 1e-300, 1.0, 1e300, f64::MAX] {
            let plan =
                QualityLattice::new([[-most, -most, 0.0], [most, most, 0.0]], [0.0; 3], false);
            assert!(plan.grid().iter().all(|&side| side <= (1 << 29) + 1), "{most}: {plan:?}");
            assert_eq!(place(&plan, [-most, -most]), ProofPosition { row: 0, col: 0 });
            assert!(plan.cell() > 0.0 && plan.cell().is_finite());
        }
        let plan = QualityLattice::new([[0.0; 3], [1.0, 2.0, 0.0]], [0.0; 3], false);
        for bad in
            [[f64::NAN, 0.0, 0.0], [0.0, 0.0, f64::INFINITY], [1.1, 0.0, 0.0], [0.0, -1e9, 0.0]]
        {
            assert_eq!(plan.snap(bad), SnapOutcome::Unusable);
        }
    }

    #[test]
    fn floats_are_off_by_more_than_doubles() {
        let bounds = [[500_000.0, 4e6, 0.0], [510_000.0, 4.01e6, 0.0]];
        let plan = |single| QualityLattice::new(bounds, [505_000.0, 4.005e6, 0.0], single);
        let metres = |plan: QualityLattice| {
            plan.rounding().map(|steps| steps * plan.cell() / ProofPosition::CELL as f64)
        };
        assert!(metres(plan(false)).iter().all(|&m| (1e-10..1e-8).contains(&m)));
        assert!(metres(plan(true)).iter().all(|&m| (1e-3..1e-2).contains(&m)));
    }

    proptest! {
        /// Where the numbers of a system in metres are, none of them is moved.
        #[test]
        fn differences_are_exact(x in prop::array::uniform2(4e5..6e5), y in prop::array::uniform2(5e6..5.2e6)) {
            let bounds = [[3e5, 5e6, 0.0], [7e5, 5.5e6, 0.0]];
            let plan = QualityLattice::new(bounds, [0.0; 3], false);
            let [p, q] = [0, 1].map(|i| place(&plan, [x[i], y[i]]));
            let step = plan.cell() / ProofPosition::CELL as f64;
            prop_assert_eq!(plan.world(p), [x[0], y[0]]);
            // The difference of floats of one size is exact.
            prop_assert_eq!((p.col - q.col) as f64 * step, x[0] - x[1]);
            prop_assert_eq!((p.row - q.row) as f64 * step, y[0] - y[1]);
        }
    }
}
