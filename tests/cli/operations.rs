//! Every option of every operation through every door, by the table of its options: what the command line writes is what
//! the library writes, and what is refused by one is refused by the other, in its own words.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Mutex;

use serde_json::{Map, Value as Json, json};
use terrane::{AnyOperation, Cancel, Data, OPERATIONS, Reads, Silent, Writes};
use terrane_base::frontend::Frontend;
use terrane_options::{OptionArity, OptionField, OptionKind, OptionRole, OptionRule, texts_of};

use crate::cli_support::Place;
use crate::operation_values::{UNTRIED, VALUES};

pub(crate) const TERRAIN: &str = "synth:rough,size=90,seed=3";

/// The verb of an operation.
pub(crate) fn verb(operation: &AnyOperation) -> &'static str {
    match operation.writes {
        Writes::Picture | Writes::Page => "view",
        _ => operation.name.trim_start_matches("cloud-"),
    }
}

/// What comes before the name of the output.
fn before_output(operation: &AnyOperation) -> Option<&'static str> {
    match operation.writes {
        Writes::Picture => Some("-o"),
        Writes::Page => Some("--html"),
        _ => None,
    }
}

/// What options an operation needs to run at all.
fn needed(operation: &AnyOperation) -> Map<String, Json> {
    let needed = match operation.name {
        "color-relief" => json!({ "colors": "colors.txt" }),
        // As large as the terrain twice; many options draw one.
        "picture" => json!({ "width": 180 }),
        "contour" => json!({ "interval": 10 }),
        "sample" => json!({ "features": "spots.wkt" }),
        "zonal" => json!({ "zones": "wide.wkt" }),
        "difference" => json!({ "reference": "dem.tif" }),
        "grid" => json!({ "cell": 2 }),
        "simplify" => json!({ "tolerance": 40 }),
        "tin" => json!({ "max_error": 20 }),
        "cloud-tin" => json!({ "max_error": 0.5 }),
        "tiles" => json!({ "max_level": 12 }),
        "cloud-tiles" => json!({ "max_level": 12, "cell": 2 }),
        _ => json!({}),
    };
    needed.as_object().unwrap().clone()
}

/// The file that an operation writes.
fn output(operation: &AnyOperation, options: &Map<String, Json>) -> &'static str {
    match (operation.name, options.get("format").and_then(Json::as_str)) {
        ("picture", _) => "out.png",
        ("page" | "cloud-page" | "line-page" | "qa", _) => "out.html",
        ("tiles" | "cloud-tiles", _) => "out",
        ("tin", _) if options.contains_key("split") => "out",
        ("tin" | "cloud-tin", Some("STL")) => "out.stl",
        ("tin" | "cloud-tin", Some("OBJ")) => "out.obj",
        ("tin" | "cloud-tin", Some("GLB")) => "out.glb",
        ("tin" | "cloud-tin", _) => "out.ply",
        ("points", _) if options.contains_key("tile") || options.contains_key("split") => "out",
        ("points", _) => "out.laz",
        ("contour" | "sample" | "simplify" | "zonal", Some("FlatGeobuf")) => "out.fgb",
        ("contour" | "sample" | "simplify" | "zonal", _) => "out.geojson",
        (_, Some("AAIGrid")) => "out.asc",
        _ => "out.tif",
    }
}

/// A value of an option, and the options to go with it; none where it cannot be tried.
fn tried(operation: &AnyOperation, field: &OptionField) -> Option<Map<String, Json>> {
    let names = [format!("{}.{}", operation.name, field.name), field.name.to_owned()];
    if UNTRIED.iter().any(|(name, _)| names.iter().any(|own| own == name)) {
        return None;
    }
    let found = names.iter().find_map(|own| VALUES.iter().find(|(name, ..)| name == own));
    let (_, value, others) = found.unwrap_or_else(|| {
        panic!("{} of {} has no value in this test", field.name, operation.name)
    });
    let value: Json = serde_json::from_str(value).unwrap();
    let mut options = needed(operation);
    let others: Map<String, Json> = serde_json::from_str(others).unwrap();
    options.extend(others);
    if (field.name, operation.name) == ("to_crs", "convert") {
        options.insert("resampling".to_owned(), json!("near"));
    }
    options.insert(field.name.to_owned(), value);
    Some(options)
}

/// Options as the command line has them; names go before the output.
fn arguments(operation: &AnyOperation, options: &Map<String, Json>) -> (Vec<String>, Vec<String>) {
    let (mut names, mut arguments) = (Vec::new(), Vec::new());
    for (name, value) in options.iter().filter(|(_, value)| !value.is_null()) {
        let field = operation.table.find(name).unwrap();
        let long = match field.kind {
            OptionKind::Flag => {
                Frontend::CommandLine.spell(&format!("‹{name}={value}›")).into_owned()
            }
            _ => Frontend::CommandLine.spell(&format!("‹{name}›")).into_owned(),
        };
        let texts = texts_of(field, value).unwrap();
        match (field.positional, field.kind, field.shape) {
            (true, ..) => names.extend(texts),
            (_, OptionKind::Flag, _) => arguments.push(long),
            // A name behind it would be that of an input.
            _ if field.bare.is_some() => {
                arguments.extend(texts.iter().map(|text| format!("{long}={text}")));
            }
            (.., OptionArity::Repeated) => {
                arguments.extend(texts.into_iter().flat_map(|text| [long.clone(), text]));
            }
            _ => arguments.extend(texts.into_iter().flat_map(|text| [long.clone(), text])),
        }
    }
    (names, arguments)
}

/// The same with paths that lead there from anywhere.
fn in_place(
    place: &Place,
    operation: &AnyOperation,
    options: &Map<String, Json>,
) -> Map<String, Json> {
    let absolute = |(name, value): (&String, &Json)| {
        let is_path = matches!(operation.table.find(name).unwrap().kind, OptionKind::Path);
        let value = match value.as_str() {
            Some(file) if is_path => place.path(file).to_str().unwrap().into(),
            _ => value.clone(),
        };
        (name.clone(), value)
    };
    options.iter().map(absolute).collect()
}

pub(crate) fn place() -> Place {
    let place = Place::new();
    let grid: String = (0..40)
        .map(|row| (0..40).map(|col| format!("{} ", row * col % 97)).collect::<String>() + "\n")
        .collect();
    let head =
        |low: u32| format!("ncols 40\nnrows 40\nxllcorner {low}\nyllcorner 4749300\ncellsize 12\n");
    place.write("like.asc", head(500_200) + &grid).write("like.prj", "EPSG:32631");
    place
        .write("fine.asc", head(500_300).replace("12", "5") + &grid)
        .write("fine.prj", "EPSG:32631");
    let hole = |row: i32, col: i32| match (row, col) {
        (5..20, 5..20) | (25, _) => -9999.0,
        _ => f64::from(row * col % 97) / 2.0,
    };
    let holes: String = (0..40)
        .map(|row| (0..40).map(|col| format!("{} ", hole(row, col))).collect::<String>() + "\n")
        .collect();
    place.write("holes.asc", head(500_200) + "NODATA_value -9999\n" + &holes);
    place.write("holes.prj", "EPSG:32631");
    place.write("colors.txt", "0% 0 0 90\n50% 10 200 30\n100% 250 240 130\n");
    place.write("other.txt", "0 1 2 3\n30 200 100 50 128\n60 9 9 9\nnv 1 1 1 0\n");
    let square = "POLYGON ((500200 4749900, 500700 4749900, 500700 4749400, 500200 4749900))";
    for name in ["area", "lake"] {
        place.write(&format!("{name}.wkt"), square);
        place.write(&format!("{name}.prj"), "EPSG:32631");
    }
    let wide = "POLYGON ((499900 4749000, 501000 4749000, 501000 4750100, 499900 4750100, 499900 4749000))";
    place.write("wide.wkt", wide).write("wide.prj", "EPSG:32631");
    let spots = |count: u32, step: u32, low: u32| {
        let spot =
            move |i| format!("POINT ({} {})\n", 500_001 + i % count * step, low + i / count * step);
        (0..count * count).map(spot).collect::<String>()
    };
    place.write("spots.wkt", spots(20, 44, 4_749_110) + &spots(10, 6, 4_750_001));
    place.write("spots.prj", "EPSG:32631");
    std::fs::create_dir(place.path("spills")).unwrap();
    place.write("lines.wkt", lines()).write("lines.prj", "EPSG:32631");
    let topology = json!({
        "type": "Topology",
        "arcs": [[[0, 0], [1, 0.1], [2, 0]], [[0, 1], [1, 1.3], [2, 1.1], [3, 1]]],
        "objects": {
            "first": { "type": "LineString", "arcs": [0] },
            "other": { "type": "LineString", "arcs": [1] },
        },
    });
    place.write("two.topojson", topology.to_string());
    place.ok(&["convert", TERRAIN, "dem.tif", "-q"]);
    place.ok(&["tin", TERRAIN, "mesh.ply", "--max-error", "20", "-q"]);
    place.write("sides.wkt", "POINT (500050 4753520)").write("sides.prj", "EPSG:32631");
    place.ok(&["synth", "cloud,size=60,density=4,seed=5", "cloud.las", "-q"]);
    let text: String = (0..500)
        .map(|i| format!("{} {} {}\n", 500_000 + i % 25 * 2, 4_750_000 + i / 25 * 3, i * 31 % 17))
        .collect();
    place.write("cloud.xyz", text);
    // The same points of two flight lines.
    for line in ["1", "2"] {
        let (name, set) = (format!("twice{line}.las"), format!("point_source_id={line}"));
        place.ok(&["points", "cloud.las", &name, "--attribute", &set, "-q"]);
    }
    let near = "POLYGON ((500010 4750010, 500045 4750010, 500045 4750040, 500010 4750010))";
    place.write("near.wkt", near).write("near.prj", "EPSG:32631");
    let pipeline = r#"[{"type": "filters.range", "limits": "Z(3:]"}, "thin:2"]"#;
    place.write("pipeline.json", pipeline);
    let cells = "1 2 3 4 5\n".repeat(4);
    let head = "ncols 5\nnrows 4\nxllcorner 500010\nyllcorner 4750010\ncellsize 7\n";
    let degrees = "ncols 5\nnrows 4\nxllcorner 7\nyllcorner 46\ncellsize 0.01\n";
    place.write("degrees.asc", degrees.to_owned() + &cells).write("degrees.prj", "EPSG:4326");
    place.write("near.asc", head.to_owned() + &cells).write("near.prj", "EPSG:32631");
    place
}

/// Lines and a ring with heights.
pub(crate) fn lines() -> String {
    let rough = |i: u32, k: u32| (i * 7919 + k * 104_729) % 61;
    let line = |k: u32| {
        let vertex = |i: u32| {
            format!(
                "{}.25 {} {}",
                500_000 + 20 * i,
                4_750_000 + 64 * k + rough(i, k),
                rough(i, k + 9)
            )
        };
        format!("LINESTRING Z ({})\n", (0..60).map(vertex).collect::<Vec<_>>().join(", "))
    };
    let ring = "POLYGON Z ((500000 4752000 1, 500090 4752000 2, 500120 4752050 3, 500090 4752099 2, \
                500010 4752080 1, 500000 4752000 1))\n";
    // A line that another one would cross, were it straight.
    let spike = "LINESTRING Z (500000 4753000 1, 500050 4753080 1, 500100 4753000 1)\n\
                 LINESTRING Z (500050 4752980 1, 500050 4753060 1)\n\
                 LINESTRING Z (500000 4753500 1, 500050 4753580 1, 500100 4753500 1)\n";
    (0..4).map(line).collect::<String>() + ring + spike
}

/// A grid of two bands, since bands other than the first are an option.
fn two_bands(place: &Place) {
    place.ok(&["grid", "cloud.las", "bands.tif", "--cell", "1", "--stat", "max,min", "-q"]);
}

#[test]
fn each_option_does_the_same_at_each_door() {
    let operations = Mutex::new(OPERATIONS.iter());
    let work = || {
        let place = place();
        two_bands(&place);
        let next = || operations.lock().unwrap().next();
        std::iter::from_fn(next).flat_map(|own| unseen(&place, own)).collect::<Vec<_>>()
    };
    let unseen = std::thread::scope(|scope| {
        let beside = scope.spawn(work);
        [work(), beside.join().unwrap()].concat()
    });
    assert!(unseen.is_empty(), "nothing changes with {unseen:?}");
}

/// The options of an operation that change nothing of what it writes.
fn unseen(place: &Place, operation: &AnyOperation) -> Vec<String> {
    let (mut unseen, mut known) = (Vec::new(), HashMap::new());
    for field in operation.table.fields() {
        let Some(options) = tried(operation, field) else { continue };
        let input = match (field.name, operation.reads) {
            ("nodata", _)
                if ["difference", "fill", "sample", "zonal"].contains(&operation.name) =>
            {
                "near.asc"
            }
            ("band" | "nodata" | "bands" | "weights", Reads::Grid) => "bands.tif",
            ("edges" | "against", _) => "mesh.ply",
            ("keep_degrees", _) => "degrees.asc",
            ("priority" | "feather", _) => "[fl]i*e.asc",
            ("layer", Reads::Features) => "two.topojson",
            ("crs", _) => "cloud:cloud.xyz",
            ("dedupe" | "drop_overlap" | "max_range", _) => "twice*.las",
            _ if operation.name == "fill" => "holes.asc",
            _ => input(operation),
        };
        let written = write_both(place, operation, &options, input);
        let others = without(operation, field, &options);
        // Many options are held against the same.
        let usual = known
            .entry((input, Json::from(others.clone()).to_string()))
            .or_insert_with(|| write_both(place, operation, &others, input));
        let is_seen = written != *usual
            || field.role == OptionRole::Run
            || (operation.name, field.name) == ("contour", "tile");
        // A terrain has no level ground, the report alone has volumes, and metres lead to one direction in any unit.
        let may_be_unseen = [
            ("aspect", "zero_for_flat"),
            ("aspect", "scale"),
            ("simplify", "strategy"),
            ("difference", "level_of_detection"),
        ];
        let may_be_unseen = may_be_unseen.contains(&(operation.name, field.name));
        if !is_seen && !may_be_unseen {
            unseen.push(format!("{} of {}", field.name, operation.name));
        }
    }
    unseen
}

/// The options without one of them; what is needed with it alone goes, too.
fn without(
    operation: &AnyOperation,
    field: &OptionField,
    options: &Map<String, Json>,
) -> Map<String, Json> {
    let mut others = options.clone();
    others.remove(field.name);
    let needed = needed(operation);
    let is_goal = options.values().any(Json::is_null) || needed.contains_key(field.name);
    // Nothing is resampled without a lattice, nor the other way round.
    let is_lattice = operation.name == "convert"
        && field.heading == "Output grid"
        && !["priority", "feather"].contains(&field.name);
    let is_rounded = (operation.name, field.name) == ("grid", "type");
    match is_goal || is_lattice || is_rounded || ["to_crs", "round"].contains(&field.name) {
        true => needed,
        false => others,
    }
}

/// What an operation writes, which both doors agree on.
fn write_both(
    place: &Place,
    operation: &AnyOperation,
    options: &Map<String, Json>,
    input: &str,
) -> Vec<u8> {
    let name = output(operation, options);
    let (names, arguments) = arguments(operation, options);
    let mut words = vec![verb(operation), input];
    words.extend(names.iter().map(String::as_str));
    words.extend(before_output(operation));
    words.push(name);
    words.extend(arguments.iter().map(String::as_str));
    words.push("--json");
    let told: Json = serde_json::from_str(&place.ok(&words).out).unwrap();
    let output = place.path(name);
    let by_command_line = taken(&output);
    let options = in_place(place, operation, options);
    let report = by_library(place, operation, input, &output, &options).unwrap();
    let written = taken(&output);
    assert!(by_command_line == written, "{words:?}");
    assert_eq!(told["output_bytes"], report["output_bytes"], "{words:?}");
    written
}

/// What a file holds, or all files in a folder do, in the order of their names; it goes.
fn taken(path: &Path) -> Vec<u8> {
    // What was kept of the work was that of this door.
    let kept = path.with_file_name("kept");
    if kept.exists() {
        std::fs::remove_dir_all(kept).unwrap();
    }
    let index = path.with_file_name("footprints.geojson");
    if index.exists() {
        std::fs::remove_file(index).unwrap();
    }
    let prj = path.with_extension("prj");
    if path.file_stem() == Some("out".as_ref()) && prj.exists() {
        std::fs::remove_file(prj).unwrap();
    }
    if path.is_dir() {
        let entries = std::fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path());
        let mut inner: Vec<_> = entries.collect();
        inner.sort();
        let bytes = inner.iter().flat_map(|path| taken(path)).collect();
        std::fs::remove_dir(path).unwrap();
        return bytes;
    }
    let bytes = std::fs::read(path).unwrap();
    std::fs::remove_file(path).unwrap();
    bytes
}

/// What the library makes of it.
fn by_library(
    place: &Place,
    operation: &AnyOperation,
    input: &str,
    output: &Path,
    options: &Map<String, Json>,
) -> terrane::Result<Json> {
    let cancel = &Cancel::default();
    let path = place.path(input.trim_start_matches("cloud:"));
    match operation.reads {
        Reads::Cloud => {
            let is_text = if input.starts_with("cloud:") { "cloud:" } else { "" };
            let cloud = terrane::open_cloud(format!("{is_text}{}", path.display()))?;
            cloud.run(operation, output, options, &Silent, cancel)
        }
        Reads::Features => {
            terrane::open_features(path)?.run(operation, output, options, &Silent, cancel)
        }
        Reads::Grid if input.starts_with('[') => {
            let files = terrane::open_files(path.to_str().unwrap());
            files.run(operation, output, options, &Silent, cancel)
        }
        Reads::Grid if input == "mesh.ply" => {
            terrane::open_mesh(path)?.run(operation, output, options, &Silent, cancel)
        }
        Reads::Grid => {
            let name = if input == TERRAIN { input } else { path.to_str().unwrap() };
            terrane::open(name)?.run(operation, output, options, &Silent, cancel)
        }
    }
}

/// What an operation is tried on.
fn input(operation: &AnyOperation) -> &'static str {
    match operation.reads {
        Reads::Grid => TERRAIN,
        Reads::Cloud => "cloud.las",
        Reads::Features => "lines.wkt",
    }
}

#[test]
fn what_does_not_go_together_is_refused_at_each_door_before_anything_is_read() {
    let place = place();
    let mut tried = 0;
    for operation in OPERATIONS {
        for rule in operation.table.rules() {
            let OptionRule::NotWith(name, others) = rule else { continue };
            for other in *others {
                let is_tried = |term: &str| {
                    let name = term.split_once('=').map_or(term, |(name, _)| name);
                    let field = operation.table.find(name.trim_end_matches('!')).unwrap();
                    self::tried(operation, field).is_some()
                };
                if !is_tried(name) || !is_tried(other) {
                    continue;
                }
                refuse_both(&place, operation, [name, other]);
                tried += 1;
            }
        }
    }
    assert!(tried >= 60, "{tried}");
}

fn refuse_both(place: &Place, operation: &AnyOperation, terms: [&str; 2]) {
    // Terms may say which value an option has, or has not.
    let named = terms.map(|term| term.split_once('=').map_or((term, None), |(a, b)| (a, Some(b))));
    let [name, other] = named.map(|(name, _)| name.trim_end_matches('!'));
    let value = |(name, value): (&str, Option<&str>)| {
        let value = value.filter(|_| !name.ends_with('!'));
        Some((name.to_owned(), Json::from(value?)))
    };
    let options = [name, other]
        .into_iter()
        .flat_map(|name| tried(operation, operation.table.find(name).unwrap()).unwrap_or_default())
        .chain(named.into_iter().filter_map(value));
    let all: Vec<(String, Json)> = options.collect();
    let mut options: Map<String, Json> = all.iter().cloned().collect();
    // What one of them does without, is left out.
    let is_left_out =
        |(key, value): &(String, Json)| value.is_null() && key != name && key != other;
    options.extend(all.into_iter().filter(is_left_out));
    // What lines are drawn at is said once.
    if [name, other].contains(&"levels") && ![name, other].contains(&"interval") {
        options.remove("interval");
    }
    let told = terms.map(|term| match operation.table.find(term).and_then(|field| field.off) {
        Some(_) => format!("‹{term}=false›"),
        None => match term.split_once("!=") {
            Some((name, _)) => format!("‹{name}› {}", options[name].as_str().unwrap()),
            None => format!("‹{term}›"),
        },
    });
    let together = format!("{} cannot be used with {}", told[0], told[1]);
    let (names, arguments) = arguments(operation, &options);
    let mut words = vec![verb(operation), input(operation)];
    words.extend(names.iter().map(String::as_str));
    words.extend(before_output(operation));
    words.push(output(operation, &options));
    words.extend(arguments.iter().map(String::as_str));
    place.fails(&words, 2, &[&Frontend::CommandLine.spell(&together)]);
    options = in_place(place, operation, &options);
    let ending = place.path(output(operation, &options));
    let path = place.path("none").with_extension(ending.extension().unwrap_or_default());
    let error = by_library(place, operation, input(operation), &path, &options).unwrap_err();
    assert!(error.to_string().starts_with(&together), "{error}");
    assert!(!path.exists());
}

#[test]
fn what_is_about_grids_is_refused_for_meshes_by_the_library_too() {
    let place = place();
    let shown = OPERATIONS.iter().filter(|own| ["picture", "page"].contains(&own.name));
    for operation in shown {
        let output = place.path(output(operation, &Map::new()));
        for (name, value) in
            [("band", json!(2)), ("nodata", json!(0)), ("clip", json!(place.path("area.wkt")))]
        {
            let options = Map::from_iter([(name.to_owned(), value)]);
            let error = by_library(&place, operation, "mesh.ply", &output, &options).unwrap_err();
            let told = format!("‹{name}› applies to grids, not to meshes");
            assert!(error.to_string().contains(&told), "{error}");
            assert!(!output.exists());
        }
    }
}

#[test]
fn nothing_that_is_read_is_replaced() {
    let place = place();
    let wkt = "LINESTRING (0 0, 1 0.1, 2 0)";
    for name in ["many", "new"] {
        std::fs::create_dir(place.path(name)).unwrap();
    }
    for name in ["many/a.wkt", "many/b.wkt"] {
        place.write(name, wkt);
    }
    place.write("points.wkt", "POINT (1 1)").write("list.csv", "cloud.las\n");
    place.ok(&["convert", TERRAIN, "member.tif", "-q"]);
    let vrt = "<VRTDataset rasterXSize=\"90\" rasterYSize=\"90\"><VRTRasterBand dataType=\"Float32\" band=\"1\">\
               <SimpleSource><SourceFilename relativeToVRT=\"1\">member.tif</SourceFilename><SourceBand>1</SourceBand>\
               <SrcRect xOff=\"0\" yOff=\"0\" xSize=\"90\" ySize=\"90\"/><DstRect xOff=\"0\" yOff=\"0\" xSize=\"90\" \
               ySize=\"90\"/></SimpleSource></VRTRasterBand></VRTDataset>";
    place.write("all.vrt", vrt);
    let (simple, sides) = (["--tolerance", "5"], ["--topology", "--sides", "points.wkt"]);
    for args in [
        &["simplify", "many", "many", simple[0], simple[1]][..],
        &["simplify", "many/a.wkt", "points.wkt", "many", simple[0], simple[1]],
        &[
            "simplify",
            "lines.wkt",
            "o.wkt",
            "--tolerance",
            "5",
            sides[0],
            sides[1],
            sides[2],
            "--report",
            "points.wkt",
        ],
        &[
            "simplify",
            "many/a.wkt",
            "many/b.wkt",
            "new",
            "--tolerance",
            "5",
            "--hierarchy",
            "new/a.wkt",
        ],
        &["slope", "all.vrt", "member.tif"],
        &["contour", "all.vrt", "member.tif", "-f", "GeoJSON", "-i", "9"],
        &["convert", TERRAIN, "like.asc", "--like", "like*.asc", "--resampling", "near"],
        &["points", "@list.csv", "list.csv"],
        &["points", "@list.csv", "o.las", "--report", "list.csv"],
        &["grid", "@list.csv", "o.tif", "--cell", "2", "--report", "list.csv"],
    ] {
        let before: Vec<_> = ["many/a.wkt", "points.wkt", "member.tif", "like.asc", "list.csv"]
            .map(|name| place.bytes(name))
            .into();
        let ran = place.run(&[args, &["--overwrite"]].concat());
        assert_eq!(ran.code, 2, "{args:?}: {}", ran.err);
        let after: Vec<_> = ["many/a.wkt", "points.wkt", "member.tif", "like.asc", "list.csv"]
            .map(|name| place.bytes(name))
            .into();
        assert!(before == after, "{args:?}");
    }
    assert_eq!(std::fs::read_dir(place.path("new")).unwrap().count(), 0);
    assert!(!place.path("o.wkt").exists());
}
