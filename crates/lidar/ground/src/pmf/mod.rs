//! Ground classification by a morphological filter of the lowest heights.
//!
//! After Pingel, Clarke & McBride, "An improved simple morphological filter for the terrain classification of
//! airborne LIDAR data" (2013): the lowest point of each cell makes a surface; parts that an opening lowers by
//! more than the window size times a slope are objects; the holes are filled; and points near the resulting
//! surface are ground, with a tolerance that grows with the slope. Three differences make the result of a tile
//! with a halo of [`Parameters::reach`] cells exactly that of the whole: windows are squares and open the first
//! surface (for squares the same as opening the previous one), holes are filled by means over windows of
//! limited size instead of springs, and all heights are integers.

mod holes;
mod low;
mod opening;
mod parameters;

use crate::finder::{GroundFinder, GroundTiling, Method, Request};
use crate::lowest_points::{EMPTY, LowestPoints};
use crate::surface::{BESIDE, GroundSurface};
use holes::{filled, widened};

pub use parameters::Parameters;

pub(crate) const METHOD: Method = Method {
    name: "pmf",
    source: "after Pingel and others 2013",
    about: "morphological filter: openings with growing squares, holes filled by means; exact in tiles of any size",
    parameters: &[],
    finder: GroundFinder {
        tiling: |_, spacing| {
            let cell = spacing.max(CELL);
            GroundTiling { cell, halo: Parameters::metres(cell, 1.0).reach(), core: None }
        },
        bytes_per_cell: 72,
        find,
    },
};

/// Side of a cell in metres, unless points are further apart.
const CELL: f64 = 1.0;

fn find(_: &Request, lows: &LowestPoints<'_>) -> GroundSurface {
    let minima: Vec<i32> = lows.points.iter().map(|p| p.z).collect();
    ground(&minima, lows.width, &Parameters::metres(lows.cell, lows.step[2]))
}

impl Parameters {
    /// Number of cells around a cell that its result depends on.
    pub fn reach(&self) -> usize {
        let radius = self.radius();
        low::REACH + 2 * holes::reach(radius) + opening::reach(radius) + BESIDE
    }
}

/// The ground under the cells whose lowest heights are `minima`, row by row, in steps; cells without points are
/// [`EMPTY`], and so is all beyond the window. Cells further than [`Parameters::reach`] from the border of the
/// window have the same ground as in any larger window.
///
/// Time is proportional to the cells: a quarter of a microsecond each, with memory for 60 bytes.
///
/// # Panics
/// When `minima` is not whole rows of `width`.
pub fn ground(minima: &[i32], width: usize, parameters: &Parameters) -> GroundSurface {
    assert!(width > 0 && minima.len().is_multiple_of(width), "whole rows of cells");
    let mut bare = low::without_noise(minima, width, parameters.depth / parameters.step);
    opening::take_off_objects(&mut bare, width, parameters);
    let wide = width + 2 * BESIDE;
    let heights = filled(&widened(&bare, width, BESIDE), wide, holes::reach(parameters.radius()));
    let Parameters { step, height: near, scaling, .. } = *parameters;
    let heights = heights.into_iter().map(|z| if z == EMPTY { f64::NAN } else { f64::from(z) });
    GroundSurface::new(width, heights.collect(), |slope| near / step + scaling * slope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CELLS: Parameters = Parameters {
        cell: 1.0,
        step: 0.01,
        window: 3.0,
        slope: 0.15,
        height: 0.5,
        scaling: 1.25,
        depth: 1.0,
    };

    /// A slope of 2 steps east and 3 south by cell, with a block on it.
    fn slope_with_block() -> (Vec<i32>, usize) {
        let height = |k: i32| {
            let (col, row) = (k % 40, k / 40);
            let block = (15..20).contains(&col) && (12..18).contains(&row);
            1000 + 2 * col - 3 * row + if block { 300 } else { 0 }
        };
        ((0..1200).map(height).collect(), 40)
    }

    #[test]
    fn a_block_is_taken_off_and_the_slope_stays() {
        let (minima, width) = slope_with_block();
        let ground = ground(&minima, width, &CELLS);
        for (at, low) in minima.iter().enumerate() {
            let (col, row) = (at % width, at / width);
            let plane = 1000 + 2 * col as i32 - 3 * row as i32;
            let is = |z: i32| ground.is_ground(col, row, [0.5, 0.5], z);
            assert_eq!(is(*low), *low == plane, "({col}, {row})");
            assert!(is(plane) && is(plane + 40) && is(plane - 40), "({col}, {row})");
            assert!(!is(plane + 100) && !is(plane - 100), "({col}, {row})");
        }
    }

    #[test]
    fn heights_are_blended_between_the_centres_of_cells() {
        let minima = [0, 100, 200, 400];
        let level = Parameters { slope: 1e6, depth: 1e6, ..CELLS };
        let ground = ground(&minima, 2, &level);
        assert_eq!(ground.height(0, 0, [0.5, 0.5]), Some(0.0));
        assert_eq!(ground.height(0, 0, [1.0, 0.5]), Some(50.0));
        assert_eq!(ground.height(1, 0, [0.0, 0.5]), Some(50.0));
        assert_eq!(ground.height(1, 1, [0.0, 0.0]), Some(175.0));
        assert_eq!(ground.height(0, 1, [1.0, 0.0]), Some(175.0));
    }

    /// What is looked at for noise, twice the holes, the windows, and the cells beside.
    #[test]
    fn the_reach_is_counted_in_cells() {
        let reach = |cell: f64, window: f64| {
            Parameters { window, ..Parameters::metres(cell, 0.01) }.reach()
        };
        assert_eq!(reach(1.0, 18.0), 2 + 2 * 36 + 36 + 1);
        assert_eq!(reach(0.5, 18.0), 2 + 2 * 72 + 72 + 1);
        assert_eq!(reach(2.0, 5.0), 2 + 2 * 6 + 6 + 1);
        assert_eq!(reach(9.0, 1.0), 2 + 2 * 2 + 2 + 1);
    }

    #[test]
    fn steep_ground_may_lie_further_off() {
        for (east, north) in [(0, 0), (7, 0), (0, -9), (12, 5), (-3, 40)] {
            let minima: Vec<i32> = (0..60).map(|k| k % 10 * east + k / 10 * north).collect();
            let steep = Parameters { slope: 1e6, depth: 1e6, scaling: 1.7, ..CELLS };
            let ground = ground(&minima, 10, &steep);
            let most = 50.0 + 1.7 * f64::from(east).hypot(f64::from(north));
            for (off, sign) in (-200..200).flat_map(|off| [(off, 1), (off, -1)]) {
                let z = minima[34] + sign * off;
                let is_near = f64::from(off).abs() < most + 1e-3;
                assert_eq!(ground.is_ground(4, 3, [0.5; 2], z), is_near, "{east} {north} {off}");
            }
        }
    }

    #[test]
    fn level_ground_is_level_to_its_very_end() {
        let minima: Vec<i32> =
            (0..40 * 5).map(|k| if k % 40 < 9 { 10_000 } else { EMPTY }).collect();
        let ground = ground(&minima, 40, &CELLS);
        let known = |col: &usize| ground.height(*col, 2, [0.5; 2]).is_some();
        let last = (0..40).take_while(known).last().unwrap();
        assert!((9..39).contains(&last));
        for (col, row) in (0..=last).flat_map(|col| (0..5).map(move |row| (col, row))) {
            let is_ground = |off: i32| ground.is_ground(col, row, [0.5; 2], 10_000 + off);
            assert_eq!(
                [50, -50, 51, -51].map(is_ground),
                [true, true, false, false],
                "{col} {row}"
            );
        }
    }

    #[test]
    fn noise_lies_deeper_than_it_may() {
        for (z, expected) in [(-50, -50), (-150, 0)] {
            let mut minima = vec![0; 15 * 15];
            minima[7 * 15 + 7] = z;
            let steep = Parameters { slope: 1e6, ..CELLS };
            assert_eq!(
                ground(&minima, 15, &steep).height(7, 7, [0.5; 2]),
                Some(f64::from(expected))
            );
        }
    }

    #[test]
    fn nothing_is_ground_where_there_are_no_points() {
        let mut minima = vec![EMPTY; 100 * 3];
        assert_eq!(ground(&minima, 100, &CELLS).height(50, 1, [0.5, 0.5]), None);
        minima[100] = 7;
        let ground = ground(&minima, 100, &CELLS);
        assert!(ground.is_ground(0, 1, [0.5, 0.5], 7));
        assert!(!ground.is_ground(99, 1, [0.5, 0.5], 7));
        assert!(super::ground(&[], 4, &CELLS).tolerances.is_empty());
    }

    /// The cells of a rectangle [west, south, east, north], which may go beyond the window.
    fn cut(minima: &[i32], width: usize, [west, south, east, north]: [i64; 4]) -> Vec<i32> {
        let inside = |col: i64, row: i64| {
            let (col, row) = (usize::try_from(col).ok()?, usize::try_from(row).ok()?);
            if col < width { minima.get(row * width + col).copied() } else { None }
        };
        let cells = (south..north).flat_map(|row| (west..east).map(move |col| (col, row)));
        cells.map(|(col, row)| inside(col, row).unwrap_or(EMPTY)).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(150))]

        /// Heights and holes of every kind, small windows: whatever depends on cells far off shows.
        #[test]
        fn cells_depend_on_nothing_beyond_the_reach(
            window in 1..4_u8,
            share in 1..60_u32,
            seed: u32,
            picks in prop::collection::vec((0..48_i64, 0..48_i64), 25),
        ) {
            let width = 48;
            let cell = |k: u32| {
                let hash = (k ^ seed).wrapping_mul(0x9E37_79B1).rotate_left(13).wrapping_mul(0x85EB_CA6B);
                if hash >> 8 & 63 < share { (hash >> 16) as i32 % 400 } else { EMPTY }
            };
            let minima: Vec<i32> = (0..48 * 48).map(cell).collect();
            let parameters = Parameters { window: window.into(), ..CELLS };
            let whole = ground(&minima, width, &parameters);
            let reach = parameters.reach() as i64;
            for (col, row) in picks {
                let around = [col - reach, row - reach, col + reach + 1, row + reach + 1];
                let side = 2 * reach as usize + 1;
                let part = ground(&cut(&minima, width, around), side, &parameters);
                let (at, middle) = (row as usize * width + col as usize, side * side / 2);
                let tolerances = [whole.tolerances[at], part.tolerances[middle]].map(f32::to_bits);
                prop_assert_eq!(tolerances[0], tolerances[1]);
                for place in [[0.2, 0.9], [0.7, 0.1]] {
                    prop_assert_eq!(
                        whole.height(col as usize, row as usize, place),
                        part.height(reach as usize, reach as usize, place)
                    );
                }
            }
        }
    }
}
