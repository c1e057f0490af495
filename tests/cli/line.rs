//! `terrane line` from the command line, every output proved by `terrane verify`.

use std::fmt::Write;

use crate::cli_support::{Place, json};
use serde_json::Value;
use terrane_line::METHODS;
use terrane_line::registry::ToleranceKind;
use terrane_vector::FORMATS;

/// A wriggly coverage of `side` x `side` squares of 1 x 1, each with a hole in it: borders are shared.
fn coverage(side: usize) -> String {
    let wriggle =
        |x: f64, y: f64| ((x * 37.0 + y * 91.0).sin() * 0.03, (x * 53.0 - y * 29.0).cos() * 0.03);
    let at = |x: f64, y: f64| {
        let (dx, dy) =
            if x.fract() == 0.0 && y.fract() == 0.0 { (0.0, 0.0) } else { wriggle(x, y) };
        format!("[{},{}]", x + dx, y + dy)
    };
    let ring = |x: f64, y: f64, size: f64, steps: usize| {
        let mut corners = Vec::new();
        let step = |i: usize| size * i as f64 / steps as f64;
        (0..steps).for_each(|i| corners.push(at(x + step(i), y)));
        (0..steps).for_each(|i| corners.push(at(x + size, y + step(i))));
        (0..steps).for_each(|i| corners.push(at(x + size - step(i), y + size)));
        (0..steps).for_each(|i| corners.push(at(x, y + size - step(i))));
        corners.push(corners[0].clone());
        format!("[{}]", corners.join(","))
    };
    let mut text = String::from("{\"type\":\"FeatureCollection\",\"features\":[\n");
    for (i, (x, y)) in (0..side * side).map(|i| (i, ((i % side) as f64, (i / side) as f64))) {
        let (outer, hole) = (ring(x, y, 1.0, 64), ring(x + 0.3, y + 0.3, 0.4, 16));
        let comma = if i > 0 { "," } else { "" };
        writeln!(
            text,
            "{comma}{{\"type\":\"Feature\",\"id\":{i},\"properties\":{{\"name\":\"n{i}\",\"area\":1.5}},\
             \"geometry\":{{\"type\":\"Polygon\",\"coordinates\":[{outer},{hole}]}}}}"
        )
        .unwrap();
    }
    text + "]}\n"
}

#[test]
fn every_method_keeps_its_promises_on_a_coverage() {
    let place = Place::new();
    place.write("a.geojson", coverage(4));
    for method in METHODS {
        let goal = match method.bounds {
            ToleranceKind::Distance => ["--tolerance", "0.05"],
            ToleranceKind::Area(_) => ["--area", "0.002"],
        };
        for strategy in ["retroactive", "proactive"] {
            let base = ["line", "a.geojson", "b.geojson", "--method", method.name, "--overwrite"];
            let how = ["--topology", "--strategy", strategy, "--json"];
            let report = json(&place.ok(&[&base[..], &goal, &how].concat()).out);
            let (kept, all) =
                (report["kept"].as_u64().unwrap(), report["vertices"].as_u64().unwrap());
            assert!(kept * 4 < all, "{}: {kept} of {all}", method.name);
            let held = match method.bounds {
                ToleranceKind::Distance => &["--tolerance", "0.05"][..],
                ToleranceKind::Area(_) => &[],
            };
            let proof = ["verify", "b.geojson", "a.geojson", "--topology", "--json"];
            let proof = place.run(&[&proof[..], held].concat());
            // Where no distance is held to, none is judged.
            assert_eq!(proof.code, if held.is_empty() { 3 } else { 0 }, "{}", proof.out);
            let proof = json(&proof.out);
            assert_eq!(proof["passed"], true, "{proof}");
            let far = |report: &Value| report["largest_distance"].as_f64().unwrap();
            assert!((far(&proof) - far(&report)).abs() < 1e-9, "{} {strategy}", method.name);
        }
    }
}

#[test]
fn properties_and_ids_go_through_every_format() {
    let place = Place::new();
    place.write("a.geojson", coverage(2));
    let goal = ["--tolerance", "0.05", "--topology", "-q"];
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        let output = format!("b.{}", format.extensions[0]);
        let args = ["line", "a.geojson", &output, "--format", format.name];
        if format.name == "GPX"
            || !format.holds.kinds.contains(&terrane_vector::GeometryType::Polygon)
        {
            continue;
        }
        place.ok(&[&args[..], &goal].concat());
        let proof = ["verify", &output, "a.geojson", "--tolerance", "0.05", "--topology", "-q"];
        let proof = place.run(&proof);
        let is_whole = format.holds.values != terrane_vector::PropertySupport::None;
        assert_eq!(proof.code, if is_whole { 0 } else { 3 }, "{}: {}", format.name, proof.err);
        assert_eq!(proof.err.contains("not judged: properties of 4 features"), !is_whole);
        place.ok(&["line", &output, "c.geojson", "--tolerance", "0", "--overwrite", "-q"]);
        let back = json(&std::fs::read_to_string(place.path("c.geojson")).unwrap());
        assert_eq!(back["features"].as_array().unwrap().len(), 4, "{}", format.name);
        // In any order: some formats sort them.
        let features = back["features"].as_array().unwrap();
        let all = |of: &dyn Fn(&Value) -> Value| {
            let mut all: Vec<String> = features.iter().map(|f| of(f).to_string()).collect();
            all.sort();
            all.join(" ")
        };
        if format.holds.properties {
            let names = all(&|f| f["properties"]["name"].clone());
            assert_eq!(names, "\"n0\" \"n1\" \"n2\" \"n3\"", "{}", format.name);
        }
        if format.holds.ids {
            assert_eq!(all(&|f| f["id"].clone()), "0 1 2 3", "{}", format.name);
        }
    }
}

#[test]
fn borders_are_shared_across_files() {
    let place = Place::new();
    let text = coverage(2);
    let lines: Vec<&str> = text.lines().collect();
    let file = |features: &[&str]| {
        let features: Vec<_> = features.iter().map(|line| line.trim_start_matches(',')).collect();
        format!("{{\"type\":\"FeatureCollection\",\"features\":[{}]}}", features.join(","))
    };
    place.write("whole.geojson", file(&lines[1..5]));
    place.write("west.geojson", file(&[lines[1], lines[3]]));
    place.write("east.geojson", file(&[lines[2], lines[4]]));
    let goal = ["--tolerance", "0.05", "--topology", "-q"];
    place.ok(&[&["line", "whole.geojson", "w.geojson"], &goal[..]].concat());
    place.ok(&[&["line", "west.geojson", "east.geojson", "parts"], &goal[..]].concat());
    let read = |name: &str| {
        json(&std::fs::read_to_string(place.path(name)).unwrap())["features"]
            .as_array()
            .unwrap()
            .clone()
    };
    let (west, east, whole) =
        (read("parts/west.geojson"), read("parts/east.geojson"), read("w.geojson"));
    assert_eq!(vec![&west[0], &east[0], &west[1], &east[1]], whole.iter().collect::<Vec<_>>());
}

#[test]
fn threads_and_order_of_work_leave_no_trace() {
    let place = Place::new();
    place.write("a.geojson", coverage(5));
    let made = |output: &str, more: &[&str]| {
        let args = ["line", "a.geojson", output, "--tolerance", "0.04", "-q"];
        place.ok(&[&args, more].concat());
        std::fs::read(place.path(output)).unwrap()
    };
    assert!(made("1.geojson", &["--threads", "1"]) == made("2.geojson", &["--threads", "4"]));
    let small = ["--threads", "3", "--memory", "1M"];
    assert!(made("3.geojson", &small) == made("4.geojson", &[]));
    let topology = |output, threads| made(output, &["--topology", "--threads", threads]);
    assert!(topology("5.geojson", "1") == topology("6.geojson", "3"));
}

#[test]
fn numbers_and_sizes_are_met() {
    let place = Place::new();
    place.write("a.geojson", coverage(3));
    let kept = |output: &str, goal: &[&str]| {
        let args = ["line", "a.geojson", output, "--overwrite", "--json"];
        let report = json(&place.ok(&[&args, goal].concat()).out);
        (report["kept"].as_u64().unwrap(), report["output_bytes"].as_u64().unwrap())
    };
    let all = kept("b.geojson", &["--keep-ratio", "1"]).0;
    for method in METHODS.iter().map(|method| method.name) {
        let (some, _) = kept("b.geojson", &["--keep-ratio", "0.25", "--method", method]);
        assert!(some * 4 <= all && some * 5 > all, "{method}: {some} of {all}");
    }
    let (few, _) = kept("b.geojson", &["--keep-count", "300"]);
    assert!((250..=300).contains(&few), "{few}");
    let (_, bytes) = kept("b.geojson", &["--target-size", "20K"]);
    assert!((15_000..=20_480).contains(&bytes), "{bytes}");
    place.fails(
        &["line", "a.geojson", "c.geojson", "--keep-count", "3"],
        2,
        &["cannot be reached"],
    );
    assert!(!place.path("c.geojson").exists());
}

/// Bytes of all files that a run with an output called b left behind; they are taken away.
fn bytes_of_output(place: &Place) -> u64 {
    let files: Vec<_> = place.files().into_iter().filter(|name| name.starts_with("b.")).collect();
    let bytes = files.iter().map(|name| std::fs::metadata(place.path(name)).unwrap().len()).sum();
    files.iter().for_each(|name| std::fs::remove_file(place.path(name)).unwrap());
    bytes
}

/// Vertices of a file, counted as they are read.
fn vertices_of(place: &Place, name: &str) -> u64 {
    let mut source = terrane_vector::open(&place.path(name), &Default::default()).unwrap();
    let mut count = 0;
    while let Some(feature) = source.next().unwrap() {
        count += feature.geometry.vertices() as u64;
    }
    count
}

/// Asserts that a goal was met, and little of it left unused.
fn is_met(came: u64, goal: u64, name: &str) {
    assert!(came <= goal && came >= goal - goal / 50, "{name}: {came} of {goal}");
}

#[test]
fn goals_are_met_by_what_is_written() {
    let place = Place::new();
    place.ok(&["synth", "coverage,vertices=200,features=16", "a.fgb", "-q"]);
    let all = vertices_of(&place, "a.fgb");
    let ways: [&[&str]; 4] = [
        &[],
        &["--topology"],
        &["--topology", "--snap", "0.5"],
        &["--topology", "--collapse", "drop"],
    ];
    let formats: Vec<_> = FORMATS
        .iter()
        .filter(|format| format.create.is_some())
        .filter(|format| format.holds.kinds.contains(&terrane_vector::GeometryType::Polygon))
        .collect();
    assert!(formats.len() > 4);
    for method in METHODS {
        for way in ways {
            for (at, format) in formats.iter().enumerate() {
                let output = format!("b.{}", format.extensions[0]);
                let decimals: &[&str] =
                    if output.contains("json") { &["--decimals", "1"] } else { &[] };
                let run = |goal: [&str; 2]| {
                    let base = ["line", "a.fgb", &output, "--method", method.name, "-q"];
                    place.ok(&[&base[..], &goal, way, decimals].concat());
                };
                let name = format!("{} {way:?} {}", method.name, format.name);
                for goal in [27_000, 40_000] {
                    run(["--target-size", &goal.to_string()]);
                    is_met(bytes_of_output(&place), goal, &name);
                }
                if at == 0 {
                    run(["--keep-ratio", "0.4"]);
                    is_met(vertices_of(&place, &output), all * 2 / 5, &name);
                    bytes_of_output(&place);
                    run(["--keep-count", "700"]);
                    is_met(vertices_of(&place, &output), 700, &name);
                    bytes_of_output(&place);
                }
            }
        }
    }
}

#[test]
fn decimals_are_those_of_every_format() {
    let place = Place::new();
    // Far from each other, so that with topology, too, every vertex can be rounded.
    let line = |k: f64| {
        let (x, y) = (k * 0.077, k * 2.0);
        format!(
            "LINESTRING Z ({x} {} 7.449,1.23456 {} -0.04,9 {} {x})\n",
            y + 0.5167,
            y + x,
            y + 9.0
        )
    };
    place.write("a.wkt", (0..40).map(|k| line(f64::from(k))).collect::<String>());
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        for way in
            [&["--tolerance", "0"][..], &["--keep-ratio", "1"], &["--tolerance", "0", "--topology"]]
        {
            let output = format!("b.{}", format.extensions[0]);
            let base = ["line", "a.wkt", &output, "--decimals", "2", "-q", "--overwrite"];
            place.ok(&[&base[..], way].concat());
            let mut source =
                terrane_vector::open(&place.path(&output), &Default::default()).unwrap();
            let mut count = 0;
            while let Some(feature) = source.next().unwrap() {
                for part in feature.geometry.parts() {
                    let heights = part.z.iter().filter(|_| way.len() < 3);
                    for c in part.xy.as_flattened().iter().chain(heights) {
                        assert_eq!((c * 100.0).round() / 100.0, *c, "{output} {way:?}");
                        count += 1;
                    }
                }
            }
            assert!(count >= 240, "{output} {way:?}: {count}");
        }
    }
}

#[test]
fn a_ratio_of_one_keeps_everything() {
    let place = Place::new();
    // Vertices on their segments, twice in one place, and a ring without area.
    let all = "LINESTRING (0 0,1 0,1 0,2 0,9 0)\nPOLYGON ((0 1,4 1,8 1,8 9,8 9,0 9,0 1))\n\
               POLYGON ((20 0,21 0,20 0,20 0))\n";
    place.write("a.wkt", all);
    let text = |name: &str| std::fs::read_to_string(place.path(name)).unwrap();
    place.ok(&["line", "a.wkt", "b.wkt", "--tolerance", "0", "--method", "rdp", "-q"]);
    assert!(text("b.wkt") != all, "a tolerance of 0 leaves out what lies on its segment");
    for method in METHODS {
        for topology in [&[][..], &["--topology"], &["--topology", "--collapse", "drop"]] {
            for goal in [["--keep-ratio", "1"], ["--keep-count", "16"], ["--target-size", "1M"]] {
                let base = ["line", "a.wkt", "b.wkt", "--method", method.name, "--overwrite", "-q"];
                place.ok(&[&base[..], topology, &goal].concat());
                assert_eq!(text("b.wkt"), all, "{} {topology:?} {goal:?}", method.name);
            }
        }
    }
    assert_eq!(vertices_of(&place, "b.wkt"), 16);
}

#[test]
fn a_goal_that_cannot_be_met_is_refused_with_the_least_that_can() {
    let place = Place::new();
    place.ok(&["synth", "coverage,vertices=200,features=36", "a.fgb", "-q"]);
    for method in METHODS {
        for way in [&[][..], &["--topology"]] {
            for (option, output) in [("--keep-count", "b.fgb"), ("--target-size", "b.shp")] {
                let base = ["line", "a.fgb", output, "--method", method.name, "-q", option];
                let refused = [&base[..], &["50"], way].concat();
                place.fails(&refused, 2, &["cannot be reached", "50"]);
                let told = place.run(&refused).err;
                let least = told.split("; pass ").nth(1).unwrap().split(' ').next().unwrap();
                place.ok(&[&base[..], &[least], way].concat());
                let came = match option {
                    "--keep-count" => vertices_of(&place, output),
                    _ => bytes_of_output(&place),
                };
                assert_eq!(came.to_string(), least, "{} {way:?} {option}", method.name);
                bytes_of_output(&place);
            }
        }
    }
}

#[test]
fn metres_heights_rings_and_sides() {
    let place = Place::new();
    // A degree of longitude is 111 km at the equator and 56 km at 60 degrees.
    let line = |y: f64| format!("LINESTRING ({} {y}, {} {}, {} {y})\n", 5.0, 5.5, y + 0.01, 6.0);
    place.write(
        "a.geojson",
        "{\"type\":\"LineString\",\"coordinates\":[[5,60],[5.5,60.01],[6,60]]}",
    );
    let kept = |tolerance: &str| {
        let args =
            ["line", "a.geojson", "b.geojson", "--tolerance", tolerance, "--overwrite", "--json"];
        json(&place.ok(&args).out)["kept"].as_u64().unwrap()
    };
    assert_eq!((kept("1110m"), kept("1.12km")), (3, 2), "0.01 degrees of latitude are 1,114 m");
    place.write("a.wkt", line(0.0) + "LINESTRING Z (0 0 0, 5 0 3, 10 0 0)\n");
    place.fails(&["line", "a.wkt", "b.wkt", "--tolerance", "1m"], 2, &["plain number"]);
    place.fails(
        &["line", "a.wkt", "b.wkt", "--tolerance", "1", "--metric", "3d"],
        65,
        &["no height"],
    );
    place.write("z.wkt", "LINESTRING Z (0 0 0, 5 0 3, 10 0 0)\n");
    place.ok(&["line", "z.wkt", "z3.wkt", "--tolerance", "2", "--metric", "3d", "-q"]);
    place.ok(&["line", "z.wkt", "z2.wkt", "--tolerance", "2", "-q"]);
    let text = |name: &str| std::fs::read_to_string(place.path(name)).unwrap();
    assert!(text("z3.wkt").contains("5 0 3") && !text("z2.wkt").contains("5 0 3"));
    place.write(
        "r.wkt",
        "POLYGON ((0 0, 1 0, 1 1, 0.5 1.01, 0 1, 0 0))\nPOLYGON ((5 5, 90 5, 90 90, 5 5))\n",
    );
    for (collapse, has) in [("minimal", true), ("drop", false), ("keep", true)] {
        for topology in [&[][..], &["--topology"]] {
            let args = [
                "line",
                "r.wkt",
                "s.wkt",
                "--tolerance",
                "3",
                "--collapse",
                collapse,
                "--overwrite",
                "-q",
            ];
            place.ok(&[&args[..], topology].concat());
            let first = text("s.wkt").lines().next().unwrap().to_owned();
            assert_eq!(!first.contains("EMPTY"), has, "{collapse} {topology:?}: {first}");
            assert_eq!(first.contains("0.5 1.01"), collapse == "keep", "{collapse}: {first}");
        }
    }
    // What has no area to begin with stays as it was.
    place.write("f.wkt", "POLYGON ((0 0, 1 0, 0 0, 0 0))\nPOLYGON ((5 5, 5 5, 5 5, 5 5))\n");
    for topology in [&[][..], &["--topology"]] {
        let args = ["line", "f.wkt", "g.wkt", "--tolerance", "3", "--overwrite", "-q"];
        place.ok(&[&args[..], topology].concat());
        assert_eq!(text("g.wkt").matches("EMPTY").count(), 0, "{topology:?}");
    }
    place.write("l.wkt", "LINESTRING (0 0, 5 2, 10 0)\n");
    place.write("p.wkt", "POINT (5 1)\n");
    let line = ["line", "l.wkt", "m.wkt", "--tolerance", "3", "--topology", "--overwrite", "-q"];
    place.ok(&line);
    assert!(!text("m.wkt").contains("5 2"));
    let proof =
        ["verify", "m.wkt", "l.wkt", "--tolerance", "3", "--topology", "--sides", "p.wkt", "-q"];
    place.fails(&proof, 1, &["changed sides"]);
    place.ok(&[&line[..], &["--sides", "p.wkt"]].concat());
    assert!(text("m.wkt").contains("5 2"));
    place.ok(&proof);
}

#[test]
fn the_book_tells_of_every_method_and_format() {
    let methods = include_str!("../../docs/src/guide/line.md");
    for method in METHODS {
        assert!(methods.contains(&format!("| `{}` |", method.name)), "{}", method.name);
    }
    let formats = include_str!("../../docs/src/guide/formats.md");
    for format in FORMATS {
        assert!(formats.contains(&format!("| {} |", format.name)), "{}", format.name);
        for ending in format.extensions {
            assert!(formats.contains(&format!(".{ending}")), "{}: {ending}", format.name);
        }
    }
}

/// Zigzags that cross their neighbours.
fn zigzags(lines: u32, step: usize) -> String {
    let zigzag = |line: u32| {
        let at = |i: u32| {
            format!("{} {}", line * 3 % 1000 + i * 7 % 11, f64::from(i) + f64::from(line) / 7.0)
        };
        let vertices: Vec<String> = (0..=60).step_by(step).map(at).collect();
        format!("LINESTRING ({})\n", vertices.join(", "))
    };
    (0..lines).map(zigzag).collect()
}

/// Members of a report that depend on what a run may use.
const PASSING: [&str; 4] = ["memory_budget", "peak_memory", "threads", "wall_seconds"];

#[test]
fn a_proof_that_reads_its_files_repeatedly_finds_the_same() {
    let place = Place::new();
    place.write("a.wkt", zigzags(4000, 1));
    place.write("b.wkt", zigzags(4000, 2));
    let prove = |memory: &str, threads: &str| {
        let args = ["verify", "b.wkt", "a.wkt", "--tolerance", "20", "--topology", "--json"];
        let told = place.run(&[&args[..], &["--memory", memory, "--threads", threads]].concat());
        assert_eq!(told.code, 1, "{}", told.err);
        let mut report: serde_json::Value = serde_json::from_str(&told.out).unwrap();
        let own = report.as_object_mut().unwrap();
        own.retain(|key, _| !PASSING.contains(&key.as_str()));
        report
    };
    let whole = prove("1G", "1");
    assert!(whole["crossings"][2].as_u64().unwrap() > 1000 && whole["moved"].as_u64().unwrap() > 0);
    assert_eq!(prove("21M", "2"), whole);
    let small = ["verify", "b.wkt", "a.wkt", "--memory", "19M"];
    place.write("a.wkt", zigzags(1, 1).replace(")", &", 1 1".repeat(50_000)) + ")");
    place.write("b.wkt", "LINESTRING (0 0, 1 1)");
    place.fails(&small, 75, &["a.wkt", "feature", "--memory"]);
}

#[test]
fn broken_promises_and_bad_input_are_told() {
    let place = Place::new();
    place.write("a.wkt", "LINESTRING (0 0, 5 2, 10 0)\nLINESTRING (0 1, 10 1.5)\n");
    place.write("b.wkt", "LINESTRING (0 0, 10 0)\nLINESTRING (0 1, 10 1.5)\n");
    let told = place.run(&["verify", "b.wkt", "a.wkt", "--tolerance", "1"]);
    assert_eq!(told.code, 1);
    assert!(told.out.contains("vertices farther than the tolerance"), "{}", told.out);
    place.ok(&["verify", "b.wkt", "a.wkt", "--tolerance", "2"]);
    place.write("c.wkt", "LINESTRING (0 0, 4 2, 10 0)\nLINESTRING (0 1, 10 1.5)\n");
    let told = place.run(&["verify", "c.wkt", "a.wkt"]);
    assert!(told.code == 1 && told.out.contains("does not have"), "{}", told.out);
    place.write("d.wkt", "LINESTRING (0 0, 10 0)\n");
    let told = place.run(&["verify", "d.wkt", "a.wkt", "--tolerance", "2"]);
    assert!(
        told.code == 1 && told.out.contains("1 features of the original are missing"),
        "{}",
        told.out
    );
    let told = place.run(&["verify", "b.wkt", "a.wkt"]);
    assert!(told.code == 3 && told.out.contains("not judged"), "{}", told.out);
    for how in ["keep", "minimal"] {
        // Nothing is judged by these.
        let args = ["verify", "b.wkt", "a.wkt", "--tolerance", "2", "--collapse", how];
        place.fails(&args, 2, &[how, "drop"]);
    }
    place.write("n.geojson", "{\"type\":\"LineString\",\"coordinates\":[[0,0],[1e999,1]]}");
    place.fails(&["line", "n.geojson", "o.geojson", "--tolerance", "1"], 65, &["n.geojson"]);
    place.fails(&["line", "a.wkt", "a.wkt", "--tolerance", "1"], 2, &[]);
    place.fails(&["line", "a.wkt", "o.wkt"], 2, &["--tolerance"]);
    place.fails(&["line", "none.wkt", "o.wkt", "--tolerance", "1"], 65, &["none.wkt"]);
    let area = ["line", "a.wkt", "o.wkt", "--tolerance", "1", "--method", "visvalingam"];
    place.fails(&area, 2, &["does not bound the distance", "--area"]);
    place.fails(&["line", "a.wkt", "o.wkt", "--area", "1"], 2, &["uses distances"]);
    place.fails(&["line", "a.wkt", "o.wkt", "--tolerance", "1", "--snap", "1"], 2, &["--topology"]);
    place.write("big.geojson", coverage(8));
    let base = ["line", "big.geojson", "o.geojson", "--tolerance", "0.01", "--topology"];
    place.fails(&[&base[..], &["--memory", "1M"]].concat(), 75, &["big.geojson", "--memory"]);
    assert!(!place.path("o.geojson").exists());
    assert!(!place.path("o.wkt").exists());
}
