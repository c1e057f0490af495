//! Findings of a verification against any kind of original, as text and JSON.

use serde::Serialize;

use super::vertices::VertexCounts;
use terrane_engine::proof::ProofVerdict;
use terrane_engine::run_statistics::RunStatistics;
use terrane_mesh::{MeshInfo, Promises};
use terrane_proof::{FaultCount, ProofPosition, ProofTally};

/// Note of a report without a known error bound.
pub(super) const NO_BOUND: &str = "the error, as no bound is known (‹max_error›)";

/// Number of occurrences of a fault, and its first place in the order of the original.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct FaultReport<P> {
    pub count: u64,
    pub first: Option<P>,
}

impl<P: Copy> FaultReport<P> {
    pub(super) fn is_none(&self) -> bool {
        self.count == 0
    }

    pub(super) fn of(fault: &FaultCount, place: impl Fn(ProofPosition) -> P) -> Self {
        Self { count: fault.count, first: fault.first.map(place) }
    }

    fn sentence(&self, what: &str, describe: impl Fn(P) -> String) -> Option<String> {
        let place = self.first.filter(|_| self.count > 0)?;
        Some(format!("{} {what}, first at {}", self.count, describe(place)))
    }
}

/// Omits zero counts from a report.
pub(super) fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// The original of a mesh, and the findings specific to its kind.
pub trait MeshOriginal: Clone + Default + PartialEq + Serialize {
    /// Where a fault is.
    type Place: Copy + PartialEq + Serialize;
    /// Noun for the samples that the promise covers.
    const POINTS: &'static str;
    /// Noun for the region that the mesh covers.
    const WHOLE: &'static str;
    /// Where triangles are Delaunay.
    const PLANE: &'static str;

    /// A place in words.
    fn describe(place: Self::Place) -> String;
    /// The coverage faults that break a promise, with their descriptions.
    fn promises(&self) -> Vec<(FaultReport<Self::Place>, &'static str)>;
    /// Vertices that the original does not have.
    fn off_vertices(&self) -> FaultReport<Self::Place>;

    /// True when vertices may lie where the original has no points.
    fn may_be_off(&self) -> bool {
        false
    }

    /// True when vertices may lie above or below the original.
    fn is_fitted(&self) -> bool {
        false
    }
    /// The failure for a mesh of this area where another is expected.
    fn wrong_area(&self, area: f64) -> String;
}

/// Result of a verification. Heights and errors are in the vertical unit of the original.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(bound = "")]
#[non_exhaustive]
pub struct MeshReport<O: MeshOriginal> {
    /// Mesh file.
    pub mesh: String,
    /// Format of the mesh.
    pub format: String,
    /// Findings specific to this kind of original.
    #[serde(flatten)]
    pub of: O,
    /// Verdict of the proof.
    #[serde(flatten)]
    pub verdict: ProofVerdict,

    /// Largest allowed vertical distance; when `None`, errors are measured, not judged.
    pub tolerance: Option<f64>,
    /// Samples further from the mesh than the tolerance (decided exactly, closed <=).
    pub over_tolerance: FaultReport<O::Place>,
    /// Largest vertical distance of covered samples.
    pub max_error: Option<f64>,
    /// Where it is.
    pub max_error_at: Option<O::Place>,
    /// Root mean square of the vertical distances.
    pub rmse: Option<f64>,
    /// Mean of these distances.
    pub mean_error: Option<f64>,
    /// Counts by error / tolerance: twenty bins from 0 to 1, then larger ones. Empty without a
    /// tolerance.
    pub error_histogram: Vec<u64>,

    /// Vertices stored.
    pub vertices: u64,
    /// Triangles stored.
    pub triangles: u64,
    /// Vertices that are not where the original has points; they are checked where they are.
    pub free_vertices: u64,
    /// Vertices without a finite position and height, or absurdly far away.
    pub unusable_vertices: u64,
    /// Triangles with such a vertex; they are left out of every other check.
    pub broken_triangles: u64,
    /// Area of all triangles less that of inverted ones.
    pub mesh_area: f64,

    /// Samples or points strictly inside more than one triangle.
    pub overlaps: FaultReport<O::Place>,
    /// Triangles clockwise seen from above.
    pub inverted_triangles: FaultReport<O::Place>,
    /// Triangles without area.
    pub empty_triangles: FaultReport<O::Place>,
    /// Edges of one triangle only that are not on the outline.
    pub cracks: FaultReport<O::Place>,
    /// Vertices strictly inside an edge of one triangle.
    pub t_junctions: FaultReport<O::Place>,
    /// Edges of more than two triangles, or of two that pass it in the same direction.
    pub non_manifold_edges: FaultReport<O::Place>,
    /// Positions where triangles meet with different heights.
    pub split_heights: FaultReport<O::Place>,
    /// Stored vertices beyond the first at the same position.
    pub duplicate_vertices: FaultReport<O::Place>,
    /// Stored vertices at no triangle's corner.
    pub unused_vertices: FaultReport<O::Place>,
    /// True when the file bears terrane's mark, and with it the promise that the original has its
    /// vertices.
    pub made_by_terrane: bool,

    /// Edges between two triangles.
    pub interior_edges: u64,
    /// Edges of one triangle.
    pub open_edges: u64,
    /// Interior edges that fail the strict in-circle test on the lattice; a failure where `delaunay`.
    pub non_delaunay_edges: FaultReport<O::Place>,
    /// True where the mesh promises that its triangles are Delaunay: terrane made it, and it states no other
    /// triangulation.
    pub delaunay: bool,
    /// Source of the mesh as named in its header; not judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Smallest angle of any triangle with area, in degrees on the lattice: a measurement.
    pub smallest_angle: Option<f64>,
    /// Triangles by smallest angle, in steps of 5 degrees from 0 to 60.
    pub angle_histogram: Vec<u64>,

    /// Time, memory and threads of the run.
    #[serde(flatten)]
    pub run: RunStatistics,
}

/// Findings on the lattice, and their scale in the units of the original.
pub(super) struct MeshFindings<'a> {
    pub(super) mesh: &'a MeshInfo,
    pub(super) stated: &'a Promises,
    /// Whether it states no triangulation that is not Delaunay.
    pub(super) is_delaunay: bool,
    pub(super) tolerance: Option<f64>,
    pub(super) vertices: &'a VertexCounts,
    pub(super) broken: u64,
    pub(super) tally: &'a ProofTally,
    /// One step of heights.
    pub(super) step: f64,
    /// Width and height of a cell, or of a step both ways.
    pub(super) cell: [f64; 2],
    /// Whether the mesh has the area that it should.
    pub(super) area_matches: bool,
}

/// Twice the area of a cell in the unit of [`ProofTally::double_area`].
pub(super) const DOUBLE_CELL: i128 = 2 << (2 * ProofPosition::FRACTION);

/// An area on the lattice, where cells are so wide and high.
pub(super) fn area(double: i128, [width, height]: [f64; 2]) -> f64 {
    double as f64 / DOUBLE_CELL as f64 * width * height
}

impl<O: MeshOriginal> MeshReport<O> {
    /// The findings, judged; without names of files and statistics of the run.
    pub(super) fn new(
        of: O,
        findings: &MeshFindings<'_>,
        place: impl Fn(ProofPosition) -> O::Place,
    ) -> Self {
        let MeshFindings { mesh, stated, tolerance, vertices, tally, step, .. } = *findings;
        let fault = |fault: &FaultCount| FaultReport::of(fault, &place);
        let report = Self {
            mesh: String::new(),
            format: mesh.format.to_owned(),
            of,
            verdict: ProofVerdict::default(),
            tolerance,
            over_tolerance: fault(&tally.over),
            max_error: tally.worst.map(|spot| spot.error * step),
            max_error_at: tally.worst.map(|spot| place(spot.at)),
            rmse: mean(tally.squares.value(), tally.covered).map(|square| square.sqrt() * step),
            mean_error: mean(tally.errors.value(), tally.covered).map(|mean| mean * step),
            error_histogram: tolerance.map_or(Vec::new(), |_| tally.histogram.to_vec()),
            vertices: mesh.vertices,
            triangles: mesh.triangles,
            free_vertices: vertices.free,
            unusable_vertices: vertices.unusable,
            broken_triangles: findings.broken,
            mesh_area: area(tally.double_area, findings.cell),
            overlaps: fault(&tally.overlaps),
            inverted_triangles: fault(&tally.inverted),
            empty_triangles: fault(&tally.empty),
            cracks: fault(&tally.cracks),
            t_junctions: fault(&tally.t_junctions),
            non_manifold_edges: fault(&tally.non_manifold),
            split_heights: fault(&tally.split_heights),
            duplicate_vertices: fault(&tally.duplicates),
            unused_vertices: fault(&tally.unused),
            made_by_terrane: mesh.is_own(),
            interior_edges: tally.interior_edges,
            open_edges: tally.open_edges,
            non_delaunay_edges: fault(&tally.non_delaunay),
            delaunay: findings.is_delaunay && mesh.is_own() && !is_silent(mesh, stated),
            source: stated.source.clone(),
            smallest_angle: tally.smallest_angle,
            angle_histogram: tally.angles.to_vec(),
            run: RunStatistics::default(),
        };
        let verdict = report.judged(findings);
        Self { verdict, ..report }
    }

    fn judged(&self, findings: &MeshFindings<'_>) -> ProofVerdict {
        let counts = [
            (self.unusable_vertices, "vertices without a usable position"),
            (self.broken_triangles, "triangles with such a vertex"),
        ];
        let plain = counts.into_iter().filter(|(count, _)| *count > 0);
        let mut failures: Vec<String> = plain.map(|(n, what)| format!("{n} {what}")).collect();
        let promises = self.promises();
        failures
            .extend(promises.iter().filter_map(|(fault, what)| fault.sentence(what, O::describe)));
        if !findings.area_matches {
            failures.push(self.of.wrong_area(self.mesh_area));
        }
        let no_bound = self.tolerance.is_none().then(|| NO_BOUND.to_owned());
        // Where all edges are Delaunay it does not matter whether that was promised.
        let is_silent = self.made_by_terrane && is_silent(findings.mesh, findings.stated);
        let no_triangulation = (is_silent && self.non_delaunay_edges.count > 0).then(|| {
            "whether it is Delaunay: its header has no space for that statement".to_owned()
        });
        ProofVerdict::of(failures, no_bound.into_iter().chain(no_triangulation).collect())
    }

    /// The faults that break a promise, with their descriptions.
    fn promises(&self) -> Vec<(FaultReport<O::Place>, String)> {
        let (points, whole) = (O::POINTS, O::WHOLE);
        let over = format!("{points} further from the mesh than the tolerance");
        let cover = self.of.promises().into_iter().map(|(fault, what)| (fault, what.to_owned()));
        let topology = [
            (self.overlaps, format!("{points} inside overlapping triangles")),
            (self.inverted_triangles, "inverted triangles".to_owned()),
            (self.empty_triangles, "triangles without area".to_owned()),
            (self.cracks, format!("cracks (open edges inside the {whole})")),
            (self.t_junctions, "T-junctions (vertices inside an open edge)".to_owned()),
            (self.non_manifold_edges, "non-manifold edges".to_owned()),
            (self.split_heights, "positions with several heights".to_owned()),
            (self.duplicate_vertices, "duplicate vertices".to_owned()),
            (self.unused_vertices, "unused vertices".to_owned()),
        ];
        // Of other meshes the bound may hold all the same.
        let off = self.made_by_terrane && !self.of.may_be_off();
        let off = off.then(|| self.of.off_vertices());
        let off = off.map(|fault| (fault, format!("vertices off the {points}")));
        let edges = format!("edges that are not Delaunay {}", O::PLANE);
        let edges = self.delaunay.then_some((self.non_delaunay_edges, edges));
        let own = off.into_iter().chain(edges);
        [(self.over_tolerance, over)].into_iter().chain(cover).chain(topology).chain(own).collect()
    }
}

/// The mean of so many values; `None` without any.
pub(super) fn mean(sum: f64, count: u64) -> Option<f64> {
    (count > 0).then(|| sum / count as f64)
}

/// True for formats whose header has no space for promises: STL, which then states no bound either.
fn is_silent(mesh: &MeshInfo, stated: &Promises) -> bool {
    !mesh.names_crs() && stated.max_error.is_none()
}
