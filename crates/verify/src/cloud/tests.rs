//! Meshes that the job makes of clouds, sound and spoiled, on any machine.

mod lines;
#[path = "../../../lidar/src/test_cloud.rs"]
#[allow(dead_code)]
mod test_cloud;

use std::path::Path;

use super::*;
use terrane_base::geom::{Point, Point3, PointFrame};
use terrane_cloud::CloudOpenOptions;
use terrane_engine::Silent;
use terrane_engine::plan::RunControl;
use terrane_engine::run_statistics::RunStatistics;
use terrane_lidar::cloud_tin::{self, CloudTinJob};
use terrane_mesh::{self as mesh, MeshInfo};
use test_cloud::PointSample;

const FRAME: PointFrame =
    PointFrame { scale: [0.01, 0.01, 0.01], offset: [500_000.0, 4_750_000.0, 0.0] };
/// Steps of height allowed.
const STEPS: i32 = 7;

fn few(points: Vec<Point>) -> PointSample {
    PointSample::new(FRAME, points)
}

/// A rough terrain; some points lie above others.
fn terrain(count: usize, crowded: bool) -> PointSample {
    let mut state = 7u64;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        ((state >> 33) % below) as i32
    };
    let point = |i: usize| {
        let far = if crowded && !i.is_multiple_of(50) { 700 } else { 40_000 };
        let (x, y) = (random(far) - 300, random(far) + 11);
        let wave = (f64::from(x) / 90.0).sin() * 25.0 + f64::from(y) / 40.0;
        Point::new(x, y, wave as i32 + random(9))
    };
    let mut points: Vec<Point> = (0..count).map(point).collect();
    let above: Vec<Point> =
        points.iter().step_by(100).map(|p| Point { z: p.z + 3000, ..*p }).collect();
    points.extend(above);
    few(points)
}

fn resources(threads: usize, memory: u64, folder: &Path) -> Resources {
    Resources { threads, memory, temp_dir: Some(folder.to_path_buf()) }
}

/// Writes the mesh of a cloud and opens it.
fn made(cloud: &PointSample, tolerance: f64, folder: &Path, name: &str) -> Box<dyn MeshSource> {
    made_with(ConstraintFeatures::default(), cloud, tolerance, folder, name)
}

/// As above, with constraints.
fn made_with(
    features: ConstraintFeatures,
    cloud: &PointSample,
    tolerance: f64,
    folder: &Path,
    name: &str,
) -> Box<dyn MeshSource> {
    let job = CloudTinJob {
        inputs: "few".into(),
        options: CloudOpenOptions::default(),
        output: folder.join(name),
        format: None,
        overwrite: true,
        placing: Default::default(),
        tolerance,
        keep_points: None,
        breaklines: None,
        measure: false,
        resources: resources(2, 1 << 30, folder),
    };
    let format = mesh::by_path(&job.output, None).unwrap();
    let at = RunControl { progress: &Silent, cancel: &Cancel::default() };
    cloud_tin::make(&job, cloud, features, format, 1 << 17, at).unwrap();
    mesh::open(&job.output).unwrap()
}

fn proved(mesh: &dyn MeshSource, cloud: &PointSample, resources: &Resources) -> CloudVerifyReport {
    proved_with(ConstraintFeatures::default(), mesh, cloud, resources)
}

fn proved_with(
    features: ConstraintFeatures,
    mesh: &dyn MeshSource,
    cloud: &PointSample,
    resources: &Resources,
) -> CloudVerifyReport {
    let stated = mesh.info().promises().unwrap();
    let tolerance = stated.max_error.map(|error| error.value);
    let cancel = Cancel::default();
    let report =
        prove_cloud(mesh, cloud, tolerance, features, resources, &Silent, &cancel).unwrap();
    // Without values that differ from run to run.
    CloudVerifyReport {
        of: CloudProofFindings { points_per_second: 0.0, ..report.of },
        run: RunStatistics::default(),
        ..report
    }
}

/// A mesh in memory.
struct Memory {
    info: MeshInfo,
    vertices: Vec<Point3>,
    triangles: Vec<[u64; 3]>,
}

impl Memory {
    fn of(mesh: &dyn MeshSource) -> Self {
        let info = mesh.info().clone();
        let mut vertices = vec![[0.0; 3]; info.vertices as usize];
        let mut triangles = vec![[0; 3]; info.triangles as usize];
        mesh.read_vertices(0, &mut vertices).unwrap();
        mesh.read_triangles(0, &mut triangles).unwrap();
        Self { info, vertices, triangles }
    }

    fn settled(mut self) -> Self {
        self.info.vertices = self.vertices.len() as u64;
        self.info.triangles = self.triangles.len() as u64;
        self
    }
}

impl MeshSource for Memory {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        out.copy_from_slice(&self.vertices[first as usize..][..out.len()]);
        Ok(())
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        out.copy_from_slice(&self.triangles[first as usize..][..out.len()]);
        Ok(())
    }
}

fn tolerance() -> f64 {
    f64::from(STEPS) * 0.01
}

#[test]
fn meshes_of_every_format_are_proved() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = terrain(6000, false);
    let resources = resources(2, 64 << 20, folder.path());
    for name in ["a.ply", "a.obj", "a.glb", "a.stl"] {
        for tolerance in [0.0, tolerance()] {
            let mesh = made(&cloud, tolerance, folder.path(), name);
            let report = proved(&*mesh, &cloud, &resources);
            assert_eq!(report.verdict.failures, Vec::<String>::new(), "{name} at {tolerance}");
            assert!(report.verdict.passed && report.made_by_terrane);
            assert_eq!(
                (report.free_vertices, report.of.off_point_vertices.count),
                (0, 0),
                "{name}"
            );
            assert_eq!(report.of.tolerance_steps, Some((tolerance * 100.0).round()), "{name}");
            assert_eq!(report.non_delaunay_edges.count, 0);
            assert_eq!(report.of.covered_points, report.of.judged_points);
            assert!(report.of.stacked_points >= 60 && report.of.judged_points <= 6000);
            assert!(report.max_error.unwrap() <= tolerance);
            assert_eq!(report.mesh_area, report.of.hull_area);
        }
    }
}

#[test]
fn threads_and_memory_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for crowded in [false, true] {
        let cloud = terrain(20_000, crowded);
        let mut mesh = Memory::of(&*made(&cloud, tolerance(), folder.path(), "b.ply"));
        // Some of every kind of finding.
        mesh.vertices[50][2] += 0.03;
        mesh.vertices[60][0] += 0.01;
        mesh.vertices[70][1] += 0.004;
        mesh.triangles.swap_remove(90);
        mesh.triangles[30].swap(0, 1);
        mesh.vertices.push(mesh.vertices[5]);
        let mesh = mesh.settled();
        let report =
            |threads, memory| proved(&mesh, &cloud, &resources(threads, memory, folder.path()));
        let one = report(1, 1 << 30);
        assert!(one.verdict.failures.len() > 5, "{:?}", one.verdict.failures);
        assert_eq!(report(3, 1 << 30), one);
        assert_eq!(report(1, 1 << 20), one);
        assert_eq!(report(3, 3 << 20), one);
    }
}

#[test]
fn little_memory_spreads_crowds_again() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = terrain(20_000, true);
    let mesh = made(&cloud, 0.0, folder.path(), "c.ply");
    let spilled = |memory| {
        let resources = resources(1, memory, folder.path());
        let report = prove_cloud(
            &*mesh,
            &cloud,
            None,
            ConstraintFeatures::default(),
            &resources,
            &Silent,
            &Cancel::default(),
        );
        report.unwrap().run.spilled_bytes.unwrap()
    };
    assert!(spilled(1 << 20) > spilled(1 << 30) * 3 / 2);
}

/// Failures reported for a cloud and its mesh after `spoil`.
fn failures(spoil: impl FnOnce(&mut Memory, &mut Vec<Point>)) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut cloud = terrain(3000, false);
    let mut mesh = Memory::of(&*made(&cloud, tolerance(), folder.path(), "d.ply"));
    spoil(&mut mesh, &mut cloud.points);
    let cloud = few(cloud.points);
    let report = proved(&mesh.settled(), &cloud, &resources(2, 64 << 20, folder.path()));
    assert_eq!(report.verdict.passed, report.verdict.failures.is_empty());
    report.verdict.failures
}

fn says(failures: &[String], what: &str) -> bool {
    failures.iter().any(|failure| failure.contains(what))
}

#[test]
fn planted_faults_are_named() {
    assert_eq!(failures(|_, _| {}), Vec::<String>::new());
    let lifted = failures(|mesh, _| mesh.vertices[40][2] += 0.01);
    assert!(says(&lifted, "1 vertices off the points, first at x 500"), "{lifted:?}");
    let moved = failures(|mesh, _| mesh.vertices[40][0] += 0.01);
    assert!(says(&moved, "1 vertices off the points"), "{moved:?}");
    let free = failures(|mesh, _| mesh.vertices[40][1] += 0.004);
    assert!(says(&free, "1 vertices off the points"), "{free:?}");
    let removed = failures(|mesh, _| drop(mesh.triangles.drain(40..41)));
    assert!(says(&removed, "cracks") && says(&removed, "area"), "{removed:?}");
    let flipped = failures(|mesh, _| mesh.triangles[40].swap(1, 2));
    assert!(says(&flipped, "1 inverted") && says(&flipped, "3 non-manifold"), "{flipped:?}");
    let doubled = failures(|mesh, _| mesh.triangles.push(mesh.triangles[40]));
    assert!(says(&doubled, "3 non-manifold") && says(&doubled, "area"), "{doubled:?}");
    let twice = failures(|mesh, _| mesh.vertices.push(mesh.vertices[40]));
    assert!(says(&twice, "1 duplicate") && twice.len() == 1, "{twice:?}");
    let idle = failures(|mesh, _| mesh.vertices.push(FRAME.world(Point::new(5000, 5000, 0))));
    assert!(says(&idle, "1 unused vertices") && idle.len() == 1, "{idle:?}");
    let crack = failures(|mesh, _| {
        let [x, y, z] = mesh.vertices[mesh.triangles[40][0] as usize];
        mesh.triangles[40][0] = mesh.vertices.len() as u64;
        mesh.vertices.push([x + 0.01, y, z]);
    });
    assert!(says(&crack, "cracks") && says(&crack, "area"), "{crack:?}");
    let lost = failures(|mesh, _| mesh.vertices[40][2] = f64::NAN);
    assert!(says(&lost, "1 vertices without a usable position"), "{lost:?}");
    let outside = failures(|_, points| points.push(Point::new(-301, 20_000, 0)));
    assert!(says(&outside, "1 points not covered") && says(&outside, "area"), "{outside:?}");
}

#[test]
fn the_tolerance_is_closed_to_the_step() {
    // Points over the middle of a triangle that lies level.
    let corners = [[0, 0], [900, 0], [0, 900]].map(|[x, y]| Point::new(x, y, 0));
    let cloud = |z| few(corners.into_iter().chain([Point::new(300, 300, z)]).collect());
    let details = vec![("max error".to_owned(), tolerance().to_string())];
    let info = MeshInfo { details, ..MeshInfo::plain("test", 3, 1) };
    let vertices = corners.map(|point| FRAME.world(point)).to_vec();
    let mesh = Memory { info, vertices, triangles: vec![[0, 1, 2]] };
    let folder = tempfile::tempdir().unwrap();
    let report = |z| proved(&mesh, &cloud(z), &resources(1, 1 << 20, folder.path()));
    for sign in [-1, 1] {
        assert!(report(sign * STEPS).verdict.passed);
        let over = report(sign * (STEPS + 1));
        assert!(says(&over.verdict.failures, "1 points further from the mesh than the tolerance"));
        assert_eq!(over.over_tolerance.first, Some([500_003.0, 4_750_003.0]));
    }
}

#[test]
fn what_cannot_be_proved_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = terrain(300, false);
    let mut mesh = Memory::of(&*made(&cloud, tolerance(), folder.path(), "e.ply"));
    let resources = resources(1, 1 << 20, folder.path());
    let prove = |mesh: &Memory, cloud: &PointSample, tolerance| {
        let cancel = Cancel::default();
        prove_cloud(
            mesh,
            cloud,
            tolerance,
            ConstraintFeatures::default(),
            &resources,
            &Silent,
            &cancel,
        )
        .unwrap_err()
    };
    assert_eq!(prove(&mesh, &cloud, Some(-1.0)).kind(), ErrorKind::Usage);
    let line = few((0..9).map(|i| Point::new(i, 2 * i, 3)).collect());
    for cloud in [line, few(Vec::new())] {
        let error = prove(&mesh, &cloud, None);
        assert!(error.to_string().contains("no surface"), "{error}");
    }
    mesh.triangles[7][1] = 1 << 40;
    let error = prove(&mesh, &cloud, None);
    assert!(error.to_string().contains("triangle 7"), "{error}");
    assert_eq!(error.kind(), ErrorKind::BadInput);
}
