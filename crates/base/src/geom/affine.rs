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

    /// Whether doubles resolve the positions of all samples of a grid of this size to a thousandth of a cell.
    pub fn resolves(&self, width: u32, height: u32) -> bool {
        let [cols, rows] = [width, height].map(|side| [0.0, f64::from(side)]);
        // Coordinates of an affine map are largest at a corner, and so are the gaps of doubles.
        let corners = cols.into_iter().flat_map(|col| rows.map(|row| [col, row]));
        let steps =
            corners.map(|[col, row]| self.apply(col, row).map(|v| v.abs().next_up() - v.abs()));
        let [x, y] =
            steps.fold([0.0, 0.0], |[x, y], step: [f64; 2]| [step[0].max(x), step[1].max(y)]);
        // Absolute values of the inverse map, as gaps of both axes add up at worst.
        let area = self.determinant().abs();
        let columns = (self.e.abs() * x + self.b.abs() * y) / area;
        let rows = (self.d.abs() * x + self.a.abs() * y) / area;
        columns.max(rows) <= 1e-3
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
    fn cells_are_resolved_where_doubles_tell_their_thousandths_apart() {
        let at = |x0: f64, cell: f64| Affine { x0, a: cell, b: 0.0, y0: x0, d: 0.0, e: -cell };
        for (x0, cell, is_resolved) in [
            (5e6, 1e-12, false),
            (5e6, 2e-9, false),
            (5e6, 1e-6, true),
            (5e6, 0.01, true),
            (0.0, 1e-12, true),
            (180.0, 5e-6, true),
            (180.0, 1e-12, false),
            (1e300, 30.0, false),
        ] {
            assert_eq!(at(x0, cell).resolves(90, 90), is_resolved, "{x0} {cell}");
        }
        let turned = Affine { a: 1e-9, b: 1e-9, d: -1e-9, e: 1e-9, ..at(5e6, 1.0) };
        assert!(!turned.resolves(9, 9) && Affine::LATTICE.resolves(u32::MAX, u32::MAX));
        // A long side does not hide a short one.
        let flat = Affine { e: -1e-9, ..at(5e6, 1000.0) };
        assert!(!flat.resolves(9, 9));
    }

    #[test]
    fn gdal_round_trip_and_inverse() {
        let map = Affine::from_gdal([500_000.0, 30.0, 2.0, 4_000_000.0, 1.0, -30.0]);
        assert_eq!(map.to_gdal(), [500_000.0, 30.0, 2.0, 4_000_000.0, 1.0, -30.0]);
        let [x, y] = map.apply(12.0, 7.0);
        let [col, row] = map.invert(x, y);
        assert!((col - 12.0).abs() < 1e-9 && (row - 7.0).abs() < 1e-9);
    }
}
