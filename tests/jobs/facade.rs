//! The library as a programmer meets it: the same meshes as by other ways, and nothing silently wrong.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use terrane::prelude::*;
use terrane::{Affine, Cancel, Crs, ErrorBound, Progress, Rect, Tin};
use terrane_base::ErrorKind;

const NAME: &str = "synth:rough,size=300,seed=7";

fn heights() -> Vec<f64> {
    let grid = terrane::open(NAME).unwrap();
    grid.heights(grid.info().bounds()).unwrap()
}

/// What is stored in a mesh file.
fn stored(path: &std::path::Path) -> (Vec<[f64; 3]>, Vec<[u64; 3]>) {
    let mesh = terrane_mesh::open(path).unwrap();
    let mut vertices = vec![[0.0; 3]; mesh.info().vertices as usize];
    let mut triangles = vec![[0; 3]; mesh.info().triangles as usize];
    mesh.read_vertices(0, &mut vertices).unwrap();
    mesh.read_triangles(0, &mut triangles).unwrap();
    (vertices, triangles)
}

/// One of three lands in 1,400 where a triangle is left, with tiles as small as hardly anybody chooses.
#[test]
fn a_mesh_in_memory_tells_what_is_not_as_it_was_asked_for() {
    let land = terrane::open("synth:salt,size=570,seed=265").unwrap();
    let make = || land.tin().max_error(10.0).tile(32).drop(false);
    let tin = make().min_angle(26.5).build().unwrap();
    let told = tin.shortfall().unwrap();
    assert!(told.starts_with("1 triangles have an angle below 26.5 degrees"), "{told}");
    assert_eq!(make().build().unwrap().shortfall(), None);
}

#[test]
fn arrays_and_files_give_one_mesh_however_it_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let grid = terrane::open(NAME).unwrap();
    let path = folder.path().join("streamed.ply");
    let report = grid.tin().max_error(2.0).tile(64).write(&path).unwrap();
    let (vertices, triangles) = stored(&path);
    let heights = heights();
    for threads in [1, 3] {
        let info = grid.info();
        let array = Tin::from_array(&heights, 300, 300).unwrap();
        let array = array.place(info.transform, info.crs.clone()).max_error(2.0).tile(64);
        let of_file = grid.tin().max_error(2.0).tile(64).threads(threads).memory("64M");
        for tin in [array.threads(threads).build().unwrap(), of_file.build().unwrap()] {
            assert_eq!(tin.vertices(), vertices);
            let same =
                tin.triangles().iter().map(|t| t.map(u64::from)).eq(triangles.iter().copied());
            assert!(same && tin.max_error() <= 2.0);
            assert_eq!((Some(tin.max_error()), Some(tin.rmse())), (report.max_error, report.rmse));
        }
    }
}

#[test]
fn a_mesh_in_memory_is_written_and_proved() {
    let folder = tempfile::tempdir().unwrap();
    let grid = terrane::open(NAME).unwrap();
    let tin = grid.tin().max_vertices(4000).build().unwrap();
    assert!(tin.vertices().len() <= 4000 && tin.max_error() <= tin.tolerance());
    for format in terrane_mesh::FORMATS {
        let path = folder.path().join("mesh").with_extension(format.extensions[0]);
        assert_eq!(tin.write(&path).unwrap(), path.metadata().unwrap().len());
        let proof = grid.verify(&path).max_error(tin.tolerance()).run().unwrap();
        let surface = grid.verify(&path).bound(ErrorBound::Surface).max_error(1e9).run().unwrap();
        assert!(surface.verdict.passed && surface.of.bound == ErrorBound::Surface);
        assert!(
            proof.verdict.passed && proof.verdict.judged,
            "{}: {:?}",
            format.name,
            proof.verdict.failures
        );
        assert_eq!(tin.write(&path).unwrap_err().kind(), ErrorKind::Usage, "a file is there");
    }
}

#[test]
fn a_clipped_grid_is_clipped_whatever_is_made_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let corners = "500100 4749900, 502700 4749700, 502000 4747200, 500400 4747600, 500100 4749900";
    std::fs::write(path("areas.wkt"), format!("POLYGON (({corners}))")).unwrap();
    std::fs::write(path("areas.prj"), "EPSG:32631").unwrap();
    let (whole, grid) = (terrane::open(NAME).unwrap(), terrane::open(NAME).unwrap());
    let grid = grid.clip(path("areas.wkt")).unwrap();
    let clipped = grid.heights(grid.info().bounds()).unwrap();
    let voids = clipped.iter().filter(|height| height.is_nan()).count();
    assert!(clipped[0].is_nan() && voids > 30_000 && voids < 60_000, "{voids}");
    let report = grid.tin().max_error(2.0).tile(64).write(path("mesh.ply")).unwrap();
    assert_eq!(report.valid_samples as usize, clipped.len() - voids);
    assert!(grid.verify(path("mesh.ply")).run().unwrap().verdict.passed);
    let without = whole.verify(path("mesh.ply")).run().unwrap().verdict;
    assert!(without.failures.concat().contains("clipped to areas.wkt"), "{:?}", without.failures);
    let tin = grid.tin().max_error(2.0).tile(64).build().unwrap();
    assert_eq!(tin.vertices(), stored(&path("mesh.ply")).0);
    let array = Tin::from_array(&clipped, 300, 300).unwrap();
    let array = array.place(grid.info().transform, grid.info().crs.clone());
    assert_eq!(array.max_error(2.0).tile(64).build().unwrap().vertices(), tin.vertices());
    let plan = grid.tin().max_error(2.0).tile(64).plan(path("work"), 2).unwrap();
    plan.run().output(path("planned.ply")).run().unwrap();
    let bytes = |name: &str| std::fs::read(path(name)).unwrap();
    assert!(bytes("planned.ply") == bytes("mesh.ply"));
    grid.convert().write(path("masked.tif")).unwrap();
    let masked = terrane::open(path("masked.tif")).unwrap();
    masked.contour().interval(20.0).write(path("by_hand.geojson")).unwrap();
    grid.contour().interval(20.0).write(path("clipped.geojson")).unwrap();
    assert!(bytes("clipped.geojson") == bytes("by_hand.geojson"));
    let other = terrane::open(NAME).unwrap().clip(path("mesh.ply"));
    assert_eq!(other.err().map(|e| e.kind()), Some(ErrorKind::BadInput));
}

#[test]
fn a_format_that_rounds_heights_states_the_bound_that_holds() {
    let folder = tempfile::tempdir().unwrap();
    let heights: Vec<f64> = (0..64).map(|i| f64::from(i * i % 13) / 10.0).collect();
    let tin = Tin::from_array(&heights, 8, 8).unwrap().max_error(0.0).build().unwrap();
    let stl = folder.path().join("mesh.stl");
    let ply = folder.path().join("mesh.ply");
    tin.write(&stl).unwrap();
    tin.write(&ply).unwrap();
    let bound = |path: &Path| {
        let text = std::fs::read(path).unwrap();
        let text = String::from_utf8_lossy(&text).into_owned();
        let stated = text.split_once("max error ").unwrap().1.split_whitespace().next();
        stated.unwrap().parse::<f64>().unwrap()
    };
    // Tenths are no whole numbers of what 32 bits hold: they are off by half a unit in the last place at the most.
    assert!(bound(&stl) > 0.0 && bound(&stl) <= f64::from(f32::EPSILON), "{}", bound(&stl));
    assert_eq!(bound(&ply), 0.0);
}

#[test]
fn voids_of_arrays_are_left_out() {
    let mut heights = vec![1i16; 100];
    heights[55] = -1;
    let whole = Tin::from_array(&heights, 10, 10).unwrap().max_error(0.5);
    let area = |tin: Tin| {
        let double = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| tin.vertices()[corner as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        tin.triangles().iter().copied().map(double).sum::<f64>() / 2.0
    };
    assert_eq!(area(whole.nodata(-1.0).build().unwrap()), 81.0 - 4.0);
    let place = Affine { a: 2.0, e: -2.0, ..Affine::LATTICE };
    let all = Tin::from_array(&heights, 10, 10).unwrap().place(place, Crs::default());
    assert_eq!(area(all.max_error(0.5).build().unwrap()), 4.0 * 81.0);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let heights = [0.0f32; 16];
    assert!(
        Tin::from_array(&heights, 4, 5).is_err() && Tin::from_array(&heights[..0], 0, 0).is_err()
    );
    let made = |tin: terrane::Job<'_, terrane::TinOptions, terrane::ArrayGrid<'_>>| {
        tin.build().unwrap_err().kind()
    };
    let tin = || Tin::from_array(&heights, 4, 4).unwrap();
    assert_eq!(made(tin()), ErrorKind::Usage, "no goal");
    assert_eq!(made(tin().max_error(-1.0)), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(f64::NAN)), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(1.0).tile(3)), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(1.0).memory("x")), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(1.0).memory(1)), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(1.0).memory(1 << 20)), ErrorKind::Resource);
    let nowhere = [f32::NAN; 16];
    let empty = Tin::from_array(&nowhere, 4, 4).unwrap().max_error(1.0);
    assert_eq!(made(empty), ErrorKind::BadInput);
    assert!(terrane::open("no such file.tif").is_err() && terrane::open_cloud("none.laz").is_err());
    let grid = terrane::open(NAME).unwrap();
    let all = Rect::new(0, 0, u32::MAX, u32::MAX);
    assert_eq!(grid.heights(all).unwrap_err().kind(), ErrorKind::Usage);
    assert!(grid.band(2).is_err());
}

#[test]
fn what_cannot_act_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let cloud = terrane::open_cloud("synth:cloud,size=50,density=2,seed=7").unwrap();
    let usage = |done: Result<_, terrane::Error>| {
        assert_eq!(done.map_err(|error| error.kind()), Err(ErrorKind::Usage));
    };
    let cells = || cloud.grid(1.0).stat("mean");
    usage(cells().radius(2.0).write(path("a.tif")).map(drop));
    usage(cells().max_edge(2.0).write(path("a.tif")).map(drop));
    usage(cloud.grid(1.0).stat("count").fill(2).write(path("a.tif")).map(drop));
    usage(cells().overwrite(true).plan(path("work"), None).map(drop));
    usage(cells().plan(path("work"), 1 << 15).map(drop));
    let plan = cells().plan(path("work"), 256).unwrap();
    let task = &plan.status().unwrap().to_do[0].id;
    usage(plan.run().task(task).output(path("a.tif")).run().map(drop));
    usage(plan.run().task(task).overwrite(true).run().map(drop));
    let grid = terrane::open(NAME).unwrap();
    usage(grid.tin().max_error(1.0).split(2).build().map(drop));
    usage(grid.tin().max_error(1.0).overwrite(true).plan(path("other"), None).map(drop));
    usage(cloud.points().tile(10.0).workdir(path("kept")).plan(path("more"), None).map(drop));
    usage(cloud.points().buffer(2.0).write(path("a.laz")).map(drop));
}

/// A GTX file of one height all over the globe.
fn geoid(height: f32) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [-90.0_f64, -180.0, 90.0, 90.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    bytes.extend([3_u32, 5].iter().flat_map(|v| v.to_be_bytes()));
    bytes.extend([height; 15].iter().flat_map(|v| v.to_be_bytes()));
    bytes
}

#[test]
fn meshes_contours_and_lines_are_written_in_another_system() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("sea.gtx"), geoid(48.5)).unwrap();
    let grid = terrane::open(NAME).unwrap();
    let tin = || grid.tin().max_error(20.0);
    tin().to_crs("EPSG:4326").write(path("plain.ply")).unwrap();
    let made = tin().to_crs("EPSG:4979").geoid(path("sea.gtx")).write(path("high.ply")).unwrap();
    assert_eq!(made.transformed.unwrap().crs, "EPSG:4979 (WGS 84)");
    let ((low, _), (high, _)) = (stored(&path("plain.ply")), stored(&path("high.ply")));
    for (low, high) in low.iter().zip(&high) {
        assert!((high[2] - low[2] - 48.5).abs() < 1e-9 && high[..2] == low[..2]);
        assert!((-180.0..180.0).contains(&low[0]) && (-90.0..90.0).contains(&low[1]));
    }
    let lines = || grid.contour().interval(50.0);
    lines().write(path("metres.wkt")).unwrap();
    let made = lines().to_crs("EPSG:4326").write(path("degrees.geojson")).unwrap();
    assert_eq!(made.transformed.unwrap().crs, "EPSG:4326 (WGS 84)");
    let features = terrane::open_features(path("metres.wkt")).unwrap();
    let simpler = || features.simplify().tolerance(5.0);
    let made = simpler().to_crs("EPSG:4326").write(path("simpler.geojson")).unwrap();
    assert_eq!(made.transformed.unwrap().crs, "EPSG:4326 (WGS 84)");
    tin().to_crs("EPSG:4326").plan(path("work"), None).unwrap();
    // What leads nowhere, or is about files.
    let sea = path("sea.gtx");
    for failed in [
        tin().geoid(&sea).write(path("no.ply")).map(drop),
        tin().to_crs("EPSG:4326").build().map(drop),
        tin().geoid(&sea).build().map(drop),
        lines().shift_grid(&sea).write(path("no.wkt")).map(drop),
        simpler().geoid(&sea).write(path("no.wkt")).map(drop),
        tin().to_crs("EPSG:4326").geoid(&sea).write(path("no.ply")).map(drop),
    ] {
        assert_eq!(failed.unwrap_err().kind(), ErrorKind::Usage);
    }
    assert!(!path("no.ply").exists() && !path("no.wkt").exists());
}

#[test]
fn lines_in_degrees_are_proved_in_metres() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let line: Vec<String> = (0..500)
        .map(|i| format!("[{}, {}]", f64::from(i) / 100.0, (f64::from(i) / 9.0).sin()))
        .collect();
    let text = format!(r#"{{"type": "LineString", "coordinates": [{}]}}"#, line.join(", "));
    std::fs::write(path("line.geojson"), text).unwrap();
    let features = terrane::open_features(path("line.geojson")).unwrap();
    features
        .simplify()
        .tolerance(terrane::Length::metres(2000.0))
        .write(path("few.geojson"))
        .unwrap();
    let passed = |metres: f64| {
        features
            .verify(path("few.geojson"))
            .tolerance(terrane::Length::metres(metres))
            .run()
            .unwrap()
            .verdict
            .passed
    };
    assert!(passed(2000.0) && !passed(200.0));
}

#[test]
fn degrees_are_written_as_local_metres() {
    let folder = tempfile::tempdir().unwrap();
    let heights: Vec<f32> = (0..64).map(|i| (i * i % 13) as f32).collect();
    let crs = Crs { epsg: Some(4326), geographic: Some(true), ..Crs::default() };
    let place = Affine { x0: 9.0, a: 0.01, b: 0.0, y0: 47.0, d: 0.0, e: -0.01 };
    let tin = Tin::from_array(&heights, 8, 8).unwrap().place(place, crs).max_error(1.0);
    let tin = tin.build().unwrap();
    let file = folder.path().join("grid.asc");
    let head = "ncols 8\nnrows 8\nxllcenter 9\nyllcenter 46.93\ncellsize 0.01\n";
    let line = |row: &[f32]| row.iter().map(|z| format!("{z} ")).collect::<String>() + "\n";
    let text: String = heights.chunks(8).map(line).collect();
    std::fs::write(&file, format!("{head}{text}")).unwrap();
    std::fs::write(file.with_extension("prj"), "EPSG:4326").unwrap();
    let grid = terrane::open(file.to_str().unwrap()).unwrap();
    for name in ["mesh.glb", "mesh.ply", "mesh.stl"] {
        let mesh = folder.path().join(name);
        let count = tin.write(&mesh).unwrap();
        assert_eq!(count, std::fs::metadata(&mesh).unwrap().len(), "{name}");
        let proof = grid.verify(&mesh).max_error(1.0).run().unwrap();
        assert!(proof.verdict.passed, "{name}: {:?}", proof.verdict);
        let wrong = grid.verify(&mesh).max_error(0.01).run().unwrap();
        assert!(!wrong.verdict.passed, "{name}");
    }
}

/// Counts what it is told.
#[derive(Clone, Default)]
struct Told(Arc<AtomicU64>);

impl Progress for Told {
    fn begin(&self, _: &str, _: u64) {}

    fn advance(&self, units: u64) {
        self.0.fetch_add(units, Ordering::Relaxed);
    }

    fn end(&self) {}
}

#[test]
fn jobs_tell_how_far_they_are_and_can_be_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let (grid, told, cancel) = (terrane::open(NAME).unwrap(), Told::default(), Cancel::default());
    grid.tin().max_error(5.0).progress(told.clone()).cancel(&cancel).build().unwrap();
    assert!(told.0.load(Ordering::Relaxed) >= 300 * 300);
    cancel.cancel();
    let kind = |error: terrane::Error| error.kind();
    let path = |name: &str| folder.path().join(name);
    let mesh = grid.tin().max_error(5.0).cancel(&cancel).write(path("a.ply")).map(drop);
    let lines = grid.contour().interval(5.0).cancel(&cancel).write(path("a.geojson")).map(drop);
    let copy = grid.convert().cancel(&cancel).write(path("a.tif")).map(drop);
    let cloud = terrane::open_cloud("synth:cloud,size=50,density=2,seed=7").unwrap();
    let cells = cloud.grid(1.0).cancel(&cancel).write(path("b.tif")).map(drop);
    let ground = cloud.tin().max_error(1.0).cancel(&cancel).write(path("b.ply")).map(drop);
    for done in [mesh, lines, copy, cells, ground] {
        assert_eq!(done.map_err(kind), Err(ErrorKind::Interrupted));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}

#[test]
fn outputs_that_exist_are_replaced_only_when_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    std::fs::write(&path, "mine").unwrap();
    let grid = terrane::open(NAME).unwrap();
    assert!(grid.tin().max_error(5.0).write(&path).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    grid.tin().max_error(5.0).overwrite(true).write(&path).unwrap();
    assert!(std::fs::read(&path).unwrap().starts_with(b"ply"));
}

#[test]
fn a_plan_gives_what_a_single_run_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    terrane::open(NAME).unwrap().convert().write(path("dem.tif")).unwrap();
    let grid = terrane::open(path("dem.tif")).unwrap();
    let tin = || grid.tin().max_error(2.0).tile(32);
    tin().write(path("single.ply")).unwrap();
    let plan = tin().plan(path("mesh"), 2).unwrap();
    let before = plan.status().unwrap();
    assert!(before.done == 0 && before.to_do.len() > 2 && before.written.is_none());
    plan.run().task(&before.to_do[0].id).run().unwrap();
    assert_eq!(plan.status().unwrap().done, 1);
    let done =
        terrane::open_plan(path("mesh")).unwrap().run().output(path("many.ply")).run().unwrap();
    assert_eq!((done.found, done.written), (1, Some(path("many.ply"))));
    assert_eq!(plan.status().unwrap().written, Some(path("many.ply")));
    let bytes = |name: &str| std::fs::read(path(name)).unwrap();
    assert!(bytes("single.ply") == bytes("many.ply"));

    let cloud = terrane::open_cloud("synth:cloud,size=300,density=1,seed=7").unwrap();
    let cells = || cloud.grid(1.0).stat("mean,p95");
    cells().write(path("single.tif")).unwrap();
    let done =
        cells().plan(path("cells"), 256).unwrap().run().output(path("many.tif")).run().unwrap();
    assert!(done.tasks > 1 && done.written.is_some());
    assert!(bytes("single.tif") == bytes("many.tif"));
    assert!(terrane::open_plan(path("nothing")).is_err());
    assert_eq!(
        tin().max_vertices(9).plan(path("other"), None).unwrap_err().kind(),
        ErrorKind::Usage
    );
}
