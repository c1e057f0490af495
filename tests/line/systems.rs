//! The reference system of lines is that of their original, and what proofs call values.

use std::path::Path;

use serde_json::{Value, json};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_simplify::{Length, LineGoal, LineJob, run};
use terrane_vector::FORMATS;
use terrane_verify::{LineVerifyJob, LineVerifyReport, verify_lines};

fn resources() -> Resources {
    Resources { threads: 1, memory: 1 << 28, temp_dir: None }
}

fn prove(lines: &Path, original: &Path) -> LineVerifyReport {
    let tolerance = Some(Length { value: 0.0, unit: None });
    let job = LineVerifyJob {
        lines: lines.to_owned(),
        original: original.to_owned(),
        layer: None,
        tolerance,
        is_space: false,
        topology: true,
        may_drop: false,
        sides: None,
        resources: resources(),
    };
    verify_lines(&job, &Silent, &Cancel::default()).unwrap()
}

/// A line in a system, or in none that is named.
fn write(path: &Path, code: Option<u32>) {
    let wkt = "LINESTRING (7 50, 8 51, 9 50.5)\n";
    let Some(code) = code else { return std::fs::write(path.with_extension("wkt"), wkt).unwrap() };
    let name = format!("urn:ogc:def:crs:EPSG::{code}");
    let line = json!({"type": "LineString", "coordinates": [[7, 50], [8, 51], [9, 50.5]]});
    let all = json!({
        "type": "FeatureCollection",
        "crs": {"type": "name", "properties": {"name": name}},
        "features": [{"type": "Feature", "properties": {}, "geometry": line}],
    });
    std::fs::write(path.with_extension("geojson"), all.to_string()).unwrap();
}

/// What lines are in and what their original is in, `None` where no system is named: kept, broken, or not
/// judged, in every format.
#[test]
fn a_changed_system_is_broken_or_named_as_not_judged_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let systems = [Some(4258), Some(4326), Some(4269), None];
    for code in systems {
        write(&folder.path().join(format!("of_{code:?}")), code);
    }
    let original = |code: Option<u32>| {
        let ending = if code.is_some() { "geojson" } else { "wkt" };
        folder.path().join(format!("of_{code:?}.{ending}"))
    };
    let mut seen = [0; 3];
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        for made in systems {
            let lines = folder.path().join(format!("lines_{made:?}.{}", format.extensions[0]));
            let goal = LineGoal::Tolerance(Length { value: 0.0, unit: None });
            let job = LineJob { overwrite: true, ..LineJob::new(original(made), &lines, goal) };
            run(&LineJob { resources: resources(), ..job }, &Silent, &Cancel::default()).unwrap();
            for held in systems {
                let told = prove(&lines, &original(held)).verdict;
                let about = |list: &[String]| list.iter().any(|one| one.contains("the CRS of the"));
                let found = [about(&told.failures), about(&told.not_judged)];
                // What GeoJSON and GPX do not name is on WGS 84.
                let is_wgs84 = ["GPX", "GeoJSON", "GeoJSONSeq"].contains(&format.name);
                let own = if made.is_none() && is_wgs84 { Some(4326) } else { made };
                let own = if format.name == "GPX" { Some(4326) } else { own };
                let expected = match (own, held) {
                    (own, held) if own == held => [false; 2],
                    (Some(4326), None) if is_wgs84 => [false; 2],
                    (Some(_), Some(_)) if format.name != "GPX" => [true, false],
                    _ => [false, true],
                };
                let what = format!("{} of {made:?} against {held:?}: {told:?}", format.name);
                assert_eq!(found, expected, "{what}");
                assert_eq!((told.passed, told.judged), (!found[0], told.not_judged.is_empty()));
                seen[usize::from(found[0]) + 2 * usize::from(found[1])] += 1;
            }
        }
    }
    assert!(seen.iter().all(|count| *count > 5), "{seen:?}");
}

#[test]
fn values_that_differ_are_told_with_their_types() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let write = |name: &str, id: u32, value: Value| {
        let line = json!({"type": "LineString", "coordinates": [[0, 0], [1, 1]]});
        let feature =
            json!({"type": "Feature", "id": id, "properties": {"n": value}, "geometry": line});
        let all = json!({"type": "FeatureCollection", "features": [feature]});
        std::fs::write(path(name), all.to_string()).unwrap();
    };
    for (own, value, told) in [
        (json!("2"), json!(2), "n is the text \"2\", not the number 2"),
        (json!(0), json!(null), "n is the number 0, not null"),
        (json!(null), json!(""), "n is null, not the text \"\""),
        (json!(true), json!("true"), "n is the boolean true, not the text \"true\""),
        (json!(3), json!(2), "n is 3, not 2"),
        (json!("b"), json!("a"), "n is \"b\", not \"a\""),
    ] {
        write("a.geojson", 1, value);
        write("b.geojson", 1, own);
        let failures = prove(&path("b.geojson"), &path("a.geojson")).verdict.failures.join("; ");
        assert!(failures.contains(told), "{failures}");
    }
    write("a.geojson", 104, json!(1));
    std::fs::write(path("b.geojson"), r#"{"type":"FeatureCollection","features":[]}"#).unwrap();
    let failures = prove(&path("b.geojson"), &path("a.geojson")).verdict.failures.join("; ");
    assert!(failures.contains("feature 0 (its id 104)"), "{failures}");
}
