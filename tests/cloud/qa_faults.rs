//! Faults that a review of reports on quality found.

use std::process::Command;

use serde_json::Value;
use terrane::prelude::*;
use terrane_engine::{Cancel, Progress};

use crate::cloud_support::{Made, Packing, Place};
use crate::qa::{job, sound, survey};

/// A file with `count` points at places (in steps) and flight lines.
fn placed(count: usize, place: impl Fn(i32) -> ([i32; 2], u16)) -> Made {
    let mut made = survey(6, count, 1, [0, 0]);
    for (i, record) in (0..).zip(&mut made.records) {
        let ([x, y], line) = place(i);
        record[..12].copy_from_slice([x, y, 0].map(i32::to_le_bytes).as_flattened());
        // One return of one, not withheld.
        record[14..16].copy_from_slice(&[0x11, 0]);
        record[20..22].copy_from_slice(&line.to_le_bytes());
    }
    made
}

#[test]
fn an_index_replaces_no_input() {
    let place = Place::new();
    let clip = br#"{"type":"Polygon","coordinates":[[[0,0],[9999,0],[9999,9999],[0,9999],[0,0]]]}"#;
    let clip = place.write("clip.geojson", clip);
    let made = sound(&survey(6, 500, 1, [0, 0]));
    let [file, table] = ["a.las", "jj.dbf"].map(|name| place.write(name, &made));
    let page = place.path().join("qa.html");
    let error = job(&[file]).clip(&clip).index(&clip).write(&page).unwrap_err();
    assert!(error.to_string().contains("also an input"), "{error}");
    let index = place.path().join("jj.shp");
    let error = job(&[table]).index(&index).write(&page).unwrap_err();
    assert!(error.to_string().contains("also an input"), "{error}");
}

#[test]
fn a_report_does_not_replace_the_index() {
    let place = Place::new();
    let file = place.write("a.las", &sound(&survey(6, 500, 1, [0, 0])));
    let [page, index] = ["qa.html", "index.json"].map(|name| place.path().join(name));
    let index = index.with_extension("geojson");
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrane"));
    command.args(["qa", &file]).arg(page).arg("--index").arg(&index).arg("--report").arg(&index);
    let done = command.output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(!done.status.success() && said.contains("choose another name"), "{said}");
}

/// Cancels a job after its pass over the cells.
struct LateCancel(Cancel);

impl Progress for LateCancel {
    fn begin(&self, stage: &str, _: u64) {
        if stage == "cells" {
            self.0.cancel();
        }
    }

    fn advance(&self, _: u64) {}

    fn end(&self) {}
}

#[test]
fn a_run_that_fails_leaves_the_index() {
    let place = Place::new();
    // No cell whose pass would check for itself.
    let file =
        place.write("a.las", &sound(&Made { records: Vec::new(), ..survey(6, 1, 1, [0, 0]) }));
    let file = [file, place.write("b.las", &sound(&survey(6, 1, 1, [0, 0])))];
    let [page, index] = ["qa.html", "index.geojson"].map(|name| place.path().join(name));
    std::fs::write(&index, "earlier").unwrap();
    let cancel = Cancel::default();
    let job = job(&file).cancel(&cancel).progress(LateCancel(cancel.clone()));
    let error = job.index(&index).write(&page).unwrap_err();
    assert_eq!(error.kind(), terrane_base::error::ErrorKind::Interrupted, "{error}");
    assert_eq!(std::fs::read_to_string(&index).unwrap(), "earlier");
    assert!(!page.exists());
}

#[test]
fn small_cells_and_wide_bounds_are_not_judged() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    let mut bytes = sound(&survey(6, 900, 1, [0, 0]));
    let file = place.write("a.las", &bytes);
    let report = job(&[file]).cell(0.3).min_density(3.0).write(&page).unwrap();
    assert_eq!(report.min_density.unwrap().is_met, None);
    assert!(report.notes.iter().any(|note| note.contains("smaller than the point spacing")));
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("not judged") && !html.contains(">met<"));

    // The highest x of the header.
    bytes[179..187].copy_from_slice(&1e6_f64.to_le_bytes());
    let file = place.write("wide.las", &bytes);
    let report = job(&[file]).write(&page).unwrap();
    let note = report.notes.iter().find(|note| note.contains("much larger than the survey"));
    assert!(note.is_some_and(|note| note.contains("‹cell›")), "{:?}", report.notes);
}

#[test]
fn a_density_is_not_met_without_points() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    let file = place.write("a.las", &sound(&survey(6, 900, 1, [0, 0])));
    let report = job(&[file]).class(vec![200]).min_density(3.0).write(&page).unwrap();
    let required = report.min_density.unwrap();
    assert_eq!((required.is_met, required.below), (Some(false), 1.0));
    assert!(std::fs::read_to_string(&page).unwrap().contains("not met"));
}

#[test]
fn rows_of_many_gaps_have_no_voids() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    let file = place.write("a.las", &sound(&placed(40_000, |i| ([i * 200, 0], 1))));
    let report = job(&[file]).cell(1.0).write(&page).unwrap();
    assert_eq!((report.voids, report.enclosed_cells), (None, 0));
    assert!(report.notes.iter().any(|note| note.starts_with("voids are not counted")));
}

#[test]
fn pairs_of_lines_have_a_limit() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    // Each line overlaps the next one.
    let made = placed(10_000, |i| ([i / 2 * 100, 0], ((i + 1) / 2) as u16));
    let file = place.write("a.las", &sound(&made));
    let report = job(&[file]).cell(1.0).write(&page).unwrap();
    assert_eq!((report.overlaps.len(), report.overlaps_left_out), (4096, 5000 - 4096));
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("904 overlaps of other pairs"));
}

#[test]
fn names_of_files_are_whole() {
    let place = Place::new();
    std::fs::create_dir_all(place.path().join("a/data")).unwrap();
    let made = sound(&survey(6, 300, 1, [0, 0]));
    std::fs::write(place.path().join("a/x.las"), &made).unwrap();
    std::fs::write(place.path().join("a/data/y.las"), &made).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrane"));
    command.current_dir(place.path()).args(["qa", "a/x.las", "a/data/y.las", "qa.html"]);
    assert!(command.output().unwrap().status.success());
    let html = std::fs::read_to_string(place.path().join("qa.html")).unwrap();
    assert!(html.contains("<td>data/y.las</td>"), "{html}");
}

#[test]
fn cells_beyond_their_numbers_are_refused() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    let mut made = survey(6, 300, 1, [0, 0]);
    made.packing = Packing::Plain;
    let file = place.write("a.las", &sound(&made));
    for (cell, what) in [(1e300, "not a finite number"), (1e-300, "below the coordinate scale")] {
        let error = job(std::slice::from_ref(&file)).cell(cell).write(&page).unwrap_err();
        let text = error.to_string();
        assert!(text.contains(what) && text.contains("‹cell›"), "{text}");
    }
    let mut wide = placed(2, |i| ([(i * 2 - 1) * i32::MAX, 0], 1));
    wide.packing = Packing::Plain;
    let file = place.write("wide.las", &sound(&wide));
    let error = job(&[file]).cell(0.01).write(&page).unwrap_err().to_string();
    assert!(error.contains("more than 2^31 cells") && error.contains("‹cell›"), "{error}");
}

#[test]
fn long_texts_of_a_shapefile_are_shortened() {
    let place = Place::new();
    let mut made = survey(6, 300, 1, [0, 0]);
    for (i, record) in made.records.iter_mut().enumerate() {
        record[16] = i as u8;
    }
    let file = place.write("a.las", &sound(&made));
    let index = place.path().join("index.shp");
    let report = job(&[file]).index(index).write(place.path().join("qa.html")).unwrap();
    assert!(report.notes.iter().any(|note| note.starts_with("index: classes of ")));
}

#[test]
fn text_clouds_have_no_point_format() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    let text: String = (0..400).map(|i| format!("{} {} 5\n", i % 20, i / 20)).collect();
    let text = format!("cloud:{}", place.write("a.xyz", text.as_bytes()));
    let las = place.write("b.las", &sound(&survey(7, 300, 1, [0, 0])));
    let index = place.path().join("all.vpc");
    let report = job(&[text, las]).crs("EPSG:32631").index(&index).write(&page).unwrap();
    let formats: Vec<_> = report.file_list.iter().map(|file| file.point_format).collect();
    assert!(formats.contains(&None) && formats.contains(&Some(7)));
    assert!(report.findings.iter().all(|it| !it.finding.contains("the point format is")));
    assert!(report.notes.iter().any(|note| note.contains("a.xyz is left out")));
    let all: Value = serde_json::from_slice(&std::fs::read(&index).unwrap()).unwrap();
    assert_eq!(all["features"].as_array().unwrap().len(), 1);
}

#[test]
fn items_of_a_virtual_point_cloud_are_readable() {
    let place = Place::new();
    let page = place.path().join("qa.html");
    let mut made = survey(8, 500, 1, [0, 0]);
    made.offset = [500_000.0, 4_000_000.0, 0.0];
    let mut bytes = sound(&made);
    // No creation date.
    bytes[90..94].fill(0);
    let file = place.write("a.las", &bytes);
    let folder = place.path().join("index");
    std::fs::create_dir(&folder).unwrap();
    let index = folder.join("all.vpc");
    let item = |index: &std::path::Path| -> Value {
        let all: Value = serde_json::from_slice(&std::fs::read(index).unwrap()).unwrap();
        all["features"].get(0).cloned().unwrap_or_default()
    };
    job(std::slice::from_ref(&file)).cell(1.0).index(&index).write(&page).unwrap();
    let found = item(&index);
    assert_eq!(found["assets"]["data"]["href"], "./../a.las");
    let properties = &found["properties"];
    assert!(properties["datetime"].is_null());
    assert_eq!(properties["start_datetime"], "0001-01-01T00:00:00Z");
    assert_eq!(properties["end_datetime"], "9999-12-31T23:59:59Z");
    let schemas = properties["pc:schemas"].to_string();
    assert!(schemas.contains("\"Blue\"") && schemas.contains("\"Infrared\""), "{schemas}");
    let rings = properties["proj:geometry"]["coordinates"][0].as_array().unwrap();
    let first = &rings[0];
    assert_eq!(first[0], first[first.as_array().unwrap().len() - 1]);

    // Filters are refused, and files beyond the projection are left out.
    let error = job(&[file]).class(vec![2]).index(&index).write(&page).unwrap_err();
    assert!(error.to_string().contains("use .geojson"), "{error}");
    made.offset = [5e8, 5e6, 0.0];
    let far = place.write("far.las", &sound(&made));
    let report = job(&[far]).cell(1.0).index(&index).write(&page).unwrap();
    let note = report.notes.iter().find(|note| note.contains("far.las is left out"));
    assert!(note.is_some(), "{:?}", report.notes);
    assert!(item(&index).is_null());

    // Without a CRS.
    let file = place.write("unknown.las", &sound(&survey(1, 300, 1, [0, 0])));
    let report = job(&[file]).index(&index).write(&page).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("‹crs›")), "{:?}", report.notes);
    assert!(report.notes.iter().all(|note| !note.contains(".prj file")), "{:?}", report.notes);
    let properties = &item(&index)["properties"];
    assert_eq!((&properties["proj:wkt2"], properties.get("proj:epsg")), (&Value::from(""), None));
}
