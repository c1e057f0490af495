//! Meshes of clouds by plan: what one run writes, whatever the tasks, and what is refused by name.

use crate::cli_support::{Place, json};
use serde_json::Value;

/// Several regions, with voids, and points above others.
const CLOUD: &str = "cloud,size=360,density=1,seed=5,voids=6";

fn place() -> Place {
    let place = Place::new();
    place.ok(&["synth", CLOUD, "c.laz", "-q"]);
    place
}

/// What is to be done, by the program's own word.
fn to_do(place: &Place) -> Vec<String> {
    let status = json(&place.ok(&["status", "work", "--json"]).out);
    let ids = status["to_do"].as_array().unwrap().iter().map(|task| task["id"].as_str().unwrap());
    ids.map(str::to_owned).collect()
}

#[test]
fn the_mesh_is_that_of_one_run_whatever_the_tasks() {
    let place = place();
    for how in [
        &["--max-error", "0.3"][..],
        &["--max-error", "0.1", "--class", "2"],
        &["--max-error", "0.5", "--return", "first", "--format", "OBJ"],
        &["--max-error", "0", "--every", "2"],
    ] {
        let ending = if how.contains(&"OBJ") { "obj" } else { "ply" };
        let [whole, mesh] = ["whole", "mesh"].map(|name| format!("{name}.{ending}"));
        let single = [&["tin", "c.laz", &whole, "--overwrite", "--json"][..], how].concat();
        let told = json(&place.ok(&single).out);
        let expected = place.bytes(&whole);
        for cut in [Some("1"), None] {
            let cut = cut.map(|cut| ["--cut", cut]);
            let cut = cut.iter().flatten().copied().collect::<Vec<_>>();
            place.ok(&[&["plan", "tin", "c.laz", "-o", "work", "-q"], how, &cut].concat());
            // Those of a round in any order.
            let mut tasks = to_do(&place);
            tasks.retain(|task| task != "finish");
            for round in ["choose", "prove", "again"] {
                for task in tasks.iter().rev().filter(|task| task.starts_with(round)) {
                    place.ok(&["run", "work", "--task", task, "-q"]);
                }
            }
            assert_eq!(to_do(&place), ["finish"]);
            let report = json(&place.ok(&["finish", "work", &mesh, "--json"]).out);
            assert!(place.bytes(&mesh) == expected, "{how:?}, {cut:?}: other bytes");
            for name in ["vertices", "triangles", "stacked_points", "points", "regions", "files"] {
                assert_eq!(report["mesh"][name], told[name], "{name}");
            }
            for name in ["work", &mesh] {
                remove(&place, name);
            }
        }
        place.ok(&[&["verify", &whole, "c.laz", "-q"][..], &filters(how)].concat());
    }
}

/// What of these arguments says which points are meant.
fn filters<'a>(how: &[&'a str]) -> Vec<&'a str> {
    let pairs = how.chunks(2).filter(|pair| !["--max-error", "--format"].contains(&pair[0]));
    pairs.flatten().copied().collect()
}

fn remove(place: &Place, name: &str) {
    let path = place.path(name);
    match path.is_dir() {
        true => std::fs::remove_dir_all(path).unwrap(),
        false => std::fs::remove_file(path).unwrap(),
    }
}

#[test]
fn a_run_with_a_workdir_goes_on() {
    let place = place();
    let tin = |output: &str, how: &[&str]| {
        let command = ["tin", "c.laz", output, "--max-error", "0.5", "--json"];
        json(&place.ok(&[&command[..], how].concat()).out)
    };
    tin("whole.ply", &[]);
    let made = tin("mesh.ply", &["--workdir", "work", "--memory", "300M"]);
    assert!(place.bytes("mesh.ply") == place.bytes("whole.ply"));
    assert_eq!(made["input"], "c.laz");
    let command = ["tin", "c.laz", "mesh.ply", "--max-error", "0.5", "--workdir", "work"];
    let again = place.ok(&[&command[..], &["--json", "--progress", "json"]].concat());
    assert_eq!(json(&again.out)["vertices"], made["vertices"]);
    assert!(!again.err.contains("\"read\""), "points are read again: {}", again.err);
    remove(&place, "mesh.ply");
    tin("mesh.ply", &["--workdir", "work", "--verify"]);
    assert!(place.bytes("mesh.ply") == place.bytes("whole.ply"));
    let other = ["tin", "c.laz", "x.ply", "--max-error", "0.6", "--workdir", "work"];
    place.fails(&other, 2, &["work", "another plan", "max_error is 0.5 in the plan, 0.6 now"]);
}

#[test]
fn another_cloud_is_refused_by_tasks_of_a_plan() {
    let place = place();
    place.ok(&["plan", "tin", "c.laz", "-o", "work", "--max-error", "1", "-q"]);
    place.ok(&["synth", &CLOUD.replace("seed=5", "seed=4"), "c.laz", "--overwrite", "-q"]);
    place.fails(&["run", "work"], 65, &["c.laz"]);
}

#[test]
fn what_a_plan_of_a_cloud_does_not_know_is_refused_by_name() {
    let place = place();
    place.write("k.wkt", "POINT (500100 4750100)");
    let cases: [(&[&str], &[&str]); 8] = [
        (&["--to-crs", "EPSG:4326"], &["--to-crs is for grids"]),
        (&["--fit-heights"], &["--fit-heights is for grids"]),
        (&["--triangulation", "data-dependent"], &["--triangulation is for grids"]),
        (&["--band", "1"], &["--band is for grids"]),
        (&["--bound", "surface"], &["--bound is for grids"]),
        (&["--keep-points", "k.wkt"], &["--keep-points is not supported", "terrane tin"]),
        (&["--breaklines", "k.wkt"], &["--breaklines is not supported"]),
        (&["--cut", "0"], &["0"]),
    ];
    for (how, words) in cases {
        let command = ["plan", "tin", "c.laz", "-o", "work", "--max-error", "1"];
        let ran = place.run(&[&command[..], how].concat());
        assert_eq!(ran.code, 2, "{how:?}: {}", ran.err);
        assert!(words.iter().all(|word| ran.err.contains(word)), "{how:?}: {}", ran.err);
    }
    let grid = ["plan", "tin", "synth:rough,size=100", "-o", "work", "--max-error", "1"];
    for (how, word) in [(["--task-size", "1"], "two rows of tiles"), (["--class", "2"], "--class")]
    {
        place.fails(&[&grid[..], &how].concat(), 2, &[word]);
    }
    let flat = ["plan", "tin", "c.laz", "-o", "work", "--max-error", "1", "--z-range", "-9,-8"];
    place.fails(&flat, 65, &["the points do not form a surface"]);
    let workdir =
        ["tin", "c.laz", "m.stl", "--max-error", "1", "--workdir", "w", "--scale", "1:500"];
    place.fails(&workdir, 2, &["--workdir cannot be used with --scale"]);
    let unused = ["tin", "c.laz", "m.ply", "--max-error", "1", "--no-disk-check"];
    place.fails(&unused, 2, &["--no-disk-check"]);
    assert!(!place.path("work").exists(), "nothing was planned");
}

#[test]
fn a_plan_tells_what_it_is_of() {
    let place = place();
    let plan = place.ok(&["plan", "tin", "c.laz", "-o", "work", "--max-error", "1"]).out;
    for part in ["regions", "max error", "written as PLY", "for the mesh"] {
        assert!(plan.contains(part), "{part} in\n{plan}");
    }
    let status: Value = json(&place.ok(&["status", "work", "--json"]).out);
    let after = |id: &str| {
        let tasks = status["to_do"].as_array().unwrap();
        let task = tasks.iter().find(|task| task["id"] == id).unwrap();
        task["after"].as_array().unwrap().len()
    };
    let parts = to_do(&place).iter().filter(|task| task.starts_with("choose")).count();
    assert_eq!([after("choose-0"), after("prove-0"), after("again-0")], [0, parts, 2 * parts]);
    assert_eq!(status["max_error"], 1.0);
    place.fails(
        &["run", "work", "--split", "2"],
        2,
        &["--split requires a plan for a mesh of a grid"],
    );
    place.fails(&["run", "work", "--task", "strip-0"], 2, &["choose-0, choose-1", "finish"]);
    place.fails(&["run", "work", "--task", "prove-0"], 69, &["choose-0", "is not done"]);
}
