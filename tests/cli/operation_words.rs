//! What is told of values and names that are given, at each door.

use serde_json::{Value as Json, json};
use terrane::{Cancel, Data, OPERATIONS, Silent};

use crate::operations::{TERRAIN, lines, place, verb};

#[test]
fn values_and_names_are_taken_as_they_are_written() {
    let place = place();
    for args in [
        &["convert", TERRAIN, "a.tif", "--type", "Float64"][..],
        &["simplify", "lines.wkt", "a.wkt", "--tolerance", "5", "--method", "RDP"],
        &["contour", TERRAIN, "d.wkt", "--levels", "10,20", "--levels", "30"],
        &["convert", TERRAIN, "b.tif", "--like", "li*.asc", "--resampling", "near"],
    ] {
        place.ok(args);
    }
    let wkt = String::from_utf8(place.bytes("a.wkt")).unwrap();
    assert!(!wkt.is_empty());
    place.fails(
        &["contour", TERRAIN, "c.wkt", "--levels", "", "--interval", "5"],
        2,
        &["--levels"],
    );
    let large = ["convert", "synth:rough,size=20000000", "c.tif", "-f", "store"];
    place.fails(&large, 2, &["choose a smaller size"]);
    place.fails(&["simplify", "lines.wkt", "c.wkt", "--decimals", "300"], 2, &["from 0 to 17"]);
    // No name is mistaken for an option.
    place.ok(&["convert", TERRAIN, "‹fit›.tif", "-q"]);
    let told = place.ok(&["slope", "‹fit›.tif", "s.tif", "--json"]).out;
    let report: Json = serde_json::from_str(&told).unwrap();
    assert_eq!(report["input"], "‹fit›.tif");
    place.fails(&["slope", "‹no›.tif", "t.tif"], 65, &["‹no›.tif: no such file"]);
    for verb in OPERATIONS.iter().map(verb) {
        let help = place.ok(&[verb, "--help"]).out;
        assert!(!help.contains('‹'), "{help}");
    }
}

#[test]
fn names_that_are_none_suggest_the_nearest() {
    let place = place();
    let place_of = |name: &str| place.path(name);
    let grid = terrane::open(TERRAIN).unwrap();
    let slope = OPERATIONS.iter().find(|operation| operation.name == "slope").unwrap();
    let given = json!({ "percnt": true });
    let given = given.as_object().unwrap();
    let cancel = &Cancel::default();
    let error = grid.run(slope, &place_of("a.tif"), given, &Silent, cancel);
    assert!(error.unwrap_err().to_string().ends_with("did you mean ‹percent›?"));
    place.fails(&["slope", TERRAIN, "a.tif", "--percnt"], 2, &["--percent"]);
    place.fails(&["slpoe", TERRAIN, "a.tif"], 2, &["'slope'"]);
}

#[test]
fn what_was_given_counts_whatever_its_value() {
    let place = place();
    for (args, told) in [
        (&["grid", "cloud.las", "o.tif", "--cell", "2", "--ground", "auto"][..], "--ground"),
        (&["grid", "cloud.las", "o.tif", "--cell", "2", "--canopy", "pit-free"], "--canopy"),
        (&["grid", "cloud.las", "o.tif", "--cell", "2", "--dtm", "--stat", "mean"], "--stat"),
        (&["points", "cloud.las", "o.las", "--buffer-flag", "withheld"], "--buffer-flag"),
        (&["points", "cloud.las", "o.las", "--tile-format", "laz"], "--tile-format"),
        (&["plan", "grid", "cloud.las", "-o", "w", "--cell", "2", "--ground", "auto"], "--ground"),
        (&["grid", "cloud.las", "o.tif", "--cell", "2", "--fill", "1e2"], "from 0 to 1024"),
        (
            &["plan", "grid", "cloud.las", "-o", "w", "--cell", "2", "--task-size", "9"],
            "--task-size",
        ),
        (&["points", "-", "o", "--tile", "9", "--workdir", "w"], "--workdir"),
        (&["plan", "finish", "w", "--task", "tile-0"], "--task"),
        (&["slope", TERRAIN, "o.tif", "--band", "1"], "--band"),
        (&["plan", "tiles", TERRAIN, "-o", "w", "--band", "1"], "--band"),
    ] {
        place.fails(args, 2, &[told]);
    }
    let cloud = terrane::open_cloud(place.path("cloud.las").to_str().unwrap()).unwrap();
    let grid = OPERATIONS.iter().find(|operation| operation.name == "grid").unwrap();
    let given = json!({ "cell": 2, "ground": "auto" });
    let given = given.as_object().unwrap();
    let output = place.path("o.tif");
    let cancel = &Cancel::default();
    let error = cloud.run(grid, &output, given, &Silent, cancel).unwrap_err();
    assert!(error.to_string().starts_with("‹ground› requires"), "{error}");
}

#[test]
fn what_stands_in_the_place_of_an_option_of_other_inputs_is_told() {
    let place = place();
    place.write("l.wkt", lines()).write("m.ply", "ply");
    for (args, code, told) in [
        (&["tin", "cloud.las", "o.ply", "--max-vertices", "9"][..], 2, "; pass --max-error in"),
        (&["tin", "cloud.las", "o.ply", "--max-triangles", "9"], 2, "; pass --max-error in"),
        (
            &["tin", "cloud.las", "o.ply", "--max-error", "1", "--max-vertices", "9"],
            2,
            "; leave --max-vertices out",
        ),
        (&["verify", "l.wkt", "l.wkt", "--max-error", "1"], 2, "; pass --tolerance instead"),
        (&["verify", "m.ply", TERRAIN, "--tolerance", "1"], 2, "; pass --max-error instead"),
        (
            &["verify", "l.wkt", "no.wkt"],
            65,
            "no.wkt: no such file; check the name, or name a file of",
        ),
        (&["line", "no.wkt", "o.wkt", "--tolerance", "1"], 65, "the name, or name a file of lines"),
        (&["verify", "no.ply", TERRAIN], 65, "no.ply: no such file; check the name\n"),
        (&["slope", "no.tif", "o.tif"], 65, "or use a synthetic terrain"),
    ] {
        place.fails(args, code, &[told]);
    }
}
