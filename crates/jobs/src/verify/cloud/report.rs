//! What a verification against a cloud found, for people and programs.

use serde::Serialize;

use super::Context;
use super::points::SpreadPoints;
use crate::tin::{horizontal_unit, vertical_unit};
use crate::verify::spread::Spread;
use terrane_cloud::Census;
use terrane_proof::cloud::Hull;
use terrane_proof::{Fault, Position, Tally};

/// How often a fault was found, and the first place: the southernmost, of these the westernmost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct CloudFault {
    pub count: u64,
    /// World x and y.
    pub first: Option<[f64; 2]>,
}

/// Result of [`prove_cloud`](super::prove_cloud). Heights and errors are in the vertical unit of the
/// cloud, areas in its horizontal unit squared, angles in degrees in steps of its frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CloudVerifyReport {
    /// Mesh file.
    pub mesh: String,
    /// Format of the mesh.
    pub format: String,
    /// Cloud.
    pub cloud: String,
    /// Coordinate reference system of the cloud.
    pub crs: String,
    /// Unit of x and y.
    pub horizontal_unit: String,
    /// Unit of heights.
    pub vertical_unit: String,
    /// True when no promise is known to be broken.
    pub passed: bool,
    /// True when all that is promised was judged.
    pub judged: bool,
    /// One sentence for each broken promise.
    pub failures: Vec<String>,
    /// What is promised and could not be judged.
    pub not_judged: Vec<String>,

    /// What became of the points read.
    pub points: Census,
    /// Points that are the lowest at their position: the promise is about these.
    pub judged_points: u64,
    /// Points above another one at the same position: they bind nothing.
    pub stacked_points: u64,
    /// Judged points covered by a triangle.
    pub covered_points: u64,

    /// Largest allowed vertical distance; when `None`, errors are measured, not judged.
    pub tolerance: Option<f64>,
    /// The same in steps of the cloud's heights, whole where it is so but for rounding.
    pub tolerance_steps: Option<f64>,
    /// Judged points further from the mesh than the tolerance (decided exactly, closed <=).
    pub over_tolerance: CloudFault,
    /// Largest vertical distance of a covered point.
    pub max_error: Option<f64>,
    /// Where it is: world x and y.
    pub max_error_at: Option<[f64; 2]>,
    /// Root mean square of these distances.
    pub rmse: Option<f64>,
    /// Mean of these distances.
    pub mean_error: Option<f64>,
    /// Points by error / tolerance: twenty bins from 0 to 1, then those over. Empty without a
    /// tolerance.
    pub error_histogram: Vec<u64>,

    /// Vertices stored.
    pub vertices: u64,
    /// Triangles stored.
    pub triangles: u64,
    /// Vertices moved to whole steps, because the rounding of their storage explains the distance.
    pub moved_vertices: u64,
    /// The longest such move, in steps along an axis.
    pub largest_move: f64,
    /// Distance up to which that is done, in steps.
    pub move_radius: f64,
    /// Vertices that are not at whole steps; they are checked where they are.
    pub free_vertices: u64,
    /// Vertices without a finite position and height, or absurdly far away.
    pub unusable_vertices: u64,
    /// Triangles with such a vertex; they are left out of every other check.
    pub broken_triangles: u64,
    /// Area of all triangles less that of inverted ones.
    pub mesh_area: f64,
    /// Area of the convex hull of the points.
    pub hull_area: f64,
    /// Corners of that hull.
    pub hull_corners: u64,

    /// Judged points no triangle covers.
    pub uncovered_points: CloudFault,
    /// Vertices beyond the hull of the points.
    pub outside_vertices: CloudFault,
    /// Judged points strictly inside more than one triangle.
    pub overlaps: CloudFault,
    /// Triangles clockwise seen from above.
    pub inverted_triangles: CloudFault,
    /// Triangles without area.
    pub empty_triangles: CloudFault,
    /// Edges of one triangle only that are not on the outline of the hull.
    pub cracks: CloudFault,
    /// Vertices strictly inside an edge of one triangle.
    pub t_junctions: CloudFault,
    /// Edges of more than two triangles, or of two that pass it in the same direction.
    pub non_manifold_edges: CloudFault,
    /// Positions where triangles meet with different heights.
    pub split_heights: CloudFault,
    /// Stored vertices beyond the first at the same position.
    pub duplicate_vertices: CloudFault,
    /// Stored vertices at no triangle's corner.
    pub unused_vertices: CloudFault,
    /// Positions of triangle corners that are no point of the cloud, in the precision of the format.
    /// A failure only where `made_by_terrane`: the error bound of other meshes may hold all the same.
    pub off_point_vertices: CloudFault,
    /// True when the file bears terrane's mark, and with it the promise that vertices are points.
    pub made_by_terrane: bool,

    /// Edges between two triangles.
    pub interior_edges: u64,
    /// Edges of one triangle.
    pub open_edges: u64,
    /// Interior edges that fail the strict in-circle test; not a failure.
    pub non_delaunay_edges: CloudFault,
    /// Smallest angle of any triangle with area; not a failure.
    pub smallest_angle: Option<f64>,
    /// Triangles by smallest angle, in steps of 5 degrees from 0 to 60.
    pub angle_histogram: Vec<u64>,

    /// Threads used.
    pub threads: usize,
    /// Memory budget in bytes.
    pub memory_budget: u64,
    /// Bytes spilled to temporary files.
    pub spilled_bytes: u64,
    /// Largest resident memory of the process so far, in bytes.
    pub peak_memory: Option<u64>,
    /// Seconds from start to end.
    pub wall_seconds: f64,
    /// Points read by seconds.
    pub points_per_second: f64,
}

impl CloudVerifyReport {
    /// The findings, judged; without names of files and figures of the run.
    pub(super) fn new(
        context: &Context<'_>,
        points: &SpreadPoints,
        hull: &Hull,
        spread: &Spread,
        tally: &Tally,
    ) -> Self {
        let (cloud, mesh) = (context.source.info(), context.work.mesh.info());
        let step = cloud.frame.scale[2];
        let place = |at: Position| context.placer.world(at);
        let fault =
            |fault: &Fault| CloudFault { count: fault.count, first: fault.first.map(place) };
        let mean = |sum: f64| (tally.covered > 0).then(|| sum / tally.covered as f64);
        let [width, height, _] = cloud.frame.scale;
        let area = |double: i128| double as f64 / DOUBLE_STEP * width * height;
        let worst = tally.worst;
        let mut report = Self {
            format: mesh.format.to_owned(),
            crs: cloud.crs.label(),
            horizontal_unit: horizontal_unit(&cloud.crs).to_owned(),
            vertical_unit: vertical_unit(&cloud.crs).unwrap_or("units").to_owned(),
            points: points.census,
            judged_points: tally.surface_samples,
            stacked_points: tally.valid - tally.surface_samples,
            covered_points: tally.covered,
            tolerance: context.tolerance,
            tolerance_steps: context.bound.map(|bound| bound.steps()),
            over_tolerance: fault(&tally.over),
            max_error: worst.map(|spot| spot.error * step),
            max_error_at: worst
                .map(|spot| place(Position::sample(i64::from(spot.col), i64::from(spot.row)))),
            rmse: mean(tally.squares.value()).map(|square| square.sqrt() * step),
            mean_error: mean(tally.errors.value()).map(|mean| mean * step),
            error_histogram: context.bound.map_or(Vec::new(), |_| tally.histogram.to_vec()),
            vertices: mesh.vertices,
            triangles: mesh.triangles,
            moved_vertices: spread.counts.snapped,
            largest_move: spread.counts.largest_snap,
            move_radius: context.placer.radius(),
            free_vertices: spread.counts.free,
            unusable_vertices: spread.counts.unusable,
            broken_triangles: spread.broken,
            mesh_area: area(tally.double_area),
            hull_area: area(hull.double_area()),
            hull_corners: hull.corners().count() as u64,
            uncovered_points: fault(&tally.uncovered),
            outside_vertices: fault(&tally.outside),
            overlaps: fault(&tally.overlaps),
            inverted_triangles: fault(&tally.inverted),
            empty_triangles: fault(&tally.empty),
            cracks: fault(&tally.cracks),
            t_junctions: fault(&tally.t_junctions),
            non_manifold_edges: fault(&tally.non_manifold),
            split_heights: fault(&tally.split_heights),
            duplicate_vertices: fault(&tally.duplicates),
            unused_vertices: fault(&tally.unused),
            off_point_vertices: fault(&tally.off_samples),
            made_by_terrane: mesh.is_own(),
            interior_edges: tally.interior_edges,
            open_edges: tally.open_edges,
            non_delaunay_edges: fault(&tally.non_delaunay),
            smallest_angle: tally.smallest_angle,
            angle_histogram: tally.angles.to_vec(),
            ..Self::default()
        };
        report.judge(tally.double_area == hull.double_area());
        report
    }

    /// Fills `failures` and `passed`.
    fn judge(&mut self, area_matches: bool) {
        let counts = [
            (self.unusable_vertices, "vertices without a usable position"),
            (self.broken_triangles, "triangles that use such a vertex"),
        ];
        let plain = counts.into_iter().filter(|(count, _)| *count > 0);
        let mut failures: Vec<String> = plain.map(|(n, what)| format!("{n} {what}")).collect();
        failures.extend(self.promises().iter().filter_map(|(fault, what)| fault.sentence(what)));
        if self.made_by_terrane {
            failures.extend(self.off_point_vertices.sentence("vertices off the points"));
        }
        if !area_matches {
            let (mesh, hull) = (self.mesh_area, self.hull_area);
            failures.push(format!("the mesh has an area of {mesh}, the hull of the points {hull}"));
        }
        self.passed = failures.is_empty();
        self.failures = failures;
        self.judged = self.tolerance.is_some();
        if !self.judged {
            self.not_judged.push(crate::verify::NO_BOUND.to_owned());
        }
    }

    /// The faults that break a promise, and what they are.
    fn promises(&self) -> [(CloudFault, &'static str); 12] {
        [
            (self.over_tolerance, "points further from the mesh than the tolerance"),
            (self.uncovered_points, "points not covered by the mesh"),
            (self.outside_vertices, "vertices beyond the hull of the points"),
            (self.overlaps, "points inside overlapping triangles"),
            (self.inverted_triangles, "inverted triangles"),
            (self.empty_triangles, "triangles without area"),
            (self.cracks, "cracks (open edges inside the hull)"),
            (self.t_junctions, "T-junctions (vertices inside an open edge)"),
            (self.non_manifold_edges, "non-manifold edges"),
            (self.split_heights, "positions with several heights"),
            (self.duplicate_vertices, "duplicate vertices"),
            (self.unused_vertices, "unused vertices"),
        ]
    }
}

/// Twice the area of a step both ways in the unit of [`Tally::double_area`].
const DOUBLE_STEP: f64 = (2u64 << (2 * Position::FRACTION)) as f64;

impl CloudFault {
    fn sentence(&self, what: &str) -> Option<String> {
        let [x, y] = self.first.filter(|_| self.count > 0)?;
        Some(format!("{} {what}, first at x {x}, y {y}", self.count))
    }
}
