//! The distance of a vertex from the segment in its place.

/// How distances are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ProofDistance {
    /// Distance in x and y.
    #[default]
    Plane,
    /// Distance in x, y and z.
    Space,
    /// In metres in the plane that touches the WGS 84 ellipsoid at the vertex, for longitudes and
    /// latitudes in degrees: differences of longitude count N cos(phi), those of latitude M, with N and
    /// M the radii of curvature across and along the meridian at the vertex's latitude phi.
    Geographic,
}

/// Semi-major axis of WGS 84, in metres.
const AXIS: f64 = 6_378_137.0;

/// Flattening of WGS 84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

impl ProofDistance {
    /// From `p` to the segment from `a` to `b`.
    pub(super) fn of(self, p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
        let scale = match self {
            Self::Plane => [1.0, 1.0, 0.0],
            Self::Space => [1.0; 3],
            Self::Geographic => metres(p[1]),
        };
        // Everything relative to the vertex.
        let [a, b] = [a, b].map(|q| [0, 1, 2].map(|k| (q[k] - p[k]) * scale[k]));
        let along = [0, 1, 2].map(|k| b[k] - a[k]);
        let square = dot(along, along);
        let part = if square > 0.0 { -dot(a, along) / square } else { 0.0 };
        if part <= 0.0 {
            return dot(a, a).sqrt();
        }
        if part >= 1.0 {
            return dot(b, b).sqrt();
        }
        let cross =
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        (dot(cross, cross) / square).sqrt()
    }
}

impl ProofDistance {
    /// x and y relative to an origin, in the units of distances near it.
    pub(super) fn flat(self, p: [f64; 3], origin: [f64; 3]) -> [f64; 2] {
        let scale = match self {
            Self::Plane | Self::Space => [1.0; 3],
            Self::Geographic => metres(origin[1]),
        };
        [0, 1].map(|k| (p[k] - origin[k]) * scale[k])
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Metres to a degree of longitude and of latitude, at a latitude.
fn metres(latitude: f64) -> [f64; 3] {
    let phi = latitude * std::f64::consts::PI / 180.0;
    let square = FLATTENING * (2.0 - FLATTENING);
    let root = (1.0 - square * phi.sin() * phi.sin()).sqrt();
    let degree = AXIS * std::f64::consts::PI / 180.0;
    [degree * phi.cos() / root, degree * (1.0 - square) / (root * root * root), 0.0]
}
