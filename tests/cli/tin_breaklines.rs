//! `--breaklines`: edges of the mesh follow the lines of a file, and are proved to.

use crate::cli_support::{Place, json};
use crate::shapes::{collection, list, ring};
use crate::tin_fit::alike_however_made;

const TERRAIN: &str = "synth:coast,width=230,height=190,seed=2";
/// What is the same of all meshes here; tiles of 32 cells, so that lines cross many seams.
const MAKE: [&str; 4] = ["--max-error", "4", "--tile", "32"];
const FOLLOW: [&str; 2] = ["--breaklines", "roads.geojson"];

/// A road with bends, one along a seam, one straight across all and beyond, two that share a border, one outside.
fn roads() -> String {
    let bends: Vec<_> =
        (0..60).map(|i| [3.7 * f64::from(i), 95.0 + 60.0 * (f64::from(i) * 0.21).sin()]).collect();
    let corners = [[60.0, 20.0], [100.3, 24.0], [110.0, 70.0], [64.0, 77.0]];
    let beside = [[100.3, 24.0], [160.0, 20.0], [150.0, 80.0], [110.0, 70.0]];
    let line = |at: &[[f64; 2]]| format!(r#"{{"type":"LineString","coordinates":{}}}"#, list(at));
    let polygon = |at: &[[f64; 2]]| format!(r#"{{"type":"Polygon","coordinates":[{}]}}"#, ring(at));
    collection(&[
        line(&bends),
        line(&[[4.0, 64.0], [200.0, 64.0], [200.0, 170.0]]),
        line(&[[-30.0, -20.0], [300.0, 260.0]]),
        polygon(&corners),
        polygon(&beside),
        line(&[[5.0, -9.0], [80.0, -9.0]]),
    ])
}

fn place() -> Place {
    let place = Place::new();
    place.write("roads.geojson", roads());
    place
}

#[test]
fn edges_that_follow_are_proved_and_a_mesh_without_them_fails() {
    let place = place();
    let plain = json(&place.ok(&[&["tin", TERRAIN, "p.ply", "--json"][..], &MAKE].concat()).out);
    assert!(plain.get("breaklines").is_none());
    for more in [&[][..], &["--bound", "surface"], &["--fit-heights"], &["--no-drop", "--strict"]] {
        let args = ["tin", TERRAIN, "a.ply", "--overwrite", "--verify", "--json"];
        let made = json(&place.ok(&[&args[..], &MAKE, &FOLLOW, more].concat()).out);
        let (lines, proved) = (&made["breaklines"], &made["verify"]);
        assert_eq!(proved["passed"], true, "{more:?}");
        assert_eq!((&lines["segments"], &lines["outside"]), (&71.into(), &1.into()));
        assert_eq!((&lines["file"], &lines["apart"]), (&"roads.geojson".into(), &0.into()));
        assert_eq!(lines, &proved["breaklines"]);
        assert!(proved["on_breaklines"].as_u64().unwrap() > 100, "{proved}");
        assert!(
            more.contains(&"--fit-heights")
                || made["vertices"].as_u64() > plain["vertices"].as_u64()
        );
        place.ok(&["verify", "a.ply", TERRAIN, FOLLOW[0], FOLLOW[1]]);
        let ran = place.run(&["verify", "a.ply", TERRAIN]);
        assert_eq!(ran.code, 3, "{}", ran.err);
        let told = "not judged: whether edges follow the lines of roads.geojson (--breaklines)";
        assert!(ran.out.contains(told), "{}", ran.out);
    }
    let ran = place.run(&["verify", "p.ply", TERRAIN, FOLLOW[0], FOLLOW[1], "--json"]);
    let found = json(&ran.out);
    assert_eq!(ran.code, 1);
    assert!(found["not_followed"]["count"].as_u64().unwrap() > 60, "{found}");
    assert!(
        found["failures"].to_string().contains("breaklines that edges do not follow"),
        "{found}"
    );
}

#[test]
fn every_format_and_a_budget_hold_them() {
    let place = place();
    for mesh in ["a.ply", "a.obj", "a.stl", "a.glb"] {
        place.ok(&[&["tin", TERRAIN, mesh, "--verify"][..], &MAKE, &FOLLOW].concat());
        place.ok(&["verify", mesh, TERRAIN, FOLLOW[0], FOLLOW[1], "--max-error", "4"]);
    }
    let told = place.ok(&[&["tin", TERRAIN, "b.ply"][..], &MAKE, &FOLLOW].concat()).out;
    assert!(told.contains("71 segments of roads.geojson, followed; 1 are outside"), "{told}");
    let args = ["tin", TERRAIN, "c.ply", "--max-vertices", "3200", "--tile", "32", "--json"];
    let made = json(&place.ok(&[&args[..], &FOLLOW, &["--verify"]].concat()).out);
    assert!(made["vertices"].as_u64().unwrap() <= 3200);
    assert_eq!(made["verify"]["passed"], true);
}

/// Where a seam's patch is as narrow as without lines, one vertex here is left without an edge along its line.
#[test]
fn no_edge_is_missing_where_many_lines_cross_seams() {
    let place = Place::new();
    let land = "synth:rough,size=514,seed=143";
    place.ok(&["contour", land, "-o", "c.fgb", "--interval", "10", "--tolerance", "5"]);
    let lines = ["--breaklines", "c.fgb"];
    let make = ["tin", land, "o.ply", "--max-error", "3", "--tile", "128", "--verify"];
    place.ok(&[&make[..], &lines].concat());
}

#[test]
fn plans_threads_and_memory_leave_no_trace() {
    let lines = tempfile::tempdir().unwrap();
    let file = lines.path().join("roads.geojson");
    std::fs::write(&file, roads()).unwrap();
    let file = file.to_str().unwrap();
    let place = alike_however_made(&["--breaklines", file]);
    place.ok(&["verify", "e.ply", "dem.tif", "--breaklines", file]);
    // Work that was begun with other lines is not gone on with.
    let plan = ["plan", "tin", "dem.tif", "-o", "new", "--max-error", "5", "--tile", "48"];
    place.ok(&[&plan[..], &["--breaklines", file]].concat());
    std::fs::write(file, roads().replace("500040,", "500050,")).unwrap();
    place.fails(&["run", "new"], 65, &["roads.geojson", "changed since the plan was made"]);
}

#[test]
fn lines_in_either_direction_are_the_same_lines() {
    let place = place();
    let wkt = |at: &[[f64; 2]]| {
        let at: Vec<_> = at
            .iter()
            .map(|[c, r]| format!("{} {}", 500_000.0 + 10.0 * c, 4_750_000.0 - 10.0 * r))
            .collect();
        format!("LINESTRING ({})", at.join(", "))
    };
    let line = [[4.0, 7.0], [180.3, 33.6], [90.0, 120.0], [20.2, 169.0]];
    let back: Vec<_> = line.into_iter().rev().collect();
    let twice = format!("{}\n{}", wkt(&back), wkt(&line));
    let made = [wkt(&line), wkt(&back), twice].map(|lines| {
        place.write("l.wkt", lines).write("l.prj", "EPSG:32631");
        let make = ["tin", TERRAIN, "l.ply", "--breaklines", "l.wkt", "--overwrite"];
        place.ok(&[&make[..], &MAKE].concat());
        place.bytes("l.ply")
    });
    assert!(made[0] == made[1] && made[0] == made[2]);
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let place = place();
    let tin = |file: &str, code: i32, words: &[&str]| {
        let args = [&["tin", TERRAIN, "a.ply", "--breaklines", file][..], &MAKE].concat();
        place.fails(&args, code, &[&[file][..], words].concat());
    };
    tin("lost.geojson", 65, &["no such file"]);
    place.write("none.geojson", collection(&[]));
    tin("none.geojson", 65, &["contains no line"]);
    place.write("peaks.wkt", "LINESTRING (500010 4749990, 500100 4749800)\nPOINT (500010 4749990)");
    place.write("peaks.prj", "EPSG:32631");
    tin("peaks.wkt", 65, &["a point is not a line", "--keep-points"]);
    place.write("far.wkt", "LINESTRING (0 0, 10 10)").write("far.prj", "EPSG:32631");
    tin("far.wkt", 65, &["no line lies on the grid"]);
    place.write("wgs.geojson", roads().replace("EPSG::32631", "EPSG::4326"));
    tin("wgs.geojson", 65, &["EPSG:4326", "EPSG:32631", "reproject one of them"]);
    let many: Vec<_> = (0..200_000).map(|i| format!("{} 4749000", 500_000 + i % 900)).collect();
    place
        .write("many.wkt", format!("LINESTRING ({})", many.join(", ")))
        .write("many.prj", "EPSG:32631");
    let job = [&["tin", TERRAIN, "m.ply", "--breaklines", "many.wkt"][..], &MAKE].concat();
    place.ok_as_advised(&job, "22M", &["many.wkt", "200000 vertices need 10 MiB"]);
    let job = [&["tin", TERRAIN, "a.ply", "--max-error", "4"][..], &FOLLOW].concat();
    for other in ["greedy4", "vip"] {
        place.fails(
            &[&job[..], &["--method", other]].concat(),
            2,
            &[other, "cannot be used with --breaklines"],
        );
    }
    place.fails(&[&job[..], &["--min-angle", "20"]].concat(), 2, &["--breaklines", "--min-angle"]);
    let over = [&["tin", TERRAIN, "roads.geojson", "-f", "PLY", "--overwrite"][..], &MAKE, &FOLLOW];
    place.fails(&over.concat(), 2, &["output is also an input"]);
}
