//! Stages before an operation: killed at any moment, a job goes on and ends with the same bytes.

use std::process::Stdio;
use std::time::Duration;

use crate::cli_support::Place;

const CHAINS: [&[&str]; 3] = [
    &["--stage", "noise", "--stage", "thin:1.5:lowest", "--stage", "dimension:Twice = 2 * z"],
    &["--stage", "ground:csf", "--stage", "height-above-ground:z", "--stage", "where:z < 20"],
    &["--stage", "normals:k=5", "--stage", "where:NormalZ > 0.3", "--stage", "poisson:0.8"],
];

/// Runs a command again and again, each time for longer, until it is not killed; returns how often it was.
fn until_done(place: &Place, args: &[&str]) -> u32 {
    for killed in 0..200 {
        let mut command = place.command(args);
        let mut child = command.stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(40 * u64::from(killed)));
        let _ended_before = child.kill();
        if child.wait().unwrap().success() {
            return killed;
        }
    }
    panic!("{args:?} does not end");
}

#[test]
fn killed_chains_go_on() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=150,density=3,seed=7", "in.laz", "-q"]);
    let mut killed = 0;
    for chain in CHAINS {
        let tin = |output, more: &[&'static str]| {
            [&["tin", "in.laz", output, "--max-error", "0.3", "-q"], chain, more].concat()
        };
        place.ok(&tin("whole.ply", &[]));
        killed += until_done(&place, &tin("made.ply", &["--workdir", "work"]));
        let grid = |verb: &[&'static str]| [verb, &["--cell", "1", "-q"], chain].concat();
        place.ok(&grid(&["grid", "in.laz", "whole.tif"]));
        killed += until_done(&place, &grid(&["plan", "grid", "in.laz", "-o", "plan"]));
        killed += until_done(&place, &["run", "plan", "-o", "made.tif", "-q"]);
        for ending in ["ply", "tif"] {
            let [whole, made] =
                ["whole", "made"].map(|name| place.path(&format!("{name}.{ending}")));
            assert!(std::fs::read(&whole).unwrap() == std::fs::read(&made).unwrap(), "{chain:?}");
            [whole, made].iter().for_each(|path| std::fs::remove_file(path).unwrap());
        }
        for folder in ["work", "plan"] {
            std::fs::remove_dir_all(place.path(folder)).unwrap();
        }
    }
    assert!(killed > 9, "{killed}");
}
