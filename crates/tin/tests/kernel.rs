//! The pure kernel against oracles: naive error checks, spade, exact areas, and itself at other
//! patch widths.

use proptest::prelude::*;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};
use terrane_base::geom::Rounding;
use terrane_base::geom::predicates::{Lattice, in_circle, orient};
use terrane_tin::{
    Heights, Local, PatchInput, Scratch, Spec, TileInput, TileMesh, Triangle, mend_patch,
    triangulate_tile,
};

/// A grid of integer heights; voids are `None`.
#[derive(Clone, Debug)]
struct Grid {
    width: u32,
    height: u32,
    z: Vec<Option<i16>>,
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
        Self { width, height, z: z.collect() }
    }
}

fn spec(tolerance: f64) -> Spec {
    Spec { tolerance, strict: false, drop: true, single_precision: None, measure: true }
}

/// Triangulates columns `from ..= to` of a grid as one tile.
fn tile(grid: &Grid, from: u32, to: u32, spec: &Spec) -> TileMesh {
    let (left, right) = (u32::from(from > 0), u32::from(to + 1 < grid.width));
    let all = grid.f32();
    let cols = (from - left) as usize..(to + 1 + right) as usize;
    let z: Vec<f32> =
        all.chunks(grid.width as usize).flat_map(|row| row[cols.clone()].to_vec()).collect();
    let heights = Heights { width: cols.len() as u32, height: grid.height, f32: &z, f64: None };
    let input = TileInput {
        heights,
        apron_left: left,
        apron_right: right,
        apron_above: 0,
        apron_below: 0,
        spacing: u32::MAX,
    };
    triangulate_tile(&input, spec, &mut Scratch::default())
}

fn whole(grid: &Grid, spec: &Spec) -> TileMesh {
    tile(grid, 0, grid.width - 1, spec)
}

fn lattice(p: Local) -> Lattice {
    [p.col() as i32, p.row() as i32]
}

/// Largest error as an exact comparison: panics when a sample in a triangle is beyond `tolerance`
/// (an integer number of `unit`ths), or beyond what the triangle tells. Returns the samples covered.
fn check_bound(
    grid: &Grid,
    triangles: &[Triangle],
    tolerance: i128,
    unit: i128,
) -> BTreeSet<[i32; 2]> {
    let mut covered = BTreeSet::new();
    for triangle in triangles {
        let p = triangle.corners.map(lattice);
        let area = i128::from(orient(p[0], p[1], p[2]));
        assert!(area > 0, "{p:?} is not counter-clockwise");
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
fn edges(triangles: &[Triangle]) -> BTreeMap<(Local, Local), Local> {
    let mut edges = BTreeMap::new();
    for t in triangles {
        let [a, b, c] = t.corners;
        for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert!(edges.insert((from, to), apex).is_none(), "edge {from:?} {to:?} occurs twice");
        }
    }
    edges
}

fn check_delaunay(triangles: &[Triangle]) {
    let edges = edges(triangles);
    for (&(a, b), &c) in &edges {
        if let Some(&d) = edges.get(&(b, a)) {
            let inside = in_circle(lattice(a), lattice(b), lattice(c), lattice(d));
            assert!(inside <= 0, "edge {:?} {:?} is not Delaunay", lattice(a), lattice(b));
        }
    }
}

fn check_all(grid: &Grid, triangles: &[Triangle], tolerance: i128, unit: i128) {
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
        quarters in 0_i32..60, strict: bool, drop: bool
    ) {
        let grid = Grid::hills(width, height, seed, holes);
        let spec = Spec { strict, drop, ..spec(f64::from(quarters) / 4.0) };
        let mesh = whole(&grid, &spec);
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
        let position = |p: Point2<f64>| Local::new(p.x as u32, p.y as u32);
        let theirs: BTreeSet<(Local, Local)> = spade.directed_edges()
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
        seed in 0_u32..1000, holes in 0_u32..3, half in 8_u32..40, height in 2_u32..50, tolerance in 0_i32..20
    ) {
        let grid = Grid::hills(2 * half + 1, height, seed, holes);
        let spec = spec(tolerance.into());
        for reach in [half, half / 2, 4, 0] {
            let (mended, is_delaunay) = mend(&grid, half, &spec, reach);
            if is_delaunay {
                check_all(&grid, &mended, tolerance.into(), 1);
            }
            prop_assert!(is_delaunay || reach < half);
        }
    }
}

/// Two tiles that meet at column `half`, and the patch of the triangles that come within `reach` of
/// it: all triangles in grid positions, and whether those left out agree with the patch.
fn mend(grid: &Grid, half: u32, spec: &Spec, reach: u32) -> (Vec<Triangle>, bool) {
    let shift = |t: &Triangle| {
        let corners = t.corners.map(|p| Local::new(p.col() + half, p.row()));
        Triangle { corners, ..*t }
    };
    let left = tile(grid, 0, half, spec).triangles;
    let right = tile(grid, half, 2 * half, spec).triangles;
    let all = left.into_iter().chain(right.iter().map(shift));
    let band = half - reach..=half + reach;
    let (inside, mut mended): (Vec<_>, Vec<_>) = all.partition(|t| {
        let cols = t.corners.map(|p| p.col());
        *band.start() <= cols.into_iter().max().unwrap()
            && cols.into_iter().min().unwrap() <= *band.end()
    });
    let input = PatchInput {
        heights: Heights { width: grid.width, height: grid.height, f32: &grid.f32(), f64: None },
        triangles: &inside,
        seam_col: Some(half),
        seam_row: None,
        grid_ends: [true; 4],
        spacing: u32::MAX,
    };
    let patch = mend_patch(&input, spec, &mut Scratch::default());
    let beyond = edges(&mended);
    let agrees = |&[a, b, c]: &[Local; 3]| {
        let disagrees = |&d| in_circle(lattice(a), lattice(b), lattice(c), lattice(d)) > 0;
        !beyond.get(&(b, a)).is_some_and(disagrees)
    };
    let is_delaunay = patch.border.iter().all(agrees);
    mended.extend(&patch.triangles);
    (mended, is_delaunay)
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
        let greedy = Spec { drop: false, ..spec(tolerance) };
        let adaptive = whole(&grid, &greedy).vertices.len();
        let strict = whole(&grid, &Spec { strict: true, ..greedy }).vertices.len();
        assert!(adaptive as f64 <= 1.07 * strict as f64, "{adaptive} against {strict}");
    }
}

#[test]
fn dropping_saves_vertices() {
    let grid = Grid::hills(257, 257, 5, 0);
    let all = whole(&grid, &Spec { drop: false, ..spec(6.0) }).vertices.len();
    let fewer = whole(&grid, &spec(6.0)).vertices.len();
    assert!(fewer as f64 <= 0.9 * all as f64, "{fewer} of {all}");
}

#[test]
fn the_sum_of_squares_counts_every_sample_once() {
    for holes in [0, 2] {
        let grid = Grid::hills(65, 50, 8, holes);
        let mesh = whole(&grid, &spec(9.0));
        let mut errors = BTreeMap::new();
        for triangle in &mesh.triangles {
            let p = triangle.corners.map(lattice);
            let area = orient(p[0], p[1], p[2]) as f64;
            let z = triangle.corners.map(|c| grid.at(c.col(), c.row()).unwrap() as f64);
            for (row, col) in (0..50).flat_map(|row| (0..65).map(move |col| (row, col))) {
                let q = [col, row];
                let w = [orient(p[1], p[2], q), orient(p[2], p[0], q), orient(p[0], p[1], q)];
                if w.iter().all(|&w| w >= 0) {
                    let plane: f64 = (0..3).map(|i| w[i] as f64 * z[i]).sum::<f64>() / area;
                    errors.insert(q, plane - grid.at(col as u32, row as u32).unwrap() as f64);
                }
            }
        }
        let expected: f64 = errors.values().map(|e| e * e).sum();
        let found: f64 = mesh.triangles.iter().map(|t| f64::from(t.square_sum)).sum();
        assert!((found - expected).abs() < 1e-4 * expected, "{found} against {expected}");
    }
}

#[test]
fn extremes_of_shape_and_content() {
    let flat = Grid { width: 33, height: 20, z: vec![Some(7); 660] };
    assert_eq!(whole(&flat, &spec(0.0)).triangles.len(), 2);
    let two = Grid { width: 2, height: 2, z: vec![Some(1), Some(2), Some(3), Some(9)] };
    assert_eq!(whole(&two, &spec(0.0)).triangles.len(), 2);
    let void = Grid { width: 9, height: 9, z: vec![None; 81] };
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
    let heights = Heights { width, height, f32: &rounded, f64: Some(&z) };
    let feet = Rounding { origin: 5e5, scale: 0.3048 };
    let about = [0.0, 5e5].map(Rounding::about);
    for single_precision in [None, Some(about[0]), Some(about[1]), Some(feet)] {
        let spec = Spec { single_precision, ..spec(0.25) };
        let none = TileInput {
            heights,
            apron_left: 0,
            apron_right: 0,
            apron_above: 0,
            apron_below: 0,
            spacing: u32::MAX,
        };
        let mesh = triangulate_tile(&none, &spec, &mut Scratch::default());
        let written = |p: Local| {
            let at = mesh.vertices.binary_search(&p).expect("a listed vertex");
            mesh.heights[at]
        };
        if let Some(rounding) = single_precision {
            assert!(mesh.heights.iter().all(|&z| rounding.apply(z) == z), "written and read back");
        }
        assert!(mesh.vertices.len() < z.len() * 9 / 10);
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
                    assert!(error <= 0.25 + 1e-9, "{error} at {q:?}");
                }
            }
        }
    }
}
