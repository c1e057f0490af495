//! What plans tell of the work before, in and after it.

use std::path::PathBuf;
use std::time::Instant;

use serde_json::Value;

use crate::cli_support::{Place, json};
use crate::plan_matrix::files;

fn cloud() -> Place {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=150,density=4,seed=5", "c.laz"]);
    place
}

/// Kinds of work whose time does not follow from the number of points alone.
#[test]
fn the_time_foretold_is_about_the_time_taken() {
    let place = cloud();
    let kinds: [&[&str]; 3] = [
        &["--cell", "0.5", "--stat", "idw:radius=4"],
        &["--cell", "0.5", "--chm"],
        &["--cell", "0.5", "--stat", "natural"],
    ];
    for kind in kinds {
        let plan = ["plan", "grid", "c.laz", "-o", "work", "--tile", "256"];
        place.ok(&[&plan[..], kind].concat());
        let foretold =
            json(&place.ok(&["status", "work", "--json"]).out)["seconds"].as_f64().unwrap();
        let started = Instant::now();
        place.ok(&["run", "work"]);
        let taken = started.elapsed().as_secs_f64();
        // The machine may be busy with other things, now or before.
        assert!(
            foretold < 10.0 * taken && taken < 10.0 * foretold,
            "{kind:?}: {foretold} for {taken}"
        );
        std::fs::remove_dir_all(place.path("work")).unwrap();
    }
}

#[test]
fn what_is_done_is_what_was_to_do() {
    let place = cloud();
    place.ok(&["synth", "rough,size=300", "dem.tif"]);
    let plans: [&[&str]; 4] = [
        &["grid", "c.laz", "--cell", "0.4", "--stat", "mean", "--tile", "256"],
        &["points", "c.laz", "--tile", "60", "--cut", "1"],
        &["tin", "c.laz", "--max-error", "1"],
        &["tin", "dem.tif", "--max-error", "3", "--tile", "64", "--strip-rows", "2"],
    ];
    for plan in plans {
        let before = place.ok(&[&["plan"], plan, &["-o", "work"]].concat()).out;
        let status = json(&place.ok(&["status", "work", "--json"]).out);
        let to_do = status["to_do"].as_array().unwrap();
        let names: Vec<&Value> = to_do.iter().map(|task| &task["id"]).collect();
        assert!(before.contains(&format!("0 done, {} to do", names.len())), "{plan:?}:\n{before}");
        let (finish, others) = to_do.split_last().unwrap();
        assert_eq!(finish["id"], "finish");
        let after: Vec<&Value> = finish["after"].as_array().unwrap().iter().collect();
        let others: Vec<&Value> = others.iter().map(|task| &task["id"]).collect();
        assert_eq!(after, others, "{plan:?}: finish waits for all others");
        let told = place.ok(&["run", "work"]).out;
        assert!(told.contains(&format!("{} tasks, ", names.len())), "{plan:?}:\n{told}");
        let again = place.ok(&["run", "work"]).out;
        assert!(again.contains(&format!("{0} of {0}, ", names.len())), "{plan:?}:\n{again}");
        assert!(!again.contains(" tasks, "), "nothing is made again:\n{again}");
        std::fs::remove_dir_all(place.path("work")).unwrap();
    }
}

#[test]
fn a_grid_has_as_many_points_as_its_cloud() {
    let place = cloud();
    let count = json(&place.ok(&["info", "c.laz", "--json"]).out)["points"].as_u64().unwrap();
    let plan =
        ["plan", "grid", "c.laz", "-o", "work", "--cell", "0.4", "--stat", "tin", "--tile", "256"];
    place.ok(&plan);
    let told = place.ok(&["run", "work", "--json"]).out;
    let report = json(&told);
    assert_eq!(report["grid"]["cloud_points"], count);
    assert!(report["points"].as_u64().unwrap() > count, "tiles read what lies near them");
    std::fs::remove_dir_all(place.path("work")).unwrap();
    place.ok(&plan);
    let told = place.ok(&["run", "work"]).out;
    let digits = |n: u64| {
        let text = n.to_string();
        let (head, tail) = text.split_at(text.len() - 3);
        format!("{head},{tail}")
    };
    assert!(told.contains(&format!("{} in the cloud; ", digits(count))), "{told}");
}

/// Plans of one request are one plan, however long their samples took.
#[test]
fn the_time_is_no_part_of_what_is_asked() {
    let place = cloud();
    let plan = |folder: &str| {
        place.ok(&["plan", "grid", "c.laz", "-o", folder, "--cell", "2", "--stat", "tin"]);
        json(&place.ok(&["status", folder, "--json"]).out)["plan_id"].clone()
    };
    assert_eq!(plan("one"), plan("two"));
    assert_eq!(plan("one"), plan("one"));
}

/// Bytes that were expected, by bytes that there are.
fn ratios(place: &Place, output: &str) -> [f64; 2] {
    let planned = json(&place.ok(&["status", "work", "--json"]).out);
    place.ok(&["run", "work", "-q"]);
    let done = json(&place.ok(&["status", "work", "--json"]).out);
    // Many small files take whole blocks of the disk.
    let block = if place.path("work").join(output).is_dir() { 4096 } else { 1 };
    let length = |file: PathBuf| file.metadata().unwrap().len().next_multiple_of(block);
    let bytes: u64 = files(&place.path("work").join(output)).into_iter().map(length).sum();
    assert_eq!(done["disk_needed"], 0);
    let ratio = |expected: &Value, bytes: f64| expected.as_f64().unwrap() / bytes;
    [
        ratio(&planned["disk_needed"], done["object_bytes"].as_f64().unwrap()),
        ratio(&planned["output_bytes"], bytes as f64),
    ]
}

#[test]
fn the_disk_that_a_plan_expects_is_what_it_takes() {
    let tin = |input: &str, error: &str, tile: &str, format: &str| {
        let place = Place::new();
        let how = ["--max-error", error, "--tile", tile, "--format", format, "-q"];
        place.ok(&[&["plan", "tin", input, "-o", "work"], &how[..]].concat());
        let ending = format.to_lowercase();
        (format!("{input} {error} {tile} {format}"), ratios(&place, &format!("mesh.{ending}")))
    };
    let grid = |how: &[&str], output: &str| {
        let place = Place::new();
        let input = "synth:cloud,size=800,density=0.7,seed=3";
        place.ok(&[&["plan", "grid", input, "-o", "work", "--tile", "256", "-q"], how].concat());
        (how.join(" "), ratios(&place, output))
    };
    let points = |how: &[&str]| {
        let place = Place::new();
        place.ok(&["synth", "cloud,size=600,density=0.7,seed=3", "c.laz", "-q"]);
        place.ok(&[&["plan", "points", "c.laz", "-o", "work", "-q"], how].concat());
        (format!("points {how:?}"), ratios(&place, "points"))
    };
    let tiles = |side: usize, how: &[&str]| {
        let place = crate::tiles::place(side);
        place.ok(&[&["plan", "tiles", "dem.asc", "-o", "work", "-q"], how].concat());
        (format!("tiles of {side} {how:?}"), ratios(&place, "tiles"))
    };
    let cloud = |side: u32, error: &str, format: &str| {
        let place = Place::new();
        place.ok(&["synth", &format!("cloud,size={side},density=0.7,seed=3"), "c.laz", "-q"]);
        let how = ["--max-error", error, "--format", format, "-q"];
        place.ok(&[&["plan", "tin", "c.laz", "-o", "work"], &how[..]].concat());
        let ending = format.to_lowercase();
        (format!("cloud of {side} {error} {format}"), ratios(&place, &format!("mesh.{ending}")))
    };
    for (what, found) in [
        cloud(900, "0.2", "PLY"),
        cloud(400, "2", "OBJ"),
        cloud(400, "0", "PLY"),
        points(&["--tile", "100"]),
        points(&["--tile", "150", "--buffer", "15", "--class", "2", "--tile-format", "las"]),
        tiles(1000, &[]),
        tiles(700, &["--no-gzip", "--no-normals"]),
        tin("synth:rough,size=1200", "2", "512", "PLY"),
        tin("synth:rough,size=1000", "2", "256", "GLB"),
        tin("synth:rough,size=800", "30", "64", "STL"),
        tin("synth:coast,size=1300", "4", "256", "PLY"),
        tin("synth:smooth,size=3000", "2", "256", "OBJ"),
        grid(&["--cell", "1", "--stat", "mean"], "grid.tif"),
        grid(
            &["--cell", "2", "--stat", "tin:max_edge=9,count", "--co", "COMPRESS=ZSTD"],
            "grid.tif",
        ),
        grid(&["--cell", "1", "--stat", "max", "--format", "COG"], "grid.tif"),
    ] {
        println!("{what}: {found:.2?}");
        assert!(found.iter().all(|ratio| (0.97..=1.5).contains(ratio)), "{what}: {found:.2?}");
    }
}
