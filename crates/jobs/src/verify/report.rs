//! What a verification found, for people and programs.

use serde::Serialize;

use super::Context;
use super::vertices::VertexCounts;
use terrane_base::geom::Affine;
use terrane_proof::{Fault, Position, Spot, Tally};

/// A place on the grid, in samples and in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Place {
    pub column: f64,
    pub row: f64,
    pub x: f64,
    pub y: f64,
}

/// How often a fault was found, and the first place in row order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct FaultReport {
    pub count: u64,
    pub first: Option<Place>,
}

/// Result of [`verify`](super::verify). Heights and errors are in the vertical unit of the grid,
/// areas in cells, angles in degrees on the lattice (as if cells were square).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct VerifyReport {
    /// Mesh file.
    pub mesh: String,
    /// Format of the mesh.
    pub format: String,
    /// Raster.
    pub raster: String,
    /// True when no promise is known to be broken.
    pub passed: bool,
    /// True when all that is promised was judged.
    pub judged: bool,
    /// One sentence for each broken promise.
    pub failures: Vec<String>,
    /// What is promised and could not be judged.
    pub not_judged: Vec<String>,

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
    /// Valid samples that touch no such cell: they have no surface and are no part of the promise.
    pub isolated_samples: u64,
    /// Cells with four valid samples: the surface is their union.
    pub surface_cells: u64,
    /// Surface samples covered by a triangle.
    pub covered_samples: u64,

    /// Largest allowed vertical distance; when `None`, errors are measured, not judged.
    pub tolerance: Option<f64>,
    /// Surface samples further from the mesh than the tolerance (decided exactly, closed <=).
    pub over_tolerance: FaultReport,
    /// Largest vertical distance of a covered surface sample.
    pub max_error: Option<f64>,
    /// Where it is.
    pub max_error_at: Option<Place>,
    /// Root mean square of these distances.
    pub rmse: Option<f64>,
    /// Mean of these distances.
    pub mean_error: Option<f64>,
    /// Samples by error / tolerance: twenty bins from 0 to 1, then those over. Empty without a
    /// tolerance.
    pub error_histogram: Vec<u64>,

    /// Vertices stored.
    pub vertices: u64,
    /// Triangles stored.
    pub triangles: u64,
    /// Vertices moved to a sample, because the rounding of their storage explains the distance.
    pub snapped_vertices: u64,
    /// The longest such move, in cells.
    pub largest_snap: f64,
    /// Distance up to which that is done, in cells.
    pub snap_radius: f64,
    /// Vertices that are no samples; they are checked where they are.
    pub free_vertices: u64,
    /// Vertices without a finite position and height, or absurdly far away.
    pub unusable_vertices: u64,
    /// Triangles with such a vertex; they are left out of every other check.
    pub broken_triangles: u64,
    /// Area of all triangles less that of inverted ones.
    pub mesh_area: f64,

    /// Surface samples no triangle covers.
    pub uncovered_samples: FaultReport,
    /// Surface cells no triangle overlaps.
    pub uncovered_cells: FaultReport,
    /// Cells with a void corner that a triangle overlaps.
    pub void_cells: FaultReport,
    /// Triangles that reach beyond the grid.
    pub outside_triangles: FaultReport,
    /// Samples strictly inside more than one triangle.
    pub overlaps: FaultReport,
    /// Triangles clockwise seen from above.
    pub inverted_triangles: FaultReport,
    /// Triangles without area.
    pub empty_triangles: FaultReport,
    /// Edges of one triangle only that are not on the outline of the surface.
    pub cracks: FaultReport,
    /// Vertices strictly inside an edge of one triangle.
    pub t_junctions: FaultReport,
    /// Edges of more than two triangles, or of two that pass it in the same direction.
    pub non_manifold_edges: FaultReport,
    /// Positions where triangles meet with different heights.
    pub split_heights: FaultReport,
    /// Stored vertices beyond the first at the same position.
    pub duplicate_vertices: FaultReport,
    /// Stored vertices at no triangle's corner.
    pub unused_vertices: FaultReport,
    /// Positions of triangle corners that are no sample, or not at the height their sample has in
    /// the precision of the format. A failure only where `made_by_terrane`: the error bound of
    /// other meshes may hold all the same.
    pub off_sample_vertices: FaultReport,
    /// True when the file bears terrane's mark, and with it the promise that vertices are samples.
    pub made_by_terrane: bool,

    /// Edges between two triangles.
    pub interior_edges: u64,
    /// Edges of one triangle.
    pub open_edges: u64,
    /// Interior edges that fail the strict in-circle test on the lattice; not a failure.
    pub non_delaunay_edges: FaultReport,
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
    /// Samples of the grid by seconds.
    pub samples_per_second: f64,
}

impl VerifyReport {
    /// The findings, judged; without names of files and figures of the run.
    pub(super) fn new(
        context: &Context<'_>,
        vertices: &VertexCounts,
        broken: u64,
        tally: &Tally,
    ) -> Self {
        let (grid, mesh) = (context.grid.info(), context.work.mesh.info());
        let map = &grid.transform;
        let fault = |fault: &Fault| FaultReport {
            count: fault.count,
            first: fault.first.map(|at| place(map, at)),
        };
        let mean = |sum: f64| (tally.covered > 0).then(|| sum / tally.covered as f64);
        let mut report = Self {
            format: mesh.format.to_owned(),
            width: grid.width,
            height: grid.height,
            samples: u64::from(grid.width) * u64::from(grid.height),
            valid_samples: tally.valid,
            surface_samples: tally.surface_samples,
            isolated_samples: tally.valid - tally.surface_samples,
            surface_cells: tally.surface_cells,
            covered_samples: tally.covered,
            tolerance: context.tolerance,
            over_tolerance: fault(&tally.over),
            max_error: tally.worst.map(|spot| spot.error),
            max_error_at: tally.worst.map(|spot| place(map, at(spot))),
            rmse: mean(tally.squares.value()).map(f64::sqrt),
            mean_error: mean(tally.errors.value()),
            error_histogram: context.tolerance.map_or(Vec::new(), |_| tally.histogram.to_vec()),
            vertices: mesh.vertices,
            triangles: mesh.triangles,
            snapped_vertices: vertices.snapped,
            largest_snap: vertices.largest_snap,
            snap_radius: context.snapper.radius(),
            free_vertices: vertices.free,
            unusable_vertices: vertices.unusable,
            broken_triangles: broken,
            mesh_area: tally.double_area as f64 / DOUBLE_CELL as f64,
            uncovered_samples: fault(&tally.uncovered),
            uncovered_cells: fault(&tally.uncovered_cells),
            void_cells: fault(&tally.void_cells),
            outside_triangles: fault(&tally.outside),
            overlaps: fault(&tally.overlaps),
            inverted_triangles: fault(&tally.inverted),
            empty_triangles: fault(&tally.empty),
            cracks: fault(&tally.cracks),
            t_junctions: fault(&tally.t_junctions),
            non_manifold_edges: fault(&tally.non_manifold),
            split_heights: fault(&tally.split_heights),
            duplicate_vertices: fault(&tally.duplicates),
            unused_vertices: fault(&tally.unused),
            off_sample_vertices: fault(&tally.off_samples),
            made_by_terrane: mesh.is_own(),
            interior_edges: tally.interior_edges,
            open_edges: tally.open_edges,
            non_delaunay_edges: fault(&tally.non_delaunay),
            smallest_angle: tally.smallest_angle,
            angle_histogram: tally.angles.to_vec(),
            ..Self::default()
        };
        report.judge(tally.double_area == i128::from(tally.surface_cells) * DOUBLE_CELL);
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
            failures.extend(self.off_sample_vertices.sentence("vertices off the samples"));
        }
        if !area_matches {
            let (mesh, surface) = (self.mesh_area, self.surface_cells);
            failures.push(format!("the mesh has an area of {mesh} cells, the surface {surface}"));
        }
        self.passed = failures.is_empty();
        self.failures = failures;
        self.judged = self.tolerance.is_some();
        if !self.judged {
            self.not_judged.push(super::NO_BOUND.to_owned());
        }
    }

    /// The faults that break a promise, and what they are.
    fn promises(&self) -> [(FaultReport, &'static str); 14] {
        [
            (self.over_tolerance, "samples further from the mesh than the tolerance"),
            (self.uncovered_samples, "samples not covered by the mesh"),
            (self.uncovered_cells, "cells not covered by the mesh"),
            (self.void_cells, "void cells covered by triangles"),
            (self.outside_triangles, "triangles reaching beyond the grid"),
            (self.overlaps, "samples inside overlapping triangles"),
            (self.inverted_triangles, "inverted triangles"),
            (self.empty_triangles, "triangles without area"),
            (self.cracks, "cracks (open edges inside the surface)"),
            (self.t_junctions, "T-junctions (vertices inside an open edge)"),
            (self.non_manifold_edges, "non-manifold edges"),
            (self.split_heights, "positions with several heights"),
            (self.duplicate_vertices, "duplicate vertices"),
            (self.unused_vertices, "unused vertices"),
        ]
    }
}

/// Twice the area of a cell in the unit of [`Tally::double_area`].
const DOUBLE_CELL: i128 = 2 << (2 * Position::FRACTION);

impl FaultReport {
    fn sentence(&self, what: &str) -> Option<String> {
        let place = self.first.filter(|_| self.count > 0)?;
        let Place { column, row, x, y } = place;
        Some(format!("{} {what}, first at column {column}, row {row} (x {x}, y {y})", self.count))
    }
}

fn at(spot: Spot) -> Position {
    Position::sample(i64::from(spot.col), i64::from(spot.row))
}

fn place(map: &Affine, at: Position) -> Place {
    let (column, row) = (at.cols(), at.rows());
    let [x, y] = map.apply(column, row);
    Place { column, row, x, y }
}
