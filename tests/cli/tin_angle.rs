//! `tin --min-angle`: no smaller angle in the whole mesh, stated and proved in every format, and by plan.

use crate::cli_support::{Place, json};
use crate::tin_fit::alike_however_made;

const GRIDS: [&str; 3] = [
    "synth:rough,width=200,height=170,seed=5",
    "synth:smooth,width=220,height=150,seed=5",
    "synth:coast,width=190,height=170,seed=3",
];
const ANGLE: [&str; 2] = ["--min-angle", "25"];

#[test]
fn meshes_state_the_smallest_angle_they_have_and_it_is_proved() {
    let place = Place::new();
    for (grid, more) in GRIDS.iter().zip([&[][..], &["--fit-heights"], &["--bound", "surface"]]) {
        for format in terrane_mesh::FORMATS {
            let mesh = format!("o.{}", format.extensions[0]);
            let error = if grid.contains("smooth") { "0.3" } else { "4" };
            let make = ["tin", grid, &mesh, "--max-error", error, "--tile", "64", "--overwrite"];
            let make = [&make[..], &["--verify", "--json"], more].concat();
            let plain = json(&place.ok(&make).out);
            assert!(plain.get("thin_triangles").is_none() && plain.get("min_angle").is_none());
            let thin =
                json(&place.run(&["verify", &mesh, grid, "--min-angle", "25", "--json"]).out);
            assert!(thin["thin_triangles"]["count"].as_u64().unwrap() > 0, "{mesh}");
            assert_eq!(thin["passed"], false);
            let made = json(&place.ok(&[&make[..], &ANGLE].concat()).out);
            assert_eq!(
                (&made["min_angle"], &made["thin_triangles"]["count"]),
                (&25.0.into(), &0.into())
            );
            assert_eq!(
                (&made["verify"]["passed"], &made["verify"]["min_angle"]),
                (&true.into(), &25.0.into())
            );
            assert!(made["verify"].get("thin_triangles").is_none());
            let quality = json(&place.ok(&["info", &mesh, "--quality", "--json"]).out);
            let least = quality["quality"]["smallest_angles"]["min"].as_f64().unwrap();
            assert!(least >= 25.0 - 1e-3, "{mesh}: {least}");
            let [more, few] = [&made, &plain].map(|made| made["vertices"].as_u64().unwrap());
            assert!(few < more && more < 3 * few, "{grid} as {mesh}: {more} for {few}");
        }
    }
}

/// Where some thousand seams and corners meet, patches that are as narrow as they are elsewhere leave triangles.
#[test]
fn no_angle_is_left_where_many_tiles_meet() {
    let place = Place::new();
    let make = ["tin", "synth:rough,size=2049", "o.ply", "--max-error", "0.4", "--tile", "128"];
    place.ok(&[&make[..], &["--min-angle", "20"]].concat());
}

/// One of three in 1,400 that have a triangle left, with tiles as small as hardly anybody chooses.
#[test]
fn a_triangle_that_is_left_is_told_of_and_fails_the_job() {
    let place = Place::new();
    let make = ["--max-error", "10", "--min-angle", "26.5", "--tile", "32", "--no-drop"];
    let land = "synth:salt,size=570,seed=265";
    let told = place.run(&[&["tin", land, "o.ply", "--json"], &make[..]].concat());
    assert_eq!(told.code, 1, "{}", told.err);
    assert!(told.err.contains("1 triangles have an angle below 26.5"), "{}", told.err);
    let report = json(&told.out);
    assert_eq!(report["thin_triangles"]["count"], 1);
    let proved = place.run(&["verify", "o.ply", land, "--json"]);
    assert_eq!((proved.code, &json(&proved.out)["thin_triangles"]["count"]), (1, &1.into()));
    place.ok(&[&["plan", "tin", land, "-o", "w"], &make[..]].concat());
    assert_eq!(place.run(&["run", "w", "-o", "p.ply"]).code, 1);
    // All that is left is to be told again, too.
    assert_eq!(place.run(&["run", "w", "-o", "p.ply"]).code, 1);
}

#[test]
fn plans_threads_and_memory_make_the_same_mesh_of_wide_angles() {
    let place = alike_however_made(&["--min-angle", "22.5"]);
    place.ok(&["verify", "e.ply", "dem.tif"]);
    // A plan of another angle is another plan.
    let other = ["tin", "dem.tif", "c.ply", "--workdir", "d", "--max-error", "5", "--tile", "48"];
    assert_ne!(place.run(&[&other[..], &["--min-angle", "20"]].concat()).code, 0);
}

#[test]
fn angles_that_cannot_be_are_refused_by_name() {
    let place = Place::new();
    let job = ["tin", GRIDS[0], "o.ply", "--max-error", "4"];
    for (angle, told) in [("26.6", "at most 26.565"), ("60", "26.565"), ("0", "0"), ("x", "x")] {
        place.fails(&[&job[..], &["--min-angle", angle]].concat(), 2, &[told]);
    }
    place.fails(
        &["plan", "tin", GRIDS[0], "-o", "w", "--max-error", "4", "--min-angle", "30"],
        2,
        &["26.565"],
    );
    place.fails(
        &[&job[..], &["--method", "greedy4"], &ANGLE].concat(),
        2,
        &["--method greedy4 cannot be used with --min-angle"],
    );
    place.ok(&["synth", "cloud,size=20,density=2", "c.laz", "-q"]);
    let cloud = ["tin", "c.laz", "o.ply", "--max-error", "1"];
    place.fails(&[&cloud[..], &ANGLE].concat(), 2, &["--min-angle is for grids"]);
    place.ok(&cloud);
    place.fails(
        &[&["verify", "o.ply", "c.laz"], &ANGLE[..]].concat(),
        2,
        &["--min-angle is for meshes of grids"],
    );
    place.ok(&[&job[..], &["--overwrite"], &ANGLE].concat());
    let bytes = std::fs::read(place.path("o.ply")).unwrap();
    let stated = b"min angle 25\n";
    let at = bytes.windows(stated.len()).position(|some| some == stated).unwrap();
    place.write("p.ply", [&bytes[..at], b"min angle xx\n", &bytes[at + stated.len()..]].concat());
    place.fails(&["verify", "p.ply", GRIDS[0]], 65, &["p.ply", "min angle xx", "--min-angle"]);
}
