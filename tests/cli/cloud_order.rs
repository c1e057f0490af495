//! Files of one cloud: neither their order nor their folder leaves a trace in what is made of them.

use crate::cli_support::Place;
use crate::tiles::walk;

/// Two clouds side by side, here and in a folder.
fn place() -> Place {
    let place = Place::new();
    std::fs::create_dir(place.path("deep")).unwrap();
    for (name, seed) in [("a.las", "3"), ("b.las", "4")] {
        let synth = format!("cloud,size=60,density=2,seed={seed}");
        place.ok(&["synth", &synth, name, "-q"]);
        place.write(&format!("deep/{name}"), place.bytes(name));
    }
    place
}

/// Ways to name them.
const NAMES: [&[&str]; 6] = [
    &["a.las", "b.las"],
    &["b.las", "a.las"],
    &["b.las", "a.las", "b.las"],
    &["deep/b.las", "deep/a.las"],
    &["deep"],
    &["deep/*.las"],
];

/// What is made of files so named.
fn made(place: &Place, [verb, output]: [&str; 2], names: &[&str], how: &[&str]) -> Vec<Vec<u8>> {
    place.ok(&[&[verb], names, &[output, "-q"], how].concat());
    let path = place.path(output);
    if path.is_file() {
        let bytes = place.bytes(output);
        std::fs::remove_file(path).unwrap();
        return vec![bytes];
    }
    let files = walk(place, output);
    let bytes = files.iter().map(|name| place.bytes(&format!("{output}/{name}"))).collect();
    std::fs::remove_dir_all(path).unwrap();
    bytes
}

#[test]
fn order_and_folders_of_the_files_of_a_cloud_leave_no_trace() {
    let place = place();
    let meshes = terrane_mesh::FORMATS.iter().flat_map(|format| format.extensions.first());
    let meshes: Vec<String> = meshes.map(|ending| format!("out.{ending}")).collect();
    let mut outputs: Vec<(&str, &str, &[&str])> = Vec::new();
    for mesh in &meshes {
        outputs.push(("tin", mesh, &["--max-error", "0.5"]));
    }
    outputs.extend([
        ("grid", "out.tif", &["--cell", "2"][..]),
        ("grid", "out.asc", &["--cell", "2", "--dtm"]),
        ("points", "out.las", &[]),
        ("points", "out.copc.laz", &["--thin", "1"]),
        ("points", "out.csv", &[]),
        ("points", "squares", &["--tile", "30"]),
        ("tiles", "tiles", &["--cell", "4"]),
        ("tiles", "three", &["--cell", "4", "--format", "3dtiles"]),
    ]);
    for (verb, output, how) in outputs {
        let first = made(&place, [verb, output], NAMES[0], how);
        for names in &NAMES[1..] {
            let same = made(&place, [verb, output], names, how) == first;
            assert!(same, "{verb} {names:?} {output} {how:?}");
        }
    }
}

#[test]
fn plans_of_clouds_make_the_same_meshes_whatever_the_order() {
    let place = place();
    let first = made(&place, ["tin", "out.ply"], NAMES[0], &["--max-error", "0.5"]);
    for names in NAMES {
        let plan = [&["plan", "tin"], names, &["-o", "work", "--max-error", "0.5", "-q"]];
        place.ok(&plan.concat());
        place.ok(&["run", "work", "-q"]);
        place.ok(&["finish", "work", "out.ply", "-q"]);
        assert!(place.bytes("out.ply") == first[0], "{names:?}");
        std::fs::remove_dir_all(place.path("work")).unwrap();
        std::fs::remove_file(place.path("out.ply")).unwrap();
    }
}
