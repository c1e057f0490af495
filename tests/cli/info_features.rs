//! `terrane info` of files of features.

use crate::cli_support::{self, Place};
use crate::data;
use serde_json::{Value, json};

fn facts(place: &Place, args: &[&str]) -> Value {
    serde_json::from_str(&place.ok(&[&["info", "--json"], args].concat()).out).unwrap()
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn real_files_are_told_as_the_catalogue_has_them() {
    let place = Place::new();
    // Format, EPSG, features, geometries, vertices, first field.
    let known = [
        (
            "UScounties.shp",
            json!(["Shapefile", 4269, 3221, {"Polygon": 3072, "MultiPolygon": 149}, 837_022, "STATE_FIPS"]),
        ),
        (
            "ne_10m_rivers_lake_centerlines.shp",
            json!(["Shapefile", 4326, 1404, {"LineString": 972, "MultiLineString": 432}, 253_029, "dissolve"]),
        ),
        (
            "ne_10m_admin_0_boundary_lines_land.json",
            json!(["GeoJSON", 4326, 462, {"LineString": 92, "MultiLineString": 370}, 77_623, "featurecla"]),
        ),
        (
            "world-atlas_countries-10m.json",
            json!(["TopoJSON", 4326, 255, {"Polygon": 105, "MultiPolygon": 150}, 544_898, "name"]),
        ),
        ("nl_zones.wkt", json!(["WKT", null, 1, {"MultiPolygon": 1}, 27_182, null])),
        ("norway_main.wkt", json!(["WKT", null, 1, {"LineString": 1}, 8854, null])),
        ("tuolumne.gpx", json!(["GPX", 4326, 9, {"Point": 8, "MultiLineString": 1}, 5257, "name"])),
    ];
    for (name, expected) in known {
        let path = data::at(&format!("lines/{name}"));
        let found = facts(&place, &[path.to_str().unwrap()]);
        let names = ["format", "epsg", "features", "geometries", "vertices"];
        let mut told: Vec<Value> = names.iter().map(|name| found[name].clone()).collect();
        told.push(found["fields"][0]["name"].clone());
        assert_eq!(Value::from(told), expected, "{name}: {found}");
        assert_eq!(found["kind"], "features");
    }
}

#[test]
fn fields_bounds_and_heights_are_told() {
    let place = Place::new();
    place.write(
        "a.geojson",
        r#"{"type":"FeatureCollection","features":[
{"type":"Feature","id":1,"properties":{"name":"a","n":1,"ok":true},"geometry":{"type":"Point","coordinates":[5,60,3]}},
{"type":"Feature","properties":{"name":null,"n":2.5,"more":{"a":1}},"geometry":{"type":"Polygon","coordinates":[[[0,0],[4,0],[4,4],[0,0]],[[1,0.5],[2,0.5],[2,1],[1,0.5]]]}},
{"type":"Feature","properties":null,"geometry":{"type":"GeometryCollection","geometries":[{"type":"LineString","coordinates":[[-7,1,-2],[1,1,9]]}]}},
{"type":"Feature","properties":{"name":"b\n"},"geometry":null}]}"#,
    );
    let found = facts(&place, &["a.geojson"]);
    let kinds = json!({"null": 1, "Point": 1, "Polygon": 1, "GeometryCollection": 1});
    assert_eq!(found["geometries"], kinds);
    let counts = ["features", "ids", "lines", "outer_rings", "holes", "vertices"];
    let counts: Vec<_> = counts.iter().map(|name| found[name].as_u64().unwrap()).collect();
    assert_eq!(counts, [4, 1, 1, 1, 1, 11]);
    assert_eq!(found["bounds"], json!([-7.0, 0.0, 5.0, 60.0]));
    assert_eq!((&found["heights"], &found["measures"]), (&json!([-2.0, 9.0]), &Value::Null));
    assert_eq!(
        found["fields"],
        json!([
            {"name": "name", "type": "text", "values": 2},
            {"name": "n", "type": "real", "values": 2},
            {"name": "ok", "type": "boolean", "values": 1},
            {"name": "more", "type": "JSON", "values": 1},
        ])
    );
    let text = place.ok(&["info", "a.geojson"]).out;
    for told in [
        "4, 1 with an id",
        "null: 1, Point: 1, Polygon: 1, GeometryCollection: 1",
        "lines: 1, outer rings: 1, holes: 1",
        "-7, 0, 5, 60",
        "-2 to 9",
        "EPSG:4326",
        "name: text, null in 2 features",
    ] {
        assert!(text.contains(told), "{told:?} missing: {text}");
    }
    // Shapefiles declare their fields.
    place.write("l.wkt", "LINESTRING M (0 0 1, 5 2 2, 10 0 3)\n");
    place.ok(&["line", "l.wkt", "l.csv", "--tolerance", "0", "-q"]);
    let found = facts(&place, &["l.wkt"]);
    assert_eq!(found["measures"], json!([1.0, 3.0]));
}

#[test]
fn tables_are_grids_or_else_features() {
    let place = Place::new();
    place.write("g.csv", "x,y,z\n0,0,1\n1,0,2\n0,1,3\n1,1,4\n");
    assert_eq!(facts(&place, &["g.csv"])["kind"], "grid");
    place.write("f.csv", "id,lon,lat,name\na,0,0,x\na,1,5,x\nb,0,1,y\n");
    let found = facts(&place, &["f.csv"]);
    assert_eq!((&found["kind"], &found["features"]), (&json!("features"), &json!(2)));
    assert!(found["notes"].to_string().contains("not a grid"), "{found}");
    // A grid with a hole in it is a damaged grid, no line.
    place.write("d.csv", "x,y,z\n0,0,1\n1,0,2\n0,1,3\n5.3,1.7,4\n");
    place.fails(&["info", "d.csv"], 65, &["d.csv"]);
}

#[test]
fn objects_of_a_topology_are_told_one_by_one() {
    let place = Place::new();
    place.write(
        "t.json",
        r#"{"type":"Topology","arcs":[[[0,0],[1,1]],[[2,2],[3,3],[4,3]]],"objects":{
"a":{"type":"LineString","arcs":[0]},"b":{"type":"LineString","arcs":[1]}}}"#,
    );
    let found = facts(&place, &["t.json"]);
    assert_eq!((&found["layer"], &found["vertices"]), (&json!("a"), &json!(2)));
    assert!(found["notes"].to_string().contains("ignored: b"), "{found}");
    assert_eq!(facts(&place, &["t.json", "--layer", "b"])["vertices"], 3);
    place.fails(&["info", "t.json", "--layer", "c"], 2, &["a, b"]);
}

/// Expects one line that names the file, and nothing told.
fn fails(place: &Place, args: &[&str], name: &str) {
    let ran = place.run(args);
    assert_eq!((ran.code, ran.out.as_str(), ran.err.lines().count()), (65, "", 1), "{}", ran.err);
    assert!(ran.err.contains(name), "{name}: {}", ran.err);
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn damaged_shapefiles_are_told() {
    for name in ["buggymultiline", "buggymultipoly", "pointnan"] {
        let path = data::at(&format!("malformed/shp/{name}.shp"));
        fails(&Place::new(), &["info", path.to_str().unwrap()], name);
    }
}

#[test]
fn damaged_files_and_options_that_cannot_act_are_told() {
    let place = Place::new();
    place.write(
        "cut.geojson",
        "{\"type\":\"FeatureCollection\",\"features\":[{\"type\":\"Feature\"",
    );
    place.write("bad.wkt", "POLYGON ((0 0, 1 1, nonsense))\n");
    place.write("nan.geojson", "{\"type\":\"Point\",\"coordinates\":[1e999,0]}");
    place.write("e.gpx", "");
    for name in ["cut.geojson", "bad.wkt", "nan.geojson", "e.gpx"] {
        fails(&place, &["info", name], name);
    }
    place.write("a.wkt", "POINT (1 2)\n").write("b.wkt", "POINT (1 2)\n");
    place.fails(&["info", "a.wkt", "--band", "1"], 2, &["--band", "features"]);
    place.fails(&["info", "a.wkt", "b.wkt", "--mosaic"], 2, &["--mosaic"]);
    place.ok(&["info", "a.wkt", "--stats"]);
    place.write("g.asc", cli_support::GRID);
    place.fails(&["info", "g.asc", "--layer", "a"], 2, &["--layer"]);
    // One that is bad does not keep the others from being told about.
    let ran = place.run(&["info", "bad.wkt", "a.wkt"]);
    assert!(ran.code == 65 && ran.out.contains("Point: 1"), "{}{}", ran.out, ran.err);
}
