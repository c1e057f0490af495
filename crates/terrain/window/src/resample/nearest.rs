//! The nearest sample: heights are not changed.

use super::on_axes;
use super::resampling::{ResamplingMethod, Scale};
use super::window::{Place, SourceWindow};

/// The registry entry.
pub(crate) const RESAMPLING: ResamplingMethod = ResamplingMethod {
    name: "near",
    about: "nearest sample, heights unchanged",
    radius: 0,
    run: heights,
    run_on_axes: on_axes::nearest,
};

fn heights(window: &SourceWindow<'_>, places: &[Place], _scale: Scale, out: &mut [f64]) {
    for (place, out) in places.iter().zip(out) {
        *out = window.nearest(*place);
    }
}
