//! A vertex of longitude and latitude, with metres for a degree of each.

use terrane_base::geom::plane::Xy;

/// A vertex with its local scale.
#[derive(Clone, Copy, Debug)]
pub struct LocatedVertex {
    /// Longitude and latitude, in degrees.
    pub at: Xy,
    /// Metres for a degree of longitude and of latitude.
    pub scale: Xy,
}

/// Semi-major axis of WGS 84, in metres.
const SEMI_MAJOR: f64 = 6_378_137.0;

/// Squared eccentricity of WGS 84, f (2 - f) with f = 1 / 298.257223563.
const ECCENTRICITY_SQUARED: f64 = 0.006_694_379_990_141_317;

impl LocatedVertex {
    /// A vertex at `at`: longitude, and latitude between -90 and 90, in degrees.
    pub fn new(at: Xy) -> Self {
        let (sin, cos) = at[1].to_radians().sin_cos();
        let w2 = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
        let normal = SEMI_MAJOR / w2.sqrt();
        let meridian = normal * (1.0 - ECCENTRICITY_SQUARED) / w2;
        Self { at, scale: [(normal * cos.abs()).to_radians(), meridian.to_radians()] }
    }

    /// The difference to `other`, in metres at this vertex.
    #[inline(always)]
    pub(super) fn to(&self, other: &Self) -> Xy {
        [(other.at[0] - self.at[0]) * self.scale[0], (other.at[1] - self.at[1]) * self.scale[1]]
    }
}
