//! Elevation grids: meshes with a proven error bound, contour lines, warping, relief, conversion, statistics of zones, heights at points.

pub use annotate::{AnnotationOptions, AnnotationReport, AnnotationSetters};

mod annotate;
pub mod colours;
pub mod contour;
pub mod convert;
pub mod relief;
pub mod sample;
pub mod tin;
pub mod warp;
pub mod zonal;
