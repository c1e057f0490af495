//! Whole jobs through the real binary: results, reports, progress, pictures, signals.

use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

use crate::cli_support::{GRID, Place, Ran, json};

const TERRAIN: &str = "synth:rough,size=300,seed=3";

#[test]
fn tin_writes_a_mesh_that_verify_accepts() {
    let place = Place::new();
    let ran = place.ok(&["tin", TERRAIN, "a.ply", "--max-error", "5", "--verify"]);
    for part in ["300 x 300", "vertices", "triangles", "max error", "verified"] {
        assert!(ran.out.contains(part), "{part} in\n{}", ran.out);
    }
    assert_eq!(ran.err, "", "no progress when nobody looks");
    place.ok(&["verify", "a.ply", TERRAIN, "--max-error", "5"]);
    let broken = place.run(&["verify", "a.ply", TERRAIN, "--max-error", "0.5"]);
    assert_eq!(broken.code, 1, "{}", broken.err);
    assert!(broken.out.contains("NOT verified"), "{}", broken.out);
}

#[test]
fn reports_are_the_same_on_stdout_and_in_a_file() {
    let place = Place::new();
    let args =
        ["tin", TERRAIN, "a.ply", "--max-error", "5", "--verify", "--json", "--report", "r.json"];
    let ran = place.ok(&args);
    let (printed, stored) =
        (json(&ran.out), std::fs::read_to_string(place.path("r.json")).unwrap());
    assert_eq!(printed, json(&stored));
    assert_eq!(printed["width"], 300);
    assert_eq!(printed["tolerance"], 5.0);
    assert!(printed["max_error"].as_f64().unwrap() <= 5.0);
    assert!(printed["rmse"].as_f64().unwrap() > 0.0);
    assert_eq!(printed["verify"]["passed"], true);
    let verified = place.ok(&["verify", "a.ply", TERRAIN, "--max-error", "5", "--json"]);
    assert_eq!(json(&verified.out)["passed"], true);
}

#[test]
fn budgets_are_kept() {
    let place = Place::new();
    let ran = place.ok(&["tin", TERRAIN, "a.ply", "--max-vertices", "500", "--json"]);
    let vertices = json(&ran.out)["vertices"].as_u64().unwrap();
    assert!((300..=500).contains(&vertices), "{vertices}");
    let ran = place.ok(&["tin", TERRAIN, "b.ply", "--max-triangles", "900", "--json"]);
    let triangles = json(&ran.out)["triangles"].as_u64().unwrap();
    assert!((500..=900).contains(&triangles), "{triangles}");
}

#[test]
fn overwrite_replaces_and_quiet_is_quiet() {
    let place = Place::new();
    place.write("a.ply", "old");
    let ran = place.ok(&["tin", TERRAIN, "a.ply", "--max-error", "5", "--overwrite", "--quiet"]);
    assert_eq!((ran.out.as_str(), ran.err.as_str()), ("", ""));
    assert!(std::fs::read(place.path("a.ply")).unwrap().starts_with(b"ply"));
    assert_eq!(place.files(), ["a.ply", "a.prj"]);
}

#[test]
fn every_mesh_format_is_written_told_about_and_drawn() {
    let place = Place::new();
    for format in terrane_mesh::FORMATS {
        let mesh = format!("as_{0}.{0}", format.extensions[0]);
        let picture = format!("{}.png", format.name);
        place.ok(&["tin", TERRAIN, &mesh, "--max-error", "5"]);
        let told = json(&place.ok(&["info", &mesh, "--json"]).out);
        assert_eq!(
            (told["kind"].as_str(), told["format"].as_str()),
            (Some("mesh"), Some(format.name))
        );
        assert!(told["triangles"].as_u64().unwrap() > 100);
        place.ok(&["view", &mesh, "-o", &picture, "--width", "64", "--edges"]);
        assert_eq!(size_of_png(&place, &picture), (64, 64));
    }
}

#[test]
fn the_format_can_be_named() {
    let place = Place::new();
    place.ok(&["tin", TERRAIN, "mesh.dat", "--max-error", "5", "-f", "ply"]);
    assert!(place.ok(&["info", "mesh.dat"]).out.contains("PLY"), "told by its first bytes");
}

fn size_of_png(place: &Place, name: &str) -> (u32, u32) {
    let file = std::fs::File::open(place.path(name)).unwrap();
    let reader = png::Decoder::new(BufReader::new(file)).read_info().unwrap();
    (reader.info().width, reader.info().height)
}

/// Opacity of each pixel, row by row.
fn opacity(place: &Place, name: &str) -> Vec<u8> {
    let file = std::fs::File::open(place.path(name)).unwrap();
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels.chunks_exact(4).map(|p| p[3]).collect()
}

#[test]
fn grids_are_told_about_and_drawn() {
    let place = Place::new();
    place.write("a.asc", GRID);
    let told = json(&place.ok(&["info", "a.asc", "--json", "--stats"]).out);
    assert_eq!((&told["width"], &told["height"]), (&4.into(), &3.into()));
    assert_eq!(told["bounds"], serde_json::json!([100.0, 200.0, 140.0, 230.0]));
    assert_eq!(told["stats"]["valid"], 11);
    assert_eq!((&told["stats"]["min"], &told["stats"]["max"]), (&1.0.into(), &11.0.into()));
    let ran = place.ok(&["view", "a.asc", "-o", "a.png", "--width", "40"]);
    assert!(ran.out.contains("40 x 30"), "{}", ran.out);
    let alpha = opacity(&place, "a.png");
    assert_eq!(alpha.len(), 40 * 30);
    assert_eq!((alpha[0], alpha[40 * 30 - 1]), (255, 0), "north-west is there, south-east is void");
    place.ok(&["view", "a.asc", "-o", "b.png", "--width", "20", "--bbox", "100,210,120,230"]);
    assert_eq!(size_of_png(&place, "b.png"), (20, 20));
    assert!(opacity(&place, "b.png").iter().all(|&a| a == 255));
}

#[test]
fn what_is_odd_and_what_a_tin_takes_is_told_as_text_and_json() {
    let place = Place::new();
    place.write("a.asc", GRID.replace("cellsize 10", "dx 10\ndy 20"));
    let told = json(&place.ok(&["info", "a.asc", "--json", "--stats", "--memory", "1G"]).out);
    let notes = told["notes"].as_array().unwrap();
    let kinds: Vec<_> = notes.iter().map(|note| note["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["no CRS", "vertical unit unknown", "cells not square", "voids"]);
    assert_eq!(told["tin"]["memory"], 1 << 30);
    let least = told["tin"]["least_memory"].as_u64().unwrap();
    let (enough, less) = (least.to_string(), (least - 1).to_string());
    let tin = ["tin", "a.asc", "a.ply", "--max-error", "1", "--memory"];
    place.ok(&[&tin[..], &[&enough]].concat());
    place.fails(&[&tin[..], &[&less, "--overwrite"]].concat(), 75, &["memory"]);
    let text = place.ok(&["info", "a.asc"]).out;
    let rows: Vec<_> = text.lines().filter_map(|line| line.trim().split_once("  ")).collect();
    let told = |name: &str| rows.iter().filter(|row| row.0 == name).count();
    assert_eq!(["note", "tin memory", "tin time", "tin disk"].map(told), [3, 1, 1, 1], "{text}");
    assert!(text.contains("10 x 20 unit (ratio 0.5000)"), "{text}");
}

#[test]
fn pictures_do_not_depend_on_threads_or_memory() {
    let place = Place::new();
    let input = "synth:salt,size=700,seed=1";
    let mut pictures = Vec::new();
    for (threads, memory) in [("1", "8M"), ("3", "1G")] {
        place.ok(&[
            "view",
            input,
            "-o",
            "p.png",
            "--width",
            "100",
            "--overwrite",
            "--threads",
            threads,
            "--memory",
            memory,
        ]);
        pictures.push(std::fs::read(place.path("p.png")).unwrap());
    }
    assert_eq!(pictures[0], pictures[1]);
    place.fails(
        &["view", input, "-o", "q.png", "--width", "9000", "--memory", "8M"],
        75,
        &["--width"],
    );
}

#[test]
fn stores_hold_what_they_were_made_of() {
    let place = Place::new();
    place.write("a.asc", GRID);
    place.ok(&["convert", "a.asc", "a.tif"]);
    place.ok(&["synth", "coast,size=120,seed=2", "s.tif"]);
    for (one, other) in [("a.asc", "a.tif"), ("synth:coast,size=120,seed=2", "s.tif")] {
        let told = |name: &str| json(&place.ok(&["info", name, "--json", "--stats"]).out);
        assert_eq!(told(one)["stats"], told(other)["stats"]);
        assert_eq!(told(one)["bounds"], told(other)["bounds"]);
    }
}

#[test]
fn demo_makes_proves_and_draws_and_can_be_run_again() {
    let place = Place::new();
    place.ok(&["demo", "--dir", "d", "--quiet"]);
    let ran = place.ok(&["demo", "--dir", "d"]);
    assert!(ran.out.contains("proved"), "{}", ran.out);
    for file in ["terrain.tif", "terrain.ply", "preview.png", "report.json"] {
        assert!(place.path("d").join(file).is_file(), "{file}");
        assert!(ran.out.contains(file), "{file} in\n{}", ran.out);
    }
}

#[test]
fn progress_for_programs_is_one_object_per_line() {
    let place = Place::new();
    let ran = place.ok(&["tin", TERRAIN, "a.ply", "--max-error", "5", "--progress", "json"]);
    assert!(ran.err.lines().count() >= 2, "{}", ran.err);
    for line in ran.err.lines() {
        let status = json(line);
        assert!(status["stage"].is_string() && status["done"].is_u64() && status["total"].is_u64());
    }
}

#[test]
fn progress_of_several_files_tells_which_is_read() {
    let place = Place::new();
    for file in ["a.laz", "b.laz", "c.las"] {
        let seed = file.as_bytes()[0];
        place.ok(&["synth", &format!("cloud,size=40,density=3,seed={seed}"), file]);
    }
    let verbs: [&[&str]; 6] = [
        &["points", "a.laz", "b.laz", "c.las", "all.laz"],
        &["points", "a.laz", "b.laz", "c.las", "thin.laz", "--thin", "2"],
        &["grid", "a.laz", "b.laz", "c.las", "grid.tif", "--cell", "2"],
        &["grid", "a.laz", "b.laz", "c.las", "ground.tif", "--cell", "2", "--dtm"],
        &["tin", "a.laz", "b.laz", "c.las", "mesh.ply", "--max-error", "1"],
        &["info", "a.laz", "b.laz", "c.las", "--mosaic", "--stats"],
    ];
    for args in verbs {
        let ran = place.ok(&[args, &["--progress", "json", "--threads", "1"]].concat());
        let told = ran.err.lines().filter(|line| line.starts_with('{')).map(json);
        let files: Vec<_> = told.filter(|status| status.get("file").is_some()).collect();
        assert!(!files.is_empty(), "{args:?}: {}", ran.err);
        for status in files {
            let number = status["file_number"].as_u64().unwrap() as usize;
            assert!(status["file"].as_str().unwrap().ends_with(args[number]), "{status}");
            assert_eq!(status["files"], 3, "{status}");
        }
    }
    let one = place.ok(&["grid", "a.laz", "one.tif", "--cell", "2", "--progress", "json"]);
    assert!(!one.err.contains("file"), "{}", one.err);
}

/// A command that does not ignore a signal though the tests may, and with them all that they start: those
/// that a shell without job control put into the background ignore INT, those under nohup HUP.
#[cfg(unix)]
fn heeding(signal: &str, command: &Command) -> Command {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap_or("0");
    let none = ignored.trim().chars().all(|digit| digit == '0');
    let mut heeding = Command::new(if none { command.get_program() } else { "env".as_ref() });
    if !none {
        heeding.arg(format!("--default-signal={signal}")).arg(command.get_program());
    }
    heeding.args(command.get_args()).current_dir(command.get_current_dir().unwrap());
    heeding
}

#[cfg(unix)]
#[test]
fn a_signal_leaves_nothing_half_written() {
    for signal in ["INT", "TERM", "HUP"] {
        let place = Place::new();
        let args = [
            "tin",
            "synth:rough,size=60000,seed=1",
            "a.ply",
            "--max-error",
            "1",
            "--progress",
            "json",
        ];
        let mut command = heeding(signal, &place.command(&args));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut messages = BufReader::new(child.stderr.take().unwrap());
        messages.read_line(&mut String::new()).unwrap();
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-s", signal, &id]).status().unwrap().success());
        let mut rest = String::new();
        messages.read_to_string(&mut rest).unwrap();
        let ran = Ran::from(child.wait_with_output().unwrap());
        assert_eq!((ran.code, ran.out.as_str()), (130, ""), "{rest}");
        assert!(rest.lines().last().unwrap().starts_with("terrane: error: interrupted"), "{rest}");
        assert_eq!(place.files(), Vec::<String>::new());
    }
}

/// As under nohup: the job outlives the terminal.
#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_is_ignored_at_the_start_stays_ignored() {
    let place = Place::new();
    let job = "exec \"$0\" tin synth:rough,size=1500,seed=1 a.ply --max-error 2 --progress json";
    let mut command = Command::new("sh");
    command.args(["-c", &format!("trap '' HUP; {job}"), env!("CARGO_BIN_EXE_terrane")]);
    command.current_dir(place.path(".")).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut messages = BufReader::new(child.stderr.take().unwrap());
    messages.read_line(&mut String::new()).unwrap();
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-HUP", &id]).status().unwrap().success());
    let mut rest = String::new();
    messages.read_to_string(&mut rest).unwrap();
    let ran = Ran::from(child.wait_with_output().unwrap());
    assert_eq!(ran.code, 0, "{rest}");
    assert!(place.path("a.ply").is_file());
}

/// Runs with files limited to `blocks` of 512 or 1024 bytes, which fails as a full disk does.
#[cfg(target_os = "linux")]
fn run_short_of_room(place: &Place, args: &[&str], blocks: u32) -> Ran {
    let mut command = Command::new("sh");
    let limit = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    command.args(["-c", &limit, env!("CARGO_BIN_EXE_terrane")]).args(args);
    Ran::from(command.current_dir(place.path(".")).output().unwrap())
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_fills_up_is_told_by_the_outputs_own_name() {
    let place = Place::new();
    let jobs: [(&[&str], &str); 3] = [
        (&["view", TERRAIN, "-o", "a.png", "--width", "600"], "a.png"),
        (&["tin", TERRAIN, "a.ply", "--max-error", "0.1"], "a.ply"),
        (&["tin", TERRAIN, "a.glb", "--max-error", "0.1"], "a.glb"),
    ];
    for (args, name) in jobs {
        let ran = run_short_of_room(&place, args, 16);
        assert_eq!(ran.code, 74, "{args:?}: {}", ran.err);
        assert!(ran.err.starts_with(&format!("terrane: error: {name}: ")), "{}", ran.err);
        assert!(!ran.err.contains(".tmp"), "{}", ran.err);
        assert_eq!(place.files(), Vec::<String>::new());
    }
}

#[cfg(unix)]
#[test]
fn a_link_is_written_through() {
    let place = Place::new();
    std::fs::create_dir(place.path("there")).unwrap();
    place.write("there/a.ply", "old");
    std::os::unix::fs::symlink("there/a.ply", place.path("a.ply")).unwrap();
    let args = ["tin", TERRAIN, "a.ply", "--max-error", "5"];
    place.fails(&args, 2, &["exists"]);
    place.ok(&[&args[..], &["--overwrite"]].concat());
    assert!(place.path("a.ply").symlink_metadata().unwrap().is_symlink());
    assert!(std::fs::read(place.path("there/a.ply")).unwrap().starts_with(b"ply"));
}

#[test]
fn a_terrain_of_a_million_by_a_million_samples_is_drawn() {
    let place = Place::new();
    let terrain = "synth:rough,size=1000000,seed=1";
    place.ok(&["view", terrain, "-o", "a.png", "--width", "200"]);
    assert_eq!(size_of_png(&place, "a.png"), (200, 200));
    assert!(opacity(&place, "a.png").iter().all(|&a| a == 255));
}
