//! Regions against the whole, and against the brute force of looking at every point.

mod lines;
mod plans;

use super::*;
use crate::cloud_tin::prepared::in_steps;
use crate::cloud_tin::region_mesh::RegionMesh;
use crate::point_index::{PointStoreSetup, Tiling};
use crate::test_cloud::PointSample;
use std::sync::{Arc, Mutex};
use terrane_base::error::ErrorKind;
use terrane_base::geom::Point3;
use terrane_engine::{Resources, Silent};
use terrane_mesh::MeshBatch;
use terrane_tin::scatter::{InsertUntilWithin, ScatterMesh};

const FRAME: PointFrame = PointFrame { scale: [0.01; 3], offset: [1000.0, 2000.0, 0.0] };

fn source(points: Vec<Point>, claimed: u64) -> PointSample {
    PointSample::new(FRAME, points).claiming(claimed)
}

/// Vertices and triangles.
type Parts = (Vec<Point3>, Vec<[u64; 3]>);

#[derive(Clone, Default)]
struct Collected(Arc<Mutex<Parts>>);

impl MeshSink for Collected {
    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
        let mut all = self.0.lock().unwrap();
        all.0.extend_from_slice(batch.vertices);
        all.1.extend_from_slice(batch.triangles);
        let vertices = all.0.len() as u64;
        assert!(batch.triangles.iter().flatten().all(|&id| id < vertices), "ids look ahead");
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        Ok(0)
    }
}

/// The mesh of a source: vertices, triangles, and how it went.
fn mesh(
    source: &PointSample,
    tolerance: f64,
    region: u64,
    threads: usize,
    memory: u64,
) -> (Vec<Point>, Vec<[u64; 3]>, CloudTinOutcome) {
    mesh_with(&OnCloud::default(), source, tolerance, region, threads, memory)
}

/// The same with constraints.
fn mesh_with(
    kept: &OnCloud,
    source: &PointSample,
    tolerance: f64,
    region: u64,
    threads: usize,
    memory: u64,
) -> (Vec<Point>, Vec<[u64; 3]>, CloudTinOutcome) {
    let folder = tempfile::tempdir().unwrap();
    let (progress, cancel) = (&Silent, &Cancel::default());
    let filling =
        PointStoreSetup { threads, memory, folder: folder.path(), within: None, progress, cancel };
    let tiling = Tiling::new(source.info.bounds.unwrap(), source.info.count);
    let points = PointStore::fill(source, tiling, &filling).unwrap();
    let hull = points.hull().unwrap();
    let mut lines = CloudLines::new(kept, hull.clone(), points.tiling());
    let regions = CloudTinRegions::new(&points, &lines.by_square(points.tiling()), region);
    lines.divide(&regions, points.tiling());
    let nearest = nearest_points(kept, &points, &hull, source.info.bounds.unwrap()).unwrap();
    let work = CloudTinContext {
        points: &points,
        regions: &regions,
        lines: &lines,
        threads,
        vertex_bytes: memory,
        measure: true,
        folder: folder.path(),
        progress,
        cancel,
    };
    let sink = Collected::default();
    let boxed: Box<dyn MeshSink> = Box::new(sink.clone());
    let made = triangulate(
        &work,
        tolerance,
        &hull.corners(),
        &nearest.points,
        &FRAME,
        || Ok(boxed),
        &mut CloudTinClock::default(),
    )
    .unwrap();
    let (vertices, triangles) = sink.0.lock().unwrap().clone();
    let point = |v: &Point3| {
        let steps = [0, 1, 2].map(|axis| FRAME.steps(axis, v[axis]).round() as i32);
        Point::new(steps[0], steps[1], steps[2])
    };
    (vertices.iter().map(point).collect(), triangles, made)
}

/// A number from 0 to `below`.
fn random(state: &mut u64, below: i32) -> i32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    ((*state >> 33) % below as u64) as i32
}

/// Rolling ground with an L-shaped outline, voids, a dense cluster and a line of points.
fn ground(count: usize) -> Vec<Point> {
    let (mut state, mut points) = (7, Vec::new());
    while points.len() < count {
        let (x, y) = match points.len() % 20 {
            0 => (3000 + random(&mut state, 60), 3000 + random(&mut state, 60)),
            1 => (random(&mut state, 20_000), 0),
            _ => (random(&mut state, 20_000), random(&mut state, 20_000)),
        };
        let is_void = [(5000, 5000, 1500), (12_000, 4000, 2500), (9000, 9900, 800)]
            .iter()
            .any(|(u, v, r): &(i32, i32, i32)| (x - u).pow(2) + (y - v).pow(2) < r * r);
        if (x > 10_000 && y > 10_000) || is_void {
            continue;
        }
        let wave = |t: i32, long: f64| (f64::from(t) / long).sin();
        let height = 300.0 * wave(x, 900.0) + 200.0 * wave(y, 700.0) + 100.0 * wave(x + y, 300.0);
        points.push(Point::new(x, y, height as i32 + random(&mut state, 9)));
    }
    points
}

/// Triangles as points, in order.
fn shapes(vertices: &[Point], triangles: &[[u64; 3]]) -> Vec<[Point; 3]> {
    let shape = |ids: &[u64; 3]| {
        let mut shape = ids.map(|id| vertices[id as usize]);
        let least = (0..3).min_by_key(|&k| shape[k]).unwrap();
        shape.rotate_left(least);
        shape
    };
    let mut all: Vec<_> = triangles.iter().map(shape).collect();
    all.sort_unstable();
    all
}

/// The Delaunay triangulation of all of `vertices` at once.
fn whole(vertices: &[Point]) -> ScatterMesh {
    let mut mesh = ScatterMesh::of_first(vertices).unwrap();
    vertices.iter().for_each(|&p| {
        mesh.insert(p);
    });
    mesh
}

fn shapes_of(mesh: &ScatterMesh) -> Vec<[Point; 3]> {
    let real: Vec<[u64; 3]> = (0..mesh.triangles().len() as u32)
        .filter(|&t| mesh.corners(t).is_some())
        .map(|t| mesh.triangles()[t as usize].corners.map(u64::from))
        .collect();
    shapes(mesh.points(), &real)
}

#[test]
fn regions_give_the_one_triangulation_of_all_vertices_and_keep_the_bound() {
    let source = source(ground(30_000), 30_000 * 100);
    for tolerance in [0.0, 12.5, 60.0] {
        let (vertices, triangles, made) = mesh(&source, tolerance, 2000, 2, 1 << 30);
        let mut reference = whole(&vertices);
        assert_eq!(shapes(&vertices, &triangles), shapes_of(&reference), "{tolerance}");
        assert_eq!((made.written.vertices, made.stacked > 0), (vertices.len() as u64, true));
        let mut points = source.points.clone();
        points.sort_unstable();
        points.dedup_by_key(|p| (p.x, p.y));
        assert_eq!(made.stacked as usize, source.points.len() - points.len());
        let fit = InsertUntilWithin::new(&mut reference, &points, tolerance);
        assert!(!fit.is_open(), "a point is beyond {tolerance}");
        assert!(tolerance == 0.0 || (fit.measure().0 - made.errors.max).abs() < 1e-6);
    }
}

#[test]
fn no_vertex_beyond_the_influence_of_a_region_touches_its_triangles() {
    let source = source(ground(6000), 6000 * 200);
    let folder = tempfile::tempdir().unwrap();
    let tiling = Tiling::new(source.info.bounds.unwrap(), source.info.count);
    let store = PointStore::empty(tiling, folder.path(), 1 << 20);
    store.add(&source.points).unwrap();
    let hull = store.hull().unwrap().corners();
    let (mut state, mut beyond) = (3, 0);
    for &region in &CloudTinRegions::new(&store, &[], 500).all {
        let local = RegionMesh::new(&store, region, &hull).unwrap();
        let (influence, window) = (local.influence(), region.window(&tiling));
        let all = (0..local.mesh.triangles().len() as u32).filter_map(|t| local.mesh.corners(t));
        let sites = all.map(|corners| corners.map(|p| [p.x, p.y]));
        let touches = |t: &[[i32; 2]; 3]| {
            terrane_delaunay::SiteWindow::of(*t).unwrap().intersection(&window).is_some()
        };
        let own: Vec<_> = sites.filter(touches).collect();
        for _ in 0..300 {
            let at = [random(&mut state, 20_000), random(&mut state, 20_000)];
            if !influence.contains(at) {
                let is_hit =
                    |[a, b, c]: &[[i32; 2]; 3]| terrane_delaunay::in_circle(*a, *b, *c, at);
                assert!(!own.iter().any(is_hit), "{at:?} is beyond {influence:?}");
                beyond += 1;
            }
        }
    }
    assert!(beyond > 500, "{beyond}");
}

#[test]
fn threads_memory_and_the_order_of_points_leave_no_trace() {
    let first = source(ground(20_000), 20_000 * 50);
    let mut points = first.points.clone();
    points.reverse();
    points.rotate_left(777);
    let second = source(points, 20_000 * 50);
    for tolerance in [0.0, 20.0] {
        let (vertices, triangles, _) = mesh(&first, tolerance, 3000, 1, 1 << 30);
        let (again, and_again, made) = mesh(&second, tolerance, 3000, 3, 20_000);
        assert!(made.spilled > 100_000);
        assert_eq!((vertices, triangles), (again, and_again));
    }
}

#[test]
fn few_points_and_lines_have_no_surface() {
    let line: Vec<Point> = (0..50).map(|i| Point::new(i, 2 * i, i % 7)).collect();
    for points in [vec![Point::new(1, 1, 1)], line] {
        let source = source(points, 50);
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.ply");
        let job = CloudTinJob::new(vec![], output, 1.0, Resources::default());
        let format = terrane_mesh::by_path(&job.output, None).unwrap();
        let at = RunControl { progress: &Silent, cancel: &Cancel::default() };
        let error = make(&job, &source, ConstraintFeatures::default(), format, REGION_POINTS, at)
            .unwrap_err();
        assert_eq!(error.kind(), ErrorKind::BadInput);
        assert!(!job.output.exists());
    }
}

#[test]
fn whole_steps_stay_whole() {
    assert_eq!((in_steps(0.3, 0.01), in_steps(0.07, 0.001)), (30.0, 70.0));
    assert_eq!(in_steps(0.305, 0.01), 30.5);
}
