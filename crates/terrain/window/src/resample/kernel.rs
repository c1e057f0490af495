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
            _ => height::<K, TAPS>(window, *place, scale, &mut wide),
        };
    }
}

/// The height at a position in the cell of a valid sample.
#[inline(always)]
pub(super) fn height<K: ResamplingKernel, const TAPS: usize>(
    window: &SourceWindow<'_>,
    place: Place,
    scale: Scale,
    wide: &mut [Vec<f64>; 2],
) -> f64 {
    match scale == Scale::ONE {
        true => close::<K, TAPS>(window, place),
        false => far::<K>(window, place, scale, TAPS / 2, wide),
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
    let [(col, across), (row, down)] = place.map(close_taps::<K, TAPS>);
    let height = weighted(window, &ResamplingTaps { first: [col, row], weights: [&across, &down] });
    // Some of them may have no weight.
    if height.is_nan() {
        far::<K>(window, place, Scale::ONE, TAPS / 2, &mut Default::default())
    } else {
        height
    }
}

/// The first sample that counts at a position along an axis, and the weights.
#[inline(always)]
pub(super) fn close_taps<K: ResamplingKernel, const TAPS: usize>(at: f64) -> (i64, [f64; TAPS]) {
    let first = floored(at) - (TAPS as i64 / 2 - 1);
    let from = at - first as f64;
    (first, std::array::from_fn(|tap| K::weight((tap as f64 - from).abs())))
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
    let ([by_column, by_row], [across, down]) = (scale.get(), buffers);
    let (col, across) = far_taps::<K>(place[0], by_column, radius, across);
    let (row, down) = far_taps::<K>(place[1], by_row, radius, down);
    ResamplingTaps { first: [col, row], weights: [across, down] }
}

/// The first sample with a weight at a position along an axis, and the weights up to the last.
#[inline(always)]
pub(super) fn far_taps<K: ResamplingKernel>(
    at: f64,
    scale: f64,
    radius: usize,
    weights: &mut Vec<f64>,
) -> (i64, &[f64]) {
    let reach = -floored(-(radius as f64 * scale));
    let from = floored(at) - reach + 1;
    weights.clear();
    let distances = (from..from + 2 * reach).map(|tap| (tap as f64 - at).abs() / scale);
    weights.extend(distances.map(K::weight));
    let zeros = weights.iter().take_while(|weight| **weight == 0.0).count();
    let end = weights.iter().rposition(|weight| *weight != 0.0).map_or(zeros, |last| last + 1);
    (from + zeros as i64, &weights[zeros..end])
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
