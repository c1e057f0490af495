//! `terrane zonal` and `terrane sample`: values by hand and by a slow way, the same bytes however they are made, every kind
//! of input refused by name.

use crate::cli_support::Place;
use serde_json::Value;

/// A grid of 60 x 50 cells of 10 m, whose height is that of no other cell, with a void at column 3, row 4.
fn place() -> Place {
    let place = Place::new();
    let height = |row: i32, col: i32| match (row, col) {
        (4, 3) => "-9999".to_owned(),
        _ => (row * 60 + col).to_string(),
    };
    let row = |row| (0..60).map(|col| height(row, col) + " ").collect::<String>() + "\n";
    let head = "ncols 60\nnrows 50\nxllcorner 500000\nyllcorner 4000000\ncellsize 10\nNODATA_value -9999\n";
    place.write("dem.asc", head.to_owned() + &(0..50).map(row).collect::<String>());
    place.write("dem.prj", "EPSG:32631");
    place
}

/// A feature collection in the CRS of the grid, of geometries as text and their names.
fn features(geometries: &[(&str, &str)]) -> String {
    let feature = |(name, geometry): &(&str, &str)| {
        format!(r#"{{"type":"Feature","properties":{{"name":"{name}"}},"geometry":{geometry}}}"#)
    };
    let all: Vec<String> = geometries.iter().map(feature).collect();
    let crs = r#""crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::32631"}}"#;
    format!(r#"{{"type":"FeatureCollection",{crs},"features":[{}]}}"#, all.join(","))
}

/// The corners of a rectangle as a ring; the upper left corner of the grid is at 0, 0, and y runs down.
fn ring([x, y, width, height]: [f64; 4]) -> String {
    let at = |x: f64, y: f64| format!("[{},{}]", 500_000.0 + x, 4_000_500.0 - y);
    let corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)];
    format!("[{}]", corners.map(|(x, y)| at(x, y)).join(","))
}

fn polygon(rings: &[[f64; 4]]) -> String {
    let rings: Vec<String> = rings.iter().map(|own| ring(*own)).collect();
    format!(r#"{{"type":"Polygon","coordinates":[{}]}}"#, rings.join(","))
}

/// The properties of the features of a file.
fn properties(place: &Place, name: &str) -> Vec<Value> {
    let found: Value = serde_json::from_slice(&std::fs::read(place.path(name)).unwrap()).unwrap();
    found["features"].as_array().unwrap().iter().map(|own| own["properties"].clone()).collect()
}

fn near(found: &Value, expected: f64) {
    let number = found.as_f64().unwrap_or_else(|| panic!("{found} is no number"));
    assert!((number - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{number} {expected}");
}

/// A CSV has a row for each polygon, empty or not, and no geometry, so that every name of a property is free.
#[test]
fn a_table_has_a_row_for_each_polygon() {
    let place = place();
    let shapes = [polygon(&[[0.0, 0.0, 25.0, 10.0]]), "null".to_owned()];
    place.write("zones.geojson", features(&[("x, y", &shapes[0]), ("none", &shapes[1])]));
    let table = |name: &str, options: &[&str]| {
        place.ok(&[&["zonal", "dem.asc", "zones.geojson", name], options].concat());
        std::fs::read_to_string(place.path(name)).unwrap()
    };
    let expected = "id,name,count,mean\n1,\"x, y\",2.5,0.8\n2,none,0,\n";
    assert_eq!(table("t.csv", &["--stat", "count,mean"]), expected);
    assert!(!place.path("t.prj").exists());
    assert_eq!(
        table("t.txt", &["--stat", "min", "--prefix", "x"]).lines().next(),
        Some("id,name,xmin")
    );
    assert_eq!(table("u", &["--stat", "count,mean", "-f", "CSV"]), expected);
}

#[test]
fn statistics_are_those_found_by_hand() {
    let place = place();
    let shapes = [
        // Cells 0 to 1 of row 0, and the left half of cell 2.
        ("row", polygon(&[[0.0, 0.0, 25.0, 10.0]])),
        // Cells around the void, and the void.
        ("void", polygon(&[[20.0, 40.0, 30.0, 10.0]])),
        ("hole", polygon(&[[100.0, 100.0, 30.0, 30.0], [110.0, 110.0, 10.0, 10.0]])),
        // Half of it is beyond the grid.
        ("beyond", polygon(&[[590.0, 490.0, 20.0, 20.0]])),
        ("outside", polygon(&[[700.0, 0.0, 20.0, 20.0]])),
        ("nothing", "null".to_owned()),
    ];
    let shapes: Vec<(&str, &str)> =
        shapes.iter().map(|(name, text)| (*name, text.as_str())).collect();
    place.write("zones.geojson", features(&shapes));
    let stat =
        "count,voids,sum,mean,min,max,range,stdev,variance,median,p90,majority,minority,variety";
    let made = place.ok(&["zonal", "dem.asc", "zones.geojson", "o.geojson", "--stat", stat]);
    assert!(made.out.contains("2 of 6 zones reach beyond the grid"), "{}", made.out);
    assert!(made.out.contains("2 of 6 zones have no valid sample"), "{}", made.out);
    let found = properties(&place, "o.geojson");
    assert_eq!(found[0]["name"], "row");
    let check = |at: usize, expected: &[(&str, f64)]| {
        expected.iter().for_each(|(name, value)| near(&found[at][*name], *value));
    };
    check(
        0,
        &[("count", 2.5), ("voids", 0.0), ("sum", 2.0), ("mean", 0.8), ("min", 0.0), ("max", 2.0)],
    );
    check(0, &[("range", 2.0), ("variance", 0.56), ("stdev", 0.56_f64.sqrt())]);
    check(
        0,
        &[("median", 1.0), ("p90", 2.0), ("majority", 0.0), ("minority", 2.0), ("variety", 3.0)],
    );
    check(
        1,
        &[("count", 2.0), ("voids", 1.0), ("sum", 242.0 + 244.0), ("min", 242.0), ("max", 244.0)],
    );
    check(2, &[("count", 8.0), ("mean", 671.0), ("variety", 8.0), ("majority", 610.0)]);
    check(3, &[("count", 1.0), ("mean", 49.0 * 60.0 + 59.0)]);
    for at in [4, 5] {
        check(at, &[("count", 0.0), ("voids", 0.0), ("variety", 0.0)]);
        assert!(
            ["sum", "mean", "min", "p90", "majority"].iter().all(|name| found[at][*name].is_null())
        );
    }
    for (cells, count) in [("center", 2.0), ("touched", 3.0), ("exact", 2.5)] {
        let name = format!("{cells}.geojson");
        place.ok(&["zonal", "dem.asc", "zones.geojson", &name, "--cells", cells, "--prefix", "d_"]);
        near(&properties(&place, &name)[0]["d_count"], count);
    }
}

/// Counties: each cell of a partition belongs to them with all its area.
#[test]
fn zones_that_share_borders_share_cells_in_any_format_and_any_way_of_making() {
    let place = Place::new();
    place.ok(&["synth", "coverage,vertices=9000,features=40,seed=3", "zones.fgb"]);
    // A grid without a CRS, as the zones have none, that holds them all.
    place.ok(&["convert", "synth:rough,size=900,seed=4", "far.asc", "-q"]);
    let text = std::fs::read_to_string(place.path("far.asc")).unwrap();
    let near = |line: &str| match line.split_whitespace().next().unwrap_or_default() {
        "xllcorner" => "xllcorner -1000".to_owned(),
        "yllcorner" => "yllcorner -1000".to_owned(),
        _ => line.to_owned(),
    };
    place.write("dem.asc", text.lines().map(|line| near(line) + "\n").collect::<String>());
    place.ok(&["convert", "dem.asc", "dem.tif", "-f", "COG", "-q"]);
    let zonal = |name: &str, more: &[&str]| {
        let make =
            ["zonal", "dem.tif", "zones.fgb", name, "--stat", "count,mean,p25,variety", "-q"];
        place.ok(&[&make[..], more].concat());
        std::fs::read(place.path(name)).unwrap()
    };
    let first = zonal("a.geojson", &["--threads", "1"]);
    for (i, more) in
        [&["--threads", "3"][..], &["--memory", "64M"], &["--threads", "2", "--memory", "48M"]]
            .into_iter()
            .enumerate()
    {
        assert!(zonal(&format!("b{i}.geojson"), more) == first, "{more:?}");
    }
    let counts = properties(&place, "a.geojson");
    assert_eq!(counts.len(), 40);
    let total: f64 = counts.iter().map(|own| own["count"].as_f64().unwrap()).sum();
    // Nothing between them is lost or counted twice: their areas, of which a cell has 100 square units, add up.
    let found: Value = serde_json::from_slice(&first).unwrap();
    let area = |ring: &Value| {
        let at: Vec<[f64; 2]> = serde_json::from_value(ring.clone()).unwrap();
        at.windows(2).map(|pair| pair[0][0] * pair[1][1] - pair[1][0] * pair[0][1]).sum::<f64>()
            / 2.0
    };
    let rings =
        found["features"].as_array().unwrap().iter().map(|own| &own["geometry"]["coordinates"][0]);
    let expected: f64 = rings.map(|ring| area(ring).abs()).sum::<f64>() / 100.0;
    assert!((total - expected).abs() < 1e-6 * expected && total > 200_000.0, "{total} {expected}");
    for ending in ["fgb", "shp"] {
        place.ok(&["zonal", "dem.tif", "zones.fgb", &format!("c.{ending}"), "-q"]);
        place.ok(&[
            "simplify",
            &format!("c.{ending}"),
            &format!("{ending}.geojson"),
            "--tolerance",
            "0",
            "-q",
        ]);
        let [mut a, mut b] = ["a.geojson", &format!("{ending}.geojson")].map(|name| {
            let all = properties(&place, name);
            all.iter().map(|own| own["count"].as_f64().unwrap()).collect::<Vec<_>>()
        });
        a.sort_by(f64::total_cmp);
        b.sort_by(f64::total_cmp);
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-6 * a), "{ending}");
    }
}

#[test]
fn zones_in_degrees_are_those_in_metres() {
    let place = place();
    let zone = polygon(&[[33.0, 47.0, 401.0, 333.0]]);
    place.write("zones.geojson", features(&[("one", &zone)]));
    place.ok(&[
        "simplify",
        "zones.geojson",
        "degrees.geojson",
        "--tolerance",
        "0",
        "--to-crs",
        "EPSG:4326",
        "-q",
    ]);
    for (zones, name) in [("zones.geojson", "a.geojson"), ("degrees.geojson", "b.geojson")] {
        place.ok(&["zonal", "dem.asc", zones, name, "-q"]);
    }
    let [a, b] =
        ["a.geojson", "b.geojson"].map(|name| properties(&place, name)[0]["mean"].as_f64());
    assert!((a.unwrap() - b.unwrap()).abs() < 1e-3, "{a:?} {b:?}");
    let outlines = ["degrees.geojson", "b.geojson"].map(|name| {
        let text: Value =
            serde_json::from_slice(&std::fs::read(place.path(name)).unwrap()).unwrap();
        text["features"][0]["geometry"].clone()
    });
    assert_eq!(outlines[0], outlines[1]);
}

#[test]
fn heights_at_points_are_those_of_samples_and_between_them() {
    let place = place();
    place.write("points.csv", "name,x,y\nsample,500005,4000495\nbetween,500010,4000495\nvoid,500035,4000455\nbeyond,499000,4000000\n");
    place.write("points.prj", "EPSG:32631");
    place.ok(&["sample", "dem.asc", "points.csv", "o.geojson", "-q"]);
    let found = properties(&place, "o.geojson");
    let heights: Vec<Option<f64>> = found.iter().map(|own| own["height"].as_f64()).collect();
    assert_eq!(heights, [Some(0.0), Some(0.5), None, None]);
    assert_eq!(found[1]["name"], "between");
    place.ok(&[
        "sample",
        "dem.asc",
        "points.csv",
        "n.geojson",
        "--resampling",
        "near",
        "-a",
        "z0",
        "-q",
    ]);
    let near = properties(&place, "n.geojson")[1]["z0"].as_f64();
    assert!(near == Some(0.0) || near == Some(1.0), "{near:?}");
    // A line from the first sample to the twelfth.
    let line = r#"{"type":"LineString","coordinates":[[500005,4000495],[500115,4000495]]}"#;
    place.write("line.geojson", features(&[("line", line)]));
    place.ok(&["sample", "dem.asc", "line.geojson", "l.geojson", "--with-z", "--step", "22", "-q"]);
    let text: Value =
        serde_json::from_slice(&std::fs::read(place.path("l.geojson")).unwrap()).unwrap();
    let vertices = text["features"][0]["geometry"]["coordinates"].as_array().unwrap();
    let z: Vec<f64> = vertices.iter().map(|at| at[2].as_f64().unwrap()).collect();
    assert_eq!(z.len(), 6);
    z.iter()
        .zip([0.0, 2.2, 4.4, 6.6, 8.8, 11.0])
        .for_each(|(z, expected)| assert!((z - expected).abs() < 1e-9));
}

/// Many points of a large grid, in any order: as one by one, and by any threads and memory.
#[test]
fn heights_do_not_depend_on_batches_threads_or_memory() {
    let place = Place::new();
    place.ok(&["convert", "synth:rough,size=1300,seed=8", "dem.tif", "-f", "COG", "-q"]);
    let mut points = String::from("x,y\n");
    for i in 0..20_000_u64 {
        let [x, y] = [i * 7919, i * 104_729].map(|at| (at % 120_011) as f64 / 3.1);
        points += &format!("{},{}\n", 499_990.0 + x, 4_750_000.0 - y / 2.0);
    }
    place.write("points.csv", points).write("points.prj", "EPSG:32631");
    let sample = |name: &str, more: &[&str]| {
        place.ok(&[&["sample", "dem.tif", "points.csv", name, "-q"][..], more].concat());
        std::fs::read(place.path(name)).unwrap()
    };
    let first = sample("a.csv", &["--threads", "1"]);
    assert!(sample("b.csv", &["--threads", "3"]) == first);
    assert!(sample("c.csv", &["--memory", "40M"]) == first);
}

#[test]
fn unsupported_inputs_are_errors() {
    let place = place();
    let square = polygon(&[[0.0, 0.0, 25.0, 10.0]]);
    let bow = r#"{"type":"Polygon","coordinates":[[[500000,4000000],[500090,4000090],[500090,4000000],[500000,4000090],[500000,4000000]]]}"#;
    let line = r#"{"type":"LineString","coordinates":[[500005,4000495],[500115,4000495]]}"#;
    place.write("zones.geojson", features(&[("a", &square)]));
    place.write("bow.geojson", features(&[("a", &square), ("b", bow)]));
    place.write("line.geojson", features(&[("a", line)]));
    place.write("plain.wkt", "POLYGON ((1 1, 2 1, 2 2, 1 1))");
    let table: [(&[&str], i32, &str); 12] = [
        (&["zonal", "dem.asc", "line.geojson", "o.geojson"], 65, "LineString has no area"),
        (
            &["zonal", "dem.asc", "bow.geojson", "o.geojson"],
            65,
            "rings of the polygon cross or overlap",
        ),
        (&["zonal", "dem.asc", "zones.geojson", "o.gpx"], 2, "GPX does not support Polygon"),
        (&["zonal", "dem.asc", "zones.geojson", "o.wkt"], 2, "WKT does not support properties"),
        (&["zonal", "dem.asc", "zones.geojson", "o.geojson", "--stat", "p101"], 2, "p0 to p100"),
        (
            &["zonal", "dem.asc", "zones.geojson", "zones.geojson", "--overwrite"],
            2,
            "zones.geojson",
        ),
        (&["zonal", "dem.asc", "no.geojson", "o.geojson"], 65, "no.geojson"),
        (&["zonal", "dem.asc", "plain.wkt", "o.geojson"], 65, "CRS"),
        (&["sample", "dem.asc", "line.geojson", "o.geojson"], 65, "several positions"),
        (&["sample", "dem.asc", "zones.geojson", "o.geojson", "--step", "3"], 2, "requires"),
        (
            &["sample", "dem.asc", "line.geojson", "o.geojson", "--with-z", "--step", "1e-9"],
            75,
            "longer",
        ),
        (
            &["sample", "dem.asc", "line.geojson", "o.geojson", "--with-z", "-a", "z"],
            2,
            "cannot be used with",
        ),
    ];
    for (args, code, words) in table {
        place.fails(args, code, &[words]);
        assert!(!place.path("o.geojson").exists(), "{args:?}");
    }
    place.ok(&["zonal", "dem.asc", "zones.geojson", "once.geojson", "-q"]);
    place.fails(
        &["zonal", "dem.asc", "once.geojson", "o.geojson"],
        65,
        &["have a property count", "--prefix"],
    );
    place.ok(&["zonal", "dem.asc", "once.geojson", "o.geojson", "--prefix", "b_", "-q"]);
    // The option that is named is one of the verb.
    place.write("p.csv", "x,y,height\n500005,4000495,7\n").write("p.prj", "EPSG:32631");
    place.write(
        "p.geojson",
        features(&[("a", r#"{"type":"Point","coordinates":[500005,4000495]}"#)]),
    );
    place.fails(
        &["sample", "dem.asc", "p.geojson", "q.geojson", "-a", "name"],
        65,
        &["have a property name", "--attribute"],
    );
    place.fails(
        &["zonal", "dem.asc", "zones.geojson", "q.geojson", "--layer", "x"],
        2,
        &["--layer applies to TopoJSON"],
    );
    // A property never takes the column of another.
    place.ok(&["sample", "dem.asc", "p.geojson", "q.csv", "-a", "x", "-q"]);
    assert!(
        std::fs::read_to_string(place.path("q.csv")).unwrap().starts_with("id,part,x,y,name,x_\n")
    );
}

/// A feature file in degrees with one polygon.
fn in_degrees(place: &Place, name: &str, [west, south, east, north]: [f64; 4]) {
    let ring = format!(
        "[[{west},{south}],[{east},{south}],[{east},{north}],[{west},{north}],[{west},{south}]]"
    );
    place.write(
        name,
        format!(r#"{{"type":"Feature","properties":{{}},"geometry":{{"type":"Polygon","coordinates":[{ring}]}}}}"#),
    );
}

/// Zones that hold the whole grid count all of it, or are refused; they are never silently without samples.
#[test]
fn zones_around_the_grid_hold_all_of_it_or_are_refused() {
    let place = place();
    for (at, bounds) in
        [[2.0, 35.0, 4.0, 37.0], [-10.0, 20.0, 20.0, 50.0], [-60.0, 30.0, 60.0, 40.0]]
            .iter()
            .enumerate()
    {
        in_degrees(&place, "zone.geojson", *bounds);
        let name = format!("o{at}.geojson");
        place.ok(&["zonal", "dem.asc", "zone.geojson", &name, "-q"]);
        near(&properties(&place, &name)[0]["count"], 60.0 * 50.0 - 1.0);
    }
    for bounds in [[-180.0, -90.0, 180.0, 90.0], [-100.0, -90.0, 100.0, 90.0]] {
        in_degrees(&place, "zone.geojson", bounds);
        let ran = place.run(&["zonal", "dem.asc", "zone.geojson", "world.geojson", "-q"]);
        assert!(ran.code == 65 || ran.code == 2, "{}", ran.err);
        assert!(ran.err.contains("zone.geojson: feature 1"), "{}", ran.err);
    }
}

/// A grid around a pole, and one that counts longitudes from 0 to 360.
#[test]
fn zones_and_points_meet_grids_at_the_pole_and_beyond_180_degrees() {
    let place = Place::new();
    let row =
        |row: i32| (0..40).map(|col| format!("{} ", row * 40 + col)).collect::<String>() + "\n";
    let rows: String = (0..40).map(row).collect();
    let head = "ncols 40\nnrows 40\nxllcorner -200000\nyllcorner -200000\ncellsize 10000\n";
    place.write("pole.asc", head.to_owned() + &rows).write("pole.prj", "EPSG:3031");
    place.write("points.csv", "lon,lat\n10,-89.5\n190,-89.5\n");
    place.ok(&["sample", "pole.asc", "points.csv", "o.geojson", "-q"]);
    let heights = properties(&place, "o.geojson");
    assert!(heights.iter().all(|own| own["height"].is_number()) && heights[0] != heights[1]);
    in_degrees(&place, "zone.geojson", [5.0, -89.6, 15.0, -89.2]);
    place.ok(&["zonal", "pole.asc", "zone.geojson", "z.geojson", "-q"]);
    assert!(properties(&place, "z.geojson")[0]["count"].as_f64().unwrap() > 1.0);
    let head = "ncols 40\nnrows 40\nxllcorner 330\nyllcorner 0\ncellsize 0.5\n";
    place.write("turn.asc", head.to_owned() + &rows).write("turn.prj", "EPSG:4326");
    place.write("west.csv", "lon,lat\n-20,10\n340,10\n");
    place.ok(&["sample", "turn.asc", "west.csv", "w.geojson", "-q"]);
    let heights = properties(&place, "w.geojson");
    assert!(heights[0]["height"].is_number() && heights[0] == heights[1], "{heights:?}");
    in_degrees(&place, "zone.geojson", [-20.0, 5.0, -15.0, 10.0]);
    place.ok(&["zonal", "turn.asc", "zone.geojson", "t.geojson", "-q"]);
    near(&properties(&place, "t.geojson")[0]["count"], 100.0);
}

/// Whole numbers stay whole; what was computed from them need not.
#[test]
fn values_of_grids_of_whole_numbers_are_integers() {
    let place = place();
    place.write("zones.geojson", features(&[("one", &polygon(&[[0.0, 0.0, 25.0, 10.0]]))]));
    place.ok(&["convert", "dem.asc", "whole.tif", "--type", "int16", "-q"]);
    let stat = "min,max,median,majority,mean";
    place.ok(&["zonal", "whole.tif", "zones.geojson", "o.geojson", "--stat", stat, "-q"]);
    let found = &properties(&place, "o.geojson")[0];
    assert!(
        ["min", "max", "median", "majority"].iter().all(|name| found[*name].is_i64()),
        "{found}"
    );
    near(&found["mean"], 0.8);
    place.write("point.csv", "x,y\n500015,4000495\n").write("point.prj", "EPSG:32631");
    for (resampling, is_whole) in [("near", true), ("bilinear", false)] {
        let name = format!("{resampling}.fgb");
        place.ok(&["sample", "whole.tif", "point.csv", &name, "--resampling", resampling, "-q"]);
        let kind = if is_whole { "height: integer" } else { "height: real" };
        assert!(place.ok(&["info", &name]).out.contains(kind), "{resampling}");
    }
}
