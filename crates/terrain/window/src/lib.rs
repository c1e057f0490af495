//! Kernels on one window of samples: contour lines, derivatives, resampling.

pub mod contour;
pub mod relief;
pub mod resample;
