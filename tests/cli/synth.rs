//! `terrane synth` for clouds and lines.

use crate::cli_support::Place;
use terrane_synth::lines::SHAPES;

#[test]
fn a_cloud_by_name_becomes_a_file() {
    let place = Place::new();
    let cloud = "cloud,size=60,density=5,seed=7";
    place.ok(&["synth", cloud, "a.laz", "-q"]);
    let json = place.ok(&["synth", &format!("synth:{cloud}"), "a.las", "--json"]).out;
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    let points = report["points"].as_u64().unwrap();
    assert!((16_000..20_000).contains(&points), "{json}");
    assert_eq!(report["point_format"], 6);
    for name in ["a.laz", "a.las"] {
        let mut reader = las::Reader::from_path(place.path(name)).unwrap();
        assert_eq!(reader.read_all().unwrap().len() as u64, points);
    }
    let told = place.ok(&["synth", cloud, "b.laz", "--point-format", "3", "--threads", "1"]).out;
    assert!(told.contains("b.laz") && told.contains("points per second"), "{told}");
    let header = las::Reader::from_path(place.path("b.laz")).unwrap().header().clone();
    assert_eq!((header.version().minor, header.point_format().to_u8().unwrap() & 63), (2, 3));
    place.fails(&["synth", cloud, "a.laz"], 2, &["a.laz", "--overwrite"]);
    place.ok(&["synth", cloud, "a.laz", "-q", "--overwrite"]);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let place = Place::new();
    let fails = |args: &[&str], code: i32, parts: &[&str]| {
        place.fails(&[&["synth"], args].concat(), code, parts);
    };
    fails(&["cloud,sise=5", "a.laz"], 2, &["sise", "density"]);
    fails(&["cloud", "a.tif"], 2, &["a.tif", ".laz"]);
    fails(&["cloud", "a.copc.laz"], 2, &["terrane points"]);
    fails(&["cloud", "no/a.laz"], 73, &["no/a.laz"]);
    fails(&["cloud", "a.laz", "--point-format", "9"], 2, &["point format 9"]);
    fails(&["cloud", "a.laz", "--memory", "1M"], 75, &["--memory"]);
    fails(&["rough,size=9", "a.tif", "--point-format", "6"], 2, &["--point-format"]);
    place.fails(&["info", "synth:cloud,size=9"], 2, &["synth:cloud", "terrane synth"]);
    assert!(place.files().is_empty(), "{:?}", place.files());
    assert!(place.ok(&["synth", "--help"]).out.contains("density"));
}

#[test]
fn lines_become_files_and_are_inputs_by_name() {
    let place = Place::new();
    for (shape, ending) in SHAPES.iter().zip(["shp", "fgb", "geojson", "wkt", "csv", "geojsonl"]) {
        let (name, file) =
            (format!("{},vertices=4000,features=2", shape.name), format!("a.{ending}"));
        let told = place.ok(&["synth", &name, &file, "--json"]).out;
        let report: serde_json::Value = serde_json::from_str(&told).unwrap();
        let vertices = if shape.is_rings { 8002 } else { 8000 };
        assert_eq!(
            (&report["features"], &report["vertices"]),
            (&2.into(), &vertices.into()),
            "{told}"
        );
        let by_name = format!("synth:{name}");
        place.ok(&["line", &by_name, "b.wkt", "--tolerance", "3", "-q", "--overwrite"]);
        for original in [&by_name, &file] {
            // WKT has no place for properties and ids, so they are not judged; a WKT has none.
            let has_none = original.ends_with(".wkt");
            let ran = place.run(&["verify", "b.wkt", original, "--tolerance", "3", "-q"]);
            assert_eq!(ran.code, if has_none { 0 } else { 3 }, "{original}: {}", ran.err);
            let is_told = ran.err.contains("of 2 features: not supported by WKT");
            assert!(is_told != has_none, "{original}: {}", ran.err);
        }
    }
    let cells = "synth:coverage,vertices=400,features=30";
    place.ok(&["line", cells, "c.geojson", "--tolerance", "9", "--topology", "-q"]);
    place.ok(&["verify", "c.geojson", cells, "--tolerance", "9", "--topology", "-q"]);
    place.fails(&["synth", "koch,vertices=1", "k.shp"], 2, &["vertices", "from 2"]);
    place.fails(&["synth", "koch", "k.tif"], 2, &["k.tif", ".shp"]);
    place.fails(&["synth", "koch", "k.shp", "--point-format", "6"], 2, &["--point-format"]);
    let help = place.ok(&["synth", "--help"]).out;
    let names = include_str!("../../docs/src/reference/names.md");
    let rows = SHAPES.iter().map(|shape| format!("| `{}` | {} |", shape.name, shape.about));
    for (row, shape) in rows.zip(SHAPES) {
        assert!(names.contains(&row) && help.contains(shape.about), "{row}");
    }
}
