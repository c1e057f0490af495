//! The methods by name.

use super::metric::{GeographicMetric, LocatedVertex, PlaneMetric, SpaceMetric, VerticalMetric};
use super::scratch::SimplifyScratch;
use super::visvalingam::{self, AreaWeight};
use super::{cone, imai_iri, rdp};
use terrane_base::geom::plane::Xy;
use terrane_base::registry::{RegistryEntry, find};

/// A method for vertices `V` in the metric `M`: metric, vertices, tolerance, scratch, kept indices
/// (appended).
pub type Run<V, M> = fn(&M, &[V], f64, &mut SimplifyScratch, &mut Vec<u32>);

/// What the tolerance of a method is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToleranceKind {
    /// The largest distance of a vertex from the segment that replaces it.
    Distance,
    /// The effective area, weighted like this, below which a vertex goes; no distance is bounded.
    Area(AreaWeight),
}

impl ToleranceKind {
    /// How areas are weighted; `None` for methods that go by distance.
    pub fn weight(self) -> Option<AreaWeight> {
        match self {
            Self::Distance => None,
            Self::Area(weight) => Some(weight),
        }
    }
}

/// A method of simplification.
#[derive(Clone, Copy, Debug)]
pub struct SimplifyMethod {
    /// Name on the command line.
    pub name: &'static str,
    /// One line for help texts.
    pub summary: &'static str,
    /// What it bounds.
    pub bounds: ToleranceKind,
    /// It splits at vertices, so what it keeps at a tolerance it keeps at any smaller one: a
    /// [`Hierarchy`](crate::Hierarchy) answers for it, and rings keep the vertex they were split at first.
    pub splits: bool,
    /// In the plane.
    pub plane: Run<Xy, PlaneMetric>,
    /// In space.
    pub space: Run<[f64; 3], SpaceMetric>,
    /// On profiles.
    pub vertical: Run<Xy, VerticalMetric>,
    /// In metres on the ellipsoid.
    pub geographic: Run<LocatedVertex, GeographicMetric>,
}

macro_rules! method {
    ($name:literal, $bounds:expr, $run:path, $summary:literal) => {
        SimplifyMethod {
            name: $name,
            summary: $summary,
            bounds: $bounds,
            splits: false,
            plane: $run,
            space: $run,
            vertical: $run,
            geographic: $run,
        }
    };
}

impl SimplifyMethod {
    /// Greedy double cone.
    pub const CONE: Self = method!(
        "cone",
        ToleranceKind::Distance,
        cone::cone,
        "greedy double cone: one pass, near the minimum number of vertices"
    );
    /// Ramer-Douglas-Peucker.
    pub const RDP: Self = Self {
        splits: true,
        ..method!(
            "rdp",
            ToleranceKind::Distance,
            rdp::rdp,
            "Ramer-Douglas-Peucker: split at the farthest vertex"
        )
    };
    /// Imai and Iri.
    pub const IMAI_IRI: Self = method!(
        "imai-iri",
        ToleranceKind::Distance,
        imai_iri::imai_iri,
        "minimum number of vertices, by shortest path"
    );
    /// Visvalingam and Whyatt.
    pub const VISVALINGAM: Self = method!(
        "visvalingam",
        ToleranceKind::Area(AreaWeight::Plain),
        visvalingam::visvalingam,
        "Visvalingam-Whyatt: smallest triangles first"
    );
    /// Visvalingam and Whyatt, with areas weighted by the angle.
    pub const WEIGHTED_VISVALINGAM: Self = method!(
        "weighted-visvalingam",
        ToleranceKind::Area(AreaWeight::Angle),
        visvalingam::weighted_visvalingam,
        "Visvalingam-Whyatt with areas weighted by the angle: spikes first"
    );
}

/// All methods, the default first.
pub const METHODS: &[SimplifyMethod] = &[
    SimplifyMethod::CONE,
    SimplifyMethod::RDP,
    SimplifyMethod::IMAI_IRI,
    SimplifyMethod::VISVALINGAM,
    SimplifyMethod::WEIGHTED_VISVALINGAM,
];

/// The method called `name`.
pub fn method(name: &str) -> Option<&'static SimplifyMethod> {
    find(METHODS, name)
}

impl RegistryEntry for SimplifyMethod {
    const KIND: &'static str = "method";

    fn name(&self) -> &'static str {
        self.name
    }
}
