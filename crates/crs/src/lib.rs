//! Operations from one coordinate reference system to another, point by point, with their accuracy.
//!
//! x is east or longitude and y is north or latitude, in any system, as in grids. An operation has three
//! steps: from the source to longitudes and latitudes on its ellipsoid, to those of the target's datum,
//! and to the target. Projections are those of `proj4rs`; shifts of datums come from a table of EPSG's
//! own, which say how right they are, or from a grid. A shift that is not known is an error, never none.
//! Every position is taken back to where it came from: one that does not arrive there lies beyond what a
//! projection reaches, and is an error, too.
//!
//! Apart from `terrane_base::geom::Crs`: every file has a system with a name, few jobs need an operation between two.

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
