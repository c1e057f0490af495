//! `terrane plan grid` and `run`: killed and failing runs go on, and end with the same bytes.

use std::process::Stdio;
use std::time::Duration;

use crate::cli_support::{Place, Ran};
use serde_json::Value;

const CLOUD: &str = "synth:cloud,size=600,density=0.4,seed=5";
const HOW: [&str; 6] = ["--cell", "1", "--stat", "tin:max_edge=8,mean", "--class", "2,3"];

/// A place with a plan, and the bytes of a single run.
fn planned() -> (Place, Vec<u8>) {
    let place = Place::new();
    place.ok(&[&["grid", CLOUD, "whole.tif", "-q"], &HOW[..]].concat());
    plan(&place);
    let expected = std::fs::read(place.path("whole.tif")).unwrap();
    (place, expected)
}

fn plan(place: &Place) {
    let args = ["plan", "grid", CLOUD, "-o", "work", "--tile", "256", "-q"];
    place.ok(&[&args, &HOW[..]].concat());
}

fn ends_well(place: &Place, expected: &[u8]) -> Value {
    let report = place.ok(&["run", "work", "--json"]).out;
    assert!(std::fs::read(place.path("work/grid.tif")).unwrap() == expected);
    serde_json::from_str(&report).unwrap()
}

/// What lies in the folder that no plan knows of.
fn strangers(place: &Place) -> Vec<String> {
    let known = |name: &String| {
        let is_object = name.starts_with("tile-") || name == "objects";
        is_object || ["plan.json", "lock", "finished.json", "grid.tif"].contains(&name.as_str())
    };
    let list = |folder: &str| {
        let entries = std::fs::read_dir(place.path(folder)).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect::<Vec<_>>()
    };
    let all = [list("work"), list("work/objects")].concat();
    all.into_iter().filter(|name| !known(name)).collect()
}

#[test]
fn a_plan_is_told_run_and_finished() {
    let (place, expected) = planned();
    let told = place.ok(&["status", "work"]).out;
    for part in ["600 x 600 cells in tiles of 256", "0 done, 10 to do", "terrane plan run work"] {
        assert!(told.contains(part), "{part} in\n{told}");
    }
    place.ok(&["run", "work", "--task", "tile-4", "-q"]);
    place.fails(&["run", "work", "--task", "tile-4", "-o", "x.tif"], 2, &["only the last task"]);
    place.fails(
        &["run", "work", "--split", "2"],
        2,
        &["--split requires a plan for a mesh of a grid"],
    );
    place.fails(&["finish", "work", "x.tif"], 69, &["tile-0 is not done"]);
    place.ok(&["run", "work", "-o", "x.tif", "-q"]);
    assert!(std::fs::read(place.path("x.tif")).unwrap() == expected);
    place.fails(&["finish", "work", "whole.tif"], 2, &["whole.tif", "already exists"]);
    place.ok(&["finish", "work", "whole.tif", "--overwrite", "--threads", "1", "-q"]);
    assert!(std::fs::read(place.path("whole.tif")).unwrap() == expected);
    place.fails(&["plan", "grid", CLOUD, "-o", "work", "--cell", "2"], 2, &["another plan"]);
    let tin = ["plan", "tin", "synth:rough,size=300", "-o", "work", "--max-error", "1"];
    place.fails(&tin, 2, &["it is for a grid"]);
}

#[test]
fn killed_runs_go_on() {
    let (place, expected) = planned();
    for wait in [40, 80, 120, 160, 200, 240] {
        let mut command = place.command(&["run", "work", "-q", "--threads", "2"]);
        let mut child = command.stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(wait));
        let _ = child.kill();
        child.wait().unwrap();
        let status = place.ok(&["status", "work", "--json"]).out;
        let status: Value = serde_json::from_str(&status).unwrap();
        assert_eq!(status["damaged"].as_array().unwrap().len(), 0, "{status}");
    }
    let report = ends_well(&place, &expected);
    assert_eq!(report["damaged"].as_array().unwrap().len(), 0, "{report}");
    assert_eq!(strangers(&place), Vec::<String>::new());
}

#[test]
fn every_failing_call_leaves_a_run_that_goes_on() {
    let (place, expected) = planned();
    for point in ["create", "sync", "rename"] {
        let mut failures = 0;
        for count in 1.. {
            let mut command = place.command(&["run", "work", "-q"]);
            let fault = format!("{point}:{count}");
            let ran = Ran::from(command.env("TERRANE_FAULT", &fault).output().unwrap());
            if ran.code == 0 {
                break;
            }
            failures += 1;
            assert!([73, 74].contains(&ran.code), "{fault}: {} {}", ran.code, ran.err);
            assert_eq!(ran.err.lines().count(), 1, "{fault}: {}", ran.err);
        }
        assert!(failures > 3, "{point} failed {failures} times");
        ends_well(&place, &expected);
        assert_eq!(strangers(&place), Vec::<String>::new());
        std::fs::remove_dir_all(place.path("work")).unwrap();
        plan(&place);
    }
}

#[test]
fn files_are_no_folders_of_work() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=2", "c.las", "-q"]);
    place.ok(&["synth", "rough,size=65", "g.tif", "-q"]);
    place.write("file", "x");
    for (args, input) in [
        (&["plan", "grid", "c.las", "--cell", "2"][..], "c.las"),
        (&["plan", "points", "c.las", "--tile", "20"], "c.las"),
        (&["plan", "tiles", "g.tif"], "g.tif"),
        (&["plan", "tin", "g.tif", "--max-error", "1"], "g.tif"),
        (&["plan", "tin", "c.las", "--max-error", "1"], "c.las"),
    ] {
        place.fails(&[args, &["-o", "file"]].concat(), 2, &["file: is a file, not a folder"]);
        place.fails(&[args, &["-o", input]].concat(), 2, &[input]);
    }
    for args in [
        &["tiles", "g.tif", "out"][..],
        &["tiles", "c.las", "out"],
        &["points", "c.las", "out", "--tile", "20"],
        &["tin", "c.las", "o.ply", "--max-error", "1"],
        &["tin", "g.tif", "o.ply", "--max-error", "1"],
    ] {
        place.fails(
            &[args, &["--workdir", "file"]].concat(),
            2,
            &["file: is a file, not a folder"],
        );
    }
    let own = ["plan", "grid", "c.las", "--cell", "2", "-o", "c.las"];
    place.fails(&own, 2, &["output is also an input"]);
}
