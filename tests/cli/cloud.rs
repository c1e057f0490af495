//! Clouds to meshes from the command line: made, proved, refused.

use crate::cli_support::{self, Place, json};

/// A small cloud as a file.
fn cloud(place: &Place) {
    let name = "cloud,size=120,density=6,seed=3,voids=2,tile=60";
    place.ok(&["synth", name, "a.laz", "-q"]);
}

#[test]
fn a_cloud_becomes_a_mesh_that_is_proved() {
    let place = Place::new();
    cloud(&place);
    for (format, ending) in [("PLY", "ply"), ("OBJ", "obj"), ("GLB", "glb"), ("STL", "stl")] {
        let mesh = format!("a.{ending}");
        let args =
            ["tin", "a.laz", &mesh, "--max-error", "0.25", "--class", "2", "--verify", "--json"];
        let made = json(&place.ok(&args).out);
        assert_eq!((&made["format"], &made["verify"]["passed"]), (&format.into(), &true.into()));
        let [kept, vertices, stacked] =
            [&made["points"]["kept"], &made["vertices"], &made["stacked_points"]]
                .map(|n| n.as_u64().unwrap());
        assert!(kept > 40_000 && vertices * 4 < kept && stacked < kept / 100, "{made}");
        assert!(made["max_error"].as_f64().unwrap() <= 0.25);
        let proof = ["verify", &mesh, "a.laz", "--max-error", "0.25"];
        let told = place.ok(&[&proof[..], &["--class", "2"]].concat()).out;
        assert!(told.contains("every promise is kept"), "{told}");
        // Without the filter there are trees above the mesh.
        let told = place.run(&proof);
        assert_eq!(told.code, 1, "{}{}", told.out, told.err);
    }
}

#[test]
fn threads_and_memory_leave_no_trace() {
    let place = Place::new();
    cloud(&place);
    let mesh = |input: &str, output: &str, more: &[&str]| {
        place.ok(&[&["tin", input, output, "--max-error", "0.1", "-q"], more].concat());
        let bytes = std::fs::read(place.path(output)).unwrap();
        // The comment that names the source differs.
        let from = bytes.windows(10).position(|w| w == b"end_header").unwrap();
        bytes[from..].to_vec()
    };
    let first = mesh("a.laz", "1.ply", &["--threads", "1"]);
    assert!(first == mesh("a.laz", "2.ply", &["--threads", "3", "--memory", "300M"]));
}

#[test]
fn a_tolerance_of_zero_keeps_every_point() {
    let place = Place::new();
    cloud(&place);
    let args = ["tin", "a.laz", "a.ply", "--max-error", "0", "--every", "7", "--verify", "--json"];
    let made = json(&place.ok(&args).out);
    let count = |n: &serde_json::Value| n.as_u64().unwrap();
    let kept = count(&made["points"]["kept"]) - count(&made["stacked_points"]);
    assert_eq!((count(&made["vertices"]), &made["verify"]["passed"]), (kept, &true.into()));
}

#[test]
fn what_is_about_grids_is_refused() {
    let place = Place::new();
    cloud(&place);
    place.write("g.asc", cli_support::GRID);
    let tin = |more: &[&str], words: &[&str]| {
        place.fails(&[&["tin", "a.laz", "a.ply"], more].concat(), 2, words);
    };
    tin(&["--max-error", "1", "--tile", "64"], &["--tile is for grids", "leave --tile out"]);
    tin(&["--max-error", "1", "--strict"], &["--strict is for grids"]);
    tin(&["--max-error", "1", "--bound", "surface"], &["--bound is for grids"]);
    tin(&["--max-error", "1", "--band", "2"], &["--band is for grids"]);
    tin(&["--max-vertices", "100"], &["--max-vertices is for grids"]);
    place.fails(&["tin", "g.asc", "a.laz", "a.ply", "--max-error", "1"], 2, &["cannot be mixed"]);
    let args = ["tin", "g.asc", "a.ply", "--max-error", "1", "--class", "2"];
    place.fails(&args, 2, &["--class is for point clouds"]);
    place.fails(&["tin", "a.laz", "a.laz", "--max-error", "1"], 2, &["a.laz"]);
    let none = ["tin", "a.laz", "a.ply", "--max-error", "1", "--class", "250"];
    place.fails(&none, 65, &["do not form a surface", "terrane info"]);
}
