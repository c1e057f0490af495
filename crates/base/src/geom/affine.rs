//! The affine map between lattice positions (column, row) and world coordinates (x, y).

/// World position of *samples* (not of cell corners): `x = x0 + a*col + b*row`,
/// `y = y0 + d*col + e*row`. Sample (0, 0) is at (`x0`, `y0`), whichever of PixelIsArea or
/// PixelIsPoint the file used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// World x of sample (0, 0).
    pub x0: f64,
    /// Change of x per column.
    pub a: f64,
    /// Change of x per row.
    pub b: f64,
    /// World y of sample (0, 0).
    pub y0: f64,
    /// Change of y per column.
    pub d: f64,
    /// Change of y per row (negative on a north-up grid).
    pub e: f64,
}

impl Affine {
    /// The map of a file without georeference: x = column, y = -row (so that north is up).
    pub const LATTICE: Affine = Affine { x0: 0.0, a: 1.0, b: 0.0, y0: 0.0, d: 0.0, e: -1.0 };

    /// From the six GDAL coefficients, which place the outer *corner* of cell (0, 0).
    pub fn from_gdal(gt: [f64; 6]) -> Self {
        let x0 = gt[0] + 0.5 * gt[1] + 0.5 * gt[2];
        let y0 = gt[3] + 0.5 * gt[4] + 0.5 * gt[5];
        Self { x0, a: gt[1], b: gt[2], y0, d: gt[4], e: gt[5] }
    }

    /// The six GDAL coefficients (outer corner of cell (0, 0)).
    pub fn to_gdal(&self) -> [f64; 6] {
        let x = self.x0 - 0.5 * self.a - 0.5 * self.b;
        let y = self.y0 - 0.5 * self.d - 0.5 * self.e;
        [x, self.a, self.b, y, self.d, self.e]
    }

    /// World position of the lattice position (`col`, `row`).
    pub fn apply(&self, col: f64, row: f64) -> [f64; 2] {
        [self.x0 + self.a * col + self.b * row, self.y0 + self.d * col + self.e * row]
    }

    /// Lattice position (column, row) of the world position (`x`, `y`).
    pub fn invert(&self, x: f64, y: f64) -> [f64; 2] {
        let (dx, dy) = (x - self.x0, y - self.y0);
        let det = self.determinant();
        [(self.e * dx - self.b * dy) / det, (self.a * dy - self.d * dx) / det]
    }

    /// Signed area of a cell; negative on a north-up grid, 0 or NaN when the map is unusable.
    pub fn determinant(&self) -> f64 {
        self.a * self.e - self.b * self.d
    }

    /// True when every coefficient is finite and the map can be inverted.
    pub fn is_valid(&self) -> bool {
        let all = [self.x0, self.a, self.b, self.y0, self.d, self.e];
        all.iter().all(|v| v.is_finite()) && self.determinant() != 0.0
    }

    /// The map of the window whose sample (0, 0) is sample (`col`, `row`) of this grid.
    pub fn shifted(&self, col: f64, row: f64) -> Self {
        let [x0, y0] = self.apply(col, row);
        Self { x0, y0, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gdal_round_trip_and_inverse() {
        let map = Affine::from_gdal([500_000.0, 30.0, 2.0, 4_000_000.0, 1.0, -30.0]);
        assert_eq!(map.to_gdal(), [500_000.0, 30.0, 2.0, 4_000_000.0, 1.0, -30.0]);
        let [x, y] = map.apply(12.0, 7.0);
        let [col, row] = map.invert(x, y);
        assert!((col - 12.0).abs() < 1e-9 && (row - 7.0).abs() < 1e-9);
    }
}
