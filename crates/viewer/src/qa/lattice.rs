//! Cells of the plane, their place and their area on the ground.

use crate::cloud_picture::cells_over;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Point, PointFrame};
use terrane_cloud::{CloudInfo, FilterRecord, round_up, side_of};
use terrane_engine::local_frame::spheroid;
use terrane_gridding::CellLattice;

/// Average number of points of a cell of the default size: its side is four times the point spacing, the size of a data
/// void in the Lidar Base Specification of the USGS.
pub(super) const POINTS_OF_CELL: f64 = 16.0;

/// Most columns or rows, whose indices are 32-bit integers.
const MAX_CELLS: u64 = i32::MAX as u64;

/// Cells with corners at multiples of their size.
pub(super) struct QaLattice {
    lattice: CellLattice,
    frame: PointFrame,
    pub(super) side: f64,
    /// Lattice indices (x, y) of the cell in the south-west.
    first: [i64; 2],
    /// Columns and rows within the bounds of the headers.
    pub(super) size: [u64; 2],
    /// Area of a cell in square [`area_unit`](Self::area_unit).
    pub(super) area: f64,
    pub(super) area_unit: &'static str,
    /// Length of a side in units of height.
    pub(super) rise: f64,
}

impl QaLattice {
    /// Over the bounds of the headers.
    ///
    /// # Errors
    /// A cell below the scale of the points, or too small or large for its number or area; latitudes beyond the poles.
    pub(super) fn new(
        info: &CloudInfo,
        bounds: [Point; 2],
        side: Option<f64>,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let side = side.unwrap_or_else(|| round_up(side_of(POINTS_OF_CELL, info, bounds)));
        let (lattice, first, size) = cells_over(info, bounds, side)?;
        if size.iter().any(|cells| *cells > MAX_CELLS) {
            let message = format!(
                "cell size {side} divides the bounds into more than 2^31 cells along an axis"
            );
            return Err(Error::usage(message).remedy("choose a larger ‹cell›"));
        }
        let crs = &info.crs;
        let (sides, area_unit, metres) = match crs.horizontal_unit() {
            "degree" => {
                let middle = bounds.map(|end| info.frame.world(end)[1]).iter().sum::<f64>() / 2.0;
                if !(-90.0..=90.0).contains(&middle) {
                    return Err(Error::bad_input(format!(
                        "latitude {middle} is outside -90 to 90 degrees"
                    ))
                    .remedy("correct the CRS with ‹crs›"));
                }
                let lengths = spheroid(crs, notes)?.degree_metres(middle);
                notes.push(format!("areas are in square metres at latitude {middle:.4}"));
                (lengths.map(|length| length * side), "metre", 1.0)
            }
            unit => ([side; 2], unit, crs.horizontal_metres().unwrap_or(1.0)),
        };
        let area = sides[0] * sides[1];
        if !area.is_normal() {
            let message = format!("the area of cells of size {side} is not a finite number");
            return Err(Error::usage(message).remedy("choose another ‹cell›"));
        }
        // Heights without a unit are in that of x and y, or in metres.
        let up = crs.vertical_metres().unwrap_or(metres);
        let rise = area.sqrt() * metres / up;
        let frame = info.frame;
        Ok(Self { lattice, frame, side, first, size, area, area_unit, rise })
    }

    /// Row and column of a point. `None` where a wrong header leaves it no place in the frame of the cloud.
    pub(super) fn cell(&self, record: &FilterRecord) -> Option<[i32; 2]> {
        let placed = self.frame.world(record.point);
        let is_placed =
            (0..3).all(|i| (placed[i] - record.world[i]).abs() <= 2.0 * self.frame.scale[i]);
        let col = self.lattice.x.index(record.point.x) - self.first[0];
        let row = self.lattice.y.index(record.point.y) - self.first[1];
        is_placed.then_some([row.try_into().ok()?, col.try_into().ok()?])
    }

    /// World coordinates of the south-west corner of a cell (row, column).
    pub(super) fn corner(&self, [row, col]: [i64; 2]) -> [f64; 2] {
        let [x, y] = [self.first[0] + col, self.first[1] + row];
        [x as f64 * self.side, y as f64 * self.side]
    }

    /// World units of a step of height.
    pub(super) fn height_step(&self) -> f64 {
        self.frame.scale[2]
    }
}
