//! `--breaklines` and `--keep-points` over clouds: posts that edges follow, points that stay, and the proof of both.

use crate::cli_support::{Place, json};

const MAKE: [&str; 5] = ["tin", "a.laz", "a.ply", "--max-error", "0.4"];
const FOLLOW: [&str; 2] = ["--breaklines", "kerbs.wkt"];
const KEEP: [&str; 2] = ["--keep-points", "kerbs.wkt"];

/// A kerb with heights, a field, a line across all and beyond, one beside, and one twice and in both directions.
const KERBS: &str =
    "LINESTRING Z (500005 4750005 240, 500031.5 4750040.25 245, 500075 4750020 243.5)
POLYGON ((500020 4750020, 500060 4750022, 500055 4750070, 500020 4750020))
LINESTRING (499000 4750030, 501000 4750041)
LINESTRING (499005 4750000, 499005 4750060)
MULTILINESTRING ((500010 4750070, 500070 4750071), (500070 4750071, 500010 4750070))";

fn place() -> Place {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=80,density=5,seed=5", "a.laz", "-q"]);
    place.write("kerbs.wkt", KERBS).write("kerbs.prj", "EPSG:32631");
    place
}

#[test]
fn lines_and_points_are_kept_and_proved() {
    let place = place();
    let plain = json(&place.ok(&[&MAKE[..], &["--json"]].concat()).out);
    assert!(plain.get("breaklines").is_none() && plain.get("keep_points").is_none());
    place.ok(&["tin", "a.laz", "p.ply", "--max-error", "0.4"]);
    for mesh in ["b.ply", "b.obj", "b.glb", "b.stl"] {
        for error in ["0.4", "0"] {
            let args = ["tin", "a.laz", mesh, "--max-error", error, "--overwrite", "--verify"];
            let made = json(&place.ok(&[&args[..], &FOLLOW, &KEEP, &["--json"]].concat()).out);
            let (lines, kept, proved) =
                (&made["breaklines"], &made["keep_points"], &made["verify"]);
            assert_eq!((&lines["segments"], &lines["outside"]), (&9.into(), &1.into()), "{made}");
            assert_eq!((&lines["file"], &lines["apart"]), (&"kerbs.wkt".into(), &0.into()));
            assert_eq!((&kept["points"], &kept["outside"]), (&15.into(), &4.into()));
            assert_eq!((kept, lines), (&proved["keep_points"], &proved["breaklines"]));
            assert_eq!((&proved["passed"], &proved["judged"]), (&true.into(), &true.into()));
            assert_eq!(proved["off_point_vertices"]["count"], 0, "{mesh} {error}");
            assert!(proved["on_breaklines"].as_u64().unwrap() > 50, "{proved}");
        }
        let proof = ["verify", mesh, "a.laz", "--max-error", "0"];
        let told = place.ok(&[&proof[..], &FOLLOW, &KEEP].concat()).out;
        assert!(
            told.contains("9 segments of kerbs.wkt, followed; 1 are outside of the cloud"),
            "{told}"
        );
        assert!(told.contains("4 points are outside of the cloud"), "{told}");
        assert!(
            told.contains("all are points of the cloud, or anchor vertices of breaklines"),
            "{told}"
        );
        let ran = place.run(&["verify", mesh, "a.laz", "--max-error", "0"]);
        // An STL has no room to say what it was made with.
        let code = if mesh == "b.stl" { 1 } else { 3 };
        assert_eq!(ran.code, code, "{mesh} {}{}", ran.out, ran.err);
        for told in ["keeps the points of kerbs.wkt (--keep", "follow the lines of kerbs.wkt (--b"]
        {
            assert!(code == 1 || ran.out.contains(told), "{}", ran.out);
        }
    }
    let ran = place.run(&[&["verify", "p.ply", "a.laz", "--json"][..], &FOLLOW, &KEEP].concat());
    let found = json(&ran.out);
    assert_eq!(ran.code, 1);
    let count = |what: &str| found[what]["count"].as_u64().unwrap();
    assert!(count("not_followed") > 10 && count("not_kept") > 3, "{found}");
    assert!(
        found["failures"].to_string().contains("breaklines that edges do not follow"),
        "{found}"
    );
}

#[test]
fn a_post_at_another_height_is_no_post() {
    let place = place();
    place.ok(&[&MAKE[..], &FOLLOW].concat());
    let lifted = KERBS.replace(" 245,", " 245.2,");
    place.write("kerbs.wkt", lifted);
    let ran = place.run(&[&["verify", "a.ply", "a.laz"][..], &FOLLOW].concat());
    assert!(ran.code == 1 && ran.out.contains("vertices off the points"), "{}", ran.out);
    // The same lines elsewhere are not followed.
    place.write("kerbs.wkt", KERBS.replace("4750070", "4750069.5"));
    let ran = place.run(&[&["verify", "a.ply", "a.laz"][..], &FOLLOW].concat());
    assert!(ran.code == 1 && ran.out.contains("edges do not follow"), "{}", ran.out);
}

#[test]
fn threads_memory_files_and_directions_leave_no_trace() {
    let place = place();
    let back: Vec<_> = KERBS.lines().rev().collect();
    let body = |more: &[&str]| {
        let args = ["tin", "a.laz", "o.ply", "--max-error", "0.3", "--overwrite", "-q"];
        place.ok(&[&args[..], &FOLLOW, &KEEP, more].concat());
        place.bytes("o.ply")
    };
    let first = body(&["--threads", "1"]);
    assert!(first == body(&["--threads", "3", "--memory", "160M"]));
    place.write("kerbs.wkt", back.join("\n"));
    assert!(first == body(&[]), "the order of lines leaves a trace");
    let point = |i: u64| {
        let [x, y] = [i * 7919 % 8000, i * 104_729 % 8000].map(|at| at as f64 / 100.0);
        format!(
            "{:.2} {:.2} {:.2}\n",
            500_000.0 + x,
            4_750_000.0 + y,
            240.0 + (i % 90) as f64 / 50.0
        )
    };
    for (name, parity) in [("even.txt", 0), ("odd.txt", 1)] {
        let points = (0..9000).filter(|i| i % 2 == parity).map(point);
        place.write(name, points.collect::<String>());
    }
    // Points as text name no system, and neither do these lines.
    place.write("bare.wkt", KERBS);
    let bare = ["--breaklines", "bare.wkt", "--keep-points", "bare.wkt"];
    let of_files = |files: [&str; 2]| {
        let args = ["tin", files[0], files[1], "o.ply", "--max-error", "0.3", "--overwrite", "-q"];
        place.ok(&[&args[..], &bare].concat());
        // The comment that names the source differs.
        let bytes = place.bytes("o.ply");
        let end = bytes.windows(10).position(|word| word == b"end_header").unwrap();
        bytes[end..].to_vec()
    };
    assert!(
        of_files(["cloud:odd.txt", "cloud:even.txt"])
            == of_files(["cloud:even.txt", "cloud:odd.txt"])
    );
}

#[test]
fn what_cannot_be_kept_over_a_cloud_is_refused() {
    let place = place();
    let tin = |option: &str, file: &str, code: i32, words: &[&str]| {
        place.fails(&[&MAKE[..], &[option, file]].concat(), code, &[&[file][..], words].concat());
    };
    tin("--breaklines", "lost.wkt", 65, &["no such file"]);
    place.write("none.geojson", r#"{"type":"FeatureCollection","features":[]}"#);
    tin("--breaklines", "none.geojson", 65, &["contains no line"]);
    tin("--keep-points", "none.geojson", 65, &["contains no point"]);
    place.write("peak.wkt", "POINT (500010 4750010)").write("peak.prj", "EPSG:32631");
    tin("--breaklines", "peak.wkt", 65, &["a point is not a line", "--keep-points"]);
    place.write("far.wkt", "LINESTRING (0 0, 10 10)").write("far.prj", "EPSG:32631");
    tin("--breaklines", "far.wkt", 65, &["no line lies within the bounds of the point cloud"]);
    tin("--keep-points", "far.wkt", 65, &["no point lies within the bounds of the point cloud"]);
    place.write("wgs.wkt", KERBS).write("wgs.prj", "EPSG:4326");
    tin(
        "--breaklines",
        "wgs.wkt",
        65,
        &["EPSG:4326", "the CRS of the cloud is EPSG:32631", "reproject one of them"],
    );
    let high = "LINESTRING Z (500010 4750010 1e12, 500020 4750010 0)";
    place.write("high.wkt", high).write("high.prj", "EPSG:32631");
    tin("--breaklines", "high.wkt", 65, &["height 1000000000000 is outside"]);
    let over = ["tin", "a.laz", "kerbs.wkt", "-f", "PLY", "--max-error", "1", "--overwrite"];
    place.fails(&[&over[..], &FOLLOW].concat(), 2, &["output is also an input"]);
    assert!(!place.path("a.ply").exists());
    place.ok(&MAKE);
    let verify = ["verify", "a.ply", "a.laz"];
    place.fails(
        &[&verify[..], &["--breaklines", "far.wkt"]].concat(),
        65,
        &["far.wkt", "the point cloud"],
    );
    place.fails(
        &[&verify[..], &["--keep-points", "far.wkt"]].concat(),
        65,
        &["far.wkt", "the point cloud"],
    );
}
