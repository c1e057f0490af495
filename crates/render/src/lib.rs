//! Pictures of grids and meshes: shaded relief in a pixel buffer. Pure.
//!
//! A [`Field`] of heights is filled from a grid ([`average_rows`], [`Field::bilinear`]) or from
//! triangles ([`fill_triangle`]); [`Painter`] turns it into RGBA rows, with the strokes of a
//! [`Coverage`] on top.

mod coverage;
mod field;
mod frame;
mod light;
mod paint;
mod tint;
mod triangle;

pub use coverage::Coverage;
pub use field::{Field, average_rows};
pub use frame::{Frame, MAX_PICTURE_SIDE};
pub use light::{Light, natural_exaggeration};
pub use paint::{Painter, Style};
pub use tint::Tint;
pub use triangle::fill_triangle;
