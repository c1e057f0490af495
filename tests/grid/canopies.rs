//! Spike-free surfaces: without pits, the plain triangulation where nothing freezes, the same bytes whatever the
//! threads, the memory, the order of files, the box and the tasks; refusals.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use crate::cli_support::Place;
use crate::support::{Lots, Written, read};
use terrane_engine::operation::Divisible;
use terrane_engine::plan::{DiskCheck, OutputForm, RunJob};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_gridding::parse_list;
use terrane_lidar::grid::plan::{PlanGridJob, plan_grid};
use terrane_lidar::grid::{GridJob, GridOptions, GridReport, SurfaceModel, run};

const FOREST: &str = "synth:cloud,size=300,density=8,seed=7";

fn made(job: &GridJob) -> (Written, GridReport) {
    let job = GridJob { overwrite: true, ..job.clone() };
    let report = run(&job, &Silent, &Cancel::default()).unwrap();
    (read(&job.output, 1), report)
}

fn canopy(input: &[String], output: &Path, preset: SurfaceModel, canopy: &str) -> GridJob {
    let job = GridJob::of_preset(input.to_vec(), output, preset, 1.0);
    GridJob { canopy: canopy.parse().unwrap(), ..job }
}

fn resources(threads: usize, mib: u64) -> Resources {
    Resources { threads, memory: mib << 20, temp_dir: None }
}

/// How many cells of a surface are far below the highest points of themselves and of all cells beside them.
fn pits(grid: &Written, max: &Written) -> usize {
    let is_deep =
        |at: usize, k: usize| max.values.get(at).is_some_and(|max| max - grid.values[k] > 2.5);
    let around =
        |k: usize| [k.wrapping_sub(grid.width), k.wrapping_sub(1), k, k + 1, k + grid.width];
    (0..grid.values.len()).filter(|&k| around(k).into_iter().all(|at| is_deep(at, k))).count()
}

/// Heights that can be compared: voids are NaN.
fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// The grid of a statistic of points that are no noise.
fn statistic(input: &[String], output: &Path, stat: &str, is_first: bool) -> Written {
    let mut job = GridJob::new(input.to_vec(), output, parse_list(stat).unwrap(), 1.0);
    job.cloud.filter.returns = is_first.then_some(terrane_cloud::Return::First);
    job.cloud.filter.classes = Some((0..=255).filter(|class| ![7, 18].contains(class)).collect());
    made(&job).0
}

#[test]
fn a_spike_free_surface_has_no_pits_where_plain_ones_do() {
    let place = Place::new();
    let input = [FOREST.to_owned()];
    let top = |name: &str, asked: &str| {
        made(&canopy(&input, &place.path(name), SurfaceModel::Dsm, asked))
    };
    let (free, report) = top("free.tif", "spike-free");
    let (pit_free, _) = top("pit.tif", "pit-free");
    let of = |stat, is_first| statistic(&input, &place.path("stat.tif"), stat, is_first);
    let [first, all, max] = [("tin", true), ("tin", false), ("max", true)].map(|(s, f)| of(s, f));
    let count = [&free, &pit_free, &first, &all].map(|grid| pits(grid, &max));
    println!("pits: spike-free, pit-free, plain of first returns, of all: {count:?}");
    assert!(
        count[0] * 8 < count[2] && count[0] < count[1] && count[0] * 30 < count[3],
        "{count:?}"
    );
    assert!(report.notes.iter().any(|note| note.contains("spike-free with")), "{:?}", report.notes);
    // Open ground is as it was: no wall has moved by more than a triangle.
    let same =
        (0..free.values.len()).filter(|k| (free.values[*k] - pit_free.values[*k]).abs() < 1.0);
    let same = same.count();
    assert!(same * 10 > free.values.len() * 8, "{same} of {}", free.values.len());
    let void = |grid: &Written| grid.values.iter().filter(|z| z.is_nan()).count();
    assert!(void(&free) <= void(&first), "{} {}", void(&free), void(&first));
}

/// Files with points about 0.7 apart, no two at one place, with voids wider than what a square sees and a bay in
/// the outline; crowns with returns from below them.
fn grove(folder: &Path) -> Vec<String> {
    let (mut lots, mut taken) = (Lots(9), BTreeSet::new());
    let mut files = vec![String::new(); 4];
    for _ in 0..150_000 {
        let [x, y] = [lots.below(36_000), lots.below(24_000)];
        let [east, north] = [x, y].map(|v| f64::from(v) / 100.0);
        let far = |[cx, cy]: [f64; 2], r: f64| (east - cx).hypot(north - cy) > r;
        let is_land =
            far([120.0, 110.0], 55.0) && far([250.0, 0.0], 40.0) && far([360.0, 200.0], 60.0);
        if !is_land || !taken.insert([x, y]) {
            continue;
        }
        let ground = f64::from(lots.below(30)) / 100.0 + east / 40.0;
        let away = (east % 17.0 - 8.5).hypot(north % 19.0 - 9.5);
        let z = match lots.below(4) {
            0 => ground,
            _ if away < 6.0 => ground + 18.0 - away,
            _ => ground,
        };
        let file = &mut files[usize::from(x > 18_000) + 2 * usize::from(y > 9_000)];
        writeln!(file, "{east:.2} {north:.2} {z:.2}").unwrap();
    }
    let write = |(number, text): (usize, &String)| {
        let path = folder.join(format!("{number}.xyz"));
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    files.iter().enumerate().map(write).collect()
}

#[test]
fn where_nothing_freezes_it_is_the_triangulation_of_all() {
    let place = Place::new();
    let input = grove(&place.path(""));
    for max_edge in [None, Some(3.0)] {
        let job = canopy(&input, &place.path("a.tif"), SurfaceModel::Dsm, "spike-free:freeze=0");
        let (free, _) = made(&GridJob { max_edge, ..job });
        let stats = parse_list("tin").unwrap();
        let job = GridJob::new(input.clone(), place.path("b.tif"), stats, 1.0);
        let (plain, _) = made(&GridJob { max_edge, ..job });
        assert!(bits(&free.values) == bits(&plain.values), "{max_edge:?}");
        assert!(plain.values.iter().any(|z| z.is_nan()));
    }
    let frozen = made(&canopy(&input, &place.path("a.tif"), SurfaceModel::Dsm, "spike-free")).0;
    let max = statistic(&input, &place.path("c.tif"), "max", false);
    let [frozen, plain] = [&frozen, &read(&place.path("b.tif"), 1)].map(|grid| pits(grid, &max));
    println!("pits of the grove: spike-free {frozen}, plain {plain}");
    assert!(frozen * 20 < plain, "{frozen} {plain}");
}

#[test]
fn neither_threads_nor_memory_nor_order_nor_the_box_leave_a_trace() {
    let place = Place::new();
    let mut input = grove(&place.path(""));
    for (preset, max_edge) in [(SurfaceModel::Dsm, None), (SurfaceModel::Chm, Some(9.0))] {
        let ground = "pmf".parse().unwrap();
        let asked = |input: &[String], resources| {
            let job = canopy(input, &place.path("a.tif"), preset, "spike-free");
            let job = GridJob { max_edge, resources, ..job };
            if preset == SurfaceModel::Chm { GridJob { ground, ..job } } else { job }
        };
        let bytes = |job: &GridJob| {
            let (_, report) = made(job);
            (std::fs::read(&job.output).unwrap(), report.run.spilled_bytes > Some(0))
        };
        let (whole, spilled) = bytes(&asked(&input, resources(1, 2048)));
        assert!(!spilled);
        assert!(whole == bytes(&asked(&input, resources(3, 2048))).0, "threads left a trace");
        input.reverse();
        assert!(whole == bytes(&asked(&input, resources(2, 1024))).0, "the order left a trace");
        let (small, _) = bytes(&asked(&input, resources(2, 132)));
        assert!(whole == small, "the budget left a trace");
        let all = read(&place.path("a.tif"), 1);
        let mut job = asked(&input, resources(2, 1024));
        job.placement.extent = Some([60.0, 70.0, 210.0, 180.0]);
        let (part, _) = made(&GridJob { output: place.path("b.tif"), ..job });
        let (col, row) = (60 - all.corner[0] as usize, all.corner[1] as usize - 180);
        for (k, line) in part.values.chunks(part.width).enumerate() {
            let from = (row + k) * all.width + col;
            assert_eq!(bits(line), bits(&all.values[from..from + part.width]));
        }
    }
}

#[test]
fn a_plan_makes_the_bytes_of_a_single_run() {
    let place = Place::new();
    let input = grove(&place.path(""));
    for (number, (preset, asked, max_edge)) in [
        (SurfaceModel::Dsm, "spike-free", None),
        (SurfaceModel::Chm, "spike-free:freeze=1.5,buffer=1", Some(12.0)),
        (SurfaceModel::Chm, "spike-free:freeze=0", None),
    ]
    .into_iter()
    .enumerate()
    {
        let job = canopy(&input, &place.path("a.tif"), preset, asked);
        let job = GridJob { max_edge, overwrite: true, resources: resources(2, 1024), ..job };
        made(&job);
        let folder = place.path(&format!("work-{number}"));
        let output = folder.join("grid.tif");
        let planned = GridJob { output, format: Some("GTiff".to_owned()), ..job };
        let plan = PlanGridJob {
            job: planned,
            folder: folder.clone(),
            cut: Some(256),
            skipped: Vec::new(),
        };
        plan_grid(&plan, &Silent, &Cancel::default()).unwrap();
        let work = RunJob {
            folder: folder.clone(),
            task: None,
            output: None,
            overwrite: false,
            form: OutputForm::default(),
            disk: DiskCheck::On,
            resources: resources(2, 1024),
        };
        let report = GridOptions::run_plan(&work, &Silent, &Cancel::default()).unwrap();
        assert_eq!(report.made.len(), 2, "{report:?}");
        let [made, single] =
            [folder.join("grid.tif"), place.path("a.tif")].map(|path| std::fs::read(path).unwrap());
        assert!(made == single, "{asked}: other bytes");
        let notes = report.of.grid.unwrap().notes;
        assert!(notes.iter().any(|note| note.contains("spike-free with")), "{notes:?}");
    }
}

#[test]
fn what_cannot_act_is_refused_and_too_little_memory_by_name() {
    let place = Place::new();
    let with = |more: &[&str], code: i32, words: &[&str]| {
        let base = ["grid", "synth:cloud,size=50", "a.tif", "--cell", "1"];
        place.fails(&[&base, more].concat(), code, words);
    };
    let free = ["--canopy", "spike-free"];
    with(&free, 2, &["--canopy requires"]);
    with(&[&free[..], &["--dtm"]].concat(), 2, &["--canopy requires", "--dsm or --chm"]);
    with(&["--dsm", "--canopy", "moss"], 2, &["unknown canopy method", "pit-free, spike-free"]);
    with(&["--dsm", "--canopy", "spike-free:freeze=-1"], 2, &["freeze=auto (from 0 to 1000)"]);
    with(&["--dsm", "--canopy", "pit-free:freeze=1"], 2, &["takes none"]);
    with(&["--dsm", "--canopy", "spike-free", "--ground", "pmf"], 2, &["--ground has no effect"]);
    with(&["--dsm", "--canopy", "spike-free", "--class", "2"], 2, &["--class has no effect"]);
    let dense = ["grid", FOREST, "a.tif", "--cell", "1", "--dsm", "--canopy", "spike-free"];
    place.ok_as_advised(&dense, "130M", &["MiB of memory are needed"]);
    // Most points of a wide cloud are in one place.
    let mut uneven = String::new();
    for k in 0..340_000 {
        let (x, y) = match k {
            0..40_000 => (k % 200 * 500, k / 200 * 500),
            _ => (40_000 + k % 550 * 5, 40_000 + (k - 40_000) / 550 * 5),
        };
        let [x, y] = [x, y].map(|v| f64::from(v) / 100.0);
        writeln!(uneven, "{x:.2} {y:.2} {}", k % 7).unwrap();
    }
    place.write("uneven.xyz", uneven);
    let uneven = ["grid", "uneven.xyz", "a.tif", "--cell", "9", "--dsm", "--overwrite", "-q"];
    let uneven = [&uneven[..], &free].concat();
    place.ok_as_advised(&uneven, "196M", &["a tile of the spike-free surface"]);
    place.write("deg.xyz", "0.0 0.0 1.0\n1.0 0.0 2.0\n0.0 1.0 3.0\n1.0 1.0 4.5\n");
    let degrees = ["grid", "deg.xyz", "b.tif", "--cell", "1", "--crs", "EPSG:4326", "--dsm"];
    place.fails(&[&degrees[..], &free].concat(), 65, &["degree"]);
    let few = ["grid", "deg.xyz", "b.tif", "--cell", "0.5", "--dsm"];
    place.ok(&[&few[..], &free].concat());
}
