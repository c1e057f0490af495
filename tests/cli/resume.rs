//! Runs of a plan that end before their time: killed, failed by the disk, by memory, by a fault of the
//! program. Nothing bad is ever at a final name, what was done stays done, and the next run ends with
//! the bytes of one that was never disturbed.

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::cli_support::{Place, Ran};
use serde_json::Value;

const PLAN: [&str; 12] = [
    "plan",
    "tin",
    "synth:rough,width=300,height=1000,seed=5",
    "-o",
    "work",
    "--max-error",
    "4",
    "--tile",
    "64",
    "--strip-rows",
    "3",
    "-q",
];

/// A folder with a plan, and the mesh that it must lead to.
fn planned() -> (Place, Vec<u8>) {
    let place = Place::new();
    place.ok(&["tin", PLAN[2], "whole.ply", "--max-error", "4", "--tile", "64"]);
    place.ok(&PLAN);
    let mesh = std::fs::read(place.path("whole.ply")).unwrap();
    (place, mesh)
}

fn plan_anew(place: &Place) {
    std::fs::remove_dir_all(place.path("work")).unwrap();
    place.ok(&PLAN);
}

fn status(place: &Place) -> Value {
    serde_json::from_str(&place.ok(&["status", "work", "--json"]).out).unwrap()
}

fn done(place: &Place) -> u64 {
    status(place)["done"].as_u64().unwrap()
}

/// Names in the folder of the plan and of its objects that have no business there.
fn strangers(place: &Place) -> Vec<String> {
    let names = |folder: &str| {
        let entries = std::fs::read_dir(place.path(folder)).unwrap().flatten();
        entries.map(|entry| entry.file_name().into_string().unwrap()).collect::<Vec<_>>()
    };
    let known = ["plan.json", "objects", "finished.json", "lock", "mesh.ply", "mesh.prj"];
    let is_object = |name: &str| name.ends_with(".object") || name.ends_with(".json");
    let is_strange = |name: &String| !known.contains(&name.as_str()) && !is_object(name);
    [names("work"), names("work/objects")].concat().into_iter().filter(is_strange).collect()
}

/// The run that ends well: it says how much it had to do.
fn resume(place: &Place, expected: &[u8]) -> Value {
    let ran = place.ok(&["run", "work", "--json"]);
    assert!(std::fs::read(place.path("work/mesh.ply")).unwrap() == expected, "other bytes");
    serde_json::from_str(&ran.out).unwrap()
}

/// Kills in the short version of the test, and where the environment asks for more.
fn kills() -> u64 {
    std::env::var("TERRANE_KILLS").map_or(12, |text| text.parse().unwrap())
}

#[test]
fn killed_runs_lose_one_task_at_most_and_end_with_the_same_bytes() {
    let (place, expected) = planned();
    let started = Instant::now();
    let whole = resume(&place, &expected);
    let time = started.elapsed().as_micros() as u64;
    let tasks = whole["tasks"].as_u64().unwrap();
    plan_anew(&place);
    let (mut before, mut rounds, mut killed) = (0, 0, 0);
    for i in 0..kills() {
        let mut child =
            place.command(&["run", "work", "-q"]).stderr(Stdio::null()).spawn().unwrap();
        // Moments all over a run, in an order that jumps about.
        std::thread::sleep(Duration::from_micros(i * 7919 % 101 * time / 101));
        killed += u64::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
        let now = done(&place);
        assert!(now >= before, "{now} of {before} tasks are still done");
        before = now;
        if now == tasks {
            (before, rounds) = (0, rounds + 1);
            assert!(std::fs::read(place.path("work/mesh.ply")).unwrap() == expected);
            plan_anew(&place);
        }
    }
    println!("{killed} of {} runs killed before their end, {rounds} ended", kills());
    assert!(killed > kills() / 4, "{killed}");
    let last = resume(&place, &expected);
    let (found, made) = (last["found"].as_u64().unwrap(), last["made"].as_array().unwrap().len());
    assert_eq!(found + made as u64 + 1, tasks, "{last}");
    assert!(found >= before.min(tasks - 1));
    assert_eq!(last["damaged"].as_array().unwrap().len(), 0, "{last}");
    assert_eq!(strangers(&place), Vec::<String>::new());
}

/// One run with a fault, and that it ended as it should.
fn fails_cleanly(place: &Place, fault: &str, expected: &[u8]) -> bool {
    let mut command = place.command(&["run", "work", "-q", "--threads", "2", "--memory", "28M"]);
    let ran = Ran::from(command.env("TERRANE_FAULT", fault).output().unwrap());
    if ran.code == 0 {
        return false;
    }
    let mesh = place.path("work/mesh.ply");
    assert!([70, 73, 74].contains(&ran.code), "{fault}: {} {}", ran.code, ran.err);
    let panicked = fault.starts_with("panic");
    let error = ran.err.lines().last().unwrap_or_default();
    assert!(error.starts_with("terrane: error: "), "{fault}: {}", ran.err);
    assert!(panicked || ran.err.lines().count() == 1, "{fault}: {}", ran.err);
    assert!(!panicked || error.contains("tile "), "{fault}: the tile is named: {error}");
    assert!(!mesh.exists() || std::fs::read(mesh).unwrap() == expected, "{fault}");
    assert_eq!(status(place)["damaged"].as_array().unwrap().len(), 0, "{fault}");
    true
}

#[test]
fn every_failing_call_leaves_a_run_that_goes_on() {
    let (place, expected) = planned();
    for (point, most) in [
        ("create", 30),
        ("sync", 30),
        ("rename", 30),
        ("write", 100),
        ("read", 400),
        ("panic", 500),
    ] {
        // Every one where the environment asks for it; else of the first, then ever fewer.
        let all = std::env::var_os("TERRANE_ALL_FAULTS").is_some();
        let mut count = 1;
        while count <= most && fails_cleanly(&place, &format!("{point}:{count}"), &expected) {
            let kept = done(&place);
            let report = resume(&place, &expected);
            assert!(report["found"].as_u64().unwrap() >= kept, "{point}:{count}");
            plan_anew(&place);
            count += if all { 1 } else { 1 + count / 3 };
        }
        assert!(count > 3, "{point} fails {count} times only");
        if done(&place) > 0 {
            plan_anew(&place);
        }
    }
    assert_eq!(strangers(&place), Vec::<String>::new());
}

#[test]
fn the_same_command_goes_on_whatever_failed() {
    let args = ["tin", PLAN[2], "out.ply", "--max-error", "4", "--tile", "64", "-q"];
    let args = [&args[..], &["--workdir", "work"]].concat();
    let place = Place::new();
    for point in ["create", "sync", "rename"] {
        for count in 1.. {
            let mut command = place.command(&args);
            command.env("TERRANE_FAULT", format!("{point}:{count}"));
            if Ran::from(command.output().unwrap()).code == 0 {
                assert!(count > 4, "{point} fails {count} times only");
                break;
            }
            place.ok(&args);
            place.ok(&args);
            place.ok(&["verify", "out.ply", PLAN[2], "--max-error", "4"]);
            std::fs::remove_dir_all(place.path("work")).unwrap();
            std::fs::remove_file(place.path("out.ply")).unwrap();
        }
        std::fs::remove_dir_all(place.path("work")).unwrap();
        std::fs::remove_file(place.path("out.ply")).unwrap();
    }
    place.write("out.ply", "mine");
    place.fails(&args, 2, &["out.ply", "already exists"]);
    place.fails(&args, 2, &["out.ply", "already exists"]);
    assert_eq!(std::fs::read(place.path("out.ply")).unwrap(), b"mine");
}

#[cfg(target_os = "linux")]
#[test]
fn memory_that_runs_out_leaves_a_run_that_goes_on() {
    let (place, expected) = planned();
    let mut failures = 0;
    for mib in (8..160).step_by(8) {
        let limited = format!("ulimit -v {}; exec \"$0\" run work -q --threads 2", mib << 10);
        let mut command = std::process::Command::new("sh");
        command.args(["-c", &limited, env!("CARGO_BIN_EXE_terrane")]).current_dir(place.path("."));
        // To print where it was takes memory, too, and waits for ever where there is none.
        command.env("RUST_BACKTRACE", "0");
        let output = command.output().unwrap();
        failures += u32::from(!output.status.success());
        if output.status.success() {
            break;
        }
        // Memory may run out after the mesh is there; it is whole then.
        if let Ok(mesh) = std::fs::read(place.path("work/mesh.ply")) {
            assert!(mesh == expected, "{mib} MiB");
            break;
        }
        assert_eq!(status(&place)["damaged"].as_array().unwrap().len(), 0, "{mib} MiB");
    }
    assert!(failures > 0, "all limits are enough");
    resume(&place, &expected);
}

#[test]
fn a_second_run_is_refused_while_one_is_at_work() {
    let (place, expected) = planned();
    let mut child = place
        .command(&["run", "work", "--threads", "1", "--progress", "json"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut messages = std::io::BufReader::new(child.stderr.take().unwrap());
    std::io::BufRead::read_line(&mut messages, &mut String::new()).unwrap();
    let second = place.run(&["run", "work", "-q"]);
    let first = child.try_wait().unwrap();
    if first.is_none() {
        assert_eq!(second.code, 69, "{}", second.err);
        assert!(second.err.contains("the folder is locked by another run"), "{}", second.err);
    }
    std::io::Read::read_to_string(&mut messages, &mut String::new()).unwrap();
    assert!(child.wait().unwrap().success());
    resume(&place, &expected);
}

#[test]
fn options_of_the_mesh_are_for_the_last_task() {
    let (place, _) = planned();
    for more in [["-o", "a.ply"], ["--split", "3"]] {
        place.fails(&[&["run", "work", "--task", "strip-0"], &more[..]].concat(), 2, &["finish"]);
    }
    place.fails(&["run", "work", "--task", "seam-4294967295"], 2, &["no task seam-4294967295"]);
}

/// What is asked for otherwise is another plan, also where it was not asked for before; what is said that would be so
/// without is the same.
#[test]
fn another_option_is_another_plan_and_a_default_is_none() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=4,seed=5", "c.las", "-q"]);
    place.ok(&["grid", "c.las", "g.tif", "--cell", "1", "--stat", "max,min", "-q"]);
    let near = "POLYGON ((500010 4750010, 500045 4750010, 500045 4750040, 500010 4750010))";
    place.write("near.wkt", near).write("near.prj", "EPSG:32631");
    let job = |folder: &str, input: &str, more: &[&str]| {
        let output = format!("{folder}.ply");
        let first =
            ["tin", input, &output, "--max-error", "1", "--tile", "16", "--workdir", folder];
        place.run(&[&first[..], more, &["-q", "--overwrite"]].concat())
    };
    let lines = ["--breaklines", "near.wkt"];
    for (number, (first, then, code)) in [
        (&[][..], &["--band", "2"][..], 2),
        (&["--band", "2"], &["--band", "1"], 2),
        (&["--band", "1"], &[], 0),
        (&[], &["--band", "1"], 0),
        (&[], &["--triangulation", "delaunay"], 0),
        (&["--triangulation", "delaunay"], &[], 0),
        (&[], &["--triangulation", "data-dependent"], 2),
        (&[], &["--to-crs", "EPSG:4326"], 2),
        (&[], &["--clip", "near.wkt"], 2),
        (&lines, &[lines[0], lines[1], "--clip", lines[1]], 2),
    ]
    .into_iter()
    .enumerate()
    {
        let folder = format!("w{number}");
        assert_eq!(job(&folder, "g.tif", first).code, 0, "{first:?}");
        let ran = job(&folder, "g.tif", then);
        assert_eq!(ran.code, code, "{first:?} {then:?}: {}", ran.err);
        assert!(code == 0 || ran.err.contains("holds another plan"), "{}", ran.err);
    }
    let cloud = |more: &[&str]| {
        let first = ["tin", "c.las", "c.ply", "--max-error", "1", "--workdir", "wc", "-q"];
        place.run(&[&first[..], more].concat())
    };
    assert_eq!(cloud(&[]).code, 0);
    let ran = cloud(&["--where", "z > 200"]);
    assert!(ran.code == 2 && ran.err.contains("holds another plan"), "{}", ran.err);
    let plan = ["plan", "tin", "g.tif", "-o", "p", "--max-error", "1"];
    place.fails(&[&plan[..], &["--cut", "9"]].concat(), 2, &["--cut is for point clouds"]);
    place.fails(&plan[..5], 2, &["--max-error <E>", "terrane plan tin --help"]);
}
