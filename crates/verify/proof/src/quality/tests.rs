//! Meshes of known quality, and the same found however the plane is divided.

use super::*;
use crate::{DomainLayout, ProofPosition, ProofVertex, Snap};
use proptest::prelude::*;

/// A lattice of `side` x `side` squares, each cut along one diagonal.
fn squares(side: i64, size: f64) -> Vec<[[f64; 3]; 3]> {
    let at = |c: i64, r: i64| [c as f64 * size, r as f64 * size, 0.0];
    let cells = (0..side).flat_map(|r| (0..side).map(move |c| (c, r)));
    cells
        .flat_map(|(c, r)| {
            let [a, b, d, e] = [at(c, r), at(c + 1, r), at(c, r + 1), at(c + 1, r + 1)];
            [[a, b, e], [a, e, d]]
        })
        .collect()
}

fn bounds(mesh: &[[[f64; 3]; 3]]) -> [[f64; 3]; 2] {
    let fold = |f: fn(f64, f64) -> f64, start: f64| {
        std::array::from_fn(|axis| mesh.iter().flatten().map(|p| p[axis]).fold(start, f))
    };
    [fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY)]
}

/// As [`measure`], with the plane divided into domains of `size`, or whole.
fn quality(mesh: &[[[f64; 3]; 3]], size: Option<[u32; 2]>) -> (Quality, f64) {
    let plan = QualityLattice::new(bounds(mesh), [0.0; 3], false);
    let vertex = |p: [f64; 3]| plan.snap(p).vertex().unwrap();
    let triangles: Vec<ProofTriangle> =
        mesh.iter().map(|corners| ProofTriangle { corners: corners.map(vertex) }).collect();
    let grid = plan.grid();
    let layout =
        DomainLayout { grid, size: size.unwrap_or(grid.map(|side| side.next_multiple_of(32))) };
    let mut all = Quality::default();
    for domain in (0..layout.len()).rev().map(|i| layout.domain(i)) {
        let mut own = Quality::default();
        let touches = |t: &&ProofTriangle| t.positions().iter().any(|p| domain.owns(*p));
        let triangles: Vec<ProofTriangle> = triangles.iter().filter(touches).copied().collect();
        measure(
            &QualityPart { domain, triangles: &triangles, plan: &plan, has_space: true },
            &mut own,
        );
        all.merge(&own);
    }
    (all, plan.cell())
}

#[test]
fn a_lattice_of_squares_is_known() {
    let (found, cell) = quality(&squares(10, 0.3), None);
    assert_eq!((found.vertices, found.triangles, found.edges), (121, 200, 320));
    assert_eq!((found.border, found.tangled, found.empty, found.inverted), (40, 0, 0, 0));
    // Diagonals have four corners on a circle, though 0.3 is no float; their neighbours have not.
    let pairs = DelaunayCounts { delaunay: 180, cocircular: 100, not_delaunay: 0, folded: 0 };
    assert_eq!(found.pairs, pairs);
    let length = found.lengths.value() * cell;
    assert!((length - (220.0 * 0.3 + 100.0 * 0.3 * 2f64.sqrt())).abs() < 1e-9, "{length}");
    // Corners have 2 or 3, rims 4, the inside 6.
    let by_degree = [(2, 2), (3, 2), (4, 36), (6, 81)];
    assert_eq!(found.degree_range, Some([2, 6]));
    assert!(by_degree.into_iter().all(|(degree, count)| found.degrees[degree] == count));
    assert_eq!((found.plan.percentile(50), found.plan.below), (Some(45.0), [0; 5]));
    assert!((found.largest_angle.unwrap() - 90.0).abs() < 1e-9);
    assert_eq!(found.aspect_histogram[0], 200);
}

#[test]
fn what_is_odd_is_counted() {
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 1.0, 5.0], [2.0, -1.0, 0.0]];
    let of = |mesh: &[[[f64; 3]; 3]]| quality(mesh, None).0;
    // A flat pair on its long diagonal.
    assert_eq!(of(&[[a, b, c], [b, a, d]]).pairs.not_delaunay, 1);
    assert_eq!(of(&[[a, d, c], [d, b, c]]).pairs.delaunay, 1);
    let upside_down = of(&[[b, a, c]]);
    assert_eq!((upside_down.inverted, upside_down.border), (1, 3));
    let same_way = of(&[[a, b, c], [a, b, d]]);
    assert_eq!((same_way.tangled, same_way.pairs), (1, DelaunayCounts::default()));
    let overhang = of(&[[a, b, c], [b, a, [2.0, 3.0, 0.0]]]);
    assert_eq!(overhang.pairs.folded, 1);
    let empty = of(&[[a, b, [2.0, 0.0, 9.0]]]);
    assert_eq!((empty.empty, empty.plan.count(), empty.space.count()), (1, 0, 1));
    assert_eq!(of(&[[a, a, a]]).degrees[0], 1);
}

#[test]
fn space_is_not_plan() {
    let (found, _) = quality(&[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]], None);
    let angle = |angles: &AcuteAngles| angles.min.unwrap();
    assert!((angle(&found.plan) - 45.0).abs() < 1e-9);
    assert!((angle(&found.space) - 0.5f64.sqrt().atan().to_degrees()).abs() < 1e-9);
}

/// By lists of vertices and edges, a triangle at a time.
fn slow(mesh: &[[[i64; 2]; 3]]) -> (u64, u64, u64, Vec<u64>) {
    let mut vertices: Vec<[i64; 2]> = mesh.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut edges = Vec::new();
    for [a, b, c] in mesh.iter().copied() {
        edges.extend([[a, b], [b, c], [c, a]].map(|[p, q]| [p.min(q), p.max(q)]));
    }
    edges.retain(|[p, q]| p != q);
    edges.sort_unstable();
    let all = edges.clone();
    edges.dedup();
    let border = edges.iter().filter(|e| all.iter().filter(|f| f == e).count() == 1).count();
    let mut degrees = vec![0; Quality::MAX_DEGREE + 1];
    for v in &vertices {
        let degree = edges.iter().filter(|e| e.contains(v)).count();
        degrees[degree.min(Quality::MAX_DEGREE)] += 1;
    }
    (vertices.len() as u64, edges.len() as u64, border as u64, degrees)
}

proptest! {
    /// Triangles at random, which no mesh would have, and domains of any size.
    #[test]
    fn like_lists_of_edges_however_the_plane_is_divided(
        mesh in prop::collection::vec(prop::array::uniform3([0i64..5, 0i64..5]), 1..40),
        wide in 1u32..40, high in 1u32..40,
    ) {
        let float = |[x, y]: [i64; 2]| [x as f64, y as f64, (x * y) as f64];
        let floats: Vec<_> = mesh.iter().map(|t| t.map(float)).collect();
        let (whole, _) = quality(&floats, None);
        let (vertices, edges, border, degrees) = slow(&mesh);
        prop_assert_eq!((whole.vertices, whole.edges, whole.border), (vertices, edges, border));
        prop_assert_eq!(&whole.degrees[..], &degrees);
        prop_assert_eq!(whole.triangles, mesh.len() as u64);
        // Five units are some 2^28 cells.
        let size = [wide, high].map(|n| n << 24);
        prop_assert_eq!(quality(&floats, Some(size)).0, whole);
    }
}

#[test]
fn vertices_are_numbered_in_the_order_of_the_lattice() {
    // A degree is told of by the number of its vertex: whole cells have another key than others.
    for shift in [0, 1] {
        let at = |col: i64, row: i64| ProofVertex {
            at: ProofPosition { col: (col << 30) + shift, row: row << 30 },
            z: 0.0,
        };
        let fan = [[1, 2], [0, 0], [2, 0], [4, 2], [2, 4], [0, 4]];
        let corner = |i: usize| at(fan[i][0], fan[i][1]);
        let triangles: Vec<ProofTriangle> = (1..5)
            .map(|i| ProofTriangle { corners: [corner(0), corner(i), corner(i + 1)] })
            .collect();
        let plan = QualityLattice::new([[0.0; 3], [1.0, 1.0, 0.0]], [0.0; 3], false);
        let layout = DomainLayout { grid: [10; 2], size: [32; 2] };
        let mut found = Quality::default();
        let domain = layout.domain(0);
        measure(
            &QualityPart { domain, triangles: &triangles, plan: &plan, has_space: false },
            &mut found,
        );
        assert_eq!((found.degrees[2], found.degrees[3], found.degrees[5]), (2, 3, 1));
        assert_eq!(found.space.count(), 0);
    }
}
