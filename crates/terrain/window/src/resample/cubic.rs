//! Cubic convolution (Keys 1981, a = -1/2): smooth, through all samples, exact for quadratic surfaces.

use super::kernel::{self, ResamplingKernel};
use super::on_axes;
use super::resampling::ResamplingMethod;

/// The registry entry.
pub(crate) const RESAMPLING: ResamplingMethod = ResamplingMethod {
    name: "cubic",
    about: "cubic convolution of 4 x 4 samples, bilinear beside voids",
    radius: 2,
    run: kernel::heights::<CubicKernel, 4>,
    run_on_axes: on_axes::heights::<CubicKernel, 4>,
};

struct CubicKernel;

impl ResamplingKernel for CubicKernel {
    #[inline(always)]
    fn weight(distance: f64) -> f64 {
        let d = distance;
        if d <= 1.0 {
            (1.5 * d - 2.5) * d * d + 1.0
        } else if d < 2.0 {
            ((-0.5 * d + 2.5) * d - 4.0) * d + 2.0
        } else {
            0.0
        }
    }
}
