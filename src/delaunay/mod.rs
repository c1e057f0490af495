//! Delaunay triangulations of scattered points: exact, canonical, and local where that is enough. Pure.

mod bins;
mod disc;
mod fork;
mod hull;
mod interpolate;
mod knit;
#[cfg(test)]
mod oracle;
mod order;
mod position;
mod predicates;
mod query;
mod space;
mod stars;
mod triangulation;

pub use bins::Bins;
pub use disc::Disc;
pub use fork::{Fork, Serial};
pub use hull::{Hull, Place};
pub use interpolate::interpolate;
pub use position::{FRACTION, Position};
pub use predicates::{Site, in_circle, orient};
pub use query::{Finder, Found};
pub use space::{Coverage, Loaded, Needs, Space, Window};
pub use stars::stars;
pub use triangulation::{MOST_POINTS, Triangulation};
