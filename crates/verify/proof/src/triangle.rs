//! Positions in fixed point, so that every geometric decision is exact, and triangles made of them.

use bytemuck::{Pod, Zeroable};

/// A position in lattice coordinates, in units of 2^-30 cell. Samples lie at whole cells. Ordered
/// by row, then column. Coordinates stay below [`ProofPosition::LIMIT`] cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct ProofPosition {
    /// Row, in 2^-30 cell.
    pub row: i64,
    /// Column, in 2^-30 cell.
    pub col: i64,
}

impl ProofPosition {
    /// Bits of the fraction of a cell.
    pub const FRACTION: u32 = 30;
    /// One cell.
    pub const CELL: i64 = 1 << Self::FRACTION;
    /// Positions at or beyond this many cells are not representable: products of coordinate
    /// differences have to fit `i128`.
    pub const LIMIT: f64 = (1u64 << 31) as f64;

    /// The sample (`col`, `row`).
    pub fn sample(col: i64, row: i64) -> Self {
        Self { row: row << Self::FRACTION, col: col << Self::FRACTION }
    }

    /// The nearest position to (`col`, `row`) cells, which are below [`Self::LIMIT`].
    pub fn nearest(col: f64, row: f64) -> Self {
        let [row, col] = [row, col].map(|cells| (cells * Self::CELL as f64).round() as i64);
        Self { row, col }
    }

    /// True when it is a whole number of cells both ways.
    pub fn is_sample(self) -> bool {
        (self.row | self.col) & (Self::CELL - 1) == 0
    }

    /// Column in cells.
    pub fn cols(self) -> f64 {
        self.col as f64 / Self::CELL as f64
    }

    /// Row in cells.
    pub fn rows(self) -> f64 {
        self.row as f64 / Self::CELL as f64
    }

    /// The vector from `other` to here, in cells.
    pub fn minus(self, other: Self) -> [f64; 2] {
        [self.col - other.col, self.row - other.row].map(|d| d as f64 / Self::CELL as f64)
    }

    /// The vector from `other` to here, where steps along a column and along a row are these vectors.
    fn minus_in(self, other: Self, [col, row]: [[f64; 2]; 2]) -> [f64; 2] {
        let [cols, rows] = self.minus(other);
        [0, 1].map(|axis| cols * col[axis] + rows * row[axis])
    }
}

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ProofVertex {
    /// Where it is.
    pub at: ProofPosition,
    /// Its height.
    pub z: f64,
}

/// A triangle by its corners, in the order of the file.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ProofTriangle {
    /// The corners.
    pub corners: [ProofVertex; 3],
}

impl ProofTriangle {
    /// Positions of the corners.
    pub fn positions(&self) -> [ProofPosition; 3] {
        self.corners.map(|corner| corner.at)
    }

    /// True when all corners are samples.
    pub fn is_lattice(&self) -> bool {
        self.positions().iter().all(|p| p.is_sample())
    }

    /// Minimum and maximum row and column of the corners.
    pub fn bounds(&self) -> [ProofPosition; 2] {
        let [a, b, c] = self.positions();
        let row = [a.row.min(b.row).min(c.row), a.row.max(b.row).max(c.row)];
        let col = [a.col.min(b.col).min(c.col), a.col.max(b.col).max(c.col)];
        [0, 1].map(|i| ProofPosition { row: row[i], col: col[i] })
    }

    /// The smallest angle in degrees, seen in (column, row) axes with square cells.
    pub fn smallest_angle(&self) -> f64 {
        self.smallest_angle_in([[1.0, 0.0], [0.0, 1.0]])
    }

    /// The smallest angle in degrees, where steps along a column and along a row are these vectors.
    pub fn smallest_angle_in(&self, steps: [[f64; 2]; 2]) -> f64 {
        let p = self.positions();
        let squares = [[1, 2], [2, 0], [0, 1]].map(|[i, j]: [usize; 2]| {
            let [x, y] = p[i].minus_in(p[j], steps);
            x * x + y * y
        });
        // The smallest angle is opposite the shortest side.
        let at = (0..3).fold(0, |best, i| if squares[i] < squares[best] { i } else { best });
        let [ux, uy] = p[(at + 1) % 3].minus_in(p[at], steps);
        let [vx, vy] = p[(at + 2) % 3].minus_in(p[at], steps);
        (ux * vy - uy * vx).abs().atan2(ux * vx + uy * vy).to_degrees()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(points: [[f64; 2]; 3]) -> ProofTriangle {
        ProofTriangle {
            corners: points.map(|[c, r]| ProofVertex { at: ProofPosition::nearest(c, r), z: 0.0 }),
        }
    }

    #[test]
    fn smallest_angles_of_known_triangles() {
        let angle = |points| triangle(points).smallest_angle();
        assert!((angle([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) - 45.0).abs() < 1e-12);
        let high = 3f64.sqrt() / 2.0;
        assert!((angle([[0.0, 0.0], [1.0, 0.0], [0.5, high]]) - 60.0).abs() < 1e-6);
        assert!((angle([[5.0, 5.0], [5.0, 6.0], [105.0, 5.0]]) - 0.5729).abs() < 1e-4);
    }

    #[test]
    fn order_is_row_major() {
        assert!(ProofPosition::sample(9, 1) < ProofPosition::sample(0, 2));
        assert!(ProofPosition::sample(-1, 2) < ProofPosition::sample(0, 2));
        assert!(
            ProofPosition::nearest(0.5, 0.0)
                == ProofPosition { row: 0, col: ProofPosition::CELL / 2 }
        );
    }
}
