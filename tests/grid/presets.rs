//! Models of the terrain: near a ground that is known, without pits, never below it; the same bytes
//! whatever the threads and the memory; refusals.

use std::path::Path;

use crate::cli_support::Place;
use crate::support::{Written, read};
use terrane_cloud::synth::survey;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_gridding::parse_list;
use terrane_lidar::grid::{GridJob, GridReport, GroundFrom, SurfaceModel, run};
use terrane_synth::cloud::{BUILDING, LidarSurvey};

/// World coordinates of a synthetic cloud's south-west corner.
const ORIGIN: [f64; 2] = [500_000.0, 4_750_000.0];
const FOREST: &str = "synth:cloud,size=300,density=8,seed=7";

fn preset(
    name: &str,
    output: &Path,
    preset: SurfaceModel,
    ground: GroundFrom,
) -> (Written, GridReport) {
    let job = GridJob { ground, ..GridJob::of_preset([name], output, preset, 1.0) };
    made(&job)
}

fn made(job: &GridJob) -> (Written, GridReport) {
    let job = GridJob { overwrite: true, ..job.clone() };
    let report = run(&job, &Silent, &Cancel::default()).unwrap();
    (read(&job.output, 1), report)
}

/// The centres of cells with their values, in metres from the survey's south-west corner.
fn cells(grid: &Written) -> impl Iterator<Item = ([f64; 2], f64)> {
    let centre = |k: usize| {
        let (col, row) = ((k % grid.width) as f64 + 0.5, (k / grid.width) as f64 + 0.5);
        [grid.corner[0] + col - ORIGIN[0], grid.corner[1] - row - ORIGIN[1]]
    };
    let void = |value: f64| if value == -9999.0 { f64::NAN } else { value };
    grid.values.iter().enumerate().map(move |(k, value)| (centre(k), void(*value)))
}

/// Root of the mean square of what separates a grid from the survey's ground, and the share of voids.
fn error(grid: &Written, survey: &LidarSurvey) -> [f64; 2] {
    let (mut known, mut sum) = (0.0, 0.0);
    for ([x, y], z) in cells(grid).filter(|(_, z)| !z.is_nan()) {
        known += 1.0;
        sum += (z - survey.ground(x, y)).powi(2);
    }
    [f64::sqrt(sum / known), 1.0 - known / grid.values.len() as f64]
}

#[test]
fn the_ground_is_found_by_class_and_by_filter() {
    let place = Place::new();
    for (name, by_class, by_filter) in [
        (FOREST, 0.05, 0.10),
        ("synth:cloud,size=250,density=2,seed=3,voids=2,tile=100", 0.12, 0.15),
    ] {
        let survey = survey(name).unwrap();
        for (ground, most, words) in [
            (GroundFrom::Auto, by_class, "points of class 2"),
            (GroundFrom::PMF, by_filter, "found by the method pmf"),
        ] {
            let (grid, report) = preset(name, &place.path("a.tif"), SurfaceModel::Dtm, ground);
            let [rmse, voids] = error(&grid, &survey);
            println!("{name} {ground:?}: {rmse:.3} m, {:.2} % void", 100.0 * voids);
            assert!(rmse < most && voids < 0.02, "{name} {ground:?}: {rmse} m, {voids} void");
            assert!(report.notes.iter().any(|note| note.contains(words)), "{:?}", report.notes);
        }
    }
}

#[test]
fn ground_without_classes_is_found_unless_only_classes_are_asked_for() {
    let place = Place::new();
    // Class 30 is that of no point.
    let job = GridJob::of_preset([FOREST], place.path("a.tif"), SurfaceModel::Dtm, 1.0);
    let mut none = job.clone();
    none.cloud.filter.classes = Some(vec![30]);
    let best = GridJob { ground: GroundFrom::Method(terrane_ground::Request::DEFAULT), ..job };
    let (auto, report) = made(&none);
    assert!(report.notes[0].contains("found by the method csf-ptd"), "{:?}", report.notes);
    assert_eq!(auto.values, made(&best).0.values);
    let only = GridJob { ground: GroundFrom::Class, ..none };
    let error = run(&GridJob { overwrite: true, ..only }, &Silent, &Cancel::default());
    assert!(error.unwrap_err().to_string().contains("no points of class 30"));
}

#[test]
fn a_surface_has_no_pits_and_stands_on_the_ground() {
    let place = Place::new();
    let at = |name: &str| place.path(name);
    let (dtm, _) = preset(FOREST, &at("dtm.tif"), SurfaceModel::Dtm, GroundFrom::Auto);
    let (dsm, _) = preset(FOREST, &at("dsm.tif"), SurfaceModel::Dsm, GroundFrom::Auto);
    let (chm, report) = preset(FOREST, &at("chm.tif"), SurfaceModel::Chm, GroundFrom::Auto);
    let mut plain = GridJob::new([FOREST], at("tin.tif"), parse_list("tin,max").unwrap(), 1.0);
    plain.cloud.filter.returns = Some(terrane_cloud::Return::First);
    plain.cloud.filter.classes = Some((0..=255).filter(|c| ![7, 18].contains(c)).collect());
    let (tin, _) = made(&plain);
    let max = read(&plain.output, 2);
    assert_eq!(report.bands[0].name, "chm");
    let values = |grid: &Written| cells(grid).map(|(_, z)| z).collect::<Vec<_>>();
    let all = [&dtm, &dsm, &chm, &tin, &max].map(values);
    let (mut lifted, mut pits, mut high) = (0, [0, 0], 0);
    for k in 0..all[0].len() {
        let [ground, top, above, tin, _] = [0, 1, 2, 3, 4].map(|band| all[band][k]);
        assert_eq!(above.is_nan(), ground.is_nan() || top.is_nan(), "{k}");
        if above.is_nan() {
            continue;
        }
        assert!(above >= 0.0 && (above - (top - ground).max(0.0)).abs() < 1e-3, "{k}: {above}");
        // Nowhere is the surface below the triangulation of all its points.
        assert!(top >= tin, "{k}: {top} {tin}");
        lifted += u32::from(top > tin + 0.5);
        high += u32::from(above > 3.0);
        // A pit: all highest points around are far above.
        for (pits, surface) in pits.iter_mut().zip([&all[1], &all[3]]) {
            *pits += u32::from(is_pit(surface[k], &all[4], k, dsm.width));
        }
    }
    println!("{lifted} lifted, pits {pits:?}, {high} high of {}", all[0].len());
    assert!(lifted > 500 && pits[0] * 4 < pits[1], "{lifted} {pits:?}");
    assert!(high > 5000);
}

/// Whether a height is far below the highest points of all cells around it.
fn is_pit(height: f64, max: &[f64], k: usize, width: usize) -> bool {
    let around = [k.wrapping_sub(width), k.wrapping_sub(1), k, k + 1, k + width];
    around.iter().all(|k| max.get(*k).is_some_and(|max| max - height > 2.5))
}

#[test]
fn roofs_and_meadows_are_as_high_as_they_are() {
    let place = Place::new();
    let survey = survey(FOREST).unwrap();
    let (chm, _) = preset(FOREST, &place.path("a.tif"), SurfaceModel::Chm, GroundFrom::PMF);
    // Cells whose points, those of the cells around too, are all of one class.
    let mut classes = vec![[0_u32; 2]; chm.values.len()];
    let mut heights = vec![0.0; chm.values.len()];
    let mut echoes = Vec::new();
    for part in 0..survey.parts() {
        survey.fill(part, &mut echoes);
        for echo in echoes.iter().filter(|e| !e.withheld && ![7, 18].contains(&e.class)) {
            let [x, y] = [echo.point.x, echo.point.y].map(|v| f64::from(v) * survey.scale);
            let row = chm.corner[1] - ORIGIN[1] - y;
            let k = row.ceil() as usize * chm.width - chm.width + x as usize;
            classes[k.min(chm.values.len() - 1)][usize::from(echo.class == BUILDING)] += 1;
            heights[k.min(chm.values.len() - 1)] =
                f64::from(echo.point.z) * survey.scale - survey.ground(x, y);
        }
    }
    let (mut roofs, mut wrong) = (0, 0);
    for (k, (_, above)) in cells(&chm).enumerate().filter(|(_, (_, z))| !z.is_nan()) {
        let (col, row) = (k % chm.width, k / chm.width);
        if col == 0 || row == 0 || col + 1 == chm.width || (row + 1) * chm.width >= classes.len() {
            continue;
        }
        let square = [k - chm.width - 1, k - 1, k + chm.width - 1];
        let around = || square.into_iter().flat_map(|from| classes[from..from + 3].iter());
        if around().all(|[other, roof]| *other == 0 && *roof > 0) {
            roofs += 1;
            wrong += u32::from((above - heights[k]).abs() > 1.5);
        }
    }
    println!("{wrong} of {roofs} roofs wrong");
    assert!(roofs > 50 && wrong * 20 < roofs, "{wrong} of {roofs}");
}

#[test]
fn neither_threads_nor_memory_nor_the_box_leave_a_trace() {
    let place = Place::new();
    let name = "synth:cloud,size=200,density=4,seed=5,voids=1,tile=100";
    for kind in [SurfaceModel::Dtm, SurfaceModel::Chm] {
        let bytes = |threads, memory: u64| {
            let resources = Resources { threads, memory: memory << 20, temp_dir: None };
            let output = place.path("a.tif");
            let job = GridJob::of_preset([name], &output, kind, 0.5);
            let (_, report) = made(&GridJob { resources, ground: GroundFrom::PMF, ..job });
            (std::fs::read(&output).unwrap(), report.run.spilled_bytes > Some(0))
        };
        let (whole, spilled) = bytes(1, 2048);
        assert!(!spilled);
        assert!(whole == bytes(3, 2048).0, "threads left a trace");
        let (small, _) = bytes(2, 128);
        assert!(whole == small, "the budget left a trace");
        let all = read(&place.path("a.tif"), 1);
        let mut job = GridJob::of_preset([name], place.path("b.tif"), kind, 0.5);
        let [x, y] = ORIGIN;
        job.placement.extent = Some([x + 40.0, y + 60.0, x + 90.0, y + 100.0]);
        let (part, _) = made(&GridJob { ground: GroundFrom::PMF, ..job });
        let col = ((part.corner[0] - all.corner[0]) * 2.0) as usize;
        let row = ((all.corner[1] - part.corner[1]) * 2.0) as usize;
        for (k, line) in part.values.chunks(part.width).enumerate() {
            let from = (row + k) * all.width + col;
            assert_eq!(line, &all.values[from..from + part.width]);
        }
    }
}

#[test]
fn what_cannot_act_is_refused() {
    let place = Place::new();
    let with = |more: &[&str], code: i32, words: &[&str]| {
        let base = ["grid", "synth:cloud,size=50", "a.tif", "--cell", "1"];
        place.fails(&[&base, more].concat(), code, words);
    };
    with(&["--dtm", "--stat", "mean"], 2, &["--stat"]);
    with(&["--dtm", "--dsm"], 2, &["--dsm"]);
    with(&["--dsm", "--chm"], 2, &["--chm"]);
    with(&["--ground", "pmf"], 2, &["--ground requires", "--dtm"]);
    with(&["--dtm", "--return", "last"], 2, &["--return has no effect"]);
    with(&["--dtm", "--ground", "pmf", "--class", "2"], 2, &["--class has no effect"]);
    with(&["--dtm", "--radius", "2"], 2, &["--radius has no effect"]);
    with(&["--dtm", "--ground", "class", "--class", "30"], 65, &["no points of class 30"]);
    place.write("a.xyz", "x y z\n0.0 0.0 1.0\n1.0 0.0 2.0\n0.0 1.0 3.0\n1.0 1.0 4.5\n");
    let degrees = ["grid", "a.xyz", "a.tif", "--cell", "1", "--crs", "EPSG:4326", "--dsm"];
    place.fails(&degrees, 65, &["degree"]);
    let told = place.ok(&["grid", "a.xyz", "a.tif", "--cell", "0.5", "--dtm"]).out;
    assert!(told.contains("metres are assumed"), "{told}");
    assert!(told.contains("of 4 last returns"), "{told}");
    assert_eq!(place.files(), ["a.tif", "a.xyz"]);
}
