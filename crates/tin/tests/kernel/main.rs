//! The pure kernel against oracles: naive error checks, spade, exact areas, and itself at other
//! patch widths.

mod alike;
mod angles;
mod border;
mod breaklines;
mod fit;
mod kept;

use border::seam;
use proptest::prelude::*;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};
use terrane_base::bound::ErrorBound;
use terrane_base::geom::predicates::{Lattice, in_circle, orient};
use terrane_base::geom::{HeightQuantization, SampleSegment};
use terrane_tin::{
    HeightWindow, PatchInput, PatchMesh, PathStretch, TileInput, TileMesh, TilePosition,
    TileScratch, TileTriangle, TinSpec, mend_patch, triangulate_tile,
};

/// A grid of integer heights; voids are `None`.
#[derive(Clone, Debug, Default)]
struct Grid {
    width: u32,
    height: u32,
    z: Vec<Option<i16>>,
    /// Samples to keep, sorted.
    kept: Vec<TilePosition>,
    /// Breaklines, and the same as they lie in it.
    lines: Vec<SampleSegment>,
    stretches: Vec<PathStretch>,
}

impl Grid {
    fn at(&self, col: u32, row: u32) -> Option<i64> {
        self.z[(row * self.width + col) as usize].map(i64::from)
    }

    fn f32(&self) -> Vec<f32> {
        self.z.iter().map(|z| z.map_or(f32::NAN, f32::from)).collect()
    }

    fn is_cell(&self, col: u32, row: u32) -> bool {
        [(0, 0), (1, 0), (0, 1), (1, 1)].iter().all(|(c, r)| self.at(col + c, row + r).is_some())
    }

    fn cells(&self) -> i64 {
        let all = (0..self.height - 1).flat_map(|r| (0..self.width - 1).map(move |c| (c, r)));
        all.filter(|&(c, r)| self.is_cell(c, r)).count() as i64
    }

    /// Rolling hills with noise, `holes` of them void.
    fn hills(width: u32, height: u32, seed: u32, holes: u32) -> Self {
        let z = (0..width * height).map(|i| {
            let (col, row) = (f64::from(i % width), f64::from(i / width));
            let noise = (i ^ seed).wrapping_mul(0x9e37_79b9) >> 16;
            let hill = 90.0 * (col * 0.11 + f64::from(seed)).sin() * (row * 0.07).cos();
            let is_void = holes > 0 && (noise >> 4) % 40 < holes;
            (!is_void).then_some(hill as i16 + (noise % 7) as i16)
        });
        Self { width, height, z: z.collect(), ..Self::default() }
    }
}

fn spec(tolerance: f64) -> TinSpec {
    TinSpec {
        tolerance,
        bound: ErrorBound::Samples,
        strict: false,
        drop: true,
        fit_heights: false,
        data_dependent: false,
        min_angle: None,
        single_precision: None,
        measure: true,
    }
}

/// Triangulates columns `from ..= to` of a grid as one tile.
fn tile(grid: &Grid, from: u32, to: u32, spec: &TinSpec) -> TileMesh {
    part(grid, [from, to], [0, grid.height - 1], spec)
}

/// Triangulates columns and rows of a grid, both ends included, as one tile.
fn part(grid: &Grid, cols: [u32; 2], rows: [u32; 2], spec: &TinSpec) -> TileMesh {
    let aprons =
        |[from, to]: [u32; 2], count: u32| [u32::from(from > 0), u32::from(to + 1 < count)];
    let ([left, right], [above, below]) = (aprons(cols, grid.width), aprons(rows, grid.height));
    let (all, mut z) = (grid.f32(), Vec::new());
    for row in rows[0] - above..=rows[1] + below {
        let first = row * grid.width;
        let line = first + cols[0] - left..=first + cols[1] + right;
        z.extend_from_slice(&all[*line.start() as usize..=*line.end() as usize]);
    }
    let [width, height] =
        [cols[1] - cols[0] + 1 + left + right, rows[1] - rows[0] + 1 + above + below];
    let (kept, lines) = grid.features_in(cols, rows);
    let input = TileInput {
        heights: HeightWindow { width, height, f32: &z, f64: None },
        apron_left: left,
        apron_right: right,
        apron_above: above,
        apron_below: below,
        spacing: u32::MAX,
        kept: &kept,
        lines: &lines,
    };
    triangulate_tile(&input, spec, &mut TileScratch::default())
}

/// A tile's triangles at their place in the grid.
fn moved(triangles: &[TileTriangle], [col, row]: [u32; 2]) -> Vec<TileTriangle> {
    let shift = |p: TilePosition| TilePosition::new(p.col() + col, p.row() + row);
    triangles.iter().map(|t| TileTriangle { corners: t.corners.map(shift), ..*t }).collect()
}

fn whole(grid: &Grid, spec: &TinSpec) -> TileMesh {
    tile(grid, 0, grid.width - 1, spec)
}

/// Coarse scans of a flat land see one sample of many: each alone has to be found all the same.
#[test]
fn a_single_sample_is_found_wherever_it_is() {
    let side = 130;
    for i in 0..150 {
        let [col, row] = [37, 61].map(|step| 1 + i * step % (side - 2));
        let mut grid = Grid {
            width: side,
            height: side,
            z: vec![Some(0); (side * side) as usize],
            ..Grid::default()
        };
        grid.z[(row * side + col) as usize] = Some(3);
        let mesh = whole(&grid, &spec(2.0));
        assert!(mesh.vertices.contains(&TilePosition::new(col, row)), "column {col}, row {row}");
        check_bound(&grid, &mesh.triangles, 2, 1);
    }
}

fn lattice(p: TilePosition) -> Lattice {
    [p.col() as i32, p.row() as i32]
}

/// Largest error as an exact comparison: panics when a sample in a triangle is beyond `tolerance`
/// (an integer number of `unit`ths), or beyond what the triangle tells. Returns the samples covered.
fn check_bound(
    grid: &Grid,
    triangles: &[TileTriangle],
    tolerance: i128,
    unit: i128,
) -> BTreeSet<[i32; 2]> {
    let mut covered = BTreeSet::new();
    for triangle in triangles {
        let p = triangle.corners.map(lattice);
        let area = i128::from(orient(p[0], p[1], p[2]));
        assert!(area > 0, "{p:?} is not counter-clockwise");
        assert_eq!(
            triangle.corners.iter().min(),
            triangle.corners.first(),
            "the smallest comes first"
        );
        let z = triangle
            .corners
            .map(|c| i128::from(grid.at(c.col(), c.row()).expect("a valid vertex")));
        let range = |axis: usize| {
            p.iter().map(|q| q[axis]).min().unwrap()..=p.iter().map(|q| q[axis]).max().unwrap()
        };
        for row in range(1) {
            for col in range(0) {
                let q = [col, row];
                let w = [orient(p[1], p[2], q), orient(p[2], p[0], q), orient(p[0], p[1], q)];
                if w.iter().any(|&w| w < 0) {
                    continue;
                }
                let height =
                    i128::from(grid.at(col as u32, row as u32).expect("surface over a void"));
                let off: i128 = (0..3).map(|i| i128::from(w[i]) * (z[i] - height)).sum();
                assert!(off.abs() * unit <= tolerance * area, "sample {q:?} is too far from {p:?}");
                // Both sides are exact: the heights and areas of these grids are small.
                let told = f64::from(triangle.max_error) * area as f64;
                assert!(off.abs() as f64 <= told, "sample {q:?} is further from {p:?} than told");
                covered.insert(q);
            }
        }
    }
    covered
}

/// Twins: directed edge to opposite corner. Panics when a directed edge occurs twice.
fn edges(triangles: &[TileTriangle]) -> BTreeMap<(TilePosition, TilePosition), TilePosition> {
    let mut edges = BTreeMap::new();
    for t in triangles {
        let [a, b, c] = t.corners;
        for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert!(edges.insert((from, to), apex).is_none(), "edge {from:?} {to:?} occurs twice");
        }
    }
    edges
}

fn check_delaunay(triangles: &[TileTriangle]) {
    let edges = edges(triangles);
    for (&(a, b), &c) in &edges {
        if let Some(&d) = edges.get(&(b, a)) {
            let inside = in_circle(lattice(a), lattice(b), lattice(c), lattice(d));
            assert!(inside <= 0, "edge {:?} {:?} is not Delaunay", lattice(a), lattice(b));
        }
    }
}

/// Hands on every place where an edge crosses a line between neighbouring samples, or meets a sample: the samples
/// on both sides, and by how many `n`ths of a unit the edge is above: whole numbers throughout.
fn each_crossing(
    grid: &Grid,
    triangles: &[TileTriangle],
    mut each: impl FnMut([[i64; 2]; 2], i64, i64),
) {
    let height = |at: [i64; 2]| grid.at(at[0] as u32, at[1] as u32).expect("surface over a void");
    for (a, b) in edges(triangles).into_keys() {
        let [a, b] = [a, b].map(|end| lattice(end).map(i64::from));
        for axis in [0, 1] {
            let n = (b[axis] - a[axis]).abs();
            for line in a[axis].min(b[axis]) + 1..a[axis].max(b[axis]) {
                let k = (line - a[axis]).abs();
                let along = a[1 - axis] * (n - k) + b[1 - axis] * k;
                let (first, rest) = (along.div_euclid(n), along.rem_euclid(n));
                let sides = [first, first + i64::from(rest > 0)]
                    .map(|along| if axis == 0 { [line, along] } else { [along, line] });
                let edge = height(a) * (n - k) + height(b) * k;
                each(sides, edge - height(sides[0]) * (n - rest) - height(sides[1]) * rest, n);
            }
        }
    }
}

/// Panics when an edge is further than `tolerance` (an integer number of `unit`ths) from a line between
/// two neighbouring samples that it crosses.
fn check_between(grid: &Grid, triangles: &[TileTriangle], tolerance: i64, unit: i64) {
    each_crossing(grid, triangles, |sides, off, n| {
        assert!(off.abs() * unit <= tolerance * n, "{off} of {n} between {sides:?}");
    });
}

fn check_all(grid: &Grid, triangles: &[TileTriangle], tolerance: i128, unit: i128) {
    let covered = check_bound(grid, triangles, tolerance, unit);
    check_delaunay(triangles);
    let area: i64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.corners.map(lattice);
            orient(a, b, c)
        })
        .sum();
    assert_eq!(area, 2 * grid.cells(), "the mesh does not cover the surface");
    for row in 0..grid.height - 1 {
        for col in (0..grid.width - 1).filter(|&col| grid.is_cell(col, row)) {
            assert!(
                covered.contains(&[col as i32, row as i32]),
                "sample {col},{row} is not covered"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]
    #[test]
    fn every_sample_is_within_the_tolerance(
        width in 2_u32..40, height in 2_u32..40, seed in 0_u32..1000, holes in 0_u32..6,
        quarters in 0_i32..60, strict: bool, drop: bool, of_surface: bool
    ) {
        let grid = Grid::hills(width, height, seed, holes);
        let bound = ErrorBound::ALL[usize::from(of_surface)];
        let spec = TinSpec { strict, drop, bound, ..spec(f64::from(quarters) / 4.0) };
        let mesh = whole(&grid, &spec);
        if of_surface {
            check_between(&grid, &mesh.triangles, quarters.into(), 4);
        }
        check_all(&grid, &mesh.triangles, quarters.into(), 4);
        let largest = mesh.triangles.iter().fold(0.0_f32, |most, t| most.max(t.max_error));
        prop_assert!(f64::from(largest) <= spec.tolerance);
    }

    #[test]
    fn edges_are_those_of_spade(width in 3_u32..60, height in 3_u32..60, seed in 0_u32..1000) {
        let grid = Grid::hills(width, height, seed, 0);
        let mesh = whole(&grid, &spec(6.0));
        let mut spade = DelaunayTriangulation::<Point2<f64>>::new();
        for p in &mesh.vertices {
            spade.insert(Point2::new(p.col().into(), p.row().into())).unwrap();
        }
        let position = |p: Point2<f64>| TilePosition::new(p.x as u32, p.y as u32);
        let theirs: BTreeSet<(TilePosition, TilePosition)> = spade.directed_edges()
            .map(|e| (position(e.from().position()), position(e.to().position()))).collect();
        let ours = edges(&mesh.triangles);
        for (&(a, b), &c) in &ours {
            let Some(&d) = ours.get(&(b, a)) else { continue };
            if in_circle(lattice(a), lattice(b), lattice(c), lattice(d)) < 0 {
                prop_assert!(theirs.contains(&(a, b)), "{:?} {:?}", lattice(a), lattice(b));
            }
        }
        prop_assert_eq!(theirs.len() / 2, spade.num_undirected_edges());
        prop_assert_eq!(mesh.triangles.len(), spade.num_inner_faces());
    }

    #[test]
    fn two_tiles_mend_into_one_mesh(
        seed in 0_u32..1000, holes in 0_u32..3, half in 8_u32..40, height in 2_u32..50,
        tolerance in 0_i32..20, of_surface: bool
    ) {
        let grid = Grid::hills(2 * half + 1, height, seed, holes);
        let spec = TinSpec { bound: ErrorBound::ALL[usize::from(of_surface)], ..spec(tolerance.into()) };
        for reach in [half, half / 2, 4, 0] {
            let (mended, is_done) = mend(&grid, half, &spec, reach);
            if is_done {
                check_all(&grid, &mended, tolerance.into(), 1);
                if of_surface {
                    check_between(&grid, &mended, tolerance.into(), 1);
                }
            }
            prop_assert!(is_done || reach < half);
        }
    }
}

/// Two tiles that meet at column `half`, and the patch of the triangles that come within `reach` of
/// it: all triangles in grid positions, and whether those left out agree with the patch, which had no more
/// to mend between samples.
fn mend(grid: &Grid, half: u32, spec: &TinSpec, reach: u32) -> (Vec<TileTriangle>, bool) {
    let left = tile(grid, 0, half, spec).triangles;
    let right = moved(&tile(grid, half, 2 * half, spec).triangles, [half, 0]);
    let all = left.into_iter().chain(right);
    let band = half - reach..=half + reach;
    let (inside, mut mended): (Vec<_>, Vec<_>) = all.partition(|t| {
        let cols = t.corners.map(|p| p.col());
        *band.start() <= cols.into_iter().max().unwrap()
            && cols.into_iter().min().unwrap() <= *band.end()
    });
    let z = grid.f32();
    let patch = mend_patch(&seam(grid, &z, half, &inside), spec, &mut TileScratch::default());
    let beyond = edges(&mended);
    let agrees = |&[a, b, c]: &[TilePosition; 3]| {
        let disagrees = |&d| in_circle(lattice(a), lattice(b), lattice(c), lattice(d)) > 0;
        !beyond.get(&(b, a)).is_some_and(disagrees)
    };
    let is_delaunay = patch.border.iter().all(agrees);
    mended.extend(&patch.triangles);
    (mended, is_delaunay && patch.left.is_empty())
}

#[test]
fn narrow_patches_suffice_on_rough_ground() {
    let grid = Grid::hills(257, 60, 3, 0);
    let (_, is_delaunay) = mend(&grid, 128, &spec(2.0), 16);
    assert!(is_delaunay);
}

#[test]
fn adaptive_strides_need_no_more_vertices_than_strict_greedy() {
    let grid = Grid::hills(257, 257, 11, 0);
    for tolerance in [3.0, 4.0, 8.0] {
        let greedy = TinSpec { drop: false, ..spec(tolerance) };
        let adaptive = whole(&grid, &greedy).vertices.len();
        let strict = whole(&grid, &TinSpec { strict: true, ..greedy }).vertices.len();
        assert!(adaptive as f64 <= 1.07 * strict as f64, "{adaptive} against {strict}");
    }
}

/// Samples of a tile of 64 by 48 cells that begins with posts, and its triangles.
fn with_posts(height: impl Fn(u32, u32) -> f32, spacing: u32, spec: &TinSpec) -> TileMesh {
    let z: Vec<f32> = (0..65 * 49).map(|i| height(i % 65, i / 65)).collect();
    let heights = HeightWindow { width: 65, height: 49, f32: &z, f64: None };
    let input = TileInput { spacing, ..TileInput::alone(heights) };
    triangulate_tile(&input, spec, &mut TileScratch::default())
}

/// The centre of the circle around a triangle, and its squared radius.
fn circle(triangle: &TileTriangle) -> ([f64; 2], f64) {
    let [a, b, c] = triangle.corners.map(|p| lattice(p).map(f64::from));
    let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
    let double = 2.0 * (u[0] * v[1] - u[1] * v[0]);
    let square = |w: [f64; 2]| w[0] * w[0] + w[1] * w[1];
    let x = (v[1] * square(u) - u[1] * square(v)) / double;
    let y = (u[0] * square(v) - v[0] * square(u)) / double;
    ([a[0] + x, a[1] + y], x * x + y * y)
}

/// A cone with a broken surface.
fn cone(col: u32, row: u32) -> f32 {
    let far = (f64::from(col) - 30.0).hypot(f64::from(row) - 20.0);
    (90.0 - 2.0 * far) as f32 + ((col * 7919 + row * 104_729) % 13) as f32
}

#[test]
fn no_circle_is_wider_than_the_diagonal_of_a_square_of_posts() {
    for (spacing, tolerance) in [(8, 1.0), (16, 5.0), (16, 30.0), (48, 5.0)] {
        let mesh = with_posts(cone, spacing, &spec(tolerance));
        // A circle around a place beyond the tile need not hold a post.
        let inside =
            |&([x, y], _): &([f64; 2], f64)| (0.0..=64.0).contains(&x) && (0.0..=48.0).contains(&y);
        let circles = mesh.triangles.iter().map(circle).filter(inside);
        let widest = circles.map(|(_, square)| square).fold(0.0, f64::max);
        let most = f64::from(spacing * spacing) / 2.0;
        assert!(widest <= most * (1.0 + 1e-9), "{spacing} {tolerance}: {widest}");
    }
}

#[test]
fn flat_ground_keeps_its_posts_and_vertices_between_them_may_go() {
    for (spacing, posts) in [(16, 5 * 4), (8, 9 * 7), (64, 2 * 2)] {
        for tolerance in [0.0, 5.0] {
            let flat = with_posts(|_, _| 7.0, spacing, &spec(tolerance));
            assert_eq!(flat.vertices.len(), posts, "{spacing}");
        }
    }
    let count = |drop| with_posts(cone, 16, &TinSpec { drop, ..spec(5.0) }).vertices.len();
    let (all, fewer) = (count(false), count(true));
    assert!(fewer as f64 <= 0.95 * all as f64, "{fewer} of {all}");
}

/// Of two samples as far from the chord the first is kept, and then the second is near enough.
#[test]
fn lines_of_a_rim_are_divided_at_the_first_of_equals() {
    let z = [0, 5, 0, 5, 0].map(Some);
    let grid = Grid { width: 5, height: 2, z: [z, [Some(0); 5]].concat(), ..Grid::default() };
    let mesh = whole(&grid, &spec(4.0));
    let top: Vec<u32> = mesh.vertices.iter().filter(|p| p.row() == 0).map(|p| p.col()).collect();
    assert_eq!(top, [0, 1, 4]);
}

#[test]
fn isolated_samples_touch_no_cell() {
    for (holes, half) in [(0, 9), (2, 9), (12, 14), (30, 20)] {
        let grid = Grid::hills(2 * half + 1, 23, 5, holes);
        let all = grid.z.iter().flatten().count() as u64;
        let mesh = whole(&grid, &spec(9.0));
        assert_eq!(mesh.valid, all);
        let alone = |at: &u32| {
            let (col, row) = (at % grid.width, at / grid.width);
            let near = |at: u32, last: u32| at.saturating_sub(1)..=at.min(last - 1);
            let rows = near(row, grid.height - 1);
            let mut cells =
                rows.flat_map(|row| near(col, grid.width - 1).map(move |col| (col, row)));
            grid.at(col, row).is_some() && !cells.any(|(col, row)| grid.is_cell(col, row))
        };
        assert_eq!(mesh.isolated, (0..grid.width * grid.height).filter(alone).count() as u64);
    }
}

#[test]
fn dropping_saves_vertices() {
    let grid = Grid::hills(257, 257, 5, 0);
    let all = whole(&grid, &TinSpec { drop: false, ..spec(6.0) }).vertices.len();
    let fewer = whole(&grid, &spec(6.0)).vertices.len();
    assert!(fewer as f64 <= 0.9 * all as f64, "{fewer} of {all}");
}

/// The sum of the squares of the errors of all samples, by looking at every sample and triangle.
fn sum_of_squares(grid: &Grid, triangles: &[TileTriangle]) -> f64 {
    let mut errors = BTreeMap::new();
    for triangle in triangles {
        let p = triangle.corners.map(lattice);
        let area = orient(p[0], p[1], p[2]) as f64;
        let z = triangle.corners.map(|c| grid.at(c.col(), c.row()).unwrap() as f64);
        for (row, col) in
            (0..grid.height).flat_map(|row| (0..grid.width).map(move |col| (row, col)))
        {
            let q = [col as i32, row as i32];
            let w = [orient(p[1], p[2], q), orient(p[2], p[0], q), orient(p[0], p[1], q)];
            if w.iter().all(|&w| w >= 0) {
                let plane: f64 = (0..3).map(|i| w[i] as f64 * z[i]).sum::<f64>() / area;
                errors.insert(q, plane - grid.at(col, row).unwrap() as f64);
            }
        }
    }
    errors.values().map(|e| e * e).sum()
}

#[test]
fn the_sum_of_squares_counts_every_sample_once() {
    for (holes, tolerance) in [(0, 9.0), (2, 9.0), (1, 20.0)] {
        let (grid, spec) = (Grid::hills(65, 50, 8, holes), spec(tolerance));
        let quarter = |cols: [u32; 2], rows: [u32; 2]| {
            moved(&part(&grid, cols, rows, &spec).triangles, [cols[0], rows[0]])
        };
        let halves =
            [[0, 21], [21, 49]].map(|rows| [quarter([0, 30], rows), quarter([30, 64], rows)]);
        for (name, triangles) in [
            ("one tile", whole(&grid, &spec).triangles),
            ("four tiles", halves.concat().concat()),
            ("two tiles mended", mend(&grid, 32, &spec, 12).0),
            ("two tiles all of which is mended", mend(&grid, 32, &spec, 32).0),
        ] {
            let expected = sum_of_squares(&grid, &triangles);
            let found: f64 = triangles.iter().map(|t| f64::from(t.square_sum)).sum();
            assert!((found - expected).abs() < 1e-4 * expected, "{name}: {found} {expected}");
        }
    }
}

/// Both sides of a rim have the same vertices, and no sample is counted by two tiles.
#[test]
fn four_tiles_have_their_rims_in_common_and_count_samples_once() {
    for (holes, col, row) in [(0, 9, 8), (2, 9, 11), (12, 14, 10), (30, 20, 5)] {
        let (grid, spec) = (Grid::hills(2 * col + 1, 23, 5, holes), spec(4.0));
        let (cols, rows) = ([[0, col], [col, 2 * col]], [[0, row], [row, 22]]);
        let tiles = rows.map(|rows| cols.map(|cols| part(&grid, cols, rows, &spec)));
        let counts = |mesh: &TileMesh| [mesh.valid, mesh.isolated];
        let sum = |i: usize| tiles.iter().flatten().map(|mesh| counts(mesh)[i]).sum::<u64>();
        assert_eq!([sum(0), sum(1)], counts(&whole(&grid, &spec)), "{holes}");
        if holes > 0 {
            // A tile does not list what only the other side's triangles use.
            continue;
        }
        let on = |mesh: &TileMesh, is: &dyn Fn(&TilePosition) -> Option<u32>| -> Vec<u32> {
            mesh.vertices.iter().filter_map(is).collect()
        };
        for [left, right] in &tiles {
            let ends = on(left, &|p| (p.col() == col).then_some(p.row()));
            assert_eq!(ends, on(right, &|p| (p.col() == 0).then_some(p.row())), "{holes}");
        }
        let [above, below] = &tiles;
        for (above, below) in above.iter().zip(below) {
            let ends = on(above, &|p| (p.row() == row).then_some(p.col()));
            assert_eq!(ends, on(below, &|p| (p.row() == 0).then_some(p.col())), "{holes}");
        }
    }
}

#[test]
fn extremes_of_shape_and_content() {
    let flat = Grid { width: 33, height: 20, z: vec![Some(7); 660], ..Grid::default() };
    assert_eq!(whole(&flat, &spec(0.0)).triangles.len(), 2);
    let two = Grid {
        width: 2,
        height: 2,
        z: vec![Some(1), Some(2), Some(3), Some(9)],
        ..Grid::default()
    };
    assert_eq!(whole(&two, &spec(0.0)).triangles.len(), 2);
    let void = Grid { width: 9, height: 9, z: vec![None; 81], ..Grid::default() };
    assert!(whole(&void, &spec(1.0)).triangles.is_empty());
    let mut single = void.clone();
    single.z[40] = Some(5);
    let mesh = whole(&single, &spec(1.0));
    assert_eq!((mesh.triangles.len(), mesh.valid, mesh.isolated), (0, 1, 1));
}

/// Heights that no `f32` holds: the bound must hold in `f64`, for vertices as they are written.
#[test]
fn the_bound_holds_for_double_precision_heights() {
    let (width, height) = (90, 70);
    let z: Vec<f64> = (0..width * height)
        .map(|i| 5e5 + f64::from(i % width).sin() + 0.7 * f64::from(i / width * 3).cos() / 3.0)
        .collect();
    let rounded: Vec<f32> = z.iter().map(|&z| z as f32).collect();
    let heights = HeightWindow { width, height, f32: &rounded, f64: Some(&z) };
    let feet = HeightQuantization { origin: 5e5, scale: 0.3048 };
    let about = [0.0, 5e5].map(HeightQuantization::about);
    // The f32 heights are off by 0.0156 at most: little less than the smaller tolerance.
    let kinds = [None, Some(about[0]), Some(about[1]), Some(feet)].into_iter().flat_map(|stored| {
        [(0.25, false), (0.25, true), (0.02, true), (0.016, true)].map(|kind| (stored, kind))
    });
    for (single_precision, (tolerance, fit)) in kinds {
        let spec = TinSpec { single_precision, fit_heights: fit, ..spec(tolerance) };
        let mesh = triangulate_tile(&TileInput::alone(heights), &spec, &mut TileScratch::default());
        let written = |p: TilePosition| {
            let at = mesh.vertices.binary_search(&p).expect("a listed vertex");
            mesh.heights[at]
        };
        if let Some(rounding) = single_precision {
            assert!(mesh.heights.iter().all(|&z| rounding.apply(z) == z), "written and read back");
        }
        assert!(tolerance < 0.25 || mesh.vertices.len() < z.len() * 9 / 10);
        for triangle in &mesh.triangles {
            let p = triangle.corners.map(lattice);
            let area = orient(p[0], p[1], p[2]) as f64;
            let corners = triangle.corners.map(written);
            for (row, col) in (0..70).flat_map(|row| (0..90).map(move |col| (row, col))) {
                let q = [col, row];
                let w = [orient(p[1], p[2], q), orient(p[2], p[0], q), orient(p[0], p[1], q)];
                if w.iter().all(|&w| w >= 0) {
                    let plane: f64 = (0..3).map(|i| w[i] as f64 / area * corners[i]).sum();
                    let error = (plane - z[(row * 90 + col) as usize]).abs();
                    assert!(error <= tolerance + 1e-9, "{error} at {q:?}, {spec:?}");
                }
            }
        }
    }
}
