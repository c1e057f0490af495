//! Arithmetic on the WGS 84 ellipsoid. Longitudes and latitudes in degrees, heights and positions in metres.

/// Semi-major axis.
pub(super) const A: f64 = 6_378_137.0;
/// Flattening.
const F: f64 = 1.0 / 298.257_223_563;
/// Semi-minor axis.
pub(super) const B: f64 = A * (1.0 - F);
/// Square of the first eccentricity.
const E2: f64 = F * (2.0 - F);

/// A point or direction, earth-centred.
pub(super) type Vector = [f64; 3];

/// Cosine and sine of a longitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProofMeridian {
    pub(super) cos: f64,
    pub(super) sin: f64,
}

impl ProofMeridian {
    /// The meridian of a longitude in degrees.
    pub fn at(longitude: f64) -> Self {
        let (sin, cos) = longitude.to_radians().sin_cos();
        Self { cos, sin }
    }

    /// The direction to the east.
    pub(super) fn east(self) -> Vector {
        [-self.sin, self.cos, 0.0]
    }
}

/// Constants of a latitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProofParallel {
    pub(super) cos: f64,
    pub(super) sin: f64,
    /// Radius of curvature in the prime vertical: length of the normal from the ellipsoid to the axis.
    pub(super) radius: f64,
    /// Distance of that point of the axis below the centre.
    pub(super) drop: f64,
}

impl ProofParallel {
    /// The parallel of a latitude in degrees.
    pub fn at(latitude: f64) -> Self {
        let (sin, cos) = latitude.to_radians().sin_cos();
        let radius = A / (1.0 - E2 * sin * sin).sqrt();
        Self { cos, sin, radius, drop: radius * E2 * sin }
    }

    /// The normal of the ellipsoid.
    pub(super) fn normal(&self, at: ProofMeridian) -> Vector {
        [self.cos * at.cos, self.cos * at.sin, self.sin]
    }

    /// The direction to the north.
    pub(super) fn north(&self, at: ProofMeridian) -> Vector {
        [-self.sin * at.cos, -self.sin * at.sin, self.cos]
    }

    /// A position at a height.
    pub(super) fn position(&self, at: ProofMeridian, height: f64) -> Vector {
        let [x, y, z] = self.normal(at);
        let far = self.radius + height;
        [far * x, far * y, far * z - self.drop]
    }
}

/// Earth-centred position of a longitude, latitude and height.
pub fn position(longitude: f64, latitude: f64, height: f64) -> [f64; 3] {
    ProofParallel::at(latitude).position(ProofMeridian::at(longitude), height)
}

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Height of a position.
pub(super) fn height(position: Vector) -> f64 {
    foot(position)[1]
}

/// Latitude of a position, in radians.
pub(super) fn latitude(position: Vector) -> f64 {
    foot(position)[0]
}

/// Latitude and height, by fixed-point iteration: each round divides the error by about 150.
fn foot([x, y, z]: Vector) -> [f64; 2] {
    let out = x.hypot(y);
    let mut latitude = z.atan2(out * (1.0 - E2));
    let mut height = 0.0;
    for _ in 0..6 {
        let (sin, cos) = latitude.sin_cos();
        let radius = A / (1.0 - E2 * sin * sin).sqrt();
        height = out * cos + z * sin - A * A / radius;
        latitude = z.atan2(out * (1.0 - E2 * radius / (radius + height)));
    }
    [latitude, height]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_survive_a_round_trip() {
        for latitude in [-90.0, -45.5, 0.0, 0.1, 46.5, 89.9999, 90.0] {
            for up in [-30_000.0, -400.0, 0.0, 8848.0] {
                let found = height(position(7.5, latitude, up));
                assert!((found - up).abs() < 1e-6, "{latitude} {up} {found}");
            }
        }
    }
}
