//! `terrane info --quality`: meshes of every format, made by every way.

use crate::cli_support::Place;
use serde_json::Value;

fn quality(place: &Place, args: &[&str]) -> Value {
    let args = [&["info", "--json", "--quality"], args].concat();
    let facts: Value = serde_json::from_str(&place.ok(&args).out).unwrap();
    facts["quality"].clone()
}

fn tin(place: &Place, output: &str, more: &[&str]) {
    let dem = ["tin", "synth:rough,size=129", output, "--max-error", "4", "-q"];
    place.ok(&[&dem, more].concat());
}

#[test]
fn meshes_of_every_format_are_the_same_triangulation() {
    let place = Place::new();
    let counts = |file: &str| {
        let all = quality(&place, &[file, "--grid", "synth:rough,size=129"]);
        let keys = ["vertices", "edges", "border_edges", "delaunay_edges", "cocircular_edges"];
        assert_eq!(all["delaunay_share"], 1.0, "{file}");
        // STL and GLB hold heights as f32 from an origin of their own.
        let rms = all["slope"]["rms"].as_f64().unwrap();
        (keys.map(|key| all[key].as_u64().unwrap()), (rms * 1e3).round())
    };
    tin(&place, "mesh.ply", &[]);
    let expected = counts("mesh.ply");
    for file in ["mesh.obj", "mesh.stl", "mesh.glb"] {
        tin(&place, file, &[]);
        assert_eq!(counts(file), expected, "{file}");
    }
    tin(&place, "tiled.ply", &["--tile", "32"]);
    let expected = counts("tiled.ply");
    for (folder, format) in [("plys", "ply"), ("glbs", "glb")] {
        tin(&place, folder, &["--tile", "32", "--split", "2", "--format", format]);
        assert_eq!(counts(folder), expected, "{folder}");
    }
}

#[test]
fn what_a_method_promises_is_seen() {
    let place = Place::new();
    let delaunay = |method: &str| {
        let file = format!("{method}.ply");
        tin(&place, &file, &["--method", method]);
        let found = quality(&place, &[&file]);
        let least = found["smallest_angles"]["min"].as_f64().unwrap();
        (found["delaunay_share"].as_f64().unwrap(), least)
    };
    assert_eq!(delaunay("greedy").0, 1.0);
    // Right triangles with two sides of one length, whatever the terrain is.
    assert_eq!(delaunay("rtin"), (1.0, 45.0));
    // Edges go where the terrain has them.
    assert!(delaunay("collapse").0 < 0.95);
}

#[test]
fn people_are_told_the_same() {
    let place = Place::new();
    tin(&place, "mesh.ply", &[]);
    let told = place.ok(&["info", "mesh.ply", "--quality", "--grid", "synth:rough,size=129"]).out;
    for word in
        ["Delaunay         100 % of inner edges in x and y", "slopes ", "aspect ratios", "degrees "]
    {
        assert!(told.contains(word), "{word}: {told}");
    }
    assert!(!place.ok(&["info", "mesh.ply"]).out.contains("Delaunay"));
}

#[test]
fn what_does_not_apply_is_refused_by_name() {
    let place = Place::new();
    tin(&place, "mesh.ply", &[]);
    place.ok(&["convert", "synth:rough,size=65", "dem.tif", "-q"]);
    place.ok(&["synth", "cloud,size=20,density=2", "points.las", "-q"]);
    place.ok(&["synth", "koch,vertices=20", "lines.geojson", "-q"]);
    for file in ["dem.tif", "synth:rough,size=65", "points.las", "lines.geojson"] {
        place.fails(&["info", file, "--quality"], 2, &["--quality is for meshes", file]);
    }
    let quality = ["info", "mesh.ply", "--quality"];
    let fails = |more: &[&str], code, words: &[&str]| {
        place.fails(&[&quality, more].concat(), code, words);
    };
    fails(&["--band", "1"], 2, &["--band", "mesh.ply"]);
    fails(&["--stats"], 2, &["--stats", "mesh.ply"]);
    fails(&["--grid", "synth:rough,size=129", "--nodata", "0"], 2, &["--nodata", "synthetic"]);
    fails(&["--grid", "mesh.ply"], 65, &["is a mesh, not a grid"]);
    place.fails(&["info", "mesh.ply", "--grid", "dem.tif"], 2, &["--quality"]);
    quality_of_part(&place);
}

/// Bands and voids are those of the grid; damage is told as ever.
fn quality_of_part(place: &Place) {
    let part = quality(place, &["mesh.ply", "--grid", "dem.tif", "--band", "1", "--threads", "2"]);
    assert_eq!(part["slope"]["cells"], 64 * 64);
    let bytes = std::fs::read(place.path("mesh.ply")).unwrap();
    place.write("short.ply", &bytes[..bytes.len() - 7]);
    place.fails(&["info", "short.ply", "--quality"], 65, &["short.ply"]);
}
