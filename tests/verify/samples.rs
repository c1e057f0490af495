//! Vertices are samples: what moved off its sample is counted, and fails a mesh of terrane's own.

use std::io::{Cursor, Read, Write};

use crate::cli_support::Place;
use crate::support::{Grid, Mesh, check, check_with, noise, split_cells};
use serde_json::Value;
use terrane_verify::VerifyReport;

/// A tolerance that no planted fault breaks.
const WIDE: Option<f64> = Some(100.0);

fn flat() -> Grid {
    Grid::new(12, 9, |_, _| 7.0)
}

/// Marks a mesh as written by terrane, with triangles of any kind.
fn own(mut mesh: Mesh) -> Mesh {
    for comment in ["terrane 0.1.0", "triangulation data-dependent"] {
        mesh.info.details.push(("comment".to_owned(), comment.to_owned()));
    }
    mesh
}

/// The one failure of a mesh of terrane's own, none of a mesh of others.
fn judged(mesh: &Mesh, grid: &Grid) -> VerifyReport {
    let foreign = check(mesh, grid, WIDE);
    assert!(foreign.verdict.passed && !foreign.made_by_terrane, "{:?}", foreign.verdict.failures);
    let report = check(&own(mesh.clone()), grid, WIDE);
    assert!(report.made_by_terrane && !report.verdict.passed);
    assert_eq!(report.verdict.failures.len(), 1, "{:?}", report.verdict.failures);
    assert!(
        report.verdict.failures[0].contains("off the samples"),
        "{:?}",
        report.verdict.failures
    );
    assert_eq!(report.of.off_sample_vertices, foreign.of.off_sample_vertices);
    report
}

#[test]
fn a_vertex_lifted_within_the_tolerance_is_off_its_sample() {
    let grid = flat();
    let mut mesh = split_cells(&grid);
    let id = mesh.find(5.0, -4.0) as usize;
    mesh.vertices[id][2] += 0.001;
    let report = judged(&mesh, &grid);
    assert_eq!((report.of.off_sample_vertices.count, report.free_vertices), (1, 0));
    let place = report.of.off_sample_vertices.first.unwrap();
    assert_eq!((place.column, place.row), (5.0, 4.0));
}

#[test]
fn a_vertex_moved_by_half_a_cell_is_off_its_sample() {
    let grid = flat();
    let mut mesh = split_cells(&grid);
    let id = mesh.find(5.0, -4.0) as usize;
    mesh.vertices[id][0] += 0.5;
    let report = judged(&mesh, &grid);
    assert_eq!((report.of.off_sample_vertices.count, report.free_vertices), (1, 1));
    assert_eq!(report.of.off_sample_vertices.first.unwrap().column, 5.5);
    assert_eq!(
        check(&own(mesh.soup()), &grid, WIDE).of.off_sample_vertices.count,
        1,
        "one position"
    );
}

#[test]
fn one_corner_of_several_at_a_sample_is_enough() {
    let grid = flat();
    let mut mesh = split_cells(&grid);
    let copy = mesh.add([5.0, -4.0, 7.5]);
    let id = mesh.find(5.0, -4.0);
    let last = mesh.triangles.iter().rposition(|t| t.contains(&id)).unwrap();
    mesh.triangles[last] = mesh.triangles[last].map(|v| if v == id { copy } else { v });
    mesh.recount();
    assert_eq!(check(&mesh, &grid, WIDE).of.off_sample_vertices.count, 1);
}

#[test]
fn a_vertex_in_a_void_or_beyond_the_grid_is_off_the_samples() {
    let mut grid = flat();
    let mesh = own(split_cells(&grid));
    grid.set(4, 4, f64::NAN);
    let report = check(&mesh, &grid, WIDE);
    assert_eq!(report.of.off_sample_vertices.count, 1);
    assert!(report.verdict.failures.iter().any(|f| f.contains("off the samples")));
    let small = Grid::new(11, 9, |_, _| 7.0);
    assert_eq!(check(&mesh, &small, WIDE).of.off_sample_vertices.count, 9);
}

#[test]
fn heights_rounded_by_their_format_are_the_samples() {
    let grid = Grid::new(12, 9, |c, r| 1e7 + noise(c, r, 3));
    for z0 in [0.0, 1e7] {
        let mut mesh = own(split_cells(&grid));
        for vertex in &mut mesh.vertices {
            vertex[2] = z0 + f64::from((vertex[2] - z0) as f32);
        }
        mesh.info.origin = [0.0, 0.0, z0];
        mesh.info.single_precision = true;
        let report = check(&mesh, &grid, WIDE);
        assert!(report.verdict.passed, "{:?}", report.verdict.failures);
        assert_eq!(report.of.off_sample_vertices.count, 0);
        mesh.info.single_precision = false;
        assert!(check(&mesh, &grid, WIDE).of.off_sample_vertices.count > 50);
    }
}

#[test]
fn the_count_depends_on_no_division() {
    let grid = Grid::new(300, 200, |c, r| noise(c, r, 5));
    let mut mesh = own(split_cells(&grid));
    for (i, vertex) in mesh.vertices.iter_mut().enumerate() {
        vertex[2] += if i % 7 == 0 { 0.5 } else { 0.0 };
    }
    let expected = mesh.vertices.len().div_ceil(7) as u64;
    for (threads, memory) in [(1, 64 << 20), (3, 3 << 20)] {
        let report = check_with(&mesh, &grid, WIDE, threads, memory);
        assert_eq!(report.of.off_sample_vertices.count, expected);
    }
}

const TERRAIN: &str = "synth:rough,size=120,seed=3";

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn meshes_of_every_format_lie_on_the_samples() {
    let place = Place::new();
    for format in terrane_mesh::FORMATS {
        let mesh = format!("a.{}", format.extensions[0]);
        place.ok(&["tin", TERRAIN, &mesh, "--max-error", "5", "--overwrite"]);
        let report = json(&place.ok(&["verify", &mesh, TERRAIN, "--json", "--max-error", "5"]).out);
        assert_eq!(report["made_by_terrane"], true, "{mesh}");
        assert_eq!(report["off_sample_vertices"]["count"], 0, "{mesh}");
    }
}

#[test]
fn a_written_mesh_that_was_tampered_with_fails_unless_it_is_not_ours() {
    let place = Place::new();
    place.ok(&["tin", TERRAIN, "a.ply", "--max-error", "5"]);
    let mut bytes = std::fs::read(place.path("a.ply")).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let z = end + 16..end + 24;
    let height = f64::from_le_bytes(bytes[z.clone()].try_into().unwrap()) + 0.001;
    bytes[z].copy_from_slice(&height.to_le_bytes());
    place.write("b.ply", &bytes);
    let ran = place.run(&["verify", "b.ply", TERRAIN, "--max-error", "5.01"]);
    assert_eq!(ran.code, 1, "{}", ran.out);
    assert!(ran.out.contains("1 vertices off the samples"), "{}", ran.out);

    let mark = bytes.windows(8).position(|w| w == b"terrane ").unwrap();
    bytes[mark..mark + 7].copy_from_slice(b"anybody");
    place.write("c.ply", &bytes);
    let ran = place.ok(&["verify", "c.ply", TERRAIN, "--max-error", "5.01"]);
    assert!(ran.out.contains("1 off the samples"), "{}", ran.out);
}

#[test]
fn a_mesh_that_states_no_bound_is_not_said_to_keep_it() {
    let place = Place::new();
    for format in terrane_mesh::FORMATS {
        let mesh = format!("a.{}", format.extensions[0]);
        place.ok(&["tin", TERRAIN, &mesh, "--max-error", "5"]);
        // Every format states its bound.
        let report = json(&place.ok(&["verify", &mesh, TERRAIN, "--json"]).out);
        assert_eq!(
            (&report["tolerance"], &report["judged"]),
            (&5.0.into(), &true.into()),
            "{mesh}"
        );
        replace(&place, &mesh, "max error", "any error");
        let told = place.run(&["verify", &mesh, TERRAIN]);
        assert!(told.code == 3 && told.out.contains("not judged: the error"), "{}", told.out);
        assert!(!told.out.contains("every promise"), "{}", told.out);
        let report = json(&place.run(&["verify", &mesh, TERRAIN, "--json"]).out);
        assert_eq!((&report["passed"], &report["judged"]), (&true.into(), &false.into()));
        // The bound, and a statement that is not known.
        assert_eq!(report["not_judged"].as_array().unwrap().len(), 2, "{report}");
        let told = place.run(&["verify", &mesh, TERRAIN, "-q"]);
        assert!(told.code == 3 && told.err.starts_with("terrane: not judged: "), "{}", told.err);
        let told = place.run(&["verify", &mesh, TERRAIN, "--max-error", "5"]);
        assert!(told.code == 3 && told.out.contains("\"any error 5"), "{}", told.out);
        assert_eq!(place.run(&["verify", &mesh, TERRAIN, "--max-error", "0.01"]).code, 1);
    }
}

/// Replaces the first of some words of a file, or of the files in it where it is an archive.
fn replace(place: &Place, name: &str, from: &str, to: &str) {
    let change = |mut bytes: Vec<u8>| {
        let at = bytes.windows(from.len()).position(|some| some == from.as_bytes())?;
        bytes.splice(at..at + from.len(), to.bytes());
        Some(bytes)
    };
    let bytes = std::fs::read(place.path(name)).unwrap();
    let Ok(mut archive) = zip::ZipArchive::new(Cursor::new(&bytes)) else {
        place.write(name, change(bytes).unwrap());
        return;
    };
    let mut changed = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).unwrap();
        let mut text = Vec::new();
        file.read_to_end(&mut text).unwrap();
        changed.start_file(file.name().unwrap(), zip::write::SimpleFileOptions::default()).unwrap();
        changed.write_all(&change(text.clone()).unwrap_or(text)).unwrap();
    }
    place.write(name, changed.finish().unwrap().into_inner());
}

#[test]
fn a_stated_bound_that_is_no_number_is_an_error() {
    let place = Place::new();
    place.ok(&["tin", TERRAIN, "a.ply", "--max-error", "5"]);
    let bytes = std::fs::read(place.path("a.ply")).unwrap();
    let at = bytes.windows(17).position(|w| w == b"max error 5 metre").unwrap() + 10;
    for bad in ["nan m   ", "-1 m    ", "inf m   ", "-inf m  ", "five    ", "        "] {
        let mut bytes = bytes.clone();
        bytes[at..at + 7].copy_from_slice(&bad.as_bytes()[..7]);
        place.write("b.ply", &bytes);
        place.fails(&["verify", "b.ply", TERRAIN], 65, &["b.ply", "max error", "--max-error"]);
        place.ok(&["verify", "b.ply", TERRAIN, "--max-error", "5"]);
    }
}

#[test]
fn heights_far_from_zero_keep_their_digits_in_every_format() {
    let place = Place::new();
    let heights: Vec<String> =
        (0..900u64).map(|i| (20_000_001 + (i * i) % 77).to_string()).collect();
    let head = "ncols 30\nnrows 30\nxllcorner 500000\nyllcorner 4000000\ncellsize 30\n";
    place.write("far.asc", format!("{head}{}\n", heights.join(" ")));
    for format in terrane_mesh::FORMATS {
        let mesh = format!("far.{}", format.extensions[0]);
        place.ok(&["tin", "far.asc", &mesh, "--max-error", "0.25", "--overwrite"]);
        let verify = ["verify", &mesh, "far.asc", "--json", "--max-error", "0.25"];
        let report = json(&place.ok(&verify).out);
        assert_eq!(report["off_sample_vertices"]["count"], 0, "{mesh}");
        let origin = json(&place.ok(&["info", &mesh, "--json"]).out)["origin"].clone();
        let far = origin[2].as_f64().unwrap() > 1.9e7;
        assert_eq!(far, format.single_precision, "{mesh}: {origin}");
    }
    let co = ["--co", "SOLID_BASE=19999990", "--overwrite"];
    place.ok(&[&["tin", "far.asc", "far.stl", "--max-error", "0.25"][..], &co].concat());
}

#[test]
fn the_bound_on_the_surface_is_judged_where_it_is_asked_for_or_stated() {
    let place = Place::new();
    place.ok(&["tin", TERRAIN, "a.ply", "--max-error", "1"]);
    let told = place.ok(&["verify", "a.ply", TERRAIN]).out;
    assert!(
        told.contains("  surface   error ") && told.contains("not promised by this mesh"),
        "{told}"
    );
    let surface = ["verify", "a.ply", TERRAIN, "--bound", "surface"];
    let told = place.run(&surface);
    assert_eq!(told.code, 1, "{}", told.out);
    assert!(told.out.contains(" places between samples further from the mesh"), "{}", told.out);
    place.ok(&[&surface[..], &["--max-error", "20"]].concat());
    let bytes = std::fs::read(place.path("a.ply")).unwrap();
    let at = bytes.windows(18).position(|some| some == b"comment max error ").unwrap();
    let [before, after] = [&bytes[..at], &bytes[at..]];
    for (stated, code) in [("surface", 1), ("samples", 0), ("volume", 65)] {
        let comment = format!("comment bound {stated}\n");
        place.write("b.ply", [before, comment.as_bytes(), after].concat());
        assert_eq!(place.run(&["verify", "b.ply", TERRAIN]).code, code, "{stated}");
        place.ok(&["verify", "b.ply", TERRAIN, "--bound", "samples"]);
    }
    place.fails(&["verify", "b.ply", TERRAIN], 65, &["b.ply", "bound volume", "--bound"]);
    place.fails(
        &["verify", "a.ply", TERRAIN, "--bound", "volume"],
        2,
        &["volume", "samples, surface"],
    );
    place.write("c.ply", [before, b"comment any error ", &after[18..]].concat());
    let ran = place.run(&["verify", "c.ply", TERRAIN, "--bound", "surface", "--json"]);
    let report = json(&ran.out);
    assert_eq!((ran.code, &report["judged"]), (3, &false.into()));
    assert!(report["surface_error"].as_f64().unwrap() > 1.0, "{report}");
}

#[test]
fn a_bound_on_the_surface_of_points_or_lines_is_refused_by_name() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=30,seed=5", "c.laz"]);
    place.ok(&["tin", "c.laz", "c.ply", "--max-error", "0.5"]);
    place.fails(
        &["verify", "c.ply", "c.laz", "--bound", "surface"],
        2,
        &["--bound is for meshes of grids", "clouds"],
    );
    place.ok(&["contour", TERRAIN, "-o", "l.geojson", "--interval", "50"]);
    let lines = ["verify", "l.geojson", "l.geojson", "--bound", "surface"];
    place.fails(&lines, 2, &["--bound is for meshes of grids", "lines"]);
    let bytes = std::fs::read(place.path("c.ply")).unwrap();
    let at = bytes.windows(18).position(|some| some == b"comment max error ").unwrap();
    place.write("d.ply", [&bytes[..at], b"comment bound surface\n", &bytes[at..]].concat());
    let told = place.run(&["verify", "d.ply", "c.laz"]);
    assert!(
        told.code == 3 && told.out.contains("\"bound surface\" (not applicable to point clouds)"),
        "{}",
        told.out
    );
}

#[test]
fn meshes_made_for_the_surface_keep_to_it_as_written_and_others_do_not() {
    let place = Place::new();
    let report = |args: &[&str]| -> Value {
        let ran = place.run(&[&["verify"], args, &["--json"]].concat());
        serde_json::from_str(&ran.out).unwrap()
    };
    for (terrain, tile) in [("rough", "64"), ("salt", "48"), ("integer", "512")] {
        let grid = format!("synth:{terrain},width=300,height=170,seed=5");
        for format in terrane_mesh::FORMATS {
            let mesh = format!("{terrain}.{}", format.extensions[0]);
            let make = ["tin", &grid, &mesh, "--max-error", "1.5", "--tile", tile, "-q"];
            place.ok(&[&make[..], &["--bound", "surface", "--verify"]].concat());
            let found = report(&[&mesh, &grid]);
            assert_eq!((&found["bound"], &found["passed"]), (&"surface".into(), &true.into()));
            assert!(found["surface_error"].as_f64().unwrap() <= 1.5, "{mesh}");
            place.ok(&[&make[..], &["--overwrite", "--verify"]].concat());
            let others = report(&[&mesh, &grid, "--bound", "surface"]);
            assert_eq!(others["passed"] == false, terrain != "integer", "{mesh}");
        }
    }
}

#[test]
fn a_plan_and_its_run_keep_to_the_surface() {
    let place = Place::new();
    let grid = "synth:rough,width=300,height=260,seed=5";
    let bound = ["--max-error", "2", "--tile", "32", "--bound", "surface", "-q"];
    place.ok(&[&["plan", "tin", grid, "-o", "work"], &bound[..]].concat());
    place.ok(&["run", "work", "-o", "planned.ply", "-q"]);
    place.ok(&[&["tin", grid, "once.ply"], &bound[..]].concat());
    let bytes = ["planned.ply", "once.ply"].map(|name| std::fs::read(place.path(name)).unwrap());
    assert_eq!(bytes[0], bytes[1]);
    let ran = place.ok(&["verify", "planned.ply", grid, "--json"]);
    assert!(ran.out.contains("\"bound\": \"surface\""), "{}", ran.out);
}
