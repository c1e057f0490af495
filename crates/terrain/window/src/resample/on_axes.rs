//! Interpolation at all positions on some columns and rows, where weights are those of a column and of a row.

use super::kernel::{self, ResamplingKernel};
use super::resampling::Scale;
use super::window::{SourceWindow, nearest_index};
use terrane_base::geom::Rect;

/// A position along an axis.
struct AxisPlace {
    /// The nearest sample, in the window; `None` beyond the cells of the grid.
    nearest: Option<usize>,
    /// The first sample with a weight, in the window; `None` if not all are there.
    first: Option<usize>,
    /// Its first weight, and their number.
    weights: usize,
    count: usize,
    /// Sum of the weights.
    sum: f64,
}

/// Positions along an axis, with the weights of samples.
struct AxisPlaces {
    places: Vec<AxisPlace>,
    weights: Vec<f64>,
}

impl AxisPlaces {
    fn of<K: ResamplingKernel, const TAPS: usize>(
        places: &[f64],
        side: u32,
        [start, length]: [u32; 2],
        (scale, is_one): (f64, bool),
    ) -> Self {
        let mut all = Self { places: Vec::with_capacity(places.len()), weights: Vec::new() };
        let within = |index: i64, count: usize| {
            let first = usize::try_from(index - i64::from(start)).ok()?;
            (first + count <= length as usize).then_some(first)
        };
        let mut wide = Vec::new();
        for at in places {
            let weights = all.weights.len();
            let nearest = nearest_index(*at, side);
            let first = match is_one {
                _ if nearest.is_none() => 0,
                true => {
                    let (first, taps) = kernel::close_taps::<K, TAPS>(*at);
                    all.weights.extend(taps);
                    first
                }
                false => {
                    let (first, taps) = kernel::far_taps::<K>(*at, scale, TAPS / 2, &mut wide);
                    all.weights.extend(taps);
                    first
                }
            };
            let (count, sum) = (all.weights.len() - weights, all.weights[weights..].iter().sum());
            let nearest = nearest.and_then(|nearest| within(nearest, 1));
            all.places.push(AxisPlace {
                nearest,
                first: within(first, count),
                weights,
                count,
                sum,
            });
        }
        all
    }

    fn weights(&self, place: &AxisPlace) -> &[f64] {
        &self.weights[place.weights..][..place.count]
    }
}

/// As [`kernel::heights`] at the positions on `columns` and `rows`, row by row, by the same arithmetic.
pub(super) fn heights<K: ResamplingKernel, const TAPS: usize>(
    window: &SourceWindow<'_>,
    [columns, rows]: [&[f64]; 2],
    scale: Scale,
    out: &mut [f64],
) {
    let Rect { col, row, width, height } = window.rect;
    let ([by_column, by_row], is_one) = (scale.get(), scale == Scale::ONE);
    let [grid_width, grid_height] = window.grid;
    let across = AxisPlaces::of::<K, TAPS>(columns, grid_width, [col, width], (by_column, is_one));
    let down = AxisPlaces::of::<K, TAPS>(rows, grid_height, [row, height], (by_row, is_one));
    // Sums along the rows of the window.
    let (width, count) = (width as usize, columns.len());
    let mut sums = vec![f64::NAN; count * height as usize];
    for (sums, heights) in sums.chunks_exact_mut(count).zip(window.heights.chunks_exact(width)) {
        for (sum, place) in sums.iter_mut().zip(&across.places) {
            if let Some(first) = place.first {
                let both = across.weights(place).iter().zip(&heights[first..]);
                *sum = both.map(|(weight, height)| weight * height).sum();
            }
        }
    }
    let mut wide = Default::default();
    for ((row, place), out) in rows.iter().zip(&down.places).zip(out.chunks_exact_mut(count)) {
        let Some(nearest) = place.nearest else {
            out.fill(f64::NAN);
            continue;
        };
        out.fill(if place.first.is_some() { 0.0 } else { f64::NAN });
        let sums = sums.chunks_exact(count).skip(place.first.unwrap_or(0));
        for (weight, sums) in down.weights(place).iter().zip(sums) {
            out.iter_mut().zip(sums).for_each(|(out, along)| *out += weight * along);
        }
        let heights = &window.heights[nearest * width..][..width];
        for ((out, column), at) in out.iter_mut().zip(columns).zip(&across.places) {
            *out /= at.sum * place.sum;
            match at.nearest {
                Some(sample) if !heights[sample].is_nan() => {
                    if out.is_nan() {
                        let at = [*column, *row];
                        *out = kernel::height::<K, TAPS>(window, at, scale, &mut wide);
                    }
                }
                _ => *out = f64::NAN,
            }
        }
    }
}

/// As [`heights`], of the nearest samples.
pub(super) fn nearest(
    window: &SourceWindow<'_>,
    [columns, rows]: [&[f64]; 2],
    _scale: Scale,
    out: &mut [f64],
) {
    let Rect { col, row, width, height } = window.rect;
    let index = |places: &[f64], side: u32, start: u32, length: u32| -> Vec<Option<usize>> {
        let within = |index: i64| usize::try_from(index - i64::from(start)).ok();
        let places = places.iter().map(|at| nearest_index(*at, side).and_then(within));
        places.map(|index| index.filter(|index| *index < length as usize)).collect()
    };
    let across = index(columns, window.grid[0], col, width);
    let down = index(rows, window.grid[1], row, height);
    for (row, out) in down.iter().zip(out.chunks_exact_mut(columns.len())) {
        let heights = row.map(|row| &window.heights[row * width as usize..][..width as usize]);
        for (out, col) in out.iter_mut().zip(&across) {
            *out = heights.zip(*col).map_or(f64::NAN, |(heights, col)| heights[col]);
        }
    }
}
