//! Charts of straight and of rotated grids.

use super::*;
use crate::overview::{OverviewPlan, RectRelation};
use crate::terrain::{HeightPatch, TerrainSampler, VoidFillSums};
use crate::tiling::GlobeTileId;
use proptest::prelude::*;
use terrane_base::geom::Rect;

/// A rotated grid in a sinusoidal projection about longitude 7, with the positions of its samples.
fn turned(
    whole: [u32; 2],
    step: f64,
    angle: f64,
    south: f64,
) -> (Result<GridGeolocation>, impl Fn([f64; 2]) -> [f64; 2]) {
    let (sin, cos) = angle.sin_cos();
    let to = move |[col, row]: [f64; 2]| {
        let [x, y] = [(col * cos - row * sin) * step, (col * sin + row * cos) * step];
        [7.0 + x / (south + y).to_radians().cos(), south + y]
    };
    let back = move |[lon, lat]: [f64; 2]| {
        let [x, y] = [(lon - 7.0) * lat.to_radians().cos() / step, (lat - south) / step];
        Ok([x * cos + y * sin, y * cos - x * sin])
    };
    (GridGeolocation::bent(whole, move |at| Ok(to(at)), back), to)
}

fn all([width, height]: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    (0..height).flat_map(move |row| (0..width).map(move |col| [col, row]))
}

#[test]
fn places_between_nodes_are_where_they_should_be() {
    for (whole, step, angle, south) in
        [([150, 90], 0.01, 0.3, 46.0), ([40, 60], 0.2, 2.0, -50.0), ([3, 2], 1e-4, -1.0, 70.0)]
    {
        let (chart, to) = turned(whole, step, angle, south);
        let chart = chart.unwrap();
        let mut least = f64::INFINITY;
        for at in all(whole).map(|at| at.map(f64::from)) {
            let (place, found) = (to(at), chart.sample(at, 0.0));
            assert!((0..2).all(|axis| (found.place[axis] - place[axis]).abs() < 1e-8));
            assert!(chart.bounds().holds(found.place));
            let back = chart.within(place).at;
            assert!((0..2).all(|axis| (back[axis] - at[axis]).abs() < 2e-3), "{at:?} {back:?}");
            let beside = chart.sample([at[0] + 1.0, at[1]], 0.0).upright.point(0.0);
            let off = (beside - found.upright.point(0.0)).length();
            least = least.min(off / (crate::globe::EQUATOR.to_radians()));
        }
        assert!(chart.spacing() < least * 1.01 && chart.spacing() > least * 0.95);
    }
    // A pole among the samples; too few nodes for the curvature.
    let (chart, _) = turned([100, 100], 0.5, 0.0, 60.0);
    assert!(chart.unwrap_err().to_string().contains("pole"));
    let wave = |[col, row]: [f64; 2]| Ok([col * 0.001 + (row * 1.3).sin() * 0.0001, row * 0.001]);
    let chart =
        GridGeolocation::bent([9, 4000], wave, |[lon, lat]| Ok([lon * 1000.0, lat * 1000.0]));
    let told = chart.unwrap_err().to_string();
    assert!(told.contains("too large for its projection"), "{told}");
}

/// Breaks of a ground along some lines, to the micrometre.
fn bends(ground: &impl TerrainSampler, lines: &[[[f64; 2]; 2]]) -> Vec<([f64; 2], Option<f64>)> {
    let mut found = Vec::new();
    for line in lines {
        ground.bends(*line, &mut |place, height| {
            found.push((place, height.map(|z| (z * 1e6).round())));
        });
    }
    found.sort_by(|a, b| a.0.partial_cmp(&b.0).unwrap());
    found
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn what_is_looked_at_of_a_bent_grid_is_what_a_look_at_all_finds(
        angle in -3.2..3.2_f64, south in -60.0..60.0_f64, exponent in 0_i32..4, seed: u32,
    ) {
        let (whole, step) = ([70_u32, 45_u32], 0.001 * 4_f64.powi(exponent));
        let (chart, _) = turned(whole, step, angle, south);
        let chart = chart.unwrap();
        let noise = |i: u32| f64::from((i ^ seed).wrapping_mul(0x9e37_79b9) >> 16) / 65536.0;
        let height = |i: u32| if i % 31 == 7 { f64::NAN } else { noise(i) * 300.0 };
        let heights: Vec<f64> = (0..whole[0] * whole[1]).map(height).collect();
        let mut means = VoidFillSums::new(whole);
        for (row, line) in (0..).zip(heights.chunks(70)) {
            means.add(0, row, line);
        }
        let fill = means.fill().unwrap();
        let rect = Rect::new(0, 0, 70, 45);
        let asked = HeightPatch::new(&heights, rect, &chart, &fill);
        let kept = asked.clone().with_positions();
        let width = 40.0 * step;
        let level = (0..20).find(|level| crate::degrees(*level) < width).unwrap();
        let [cols, rows] = GlobeTileId::meeting(level, &chart.bounds());
        let tiles = (rows[0]..=rows[1]).flat_map(|y| (cols[0]..=cols[1]).map(move |x| GlobeTileId { level, x, y }));
        let lines = |first: u32, last: u32, from: f64| -> Vec<f64> {
            (first..=last + 1).map(|i| from + f64::from(i) * crate::degrees(level)).collect()
        };
        let borders = [lines(cols[0], cols[1], -180.0), lines(rows[0], rows[1], -90.0)];
        let plan = OverviewPlan::new(chart.clone(), [&borders[0], &borders[1]]);
        let mut gathered = plan.clone().gather();
        gathered.add(plan.summarize(rect, &heights));
        let overview = gathered.finish().unwrap();
        let mut seen = 0;
        for id in tiles {
            let bounds = id.bounds();
            let expected: Vec<[f64; 2]> = all(whole)
                .filter(|[col, row]| heights[(row * 70 + col) as usize].is_finite())
                .map(|at| chart.sample(at.map(f64::from), 0.0).place)
                .filter(|place| bounds.holds(*place))
                .collect();
            seen += expected.len();
            for patch in [&asked, &kept] {
                let mut found = Vec::new();
                patch.each(&bounds, 1, &mut |sample| found.push(sample.place));
                prop_assert_eq!(&found, &expected);
                prop_assert_eq!(patch.holds_any(&bounds), !expected.is_empty());
            }
            // Blocks by what is in them.
            let [cols, rows] = overview.blocks_in(&bounds);
            let OverviewPlan { blocks, .. } = &plan;
            for at in all(blocks.counts) {
                let rect = blocks.rect(at);
                let within = all([rect.width, rect.height])
                    .map(|[col, row]| chart.sample([col + rect.col, row + rect.row].map(f64::from), 0.0).place)
                    .filter(|place| bounds.holds(*place))
                    .count();
                let is_listed = (cols[0]..cols[1]).contains(&at[0]) && (rows[0]..rows[1]).contains(&at[1]);
                prop_assert!(is_listed || within == 0);
                match overview.lie(at, &overview.corners(at), &bounds) {
                    RectRelation::Beside => prop_assert_eq!(within, 0),
                    RectRelation::Within => prop_assert_eq!(within, rect.len()),
                    RectRelation::Across => (),
                }
            }
            // Along its borders, by the overview and by samples, and in halves.
            let corners = [[bounds.west, bounds.south], [bounds.east, bounds.south], [bounds.east, bounds.north]];
            for [from, to] in [[corners[0], corners[1]], [corners[2], corners[1]]] {
                let near = bends(&asked, &[[from, to]]);
                let far = bends(&overview, &[[from, to]]);
                prop_assert_eq!(&near, &far);
                let middle = [(from[0] + to[0]) / 2.0, (from[1] + to[1]) / 2.0];
                let mut halves = bends(&asked, &[[from, middle], [middle, to]]);
                halves.dedup();
                let mut near = near;
                near.dedup();
                prop_assert_eq!(halves, near);
                for k in 0..50 {
                    let part = f64::from(k) / 50.0;
                    let place = [0, 1].map(|axis: usize| from[axis] + (to[axis] - from[axis]) * part);
                    let [near, far] = [asked.height(place), overview.height(place)];
                    prop_assert_eq!(near.is_none(), far.is_none());
                    let filled = asked.filled(place) - overview.filled(place);
                    prop_assert!((near.unwrap_or(0.0) - far.unwrap_or(0.0)).abs().max(filled.abs()) < 1e-6);
                }
            }
        }
        prop_assert!(seen > 2000);
    }
}
