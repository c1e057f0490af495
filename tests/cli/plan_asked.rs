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
            let words = [*name, if *written == "folder" { "names a file" } else { *written }];
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
    place.fails(&["run", "w0", "-o", "x.ply", "--split", "1"], 2, &["x.ply", "names a file"]);
}

#[test]
fn names_of_files_are_refused_for_folders_without_a_plan_too() {
    let place = place();
    let tin = ["tin", "in/g.tif", "--max-error", "5"];
    place.fails(&[&tin[..], &["x.ply", "--split", "1"]].concat(), 2, &["x.ply", "names a file"]);
    for how in [["--tile", "30"], ["--split", "class"]] {
        let args = ["points", "in/a.las", "x.laz", how[0], how[1]];
        place.fails(&args, 2, &["x.laz", "names a file"]);
    }
    // A format that is named counts more than an ending.
    for workdir in [&[][..], &["--workdir", "w"]] {
        place.ok(&[&tin[..], &["x.obj", "-f", "PLY", "-q", "--overwrite"], workdir].concat());
        assert!(place.bytes("x.obj").starts_with(b"ply"));
    }
}
