//! A mesh in many files is the mesh in one file: the same triangles, and a promise that can be proved.

use std::collections::HashSet;
use std::ffi::OsString;

use crate::cli_support::Place;
use crate::held;
use serde_json::Value;
use terrane_mesh as mesh;

const TERRAIN: &str = "synth:coast,width=700,height=420,seed=4";

/// All triangles by the bits of their corners, beginning with the smallest; no two are the same.
fn triangles(place: &Place, name: &str) -> HashSet<[[u64; 3]; 3]> {
    let mesh = mesh::open(&place.path(name)).unwrap();
    let info = mesh.info();
    let mut positions = vec![[0.0; 3]; info.vertices as usize];
    mesh.read_vertices(0, &mut positions).unwrap();
    let mut ids = vec![[0; 3]; info.triangles as usize];
    mesh.read_triangles(0, &mut ids).unwrap();
    let triangle = |ids: &[u64; 3]| {
        let mut corners = ids.map(|id| positions[id as usize].map(f64::to_bits));
        let first = (0..3).min_by_key(|&i| corners[i]).unwrap();
        corners.rotate_left(first);
        corners
    };
    let all: HashSet<_> = ids.iter().map(triangle).collect();
    assert_eq!(all.len() as u64, info.triangles, "{name} has a triangle twice");
    all
}

fn tin(place: &Place, output: &str, more: &[&str]) {
    let args = ["tin", TERRAIN, output, "--max-error", "2", "--tile", "32", "-q"];
    place.ok(&[&args[..], more].concat());
}

#[test]
fn the_blocks_are_the_whole_in_every_format() {
    for format in mesh::FORMATS {
        let place = Place::new();
        let whole = format!("whole.{}", format.extensions[0]);
        tin(&place, &whole, &[]);
        for split in ["1", "3", "100"] {
            tin(&place, split, &["--split", split, "-f", format.name]);
            let expected = triangles(&place, &whole);
            assert!(triangles(&place, split) == expected, "{} by {split}", format.name);
            place.ok(&["verify", split, TERRAIN, "--max-error", "2"]);
        }
        let broken = place.run(&["verify", "3", TERRAIN, "--max-error", "0.5"]);
        assert_eq!(broken.code, 1, "{}: {}", format.name, broken.err);
    }
}

#[test]
fn a_block_that_is_lost_or_changed_is_found() {
    let place = Place::new();
    tin(&place, "out", &["--split", "4"]);
    let index = place.path("out/index.geojson");
    let text = std::fs::read_to_string(&index).unwrap();
    let parsed: Value = serde_json::from_str(&text).unwrap();
    let features = parsed["features"].as_array().unwrap();
    assert!(features.len() > 8, "{}", features.len());
    // Without one block there is a hole.
    let mut fewer = parsed.clone();
    fewer["features"].as_array_mut().unwrap().remove(7);
    std::fs::write(&index, fewer.to_string()).unwrap();
    assert_eq!(place.run(&["verify", "out", TERRAIN]).code, 1);
    std::fs::write(&index, &text).unwrap();
    place.ok(&["verify", "out", TERRAIN]);
    // One block of another mesh does not fit.
    tin(&place, "other", &["--split", "4", "--no-drop"]);
    let name = features[7]["properties"]["file"].as_str().unwrap();
    std::fs::copy(place.path("other").join(name), place.path("out").join(name)).unwrap();
    assert_ne!(place.run(&["verify", "out", TERRAIN]).code, 0);
    std::fs::remove_file(place.path("out").join(name)).unwrap();
    place.fails(&["verify", "out", TERRAIN], 65, &[name]);
}

#[test]
fn bytes_do_not_depend_on_threads_memory_or_tasks() {
    let place = Place::new();
    tin(&place, "a", &["--split", "3", "--threads", "1"]);
    tin(&place, "b", &["--split", "3", "--threads", "3", "--memory", "40M"]);
    place.ok(&["plan", "tin", TERRAIN, "-o", "work", "--max-error", "2", "--tile", "32", "-q"]);
    place.ok(&["run", "work", "-o", "c", "--split", "3", "-q"]);
    place.ok(&["run", "work", "-o", "c", "--split", "3", "-q"]);
    let expected = read(&place, "a");
    assert!(expected.len() > 20);
    assert!(read(&place, "b") == expected && read(&place, "c") == expected);
}

/// All files of a folder, by name.
fn read(place: &Place, folder: &str) -> Vec<(OsString, Vec<u8>)> {
    let entries = std::fs::read_dir(place.path(folder)).unwrap().flatten();
    let mut files: Vec<_> =
        entries.map(|entry| (entry.file_name(), std::fs::read(entry.path()).unwrap())).collect();
    files.sort();
    files
}

#[test]
fn another_or_a_damaged_folder_is_not_taken_for_the_finished_one() {
    let place = Place::new();
    tin(&place, "three", &["--split", "3"]);
    tin(&place, "four", &["--split", "4"]);
    place.ok(&["plan", "tin", TERRAIN, "-o", "work", "--max-error", "2", "--tile", "32", "-q"]);
    let args = |split| ["run", "work", "-o", "out", "-q", "--split", split];
    place.ok(&args("3"));
    place.fails(&args("4"), 2, &["out", "already exists"]);
    place.ok(&[&args("4")[..], &["--overwrite"]].concat());
    assert!(read(&place, "out") == read(&place, "four"));
    std::fs::remove_file(place.path("out/block-0000-0001.ply")).unwrap();
    place.fails(&args("4"), 2, &["out", "changed since", "--overwrite"]);
    place.ok(&[&args("4")[..], &["--overwrite"]].concat());
    assert!(read(&place, "out") == read(&place, "four"));
}

#[test]
fn another_bottom_is_not_taken_for_the_finished_one() {
    let place = Place::new();
    let solid = |base: &str| {
        let base = format!("SOLID_BASE={base}");
        tin(&place, "a.stl", &["--workdir", "work", "--overwrite", "--co", &base]);
        std::fs::read(place.path("a.stl")).unwrap()
    };
    assert!(solid("-500") != solid("-600"));
}

#[test]
fn blocks_of_a_solid_are_solids() {
    let place = Place::new();
    tin(&place, "out", &["--split", "4", "-f", "STL", "--co", "SOLID_BASE=-500"]);
    place.ok(&["info", "out"]);
    place.ok(&["view", "out", "-o", "out.png", "--width", "200", "-q"]);
    let names = read(&place, "out").into_iter().map(|(name, _)| name);
    let blocks: Vec<_> = names.filter(|name| name.to_string_lossy().ends_with(".stl")).collect();
    assert!(blocks.len() > 8);
    for name in blocks {
        let block = mesh::open(&place.path("out").join(&name)).unwrap();
        let solid = held::corners(&held::read(&*block, 1000).unwrap());
        let sides = held::edges(&solid);
        let is_closed = |([a, b], times): (&held::Edge, &u64)| sides.get(&[*b, *a]) == Some(times);
        assert!(sides.iter().all(is_closed), "{name:?}");
        assert!(held::six_volumes(&solid) > 0.0, "{name:?}");
        let heights = solid.iter().flatten().map(|p| p[2]);
        assert_eq!(heights.fold(f64::INFINITY, f64::min), -500.0, "{name:?}");
    }
}

#[test]
fn a_folder_is_replaced_whole_or_not_at_all() {
    let place = Place::new();
    let more = |split| ["--split", split, "--overwrite"];
    tin(&place, "new", &more("7"));
    let (new, mut count) = (read(&place, "new"), 0);
    loop {
        tin(&place, "out", &more("6"));
        let old = read(&place, "out");
        count += 1;
        let args = ["tin", TERRAIN, "out", "--max-error", "2", "--tile", "32", "-q"];
        let mut command = place.command(&[&args[..], &more("7")].concat());
        let output = command.env("TERRANE_FAULT", format!("rename:{count}")).output().unwrap();
        if output.status.success() {
            break;
        }
        assert!(read(&place, "out") == old, "rename:{count}");
    }
    assert!(count > 8 && read(&place, "out") == new);
    assert_eq!(place.files(), ["new", "out"]);
}

#[test]
fn folders_of_others_are_never_replaced() {
    let place = Place::new();
    std::fs::create_dir(place.path("out")).unwrap();
    place.write("out/precious", "x");
    let args = ["tin", TERRAIN, "out", "--max-error", "2", "--split", "2"];
    place.fails(&args, 2, &["out"]);
    place.fails(&[&args[..], &["--overwrite"]].concat(), 2, &["not created by terrane"]);
    std::fs::remove_file(place.path("out/precious")).unwrap();
    std::fs::remove_dir(place.path("out")).unwrap();
    tin(&place, "out", &["--split", "2"]);
    tin(&place, "out", &["--split", "7", "--overwrite"]);
    assert_eq!(place.files(), ["out"]);
    place.write("out/precious", "x");
    place.fails(&[&args[..], &["--overwrite"]].concat(), 2, &["other files"]);
    assert_eq!(std::fs::read(place.path("out/precious")).unwrap(), b"x");
}

#[cfg(unix)]
#[test]
fn an_index_that_names_folders_is_refused() {
    let place = Place::new();
    tin(&place, "out", &["--split", "100"]);
    let index = place.path("out/index.geojson");
    let text = std::fs::read_to_string(&index).unwrap();
    let mut parsed: Value = serde_json::from_str(&text).unwrap();
    let features = parsed["features"].as_array_mut().unwrap();
    features[0]["properties"]["file"] = "again".into();
    std::fs::write(&index, parsed.to_string()).unwrap();
    std::os::unix::fs::symlink(".", place.path("out/again")).unwrap();
    place.fails(&["info", "out"], 65, &["out/again", "not a regular file"]);
}
