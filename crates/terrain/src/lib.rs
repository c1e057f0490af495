//! Elevation grids: meshes with a proven error bound, contour lines, warping, relief, conversion,
//! differences, filled voids, statistics of zones, heights at points.

pub use annotate::{AnnotationOptions, AnnotationReport, AnnotationSetters};

mod annotate;
mod bands;
pub mod colours;
pub mod contour;
pub mod convert;
pub mod difference;
pub mod fill;
mod halo;
pub mod relief;
pub mod sample;
mod stored;
pub mod tin;
pub mod warp;
pub mod zonal;
