//! Ground classification: methods by name, from the lowest points of cells; and [`noise`] classification. Pure.
//!
//! A method ([`METHODS`], [`Request`]) takes the lowest point of each cell of a window ([`LowestPoints`]) and
//! returns a surface with a tolerance ([`GroundSurface`]): points within it are ground. Low outliers are
//! removed first. Methods without a bounded reach are defined on tiles of a fixed size with a halo
//! ([`GroundTiling`]), so that the ground depends on the point cloud only.

mod csf;
mod csf_ptd;
mod densify;
mod finder;
mod ghost_vertices;
mod grid;
mod grow;
#[cfg(test)]
mod landscapes;
mod lowest_in_cells;
mod lowest_points;
mod method;
pub mod method_call;
pub mod neighbors;
pub mod noise;
mod outliers;
pub mod pmf;
mod ptd;
#[cfg(test)]
mod scenes;
mod smrf;
mod surface;
mod tin;

pub use finder::{GroundFinder, GroundTiling, Method, Request};
pub use lowest_points::{EMPTY, LowestPoints, NO_POINT};
pub use method::METHODS;
pub use surface::GroundSurface;
