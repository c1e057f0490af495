//! The library as a programmer meets it: the same meshes as by other ways, and nothing silently wrong.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use terrane::{Affine, Cancel, Crs, Plan, Progress, Tin};
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
fn heights_that_a_format_does_not_hold_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let heights: Vec<f64> = (0..64).map(|i| f64::from(i * i % 13) / 10.0).collect();
    let tin = Tin::from_array(&heights, 8, 8).unwrap().max_error(0.0).build().unwrap();
    let stl = folder.path().join("mesh.stl");
    assert_eq!(tin.write(&stl).unwrap_err().kind(), ErrorKind::Unsupported);
    assert!(!stl.exists());
    tin.write(folder.path().join("mesh.ply")).unwrap();
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
    let made = |tin: terrane::TinBuilder<terrane::ArrayGrid<'_>>| tin.build().unwrap_err().kind();
    let tin = || Tin::from_array(&heights, 4, 4).unwrap();
    assert_eq!(made(tin()), ErrorKind::Usage, "no goal");
    assert_eq!(made(tin().max_error(-1.0)), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(f64::NAN)), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(1.0).tile(3)), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(1.0).memory("x")), ErrorKind::Usage);
    assert_eq!(made(tin().max_error(1.0).memory(1)), ErrorKind::Resource);
    let nowhere = [f32::NAN; 16];
    let empty = Tin::from_array(&nowhere, 4, 4).unwrap().max_error(1.0);
    assert_eq!(made(empty), ErrorKind::BadInput);
    assert!(terrane::open("no such file.tif").is_err() && terrane::open_cloud("none.laz").is_err());
    let grid = terrane::open(NAME).unwrap();
    assert!(grid.band(2).is_err());
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
    let lines = grid.contours().every(5.0).cancel(&cancel).write(path("a.geojson")).map(drop);
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
    let done = Plan::open(path("mesh")).unwrap().run().output(path("many.ply")).run().unwrap();
    assert_eq!((done.found, done.written), (1, Some(path("many.ply"))));
    assert_eq!(plan.status().unwrap().written, Some(path("many.ply")));
    let bytes = |name: &str| std::fs::read(path(name)).unwrap();
    assert!(bytes("single.ply") == bytes("many.ply"));

    let cloud = terrane::open_cloud("synth:cloud,size=300,density=1,seed=7").unwrap();
    let cells = || cloud.grid(1.0).stats("mean,p95");
    cells().write(path("single.tif")).unwrap();
    let done =
        cells().plan(path("cells"), 256).unwrap().run().output(path("many.tif")).run().unwrap();
    assert!(done.tasks > 1 && done.written.is_some());
    assert!(bytes("single.tif") == bytes("many.tif"));
    assert!(Plan::open(path("nothing")).is_err());
    assert_eq!(
        tin().max_vertices(9).plan(path("other"), None).unwrap_err().kind(),
        ErrorKind::Usage
    );
}
