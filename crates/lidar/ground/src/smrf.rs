//! The simple morphological filter as published: growing discs, and springs.
//!
//! After Pingel, Clarke & McBride, "An improved simple morphological filter for the terrain classification of
//! airborne LIDAR data" (2013): isolated low points are removed; parts that openings with discs lower by more
//! than their radius times a slope are objects; holes are filled by springs; points near the resulting surface
//! are ground, with a tolerance that grows with the slope.

use crate::finder::{GroundFinder, GroundTiling, Method, Request};
use crate::grid::{nearest_filled, neighbours, widened};
use crate::lowest_points::LowestPoints;
use crate::surface::GroundSurface;
use terrane_base::parameters::Parameter;

pub(crate) const METHOD: Method = Method {
    name: "smrf",
    source: "Pingel and others 2013",
    about: "simple morphological filter: openings with growing discs, spring inpainting",
    parameters: &[
        Parameter::new("cell", 1.0, [0.25, 100.0], "cell size, metres"),
        Parameter::new("slope", 0.15, [0.0, 10.0], "maximum ground slope, rise over run"),
        Parameter::new("window", 18.0, [1.0, 100.0], "radius of the largest disc, metres"),
        Parameter::new(
            "threshold",
            0.5,
            [0.0, 100.0],
            "maximum distance of ground from the surface, metres",
        ),
        Parameter::new(
            "scalar",
            1.25,
            [0.0, 100.0],
            "increase of the threshold per unit of slope, metres",
        ),
    ],
    finder: GroundFinder {
        tiling: |request, _| GroundTiling::fixed(request.value("cell")),
        bytes_per_cell: 128,
        find,
    },
};

/// Slope by which a low point stands out, rise over run to the next cell.
const LOW: f64 = 5.0;
/// Iterations of the relaxation of springs.
const RELAXED: usize = 200;
/// Over-relaxation factor.
const BEYOND: f64 = 1.85;

fn find(request: &Request, lows: &LowestPoints<'_>) -> GroundSurface {
    let (cell, step) = (lows.cell, lows.step[2]);
    let heights = lows.heights();
    let radius = (request.value("window") / cell).ceil() as usize;
    let bare = without_objects(&heights, lows.width, radius, request.value("slope") * cell);
    let surface = widened(&sprung(&bare, lows.width), lows.width);
    let [near, scalar] = ["threshold", "scalar"].map(|key| request.value(key));
    let surface = surface.into_iter().map(|z| z / step).collect();
    GroundSurface::new(lows.width, surface, |rise| (near + scalar * rise * step / cell) / step)
}

/// Heights with objects and low points set to NaN; `rise` is that of the steepest ground from cell to cell.
fn without_objects(heights: &[f64], width: usize, radius: usize, rise: f64) -> Vec<f64> {
    let filled = nearest_filled(heights, width);
    let upside_down: Vec<f64> = filled.iter().map(|z| -z).collect();
    let closed: Vec<f64> = opened(&upside_down, width, 1).iter().map(|z| -z).collect();
    let mut bare = heights.to_vec();
    let mut last = filled.clone();
    for r in 1..=radius {
        let opening = opened(&last, width, r);
        for (at, height) in bare.iter_mut().enumerate() {
            if last[at] - opening[at] > rise * r as f64 {
                *height = f64::NAN;
            }
        }
        last = opening;
    }
    let depth = LOW * rise.clamp(f64::MIN_POSITIVE, 1.0);
    for (height, (closed, filled)) in bare.iter_mut().zip(closed.iter().zip(&filled)) {
        if closed - filled > depth {
            *height = f64::NAN;
        }
    }
    bare
}

/// The opening with a disc: the highest of the lowest heights of all discs that hold a cell.
fn opened(heights: &[f64], width: usize, radius: usize) -> Vec<f64> {
    let eroded = over_disc(heights, width, radius, f64::min, f64::INFINITY);
    over_disc(&eroded, width, radius, f64::max, f64::NEG_INFINITY)
}

/// The best of the disc around each cell: of ever longer pieces of rows, each where the disc is as wide.
fn over_disc(
    heights: &[f64],
    width: usize,
    radius: usize,
    better: impl Fn(f64, f64) -> f64 + Copy,
    none: f64,
) -> Vec<f64> {
    let mut best = vec![none; heights.len()];
    let mut rows = heights.to_vec();
    for half in 0..=radius {
        if half > 0 {
            rows = longer(&rows, width, better);
        }
        for away in (0..=radius).filter(|&away| half_width(radius, away) == half) {
            let shift = (away * width).min(heights.len());
            let pairs = heights.len() - shift;
            best[..pairs].iter_mut().zip(&rows[shift..]).for_each(|(b, v)| *b = better(*b, *v));
            best[shift..].iter_mut().zip(&rows[..pairs]).for_each(|(b, v)| *b = better(*b, *v));
        }
    }
    best
}

/// Half width of a disc, in cells, at a distance in rows from its centre.
fn half_width(radius: usize, away: usize) -> usize {
    (radius * radius - away * away).isqrt()
}

/// Pieces of rows one cell longer at both ends.
fn longer(rows: &[f64], width: usize, better: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let mut out = rows.to_vec();
    for (line, out) in rows.chunks(width).zip(out.chunks_mut(width)) {
        for (out, east) in out.iter_mut().zip(&line[1..]) {
            *out = better(*out, *east);
        }
        for (out, west) in out[1..].iter_mut().zip(line) {
            *out = better(*out, *west);
        }
    }
    out
}

/// Holes filled by springs between neighbours.
fn sprung(bare: &[f64], width: usize) -> Vec<f64> {
    let mut heights = nearest_filled(bare, width);
    let holes: Vec<usize> = (0..bare.len()).filter(|&at| bare[at].is_nan()).collect();
    for _ in 0..RELAXED {
        for &at in &holes {
            let (mut sum, mut count) = (0.0, 0.0);
            for other in neighbours(at, width, bare.len()) {
                sum += heights[other];
                count += 1.0;
            }
            if count > 0.0 {
                // In place: a height is used as soon as it is set, which over-relaxation needs to converge.
                heights[at] += BEYOND * (sum / count - heights[at]);
            }
        }
    }
    heights
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn discs_are_those_of_the_definition(
            width in 1..12_usize,
            cells in prop::collection::vec(-50..50_i32, 12..150),
            radius in 1..6_usize,
        ) {
            let heights: Vec<f64> = cells[..cells.len() / width * width].iter().map(|z| f64::from(*z)).collect();
            let found = over_disc(&heights, width, radius, f64::min, f64::INFINITY);
            for (at, low) in found.into_iter().enumerate() {
                let inside = |k: &usize| {
                    let (x, y) = ((k % width).abs_diff(at % width), (k / width).abs_diff(at / width));
                    x * x + y * y <= radius * radius
                };
                let expected = (0..heights.len()).filter(inside).map(|k| heights[k]);
                prop_assert_eq!(low, expected.fold(f64::INFINITY, f64::min));
            }
        }
    }

    #[test]
    fn springs_go_straight_across_a_hole() {
        let plane = |k: usize| (k % 30) as f64 * 0.5 - (k / 30) as f64 * 0.25;
        let hole = |k: usize| (8..20).contains(&(k % 30)) && (5..15).contains(&(k / 30));
        let bare: Vec<f64> = (0..600).map(|k| if hole(k) { f64::NAN } else { plane(k) }).collect();
        for (k, z) in sprung(&bare, 30).into_iter().enumerate() {
            assert!((z - plane(k)).abs() < 1e-3, "{k} {z}");
        }
    }
}
