//! Reports on the ground: clouds whose classes or returns tell little, and classes that are to stay.

use std::fmt::Write;

use crate::cli_support::Place;

/// A point: where it lies, its class, the number of its return and the returns of its pulse.
type Echo = ([f64; 3], u8, [u8; 2]);

/// Points as text.
fn text(echoes: impl IntoIterator<Item = Echo>) -> String {
    let mut text = "x y z class return returns\n".to_owned();
    for ([x, y, z], class, [number, returns]) in echoes {
        writeln!(text, "{x:.2} {y:.2} {z:.3} {class} {number} {returns}").unwrap();
    }
    text
}

const SIDE: usize = 48;

/// Height of a slope, in metres.
fn slope(x: f64, y: f64) -> f64 {
    10.0 + 0.05 * x - 0.02 * y
}

fn is_roof(x: f64, y: f64) -> bool {
    (20.0..30.0).contains(&x) && (12.0..24.0).contains(&y)
}

/// A slope with a house, one return each metre.
fn places() -> impl Iterator<Item = [f64; 3]> {
    (0..SIDE * SIDE).map(|k| {
        let (x, y) = ((k % SIDE) as f64 + 0.5, (k / SIDE) as f64 + 0.5);
        [x, y, slope(x, y) + if is_roof(x, y) { 6.0 } else { 0.0 }]
    })
}

/// The classes of points, by the order of these.
fn classes(csv: &str) -> Vec<u8> {
    let mut lines = csv.lines();
    let split = |line: &str| line.split([',', ' ']).map(str::to_owned).collect::<Vec<_>>();
    let heading = split(lines.next().unwrap());
    let column = heading.iter().position(|name| name == "classification").unwrap();
    lines.map(|line| split(line)[column].parse().unwrap()).collect()
}

/// A folder of the files of a coast: two tiles with ground and water, one of water alone, one of buildings, trees and
/// key points, and one without points.
fn coast() -> Place {
    let place = Place::new();
    std::fs::create_dir(place.path("coast")).unwrap();
    let tile = |west: f64, class: fn(usize) -> u8| {
        let one = move |(k, [x, y, z]): (usize, [f64; 3])| ([x + west, y, z], class(k), [1, 1]);
        text(places().enumerate().map(one))
    };
    let ground: fn(usize) -> u8 = |k| if k % 5 == 0 { 9 } else { 2 };
    for (name, west, class) in [
        ("a", 0.0, ground),
        ("b", 48.0, ground),
        ("c", 96.0, |_| 9),
        ("d", 144.0, |k| [6, 1, 8][k % 3]),
    ] {
        place.write("tile.xyz", tile(west, class));
        let name = format!("coast/{name}.laz");
        place.ok(&["points", "cloud:tile.xyz", &name, "--crs", "EPSG:28992", "-q"]);
    }
    let empty = ["points", "coast/a.laz", "coast/e.las", "--class", "30", "-q"];
    place.ok(&empty);
    place
}

#[test]
fn b6_tiles_without_class_2_leave_the_others_their_classes() {
    let place = coast();
    let dtm = ["grid", "coast", "dtm.asc", "--dtm", "--cell", "0.5", "--bbox", "0,0,192,48"];
    let told = place.ok(&dtm).out;
    let count = 2 * (0..SIDE * SIDE).filter(|k| k % 5 > 0).count();
    assert!(told.contains(&format!("ground: {count} points of class 2")), "{told}");
    let grid = String::from_utf8(place.bytes("dtm.asc")).unwrap();
    let rows = grid.lines().filter(|line| line.split_whitespace().count() == 384);
    let mut known = 0;
    for (row, line) in rows.enumerate() {
        for (col, value) in line.split_whitespace().enumerate() {
            let value: f64 = value.parse().unwrap();
            let (x, y) = (col as f64 * 0.5 % 48.0 + 0.25, 47.75 - row as f64 * 0.5);
            let is_plain = !is_roof(x, y) && (1.0..47.0).contains(&x);
            if value != -9999.0 {
                assert!(col < 192, "ground beyond its points: {row} {col} {value}");
                known += 1;
                // The edge between the tiles is a step.
                assert!(!is_plain || (value - slope(x, y)).abs() < 6.1, "{row} {col} {value}");
            }
        }
    }
    assert!(known > 188 * 94, "{known}");
    place.ok(&[&["plan", "grid", "coast", "-o", "work", "--tile", "256"], &dtm[3..]].concat());
    place.ok(&["run", "work", "-q"]);
    place.ok(&["finish", "work", "planned.tif", "-q"]);
    place.ok(&[&["grid", "coast", "whole.tif"], &dtm[3..]].concat());
    assert!(place.bytes("planned.tif") == place.bytes("whole.tif"));
}

#[test]
fn classes_of_other_things_than_ground_and_plants_are_kept_unless_named() {
    let place = Place::new();
    let all = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 17, 18, 26, 40, 200];
    let class = |k: usize| all[k * 7 % all.len()];
    place.write("in.xyz", text(places().enumerate().map(|(k, p)| (p, class(k), [1, 1]))));
    for (way, named) in [
        ("ground", &[][..]),
        ("ground:reclassify=9", &[9]),
        ("ground:reclassify=17,9,26,3", &[9, 17, 26]),
        ("ground:reclassify=200, 40", &[40, 200]),
    ] {
        for ground in ["auto", "csf", "ptd", "smrf", "pmf"] {
            let asked = ["points", "cloud:in.xyz", "out.csv", "--overwrite", "--classify", way];
            let told = place.ok(&[&asked[..], &["--ground", ground]].concat()).out;
            let found = classes(&String::from_utf8(place.bytes("out.csv")).unwrap());
            let (mut became, mut kept) = ([0_u64; 256], [0_u64; 256]);
            for (k, ([x, y, _], found)) in places().zip(found).enumerate() {
                let before = class(k);
                let may_change = before <= 5 || named.contains(&before);
                let expected = match before {
                    _ if may_change && !is_roof(x, y) => 2,
                    2 => 1,
                    other => other,
                };
                assert_eq!(found, expected, "{way} {ground}: class {before} at {x} {y}");
                became[usize::from(before)] += u64::from(may_change && !is_roof(x, y));
                kept[usize::from(before)] += u64::from(!may_change);
            }
            for class in all {
                let [became, kept] = [became, kept].map(|counts| counts[usize::from(class)]);
                let is_told = |count| told.contains(&format!("{count} of class {class}"));
                let is_noise = [7, 18].contains(&class);
                assert!(became == 0 || is_told(became), "{way}: {became} of {class}: {told}");
                assert!(kept == 0 || is_noise || is_told(kept), "{way}: {kept} of {class}: {told}");
            }
            assert!(told.contains("ground:reclassify=CLASS"), "{told}");
        }
    }
    let refused = |way: &str, words: &[&str]| {
        place.fails(&["points", "cloud:in.xyz", "no.csv", "--classify", way], 2, words);
    };
    refused("ground:reclassify=7", &["class 7", "noise"]);
    refused("ground:reclassify=water", &["water"]);
    refused("ground:9", &["reclassify=CLASS"]);
    place.write("water.xyz", text(places().map(|p| (p, 9, [1, 1]))));
    let water = ["points", "cloud:water.xyz", "no.csv", "--classify", "ground"];
    place.fails(&water, 65, &["may reclassify", "ground:reclassify="]);
}

#[test]
fn returns_whose_numbers_tell_nothing_are_all_looked_at() {
    let place = Place::new();
    // Each place is measured twice, so a filter of returns that does not act halves nothing silently.
    let numbered =
        |pattern: fn(usize) -> [u8; 2]| text(places().enumerate().map(|(k, p)| (p, 0, pattern(k))));
    place.write("plain.xyz", numbered(|_| [1, 1]));
    let grid = |name: &str, more: &[&str]| {
        let cloud = format!("cloud:{name}.xyz");
        let asked = ["grid", &cloud, "out.tif", "--dtm", "--cell", "0.125", "--overwrite"];
        let told = place.ok(&[&asked, more].concat()).out;
        (told, place.bytes("out.tif"))
    };
    let classify = |name: &str| {
        let cloud = format!("cloud:{name}.xyz");
        let asked = ["points", &cloud, "out.csv", "--overwrite", "--classify", "ground"];
        place.ok(&[&asked[..], &["--ground", "pmf"]].concat());
        classes(&String::from_utf8(place.bytes("out.csv")).unwrap())
    };
    let pmf = ["--ground", "pmf"];
    let (expected, classified) = (grid("plain", &pmf).1, classify("plain"));
    for (name, pattern) in [
        ("zero", (|_| [0, 0]) as fn(usize) -> [u8; 2]),
        ("none_of_one", |_| [0, 1]),
        ("none_of_some", |k| [0, 1 + (k % 3) as u8]),
        ("one_of_none", |_| [1, 0]),
        ("one_of_two", |_| [1, 2]),
        ("one_of_some", |k| [1, 1 + (k % 4) as u8]),
    ] {
        place.write(&format!("{name}.xyz"), numbered(pattern));
        assert!(grid(name, &pmf).1 == expected, "{name}");
        assert_eq!(classify(name), classified, "{name}");
        let plan = ["plan", "grid", &format!("cloud:{name}.xyz"), "-o", name, "--tile", "256"];
        place.ok(&[&plan[..], &["--dtm", "--cell", "0.125", "-q"], &pmf].concat());
        place.ok(&["run", name, "-q"]);
        place.ok(&["finish", name, "planned.tif", "-q", "--overwrite"]);
        assert!(place.bytes("planned.tif") == expected, "{name}");
    }
    // Numbers that tell are heeded: first returns of two in the air above each place.
    let twice = places().enumerate().flat_map(|(k, [x, y, z])| {
        let above = [x, y, z + 3.0 + (k % 7) as f64];
        [(above, 0, [1, 2]), ([x, y, z], 0, [2, 2])]
    });
    place.write("twice.xyz", text(twice));
    let (told, found) = grid("twice", &pmf);
    assert!(found == expected && told.contains("of 2304 last returns"), "{told}");
}

#[test]
fn returns_of_any_number_on_the_ground_are_ground() {
    let place = Place::new();
    // Beside each last return an earlier one, half of them on the ground.
    let two = places().enumerate().flat_map(|(k, [x, y, z])| {
        let first = [x + 0.3, y + 0.2, z + if k % 2 == 0 { 0.01 } else { 4.0 }];
        [(first, 1, [1, 2]), ([x, y, z], 1, [2, 2])]
    });
    place.write("in.xyz", text(two));
    for ground in ["auto", "csf", "ptd", "smrf", "pmf"] {
        let asked = ["points", "cloud:in.xyz", "out.csv", "--overwrite", "--classify", "ground"];
        place.ok(&[&asked[..], &["--ground", ground, "-q"]].concat());
        let found = classes(&String::from_utf8(place.bytes("out.csv")).unwrap());
        for (k, [x, y, _]) in places().enumerate() {
            let beside_roof = is_roof(x, y) || is_roof(x - 1.0, y) || is_roof(x + 1.0, y);
            let expected = [if k % 2 == 0 { 2 } else { 1 }, 2];
            assert!(beside_roof || found[2 * k..][..2] == expected, "{ground} {x} {y}");
        }
    }
}
