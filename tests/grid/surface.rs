//! Grids by triangulation: the same as from all points at once, whatever the voids, blocks, threads and
//! memory; and agreement with planes.

use std::path::Path;

use crate::support::{Lots, Memory, frame, job, read, run};
use terrane_base::geom::{Point, PointFrame};
use terrane_cloud::{CloudOpenOptions, PointSource};
use terrane_delaunay::{
    ConvexHull, FixedPosition, LoadedPoints, Location, PointBins, TriangleFinder, interpolate,
};
use terrane_engine::Resources;

/// All points of a source.
fn all(source: &dyn PointSource) -> Vec<Point> {
    let mut points = Vec::new();
    for part in 0..source.parts() {
        let mut each = |batch: &[Point]| {
            points.extend_from_slice(batch);
            Ok(())
        };
        source.positions(part, &mut each).unwrap();
    }
    points
}

/// An airborne cloud with voids of 15 to 60 m on the lines between tiles.
fn survey() -> (PointFrame, Vec<Point>) {
    let name = "synth:cloud,size=300,density=4,seed=5,voids=14,tile=75".to_owned();
    let source = terrane_cloud::source(&[name], &CloudOpenOptions::default()).unwrap();
    (source.info().frame, all(&*source))
}

/// The heights at the centres of cells of 1 by the triangulation of all points at once.
fn untiled(
    frame: &PointFrame,
    points: &[Point],
    [west, north]: [f64; 2],
    width: usize,
) -> Vec<f32> {
    let hull = ConvexHull::of(points.to_vec());
    let bins = PointBins::new(points);
    let space = LoadedPoints::whole(&bins);
    let mut finder = TriangleFinder::new(&space, &hull);
    let world = |steps: f64| steps * frame.scale[2] + frame.offset[2];
    let height = |i: usize| {
        let (x, y) = (west + 0.5 + (i % width) as f64, north - 0.5 - (i / width) as f64);
        let at = FixedPosition::from_steps(frame.steps(0, x), frame.steps(1, y));
        match finder.find(at).unwrap() {
            Location::At(point) => world(f64::from(point.z)) as f32,
            Location::Triangle(corners) => world(interpolate(&corners, at)) as f32,
            Location::Outside => f32::NAN,
        }
    };
    (0..width * width).map(height).collect()
}

fn gridded(source: &Memory, output: &Path, stats: &str, threads: usize, memory: u64) -> Vec<f64> {
    let mut job = job(output, stats, 1.0);
    job.resources = Resources { threads, memory, ..Resources::default() };
    job.overwrite = true;
    run(source, &job);
    read(output, 1).values
}

#[test]
fn no_cell_differs_from_the_triangulation_of_all_points() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("tin.tif");
    let (frame, points) = survey();
    let source = Memory::new(frame, &points, 10_000);
    run(&source, &job(&output, "tin", 1.0));
    let written = read(&output, 1);
    let whole = untiled(&frame, &points, written.corner, written.width);
    let voids = whole.iter().filter(|v| v.is_nan()).count();
    assert!(whole.len() >= 300 * 300 && voids < whole.len() / 10, "{voids} of {}", whole.len());
    let is_same = |(a, b): (&f64, &f32)| (a.is_nan() && b.is_nan()) || *a as f32 == *b;
    let differing = written.values.iter().zip(&whole).filter(|pair| !is_same(*pair)).count();
    assert_eq!(differing, 0);
}

#[test]
fn order_threads_and_memory_leave_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("tin.tif");
    let (frame, mut points) = survey();
    for stats in ["tin", "natural"] {
        gridded(&Memory::new(frame, &points, 7000), &output, stats, 1, 4 << 30);
        let first = std::fs::read(&output).unwrap();
        let mut lots = Lots(3);
        for i in (1..points.len()).rev() {
            points.swap(i, lots.below(i as u32 + 1) as usize);
        }
        gridded(&Memory::new(frame, &points, 999), &output, stats, 3, 256 << 20);
        assert!(first == std::fs::read(&output).unwrap(), "{stats}");
    }
}

#[test]
fn planes_are_reproduced_and_beyond_the_hull_is_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("plane.tif");
    let mut lots = Lots(11);
    let mut plane = || {
        let (x, y) = (lots.below(5000), lots.below(5000));
        Point::new(x, y, 3 * x - 2 * y)
    };
    let points: Vec<Point> = (0..4000).map(|_| plane()).collect();
    let source = Memory::new(frame(0.01, [10.0, 20.0, 5.0]), &points, 1000);
    for stats in ["tin", "natural"] {
        let mut job = job(&output, stats, 1.0);
        (job.overwrite, job.sample_type) = (true, terrane_raster::SampleType::F64);
        job.placement.extent = Some([0.0, 10.0, 70.0, 80.0]);
        run(&source, &job);
        let written = read(&output, 1);
        let mut found = 0;
        for (i, value) in written.values.iter().enumerate().filter(|(_, v)| !v.is_nan()) {
            let x = written.corner[0] + 0.5 + (i % written.width) as f64 - 10.0;
            let y = written.corner[1] - 0.5 - (i / written.width) as f64 - 20.0;
            assert!((value - (3.0 * x - 2.0 * y + 5.0)).abs() < 1e-6, "{stats} {value}");
            found += 1;
        }
        assert!((2300..=2500).contains(&found), "{found} of 2500 cells");
    }
}

#[test]
fn long_edges_are_no_surface() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("edges.tif");
    let (frame, points) = survey();
    let source = Memory::new(frame, &points, 10_000);
    let valid = |max_edge| {
        let mut job = job(&output, "tin", 1.0);
        (job.overwrite, job.max_edge) = (true, max_edge);
        run(&source, &job).bands[0].valid
    };
    let (all, short) = (valid(None), valid(Some(8.0)));
    assert!(short + 3000 < all && short > all / 2, "{short} of {all}");
}
