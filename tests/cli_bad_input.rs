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
    let folder = place.run(&["tin", ".", "out.ply", "--max-error", "1"]);
    assert_eq!(folder.code, 65, "{}", folder.err);
    for (line, word) in folder.err.lines().zip(["empty.tif", "noise.tif", "--skip-bad"]) {
        assert!(line.starts_with("terrane: error: ") && line.contains(word), "{line}");
    }
    assert_eq!(folder.err.lines().count(), 3, "each bad file has its line: {}", folder.err);
    assert!(!place.path("out.ply").exists());
    std::fs::create_dir(place.path("bare")).unwrap();
    tin("bare", 65, &["bare", "holds no grid"]);
    tin("*.dem", 65, &["matches no file"]);
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
    let convert = |args: &[&str], words: &[&str]| {
        place.fails(&[&["convert", "good.asc"], args].concat(), 2, words);
    };
    convert(&["out.jpg"], &[".tif or .tiff, .asc, .flt, .png"]);
    convert(&["out.png", "-f", "COG"], &["COG", ".tif"]);
    convert(&["out.tif", "-f", "JPEG"], &["JPEG", "store, COG, GTiff"]);
    convert(&["out.tif", "-f", "COG", "--co", "TILED=YES"], &["TILED", "COMPRESS=NONE|DEFLATE"]);
    convert(&["out.tif", "-f", "COG", "--co", "COMPRESS=JPEG"], &["JPEG", "NONE|DEFLATE|ZSTD"]);
    convert(&["out.tif", "--co", "COMPRESS"], &["KEY=VAL"]);
    convert(&["out.tif", "--type", "int64"], &["int64", "int32", "float32"]);
    let narrow = ["convert", "good.asc", "out.tif", "--type", "uint8"];
    place.fails(&narrow, 65, &["column 3, row 2", "--out-nodata"]);
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

#[test]
fn options_that_cannot_act_are_refused_by_name() {
    let place = place();
    place.ok(&["tin", "good.asc", "m.ply", "--max-error", "0"]);
    let view = ["view", "m.ply", "-o", "out.png"];
    place.fails(&[&view[..], &["--band", "1"]].concat(), 2, &["m.ply", "--band", "mesh"]);
    place.fails(&[&view[..], &["--nodata", "3"]].concat(), 2, &["m.ply", "--nodata", "mesh"]);
    place.fails(&["info", "m.ply", "--band", "1"], 2, &["m.ply", "--band", "mesh"]);
    place.fails(&["info", "m.ply", "--nodata", "1"], 2, &["m.ply", "--nodata", "mesh"]);
    place.fails(&["info", "m.ply", "--stats"], 2, &["m.ply", "--stats", "mesh"]);
    let terrain = "synth:rough,size=20";
    for args in [
        &["tin", terrain, "out.ply", "--max-error", "1"][..],
        &["verify", "m.ply", terrain],
        &["info", terrain],
        &["view", terrain, "-o", "out.png"],
        &["convert", terrain, "out.tif"],
    ] {
        place.fails(&[args, &["--band", "1"]].concat(), 2, &["synth:rough", "--band"]);
        place.fails(&[args, &["--nodata", "-1"]].concat(), 2, &["synth:rough", "--nodata"]);
    }
    for option in [["--threads", "1"], ["--memory", "1G"], ["--temp-dir", "."]] {
        place.ok(&["info", "good.asc", option[0], option[1]]);
        place.fails(&["info", "m.ply", option[0], option[1]], 2, &["m.ply", option[0], "mesh"]);
    }
    place.fails(&[&view[..], &["--temp-dir", "."]].concat(), 2, &["m.ply", "--temp-dir", "mesh"]);
    place.fails(&["synth", "rough,size=20", "out.tif", "--temp-dir", "."], 2, &["--temp-dir"]);
}

#[test]
fn a_tile_out_of_range_is_a_usage_error_that_tells_the_range() {
    let place = place();
    for cells in ["1", "15", "8193", "99999999999"] {
        let args = ["tin", "good.asc", "out.ply", "--max-error", "1", "--tile", cells];
        place.fails(&args, 2, &["--tile", "16..=8192"]);
    }
}

#[test]
fn verify_says_when_mesh_and_grid_are_swapped() {
    let place = place();
    place.ok(&["tin", "good.asc", "m.ply", "--max-error", "0"]);
    place.fails(&["verify", "good.asc", "m.ply"], 2, &["terrane verify m.ply good.asc"]);
    place.fails(&["verify", "good.asc", "good.asc"], 65, &["good.asc", "mesh"]);
    place.fails(&["verify", "m.ply", "m.ply"], 65, &["m.ply", "grid"]);
}

#[test]
fn budgets_too_small_tell_the_least_and_the_units() {
    let place = place();
    let tin = ["tin", "good.asc", "out.ply", "--max-error", "1", "--memory"];
    for bare in ["1", "512", "1000000"] {
        place.fails(&[&tin[..], &[bare]].concat(), 2, &["--memory", "at least 1M", "K, M or G"]);
    }
    place.fails(&[&tin[..], &["1M"]].concat(), 75, &["--memory 19M", "1.0 MiB"]);
    let wide = ["tin", "synth:rough,size=600", "out.ply", "--max-error", "1", "--memory"];
    place.fails(&[&wide[..], &["1M"]].concat(), 75, &["--memory 67M", "1.0 MiB"]);
    let view = ["view", "good.asc", "-o", "out.png", "--memory", "1M"];
    place.fails(&view, 75, &["--memory 156M", "--width"]);
}

#[test]
fn terrains_that_are_too_large_for_a_store() {
    let place = place();
    for size in ["1073741824", "10000000", "99999999999"] {
        place.fails(&["synth", &format!("rough,size={size}"), "out.tif"], 2, &["size"]);
    }
}

#[test]
fn names_of_terrains_say_each_thing_once() {
    let place = place();
    for (name, word) in [
        ("synth:rough,size=10,size=20", "size is given twice"),
        ("synth:rough,seed=1,size=9,seed=1", "seed is given twice"),
        ("synth:rough,size=10,", "empty"),
        ("synth:rough,,size=10", "empty"),
        ("synth:rough,", "empty"),
    ] {
        place.fails(&["info", name], 2, &[word]);
    }
    let told = place.ok(&["info", "synth:rough,height=3,size=10"]).out;
    assert!(told.contains("10 x 3"), "in any order: {told}");
}
