//! Interpolates heights of a grid: by the nearest sample, or by weights of the samples around.
//!
//! A method is a file here and a line in [`RESAMPLINGS`]. A position has a height if the nearest sample has
//! one, so all methods leave the same voids. Where the output is coarser than the grid ([`Scale`]), kernels are
//! widened to cover all samples.
//!
//! ```
//! use terrane_base::geom::Rect;
//! use terrane_window::resample::{RESAMPLINGS, Scale, SourceWindow};
//!
//! let heights = [1.0, 2.0, 5.0, f64::NAN];
//! let window = SourceWindow { grid: [2, 2], rect: Rect::new(0, 0, 2, 2), heights: &heights };
//! let mut out = [0.0; 3];
//! let places = [[0.5, 0.0], [0.0, 0.25], [0.75, 0.75]];
//! RESAMPLINGS[1].heights(&window, &places, Scale::ONE, &mut out);
//! assert_eq!((out[0], out[1]), (1.5, 2.0));
//! assert!(out[2].is_nan());
//! ```

mod bilinear;
mod cubic;
mod kernel;
mod nearest;
mod on_axes;
mod resampling;
#[cfg(test)]
mod tests;
mod window;

pub use resampling::{ResamplingMethod, Scale};
pub use window::{Place, SourceWindow};

/// All methods. A new one is one file and one line here.
pub const RESAMPLINGS: &[ResamplingMethod] =
    &[nearest::RESAMPLING, bilinear::RESAMPLING, cubic::RESAMPLING];
