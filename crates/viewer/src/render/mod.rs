//! Pictures of grids and meshes: shaded relief in a pixel buffer. Pure.
//!
//! A [`Field`] of heights is filled from a grid ([`average_rows`], [`Field::bilinear`]) or from
//! triangles ([`fill_triangle`], with [`Colours`] of their own [`fill_coloured`]); [`Painter`] turns it into
//! RGBA rows, with the strokes of a [`Coverage`] on top.
//!
//! **Painting.** A tint by height, halfway between equal steps and equal areas; light from one main and
//! two lesser directions, cool in the shade and warm in the sun; ridges lifted a little against the
//! smoothed ground. The vertical exaggeration follows from the slopes of the picture unless it is given.
//! Edges are strokes that combine by maximum, so their order leaves no trace; short ones are fainter.
//! Longitudes are shortened by the cosine of the latitude. [`write_text`] has letters for what stands under
//! pictures.

mod classes;
mod colours;
mod coverage;
mod field;
mod frame;
mod light;
mod paint;
mod text;
mod tint;
mod triangle;

pub use classes::class_colour;
pub use colours::Colours;
pub use coverage::Coverage;
pub use field::{Field, average_rows};
pub use frame::{Frame, MAX_PICTURE_SIDE};
pub use light::{Light, natural_exaggeration};
pub use paint::{Painter, Style};
pub use text::{text_size, write_text};
pub use tint::{Tint, palette};
pub use triangle::{fill_coloured, fill_triangle};
