//! Size, alignment and convention of the cells of a grid.

use serde::{Deserialize, Serialize};
use terrane_options::Choice;

use terrane_base::error::{Error, Result};
use terrane_cloud::CloudInfo;

/// Grid conventions of another program, for comparisons cell by cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice, Serialize, Deserialize)]
pub enum Compat {
    /// terrane: cells [W, E) x [S, N), corners at multiples of the cell size
    #[default]
    None,
    /// PDAL writers.gdal: origin at the lowest x and y of all points; every statistic uses the points within the radius
    /// of a cell centre
    Pdal,
    /// lasR: cells [W, E) x (S, N], corners at multiples of the cell size
    Lasr,
}

/// Position and size of the cells of a grid.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Sides of a cell (x, y), in world units; those of `like` if given; for a terrain model without either,
    /// about the point spacing.
    pub cell: Option<[f64; 2]>,
    /// A corner of some cell; the origin of the coordinates when `None`.
    pub align: Option<[f64; 2]>,
    /// All cells that this box (x min, y min, x max, y max) overlaps; the bounds of the point cloud when
    /// `None`.
    pub extent: Option<[f64; 4]>,
    /// Grid that defines the cells and the extent.
    pub like: Option<String>,
    /// Whether the size was derived from the density of points, for a note.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_chosen: bool,
}

impl Placement {
    /// Cells of this size over the whole point cloud.
    pub fn new(cell: [f64; 2]) -> Self {
        Self { cell: Some(cell), ..Self::default() }
    }

    /// Fails for conflicting options.
    pub(super) fn check(&self, compat: Compat, is_model: bool) -> Result<()> {
        match (&self.like, &self.cell) {
            (Some(_), Some(_)) => return refuse("‹like› and ‹cell› both set the cell size"),
            (None, None) if !is_model => {
                return Err(Error::usage("no cell size given").remedy("pass ‹cell› or ‹like›"));
            }
            (None, Some(cell)) if !cell.iter().all(|side| *side > 0.0 && side.is_finite()) => {
                return Err(Error::usage("the cell size is not above 0"));
            }
            _ => {}
        }
        if self.like.is_some() && (self.align.is_some() || self.extent.is_some()) {
            return refuse(
                "‹like› sets all cells, so it is not supported with ‹align› or ‹extent›",
            );
        }
        if compat == Compat::Pdal && (self.align.is_some() || self.like.is_some()) {
            return refuse(
                "‹compat› pdal sets the grid origin, so it is not supported with ‹align› or ‹like›",
            );
        }
        Ok(())
    }
}

fn refuse(conflict: &str) -> Result<()> {
    Err(Error::usage(conflict).remedy("leave out one of them"))
}

/// Mantissas of derived cell sizes, times a power of ten.
const ROUND: [f64; 4] = [1.0, 2.0, 5.0, 10.0];

/// The default cell size: the root of the area per point, from the headers, rounded up.
pub(super) fn default_cell(info: &CloudInfo) -> Result<f64> {
    let [low, high] = info.bounds.ok_or_else(unknown_spacing)?.map(|end| info.frame.world(end));
    let area = (high[0] - low[0]) * (high[1] - low[1]);
    let spacing = (area / info.count as f64).sqrt();
    if !spacing.is_normal() {
        return Err(unknown_spacing());
    }
    let power = 10_f64.powf(spacing.log10().floor());
    let side = ROUND.into_iter().map(|step| step * power).find(|side| *side >= spacing);
    side.ok_or_else(unknown_spacing)
}

fn unknown_spacing() -> Error {
    Error::usage("the point spacing is unknown").remedy("pass the cell size with ‹cell›")
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::{Point, PointFrame};

    #[test]
    fn cells_are_as_wide_as_points_are_apart() {
        let cell = |count: u64, [width, height]: [i32; 2]| {
            let frame = PointFrame { scale: [0.01; 3], offset: [0.0; 3] };
            let bounds = [[0, 0, 0], [width, height, 7]].map(|[x, y, z]| Point { x, y, z });
            let info = CloudInfo { frame, bounds: Some(bounds), count, crs: Default::default() };
            default_cell(&info).ok()
        };
        assert_eq!(cell(10_000, [10_000, 10_000]), Some(1.0));
        assert_eq!(cell(9_999, [10_000, 10_000]), Some(2.0));
        assert_eq!(cell(80_000, [10_000, 10_000]), Some(0.5));
        assert_eq!(cell(400, [10_000, 10_000]), Some(5.0));
        assert_eq!(cell(0, [10_000, 10_000]), None);
        assert_eq!(cell(5, [0, 10_000]), None);
    }
}
