//! Kernels on one window of samples: contour lines, cells within polygons, derivatives, resampling.

pub mod contour;
pub mod coverage;
pub mod relief;
pub mod resample;
