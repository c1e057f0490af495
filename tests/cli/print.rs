//! Meshes for viewers and printers: in metres or millimetres of their own, of the size that was asked
//! for, solid or not.

use crate::cli_support::{GRID, Place};

/// A cloud as text, 1 km across in the unit of its coordinates.
fn points(step: f64) -> String {
    let point = |i: u32| {
        let (x, y) = (f64::from(i % 10), f64::from(i / 10));
        format!("{} {} {}\n", 7.0 + x * step, 46.0 + y * step, i % 7)
    };
    (0..100).map(point).collect()
}

/// Heights over longitudes and latitudes: 9 x 7 samples a thousandth of a degree apart.
fn degrees(place: &Place) {
    let rows = (0..7).map(|row| {
        let height = |col: i32| 300.25 + f64::from((col * 7 + row * 5) % 11) * 3.5;
        (0..9).map(|col| height(col).to_string()).collect::<Vec<_>>().join(" ")
    });
    let text = rows.collect::<Vec<_>>().join("\n");
    let head = "ncols 9\nnrows 7\nxllcenter 7\nyllcenter 46\ncellsize 0.001\n";
    place.write("dem.asc", format!("{head}{text}\n"));
    let wkt = "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],\
               PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"EPSG\",\"4326\"]]";
    place.write("dem.prj", wkt);
}

/// The triangles of an STL as they are stored.
fn stored(bytes: &[u8]) -> Vec<[[f32; 3]; 3]> {
    let corners = |record: &[u8]| {
        let number = |i: usize| f32::from_le_bytes(record[4 * i..4 * i + 4].try_into().unwrap());
        [3, 6, 9].map(|at| [number(at), number(at + 1), number(at + 2)])
    };
    bytes[84..].chunks_exact(50).map(corners).collect()
}

/// Sides of the box around some triangles, and its lowest height.
fn sides(triangles: &[[[f32; 3]; 3]]) -> ([f64; 3], f64) {
    let all = || triangles.iter().flatten();
    let low = [0, 1, 2].map(|i| all().map(|p| f64::from(p[i])).fold(f64::INFINITY, f64::min));
    let high = [0, 1, 2].map(|i| all().map(|p| f64::from(p[i])).fold(f64::NEG_INFINITY, f64::max));
    ([0, 1, 2].map(|i| high[i] - low[i]), low[2])
}

/// Options, and the sides that an STL of `degrees` then has.
const PRINTS: [(&[&str], [f64; 3]); 6] = [
    // 0.008 x 0.006 degrees at latitude 46.003.
    (&[], [619.4, 666.9, 35.0]),
    (&["--keep-degrees"], [0.008, 0.006, 35.0]),
    (&["--exaggeration", "2"], [619.4, 666.9, 70.0]),
    (&["--size", "100mm"], [92.88, 100.0, 5.248]),
    (&["--scale", "1:10000", "--exaggeration", "3"], [61.94, 66.69, 10.5]),
    (&["--size", "10cm", "--base", "3mm"], [92.88, 100.0, 8.248]),
];

#[test]
fn meshes_of_degrees_are_proved_in_any_units() {
    for (options, _) in PRINTS.into_iter().filter(|(options, _)| !options.contains(&"--base")) {
        for format in terrane_mesh::FORMATS {
            let place = Place::new();
            degrees(&place);
            let mesh = format!("mesh.{}", format.extensions[0]);
            let args = [&["tin", "dem.asc", &mesh, "--max-error", "4", "--json"], options].concat();
            if format.name == "LandXML" {
                place.fails(&args, 65, &["LandXML requires one length unit", "degrees"]);
                continue;
            }
            if format.states_unit && options.contains(&"--keep-degrees") {
                place.fails(&args, 2, &["--keep-degrees has no effect on", format.name]);
                continue;
            }
            if !format.single_precision && !options.is_empty() {
                place.fails(&args, 2, &[options[0], "applies to STL, 3MF and GLB"]);
                continue;
            }
            let report: serde_json::Value = serde_json::from_str(&place.ok(&args).out).unwrap();
            let notes = report["notes"].to_string();
            let told = if report["placed"].is_null() { "spike" } else { "metre" };
            assert!(notes.contains(told) || options == ["--keep-degrees"], "{args:?}: {notes}");
            place.ok(&["verify", &mesh, "dem.asc", "--max-error", "4"]);
            place.ok(&["view", &mesh, "-o", "mesh.png", "--width", "200"]);
            let info = place.ok(&["info", &mesh, "--json"]).out;
            let info: serde_json::Value = serde_json::from_str(&info).unwrap();
            let low = info["bounds"][0][0].as_f64().unwrap();
            assert!((low - 7.0).abs() < 1e-6, "{args:?}: in the coordinates of the data, {info}");
        }
    }
}

#[test]
fn a_unit_has_one_size_for_all_verbs() {
    let place = Place::new();
    place.write("a.asc", GRID).write("a.wkt", "LINESTRING (0 0, 1 0.1, 2 0)\n");
    for (unit, metres) in [
        ("metre", 1.0),
        ("foot", 0.3048),
        ("US survey foot", 1200.0 / 3937.0),
        ("fathom", 1.8288),
        ("kilometre", 1000.0),
        ("a rod of my own", 5.0292),
    ] {
        place.write("a.prj", format!("LOCAL_CS[\"site\",UNIT[\"{unit}\",{metres}]]"));
        let told = |args: &[&str], at: [&str; 2]| -> serde_json::Value {
            let out = place.ok(&[args, &["--overwrite", "--json"]].concat()).out;
            let report: serde_json::Value = serde_json::from_str(&out).unwrap();
            report[at[0]][at[1]].clone()
        };
        let print = ["tin", "a.asc", "print.glb", "--max-error", "0.01", "--scale", "1:10"];
        let scale = told(&print, ["placed", "scale"])[0].as_f64().unwrap();
        assert!((scale * 10.0 / metres - 1.0).abs() < 1e-6, "{unit}: {scale}");
        let line = ["line", "a.wkt", "b.wkt", "--tolerance", "10m"];
        let threshold = told(&line, ["threshold", "value"]).as_f64().unwrap();
        assert!((threshold * metres / 10.0 - 1.0).abs() < 1e-12, "{unit}: {threshold}");
    }
}

#[test]
fn prints_have_the_size_that_was_asked_for() {
    for (options, expected) in PRINTS {
        let place = Place::new();
        degrees(&place);
        place.ok(&[&["tin", "dem.asc", "a.stl", "--max-error", "0.5"], options].concat());
        let triangles = stored(&std::fs::read(place.path("a.stl")).unwrap());
        let (found, _) = sides(&triangles);
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() <= expected * 1e-3, "{options:?}: {found} {expected}");
        }
        if options.contains(&"--size") {
            assert!((found[1] - 100.0).abs() < 1e-4, "{options:?}: {found:?}");
        }
        let mut edges = std::collections::HashMap::<_, i32>::new();
        for corners in &triangles {
            let bits = corners.map(|p| p.map(f32::to_bits));
            for i in 0..3 {
                let (a, b) = (bits[i], bits[(i + 1) % 3]);
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        let is_closed = edges.values().all(|&sum| sum == 0);
        assert_eq!(is_closed, options.contains(&"--base"), "{options:?}");
    }
}

#[test]
fn solids_are_never_proved_and_never_called_broken() {
    for (options, is_solid) in [
        (&[][..], false),
        (&["--size", "100mm"], false),
        (&["--size", "100mm", "--base", "3mm"], true),
        (&["--scale", "1:10000", "--exaggeration", "2", "--base", "1mm"], true),
        (&["--co", "SOLID_BASE=250"], true),
        (&["--co", "SOLID_BASE=250", "--keep-degrees"], true),
        (&["--co", "SOLID_BASE=250", "--split", "1", "--tile", "16", "--format", "STL"], true),
        (&["--co", "SOLID_BASE=250", "--workdir", "work"], true),
    ] {
        for format in terrane_mesh::FORMATS {
            let place = Place::new();
            degrees(&place);
            let mesh = match options.contains(&"--split") {
                true => "mesh".to_owned(),
                false => format!("mesh.{}", format.extensions[0]),
            };
            let ran =
                place.run(&[&["tin", "dem.asc", &mesh, "--max-error", "4"], options].concat());
            let is_refused = !format.can_be_solid && is_solid && !options.contains(&"--split")
                || format.states_unit && options.contains(&"--keep-degrees")
                || format.name == "LandXML" && !options.contains(&"--split");
            if is_refused || (!format.single_precision && options.contains(&"--size")) {
                let codes = if format.name == "LandXML" { [2, 65] } else { [2, 2] };
                assert!(codes.contains(&ran.code), "{options:?} {mesh}: {}", ran.err);
                continue;
            }
            assert_eq!(ran.code, 0, "{options:?} {mesh}: {}", ran.err);
            let verify = ["verify", &mesh, "dem.asc", "--max-error", "4"];
            match is_solid {
                true => place.fails(&verify, 65, &[&mesh, "is a solid", "without --base"]),
                false => drop(place.ok(&verify)),
            }
        }
    }
}

/// Options that make a mesh smaller or larger than f32 holds.
const BEYOND: [(&str, &str); 7] = [
    ("--scale", "1e-50"),
    ("--scale", "1e-43"),
    ("--scale", "1e60"),
    ("--size", "1e-45m"),
    ("--size", "1e-290mm"),
    ("--exaggeration", "1e-50"),
    ("--exaggeration", "1e60"),
];

#[test]
fn prints_that_collapse_are_refused_by_name() {
    let place = Place::new();
    degrees(&place);
    place.write("plain.asc", GRID).write("a.txt", points(100.0));
    for format in terrane_mesh::FORMATS.iter().filter(|format| format.single_precision) {
        let output = format!("a.{}", format.extensions[0]);
        for input in ["dem.asc", "plain.asc", "a.txt"] {
            for (option, value) in BEYOND {
                let args = ["tin", input, &output, "--max-error", "4", option, value];
                place.fails(&args, 2, &[&format!("{option} puts coordinates"), format.name]);
            }
            // Small, and still what it was.
            for (option, value) in
                [("--scale", "1e-30"), ("--size", "1e-25m"), ("--exaggeration", "1e-9")]
            {
                place.ok(&["tin", input, &output, "--max-error", "4", option, value]);
                place.ok(&["verify", &output, input, "--max-error", "4"]);
                std::fs::remove_file(place.path(&output)).unwrap();
                let prj = place.path(&output).with_extension("prj");
                drop(std::fs::remove_file(prj));
            }
        }
    }
}

#[test]
fn options_of_prints_that_cannot_act_are_refused() {
    let place = Place::new();
    degrees(&place);
    place.write("plain.asc", GRID).write("a.txt", points(0.001));
    let tin = |more: &[&'static str]| [&["tin"], more, &["--max-error", "1"]].concat();
    for (more, word) in [
        (
            &["plain.asc", "a.glb", "--keep-degrees"][..],
            "--keep-degrees requires geographic coordinates",
        ),
        (
            &["plain.asc", "a.glb", "--base", "3mm", "--size", "10"],
            "--base is not supported by GLB",
        ),
        (&["plain.asc", "a.stl", "--base", "3mm"], "add --size or --scale"),
        (&["plain.asc", "a.ply", "--size", "100mm"], "--size applies to STL, 3MF and GLB"),
        (&["plain.asc", "a.stl", "--size", "1", "--workdir", "w"], "--workdir"),
        (
            &["plain.asc", "a.stl", "--size", "1", "--base", "1", "--co", "SOLID_BASE=0"],
            "--base cannot be used with --co",
        ),
        (&["cloud:a.txt", "a.stl", "--size", "1", "--base", "1"], "--base is for grids"),
        (&["plain.asc", "a.stl", "--size", "0mm"], "expected a length"),
        (&["plain.asc", "a.stl", "--scale", "1:0"], "expected a scale"),
    ] {
        place.fails(&tin(more), 2, &[word]);
    }
    place.ok(&tin(&["cloud:a.txt", "a.stl", "--crs", "EPSG:4326"]));
    place.ok(&["verify", "a.stl", "cloud:a.txt", "--crs", "EPSG:4326", "--max-error", "1"]);
}
