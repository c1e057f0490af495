//! What is computed of one window of samples: contour lines, derivatives, heights between samples.

pub mod contour;
pub mod relief;
pub mod resample;
