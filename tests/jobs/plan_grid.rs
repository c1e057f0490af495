//! Grids by plan: the bytes of a single run, whoever did which task, and only what lies near is read.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use terrane_base::{ErrorKind, Result};
use terrane_engine::operation::Divisible;
use terrane_engine::plan::{DiskCheck, OutputForm, RunJob, RunReport};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_gridding::parse_list;
use terrane_lidar::grid::plan::{CellRun, PlanGridJob, plan_grid};
use terrane_lidar::grid::{GridJob, GridOptions, GroundFrom, SurfaceModel, run};
use terrane_raster::SampleType;

/// Side of the cloud, and of the square that a file of it has.
const SIDE: i32 = 1024;
const FILE: i32 = 51;

fn resources(threads: usize) -> Resources {
    Resources { threads, memory: 256 << 20, temp_dir: None }
}

/// Points about 2.4 apart on rough ground, in a file for each square, with voids up to 460 wide where
/// files and tiles meet and a bay in the outline.
fn cloud(folder: &Path) -> Vec<String> {
    let voids = [(128, 128, 20), (256, 300, 35), (320, 896, 30), (512, 512, 230), (1024, 640, 330)];
    cloud_of(folder, SIDE, &voids)
}

/// The same of a cloud with another side, and with other voids.
fn cloud_of(folder: &Path, side: i32, voids: &[(i32, i32, i32)]) -> Vec<String> {
    let (mut state, mut files) = (5_u64, std::collections::BTreeMap::<_, String>::new());
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        f64::from((state >> 40) as u32) / f64::from(1 << 24)
    };
    for _ in 0..side * side / 6 {
        let [x, y] = [random(), random()].map(|v| (v * f64::from(side) * 100.0).floor() / 100.0);
        let far = |(cx, cy, r): &(i32, i32, i32)| {
            (x - f64::from(*cx)).hypot(y - f64::from(*cy)) > f64::from(*r)
        };
        let z = (x / 40.0).sin() * 9.0 + (y / 25.0).cos() * 5.0 + random();
        if voids.iter().all(far) {
            let text = files.entry((x as i32 / FILE, y as i32 / FILE)).or_default();
            writeln!(text, "{x:.2} {y:.2} {z:.3}").unwrap();
        }
    }
    let write = |((x, y), text): ((i32, i32), String)| {
        let path = folder.join(format!("{x}-{y}.xyz"));
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    files.into_iter().map(write).collect()
}

fn job(files: &[String], output: &Path, stats: &str) -> GridJob {
    let job = GridJob::new(files.to_vec(), output, parse_list(stats).unwrap(), 1.0);
    GridJob { resources: resources(2), ..job }
}

fn plan(folder: &Path, grid: &GridJob, tile: u32) -> Result<()> {
    let format = grid.format()?.name.to_owned();
    let output = folder.join("grid").with_extension(grid.output.extension().unwrap());
    let grid = GridJob { output, format: Some(format), ..grid.clone() };
    let plan = PlanGridJob {
        job: grid,
        folder: folder.to_path_buf(),
        cut: Some(tile),
        skipped: Vec::new(),
    };
    plan_grid(&plan, &Silent, &Cancel::default()).map(drop)
}

/// For a square of a method that finds the ground.
fn enough() -> Resources {
    Resources { memory: 1 << 30, ..resources(2) }
}

fn work(folder: &Path, task: Option<&str>) -> Result<RunReport<CellRun>> {
    let job = RunJob {
        folder: folder.to_path_buf(),
        task: task.map(str::to_owned),
        output: None,
        overwrite: false,
        form: OutputForm::default(),
        disk: DiskCheck::On,
        resources: enough(),
    };
    GridOptions::run_plan(&job, &Silent, &Cancel::default())
}

fn single(grid: &GridJob) -> Vec<u8> {
    run(grid, &Silent, &Cancel::default()).unwrap();
    std::fs::read(&grid.output).unwrap()
}

fn objects(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("objects")).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = paths.filter(|p| p.extension().unwrap() == ending).collect();
    paths.sort();
    paths
}

#[test]
fn the_grid_of_a_plan_is_that_of_a_single_run() {
    let temp = tempfile::tempdir().unwrap();
    // Three by three tiles, or two by two, with voids across their borders, and a bay.
    let voids = [(128, 128, 20), (256, 300, 35), (320, 672, 30), (480, 480, 170), (768, 300, 190)];
    let files = cloud_of(temp.path(), 768, &voids);
    for (name, stats) in [
        ("a.tif", "mean,count,p90,std,idw:radius=4"),
        ("b.tif", "tin,nearest:radius=2"),
        ("c.tif", "tin:max_edge=6,max"),
        ("d.tif", "natural"),
        ("e.asc", "tin"),
    ] {
        let mut grid = job(&files, &temp.path().join(name), stats);
        grid.fill = if name == "c.tif" { 3 } else { 0 };
        if name == "e.asc" {
            (grid.sample_type, grid.round) = (SampleType::I32, true);
            grid.placement.align = Some([0.25, 0.5]);
        }
        let expected = single(&grid);
        let folder = temp.path().join(name.replace('.', "-"));
        plan(&folder, &grid, if stats == "natural" { 512 } else { 256 }).unwrap();
        let report = work(&folder, None).unwrap();
        let tasks = report.made.len() as u64 + 1;
        assert!(report.tasks == tasks && tasks > 4 && report.found == 0, "{name}: {report:?}");
        let output = folder.join("grid").with_extension(&name[2..]);
        assert!(std::fs::read(output).unwrap() == expected, "{name}: other bytes");
        assert!(work(&folder, None).unwrap().made.is_empty(), "nothing is left to do");
    }
}

/// A forest with houses and voids, whose parts lie side by side.
const FOREST: &str = "synth:cloud,size=600,density=0.25,seed=11,voids=2,tile=50";

#[test]
fn models_of_a_plan_are_those_of_a_single_run() {
    let temp = tempfile::tempdir().unwrap();
    let method = |text: &str| text.parse::<GroundFrom>().unwrap();
    let of = |preset, ground: &str, max_edge| {
        let job = GridJob::of_preset([FOREST], "", preset, 1.5);
        GridJob { ground: method(ground), max_edge, resources: enough(), ..job }
    };
    for (number, made) in [
        of(SurfaceModel::Dtm, "auto", None),
        of(SurfaceModel::Dtm, "csf:rigidness=1,cloth=1.5", None),
        of(SurfaceModel::Dtm, "pmf", Some(25.0)),
        of(SurfaceModel::Dsm, "class", None),
        of(SurfaceModel::Chm, "auto", Some(30.0)),
        of(SurfaceModel::Chm, "pmf", None),
    ]
    .into_iter()
    .enumerate()
    {
        let output = temp.path().join(format!("{number}.tif"));
        let made = GridJob { output, fill: if number == 2 { 3 } else { 0 }, ..made };
        let expected = single(&made);
        let folder = temp.path().join(number.to_string());
        plan(&folder, &made, 256).unwrap();
        let report = work(&folder, None).unwrap();
        assert_eq!(report.made.len(), 4, "{number}: {report:?}");
        let same = std::fs::read(folder.join("grid.tif")).unwrap() == expected;
        assert!(same, "{number}: other bytes");
        let notes = report.of.grid.unwrap().notes;
        assert!(notes.iter().any(|note| note.starts_with("ground: ")), "{notes:?}");
    }
}

#[test]
fn a_tile_of_a_model_reads_what_lies_near_it() {
    let temp = tempfile::tempdir().unwrap();
    let job = GridJob::of_preset([FOREST], temp.path().join("a.tif"), SurfaceModel::Dtm, 0.5);
    let ground = GroundFrom::Class;
    let job = GridJob { ground, max_edge: Some(9.0), resources: enough(), ..job };
    let folder = temp.path().join("work");
    plan(&folder, &job, 256).unwrap();
    let all = GridOptions::status(&folder).unwrap().of.points;
    let read = work(&folder, Some("tile-0")).unwrap().of.points as f64 / all as f64;
    // Of a twentieth, and of a margin as wide as a square of the store.
    assert!((0.05..0.6).contains(&read), "{read}");
}

#[test]
fn a_tile_reads_what_lies_near_it() {
    let temp = tempfile::tempdir().unwrap();
    let files = cloud(temp.path());
    let points = |stats: &str, task: &str| {
        let grid = job(&files, Path::new("a.tif"), stats);
        let folder = temp.path().join(format!("{}-{task}", stats.replace([':', '='], "-")));
        plan(&folder, &grid, 256).unwrap();
        let all = GridOptions::status(&folder).unwrap().of.points;
        work(&folder, Some(task)).unwrap().of.points as f64 / all as f64
    };
    // Those of a sixteenth; those in a margin, too; and what it takes around a wide void.
    let (local, near, far) =
        (points("mean", "tile-0"), points("tin:max_edge=6", "tile-0"), points("tin", "tile-5"));
    assert!((0.05..0.12).contains(&local), "{local}");
    assert!((0.12..0.4).contains(&near), "{near}");
    assert!(near < far, "{near} {far}");
}

#[test]
fn tasks_are_done_in_any_order_by_anyone() {
    let temp = tempfile::tempdir().unwrap();
    let files = cloud(temp.path());
    let grid = job(&files, &temp.path().join("a.tif"), "tin,mean");
    let (expected, folder) = (single(&grid), temp.path().join("work"));
    plan(&folder, &grid, 256).unwrap();
    for tile in [7, 0, 15, 3, 8, 14, 1, 9, 13, 6, 2, 11, 12, 10, 4] {
        assert_eq!(work(&folder, Some(&format!("tile-{tile}"))).unwrap().made.len(), 1);
    }
    let missing = work(&folder, Some("finish")).unwrap_err();
    assert_eq!(missing.kind(), ErrorKind::NotYet);
    assert!(missing.to_string().contains("tile-5 is not done"), "{missing}");
    let status = GridOptions::status(&folder).unwrap();
    let left: Vec<_> = status.to_do.iter().map(|task| task.id.as_str()).collect();
    assert_eq!((left, status.done), (vec!["tile-5", "finish"], 15));
    assert!(work(&folder, Some("tile-16")).unwrap_err().to_string().contains("no task tile-16"));
    assert!(work(&folder, Some("strip-0")).unwrap_err().to_string().contains("is not a task"));
    let report = work(&folder, None).unwrap();
    assert_eq!((report.found, report.made), (15, vec!["tile-5".to_owned()]));
    assert!(std::fs::read(folder.join("grid.tif")).unwrap() == expected);
}

#[test]
fn damage_is_found_and_made_good() {
    let temp = tempfile::tempdir().unwrap();
    let files = cloud(temp.path());
    let grid = job(&files, &temp.path().join("a.tif"), "mean,min");
    let (expected, folder) = (single(&grid), temp.path().join("work"));
    plan(&folder, &grid, 256).unwrap();
    work(&folder, None).unwrap();
    let tiles = objects(&folder, "tif");
    let mut bytes = std::fs::read(&tiles[2]).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&tiles[2], bytes).unwrap();
    std::fs::write(&tiles[4], b"short").unwrap();
    std::fs::remove_file(&objects(&folder, "json")[6]).unwrap();
    std::fs::remove_file(folder.join("grid.tif")).unwrap();
    let report = work(&folder, None).unwrap();
    assert_eq!((report.damaged.len(), report.made.len(), report.found), (2, 3, 13));
    assert!(std::fs::read(folder.join("grid.tif")).unwrap() == expected);
}

#[test]
fn another_input_or_plan_is_refused() {
    let temp = tempfile::tempdir().unwrap();
    let files = cloud(temp.path());
    let grid = job(&files, Path::new("a.tif"), "mean");
    let folder = temp.path().join("work");
    plan(&folder, &grid, 256).unwrap();
    plan(&folder, &grid, 256).unwrap();
    let other = plan(&folder, &job(&files, Path::new("a.tif"), "max"), 256).unwrap_err();
    assert!(other.to_string().contains("holds another plan: method.stats.0"), "{other}");
    assert!(plan(&temp.path().join("other"), &grid, 100).unwrap_err().to_string().contains("256"));
    let text = std::fs::read_to_string(&files[3]).unwrap();
    std::fs::write(&files[3], text.replacen('1', "2", 1)).unwrap();
    let changed = work(&folder, None).unwrap_err();
    assert_eq!(changed.kind(), ErrorKind::BadInput);
    assert!(changed.to_string().contains(&files[3]), "{changed}");
}
