//! `terrane tiles --format 3dtiles`: proved by `verify`, the same bytes however they are made, and whatever is done
//! to a sound set, what is wrong with it is named.

use std::fs;
use std::path::PathBuf;

use serde_json::{Value, json};

use crate::cli_support::{Place, json as parsed};
use crate::tiles::{place, walk};

const MAKE: [&str; 7] =
    ["tiles", "dem.asc", "t", "--format", "3dtiles", "--tile-edges", "--no-gzip"];

/// A sound set, unpacked so that its bytes can be changed.
fn sound() -> Place {
    let place = place(100);
    place.ok(&[&MAKE[..], &["-q"]].concat());
    place
}

/// Fails unless the set is told to be broken, and how.
fn expect(place: &Place, what: &str) {
    let ran = place.run(&["verify", "t", "dem.asc", "--json"]);
    assert_eq!(ran.code, 1, "{what}: {}{}", ran.out, ran.err);
    let told = parsed(&ran.out)["failures"].to_string();
    assert!(told.contains(what), "{what} is not in {told}");
}

/// Fails unless the set is refused with these words and the file's name.
fn refused(place: &Place, name: &str, what: &str) {
    let ran = place.run(&["verify", "t", "dem.asc"]);
    // Of a tile the others are proved, of what tells of all nothing.
    assert!([1, 65, 66, 74].contains(&ran.code), "{what}: {} {}", ran.code, ran.err);
    let told = ran.out + &ran.err;
    assert!(told.contains(what) && told.contains(name), "{what}: {told}");
}

#[test]
fn every_level_is_proved_and_the_bytes_are_the_same() {
    let place = place(150);
    let both = ["--format", "3dtiles", "--format", "quantized-mesh"];
    let made = [&["tiles", "dem.asc", "one", "--threads", "1", "--json"], &both[..]].concat();
    let made = parsed(&place.ok(&made).out);
    let levels = made["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 30, "{made}");
    for level in levels {
        let [error, allowed] = ["error", "tolerance"].map(|key| level[key].as_f64().unwrap());
        assert!(error <= allowed && level["tiles"].as_u64().unwrap() > 0, "{level}");
        assert_eq!(level["lattice"].is_null(), level["format"] == "quantized-mesh", "{level}");
    }
    for set in ["one/3dtiles", "one/quantized-mesh"] {
        let told = parsed(&place.ok(&["verify", set, "dem.asc", "--json"]).out);
        assert_eq!(told["passed"], true, "{told}");
    }
    // A set is the same whatever else is made, by any number of threads, in any memory.
    let alone = ["tiles", "dem.asc", "two", "--threads", "2", "--memory", "96M", "-q"];
    place.ok(&[&alone[..], &both[..2]].concat());
    assert_eq!(walk(&place, "one/3dtiles"), walk(&place, "two"));
    place.ok(&["tiles", "dem.asc", "three", "-q"]);
    for (folder, other) in [("two", "3dtiles"), ("three", "quantized-mesh")] {
        for name in walk(&place, folder) {
            let [a, b] = [format!("{folder}/{name}"), format!("one/{other}/{name}")];
            assert_eq!(place.bytes(&a), place.bytes(&b), "{name}");
        }
    }
    // So by plan, whose tasks keep what is told of tiles.
    let planned = ["tiles", "dem.asc", "four", "--workdir", "work", "-q"];
    place.ok(&[&planned[..], &both[..]].concat());
    assert_eq!(walk(&place, "one"), walk(&place, "four"));
    for name in walk(&place, "one") {
        let [a, b] = ["one", "four"].map(|folder| place.bytes(&format!("{folder}/{name}")));
        assert_eq!(a, b, "{name}");
    }
    let plain = ["--no-gzip", "--no-normals", "--max-level", "9", "--overwrite", "-q"];
    place.ok(&[&["tiles", "dem.asc", "two"], &both[..2], &plain[..]].concat());
    place.ok(&["verify", "two/tileset.json", "dem.asc", "-q"]);
    place.ok(&[&["tiles", "dem.asc", "one"], &both[..], &plain[..]].concat());
    place.write("one/3dtiles/west/0/mine.txt", "mine");
    let again = ["tiles", "dem.asc", "one", "--overwrite"];
    place.fails(&again, 2, &["contains other files"]);
    place.fails(&["tiles", "dem.asc", "x", "--tile-edges"], 2, &["3dtiles"]);
    place.fails(&["tiles", "dem.asc", "x", "-f", "3dtiles", "-f", "3dtiles"], 2, &["twice"]);
    place.fails(&["tiles", "dem.asc", "x", "-f", "b3dm"], 2, &["quantized-mesh, 3dtiles"]);
}

/// A file of binary glTF: its text, and its buffer.
pub(crate) struct Glb {
    pub(crate) text: Value,
    pub(crate) buffer: Vec<u8>,
}

impl Glb {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let text = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        Self { text, buffer: bytes[28 + length..].to_vec() }
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut text = self.text.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let number = |value: usize| (value as u32).to_le_bytes();
        let whole = 28 + text.len() + self.buffer.len();
        let head = [*b"glTF", number(2), number(whole), number(text.len()), *b"JSON"].concat();
        let middle = [number(self.buffer.len()), *b"BIN\0"].concat();
        [head, text, middle, self.buffer.clone()].concat()
    }

    fn primitive(&mut self) -> &mut Value {
        &mut self.text["meshes"][0]["primitives"][0]
    }

    /// Where the elements of an accessor begin, and how many there are.
    fn place(&self, accessor: &Value) -> (usize, usize) {
        let accessor = &self.text["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &self.text["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let number = |value: &Value| value.as_u64().unwrap() as usize;
        (number(&view["byteOffset"]), number(&accessor["count"]))
    }

    fn attribute(&mut self, name: &str) -> (usize, usize) {
        let accessor = self.primitive()["attributes"][name].clone();
        self.place(&accessor)
    }

    fn indices(&mut self) -> (usize, usize) {
        let accessor = self.primitive()["indices"].clone();
        self.place(&accessor)
    }

    fn edge(&mut self, name: &str) -> (usize, usize) {
        let accessor = self.primitive()["extensions"]["CESIUM_tile_edges"][name].clone();
        self.place(&accessor)
    }

    fn float(&mut self, at: usize, change: impl Fn(f32) -> f32) {
        let old = f32::from_le_bytes(self.buffer[at..at + 4].try_into().unwrap());
        self.buffer[at..at + 4].copy_from_slice(&change(old).to_le_bytes());
    }

    /// Moves all vertices, and the ends that are said of them.
    fn shift(&mut self, by: f64) {
        // The place of z in the matrix of y up.
        let z = self.text["nodes"][0]["matrix"][13].as_f64().unwrap();
        self.text["nodes"][0]["matrix"][13] = json!(z + by);
    }
}

/// What the proof of a set says of the changes below.
pub(crate) fn named() -> impl Iterator<Item = &'static str> {
    CHANGES.into_iter().map(|(what, _)| what).chain([REGIONS, NESTED])
}

const REGIONS: &str = "regions that do not contain the tiles";
const NESTED: &str = "sphere does not contain that";

type Change = (&'static str, fn(&mut Glb));

const CHANGES: [Change; 15] = [
    ("clockwise triangles", |t| {
        let (at, _) = t.indices();
        (0..2).for_each(|k| t.buffer.swap(at + k, at + 2 + k));
    }),
    ("triangles without area", |t| {
        let (at, _) = t.indices();
        (0..2).for_each(|k| t.buffer[at + 2 + k] = t.buffer[at + k]);
    }),
    ("edges of one triangle inside", |t| {
        let (at, _) = t.indices();
        (0..2).for_each(|k| t.buffer[at + 2 + k] = t.buffer[at + k]);
    }),
    ("wrong lists of the vertices of a side", |t| {
        let (at, _) = t.edge("left");
        (0..2).for_each(|k| t.buffer[at + 2 + k] = t.buffer[at + k]);
    }),
    ("vertices of a side in the wrong order", |t| {
        let (at, count) = t.edge("bottom");
        (0..2).for_each(|k| t.buffer.swap(at + k, at + 2 * (count - 1) + k));
    }),
    ("normals that do not point outwards", |t| {
        let (at, count) = t.attribute("NORMAL");
        (0..3 * count).for_each(|i| t.float(at + 4 * i, |value| -value));
    }),
    ("without the normals that tileset.json announces", |t| {
        t.primitive()["attributes"].as_object_mut().unwrap().remove("NORMAL");
    }),
    ("without the edges that tileset.json announces", |t| {
        t.primitive().as_object_mut().unwrap().remove("extensions");
    }),
    ("differs from that of their texture coordinates", |t| {
        let (at, _) = t.attribute("TEXCOORD_0");
        t.float(at, |u| (u + 0.25) % 1.0);
    }),
    ("wrong minimum or maximum of positions", |t| t.text["accessors"][0]["max"][0] = json!(1e6)),
    ("not multiples of the lattice", |t| t.shift(1e-5)),
    ("samples further from the surface", |t| t.shift(64.0)),
    ("borders whose vertices or heights differ", |t| t.shift(0.25)),
    ("vertices outside the bounding sphere", |t| t.shift(1e4)),
    ("triangles outside the stated height range", |t| t.shift(4096.0)),
];

/// The files of the finest level; the first has several triangles.
fn tile(place: &Place) -> PathBuf {
    let all = walk(place, "t");
    let is_it = |name: &&String| {
        name.starts_with("east/14/")
            && name.ends_with(".glb")
            && Glb::of(&place.bytes(&format!("t/{name}"))).indices().1 > 30
    };
    place.path("t").join(all.iter().find(is_it).expect("a tile of several triangles"))
}

#[test]
fn every_change_of_a_tile_is_named() {
    let place = sound();
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    let path = tile(&place);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, Glb::of(&whole).bytes()).unwrap();
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    for (what, change) in CHANGES {
        let mut glb = Glb::of(&whole);
        change(&mut glb);
        let bytes = glb.bytes();
        assert!(bytes != Glb::of(&whole).bytes(), "{what}");
        fs::write(&path, bytes).unwrap();
        expect(&place, what);
    }
}

#[test]
fn what_clients_of_terrain_do_not_take_is_refused_by_name() {
    let place = sound();
    let path = tile(&place);
    let name = path.file_name().unwrap().to_str().unwrap();
    let whole = fs::read(&path).unwrap();
    let changes: [Change; 18] = [
        ("translation", |t| t.text["nodes"][0]["translation"] = json!([100, 0, 0])),
        ("children", |t| t.text["nodes"][0]["children"] = json!([0])),
        ("alphaMode", |t| t.text["materials"][0]["alphaMode"] = json!("BLEND")),
        ("baseColorFactor", |t| {
            t.text["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0, 0, 0, 0]);
        }),
        ("not listed as used", |t| {
            t.text.as_object_mut().unwrap().remove("extensionsUsed");
        }),
        ("KHR_draco_mesh_compression", |t| {
            t.primitive()["extensions"]["KHR_draco_mesh_compression"] = json!({});
        }),
        ("targets", |t| t.primitive()["targets"] = json!([{"POSITION": 0}])),
        ("skins", |t| t.text["skins"] = json!([{}])),
        ("wrong target", |t| {
            let accessor = t.primitive()["indices"].as_u64().unwrap() as usize;
            let view = t.text["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
            t.text["bufferViews"][view]["target"] = json!(34962);
        }),
        ("uniform scale", |t| t.text["nodes"][0]["matrix"][0] = json!(2.0)),
        ("without a matrix", |t| {
            t.text["nodes"][0].as_object_mut().unwrap().remove("matrix");
        }),
        ("not one node", |t| t.text["scenes"][0]["nodes"] = json!([])),
        ("is required", |t| t.text["extensionsRequired"] = json!(["EXT_some"])),
        ("exceeds its buffer view", |t| t.text["accessors"][0]["count"] = json!(99_999)),
        ("buffer is not", |t| t.text["buffers"][0]["byteLength"] = json!(8)),
        ("stride of accessor", |t| t.text["bufferViews"][0]["byteStride"] = json!(16)),
        ("glTF version", |t| t.text["asset"]["version"] = json!("1.0")),
        ("exceeds the", |t| {
            let (at, _) = t.indices();
            t.buffer[at..at + 2].copy_from_slice(&[0xfe, 0xff]);
        }),
    ];
    for (what, change) in changes {
        let mut glb = Glb::of(&whole);
        change(&mut glb);
        fs::write(&path, glb.bytes()).unwrap();
        refused(&place, name, what);
    }
    for (what, bytes) in [
        ("not a binary glTF", Vec::new()),
        ("length in the header", whole[..whole.len() / 2].to_vec()),
        ("length in the header", [&whole[..], b"more"].concat()),
    ] {
        fs::write(&path, bytes).unwrap();
        refused(&place, name, what);
    }
}

type ChangeOfSet<'a> = (&'a str, &'a dyn Fn(&mut Value));

#[test]
fn every_change_of_the_tileset_is_named() {
    let place = sound();
    let path = place.path("t/tileset.json");
    let whole: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let wrong: [ChangeOfSet<'_>; 6] = [
        ("larger tolerance than clients assume", &|t| {
            t["extras"]["terrane"]["levels"][3]["tolerance"] = json!(1e5);
        }),
        ("other geometric errors at its root", &|t| {
            (0..2).for_each(|i| t["root"]["children"][i]["geometricError"] = json!(7e4));
        }),
        ("larger error than tileset.json states", &|t| {
            t["extras"]["terrane"]["levels"][14]["error"] = json!(0.001);
        }),
        ("another number of tiles", &|t| t["extras"]["terrane"]["levels"][2]["tiles"] = json!(77)),
        ("bounds that do not contain all samples", &|t| {
            t["extras"]["terrane"]["bounds"][0] = json!(7.04);
        }),
        (REGIONS, &|t| {
            t["root"]["children"][1]["boundingVolume"]["region"][5] = json!(1.0);
        }),
    ];
    for (what, change) in wrong {
        let mut tileset = whole.clone();
        change(&mut tileset);
        fs::write(&path, tileset.to_string()).unwrap();
        expect(&place, what);
    }
    let unknown: [ChangeOfSet<'_>; 17] = [
        ("transform", &|t| {
            t["root"]["transform"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1000, 0, 0, 1]);
        }),
        ("transform", &|t| t["root"]["children"][1]["transform"] = json!(vec![0; 16])),
        ("viewerRequestVolume", &|t| {
            t["root"]["viewerRequestVolume"] = json!({"sphere": [0, 0, 0, 1]});
        }),
        ("extensionsRequired", &|t| t["extensionsRequired"] = json!(["FOO_bar"])),
        ("contents", &|t| t["root"]["children"][0]["contents"] = json!([{"uri": "a.glb"}])),
        ("offset", &|t| {
            t["schema"]["classes"]["tile"]["properties"]["minimumHeight"]["offset"] = json!(100.0);
        }),
        ("scale", &|t| {
            t["schema"]["classes"]["tile"]["properties"]["geometricError"]["scale"] = json!(0.1);
        }),
        ("noData", &|t| {
            t["schema"]["classes"]["tile"]["properties"]["minimumHeight"]["noData"] = json!(-1.0);
        }),
        ("not 1.1", &|t| t["asset"]["version"] = json!("1.0")),
        ("schema", &|t| {
            t.as_object_mut().unwrap().remove("schema");
        }),
        ("1 roots", &|t| {
            t["root"]["children"].as_array_mut().unwrap().pop();
        }),
        ("not the globe and its halves", &|t| {
            t["root"]["children"][0]["boundingVolume"]["region"][2] = json!(0.5);
        }),
        ("grow from the root on", &|t| t["geometricError"] = json!(5.0)),
        ("replacing", &|t| t["root"]["refine"] = json!("ADD")),
        ("addresses other than", &|t| {
            t["root"]["children"][0]["content"]["uri"] = json!("{level}.glb");
        }),
        ("TILE_HORIZON_OCCLUSION_POINT", &|t| {
            t["schema"]["classes"]["tile"]["properties"]["horizonOcclusionPoint"]["semantic"] =
                json!("OTHER");
        }),
        ("beyond level 12", &|t| {
            for i in 0..2 {
                t["root"]["children"][i]["implicitTiling"]["availableLevels"] = json!(13);
            }
            t["extras"]["terrane"]["levels"].as_array_mut().unwrap().truncate(13);
        }),
    ];
    for (what, change) in unknown {
        let mut tileset = whole.clone();
        change(&mut tileset);
        fs::write(&path, tileset.to_string()).unwrap();
        refused(&place, "t/", what);
    }
}

/// A subtree with its text apart.
fn with_text(bytes: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize;
    let mut text: Value = serde_json::from_slice(&bytes[24..24 + length]).unwrap();
    change(&mut text);
    let mut text = text.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let head = [&bytes[..8], &(text.len() as u64).to_le_bytes(), &bytes[16..24]].concat();
    [head, text, bytes[24 + length..].to_vec()].concat()
}

/// With one number of what is told of the first tile changed.
fn with_number(bytes: &[u8], name: &str, change: impl Fn(f64) -> f64) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize;
    let text: Value = serde_json::from_slice(&bytes[24..24 + length]).unwrap();
    let view = text["propertyTables"][0]["properties"][name]["values"].as_u64().unwrap();
    let offset = text["bufferViews"][view as usize]["byteOffset"].as_u64().unwrap() as usize;
    // Of a sphere the radius, of a point all three.
    let (first, count) = match name {
        "boundingSphere" => (3, 1),
        "horizonOcclusionPoint" => (0, 3),
        _ => (0, 1),
    };
    let mut bytes = bytes.to_vec();
    for at in (0..count).map(|k| 24 + length + offset + 8 * (first + k)) {
        let old = f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        bytes[at..at + 8].copy_from_slice(&change(old).to_le_bytes());
    }
    bytes
}

#[test]
fn every_change_of_a_subtree_is_named() {
    let place = sound();
    let path = place.path("t").join("east/0/0/0.subtree");
    let whole = fs::read(&path).unwrap();
    let wrong: [(&str, Vec<u8>); 6] = [
        ("outside the bounding sphere", with_number(&whole, "boundingSphere", |r| r / 2.0)),
        (NESTED, with_number(&whole, "boundingSphere", |r| r / 2.0)),
        ("tiles with a larger error", with_number(&whole, "geometricError", |_| 0.5)),
        ("outside the stated height range", with_number(&whole, "minimumHeight", |_| 0.0)),
        ("record a larger error", with_number(&whole, "geometricError", |_| 1e6)),
        ("visible where", with_number(&whole, "horizonOcclusionPoint", |x| x * 1e-6)),
    ];
    for (what, bytes) in wrong {
        fs::write(&path, bytes).unwrap();
        expect(&place, what);
    }
    let unknown: [(&str, Vec<u8>); 8] = [
        (
            "scale",
            with_text(&whole, |t| {
                t["propertyTables"][0]["properties"]["geometricError"]["scale"] = json!(0.5);
            }),
        ),
        ("not a subtree", b"no subtree".to_vec()),
        ("lengths of JSON and buffer", whole[..whole.len() - 8].to_vec()),
        ("bits are set", with_text(&whole, |t| t["tileAvailability"]["availableCount"] = json!(2))),
        (
            "without content",
            with_text(&whole, |t| t["contentAvailability"] = json!([{"constant": 0}])),
        ),
        (
            "property table has 3 rows",
            with_text(&whole, |t| t["propertyTables"][0]["count"] = json!(3)),
        ),
        ("property table is missing", with_text(&whole, |t| t["tileMetadata"] = json!(4))),
        ("east/7/", with_text(&whole, |t| t["childSubtreeAvailability"] = json!({"constant": 1}))),
    ];
    for (what, bytes) in unknown {
        fs::write(&path, bytes).unwrap();
        refused(&place, "subtree", what);
    }
    fs::write(&path, with_text(&whole, |t| t["childSubtreeAvailability"] = json!({"constant": 0})))
        .unwrap();
    expect(&place, "tiles not listed as available in tileset.json");
    expect(&place, "neither tileset.json nor a tile");
}

type ChangeOfFiles<'a> = (&'a str, fn(&Place));

#[test]
fn every_change_of_the_files_is_named() {
    let changes: [ChangeOfFiles<'_>; 4] = [
        ("missing tiles with samples", |p| fs::remove_file(tile(p)).unwrap()),
        ("missing tiles listed as available", |p| fs::remove_file(tile(p)).unwrap()),
        ("missing roots", |p| fs::remove_file(p.path("t/west/0/0/0.glb")).unwrap()),
        ("neither tileset.json nor a tile", |p| {
            fs::write(p.path("t/east/14/mine.txt"), "mine").unwrap();
        }),
    ];
    for (what, change) in changes {
        let place = sound();
        change(&place);
        expect(&place, what);
    }
    let place = sound();
    fs::remove_file(place.path("t/west/0/0/0.subtree")).unwrap();
    refused(&place, "0.subtree", "No such file");
}
