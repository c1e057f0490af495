//! Report of a verification against a cloud.

use serde::Serialize;

use super::constraints::ConstraintChecks;
use super::context::CloudProofContext;
use super::points::SpreadPoints;
use crate::buckets::MeshSpread;
use crate::findings::{FaultReport, MeshFindings, MeshOriginal, MeshReport, area, is_zero};
use terrane_base::error::Result;
use terrane_cloud::ReturnCounts;
use terrane_engine::breaklines::BreaklinesReport;
use terrane_engine::constraints::RequiredPointsReport;
use terrane_proof::cloud::ProofHull;
use terrane_proof::{FaultCount, ProofPosition, ProofTally};

/// Result of [`prove_cloud`](super::prove_cloud): areas are in the horizontal unit squared, angles in
/// steps of the cloud's frame, places are world x and y, and the first place of a fault is the
/// southernmost, of these the westernmost.
pub type CloudVerifyReport = MeshReport<CloudProofFindings>;

/// Findings of a verification against a cloud.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CloudProofFindings {
    /// Cloud.
    pub cloud: String,
    /// Coordinate reference system of the cloud.
    pub crs: String,
    /// Unit of x and y.
    pub horizontal_unit: String,
    /// Unit of heights.
    pub vertical_unit: String,
    /// Counts of the points read.
    pub points: ReturnCounts,
    /// Points that are the lowest at their position: the promise is about these.
    pub judged_points: u64,
    /// Points above another one at the same position: they bind nothing.
    pub stacked_points: u64,
    /// Judged points covered by a triangle.
    pub covered_points: u64,
    /// The tolerance in steps of the cloud's heights, whole where it is so but for rounding.
    pub tolerance_steps: Option<f64>,
    /// Vertices moved to whole steps, because the rounding of their storage explains the distance.
    pub moved_vertices: u64,
    /// The longest such move, in steps along an axis.
    pub largest_move: f64,
    /// Distance up to which that is done, in steps.
    pub move_radius: f64,
    /// Area of the convex hull of the points.
    pub hull_area: f64,
    /// Corners of that hull.
    pub hull_corners: u64,
    /// Judged points no triangle covers.
    pub uncovered_points: FaultReport<[f64; 2]>,
    /// Vertices beyond the hull of the points.
    pub outside_vertices: FaultReport<[f64; 2]>,
    /// Positions of triangle corners that are neither points of the cloud nor vertices of given breaklines, in the
    /// precision of the format. A failure only where `made_by_terrane`: the error bound of other meshes may hold all
    /// the same.
    pub off_point_vertices: FaultReport<[f64; 2]>,
    /// True where the mesh states vertices on breaklines that were not given: these need not be points.
    #[serde(skip)]
    pub has_posts: bool,
    /// Points to keep, if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_points: Option<RequiredPointsReport>,
    /// Points nearest to points to keep that are not vertices.
    #[serde(skip_serializing_if = "FaultReport::is_none")]
    pub not_kept: FaultReport<[f64; 2]>,
    /// Breaklines, if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<BreaklinesReport>,
    /// Vertices on breaklines.
    #[serde(skip_serializing_if = "is_zero")]
    pub on_breaklines: u64,
    /// Places where edges do not follow breaklines.
    #[serde(skip_serializing_if = "FaultReport::is_none")]
    pub not_followed: FaultReport<[f64; 2]>,
    /// Points read by seconds.
    pub points_per_second: f64,
}

impl MeshOriginal for CloudProofFindings {
    type Place = [f64; 2];
    const POINTS: &'static str = "points";
    const WHOLE: &'static str = "hull";
    const PLANE: &'static str = "in the steps of the cloud";

    fn describe([x, y]: [f64; 2]) -> String {
        format!("x {x}, y {y}")
    }

    fn promises(&self) -> Vec<(FaultReport<[f64; 2]>, &'static str)> {
        vec![
            (self.uncovered_points, "points not covered by the mesh"),
            (self.outside_vertices, "vertices beyond the hull of the points"),
            (self.not_kept, "required points that are not vertices"),
            (self.not_followed, "places on breaklines that edges do not follow"),
        ]
    }

    fn off_vertices(&self) -> FaultReport<[f64; 2]> {
        self.off_point_vertices
    }

    fn may_be_off(&self) -> bool {
        self.has_posts
    }

    fn wrong_area(&self, area: f64) -> String {
        format!("the mesh has an area of {area}, the hull of the points {}", self.hull_area)
    }
}

/// The findings, judged; without names of files and statistics of the run.
pub(super) fn report(
    context: &CloudProofContext<'_>,
    points: &SpreadPoints,
    hull: &ProofHull,
    spread: &MeshSpread,
    constraints: &ConstraintChecks,
    tally: &ProofTally,
) -> Result<CloudVerifyReport> {
    let cloud = context.source.info();
    let place = |at: ProofPosition| context.placer.world(at);
    let fault = |fault: &FaultCount| FaultReport::of(fault, place);
    let [width, height, step] = cloud.frame.scale;
    let of = CloudProofFindings {
        crs: cloud.crs.label(),
        horizontal_unit: cloud.crs.horizontal_units().to_owned(),
        vertical_unit: cloud.crs.heights_unit().unwrap_or("units").to_owned(),
        points: points.counts,
        judged_points: tally.surface_samples,
        stacked_points: tally.valid - tally.surface_samples,
        covered_points: tally.covered,
        tolerance_steps: context.bound.map(|bound| bound.steps()),
        moved_vertices: spread.counts.snapped,
        largest_move: spread.counts.largest_snap,
        move_radius: context.placer.radius(),
        hull_area: area(hull.double_area(), [width, height]),
        hull_corners: hull.corners().count() as u64,
        uncovered_points: fault(&tally.uncovered),
        outside_vertices: fault(&tally.outside),
        off_point_vertices: fault(&tally.off_samples),
        has_posts: context.has_posts,
        keep_points: context.constraints.points_report(
            constraints.beyond,
            tally.kept,
            tally.kept - tally.not_kept.count,
        )?,
        not_kept: fault(&tally.not_kept),
        breaklines: context
            .constraints
            .breaklines_report(|line| constraints.is_outside(line), tally.not_followed.count)?,
        on_breaklines: tally.on_lines,
        not_followed: fault(&tally.not_followed),
        ..CloudProofFindings::default()
    };
    let found = MeshFindings {
        mesh: context.work.mesh.info(),
        stated: &context.stated,
        is_delaunay: context.is_delaunay,
        tolerance: context.tolerance,
        vertices: &spread.counts,
        broken: spread.broken,
        tally,
        step,
        cell: [width, height],
        area_matches: tally.double_area == hull.double_area(),
    };
    Ok(MeshReport::new(of, &found, place))
}
