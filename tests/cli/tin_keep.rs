//! `--keep-points`: samples nearest to the points of a file are vertices, and proved to be.

use crate::cli_support::{Place, json};
use crate::shapes::{at, collection, list};

const TERRAIN: &str = "synth:coast,width=230,height=190,seed=2";
/// What is the same of all meshes here; tiles of 32 cells, so that points lie on many seams.
const MAKE: [&str; 4] = ["--max-error", "4", "--tile", "32"];
const KEEP: [&str; 2] = ["--keep-points", "peaks.geojson"];

/// 150 points off their samples, one of them twice; a line along a seam; two points outside.
fn peaks() -> String {
    let scattered = (0..150).map(|i| {
        let (i, off) = (f64::from(i), f64::from(i % 9) * 0.1 - 0.4);
        [(i * 37.0) % 229.0 + off, (i * 53.0) % 189.0 - off]
    });
    let scattered: Vec<_> = scattered.chain([[37.2, 53.2]]).collect();
    let line: Vec<_> = (0..40).map(|i| [f64::from(i) * 4.5, 64.0 + f64::from(i % 2)]).collect();
    collection(&[
        format!(r#"{{"type":"MultiPoint","coordinates":{}}}"#, list(&scattered)),
        format!(r#"{{"type":"LineString","coordinates":{}}}"#, list(&line)),
        format!(r#"{{"type":"Point","coordinates":{}}}"#, at([229.6, 3.0])),
        format!(r#"{{"type":"Point","coordinates":{}}}"#, at([50.0, -900.0])),
    ])
}

fn place() -> Place {
    let place = Place::new();
    place.write("peaks.geojson", peaks());
    place
}

#[test]
fn what_is_kept_is_proved_and_a_mesh_without_it_fails() {
    let place = place();
    let plain = json(&place.ok(&[&["tin", TERRAIN, "p.ply", "--json"][..], &MAKE].concat()).out);
    assert!(plain.get("keep_points").is_none());
    for more in [&[][..], &["--bound", "surface"], &["--fit-heights"], &["--no-drop", "--strict"]] {
        let args = ["tin", TERRAIN, "a.ply", "--overwrite", "--verify", "--json"];
        let made = json(&place.ok(&[&args[..], &MAKE, &KEEP, more].concat()).out);
        let (kept, proved) = (&made["keep_points"], &made["verify"]);
        assert_eq!(proved["passed"], true, "{more:?}");
        assert_eq!((&kept["points"], &kept["outside"]), (&193.into(), &2.into()));
        assert_eq!(kept["file"], "peaks.geojson");
        assert_eq!(kept, &proved["keep_points"]);
        let [samples, void, vertices] =
            ["samples", "without_surface", "vertices"].map(|name| kept[name].as_u64().unwrap());
        assert!((185..193).contains(&samples) && void > 0 && vertices > 120, "{kept}");
        assert_eq!(samples, void + vertices);
        // Few of them would be vertices otherwise.
        assert!(
            more.contains(&"--fit-heights")
                || made["vertices"].as_u64() > plain["vertices"].as_u64()
        );
        place.ok(&["verify", "a.ply", TERRAIN, KEEP[0], KEEP[1]]);
        let ran = place.run(&["verify", "a.ply", TERRAIN]);
        assert_eq!(ran.code, 3, "{}", ran.err);
        let told = "not judged: whether it keeps the points of peaks.geojson (--keep-points)";
        assert!(ran.out.contains(told), "{}", ran.out);
    }
    let ran = place.run(&["verify", "p.ply", TERRAIN, KEEP[0], KEEP[1], "--json"]);
    let found = json(&ran.out);
    assert_eq!(ran.code, 1);
    assert!(found["not_kept"]["count"].as_u64().unwrap() > 100, "{found}");
    assert!(found["failures"].to_string().contains("not vertices at their height"), "{found}");
}

#[test]
fn every_format_holds_them() {
    let place = place();
    for mesh in ["a.ply", "a.obj", "a.stl", "a.glb"] {
        place.ok(&[&["tin", TERRAIN, mesh, "--verify"][..], &MAKE, &KEEP].concat());
        place.ok(&["verify", mesh, TERRAIN, KEEP[0], KEEP[1], "--max-error", "4"]);
    }
    let told = place.ok(&[&["tin", TERRAIN, "b.ply"][..], &MAKE, &KEEP].concat()).out;
    assert!(told.contains(" at 193 points of peaks.geojson; 2 points are outside"), "{told}");
}

#[test]
fn threads_memory_plans_and_other_files_leave_no_trace() {
    let place = place();
    let make = [&["tin", TERRAIN, "a.ply"][..], &MAKE, &KEEP].concat();
    place.ok(&make);
    let expected = place.bytes("a.ply");
    for machine in [&["--threads", "1"][..], &["--threads", "3", "--memory", "28M"]] {
        place.ok(&[&make[..], machine, &["--overwrite"]].concat());
        assert!(place.bytes("a.ply") == expected, "{machine:?}");
    }
    let plan = ["plan", "tin", TERRAIN, "-o", "work", "--strip-rows", "2", "-q"];
    place.ok(&[&plan[..], &MAKE, &KEEP].concat());
    // Wherever it is run from.
    let away = place.path("away");
    std::fs::create_dir(&away).unwrap();
    let run = place.command(&["run", "../work", "-q"]).current_dir(&away).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert!(place.bytes("work/mesh.ply") == expected);
    let work = ["tin", TERRAIN, "b.ply", "--workdir", "w", "--json"];
    let made = json(&place.ok(&[&work[..], &MAKE, &KEEP].concat()).out);
    assert!(made["keep_points"]["vertices"].as_u64().unwrap() > 120);
    assert!(place.bytes("b.ply") == expected);
    // The same points in another format.
    std::fs::create_dir(place.path("fgb")).unwrap();
    place.ok(&["line", "peaks.geojson", "peaks.fgb", "--tolerance", "0"]);
    std::fs::rename(place.path("peaks.fgb"), place.path("fgb/peaks.geojson")).unwrap();
    let other = ["--keep-points", "fgb/peaks.geojson"];
    place.ok(&[&["tin", TERRAIN, "c.ply"][..], &MAKE, &other].concat());
    assert!(place.bytes("c.ply") == expected);
    // Work that was begun with other points is not gone on with.
    place.ok(&[&["plan", "tin", TERRAIN, "-o", "new", "-q"][..], &MAKE, &KEEP].concat());
    let others = peaks().replace("[500045,", "[500055,");
    assert_ne!(others, peaks());
    place.write("peaks.geojson", others);
    place.fails(&["run", "new"], 65, &["peaks.geojson", "changed since the plan was made"]);
}

#[test]
fn a_budget_counts_them() {
    let place = place();
    let args = ["tin", TERRAIN, "a.ply", "--max-vertices", "1500", "--tile", "32", "--json"];
    let made = json(&place.ok(&[&args[..], &KEEP, &["--verify"]].concat()).out);
    assert!(made["vertices"].as_u64().unwrap() <= 1500);
    assert_eq!(made["verify"]["passed"], true);
}

#[test]
fn what_cannot_be_kept_is_refused() {
    let place = place();
    let tin = |file: &str, code: i32, words: &[&str]| {
        let args = [&["tin", TERRAIN, "a.ply", "--keep-points", file][..], &MAKE].concat();
        place.fails(&args, code, &[&[file][..], words].concat());
    };
    tin("lost.geojson", 65, &["no such file"]);
    place.write("none.geojson", collection(&[]));
    tin("none.geojson", 65, &["contains no point"]);
    let far = format!(r#"{{"type":"Point","coordinates":{}}}"#, at([500.0, 3.0]));
    place.write("far.geojson", collection(&[far]));
    tin("far.geojson", 65, &["no point lies on the grid"]);
    place.write("wgs.geojson", peaks().replace("EPSG::32631", "EPSG::4326"));
    tin("wgs.geojson", 65, &["EPSG:4326", "EPSG:32631", "reproject one of them"]);
    place.write("points.wkt", "POINT (500010 4749990)");
    tin("points.wkt", 65, &["unknown", "EPSG:32631", "set it in the file"]);
    let many: String =
        (0..200_000).map(|i| format!("POINT ({} 4749000)\n", 500_000 + i % 900)).collect();
    place.write("many.wkt", many).write("many.prj", "EPSG:32631");
    let job = [&["tin", TERRAIN, "m.ply", "--keep-points", "many.wkt"][..], &MAKE].concat();
    place.ok_as_advised(&job, "22M", &["many.wkt", "200000 vertices need 10 MiB"]);
    for other in [&["--method", "greedy4"][..], &["--method", "vip"]] {
        let args = ["tin", TERRAIN, "a.ply", "--max-error", "4"];
        place.fails(
            &[&args[..], &KEEP, other].concat(),
            2,
            &["cannot be used with --keep-points", "--method"],
        );
    }
    let over = [&["tin", TERRAIN, "peaks.geojson", "-f", "PLY", "--overwrite"][..], &MAKE, &KEEP];
    place.fails(&over.concat(), 2, &["output is also an input"]);
}
