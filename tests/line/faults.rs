//! The proof of lines: planted faults are found in every format, and what `terrane line` makes passes.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use terrane::ErrorKind;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_line::METHODS;
use terrane_line::registry::ToleranceKind;
use terrane_line::topology::{RingCollapse, Strategy};
use terrane_simplify::{Length, LineGoal, LineJob, Topology, run};
use terrane_vector::{FORMATS, VectorFormat};
use terrane_verify::{LineVerifyJob, LineVerifyReport, verify_lines};

/// Numbers that look random, and are the same each time.
struct Dice(u64);

impl Dice {
    fn below(&mut self, count: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (self.0 >> 33) % count
    }

    fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }

    fn of<T: Clone>(&mut self, some: &[T]) -> T {
        some[self.below(some.len() as u64) as usize].clone()
    }
}

fn length(value: f64) -> Length {
    Length { value, unit: None }
}

fn resources() -> Resources {
    Resources { threads: 1, memory: 1 << 30, temp_dir: None }
}

fn write(path: &Path, features: &[Value]) {
    let all = json!({"type": "FeatureCollection", "features": features});
    std::fs::write(path, all.to_string()).unwrap();
}

/// The features of a GeoJSON as a file of another format.
fn convert(from: &Path, to: &Path) -> bool {
    let goal = LineGoal::Tolerance(length(0.0));
    let job = LineJob { overwrite: true, ..LineJob::new(from, to, goal) };
    let job = LineJob { resources: resources(), ..job };
    run(&job, &Silent, &Cancel::default()).is_ok()
}

fn proof(lines: PathBuf, original: PathBuf, tolerance: Option<f64>) -> LineVerifyJob {
    LineVerifyJob {
        lines,
        original,
        layer: None,
        tolerance: tolerance.map(length),
        is_space: false,
        topology: false,
        may_drop: false,
        sides: None,
        resources: resources(),
    }
}

fn prove(job: &LineVerifyJob) -> LineVerifyReport {
    verify_lines(job, &Silent, &Cancel::default()).unwrap()
}

/// A ring of twenty vertices around a place, with heights.
fn ring(x: f64, radius: f64, turn: f64) -> Value {
    let corner = |i: usize| {
        let angle = turn * (i % 20) as f64 * std::f64::consts::TAU / 20.0;
        json!([x + radius * angle.cos(), 10.0 + radius * angle.sin(), 3.0 + (i % 20) as f64])
    };
    (0..=20).map(corner).collect()
}

/// Four features of a kind of geometry, each of two parts (or several points), with heights.
fn features(kind: &str) -> Vec<Value> {
    let coordinates = |x: f64| match kind {
        "MultiPolygon" => {
            json!([[ring(x, 5.0, 1.0), ring(x, 2.0, -1.0)], [ring(x + 200.0, 5.0, 1.0)]])
        }
        "MultiLineString" => {
            let line = |y: f64| -> Value {
                (0..10).map(|i| json!([x + f64::from(i), y + f64::from(i * i % 5), i])).collect()
            };
            json!([line(0.0), line(20.0)])
        }
        _ => (0..3).map(|i| json!([x + f64::from(i), f64::from(i), i])).collect(),
    };
    let feature = |i: u32| {
        json!({
            "type": "Feature",
            "id": i,
            "properties": {
                "name": format!("n{i}"), "population_total": i * 10,
                "population_today": i * 10 + 1, "area": 1.5 + f64::from(i),
            },
            "geometry": {"type": kind, "coordinates": coordinates(20.0 * f64::from(i))},
        })
    };
    (0..4).map(feature).collect()
}

/// The first vertex of the last part.
fn vertex(feature: &mut Value) -> &mut Value {
    let mut at = &mut feature["geometry"]["coordinates"];
    while at[0].is_array() {
        let last = at.as_array().unwrap().len() - 1;
        let is_vertex = at[0][0].is_number();
        at = if is_vertex { &mut at[1] } else { &mut at[last] };
    }
    at
}

fn without_heights(coordinates: &mut Value) {
    match coordinates[0].is_array() {
        true => coordinates.as_array_mut().unwrap().iter_mut().for_each(without_heights),
        false => _ = coordinates.as_array_mut().unwrap().pop(),
    }
}

type Plant = fn(&mut Vec<Value>);

/// What is wrong, how it is done, and whether it is about properties.
const FAULTS: &[(&str, Plant, bool)] = &[
    ("nothing", |_| {}, false),
    ("a feature is gone", |all| _ = all.remove(2), false),
    ("a feature is there twice", |all| all.push(all[0].clone()), false),
    ("a feature is emptied", |all| all[2]["geometry"]["coordinates"] = json!([]), false),
    (
        "a part is gone",
        |all| _ = all[1]["geometry"]["coordinates"].as_array_mut().unwrap().remove(1),
        false,
    ),
    (
        "a hole is gone",
        |all| _ = all[1]["geometry"]["coordinates"][0].as_array_mut().unwrap().pop(),
        false,
    ),
    (
        "geometries are swapped",
        |all| {
            let one = all[0]["geometry"].take();
            all[0]["geometry"] = std::mem::replace(&mut all[3]["geometry"], one);
        },
        false,
    ),
    ("a vertex is moved", |all| vertex(&mut all[1])[0] = json!(0.125), false),
    ("a height is another", |all| vertex(&mut all[1])[2] = json!(99.5), false),
    (
        "heights of a feature are gone",
        |all| without_heights(&mut all[1]["geometry"]["coordinates"]),
        false,
    ),
    ("a number is another", |all| all[1]["properties"]["area"] = json!(2.25), true),
    ("a text is another", |all| all[1]["properties"]["name"] = json!("n2"), true),
    ("a text is a number", |all| all[1]["properties"]["name"] = json!(7), true),
    ("a value is gone", |all| all[1]["properties"]["area"] = json!(null), true),
    (
        "a cut name's value is another",
        |all| all[1]["properties"]["population_today"] = json!(9),
        true,
    ),
    ("an id is another", |all| all[1]["id"] = json!(77), true),
    (
        "a name is another",
        |all| {
            for feature in all {
                let name = feature["properties"]["name"].take();
                feature["properties"].as_object_mut().unwrap().remove("name");
                feature["properties"]["title"] = name;
            }
        },
        true,
    ),
];

/// Formats that can be written and hold a kind of geometry.
fn holding(kind: &str) -> impl Iterator<Item = &'static VectorFormat> {
    let holds = move |format: &&VectorFormat| {
        let kinds = format.holds.kinds;
        format.create.is_some() && kinds.iter().any(|known| known.name() == kind)
    };
    FORMATS.iter().filter(holds)
}

#[test]
fn planted_faults_are_found_in_every_format() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    let mut looked_at = 0;
    for kind in ["MultiPolygon", "MultiLineString", "MultiPoint"] {
        write(&path("original.geojson"), &features(kind));
        for format in holding(kind) {
            for (what, plant, is_property) in FAULTS {
                if *what == "a hole is gone" && kind != "MultiPolygon" {
                    continue;
                }
                let mut faulty = features(kind);
                plant(&mut faulty);
                write(&path("faulty.geojson"), &faulty);
                let lines = path(&format!("lines.{}", format.extensions[0]));
                assert!(
                    convert(&path("faulty.geojson"), &lines),
                    "{what}, {kind}, {}",
                    format.name
                );
                let report = prove(&proof(lines, path("original.geojson"), Some(0.0)));
                let name = format!("{what}, {kind}, {}: {report:?}", format.name);
                // What a format cannot hold is told, and no more.
                let is_lossy = matches!(format.name, "WKT" | "GPX");
                let of_name = ["a text is another", "a text is a number", "a name is another"];
                let is_held = format.name == "GPX" && of_name.contains(what);
                let is_sound = *what == "nothing" || (*is_property && is_lossy && !is_held);
                assert_eq!(report.verdict.passed, is_sound, "{name}");
                assert_eq!(report.verdict.judged, !is_lossy, "{name}");
                assert_eq!(report.verdict.not_judged.is_empty(), report.verdict.judged, "{name}");
                looked_at += 1;
            }
        }
    }
    assert!(looked_at > 200, "{looked_at}");
}

#[test]
fn shapefiles_cut_names_and_that_is_told() {
    let place = tempfile::tempdir().unwrap();
    let (original, lines) = (place.path().join("a.geojson"), place.path().join("b.shp"));
    write(&original, &features("MultiPolygon"));
    assert!(convert(&original, &lines));
    let report = prove(&proof(lines, original, Some(0.0)));
    assert!(report.verdict.passed && report.verdict.judged, "{report:?}");
    // They stand in the original by name; the first of two that are cut alike has the plain stem.
    let told = "truncated names of fields: population_today is population, \
                population_total is populati_1";
    assert_eq!(report.notes, [told]);
}

#[test]
fn ids_that_repeat_are_proved_where_csv_numbers_features() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    let (original, lines) = (path("a.geojson"), path("b.csv"));
    for property in ["name", "original_id"] {
        let mut all = features("MultiLineString");
        all[1]["id"] = json!(0);
        all[3].as_object_mut().unwrap().remove("id");
        all[2]["properties"][property] = json!("x");
        write(&original, &all);
        assert!(convert(&original, &lines));
        let report = prove(&proof(lines.clone(), original.clone(), Some(0.0)));
        assert!(report.verdict.passed && report.verdict.judged, "{report:?}");
        all[1]["id"] = json!(2);
        write(&original, &all);
        let report = prove(&proof(lines.clone(), original.clone(), Some(0.0)));
        assert_eq!(report.changed_attributes, 1, "{report:?}");
    }
}

#[test]
fn sorted_features_are_paired_by_what_they_are() {
    let place = tempfile::tempdir().unwrap();
    let (original, lines) = (place.path().join("a.geojson"), place.path().join("b.fgb"));
    let at = |i: u32| [[f64::from(i * 7 % 23), 0.0], [f64::from(i * 7 % 23), f64::from(i % 5)]];
    // Some lie upon each other, and only their properties tell them apart.
    let feature = |i: u32| {
        json!({"type": "Feature", "properties": {"n": i},
               "geometry": {"type": "LineString", "coordinates": at(i / 2)}})
    };
    let all: Vec<Value> = (0..60).map(feature).collect();
    write(&original, &all);
    assert!(convert(&original, &lines));
    let report = prove(&proof(lines.clone(), original.clone(), Some(0.0)));
    assert!(report.verdict.passed && report.verdict.judged, "{report:?}");
    let mut changed = all.clone();
    changed[31]["properties"]["n"] = json!(30);
    write(&place.path().join("c.geojson"), &changed);
    assert!(convert(&place.path().join("c.geojson"), &lines));
    let report = prove(&proof(lines, original, Some(0.0)));
    assert_eq!((report.verdict.passed, report.changed_attributes), (false, 1), "{report:?}");
}

#[test]
fn rings_may_be_gone_where_that_was_declared_and_within_the_tolerance() {
    let place = tempfile::tempdir().unwrap();
    let (original, lines) = (place.path().join("a.wkt"), place.path().join("b.wkt"));
    let thin = "((0 0, 50 0.5, 100 0, 50 -0.5, 0 0), (40 0, 50 0.2, 60 0, 40 0))";
    let gone = "MULTIPOLYGON (((0 50, 9 50, 9 59, 0 50)))\n";
    for (ring, tolerance, may_drop, passed) in [
        (thin, 0.5, true, true),
        (thin, 0.5, false, false),
        (thin, 0.4, true, false),
        ("((0 0, 10 10, 10 0, 0 10, 0 0))", 0.5, true, false),
        ("((0 0, 3 4, 0 0, 0 0))", 0.0, true, true),
        // A hole that goes with its ring need not be thin itself, but must not be elsewhere.
        ("((0 0, 9 1, 18 0, 9 -1, 0 0), (7 -0.9, 11 -0.9, 9 0.9, 7 -0.9))", 1.0, true, true),
        ("((0 0, 9 1, 18 0, 9 -1, 0 0), (7 30, 11 30, 9 32, 7 30))", 1.0, true, false),
    ] {
        let kept = gone.trim_start_matches("MULTIPOLYGON ").trim_end();
        let own = kept.strip_prefix('(').unwrap();
        std::fs::write(&original, format!("MULTIPOLYGON ({ring}, {own}\n")).unwrap();
        std::fs::write(&lines, gone).unwrap();
        let job = proof(lines.clone(), original.clone(), Some(tolerance));
        let report = prove(&LineVerifyJob { may_drop, ..job });
        assert_eq!(report.verdict.passed, passed, "{ring} {tolerance} {may_drop}: {report:?}");
        assert!(report.dropped > 0 && (report.missing > 0) != passed, "{report:?}");
    }
}

#[test]
fn without_a_tolerance_distances_are_not_judged() {
    let place = tempfile::tempdir().unwrap();
    let (original, lines) = (place.path().join("a.geojson"), place.path().join("b.geojson"));
    write(&original, &features("MultiLineString"));
    assert!(convert(&original, &lines));
    let report = prove(&proof(lines, original, None));
    assert!(report.verdict.passed && !report.verdict.judged, "{report:?}");
    assert!(report.verdict.not_judged[0].contains("‹tolerance›"), "{report:?}");
}

/// A world of features that are as odd as may be: small whole coordinates, so that vertices repeat and
/// lines cross; or neat ones, which topology can be asked of.
fn world(dice: &mut Dice, is_neat: bool) -> Vec<Value> {
    let has_heights = dice.below(3);
    let vertex = |dice: &mut Dice, x: f64, y: f64| match has_heights {
        0 => json!([x, y]),
        _ => json!([x, y, dice.below(4)]),
    };
    let odd = |dice: &mut Dice, least: u64| -> Vec<Value> {
        let count = least + dice.below(11);
        let at = |dice: &mut Dice| dice.below(12) as f64;
        (0..count)
            .map(|_| {
                let (x, y) = (at(dice), at(dice));
                vertex(dice, x, y)
            })
            .collect()
    };
    let closed = |mut ring: Vec<Value>| {
        ring.push(ring[0].clone());
        Value::from(ring)
    };
    let neat = |dice: &mut Dice, number: u64| {
        let count = 8 + dice.below(40);
        let corner = |i: u64, radius: f64, dice: &mut Dice| {
            let angle = i as f64 * std::f64::consts::TAU / count as f64;
            let radius = radius * (1.0 + dice.below(100) as f64 / 500.0);
            json!([20.0 * number as f64 + radius * angle.cos(), radius * angle.sin()])
        };
        let outer: Vec<Value> = (0..count).map(|i| corner(i, 6.0, dice)).collect();
        let hole: Vec<Value> = (0..count).rev().map(|i| corner(i, 3.0, dice)).collect();
        json!({"type": "Polygon", "coordinates": [closed(outer), closed(hole)]})
    };
    let count = 1 + dice.below(6);
    let kind = dice.below(4);
    let mut features = Vec::new();
    for number in 0..count {
        let kind = if kind == 3 { dice.below(4) } else { kind };
        let geometry = match (is_neat, kind) {
            (true, _) => neat(dice, number),
            (_, 0) => json!({"type": "LineString", "coordinates": odd(dice, 2)}),
            (_, 1) => {
                json!({"type": "MultiLineString", "coordinates": [odd(dice, 2), odd(dice, 2)]})
            }
            (_, 2) => {
                let ring = odd(dice, 3);
                json!({"type": "Polygon", "coordinates": [closed(ring)]})
            }
            _ if dice.one_in(3) => json!(null),
            _ => json!({"type": "MultiPoint", "coordinates": odd(dice, 1)}),
        };
        let texts = [json!("a"), json!("007"), json!(" x "), json!("é,;\"q\"")];
        let properties = json!({
            "population_total": dice.below(9), "population_today": dice.below(9),
            "mixed": dice.of(&[json!(1), json!(2.5), json!("two"), json!(true), json!(null)]),
            "real": dice.of(&[json!(0.1), json!(1e-9), json!(-5), json!(1e20)]),
            "text": dice.of(&texts),
            "list": [dice.below(3), {"k": null}],
        });
        features.push(json!({
            "type": "Feature", "id": number, "properties": properties, "geometry": geometry,
        }));
    }
    features
}

/// How many worlds are tried.
fn worlds() -> u64 {
    std::env::var("TERRANE_WORLDS").ok().and_then(|n| n.parse().ok()).unwrap_or(250)
}

#[test]
fn what_is_made_passes() {
    let place = tempfile::tempdir().unwrap();
    let original = place.path().join("a.geojson");
    let (mut passed, mut formats) = (0, BTreeSet::new());
    for seed in 0..worlds() {
        let dice = &mut Dice(seed * 7919 + 17);
        let is_neat = dice.one_in(4);
        write(&original, &world(dice, is_neat));
        let writable: Vec<&VectorFormat> = FORMATS.iter().filter(|f| f.create.is_some()).collect();
        let format = dice.of(&writable);
        let lines = place.path().join(format!("b{seed}.{}", format.extensions[0]));
        let method = &METHODS[dice.below(METHODS.len() as u64) as usize];
        let tolerance = dice.of(&[0.0, 0.5, 1.0, 3.0]);
        let goal = match method.bounds {
            ToleranceKind::Distance => LineGoal::Tolerance(length(tolerance)),
            ToleranceKind::Area(_) => LineGoal::Area(tolerance),
        };
        let collapse = dice.of(&[RingCollapse::Minimal, RingCollapse::Drop, RingCollapse::Keep]);
        let strategy = dice.of(&[Strategy::Retroactive, Strategy::Proactive]);
        let topology = is_neat.then(|| Topology { strategy, ..Topology::default() });
        let job = LineJob { method, collapse, topology, ..LineJob::new(&original, &lines, goal) };
        let job = LineJob { resources: resources(), ..job };
        // Not every format holds every world.
        if let Err(error) = run(&job, &Silent, &Cancel::default()) {
            let kinds = [ErrorKind::CannotWrite, ErrorKind::Unsupported, ErrorKind::Usage];
            assert!(kinds.contains(&error.kind()), "{seed}, {}: {error}", format.name);
            continue;
        }
        let bound = (method.bounds == ToleranceKind::Distance).then_some(tolerance * (1.0 + 1e-12));
        let report = prove(&LineVerifyJob {
            may_drop: collapse == RingCollapse::Drop,
            topology: is_neat,
            ..proof(lines, original.clone(), bound)
        });
        let name = format!("{seed}, {}, {}, {collapse:?}", format.name, method.name);
        assert!(report.verdict.passed, "{name}: {:?}", report.verdict.failures);
        let is_lossy = matches!(format.name, "WKT" | "GPX");
        assert_eq!(
            report.verdict.judged,
            bound.is_some() && !is_lossy,
            "{name}: {:?}",
            report.verdict.not_judged
        );
        passed += 1;
        formats.insert(format.name);
    }
    assert!(passed * 3 > worlds(), "{passed}");
    let writable = FORMATS.iter().filter(|format| format.create.is_some());
    assert_eq!(formats, writable.map(|format| format.name).collect(), "each has been judged");
}
