//! `terrane tiles --skirts`: walls hang from the sides of 3D Tiles, straight down and as deep as is said, and `verify`
//! tells them from the surface.

use std::fs;

use serde_json::{Value, json};

use crate::cli_support::{Place, json as parsed};
use crate::tiles::{place, walk};
use crate::tiles_three::Glb;

/// What may be wrong with skirts.
pub(crate) const NAMED: [&str; 3] = [
    "open edges between a skirt and its tile, or within a skirt",
    "vertices of skirts that are not vertically below the rim at the depth in tileset.json",
    "levels whose skirts are shorter than the expected gap to the coarser level",
];

const MAKE: [&str; 6] = ["tiles", "dem.asc", "t", "--format", "3dtiles", "--skirts"];

#[test]
fn skirts_are_proved_and_the_bytes_are_the_same() {
    let place = place(120);
    for (number, how) in
        [&[][..], &["--tile-edges"], &["--meshopt"], &["--meshopt", "--tile-edges"]]
            .into_iter()
            .enumerate()
    {
        let own = ["--overwrite", "-q"];
        place.ok(&[&MAKE[..], how, &own, &["--threads", "1"]].concat());
        let told = parsed(&place.ok(&["verify", "t", "dem.asc", "--json"]).out);
        assert_eq!(told["passed"], true, "{how:?}: {told}");
        let plain = ["tiles", "dem.asc", "plain", "--format", "3dtiles"];
        place.ok(&[&plain[..], how, &own].concat());
        let bare = parsed(&place.ok(&["verify", "plain", "dem.asc", "--json"]).out);
        // The surface has as many samples within as large an error, and what hangs is not counted.
        assert_eq!(told["measured"], bare["measured"]);
        let made = ["tiles", "dem.asc", "two", "--format", "3dtiles", "--skirts"];
        place.ok(&[&made[..], how, &own, &["--workdir", &format!("work{number}")]].concat());
        assert_eq!(walk(&place, "t"), walk(&place, "two"));
        for name in walk(&place, "t") {
            let [a, b] = ["t", "two"].map(|set| place.bytes(&format!("{set}/{name}")));
            assert_eq!(a, b, "{how:?}: {name}");
        }
    }
    place.fails(&["tiles", "dem.asc", "x", "--skirts"], 2, &["--skirts", "--format 3dtiles"]);
}

/// A set whose bytes can be changed, and one of its tiles.
fn sound() -> (Place, std::path::PathBuf, Vec<u8>) {
    let place = place(100);
    place.ok(&[&MAKE[..], &["--tile-edges", "--no-gzip", "-q"]].concat());
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    let all = walk(&place, "t");
    let of_level = |name: &&String| name.ends_with(".glb") && name.starts_with("east/13/");
    let path = place.path("t").join(all.iter().find(of_level).expect("a tile"));
    let bytes = fs::read(&path).unwrap();
    (place, path, bytes)
}

/// Earth-centred offsets, places in the tile and corners of triangles.
type Parts = (Vec<[f32; 3]>, Vec<[f32; 2]>, Vec<[u16; 3]>);

fn parts(glb: &Glb) -> Parts {
    let part = |view: usize| {
        let told = &glb.text["bufferViews"][view];
        let [at, length] =
            ["byteOffset", "byteLength"].map(|key| told[key].as_u64().unwrap() as usize);
        &glb.buffer[at..at + length]
    };
    let floats = |view: usize| -> Vec<f32> {
        part(view)
            .chunks_exact(4)
            .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
            .collect()
    };
    let indices: Vec<u16> = part(3)
        .chunks_exact(2)
        .map(|bytes| u16::from_le_bytes(bytes.try_into().unwrap()))
        .collect();
    let (positions, places) = (floats(0), floats(1));
    (
        positions.as_chunks().0.to_vec(),
        places.as_chunks().0.to_vec(),
        indices.as_chunks().0.to_vec(),
    )
}

/// Triangles upon a side of the tile.
fn hanging((_, places, triangles): &Parts) -> Vec<usize> {
    let is_hanging = |i: &usize| {
        let corners = triangles[*i].map(|corner| places[usize::from(corner)]);
        (0..2).any(|axis| [0.0, 1.0].iter().any(|end| corners.iter().all(|at| at[axis] == *end)))
    };
    (0..triangles.len()).filter(is_hanging).collect()
}

#[test]
fn walls_hang_straight_down_as_deep_as_is_said() {
    let (place, _, bytes) = sound();
    let tileset: Value = serde_json::from_slice(&place.bytes("t/tileset.json")).unwrap();
    let levels = tileset["extras"]["terrane"]["levels"].as_array().unwrap();
    let depth = levels[13]["skirt"].as_f64().unwrap();
    let both =
        levels[12]["tolerance"].as_f64().unwrap() + levels[13]["tolerance"].as_f64().unwrap();
    assert!((both..both + 1.0).contains(&depth), "{depth} {both}");
    let glb = Glb::of(&bytes);
    let parts = parts(&glb);
    let (positions, places, triangles) = &parts;
    let walls = hanging(&parts);
    let lists = &glb.text["meshes"][0]["primitives"][0]["extensions"]["CESIUM_tile_edges"];
    let listed: u64 = ["left", "bottom", "right", "top"]
        .iter()
        .map(|side| {
            glb.text["accessors"][lists[side].as_u64().unwrap() as usize]["count"].as_u64().unwrap()
        })
        .sum();
    // Two for each edge; corners are listed on two sides.
    assert_eq!(walls.len() as u64, 2 * (listed - 4));
    let mut looked = 0;
    for wall in walls {
        for a in triangles[wall].map(usize::from) {
            for b in triangles[wall]
                .map(usize::from)
                .into_iter()
                .filter(|b| places[a] == places[*b] && a != *b)
            {
                let apart: f64 = (0..3)
                    .map(|axis| f64::from(positions[a][axis] - positions[b][axis]).powi(2))
                    .sum::<f64>()
                    .sqrt();
                assert!((apart - depth).abs() < 0.01, "{apart} {depth}");
                looked += 1;
            }
        }
    }
    assert!(looked > 20, "{looked}");
}

#[test]
fn torn_and_short_skirts_are_noticed() {
    let (place, path, whole) = sound();
    let notices = |words: &str| {
        let ran = place.run(&["verify", "t", "dem.asc"]);
        assert!(ran.code == 1 && ran.out.contains(words), "{words}: {} {}", ran.out, ran.err);
    };
    let parts = parts(&Glb::of(&whole));
    let wall = hanging(&parts)[5];
    let index = |glb: &Glb, corner: usize| {
        glb.text["bufferViews"][3]["byteOffset"].as_u64().unwrap() as usize
            + 2 * (3 * wall + corner)
    };
    // A triangle turned over, and one that hangs from another vertex.
    let mut turned = Glb::of(&whole);
    let [a, b] = [index(&turned, 0), index(&turned, 1)];
    (0..2).for_each(|byte| turned.buffer.swap(a + byte, b + byte));
    fs::write(&path, turned.bytes()).unwrap();
    notices(NAMED[0]);
    let mut gone = Glb::of(&whole);
    let (from, to) = (index(&gone, 0), index(&gone, 1));
    gone.buffer.copy_within(to..to + 2, from);
    fs::write(&path, gone.bytes()).unwrap();
    notices(NAMED[0]);
    fs::write(&path, &whole).unwrap();
    // All of a level as deep as is not said, and a level that says too little.
    let tileset: Value = serde_json::from_slice(&place.bytes("t/tileset.json")).unwrap();
    let said = |level: usize, depth: Value| {
        let mut changed = tileset.clone();
        changed["extras"]["terrane"]["levels"][level]["skirt"] = depth;
        place.write("t/tileset.json", changed.to_string());
    };
    let depth = tileset["extras"]["terrane"]["levels"][13]["skirt"].as_f64().unwrap();
    said(13, json!(depth + tileset["extras"]["terrane"]["levels"][13]["step"].as_f64().unwrap()));
    notices(NAMED[1]);
    said(13, json!(depth / 2.0));
    notices(NAMED[2]);
    // What is not said to hang is surface.
    said(13, Value::Null);
    notices("triangles without area");
    said(13, json!(-1.0));
    let ran = place.run(&["verify", "t", "dem.asc"]);
    assert!(ran.code == 65 && ran.err.contains("tileset.json: tolerance"), "{}", ran.err);
    place.write("t/tileset.json", tileset.to_string());
    place.ok(&["verify", "t", "dem.asc", "-q"]);
}
