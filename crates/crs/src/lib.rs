//! Coordinate operations between reference systems, point by point, with their accuracy.
//!
//! x is east or longitude and y is north or latitude in any CRS, as in grids. An operation has three steps: from the
//! source to longitude and latitude on its ellipsoid, to the datum of the target, and to the target. Projections are
//! those of `proj4rs`. Datum shifts come from a table of EPSG operations with their accuracy, or from a grid. An
//! unknown shift is an error, never ignored. Every position is transformed back: if the result differs, the position
//! is outside the domain of the projection, which is an error.
//!
//! Separate from `terrane_base::geom::Crs`: every file has a CRS with a name, few jobs need an operation between two.

mod area;
mod geoid;
mod heights;
mod ntv2;
mod operation;
mod projection;
mod shift;
mod table;
#[cfg(test)]
mod tests;

pub use geoid::{Geoid, MAX_GRID_BYTES};
pub use ntv2::ShiftGrid;
pub use operation::{CoordinateOperation, CoordinateOperationOptions};
