//! Bilinear: linear between the samples on both sides, along columns and along rows.

use crate::resample::Resampling;
use crate::resample::kernel::{self, Kernel};

/// The registry entry.
pub(crate) const RESAMPLING: Resampling = Resampling {
    name: "bilinear",
    about: "by the four samples around, linear along columns and rows",
    radius: 1,
    run: kernel::heights::<Bilinear, 2>,
};

/// Weights that fall to nothing one sample away.
pub(crate) struct Bilinear;

impl Kernel for Bilinear {
    #[inline(always)]
    fn weight(distance: f64) -> f64 {
        (1.0 - distance).max(0.0)
    }
}
