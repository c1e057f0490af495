//! What is asked of a plan: names that say something else than what is written are refused before the work, and what
//! is the same however it is written is the same plan.

use crate::cli_support::Place;

const CLOUD: &str = "synth:cloud,size=60,density=2,seed=5";

/// Two clouds and a grid in a folder, which a link leads to, too.
fn place() -> Place {
    let place = Place::new();
    std::fs::create_dir(place.path("in")).unwrap();
    for (name, seed) in [("in/a.las", "3"), ("in/b.las", "4")] {
        place.ok(&["synth", &format!("cloud,size=60,density=2,seed={seed}"), name, "-q"]);
    }
    place.ok(&["convert", "synth:rough,size=60", "in/g.tif", "-q"]);
    place.write("in/g.prj", "EPSG:32631");
    #[cfg(unix)]
    std::os::unix::fs::symlink("in", place.path("link")).unwrap();
    place
}

/// Plans of all kinds, with what they write.
const PLANS: [(&[&str], &str); 6] = [
    (&["tin", "in/g.tif", "--max-error", "5"], "PLY"),
    (&["tin", "in/g.tif", "--max-error", "5", "-f", "OBJ"], "OBJ"),
    (&["tin", CLOUD, "--max-error", "5"], "PLY"),
    (&["grid", CLOUD, "--cell", "4"], "GTiff"),
    (&["tiles", "in/g.tif"], "folder"),
    (&["points", "in/a.las", "--tile", "30"], "folder"),
];

#[test]
fn names_of_other_formats_are_refused_before_the_work_of_a_plan() {
    let place = place();
    for (number, (plan, written)) in PLANS.iter().enumerate() {
        let folder = format!("w{number}");
        place.ok(&[&["plan"], *plan, &["-o", &folder, "-q"]].concat());
        let (own, others) = match *written {
            "PLY" => ("out.PLY", &["x.obj", "x.glb", "x.tif", "x.laz", "x.geojson"][..]),
            "OBJ" => ("out.obj", &["x.ply", "x.STL", "x.las"][..]),
            "GTiff" => ("out.tiff", &["x.asc", "x.ply", "x.laz"][..]),
            _ => ("out", &["x.las", "x.LAZ", "x.copc.laz", "x.obj", "x.tif", "x.3tz"][..]),
        };
        for name in others {
            let words =
                [*name, if *written == "folder" { "extension of a file format" } else { *written }];
            place.fails(&["run", &folder, "-o", name, "-q"], 2, &words);
            place.fails(&["finish", &folder, name, "-q"], 2, &words);
            assert!(!place.path(name).exists(), "{plan:?} {name}");
        }
        let objects = std::fs::read_dir(place.path(&format!("{folder}/objects"))).unwrap();
        assert_eq!(objects.count(), 0, "{plan:?}: told before the work");
        place.ok(&["run", &folder, "-o", &format!("{number}-{own}"), "-q"]);
    }
    place.ok(&["run", "w0", "-o", "mesh.dat", "-q"]);
    place.ok(&["run", "w0", "-o", "blocks", "--split", "1", "-q"]);
    place.fails(
        &["run", "w0", "-o", "x.ply", "--split", "1"],
        2,
        &["x.ply", "extension of a file format"],
    );
}

#[test]
fn names_of_files_are_refused_for_folders_without_a_plan_too() {
    let place = place();
    let tin = ["tin", "in/g.tif", "--max-error", "5"];
    place.fails(
        &[&tin[..], &["x.ply", "--split", "1"]].concat(),
        2,
        &["x.ply", "extension of a file format"],
    );
    for how in [["--tile", "30"], ["--split", "class"]] {
        let args = ["points", "in/a.las", "x.laz", how[0], how[1]];
        place.fails(&args, 2, &["x.laz", "extension of a file format"]);
    }
    // A format that is named counts more than an ending.
    for workdir in [&[][..], &["--workdir", "w"]] {
        place.ok(&[&tin[..], &["x.obj", "-f", "PLY", "-q", "--overwrite"], workdir].concat());
        assert!(place.bytes("x.obj").starts_with(b"ply"));
    }
}

/// A plan, what is said of it first, and what says the same, or something else.
type Said = (&'static [&'static str], &'static [&'static str], &'static [&'static str], bool);

#[test]
fn a_plan_is_the_same_however_its_values_are_written() {
    let place = place();
    let (grid, points): (&[&str], &[&str]) =
        (&["grid", CLOUD, "--cell", "4"], &["points", "in/a.las", "--tile", "30"]);
    let (mesh, tin): (&[&str], &[&str]) =
        (&["tin", CLOUD, "--max-error", "5"], &["tin", "in/g.tif", "--max-error", "5"]);
    let said: [Said; 26] = [
        (grid, &[], &["--align", "0,0"], true),
        (grid, &["--align", "0,0"], &["--align", "0.0,-0"], true),
        (grid, &[], &["--align", "1,0"], false),
        (grid, &[], &["--stat", "mean"], true),
        (grid, &[], &["--stat", "AVG"], true),
        (grid, &["--stat", "idw"], &["--stat", "idw", "--power", "1.0"], true),
        (grid, &["--stat", "idw", "--power", "1"], &["--stat", "idw", "--power", "1.0"], true),
        (grid, &["--stat", "idw"], &["--stat", "idw", "--power", "2"], false),
        (grid, &["--stat", "idw:power=1,p95"], &["--stat", "idw:power=1.0,p95.0"], true),
        (grid, &["--class", "9,2"], &["--class", "2,9"], true),
        (grid, &["--class", "9,2"], &["--class", "2", "--class", "9", "--class", "2"], true),
        (grid, &["--class", "9,2"], &["--class", "2"], false),
        (grid, &[], &["--every", "1"], true),
        (grid, &[], &["--every", "2"], false),
        (grid, &["--co", "compress=zstd"], &["--co", "COMPRESS=ZSTD"], true),
        (grid, &["--co", "COMPRESS=ZSTD"], &["--co", "COMPRESS=LZW"], false),
        (
            grid,
            &["--co", "COMPRESS=ZSTD", "--co", "PREDICTOR=NO"],
            &["--co", "predictor=no", "--co", "compress=zstd"],
            true,
        ),
        (grid, &["--crs", "epsg:32631"], &["--crs", "EPSG:32631"], true),
        (points, &["--class", "9,2"], &["--class", "2,9"], true),
        (points, &["--every", "1"], &[], true),
        (mesh, &["--class", "9,2", "--every", "1"], &["--class", "2,9"], true),
        (tin, &["--band", "1"], &["--triangulation", "delaunay"], true),
        (tin, &["--to-crs", "epsg:4326"], &["--to-crs", "EPSG:4326"], true),
        (tin, &["--to-crs", "EPSG: 4326"], &["--to-crs", "EPSG:4326"], true),
        (tin, &["--to-crs", "EPSG:4326"], &["--to-crs", "EPSG:3035"], false),
        (&["tiles", "in/g.tif"], &["--band", "1"], &["--format", "quantized-mesh"], true),
    ];
    for (number, (plan, first, then, is_same)) in said.into_iter().enumerate() {
        let folder = format!("w{number}");
        let write = |how| [&["plan"], plan, how, &["-o", &folder, "-q"]].concat();
        place.ok(&write(first));
        match is_same {
            true => drop(place.ok(&write(then))),
            false => place.fails(&write(then), 2, &["holds another plan"]),
        }
    }
}

#[cfg(unix)]
#[test]
fn a_plan_is_the_same_however_its_files_are_named() {
    let place = place();
    let whole = place.path("in").to_str().unwrap().to_owned();
    let [g, a] = ["g.tif", "a.las"].map(|name| format!("{whole}/{name}"));
    let grids = ["in/g.tif", "./in/g.tif", "in/../in/g.tif", "link/g.tif", &g];
    let clouds: [&[&str]; 5] = [
        &["in/a.las", "in/b.las"],
        &["in/b.las", "./in/a.las"],
        &[&a, "link/b.las"],
        &["in/*.las"],
        &["in/b.las", "in/a.las", "link/a.las"],
    ];
    let grids: Vec<&[&str]> = grids.iter().map(std::slice::from_ref).collect();
    let area = "POLYGON ((0 0, 1e7 0, 1e7 1e7, 0 1e7, 0 0))";
    place.write("area.wkt", area).write("area.prj", "EPSG:32631");
    for (verb, output, how, inputs) in [
        ("tin", "o.ply", &["--max-error", "5", "--clip", "area.wkt"][..], &grids[..]),
        ("tiles", "o", &[], &grids),
        ("tin", "o.ply", &["--max-error", "5"], &clouds),
        ("grid", "o.tif", &["--cell", "4", "--clip", "area.wkt"], &clouds),
        ("points", "o", &["--tile", "30"], &clouds),
    ] {
        place.ok(&[&["plan", verb], inputs[0], how, &["-o", "work", "-q"]].concat());
        place.ok(&["run", "work", "-o", output, "-q"]);
        let made = bytes(&place, output);
        for names in inputs {
            place.ok(&[&["plan", verb], *names, how, &["-o", "work", "-q"]].concat());
            if verb != "grid" {
                let work = ["--workdir", "work", "-q"];
                place.ok(&[&[verb], *names, &[output], how, &work].concat());
            }
            place.ok(&[&[verb], *names, &[output, "--overwrite", "-q"], how].concat());
            assert!(bytes(&place, output) == made, "{verb} {names:?}");
            place.ok(&["run", "work", "-o", output, "--overwrite", "-q"]);
        }
        std::fs::remove_dir_all(place.path("work")).unwrap();
        let output = place.path(output);
        if output.is_dir() {
            std::fs::remove_dir_all(output)
        } else {
            std::fs::remove_file(output)
        }
        .unwrap();
    }
}

/// What a file holds, or all files of a folder.
fn bytes(place: &Place, output: &str) -> Vec<Vec<u8>> {
    match place.path(output).is_file() {
        true => vec![place.bytes(output)],
        false => {
            let names = crate::tiles::walk(place, output);
            names.iter().map(|name| place.bytes(&format!("{output}/{name}"))).collect()
        }
    }
}
