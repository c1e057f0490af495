//! Manners towards batches and pipes: many files of which some are bad, names of any kind, and
//! messages that say what to do.

mod cli_support;

use cli_support::{GRID, Place};

/// A cloud as text, 1 km across in the unit of its coordinates.
fn points(step: f64) -> String {
    let point = |i: u32| {
        let (x, y) = (f64::from(i % 10), f64::from(i / 10));
        format!("{} {} {}\n", 7.0 + x * step, 46.0 + y * step, i % 7)
    };
    (0..100).map(point).collect()
}

#[test]
fn the_output_may_stand_behind_an_option() {
    let place = Place::new();
    let line = "LINESTRING (0 0, 1 0.1, 2 0)\n";
    place.write("a.asc", GRID).write("a.txt", points(100.0)).write("a.wkt", line);
    for (args, output) in [
        (&["tin", "a.asc", "--max-error", "2", "a.ply"][..], "a.ply"),
        (&["tin", "--max-error", "2", "a.asc", "--overwrite", "a.ply"], "a.ply"),
        (&["convert", "a.asc", "--round", "b.asc"], "b.asc"),
        (&["grid", "a.txt", "--cell", "100", "a.tif"], "a.tif"),
        (&["line", "a.wkt", "--tolerance", "1", "b.wkt"], "b.wkt"),
    ] {
        place.ok(args);
        assert!(place.path(output).is_file(), "{args:?}");
    }
    for args in [&["tin", "a.asc", "--max-error", "2"][..], &["convert", "a.asc"]] {
        place.fails(args, 2, &["name an input and, last of all, the file to write"]);
    }
}

#[test]
fn the_lowest_height_is_named_before_the_work() {
    let place = Place::new();
    place.write("a.asc", GRID);
    for base in ["1", "1.5", "3", "9"] {
        let base = format!("SOLID_BASE={base}");
        let args = ["tin", "a.asc", "a.stl", "--max-error", "0", "--co", &base];
        place.fails(&args, 2, &["the lowest height is 1", "choose a base below 1"]);
    }
    place.ok(&["tin", "a.asc", "a.stl", "--max-error", "0", "--co", "SOLID_BASE=0.5"]);
}

#[test]
fn a_file_that_a_vrt_names_is_told_with_the_vrt() {
    let source = |name: &str| {
        format!(
            "<SimpleSource><SourceFilename relativeToVRT=\"1\">{name}</SourceFilename>\
             <SourceBand>1</SourceBand></SimpleSource>"
        )
    };
    let vrt = |sources: &str| {
        format!(
            "<VRTDataset rasterXSize=\"4\" rasterYSize=\"3\"><GeoTransform>0,1,0,0,0,-1\
             </GeoTransform><VRTRasterBand dataType=\"Float32\" band=\"1\">{sources}\
             </VRTRasterBand></VRTDataset>"
        )
    };
    let place = Place::new();
    place.write("broken.asc", &GRID[..GRID.len() - 9]);
    place.write("lost.vrt", vrt(&source("gone.asc")));
    place.write("broken.vrt", vrt(&source("broken.asc")));
    place.write("outer.vrt", vrt(&source("lost.vrt")));
    for (args, words) in [
        (["info", "lost.vrt"], &["lost.vrt: source gone.asc"][..]),
        (["info", "broken.vrt"], &["broken.vrt: source broken.asc"]),
        (["info", "outer.vrt"], &["outer.vrt: source lost.vrt: source gone.asc"]),
    ] {
        let ran = place.run(&args);
        assert_eq!(ran.code, 65, "{}", ran.err);
        words.iter().for_each(|word| assert!(ran.err.contains(word), "{}", ran.err));
    }
}

#[test]
fn bytes_too_many_are_told_from_polygons() {
    let header = |faces: &str, corners: u8| {
        let mut text = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n\
             property float y\nproperty float z\n{faces}end_header\n"
        )
        .into_bytes();
        let square = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        text.extend(square.iter().flatten().flat_map(|c| c.to_le_bytes()));
        if corners > 0 {
            text.push(corners);
            text.extend((0..u32::from(corners)).flat_map(u32::to_le_bytes));
        }
        text
    };
    let face = "element face 1\nproperty list uchar uint vertex_indices\n";
    let with_more = |mut bytes: Vec<u8>| {
        bytes.push(0);
        bytes
    };
    let place = Place::new();
    place.write("square.ply", header(face, 4));
    place.write("long.ply", with_more(header(face, 3)));
    place.write("bare.ply", with_more(header("", 0)));
    place.fails(&["info", "square.ply"], 65, &["face 0 has 4 corners", "triangulate it first"]);
    for name in ["long.ply", "bare.ply"] {
        place.fails(&["info", name], 65, &["1 bytes more", "something was put behind its end"]);
    }
}

#[test]
fn cells_of_degrees_are_not_taken_for_metres() {
    let place = Place::new();
    place.write("a.txt", points(0.001));
    let grid = |more: &[&'static str]| {
        let all = ["grid", "a.txt", "a.tif", "--crs", "EPSG:4326", "--overwrite"];
        [&all[..], more].concat()
    };
    for more in [&["--cell", "1"][..], &["--cell", "0.5,2"], &["--cell", "1", "--compat", "pdal"]] {
        place.fails(&grid(more), 2, &["--cell counts degrees here", "pass --cell"]);
    }
    place.fails(
        &["plan", "grid", "a.txt", "-o", "w", "--cell", "1", "--crs", "EPSG:4326"],
        2,
        &["--cell counts degrees here"],
    );
    place.ok(&grid(&["--cell", "0.002"]));
    place.ok(&grid(&["--cell", "1", "--bbox", "7,46,8,47"]));
    place.ok(&["grid", "a.txt", "b.tif", "--cell", "1"]);
}

/// A grid beside `GRID`, `column` columns of four samples to the east.
fn beside(column: u32) -> String {
    GRID.replace("xllcorner 100", &format!("xllcorner {}", 100 + 40 * column))
}

/// Folders of grids, clouds and features, each with three good files and two bad ones, one of them
/// deeper.
fn batch() -> Place {
    let place = Place::new();
    for folder in ["g/deep", "c/deep", "f/deep"] {
        std::fs::create_dir_all(place.path(folder)).unwrap();
    }
    for (i, name) in ["g/a.asc", "g/c.asc", "g/deep/e.asc"].into_iter().enumerate() {
        place.write(name, beside(i as u32));
    }
    for (i, name) in ["c/a.laz", "c/c.laz", "c/deep/e.laz"].into_iter().enumerate() {
        let cloud = format!("cloud,size=30,density=1,seed={i}");
        place.ok(&["synth", &cloud, name, "-q"]);
    }
    for name in ["f/a.geojson", "f/c.geojson", "f/deep/e.geojson"] {
        let line = r#"{"type":"LineString","coordinates":[[0,0],[1,0.1],[2,0]]}"#;
        place.write(name, line);
    }
    place.write("g/b.asc", "ncols 4\nnrows").write("g/d.asc", "");
    place.write("c/b.laz", "LASF").write("c/d.laz", "no cloud");
    place.write("f/b.geojson", r#"{"type":"LineStr"#).write("f/d.geojson", "{");
    place
}

/// Each verb on a folder of a batch: arguments, the kind of files, and what it writes.
const VERBS: [(&[&str], &str, &[&str]); 9] = [
    (&["tin", "g", "out.ply", "--max-error", "0"], "g", &["--report", "r.json"]),
    (&["convert", "g", "out.tif"], "g", &["--json"]),
    (&["contour", "g", "-o", "out.geojson", "-i", "2"], "g", &["--report", "r.json"]),
    (&["view", "g", "-o", "out.png"], "g", &["--json"]),
    (&["info", "g"], "g", &["--json"]),
    (&["plan", "tin", "g", "-o", "out", "--max-error", "0"], "g", &["--json"]),
    (&["tin", "c", "out.ply", "--max-error", "1"], "c", &["--report", "r.json"]),
    (&["grid", "c", "out.tif", "--cell", "5"], "c", &["--report", "r.json"]),
    (&["line", "f", "out", "--tolerance", "1"], "f", &["--report", "r.json"]),
];

#[test]
fn all_bad_files_of_a_batch_are_told_at_once() {
    let place = batch();
    for (args, kind, _) in VERBS {
        let ran = place.run(args);
        assert!(ran.code == 65 && ran.out.is_empty(), "{args:?}: {}", ran.err);
        let lines: Vec<&str> = ran.err.lines().collect();
        for bad in ["b", "d"] {
            let name = format!("{kind}/{bad}.");
            let told = lines.iter().filter(|line| line.contains(&name)).count();
            assert_eq!(told, 1, "{args:?}: {}", ran.err);
        }
        let last = lines.last().unwrap();
        assert!(last.contains("2 of 4 files cannot be used; "), "{args:?}: {}", ran.err);
        assert!(!place.path("out").exists());
    }
}

#[test]
fn bad_files_are_skipped_when_asked_and_listed() {
    for (args, kind, report) in VERBS {
        let place = batch();
        let ran = place.ok(&[args, report, &["--skip-bad"]].concat());
        let told = match report {
            ["--json"] => ran.out,
            _ => std::fs::read_to_string(place.path("r.json")).unwrap(),
        };
        let report: serde_json::Value = serde_json::from_str(&told).unwrap();
        let names: Vec<&str> = report["skipped"]
            .as_array()
            .unwrap_or_else(|| panic!("{args:?}: {told}"))
            .iter()
            .map(|one| one["file"].as_str().unwrap())
            .collect();
        assert_eq!(names.len(), 2, "{args:?}: {names:?}");
        for name in names {
            assert!(name.starts_with(&format!("{kind}/")), "{name}");
            let lines = ran.err.lines().filter(|line| line.contains(&format!("skipped {name}: ")));
            assert_eq!(lines.count(), 1, "{args:?}: {}", ran.err);
        }
    }
}

#[test]
fn a_plan_keeps_to_the_files_it_was_made_with() {
    let place = batch();
    place.ok(&["plan", "tin", "g", "-o", "w", "--max-error", "0", "--skip-bad"]);
    place.ok(&["plan", "grid", "c", "-o", "v", "--cell", "5", "--skip-bad"]);
    // Mended afterwards: the plans have been made without it.
    place.write("g/b.asc", beside(7));
    for folder in ["w", "v"] {
        let status = place.ok(&["status", folder, "--json"]).out;
        let status: serde_json::Value = serde_json::from_str(&status).unwrap();
        assert_eq!(status["skipped"].as_array().map(Vec::len), Some(2), "{status}");
        place.ok(&["run", folder]);
    }
    place.ok(&["tin", "g/a.asc", "g/c.asc", "whole.ply", "--max-error", "0"]);
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert_eq!(bytes("w/mesh.ply").len(), bytes("whole.ply").len());
}

#[test]
fn what_a_plan_leaves_out_is_told_and_is_no_reason_to_plan_anew() {
    let place = batch();
    let tin = |more: &[&'static str]| {
        [&["tin"], more, &["out.ply", "--max-error", "0", "--workdir", "w"]].concat()
    };
    let skipping = tin(&["g", "--skip-bad"]);
    let names = |text: &str| {
        let told: serde_json::Value = serde_json::from_str(text).unwrap();
        let all = told["skipped"].as_array().cloned().unwrap_or_default();
        all.iter().map(|one| one["file"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let bad = ["g/b.asc", "g/d.asc"];
    assert_eq!(names(&place.ok(&[&skipping[..], &["--json"]].concat()).out), bad);
    assert_eq!(names(&place.ok(&["status", "w", "--json"]).out), bad);
    assert_eq!(names(&place.ok(&["run", "w", "-o", "out.ply", "--json"]).out), bad);
    for told in [place.ok(&["status", "w"]).out, place.ok(&["run", "w", "-o", "out.ply"]).out] {
        let rows = bad.iter().filter(|name| told.contains(&format!("{name}: ")));
        assert_eq!(rows.count(), 2, "{told}");
    }
    let made = std::fs::read(place.path("out.ply")).unwrap();
    // The same work, asked for by the names of what is left, and after another reason to skip.
    place.write("g/b.asc", "neither a grid nor as it was");
    place.ok(&tin(&["g/a.asc", "g/c.asc"]));
    place.ok(&skipping);
    place.ok(&["plan", "tin", "g", "-o", "w", "--max-error", "0", "--skip-bad"]);
    assert!(std::fs::read(place.path("out.ply")).unwrap() == made);
    place.ok(&["plan", "grid", "c", "-o", "v", "--cell", "5", "--skip-bad"]);
    place.write("c/b.laz", "neither a cloud nor as it was");
    place.ok(&["plan", "grid", "c", "-o", "v", "--cell", "5", "--skip-bad"]);
    assert_eq!(names(&place.ok(&["run", "v", "--json"]).out), ["c/b.laz", "c/d.laz"]);
}

#[test]
fn folders_recurse_when_asked() {
    let place = batch();
    for name in ["g/b.asc", "g/d.asc", "c/b.laz", "c/d.laz", "f/b.geojson", "f/d.geojson"] {
        std::fs::remove_file(place.path(name)).unwrap();
    }
    let files = |args: &[&str]| {
        let report = place.ok(args).out;
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        report["details"]["files"]
            .as_str()
            .map(str::to_owned)
            .unwrap_or(report["files"].to_string())
    };
    for (kind, ending) in [("g", "asc"), ("c", "laz")] {
        assert_eq!(files(&["info", kind, "--json"]), "2");
        assert_eq!(files(&["info", kind, "--json", "--recursive"]), "3");
        assert_eq!(files(&["info", &format!("{kind}/**/*.{ending}"), "--json"]), "3");
    }
    place.ok(&["line", "f", "out", "--tolerance", "1", "--recursive"]);
    place.ok(&["line", "f/**/*.geojson", "too", "--tolerance", "1"]);
    for folder in ["out", "too"] {
        let made = std::fs::read_dir(place.path(folder)).unwrap().count();
        assert_eq!(made, 3, "{folder}");
    }
    place.fails(&["info", "g/a.asc", "--recursive"], 2, &["--recursive is for folders"]);
}

/// Names of bytes that are no UTF-8.
#[cfg(unix)]
mod latin {
    use std::ffi::{OsStr, OsString};
    use std::os::unix::ffi::OsStrExt;
    use std::process::{Command, Output};

    use super::{Place, batch};

    /// "dém.ENDING" in Latin-1.
    fn name(ending: &str) -> OsString {
        OsStr::from_bytes(&[b"d\xe9m.", ending.as_bytes()].concat()).to_owned()
    }

    fn run(place: &Place, args: &[&OsStr]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrane"));
        command.args(args).current_dir(place.path("")).output().unwrap()
    }

    #[test]
    fn names_of_any_bytes_work_with_every_verb() {
        let place = batch();
        let at = |name: &OsStr| place.path("").join(name);
        std::fs::copy(place.path("g/a.asc"), at(&name("asc"))).unwrap();
        std::fs::copy(place.path("c/a.laz"), at(&name("laz"))).unwrap();
        std::fs::copy(place.path("f/a.geojson"), at(&name("geojson"))).unwrap();
        std::fs::write(place.path("list.txt"), [name("asc").as_bytes(), b"\n"].concat()).unwrap();
        std::fs::create_dir(at(&name("d"))).unwrap();
        std::fs::copy(place.path("g/a.asc"), at(&name("d")).join(name("asc"))).unwrap();
        let word = |text: &'static str| -> OsString {
            match text.split_at(1) {
                ("@", ending) => name(ending),
                ("%", ending) => OsStr::from_bytes(&[b"\xfc.", ending.as_bytes()].concat()).into(),
                _ => text.into(),
            }
        };
        for (args, output) in [
            (&["tin", "@asc", "@ply", "--max-error", "0", "--report", "@json"][..], "@ply"),
            (&["verify", "@ply", "@asc"], "@ply"),
            (&["info", "@ply", "--json"], "@ply"),
            (&["info", "@asc", "--json"], "@ply"),
            (&["info", "list.txt", "@laz", "@geojson"], "@ply"),
            (&["view", "@ply", "-o", "@png"], "@png"),
            (&["convert", "@asc", "@tif"], "@tif"),
            (&["convert", "@d", "%tif", "-f", "GTiff"], "%tif"),
            (&["contour", "@asc", "-o", "@wkt", "-i", "2"], "@wkt"),
            (&["grid", "@laz", "@tiff", "--cell", "5"], "@tiff"),
            (&["grid", "@laz", "%tiff", "--like", "@tiff"], "%tiff"),
            (&["tin", "@laz", "@glb", "--max-error", "1"], "@glb"),
            (&["verify", "@glb", "@laz"], "@glb"),
            (&["line", "@geojson", "%shp", "--tolerance", "1"], "%dbf"),
            (&["verify", "%shp", "@geojson", "--tolerance", "1"], "%shx"),
            (&["synth", "rough,size=9", "%synth.tif"], "%synth.tif"),
            (&["plan", "tin", "@asc", "-o", "@plan", "--max-error", "0"], "@plan"),
            (&["run", "@plan"], "@plan"),
            (&["finish", "@plan", "%ply", "--overwrite"], "%ply"),
            (&["status", "@plan"], "@plan"),
            (&["plan", "grid", "@laz", "-o", "@gplan", "--cell", "5"], "@gplan"),
            (&["run", "@gplan"], "@gplan"),
            (&["tin", "@asc", "@stl", "--max-error", "0", "--workdir", "@work"], "@work"),
        ] {
            let args: Vec<OsString> = args.iter().map(|text| word(text)).collect();
            let args: Vec<&OsStr> = args.iter().map(OsString::as_os_str).collect();
            let ran = run(&place, &args);
            assert!(ran.status.success(), "{args:?}: {}", String::from_utf8_lossy(&ran.stderr));
            assert!(std::str::from_utf8(&ran.stdout).is_ok(), "{args:?}");
            assert!(at(&word(output)).exists(), "{args:?}");
        }
        let missing = run(&place, &["info".as_ref(), &name("nowhere")]);
        let told = String::from_utf8_lossy(&missing.stderr).into_owned();
        assert!(told.contains("d\u{fffd}m.nowhere"), "{told}");
    }
}

/// Runs with `input` on stdin.
fn piped(place: &Place, args: &[&str], input: &[u8]) -> cli_support::Ran {
    use std::io::Write;
    use std::process::Stdio;
    let mut command = place.command(args);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // One that refuses its arguments does not read.
    let _ = child.stdin.take().unwrap().write_all(input);
    cli_support::Ran::from(child.wait_with_output().unwrap())
}

#[test]
fn features_go_through_pipes() {
    let place = Place::new();
    place.write("a.geojson", r#"{"type":"LineString","coordinates":[[0,0],[1,0.1],[2,0],[3,5]]}"#);
    for (format, ending) in
        [("GeoJSON", "geojson"), ("GeoJSONSeq", "geojsonl"), ("WKT", "wkt"), ("CSV", "csv")]
    {
        let input = format!("in.{ending}");
        place.ok(&["line", "a.geojson", &input, "--tolerance", "0", "-q"]);
        let bytes = std::fs::read(place.path(&input)).unwrap();
        for more in [&[][..], &["--json"], &["--quiet"]] {
            let args = [&["line", "-", "-", "-f", format, "--tolerance", "1"], more].concat();
            let args = [&args[..], &["--input-format", format]].concat();
            let ran = piped(&place, &args, &bytes);
            assert_eq!(ran.code, 0, "{args:?}: {}", ran.err);
            let output = format!("out.{ending}");
            let to_file = ["line", &input, &output, "--tolerance", "1", "--overwrite", "-q"];
            place.ok(&to_file);
            let expected = std::fs::read_to_string(place.path(&output)).unwrap();
            let plain = |text: &str| text.replace("stdout", "").replace("stdin", "");
            let plain =
                |text: &str| plain(text).replace("\"out\"", "\"\"").replace("\"in\"", "\"\"");
            assert_eq!(plain(&ran.out), plain(&expected), "{args:?}: the file and nothing else");
            assert_eq!(ran.err.is_empty(), more == ["--quiet"], "{args:?}: {}", ran.err);
        }
    }
    let sniffed = piped(
        &place,
        &["line", "-", "-", "-f", "WKT", "--tolerance", "1"],
        &std::fs::read(place.path("a.geojson")).unwrap(),
    );
    assert_eq!(sniffed.code, 0, "{}", sniffed.err);
    assert!(sniffed.out.starts_with("LINESTRING"), "{}", sniffed.out);
}

#[test]
fn grids_and_points_come_through_pipes() {
    let place = Place::new();
    let xyz: String = (0..20).map(|i| format!("{} {} {}\n", i % 5, 9 - i / 5, i * i % 7)).collect();
    for args in [
        &["tin", "-", "a.ply", "--max-error", "0"][..],
        &["convert", "-", "a.tif"],
        &["contour", "-", "-o", "a.wkt", "-i", "2"],
        &["grid", "-", "b.tif", "--cell", "1"],
        &["grid", "cloud:-", "c.tif", "--cell", "1"],
    ] {
        let ran = piped(&place, args, xyz.as_bytes());
        assert_eq!(ran.code, 0, "{args:?}: {}", ran.err);
    }
    let again = piped(&place, &["tin", "-", "b.ply", "--max-error", "0"], xyz.as_bytes());
    assert_eq!(again.code, 0);
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert_eq!(bytes("a.ply"), bytes("b.ply"), "no temporary name in it");
    let lines =
        piped(&place, &["contour", "-", "-o", "-", "-f", "GeoJSON", "-i", "2"], xyz.as_bytes());
    assert!(lines.code == 0 && lines.out.starts_with('{'), "{}{}", lines.out, lines.err);
    let bad = piped(&place, &["convert", "-", "d.tif"], b"1 2\n");
    assert!(bad.code == 65 && bad.err.contains("error: -: "), "{}", bad.err);
}

#[test]
fn what_cannot_go_through_a_pipe_is_refused_by_name() {
    let place = batch();
    for (args, word) in [
        (&["tin", "g/a.asc", "-", "-f", "PLY", "--max-error", "1"][..], "stdout is not written"),
        (&["convert", "g/a.asc", "-", "-f", "GTiff"], "stdout is not written"),
        (&["grid", "c/a.laz", "-", "-f", "GTiff", "--cell", "5"], "stdout is not written"),
        (&["view", "g/a.asc", "-o", "-"], "-: "),
        (&["contour", "g/a.asc", "-o", "-", "-f", "FlatGeobuf", "-i", "2"], "FlatGeobuf cannot"),
        (&["line", "f/a.geojson", "-", "-f", "Shapefile", "--tolerance", "1"], "Shapefile cannot"),
        (&["line", "f/a.geojson", "-", "--tolerance", "1"], "does not say which"),
        (&["line", "-", "-", "f/a.geojson", "--tolerance", "1"], "only once"),
        (&["tin", "g/a.asc", "a.ply", "--max-error", "1", "--report", "-"], "stdout is not"),
        (
            &["line", "f/a.geojson", "a.wkt", "--tolerance", "1", "--input-format", "WKT"],
            "--input-format is for stdin",
        ),
        (&["info", "-"], "stdin is not read"),
        (&["view", "-", "-o", "a.png"], "stdin is not read"),
        (&["verify", "-", "g/a.asc"], "stdin is not read"),
        (&["synth", "rough,size=9", "-"], "-: "),
        (&["plan", "tin", "-", "-o", "w", "--max-error", "1"], "stdin is not read"),
    ] {
        place.fails(args, 2, &[word]);
        assert!(!place.path("-").exists(), "{args:?}");
    }
    let gpx = piped(
        &place,
        &["line", "-", "a.wkt", "--tolerance", "1", "--input-format", "GPX"],
        b"<gpx/>",
    );
    assert!(gpx.code == 2 && gpx.err.contains("GPX cannot be read through a pipe"), "{}", gpx.err);
}
