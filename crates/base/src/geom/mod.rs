//! Ids, lattice windows, the affine map from lattice to world, and exact predicates. Pure.

mod affine;
mod crs;
mod decimal;
mod path;
pub mod plane;
mod point;
pub mod predicates;
mod rect;
mod rounding;
mod ruler;
mod spheroid;
#[cfg(test)]
mod tests;

pub use affine::Affine;
pub use crs::{Conversion, Crs, Datum, GeoKeys, VerticalReference, is_geographic, metres_in, wkt};
pub use decimal::Decimal;
pub use path::{Ends, Paths, SampleSegment, cut};
pub use point::{DistancePredicate, Point, PointFrame, REACH, is_within};
pub use rect::Rect;
pub use rounding::HeightQuantization;
pub use ruler::Ruler;
pub use spheroid::Spheroid;

/// A point in world coordinates: x, y in units of the CRS, z in the vertical unit of the data.
pub type Point3 = [f64; 3];
