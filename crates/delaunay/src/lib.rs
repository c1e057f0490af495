//! Delaunay triangulations of scattered points: exact, canonical, and local where that is enough. Pure.
//!
//! One set of positions has one triangulation (`predicates`), so a part of it computed from a part of
//! the points is the same part, once it is *final*: the discs of its triangles hold no place where
//! unknown points may be. Whoever works on more points than fit into memory loads those around a
//! window into [`PointBins`], says in a [`LoadedPoints`] what that makes known, and asks: for the triangle at a
//! position ([`TriangleFinder`]), for natural neighbour heights ([`Natural`]), or for all triangles that a
//! block owns ([`stars`]). The answer is final, or a [`NeededWindow`]: load that too (at most somewhat more
//! at a time, for it shrinks as points come in) and ask again. The hull of all points must be known
//! beforehand: [`ConvexHull`]s of parts merge. [`Triangulation`] does all points at once, and can be added to;
//! [`SpikeFree`] adds them from the highest down, and leaves out those below triangles that are frozen.

mod disc;
mod divide_and_conquer;
mod hull;
mod insert;
mod interpolate;
mod natural;
#[cfg(test)]
mod oracle;
mod order;
mod parallel;
mod point_bins;
mod position;
mod predicates;
mod query;
mod space;
mod spikefree;
mod stars;
mod triangulation;
mod window;

pub use disc::CircumscribedDisc;
pub use hull::{ConvexHull, HullLocation};
pub use interpolate::interpolate;
pub use natural::Natural;
pub use parallel::{ForkJoin, SerialJoin};
pub use point_bins::PointBins;
pub use position::{FRACTION, FixedPosition};
pub use predicates::{Site, in_circle, orient};
pub use query::{Location, TriangleFinder};
pub use space::{LoadedPoints, NeededWindow, OccupancyGrid, PointIndex};
pub use spikefree::{FreezeRule, SpikeFree};
pub use stars::stars;
pub use triangulation::{MAX_POINTS, Triangulation};
pub use window::SiteWindow;
