//! What users get wrong: one line with the remedy, the right exit code, and nothing written.

mod cli_support;

use cli_support::{GRID, Place, VOID_GRID};

fn place() -> Place {
    let place = Place::new();
    place.write("good.asc", GRID).write("void.asc", VOID_GRID);
    place.write("noise.tif", [7u8; 300]).write("text.txt", "hello").write("empty.tif", "");
    place
}

#[test]
fn missing_and_broken_inputs() {
    let place = place();
    let tin = |input: &str, code: i32, words: &[&str]| {
        place.fails(&["tin", input, "out.ply", "--max-error", "1"], code, words);
    };
    tin("nowhere.tif", 65, &["nowhere.tif", "no such file"]);
    tin(".", 65, &["folder"]);
    tin("noise.tif", 65, &["noise.tif"]);
    tin("empty.tif", 65, &["empty.tif"]);
    tin("text.txt", 65, &["text.txt"]);
    tin("void.asc", 65, &["valid"]);
    tin("synth:nothing", 2, &["nothing"]);
}

#[test]
fn a_band_that_is_not_there() {
    let place = place();
    let args = ["tin", "good.asc", "out.ply", "--max-error", "1", "--band"];
    place.fails(&[&args[..], &["2"]].concat(), 2, &["band"]);
    place.fails(&[&args[..], &["0"]].concat(), 2, &["band"]);
}

#[test]
fn tolerances_that_are_none() {
    let place = place();
    for bad in ["-1", "nan", "inf", "-inf", "x", ""] {
        place.fails(&["tin", "good.asc", "out.ply", "--max-error", bad], 2, &["zero or more"]);
        place.fails(&["verify", "m.ply", "good.asc", "--max-error", bad], 2, &["zero or more"]);
    }
    place.ok(&["tin", "good.asc", "out.ply", "--max-error", "0"]);
}

#[test]
fn exactly_one_goal() {
    let place = place();
    place.fails(&["tin", "good.asc", "out.ply"], 2, &["--max-error", "terrane tin --help"]);
    let both = ["tin", "good.asc", "out.ply", "--max-error", "1", "--max-vertices", "9"];
    place.fails(&both, 2, &["cannot be used with"]);
    place.fails(&["tin", "good.asc", "out.ply", "--max-triangles", "0"], 2, &["--max-triangles"]);
}

#[test]
fn outputs_that_cannot_be() {
    let place = place();
    place.write("taken.ply", "keep me").write("taken.png", "keep me").write("taken.tif", "keep me");
    let tin = |output: &str, code: i32, words: &[&str]| {
        place.fails(&["tin", "good.asc", output, "--max-error", "1"], code, words);
    };
    tin("out.xyz", 2, &["xyz"]);
    tin("out", 2, &["out"]);
    tin("taken.ply", 2, &["exists", "--overwrite"]);
    tin("no/such/folder/out.ply", 73, &["folder"]);
    place.fails(&["tin", "good.asc", "out.ply", "--max-error", "1", "-f", "DXF"], 2, &["DXF"]);
    let co = ["tin", "good.asc", "out.ply", "--max-error", "1", "--co"];
    place.fails(&[&co[..], &["SOLID_BASE=0"]].concat(), 2, &["SOLID_BASE", "STL"]);
    place.fails(&[&co[..], &["LEVEL=9"]].concat(), 2, &["SOLID_BASE"]);
    place.fails(&["view", "good.asc", "-o", "taken.png"], 2, &["exists"]);
    place.fails(&["view", "good.asc", "-o", "out.jpg"], 2, &[".png"]);
    place.fails(&["convert", "good.asc", "taken.tif"], 2, &["exists"]);
    place.fails(&["convert", "good.asc", "out.png"], 2, &[".tif"]);
    place.fails(&["convert", "noise.tif", "noise.tif", "--overwrite"], 2, &["itself"]);
    let report = ["tin", "good.asc", "out.ply", "--max-error", "1", "--report", "taken.tif"];
    place.fails(&report, 2, &["taken.tif", "exists"]);
    for kept in ["taken.ply", "taken.png", "taken.tif"] {
        assert_eq!(std::fs::read(place.path(kept)).unwrap(), b"keep me");
    }
}

#[test]
fn options_out_of_range() {
    let place = place();
    let tin = ["tin", "good.asc", "out.ply", "--max-error", "1"];
    for (option, value) in [
        ("--threads", "0"),
        ("--memory", "lots"),
        ("--memory", "0"),
        ("--tile", "1"),
        ("--progress", "loud"),
    ] {
        place.fails(&[&tin[..], &[option, value]].concat(), 2, &[option]);
    }
    let view = ["view", "good.asc", "-o", "out.png"];
    for (option, value) in [
        ("--width", "0"),
        ("--width", "99999"),
        ("--altitude", "0"),
        ("--azimuth", "nan"),
        ("--exaggeration", "0"),
        ("--bbox", "1,2,1,2"),
    ] {
        place.fails(&[&view[..], &[option, value]].concat(), 2, &[]);
    }
    place.fails(&[&view[..], &["--bbox", "0,0,1,1"]].concat(), 2, &["--bbox", "reach"]);
    place.fails(&[&view[..], &["--edges"]].concat(), 2, &["edges"]);
    place.fails(&["frobnicate"], 2, &["frobnicate"]);
}

#[test]
fn one_bad_file_does_not_hide_the_others() {
    let place = place();
    let ran = place.run(&["info", "noise.tif", "good.asc", "nowhere.tif"]);
    assert_eq!(ran.code, 65);
    assert!(ran.out.contains("good.asc") && ran.out.contains("4 x 3"), "{}", ran.out);
    assert_eq!(ran.err.lines().count(), 2, "{}", ran.err);
}
