//! Delaunay triangulations of scattered points: exact, canonical, and local where that is enough. Pure.

mod bins;
mod disc;
mod hull;
mod interpolate;
#[cfg(test)]
mod oracle;
mod position;
mod predicates;
mod query;
mod space;

pub use bins::Bins;
pub use disc::Disc;
pub use hull::{Hull, Place};
pub use interpolate::interpolate;
pub use position::{FRACTION, Position};
pub use predicates::{Site, in_circle, orient};
pub use query::{Finder, Found};
pub use space::{Coverage, Loaded, Needs, Space, Window};
