//! Ids, lattice windows, the affine map from lattice to world, and exact predicates. Pure.

mod affine;
mod crs;
mod geokeys;
pub mod plane;
mod point;
pub mod predicates;
mod rect;
mod rounding;
pub mod wkt;

pub use affine::Affine;
pub use crs::Crs;
pub use geokeys::GeoKeys;
pub use point::{Frame, Point, REACH};
pub use rect::Rect;
pub use rounding::Rounding;

/// A point in world coordinates: x, y in units of the CRS, z in the vertical unit of the data.
pub type Point3 = [f64; 3];
