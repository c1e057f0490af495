//! Pictures of grids and meshes: shaded relief in a pixel buffer. Pure.
//!
//! A [`PictureHeights`] is filled from a grid ([`average_rows`], [`PictureHeights::bilinear`]) or from
//! triangles ([`fill_triangle`], with [`PixelColors`] of their own [`fill_coloured`]); [`FieldPainter`] turns it into
//! RGBA rows, with the strokes of a [`StrokeCoverage`] on top.
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
mod frame;
mod height_field;
mod light;
mod paint;
mod text;
mod tint;
mod triangle;

pub use classes::class_colour;
pub use colours::PixelColors;
pub use coverage::StrokeCoverage;
pub use frame::{MAX_PICTURE_SIDE, PictureFrame};
pub use height_field::{PictureHeights, average_rows};
pub use light::{ReliefLight, natural_exaggeration};
pub use paint::{FieldPainter, PictureStyle};
pub use text::{text_size, write_text};
pub use tint::{HeightColors, palette};
pub use triangle::{fill_coloured, fill_triangle};
