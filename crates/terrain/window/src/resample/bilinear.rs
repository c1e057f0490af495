//! Bilinear: linear between the samples on both sides, along columns and along rows.

use super::kernel::{self, Bilinear};
use super::on_axes;
use super::resampling::ResamplingMethod;

/// The registry entry.
pub(crate) const RESAMPLING: ResamplingMethod = ResamplingMethod {
    name: "bilinear",
    about: "bilinear interpolation of 2 x 2 samples",
    radius: 1,
    run: kernel::heights::<Bilinear, 2>,
    run_on_axes: on_axes::heights::<Bilinear, 2>,
};
