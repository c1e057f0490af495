//! `terrane fill`: heights by hand and by a slow way, the same bytes however they are made, every sample type.

use crate::cli_support::{Place, VOID_GRID, json};
use crate::relief::values;

/// Heights in text, row by row, with `*` for voids, as ESRI ASCII.
fn grid(rows: &str) -> String {
    let rows: Vec<&str> = rows.lines().collect();
    let (columns, lines) = (rows[0].split_whitespace().count(), rows.len());
    let head = format!("ncols {columns}\nnrows {lines}\nxllcorner 0\nyllcorner 0\ncellsize 5\n");
    head + "NODATA_value -9999\n" + &rows.join("\n").replace('*', "-9999") + "\n"
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-5 * expected.abs().max(1.0), "{found} {expected}");
}

#[test]
fn voids_are_weighted_means_of_the_nearest_in_each_quadrant() {
    let place = Place::new();
    // North-east 4 at distance 1 (above), south-east 10 at 2 (in its row), south-west 8 at sqrt 5, north-west 1.5 at 1.
    place.write("a.asc", grid("0.5 2 4 6 9\n3 1.5 * * 10\n7 * * * *\n* 8 * * 5"));
    let report = place.ok(&["fill", "a.asc", "o.asc", "--max-distance", "3", "--json"]);
    let (columns, found) = values(&place, "o.asc");
    let weights = [(4.0, 1.0), (10.0, 2.0), (8.0, 5_f64.sqrt()), (1.5, 1.0)];
    let mean = |weights: &[(f64, f64)]| {
        let sum: f64 = weights.iter().map(|(z, distance)| z / distance).sum();
        sum / weights.iter().map(|(_, distance)| 1.0 / distance).sum::<f64>()
    };
    near(found[columns + 2], mean(&weights));
    // A corner has the quadrants within the grid alone.
    near(found[3 * columns], mean(&[(7.0, 1.0), (8.0, 1.0)]));
    let report = json(&report.out);
    assert_eq!((&report["filled"], &report["left"]), (&9.into(), &0.into()));
    assert_eq!(report["valid_samples"], 20);
    assert_eq!(found[4], 9.0, "valid samples stay");
    // Heights next to a void only.
    let report = json(&place.ok(&["fill", "a.asc", "p.asc", "--max-distance", "1", "--json"]).out);
    let (_, found) = values(&place, "p.asc");
    near(found[columns + 2], 2.75);
    assert!(found[2 * columns + 3].is_nan());
    let note = report["notes"].to_string();
    assert!(note.contains("voids left: 2, farther than 1 cells from all valid samples"), "{note}");
    assert!(note.contains("--max-distance") && report["left"] == 2, "{note}");
    assert_eq!(report["filled"], 7);
}

#[test]
fn smoothing_changes_filled_samples_only() {
    let place = Place::new();
    place.write("a.asc", grid("0 0 * * * 8"));
    for (smoothing, expected) in
        [("0", [0.0, 0.0, 2.0, 4.0, 6.0, 8.0]), ("7", [0.0, 0.0, 2.0, 4.0, 6.0, 8.0])]
    {
        place.ok(&["fill", "a.asc", "o.asc", "--smoothing", smoothing, "--overwrite", "-q"]);
        let (_, found) = values(&place, "o.asc");
        found.iter().zip(expected).for_each(|(found, expected)| near(*found, expected));
    }
    place.write("b.asc", grid("0 9 0\n* * *\n0 0 0"));
    place.ok(&["fill", "b.asc", "o.tif", "--smoothing", "1", "--overwrite", "-q"]);
    let filled = place.ok(&["fill", "b.asc", "p.tif", "--overwrite", "-q"]);
    assert!(filled.out.is_empty());
    let [(_, smooth), (_, plain)] = ["o.tif", "p.tif"].map(|name| values(&place, name));
    let mean = (plain[3..6].iter().sum::<f64>() + 9.0) / 9.0;
    // Whole numbers are rounded after smoothing.
    near(smooth[4], mean.round());
    assert_eq!(smooth[1], 9.0);
}

#[test]
fn threads_memory_formats_and_parts_leave_no_trace() {
    let place = Place::new();
    let dem = "synth:salt,size=1100,voids=0.4,seed=5";
    // Wide voids, too.
    let areas = "POLYGON ((500100 4749900, 508000 4749000, 504000 4745000, 500100 4749900))\n\
                 POLYGON ((504000 4741000, 510800 4741000, 510800 4739200, 504000 4741000))";
    place.write("areas.wkt", areas).write("areas.prj", "EPSG:32631");
    place.ok(&["convert", dem, "dem.tif", "--clip", "areas.wkt", "-q"]);
    let make = |name: &str, more: &[&str]| {
        let fill = ["fill", "dem.tif", name, "--smoothing", "2"];
        let ran = place
            .ok(&[&fill[..], &["--max-distance", "60", "--overwrite", "--json"], more].concat());
        let report = json(&ran.out);
        (report["filled"].as_u64().unwrap(), report["left"].as_u64().unwrap())
    };
    let counts = make("one.tif", &["--threads", "1"]);
    assert!(counts.0 > 200_000 && counts.1 > 100_000, "{counts:?}");
    assert_eq!(make("two.tif", &["--threads", "2", "--memory", "44M"]), counts);
    assert!(place.bytes("one.tif") == place.bytes("two.tif"));
    let (columns, whole) = values(&place, "one.tif");
    for (name, format) in
        [("o.tif", "COG"), ("o.asc", "AAIGrid"), ("s.tif", "store"), ("t.tif", "GTiff")]
    {
        let more = if name == "t.tif" { &["--co", "TILED=YES"][..] } else { &[] };
        assert_eq!(make(name, &[&["-f", format], more].concat()), counts, "{format}");
        let (_, other) = values(&place, name);
        let is_same =
            whole.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-4 || a.is_nan() && b.is_nan());
        assert!(is_same, "{format}");
    }
    let voids = whole.iter().filter(|z| z.is_nan()).count() as u64;
    assert_eq!((voids, columns), (counts.1, 1100));
    assert!(whole.iter().all(|z| *z != 0.0), "no height is made of nothing");
}

/// Samples outside the polygons count for the heights of those inside, and are void and uncounted in the output.
#[test]
fn clip_polygons_cut_the_filled_grid() {
    let place = Place::new();
    let dem = "synth:salt,size=700,voids=0.9,seed=5";
    let area = "POLYGON ((500100 4749900, 506000 4749000, 504000 4745000, 500100 4749900))";
    place.write("area.wkt", area).write("area.prj", "EPSG:32631");
    let options = ["--max-distance", "2", "--smoothing", "1", "--json"];
    place.ok(&[&["fill", dem, "whole.tif"], &options[..]].concat());
    place.ok(&["convert", "whole.tif", "expected.tif", "--clip", "area.wkt", "-q"]);
    let told = place.ok(&[&["fill", dem, "o.tif", "--clip", "area.wkt"], &options[..]].concat());
    let told = json(&told.out);
    let small = ["--memory", "44M", "--threads", "2"];
    let small = [&["fill", dem, "small.tif", "--clip", "area.wkt"], &options[..], &small].concat();
    assert_eq!(json(&place.ok(&small).out)["filled"], told["filled"]);
    let [expected, found] = ["expected.tif", "o.tif"].map(|name| values(&place, name).1);
    assert_eq!(format!("{found:?}"), format!("{expected:?}"));
    assert!(place.bytes("o.tif") == place.bytes("small.tif"));
    // Samples outside are neither filled nor left: with other polygons they are, and the sums agree.
    let count = |name: &str| told[name].as_u64().unwrap();
    let valid = found.iter().filter(|z| !z.is_nan()).count() as u64;
    place.ok(&["convert", dem, "before.tif", "--clip", "area.wkt", "-q"]);
    let before = values(&place, "before.tif").1.iter().filter(|z| !z.is_nan()).count() as u64;
    assert_eq!(valid, before + count("filled"));
    place.ok(&["convert", "synth:rough,size=700", "level.tif", "--clip", "area.wkt", "-q"]);
    let inside = values(&place, "level.tif").1.iter().filter(|z| !z.is_nan()).count() as u64;
    assert_eq!(inside, valid + count("left"));
    assert!(count("filled") > 1000 && count("left") > 100 && inside < 700 * 700, "{told}");
}

/// Filled heights are rounded to the type of the output, and are never its nodata value.
#[test]
fn output_types_and_nodata_values_can_be_chosen() {
    let place = Place::new();
    place.write("a.asc", grid("1 2 * 4\n-1 1 * *\n1 2 * 2"));
    let options = ["--type", "int16", "--out-nodata", "3", "--overwrite", "--json"];
    let told = json(&place.ok(&[&["fill", "a.asc", "o.tif"], &options[..]].concat()).out);
    assert_eq!((&told["sample_type"], &told["left"]), (&"int16".into(), &0.into()), "{told}");
    assert!(values(&place, "o.tif").1.iter().all(|z| z.fract() == 0.0 && *z != 3.0));
    let exact = ["fill", "a.asc", "f.tif", "--type", "float64", "--json"];
    assert_eq!(json(&place.ok(&exact).out)["left"], 0);
    assert!(values(&place, "f.tif").1.iter().any(|z| z.fract() != 0.0));
    // Valid samples are never changed unasked.
    place.write("b.asc", grid("0.5 * 2.25 1"));
    place.fails(&["fill", "b.asc", "b.tif", "--type", "int8"], 65, &["b.tif", "--round"]);
    place.ok(&["fill", "b.asc", "b.tif", "--type", "int8", "--round", "-q"]);
}

#[test]
fn every_sample_type_stays_and_nodata_is_never_made() {
    let place = Place::new();
    place.write("a.asc", grid("1 4 * 3 7\n9 * 2 * 5\n3 * * * 100"));
    for kind in
        ["int8", "uint8", "int16", "uint16", "int32", "uint32", "float16", "float32", "float64"]
    {
        let (nodata, name) =
            (if kind.starts_with("float") { "-9999" } else { "0" }, format!("{kind}.tif"));
        let convert = ["convert", "a.asc", &name, "--type", kind, "--out-nodata", nodata, "-q"];
        place.ok(&convert);
        let report = json(&place.ok(&["fill", &name, "o.tif", "--overwrite", "--json"]).out);
        assert_eq!((&report["sample_type"], &report["left"]), (&kind.into(), &0.into()), "{kind}");
        let (_, found) = values(&place, "o.tif");
        let is_whole = !kind.starts_with("float");
        assert!(
            found.iter().all(|z| z.is_finite() && (!is_whole || z.fract() == 0.0)),
            "{kind}: {found:?}"
        );
    }
    // A mean of -1 and 1 is 0, which is nodata.
    place.write("b.asc", grid("-1 * 1").replace("-9999", "0"));
    place.ok(&["convert", "b.asc", "b.tif", "--type", "int16", "-q"]);
    for (input, output) in [("b.asc", "p.asc"), ("b.tif", "p.tif")] {
        let report = json(&place.ok(&["fill", input, output, "--json"]).out);
        assert_eq!(report["filled"], 1, "{input}");
        assert_eq!(report["left"], 0, "{input}");
    }
}

#[test]
fn grids_without_voids_and_without_heights_are_copied() {
    let place = Place::new();
    place.write("void.asc", VOID_GRID);
    let report = json(&place.ok(&["fill", "void.asc", "o.tif", "--json"]).out);
    assert_eq!((&report["filled"], &report["left"]), (&0.into(), &4.into()));
    place.ok(&["convert", "synth:rough,size=90", "a.tif", "-q"]);
    let told = place.ok(&["fill", "a.tif", "b.tif"]).out;
    assert!(told.contains("filled      0"), "{told}");
    assert!(place.bytes("a.tif") == place.bytes("b.tif"));
}

#[test]
fn what_cannot_be_filled_is_refused_with_a_remedy() {
    let place = Place::new();
    place.ok(&["convert", "synth:salt,size=300", "a.tif", "-q"]);
    place.fails(&["fill", "a.tif", "o.tif", "--max-distance", "0"], 2, &["--max-distance"]);
    place.fails(&["fill", "a.tif", "o.tif", "--max-distance", "10001"], 2, &["--max-distance"]);
    place.fails(&["fill", "a.tif", "a.tif", "--overwrite"], 2, &["a.tif"]);
    place.fails(&["fill", "no.tif", "o.tif"], 65, &["no.tif"]);
    place.ok(&["convert", "synth:salt,size=1700,voids=0.001", "b.tif", "-q"]);
    let far = ["fill", "b.tif", "o.tif", "--max-distance", "1500"];
    place.fails(&[&far[..], &["--memory", "50M"]].concat(), 75, &["a smaller --max-distance"]);
    place.ok_as_advised(&[&far[..], &["-q"]].concat(), "50M", &["--memory"]);
}
