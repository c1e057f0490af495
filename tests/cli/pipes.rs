//! Stdin and stdout: what comes and goes through pipes, what it is called, and what is refused.

use crate::cli_support::{self, Place, batch};

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

/// A grid and points as text, the second file of a mosaic, and lines.
fn streams() -> (Place, String, String) {
    let place = Place::new();
    let xyz = |x: i32| -> String {
        (0..20).map(|i| format!("{} {} {}\n", x + i % 5, 9 - i / 5, i * i % 7)).collect()
    };
    let lines = r#"{"type":"LineString","coordinates":[[0,0],[1,0.1],[2,0],[3,5]]}"#;
    place.write("whole.xyz", xyz(0)).write("east.xyz", xyz(5)).write("lines.geojson", lines);
    place.write("bad.xyz", "1 2\n").write("bad.geojson", "{");
    (place, xyz(0), lines.to_owned())
}

/// A report without what is another one each time.
fn settled(report: &[u8]) -> serde_json::Value {
    fn settle(value: &mut serde_json::Value) {
        if let Some(map) = value.as_object_mut() {
            let is_measured = |key: &str| key.contains("second") || key == "peak_memory";
            map.retain(|key, _| !is_measured(key));
            map.values_mut().for_each(settle);
        }
        value.as_array_mut().into_iter().flatten().for_each(settle);
    }
    let mut value = serde_json::from_slice(report).unwrap();
    settle(&mut value);
    value
}

/// Every verb that reads stdin, alone and among other files, good and bad: arguments, output and the
/// name of the file that stdin is a copy of.
const READERS: [(&[&str], &str, &str); 14] = [
    (&["tin", "-", "OUT", "--max-error", "0", "--verify", "--report", "R"], "a.ply", "whole.xyz"),
    (&["tin", "-", "OUT", "--max-error", "0", "--report", "R"], "a.obj", "whole.xyz"),
    (&["tin", "-", "east.xyz", "OUT", "--max-error", "0", "--report", "R"], "b.obj", "whole.xyz"),
    (
        &[
            "tin",
            "bad.xyz",
            "-",
            "east.xyz",
            "OUT",
            "--max-error",
            "0",
            "--report",
            "R",
            "--skip-bad",
        ],
        "c.ply",
        "whole.xyz",
    ),
    (
        &["tin", "-", "bad.xyz", "OUT", "--max-error", "0", "--report", "R", "--skip-bad"],
        "d.ply",
        "whole.xyz",
    ),
    (&["convert", "-", "OUT", "--json"], "a.tif", "whole.xyz"),
    (&["convert", "-", "east.xyz", "bad.xyz", "OUT", "--skip-bad", "--json"], "b.asc", "whole.xyz"),
    (&["contour", "-", "-o", "OUT", "-i", "2", "--report", "R"], "a.wkt", "whole.xyz"),
    (&["grid", "-", "OUT", "--cell", "1", "--report", "R"], "c.tif", "whole.xyz"),
    (&["grid", "cloud:-", "OUT", "--cell", "1", "--report", "R"], "d.tif", "whole.xyz"),
    (&["tin", "cloud:-", "OUT", "--max-error", "1", "--report", "R"], "m.ply", "whole.xyz"),
    (&["grid", "-", "cloud:east.xyz", "OUT", "--cell", "1", "--report", "R"], "e.tif", "whole.xyz"),
    (&["line", "-", "OUT", "--tolerance", "1", "--report", "R"], "a.wkt", "lines.geojson"),
    (
        &["line", "-", "bad.geojson", "OUT", "--tolerance", "1", "--report", "R", "--skip-bad"],
        "b",
        "lines.geojson",
    ),
];

#[test]
fn what_comes_through_a_pipe_is_called_a_dash_everywhere() {
    let (place, xyz, lines) = streams();
    for (args, output, file) in READERS {
        let input = if file == "whole.xyz" { &xyz } else { &lines };
        let run = |again: &str, instead: Option<&str>| {
            std::fs::create_dir(place.path(again)).unwrap();
            let (out, report) = (format!("{again}/{output}"), format!("{again}/report.json"));
            let instead = |name: &str| match (name, instead) {
                ("-", Some(file)) => file.to_owned(),
                ("cloud:-", Some(file)) => format!("cloud:{file}"),
                ("OUT", _) => out.clone(),
                ("R", _) => report.clone(),
                _ => name.to_owned(),
            };
            let args: Vec<String> = args.iter().map(|name| instead(name)).collect();
            let ran = piped(
                &place,
                &args.iter().map(String::as_str).collect::<Vec<_>>(),
                input.as_bytes(),
            );
            assert_eq!(ran.code, 0, "{args:?}: {}", ran.err);
            // In a folder an output has the name of its input, and this one has none.
            let all = format!("{}{}", ran.out, ran.err).replace("b/stdin.geojson", "");
            assert!(!all.contains("stdin"), "{ran:?}");
            let read = |path: &std::path::Path| match path.is_dir() {
                true => std::fs::read_dir(path)
                    .unwrap()
                    .flatten()
                    .map(|e| std::fs::read(e.path()).unwrap())
                    .collect::<Vec<_>>()
                    .concat(),
                false => std::fs::read(path).unwrap(),
            };
            let told = match args.iter().any(|arg| arg == "--json") {
                true => ran.out.clone().into_bytes(),
                false => read(&place.path(&report)),
            };
            let bytes = read(&place.path(&out));
            std::fs::remove_dir_all(place.path(again)).unwrap();
            (bytes, settled(&told))
        };
        let (bytes, report) = run("run", None);
        assert_eq!((&bytes, &report), (&run("run", None).0, &run("run", None).1), "{args:?}");
        let named = report["inputs"][0].as_str().or(report["input"].as_str()).unwrap();
        assert!(
            named.starts_with('-') || named.ends_with(", -") || named.ends_with(" more"),
            "{named}"
        );
        let all = report.to_string().replace("b/stdin.geojson", "");
        assert!(!all.contains("stdin"), "{report}");
        let (from_file, _) = run("run", Some(file));
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).replace(file, "-");
        assert_eq!(text(&bytes), text(&from_file), "{args:?}: as from the file");
    }
}

#[test]
fn tiles_of_points_from_stdin_say_so() {
    let place = Place::new();
    let points: String = (0..400)
        .map(|i| format!("{} {} {}\n", 500_000 + i % 20, 4_750_000 + i / 20, i * 31 % 17))
        .collect();
    let args = ["tiles", "cloud:-", "t", "--ground", "pmf", "--crs", "EPSG:32631", "--json"];
    let args = [&args[..], &["--max-level", "4"]].concat();
    let ran = piped(&place, &args, points.as_bytes());
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(settled(ran.out.as_bytes())["input"], "-");
    let layer = settled(&place.bytes("t/layer.json"));
    assert_eq!(layer["terrane"]["source"], "-");
}

#[test]
fn errors_of_what_comes_through_a_pipe_name_a_dash() {
    let (place, ..) = streams();
    for args in [
        &["tin", "-", "out.ply", "--max-error", "0"][..],
        &["tin", "-", "nowhere.xyz", "bad.xyz", "out.ply", "--max-error", "0", "--skip-bad"],
        &["tin", "-", "bad.xyz", "out.ply", "--max-error", "0"],
        &["convert", "-", "out.tif"],
        &["contour", "-", "-o", "out.wkt", "-i", "2"],
        &["grid", "-", "out.tif", "--cell", "1"],
        &["grid", "-", "cloud:bad.xyz", "out.tif", "--cell", "1"],
        &["line", "-", "out.wkt", "--tolerance", "1", "--input-format", "GeoJSON"],
        &["line", "-", "bad.geojson", "out", "--tolerance", "1", "--input-format", "GeoJSON"],
    ] {
        let ran = piped(&place, args, b"1 2\n");
        assert!(ran.code == 65 && ran.err.contains("error: -: "), "{args:?}: {}", ran.err);
        assert!(!ran.err.contains("stdin"), "{args:?}: {}", ran.err);
    }
}

#[test]
fn contours_go_through_pipes() {
    let (place, xyz, _) = streams();
    let args = ["contour", "-", "-o", "-", "-f", "GeoJSON", "-i", "2", "--json"];
    let ran = piped(&place, &args, xyz.as_bytes());
    assert!(ran.code == 0 && ran.out.starts_with('{'), "{ran:?}");
    let report = settled(ran.err.as_bytes());
    assert_eq!((&report["input"], &report["output"]), (&"-".into(), &"-".into()));
}

/// Each of these is wrong in something else than its input.
#[test]
fn what_is_wrong_with_the_rest_is_told_before_stdin_is_read() {
    use std::process::Stdio;
    let (place, ..) = streams();
    place.write("there.ply", "x").write("there.tif", "x").write("there.wkt", "x");
    place.write("there.json", "x");
    for (args, word) in [
        (&["tin", "-", "there.ply", "--max-error", "0"][..], "exists"),
        (
            &["tin", "-", "a.ply", "--max-error", "0", "--workdir", "w"],
            "--workdir is not supported with stdin",
        ),
        (&["tin", "-", "a.xxx", "--max-error", "0"], "a.xxx"),
        (&["tin", "-", "a.ply", "--max-error", "0", "--co", "SOLID_BASE=1"], "SOLID_BASE"),
        (&["tin", "-", "a.ply", "--max-error", "0", "--report", "there.json"], "exists"),
        (&["tin", "-", "nowhere.xyz", "a.ply", "--max-error", "0"], "no such file"),
        (&["tin", "-", "a.ply", "--max-error", "0", "--temp-dir", "nowhere"], "error: nowhere: "),
        (&["convert", "-", "there.tif"], "exists"),
        (&["convert", "-", "a.tif", "-f", "COG", "--co", "NO=1"], "NO"),
        (&["contour", "-", "-o", "there.wkt", "-i", "2"], "exists"),
        (&["contour", "-", "-o", "-", "-f", "FlatGeobuf", "-i", "2"], "FlatGeobuf"),
        (&["grid", "-", "there.tif", "--cell", "1"], "exists"),
        (&["grid", "-", "a.tif", "--cell", "1", "--power", "2"], "--power"),
        (&["line", "-", "there.wkt", "--tolerance", "1"], "exists"),
        (&["line", "-", "a.xxx", "--tolerance", "1"], "a.xxx"),
        (&["line", "-", "a.wkt", "--area", "1"], "area"),
        (
            &["line", "-", "a.wkt", "--tolerance", "1", "--hierarchy", "h", "--method", "cone"],
            "--hierarchy",
        ),
        (&["line", "-", "a.wkt", "--tolerance", "1", "--input-format", "GPX"], "GPX"),
        (
            &["line", "-", "a.wkt", "--tolerance", "1", "--topology", "--sides", "nowhere.wkt"],
            "nowhere.wkt",
        ),
        (&["grid", "-", "a.tif", "--like", "nowhere.tif"], "nowhere.tif"),
        (&["line", "-", "lines.geojson", "there.wkt", "--tolerance", "1"], "is a file"),
    ] {
        let before = place.files();
        let mut command = place.command(args);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        // Open as long as it is held: who reads it waits.
        let stdin = child.stdin.take().unwrap();
        let patience = std::time::Instant::now();
        while child.try_wait().unwrap().is_none() {
            assert!(patience.elapsed().as_secs() < 60, "{args:?} waits for stdin");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        drop(stdin);
        let ran = cli_support::Ran::from(child.wait_with_output().unwrap());
        assert!(matches!(ran.code, 2 | 65 | 73) && ran.err.contains(word), "{args:?}: {}", ran.err);
        assert_eq!(place.files(), before, "{args:?}");
    }
}

#[cfg(unix)]
#[test]
fn stopped_while_stdin_is_read_nothing_is_left() {
    use std::io::Write;
    use std::process::{Command, Stdio};
    let (place, ..) = streams();
    std::fs::create_dir(place.path("temp")).unwrap();
    let args = ["tin", "-", "a.ply", "--max-error", "0", "--temp-dir", "temp"];
    let mut command = place.command(&args);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(b"0 0 1\n").unwrap();
    let count = || std::fs::read_dir(place.path("temp")).unwrap().count();
    while count() == 0 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
    let patience = std::time::Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(patience.elapsed().as_secs() < 60, "it waits for stdin");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    drop(stdin);
    let ran = cli_support::Ran::from(child.wait_with_output().unwrap());
    assert_eq!((ran.code, count()), (130, 0), "{}", ran.err);
    assert!(!place.path("a.ply").exists());
}

#[test]
fn what_cannot_go_through_a_pipe_is_refused_by_name() {
    let place = batch();
    for (args, word) in [
        (&["view", "g/a.asc", "-o", "-"][..], "-: "),
        (&["contour", "g/a.asc", "-o", "-", "-f", "FlatGeobuf", "-i", "2"], "FlatGeobuf cannot"),
        (&["line", "f/a.geojson", "-", "-f", "Shapefile", "--tolerance", "1"], "Shapefile cannot"),
        (&["line", "f/a.geojson", "-", "--tolerance", "1"], "extension matches no"),
        (&["line", "-", "-", "f/a.geojson", "--tolerance", "1"], "only once"),
        (
            &["line", "f/a.geojson", "a.wkt", "--tolerance", "1", "--input-format", "WKT"],
            "--input-format requires stdin",
        ),
        (&["info", "-"], "stdin is not supported"),
        (&["view", "-", "-o", "a.png"], "stdin is not supported"),
        (&["verify", "-", "g/a.asc"], "stdin is not supported"),
        (&["plan", "tin", "-", "-o", "w", "--max-error", "1"], "stdin is not supported"),
        (
            &["plan", "tin", "-", "g/a.asc", "-o", "w", "--max-error", "1", "--skip-bad"],
            "stdin is not",
        ),
        (&["plan", "grid", "-", "-o", "w", "--cell", "1"], "stdin is not supported"),
        (&["plan", "grid", "cloud:-", "-o", "w", "--cell", "1"], "stdin is not supported"),
        (&["verify", "g/a.asc", "-"], "stdin is not supported"),
    ] {
        place.fails(args, 2, &[word]);
    }
    let gpx = piped(
        &place,
        &["line", "-", "a.wkt", "--tolerance", "1", "--input-format", "GPX"],
        b"<gpx/>",
    );
    assert!(gpx.code == 2 && gpx.err.contains("GPX cannot be read through a pipe"), "{}", gpx.err);
}

/// Every verb with every option that names an output.
#[test]
fn nothing_is_ever_called_a_dash() {
    let place = batch();
    place.ok(&["tin", "g/a.asc", "m.ply", "--max-error", "1"]);
    place.ok(&["plan", "tin", "g/a.asc", "-o", "w", "--max-error", "1"]);
    place.ok(&["plan", "grid", "c/a.laz", "-o", "v", "--cell", "5"]);
    for args in [
        &["tin", "g/a.asc", "-", "--max-error", "1", "-f", "PLY"][..],
        &["tin", "g/a.asc", "-", "--max-error", "1", "--split", "1"],
        &["tin", "g/a.asc", "-", "--max-error", "1", "--split", "1", "--overwrite"],
        &["tin", "g/a.asc", "-", "--max-error", "1", "-f", "PLY", "--workdir", "u"],
        &["tin", "g/a.asc", "a.ply", "--max-error", "1", "--workdir", "-"],
        &["tin", "g/a.asc", "a.ply", "--max-error", "1", "--report", "-"],
        &["tin", "g/a.asc", "a.ply", "--max-error", "1", "--temp-dir", "-"],
        &["tin", "c/a.laz", "-", "--max-error", "1", "-f", "PLY"],
        &["tin", "c/a.laz", "a.ply", "--max-error", "1", "--report", "-"],
        &["verify", "m.ply", "g/a.asc", "--report", "-"],
        &["view", "g/a.asc", "-o", "-"],
        &["convert", "g/a.asc", "-", "-f", "GTiff"],
        &["grid", "c/a.laz", "-", "-f", "GTiff", "--cell", "5"],
        &["grid", "c/a.laz", "a.tif", "--cell", "5", "--report", "-"],
        &["contour", "g/a.asc", "-o", "a.wkt", "-i", "2", "--report", "-"],
        &["line", "f/a.geojson", "f/c.geojson", "-", "--tolerance", "1"],
        &["line", "f/a.geojson", "f/c.geojson", "-", "--tolerance", "1", "-f", "WKT"],
        &["line", "f/a.*", "-", "--tolerance", "1", "-f", "WKT"],
        &["line", "f/a.geojson", "a.wkt", "--tolerance", "1", "--report", "-"],
        &["line", "f/a.geojson", "a.wkt", "--tolerance", "1", "--hierarchy", "-"],
        &["synth", "rough,size=9", "-"],
        &["synth", "cloud,size=9", "-"],
        &["synth", "koch,vertices=9", "-"],
        &["plan", "tin", "g/a.asc", "-o", "-", "--max-error", "1"],
        &["plan", "grid", "c/a.laz", "-o", "-", "--cell", "5"],
        &["run", "w", "--output", "-"],
        &["run", "w", "--output", "-", "--split", "1"],
        &["finish", "w", "-"],
        &["run", "v", "--output", "-"],
        &["demo", "--dir", "-"],
        &["man", "-"],
    ] {
        let ran = place.run(args);
        assert!(matches!(ran.code, 2 | 69 | 73), "{args:?}: {} {}", ran.code, ran.err);
        assert!(ran.err.contains("-: "), "{args:?}: {}", ran.err);
        assert!(place.path("-").symlink_metadata().is_err(), "{args:?}");
    }
}
