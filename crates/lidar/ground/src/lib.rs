//! Which points of a cloud are ground: methods by name, from the lowest points of cells; and which are [`noise`]. Pure.
//!
//! A method ([`METHODS`], [`Asked`]) gets the lowest point of each cell of a window ([`LowestPoints`]) and gives
//! a surface with a tolerance ([`GroundSurface`]): points that lie near it are ground. Points far below all around
//! them are left out before. Methods whose cells depend
//! on others however far away are defined on squares of a fixed size, each with a halo ([`GroundTiling`]), so
//! that the ground of a cloud is a function of the cloud alone.

mod adaptive;
pub mod asked;
mod cells;
mod csf;
mod densify;
pub mod filter;
mod finder;
mod frame;
mod grid;
mod grow;
#[cfg(test)]
mod landscapes;
mod lows;
mod method;
pub mod noise;
mod outliers;
mod ptd;
#[cfg(test)]
mod scenes;
mod smrf;
mod surface;
mod tin;

pub use finder::{Asked, GroundFinder, GroundTiling, Method};
pub use lows::{EMPTY, LowestPoints, NO_POINT};
pub use method::METHODS;
pub use surface::GroundSurface;
