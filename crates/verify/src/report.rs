//! Report of a verification against a grid.

use serde::Serialize;

use super::context::GridProofContext;
use super::findings::{DOUBLE_CELL, FaultReport, MeshFindings, MeshOriginal, MeshReport, is_zero};
use super::vertices::VertexCounts;
use terrane_base::bound::ErrorBound;
use terrane_base::geom::Affine;
use terrane_engine::breaklines::BreaklinesReport;
use terrane_engine::constraints::RequiredPointsReport;
use terrane_proof::{FaultCount, ProofPosition, ProofTally};

/// A position on the grid, in samples and in world coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct GridLocation {
    pub column: f64,
    pub row: f64,
    pub x: f64,
    pub y: f64,
}

/// Findings for one band.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BandProof {
    /// Its number, from 1.
    pub band: u32,
    /// Factor of errors in this band.
    pub weight: f64,
    /// The largest difference allowed: the tolerance divided by the weight.
    pub tolerance: Option<f64>,
    /// The largest difference found, not multiplied.
    pub max_error: Option<f64>,
    /// Where it is.
    pub max_error_at: Option<GridLocation>,
    /// Root mean square of the differences.
    pub rmse: Option<f64>,
    /// Samples further off than allowed (decided exactly, closed <=).
    pub over: u64,
}

/// Result of [`verify`](super::verify): areas are in cells, angles on the lattice (as if cells were
/// square), and the first place of a fault is the first in row order.
pub type VerifyReport = MeshReport<OfGrid>;

/// Findings specific to grids.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct OfGrid {
    /// Raster.
    pub raster: String,
    /// Columns of the grid.
    pub width: u32,
    /// Rows of the grid.
    pub height: u32,
    /// Samples of the grid.
    pub samples: u64,
    /// Samples with a height.
    pub valid_samples: u64,
    /// Samples that belong to a cell with four valid samples: the promise is about these.
    pub surface_samples: u64,
    /// Valid samples that touch no such cell: they are not part of the surface or the promise.
    pub isolated_samples: u64,
    /// Cells with four valid samples: the surface is their union.
    pub surface_cells: u64,
    /// Surface samples covered by a triangle.
    pub covered_samples: u64,
    /// Vertices moved to a sample, because the rounding of their storage explains the distance.
    pub snapped_vertices: u64,
    /// The longest such move, in cells.
    pub largest_snap: f64,
    /// Distance up to which that is done, in cells.
    pub snap_radius: f64,
    /// Surface samples no triangle covers.
    pub uncovered_samples: FaultReport<GridLocation>,
    /// Surface cells no triangle overlaps.
    pub uncovered_cells: FaultReport<GridLocation>,
    /// Cells with a void corner that a triangle overlaps.
    pub void_cells: FaultReport<GridLocation>,
    /// Triangles that reach beyond the grid.
    pub outside_triangles: FaultReport<GridLocation>,
    /// True when the mesh states that its heights are fitted: vertices may lie above or below samples.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fitted: bool,
    /// Positions of triangle corners that are not a sample, or, unless heights are fitted, not at the height of
    /// the sample in the precision of the format. A failure only where `made_by_terrane`: the error bound of
    /// other meshes may hold all the same.
    pub off_sample_vertices: FaultReport<GridLocation>,
    /// Where the tolerance holds: at samples, or along the lines between neighbouring samples as
    /// well.
    pub bound: ErrorBound,
    /// Largest vertical distance between the mesh and the lines between neighbouring samples of the
    /// surface, these samples included.
    pub surface_error: Option<f64>,
    /// Where it is.
    pub surface_error_at: Option<GridLocation>,
    /// Where the mesh breaks on such a line: there, or at a sample, it is furthest from it.
    pub breaks: u64,
    /// Breaks further from their line than the tolerance (decided exactly, closed <=). A failure only
    /// where `bound` is the surface.
    pub over_between_samples: FaultReport<GridLocation>,
    /// Smallest angle allowed in plan, if limited.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_angle: Option<f64>,
    /// Triangles with a smaller angle.
    #[serde(skip_serializing_if = "FaultReport::is_none")]
    pub thin_triangles: FaultReport<GridLocation>,
    /// Points to keep, if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_points: Option<RequiredPointsReport>,
    /// Samples nearest to points to keep that are not vertices at their height.
    #[serde(skip_serializing_if = "FaultReport::is_none")]
    pub not_kept: FaultReport<GridLocation>,
    /// Breaklines, if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub breaklines: Option<BreaklinesReport>,
    /// Vertices on breaklines.
    #[serde(skip_serializing_if = "is_zero")]
    pub on_breaklines: u64,
    /// Samples where edges do not follow breaklines.
    #[serde(skip_serializing_if = "FaultReport::is_none")]
    pub not_followed: FaultReport<GridLocation>,
    /// The bands that errors are measured in, where channels are checked against several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bands: Vec<BandProof>,
    /// Samples of the grid by seconds.
    pub samples_per_second: f64,
}

impl MeshOriginal for OfGrid {
    type Place = GridLocation;
    const POINTS: &'static str = "samples";
    const WHOLE: &'static str = "surface";
    const PLANE: &'static str = "on the lattice of samples";

    fn describe(GridLocation { column, row, x, y }: GridLocation) -> String {
        format!("column {column}, row {row} (x {x}, y {y})")
    }

    fn promises(&self) -> Vec<(FaultReport<GridLocation>, &'static str)> {
        let between = match self.bound {
            ErrorBound::Samples => FaultReport::default(),
            ErrorBound::Surface => self.over_between_samples,
        };
        vec![
            (between, "places between samples further from the mesh than the tolerance"),
            (self.thin_triangles, "triangles with an angle below the minimum"),
            (self.not_kept, "required samples that are not vertices at their height"),
            (self.not_followed, "samples on breaklines that edges do not follow"),
            (self.uncovered_samples, "samples not covered by the mesh"),
            (self.uncovered_cells, "cells not covered by the mesh"),
            (self.void_cells, "void cells covered by triangles"),
            (self.outside_triangles, "triangles reaching beyond the grid"),
        ]
    }

    fn off_vertices(&self) -> FaultReport<GridLocation> {
        self.off_sample_vertices
    }

    fn is_fitted(&self) -> bool {
        self.fitted
    }

    fn wrong_area(&self, area: f64) -> String {
        format!("the mesh has an area of {area} cells, the surface {}", self.surface_cells)
    }
}

/// The findings, judged; without names of files and statistics of the run.
pub(super) fn report(
    context: &GridProofContext<'_>,
    vertices: &VertexCounts,
    broken: u64,
    tally: &ProofTally,
) -> VerifyReport {
    let grid = context.grid.info();
    let place = |at: ProofPosition| place(&grid.transform, at);
    let fault = |fault: &FaultCount| FaultReport::of(fault, place);
    let of = OfGrid {
        width: grid.width,
        height: grid.height,
        samples: u64::from(grid.width) * u64::from(grid.height),
        valid_samples: tally.valid,
        surface_samples: tally.surface_samples,
        isolated_samples: tally.valid - tally.surface_samples,
        surface_cells: tally.surface_cells,
        covered_samples: tally.covered,
        snapped_vertices: vertices.snapped,
        largest_snap: vertices.largest_snap,
        snap_radius: context.snapper.radius(),
        uncovered_samples: fault(&tally.uncovered),
        uncovered_cells: fault(&tally.uncovered_cells),
        void_cells: fault(&tally.void_cells),
        outside_triangles: fault(&tally.outside),
        fitted: context.is_fitted,
        off_sample_vertices: fault(&tally.off_samples),
        bound: context.requirements.bound,
        surface_error: tally.worst_of_surface().map(|spot| spot.error),
        surface_error_at: tally.worst_of_surface().map(|spot| place(spot.at)),
        breaks: tally.breaks,
        over_between_samples: fault(&tally.over_between),
        min_angle: context.requirements.min_angle,
        thin_triangles: fault(&tally.thin),
        keep_points: context
            .requirements
            .kept
            .report(tally.kept, tally.kept - tally.not_kept.count),
        not_kept: fault(&tally.not_kept),
        breaklines: context.requirements.kept.lines().report(tally.not_followed.count),
        on_breaklines: tally.on_lines,
        not_followed: fault(&tally.not_followed),
        ..OfGrid::default()
    };
    let found = MeshFindings {
        mesh: context.work.mesh.info(),
        stated: &context.stated,
        is_delaunay: context.is_delaunay,
        tolerance: context.requirements.tolerance,
        vertices,
        broken,
        tally,
        step: 1.0,
        cell: [1.0; 2],
        area_matches: tally.double_area == i128::from(tally.surface_cells) * DOUBLE_CELL,
    };
    MeshReport::new(of, &found, place)
}

pub(super) fn place(map: &Affine, at: ProofPosition) -> GridLocation {
    let (column, row) = (at.cols(), at.rows());
    let [x, y] = map.apply(column, row);
    GridLocation { column, row, x, y }
}
