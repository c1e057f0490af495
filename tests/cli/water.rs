//! `--water`: lakes become level, rivers fall along their lines, and edges follow the banks.

use crate::cli_support::{Place, json};
use crate::shapes::{collection, list, ring};
use crate::tin_fit::alike_however_made;

const TERRAIN: &str = "synth:rough,size=260,seed=9";
const WATER: [&str; 2] = ["--water", "water.geojson"];

fn polygon(corners: &[[f64; 2]]) -> String {
    format!(r#"{{"type":"Polygon","coordinates":[{}]}}"#, ring(corners))
}

fn line(at: &[[f64; 2]]) -> String {
    format!(r#"{{"type":"LineString","coordinates":{}}}"#, list(at))
}

const LAKE: [[f64; 2]; 4] = [[40.0, 60.0], [101.0, 60.0], [101.0, 97.0], [40.0, 97.0]];

/// A lake, one with an island, and a river with bends; one lake lies beyond the grid, and in part another.
fn water() -> String {
    let bend = |i: i32, off: f64| {
        let along = 6.0 * f64::from(i);
        [along, 170.0 + 25.0 * (along * 0.04).sin() + off]
    };
    let banks = (1..43).map(|i| bend(i, -4.3)).chain((1..43).rev().map(|i| bend(i, 4.3)));
    let middle: Vec<_> = (1..43).map(|i| bend(i, 0.0)).collect();
    let island = [[150.0, 50.0], [170.4, 55.0], [160.0, 80.2]];
    let around = [[120.3, 30.0], [200.0, 22.7], [214.0, 100.0], [130.0, 109.4]];
    let with_island =
        format!(r#"{{"type":"Polygon","coordinates":[{},{}]}}"#, ring(&around), ring(&island));
    collection(&[
        polygon(&LAKE),
        with_island,
        polygon(&banks.collect::<Vec<_>>()),
        line(&middle),
        polygon(&[[-50.0, -50.0], [-20.0, -50.0], [-20.0, -20.0]]),
        polygon(&[[240.0, -10.0], [280.0, -12.0], [270.0, 30.0]]),
    ])
}

fn place() -> Place {
    let place = Place::new();
    place.write("water.geojson", water());
    place
}

#[test]
fn meshes_of_level_water_are_proved_and_others_fail() {
    let place = place();
    let make = ["--max-error", "5", "--tile", "48"];
    place.ok(&[&["tin", TERRAIN, "p.ply"][..], &make].concat());
    for more in [&[][..], &["--bound", "surface"], &["--no-drop", "--strict"]] {
        let args = ["tin", TERRAIN, "a.ply", "--overwrite", "--verify", "--json"];
        let made = json(&place.ok(&[&args[..], &make, &WATER, more].concat()).out);
        let found = &made["water"];
        assert_eq!((&found["lakes"], &found["rivers"]), (&3.into(), &1.into()), "{found}");
        assert_eq!((&found["outside"], &found["file"]), (&1.into(), &"water.geojson".into()));
        assert_eq!(made["verify"]["passed"], true, "{more:?}");
        assert_eq!(made["breaklines"]["apart"], 0);
        place.ok(&["verify", "a.ply", TERRAIN, WATER[0], WATER[1]]);
        // The land without its water is another.
        let ran = place.run(&["verify", "a.ply", TERRAIN]);
        assert_eq!(ran.code, 1, "{}", ran.err);
        assert!(
            ran.out.contains("the water of water.geojson is level: pass --water"),
            "{}",
            ran.out
        );
        assert!(place.run(&["verify", "p.ply", TERRAIN, WATER[0], WATER[1]]).code == 1);
    }
}

#[test]
fn a_lake_of_a_mesh_is_level() {
    let place = place();
    place.write("lake.geojson", collection(&[polygon(&LAKE)]));
    place.ok(&[
        "tin",
        TERRAIN,
        "a.obj",
        "--max-error",
        "5",
        "--tile",
        "48",
        "--water",
        "lake.geojson",
    ]);
    let text = String::from_utf8(place.bytes("a.obj")).unwrap();
    let numbers = |line: &str| -> Vec<f64> {
        line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect()
    };
    let vertices: Vec<_> =
        text.lines().filter(|line| line.starts_with("v ")).map(numbers).collect();
    let low = [0, 1].map(|axis| vertices.iter().map(|v| v[axis]).fold(f64::INFINITY, f64::min));
    let most = vertices.iter().map(|v| v[1]).fold(f64::NEG_INFINITY, f64::max);
    // Columns and rows.
    let at = |v: &[f64]| [(v[0] - low[0]) / 10.0, (most - v[1]) / 10.0];
    let is_in = |[col, row]: [f64; 2]| {
        (LAKE[0][0]..=LAKE[2][0]).contains(&col) && (LAKE[0][1]..=LAKE[2][1]).contains(&row)
    };
    let wet: Vec<_> = vertices.iter().filter(|v| is_in(at(v))).map(|v| v[2]).collect();
    assert!(wet.len() > 4 && wet.iter().all(|z| *z == wet[0]), "{wet:?}");
    for line in text.lines().filter(|line| line.starts_with("f ")) {
        let corners = numbers(line).into_iter().map(|number| &vertices[number as usize - 1]);
        let corners: Vec<_> = corners.map(|v| at(v)).collect();
        let middle = [0, 1].map(|axis| corners.iter().map(|c| c[axis]).sum::<f64>() / 3.0);
        assert_eq!(is_in(middle), corners.iter().all(|c| is_in(*c)), "{corners:?}");
    }
}

#[test]
fn plans_threads_and_memory_leave_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("water.geojson");
    std::fs::write(&file, water()).unwrap();
    let file = file.to_str().unwrap();
    let place = alike_however_made(&["--water", file]);
    place.ok(&["verify", "e.ply", "dem.tif", "--water", file]);
    for [threads, memory] in [["1", "80M"], ["4", "300M"]] {
        let convert = ["convert", "dem.tif", "o.tif", "--water", file, "--overwrite"];
        place.ok(&[&convert[..], &["--threads", threads, "--memory", memory]].concat());
        // All but what the mesh states of water is kept by the grid that was flattened.
        let ran = place.run(&["verify", "e.ply", "o.tif"]);
        let is_kept = ran.code == 3 && ran.out.contains("all Delaunay");
        assert!(is_kept && ran.out.contains("is level (--water)"), "{}", ran.out);
    }
    let plan = ["plan", "tin", "dem.tif", "-o", "new", "--max-error", "5", "--tile", "48"];
    place.ok(&[&plan[..], &["--water", file]].concat());
    std::fs::write(file, water().replace("500400,", "500410,")).unwrap();
    place.fails(&["run", "new"], 65, &["water.geojson", "changed since the plan was made"]);
}

#[test]
fn a_model_of_the_ground_has_its_water_at_once() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=200,density=2,seed=5", "a.laz"]);
    let [x, y] = [500_000.0, 4_750_000.0];
    let corners = [[40.0, 40.0], [90.0, 50.0], [80.0, 120.0], [50.0, 100.0], [40.0, 40.0]];
    let ring: Vec<_> = corners.iter().map(|c| format!("{} {}", x + c[0], y + c[1])).collect();
    let lake = format!("POLYGON (({}))", ring.join(", "));
    place.write("l.wkt", lake).write("l.prj", "EPSG:32631");
    let dtm = ["--cell", "1", "--dtm", "--ground", "pmf"];
    place.ok(&[&["grid", "a.laz", "bare.tif"][..], &dtm].concat());
    let made = [&["grid", "a.laz", "wet.tif", "--water", "l.wkt", "--json"][..], &dtm].concat();
    let made = json(&place.ok(&made).out);
    assert_eq!((&made["water"]["lakes"], &made["water"]["rivers"]), (&1.into(), &0.into()));
    place.ok(&["convert", "bare.tif", "b.asc", "--water", "l.wkt", "--out-nodata", "-9999"]);
    place.ok(&["convert", "wet.tif", "w.asc", "--out-nodata", "-9999"]);
    assert!(place.bytes("b.asc") == place.bytes("w.asc"));
    place.ok(&["convert", "bare.tif", "d.asc", "--out-nodata", "-9999"]);
    assert!(place.bytes("d.asc") != place.bytes("w.asc"));
    let left = std::fs::read_dir(place.path(".")).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(!left.into_iter().any(|name| name.to_string_lossy().starts_with(".terrane-")));
    // It is the same file, but for its water.
    let told = |name: &str| json(&place.ok(&["info", name, "--json"]).out);
    let [bare, wet] = ["bare.tif", "wet.tif"].map(told);
    for key in ["crs", "sample_type", "nodata", "width", "height", "transform", "details", "bands"]
    {
        assert_eq!(bare[key], wet[key], "{key}");
    }
}

#[test]
fn a_line_that_seems_to_be_drawn_upstream_is_told_of() {
    let place = Place::new();
    let rows = |row: u32| {
        let col = |col: u32| (200 - col + row.abs_diff(5)).to_string();
        (0..60).map(col).collect::<Vec<_>>().join(" ") + "\n"
    };
    let head = "ncols 60\nnrows 11\nxllcorner 0\nyllcorner 0\ncellsize 1\n";
    place.write("a.asc", format!("{head}{}", (0..11).map(rows).collect::<String>()));
    for (name, at) in [("down", "2.5 5.5, 57.5 5.5"), ("up", "57.5 5.5, 2.5 5.5")] {
        let area = "POLYGON ((2.5 3.5, 57.5 3.5, 57.5 7.5, 2.5 7.5, 2.5 3.5))";
        place.write("w.wkt", format!("{area}\nLINESTRING ({at})"));
        let out = format!("{name}.asc");
        let told = place.ok(&["convert", "a.asc", &out, "--water", "w.wkt"]).out;
        let is_told = told.contains(
            "line 1 of w.wkt: bank heights rise along the line; check that it is drawn downstream",
        );
        assert_eq!(is_told, name == "up", "{told}");
        assert!(told.contains("water"), "{told}");
    }
    let wet = String::from_utf8(place.bytes("down.asc")).unwrap();
    let middle: Vec<i32> =
        wet.lines().nth(6 + 5).unwrap().split_whitespace().map(|z| z.parse().unwrap()).collect();
    assert!(middle.windows(2).all(|pair| pair[1] <= pair[0]), "{middle:?}");
}

#[test]
fn what_cannot_be_made_level_is_refused() {
    let place = place();
    let convert = |file: &str, code: i32, words: &[&str]| {
        let args = ["convert", TERRAIN, "a.tif", "--water", file];
        place.fails(&args, code, &[&[file][..], words].concat());
    };
    convert("lost.geojson", 65, &["no such file", "check the name"]);
    place.write("none.geojson", collection(&[line(&[[1.0, 1.0], [9.0, 9.0]])]));
    convert("none.geojson", 65, &["contains no polygon"]);
    place.write("peak.wkt", "POINT (500010 4749990)").write("peak.prj", "EPSG:32631");
    convert("peak.wkt", 65, &["points are not supported as water"]);
    place.write("far.geojson", collection(&[polygon(&[[-9.0, -9.0], [-5.0, -9.0], [-5.0, -5.0]])]));
    convert("far.geojson", 65, &["water polygons do not overlap the grid"]);
    let all = [[-9.0, -9.0], [400.0, -9.0], [400.0, 400.0], [-9.0, 400.0]];
    place.write("all.geojson", collection(&[polygon(&all)]));
    convert("all.geojson", 65, &["polygon 1", "without a bank"]);
    place.write("wgs.geojson", water().replace("EPSG::32631", "EPSG::4326"));
    convert("wgs.geojson", 65, &["EPSG:4326", "EPSG:32631", "reproject one of them"]);
    let river = [[10.0, 10.0], [90.0, 10.0], [90.0, 20.0], [10.0, 20.0]];
    let circle = [[20.0, 15.0], [50.0, 12.0], [80.0, 15.0], [50.0, 18.0], [20.0, 15.0]];
    place.write("ring.geojson", collection(&[polygon(&river), line(&circle)]));
    convert("ring.geojson", 65, &["line 1", "cycle"]);
    let job = [&["tin", TERRAIN, "a.ply", "--max-error", "5"][..], &WATER].concat();
    place.fails(&[&job[..], &["--fit-heights"]].concat(), 2, &["--water", "--fit-heights"]);
    place.fails(&[&job[..], &["--min-angle", "20"]].concat(), 2, &["--water", "--min-angle"]);
    place.fails(
        &[&job[..], &["--method", "drop"]].concat(),
        2,
        &["--method drop cannot be used with --water"],
    );
    place.fails(
        &[&job[..], &["--bands", "1"]].concat(),
        2,
        &["--bands cannot be used with --water"],
    );
    place.ok(&["synth", "cloud,size=20,density=2,seed=5", "a.laz", "-q"]);
    let cloud = ["tin", "a.laz", "c.ply", "--max-error", "1"];
    place.fails(&[&cloud[..], &WATER].concat(), 2, &["--water is for grids"]);
    place.ok(&cloud);
    place.fails(
        &[&["verify", "c.ply", "a.laz"][..], &WATER].concat(),
        2,
        &["--water is for meshes of grids"],
    );
    let grid = ["grid", "a.laz", "g.tif", "--cell", "1"];
    for other in ["--dsm", "--chm"] {
        place.fails(&[&grid[..], &WATER, &[other]].concat(), 2, &["--dtm"]);
    }
    place.fails(
        &[&grid[..], &["--dtm", "--water", "lost.wkt"]].concat(),
        65,
        &["lost.wkt", "no such file"],
    );
    let over = ["tin", TERRAIN, "water.geojson", "-f", "PLY", "--max-error", "5", "--overwrite"];
    place.fails(&[&over[..], &WATER].concat(), 2, &["output is also an input"]);
}
