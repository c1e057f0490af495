//! The quality of meshes: known ones, and the same figures whatever a job may use.

use std::path::Path;

use crate::support::{Grid, Mesh, delaunay, noise, split_cells};
use terrane::Result;
use terrane_base::geom::{Affine, Crs};
use terrane_engine::input::mesh_bounds;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_verify::{MeasuredMesh, QualityReport, SlopeReference, quality};

fn measured(
    mesh: &Mesh,
    grid: Option<&Grid>,
    threads: usize,
    memory: u64,
) -> Result<QualityReport> {
    let resources = Resources { threads, memory, temp_dir: None };
    let cancel = Cancel::default();
    let bounds = mesh_bounds(mesh, &Silent, &cancel)?;
    let measured = MeasuredMesh { file: Path::new("mesh"), mesh, bounds };
    let against = grid.map(|grid| SlopeReference { name: Path::new("grid"), grid });
    quality(measured, against, &resources, &Silent, &cancel)
}

fn of(mesh: &Mesh) -> QualityReport {
    measured(mesh, None, 1, 64 << 20).unwrap()
}

fn rough(width: u32, height: u32) -> Grid {
    Grid::new(width, height, |c, r| noise(c, r, 7) * 20.0)
}

#[test]
fn nothing_depends_on_threads_memory_or_the_identity_of_vertices() {
    let mut grid = rough(200, 120);
    grid.set(100, 100, f64::NAN);
    let mesh = delaunay(&grid, |c, r| noise(c, r, 1) < 0.6);
    let expected = measured(&mesh, Some(&grid), 1, 256 << 20).unwrap();
    assert!(expected.triangles > 20_000 && expected.slope.as_ref().unwrap().cells > 23_000);
    for (threads, memory) in [(3, 256 << 20), (1, 1 << 20), (2, 3 << 20), (4, 16 << 20)] {
        assert_eq!(measured(&mesh, Some(&grid), threads, memory).unwrap(), expected);
    }
    assert_eq!(measured(&mesh.soup(), Some(&grid), 2, 1 << 20).unwrap(), expected);
    let mut turned = mesh.clone();
    turned.triangles.reverse();
    assert_eq!(measured(&turned, Some(&grid), 2, 1 << 20).unwrap(), expected);
}

#[test]
fn a_crowd_at_one_place_is_divided_again() {
    // Nearly all of the mesh in a corner of its extent, and one triangle far away.
    let grid = rough(150, 150);
    let mut mesh = delaunay(&grid, |_, _| true);
    let far = [[1e6, 1e6, 0.0], [1e6 + 1.0, 1e6, 0.0], [1e6, 1e6 + 1.0, 0.0]];
    let ids = far.map(|vertex| mesh.add(vertex));
    mesh.triangles.push(ids);
    mesh.recount();
    let expected = measured(&mesh, None, 1, 256 << 20).unwrap();
    assert_eq!(measured(&mesh, None, 3, 1 << 20).unwrap(), expected);
    assert_eq!(expected.triangles, 149 * 149 * 2 + 1);
    // A fan around one vertex cannot be divided: it is looked at whole, or refused.
    let mut fan = Mesh::new(vec![[0.0; 3]], Vec::new());
    let rim: Vec<u64> = (0..100_000)
        .map(|i| f64::from(i) * 1e-5)
        .map(|angle| fan.add([angle.cos(), angle.sin(), 0.0]))
        .collect();
    fan.triangles = rim.windows(2).map(|pair| [0, pair[0], pair[1]]).collect();
    fan.recount();
    assert_eq!(measured(&fan, None, 2, 256 << 20).unwrap().degrees.max, Some(100_000));
    let error = measured(&fan, None, 2, 1 << 20).unwrap_err().to_string();
    assert!(error.contains("triangles at one position") && error.contains("‹memory›"), "{error}");
}

fn minus(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| p[axis] - q[axis])
}

#[test]
fn a_mesh_of_all_samples_is_as_good_as_its_grid() {
    // A plane, on cells that are turned, and not square.
    let mut grid = Grid::new(30, 20, |c, r| 0.3 * f64::from(c) - 0.2 * f64::from(r));
    grid.info.transform = Affine { x0: 5e5, a: 0.3, b: 0.1, y0: 4e6, d: 0.2, e: -0.7 };
    let mesh = split_cells(&grid);
    let report = measured(&mesh, Some(&grid), 2, 64 << 20).unwrap();
    let slope = report.slope.unwrap();
    assert_eq!((slope.cells, slope.uncovered_cells), (29 * 19, 0));
    assert!(slope.max.unwrap() < 1e-6 && slope.notes.len() == 2);
    assert_eq!((report.vertices, report.triangles), (600, 29 * 19 * 2));
    assert_eq!((report.border_edges, report.inverted_triangles), (2 * (29 + 19), 0));
    // A tilted triangle over a level grid is as far off as it is steep.
    let level = Grid { heights: vec![0.0; 600], ..grid.clone() };
    let slope = measured(&mesh, Some(&level), 2, 64 << 20).unwrap().slope.unwrap();
    let [p, q, r] = mesh.triangles[0].map(|id| mesh.vertices[id as usize]);
    let ([ux, uy, uz], [vx, vy, vz]) = (minus(q, p), minus(r, p));
    let normal: [f64; 3] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    let steep = normal[0].hypot(normal[1]).atan2(normal[2]).to_degrees();
    assert!((slope.max.unwrap() - steep).abs() < 1e-6, "{slope:?} {steep}");
    assert!((slope.rms.unwrap() - steep).abs() < 1e-6);
}

#[test]
fn ties_of_coordinates_that_are_no_floats_are_on_a_circle() {
    // Cells of 0.3 far from the origin, turned: no four of their corners are on a circle as they are held.
    let mut grid = rough(60, 60);
    for (a, d) in [(0.3, 0.0), (0.27, 0.13), (1.0 / 3.0, 0.01)] {
        grid.info.transform = Affine { x0: 512_345.678, a, b: d, y0: 4_123_456.789, d, e: -a };
        let full = of(&split_cells(&grid));
        assert_eq!((full.non_delaunay_edges, full.cocircular_edges), (0, 59 * 59), "{a} {d}");
        let thinned = of(&delaunay(&grid, |c, r| noise(c, r, 3) < 0.2));
        assert_eq!((thinned.non_delaunay_edges, thinned.folded_edges), (0, 0));
        assert_eq!(thinned.delaunay_share, Some(1.0));
    }
}

#[test]
fn a_flipped_edge_is_found() {
    let grid = rough(40, 40);
    let mesh = delaunay(&grid, |c, r| noise(c, r, 5) < 0.3);
    let (sound, mut flipped) = (of(&mesh), mesh.clone());
    let [a, b, c] = mesh.triangles[100];
    // The triangle beyond the edge from a to b, and the edge from c to its corner in its place.
    let beyond = |t: &[u64; 3]| t.contains(&a) && t.contains(&b) && !t.contains(&c);
    let other = mesh.triangles.iter().position(beyond).unwrap();
    let d = mesh.triangles[other].into_iter().find(|id| *id != a && *id != b).unwrap();
    (flipped.triangles[100], flipped.triangles[other]) = ([a, d, c], [d, b, c]);
    let report = of(&flipped);
    let bad = report.non_delaunay_edges + report.folded_edges;
    assert!(sound.delaunay_share == Some(1.0) && bad > 0, "{report:?}");
    assert_eq!(report.edges, sound.edges);
}

#[test]
fn units_are_those_of_the_grid() {
    let mut grid = Grid::new(9, 9, |c, _| 1000.0 * f64::from(c));
    let level = Grid { heights: vec![0.0; 81], ..grid.clone() };
    let slope = |mesh: &Mesh, grid: &Grid| {
        measured(mesh, Some(grid), 1, 64 << 20).map(|report| report.slope.unwrap())
    };
    grid.info.transform = Affine { x0: 10.0, a: 0.01, b: 0.0, y0: 60.04, d: 0.0, e: -0.01 };
    grid.info.crs = Crs { epsg: Some(4326), geographic: Some(true), ..Crs::default() };
    let mut mesh = split_cells(&grid);
    mesh.info.crs = Some("EPSG:4326 (WGS 84)".to_owned());
    let level = Grid { info: grid.info.clone(), ..level };
    let report = measured(&mesh, Some(&level), 1, 64 << 20).unwrap();
    assert_eq!(report.smallest_angles_in_space, None);
    let found = report.slope.unwrap();
    // 1000 m on a hundredth of a degree at 60 degrees north.
    assert!(
        (found.rms.unwrap() - (1000.0f64 / 558.0).atan().to_degrees()).abs() < 0.1,
        "{found:?}"
    );
    assert_eq!(found.notes.len(), 1);
    let odd = Crs { vertical_unit: Some("sazhen".to_owned()), ..grid.info.crs.clone() };
    let mut unknown = grid.clone();
    unknown.info.crs = odd;
    let error = slope(&mesh, &unknown).unwrap_err().to_string();
    assert!(error.starts_with("grid: ") && error.contains("sazhen"), "{error}");
}

#[test]
fn what_cannot_be_measured_is_an_error_and_no_mesh_is_none() {
    let mut mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]);
    assert_eq!(of(&mesh).edges, 3);
    mesh.triangles.push([0, 1, 3]);
    mesh.recount();
    let error = measured(&mesh, None, 1, 64 << 20).unwrap_err().to_string();
    assert!(error.starts_with("mesh: ") && error.contains("vertex 3"), "{error}");
    mesh.info.solid = true;
    let error = measured(&mesh, None, 1, 64 << 20).unwrap_err().to_string();
    assert!(error.contains("solid"), "{error}");
    let none = of(&Mesh::new(Vec::new(), Vec::new()));
    assert_eq!((none.triangles, none.delaunay_share, none.degrees.min), (0, None, None));
    // Triangles that cannot be placed are counted, and left out.
    let mut broken =
        Mesh::new(vec![[0.0; 3], [1.0, 0.0, f64::NAN], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]);
    broken.recount();
    let report = of(&broken);
    assert_eq!((report.triangles, report.broken_triangles), (0, 1));
}
