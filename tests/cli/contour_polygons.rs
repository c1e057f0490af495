//! `terrane contour --polygons` through the real binary.

use crate::cli_support::{GRID, Place, VOID_GRID};
use serde_json::Value;

const TERRAIN: &str = "synth:rough,size=300,seed=3";

fn features(place: &Place, name: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(place.path(name)).unwrap();
    let written: Value = serde_json::from_str(&text).unwrap();
    written["features"].as_array().unwrap().clone()
}

/// Twice the signed area of a ring.
fn twice_area(ring: &Value) -> f64 {
    let at = |p: &Value, axis: usize| p[axis].as_f64().unwrap();
    let ring = ring.as_array().unwrap();
    let pairs = ring.windows(2);
    pairs.map(|p| at(&p[0], 0) * at(&p[1], 1) - at(&p[1], 0) * at(&p[0], 1)).sum()
}

fn twice_sum(features: &[Value]) -> f64 {
    let rings = features.iter().flat_map(|f| f["geometry"]["coordinates"].as_array().unwrap());
    rings.map(twice_area).sum()
}

#[test]
fn bands_are_written_and_told_about() {
    let place = Place::new();
    place.write("grid.asc", GRID);
    let ran = place.ok(&["contour", "grid.asc", "-o", "a.geojson", "-i", "2.5", "--polygons"]);
    assert!(ran.out.contains("polygons"), "{}", ran.out);
    let bands = features(&place, "a.geojson");
    let ends: Vec<_> = bands
        .iter()
        .map(|f| ["elev_min", "elev_max"].map(|name| f["properties"][name].as_f64().unwrap()))
        .collect();
    assert!(ends.iter().all(|[min, max]| max - min == 2.5), "{ends:?}");
    assert!(ends.is_sorted(), "{ends:?}");
    // Five cells of 10 by 10 without the void.
    assert!((twice_sum(&bands) / 2.0 - 500.0).abs() < 1e-9);
    place.ok(&["contour", "grid.asc", "-o", "b.geojson", "--levels", "5,8", "-p", "-a", "h", "-q"]);
    let bands = features(&place, "b.geojson");
    let (first, last) = (&bands[0]["properties"], &bands[bands.len() - 1]["properties"]);
    assert_eq!((&first["h_min"], &first["h_max"]), (&Value::Null, &5.0.into()));
    assert_eq!((&last["h_min"], &last["h_max"]), (&8.0.into(), &Value::Null));
    place.write("void.asc", VOID_GRID);
    place.ok(&["contour", "void.asc", "-o", "c.geojson", "-i", "1", "-p", "-q"]);
    assert!(features(&place, "c.geojson").is_empty());
}

#[test]
fn bytes_do_not_depend_on_tiles_threads_and_memory() {
    let place = Place::new();
    let run = |out: &str, more: &[&str]| {
        place
            .ok(&[&["contour", TERRAIN, "-o", out, "-i", "10", "-q", "--polygons"], more].concat());
        std::fs::read(place.path(out)).unwrap()
    };
    let first = run("a.geojson", &["--threads", "1"]);
    assert!(run("b.geojson", &["--tile", "32", "--threads", "4"]) == first);
    assert!(run("c.geojson", &["--tile", "100", "--memory", "64M"]) == first);
    let whole = ["contour", TERRAIN, "-o", "whole.geojson", "--levels", "1e6", "-q", "--polygons"];
    place.ok(&whole);
    let whole = features(&place, "whole.geojson");
    assert_eq!((whole.len(), &whole[0]["geometry"]["coordinates"][1]), (1, &Value::Null));
    let is_same =
        |name| (twice_sum(&features(&place, name)) / twice_sum(&whole) - 1.0).abs() < 1e-9;
    assert!(is_same("a.geojson"));
    let few = run("d.geojson", &["--tile", "64", "--tolerance", "2", "--threads", "1"]);
    assert!(run("e.geojson", &["--tile", "64", "--tolerance", "2", "--threads", "3"]) == few);
    assert!(few.len() < first.len());
    assert!(is_same("d.geojson"));
}

#[test]
fn shapefiles_and_other_systems() {
    let place = Place::new();
    place.ok(&["contour", TERRAIN, "-o", "a.shp", "-i", "50", "-p", "-q"]);
    let ran = place.ok(&["info", "a.shp"]);
    assert!(ran.out.contains("Polygon") && ran.out.contains("elev_min"), "{}", ran.out);
    let to_crs =
        ["contour", TERRAIN, "-o", "b.fgb", "-i", "50", "-p", "-q", "--to-crs", "EPSG:4326"];
    place.ok(&to_crs);
    // Chords of simplified lines would not be those of the borders there.
    let few = [&to_crs[..], &["--tolerance", "5", "--overwrite"]].concat();
    place.fails(&few, 2, &["--polygons with --tolerance", "terrane convert"]);
}

#[test]
fn what_polygons_cannot_have_is_refused() {
    let place = Place::new();
    place.write("grid.asc", GRID);
    let fails = |args: &[&str], code, words: &[&str]| {
        let all = [&["contour", "grid.asc", "--polygons", "-o"], args].concat();
        place.fails(&all, code, words);
    };
    fails(&["a.geojson", "-i", "1", "--index", "5"], 2, &["--index"]);
    fails(&["a.geojson", "-i", "1", "--3d"], 2, &["--with-z"]);
    fails(&["a.gpx", "-i", "1"], 2, &["GPX does not support polygons"]);
    fails(&["a.geojson", "--levels", "5,5.000000000000001"], 65, &["has no width", "--levels"]);
    fails(&["a.geojson"], 2, &["--interval"]);
    // Crossings that are apart in the grid, but not in its coordinates.
    let tiny = |cell: &str| {
        let head = format!("ncols 4\nnrows 3\nxllcorner 170\nyllcorner 45\ncellsize {cell}\n");
        place
            .write("tiny.asc", head + "1 2 3 4\n4 3 3 1\n1 3 2 2\n")
            .write("tiny.prj", "EPSG:4326");
        ["contour", "tiny.asc", "-o", "t.geojson", "-i", "1", "-p", "--overwrite", "-q"]
    };
    place.fails(&tiny("1e-9"), 65, &["too small for polygons", "--polygons"]);
    place.ok(&tiny("1e-7"));
    place.fails(
        &["contour", TERRAIN, "-o", "a.geojson", "-i", "1", "-p", "--memory", "8M"],
        75,
        &["MiB of memory are needed"],
    );
}
