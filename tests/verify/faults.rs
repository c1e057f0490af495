//! Planted faults: each is found by its own name, and a sound mesh has none.

use crate::support::{
    self, Grid, Mesh, check, check_surface, check_with, delaunay, noise, split_cells,
};
use terrane_base::geom::Affine;
use terrane_verify::{FaultReport, GridLocation, MeshRequirements, VerifyReport};

/// World y of a row, under the default map.
fn y(row: u32) -> f64 {
    -f64::from(row)
}

fn rough() -> Grid {
    Grid::new(12, 9, |c, r| (noise(c, r, 1) * 64.0).round() / 4.0)
}

/// Names of all faults found, in the order of the report.
fn faults(report: &VerifyReport) -> Vec<&'static str> {
    let named: [(&str, &FaultReport<GridLocation>); 15] = [
        ("over", &report.over_tolerance),
        ("uncovered samples", &report.of.uncovered_samples),
        ("uncovered cells", &report.of.uncovered_cells),
        ("void", &report.of.void_cells),
        ("outside", &report.of.outside_triangles),
        ("overlap", &report.overlaps),
        ("inverted", &report.inverted_triangles),
        ("empty", &report.empty_triangles),
        ("crack", &report.cracks),
        ("t-junction", &report.t_junctions),
        ("non-manifold", &report.non_manifold_edges),
        ("split height", &report.split_heights),
        ("duplicate", &report.duplicate_vertices),
        ("unused", &report.unused_vertices),
        ("non-delaunay", &report.non_delaunay_edges),
    ];
    named.iter().filter(|(_, fault)| fault.count > 0).map(|(name, _)| *name).collect()
}

fn assert_sound(report: &VerifyReport) {
    assert_eq!(report.verdict.failures, Vec::<String>::new());
    assert!(report.verdict.passed);
    assert_eq!(faults(report), Vec::<&str>::new());
    assert_eq!(report.of.covered_samples, report.of.surface_samples);
    assert_eq!(report.mesh_area, report.of.surface_cells as f64);
}

#[test]
fn split_cells_are_sound_under_any_map() {
    let utm = Affine { x0: 5e5, a: 30.0, b: 0.0, y0: 4.2e6, d: 0.0, e: -30.0 };
    let south_up = Affine { e: 30.0, ..utm };
    let rotated = Affine { x0: 0.1, a: 0.8, b: 0.6, y0: -7.3, d: 0.6, e: -0.8 };
    let degrees = Affine { x0: 11.3, a: 1.0 / 3600.0, b: 0.0, y0: 46.9, d: 0.0, e: -1.0 / 3600.0 };
    for transform in [Affine::LATTICE, utm, south_up, rotated, degrees] {
        let mut grid = rough();
        grid.info.transform = transform;
        let report = check(&split_cells(&grid), &grid, Some(0.0));
        assert_sound(&report);
        assert_eq!((report.max_error, report.rmse), (Some(0.0), Some(0.0)));
        assert_eq!(report.triangles, 2 * 11 * 8);
        assert_eq!((report.free_vertices, report.open_edges), (0, 2 * (11 + 8)));
    }
}

#[test]
fn voids_and_isolated_samples_are_no_fault() {
    let mut grid = rough();
    for (col, row) in [(3, 3), (4, 3), (9, 0), (10, 1), (11, 1), (0, 8)] {
        grid.set(col, row, f64::NAN);
    }
    let report = check(&split_cells(&grid), &grid, Some(0.0));
    assert_sound(&report);
    assert_eq!((report.of.valid_samples, report.of.isolated_samples), (102, 2));
    assert_eq!(report.of.covered_samples, 100);
}

#[test]
fn a_delaunay_mesh_has_no_non_delaunay_edge_and_a_flip_makes_one() {
    let grid = Grid::new(100, 80, |c, r| f64::from(c) * 0.5 - f64::from(r));
    let mut mesh = delaunay(&grid, |c, r| noise(c, r, 7) < 0.05);
    let report = check(&mesh, &grid, Some(1e-9));
    assert_sound(&report);
    assert!(report.smallest_angle.unwrap() > 0.0);
    assert_eq!(report.angle_histogram.iter().sum::<u64>(), report.triangles);
    let flipped = (0..mesh.triangles.len()).find_map(|t| flip(&mesh, t)).unwrap();
    mesh.triangles = flipped;
    let report = check(&mesh, &grid, Some(1e-9));
    assert!(
        report.verdict.passed,
        "another's mesh promises nothing: {:?}",
        report.verdict.failures
    );
    assert!(report.non_delaunay_edges.count >= 1 && !report.delaunay);
    let comment = |text: &str| ("comment".to_owned(), text.to_owned());
    mesh.info.details = vec![comment("terrane 0.1.0")];
    let failures = check(&mesh, &grid, Some(1e-9)).verdict.failures;
    assert_eq!(failures.len(), 1);
    assert!(failures[0].contains("not Delaunay on the lattice of samples"), "{failures:?}");
    mesh.info.details.push(comment("triangulation data-dependent"));
    assert!(check(&mesh, &grid, Some(1e-9)).verdict.passed);
}

/// Fitted heights: each vertex of the surface moved in turn, within the bound.
#[test]
fn a_fitted_vertex_on_the_outline_has_the_height_of_its_sample() {
    let mut grid = rough();
    for (col, row) in [(3, 3), (9, 0), (10, 6)] {
        grid.set(col, row, f64::NAN);
    }
    let mut mesh = split_cells(&grid);
    mesh.info.details = ["terrane 0.1.0", "fitted heights"]
        .map(|text| ("comment".to_owned(), text.to_owned()))
        .to_vec();
    assert_sound(&check(&mesh, &grid, Some(1.0)));
    let mut inside = 0;
    for id in 0..mesh.vertices.len() {
        let [x, y, z] = mesh.vertices[id];
        let around = [(0, 0), (-1, 0), (0, -1), (-1, -1)];
        let is_inside = around.iter().all(|(c, r)| grid.is_surface(x as i64 + c, -y as i64 + r));
        mesh.vertices[id][2] = z + 0.2;
        let report = check(&mesh, &grid, Some(1.0));
        let off = u64::from(!is_inside);
        assert_eq!((report.of.off_sample_vertices.count, report.verdict.passed), (off, is_inside));
        mesh.vertices[id][2] = z;
        inside += u64::from(is_inside);
    }
    assert!(inside > 20 && inside < mesh.vertices.len() as u64 / 2 + 20, "{inside}");
}

/// Flips the first side of triangle `t`, where that leaves two proper triangles.
fn flip(mesh: &Mesh, t: usize) -> Option<Vec<[u64; 3]>> {
    let [a, b, c] = mesh.triangles[t];
    let rotations = |[x, y, z]: [u64; 3]| [[x, y, z], [y, z, x], [z, x, y]];
    let twin = |&[x, y, _]: &[u64; 3]| [x, y] == [b, a];
    let (other, d) = mesh.triangles.iter().enumerate().find_map(|(i, &triangle)| {
        rotations(triangle).iter().find(|r| twin(r)).map(|r| (i, r[2]))
    })?;
    let area = |ids: [u64; 3]| {
        let [p, q, s] = ids.map(|id| mesh.vertices[id as usize]);
        (q[0] - p[0]) * (s[1] - p[1]) - (q[1] - p[1]) * (s[0] - p[0])
    };
    let new = [[a, d, c], [d, b, c]];
    let mut triangles = mesh.triangles.clone();
    (triangles[t], triangles[other]) = (new[0], new[1]);
    new.iter().all(|&ids| area(ids) > 0.0).then_some(triangles)
}

#[test]
fn a_vertex_moved_up_is_over_the_tolerance() {
    let grid = rough();
    let mut mesh = split_cells(&grid);
    let id = mesh.find(5.0, y(4));
    mesh.vertices[id as usize][2] += 0.5;
    let report = check(&mesh, &grid, Some(0.25));
    assert_eq!(faults(&report), ["over"]);
    assert_eq!(report.over_tolerance.count, 1);
    let place = report.over_tolerance.first.unwrap();
    assert_eq!((place.column, place.row, place.x, place.y), (5.0, 4.0, 5.0, -4.0));
    assert_eq!((report.max_error, report.max_error_at), (Some(0.5), Some(place)));
    assert!(!report.verdict.passed && report.verdict.failures.len() == 1);
    assert!(
        report.verdict.failures[0].contains("column 5, row 4"),
        "{}",
        report.verdict.failures[0]
    );
    assert!(check(&mesh, &grid, Some(0.5)).verdict.passed, "closed <=");
}

#[test]
fn a_vertex_moved_sideways_is_free_and_over_the_tolerance() {
    let grid = rough();
    let mut mesh = split_cells(&grid);
    let id = mesh.find(5.0, y(4)) as usize;
    mesh.vertices[id][0] += 0.25;
    let report = check(&mesh, &grid, Some(1e-6));
    assert_eq!(report.free_vertices, 1);
    assert_eq!(faults(&report), ["over", "non-delaunay"]);
    // Beyond its neighbour it turns triangles over.
    mesh.vertices[id][0] += 1.25;
    let report = check(&mesh, &grid, Some(1e-6));
    assert!(report.inverted_triangles.count > 0 && !report.verdict.passed);
}

#[test]
fn one_part_in_a_billion_over_the_tolerance_is_over() {
    // A slope of 1/3 over three cells: the middle samples are off by no float exactly.
    let grid = Grid::new(4, 2, |c, _| if c == 1 { 1.0 } else { f64::from(c) / 3.0 * 0.9 });
    let mesh = delaunay(&grid, |_, _| false);
    let error = check(&mesh, &grid, None).max_error.unwrap();
    let count = |tolerance: f64| check(&mesh, &grid, Some(tolerance)).over_tolerance.count;
    assert_eq!(count(error * (1.0 + 1e-9)), 0);
    assert_eq!(count(error * (1.0 - 1e-9)), 2);
    assert_eq!(count(error.next_up().next_up()), 0);
    assert_eq!(count(error.next_down().next_down()), 2);
}

#[test]
fn the_verdict_at_the_tolerance_is_exact() {
    // Plane z = x / 3 against 1: the error at column 1 is 2/3, between two floats.
    let mut grid = Grid::new(4, 2, |c, _| if c == 3 { 1.0 } else { 0.0 });
    grid.set(1, 0, 1.0);
    let mesh = delaunay(&grid, |_, _| false);
    let below = 2.0 / 3.0;
    let report = check(&mesh, &grid, Some(below));
    assert_eq!(report.over_tolerance.count, 3);
    assert_eq!(*report.error_histogram.last().unwrap(), 3);
    assert!(report.max_error.unwrap() > below);
    let report = check(&mesh, &grid, Some(f64::next_up(below)));
    assert!(report.verdict.passed);
    assert!(report.max_error.unwrap() <= f64::next_up(below));
}

#[test]
fn a_dropped_triangle_is_a_crack() {
    let grid = rough();
    let mut mesh = split_cells(&grid);
    mesh.triangles.remove(77);
    mesh.recount();
    let report = check(&mesh, &grid, Some(0.0));
    assert_eq!(faults(&report), ["crack"]);
    assert_eq!(report.cracks.count, 3);
    assert_eq!(report.mesh_area, 87.5);
    // Both halves of a cell, and with them a cell.
    mesh.triangles.remove(76);
    mesh.recount();
    assert_eq!(faults(&check(&mesh, &grid, None)), ["uncovered cells", "crack"]);
}

#[test]
fn a_dropped_corner_leaves_a_sample_uncovered() {
    let grid = rough();
    let mut mesh = split_cells(&grid);
    let corner = mesh.find(0.0, 0.0);
    mesh.triangles.retain(|t| !t.contains(&corner));
    mesh.recount();
    let report = check(&mesh, &grid, Some(0.0));
    assert_eq!(faults(&report), ["uncovered samples", "crack", "unused"]);
    assert_eq!(report.of.uncovered_samples.count, 1);
}

#[test]
fn a_vertex_split_apart_is_a_crack() {
    let grid = rough();
    for (dx, dz, expected) in [
        (0.25, 0.0, &["over", "crack"][..]),
        (0.0, 0.5, &["over", "split height", "duplicate"][..]),
    ] {
        let mut mesh = split_cells(&grid);
        let id = mesh.find(6.0, y(3));
        let [x, y, z] = mesh.vertices[id as usize];
        let copy = mesh.add([x + dx, y, z + dz]);
        let users: Vec<usize> =
            (0..mesh.triangles.len()).filter(|&t| mesh.triangles[t].contains(&id)).collect();
        for &t in &users[..3] {
            mesh.triangles[t] = mesh.triangles[t].map(|v| if v == id { copy } else { v });
        }
        mesh.recount();
        let report = check(&mesh, &grid, Some(1e-6));
        for name in expected {
            assert!(faults(&report).contains(name), "{name} among {:?}", faults(&report));
        }
        let soup = check(&mesh.soup(), &grid, Some(1e-6));
        assert!(!soup.verdict.passed);
        assert_eq!(soup.split_heights, report.split_heights);
        assert_eq!(soup.cracks, report.cracks);
    }
}

/// Two by one large cells of four triangles' worth, with a vertex on the shared edge used by the
/// right side only.
fn t_junction() -> (Grid, Mesh) {
    let grid = Grid::new(9, 5, |_, _| 1.0);
    let place = [(0, 0), (4, 0), (8, 0), (0, 4), (4, 4), (8, 4), (4, 2)];
    let vertices = place.map(|(c, r)| grid.vertex(c, r)).to_vec();
    let triangles = vec![[0, 3, 1], [1, 3, 4], [1, 6, 2], [6, 4, 5], [6, 5, 2]];
    (grid, Mesh::new(vertices, triangles))
}

#[test]
fn a_t_junction_is_named() {
    let (grid, mut mesh) = t_junction();
    let report = check(&mesh, &grid, Some(0.0));
    assert_eq!(faults(&report), ["crack", "t-junction"]);
    assert_eq!((report.t_junctions.count, report.cracks.count), (1, 3));
    let place = report.t_junctions.first.unwrap();
    assert_eq!((place.column, place.row), (4.0, 2.0));
    mesh.vertices[6] = [4.0, -2.25, 1.0];
    assert_eq!(check(&mesh, &grid, Some(0.0)).t_junctions.count, 1, "off the lattice too");
    // An empty triangle closes the mesh by its edges, and is named instead.
    mesh.triangles.push([1, 4, 6]);
    mesh.recount();
    assert_eq!(faults(&check(&mesh, &grid, Some(0.0))), ["empty"]);
}

#[test]
fn duplicate_and_unused_vertices_are_counted() {
    let grid = rough();
    let mut mesh = split_cells(&grid);
    mesh.add(mesh.vertices[40]);
    mesh.recount();
    assert_eq!(faults(&check(&mesh, &grid, Some(0.0))), ["duplicate"]);
    mesh.vertices.pop();
    mesh.add([3.5, -3.5, 0.0]);
    mesh.recount();
    assert_eq!(faults(&check(&mesh, &grid, Some(0.0))), ["unused"]);
    let soup = mesh.soup();
    let report = check(&soup, &grid, Some(0.0));
    assert_sound(&report);
}

#[test]
fn inverted_empty_and_overlapping_triangles_are_named() {
    let grid = rough();
    let mut mesh = split_cells(&grid);
    mesh.triangles[50].swap(1, 2);
    let report = check(&mesh, &grid, Some(0.0));
    assert_eq!(faults(&report), ["inverted", "non-manifold"]);
    assert_eq!((report.inverted_triangles.count, report.non_manifold_edges.count), (1, 3));
    mesh.triangles[50].swap(1, 2);

    let [a, b, _] = mesh.triangles[50];
    mesh.triangles.push([a, b, b]);
    mesh.recount();
    assert_eq!(check(&mesh, &grid, Some(0.0)).empty_triangles.count, 1);
    mesh.triangles.pop();

    let far = [mesh.find(2.0, y(2)), mesh.find(2.0, y(6)), mesh.find(8.0, y(2))];
    mesh.triangles.push(far);
    mesh.recount();
    // Of a single layer of unit triangles no sample is strictly inside.
    let report = check(&mesh, &grid, None);
    assert_eq!(faults(&report), ["crack", "t-junction"]);
    assert!(report.verdict.failures.iter().any(|f| f.contains("area")));
    mesh.triangles.push(far);
    mesh.recount();
    let report = check(&mesh, &grid, None);
    assert_eq!(faults(&report), ["overlap", "non-manifold"]);
    assert_eq!(report.overlaps.count, 7, "as Pick's theorem says");
}

#[test]
fn triangles_over_voids_and_beyond_the_grid_are_named() {
    let mut grid = rough();
    let mut mesh = split_cells(&grid);
    grid.set(4, 4, f64::NAN);
    let report = check(&mesh, &grid, Some(0.0));
    assert_eq!((report.of.void_cells.count, report.of.uncovered_samples.count), (4, 0));
    assert!(faults(&report).contains(&"void"));
    let small = Grid::new(11, 9, |c, r| grid.at(c, r));
    let report = check(&mesh, &small, None);
    assert_eq!(report.of.outside_triangles.count, 2 * 8);
    mesh.vertices.iter_mut().for_each(|v| v[0] -= 1.0);
    let mut shifted = rough();
    shifted.info.transform.x0 = -1.0;
    assert_sound(&check(&mesh, &shifted, Some(0.0)));
    assert_eq!(check(&mesh, &rough(), None).of.outside_triangles.count, 2 * 8);
}

#[test]
fn unusable_vertices_and_bad_ids() {
    let grid = rough();
    let mut mesh = split_cells(&grid);
    mesh.vertices[30][2] = f64::NAN;
    let report = check(&mesh, &grid, Some(0.0));
    assert_eq!((report.unusable_vertices, report.broken_triangles), (1, 6));
    assert!(!report.verdict.passed);
    mesh.triangles[3][1] = 1 << 40;
    let resources = terrane_engine::Resources::default();
    let (progress, cancel) = (terrane_engine::Silent, terrane_engine::Cancel::default());
    let verify = |tolerance| {
        let asked = MeshRequirements::of_samples(tolerance);
        terrane_verify::verify(&mesh, &grid, asked, &resources, &progress, &cancel)
    };
    let error = verify(None).unwrap_err();
    assert_eq!(error.kind(), terrane::ErrorKind::BadInput);
    assert!(error.to_string().starts_with("triangle 3: refers to vertex 1099511627776"));
    let error = verify(Some(f64::NAN)).unwrap_err();
    assert_eq!(error.kind(), terrane::ErrorKind::Usage);
}

#[test]
fn grids_without_surface() {
    let empty = Mesh::new(Vec::new(), Vec::new());
    let line = Grid::new(7, 1, |_, _| 1.0);
    let report = check(&empty, &line, Some(0.0));
    assert!(report.verdict.passed);
    assert_eq!((report.of.isolated_samples, report.max_error), (7, None));
    let void = Grid::new(5, 5, |_, _| f64::NAN);
    assert!(check(&empty, &void, Some(0.0)).verdict.passed);
    let cell = Grid::new(2, 2, |_, _| 1.0);
    assert_sound(&check(&split_cells(&cell), &cell, Some(0.0)));
    assert_eq!(check(&empty, &cell, None).of.uncovered_samples.count, 4);
}

#[test]
fn long_outline_edges_are_followed_across_domains() {
    // Two triangles over a grid of many domains, then with a notch cut into the border.
    let mut grid = Grid::new(5000, 70, |_, _| 0.0);
    let mesh = delaunay(&grid, |_, _| false);
    assert_sound(&support::check_with(&mesh, &grid, Some(0.0), 2, 1 << 20));
    grid.set(4700, 69, f64::NAN);
    let report = support::check_with(&mesh, &grid, Some(0.0), 2, 1 << 20);
    assert_eq!((report.cracks.count, report.of.void_cells.count), (1, 2));
}

#[test]
fn rounded_storage_is_snapped_and_reported() {
    let mut grid = rough();
    grid.info.transform =
        Affine { x0: 512_345.7, a: 0.3, b: 0.0, y0: 4_200_000.1, d: 0.0, e: -0.3 };
    let mut mesh = split_cells(&grid);
    let origin = [512_345.0, 4_200_000.0, 0.0];
    for vertex in &mut mesh.vertices {
        for k in 0..2 {
            vertex[k] = f64::from((vertex[k] - origin[k]) as f32) + origin[k];
        }
    }
    mesh.info.origin = origin;
    mesh.info.single_precision = true;
    let report = check(&mesh, &grid, Some(0.0));
    assert_sound(&report);
    assert!(report.of.snapped_vertices > 90 && report.of.largest_snap > 1e-9);
    assert!(report.of.largest_snap <= report.of.snap_radius && report.of.snap_radius < 1e-3);
}

#[test]
fn steep_needles_stay_exact() {
    // Rounding of a plane this steep is far above the tolerance: only exact decisions get it right.
    let z = |c: u32, r: u32| f64::from(c) * 1e9 + f64::from(r) * 3e9;
    let grid = Grid::new(300, 3, z);
    let mut mesh = Mesh::new(
        [(0, 0), (299, 0), (0, 2), (299, 2), (1, 1)].map(|(c, r)| grid.vertex(c, r)).to_vec(),
        vec![[0, 2, 4], [0, 4, 1], [4, 2, 3], [4, 3, 1]],
    );
    assert_sound_but_delaunay(&check(&mesh, &grid, Some(0.0)));
    mesh.vertices[4][2] = mesh.vertices[4][2].next_up();
    assert!(check(&mesh, &grid, Some(0.0)).over_tolerance.count > 0);
}

fn assert_sound_but_delaunay(report: &VerifyReport) {
    assert!(report.verdict.passed, "{:?}", report.verdict.failures);
}

/// A flat grid but for four samples, and its Delaunay mesh without two samples between these: the four,
/// by turns 1 above and below, are a rectangle with one diagonal, which crosses the line between the
/// two samples left out, or beside them at the border, where it is off by 1 from a height of 0. All
/// samples are on the mesh.
fn off_between(size: [u32; 2], [col, row]: [u32; 2], upright: bool) -> (Grid, Mesh) {
    let turn = |c: u32, r: u32| if upright { (r, c) } else { (c, r) };
    let (col, row) = turn(col, row);
    let grid = Grid::new(size[0], size[1], |c, r| match turn(c, r) {
        (c, r) if r + 1 == row && c == col || r == row + 1 && c == col + 1 => 1.0,
        (c, r) if r + 1 == row && c == col + 1 || r == row + 1 && c == col => -1.0,
        _ => 0.0,
    });
    let is_left_out = |c, r| turn(c, r).1 == row && (col..=col + 1).contains(&turn(c, r).0);
    let mesh = delaunay(&grid, |c, r| !is_left_out(c, r));
    (grid, mesh)
}

#[test]
fn an_error_between_samples_alone_is_found_wherever_it_is() {
    // Domains begin at multiples of 32.
    let places = [
        ([10, 10], false, [10.5, 10.0]),
        ([10, 10], true, [10.0, 10.5]),
        ([31, 40], false, [31.5, 40.0]),
        ([32, 40], false, [32.5, 40.0]),
        ([40, 31], true, [40.0, 31.5]),
        ([40, 32], true, [40.0, 32.5]),
        ([31, 32], true, [31.0, 32.5]),
        ([1, 1], false, [1.5, 1.0]),
        ([67, 68], false, [67.5, 68.0]),
        ([68, 67], true, [68.0, 67.5]),
    ];
    for (at, upright, [column, row]) in places {
        let (grid, mesh) = off_between([70, 70], at, upright);
        assert_sound(&check(&mesh, &grid, Some(0.0)));
        assert!(check_surface(&mesh, &grid, Some(1.0)).verdict.passed, "closed <=");
        for memory in [1 << 20, 64 << 20] {
            let report = check_with(&mesh, &grid, Some(1f64.next_down()), 2, memory);
            assert_eq!((report.of.breaks, report.of.over_between_samples.count), (1, 1), "{at:?}");
            let place = report.of.over_between_samples.first.unwrap();
            assert_eq!([place.column, place.row], [column, row]);
            assert_eq!((report.of.surface_error, report.max_error), (Some(1.0), Some(0.0)));
            assert_eq!(report.of.surface_error_at, Some(place));
        }
        let report = check_surface(&mesh, &grid, Some(1f64.next_down()));
        assert_eq!(report.verdict.failures.len(), 1, "{:?}", report.verdict.failures);
        assert!(report.verdict.failures[0].starts_with("1 places between samples further from"));
    }
}

#[test]
fn an_error_between_samples_beside_the_border_is_found() {
    for corner in [1.0, -1.0] {
        // Two triangles over six samples, whose diagonal is off by 1 in the middle.
        let z = |c, r| {
            if c == 1 {
                0.0
            } else if (c == 0) == (r == 0) {
                corner
            } else {
                -corner
            }
        };
        for upright in [false, true] {
            let size = if upright { [2, 3] } else { [3, 2] };
            let grid = Grid::new(size[0], size[1], |c, r| if upright { z(r, c) } else { z(c, r) });
            let report = check_surface(&delaunay(&grid, |_, _| false), &grid, Some(0.5));
            assert_eq!((report.of.breaks, report.of.over_between_samples.count), (1, 1));
            assert_eq!((report.of.surface_error, report.max_error), (Some(1.0), Some(0.0)));
        }
    }
}

#[test]
fn a_line_beside_a_void_is_judged_and_one_between_voids_is_not() {
    let (mut grid, mesh) = off_between([70, 70], [31, 40], false);
    grid.set(32, 41, f64::NAN);
    assert_eq!(check_surface(&mesh, &grid, Some(0.5)).of.over_between_samples.count, 1);
    grid.set(31, 39, f64::NAN);
    assert_eq!(check_surface(&mesh, &grid, Some(0.5)).of.breaks, 0);
    let (mut grid, mesh) = off_between([70, 70], [31, 40], false);
    grid.set(32, 40, f64::NAN);
    assert_eq!(check_surface(&mesh, &grid, Some(0.5)).of.breaks, 0);
}

#[test]
fn an_error_between_samples_is_decided_exactly() {
    // Where the edge from (0, 0) to (3, 1) crosses columns its height is a third and two thirds, and
    // 1/4 from the line between the samples there, of 0 and 1/4, and of 0 and 5/8.
    let heights = [[0.0, 0.0, 0.0, 0.0], [0.0, 0.25, 0.625, 1.0]];
    let grid = Grid::new(4, 2, |c, r| heights[r as usize][c as usize]);
    let corners = [(0, 0), (3, 0), (0, 1), (3, 1)].map(|(c, r)| grid.vertex(c, r));
    let mut mesh = Mesh::new(corners.to_vec(), vec![[0, 3, 1], [0, 2, 3]]);
    let over = |mesh: &Mesh, tolerance: f64| {
        let report = check_surface(mesh, &grid, Some(tolerance));
        assert_eq!((report.of.breaks, report.over_tolerance.count), (2, 0));
        assert_eq!(report.of.surface_error.unwrap() > tolerance, !report.verdict.passed);
        report.of.over_between_samples.count
    };
    assert_eq!([0.25, 0.25f64.next_down()].map(|tolerance| over(&mesh, tolerance)), [0, 2]);
    mesh.vertices[3][2] = 1f64.next_up();
    assert_eq!(over(&mesh, 0.25), 2);
    mesh.vertices[3][2] = 1f64.next_down();
    assert_eq!(over(&mesh, 0.25), 0);
}

#[test]
fn an_edge_that_crosses_lines_at_samples_alone_has_no_break() {
    let grid = Grid::new(70, 70, |c, r| f64::from(c) + f64::from(r));
    let report = check_surface(&delaunay(&grid, |_, _| false), &grid, Some(0.0));
    assert_eq!((report.of.breaks, report.of.surface_error), (0, Some(0.0)));
    assert!(report.verdict.passed && report.verdict.judged);
}

#[test]
fn a_corner_on_a_line_is_a_break_for_each_height_it_has() {
    let grid = Grid::new(12, 9, |_, _| 7.0);
    let mut mesh = split_cells(&grid);
    let id = mesh.find(5.0, y(4)) as usize;
    (mesh.vertices[id][0], mesh.vertices[id][2]) = (5.25, 7.5);
    let over = |mesh: &Mesh, tolerance| check_surface(mesh, &grid, Some(tolerance)).of;
    let place = over(&mesh, 0.45).over_between_samples.first.unwrap();
    assert_eq!((place.column, place.row), (5.25, 4.0));
    assert_eq!(over(&mesh, 0.45).over_between_samples.count, 1);
    assert_eq!(over(&mesh, 0.5).over_between_samples.count, 0);
    let copy = mesh.add([5.25, y(4), 6.5]);
    let last = mesh.triangles.iter().rposition(|t| t.contains(&(id as u64))).unwrap();
    mesh.triangles[last] = mesh.triangles[last].map(|v| if v == id as u64 { copy } else { v });
    mesh.recount();
    assert_eq!(over(&mesh, 0.45).over_between_samples.count, 2);
}

#[test]
fn without_a_tolerance_the_surface_is_measured_and_not_said_to_be_kept() {
    let (grid, mesh) = off_between([70, 70], [31, 40], false);
    let report = check_surface(&mesh, &grid, None);
    assert!(report.verdict.passed && !report.verdict.judged);
    assert_eq!((report.of.surface_error, report.of.over_between_samples.count), (Some(1.0), 0));
}

#[test]
fn heights_beyond_all_floats_are_over_between_samples() {
    let grid = Grid::new(3, 2, |c, r| if c == 2 * r { -1e308 } else { 1e308 });
    let corners = [(0, 0), (2, 0), (0, 1), (2, 1)].map(|(c, r)| grid.vertex(c, r));
    let mesh = Mesh::new(corners.to_vec(), vec![[0, 3, 1], [0, 2, 3]]);
    let report = check_surface(&mesh, &grid, Some(1.0));
    assert_eq!(report.of.over_between_samples.count, 1);
    assert_eq!(report.of.surface_error, Some(f64::INFINITY));
}
