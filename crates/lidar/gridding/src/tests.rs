//! Blocks, axes and scattered points against slow twins: statistics from all heights of a cell, cells
//! and distances in whole numbers.

use proptest::prelude::*;

use super::*;
use terrane_base::geom::{Affine, Point, PointFrame, Rect};

const UNITS: CellUnits = CellUnits { scale: 0.25, offset: -7.0, area: 3.0 };
const OWN: &str = "count,density,min,max,range,mean,std,std:ddof=1,median,p95,p0,p100,tin,natural";

fn recipe(list: &str, around: bool) -> StatisticRecipe {
    StatisticRecipe::new(
        &parse_list(list).unwrap(),
        &StatisticDefaults { radius: 2.0, power: 1.0, around },
    )
}

/// A statistic of the heights of a cell.
fn plain(statistic: Statistic, steps: &[i32]) -> f64 {
    let mut z: Vec<f64> =
        steps.iter().map(|z| f64::from(*z) * UNITS.scale + UNITS.offset).collect();
    z.sort_by(f64::total_cmp);
    let n = z.len() as f64;
    let mean = z.iter().sum::<f64>() / n;
    let Some((low, high)) = z.first().zip(z.last()) else {
        return if statistic.counts() { 0.0 } else { f64::NAN };
    };
    let at_rank = |rank: f64| {
        let place = rank / 100.0 * (n - 1.0);
        let [low, high] = [place.floor(), place.ceil()].map(|at| z[at as usize]);
        low + (high - low) * place.fract()
    };
    match statistic.name() {
        "count" => n,
        "density" => n / UNITS.area,
        "min" => *low,
        "max" => *high,
        "range" => high - low,
        "mean" => mean,
        "std" => {
            let left = n - statistic.parameter("ddof").unwrap_or(0.0);
            let sum: f64 = z.iter().map(|z| (z - mean).powi(2)).sum();
            if left > 0.0 { (sum / left).sqrt() } else { f64::NAN }
        }
        _ => statistic.rank().map_or(f64::NAN, at_rank),
    }
}

fn to(block: &mut CellBlock) -> BlockTarget<'_> {
    BlockTarget { block, region: 0, reals: &[] }
}

fn near(a: f64, b: f64) -> bool {
    a.is_nan() && b.is_nan() || (a - b).abs() <= 1e-9 * b.abs().max(1.0)
}

/// A block of the same content, by way of its bytes.
fn reread(recipe: &StatisticRecipe, block: &CellBlock, cells: usize) -> CellBlock {
    let mut copy = CellBlock::new(recipe, cells);
    let parts = block.parts();
    let lengths: Vec<usize> = parts.iter().map(|part| part.len()).collect();
    for (to, from) in copy.parts_mut(&lengths).into_iter().zip(parts) {
        to.copy_from_slice(from);
    }
    copy
}

proptest! {
    #[test]
    fn statistics_are_those_of_all_heights(
        points in prop::collection::vec((0..5_u32, -1000..1000_i32, 0..3_usize), 0..60),
        around: bool,
    ) {
        let recipe = recipe(OWN, around);
        let mut blocks = [(); 3].map(|()| CellBlock::new(&recipe, 6));
        for &(cell, z, division) in &points {
            let hits = CellHits { cells: &[cell], points: &[Point::new(1, 2, z)], squares: &[], unit: 1.0, reals: &[] };
            blocks[division].add(0, hits).unwrap();
        }
        let fixed = 6 * recipe.bytes_per_cell();
        prop_assert!(blocks[0].memory_use() >= fixed + blocks[0].parts().last().unwrap().len());
        let mut sum = reread(&recipe, &blocks[0], 6);
        for other in &blocks[1..] {
            sum.fold(&reread(&recipe, other, 6)).unwrap();
        }
        let bytes: usize = sum.parts().iter().map(|part| part.len()).sum();
        prop_assert_eq!(bytes, fixed + points.len() * recipe.bytes_per_point());
        sum.settle();
        for at in 0..6 {
            let own = points.iter().filter(|point| point.0 == at);
            let heights: Vec<i32> = own.map(|point| point.1).collect();
            for band in recipe.bands() {
                let found = sum.value(band, at as usize, &UNITS);
                let expected = plain(band.statistic, &heights);
                prop_assert!(near(found, expected), "{}: {found} {expected}", band.label);
            }
        }
    }
}

#[test]
fn blocks_of_other_recipes_and_other_regions_are_kept_apart() {
    let [mut low, again, high] =
        ["min", "min", "max"].map(|list| CellBlock::new(&recipe(list, false), 1));
    assert!(low.fold(&again).is_ok() && low.fold(&high).is_err());
    // Regions: the cell, then the disc.
    let both = recipe("count,nearest,idw", false);
    let mut block = CellBlock::new(&both, 1);
    let hits = CellHits {
        cells: &[0],
        points: &[Point::new(0, 0, 8)],
        squares: &[4],
        unit: 1.0,
        reals: &[],
    };
    block.add(0, hits).unwrap();
    let values = |block: &CellBlock| [0, 1, 2].map(|i| block.value(&both.bands()[i], 0, &UNITS));
    let [count, nearest, idw] = values(&block);
    assert!(count == 1.0 && nearest.is_nan() && idw.is_nan());
    block.add(1, hits).unwrap();
    assert_eq!(values(&block), [1.0, -5.0, -5.0]);
    assert_eq!(block.memory_use(), both.bytes_per_cell());
}

/// Steps, offset, anchor and side of cells in 10^-6, on both axes.
#[derive(Clone, Copy, Debug)]
struct Whole {
    scale: i64,
    offset: i64,
    anchor: i64,
    cell: i64,
}

/// The float that is so many 10^-6.
fn world(units: i64) -> f64 {
    format!("{units}e-6").parse().unwrap()
}

impl Whole {
    fn lattice(self, edges: CellEdgeRule) -> CellLattice {
        let frame = PointFrame { scale: [world(self.scale); 3], offset: [world(self.offset); 3] };
        CellLattice::new(&frame, [world(self.anchor); 2], [world(self.cell); 2], edges)
    }

    /// From the anchor to a step.
    fn at(self, steps: i32) -> i64 {
        i64::from(steps) * self.scale + self.offset - self.anchor
    }

    fn index(self, steps: i32, upper_closed: bool) -> i64 {
        (self.at(steps) - i64::from(upper_closed)).div_euclid(self.cell)
    }

    /// Twice the distance from a step to the centre of a cell.
    fn apart(self, steps: i32, index: i64) -> i64 {
        2 * self.at(steps) - (2 * index + 1) * self.cell
    }
}

fn wholes() -> impl Iterator<Item = Whole> {
    let sides = [
        (10_000, 50_000),
        (10_000, 1_000_000),
        (10_000, 33_300),
        (10_000, 15_000),
        (30_000, 70_000),
        (1_000_000, 1_000_000),
        (1_000_000, 300_000),
        (7, 1),
        (250, 999_999),
    ];
    let places = [(0, 0), (0, 5_000), (123_450_000, 0), (-98_765, 1_234_567)];
    sides.into_iter().flat_map(move |(scale, cell)| {
        places.map(|(offset, anchor)| Whole { scale, offset, anchor, cell })
    })
}

#[test]
fn cells_and_distances_are_those_in_whole_numbers() {
    for whole in wholes() {
        for edges in [CellEdgeRule::LowerClosed, CellEdgeRule::NorthClosed] {
            let CellLattice { x, y } = whole.lattice(edges);
            let (first, count) = (whole.index(-40, false), 60);
            let (x, y) = (x.covering(first, count), y.covering(first, count));
            let lattice = CellLattice { x, y };
            let unit = lattice.unit(world(10 * whole.cell));
            let steps = (-300..300).chain([-1 << 29, i32::MIN, i32::MAX, 1 << 29]);
            let [mut cols, mut rows] = [Vec::new(), Vec::new()];
            x.numbers(steps.clone(), &mut cols);
            y.numbers(steps.clone(), &mut rows);
            for (i, steps) in steps.enumerate() {
                let [col, row] =
                    [false, edges == CellEdgeRule::NorthClosed].map(|c| whole.index(steps, c));
                assert_eq!([x.index(steps), y.index(steps)], [col, row], "{whole:?} {steps}");
                let [east, south] = [col - first, i64::from(count) - 1 - (row - first)]
                    .map(|number| number.clamp(i32::MIN.into(), i32::MAX.into()) as i32);
                assert_eq!([cols[i], rows[i]], [east, south], "{whole:?} {steps}");
                let mut squares = Vec::new();
                let first_row = i64::from(south);
                y.squares(steps, first_row..first_row + 2, unit, &mut squares);
                for (k, square) in (0..).zip(squares).filter(|_| steps.unsigned_abs() < 300) {
                    let apart = world(whole.apart(steps, row - k)) / 2.0;
                    let found = (square as f64).sqrt() * unit.size;
                    assert!(
                        (found - apart.abs()).abs() < 1e-12,
                        "{whole:?} {steps}: {found} {apart}"
                    );
                }
            }
            let centre = world(whole.anchor) + (first as f64 + 0.5) * world(whole.cell);
            assert!(near(x.world_centre(0), centre) && near(y.world_centre(59), centre));
            let Affine { x0, a, b, y0, d, e } = lattice.transform();
            let cell = world(whole.cell);
            assert_eq!([x0, a, b, y0], [x.world_centre(0), cell, 0.0, y.world_centre(0)]);
            assert_eq!((d, e, lattice.area()), (0.0, -cell, cell * cell));
            assert_eq!((lattice.size(), y.first()), ((count, count), first));
        }
    }
}

#[test]
fn points_are_scattered_to_the_cells_around_them() {
    let mut hits = 0;
    for (n, whole) in (0..).zip(wholes().filter(|whole| whole.cell >= 15_000)) {
        // Window in a grid of 40 x 40 cells; a part of the block's row lies beyond the window.
        let (window, stride) = (Rect::new(9, 13, 14, 11), 17);
        let [west, south] = [whole.index(-20, false); 2];
        let CellLattice { x, y } = whole.lattice(CellEdgeRule::LowerClosed);
        let lattice = CellLattice { x: x.covering(west, 40), y: y.covering(south, 40) };
        for (radius, power) in [(5, 1.0), (10, 2.0), (25, 0.5), (43, 3.0), (61, 1.3)] {
            let radius = whole.cell * radius / 10;
            let points = points(n, whole, 90);
            let list = format!("idw:radius={0},power={power},nearest:radius={0}", world(radius));
            let recipe = recipe(&list, false);
            assert_eq!(
                recipe.regions_of(0).collect::<Vec<_>>(),
                [(0, CellNeighborhood::Disc(world(radius)))]
            );
            let mut block = CellBlock::new(&recipe, (stride * window.height) as usize);
            let mut scatter = DiscScatter::new(&lattice, world(radius));
            // A cell that no point can be nearer to than the radius, but may be as near, is either.
            let reach = |twice: i64| (twice / whole.cell + 1) / 2;
            let (least, most) = (reach(2 * radius - 1), reach(2 * radius));
            let (across, down) = scatter.reach();
            assert!(across == down && (least..=most).contains(&across), "{whole:?} {across}");
            let places: Vec<(i32, i32)> = points
                .iter()
                .map(|p| (lattice.x.index(p.x) - west, 39 + south - lattice.y.index(p.y)))
                .map(|(col, row)| (col as i32, row as i32))
                .collect();
            scatter.add(&lattice, window, stride, &points, &places, to(&mut block)).unwrap();
            for at in 0..stride * window.height {
                let (col, row) = (at % stride, at / stride);
                let [east, north] =
                    [west + i64::from(window.col + col), 39 + south - i64::from(window.row + row)];
                let square = |p: &Point| {
                    [whole.apart(p.x, east), whole.apart(p.y, north)].map(|d| i128::from(d).pow(2))
                };
                let limit = i128::from(2 * radius).pow(2);
                let mut found: Vec<(i128, Point)> =
                    points.iter().map(|p| (square(p).iter().sum(), *p)).collect();
                found.retain(|(square, _)| *square < limit && col < window.width);
                found.sort();
                hits += found.len();
                let expected =
                    [weighted(&found, power), found.first().map(|(_, p)| f64::from(p.z))];
                for (band, expected) in recipe.bands().iter().zip(expected) {
                    let expected = expected.map_or(f64::NAN, |z| z * UNITS.scale + UNITS.offset);
                    let value = block.value(band, at as usize, &UNITS);
                    let is_near = value.is_nan() && expected.is_nan()
                        || (value - expected).abs() < 1e-5 * expected.abs().max(1.0);
                    assert!(is_near, "{whole:?} {at} {}: {value} {expected}", band.label);
                }
            }
        }
    }
    assert!(hits > 50_000, "{hits}");
}

/// Mean of the heights of points, nearest first; lowest of those at the centre, if there are any.
fn weighted(found: &[(i128, Point)], power: f64) -> Option<f64> {
    let (nearest, point) = found.first()?;
    if *nearest == 0 {
        return Some(point.z.into());
    }
    let weight = |square: i128| (square as f64).powf(-power / 2.0);
    let sum: f64 = found.iter().map(|(square, p)| weight(*square) * f64::from(p.z)).sum();
    Some(sum / found.iter().map(|(square, _)| weight(*square)).sum::<f64>())
}

/// Points over some 40 cells, some on centres of cells and of equal distance.
fn points(seed: u64, whole: Whole, count: usize) -> Vec<Point> {
    let mut state = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut next = |below: i64| {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        ((state >> 33) % below as u64) as i32
    };
    let side = 40 * whole.cell / whole.scale;
    let mut points: Vec<Point> = (0..count)
        .map(|_| Point::new(next(side) - 20, next(side) - 20, next(4000) - 2000))
        .collect();
    let half = (whole.cell / whole.scale / 2).max(1) as i32;
    points.iter_mut().step_by(3).for_each(|p| (p.x, p.y) = (p.x / half * half, p.y / half * half));
    let again = points[..9].iter().map(|p| Point { z: p.z - 1, ..*p }).collect::<Vec<_>>();
    points.extend(again);
    points
}

#[test]
fn distances_of_too_many_digits_are_rounded_to_small_units() {
    let third = 1.0 / 3.0;
    let mut exact = Vec::new();
    for (scale, cell) in [(third, 7.0 * third), (third, 0.7), (0.1 + third, 1e3 * third)] {
        let frame = PointFrame { scale: [scale; 3], offset: [0.1 + third; 3] };
        let lattice = CellLattice::new(&frame, [-0.4; 2], [cell; 2], CellEdgeRule::LowerClosed);
        let (reach, x) = (3e4 * cell, lattice.x.covering(-50, 100));
        exact.push(x.is_exact());
        let unit = lattice.unit(reach);
        assert!(unit.size > 0.0 && unit.size * 1e14 < reach);
        for radius in [reach, reach / 7.0, cell] {
            let units = (unit.square(radius) as f64).sqrt();
            assert!((0.0..1.001).contains(&(units - radius / unit.size)), "{scale} {radius}");
        }
        for (steps, number) in [(-77, 3), (0, 50), (1, 50), (1234, 99), (-9999, 0)] {
            let mut squares = Vec::new();
            x.squares(steps, number..number + 1, unit, &mut squares);
            let centre = (number as f64 - 49.5) * cell - 0.4;
            let apart = f64::from(steps) * scale + 0.1 + third - centre;
            let found = (squares[0] as f64).sqrt() * unit.size;
            let slack = unit.size + 1e-9;
            assert!((found - apart.abs()).abs() < slack, "{scale} {steps}: {found} {apart}");
        }
    }
    assert_eq!(exact, [true, false, false]);
}

proptest! {
    #[test]
    fn what_is_around_is_folded_as_it_is_added(
        points in prop::collection::vec((0..3_u32, -99..99_i32, 0..9_u128, 0..2_usize), 1..40),
    ) {
        let recipe = recipe("idw:power=0.7,nearest,count,range,std", true);
        let mut blocks = [(); 3].map(|()| CellBlock::new(&recipe, 3));
        for &(cell, z, square, division) in &points {
            let points = &[Point::new(z % 5, 2, z)];
            let hits = CellHits { cells: &[cell], points, squares: &[square], unit: 0.5, reals: &[] };
            blocks[division].add(0, hits).unwrap();
            blocks[2].add(0, hits).unwrap();
        }
        blocks[1] = reread(&recipe, &blocks[1], 3);
        let (parts, whole) = blocks.split_at_mut(2);
        let (one, other) = parts.split_at_mut(1);
        one[0].fold(&other[0]).unwrap();
        for (band, at) in recipe.bands().iter().flat_map(|b| (0..3).map(move |at| (b, at))) {
            let values = [&one[0], &whole[0]].map(|block| block.value(band, at, &UNITS).to_bits());
            prop_assert_eq!(values[0], values[1], "{}", band.label);
        }
    }
}

#[test]
fn bands_tell_what_they_are_made_of() {
    for (list, counts, triangulated) in [
        ("count", true, false),
        ("density", true, false),
        ("min", false, false),
        ("tin", false, true),
        ("natural", false, true),
        ("idw", false, false),
    ] {
        let recipe = recipe(list, false);
        let band = &recipe.bands()[0];
        assert_eq!((band.counts(), band.is_triangulated()), (counts, triangulated), "{list}");
        assert_eq!(band.statistic.is_height(), !counts, "{list}");
        assert_eq!([recipe.is_empty(), recipe.triangulates()], [triangulated; 2], "{list}");
    }
}

#[test]
fn room_for_heights_is_held_until_it_is_given_back() {
    let median = recipe("median", false);
    let mut block = CellBlock::new(&median, 1);
    let hits = CellHits {
        cells: &[0; 100],
        points: &[Point::new(0, 0, 1); 100],
        squares: &[],
        unit: 1.0,
        reals: &[],
    };
    block.add(0, hits).unwrap();
    block.parts_mut(&[0]);
    assert!(block.memory_use() >= 100 * median.bytes_per_point());
    assert!(block.parts()[0].is_empty() && block.value(&median.bands()[0], 0, &UNITS).is_nan());
}

/// More hits than are handed over at once, in rows of many cells and of one.
#[test]
fn no_hit_is_lost_however_many_there_are() {
    let frame = PointFrame { scale: [0.01; 3], offset: [0.0; 3] };
    let lattice = CellLattice::new(&frame, [0.0; 2], [1.0; 2], CellEdgeRule::LowerClosed);
    let lattice = CellLattice { x: lattice.x.covering(0, 40), y: lattice.y.covering(0, 40) };
    let recipe = recipe("count", true);
    for (width, height) in [(1, 1), (1, 30), (37, 30), (30, 1)] {
        let window = Rect::new(2, 5, width, height);
        // All are in one cell, some of whose neighbours are nearer than the radius to them.
        let points = vec![Point::new(250, 3450, 7); 5_000];
        let mut block = CellBlock::new(&recipe, (width * height) as usize);
        let mut scatter = DiscScatter::new(&lattice, 2.0);
        let places = vec![(2, 5); points.len()];
        scatter.add(&lattice, window, width, &points, &places, to(&mut block)).unwrap();
        for at in 0..width * height {
            let (east, south) = (f64::from(at % width), f64::from(at / width));
            let expected = if east.hypot(south) < 2.0 { 5_000.0 } else { 0.0 };
            let found = block.value(&recipe.bands()[0], at as usize, &UNITS);
            assert_eq!(found, expected, "{width} {height} {at}");
        }
    }
}

#[test]
fn the_lowest_of_the_points_at_a_centre_is_its_height() {
    let recipe = recipe("idw", false);
    let mut block = CellBlock::new(&recipe, 2);
    let z = [90, -30, 50, 70, 80].map(|z| Point::new(0, 0, z));
    let hits = CellHits {
        cells: &[0, 0, 0, 1, 1],
        points: &z,
        squares: &[0, 0, 1, 1, 1],
        unit: 1e-3,
        reals: &[],
    };
    block.add(0, hits).unwrap();
    let values = [0, 1].map(|at| block.value(&recipe.bands()[0], at, &UNITS));
    assert_eq!(values, [-30.0 * UNITS.scale + UNITS.offset, 75.0 * UNITS.scale + UNITS.offset]);
}

#[test]
fn a_cell_with_more_points_than_can_be_counted_is_an_error() {
    let recipe = recipe("count", false);
    let full = |count: u32| {
        let mut block = CellBlock::new(&recipe, 2);
        let part = &mut block.parts_mut(&[8])[0];
        part[..4].copy_from_slice(&count.to_ne_bytes());
        block
    };
    let points = [Point::new(0, 0, 8); 2];
    for cells in [[0, 1], [1, 0]] {
        let hits = CellHits { cells: &cells, points: &points, squares: &[], unit: 1.0, reals: &[] };
        assert!(full(u32::MAX).add(0, hits).is_err(), "{cells:?}");
        assert!(full(u32::MAX - 1).add(0, hits).is_ok(), "{cells:?}");
    }
    assert!(full(u32::MAX - 5).fold(&full(6)).is_err());
    assert!(full(u32::MAX - 6).fold(&full(6)).is_ok());
}

#[test]
fn statistics_are_one_by_name_and_numbers() {
    let one = |text: &str| parse_list(text).unwrap()[0].statistic;
    for (a, b, is_same) in [
        ("min", "min", true),
        ("min", "max", false),
        ("p95", "p95", true),
        ("p95", "p90", false),
        ("idw:radius=2", "idw:radius=2", true),
        ("idw:radius=2", "idw:radius=3", false),
        ("idw:radius=2", "nearest:radius=2", false),
    ] {
        assert_eq!(one(a) == one(b), is_same, "{a} {b}");
    }
    let whole = ["count", "density", "mean"].map(|text| one(text).is_whole());
    assert_eq!(whole, [true, false, false]);
    assert_eq!(
        ["p95", "idw:radius=2", "mean"].map(|text| one(text).rank()),
        [Some(95.0), None, None]
    );
    let lacks = ["idw", "idw:radius=2", "mean"].map(|text| one(text).lacks("radius"));
    assert_eq!(lacks, [true, false, false]);
    assert!(one("idw:radius=2").lacks("power"));
}
