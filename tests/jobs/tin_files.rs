//! The grid-to-TIN job from file to file: what is refused before the work, budgets, reports.

use std::path::{Path, PathBuf};

use terrane_base::{ErrorKind, Result};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_mesh as mesh;
use terrane_terrain::tin::{TinGoal, TinJob, TinReport, run};

const TERRAIN: &str = "synth:rough,size=300,seed=7";

fn job(input: &str, output: &Path, goal: TinGoal) -> TinJob {
    TinJob {
        tile: 64,
        resources: Resources { threads: 2, memory: 256 << 20, temp_dir: None },
        ..TinJob::new(input, output, goal)
    }
}

fn make(job: &TinJob) -> Result<TinReport> {
    run(job, &Silent, &Cancel::default())
}

fn names(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries.map(|entry| PathBuf::from(entry.unwrap().file_name())).collect()
}

#[test]
fn writes_a_mesh_that_says_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.ply", "b.obj", "c.stl", "d.glb"] {
        let path = folder.path().join(name);
        let made = make(&job(TERRAIN, &path, TinGoal::MaxError(20.0))).unwrap();
        let source = mesh::open(&path).unwrap();
        assert_eq!(source.info().triangles, made.triangles);
        let indexed = source.info().indexed;
        assert!(!indexed || source.info().vertices == made.vertices);
        assert_eq!((made.samples, made.valid_samples), (90_000, 90_000));
        assert!(made.max_error.is_some_and(|e| e > 0.0 && e <= 20.0 * (1.0 + 1e-6)));
        assert!(made.rmse < made.max_error);
        assert_eq!(made.output_bytes, path.metadata().unwrap().len());
        assert_eq!(made.stages.len(), 4);
    }
}

#[test]
fn the_ply_comments_carry_the_tolerance() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    make(&job(TERRAIN, &path, TinGoal::MaxError(12.5))).unwrap();
    let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
    assert!(text.contains("max error 12.5"));
    assert!(text.contains(&format!("source {TERRAIN}")));
}

#[test]
fn bytes_do_not_depend_on_threads_or_memory() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str, threads, memory: u64| {
        let path = folder.path().join(name);
        let resources = Resources { threads, memory: memory << 20, temp_dir: None };
        let job = job(TERRAIN, &path, TinGoal::MaxError(5.0));
        make(&TinJob { resources, overwrite: true, ..job }).unwrap();
        std::fs::read(&path).unwrap()
    };
    for extension in ["ply", "glb", "stl"] {
        let first = bytes(&format!("1.{extension}"), 1, 4096);
        assert!(first == bytes(&format!("2.{extension}"), 8, 64));
        assert!(first == bytes(&format!("3.{extension}"), 2, 64));
    }
}

#[test]
fn a_budget_is_kept_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let budget = |goal| make(&TinJob { overwrite: true, ..job(TERRAIN, &path, goal) }).unwrap();
    assert_eq!(budget(TinGoal::MaxVertices(400)).vertices, 400, "the coarsest");
    assert_eq!(budget(TinGoal::MaxTriangles(722)).triangles, 722, "the coarsest");
    for most in [800, 1000, 20_000] {
        let made = budget(TinGoal::MaxVertices(most));
        assert!(made.vertices <= most && made.trials > 0, "{} of {most}", made.vertices);
        assert!(
            most < 1000 || made.vertices as f64 > 0.95 * most as f64,
            "{} of {most}",
            made.vertices
        );
        let made = budget(TinGoal::MaxTriangles(most));
        assert!(made.triangles <= most, "{} of {most}", made.triangles);
    }
    let all = budget(TinGoal::MaxVertices(90_000));
    assert_eq!((all.tolerance, all.trials, all.max_error), (0.0, 0, Some(0.0)));
}

#[test]
fn too_small_a_budget_tells_the_least() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let error = make(&job(TERRAIN, &path, TinGoal::MaxVertices(3))).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert!(error.to_string().contains("allow at least 400"), "{error}");
    assert!(names(folder.path()).is_empty());
}

#[test]
fn requests_without_sense_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let good = job(TERRAIN, &path, TinGoal::MaxError(5.0));
    let refused = |job: TinJob| {
        let error = make(&job).unwrap_err();
        assert!(names(folder.path()).is_empty());
        error.kind()
    };
    for tolerance in [-1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(
            refused(TinJob { goal: TinGoal::MaxError(tolerance), ..good.clone() }),
            ErrorKind::Usage
        );
    }
    for goal in [TinGoal::MaxVertices(0), TinGoal::MaxTriangles(0)] {
        assert_eq!(refused(TinJob { goal, ..good.clone() }), ErrorKind::Usage);
    }
    let missing = folder.path().join("no/such/folder/a.ply");
    assert_eq!(refused(TinJob { output: missing, ..good.clone() }), ErrorKind::CannotWrite);
    assert_eq!(refused(TinJob { output: "a.xyz".into(), ..good.clone() }), ErrorKind::Usage);
    assert_eq!(refused(TinJob { tile: 7, ..good.clone() }), ErrorKind::Usage);
    let little = Resources { memory: 8 << 20, ..good.resources.clone() };
    assert_eq!(refused(TinJob { resources: little, ..good.clone() }), ErrorKind::Resource);
    assert_eq!(refused(TinJob { input: "none.tif".into(), ..good.clone() }), ErrorKind::BadInput);
    let thin = "synth:rough,width=1,height=300".to_owned();
    let kind = refused(TinJob { input: thin.into(), ..good });
    assert!(matches!(kind, ErrorKind::BadInput | ErrorKind::Usage));
}

#[test]
fn an_existing_output_stays_unless_told_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    std::fs::write(&path, "mine").unwrap();
    let job = job(TERRAIN, &path, TinGoal::MaxError(5.0));
    assert_eq!(make(&job).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    make(&TinJob { overwrite: true, ..job }).unwrap();
    assert_ne!(std::fs::read(&path).unwrap(), b"mine");
}

#[test]
fn an_interrupted_job_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let cancel = Cancel::default();
    cancel.cancel();
    let job = job(TERRAIN, &folder.path().join("a.ply"), TinGoal::MaxVertices(500));
    assert_eq!(run(&job, &Silent, &cancel).unwrap_err().kind(), ErrorKind::Interrupted);
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_format_that_cannot_hold_the_mesh_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let huge = "synth:rough,size=80000,seed=7";
    let job = job(huge, &path, TinGoal::MaxError(0.001));
    let error = make(&TinJob { tile: 128, ..job }).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::CannotWrite);
    assert!(error.to_string().contains("GLB"), "{error}");
    assert!(names(folder.path()).is_empty());
}
