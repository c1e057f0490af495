//! Interpolation with separable weights.

use super::resampling::Scale;
use super::window::{Place, SourceWindow};
use terrane_base::rounding::floored;

/// Weights by distance.
pub(crate) trait ResamplingKernel {
    /// The weight of a sample at a distance in columns or rows.
    fn weight(distance: f64) -> f64;
}

/// Weights that fall linearly to 0 at the next sample.
pub(crate) struct Bilinear;

impl ResamplingKernel for Bilinear {
    #[inline(always)]
    fn weight(distance: f64) -> f64 {
        (1.0 - distance).max(0.0)
    }
}

/// The height at each position, by a kernel of `TAPS` samples along each axis.
pub(crate) fn heights<K: ResamplingKernel, const TAPS: usize>(
    window: &SourceWindow<'_>,
    places: &[Place],
    scale: Scale,
    out: &mut [f64],
) {
    let mut wide = [Vec::new(), Vec::new()];
    for (place, out) in places.iter().zip(out) {
        *out = match window.nearest(*place) {
            void if void.is_nan() => void,
            _ if scale == Scale::ONE => close::<K, TAPS>(window, *place),
            _ => far::<K>(window, *place, scale, TAPS / 2, &mut wide),
        };
    }
}

/// Samples that count, along both axes: the first, and their weights.
struct ResamplingTaps<'a> {
    first: [i64; 2],
    weights: [&'a [f64]; 2],
}

/// Interpolates at about the resolution of the grid.
#[inline(always)]
fn close<K: ResamplingKernel, const TAPS: usize>(window: &SourceWindow<'_>, place: Place) -> f64 {
    let first = place.map(|at| floored(at) - (TAPS as i64 / 2 - 1));
    let weights: [[f64; TAPS]; 2] = [0, 1].map(|axis| {
        let from = place[axis] - first[axis] as f64;
        std::array::from_fn(|tap| K::weight((tap as f64 - from).abs()))
    });
    let height = weighted(
        window,
        &ResamplingTaps { first, weights: weights.each_ref().map(|axis| &axis[..]) },
    );
    // Some of them may have no weight.
    if height.is_nan() {
        far::<K>(window, place, Scale::ONE, TAPS / 2, &mut Default::default())
    } else {
        height
    }
}

/// Downsamples: weights all samples that an output cell covers.
fn far<K: ResamplingKernel>(
    window: &SourceWindow<'_>,
    place: Place,
    scale: Scale,
    radius: usize,
    weights: &mut [Vec<f64>; 2],
) -> f64 {
    let taps = weigh::<K>(place, scale, radius, weights);
    let height = weighted(window, &taps);
    if height.is_nan() { partial(window, place, scale) } else { height }
}

/// The samples with a weight, along both axes.
#[inline(always)]
fn weigh<'a, K: ResamplingKernel>(
    place: Place,
    scale: Scale,
    radius: usize,
    buffers: &'a mut [Vec<f64>; 2],
) -> ResamplingTaps<'a> {
    let mut first = [0; 2];
    let mut axis = 0;
    let weights = buffers.each_mut().map(|weights| {
        let (at, scale) = (place[axis], scale.get()[axis]);
        let reach = -floored(-(radius as f64 * scale));
        let from = floored(at) - reach + 1;
        weights.clear();
        let distances = (from..from + 2 * reach).map(|tap| (tap as f64 - at).abs() / scale);
        weights.extend(distances.map(K::weight));
        let zeros = weights.iter().take_while(|weight| **weight == 0.0).count();
        let end = weights.iter().rposition(|weight| *weight != 0.0).map_or(zeros, |last| last + 1);
        first[axis] = from + zeros as i64;
        axis += 1;
        &weights[zeros..end]
    });
    ResamplingTaps { first, weights }
}

/// By all samples; NaN if one is void or beyond the window.
#[inline(always)]
fn weighted(window: &SourceWindow<'_>, taps: &ResamplingTaps<'_>) -> f64 {
    let [across, down] = taps.weights;
    let mut sum = 0.0;
    for (row, weight) in (taps.first[1]..).zip(down) {
        let Some(heights) = window.row([taps.first[0], row], across.len()) else {
            return f64::NAN;
        };
        let along: f64 = across.iter().zip(heights).map(|(weight, height)| weight * height).sum();
        sum += weight * along;
    }
    sum / (across.iter().sum::<f64>() * down.iter().sum::<f64>())
}

/// Bilinear, by the valid ones of the samples: the nearest is one of them, so there is a weight.
#[cold]
fn partial(window: &SourceWindow<'_>, place: Place, scale: Scale) -> f64 {
    let mut weights = [Vec::new(), Vec::new()];
    let ResamplingTaps { first, weights } = weigh::<Bilinear>(place, scale, 1, &mut weights);
    let (mut sum, mut total) = (0.0, 0.0);
    for (row, down) in (first[1]..).zip(weights[1]) {
        for (col, across) in (first[0]..).zip(weights[0]) {
            let (height, weight) = (window.at([col, row]), across * down);
            if !height.is_nan() {
                sum += weight * height;
                total += weight;
            }
        }
    }
    sum / total
}
