//! Outputs in another reference system (`--to-crs`): positions against those of PROJ, all else as without,
//! and what is refused.

use crate::cli_support::{Place, Ran, json};
use terrane_base::geom::wkt::of_srs;
use terrane_crs::{CoordinateOperation, CoordinateOperationOptions};
use terrane_mesh as mesh;

/// A grid in the middle of Switzerland (CH1903+ / LV95), of waves, without a void.
fn grid() -> String {
    let mut text =
        "ncols 60\nnrows 50\nxllcorner 2600000\nyllcorner 1200000\ncellsize 25\n".to_owned();
    for row in 0..50 {
        let height =
            |col: i32| 500.0 + 80.0 * (f64::from(col) / 7.0).sin() * (f64::from(row) / 9.0).cos();
        let heights: Vec<String> = (0..60).map(|col| format!("{:.2}", height(col))).collect();
        text += &heights.join(" ");
        text.push('\n');
    }
    text
}

fn place() -> Place {
    let place = Place::new();
    place.write("dem.asc", grid()).write("dem.prj", "EPSG:2056");
    place
}

/// The numbers of a text, in their order.
fn numbers(text: &str) -> Vec<f64> {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-');
    text.split(|c| !is_part(c)).filter_map(|word| word.parse().ok()).collect()
}

fn near(found: &[f64], wanted: &[f64], most: f64) {
    assert_eq!(found.len(), wanted.len(), "{found:?}");
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= most;
    assert!(found.iter().zip(wanted).all(is_near), "{found:?} {wanted:?}");
}

#[test]
fn lines_are_where_proj_has_them_there_and_back() {
    let place = Place::new();
    place.write("a.wkt", "LINESTRING(2600000 1200000,2600500 1200250,2601000 1199000)\n");
    place.write("a.prj", "EPSG:2056");
    let asked = ["line", "a.wkt", "b.wkt", "--tolerance", "0", "--to-crs", "EPSG:4326", "--json"];
    let ran = place.ok(&asked);
    let told = json(&ran.out);
    // Of PROJ 9.5, by EPSG:1676.
    let proj =
        [7.4386324209, 46.9510827719, 7.4452007163, 46.9533314305, 7.4517664999, 46.9420869489];
    near(&numbers(&String::from_utf8(place.bytes("b.wkt")).unwrap()), &proj, 5e-9);
    assert_eq!(told["crs"], "EPSG:2056 (CH1903+ / LV95)");
    assert_eq!(told["transformed"]["crs"], "EPSG:4326 (WGS 84)");
    assert_eq!(told["transformed"]["operation"], "CH1903+ to WGS 84 (1) (EPSG:1676)");
    assert_eq!(told["transformed"]["accuracy"], 1.0);
    assert!(String::from_utf8(place.bytes("b.prj")).unwrap().contains("\"WGS 84\""));
    place.ok(&["line", "b.wkt", "c.wkt", "--tolerance", "0", "--to-crs", "EPSG:2056"]);
    let back = [2_600_000.0, 1_200_000.0, 2_600_500.0, 1_200_250.0, 2_601_000.0, 1_199_000.0];
    near(&numbers(&String::from_utf8(place.bytes("c.wkt")).unwrap()), &back, 1e-3);
    // Without an extent in the header and beyond what one shift holds for, by name.
    place
        .write("far.wkt", "LINESTRING(2600000 1200000,3900000 2900000)\n")
        .write("far.prj", "EPSG:2056");
    let asked = ["line", "far.wkt", "d.wkt", "--tolerance", "0", "--to-crs", "EPSG:4326"];
    place.fails(
        &asked,
        65,
        &["no shift from CH1903+ to WGS 84 is known for the whole extent of the data"],
    );
}

/// Lines of features, as nested lists of positions.
fn lines(place: &Place, name: &str) -> Vec<Vec<[f64; 3]>> {
    let text = String::from_utf8(place.bytes(name)).unwrap();
    let positions = |line: &serde_json::Value| -> Vec<[f64; 3]> {
        let all = line["geometry"]["coordinates"].as_array().unwrap();
        let number = |at: &serde_json::Value, axis: usize| at[axis].as_f64().unwrap_or(0.0);
        all.iter().map(|at| [number(at, 0), number(at, 1), number(at, 2)]).collect()
    };
    json(&text)["features"].as_array().unwrap().iter().map(positions).collect()
}

#[test]
fn contours_are_those_of_the_grid_taken_to_another_system() {
    let place = place();
    let asked = ["contour", "dem.asc", "--interval", "20", "--3d", "--tolerance", "15", "--json"];
    let plain = json(&place.ok(&[&asked[..], &["-o", "a.geojson"]].concat()).out);
    let to = ["-o", "b.geojson", "--to-crs", "EPSG:32632"];
    let moved = json(&place.ok(&[&asked[..], &to].concat()).out);
    for member in ["lines", "rings", "vertices", "original_vertices", "levels", "crs"] {
        assert_eq!(plain[member], moved[member], "{member}");
    }
    assert!(plain.get("transformed").is_none());
    let written = String::from_utf8(place.bytes("b.geojson")).unwrap();
    assert!(written.contains("urn:ogc:def:crs:EPSG::32632"), "{written:.300}");
    let extent = Some([2_600_000.0, 1_200_000.0, 2_601_500.0, 1_201_250.0]);
    let options = CoordinateOperationOptions { extent, ..CoordinateOperationOptions::default() };
    let operation =
        CoordinateOperation::between(&of_srs("EPSG:2056"), &of_srs("EPSG:32632"), &options)
            .unwrap();
    let (before, after) = (lines(&place, "a.geojson"), lines(&place, "b.geojson"));
    assert!(before.len() > 10 && before.len() == after.len());
    for (a, b) in before.iter().flatten().zip(after.iter().flatten()) {
        near(b, &operation.point(*a).unwrap(), 1e-6);
    }
    // The same bytes with other threads and memory.
    let other =
        [&asked[..], &["-o", "c.geojson", "--to-crs", "EPSG:32632", "--threads", "1"]].concat();
    place.ok(&[&other[..], &["--memory", "60M"]].concat());
    assert_eq!(place.bytes("b.geojson"), place.bytes("c.geojson"));
}

#[test]
fn what_a_simplification_decides_is_decided_before() {
    let place = place();
    place.ok(&["contour", "dem.asc", "-o", "a.fgb", "--interval", "5", "-q"]);
    for more in [&["--topology"][..], &["--method", "rdp"], &["--hierarchy", "h"]] {
        let asked =
            [&["line", "a.fgb", "--tolerance", "10", "--json", "--overwrite"][..], more].concat();
        let with = |out: &[&str]| {
            // The output comes second.
            let mut all = asked.clone();
            all.splice(2..2, out[..1].iter().copied());
            json(&place.ok(&[&all[..], &out[1..]].concat()).out)
        };
        let plain = with(&["b.fgb"]);
        let moved = with(&["c.fgb", "--to-crs", "EPSG:4326"]);
        for member in ["kept", "vertices", "largest_distance", "arcs", "input_crossings"] {
            assert_eq!(plain[member], moved[member], "{member} {more:?}");
        }
    }
    let asked = ["line", "a.fgb", "d.fgb", "--tolerance", "1", "--topology", "--decimals", "6"];
    place.fails(
        &[&asked[..], &["--to-crs", "EPSG:4326"]].concat(),
        2,
        &["--decimals", "--topology"],
    );
    let asked = ["line", "a.fgb", "e.wkt", "--tolerance", "1", "--decimals", "6", "-q"];
    place.ok(&[&asked[..], &["--to-crs", "EPSG:4326"]].concat());
    let text = String::from_utf8(place.bytes("e.wkt")).unwrap();
    let longest =
        text.split([' ', ',', '(', ')']).filter_map(|word| Some(word.split_once('.')?.1.len()));
    assert_eq!(longest.max(), Some(6));
}

#[test]
fn rectangles_of_the_system_before_do_not_come_along() {
    let place = Place::new();
    let line = r#"{"type":"Feature","bbox":[1,2,3,4],"properties":{},"geometry":{"type":"LineString","coordinates":[[7.4,46.9,5],[7.5,47]]}}"#;
    place.write(
        "a.geojson",
        format!(r#"{{"type":"FeatureCollection","bbox":[1,2,3,4],"features":[{line}]}}"#),
    );
    place.ok(&[
        "line",
        "a.geojson",
        "b.geojson",
        "--tolerance",
        "0",
        "--to-crs",
        "EPSG:2056",
        "-q",
    ]);
    let text = String::from_utf8(place.bytes("b.geojson")).unwrap();
    assert!(!text.contains("bbox"), "{text}");
    // A height stays, and none stays none.
    let found = numbers(&json(&text)["features"][0]["geometry"]["coordinates"].to_string());
    assert_eq!((found.len(), found[2]), (5, 5.0), "{text}");
}

fn vertices(place: &Place, name: &str) -> (Vec<[f64; 3]>, Vec<[u64; 3]>) {
    let source = mesh::open(&place.path(name)).unwrap();
    let info = source.info();
    let mut vertices = vec![[0.0; 3]; info.vertices as usize];
    let mut triangles = vec![[0; 3]; info.triangles as usize];
    source.read_vertices(0, &mut vertices).unwrap();
    source.read_triangles(0, &mut triangles).unwrap();
    (vertices, triangles)
}

#[test]
fn meshes_of_every_format_have_the_same_triangles_elsewhere_and_are_not_proved_there() {
    let place = place();
    let extent = Some([2_600_012.5, 1_200_012.5, 2_601_487.5, 1_201_237.5]);
    let options = CoordinateOperationOptions { extent, ..CoordinateOperationOptions::default() };
    for target in ["EPSG:32632", "EPSG:4326"] {
        let operation =
            CoordinateOperation::between(&of_srs("EPSG:2056"), &of_srs(target), &options).unwrap();
        for format in mesh::FORMATS {
            let [plain, moved] = ["a", "b"].map(|name| format!("{name}.{}", format.extensions[0]));
            // LandXML holds no degrees.
            let to = if format.name == "LandXML" { "EPSG:32632" } else { target };
            if to != target {
                continue;
            }
            let make = |name: &str, more: &[&str]| {
                let asked =
                    ["tin", "dem.asc", name, "--max-error", "2", "--tile", "16", "--overwrite"];
                place.ok(&[&asked[..], more].concat())
            };
            make(&plain, &["-q"]);
            let told = json(&make(&moved, &["--to-crs", to, "--json"]).out);
            assert_eq!(told["transformed"]["accuracy"], 1.0);
            assert!(
                told["notes"].to_string().contains("the error bound holds in EPSG:2056"),
                "{told}"
            );
            let ((before, these), (after, those)) =
                (vertices(&place, &plain), vertices(&place, &moved));
            assert!(these == those && !these.is_empty(), "{moved}");
            let slack = match (format.single_precision, target) {
                (false, "EPSG:4326") => 1e-9,
                (false, _) => 2e-3,
                (true, "EPSG:4326") => 1e-8,
                (true, _) => 1e-3,
            };
            for (a, b) in before.iter().zip(&after) {
                let [x, y, z] = operation.point(*a).unwrap();
                assert!(
                    (b[0] - x).abs().max((b[1] - y).abs()) < slack && (b[2] - z).abs() < 1e-3,
                    "{moved}: {b:?} {x} {y} {z}"
                );
            }
            let prj = String::from_utf8(place.bytes("b.prj")).unwrap();
            assert!(
                prj.contains(if target == "EPSG:4326" { "GEOGCS" } else { "zone 32N" }),
                "{prj}"
            );
            let refused = place.run(&["verify", &moved, "dem.asc", "--max-error", "2"]);
            // Those that do not state what they were are told by the system beside them.
            match refused.code {
                65 => assert!(refused.err.contains("EPSG:2056") && refused.err.contains("; ")),
                1 => assert!(refused.out.contains("that of the grid is EPSG:2056"), "{refused:?}"),
                _ => panic!("{moved}: {refused:?}"),
            }
        }
    }
}

/// A GTX file of one height around the data.
fn geoid(height: f32) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [46.0f64, 7.0, 1.0, 1.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    bytes.extend([3u32, 3].iter().flat_map(|v| v.to_be_bytes()));
    bytes.extend([height; 9].iter().flat_map(|v| v.to_be_bytes()));
    bytes
}

/// An NTv2 file from an ellipsoid to that of GRS 80, of one shift, 46 to 48 degrees north and 6 to 9 east.
fn shifts(axis: f64, [up, west]: [f32; 2]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut put = |key: &str, value: &[u8]| {
        out.extend(format!("{key:8}").as_bytes());
        out.extend(value);
        out.resize(out.len().next_multiple_of(16), 0);
    };
    let counts = [("NUM_OREC", 11u32), ("NUM_SREC", 11), ("NUM_FILE", 1)];
    counts.iter().for_each(|(key, count)| put(key, &count.to_le_bytes()));
    for (key, text) in [
        ("GS_TYPE", "SECONDS "),
        ("VERSION", "NTv2.0  "),
        ("SYSTEM_F", "CH1903+ "),
        ("SYSTEM_T", "ETRS89  "),
    ] {
        put(key, text.as_bytes());
    }
    for (key, axis) in [
        ("MAJOR_F", axis),
        ("MINOR_F", axis - 2e4),
        ("MAJOR_T", 6_378_137.0),
        ("MINOR_T", 6_356_752.0),
    ] {
        put(key, &axis.to_le_bytes());
    }
    for key in ["SUB_NAME", "PARENT", "CREATED", "UPDATED"] {
        put(key, b"NONE    ");
    }
    for (key, value) in [
        ("S_LAT", 46.0),
        ("N_LAT", 48.0),
        ("E_LONG", -9.0),
        ("W_LONG", -6.0),
        ("LAT_INC", 1.0),
        ("LONG_INC", 1.0f64),
    ] {
        put(key, &(value * 3600.0).to_le_bytes());
    }
    put("GS_COUNT", &12u32.to_le_bytes());
    for _ in 0..12 {
        out.extend([up, west, 0.0, 0.0].iter().flat_map(|value: &f32| value.to_le_bytes()));
    }
    out
}

#[test]
fn geoids_and_grids_of_shifts_are_used() {
    let place = place();
    place.write("g.gtx", geoid(49.5)).write("s.gsb", shifts(6_377_397.155, [-4.0, 3.0]));
    let make = |name: &str, more: &[&str]| -> Ran {
        let asked = ["tin", "dem.asc", name, "--max-error", "2", "--overwrite", "--json"];
        place.ok(&[&asked[..], more].concat())
    };
    make("a.ply", &[]);
    let told = json(&make("b.ply", &["--to-crs", "EPSG:4979", "--geoid", "g.gtx"]).out);
    assert!(told["notes"].to_string().contains("assumed to be above the geoid"), "{told}");
    let ((before, _), (after, _)) = (vertices(&place, "a.ply"), vertices(&place, "b.ply"));
    assert!(before.iter().zip(&after).all(|(a, b)| (b[2] - a[2] - 49.5).abs() < 1e-9));
    // Of one datum, and by the grid: the difference is the shift.
    make("c.ply", &["--to-crs", "EPSG:4150"]);
    let told = json(&make("d.ply", &["--to-crs", "EPSG:4258", "--shift-grid", "s.gsb"]).out);
    assert_eq!(told["transformed"]["accuracy"], serde_json::Value::Null);
    assert_eq!(told["transformed"]["operation"], "shift grid from CH1903+ to ETRS89");
    let ((old, _), (new, _)) = (vertices(&place, "c.ply"), vertices(&place, "d.ply"));
    for (a, b) in old.iter().zip(&new) {
        near(&[b[0] - a[0], b[1] - a[1]], &[-3.0 / 3600.0, -4.0 / 3600.0], 1e-9);
    }
    place.write("t.gsb", shifts(6_378_388.0, [0.0, 0.0])).write("bad.gtx", "x");
    let fails = |more: &[&str], code: i32, words: &[&str]| {
        let asked = ["tin", "dem.asc", "z.ply", "--max-error", "2"];
        place.fails(&[&asked[..], more].concat(), code, words);
    };
    fails(&["--to-crs", "EPSG:4258", "--shift-grid", "t.gsb"], 65, &["from CH1903+ to ETRS89"]);
    fails(&["--to-crs", "EPSG:4979", "--geoid", "bad.gtx"], 65, &["bad.gtx", "not a valid GTX"]);
    fails(&["--to-crs", "EPSG:4979", "--geoid", "none.gtx"], 65, &["none.gtx", "no such file"]);
    fails(
        &["--to-crs", "EPSG:4326", "--geoid", "g.gtx"],
        2,
        &["requires a target CRS with a vertical axis"],
    );
    fails(&["--geoid", "g.gtx"], 2, &["--to-crs"]);
    let asked = [
        "tin",
        "dem.asc",
        "z.glb",
        "--max-error",
        "2",
        "--to-crs",
        "EPSG:4979",
        "--geoid",
        "g.gtx",
    ];
    place.fails(&asked, 65, &["GLB rounds heights"]);
}

#[test]
fn what_cannot_be_done_is_refused_by_name_and_nothing_is_written() {
    let place = place();
    place.write("none.asc", grid()).write("south.asc", grid()).write("south.prj", "EPSG:5513");
    place.write("local.asc", grid()).write("local.prj", r#"LOCAL_CS["site",UNIT["metre",1]]"#);
    for (input, target, words) in [
        ("dem.asc", "EPSG:65000", &["unknown EPSG code"][..]),
        ("dem.asc", "EPSG:4978", &["geocentric"]),
        ("dem.asc", "EPSG:27200", &["nzmg"]),
        (
            "dem.asc",
            "EPSG:28992",
            &["no shift from Amersfoort to WGS 84 is known for the whole extent"],
        ),
        ("dem.asc", "EPSG:4326+5773", &["use a target CRS without heights"]),
        ("none.asc", "EPSG:4326", &["none.asc", "CRS is missing"]),
        ("local.asc", "EPSG:4326", &["local.asc", "a local (engineering) CRS"]),
        ("south.asc", "EPSG:4326", &["south.asc", "south and west"]),
    ] {
        for job in [
            &["tin", input, "z.ply", "--max-error", "2", "--to-crs", target][..],
            &["contour", input, "-o", "z.fgb", "--interval", "20", "--to-crs", target],
        ] {
            place.fails(job, 65, words);
        }
    }
    for (output, more) in [("z.ply", &["--verify"][..]), ("z", &["--split", "1"])] {
        let tin = ["tin", "dem.asc", output, "--max-error", "2", "--to-crs", "EPSG:4326"];
        place.fails(&[&tin[..], more].concat(), 2, &["--to-crs"]);
    }
    place.fails(
        &["tin", "dem.asc", "z.ply", "--max-error", "2", "--to-crs", "nowhere"],
        2,
        &["EPSG:CODE"],
    );
    place.ok(&["synth", "cloud,size=20,density=1,seed=1", "c.las", "-q"]);
    let cloud = ["tin", "c.las", "z.ply", "--max-error", "1", "--to-crs", "EPSG:4326"];
    place.fails(&cloud, 2, &["--to-crs is for grids"]);
}

#[test]
fn plans_of_meshes_lead_elsewhere_as_well() {
    let place = place();
    place.write("g.gtx", geoid(49.5));
    let to =
        ["--max-error", "2", "--tile", "16", "--to-crs", "EPSG:4979", "--geoid", "g.gtx", "-q"];
    place.ok(&[&["tin", "dem.asc", "whole.ply"], &to[..]].concat());
    place.ok(&[&["tin", "dem.asc", "again.ply", "--workdir", "w"], &to[..]].concat());
    assert!(place.bytes("again.ply") == place.bytes("whole.ply"));
    assert_eq!(place.bytes("again.prj"), place.bytes("whole.prj"));

    let cut = ["--strip-rows", "2"];
    place.ok(&[&["plan", "tin", "dem.asc", "-o", "work"], &to[..], &cut].concat());
    // Tasks know nothing of it, so those of another system are as good.
    place.ok(&["run", "work", "-q"]);
    assert!(place.bytes("work/mesh.ply") == place.bytes("whole.ply"));
    place.fails(&["finish", "work", "blocks", "--split", "1"], 2, &["--to-crs"]);
    place.write("g.gtx", geoid(50.0));
    place.fails(&["finish", "work", "late.ply"], 65, &["g.gtx"]);
}

#[test]
fn meshes_across_180_degrees_go_on_and_those_around_a_pole_are_refused() {
    let place = Place::new();
    let at = |x: i32, y: i32, cell: i32| {
        let head = format!("ncols 60\nnrows 50\nxllcorner {x}\nyllcorner {y}\ncellsize {cell}\n");
        head + grid().split_once("cellsize 25\n").unwrap().1
    };
    place.write("a.asc", at(600_000, 5_200_000, 5000)).write("a.prj", "EPSG:32660");
    let told =
        place.ok(&["tin", "a.asc", "m.ply", "--max-error", "2", "--to-crs", "EPSG:4326", "--json"]);
    assert!(told.out.contains("beyond 180 degrees"), "{}", told.out);
    let (found, triangles) = vertices(&place, "m.ply");
    let (low, high) =
        found.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v[0]), h.max(v[0])));
    assert!(high - low < 10.0 && (low < -180.0 || high > 180.0), "{low} {high}");
    let wide = |t: &[u64; 3]| (found[t[0] as usize][0] - found[t[1] as usize][0]).abs() > 20.0;
    assert!(!triangles.iter().any(wide));
    let cut = ["contour", "a.asc", "-o", "b.fgb", "--interval", "20", "--to-crs", "EPSG:3857"];
    place.fails(&cut, 65, &["cross the meridian", "discontinuous"]);
    place.write("p.asc", at(-150_000, -125_000, 5000)).write("p.prj", "EPSG:3413");
    let pole = ["tin", "p.asc", "q.ply", "--max-error", "2", "--to-crs", "EPSG:4326"];
    place.fails(&pole, 65, &["surround a pole", "EPSG:3413"]);
    place.ok(&["tin", "p.asc", "q.ply", "--max-error", "2", "--to-crs", "EPSG:3995", "-q"]);
}
