//! Hand-made water, and any against twins that look at each sample by itself.

use super::*;
use crate::{GridSource, SampleType};
use proptest::prelude::*;
use terrane_base::geom::{Affine, Rect, SampleSegment};

/// Heights that lie in memory.
struct Land {
    info: GridInfo,
    heights: Vec<f64>,
}

impl Land {
    fn new(width: u32, height: u32, at: impl Fn(u32, u32) -> f64) -> Self {
        let all = (0..height).flat_map(|row| (0..width).map(move |col| (col, row)));
        let heights = all.map(|(col, row)| at(col, row)).collect();
        Self { info: GridInfo::plain("test", width, height, SampleType::F64), heights }
    }

    fn read<H: Copy + From<f32>>(&self, rect: Rect, out: &mut [H], of: fn(f64) -> H) -> Result<()> {
        let rows = rect.row..rect.end_row();
        let all = rows.flat_map(|row| (rect.col..rect.end_col()).map(move |col| (col, row)));
        for (out, (col, row)) in out.iter_mut().zip(all) {
            *out = of(self.heights[(row * self.info.width + col) as usize]);
        }
        Ok(())
    }
}

impl GridSource for Land {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.read(rect, out, |height| height as f32)
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.read(rect, out, |height| height)
    }
}

/// Water whose positions are columns and rows of a grid.
fn water(info: &GridInfo, polygons: &[Vec<Xy>], lines: &[Vec<Xy>]) -> Arc<Water> {
    let world = |at: &Vec<Xy>| -> Vec<Xy> {
        at.iter().map(|&[col, row]| info.transform.apply(col, row)).collect()
    };
    let mut features = WaterFeatures::default();
    for polygon in polygons {
        features.begin_area().unwrap();
        let mut ring = world(polygon);
        ring.push(ring[0]);
        features.push_ring(&ring).unwrap();
    }
    lines.iter().for_each(|line| features.push_line(&world(line)).unwrap());
    Arc::new(Water::new(features, Path::new("water.wkt"), Crs::default()))
}

fn box_of(low: Xy, high: Xy) -> Vec<Xy> {
    vec![low, [high[0], low[1]], high, [low[0], high[1]]]
}

/// The grid with its water, read in windows of `side` samples.
fn levelled_heights(land: Land, water: &Arc<Water>, side: u32) -> Result<Vec<f64>> {
    let GridInfo { width, height, .. } = land.info;
    let grid = levelled(water, &crate::GridOpenOptions::default(), |_| Ok(Box::new(land)))?;
    let mut all = vec![0.0; (width * height) as usize];
    for row in (0..height).step_by(side as usize) {
        for col in (0..width).step_by(side as usize) {
            let rect = Rect::new(col, row, side.min(width - col), side.min(height - row));
            let mut out = vec![0.0; rect.len()];
            grid.read_f64(rect, &mut out)?;
            for (i, height) in out.into_iter().enumerate() {
                let (down, across) = (i as u32 / rect.width, i as u32 % rect.width);
                all[((row + down) * width + col + across) as usize] = height;
            }
        }
    }
    Ok(all)
}

#[test]
fn a_lake_is_as_high_as_its_lowest_bank() {
    let land = || Land::new(20, 12, |col, row| f64::from(100 + col) + 0.01 * f64::from(row));
    let info = land().info;
    let lake = water(&info, &[box_of([5.0, 4.0], [9.0, 7.0])], &[]);
    let found = levelled_heights(land(), &lake, 64).unwrap();
    // The lowest sample around it is at column 4, row 3.
    for (i, (before, after)) in land().heights.iter().zip(&found).enumerate() {
        let (col, row) = (i % 20, i / 20);
        let is_water = (5..=9).contains(&col) && (4..=7).contains(&row);
        assert_eq!(*after, if is_water { 104.03 } else { *before }, "{col} {row}");
    }
    let report = lake.report().unwrap();
    assert_eq!((report.lakes, report.rivers, report.outside), (1, 0, 0));
    assert_eq!(report.levels, Some([104.03; 2]));
}

#[test]
fn a_river_falls_along_its_line_and_is_level_across() {
    // Banks fall to the east, with a ridge across at column 20 and a hollow at column 30.
    let bank = |col: u32| match col {
        18..=22 => 95.0,
        30 => 60.0,
        _ => 100.0 - f64::from(col),
    };
    let land = || Land::new(60, 11, |col, row| bank(col) + f64::from(row.abs_diff(5)));
    let info = land().info;
    let river = [box_of([2.0, 3.0], [57.0, 7.0])];
    let line = vec![[2.0, 5.0], [57.0, 5.0]];
    let water_of = |line: Vec<Xy>| water(&info, &river, &[line]);
    let down = water_of(line.clone());
    let found = levelled_heights(land(), &down, 7).unwrap();
    let row = |row: usize| &found[row * 60 + 2..row * 60 + 58];
    for wet in 3..=7 {
        assert_eq!(row(wet), row(5), "level across");
    }
    assert!(row(5).windows(2).all(|pair| pair[1] <= pair[0]), "{:?}", row(5));
    // From column 29 on the hollow is the lowest bank, until there are lower ones beside column 40.
    assert_eq!((row(5)[27], row(5)[38]), (63.0, 62.0));
    let report = down.report().unwrap();
    assert_eq!((report.lakes, report.rivers, report.rising.len()), (0, 1, 0));
    assert!(report.dug > 10.0, "{report:?}");
    let up = water_of(line.into_iter().rev().collect());
    levelled_heights(land(), &up, 64).unwrap();
    assert_eq!(up.report().unwrap().rising, [1]);
}

#[test]
fn levels_go_on_from_line_to_line_and_through_lakes() {
    // A river into a lake, and one out of it, whose banks alone would be higher.
    let bank = |col: u32| match col {
        ..18 => 50.0,
        18..40 => 55.0,
        _ => 60.0,
    };
    let land = || Land::new(60, 9, |col, _| bank(col));
    let info = land().info;
    let areas = [
        box_of([1.0, 3.0], [20.0, 5.0]),
        box_of([20.0, 2.0], [40.0, 6.0]),
        box_of([40.0, 3.0], [58.0, 5.0]),
    ];
    // The first river is two lines.
    let lines = [
        vec![[10.0, 4.0], [20.0, 4.0]],
        vec![[1.0, 4.0], [10.0, 4.0]],
        vec![[40.0, 4.0], [58.0, 4.0]],
    ];
    let all = water(&info, &areas, &lines);
    let found = levelled_heights(land(), &all, 64).unwrap();
    for col in 1..=58 {
        assert_eq!(found[4 * 60 + col], 50.0, "{col}");
    }
    let report = all.report().unwrap();
    assert_eq!((report.lakes, report.rivers, report.dug), (1, 2, 10.0));
    // A side line of the lake has its level.
    let mut with_side = lines.to_vec();
    with_side.push(vec![[25.0, 2.0], [25.0, 0.0], [35.0, 0.0], [35.0, 2.0]]);
    let found = levelled_heights(land(), &water(&info, &areas, &with_side), 64).unwrap();
    assert_eq!(found[4 * 60 + 30], 50.0);
    let circle = [lines[0].clone(), vec![[20.0, 4.0], [30.0, 8.0], [10.0, 4.0]]];
    let error = levelled_heights(land(), &water(&info, &areas[..1], &circle), 64).unwrap_err();
    assert!(error.to_string().contains("cycle"), "{error}");
}

#[test]
fn lakes_that_share_a_side_are_one() {
    let land = || Land::new(30, 9, |col, _| f64::from(100 - col));
    let info = land().info;
    let halves = [box_of([3.0, 2.0], [10.0, 6.0]), box_of([10.0, 2.0], [20.0, 6.0])];
    let one = water(&info, &halves, &[]);
    let found = levelled_heights(land(), &one, 64).unwrap();
    assert_eq!((found[4 * 30 + 5], found[4 * 30 + 15]), (79.0, 79.0));
    assert_eq!(one.report().unwrap().lakes, 1);
    let apart = [halves[0].clone(), box_of([11.0, 2.0], [20.0, 6.0])];
    let two = water(&info, &apart, &[]);
    let found = levelled_heights(land(), &two, 64).unwrap();
    assert_eq!((found[4 * 30 + 5], found[4 * 30 + 15]), (89.0, 79.0));
}

#[test]
fn the_lowest_holds_where_lakes_overlap() {
    let land = || Land::new(30, 9, |col, _| f64::from(100 - col));
    let info = land().info;
    let lakes = [box_of([3.0, 2.0], [12.0, 6.0]), box_of([9.0, 3.0], [20.0, 5.0])];
    for order in [[0, 1], [1, 0]] {
        let both = water(&info, &order.map(|i| lakes[i].clone()), &[]);
        let found = levelled_heights(land(), &both, 64).unwrap();
        let level = |col: usize| found[4 * 30 + col];
        assert_eq!([level(5), level(10), level(15)], [87.0, 79.0, 79.0], "{order:?}");
    }
}

#[test]
fn water_in_voids_stays_void_and_water_in_water_takes_its_level() {
    let land = || Land::new(30, 9, |col, _| if col < 15 { f64::from(50 - col) } else { f64::NAN });
    let info = land().info;
    let areas = [
        box_of([2.0, 2.0], [10.0, 6.0]),
        box_of([4.0, 3.0], [7.0, 5.0]),
        box_of([20.0, 2.0], [27.0, 6.0]),
    ];
    let all = water(&info, &areas, &[]);
    let found = levelled_heights(land(), &all, 64).unwrap();
    let at = |col: usize| found[4 * 30 + col];
    assert_eq!([at(3), at(5), at(9)], [39.0; 3]);
    assert!(at(23).is_nan());
    let report = all.report().unwrap();
    assert_eq!((report.lakes, report.without_bank, report.levels), (3, 2, Some([39.0; 2])));
}

#[test]
fn what_cannot_be_told_is_refused() {
    let land = || Land::new(9, 9, |_, _| 5.0);
    let info = land().info;
    let failed = |lake: Arc<Water>| levelled_heights(land(), &lake, 64).unwrap_err().to_string();
    let far = water(&info, &[box_of([20.0, 2.0], [30.0, 6.0])], &[]);
    assert!(failed(far).contains("water polygons do not overlap the grid"));
    let all = water(&info, &[box_of([-5.0, -5.0], [30.0, 30.0])], &[]);
    let error = failed(all);
    assert!(error.contains("polygon 1") && error.contains("without a bank"), "{error}");
    let mut features = WaterFeatures::default();
    assert!(features.push_ring(&[[0.0, 0.0]]).is_err());
    features.begin_area().unwrap();
    assert!(features.push_ring(&[[0.0, f64::NAN]]).is_err());
    assert!(features.push_line(&[[0.0, f64::INFINITY]]).is_err());
    // Lines without a length make no river of it.
    for line in [&[][..], &[[5.0, -5.0]], &[[5.0, -5.0]; 3]] {
        let mut features = WaterFeatures::default();
        features.begin_area().unwrap();
        features.push_ring(&[[2.0, -2.0], [6.0, -2.0], [6.0, -6.0], [2.0, -2.0]]).unwrap();
        features.push_line(line).unwrap();
        let lake = Arc::new(Water::new(features, Path::new("water.wkt"), Crs::default()));
        levelled_heights(land(), &lake, 64).unwrap();
        assert_eq!(lake.report().unwrap().lakes, 1, "{line:?}");
    }
}

#[test]
fn whole_numbers_stay_whole_and_singles_single() {
    for (kind, scale) in [(SampleType::I16, 1.0), (SampleType::I16, 0.25), (SampleType::F32, 1.0)] {
        let mut land = Land::new(40, 9, |col, _| scale * (40.0 - f64::from(col / 7)));
        (land.info.sample_type, land.info.scale) = (kind, scale);
        let info = land.info.clone();
        let river = [box_of([2.0, 3.0], [37.0, 5.0])];
        let all = water(&info, &river, &[vec![[2.0, 4.0], [37.0, 4.0]]]);
        for height in levelled_heights(land, &all, 64).unwrap() {
            let is_right = match kind {
                SampleType::F32 => f64::from(height as f32) == height,
                _ => (height / scale).fract() == 0.0,
            };
            assert!(is_right, "{kind:?} {height}");
        }
    }
}

/// The samples of a lake, looked at one by one: even-odd on whole corners, or on the path of a side.
fn twin(polygon: &[Xy], size: [u32; 2]) -> Vec<bool> {
    let corners: Vec<_> = polygon.iter().map(|at| at.map(|c| (c + 0.5).floor() as i64)).collect();
    let sides: Vec<_> =
        corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| (*a, *b)).collect();
    let is_water = |at: [i64; 2]| {
        let on_path = sides.iter().any(|&(a, b)| SampleSegment::new(a, b).step_of(at).is_some());
        let crossings = sides.iter().filter(|&&(a, b)| {
            let [a, b] = if a[1] <= b[1] { [a, b] } else { [b, a] };
            let turn = (b[0] - a[0]) * (at[1] - a[1]) - (b[1] - a[1]) * (at[0] - a[0]);
            (a[1]..b[1]).contains(&at[1]) && turn < 0
        });
        on_path || crossings.count() % 2 == 1
    };
    let rows = 0..i64::from(size[1]);
    rows.flat_map(|row| (0..i64::from(size[0])).map(move |col| [col, row])).map(is_water).collect()
}

proptest! {
    /// Wherever corners are on the grid, its twin says what is water; nothing floats, and nothing else changes.
    #[test]
    fn water_is_where_its_twin_says_and_never_above_its_bank(
        polygon in prop::collection::vec([0.0..39.4_f64, 0.0..29.4_f64], 3..9),
        line in prop::option::of([[0.0..39.4_f64, 0.0..29.4_f64], [0.0..39.4_f64, 0.0..29.4_f64]]),
        heights in prop::collection::vec(0..40_i32, 40 * 30),
        turned in any::<bool>(), side in 3..50_u32,
    ) {
        let mut land = Land::new(40, 30, |col, row| f64::from(heights[(row * 40 + col) as usize]));
        if turned {
            land.info.transform =
                Affine { x0: 500.0, a: 3.0, b: 1.0, y0: 70.0, d: 1.0, e: -2.0 };
        }
        let before = land.heights.clone();
        let line: Vec<_> = line.into_iter().map(|line| line.to_vec()).collect();
        let all = water(&land.info, std::slice::from_ref(&polygon), &line);
        // Positions of a turned grid come back as other floats.
        let near_half = |c: f64| ((c + 0.5).fract() - 0.5).abs() > 0.499_999;
        prop_assume!(!turned || !polygon.iter().flatten().any(|&c| near_half(c)));
        let is_water = twin(&polygon, [40, 30]);
        let found = levelled_heights(land, &all, side).unwrap();
        for (i, (before, after)) in before.iter().zip(&found).enumerate() {
            if !is_water[i] {
                prop_assert_eq!(before, after);
                continue;
            }
            let (col, row) = (i as i64 % 40, i as i64 / 40);
            for (c, r) in (-1..=1).flat_map(|r| (-1..=1).map(move |c| (col + c, row + r))) {
                let beside = (r * 40 + c) as usize;
                if (0..40).contains(&c) && (0..30).contains(&r) && !is_water[beside] {
                    prop_assert!(*after <= found[beside], "{} above {}", after, found[beside]);
                }
            }
        }
        let wet = || found.iter().zip(&is_water).filter(|(_, is_water)| **is_water).map(|(z, _)| *z);
        let [low, high] = [wet().fold(f64::INFINITY, f64::min), wet().fold(f64::NEG_INFINITY, f64::max)];
        let report = all.report().unwrap();
        prop_assert_eq!(report.levels, Some([low, high]));
        prop_assert!(report.rivers == 1 || low == high, "a lake is level");
    }

    /// What lies beyond the grid does not change what is on it.
    #[test]
    fn a_part_of_a_grid_has_the_water_of_the_whole(
        polygon in prop::collection::vec([-30.0..70.0_f64, -30.0..60.0_f64], 3..8),
    ) {
        let whole = GridInfo::plain("test", 130, 120, SampleType::F32);
        let shifted: Vec<_> = polygon.iter().map(|at| at.map(|c| c + 45.0)).collect();
        let part = GridInfo::plain("test", 40, 30, SampleType::F32);
        let mask = |info: &GridInfo, polygon: &Vec<Xy>| {
            mask::WaterMask::new(&water(info, std::slice::from_ref(polygon), &[]), info)
        };
        let rect = |col, row| Rect::new(col, row, 40, 30);
        let of_whole = mask(&whole, &shifted).unwrap().rows(rect(45, 45));
        let of_part = mask(&part, &polygon).map(|mask| mask.rows(rect(0, 0)));
        let of_part = of_part.unwrap_or_else(|_| vec![Vec::new(); 30]);
        // A side that enters the grid begins at the sample nearest to where it does, so that its path may
        // lie a sample beside that of the whole side.
        for (row, (whole, part)) in of_whole.iter().zip(&of_part).enumerate() {
            for col in 0..40_u32 {
                let holds = |runs: &[crate::clip::Labelled]| runs.iter().any(|(_, cols)| cols.contains(&col));
                if holds(whole) != holds(part) {
                    let at = [f64::from(col), row as f64];
                    let near = polygon.iter().zip(polygon.iter().cycle().skip(1)).any(|(a, b)| {
                        distance_to(at, *a, *b) < 2.0
                    });
                    prop_assert!(near, "{col} {row}");
                }
            }
        }
    }

    /// Its twin looks at all segments.
    #[test]
    fn the_nearest_place_does_not_depend_on_what_was_found_last(
        lines in prop::collection::vec(prop::collection::vec([0..40_i32, 0..40_i32], 2..60), 1..6),
        at in [-10..50_i32, -10..50_i32], last in 0..100_usize,
    ) {
        let lines: Vec<Vec<Xy>> =
            lines.iter().map(|line| line.iter().map(|at| at.map(f64::from)).collect()).collect();
        let axis = axis::RiverAxis::new((0..).zip(lines.iter().map(Vec::as_slice)), 1.0);
        let count: usize = lines.iter().map(|line| line.len() - 1).sum();
        let at = at.map(f64::from);
        let mut last = last % count;
        let found = axis.nearest(at, &mut last);
        prop_assert_eq!(found, axis.nearest(at, &mut 0));
        let all = lines.iter().flat_map(|line| line.windows(2));
        let least = all.map(|pair| distance_to(at, pair[0], pair[1])).fold(f64::INFINITY, f64::min);
        let line = &lines[found.line as usize];
        let mut along = found.along;
        let mut here = line[0];
        for pair in line.windows(2) {
            let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
            here = [0, 1].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis]));
            if along <= length {
                break;
            }
            along -= length;
        }
        prop_assert!(((here[0] - at[0]).hypot(here[1] - at[1]) - least).abs() < 1e-6);
    }
}

fn distance_to(at: Xy, a: Xy, b: Xy) -> f64 {
    let on = [b[0] - a[0], b[1] - a[1]];
    let square = on[0] * on[0] + on[1] * on[1];
    let share = match square > 0.0 {
        true => (((at[0] - a[0]) * on[0] + (at[1] - a[1]) * on[1]) / square).clamp(0.0, 1.0),
        false => 0.0,
    };
    (a[0] + share * on[0] - at[0]).hypot(a[1] + share * on[1] - at[1])
}
