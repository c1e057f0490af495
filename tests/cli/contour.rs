//! `terrane contour` through the real binary.

use crate::cli_support::{GRID, Place, VOID_GRID};
use serde_json::Value;

const TERRAIN: &str = "synth:rough,size=300,seed=3";

#[test]
fn lines_are_written_and_told_about() {
    let place = Place::new();
    place.write("grid.asc", GRID);
    let ran = place.ok(&["contour", "grid.asc", "-o", "a.geojson", "--interval", "2.5"]);
    for part in ["grid.asc -> a.geojson", "4 x 3 samples", "4 from 2.5 to 10", "5, 0 of them rings"]
    {
        assert!(ran.out.contains(part), "{part} in\n{}", ran.out);
    }
    assert_eq!(ran.err, "");
    let text = std::fs::read_to_string(place.path("a.geojson")).unwrap();
    let written: Value = serde_json::from_str(&text).unwrap();
    let features = written["features"].as_array().unwrap();
    let heights: Vec<_> =
        features.iter().map(|f| f["properties"]["elev"].as_f64().unwrap()).collect();
    assert_eq!(heights, [2.5, 5.0, 7.5, 7.5, 10.0]);
    assert_eq!(
        (&features[2]["id"], &features[2]["geometry"]["type"]),
        (&3.into(), &"LineString".into())
    );
    // Samples are in the middle of cells: the first row is at 225, the first column at 105.
    assert_eq!(features[0]["geometry"]["coordinates"][0], serde_json::json!([105, 221.25]));
}

#[test]
fn levels_names_and_heights_are_as_asked() {
    let place = Place::new();
    place.write("grid.asc", GRID);
    place.ok(&[
        "contour",
        "grid.asc",
        "-o",
        "a.geojson",
        "--levels",
        "-3,6,4.25",
        "-a",
        "h",
        "--3d",
        "-q",
    ]);
    let text = std::fs::read_to_string(place.path("a.geojson")).unwrap();
    let written: Value = serde_json::from_str(&text).unwrap();
    let first = &written["features"][0];
    assert_eq!(first["properties"]["h"], 4.25);
    assert_eq!(first["geometry"]["coordinates"][0][2], 4.25);
    place.ok(&[
        "contour",
        "grid.asc",
        "-o",
        "b.geojson",
        "--interval",
        "4",
        "--base",
        "-1.75",
        "-q",
    ]);
    let text = std::fs::read_to_string(place.path("b.geojson")).unwrap();
    let written: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(written["features"][0]["properties"]["elev"], 2.25);
}

#[test]
fn options_of_other_programs_are_known() {
    let place = Place::new();
    place.write("grid.asc", GRID);
    let run = |args: &[&str]| {
        place
            .ok(&[&["contour", "grid.asc", "-o", "a.geojson", "-q", "--overwrite"], args].concat());
        let text = std::fs::read_to_string(place.path("a.geojson")).unwrap();
        let written: Value = serde_json::from_str(&text).unwrap();
        let features = written["features"].as_array().unwrap();
        features.iter().map(|f| f["properties"].clone()).collect::<Vec<_>>()
    };
    let heights = |args: &[&str]| -> Vec<f64> {
        run(args).iter().map(|p| p["elev"].as_f64().unwrap()).collect()
    };
    assert_eq!(heights(&["-i", "4", "--offset", "-1.75"]), heights(&["-i", "4", "--base", "2.25"]));
    // 9 means nothing now, and -9999 is a height.
    assert!(heights(&["--levels", "-5000"]).is_empty());
    assert_eq!(heights(&["--levels", "-5000", "--nodata", "9"]), [-5000.0]);
    let marks: Vec<_> = run(&["-i", "2.5", "--index", "2"])
        .iter()
        .map(|p| (p["elev"].as_f64().unwrap(), p["index"].as_bool().unwrap()))
        .collect();
    let expected = [(2.5, false), (5.0, true), (7.5, false), (7.5, false), (10.0, true)];
    assert_eq!(marks, expected);
    place.fails(
        &["contour", "grid.asc", "-o", "b.geojson", "-i", "1", "--band", "2"],
        2,
        &["band"],
    );
}

#[test]
fn simplified_lines_are_proved() {
    let place = Place::new();
    let run = |out: &str, more: &[&str]| {
        place.ok(&[&["contour", TERRAIN, "-o", out, "-i", "5", "-q", "--tile", "64"], more].concat());
    };
    run("all.fgb", &[]);
    run("few.geojson", &["--tolerance", "3"]);
    let proved = ["verify", "few.geojson", "all.fgb", "--tolerance", "3.0000001", "--topology"];
    place.ok(&proved);
    let ran = place.run(&["verify", "few.geojson", "all.fgb", "--tolerance", "2"]);
    assert_eq!(ran.code, 1, "{}", ran.out);
}

#[test]
fn reports_are_the_same_on_stdout_and_in_a_file() {
    let place = Place::new();
    let args = ["contour", TERRAIN, "-o", "a.fgb", "-i", "50", "--tolerance", "5", "--json"];
    let ran = place.ok(&[&args[..], &["--report", "r.json"]].concat());
    assert_eq!(ran.out, std::fs::read_to_string(place.path("r.json")).unwrap());
    let report: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!((&report["format"], &report["width"]), (&"FlatGeobuf".into(), &300.into()));
    assert!(report["vertices"].as_u64().unwrap() < report["original_vertices"].as_u64().unwrap());
    assert!(report["lines"].as_u64().unwrap() > 10);
    let quiet = place.ok(&["contour", TERRAIN, "-o", "b.shp", "-i", "50", "-q"]);
    assert_eq!((quiet.out.as_str(), quiet.err.as_str()), ("", ""));
    assert!(place.path("b.dbf").is_file());
}

#[test]
fn grids_without_lines_are_no_error() {
    let place = Place::new();
    place.write("void.asc", VOID_GRID);
    let ran = place.ok(&["contour", "void.asc", "-o", "a.geojson", "-i", "1"]);
    assert!(ran.out.contains("none (no level is crossed)"), "{}", ran.out);
}

#[test]
fn nonsense_is_told_on_one_line() {
    let place = Place::new();
    place.write("grid.asc", GRID).write("taken.geojson", "x");
    let fails = |args: &[&str], code, words: &[&str]| {
        place.fails(&[&["contour", "grid.asc", "-o"], args].concat(), code, words);
    };
    fails(&["a.geojson"], 2, &["--interval"]);
    fails(&["a.geojson", "--interval", "0"], 2, &["above zero"]);
    fails(&["a.geojson", "--interval", "1", "--levels", "1,2"], 2, &["--levels"]);
    fails(&["a.geojson", "--levels", "1,x"], 2, &["expected a number"]);
    fails(&["a.geojson", "--levels", "1", "--base", "2"], 2, &["--levels"]);
    fails(&["a.geojson", "-i", "1", "--tolerance", "-1"], 2, &["zero or more"]);
    fails(&["a.geojson", "-i", "1", "--tile", "3"], 2, &["16"]);
    fails(&["a.tif", "-i", "1"], 2, &[".geojson"]);
    fails(&["a.topojson", "-i", "1"], 2, &["TopoJSON"]);
    fails(&["taken.geojson", "-i", "1"], 2, &["--overwrite"]);
    fails(&["grid.asc", "-i", "1", "--overwrite", "-f", "csv"], 2, &["also an input"]);
    fails(&["nowhere/a.geojson", "-i", "1"], 73, &["folder does not exist"]);
    place.write("high.asc", GRID.replace("11 -9999", "1e31 -9999"));
    let high = ["contour", "high.asc", "-o", "a.geojson", "-i", "1"];
    place.fails(&high, 65, &["high.asc", "column 2, row 2", "--nodata"]);
    place.fails(&["contour", "none.tif", "-o", "a.geojson", "-i", "1"], 65, &["no such file"]);
    place.fails(
        &["contour", TERRAIN, "-o", "a.geojson", "-i", "1", "--memory", "8M"],
        75,
        &["MiB of memory are needed"],
    );
}
