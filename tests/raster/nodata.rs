//! Nodata that a file does not declare is told of; `convert` does with nodata and bands as asked.

use crate::cli_support::Place;
use crate::raster_support::tiff_builder::{Spec, Value};
use crate::raster_support::{self, open_band, read_all};

/// Heights with seven pits.
fn pits(col: usize, row: usize, _: usize) -> f64 {
    if row == 2 && (3..10).contains(&col) { -32_767.0 } else { (col * row) as f64 }
}

fn declared(value: &str) -> Vec<(u16, Value)> {
    vec![(42113, Value::Text(value.to_owned()))]
}

#[test]
fn info_warns_of_undeclared_nodata() {
    let place = Place::new();
    let mut spec = Spec::new(30, 20, 2, 16);
    place.write("a.tif", spec.build(pits));
    let line = "7 samples are -32767, which looks like an undeclared nodata value; \
                pass --nodata -32767";
    let told = place.ok(&["info", "a.tif", "--stats"]).out;
    assert!(told.contains(line), "{told}");
    let told = place.ok(&["info", "a.tif", "--stats", "--json"]).out;
    assert!(told.contains(r#""at_min":7,"suspected_nodata":-32767.0"#), "{told}");
    assert!(!place.ok(&["info", "a.tif"]).out.contains("undeclared"), "no sample was read");
    let told = place.ok(&["info", "a.tif", "--stats", "--nodata", "-32767"]).out;
    assert!(!told.contains("undeclared") && told.contains("7 samples are void"), "{told}");
    spec.extra = declared("-32767");
    place.write("b.tif", spec.build(pits));
    let told = place.ok(&["info", "b.tif", "--stats", "--json"]).out;
    assert!(told.contains(r#""valid":593"#) && !told.contains("suspected"), "{told}");
}

#[test]
fn tin_warns_of_undeclared_nodata_and_counts_each_sample_once() {
    let place = Place::new();
    let mut spec = Spec::new(30, 20, 2, 16);
    place.write("a.tif", spec.build(pits));
    let args = ["tin", "a.tif", "a.ply", "--max-error", "1", "--tile", "16"];
    let told = place.ok(&[&args[..], &["--report", "a.json"]].concat());
    assert!((told.out + &told.err).contains("7 samples are -32767, which looks like"));
    let report = std::fs::read_to_string(place.path("a.json")).unwrap();
    assert!(report.contains("\"suspected_nodata\": -32767.0"), "{report}");
    assert!(report.contains("\"suspected_samples\": 7"), "{report}");
    spec.extra = declared("-32767");
    place.write("b.tif", spec.build(pits));
    let told = place.ok(&["tin", "b.tif", "b.ply", "--max-error", "1"]);
    assert!(!(told.out + &told.err).contains("looks like"));
}

#[test]
fn convert_declares_the_nodata_value_it_is_given_in_place_of_the_files() {
    let place = Place::new();
    let mut spec = Spec::new(30, 20, 2, 16);
    spec.extra = declared("0");
    place.write("a.tif", spec.build(pits));
    place.ok(&["convert", "a.tif", "b.tif", "--nodata", "-32767"]);
    let store = open_band(&place.path("b.tif"), 1).unwrap();
    assert_eq!(store.info().nodata, Some(-32_767.0));
    let heights = read_all(store.as_ref()).unwrap();
    assert_eq!(heights.iter().filter(|z| z.is_nan()).count(), 7);
    assert_eq!(heights.iter().filter(|z| **z == 0.0).count(), 49, "the file's value is a height");
}

#[test]
fn convert_takes_the_band_with_its_scale_and_unit() {
    let xml = r#"<GDALMetadata><Item name="SCALE" sample="1" role="scale">0.5</Item>
        <Item name="OFFSET" sample="1" role="offset">-3</Item>
        <Item name="UNITTYPE" sample="1" role="unittype">ft</Item></GDALMetadata>"#;
    let place = Place::new();
    let mut spec = Spec::new(30, 20, 2, 16);
    (spec.bands, spec.extra) = (2, declared("7"));
    spec.extra.push((42112, Value::Text(xml.to_owned())));
    place.write("a.tif", spec.build(|col, row, band| (col + row + 100 * band) as f64));
    for band in [1, 2] {
        place.ok(&["convert", "a.tif", "b.tif", "--overwrite", "--band", &band.to_string()]);
        let source = open_band(&place.path("a.tif"), band).unwrap();
        let store = open_band(&place.path("b.tif"), 1).unwrap();
        let (from, to) = (source.info(), store.info());
        assert_eq!((to.bands, to.scale, to.offset), (1, from.scale, from.offset));
        assert_eq!(to.crs.vertical_unit_text, from.crs.vertical_unit_text);
        let (a, b) = (read_all(source.as_ref()).unwrap(), read_all(store.as_ref()).unwrap());
        assert!(a.iter().zip(&b).all(|(a, b)| raster_support::same(*a, *b)));
    }
    assert!(place.run(&["convert", "a.tif", "c.tif", "--band", "3"]).code == 2);
}

#[test]
fn a_nodata_value_that_the_type_cannot_hold_is_named() {
    let place = Place::new();
    let mut spec = Spec::new(30, 20, 1, 8);
    (spec.bands, spec.extra) = (2, vec![(338, Value::Short(vec![2]))]);
    place.write("a.tif", spec.build(|col, _, band| if band == 0 { 9.0 } else { (col % 2) as f64 }));
    for (nodata, word) in [(None, "no nodata value is declared"), (Some("-9999"), "-9999 cannot")] {
        let mut args = vec!["convert", "a.tif", "b.tif"];
        args.extend(nodata.into_iter().flat_map(|value| ["--nodata", value]));
        let ran = place.run(&args);
        assert!(ran.code == 65 && ran.err.contains(word), "{}", ran.err);
    }
    place.ok(&["convert", "a.tif", "b.tif", "--nodata", "255"]);
}
