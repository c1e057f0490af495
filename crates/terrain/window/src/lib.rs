//! Kernels on one window of samples: contour lines, cells within polygons, derivatives, resampling, voids.

pub mod contour;
pub mod coverage;
pub mod relief;
pub mod resample;
pub mod voids;
