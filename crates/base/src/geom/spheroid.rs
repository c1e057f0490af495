//! Reference ellipsoids of any celestial body.

/// An ellipsoid of revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spheroid {
    /// Semi-major axis, in metres.
    axis: f64,
    eccentricity_squared: f64,
}

/// Semi-major axes of ellipsoids of the Earth, in metres.
const EARTH: std::ops::Range<f64> = 6.3e6..6.5e6;

impl Spheroid {
    /// The WGS 84 ellipsoid.
    pub const WGS84: Self =
        Self { axis: 6_378_137.0, eccentricity_squared: 0.006_694_379_990_141_316 };

    /// From the semi-major axis in metres and the inverse flattening (0 for a sphere); `None` if invalid.
    pub fn new(axis: f64, inverse_flattening: f64) -> Option<Self> {
        // The formula below may differ from the constant in the last bit, and one ellipsoid would be two.
        if (axis, inverse_flattening) == (6_378_137.0, 298.257_223_563) {
            return Some(Self::WGS84);
        }
        let flattening = if inverse_flattening == 0.0 { 0.0 } else { 1.0 / inverse_flattening };
        let is_sound = axis > 0.0 && axis.is_finite() && (0.0..1.0).contains(&flattening);
        let eccentricity_squared = flattening * (2.0 - flattening);
        is_sound.then_some(Self { axis, eccentricity_squared })
    }

    /// Whether the size is that of the Earth.
    pub fn is_of_earth(&self) -> bool {
        EARTH.contains(&self.axis)
    }

    /// Metres per degree of longitude and of latitude; 0 for longitudes at a pole.
    pub fn degree_metres(&self, latitude: f64) -> [f64; 2] {
        let (sine, cosine) = latitude.to_radians().sin_cos();
        let bulge = 1.0 - self.eccentricity_squared * sine * sine;
        let across = self.axis / bulge.sqrt() * cosine;
        let along = self.axis * (1.0 - self.eccentricity_squared) / (bulge * bulge.sqrt());
        [across, along].map(f64::to_radians)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_of_a_sphere_are_parts_of_its_circles() {
        let moon = Spheroid::new(1_737_400.0, 0.0).unwrap();
        let circle = 1_737_400.0_f64.to_radians();
        for latitude in [-60.0_f64, 0.0, 45.0, 89.0] {
            let [across, along] = moon.degree_metres(latitude);
            assert!((along - circle).abs() < 1e-9, "{latitude}");
            assert!((across - circle * latitude.to_radians().cos()).abs() < 1e-9, "{latitude}");
        }
        assert!(!moon.is_of_earth() && Spheroid::WGS84.is_of_earth());
    }

    #[test]
    fn what_is_no_ellipsoid_is_none() {
        for (axis, flattening) in [
            (0.0, 0.0),
            (-1.0, 300.0),
            (f64::NAN, 300.0),
            (f64::INFINITY, 0.0),
            (6e6, 1.0),
            (6e6, -300.0),
            (6e6, f64::NAN),
        ] {
            assert_eq!(Spheroid::new(axis, flattening), None, "{axis} {flattening}");
        }
    }
}
