//! Heights beside those of a loop over all samples of a grid, and of surfaces whose heights are known.

use proptest::prelude::*;

use super::*;
use terrane_base::geom::Rect;

fn window<'a>(grid: [u32; 2], heights: &'a [f64]) -> SourceWindow<'a> {
    SourceWindow { grid, rect: Rect::new(0, 0, grid[0], grid[1]), heights }
}

fn one(name: &str) -> &'static ResamplingMethod {
    terrane_base::registry::find(RESAMPLINGS, name).unwrap()
}

fn at(resampling: &ResamplingMethod, window: &SourceWindow<'_>, place: Place, scale: Scale) -> f64 {
    let mut out = [0.0];
    resampling.heights(window, &[place], scale, &mut out);
    out[0]
}

/// As Keys (1981) has it, and a hat.
fn weight(name: &str, x: f64) -> f64 {
    match (name, x) {
        ("bilinear", x) if x < 1.0 => 1.0 - x,
        ("cubic", x) if x < 1.0 => 1.5 * x.powi(3) - 2.5 * x.powi(2) + 1.0,
        ("cubic", x) if x < 2.0 => -0.5 * x.powi(3) + 2.5 * x.powi(2) - 4.0 * x + 2.0,
        _ => 0.0,
    }
}

/// Over all samples of the grid, and of the endless lattice around it: those that count and are not there make a
/// cubic height bilinear.
fn slow(name: &str, grid: [u32; 2], heights: &[f64], place: Place, scale: [f64; 2]) -> f64 {
    let get = |col: i64, row: i64| match (u32::try_from(col), u32::try_from(row)) {
        (Ok(c), Ok(r)) if c < grid[0] && r < grid[1] => heights[(r * grid[0] + c) as usize],
        _ => f64::NAN,
    };
    let all = || (-90..130).flat_map(|row| (-90..130).map(move |col| (col, row)));
    let off = |(col, row): (i64, i64)| [col as f64 - place[0], row as f64 - place[1]].map(f64::abs);
    // Of samples that are as near the right one, and the lower, counts.
    let cell = place.map(|at| (at + 0.5).floor() as i64);
    let cell = [0, 1].map(|axis| match cell[axis] == i64::from(grid[axis]) {
        true if place[axis] + 0.5 == f64::from(grid[axis]) => cell[axis] - 1,
        _ => cell[axis],
    });
    let nearest = get(cell[0], cell[1]);
    if name == "near" || nearest.is_nan() {
        return nearest;
    }
    let (mut sum, mut total) = (0.0, 0.0);
    for at in all() {
        let [x, y] = off(at);
        let weight = weight(name, x / scale[0]) * weight(name, y / scale[1]);
        let height = get(at.0, at.1);
        match height.is_nan() {
            true if weight != 0.0 && name == "cubic" => {
                return slow("bilinear", grid, heights, place, scale);
            }
            true => {}
            false => (sum, total) = (sum + weight * height, total + weight),
        }
    }
    sum / total
}

fn is_near(a: f64, b: f64) -> bool {
    (a.is_nan() && b.is_nan()) || (a - b).abs() < 1e-9 * (1.0 + b.abs())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 64 } else { 512 }))]

    #[test]
    fn heights_are_those_of_a_loop_over_all(
        width in 1..20_u32, height in 1..20_u32, seed: u64, voids in prop_oneof![Just(0), 0..40_u64],
        x in -1.2..1.2_f64, y in -1.2..1.2_f64, sx in 0.4..5.0_f64, sy in 0.4..5.0_f64, steps: bool,
    ) {
        let random = |i: u64| (seed ^ i).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(17).wrapping_mul(0xD134_2543_DE82_EF95) >> 33;
        let heights: Vec<f64> = (0..u64::from(width * height))
            .map(|i| if random(i) % 100 < voids { f64::NAN } else { (random(i + 999) % 1000) as f64 / 7.0 })
            .collect();
        let grid = [width, height];
        let place = [x * f64::from(width), y * f64::from(height)];
        // Quarters, too: samples, borders of cells and the ends of kernels.
        let place = if steps { place.map(|at| (at * 4.0).round() / 4.0) } else { place };
        let scale = Scale::new([sx, sy]);
        for resampling in RESAMPLINGS {
            let expected = slow(resampling.name, grid, &heights, place, scale.get());
            let found = at(resampling, &window(grid, &heights), place, scale);
            prop_assert!(is_near(found, expected), "{}: {found}, not {expected}", resampling.name);
            // What is needed is enough.
            let rect = resampling.needed(grid, &[place], scale);
            let part: Vec<f64> = (rect.row..rect.end_row())
                .flat_map(|row| (rect.col..rect.end_col()).map(move |col| (col, row)))
                .map(|(col, row)| heights[(row * width + col) as usize])
                .collect();
            let part = SourceWindow { grid, rect, heights: &part };
            let again = at(resampling, &part, place, scale);
            prop_assert!(again.to_bits() == found.to_bits() || again.is_nan() && found.is_nan());
        }
    }
}

proptest! {
    #[test]
    fn heights_on_columns_and_rows_are_those_one_by_one(
        width in 1..20_u32, height in 1..20_u32, seed: u64, voids in prop_oneof![Just(0), 0..40_u64],
        columns in prop::collection::vec(-3.0..24.0_f64, 1..9), rows in prop::collection::vec(-3.0..24.0_f64, 1..9),
        sx in 0.4..5.0_f64, sy in 0.4..5.0_f64, steps: bool,
    ) {
        let random = |i: u64| (seed ^ i).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(17).wrapping_mul(0xD134_2543_DE82_EF95) >> 33;
        let heights: Vec<f64> = (0..u64::from(width * height))
            .map(|i| if random(i) % 100 < voids { f64::NAN } else { (random(i + 999) % 1000) as f64 / 7.0 })
            .collect();
        let grid = [width, height];
        let [columns, rows] = [columns, rows].map(|axis| {
            axis.into_iter().map(|at| if steps { (at * 4.0).round() / 4.0 } else { at }).collect::<Vec<f64>>()
        });
        let places: Vec<Place> = rows.iter().flat_map(|y| columns.iter().map(|x| [*x, *y])).collect();
        let scale = Scale::new([sx, sy]);
        for resampling in RESAMPLINGS {
            let rect = resampling.needed_on_axes(grid, [&columns, &rows], scale);
            prop_assert_eq!(rect, resampling.needed(grid, &places, scale));
            let part: Vec<f64> = (rect.row..rect.end_row())
                .flat_map(|row| (rect.col..rect.end_col()).map(move |col| (col, row)))
                .map(|(col, row)| heights[(row * width + col) as usize])
                .collect();
            if part.is_empty() {
                continue;
            }
            let part = SourceWindow { grid, rect, heights: &part };
            let (mut expected, mut found) = (vec![0.0; places.len()], vec![0.0; places.len()]);
            resampling.heights(&part, &places, scale, &mut expected);
            resampling.heights_on_axes(&part, [&columns, &rows], scale, &mut found);
            for (found, expected) in found.iter().zip(&expected) {
                let is_same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
                prop_assert!(is_same, "{}: {found}, not {expected}", resampling.name);
            }
        }
    }
}

#[test]
fn cubic_is_exact_for_quadratic_surfaces() {
    let of = |x: f64, y: f64| 3.0 + x - 2.0 * y + 0.5 * x * x - 0.25 * x * y + y * y;
    let heights: Vec<f64> = (0..100).map(|i| of(f64::from(i % 10), f64::from(i / 10))).collect();
    for i in 0..200 {
        let place = [1.0 + f64::from(i % 14) / 2.0 * 0.9, 1.0 + f64::from(i) * 0.03];
        let found = at(one("cubic"), &window([10, 10], &heights), place, Scale::ONE);
        assert!((found - of(place[0], place[1])).abs() < 1e-10, "{place:?}");
    }
}

#[test]
fn cells_reach_half_a_sample_beyond_and_no_further() {
    let heights = [7.0, 9.0];
    let window = window([2, 1], &heights);
    for resampling in RESAMPLINGS {
        for (col, expected) in [(-0.5, 7.0), (1.5, 9.0)] {
            for row in [-0.5, 0.0, 0.5] {
                assert_eq!(at(resampling, &window, [col, row], Scale::ONE), expected);
            }
        }
        for place in [[-0.51, 0.0], [1.51, 0.0], [0.0, 0.51], [f64::NAN, 0.0], [0.0, f64::INFINITY]]
        {
            assert!(at(resampling, &window, place, Scale::ONE).is_nan(), "{place:?}");
            assert!(resampling.needed([2, 1], &[place], Scale::ONE).is_empty());
        }
    }
}

#[test]
fn ways_are_found_by_name() {
    assert_eq!(
        RESAMPLINGS.iter().map(|r| r.name).collect::<Vec<_>>(),
        ["near", "bilinear", "cubic"]
    );
    assert_eq!(one("NEAREST").name, "near");
}
