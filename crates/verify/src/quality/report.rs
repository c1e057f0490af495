//! Report of the quality of a mesh, as text and JSON.

use serde::Serialize;

use crate::findings::mean;
use crate::report::GridLocation;
use terrane_proof::ProofPosition;
use terrane_proof::quality::{AcuteAngles, DelaunayCounts, Quality};
use terrane_proof::slope::SlopeTally;

/// The quality of a mesh. Vertices are positions in plan, so that duplicates in formats without shared
/// vertices count once. Lengths and angles are in plan in the coordinates of the mesh, as if these were
/// lengths, except those in space.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct QualityReport {
    /// Positions of corners.
    pub vertices: u64,
    /// Triangles, without the broken ones.
    pub triangles: u64,
    /// Triangles with a vertex that has no finite position; they are excluded from all other
    /// figures.
    pub broken_triangles: u64,
    /// Triangles without area in plan: they have no angles.
    pub empty_triangles: u64,
    /// Triangles clockwise seen from above.
    pub inverted_triangles: u64,
    /// Edges, each once.
    pub edges: u64,
    /// Edges of two triangles that pass them in opposite directions.
    pub interior_edges: u64,
    /// Edges of one triangle.
    pub border_edges: u64,
    /// Edges of more than two triangles, or of two that pass them in the same direction.
    pub non_manifold_edges: u64,
    /// Interior edges that are locally Delaunay: neither opposite corner is inside the circle through the
    /// other triangle.
    pub delaunay_edges: u64,
    /// Delaunay edges with all four corners on one circle, within the rounding of positions: the other
    /// diagonal would be Delaunay, too.
    pub cocircular_edges: u64,
    /// Interior edges that are not locally Delaunay.
    pub non_delaunay_edges: u64,
    /// Interior edges whose triangles do not lie on opposite sides in plan: overhangs, and neighbours of
    /// triangles without area. They are not Delaunay either.
    pub folded_edges: u64,
    /// Delaunay edges by interior edges.
    pub delaunay_share: Option<f64>,
    /// Sum of the lengths of all edges.
    pub edge_length_sum: f64,
    /// The shortest edge.
    pub shortest_edge: Option<f64>,
    /// The longest edge.
    pub longest_edge: Option<f64>,
    /// Edges of a vertex.
    pub degrees: DegreeReport,
    /// Smallest angles of triangles in plan.
    pub smallest_angles: AngleReport,
    /// The largest angle of a triangle in plan, in degrees.
    pub largest_angle: Option<f64>,
    /// Aspect ratios of triangles in plan.
    pub aspect_ratios: AspectReport,
    /// Smallest angles of triangles in space, heights taken to have the unit of x and y; absent where these
    /// are degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smallest_angles_in_space: Option<AngleReport>,
    /// How far triangles are from the slopes of the grid; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope: Option<SlopeReport>,
}

/// Smallest angles of triangles, in degrees.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AngleReport {
    /// The least of all.
    pub min: Option<f64>,
    /// 1st percentile over the triangles, to a hundredth of a degree.
    pub percentile_1: Option<f64>,
    /// 5th percentile.
    pub percentile_5: Option<f64>,
    /// Median.
    pub median: Option<f64>,
    /// Shares of triangles below some angles.
    pub below: Vec<AngleShare>,
    /// Triangles in steps of 5 degrees from 0 to 60.
    pub histogram: Vec<u64>,
}

/// A share of the triangles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AngleShare {
    /// The angle, in degrees.
    pub angle: f64,
    /// How many triangles are below it.
    pub triangles: u64,
    /// The same, by all that have angles.
    pub share: f64,
}

impl AngleReport {
    fn new(angles: &AcuteAngles) -> Self {
        let below = AcuteAngles::LIMITS.into_iter().zip(angles.below).map(|(angle, triangles)| {
            AngleShare { angle, triangles, share: triangles as f64 / angles.count().max(1) as f64 }
        });
        Self {
            min: angles.min,
            percentile_1: angles.percentile(1),
            percentile_5: angles.percentile(5),
            median: angles.percentile(50),
            below: below.collect(),
            histogram: angles.histogram.to_vec(),
        }
    }
}

/// Aspect ratios of triangles: longest edge by the radius of the inscribed circle, by 2 sqrt(3), as the
/// Verdict library has it; 1 for an equilateral triangle.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AspectReport {
    /// Mean over the triangles with area.
    pub mean: Option<f64>,
    /// The largest.
    pub max: Option<f64>,
    /// Upper ends of the bins of the histogram but the last, which has none.
    pub bins: Vec<f64>,
    /// Triangles by bin.
    pub histogram: Vec<u64>,
}

/// Numbers of edges of vertices.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DegreeReport {
    /// The fewest.
    pub min: Option<u64>,
    /// Mean over the vertices.
    pub mean: Option<f64>,
    /// The most.
    pub max: Option<u64>,
    /// Vertices with 0, 1, 2 and more edges; the last entry counts 20 or more.
    pub histogram: Vec<u64>,
}

/// The angle between the normals of triangles and of the grid, in degrees: at the middle of each cell
/// with four samples, with the slope by central differences. Where several triangles meet there, the
/// largest angle counts.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SlopeReport {
    /// Cells that were compared.
    pub cells: u64,
    /// Cells with four samples and no triangle over their middle.
    pub uncovered_cells: u64,
    /// Root mean square of the angles.
    pub rms: Option<f64>,
    /// The largest angle.
    pub max: Option<f64>,
    /// Where it is.
    pub max_at: Option<GridLocation>,
    /// Assumptions.
    pub notes: Vec<String>,
}

impl SlopeReport {
    pub(super) fn new(
        slopes: &SlopeTally,
        notes: Vec<String>,
        place: impl Fn(ProofPosition) -> GridLocation,
    ) -> Self {
        let mean = mean(slopes.squares.value(), slopes.cells);
        Self {
            cells: slopes.cells,
            uncovered_cells: slopes.uncovered,
            rms: mean.map(f64::sqrt),
            max: slopes.worst.map(|spot| spot.error),
            max_at: slopes.worst.map(|spot| place(spot.at)),
            notes,
        }
    }
}

impl QualityReport {
    /// Builds the report; `cell` is the width of a lattice cell in the units of the mesh.
    pub(super) fn new(quality: &Quality, broken: u64, cell: f64, has_space: bool) -> Self {
        let DelaunayCounts { delaunay, cocircular, not_delaunay, folded } = quality.pairs;
        let interior_edges = delaunay + cocircular + not_delaunay + folded;
        let delaunay_edges = delaunay + cocircular;
        Self {
            vertices: quality.vertices,
            triangles: quality.triangles,
            broken_triangles: broken,
            empty_triangles: quality.empty,
            inverted_triangles: quality.inverted,
            edges: quality.edges,
            interior_edges,
            border_edges: quality.border,
            non_manifold_edges: quality.tangled,
            delaunay_edges,
            cocircular_edges: cocircular,
            non_delaunay_edges: not_delaunay,
            folded_edges: folded,
            delaunay_share: mean(delaunay_edges as f64, interior_edges),
            edge_length_sum: quality.lengths.value() * cell,
            shortest_edge: quality.shortest.map(|cells| cells * cell),
            longest_edge: quality.longest.map(|cells| cells * cell),
            degrees: DegreeReport::new(quality),
            smallest_angles: AngleReport::new(&quality.plan),
            largest_angle: quality.largest_angle,
            aspect_ratios: AspectReport {
                mean: mean(quality.aspects.value(), quality.plan.count()),
                max: quality.worst_aspect,
                bins: Quality::ASPECTS.to_vec(),
                histogram: quality.aspect_histogram.to_vec(),
            },
            smallest_angles_in_space: has_space.then(|| AngleReport::new(&quality.space)),
            slope: None,
        }
    }
}

impl DegreeReport {
    fn new(quality: &Quality) -> Self {
        let [min, max] = [0, 1].map(|end| quality.degree_range.map(|range| range[end]));
        // Each edge is one of two vertices.
        let mean = mean(2.0 * quality.edges as f64, quality.vertices);
        Self { min, mean, max, histogram: quality.degrees.to_vec() }
    }
}
