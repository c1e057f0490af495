//! What `tin` promises in numbers holds: the memory it advises, the vertices it allows, the largest
//! error it tells, and tiles that cost nothing where they are larger than the grid.

use std::fmt::Write as _;

use crate::cli_support::Place;
use serde_json::Value;

/// A grid with round voids, as ESRI ASCII.
fn holed(side: i32, whole: bool) -> String {
    let mut text = format!(
        "ncols {side}\nnrows {side}\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n"
    );
    for (row, col) in (0..side).flat_map(|row| (0..side).map(move |col| (row, col))) {
        let (x, y) = (f64::from(col), f64::from(row));
        let (dx, dy) = (x % 37.0 - 18.0, y % 41.0 - 20.0);
        let rough = f64::from((col * 7919 + row * 104_729) % 1000) / 100.0;
        let height = 40.0 * (x / 31.0).sin() * (y / 23.0).cos() + rough;
        let height = if dx * dx + dy * dy < 90.0 { -9999.0 } else { height };
        let height = if whole { height.round() } else { height };
        writeln!(text, "{height}").unwrap();
    }
    text
}

fn report(place: &Place, args: &[&str]) -> Value {
    let ran = place.ok(&[args, &["--json", "--overwrite"]].concat());
    serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{args:?}: {e}: {}", ran.out))
}

#[test]
fn advised_memory_is_enough_memory() {
    let place = Place::new();
    let tall = ["--co", "COMPRESS=DEFLATE", "--co", "BLOCKYSIZE=800", "-q"];
    place
        .ok(&[&["convert", "synth:rough,size=800", "strip.tif", "-f", "GTiff"], &tall[..]]
            .concat());
    place.ok(&["synth", "cloud,size=90,density=8", "cloud.laz", "-q"]);
    // A `*` stands for a name of its own in each run.
    let jobs = [
        "tin synth:rough,size=300 *.ply --max-error 1",
        "tin strip.tif *.ply --max-error 1",
        "tin strip.tif *.ply --max-error 1 --tile 8192",
        "tin strip.tif *.ply --max-vertices 5000",
        "tin cloud.laz *.ply --max-error 0.5",
        "tin cloud.laz *.ply --max-error 0",
        "grid cloud.laz *.tif --cell 1",
        "grid cloud.laz *.tif --cell 1 --stat natural",
        "grid cloud.laz *.tif --cell 1 --stat tin",
        "tin strip.tif *.ply --max-error 1 --workdir *",
    ];
    for (i, job) in jobs.iter().enumerate() {
        for threads in ["1", "2", "7"] {
            let job = job.replace('*', &format!("{i}-{threads}"));
            let job: Vec<&str> = job.split(' ').chain(["--threads", threads]).collect();
            let memory = place.advised(&job, "1M", &[]);
            place.ok(&[&job[..], &["--memory", &memory, "-q"]].concat());
        }
    }
}

/// A second worker that just fits must not take the room of a block.
#[test]
fn more_memory_than_advised_is_enough_too() {
    let place = Place::new();
    let tall = ["--co", "COMPRESS=DEFLATE", "--co", "BLOCKYSIZE=1100", "-q"];
    place
        .ok(&[&["convert", "synth:rough,size=1100", "strip.tif", "-f", "GTiff"], &tall[..]]
            .concat());
    let job = ["tin", "strip.tif", "o.ply", "--max-error", "1", "--tile", "64", "--threads", "2"];
    let least: u64 = place.advised(&job, "1M", &[]).trim_end_matches('M').parse().unwrap();
    for memory in least..least + 12 {
        let memory = format!("{memory}M");
        place.ok(&[&job[..], &["--memory", &memory, "--overwrite", "-q"]].concat());
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_mesh_of_all_points_of_a_cloud_keeps_to_the_least_memory() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=250,density=8", "cloud.las", "-q"]);
    for (format, threads) in [("ply", "1"), ("stl", "2")] {
        let output = format!("all.{format}");
        let job = ["tin", "cloud.las", &output, "--max-error", "0", "--threads", threads];
        let memory = place.advised(&job, "1M", &[]);
        let report = report(&place, &[&job[..], &["--memory", &memory]].concat());
        let peak = report["peak_memory"].as_f64().unwrap() / f64::from(1 << 20);
        let allowed: f64 = memory.trim_end_matches('M').parse().unwrap();
        assert!(peak <= allowed, "{peak} MiB of {allowed}, {format}");
    }
}

#[test]
fn a_budget_takes_few_trials_and_is_nearly_used() {
    let place = Place::new();
    place.write("holed.asc", holed(240, false)).write("whole.asc", holed(240, true));
    for (grid, least) in [("holed.asc", 0.95), ("whole.asc", 0.5)] {
        for (goal, counted, budget) in [
            ("--max-vertices", "vertices", "9000"),
            ("--max-vertices", "vertices", "12000"),
            ("--max-vertices", "vertices", "30000"),
            ("--max-triangles", "triangles", "18000"),
            ("--max-triangles", "triangles", "40000"),
        ] {
            let made = report(&place, &["tin", grid, "o.ply", goal, budget, "--tile", "64"]);
            let (count, trials) =
                (made[counted].as_f64().unwrap(), made["trials"].as_u64().unwrap());
            let used = count / budget.parse::<f64>().unwrap();
            assert!(trials <= 6, "{trials} trials, {grid} {goal} {budget}");
            assert!(used <= 1.0 && used >= least, "{used} used, {grid} {goal} {budget}");
        }
    }
}

#[test]
fn the_largest_error_told_is_never_below_the_truth() {
    let place = Place::new();
    place.write("holed.asc", holed(150, false)).write("whole.asc", holed(150, true));
    place.ok(&["synth", "cloud,size=60,density=8", "cloud.las", "-q"]);
    let mut checked = 0;
    for input in ["holed.asc", "whole.asc", "synth:rough,size=200", "cloud.las"] {
        for tolerance in ["0.13", "0.5", "1.7", "6"] {
            for output in ["o.ply", "o.glb", "o.obj"] {
                let tin = report(&place, &["tin", input, output, "--max-error", tolerance]);
                let told = tin["max_error"].as_f64().unwrap();
                let ran = place.run(&["verify", output, input, "--json"]);
                let proof: Value = serde_json::from_str(&ran.out).unwrap();
                let truth = proof["max_error"].as_f64().unwrap();
                assert!(
                    truth <= told,
                    "{told:e} told, {truth:e} found: {input} {tolerance} {output}"
                );
                assert!(
                    told <= tolerance.parse().unwrap(),
                    "{told:e}: {input} {tolerance} {output}"
                );
                assert!(told <= truth * (1.0 + 1e-6) + 1e-9, "{told:e} for {truth:e}");
                checked += 1;
            }
        }
    }
    assert_eq!(checked, 48);
}

#[test]
fn a_tile_larger_than_the_grid_is_one_of_its_size() {
    let place = Place::new();
    let job = |output, tile| {
        [
            "tin",
            "synth:rough,size=200",
            output,
            "--max-error",
            "1",
            "--threads",
            "2",
            "--tile",
            tile,
        ]
    };
    let memory = place.advised(&job("a.ply", "199"), "1M", &[]);
    for (output, tile) in [("a.ply", "199"), ("b.ply", "200"), ("c.ply", "8192")] {
        place.ok(&[&job(output, tile)[..], &["--memory", &memory, "-q"]].concat());
        assert_eq!(place.advised(&job("d.ply", tile), "1M", &[]), memory);
    }
    let [a, b, c] =
        ["a.ply", "b.ply", "c.ply"].map(|name| std::fs::read(place.path(name)).unwrap());
    assert!(a == b && a == c);
    place.fails(&job("e.ply", "8193"), 2, &["8193", "from 16 to 8192"]);
}
