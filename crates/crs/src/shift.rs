//! Datum shifts with seven parameters (Helmert).

use std::f64::consts::PI;

/// An ellipsoid: semi-major axis and squared first eccentricity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ellipsoid {
    axis: f64,
    eccentricity2: f64,
}

impl Ellipsoid {
    pub(crate) const WGS84: Self = Self::new(6_378_137.0, 298.257_223_563);

    /// From the semi-major axis in metres and the inverse flattening, which is 0 for a sphere.
    pub(crate) const fn new(axis: f64, flattening: f64) -> Self {
        let f = if flattening == 0.0 { 0.0 } else { 1.0 / flattening };
        Self { axis, eccentricity2: f * (2.0 - f) }
    }

    /// Geocentric coordinates in metres of longitude and latitude in radians and a height.
    pub(crate) fn to_centre(self, [longitude, latitude, height]: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = latitude.sin_cos();
        let normal = self.axis / (1.0 - self.eccentricity2 * sin * sin).sqrt();
        let out = (normal + height) * cos;
        let (east, north) = longitude.sin_cos();
        [out * north, out * east, (normal * (1.0 - self.eccentricity2) + height) * sin]
    }

    /// Longitude, latitude and height of geocentric coordinates, by Bowring's iteration.
    pub(crate) fn of_centre(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let out = x.hypot(y);
        let ratio = (1.0 - self.eccentricity2).sqrt();
        let minor = self.axis * ratio;
        let second = self.eccentricity2 / (1.0 - self.eccentricity2);
        let mut reduced = (z).atan2(out * ratio);
        let mut latitude = 0.0;
        for _ in 0..3 {
            let (sin, cos) = reduced.sin_cos();
            latitude = (z + second * minor * sin.powi(3))
                .atan2(out - self.eccentricity2 * self.axis * cos.powi(3));
            reduced = (ratio * latitude.sin()).atan2(latitude.cos());
        }
        let (sin, cos) = latitude.sin_cos();
        let normal = self.axis / (1.0 - self.eccentricity2 * sin * sin).sqrt();
        // Measured along the normal, so that it holds at the poles, too.
        let height = out * cos + z * sin - self.axis * self.axis / normal;
        [y.atan2(x), latitude, height]
    }
}

/// Translation, rotation and scale of geocentric coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Helmert {
    matrix: [[f64; 3]; 3],
    move_by: [f64; 3],
}

impl Helmert {
    /// From metres, arc-seconds (position vector convention) and parts per million. Rotations are assumed small, as
    /// in EPSG's formula.
    pub(crate) fn new([x, y, z, rx, ry, rz, scale]: [f64; 7]) -> Self {
        let [rx, ry, rz] = [rx, ry, rz].map(|seconds| seconds / 3600.0 * PI / 180.0);
        let rows = [[1.0, -rz, ry], [rz, 1.0, -rx], [-ry, rx, 1.0]];
        let scale = 1.0 + scale * 1e-6;
        Self { matrix: rows.map(|row| row.map(|value| value * scale)), move_by: [x, y, z] }
    }

    /// The exact inverse: the inverse matrix, not negated angles.
    pub(crate) fn inverse(&self) -> Self {
        let m = &self.matrix;
        let determinant: f64 = (0..3).map(|c| m[0][c] * minor(m, 0, c)).sum();
        let mut matrix = [[0.0; 3]; 3];
        for (r, row) in matrix.iter_mut().enumerate() {
            for (c, value) in row.iter_mut().enumerate() {
                *value = minor(m, c, r) / determinant;
            }
        }
        let back = Self { matrix, move_by: [0.0; 3] }.apply(self.move_by);
        Self { matrix, move_by: back.map(|value| -value) }
    }

    pub(crate) fn apply(&self, at: [f64; 3]) -> [f64; 3] {
        let mut moved = self.move_by;
        for (value, row) in moved.iter_mut().zip(&self.matrix) {
            *value += row[0] * at[0] + row[1] * at[1] + row[2] * at[2];
        }
        moved
    }
}

/// Signed minor of a matrix without a row and a column.
fn minor(m: &[[f64; 3]; 3], r: usize, c: usize) -> f64 {
    let [a, b] = [(r + 1) % 3, (r + 2) % 3];
    let [d, e] = [(c + 1) % 3, (c + 2) % 3];
    m[a][d] * m[b][e] - m[a][e] * m[b][d]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn places_come_back_from_the_centre_of_the_earth(
            longitude in -PI..PI, latitude in -1.57..1.57, height in -11_000.0..9_000.0,
        ) {
            for ellipsoid in [Ellipsoid::WGS84, Ellipsoid::new(6_377_397.155, 299.1528128), Ellipsoid::new(6_371_000.0, 0.0)] {
                let back = ellipsoid.of_centre(ellipsoid.to_centre([longitude, latitude, height]));
                prop_assert!((back[0] - longitude).abs() < 1e-13 * 10.0 && (back[1] - latitude).abs() < 1e-13 * 10.0);
                prop_assert!((back[2] - height).abs() < 1e-6);
            }
        }

        #[test]
        fn a_shift_is_undone(
            x in -6.4e6..6.4e6, y in -6.4e6..6.4e6, z in -6.4e6..6.4e6, by in -900.0..900.0, turn in -30.0..30.0, scale in -30.0..30.0,
        ) {
            let shift = Helmert::new([by, -by, by / 2.0, turn, -turn, turn / 3.0, scale]);
            let back = shift.inverse().apply(shift.apply([x, y, z]));
            let most = [x, y, z].iter().zip(back).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            prop_assert!(most < 1e-6, "{most}");
        }
    }

    /// The example of the EPSG guidance note 7-2 for seven parameters (method 9606).
    #[test]
    fn the_formula_is_that_of_epsg() {
        let shift = Helmert::new([0.0, 0.0, 4.5, 0.0, 0.0, 0.554, 0.219]);
        let moved = shift.apply([3_657_660.66, 255_768.55, 5_201_382.11]);
        for (found, known) in moved.into_iter().zip([3_657_660.78, 255_778.43, 5_201_387.75]) {
            assert!((found - known).abs() < 0.006, "{found} {known}");
        }
    }
}
