//! The CRS and the extent of a mesh of a grid.

use super::job::TinJob;
use std::path::Path;
use std::sync::Arc;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs, Point3};
use terrane_crs::CoordinateOperation;
use terrane_engine::transform::{PositionExtent, extent_of};
use terrane_mesh::MeshFormat;
use terrane_raster::GridInfo;

/// CRS and extent of a mesh.
pub(super) struct MeshFrame {
    pub(super) crs: Crs,
    /// World bounding box of the samples; z is not known.
    pub(super) bounds: [Point3; 2],
    /// Smallest spacing of samples along x and y; 1 for heights.
    pub(super) steps: Point3,
    /// The operation from the CRS of the grid, if that is another.
    pub(super) operation: Option<Arc<CoordinateOperation>>,
}

/// Positions along each side of a grid, transformed to find its extent in another CRS.
const LATTICE: u32 = 33;

impl MeshFrame {
    /// The frame of a grid in its own CRS, or in the target CRS.
    ///
    /// # Errors
    /// Errors of operations; a change of heights in a format that rounds them.
    pub(super) fn new(info: &GridInfo, job: &TinJob, format: &MeshFormat) -> Result<Self> {
        let frame = Self {
            crs: info.crs.clone(),
            bounds: bounds(info),
            steps: steps(info),
            operation: None,
        };
        let Some(transform) = &job.transform else { return Ok(frame) };
        let input = job.input.to_string();
        let (input, extent) = (Path::new(&input), extent_of(info));
        let operation = transform.operation(input, &info.crs, Some(extent), &job.resources)?;
        if format.single_precision && !operation.keeps_heights() {
            let message = format!(
                "{} rounds heights, so it is not supported for a CRS that changes them",
                format.name
            );
            return Err(Error::unsupported(message).remedy("write PLY or OBJ, or pass a 2D CRS"));
        }
        frame.moved(operation)
    }

    fn moved(self, operation: CoordinateOperation) -> Result<Self> {
        let [low, high] = self.bounds;
        let mut extent = PositionExtent::NONE;
        for at in (0..LATTICE * LATTICE).map(|i| [i % LATTICE, i / LATTICE]) {
            let position = [0, 1].map(|axis| {
                let share = f64::from(at[axis]) / f64::from(LATTICE - 1);
                low[axis] + (high[axis] - low[axis]) * share
            });
            // What lies beyond the projection may be void.
            if let Ok(position) = operation.position(position) {
                extent.add(position);
            }
        }
        let [x0, y0, x1, y1] = extent
            .get()
            .map_or_else(|| operation.position([low[0], low[1]]).map(|[x, y]| [x, y, x, y]), Ok)?;
        let moved_sides = [x1 - x0, y1 - y0];
        let [x_step, y_step] = [0, 1].map(|axis| match high[axis] - low[axis] {
            side if side > 0.0 => self.steps[axis] * moved_sides[axis] / side,
            _ => self.steps[axis],
        });
        Ok(Self {
            crs: operation.target().clone(),
            bounds: [[x0, y0, f64::NAN], [x1, y1, f64::NAN]],
            steps: [x_step, y_step, 1.0],
            operation: Some(Arc::new(operation)),
        })
    }

    /// Notes for the report.
    pub(super) fn notes(&self) -> Vec<String> {
        let Some(operation) = &self.operation else { return Vec::new() };
        let bound = format!(
            "the error bound holds in {}; in {}, flat triangles deviate slightly between their vertices",
            operation.source().label(),
            self.crs.label()
        );
        operation.notes().iter().cloned().chain([bound]).collect()
    }
}

/// World bounding box of the samples; z is not known.
pub(super) fn bounds(info: &GridInfo) -> [Point3; 2] {
    let [x0, y0, x1, y1] = extent_of(info);
    [[x0, y0, f64::NAN], [x1, y1, f64::NAN]]
}

fn steps(info: &GridInfo) -> Point3 {
    let Affine { a, b, d, e, .. } = info.transform;
    [a.abs().max(b.abs()), d.abs().max(e.abs()), 1.0]
}
