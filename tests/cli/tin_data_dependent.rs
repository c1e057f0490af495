//! `tin --triangulation data-dependent`: any triangles within the bound, in every format and by plan.

use crate::cli_support::Place;
use crate::tin_fit::{GRIDS, alike_however_made, told};
use serde_json::Value;

const ANY: [&str; 2] = ["--triangulation", "data-dependent"];

#[test]
fn meshes_of_any_triangles_are_smaller_and_proved_as_written() {
    let place = Place::new();
    for (grid, bound) in GRIDS.iter().zip(["samples", "surface", "samples", "surface"]) {
        for format in terrane_mesh::FORMATS {
            let mesh = format!("o.{}", format.extensions[0]);
            let error = if grid.contains("smooth") { "0.3" } else { "4" };
            let make = ["tin", grid, &mesh, "--max-error", error, "--tile", "64", "--bound", bound];
            for more in
                [&["--overwrite", "--verify"][..], &["--overwrite", "--verify", "--fit-heights"]]
            {
                // Where all statements do not fit into the 80 bytes of STL, that is refused by name.
                if format.name == "STL" && bound == "surface" && more.contains(&"--fit-heights") {
                    let all = [&make[..], more, &["--triangulation", "data-dependent"]].concat();
                    let ran = place.run(&all);
                    if ran.code != 0 {
                        assert!(ran.code == 2 && ran.err.contains("no space for"), "{ran:?}");
                        continue;
                    }
                }
                let make = [&make[..], more].concat();
                let any = told(&place, &[&make[..], &ANY].concat());
                assert_eq!(any["verify"]["passed"], true, "{mesh}");
                assert_eq!(any["triangulation"], "data-dependent");
                let most = any["max_error"].as_f64().unwrap();
                assert!((most - any["verify"]["max_error"].as_f64().unwrap()).abs() < 1e-5);
                let [rmse, proved] = [&any["rmse"], &any["verify"]["rmse"]].map(Value::as_f64);
                assert!(
                    (rmse.unwrap() / proved.unwrap() - 1.0).abs() < 1e-4,
                    "{rmse:?} {proved:?}"
                );
                let usual = told(&place, &make);
                assert!(usual["triangulation"].is_null());
                let [less, all] = [&any, &usual].map(|made| made["vertices"].as_u64().unwrap());
                assert!(less < all, "{grid} as {mesh}: {less} of {all}");
            }
        }
    }
}

/// A grid of one tile, so that no seam takes anything of it.
#[test]
fn a_fifth_of_the_vertices_goes_with_the_edges_that_are_delaunay() {
    let place = Place::new();
    let make = |mesh: &str, options: &[&str]| {
        let job = ["tin", "synth:rough,size=513,seed=2", mesh, "--max-error", "2"];
        told(&place, &[&job[..], options].concat())["vertices"].as_u64().unwrap()
    };
    let (usual, any) = (make("a.ply", &[]), make("b.ply", &ANY));
    assert!(5 * any < 4 * usual, "{any} of {usual}");
    let share = |mesh: &str| {
        told(&place, &["info", mesh, "--quality"])["quality"]["delaunay_share"].as_f64()
    };
    assert_eq!(share("a.ply"), Some(1.0));
    assert!(
        share("b.ply").is_some_and(|share| (0.3..0.95).contains(&share)),
        "{:?}",
        share("b.ply")
    );
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    make("c.ply", &["--triangulation", "delaunay"]);
    assert!(bytes("c.ply") == bytes("a.ply"));
    let header = String::from_utf8_lossy(&bytes("b.ply")[..800]).into_owned();
    assert!(header.contains("comment triangulation data-dependent\n"), "{header}");
}

#[test]
fn plans_threads_and_memory_make_the_same_mesh_of_any_triangles() {
    alike_however_made(&ANY);
    alike_however_made(&[&ANY[..], &["--fit-heights", "--bound", "surface"]].concat());
}

#[test]
fn triangulations_that_do_not_fit_are_refused_by_name() {
    let place = Place::new();
    let job = ["tin", GRIDS[0], "o.ply", "--max-error", "4"];
    let refused = |options: &[&str], needles: &[&str]| {
        place.fails(&[&job[..], options].concat(), 2, needles);
    };
    refused(&[&ANY[..], &["--no-drop"]].concat(), &["--triangulation data-dependent", "--no-drop"]);
    refused(&["--triangulation", "split3"], &["greedy", "--triangulation split3"]);
    refused(&["--triangulation", "thin"], &["thin"]);
    refused(&[&ANY[..], &["--bands", "1,1"]].concat(), &["--triangulation"]);
    refused(&[&ANY[..], &["--method", "kdtree"]].concat(), &["kdtree", "--triangulation"]);
    let plan = ["plan", "tin", GRIDS[0], "-o", "w", "--max-error", "4"];
    let split = ["--triangulation", "split3"];
    place.fails(&[&plan[..], &split].concat(), 2, &["--triangulation split3"]);
    place.fails(&[&plan[..], &ANY, &["--no-drop"]].concat(), 2, &["--no-drop"]);
    place.ok(&["synth", "cloud,size=20,density=2", "c.laz", "-q"]);
    let cloud = ["tin", "c.laz", "o.ply", "--max-error", "1"];
    place.fails(&[&cloud[..], &ANY].concat(), 2, &["--triangulation is for grids"]);
}
