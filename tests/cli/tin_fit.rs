//! `tin --fit-heights`: heights that are no sample's, within the bound all the same, in every format and by plan.

use crate::cli_support::Place;
use serde_json::Value;

pub(crate) const GRIDS: [&str; 4] = [
    "synth:rough,width=200,height=170,seed=5",
    "synth:smooth,width=220,height=150,seed=5",
    "synth:salt,width=150,height=170,seed=5",
    "synth:coast,width=190,height=170,seed=3",
];

pub(crate) fn told(place: &Place, args: &[&str]) -> Value {
    let ran = place.run(&[args, &["--json"]].concat());
    serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{args:?}: {e}: {}", ran.err))
}

#[test]
fn fitted_meshes_are_smaller_and_proved_as_written() {
    let place = Place::new();
    for (grid, bound) in GRIDS.iter().zip(["samples", "surface", "samples", "surface"]) {
        for format in terrane_mesh::FORMATS {
            let mesh = format!("o.{}", format.extensions[0]);
            let error = if grid.contains("smooth") { "0.3" } else { "4" };
            let make = ["tin", grid, &mesh, "--max-error", error, "--tile", "64", "--bound", bound];
            let make = [&make[..], &["--overwrite", "--verify"]].concat();
            let fitted = told(&place, &[&make[..], &["--fit-heights"]].concat());
            assert_eq!(
                (&fitted["fit_heights"], &fitted["verify"]["passed"]),
                (&true.into(), &true.into())
            );
            assert_eq!(fitted["verify"]["fitted"], true, "{mesh}");
            let most = fitted["max_error"].as_f64().unwrap();
            assert!((most - fitted["verify"]["max_error"].as_f64().unwrap()).abs() < 1e-5);
            let [rmse, proved] = [&fitted["rmse"], &fitted["verify"]["rmse"]].map(Value::as_f64);
            assert!((rmse.unwrap() / proved.unwrap() - 1.0).abs() < 1e-4, "{rmse:?} {proved:?}");
            let usual = told(&place, &make);
            assert!(usual["verify"]["fitted"].is_null() && usual["fit_heights"].is_null());
            let [less, more] = [&fitted, &usual].map(|made| made["vertices"].as_u64().unwrap());
            assert!(less < more, "{grid} as {mesh}: {less} of {more}");
        }
    }
}

/// Where the mesh does not say so, other heights than those of samples are a failure, and beside samples they
/// always are.
#[test]
fn what_a_fitted_mesh_does_not_state_is_held_against_it() {
    let place = Place::new();
    place.ok(&["tin", GRIDS[0], "a.ply", "--max-error", "4", "--fit-heights"]);
    assert!(place.ok(&["verify", "a.ply", GRIDS[0]]).out.contains("heights fitted"));
    let bytes = std::fs::read(place.path("a.ply")).unwrap();
    let stated = b"comment fitted heights\n";
    let at = bytes.windows(stated.len()).position(|some| some == stated).unwrap();
    let without = [&bytes[..at], b"comment sundry heights\n", &bytes[at + stated.len()..]].concat();
    place.write("b.ply", without);
    let found = told(&place, &["verify", "b.ply", GRIDS[0]]);
    assert_eq!((&found["passed"], &found["over_tolerance"]["count"]), (&false.into(), &0.into()));
    assert!(found["off_sample_vertices"]["count"].as_u64().unwrap() > 100);
    let shifted = "synth:rough,width=200,height=169,seed=5";
    assert_eq!(place.run(&["verify", "a.ply", shifted]).code, 1);
}

/// Makes a mesh with these options: alone, by four threads, in a folder that can be gone on with, and by plan.
pub(crate) fn alike_however_made(options: &[&str]) -> Place {
    let place = Place::new();
    place.ok(&["synth", "rough,size=260,seed=9", "dem.tif"]);
    let make = [&["--max-error", "5", "--tile", "48"], options].concat();
    place.ok(&[&["tin", "dem.tif", "a.ply", "--threads", "1"], &make[..]].concat());
    place.ok(&[&["tin", "dem.tif", "b.ply", "--threads", "4"], &make[..]].concat());
    place.ok(&[&["tin", "dem.tif", "c.ply", "--workdir", "d"], &make[..]].concat());
    place.ok(&[&["plan", "tin", "dem.tif", "-o", "w"], &make[..]].concat());
    place.ok(&["run", "w", "-o", "e.ply"]);
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    for other in ["b.ply", "c.ply", "e.ply"] {
        assert!(bytes(other) == bytes("a.ply"), "{other}");
    }
    place
}

#[test]
fn plans_threads_and_memory_make_the_same_fitted_mesh() {
    alike_however_made(&["--fit-heights"]);
}

#[test]
fn what_does_not_go_with_fitting_is_refused_by_name() {
    let place = Place::new();
    let job = ["tin", GRIDS[0], "o.ply", "--max-error", "4", "--fit-heights"];
    for option in ["--strict", "--no-drop"] {
        place.fails(&[&job[..], &[option]].concat(), 2, &["--fit-heights", option]);
    }
    place.fails(
        &[&job[..], &["--method", "greedy4"]].concat(),
        2,
        &["--method greedy4 cannot be used with --fit-heights"],
    );
    place.ok(&["synth", "cloud,size=20,density=2", "c.laz", "-q"]);
    let cloud = ["tin", "c.laz", "o.ply", "--max-error", "1", "--fit-heights"];
    place.fails(&cloud, 2, &["--fit-heights is for grids"]);
}
