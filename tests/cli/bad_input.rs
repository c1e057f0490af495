//! What users get wrong: one line with the remedy, the right exit code, and nothing written.

use crate::cli_support::{GRID, Place, VOID_GRID};

fn place() -> Place {
    let place = Place::new();
    place.write("good.asc", GRID).write("void.asc", VOID_GRID);
    place.write("noise.tif", [7u8; 300]).write("text.txt", "hello").write("empty.tif", "");
    place
}

#[test]
fn missing_and_broken_inputs() {
    let place = place();
    let tin = |input: &str, code: i32, words: &[&str]| {
        place.fails(&["tin", input, "out.ply", "--max-error", "1"], code, words);
    };
    tin("nowhere.tif", 65, &["nowhere.tif", "no such file"]);
    let folder = place.run(&["tin", ".", "out.ply", "--max-error", "1"]);
    assert_eq!(folder.code, 65, "{}", folder.err);
    for (line, word) in folder.err.lines().zip(["empty.tif", "noise.tif", "--skip-bad"]) {
        assert!(line.starts_with("terrane: error: ") && line.contains(word), "{line}");
    }
    assert_eq!(folder.err.lines().count(), 3, "each bad file has its line: {}", folder.err);
    assert!(!place.path("out.ply").exists());
    std::fs::create_dir(place.path("bare")).unwrap();
    tin("bare", 65, &["bare", "holds no grid"]);
    tin("*.dem", 65, &["matches no file"]);
    tin("noise.tif", 65, &["noise.tif"]);
    tin("empty.tif", 65, &["empty.tif"]);
    tin("text.txt", 65, &["text.txt"]);
    tin("void.asc", 65, &["valid"]);
    tin("synth:nothing", 2, &["nothing"]);
}

#[test]
fn a_band_that_is_not_there() {
    let place = place();
    let args = ["tin", "good.asc", "out.ply", "--max-error", "1", "--band"];
    place.fails(&[&args[..], &["2"]].concat(), 2, &["band"]);
    place.fails(&[&args[..], &["0"]].concat(), 2, &["band"]);
}

#[test]
fn tolerances_that_are_none() {
    let place = place();
    for bad in ["-1", "nan", "inf", "-inf", "x", ""] {
        place.fails(&["tin", "good.asc", "out.ply", "--max-error", bad], 2, &["zero or more"]);
        place.fails(&["verify", "m.ply", "good.asc", "--max-error", bad], 2, &["zero or more"]);
    }
    place.ok(&["tin", "good.asc", "out.ply", "--max-error", "0"]);
}

#[test]
fn exactly_one_goal() {
    let place = place();
    place.fails(&["tin", "good.asc", "out.ply"], 2, &["no target given", "--max-error"]);
    let both = ["tin", "good.asc", "out.ply", "--max-error", "1", "--max-vertices", "9"];
    place.fails(&both, 2, &["cannot be used with"]);
    place.fails(&["tin", "good.asc", "out.ply", "--max-triangles", "0"], 2, &["--max-triangles"]);
}

#[test]
fn outputs_that_cannot_be() {
    let place = place();
    place.write("taken.ply", "keep me").write("taken.png", "keep me").write("taken.tif", "keep me");
    let tin = |output: &str, code: i32, words: &[&str]| {
        place.fails(&["tin", "good.asc", output, "--max-error", "1"], code, words);
    };
    tin("out.xyz", 2, &["xyz"]);
    tin("out", 2, &["out"]);
    tin("taken.ply", 2, &["exists", "--overwrite"]);
    tin("no/such/folder/out.ply", 73, &["folder"]);
    place.fails(&["tin", "good.asc", "out.ply", "--max-error", "1", "-f", "FBX"], 2, &["FBX"]);
    let co = ["tin", "good.asc", "out.ply", "--max-error", "1", "--co"];
    place.fails(&[&co[..], &["SOLID_BASE=0"]].concat(), 2, &["SOLID_BASE", "STL"]);
    place.fails(&[&co[..], &["LEVEL=9"]].concat(), 2, &["SOLID_BASE"]);
    place.fails(&["view", "good.asc", "-o", "taken.png"], 2, &["exists"]);
    place.fails(&["view", "good.asc", "-o", "out.jpg"], 2, &[".png"]);
    place.fails(&["convert", "good.asc", "taken.tif"], 2, &["exists"]);
    let convert = |args: &[&str], words: &[&str]| {
        place.fails(&[&["convert", "good.asc"], args].concat(), 2, words);
    };
    convert(&["out.jpg"], &[".tif or .tiff, .asc, .flt, .png"]);
    convert(&["out.png", "-f", "COG"], &["COG", ".tif"]);
    convert(&["out.tif", "-f", "JPEG"], &["JPEG", "GTiff, COG, store"]);
    convert(&["out.tif", "-f", "COG", "--co", "TILED=YES"], &["TILED", "COMPRESS=NONE|DEFLATE"]);
    convert(&["out.tif", "-f", "COG", "--co", "COMPRESS=JPEG"], &["JPEG", "NONE|DEFLATE|ZSTD"]);
    convert(&["out.tif", "--co", "COMPRESS"], &["KEY=VAL"]);
    convert(&["out.tif", "--type", "int64"], &["int64", "int32", "float32"]);
    let narrow = ["convert", "good.asc", "out.tif", "--type", "uint8"];
    place.fails(&narrow, 65, &["column 3, row 2", "--out-nodata"]);
    place.fails(&["convert", "noise.tif", "noise.tif", "--overwrite"], 2, &["also an input"]);
    let report = ["tin", "good.asc", "out.ply", "--max-error", "1", "--report", "taken.tif"];
    place.fails(&report, 2, &["taken.tif", "exists"]);
    for kept in ["taken.ply", "taken.png", "taken.tif"] {
        assert_eq!(std::fs::read(place.path(kept)).unwrap(), b"keep me");
    }
}

/// Two lines of features, in longitude and latitude.
const LINES: &str = r#"{"type":"LineString","coordinates":[[0,0],[1,0.1],[2,0]]}"#;

/// Verbs that take --report, each with what it makes: the name of a file without its ending, or of a
/// folder.
fn reporting() -> Vec<(Vec<String>, String)> {
    let mut verbs = Vec::new();
    let mut add = |args: &str, output: &str| {
        let words = args.replace('@', output);
        verbs.push((words.split(' ').map(str::to_owned).collect(), output.to_owned()));
    };
    let ending = |endings: &[&str]| format!("out.{}", endings[0]);
    // LandXML has no degrees.
    for format in terrane_mesh::FORMATS.iter().filter(|format| format.name != "LandXML") {
        let output = ending(format.extensions);
        add("tin dem.asc @ --max-error 1", &output);
        add("tin cloud:cloud.txt @ --max-error 1 --crs EPSG:4326", &output);
    }
    add("tin dem.asc out.ply --max-error 1 --workdir work", "out.ply");
    add("tin dem.asc @ --max-error 1 --split 1", "blocks");
    for format in terrane_raster::write::FORMATS.iter().filter(|format| format.name != "PNG") {
        let output = ending(format.extensions);
        add(&format!("grid cloud.txt @ --cell 0.002 --crs EPSG:4326 -f {}", format.name), &output);
    }
    let written = |f: &&terrane_vector::VectorFormat| f.create.is_some();
    for format in terrane_vector::FORMATS.iter().filter(written) {
        let output = ending(format.extensions);
        add("line in.geojson @ --tolerance 0.01", &output);
        add("line in.geojson more.geojson out --tolerance 0.01", "out");
        if format.holds.properties {
            add("contour dem.asc -o @ --interval 2", &output);
        }
    }
    verbs
}

/// Every file in a folder and those below, with its bytes.
fn contents(folder: &std::path::Path) -> std::collections::BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut all = std::collections::BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        match entry.path() {
            path if path.is_dir() => all.extend(contents(&path)),
            path => drop(all.insert(path.clone(), std::fs::read(path).unwrap())),
        }
    }
    all
}

#[test]
fn a_report_never_takes_the_place_of_what_is_read_or_made() {
    let place = Place::new();
    let point = |i: u32| {
        let (x, y) = (7.0 + f64::from(i % 10) * 1e-3, 46.0 + f64::from(i / 10) * 1e-3);
        format!("{x} {y} {}\n", i % 7)
    };
    place.write("cloud.txt", (0..100).map(point).collect::<String>());
    place.write("in.geojson", LINES).write("more.geojson", LINES);
    place.ok(&["grid", "cloud.txt", "dem.asc", "--cell", "0.001", "--crs", "EPSG:4326"]);
    let root = place.path("");
    let before = contents(&root);
    assert!(before.contains_key(&place.path("dem.prj")));
    let verbs = reporting();
    assert!(verbs.len() > 20);
    for (args, output) in verbs {
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        place.ok(&args);
        let made = contents(&root);
        assert!(made.len() > before.len(), "{args:?}");
        // Also what would be read with it if it were there.
        let stem = output.rsplit_once('.').map_or(&*output, |(stem, _)| stem);
        let mut taken: Vec<_> = made.keys().cloned().collect();
        if place.path(&output).is_file() {
            taken.extend(["prj", "PRJ"].map(|ending| place.path(&format!("{stem}.{ending}"))));
        }
        if args[0] == "grid" {
            taken.extend(["out.wld", "out.hdr"].map(|name| place.path(name)));
            taken.extend([".aux.xml", ".msk"].map(|ending| place.path(&(output.clone() + ending))));
        }
        let is_foreign = |path: &std::path::Path| {
            let names: &[&str] = match args[1] {
                "dem.asc" => &["cloud.txt", "in.geojson", "more.geojson"],
                "cloud.txt" | "cloud:cloud.txt" => {
                    &["dem.asc", "dem.prj", "in.geojson", "more.geojson"]
                }
                _ => &["cloud.txt", "dem.asc", "dem.prj", "more.geojson"],
            };
            path.file_name().is_some_and(|name| names.iter().any(|other| name == *other))
        };
        for path in taken.into_iter().filter(|path| !is_foreign(path)) {
            let report = path.to_str().unwrap();
            let more = ["--overwrite", "--report", report];
            place.fails(&[&args[..], &more].concat(), 2, &[report, "itself or a part of it"]);
            assert!(contents(&root) == made, "{args:?} {report}");
        }
        for path in made.keys().filter(|path| !before.contains_key(*path)) {
            std::fs::remove_file(path).unwrap();
        }
        for folder in ["work", "blocks", "out"].map(|name| place.path(name)) {
            drop(std::fs::remove_dir_all(folder));
        }
    }
}

#[test]
fn a_report_never_takes_the_place_of_what_is_proved() {
    let place = Place::new();
    place.write("dem.asc", GRID).write("a.txt", "0 0 1\n9 0 2\n0 9 3\n9 9 4\n4 5 6\n");
    place.write("in.geojson", LINES);
    place.ok(&["tin", "dem.asc", "a.ply", "--max-error", "1"]);
    place.ok(&["tin", "dem.asc", "blocks", "--max-error", "1", "--split", "1"]);
    place.ok(&["tin", "cloud:a.txt", "b.ply", "--max-error", "1"]);
    place.ok(&["line", "in.geojson", "a.shp", "--tolerance", "0.01"]);
    for (args, taken) in [
        (
            &["verify", "a.ply", "dem.asc"][..],
            &["a.ply", "dem.asc", "a.prj", "dem.prj", "dem.wld"][..],
        ),
        (&["verify", "blocks", "dem.asc"], &["blocks/report.json", "dem.asc"]),
        (&["verify", "b.ply", "cloud:a.txt"], &["b.ply", "a.txt", "b.prj"]),
        (
            &["verify", "a.shp", "in.geojson"],
            &["a.shp", "a.dbf", "a.shx", "a.cpg", "a.prj", "in.geojson"],
        ),
    ] {
        let made = contents(&place.path(""));
        for report in taken {
            let more = ["--overwrite", "--report", report];
            place.fails(&[args, &more].concat(), 2, &[report, "itself or a part of it"]);
            assert!(contents(&place.path("")) == made, "{args:?} {report}");
        }
    }
}

#[test]
fn what_lies_beside_an_output_is_refused_before_the_work() {
    let place = Place::new();
    place.write("dem.asc", GRID).write("a.txt", "0 0 1\n9 0 2\n0 9 3\n9 9 4\n4 5 6\n");
    place.ok(&["plan", "tin", "dem.asc", "-o", "mesh", "--max-error", "0"]);
    place.ok(&["plan", "grid", "a.txt", "-o", "asc", "--cell", "1", "-f", "AAIGrid"]);
    place.ok(&["plan", "grid", "a.txt", "-o", "flt", "--cell", "1", "-f", "GridFloat"]);
    std::fs::create_dir(place.path("out")).unwrap();
    let objects = |folder: &str| contents(&place.path(folder).join("objects")).len();
    for (folder, output, beside) in [
        ("mesh", "out/a.ply", &["out/a.prj"][..]),
        ("asc", "out/a.asc", &["out/a.prj", "out/a.asc.msk"]),
        ("flt", "out/a.flt", &["out/a.prj", "out/a.hdr", "out/a.flt.hdr", "out/a.flt.aux.xml"]),
    ] {
        for name in beside {
            place.write(name, "of something else");
            let run = ["run", folder, "-o", output];
            for task in [&[][..], &["--task", "finish"]] {
                let ran = place.run(&[&run[..], task].concat());
                assert!(![0, 75].contains(&ran.code), "{name} {task:?}: {}", ran.err);
                assert!(ran.err.contains(name) && ran.err.contains("; "), "{}", ran.err);
                assert_eq!(objects(folder), 0, "{name}: {}", ran.err);
            }
            std::fs::remove_file(place.path(name)).unwrap();
        }
        place.ok(&["run", folder, "-o", output]);
        assert!(objects(folder) > 0);
    }
    place.write("new.prj", "of something else");
    let tin = ["tin", "dem.asc", "new.ply", "--max-error", "0", "--workdir", "new"];
    place.fails(&tin, 2, &["new.prj", "--overwrite"]);
    place.ok(&[&tin[..], &["--overwrite"]].concat());
}

/// The header of an input would become that of the output, and the input would be lost.
#[test]
fn no_file_takes_the_place_of_one_that_is_read_with_the_input() {
    let header = "BYTEORDER I\nLAYOUT BIL\nNROWS 2\nNCOLS 2\nNBANDS 1\nNBITS 8\n";
    let envi = "ENVI\nsamples = 2\nlines = 2\nbands = 1\ndata type = 1\ninterleave = bsq\n";
    for (input, header) in [("a.bil", header), ("a.bsq", header), ("a.img", envi)] {
        let place = Place::new();
        place.write("a.hdr", header).write(input, [1, 2, 3, 4]);
        std::fs::create_dir(place.path("b")).unwrap();
        let taken = ["a.hdr", "sidecar of the input", "choose another output name"];
        place.fails(&["convert", input, "a.flt", "--overwrite"], 2, &taken);
        place.fails(&["convert", input, "b/../a.flt", "--overwrite"], 2, &taken);
        place.ok(&["convert", input, "b/a.flt", "--overwrite"]);
        assert_eq!(std::fs::read_to_string(place.path("a.hdr")).unwrap(), header);
        // A part of a mosaic, and a header that nothing reads.
        place.ok(&["info", input]);
        place.write("list.txt", format!("{input}\n"));
        place.fails(&["convert", "list.txt", "a.flt", "--overwrite"], 2, &taken[..1]);
        place.write("c.hdr", "of something else");
        place.ok(&["convert", input, "c.flt", "--overwrite"]);
    }
}

#[test]
fn options_out_of_range() {
    let place = place();
    let tin = ["tin", "good.asc", "out.ply", "--max-error", "1"];
    for (option, value) in [
        ("--threads", "0"),
        ("--memory", "lots"),
        ("--memory", "0"),
        ("--tile", "1"),
        ("--progress", "loud"),
    ] {
        place.fails(&[&tin[..], &[option, value]].concat(), 2, &[option]);
    }
    let view = ["view", "good.asc", "-o", "out.png"];
    for (option, value) in [
        ("--width", "0"),
        ("--width", "99999"),
        ("--altitude", "0"),
        ("--azimuth", "nan"),
        ("--exaggeration", "0"),
        ("--bbox", "1,2,1,2"),
    ] {
        place.fails(&[&view[..], &[option, value]].concat(), 2, &[]);
    }
    place.fails(
        &[&view[..], &["--bbox", "0,0,1,1"]].concat(),
        2,
        &["--bounds", "outside the data"],
    );
    place.fails(&[&view[..], &["--edges"]].concat(), 2, &["edges"]);
    place.fails(&["frobnicate"], 2, &["frobnicate"]);
}

#[test]
fn one_bad_file_does_not_hide_the_others() {
    let place = place();
    let ran = place.run(&["info", "noise.tif", "good.asc", "nowhere.tif"]);
    assert_eq!(ran.code, 65);
    assert!(ran.out.contains("good.asc") && ran.out.contains("4 x 3"), "{}", ran.out);
    assert_eq!(ran.err.lines().count(), 2, "{}", ran.err);
}

#[test]
fn options_that_cannot_act_are_refused_by_name() {
    let place = place();
    place.ok(&["tin", "good.asc", "m.ply", "--max-error", "0"]);
    let view = ["view", "m.ply", "-o", "out.png"];
    place.fails(&[&view[..], &["--band", "1"]].concat(), 2, &["m.ply", "--band", "mesh"]);
    place.fails(&[&view[..], &["--nodata", "3"]].concat(), 2, &["m.ply", "--nodata", "mesh"]);
    place.fails(&["info", "m.ply", "--band", "1"], 2, &["m.ply", "--band", "mesh"]);
    place.fails(&["info", "m.ply", "--nodata", "1"], 2, &["m.ply", "--nodata", "mesh"]);
    place.fails(&["info", "m.ply", "--stats"], 2, &["m.ply", "--stats", "mesh"]);
    let terrain = "synth:rough,size=20";
    for args in [
        &["tin", terrain, "out.ply", "--max-error", "1"][..],
        &["verify", "m.ply", terrain],
        &["info", terrain],
        &["view", terrain, "-o", "out.png"],
        &["convert", terrain, "out.tif"],
    ] {
        place.fails(&[args, &["--band", "2"]].concat(), 2, &["synth:rough", "--band"]);
        place.fails(&[args, &["--nodata", "-1"]].concat(), 2, &["synth:rough", "--nodata"]);
    }
    for option in [["--threads", "1"], ["--memory", "1G"], ["--temp-dir", "."]] {
        place.ok(&["info", "good.asc", option[0], option[1]]);
        place.ok(&["info", "m.ply", option[0], option[1]]);
    }
    place.fails(&["synth", "rough,size=20", "out.tif", "--temp-dir", "."], 2, &["--temp-dir"]);
}

#[test]
fn a_tile_out_of_range_is_a_usage_error_that_tells_the_range() {
    let place = place();
    for cells in ["1", "15", "8193", "99999999999"] {
        let args = ["tin", "good.asc", "out.ply", "--max-error", "1", "--tile", cells];
        place.fails(&args, 2, &["--tile", "from 16 to 8192"]);
    }
}

#[test]
fn verify_says_when_mesh_and_grid_are_swapped() {
    let place = place();
    place.ok(&["tin", "good.asc", "m.ply", "--max-error", "0"]);
    place.fails(&["verify", "good.asc", "m.ply"], 2, &["terrane verify m.ply good.asc"]);
    place.fails(&["verify", "good.asc", "good.asc"], 65, &["good.asc", "mesh"]);
    place.fails(&["verify", "m.ply", "m.ply"], 65, &["m.ply", "grid"]);
}

#[test]
fn budgets_too_small_tell_the_least_and_the_units() {
    let place = place();
    let tin = ["tin", "good.asc", "out.ply", "--max-error", "1", "--memory"];
    for bare in ["1", "512", "1000000"] {
        place.fails(&[&tin[..], &[bare]].concat(), 2, &["--memory", "at least 1M", "K, M or G"]);
    }
    place.ok_as_advised(&tin[..5], "1M", &["1.0 MiB"]);
    let wide = ["tin", "synth:rough,size=600", "wide.ply", "--max-error", "1"];
    place.ok_as_advised(&wide, "1M", &["1.0 MiB"]);
    let view = ["view", "good.asc", "-o", "out.png", "--width", "1600"];
    place.ok_as_advised(&view, "1M", &["--width"]);
}

#[test]
fn terrains_that_are_too_large_for_a_store() {
    let place = place();
    for size in ["1073741824", "10000000", "99999999999"] {
        place.fails(&["synth", &format!("rough,size={size}"), "out.tif"], 2, &["size"]);
    }
}

#[test]
fn names_of_terrains_say_each_thing_once() {
    let place = place();
    for (name, word) in [
        ("synth:rough,size=10,size=20", "size is given twice"),
        ("synth:rough,seed=1,size=9,seed=1", "seed is given twice"),
        ("synth:rough,size=10,", "empty"),
        ("synth:rough,,size=10", "empty"),
        ("synth:rough,", "empty"),
    ] {
        place.fails(&["info", name], 2, &[word]);
    }
    let told = place.ok(&["info", "synth:rough,height=3,size=10"]).out;
    assert!(told.contains("10 x 3"), "in any order: {told}");
}

#[test]
fn addresses_are_told_to_be_none_of_files() {
    let place = place();
    let words = ["URLs of this kind are not supported", "curl -LO"];
    for address in [
        "ftp://example.com/a.tif",
        "hdfs://example.com/a.tif?token=1&x=*",
        "/vsizip/a.zip/a.tif",
        "/vsicurl/ftp://example.com/a.tif",
    ] {
        for args in [
            &["tin", address, "o.ply", "--max-error", "1"][..],
            &["tin", "good.asc", address, "o.ply", "--max-error", "1"],
            &["tin", "good.asc", "o.ply", "--max-error", "1", "--clip", address],
            &["tin", "good.asc", "o.ply", "--max-error", "1", "--breaklines", address],
            &["info", address],
            &["convert", address, "o.tif"],
            &["contour", address, "-o", "o.wkt", "--interval", "1"],
            &["hillshade", address, "o.tif"],
            &["color-relief", "good.asc", address, "o.tif"],
            &["grid", address, "o.tif", "--cell", "1"],
            &["points", address, "o.las"],
            &["line", address, "o.wkt", "--tolerance", "1"],
            &["tiles", address, "t"],
            &["view", address, "-o", "o.png"],
            &["verify", address, "good.asc"],
            &["verify", "m.ply", address],
            &["plan", "tin", address, "-o", "w", "--max-error", "1"],
        ] {
            place.write("m.ply", "ply");
            place.fails(args, 65, &words);
        }
    }
    let las = ["info", "ftp://example.com/a.las"];
    place.fails(&las, 65, &words);
    let args = ["convert", "good.asc", "http://example.com/a.tif"];
    place.fails(&args, 73, &["cannot write to URLs"]);
}

#[test]
fn cells_that_doubles_do_not_tell_apart_are_refused_by_all_that_write_positions() {
    let place = Place::new();
    // Cells by the place they lie at, and whether positions are held.
    for (cell, at, is_held) in [
        ("1e-12", "5000000", false),
        ("2e-9", "5000000", false),
        ("1e-7", "500000000", false),
        ("1e-5", "5000000", true),
        ("1e-12", "0", true),
    ] {
        let rows = "1 2 3 4\n5 9 7 8\n9 10 11 -9999\n";
        let grid = format!(
            "ncols 4\nnrows 3\nxllcorner {at}\nyllcorner {at}\ncellsize {cell}\nNODATA_value -9999\n{rows}"
        );
        place.write("a.asc", &grid).write("mesh.ply", "ply");
        for args in [
            &["tin", "a.asc", "o.ply", "--max-error", "1"][..],
            &["tin", "a.asc", "o.obj", "--max-error", "1", "--method", "greedy"],
            &["contour", "a.asc", "-o", "o.wkt", "--interval", "2"],
            &["convert", "a.asc", "o.csv"],
            &["plan", "tin", "a.asc", "-o", "w", "--max-error", "1"],
        ] {
            match is_held {
                false => place.fails(args, 65, &["below the precision", "gdal_edit.py"]),
                true => {
                    let ran = place.run(args);
                    assert!(
                        !ran.err.contains("below the precision"),
                        "{cell} {args:?}: {}",
                        ran.err
                    );
                }
            }
            for made in ["o.ply", "o.obj", "o.wkt", "o.csv"] {
                let _ = std::fs::remove_file(place.path(made));
            }
            let _ = std::fs::remove_dir_all(place.path("w"));
        }
        let told = place.ok(&["info", "a.asc"]).out;
        assert_eq!(told.contains("cells are below the precision"), !is_held, "{cell}: {told}");
    }
}
