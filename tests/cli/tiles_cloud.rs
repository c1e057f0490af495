//! `terrane tiles CLOUD`: the tiles of a model of the ground, as two commands make them, proved against the cloud.

use serde_json::Value;

use crate::cli_support::{self, Place, json};
use crate::tiles::walk;

const CLOUD: &str = "synth:cloud,size=120,density=4,seed=3,voids=2,tile=60";

/// The files of two sets are the same; `layer.json` but for the name of what they were made of.
fn alike(place: &Place, [a, b]: [&str; 2]) {
    assert_eq!(walk(place, a), walk(place, b));
    for name in walk(place, a) {
        let [a, b] = [a, b].map(|set| {
            let bytes = place.bytes(&format!("{set}/{name}"));
            let text: Option<Value> = (name == "layer.json")
                .then(|| serde_json::from_slice(&bytes).expect("a layer.json"));
            let text = text.map(|mut text| {
                text["terrane"]["source"] = Value::Null;
                text.to_string().into_bytes()
            });
            text.unwrap_or(bytes)
        });
        assert_eq!(a, b, "{name}");
    }
}

#[test]
fn tiles_are_those_of_the_model_that_grid_makes() {
    let place = Place::new();
    for (number, how) in [&[][..], &["--class", "2"], &["--ground", "pmf"]].iter().enumerate() {
        let [one, two, dtm] = ["one", "two", "dtm.tif"].map(|name| format!("{number}{name}"));
        let cell = ["--cell", "2"];
        let made = ["tiles", CLOUD, &one, "--json"];
        let made = json(&place.ok(&[&made[..], &cell, how].concat()).out);
        assert!(made["notes"][0].as_str().unwrap().starts_with("ground: "), "{made}");
        assert_eq!(made["input"], CLOUD);
        place.ok(&[&["grid", CLOUD, &dtm, "--dtm", "-q"], &cell[..], how].concat());
        place.ok(&["tiles", &dtm, &two, "-q"]);
        alike(&place, [&one, &two]);
        let verify = ["verify", &one, CLOUD, "--json"];
        let told = json(&place.ok(&[&verify[..], &cell, how].concat()).out);
        assert_eq!((&told["passed"], &told["raster"]), (&true.into(), &CLOUD.into()), "{told}");
        place.ok(&["verify", &one, &dtm, "-q"]);
    }
    // A model of other cells has samples where tiles do not promise anything.
    let other = place.run(&["verify", "0one", CLOUD, "--cell", "3", "-q"]);
    assert_eq!(other.code, 1, "{} {}", other.out, other.err);
    assert!(place.files().iter().all(|name| !name.starts_with(".terrane")), "{:?}", place.files());
}

#[test]
fn cells_are_as_wide_as_points_are_apart() {
    let place = Place::new();
    place.ok(&["tiles", CLOUD, "one", "--class", "2", "-q"]);
    place.ok(&["tiles", CLOUD, "two", "--class", "2", "--cell", "0.5", "-q"]);
    alike(&place, ["one", "two"]);
    place.ok(&["verify", "one", CLOUD, "--class", "2", "-q"]);
}

#[test]
fn work_in_a_folder_goes_on_where_it_was() {
    let place = Place::new();
    let make = |output: &str, more: &[&str]| {
        let args = ["tiles", CLOUD, output, "--cell", "1", "--class", "2", "-q"];
        place.ok(&[&args[..], more].concat());
    };
    make("one", &[]);
    make("two", &["--workdir", "work"]);
    alike(&place, ["one", "two"]);
    let model = place.path("work/model/model.tif");
    let made = std::fs::metadata(&model).unwrap().modified().unwrap();
    // Tiles that are gone are made again, of the model that is there.
    std::fs::remove_dir_all(place.path("two")).unwrap();
    make("two", &["--workdir", "work"]);
    alike(&place, ["one", "two"]);
    assert_eq!(std::fs::metadata(&model).unwrap().modified().unwrap(), made);
    // A model that is gone is put together again.
    std::fs::remove_file(&model).unwrap();
    make("two", &["--workdir", "work", "--overwrite"]);
    alike(&place, ["one", "two"]);
    // Ground that a method finds is planned, too.
    let found = |more: &[&str], output| {
        let args = ["tiles", CLOUD, output, "--cell", "1", "--ground", "pmf", "-q"];
        place.ok(&[&args[..], more].concat());
    };
    found(&[], "three");
    found(&["--workdir", "found"], "four");
    alike(&place, ["three", "four"]);
    // What is in the folder is no place for tiles, and nothing is made to find that out.
    for output in ["new/model", "new/tiles", "new/tiles/objects", "new/model/model.tif"] {
        let args = ["tiles", CLOUD, output, "--cell", "1", "--workdir", "new"];
        place.fails(&args, 2, &[output, "work folder"]);
    }
    let other = ["tiles", CLOUD, "x", "--cell", "2", "--class", "2", "--workdir", "work"];
    place.fails(&other, 2, &["another"]);
}

#[test]
fn water_of_a_model_is_level_and_told_of() {
    let place = Place::new();
    let lake = "POLYGON ((500020 4750020, 500090 4750030, 500080 4750090, 500020 4750020))";
    place.write("lake.wkt", lake).write("lake.prj", "EPSG:32631");
    let water = ["--water", "lake.wkt"];
    place.ok(&[&["tiles", CLOUD, "t", "--cell", "2", "--water-mask", "-q"], &water[..]].concat());
    let verify = ["verify", "t", CLOUD, "--cell", "2", "--json"];
    let told = json(&place.ok(&[&verify[..], &water].concat()).out);
    assert_eq!((&told["passed"], &told["judged"]), (&true.into(), &true.into()), "{told}");
}

#[test]
fn parts_of_clouds_are_made_and_proved_as_such() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=4,seed=5", "c.las", "-q"]);
    let near = "POLYGON ((500010 4750010, 500045 4750010, 500045 4750040, 500010 4750010))";
    place.write("near.wkt", near).write("near.prj", "EPSG:32631");
    for part in [&["--bounds", "500010,4750010,500030,4750030"][..], &["--clip", "near.wkt"]] {
        let with = |args: &[&'static str]| [args, part, &["--overwrite", "-q"]].concat();
        place.ok(&with(&["tin", "c.las", "m.ply", "--max-error", "1"]));
        place.ok(&[&["verify", "m.ply", "c.las"], part].concat());
        place.ok(&with(&["grid", "c.las", "dtm.tif", "--dtm", "--cell", "0.5"]));
        place.ok(&["tiles", "dtm.tif", "of_grid", "--overwrite", "-q"]);
        place.ok(&with(&["tiles", "c.las", "of_cloud", "--cell", "0.5"]));
        let told = json(
            &place
                .ok(&[&["verify", "of_cloud", "c.las", "--cell", "0.5", "--json"], part].concat())
                .out,
        );
        assert_eq!((&told["passed"], &told["judged"]), (&true.into(), &true.into()), "{told}");
        let of_grid = json(&place.ok(&["verify", "of_grid", "dtm.tif", "--json"]).out);
        assert_eq!(told["samples"], of_grid["samples"], "{part:?}");
    }
}

#[test]
fn what_does_not_fit_clouds_or_grids_is_refused() {
    let place = Place::new();
    let tiles = |more: &[&str], words: &[&str]| {
        place.fails(&[&["tiles", CLOUD, "t"], more].concat(), 2, words);
    };
    tiles(&["--band", "2"], &["--band", "not for point clouds"]);
    tiles(&["--band", "1"], &["--band", "not for point clouds"]);
    tiles(&["--nodata", "0"], &["--nodata", "not for point clouds"]);
    tiles(&["--meshopt"], &["--meshopt", "--format 3dtiles"]);
    place.fails(&["plan", "tiles", CLOUD, "-o", "work"], 2, &["make a grid first", "plan grid"]);
    place.write("g.asc", cli_support::GRID).write("g.prj", "EPSG:32631");
    place.fails(&["tiles", "g.asc", "t", "--cell", "1"], 2, &["--cell", "g.asc"]);
    place.fails(&["tiles", "-", "t", "--ground", "auto"], 2, &["--ground", "cloud:-"]);
    place.fails(&["tiles", "g.asc", "t", "--ground", "auto"], 2, &["--ground", "g.asc"]);
    place.fails(&["tiles", "g.asc", "t", "--class", "2"], 2, &["--class is for point clouds"]);
    place.write("p.xyz", "1 2 3\n4 5 6\n7 9 3\n8 1 2\n");
    place.fails(&["tiles", "cloud:p.xyz", "t"], 65, &["p.xyz", "CRS is missing", "--crs"]);
    place.ok(&["tin", "g.asc", "m.ply", "--max-error", "1", "-q"]);
    place.fails(&["verify", "m.ply", "g.asc", "--cell", "1"], 2, &["--cell", "terrain tiles"]);
    place.ok(&["tiles", "g.asc", "g", "--max-level", "4", "-q"]);
    place.fails(
        &["verify", "g", "g.asc", "--ground", "class"],
        2,
        &["--ground is for terrain tiles of point clouds"],
    );
    place.fails(
        &["verify", "g", "g.asc", "--ground", "auto"],
        2,
        &["--ground is for terrain tiles of point clouds"],
    );
    place.fails(&["verify", "m.ply", "g.asc", "--ground", "auto"], 2, &["--ground"]);
}
