//! `terrane verify` on tiles: each field of each header and of what tells of a set is written wrong in turn, and every
//! time it is told.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::cli_support::Place;
use crate::tiles::{place, walk};

/// What is told here and nowhere else.
pub(crate) const NAMED: [&str; 11] = [
    "tiles that cannot be read",
    "stated height range is too large",
    "larger bounding sphere than they and their children need",
    "bounding sphere is not centred on them",
    "other geometric errors at its root than its tiles need",
    "horizon occlusion point is not the nearest above their middle",
    "bounds that reach beyond the raster",
    "though their positions resolve the samples",
    "larger error than any of their tiles records",
    "an unexpected height step",
    "states another vertical reference",
];

/// Fields that were written wrong, and nobody told; and all that was told of others.
#[derive(Default)]
struct Untold(Vec<String>, String);

impl Untold {
    fn look(&mut self, place: &Place, field: &str) {
        let ran = place.run(&["verify", "t", "dem.asc", "--json"]);
        if ![1, 65].contains(&ran.code) {
            self.0.push(format!("{field}: exit code {} {}", ran.code, ran.err));
        }
        self.1 += &ran.out;
    }

    /// Fails where something was not told, or was never told by these names.
    fn end(&self, named: &[&str]) {
        assert!(self.0.is_empty(), "{:#?}", self.0);
        named.iter().for_each(|name| assert!(self.1.contains(name), "{name}"));
    }

    /// Writes the file of a set with members changed, one after the other.
    fn members(&mut self, place: &Place, name: &str, changes: &[(&str, Value)]) {
        let path = place.path(name);
        let whole = fs::read(&path).unwrap();
        for (pointer, value) in changes {
            let mut changed: Value = serde_json::from_slice(&whole).unwrap();
            match changed.pointer_mut(pointer) {
                Some(member) if member != value => *member = value.clone(),
                _ => panic!("{pointer} is {value} or not there"),
            }
            fs::write(&path, changed.to_string()).unwrap();
            self.look(place, &format!("{name}{pointer} = {value}"));
        }
        fs::write(&path, whole).unwrap();
    }
}

/// A member as a number, changed.
fn number(set: &Path, pointer: &str, change: impl Fn(f64) -> f64) -> Value {
    let text: Value = serde_json::from_slice(&fs::read(set).unwrap()).unwrap();
    json!(change(text.pointer(pointer).and_then(Value::as_f64).unwrap()))
}

/// What is said of a level, each member wrong.
fn of_level(set: &Path, levels: &str, level: usize) -> Vec<(String, Value)> {
    let at = |name: &str| format!("{levels}/{level}/{name}");
    let of = |name: &str, change: fn(f64) -> f64| (at(name), number(set, &at(name), change));
    let error = number(set, &at("error"), |error| error / 2.0);
    vec![
        (at("level"), json!(20)),
        of("tolerance", |tolerance| tolerance * 1.01),
        (at("tolerance"), error.clone()),
        of("step", |step| step * 2.0),
        of("step", |step| step / 2.0),
        (at("error"), error),
        of("error", |error| error + 0.01),
        of("tiles", |tiles| tiles + 1.0),
    ]
}

#[test]
fn every_field_of_a_quantized_mesh_is_judged() {
    let place = place(70);
    place.ok(&["tiles", "dem.asc", "t", "--no-gzip", "-q"]);
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    let mut untold = Untold::default();
    let all = walk(&place, "t");
    for level in ["0/", "9/", "14/"] {
        let name = all.iter().rfind(|name| name.starts_with(level)).unwrap();
        let path = place.path("t").join(name);
        let whole = fs::read(&path).unwrap();
        let mut write = |field: &str, at: usize, bytes: &[u8]| {
            let mut changed = whole.clone();
            changed[at..at + bytes.len()].copy_from_slice(bytes);
            assert!(changed != whole, "{field}");
            fs::write(&path, changed).unwrap();
            untold.look(&place, &format!("{name}: {field}"));
        };
        let double = |at: usize| f64::from_le_bytes(whole[at..at + 8].try_into().unwrap());
        let centre = [("centre", 0), ("sphere", 32)];
        for (field, at) in
            centre.into_iter().flat_map(|(f, at)| [(f, at), (f, at + 8), (f, at + 16)])
        {
            write(field, at, &(double(at) + 1000.0).to_le_bytes());
        }
        write("radius", 56, &(double(56) + 1000.0).to_le_bytes());
        write("radius", 56, &(double(56) - 1000.0).to_le_bytes());
        let far = (8..11).map(|i| double(8 * i).powi(2)).sum::<f64>().sqrt();
        for at in [64, 72, 80].into_iter().filter(|at| double(*at).abs() > 0.01 * far) {
            write("horizon", at, &(double(at) * 1.001).to_le_bytes());
            write("horizon", at, &(double(at) * 0.999).to_le_bytes());
        }
        for at in [24, 28] {
            let height = f32::from_le_bytes(whole[at..at + 4].try_into().unwrap());
            for by in [-1000.0, -1.0, 1.0, 1000.0] {
                write("height", at, &(height + by).to_le_bytes());
            }
        }
        let count = u32::from_le_bytes(whole[88..92].try_into().unwrap());
        write("vertices", 88, &(count - 1).to_le_bytes());
        write("vertices", 88, &(count + 1).to_le_bytes());
        let triangles = 92 + 6 * count as usize;
        write("triangles", triangles, &[whole[triangles] ^ 1]);
        let error = whole.windows(8).rposition(|text| text == b"\"error\":").unwrap() + 8;
        write("error", error, b"0");
        write("error", error, b"9e9 ");
        fs::write(&path, &whole).unwrap();
    }
    let set = place.path("t/layer.json");
    let mut changes: Vec<(String, Value)> =
        [7, 14].into_iter().flat_map(|level| of_level(&set, "/terrane/levels", level)).collect();
    for (side, by) in [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)] {
        let pointer = format!("/bounds/{side}");
        changes.push((pointer.clone(), number(&set, &pointer, |at| at + by)));
        changes.push((pointer.clone(), number(&set, &pointer, |at| at - by)));
    }
    changes.extend(
        [
            ("/format", json!("heightmap-1.0")),
            ("/scheme", json!("slippyMap")),
            ("/projection", json!("EPSG:3857")),
            ("/tiles", json!(["{z}/{y}/{x}.terrain"])),
            ("/extensions", json!(["metadata"])),
            ("/extensions", json!(["octvertexnormals"])),
            ("/extensions", json!(["octvertexnormals", "metadata", "watermask"])),
            ("/minzoom", json!(1)),
            ("/maxzoom", json!(13)),
            ("/metadataAvailability", json!(5)),
            ("/metadataAvailability", Value::Null),
            ("/available/14", json!([])),
            ("/available/9", json!([{"startX": 0, "startY": 0, "endX": 0, "endY": 0}])),
            ("/terrane/beyond", json!("some")),
            ("/terrane/heights", json!("some")),
            ("/terrane/heights", json!("ellipsoid, with the geoid added")),
        ]
        .map(|(pointer, value)| (pointer.to_owned(), value)),
    );
    let changes: Vec<(&str, Value)> =
        changes.iter().map(|(pointer, value)| (&**pointer, value.clone())).collect();
    untold.members(&place, "t/layer.json", &changes);
    untold.end(&[NAMED[2], NAMED[3], NAMED[5], NAMED[6], NAMED[8], NAMED[9], NAMED[10]]);
    // What is not known is named.
    let layer = fs::read_to_string(&set).unwrap().replace(r#""metadata""#, r#""metadata", "some""#);
    fs::write(&set, layer).unwrap();
    let ran = place.run(&["verify", "t", "dem.asc", "--json"]);
    let told: Value = serde_json::from_str(&ran.out).unwrap();
    assert!(told["not_judged"].to_string().contains("some"), "{told}");
}

/// The bytes of a column of what a subtree tells: where its first number is.
fn column(bytes: &[u8], name: &str) -> usize {
    let length = u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize;
    let text: Value = serde_json::from_slice(&bytes[24..24 + length]).unwrap();
    let view = text["propertyTables"][0]["properties"][name]["values"].as_u64().unwrap();
    24 + length + text["bufferViews"][view as usize]["byteOffset"].as_u64().unwrap() as usize
}

#[test]
fn every_field_of_3d_tiles_is_judged() {
    let place = place(70);
    let made = ["tiles", "dem.asc", "t", "-f", "3dtiles", "--skirts", "--tile-edges", "--no-gzip"];
    place.ok(&[&made[..], &["-q"]].concat());
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    let mut untold = Untold::default();
    // The first tile of subtrees from the top, the middle and the deepest levels.
    for name in walk(&place, "t").iter().filter(|name| name.ends_with(".subtree")) {
        let path = place.path("t").join(name);
        let whole = fs::read(&path).unwrap();
        let mut write = |field: &str, number: usize, change: &dyn Fn(f64) -> f64| {
            let at = column(&whole, field) + 8 * number;
            let old = f64::from_le_bytes(whole[at..at + 8].try_into().unwrap());
            // Of a direction the parts that count; a half without samples has no error.
            if old == 0.0 || (field == "horizonOcclusionPoint" && old.abs() < 1e-3) {
                return;
            }
            let mut changed = whole.clone();
            changed[at..at + 8].copy_from_slice(&change(old).to_le_bytes());
            fs::write(&path, changed).unwrap();
            untold.look(&place, &format!("{name}: {field} {number}"));
        };
        // Large triangles dip by kilometres, which is told as a bound.
        for by in [-20_000.0, 20_000.0] {
            write("minimumHeight", 0, &|height| height + by);
            write("maximumHeight", 0, &|height| height + by);
            (0..4).for_each(|part| write("boundingSphere", part, &|at| at + by));
        }
        for by in [0.999, 1.001] {
            (0..3).for_each(|part| write("horizonOcclusionPoint", part, &|at| at * by));
        }
        write("geometricError", 0, &|_| 0.0);
        write("geometricError", 0, &|_| 1e9);
        fs::write(&path, &whole).unwrap();
    }
    let set = place.path("t/tileset.json");
    let levels = "/extras/terrane/levels";
    let mut changes: Vec<(String, Value)> =
        [7, 14].into_iter().flat_map(|level| of_level(&set, levels, level)).collect();
    for level in [7, 14] {
        for (name, by) in [("lattice", 4.0), ("skirt", 2.0), ("skirt", 0.5)] {
            let pointer = format!("{levels}/{level}/{name}");
            changes.push((pointer.clone(), number(&set, &pointer, |old| old * by)));
        }
    }
    let halves = ["/root", "/root/children/0", "/root/children/1"];
    for (part, side) in halves.into_iter().flat_map(|part| (0..6).map(move |side| (part, side))) {
        let pointer = format!("{part}/boundingVolume/region/{side}");
        changes.push((pointer.clone(), number(&set, &pointer, |at| at + 0.01)));
        changes.push((pointer.clone(), number(&set, &pointer, |at| at - 0.01)));
    }
    for pointer in ["", "/root", "/root/children/0", "/root/children/1"] {
        let pointer = format!("{pointer}/geometricError");
        changes.push((pointer.clone(), number(&set, &pointer, |error| error * 1.01)));
        changes.push((pointer.clone(), number(&set, &pointer, |error| error * 0.99)));
    }
    for side in 0..4 {
        let pointer = format!("/extras/terrane/bounds/{side}");
        changes.push((pointer.clone(), number(&set, &pointer, |at| at + 1.0)));
        changes.push((pointer.clone(), number(&set, &pointer, |at| at - 1.0)));
    }
    let tiling = "/root/children/0/implicitTiling";
    let class = "/schema/classes/tile/properties/minimumHeight";
    changes.extend([
        ("/asset/version".to_owned(), json!("1.0")),
        ("/root/refine".to_owned(), json!("ADD")),
        ("/root/children/1/refine".to_owned(), json!("ADD")),
        ("/root/children/0/content/uri".to_owned(), json!("east/{level}/{x}/{y}.glb")),
        (format!("{tiling}/subtrees/uri"), json!("east/{level}/{x}/{y}.subtree")),
        (format!("{tiling}/subdivisionScheme"), json!("OCTREE")),
        (format!("{tiling}/subtreeLevels"), json!(6)),
        (format!("{tiling}/availableLevels"), json!(14)),
        (format!("{class}/type"), json!("VEC3")),
        (format!("{class}/componentType"), json!("FLOAT32")),
        (format!("{class}/semantic"), json!("TILE_MAXIMUM_HEIGHT")),
        ("/extras/terrane/normals".to_owned(), json!(false)),
        ("/extras/terrane/edges".to_owned(), json!(false)),
        ("/extras/terrane/beyond".to_owned(), json!("some")),
    ]);
    let changes: Vec<(&str, Value)> =
        changes.iter().map(|(pointer, value)| (&**pointer, value.clone())).collect();
    untold.members(&place, "t/tileset.json", &changes);
    untold.end(&[NAMED[1], NAMED[2], NAMED[3], NAMED[4], NAMED[5], NAMED[6], NAMED[8], NAMED[9]]);
}

/// A level that says it is as far off as it is, and need not be.
#[test]
fn an_error_that_positions_do_not_ask_for_is_told() {
    let place = place(70);
    place.ok(&["tiles", "dem.asc", "t", "--no-gzip", "-q"]);
    let all = walk(&place, "t");
    let path = place.path("t").join(all.iter().rfind(|name| name.starts_with("14/")).unwrap());
    let mut bytes = fs::read(&path).unwrap();
    for at in [24, 28] {
        let height = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        bytes[at..at + 4].copy_from_slice(&(height + 64.0).to_le_bytes());
    }
    fs::write(&path, bytes).unwrap();
    let set = place.path("t/layer.json");
    let mut layer: Value = serde_json::from_slice(&fs::read(&set).unwrap()).unwrap();
    layer["terrane"]["levels"][14]["tolerance"] = json!(70.0);
    layer["terrane"]["levels"][14]["error"] = json!(70.0);
    fs::write(&set, layer.to_string()).unwrap();
    let ran = place.run(&["verify", "t", "dem.asc"]);
    assert!(ran.code == 1 && ran.out.contains(NAMED[7]), "{}{}", ran.out, ran.err);
}

/// One that is torn off in the middle of its gzip is told, and the others are proved.
#[test]
fn a_truncated_tile_is_told_and_the_others_are_proved() {
    let place = place(70);
    for format in ["quantized-mesh", "3dtiles"] {
        place.ok(&["tiles", "dem.asc", "t", "-f", format, "--overwrite", "-q"]);
        let ending = if format == "3dtiles" { ".glb" } else { ".terrain" };
        let all = walk(&place, "t");
        let names: Vec<_> = all.iter().filter(|name| name.ends_with(ending)).collect();
        for name in [names[2], names[names.len() - 1]] {
            let path = place.path("t").join(name);
            let whole = fs::read(&path).unwrap();
            for length in [20, whole.len() / 2, whole.len() - 1] {
                fs::write(&path, &whole[..length]).unwrap();
                let ran = place.run(&["verify", "t", "dem.asc", "--json"]);
                let told: Value = serde_json::from_str(&ran.out).unwrap();
                let failures = told["failures"].as_array().unwrap();
                assert_eq!((ran.code, failures.len()), (1, 1), "{name}: {told}");
                let says = |word: &str| failures[0].as_str().unwrap().contains(word);
                assert!(says("truncated") && says(name) && says(NAMED[0]), "{told}");
                assert!(told["measured"].as_u64().unwrap() > 4000, "{told}");
            }
            fs::write(&path, whole).unwrap();
        }
        place.ok(&["verify", "t", "dem.asc", "-q"]);
    }
}
