//! `--clip`: grids in the polygons of a file, by every verb that reads grids, and proved as such.

use std::fmt::Write as _;

use crate::cli_support::{GRID, Place, json};
use crate::shapes::{collection, ring};

const TERRAIN: &str = "synth:rough,width=230,height=190,seed=5";
/// What is the same of all meshes here; tiles of 32 cells, so that borders cross seams.
const MAKE: [&str; 4] = ["--max-error", "4", "--tile", "32"];

/// A polygon with a hole whose border runs along samples, and one of two parts that overlaps it.
fn areas() -> String {
    let outer = ring(&[[20.0, 12.0], [180.3, 5.1], [200.0, 120.0], [64.0, 180.5], [3.2, 96.0]]);
    let hole = ring(&[[60.0, 60.0], [96.0, 60.0], [96.0, 100.0], [60.0, 100.0]]);
    let (over, apart) = (
        ring(&[[190.0, 110.0], [229.0, 110.0], [229.0, 140.0], [190.0, 140.0]]),
        ring(&[[150.0, 160.0], [190.0, 160.0], [170.0, 189.0]]),
    );
    collection(&[
        format!(r#"{{"type":"Polygon","coordinates":[{outer},{hole}]}}"#),
        format!(r#"{{"type":"MultiPolygon","coordinates":[[{over}],[{apart}]]}}"#),
    ])
}

fn place() -> Place {
    let place = Place::new();
    place.write("areas.geojson", areas());
    place
}

/// A mesh without the lines that tell what it was made of.
fn unsigned(place: &Place, name: &str) -> Vec<u8> {
    let bytes = place.bytes(name);
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|some| some == end).unwrap() + end.len();
    let head = String::from_utf8(bytes[..at].to_vec()).unwrap();
    let told: Vec<&str> = head.lines().filter(|line| !line.starts_with("comment")).collect();
    [told.join("\n").as_bytes(), &bytes[at..]].concat()
}

#[test]
fn a_clipped_mesh_is_proved_with_its_polygons_and_fails_without() {
    let place = place();
    for bound in ["samples", "surface"] {
        let make = ["tin", TERRAIN, "a.ply", "--clip", "areas.geojson", "--bound", bound];
        let made = place.ok(&[&make[..], &MAKE, &["--overwrite", "--verify", "--json"]].concat());
        let made = json(&made.out);
        assert_eq!(made["verify"]["passed"], true);
        assert_eq!(made["valid_samples"], made["verify"]["valid_samples"]);
        assert!(made["valid_samples"].as_u64().unwrap() < 230 * 190 * 3 / 4);
        place.ok(&["verify", "a.ply", TERRAIN, "--clip", "areas.geojson"]);
        let ran = place.run(&["verify", "a.ply", TERRAIN, "--json"]);
        let found = json(&ran.out);
        assert_eq!((ran.code, &found["passed"]), (1, &false.into()));
        assert!(found["uncovered_samples"]["count"].as_u64().unwrap() > 10_000);
        let told = found["failures"].to_string();
        assert!(told.contains("clipped to areas.geojson: pass it with --clip"), "{told}");
    }
    // The other way around, too: samples that should be void are not.
    place.ok(&[&["tin", TERRAIN, "b.ply"][..], &MAKE].concat());
    let ran = place.run(&["verify", "b.ply", TERRAIN, "--clip", "areas.geojson", "--json"]);
    let found = json(&ran.out);
    assert_eq!(ran.code, 1);
    assert!(found["void_cells"]["count"].as_u64().unwrap() > 10_000);
    assert!(!found["failures"].to_string().contains("--clip"), "{found}");
}

#[test]
fn clipping_gives_the_bytes_of_a_grid_that_is_void_there() {
    let place = place();
    let clip = ["--clip", "areas.geojson"];
    place.ok(&["convert", TERRAIN, "all.tif", "-f", "GTiff"]);
    place.ok(&[&["convert", TERRAIN, "masked.tif", "-f", "GTiff"][..], &clip].concat());
    for more in
        [&[][..], &["--fit-heights"], &["--strict", "--no-drop"], &["--max-triangles", "2500"]]
    {
        let goal = if more.contains(&"--max-triangles") { &MAKE[2..] } else { &MAKE[..] };
        let tin = |grid, mesh| [&["tin", grid, mesh, "--overwrite"][..], goal, more].concat();
        place.ok(&tin("masked.tif", "by_hand.ply"));
        place.ok(&[tin("all.tif", "clipped.ply"), clip.to_vec()].concat());
        assert!(unsigned(&place, "clipped.ply") == unsigned(&place, "by_hand.ply"), "{more:?}");
    }
    let contour = |grid, lines| ["contour", grid, "-o", lines, "--interval", "20"];
    place.ok(&contour("masked.tif", "by_hand.geojson"));
    place.ok(&[&contour("all.tif", "clipped.geojson")[..], &clip].concat());
    assert!(place.bytes("clipped.geojson") == place.bytes("by_hand.geojson"));
    let view = |grid, picture| ["view", grid, "-o", picture, "--width", "90"];
    place.ok(&view("masked.tif", "by_hand.png"));
    place.ok(&[&view("all.tif", "clipped.png")[..], &clip].concat());
    assert!(place.bytes("clipped.png") == place.bytes("by_hand.png"));
    let info = |grid| ["info", grid, "--stats", "--json"];
    let by_hand = json(&place.ok(&info("masked.tif")).out);
    let clipped = json(&place.ok(&[&info("all.tif")[..], &clip].concat()).out);
    assert_eq!(clipped["stats"], by_hand["stats"]);
    assert_eq!(clipped["details"]["clip"], "areas.geojson");
    let least = ["tin", "all.tif", "a.ply", "--max-error", "9", "--method", "vip"];
    place.ok(&[&least[..], &clip].concat());
    // What it was clipped by is not judged without the polygons.
    let ran = place.run(&["verify", "a.ply", "masked.tif"]);
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!((ran.out + &ran.err).contains("clip"));
    let ran = place.ok(&[&["verify", "a.ply", "all.tif"][..], &clip].concat());
    assert!(ran.out.contains("every promise is kept"));
}

/// The plain grid has its samples at 105, 115, ... and 225, 215, 205.
#[test]
fn a_sample_on_a_border_stays_and_one_in_a_hole_does_not() {
    let place = Place::new();
    place.write("dem.asc", GRID);
    let valid = |polygons: &str| {
        place.write("areas.wkt", polygons);
        let told = place.ok(&["info", "dem.asc", "--clip", "areas.wkt", "--stats", "--json"]).out;
        let stats = &json(&told)["stats"];
        (stats["valid"].as_u64().unwrap(), stats["min"].as_f64().unwrap())
    };
    assert_eq!(valid("POLYGON ((105 225, 125 225, 125 205, 105 205, 105 225))"), (9, 1.0));
    assert_eq!(valid("POLYGON ((105.01 225, 125 225, 125 205, 105.01 205, 105.01 225))"), (6, 2.0));
    let hole = "(106 224, 124 224, 124 206, 106 206, 106 224)";
    let holed = format!("POLYGON ((105 225, 125 225, 125 205, 105 205, 105 225), {hole})");
    assert_eq!(valid(&holed), (8, 1.0), "all but the 9 in the middle");
    assert_eq!(valid(&format!("{holed}\nPOLYGON ({hole})")), (9, 1.0), "another fills the hole");
    assert_eq!(valid("POLYGON ((115 215, 116 215, 116 216, 115 215))"), (1, 9.0), "a corner");
}

#[test]
fn threads_memory_plans_and_formats_leave_no_trace() {
    let place = place();
    let make = [&["tin", TERRAIN, "a.ply", "--clip", "areas.geojson"][..], &MAKE].concat();
    place.ok(&make);
    let expected = place.bytes("a.ply");
    for machine in [&["--threads", "1"][..], &["--threads", "3", "--memory", "28M"]] {
        place.ok(&[&make[..], machine, &["--overwrite"]].concat());
        assert!(place.bytes("a.ply") == expected, "{machine:?}");
    }
    let plan = ["plan", "tin", TERRAIN, "-o", "work", "--clip", "areas.geojson"];
    place.ok(&[&plan[..], &MAKE, &["--strip-rows", "2", "-q"]].concat());
    // Wherever it is run from.
    let away = place.path("away");
    std::fs::create_dir(&away).unwrap();
    let run = place.command(&["run", "../work", "-q"]).current_dir(&away).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert!(place.bytes("work/mesh.ply") == expected);
    let work = ["tin", TERRAIN, "b.ply", "--clip", "areas.geojson", "--workdir", "w"];
    place.ok(&[&work[..], &MAKE].concat());
    assert!(place.bytes("b.ply") == expected);
    // The same polygons in another format.
    place.ok(&["line", "areas.geojson", "areas.fgb", "--tolerance", "0"]);
    std::fs::create_dir(place.path("fgb")).unwrap();
    std::fs::rename(place.path("areas.fgb"), place.path("fgb/areas.geojson")).unwrap();
    place.ok(&[&["tin", TERRAIN, "c.ply", "--clip", "fgb/areas.geojson"][..], &MAKE].concat());
    assert!(place.bytes("c.ply") == expected);
}

#[test]
fn work_that_was_begun_with_other_polygons_is_not_gone_on_with() {
    let place = place();
    let plan = ["plan", "tin", TERRAIN, "-o", "work", "--strip-rows", "2", "-q"];
    let clip = ["--clip", "areas.geojson"];
    place.ok(&[&plan[..], &MAKE, &clip].concat());
    let other = areas().replace("501700", "501710");
    assert_ne!(other, areas());
    place.write("areas.geojson", other);
    place.fails(&["run", "work"], 65, &["areas.geojson", "changed since the plan was made"]);
    place.write("areas.geojson", areas());
    place.fails(&[&plan[..], &MAKE].concat(), 2, &["work"]);
    place.ok(&["run", "work", "-q"]);
    let work = ["tin", TERRAIN, "b.ply", "--workdir", "w", "-q"];
    place.ok(&[&work[..], &MAKE, &clip].concat());
    place.write("other.geojson", areas());
    for other in [&["--clip", "other.geojson"][..], &[]] {
        let ran = place.run(&[&work[..], &MAKE, other, &["--overwrite"]].concat());
        assert_eq!(ran.code, 2, "{}", ran.err);
    }
}

#[test]
fn what_cannot_be_clipped_to_is_refused() {
    let place = place();
    let tin = |clip: &str, code: i32, words: &[&str]| {
        let args = [&["tin", TERRAIN, "a.ply", "--clip", clip][..], &MAKE].concat();
        place.fails(&args, code, &[&[clip][..], words].concat());
    };
    let line = r#"{"type":"LineString","coordinates":[[500100,4749000],[500200,4749100]]}"#;
    let square = ring(&[[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]]);
    let square = format!(r#"{{"type":"Polygon","coordinates":[{square}]}}"#);
    place.write("line.geojson", collection(&[square.clone(), line.to_owned()]));
    tin("line.geojson", 65, &["feature 2", "is a LineString", "not a polygon to clip the grid to"]);
    let far = ring(&[[900.0, 1.0], [990.0, 1.0], [990.0, 9.0]]);
    place.write(
        "far.geojson",
        collection(&[format!(r#"{{"type":"Polygon","coordinates":[{far}]}}"#)]),
    );
    tin("far.geojson", 65, &["polygons contain no sample of the grid"]);
    let between = ring(&[[1.2, 1.2], [1.8, 1.2], [1.8, 1.8]]);
    place.write(
        "between.geojson",
        collection(&[format!(r#"{{"type":"Polygon","coordinates":[{between}]}}"#)]),
    );
    tin("between.geojson", 65, &["polygons contain no sample of the grid"]);
    let thin = ring(&[[1.0, 1.0], [9.0, 1.0], [9.0, 1.5]]);
    let thin = collection(&[format!(r#"{{"type":"Polygon","coordinates":[{thin}]}}"#)]);
    place.write("thin.geojson", thin);
    let args = [&["tin", TERRAIN, "a.ply", "--clip", "thin.geojson"][..], &MAKE].concat();
    place.fails(&args, 65, &["no cell with four valid samples", "clip it to larger polygons"]);
    place.write("wgs.geojson", collection(&[square]).replace("EPSG::32631", "EPSG::4326"));
    tin("wgs.geojson", 65, &["EPSG:4326", "EPSG:32631", "reproject one of them"]);
    place.write("areas.wkt", "POLYGON ((500000 4750000, 500900 4750000, 500900 4749000))");
    tin("areas.wkt", 65, &["unknown", "EPSG:32631", "set it in the file"]);
    place.write("none.geojson", collection(&[]));
    tin("none.geojson", 65, &["contains no polygon"]);
    tin("lost.geojson", 65, &["no such file", "check the name"]);
    let mut many = "POLYGON ((".to_owned();
    for i in 0..400_000 {
        write!(many, "{} {},", 500_000 + i % 997, 4_749_000 + i % 991).unwrap();
    }
    place.write("many.wkt", many + "500000 4749000))").write("many.prj", "EPSG:32631");
    let job = [&["tin", TERRAIN, "of_many.ply", "--clip", "many.wkt"][..], &MAKE].concat();
    place.ok_as_advised(&job, "22M", &["many.wkt", "400001 vertices need 16 MiB"]);
    place.fails(
        &[
            &[
                "tin",
                TERRAIN,
                "areas.geojson",
                "--clip",
                "areas.geojson",
                "--overwrite",
                "-f",
                "PLY",
            ][..],
            &MAKE,
        ]
        .concat(),
        2,
        &["output is also an input"],
    );
    place.ok(&["synth", "cloud,size=20,density=2,seed=5", "a.laz", "-q"]);
    let cloud = ["tin", "a.laz", "a.obj", "--max-error", "1", "--clip", "areas.geojson"];
    place.fails(&cloud, 65, &["do not form a surface"]);
    place.ok(&[&["tin", TERRAIN, "m.ply"][..], &MAKE].concat());
    place.fails(&["info", "m.ply", "--clip", "areas.geojson"], 2, &["--clip is for grid files"]);
    place.fails(
        &["view", "m.ply", "-o", "m.png", "--clip", "areas.geojson"],
        2,
        &["--clip is for"],
    );
}
