//! Line simplification in memory.

use terrane_line::registry::Run;
use terrane_line::{self as line, PlaneMetric, SimplifyScratch, SpaceMetric, ring};

/// Simplification method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// Greedy double cone: one pass, near the fewest vertices. O(n) in practice.
    #[default]
    Cone,
    /// Ramer (1972), Douglas and Peucker (1973): split at the farthest vertex. O(n log n) as a rule.
    Rdp,
    /// Imai and Iri (1988): the minimum number of vertices, by shortest path. O(n^2) at worst.
    ImaiIri,
    /// Visvalingam and Whyatt (1993): smallest triangles first. The tolerance is an area; distances are not
    /// bounded. O(n log n).
    Visvalingam,
    /// The same with areas weighted by the angle: spikes first.
    WeightedVisvalingam,
}

impl Method {
    /// Registry entry.
    pub(super) fn entry(self) -> &'static line::SimplifyMethod {
        match self {
            Self::Cone => &line::SimplifyMethod::CONE,
            Self::Rdp => &line::SimplifyMethod::RDP,
            Self::ImaiIri => &line::SimplifyMethod::IMAI_IRI,
            Self::Visvalingam => &line::SimplifyMethod::VISVALINGAM,
            Self::WeightedVisvalingam => &line::SimplifyMethod::WEIGHTED_VISVALINGAM,
        }
    }
}

/// Position of a vertex: `[f64; 2]` in the plane or `[f64; 3]` in space.
pub trait Coordinates: Copy + sealed::SealedCoordinates {}

impl Coordinates for [f64; 2] {}
impl Coordinates for [f64; 3] {}

mod sealed {
    use super::*;

    pub trait SealedCoordinates: Copy {
        type Metric: line::DistanceMetric<Self>;
        const METRIC: Self::Metric;
        fn run(method: &line::SimplifyMethod) -> Run<Self, Self::Metric>;
        fn is_finite(&self) -> bool;
    }

    impl SealedCoordinates for [f64; 2] {
        type Metric = PlaneMetric;
        const METRIC: PlaneMetric = PlaneMetric;

        fn run(method: &line::SimplifyMethod) -> Run<Self, PlaneMetric> {
            method.plane
        }

        fn is_finite(&self) -> bool {
            self.iter().all(|coordinate| coordinate.is_finite())
        }
    }

    impl SealedCoordinates for [f64; 3] {
        type Metric = SpaceMetric;
        const METRIC: SpaceMetric = SpaceMetric;

        fn run(method: &line::SimplifyMethod) -> Run<Self, SpaceMetric> {
            method.space
        }

        fn is_finite(&self) -> bool {
            self.iter().all(|coordinate| coordinate.is_finite())
        }
    }
}

/// Simplifies a line in memory: every omitted vertex is within `tolerance` of the segment that replaces it.
///
/// A vertex with a NaN coordinate is kept, as are its neighbours; a negative or NaN tolerance keeps all
/// vertices.
///
/// ```
/// use terrane::Method;
///
/// let coords = [[0.0, 0.0], [1.0, 0.004], [2.0, 0.0], [2.0, 1.0]];
/// assert_eq!(terrane::simplify(&coords, 0.01).indices(), [0, 2, 3]);
/// let kept = terrane::simplify(&coords, 0.01).method(Method::Rdp).coords();
/// assert_eq!(kept, [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]);
/// ```
pub fn simplify<C: Coordinates>(coords: &[C], tolerance: f64) -> Simplify<'_, C> {
    Simplify { coords, tolerance, method: Method::default(), is_ring: false }
}

/// A simplification built by setters; see [`simplify`].
#[derive(Clone, Copy, Debug)]
pub struct Simplify<'a, C> {
    coords: &'a [C],
    tolerance: f64,
    method: Method,
    is_ring: bool,
}

impl<C: Coordinates> Simplify<'_, C> {
    /// Simplification method; the cone by default.
    pub fn method(mut self, method: Method) -> Self {
        self.method = method;
        self
    }

    /// Treats the line as a ring whose last vertex repeats the first. The first vertex may be omitted; at least
    /// three vertices remain. Indices refer to distinct vertices, never to the last; [`coords`](Self::coords)
    /// closes the ring again.
    ///
    /// ```
    /// let square = [[1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0], [1.0, 0.0]];
    /// assert_eq!(terrane::simplify(&square, 0.0).ring(true).indices(), [1, 2, 3, 4]);
    /// ```
    pub fn ring(mut self, is_ring: bool) -> Self {
        self.is_ring = is_ring;
        self
    }

    /// Indices of the kept vertices, ascending.
    pub fn indices(&self) -> Vec<usize> {
        let keeps_all = self.tolerance.is_nan() || self.tolerance < 0.0;
        let is_finite = self.coords.iter().all(sealed::SealedCoordinates::is_finite);
        let distinct = self.coords.len() - usize::from(self.is_ring && !self.coords.is_empty());
        let is_too_long = self.is_ring && self.coords.len() > MAX_VERTICES;
        if keeps_all || is_too_long || (self.is_ring && !is_finite) {
            return (0..distinct).collect();
        }
        let mut indices = Vec::new();
        match self.is_ring {
            true => indices.extend(self.of_ring(&mut SimplifyScratch::default())),
            false => self.each_run(|from, kept| {
                indices.extend(kept.iter().map(|index| from + *index as usize));
            }),
        }
        indices
    }

    /// The kept vertices.
    pub fn coords(&self) -> Vec<C> {
        let mut kept: Vec<C> = self.indices().into_iter().map(|at| self.coords[at]).collect();
        let closing = kept.first().copied().filter(|_| self.is_ring);
        kept.extend(closing);
        kept
    }

    /// Calls `each` with the first vertex of each run of finite vertices, and with the kept indices of the run.
    fn each_run(&self, mut each: impl FnMut(usize, &[u32])) {
        let (mut scratch, mut kept) = (SimplifyScratch::default(), Vec::new());
        let run = C::run(self.method.entry());
        let mut from = 0;
        let runs = self.coords.chunk_by(|a, b| a.is_finite() == b.is_finite());
        for piece in runs.flat_map(|run| run.chunks(MAX_VERTICES)) {
            kept.clear();
            match piece[0].is_finite() {
                true => run(&C::METRIC, piece, self.tolerance, &mut scratch, &mut kept),
                false => kept.extend(0..piece.len() as u32),
            }
            each(from, &kept);
            from += piece.len();
        }
    }

    fn of_ring(&self, scratch: &mut SimplifyScratch) -> impl Iterator<Item = usize> + use<C> {
        let (method, tolerance, mut kept) = (self.method.entry(), self.tolerance, Vec::new());
        let run = C::run(method);
        match method.bounds.weight() {
            Some(weight) => {
                ring::visvalingam(&C::METRIC, self.coords, tolerance, weight, &mut kept);
            }
            None => {
                let can_move = !method.splits;
                ring::simplify(
                    &C::METRIC,
                    self.coords,
                    tolerance,
                    can_move,
                    |points, scratch, kept| run(&C::METRIC, points, tolerance, scratch, kept),
                    scratch,
                    &mut kept,
                );
            }
        }
        kept.into_iter().map(|at| at as usize)
    }
}

/// Maximum number of vertices of a run (32-bit indices).
const MAX_VERTICES: usize = 1 << 31;

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Method; 5] = [
        Method::Cone,
        Method::Rdp,
        Method::ImaiIri,
        Method::Visvalingam,
        Method::WeightedVisvalingam,
    ];

    #[test]
    fn every_method_of_the_registry_has_a_name_here() {
        let names = ALL.map(|method| method.entry().name);
        assert_eq!(names.to_vec(), line::METHODS.iter().map(|m| m.name).collect::<Vec<_>>());
    }

    #[test]
    fn bad_vertices_and_their_neighbours_stay() {
        let mut line: Vec<[f64; 2]> = (0..9).map(|i| [f64::from(i), 0.0]).collect();
        line[4][1] = f64::NAN;
        for method in ALL {
            let kept = simplify(&line, 0.5).method(method).indices();
            assert_eq!(kept, [0, 3, 4, 5, 8], "{method:?}");
            assert_eq!(simplify(&line, f64::NAN).method(method).indices().len(), 9);
        }
    }

    #[test]
    fn short_lines_and_rings_are_left_alone() {
        for count in 0..3 {
            let line = vec![[1.0, 2.0, 3.0]; count];
            for method in ALL {
                let lone = simplify(&line, 1.0).method(method);
                assert_eq!(lone.indices(), (0..count).collect::<Vec<_>>());
                assert_eq!(lone.ring(true).indices().len(), count.saturating_sub(1));
            }
        }
    }
}
