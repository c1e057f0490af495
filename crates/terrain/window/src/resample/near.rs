//! The nearest sample: heights stay what they are.

use super::resampling::{Resampling, Scale};
use super::window::{Place, Window};

/// The registry entry.
pub(crate) const RESAMPLING: Resampling = Resampling {
    name: "near",
    about: "the height of the nearest sample; none is made up",
    radius: 0,
    run: heights,
};

fn heights(window: &Window<'_>, places: &[Place], _scale: Scale, out: &mut [f64]) {
    for (place, out) in places.iter().zip(out) {
        *out = window.nearest(*place);
    }
}
