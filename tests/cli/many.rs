//! Many files: bad ones among good ones, folders below folders, kinds of files, and advice that helps.

use crate::cli_support::{self, batch, beside};

/// Each verb on a folder of a batch: arguments, the kind of files, and what it writes.
const VERBS: [(&[&str], &str, &[&str]); 9] = [
    (&["tin", "g", "out.ply", "--max-error", "0"], "g", &["--report", "r.json"]),
    (&["convert", "g", "out.tif"], "g", &["--json"]),
    (&["contour", "g", "-o", "out.geojson", "-i", "2"], "g", &["--report", "r.json"]),
    (&["view", "g", "-o", "out.png", "--width", "200"], "g", &["--json"]),
    (&["info", "g"], "g", &["--json"]),
    (&["plan", "tin", "g", "-o", "out", "--max-error", "0"], "g", &["--json"]),
    (&["tin", "c", "out.ply", "--max-error", "1"], "c", &["--report", "r.json"]),
    (&["grid", "c", "out.tif", "--cell", "5"], "c", &["--report", "r.json"]),
    (&["line", "f", "out", "--tolerance", "1"], "f", &["--report", "r.json"]),
];

#[test]
fn all_bad_files_of_a_batch_are_told_at_once() {
    let place = batch();
    for (args, kind, _) in VERBS {
        let ran = place.run(args);
        assert!(ran.code == 65 && ran.out.is_empty(), "{args:?}: {}", ran.err);
        let lines: Vec<&str> = ran.err.lines().collect();
        for bad in ["b", "d"] {
            let name = format!("{kind}/{bad}.");
            let told = lines.iter().filter(|line| line.contains(&name)).count();
            assert_eq!(told, 1, "{args:?}: {}", ran.err);
        }
        let last = lines.last().unwrap();
        assert!(last.contains("2 of 4 files cannot be used; "), "{args:?}: {}", ran.err);
        assert!(!place.path("out").exists());
    }
}

#[test]
fn bad_files_are_skipped_when_asked_and_listed() {
    for (args, kind, report) in VERBS {
        let place = batch();
        let ran = place.ok(&[args, report, &["--skip-bad"]].concat());
        let told = match report {
            ["--json"] => ran.out,
            _ => std::fs::read_to_string(place.path("r.json")).unwrap(),
        };
        let report: serde_json::Value = serde_json::from_str(&told).unwrap();
        let names: Vec<&str> = report["skipped"]
            .as_array()
            .unwrap_or_else(|| panic!("{args:?}: {told}"))
            .iter()
            .map(|one| one["file"].as_str().unwrap())
            .collect();
        assert_eq!(names.len(), 2, "{args:?}: {names:?}");
        for name in names {
            assert!(name.starts_with(&format!("{kind}/")), "{name}");
            let lines = ran.err.lines().filter(|line| line.contains(&format!("skipped {name}: ")));
            assert_eq!(lines.count(), 1, "{args:?}: {}", ran.err);
        }
    }
}

#[test]
fn a_plan_keeps_to_the_files_it_was_made_with() {
    let place = batch();
    place.ok(&["plan", "tin", "g", "-o", "w", "--max-error", "0", "--skip-bad"]);
    place.ok(&["plan", "grid", "c", "-o", "v", "--cell", "5", "--skip-bad"]);
    // Mended afterwards: the plans have been made without it.
    place.write("g/b.asc", beside(7));
    for folder in ["w", "v"] {
        let status = place.ok(&["status", folder, "--json"]).out;
        let status: serde_json::Value = serde_json::from_str(&status).unwrap();
        assert_eq!(status["skipped"].as_array().map(Vec::len), Some(2), "{status}");
        place.ok(&["run", folder]);
    }
    place.ok(&["tin", "g/a.asc", "g/c.asc", "whole.ply", "--max-error", "0"]);
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert_eq!(bytes("w/mesh.ply").len(), bytes("whole.ply").len());
}

#[test]
fn what_a_plan_leaves_out_is_told_and_is_no_reason_to_plan_anew() {
    let place = batch();
    let tin = |more: &[&'static str]| {
        [&["tin"], more, &["out.ply", "--max-error", "0", "--workdir", "w"]].concat()
    };
    let skipping = tin(&["g", "--skip-bad"]);
    let names = |text: &str| {
        let told: serde_json::Value = serde_json::from_str(text).unwrap();
        let all = told["skipped"].as_array().cloned().unwrap_or_default();
        all.iter().map(|one| one["file"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let bad = ["g/b.asc", "g/d.asc"];
    assert_eq!(names(&place.ok(&[&skipping[..], &["--json"]].concat()).out), bad);
    assert_eq!(names(&place.ok(&["status", "w", "--json"]).out), bad);
    assert_eq!(names(&place.ok(&["run", "w", "-o", "out.ply", "--json"]).out), bad);
    for told in [place.ok(&["status", "w"]).out, place.ok(&["run", "w", "-o", "out.ply"]).out] {
        let rows = bad.iter().filter(|name| told.contains(&format!("{name}: ")));
        assert_eq!(rows.count(), 2, "{told}");
    }
    let made = std::fs::read(place.path("out.ply")).unwrap();
    // The same work, asked for by the names of what is left, and after another reason to skip.
    place.write("g/b.asc", "neither a grid nor as it was");
    place.ok(&tin(&["g/a.asc", "g/c.asc"]));
    place.ok(&skipping);
    place.ok(&["plan", "tin", "g", "-o", "w", "--max-error", "0", "--skip-bad"]);
    assert!(std::fs::read(place.path("out.ply")).unwrap() == made);
    place.ok(&["plan", "grid", "c", "-o", "v", "--cell", "5", "--skip-bad"]);
    place.write("c/b.laz", "neither a cloud nor as it was");
    place.ok(&["plan", "grid", "c", "-o", "v", "--cell", "5", "--skip-bad"]);
    assert_eq!(names(&place.ok(&["run", "v", "--json"]).out), ["c/b.laz", "c/d.laz"]);
}

#[test]
fn folders_recurse_when_asked() {
    let place = batch();
    for name in ["g/b.asc", "g/d.asc", "c/b.laz", "c/d.laz", "f/b.geojson", "f/d.geojson"] {
        std::fs::remove_file(place.path(name)).unwrap();
    }
    let files = |args: &[&str]| {
        let report = place.ok(args).out;
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        report["details"]["files"]
            .as_str()
            .map(str::to_owned)
            .unwrap_or(report["files"].to_string())
    };
    for (kind, ending) in [("g", "asc"), ("c", "laz")] {
        assert_eq!(files(&["info", kind, "--json"]), "2");
        assert_eq!(files(&["info", kind, "--json", "--recursive"]), "3");
        assert_eq!(files(&["info", &format!("{kind}/**/*.{ending}"), "--json"]), "3");
    }
    place.ok(&["line", "f", "out", "--tolerance", "1", "--recursive"]);
    place.ok(&["line", "f/**/*.geojson", "too", "--tolerance", "1"]);
    for folder in ["out", "too"] {
        let made = std::fs::read_dir(place.path(folder)).unwrap().count();
        assert_eq!(made, 3, "{folder}");
    }
    place.fails(&["info", "g/a.asc", "--recursive"], 2, &["--recursive requires a folder"]);
}

#[test]
fn the_kind_of_files_is_asked_of_those_below() {
    let place = batch();
    for name in ["g/b.asc", "g/d.asc", "c/b.laz", "c/d.laz", "f/b.geojson", "f/d.geojson"] {
        std::fs::remove_file(place.path(name)).unwrap();
    }
    // Nothing but folders in the first.
    for (kind, ending) in [("g", "asc"), ("c", "laz"), ("f", "geojson")] {
        let (outer, inner) = (format!("only-{kind}"), format!("only-{kind}/{kind}"));
        std::fs::create_dir(place.path(&outer)).unwrap();
        std::fs::rename(place.path(kind), place.path(&inner)).unwrap();
        assert!(place.path(&format!("{inner}/a.{ending}")).exists());
    }
    let deep = [["only-KIND", "--recursive"], ["only-KIND/**", "--quiet"]];
    for (i, [input, option]) in deep.into_iter().enumerate() {
        let (grids, clouds) = (input.replace("KIND", "g"), input.replace("KIND", "c"));
        let features = input.replace("KIND", "f");
        let out = |ending: &str| format!("{i}{ending}");
        let (mesh, hull) = (out("g.ply"), out("c.ply"));
        place.ok(&["tin", &grids, &mesh, "--max-error", "1", option]);
        place.ok(&["verify", &mesh, &grids, option]);
        place.ok(&["tin", &clouds, &hull, "--max-error", "1", option]);
        place.ok(&["verify", &hull, &clouds, option]);
        place.ok(&["grid", &clouds, &out(".tif"), "--cell", "5", option]);
        place.ok(&["plan", "grid", &clouds, "-o", &out("plan"), "--cell", "5", option]);
        place.ok(&["line", &features, &out("lines"), "--tolerance", "1", option]);
        for (input, kind, files) in [(&grids, "grid", "3"), (&clouds, "cloud", "3")] {
            let told: serde_json::Value =
                serde_json::from_str(&place.ok(&["info", input, "--json", option]).out).unwrap();
            let count = told["details"]["files"].as_str().map(str::to_owned);
            let count = count.unwrap_or(told["files"].to_string());
            assert_eq!((told["kind"].as_str().unwrap(), &*count), (kind, files), "{input}");
        }
    }
    std::fs::create_dir(place.path("both")).unwrap();
    std::fs::rename(place.path("only-g/g"), place.path("both/g")).unwrap();
    std::fs::rename(place.path("only-c/c"), place.path("both/c")).unwrap();
    std::fs::copy(place.path("both/c/a.laz"), place.path("both/g/a.laz")).unwrap();
    let both = ["point clouds and grids"];
    for verb in [&["tin", "both", "x.ply", "--max-error", "1"][..], &["verify", "0g.ply", "both"]] {
        place.fails(&[verb, &["--recursive"]].concat(), 2, &both);
    }
    let info = place.run(&["info", "both", "--recursive"]);
    assert!(info.code == 2 && info.err.contains(both[0]), "{}", info.err);
    place.fails(&["tin", "both/g", "x.ply", "--max-error", "1"], 2, &both);
    place.ok(&["tin", "both/**/*.laz", "x.ply", "--max-error", "1"]);
    place.ok(&["grid", "both", "x.tif", "--cell", "5", "--recursive"]);
    let two = ["tin", "both/c", "both/g/deep", "y.ply", "--max-error", "1", "--recursive"];
    place.fails(&two, 2, &["cannot be mixed"]);
}

#[test]
fn bad_files_by_themselves_are_skipped_when_asked() {
    let place = batch();
    place.ok(&["tin", "g/a.asc", "m.ply", "--max-error", "1"]);
    let good = ["g/a.asc", "m.ply", "c/a.laz", "f/a.geojson"];
    let bad = ["g/b.asc", "c/b.laz", "f/b.geojson", "nowhere.tif"];
    let args = [&["info", "--json", "--skip-bad"][..], &good, &bad].concat();
    let ran = place.ok(&args);
    let mut told: Vec<serde_json::Value> =
        ran.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let last = told.pop().unwrap();
    let skipped =
        last["skipped"].as_array().unwrap().iter().map(|one| one["file"].as_str().unwrap());
    assert_eq!((told.len(), skipped.collect::<Vec<_>>()), (good.len(), bad.to_vec()));
    for name in bad {
        assert!(ran.err.contains(&format!("skipped {name}: ")), "{}", ran.err);
    }
    let all_bad = place.run(&[&["info", "--skip-bad"][..], &bad].concat());
    assert_eq!((all_bad.code, all_bad.err.lines().count()), (65, bad.len()), "{}", all_bad.err);
    // A mesh is no bad grid.
    place.ok(&["info", "m.ply", "--skip-bad"]);
    place.ok(&["view", "m.ply", "-o", "m.png", "--width", "200", "--skip-bad"]);
    place.ok(&["tin", "g/a.asc", "g/c.asc", "proved.ply", "--max-error", "0", "-q"]);
    let proof = ["verify", "proved.ply", "g/a.asc", "g/c.asc", "g/none.asc"];
    assert!(place.ok(&[&proof[..], &["--skip-bad"]].concat()).err.contains("skipped g/none.asc"));
    place.fails(&proof, 65, &["g/none.asc", "no such file", "check the name"]);
}

#[test]
fn what_was_asked_for_says_whether_lines_go_into_a_folder() {
    let place = batch();
    let tolerance = ["--tolerance", "1", "-q"];
    for (i, args) in [
        &["f/a.geojson", "f/b.geojson", "OUT", "--skip-bad"][..],
        &["f/a.geojson", "nowhere.geojson", "OUT", "--skip-bad"],
        &["f/a*.geojson", "OUT"],
        &["f/deep", "OUT"],
        &["f/deep", "OUT", "--recursive"],
    ]
    .into_iter()
    .enumerate()
    {
        // Named so that either would do.
        let out = format!("{i}.wkt");
        let args: Vec<&str> =
            args.iter().map(|arg| if *arg == "OUT" { &out } else { *arg }).collect();
        place.ok(&[&["line"][..], &args, &tolerance].concat());
        let inside = std::fs::read_dir(place.path(&out)).unwrap().flatten().next().unwrap();
        assert!(inside.file_name().to_str().unwrap().ends_with(".geojson"), "{args:?}");
    }
    place.ok(&[&["line", "f/a.geojson", "one.wkt"][..], &tolerance].concat());
    assert!(place.path("one.wkt").is_file());
}

#[test]
fn to_skip_bad_files_is_advised_where_it_helps() {
    let advice = |ran: &cli_support::Ran| ran.err.contains("--skip-bad");
    for (args, kind, _) in VERBS {
        let place = batch();
        let ran = place.run(args);
        assert!(ran.code == 65 && advice(&ran), "{args:?}: {}", ran.err);
        for name in std::fs::read_dir(place.path(kind)).unwrap().flatten() {
            let path = name.path();
            if path.is_file() && !["b", "d"].contains(&path.file_stem().unwrap().to_str().unwrap())
            {
                std::fs::remove_file(path).unwrap();
            }
        }
        for more in [&[][..], &["--skip-bad"]] {
            let ran = place.run(&[args, more].concat());
            assert!(ran.code == 65 && !advice(&ran), "none is left, {args:?}: {}", ran.err);
        }
    }
    // The parts of one file cannot be skipped.
    let place = batch();
    let source = |name: &str, x: u32| {
        format!(
            "<SimpleSource><SourceFilename relativeToVRT=\"1\">{name}</SourceFilename>\
             <SourceBand>1</SourceBand><SrcRect xOff=\"0\" yOff=\"0\" xSize=\"4\" ySize=\"3\"/>\
             <DstRect xOff=\"{x}\" yOff=\"0\" xSize=\"4\" ySize=\"3\"/></SimpleSource>"
        )
    };
    let sources = [("g/a.asc", 0), ("g/b.asc", 4), ("g/d.asc", 8)].map(|(name, x)| source(name, x));
    place.write(
        "all.vrt",
        format!(
            "<VRTDataset rasterXSize=\"12\" rasterYSize=\"3\">\
             <GeoTransform>100,10,0,230,0,-10</GeoTransform>\
             <VRTRasterBand dataType=\"Float32\" band=\"1\">{}</VRTRasterBand></VRTDataset>",
            sources.concat()
        ),
    );
    for verb in [&["tin", "all.vrt", "a.ply", "--max-error", "1"][..], &["info", "all.vrt"]] {
        let ran = place.run(verb);
        assert!(ran.code == 65 && ran.err.contains("b.asc") && !advice(&ran), "{}", ran.err);
    }
}
