//! `tin --method`: every method of the textbooks from file to file, proved, and what is refused by name.

use crate::cli_support::Place;
use serde_json::Value;
use terrane_baselines::{METHODS, MethodPromise, TriangulationRule};

const GRIDS: [&str; 3] = [
    "synth:rough,size=65,seed=7",
    "synth:coast,width=60,height=47,seed=3",
    "synth:salt,width=41,height=70,seed=2",
];

fn made(place: &Place, args: &[&str]) -> Value {
    let ran = place.ok(&[args, &["--json", "--overwrite"]].concat());
    serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{args:?}: {e}: {}", ran.out))
}

#[test]
fn every_method_keeps_the_bound_that_its_mesh_states() {
    let place = Place::new();
    for method in METHODS {
        let count = if method.takes_triangulation { 3 } else { 1 };
        for triangulation in &TriangulationRule::ALL[..count] {
            for grid in GRIDS {
                let job = ["tin", grid, "o.ply", "--max-error", "5.5", "--method", method.name];
                let connected = ["--triangulation", triangulation.name()];
                let connected = if count > 1 { &connected[..] } else { &[] };
                let report = made(&place, &[&job[..], connected].concat());
                assert_eq!(report["method"], method.name);
                assert_eq!(report["triangulation"].is_string(), count > 1);
                let [error, stated] = ["max_error", "tolerance"].map(|name| report[name].as_f64());
                match method.promise {
                    MethodPromise::Samples => assert_eq!(stated, Some(5.5)),
                    MethodPromise::Measured => assert_eq!(stated, error),
                }
                assert!(error.unwrap() <= stated.unwrap(), "{report}");
                let proof = made(&place, &["verify", "o.ply", grid]);
                assert_eq!(proof["passed"], true, "{proof}");
                assert_eq!(proof["off_sample_vertices"]["count"], 0, "{proof}");
                let proved = proof["max_error"].as_f64().unwrap();
                assert!(
                    (proved - error.unwrap()).abs() < 1e-6,
                    "{}, {grid}: {proved}",
                    method.name
                );
            }
        }
    }
}

#[test]
fn a_number_of_vertices_or_triangles_is_met() {
    let place = Place::new();
    for method in METHODS.iter().filter(|method| method.takes_budget) {
        for (goal, counted, most) in
            [("--max-vertices", "vertices", 100), ("--max-triangles", "triangles", 150)]
        {
            let job = ["tin", GRIDS[0], "o.ply", goal, &most.to_string(), "--method", method.name];
            let report = made(&place, &[&job[..], &["--verify"]].concat());
            let count = report[counted].as_i64().unwrap();
            assert!(count == most || count == most - 1, "{}: {count}", method.name);
            assert_eq!(report["tolerance"], report["max_error"]);
        }
        let least = ["tin", GRIDS[1], "o.ply", "--max-vertices", "3", "--method", method.name];
        place.fails(&[&least[..], &["--overwrite"]].concat(), 2, &["allow "]);
    }
}

#[test]
fn formats_of_single_precision_and_by_position_keep_the_bound() {
    let place = Place::new();
    place.ok(&["synth", "rough,size=40", "dem.tif", "-q"]);
    for output in ["o.stl", "o.glb", "o.obj"] {
        let job = ["tin", "dem.tif", output, "--max-error", "3", "--method", "greedy4"];
        place.ok(&[&job[..], &["--verify", "-q"]].concat());
    }
}

#[test]
fn what_a_method_does_not_have_is_refused_by_name() {
    let place = Place::new();
    let refused = |options: &str, words: &[&str]| {
        let job = format!("tin {} o.ply {options}", GRIDS[0]);
        place.fails(&job.split(' ').collect::<Vec<_>>(), 2, words);
    };
    for option in
        ["--workdir w", "--split 2", "--strict", "--no-drop", "--tile 64", "--bound surface"]
    {
        let named = option.trim_end_matches(|c: char| c == 'w' || c.is_ascii_digit()).trim();
        refused(
            &format!("--max-error 4 --method greedy1 {option}"),
            &["--method greedy1 cannot be used with", named],
        );
    }
    refused(
        "--max-error 4 --method vip --triangulation split3",
        &["vip does not support --triangulation"],
    );
    refused("--max-error 4 --triangulation split3", &["greedy does not support --triangulation"]);
    refused(
        "--max-vertices 50 --method rtin",
        &["rtin does not support --max-vertices", "--max-error"],
    );
    refused("--max-triangles 50 --method kdtree", &["kdtree does not support --max-triangles"]);
    refused("--max-error 4 --method delatin", &["delatin", "greedy, greedy1", "collapse"]);
    refused("--max-error 4 --method greedy1 --triangulation best", &["best", "data-dependent"]);
    place.ok(&["synth", "cloud,size=20,density=2", "c.laz", "-q"]);
    let cloud = ["tin", "c.laz", "o.ply", "--max-error", "1", "--method", "drop"];
    place.fails(&cloud, 2, &["--method is for grids"]);
    let plan = ["plan", "tin", GRIDS[0], "-o", "w", "--max-error", "1", "--method", "drop"];
    place.fails(&plan, 2, &["--method"]);
}

#[test]
fn the_engine_may_be_named() {
    let place = Place::new();
    let job = ["tin", GRIDS[0], "a.ply", "--max-error", "4", "-q"];
    place.ok(&job);
    place.ok(&["tin", GRIDS[0], "b.ply", "--max-error", "4", "-q", "--method", "greedy"]);
    let bytes = ["a.ply", "b.ply"].map(|name| std::fs::read(place.path(name)).unwrap());
    assert_eq!(bytes[0], bytes[1]);
}

#[test]
fn too_large_a_grid_is_refused_with_the_memory_that_is_enough() {
    let place = Place::new();
    for method in METHODS {
        let job = ["tin", "synth:rough,size=257", "o.ply", "--max-error", "0", "--method"];
        let job = [&job[..], &[method.name]].concat();
        if method.name == "greedy1" || method.name == "greedy2" {
            continue;
        }
        let ran = place.run(&[&job[..], &["--overwrite", "--memory", "20M"]].concat());
        assert_eq!(ran.code, 75, "{}", ran.err);
        assert!(ran.err.contains("257 x 257") && ran.err.contains("at most "), "{}", ran.err);
        let advised = ran.err.split("--memory ").nth(1).unwrap().split(' ').next().unwrap();
        let report = made(&place, &[&job[..], &["--memory", advised]].concat());
        let allowed: f64 = advised.trim_end_matches('M').parse().unwrap();
        if let Some(peak) = report["peak_memory"].as_f64() {
            assert!(peak <= allowed * f64::from(1 << 20), "{}: {peak} of {advised}", method.name);
        }
    }
    let wide = ["tin", "synth:rough,width=20000,height=2", "p.ply", "--max-error", "1"];
    place.fails(&[&wide[..], &["--method", "drop"]].concat(), 65, &["16384", "--method"]);
}
