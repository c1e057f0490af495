//! `terrane line --hierarchy`: what a stored hierarchy gives is what the method gives, and a file that does
//! not fit, or is none, is turned away.

use std::fmt::Write;

use crate::cli_support::Place;
use serde_json::Value;

/// A walk of `count` vertices from (x, y), with heights, in GeoJSON; the last is the first when `closed`.
fn walk(seed: u64, count: usize, closed: bool) -> String {
    let noise = |i: usize| {
        let mut v = (seed << 32 | i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        v = (v ^ (v >> 31)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (v >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let turn = std::f64::consts::TAU / count as f64;
    let mut all = Vec::new();
    for i in 0..count {
        let (angle, radius) = (turn * i as f64, 1.0 + 0.2 * noise(2 * i));
        let (x, y) = match closed {
            true => (radius * angle.cos(), radius * angle.sin()),
            false => (i as f64 * 0.01, noise(2 * i)),
        };
        let [x, y] = [x + seed as f64 * 3.0, y].map(|c| (c * 1e5).round() / 1e5);
        all.push(format!("[{x},{y},{}]", (noise(2 * i + 1) * 100.0).round()));
    }
    if closed {
        all.push(all[0].clone());
    }
    format!("[{}]", all.join(","))
}

/// Features of every kind: long and short, closed lines, holes, rings without area, nothing at all.
fn features() -> Vec<String> {
    let of = |kind: &str, coordinates: String| {
        format!("{{\"type\":\"{kind}\",\"coordinates\":{coordinates}}}")
    };
    let mut all = vec![
        of("LineString", walk(1, 700, false)),
        of("LineString", walk(2, 300, true)),
        of("LineString", "[[0,0,1],[1,1,1]]".to_owned()),
        of("Polygon", format!("[{},{}]", walk(3, 500, true), walk(4, 9, true))),
        of("Point", "[5,6,7]".to_owned()),
        of("MultiPolygon", format!("[[{}],[{}]]", walk(5, 400, true), walk(6, 3, true))),
        of("Polygon", "[[[0,0,0],[1,0,0],[0,0,0],[0,0,0]]]".to_owned()),
        of("MultiLineString", format!("[{},{}]", walk(7, 2, false), walk(8, 90, true))),
        of("MultiPoint", "[[1,2,3],[4,5,6]]".to_owned()),
        "null".to_owned(),
    ];
    let members = [&all[0], &all[3], &all[4]].map(String::as_str).join(",");
    all.push(format!("{{\"type\":\"GeometryCollection\",\"geometries\":[{members}]}}"));
    all.extend((10..60).map(|seed| of("Polygon", format!("[{}]", walk(seed, 40, true)))));
    all
}

fn collection(geometries: &[String]) -> String {
    let mut text = String::from("{\"type\":\"FeatureCollection\",\"features\":[\n");
    for (i, geometry) in geometries.iter().enumerate() {
        let comma = if i > 0 { "," } else { "" };
        let head = format!("{comma}{{\"type\":\"Feature\",\"id\":{i},\"properties\":{{\"n\":{i}}}");
        writeln!(text, "{head},\"geometry\":{geometry}}}").unwrap();
    }
    text + "]}\n"
}

/// A place with all kinds of features in `a.geojson`.
fn place() -> Place {
    let place = Place::new();
    place.write("a.geojson", collection(&features()));
    place
}

/// Runs on `a.geojson` into `output`, and gives the bytes and the report.
fn line(place: &Place, output: &str, more: &[&str]) -> (Vec<u8>, Value) {
    let base = ["line", "a.geojson", output, "--overwrite", "--json"];
    let report = place.ok(&[&base, more].concat()).out;
    (std::fs::read(place.path(output)).unwrap(), serde_json::from_str(&report).unwrap())
}

/// True when a goal that cannot be met is refused with and without a hierarchy.
fn is_beyond(place: &Place, goal: &[&str], hierarchy: &str) -> bool {
    let base = ["line", "a.geojson", "d.geojson", "--overwrite"];
    let [direct, stored] = [["--method", "rdp"], ["--hierarchy", hierarchy]]
        .map(|how| place.run(&[&base[..], goal, &how].concat()));
    assert_eq!(direct.code, stored.code, "{goal:?}: {}{}", direct.err, stored.err);
    assert!(direct.code == 0 || direct.err == stored.err, "{}{}", direct.err, stored.err);
    direct.code != 0
}

#[test]
fn a_stored_hierarchy_gives_what_the_method_gives() {
    let place = place();
    let goals = [
        ["--tolerance", "0.05"],
        ["--tolerance", "0"],
        ["--tolerance", "0.3"],
        ["--tolerance", "1.1"],
        ["--tolerance", "100"],
        ["--keep-ratio", "0.1"],
        ["--keep-ratio", "0.6"],
        ["--keep-ratio", "1"],
        ["--keep-count", "700"],
        ["--keep-count", "3000"],
        ["--target-size", "90K"],
    ];
    for (name, metric) in [("plane.h", &[][..]), ("space.h", &["--metric", "3d"])] {
        for goal in goals {
            for collapse in ["minimal", "drop", "keep"] {
                let how = [&goal[..], metric, &["--collapse", collapse]].concat();
                if goal[0] != "--tolerance" && is_beyond(&place, &how, name) {
                    continue;
                }
                let direct = line(&place, "b.geojson", &[&how[..], &["--method", "rdp"]].concat());
                let stored =
                    line(&place, "c.geojson", &[&how[..], &["--hierarchy", name]].concat());
                assert!(direct.0 == stored.0, "{name} {how:?}");
                for fact in ["kept", "vertices", "collapsed", "largest_distance", "threshold"] {
                    assert_eq!(direct.1[fact], stored.1[fact], "{fact}: {name} {how:?}");
                }
                let is_first = goal == goals[0] && collapse == "minimal";
                assert_eq!(stored.1["hierarchy"]["made"], is_first, "{name} {how:?}");
            }
        }
    }
    for metres in ["1km", "20km"] {
        let direct = line(&place, "b.geojson", &["--tolerance", metres, "--method", "rdp"]);
        let stored = line(&place, "c.geojson", &["--tolerance", metres, "--hierarchy", "m.h"]);
        assert!(direct.0 == stored.0, "{metres}");
    }
}

#[test]
fn hierarchies_are_the_same_however_they_are_made() {
    let place = place();
    let made = |name: &str, more: &[&str]| {
        line(&place, "b.geojson", &[&["--hierarchy", name], more].concat());
        std::fs::read(place.path(name)).unwrap()
    };
    let first = made("1.h", &["--tolerance", "0.1", "--threads", "1"]);
    let small = ["--tolerance", "7", "--threads", "3", "--memory", "13M"];
    assert!(first == made("2.h", &small));
    assert!(first == made("3.h", &["--keep-ratio", "0.5", "--threads", "2"]));
    assert!(first == made("1.h", &["--keep-ratio", "0.5"]), "asking changes nothing");
    // Properties and formats do not matter, coordinates do.
    place.ok(&["line", "a.geojson", "a.fgb", "--tolerance", "0", "-q"]);
    let lines: Vec<String> = features().into_iter().take(1).collect();
    place.write("one.geojson", collection(&lines));
    place.write("one.csv", {
        let rows = walk(1, 700, false).replace("],[", "\n");
        format!("x,y,z\n{}\n", rows.trim_matches(['[', ']']))
    });
    let goal = ["--tolerance", "0.1", "--hierarchy", "one.h", "-q"];
    place.ok(&[&["line", "one.geojson", "one.b.geojson"], &goal[..]].concat());
    place.ok(&[&["line", "one.csv", "two.b.geojson"], &goal[..]].concat());
}

#[test]
fn several_files_have_one_hierarchy() {
    let place = Place::new();
    let all = features();
    place.write("a.geojson", collection(&all[..20])).write("b.geojson", collection(&all[20..]));
    let run = |output: &str, more: &[&str]| {
        let base = ["line", "a.geojson", "b.geojson", output, "--overwrite", "-q"];
        place.ok(&[&base, more].concat());
        let read = |name: &str| std::fs::read(place.path(output).join(name)).unwrap();
        [read("a.geojson"), read("b.geojson")]
    };
    for goal in [["--tolerance", "0.1"], ["--tolerance", "0.2"], ["--keep-count", "900"]] {
        let direct = run("direct", &[&goal[..], &["--method", "rdp"]].concat());
        assert!(direct == run("stored", &[&goal[..], &["--hierarchy", "h"]].concat()), "{goal:?}");
    }
    let turned = ["line", "b.geojson", "a.geojson", "c", "--tolerance", "1", "--hierarchy", "h"];
    let ran = place.run(&turned);
    assert!(ran.code == 65 && ran.err.contains("--hierarchy"), "{}", ran.err);
    assert!(!place.path("c/b.geojson").exists());
    let one = ["line", "a.geojson", "c.geojson", "--tolerance", "1", "--hierarchy", "h"];
    place.fails(&one, 65, &["more features than the input"]);
}

#[test]
fn hierarchies_of_other_lines_are_turned_away() {
    let place = place();
    line(&place, "b.geojson", &["--tolerance", "1", "--hierarchy", "h"]);
    let run = ["line", "x.geojson", "c.geojson", "--hierarchy", "h", "--tolerance"];
    let goal = |tolerance| [&run[..], &[tolerance]].concat();
    let all = features();
    let text = collection(&all);
    // The last digit of one coordinate of one feature.
    let at = text.find("\"id\":30").unwrap()
        + text[text.find("\"id\":30").unwrap()..].find("[[[").unwrap();
    let digit = at + text[at..].find(',').unwrap() - 1;
    let other = if &text[digit..=digit] == "1" { "2" } else { "1" };
    place.write("x.geojson", format!("{}{other}{}", &text[..digit], &text[digit + 1..]));
    place.fails(&goal("1"), 65, &["to other coordinates", "feature 31", "x.geojson", "delete"]);
    place.write("x.geojson", collection(&all[..40]));
    place.fails(&goal("1"), 65, &["more features than the input"]);
    place.fails(&[&run[..5], &["--keep-count", "900"]].concat(), 65, &["more features"]);
    place.write("x.geojson", collection(&[&all[..], &all[..1]].concat()));
    place.fails(&goal("1"), 65, &["fewer features than the input"]);
    let mut shuffled = all.clone();
    shuffled.swap(3, 12);
    place.write("x.geojson", collection(&shuffled));
    place.fails(&goal("1"), 65, &["delete"]);
    // Other properties are no other lines.
    place.write("x.geojson", text.replace("\"n\":", "\"name\":"));
    place.ok(&[&goal("1")[..], &["-q", "--overwrite"]].concat());
    place.fails(&[&goal("1km")[..], &["--overwrite"]].concat(), 2, &["in x and y", "ellipsoid"]);
    let space = [&goal("1")[..], &["--overwrite", "--metric", "3d"]].concat();
    place.fails(&space, 2, &["x, y and z", "another --hierarchy"]);
    let cone = [&goal("1")[..], &["--overwrite", "--method", "cone"]].concat();
    place.fails(&cone, 2, &["cone", "--method rdp"]);
    assert_eq!(place.run(&[&goal("1")[..], &["--topology"]].concat()).code, 2);
    place.fails(
        &["line", "x.geojson", "d.geojson", "--tolerance", "1", "--hierarchy", "d.geojson"],
        2,
        &[],
    );
    place.fails(
        &["line", "x.geojson", "d.geojson", "--tolerance", "1", "--hierarchy", "no/h"],
        73,
        &["no/h"],
    );
    place.write("n", "no hierarchy at all").write("e", "");
    for name in ["n", "e", "x.geojson"] {
        let bad = ["line", "a.geojson", "d.geojson", "--tolerance", "1", "--hierarchy", name];
        place.fails(&bad, 65, &[name]);
    }
}

#[test]
fn nothing_appears_that_is_not_whole() {
    let place = place();
    let mut text = collection(&features());
    text.truncate(text.len() - 40);
    place.write("cut.geojson", text);
    for goal in [["--tolerance", "1"], ["--keep-ratio", "0.5"]] {
        let run = ["line", "cut.geojson", "b.geojson", "--hierarchy", "h"];
        place.fails(&[&run[..], &goal].concat(), 65, &["cut.geojson"]);
    }
    line(&place, "b.geojson", &["--tolerance", "1", "--hierarchy", "h"]);
    let whole = std::fs::read(place.path("h")).unwrap();
    // Cut short, or a byte changed: an error, or what the method gives (a link between equal distances).
    let ends = [0, 7, 31, 63, 64, 100, whole.len() / 2, whole.len() - 1];
    let damaged = ends.iter().map(|end| whole[..*end].to_vec());
    let changed = (0..whole.len()).step_by(whole.len() / 40 + 1).chain(0..80).map(|at| {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x15;
        bytes
    });
    for bytes in damaged.chain(changed).chain([[&whole[..], &[0]].concat()]) {
        place.write("h", &bytes);
        let run = ["line", "a.geojson", "c.geojson", "--tolerance", "0.3", "--hierarchy", "h"];
        place.fails(&run, 65, &[]);
    }
}
