//! Largest error and sum of squared errors of a finished triangle, every sample counted once.

use super::Local;
use super::exact::{distance, for_each_sample};
use super::field::Field;

/// Measures triangle `p` over all its samples in `f64`. A sample on edge `i` counts in the sum only
/// when `owned[i]`; vertices have no error. Returns (largest error, sum of squares).
pub(super) fn measure(field: &Field, p: [Local; 3], owned: [bool; 3]) -> (f32, f32) {
    let z = field.vertices(p);
    let whole = [0, field.width() as i32 - 1, 0, field.height() as i32 - 1];
    let (mut largest, mut sum) = (0.0_f64, 0.0);
    for_each_sample(p, whole, |at, weights| {
        let height = field.sample(at);
        if height.is_nan() {
            return;
        }
        let error = distance(weights, z, height);
        largest = largest.max(error);
        // Weight i belongs to corner i, so it vanishes on the edge opposite, which starts at i + 1.
        let is_owned = (0..3).all(|i| weights[i] != 0 || owned[(i + 1) % 3]);
        if is_owned {
            sum += error * error;
        }
    });
    (largest as f32, sum as f32)
}

/// Which of the two triangles beside an edge owns the samples on it: decided by direction alone,
/// so that both sides agree wherever they are computed.
pub(super) fn owns_by_direction(from: Local, to: Local) -> bool {
    to.row() < from.row() || (to.row() == from.row() && to.col() > from.col())
}
