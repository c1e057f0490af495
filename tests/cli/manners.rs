//! Manners: messages that say what to do, names of any kind, and prints of the size that was asked for.

use crate::cli_support::{GRID, Place};

/// A cloud as text, 1 km across in the unit of its coordinates.
fn points(step: f64) -> String {
    let point = |i: u32| {
        let (x, y) = (f64::from(i % 10), f64::from(i / 10));
        format!("{} {} {}\n", 7.0 + x * step, 46.0 + y * step, i % 7)
    };
    (0..100).map(point).collect()
}

#[test]
fn the_output_may_stand_behind_an_option() {
    let place = Place::new();
    let line = "LINESTRING (0 0, 1 0.1, 2 0)\n";
    place.write("a.asc", GRID).write("a.txt", points(100.0)).write("a.wkt", line);
    for (args, output) in [
        (&["tin", "a.asc", "--max-error", "2", "a.ply"][..], "a.ply"),
        (&["tin", "--max-error", "2", "a.asc", "--overwrite", "a.ply"], "a.ply"),
        (&["convert", "a.asc", "--round", "b.asc"], "b.asc"),
        (&["grid", "a.txt", "--cell", "100", "a.tif"], "a.tif"),
        (&["line", "a.wkt", "--tolerance", "1", "b.wkt"], "b.wkt"),
        (&["contour", "a.asc", "--interval", "3", "c.fgb"], "c.fgb"),
        (&["contour", "a.asc", "-o", "d.fgb", "--interval", "3"], "d.fgb"),
        (&["tin", "a.asc", "--max-error", "2", "--exaggeration", "2", "a.stl"], "a.stl"),
        (&["tin", "a.asc", "--max-error", "2", "--exaggerate", "2", "b.stl"], "b.stl"),
    ] {
        place.ok(args);
        assert!(place.path(output).is_file(), "{args:?}");
    }
    for args in [&["tin", "a.asc", "--max-error", "2"][..], &["convert", "a.asc"]] {
        place.fails(args, 2, &["output file missing: pass the input, then the output"]);
    }
}

#[test]
fn the_lowest_height_is_named_before_the_work() {
    let place = Place::new();
    place.write("a.asc", GRID);
    for base in ["1", "1.5", "3", "9"] {
        let base = format!("SOLID_BASE={base}");
        let args = ["tin", "a.asc", "a.stl", "--max-error", "0", "--co", &base];
        place.fails(&args, 2, &["the lowest height, 1", "pass a base below 1"]);
    }
    place.ok(&["tin", "a.asc", "a.stl", "--max-error", "0", "--co", "SOLID_BASE=0.5"]);
}

#[test]
fn a_file_that_a_vrt_names_is_told_with_the_vrt() {
    let source = |name: &str| {
        format!(
            "<SimpleSource><SourceFilename relativeToVRT=\"1\">{name}</SourceFilename>\
             <SourceBand>1</SourceBand></SimpleSource>"
        )
    };
    let vrt = |sources: &str| {
        format!(
            "<VRTDataset rasterXSize=\"4\" rasterYSize=\"3\"><GeoTransform>0,1,0,0,0,-1\
             </GeoTransform><VRTRasterBand dataType=\"Float32\" band=\"1\">{sources}\
             </VRTRasterBand></VRTDataset>"
        )
    };
    let place = Place::new();
    place.write("broken.asc", &GRID[..GRID.len() - 9]);
    place.write("lost.vrt", vrt(&source("gone.asc")));
    place.write("broken.vrt", vrt(&source("broken.asc")));
    place.write("outer.vrt", vrt(&source("lost.vrt")));
    for (args, words) in [
        (["info", "lost.vrt"], &["lost.vrt: source gone.asc"][..]),
        (["info", "broken.vrt"], &["broken.vrt: source broken.asc"]),
        (["info", "outer.vrt"], &["outer.vrt: source lost.vrt: source gone.asc"]),
    ] {
        let ran = place.run(&args);
        assert_eq!(ran.code, 65, "{}", ran.err);
        words.iter().for_each(|word| assert!(ran.err.contains(word), "{}", ran.err));
    }
}

#[test]
fn bytes_too_many_are_told_from_polygons() {
    let header = |faces: &str, corners: u8| {
        let mut text = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n\
             property float y\nproperty float z\n{faces}end_header\n"
        )
        .into_bytes();
        let square = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        text.extend(square.iter().flatten().flat_map(|c| c.to_le_bytes()));
        if corners > 0 {
            text.push(corners);
            text.extend((0..u32::from(corners)).flat_map(u32::to_le_bytes));
        }
        text
    };
    let face = "element face 1\nproperty list uchar uint vertex_indices\n";
    let with_more = |mut bytes: Vec<u8>| {
        bytes.push(0);
        bytes
    };
    let place = Place::new();
    place.write("square.ply", header(face, 4));
    place.write("long.ply", with_more(header(face, 3)));
    place.write("bare.ply", with_more(header("", 0)));
    place.fails(
        &["info", "square.ply"],
        65,
        &["face 0 has 4 corners", "triangulate the mesh first"],
    );
    for name in ["long.ply", "bare.ply"] {
        place.fails(&["info", name], 65, &["has 1 surplus bytes", "copy the file again"]);
    }
}

#[test]
fn cells_of_degrees_are_not_taken_for_metres() {
    let place = Place::new();
    place.write("a.txt", points(0.001));
    let grid = |more: &[&'static str]| {
        let all = ["grid", "a.txt", "a.tif", "--crs", "EPSG:4326", "--overwrite"];
        [&all[..], more].concat()
    };
    for more in [&["--cell", "1"][..], &["--cell", "0.5,2"], &["--cell", "1", "--compat", "pdal"]] {
        place.fails(&grid(more), 2, &["--cell is in degrees", "pass --cell"]);
    }
    place.fails(
        &["plan", "grid", "a.txt", "-o", "w", "--cell", "1", "--crs", "EPSG:4326"],
        2,
        &["--cell is in degrees"],
    );
    place.ok(&grid(&["--cell", "0.002"]));
    place.ok(&grid(&["--cell", "1", "--bbox", "7,46,8,47"]));
    place.ok(&["grid", "a.txt", "b.tif", "--cell", "1"]);
}

/// Names of bytes that are no UTF-8.
#[cfg(unix)]
mod latin {
    use std::ffi::{OsStr, OsString};
    use std::os::unix::ffi::OsStrExt;
    use std::process::{Command, Output};

    use crate::cli_support::{Place, batch};

    /// "dém.ENDING" in Latin-1.
    fn name(ending: &str) -> OsString {
        OsStr::from_bytes(&[b"d\xe9m.", ending.as_bytes()].concat()).to_owned()
    }

    fn run(place: &Place, args: &[&OsStr]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrane"));
        command.args(args).current_dir(place.path("")).output().unwrap()
    }

    #[test]
    fn names_of_any_bytes_work_with_every_verb() {
        let place = batch();
        let at = |name: &OsStr| place.path("").join(name);
        std::fs::copy(place.path("g/a.asc"), at(&name("asc"))).unwrap();
        std::fs::copy(place.path("c/a.laz"), at(&name("laz"))).unwrap();
        std::fs::copy(place.path("f/a.geojson"), at(&name("geojson"))).unwrap();
        std::fs::write(place.path("list.txt"), [name("asc").as_bytes(), b"\n"].concat()).unwrap();
        std::fs::create_dir(at(&name("d"))).unwrap();
        std::fs::copy(place.path("g/a.asc"), at(&name("d")).join(name("asc"))).unwrap();
        let word = |text: &'static str| -> OsString {
            match text.split_at(1) {
                ("@", ending) => name(ending),
                ("%", ending) => OsStr::from_bytes(&[b"\xfc.", ending.as_bytes()].concat()).into(),
                _ => text.into(),
            }
        };
        for (args, output) in [
            (&["tin", "@asc", "@ply", "--max-error", "0", "--report", "@json"][..], "@ply"),
            (&["verify", "@ply", "@asc"], "@ply"),
            (&["info", "@ply", "--json"], "@ply"),
            (&["info", "@asc", "--json"], "@ply"),
            (&["info", "list.txt", "@laz", "@geojson"], "@ply"),
            (&["view", "@ply", "-o", "@png", "--width", "200"], "@png"),
            (&["convert", "@asc", "@tif"], "@tif"),
            (&["convert", "@d", "%tif", "-f", "GTiff"], "%tif"),
            (&["contour", "@asc", "-o", "@wkt", "-i", "2"], "@wkt"),
            (&["grid", "@laz", "@tiff", "--cell", "5"], "@tiff"),
            (&["grid", "@laz", "%tiff", "--like", "@tiff"], "%tiff"),
            (&["tin", "@laz", "@glb", "--max-error", "1"], "@glb"),
            (&["verify", "@glb", "@laz"], "@glb"),
            (&["line", "@geojson", "%shp", "--tolerance", "1"], "%dbf"),
            (&["verify", "%shp", "@geojson", "--tolerance", "1"], "%shx"),
            (&["synth", "rough,size=9", "%synth.tif"], "%synth.tif"),
            (&["plan", "tin", "@asc", "-o", "@plan", "--max-error", "0"], "@plan"),
            (&["run", "@plan"], "@plan"),
            (&["finish", "@plan", "%ply", "--overwrite"], "%ply"),
            (&["status", "@plan"], "@plan"),
            (&["plan", "grid", "@laz", "-o", "@gplan", "--cell", "5"], "@gplan"),
            (&["run", "@gplan"], "@gplan"),
            (&["tin", "@asc", "@stl", "--max-error", "0", "--workdir", "@work"], "@work"),
        ] {
            let args: Vec<OsString> = args.iter().map(|text| word(text)).collect();
            let args: Vec<&OsStr> = args.iter().map(OsString::as_os_str).collect();
            let ran = run(&place, &args);
            assert!(ran.status.success(), "{args:?}: {}", String::from_utf8_lossy(&ran.stderr));
            assert!(std::str::from_utf8(&ran.stdout).is_ok(), "{args:?}");
            assert!(at(&word(output)).exists(), "{args:?}");
        }
        let (folder, laz) = (name("d"), name("laz"));
        let report = [folder.as_bytes(), b"/r.json"].concat();
        let mut args: Vec<&OsStr> = vec!["points".as_ref(), &laz, "squares".as_ref()];
        args.extend(["--tile", "20", "--workdir"].map(OsStr::new));
        args.extend([&folder, OsStr::new("--report"), OsStr::from_bytes(&report)]);
        let refused = run(&place, &args);
        let told = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(2) && told.contains("a part of it"), "{told}");
        let missing = run(&place, &["info".as_ref(), &name("nowhere")]);
        let told = String::from_utf8_lossy(&missing.stderr).into_owned();
        assert!(told.contains("d\u{fffd}m.nowhere"), "{told}");
    }
}

/// A run that is killed leaves nothing, not even a hidden file, beside its output.
#[cfg(target_os = "linux")]
#[test]
fn a_killed_run_leaves_no_hidden_file() {
    let place = Place::new();
    let jobs: [&[&str]; 3] = [
        &["tin", "synth:rough,size=6001,seed=1", "o.ply", "--max-error", "0.5", "--threads", "1"],
        &["convert", "synth:rough,size=12001,seed=1", "o.tif", "--threads", "1"],
        &["synth", "cloud,size=3000,density=8", "o.laz"],
    ];
    for job in jobs {
        let mut child = place.command(job).spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(700));
        assert!(child.try_wait().unwrap().is_none(), "{job:?} ended before it was killed");
        child.kill().unwrap();
        child.wait().unwrap();
        let left: Vec<_> = std::fs::read_dir(place.path("")).unwrap().flatten().collect();
        assert!(left.is_empty(), "{job:?}: {left:?}");
    }
}
