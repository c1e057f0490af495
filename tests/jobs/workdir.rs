//! Work by plan: the mesh is the one of a single run, whoever did which task how often.

use std::path::{Path, PathBuf};

use terrane_base::{ErrorKind, Result};
use terrane_engine::operation::Divisible;
use terrane_engine::plan::{DiskCheck, OutputForm, RunJob};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_terrain::tin::{
    PlanJob, RunReport, StatusReport, TinGoal, TinJob, TinOptions, plan_work, run, run_in,
};

const TERRAIN: &str = "synth:rough,width=700,height=1100,seed=7";

fn resources(threads: usize) -> Resources {
    Resources { threads, memory: 256 << 20, temp_dir: None }
}

fn tin(input: &str, output: &Path) -> TinJob {
    let job = TinJob::new(input, output, TinGoal::MaxError(8.0));
    TinJob { tile: 64, resources: resources(2), ..job }
}

fn plan(folder: &Path, input: &str, strip_rows: u32) -> Result<StatusReport> {
    let tin = tin(input, Path::new("mesh.ply"));
    let job = PlanJob {
        job: tin,
        folder: folder.to_path_buf(),
        cut: Some(strip_rows),
        skipped: Vec::new(),
    };
    plan_work(&job, &Silent, &Cancel::default())
}

fn work(folder: &Path, task: Option<&str>, threads: usize) -> Result<RunReport> {
    let job = RunJob {
        folder: folder.to_path_buf(),
        task: task.map(str::to_owned),
        output: None,
        overwrite: false,
        form: OutputForm::default(),
        disk: DiskCheck::On,
        resources: resources(threads),
    };
    TinOptions::run_plan(&job, &Silent, &Cancel::default())
}

/// The mesh of a single run.
fn whole(folder: &Path, input: &str) -> Vec<u8> {
    let path = folder.join("whole.ply");
    run(&tin(input, &path), &Silent, &Cancel::default()).unwrap();
    std::fs::read(path).unwrap()
}

/// The files of objects, without the notes on them.
fn objects(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("objects")).unwrap();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "object"));
    paths.sort();
    paths
}

#[test]
fn the_mesh_of_a_plan_is_that_of_a_single_run() {
    let temp = tempfile::tempdir().unwrap();
    for (i, terrain) in ["synth:rough", "synth:coast", "synth:smooth"].iter().enumerate() {
        let input = format!("{terrain},width=700,height=1100,seed=7");
        let expected = whole(temp.path(), &input);
        std::fs::remove_file(temp.path().join("whole.ply")).unwrap();
        for (strip_rows, threads) in [(2, 1), (3, 3), (5, 2), (40, 2)] {
            let folder = temp.path().join(format!("{i}-{strip_rows}"));
            plan(&folder, &input, strip_rows).unwrap();
            let report = work(&folder, None, threads).unwrap();
            assert_eq!(report.made.len() as u64 + 1, report.tasks);
            assert!(
                std::fs::read(folder.join("mesh.ply")).unwrap() == expected,
                "{input} by {strip_rows}"
            );
        }
    }
}

/// A folder in which all is done but the mesh removed again.
fn done(temp: &Path) -> PathBuf {
    let folder = temp.join("work");
    plan(&folder, TERRAIN, 4).unwrap();
    work(&folder, None, 2).unwrap();
    folder
}

fn remove_mesh(folder: &Path) -> Vec<u8> {
    let path = folder.join("mesh.ply");
    let mesh = std::fs::read(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    mesh
}

#[test]
fn tasks_may_be_done_one_by_one_in_any_order_and_twice() {
    let temp = tempfile::tempdir().unwrap();
    let expected = whole(temp.path(), TERRAIN);
    let folder = temp.path().join("work");
    let planned = plan(&folder, TERRAIN, 3).unwrap();
    let ids = |kind: &str| {
        let all = planned.to_do.iter().map(|task| task.id.clone());
        all.filter(|id| id.starts_with(kind)).rev().collect::<Vec<_>>()
    };
    assert_eq!((ids("strip").len(), ids("seam").len()), (6, 5));
    let early = work(&folder, Some("seam-1"), 1).unwrap_err();
    assert_eq!(early.kind(), ErrorKind::NotYet);
    assert!(early.to_string().contains("strip-1 is not done"), "{early}");
    let early = work(&folder, Some("finish"), 1).unwrap_err().to_string();
    assert!(early.contains("strip-0 is not done"), "{early}");
    for id in ids("strip").iter().chain(&ids("seam")) {
        assert_eq!(work(&folder, Some(id), 2).unwrap().made, [id.as_str()]);
        assert!(work(&folder, Some(id), 2).unwrap().made.is_empty());
    }
    assert_eq!(TinOptions::status(&folder).unwrap().to_do.len(), 1);
    for _ in 0..2 {
        let finished = work(&folder, Some("finish"), 2).unwrap();
        assert!(finished.of.mesh.is_some_and(|mesh| mesh.max_error.is_some_and(|e| e <= 8.0)));
    }
    assert!(remove_mesh(&folder) == expected);
    for unknown in
        ["seam-5", "strip-6", "strip", "strip-", "strip-x", "seam--1", "Finish", "end", ""]
    {
        assert_eq!(work(&folder, Some(unknown), 1).unwrap_err().kind(), ErrorKind::Usage);
    }
}

#[test]
fn a_flipped_bit_anywhere_is_found_and_only_that_task_done_again() {
    let temp = tempfile::tempdir().unwrap();
    let folder = done(temp.path());
    let expected = remove_mesh(&folder);
    for (i, path) in objects(&folder).iter().enumerate() {
        let sound = std::fs::read(path).unwrap();
        let places = [0, 20, sound.len() / 2, sound.len() - 100, sound.len() - 40, sound.len() - 1];
        let mut bytes = sound.clone();
        bytes[places[i % places.len()]] ^= 1 << (i % 8);
        std::fs::write(path, &bytes).unwrap();
        let report = work(&folder, None, 2).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        assert_eq!((report.damaged.len(), report.made.len()), (1, 1), "{name}");
        assert!(name.starts_with(&format!("{}-", report.damaged[0])));
        assert!(std::fs::read(path).unwrap() == sound, "{name} is the same again");
        assert!(remove_mesh(&folder) == expected);
    }
}

#[test]
fn truncated_and_lost_objects_are_done_again() {
    let temp = tempfile::tempdir().unwrap();
    let folder = done(temp.path());
    let expected = remove_mesh(&folder);
    let objects = objects(&folder);
    for (i, path) in objects.iter().enumerate() {
        let len = path.metadata().unwrap().len();
        match i % 3 {
            0 => std::fs::remove_file(path).unwrap(),
            1 => std::fs::File::options().write(true).open(path).unwrap().set_len(len / 2).unwrap(),
            _ => std::fs::write(path, b"").unwrap(),
        }
    }
    let status = TinOptions::status(&folder).unwrap();
    assert_eq!(status.to_do.len(), objects.len() + 1);
    assert_eq!(work(&folder, None, 2).unwrap().made.len(), objects.len());
    assert!(remove_mesh(&folder) == expected);
    std::fs::remove_dir_all(folder.join("objects")).unwrap();
    assert_eq!(work(&folder, None, 2).unwrap().made.len(), objects.len());
    assert!(remove_mesh(&folder) == expected);
}

#[test]
fn a_finished_plan_has_nothing_to_do_until_its_mesh_is_touched() {
    let temp = tempfile::tempdir().unwrap();
    let folder = done(temp.path());
    let again = work(&folder, None, 2).unwrap();
    assert!(again.made.is_empty() && again.of.mesh.is_some());
    assert_eq!(again.found + 1, again.tasks);
    let status = TinOptions::status(&folder).unwrap();
    assert!(status.to_do.is_empty() && status.last_output.output.is_some());
    std::fs::write(folder.join("mesh.ply"), b"something else").unwrap();
    assert_eq!(work(&folder, None, 2).unwrap_err().kind(), ErrorKind::Usage);
}

#[test]
fn another_plan_is_refused_with_the_difference() {
    let temp = tempfile::tempdir().unwrap();
    let folder = done(temp.path());
    assert!(plan(&folder, TERRAIN, 4).unwrap().to_do.is_empty(), "the same plan is taken as it is");
    let refused = plan(&folder, TERRAIN, 5).unwrap_err().to_string();
    assert!(refused.contains("method.strip_rows is 4 in the plan, 5 now"), "{refused}");
    let mut job = PlanJob {
        job: tin(TERRAIN, Path::new("mesh.ply")),
        folder: folder.clone(),
        cut: Some(4),
        skipped: Vec::new(),
    };
    job.job.goal = TinGoal::MaxError(9.0);
    let refused = plan_work(&job, &Silent, &Cancel::default()).unwrap_err().to_string();
    assert!(refused.contains("method.max_error is 8.0 in the plan, 9.0 now"), "{refused}");
    let other = temp.path().join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("precious"), b"x").unwrap();
    assert_eq!(plan(&other, TERRAIN, 4).unwrap_err().kind(), ErrorKind::Usage);
    let small = plan(&temp.path().join("new"), TERRAIN, 1).unwrap_err();
    assert_eq!(small.kind(), ErrorKind::Usage, "{small}");
    assert!(small.to_string().contains("two rows of tiles"), "{small}");
    assert!(!temp.path().join("new").exists());
}

#[test]
fn a_plan_that_was_edited_is_refused() {
    let temp = tempfile::tempdir().unwrap();
    let folder = done(temp.path());
    let path = folder.join("plan.json");
    let text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in [
        ("\"max_error\": 8.0", "\"max_error\": 80.0"),
        ("\"drop\": true", "\"drop\": 1"),
        ("}", ""),
    ] {
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        assert_eq!(work(&folder, None, 1).unwrap_err().kind(), ErrorKind::BadInput, "{to}");
    }
    std::fs::write(&path, &text).unwrap();
    assert!(work(&folder, None, 1).is_ok());
}

#[test]
fn an_input_that_changed_is_refused() {
    let temp = tempfile::tempdir().unwrap();
    let grid = temp.path().join("grid.asc");
    let write = |corner: u32| {
        let mut text = "ncols 40\nnrows 40\nxllcorner 0\nyllcorner 0\ncellsize 1\n".to_owned();
        for i in 0..1600 {
            let height = if i == 0 { corner } else { i * i % 17 };
            text += &format!("{height} ");
        }
        std::fs::write(&grid, text).unwrap();
    };
    write(3);
    let mut job = tin(grid.to_str().unwrap(), &temp.path().join("a.ply"));
    job.tile = 16;
    job.goal = TinGoal::MaxError(1.0);
    let folder = temp.path().join("work");
    run_in(&folder, &job, &[], DiskCheck::On, &Silent, &Cancel::default()).unwrap();
    write(4);
    let refused = work(&folder, None, 1).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::BadInput);
    assert!(refused.to_string().contains("grid.asc: changed since the plan was made"), "{refused}");
    write(3);
    assert!(
        work(&folder, None, 1).unwrap().made.is_empty(),
        "what was there before is taken again"
    );
}

/// A plan for a grid in a file, done.
fn done_from_file(temp: &Path) -> (PathBuf, TinJob) {
    let grid = temp.join("grid.asc");
    let mut text = "ncols 40\nnrows 40\nxllcorner 0\nyllcorner 0\ncellsize 1\n".to_owned();
    (0..1600).for_each(|i| text += &format!("{} ", i * i % 17));
    std::fs::write(&grid, text).unwrap();
    let mut job = tin(grid.to_str().unwrap(), &temp.join("a.ply"));
    (job.tile, job.goal) = (16, TinGoal::MaxError(1.0));
    let folder = temp.join("work");
    run_in(&folder, &job, &[], DiskCheck::On, &Silent, &Cancel::default()).unwrap();
    (folder, job)
}

#[test]
fn a_file_that_came_to_lie_beside_the_input_is_refused() {
    let temp = tempfile::tempdir().unwrap();
    let (folder, job) = done_from_file(temp.path());
    let sidecar = temp.path().join("grid.asc.aux.xml");
    let text = "<PAMDataset><PAMRasterBand band='1'><NoDataValue>4</NoDataValue></PAMRasterBand>\
                </PAMDataset>";
    std::fs::write(&sidecar, text).unwrap();
    for task in [None, Some("strip-0"), Some("finish")] {
        let refused = work(&folder, task, 1).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::BadInput);
        assert!(refused.to_string().contains("grid.asc.aux.xml: is read with"), "{refused}");
    }
    assert!(run_in(&folder, &job, &[], DiskCheck::On, &Silent, &Cancel::default()).is_err());
    std::fs::remove_file(sidecar).unwrap();
    assert!(run_in(&folder, &job, &[], DiskCheck::On, &Silent, &Cancel::default()).is_ok());
}

#[test]
fn the_same_bytes_at_another_time_are_the_same_input() {
    let temp = tempfile::tempdir().unwrap();
    let (folder, job) = done_from_file(temp.path());
    let grid = std::fs::File::options().append(true).open(temp.path().join("grid.asc")).unwrap();
    grid.set_modified(std::time::UNIX_EPOCH).unwrap();
    assert!(run_in(&folder, &job, &[], DiskCheck::On, &Silent, &Cancel::default()).is_ok());
    assert!(work(&folder, Some("strip-0"), 1).unwrap().made.is_empty());
}

#[test]
fn the_tiles_told_are_those_used() {
    let temp = tempfile::tempdir().unwrap();
    for (side, used) in [(16, 16), (8192, 39)] {
        let mut job = tin("synth:rough,size=40", &temp.path().join(format!("{side}.ply")));
        job.tile = side;
        let folder = temp.path().join(side.to_string());
        let planned =
            run_in(&folder, &job, &[], DiskCheck::On, &Silent, &Cancel::default()).unwrap();
        job.overwrite = true;
        let whole = run(&job, &Silent, &Cancel::default()).unwrap();
        let status = TinOptions::status(&folder).unwrap();
        let told = [planned.tile_cells, whole.tile_cells, status.tile_cells];
        assert_eq!(told, [used; 3], "{side}");
    }
}

#[test]
fn neither_input_nor_plan_is_ever_the_output() {
    let temp = tempfile::tempdir().unwrap();
    let (folder, _) = done_from_file(temp.path());
    let object = objects(&folder).remove(0);
    for output in
        [temp.path().join("grid.asc"), folder.join("plan.json"), folder.join("lock"), object]
    {
        let before = std::fs::read(&output).unwrap();
        for task in [None, Some("finish".to_owned())] {
            let job = RunJob {
                folder: folder.clone(),
                task,
                output: Some(output.clone()),
                overwrite: true,
                form: OutputForm::default(),
                disk: DiskCheck::On,
                resources: resources(1),
            };
            let refused = TinOptions::run_plan(&job, &Silent, &Cancel::default()).unwrap_err();
            assert_eq!(refused.kind(), ErrorKind::Usage, "{refused}");
        }
        assert!(std::fs::read(&output).unwrap() == before);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn an_output_of_any_name_is_noted() {
    use std::os::unix::ffi::OsStrExt;
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().join("work");
    plan(&folder, TERRAIN, 4).unwrap();
    let job = RunJob {
        folder: folder.clone(),
        task: None,
        output: Some(temp.path().join(std::ffi::OsStr::from_bytes(b"\xff.ply"))),
        overwrite: false,
        form: OutputForm::default(),
        disk: DiskCheck::On,
        resources: resources(1),
    };
    TinOptions::run_plan(&job, &Silent, &Cancel::default()).unwrap();
    assert!(job.output.is_some_and(|output| output.is_file()));
    assert!(
        TinOptions::status(&folder)
            .unwrap()
            .last_output
            .output
            .is_some_and(|output| output.ends_with(".ply"))
    );
}

#[test]
fn looking_through_what_is_done_can_be_stopped() {
    let temp = tempfile::tempdir().unwrap();
    let folder = done(temp.path());
    let cancel = Cancel::default();
    cancel.cancel();
    let job = RunJob {
        folder: folder.clone(),
        task: None,
        output: None,
        overwrite: false,
        form: OutputForm::default(),
        disk: DiskCheck::On,
        resources: resources(1),
    };
    assert_eq!(
        TinOptions::run_plan(&job, &Silent, &cancel).unwrap_err().kind(),
        ErrorKind::Interrupted
    );
    assert!(work(&folder, None, 1).unwrap().damaged.is_empty());
}

#[test]
fn formats_with_a_limit_may_be_many_files() {
    let temp = tempfile::tempdir().unwrap();
    let plan = |name: &str, split| {
        let mut tin = tin("synth:rough,size=80001", Path::new("mesh.glb"));
        (tin.split, tin.goal) = (split, TinGoal::MaxError(0.01));
        let job =
            PlanJob { job: tin, folder: temp.path().join(name), cut: None, skipped: Vec::new() };
        plan_work(&job, &Silent, &Cancel::default())
    };
    assert_eq!(plan("one", None).unwrap_err().kind(), ErrorKind::CannotWrite);
    assert!(plan("many", Some(8)).is_ok());
}

#[test]
fn two_who_do_everything_are_told_apart_and_tasks_disturb_nobody() {
    let temp = tempfile::tempdir().unwrap();
    let folder = done(temp.path());
    let lock = std::fs::File::options().append(true).open(folder.join("lock")).unwrap();
    lock.lock().unwrap();
    assert_eq!(work(&folder, None, 1).unwrap_err().kind(), ErrorKind::NotYet);
    for task in ["strip-0", "seam-0", "finish"] {
        assert!(work(&folder, Some(task), 1).is_ok(), "{task} beside a run");
    }
    lock.unlock().unwrap();
    assert!(work(&folder, None, 1).is_ok());
}

#[test]
fn formats_of_single_precision_keep_their_bound_and_bytes() {
    let temp = tempfile::tempdir().unwrap();
    for name in ["a.glb", "a.stl", "a.obj"] {
        let direct = temp.path().join(name);
        let job = tin(TERRAIN, &direct);
        run(&job, &Silent, &Cancel::default()).unwrap();
        let worked = temp.path().join(format!("by-{name}"));
        let job = TinJob { output: worked.clone(), ..job };
        let work = temp.path().join(format!("{name}-work"));
        let report = run_in(&work, &job, &[], DiskCheck::On, &Silent, &Cancel::default());
        assert_eq!(report.unwrap().samples, 700 * 1100);
        assert!(std::fs::read(direct).unwrap() == std::fs::read(worked).unwrap(), "{name}");
    }
}

#[test]
fn a_budget_of_vertices_cannot_be_planned() {
    let temp = tempfile::tempdir().unwrap();
    let mut job = tin(TERRAIN, &temp.path().join("a.ply"));
    job.goal = TinGoal::MaxVertices(1000);
    let folder = temp.path().join("work");
    let refused =
        run_in(&folder, &job, &[], DiskCheck::On, &Silent, &Cancel::default()).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::Usage);
    assert!(!folder.exists());
}
