//! Elevation grids: meshes with a proven error bound, contour lines, warping, relief, conversion.

pub mod colours;
pub mod contour;
pub mod convert;
pub mod relief;
pub mod tin;
pub mod warp;
