//! Solids in STL and 3MF: closed, upright, on a flat bottom, and the right way out.

use crate::held::{self, Mesh, edges, six_volumes};
use terrane::ErrorKind;
use terrane_base::geom::Point3;
use terrane_mesh::{self as mesh, MeshFormat, SinkOptions};

const BASE: f64 = -12.5;

fn stl() -> &'static MeshFormat {
    mesh::by_path("a.stl".as_ref(), None).unwrap()
}

/// The formats that solids can be in.
fn formats() -> impl Iterator<Item = &'static MeshFormat> {
    mesh::FORMATS.iter().filter(|format| format.can_be_solid)
}

fn solid(mesh: &Mesh, base: f64) -> terrane::Result<Vec<[Point3; 3]>> {
    Ok(held::corners(&solid_in(stl(), mesh, base)?))
}

fn solid_in(format: &MeshFormat, mesh: &Mesh, base: f64) -> terrane::Result<Mesh> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("solid").with_extension(format.extensions[0]);
    let options = SinkOptions { solid_base: Some(base), ..SinkOptions::default() };
    let written = held::write(format, &path, mesh, &options, 100);
    if written.is_err() {
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
    written?;
    let source = mesh::open(&path).unwrap();
    assert!(source.info().solid);
    Ok(held::read(&*source, 1000).unwrap())
}

#[test]
fn every_edge_of_a_3mf_has_two_triangles_by_their_vertices() {
    let format = mesh::by_path("a.3mf".as_ref(), None).unwrap();
    let surfaces = [
        held::surface(1, 9),
        held::surface(40, 1000),
        held::surface(41, 205),
        held::surface(30, 31),
    ];
    let mut middles = 0;
    for mesh in surfaces {
        let solid = solid_in(format, &mesh, BASE).unwrap();
        let mut edges = std::collections::HashMap::new();
        for [a, b, c] in &solid.triangles {
            for edge in [[*a, *b], [*b, *c], [*c, *a]] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        for ([a, b], count) in &edges {
            assert_eq!((*count, edges.get(&[*b, *a])), (1, Some(&1)), "{a} {b}");
        }
        assert!(solid.triangles.iter().all(|[a, b, c]| a != b && b != c && c != a));
        middles += solid.vertices.len() - 2 * mesh.vertices.len();
        let corners = held::corners(&solid);
        let area = |[a, b, c]: &[Point3; 3]| {
            let [u, v] = [b, c].map(|p| [0, 1, 2].map(|i| p[i] - a[i]));
            (0..3).any(|i| u[i] * v[(i + 1) % 3] != u[(i + 1) % 3] * v[i])
        };
        assert!(corners.iter().all(area), "a triangle without an area");
    }
    assert!(middles > 0, "no outlines touch");
}

#[test]
fn every_edge_has_two_triangles_that_run_opposite_ways() {
    // Holes that do not touch each other, so that no vertex has two outlines.
    for mesh in [held::surface(1, 9), held::surface(40, 1000), held::surface(41, 205)] {
        let triangles = solid(&mesh, BASE).unwrap();
        let edges = edges(&triangles);
        for ([a, b], count) in &edges {
            assert_eq!((*count, edges.get(&[*b, *a])), (1, Some(&1)), "{a:?} {b:?}");
        }
        let corners = triangles.iter().flatten();
        let low = corners.clone().map(|p| p[2]).fold(f64::INFINITY, f64::min);
        assert_eq!(low, BASE);
        assert!(triangles.len() > 2 * mesh.triangles.len());
    }
}

#[test]
fn where_outlines_touch_only_the_upright_edge_has_four_triangles() {
    // Cells left out along a diagonal touch at their corners.
    let triangles = solid(&held::surface(30, 31), BASE).unwrap();
    let edges = edges(&triangles);
    let mut pinches = 0;
    for ([a, b], count) in &edges {
        assert_eq!(Some(count), edges.get(&[*b, *a]), "as many one way as the other");
        let is_upright = a[..2] == b[..2];
        assert!(*count == 1 || *count == 2 && is_upright, "{count} at {a:?} {b:?}");
        pinches += count - 1;
    }
    assert!(pinches > 0, "no outlines touch");
}

#[test]
fn a_solid_far_from_zero_has_its_base_where_it_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("solid.stl");
    let options = SinkOptions { solid_base: Some(2e7 - 100.0), ..SinkOptions::default() };
    let header = mesh::MeshHeader { origin: [0.0, 0.0, 2e7], ..held::header() };
    let corners = [[[0.0, 0.0, 2e7 + 0.25], [30.0, 0.0, 2e7 - 0.5], [0.0, 30.0, 2e7]]];
    let mut sink = (stl().create)(&path, &header, &options).unwrap();
    let [vertices] = &corners;
    let batch =
        mesh::MeshBatch { vertices, values: &[], triangles: &[[0, 1, 2]], corners: &corners };
    sink.push(batch).unwrap();
    sink.finish().unwrap();
    let source = mesh::open(&path).unwrap();
    assert_eq!(source.info().origin, [0.0, 0.0, 2e7]);
    let found = held::corners(&held::read(&*source, 1000).unwrap());
    assert!(found.contains(&corners[0]), "heights come back to the bit");
    let low = found.iter().flatten().map(|p| p[2]).fold(f64::INFINITY, f64::min);
    assert_eq!(low, 2e7 - 100.0);
}

#[test]
fn the_volume_is_that_under_the_surface() {
    let mesh = held::surface(20, 1000);
    let under = |corners: &[Point3; 3]| {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        area * (a[2] + b[2] + c[2] - 3.0 * BASE)
    };
    let expected: f64 = held::corners(&mesh).iter().map(under).sum();
    for format in formats() {
        let found = six_volumes(&held::corners(&solid_in(format, &mesh, BASE).unwrap()));
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} is not {expected}");
    }
}

#[test]
fn a_base_that_is_not_below_the_surface_is_refused() {
    for base in [36.0, 50.0, 1e9, f64::NAN, 1e300] {
        for format in formats() {
            let error = solid_in(format, &held::surface(5, 99), base).err().unwrap();
            assert_eq!(error.kind(), ErrorKind::Usage, "{error}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let options = SinkOptions { solid_base: Some(10.0), ..SinkOptions::default() };
    let mut header = held::header();
    header.bounds = [[0.0, 0.0, 10.0], [1.0, 1.0, 90.0]];
    let early = (stl().create)(&folder.path().join("a.stl"), &header, &options).err().unwrap();
    assert!(early.to_string().contains("choose a base below"), "{early}");
}

#[test]
fn corners_must_come_with_the_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let options = SinkOptions::default();
    let header = held::header();
    let mut sink = (stl().create)(&folder.path().join("a.stl"), &header, &options).unwrap();
    assert!(sink.wants_corners());
    let vertices = [held::ORIGIN; 3];
    let batch =
        mesh::MeshBatch { vertices: &vertices, values: &[], triangles: &[[0, 1, 2]], corners: &[] };
    assert_eq!(sink.push(batch).unwrap_err().kind(), ErrorKind::Usage);
}
