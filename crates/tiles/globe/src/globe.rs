//! The ellipsoid WGS 84: positions and verticals.

use std::ops::{Add, Mul, Sub};

/// Metres from the centre to the equator.
pub(crate) const EQUATOR: f64 = 6_378_137.0;
/// Metres from the centre to a pole.
pub(crate) const POLE: f64 = EQUATOR * (1.0 - FLATTENING);

const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// The square of the first eccentricity.
const ECCENTRICITY: f64 = FLATTENING * (2.0 - FLATTENING);

/// A direction, or a position in metres from the centre of the earth: x towards longitude 0, y towards 90
/// degrees east, z towards the north pole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vector(pub [f64; 3]);

impl Vector {
    /// Dot product.
    #[inline]
    pub fn dot(self, other: Self) -> f64 {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        a * x + b * y + c * z
    }

    /// Cross product.
    #[inline]
    pub fn cross(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    /// Its length.
    #[inline]
    pub fn length(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Nearest position with coordinates that are multiples of a step.
    pub(crate) fn rounded(self, step: f64) -> Self {
        // Adding 0 removes negative zeros, as in clients.
        Self(self.0.map(|value| (value / step).round() * step + 0.0))
    }

    /// Normalized direction; a zero vector is unchanged.
    pub fn unit(self) -> Self {
        let length = self.length();
        if length > 0.0 { self * (1.0 / length) } else { self }
    }
}

impl Add for Vector {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl Sub for Vector {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Mul<f64> for Vector {
    type Output = Self;

    #[inline]
    fn mul(self, by: f64) -> Self {
        Self(self.0.map(|value| value * by))
    }
}

/// The sine and the cosine of an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SinCos {
    /// Of the angle.
    pub sin: f64,
    /// Of the angle.
    pub cos: f64,
}

impl SinCos {
    /// Of an angle in degrees.
    pub fn of(degrees: f64) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Self { sin, cos }
    }
}

/// Vertical at a position of the ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EllipsoidNormal {
    /// Up, of length 1.
    pub normal: Vector,
    /// Metres from the ellipsoid to the axis of the earth, along the normal.
    bend: f64,
}

impl EllipsoidNormal {
    /// At a longitude and a latitude in degrees.
    pub fn at([lon, lat]: [f64; 2]) -> Self {
        let lat = SinCos::of(lat);
        Self::of(SinCos::of(lon), lat, bend(lat))
    }

    /// At a longitude and a latitude with known distance from the axis.
    #[inline]
    pub fn of(lon: SinCos, lat: SinCos, bend: f64) -> Self {
        Self { normal: Vector([lat.cos * lon.cos, lat.cos * lon.sin, lat.sin]), bend }
    }

    /// In a direction from the centre of the earth's curvature there, nearly of length 1.
    pub(crate) fn along(up: Vector) -> Self {
        let normal = up.unit();
        let [x, y, sin] = normal.0;
        Self { normal, bend: bend(SinCos { sin, cos: x.hypot(y) }) }
    }

    /// Longitude and latitude in degrees.
    pub(crate) fn place(&self) -> [f64; 2] {
        let [x, y, z] = self.normal.0;
        [y.atan2(x), z.atan2(x.hypot(y))].map(f64::to_degrees)
    }

    /// Position at a height above the ellipsoid.
    #[inline]
    pub fn point(&self, height: f64) -> Vector {
        let [x, y, z] = self.normal.0;
        let out = self.bend + height;
        Vector([out * x, out * y, (self.bend * (1.0 - ECCENTRICITY) + height) * z])
    }

    /// East and north, of length 1; at a pole, those of longitude 0.
    pub fn across(&self) -> [Vector; 2] {
        let [x, y, _] = self.normal.0;
        let east = match x == 0.0 && y == 0.0 {
            true => Vector([0.0, 1.0, 0.0]),
            false => Vector([-y, x, 0.0]).unit(),
        };
        [east, self.normal.cross(east)]
    }
}

/// A sample with its local directions east, north and up. Positions near it are computed without the rounding
/// of earth-centred coordinates.
pub(crate) struct EastNorthUpFrame {
    at: Vector,
    /// The first two have the length cos(latitude), which avoids a square root per sample.
    axes: [Vector; 3],
    /// Its square.
    pub(crate) square: f64,
}

impl EastNorthUpFrame {
    /// At a height above the ellipsoid.
    #[inline]
    pub(crate) fn new(upright: &EllipsoidNormal, height: f64) -> Self {
        let up = upright.normal;
        let [x, y, _] = up.0;
        let east = Vector([-y, x, 0.0]);
        Self { at: upright.point(height), axes: [east, up.cross(east), up], square: x * x + y * y }
    }

    /// Local coordinates of a position: east and north in metres times cos(latitude), and metres up.
    #[inline]
    pub(crate) fn local(&self, place: Vector) -> [f64; 3] {
        let from = place - self.at;
        self.axes.map(|axis| axis.dot(from))
    }
}

/// Metres from the ellipsoid to the axis of the earth at a latitude, along the vertical.
#[inline]
pub(crate) fn bend(lat: SinCos) -> f64 {
    EQUATOR / (1.0 - ECCENTRICITY * lat.sin * lat.sin).sqrt()
}

/// Metres north of the centre at which the vertical of a latitude meets the axis of the earth.
#[inline]
pub(crate) fn beneath(lat: SinCos, bend: f64) -> f64 {
    -bend * ECCENTRICITY * lat.sin
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places as PROJ has them (EPSG:4979 to EPSG:4978).
    #[test]
    fn places_are_where_others_have_them() {
        let known = [
            ([0.0, 0.0], 0.0, [EQUATOR, 0.0, 0.0]),
            ([90.0, 0.0], 100.0, [0.0, EQUATOR + 100.0, 0.0]),
            ([0.0, 90.0], 0.0, [0.0, 0.0, 6_356_752.314_245_179]),
            ([7.5, 46.5], 4000.0, [4_363_275.499_549, 574_436.117_177, 4_606_581.896_130]),
            (
                [-120.25, -33.125],
                -50.0,
                [-2_693_613.863_030, -4_618_815.973_470, -3_465_549.726_961],
            ),
            ([179.5, 80.25], 12.5, [-1_083_624.137_381, 9_456.644_582, 6_264_342.711_328]),
        ];
        for (place, height, [x, y, z]) in known {
            let off = EllipsoidNormal::at(place).point(height) - Vector([x, y, z]);
            assert!(
                off.length() < 1e-5,
                "{place:?} {off:?} {:?}",
                EllipsoidNormal::at(place).point(height)
            );
        }
    }

    #[test]
    fn what_is_upright_is_at_right_angles_to_what_is_across() {
        for place in [[7.0, 46.0], [-120.0, -30.0], [0.0, 90.0], [33.0, -90.0]] {
            let upright = EllipsoidNormal::at(place);
            let [east, north] = upright.across();
            let flat = [east.dot(north), east.dot(upright.normal), north.dot(upright.normal)];
            assert!(flat.iter().all(|dot| dot.abs() < 1e-15));
            assert!(upright.normal.dot(east.cross(north)) > 0.999);
        }
    }
}
