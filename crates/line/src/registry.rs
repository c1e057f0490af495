//! The methods by name.

use super::metric::{Geographic, Located, Plane, Space, Vertical};
use super::{Scratch, Xy, cone, imai_iri, rdp, visvalingam};

/// A method for vertices `V` in the metric `M`: metric, vertices, tolerance, scratch, kept indices
/// (appended).
pub type Run<V, M> = fn(&M, &[V], f64, &mut Scratch, &mut Vec<u32>);

/// What the tolerance of a method is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bounds {
    /// The largest distance of a vertex from the segment that replaces it.
    Distance,
    /// The effective area below which a vertex goes; no distance is bounded.
    Area,
}

/// A method of simplification.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Name on the command line.
    pub name: &'static str,
    /// One line for help texts.
    pub summary: &'static str,
    /// What it bounds.
    pub bounds: Bounds,
    /// In the plane.
    pub plane: Run<Xy, Plane>,
    /// In space.
    pub space: Run<[f64; 3], Space>,
    /// On profiles.
    pub vertical: Run<Xy, Vertical>,
    /// In metres on the ellipsoid.
    pub geographic: Run<Located, Geographic>,
}

macro_rules! method {
    ($name:literal, $bounds:ident, $run:path, $summary:literal) => {
        Method {
            name: $name,
            summary: $summary,
            bounds: Bounds::$bounds,
            plane: $run,
            space: $run,
            vertical: $run,
            geographic: $run,
        }
    };
}

/// All methods, the default first.
pub const METHODS: &[Method] = &[
    method!("cone", Distance, cone::cone, "greedy double cone: one pass, near the fewest vertices"),
    method!("rdp", Distance, rdp::rdp, "Ramer-Douglas-Peucker: split at the farthest vertex"),
    method!("imai-iri", Distance, imai_iri::imai_iri, "the fewest vertices, by shortest path"),
    method!(
        "visvalingam",
        Area,
        visvalingam::visvalingam,
        "Visvalingam-Whyatt: smallest triangles first"
    ),
    method!(
        "weighted-visvalingam",
        Area,
        visvalingam::weighted_visvalingam,
        "Visvalingam-Whyatt with areas weighted by the angle: spikes first"
    ),
];

/// The method called `name`.
pub fn method(name: &str) -> Option<&'static Method> {
    METHODS.iter().find(|method| method.name == name)
}
