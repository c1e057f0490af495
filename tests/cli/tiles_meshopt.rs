//! `terrane tiles --meshopt`: 3D Tiles whose parts are compressed are proved as others are, at less than half the bytes,
//! and damaged ones are noticed.

use std::fs;

use serde_json::json;

use crate::cli_support::{Place, json as parsed};
use crate::tiles::{place, walk};
use crate::tiles_three::Glb;

const MAKE: [&str; 6] = ["tiles", "dem.asc", "t", "--format", "3dtiles", "--meshopt"];

/// Bytes of all tiles of a set.
fn bytes(place: &Place, set: &str) -> usize {
    let names = walk(place, set).into_iter().filter(|name| name.ends_with(".glb"));
    names.map(|name| place.bytes(&format!("{set}/{name}")).len()).sum()
}

#[test]
fn compressed_sets_are_proved_and_small_and_their_bytes_are_the_same() {
    let place = place(150);
    for edges in [&[][..], &["--tile-edges"]] {
        let own = ["--overwrite", "-q"];
        place.ok(&[&MAKE[..], edges, &own, &["--threads", "1"]].concat());
        let told = parsed(&place.ok(&["verify", "t", "dem.asc", "--json"]).out);
        assert_eq!(told["passed"], true, "{told}");
        let plain = ["tiles", "dem.asc", "plain", "--format", "3dtiles"];
        place.ok(&[&plain[..], edges, &own].concat());
        assert!(2 * bytes(&place, "t") < bytes(&place, "plain"), "{edges:?}");
        let other = ["tiles", "dem.asc", "two", "--format", "3dtiles", "--meshopt"];
        place.ok(&[&other[..], edges, &own, &["--threads", "2", "--memory", "96M"]].concat());
        let work = format!("work{}", edges.len());
        let planned = ["tiles", "dem.asc", "three", "--format", "3dtiles", "--meshopt"];
        place.ok(&[&planned[..], edges, &own, &["--workdir", &work]].concat());
        for set in ["two", "three"] {
            assert_eq!(walk(&place, "t"), walk(&place, set));
            for name in walk(&place, "t") {
                let [a, b] = ["t", set].map(|set| place.bytes(&format!("{set}/{name}")));
                assert_eq!(a, b, "{set}/{name}");
            }
        }
    }
    place.fails(&["tiles", "dem.asc", "x", "--meshopt"], 2, &["--meshopt", "--format 3dtiles"]);
}

#[test]
fn damaged_parts_are_noticed() {
    let place = place(100);
    place.ok(&[&MAKE[..], &["--tile-edges", "--no-gzip", "-q"]].concat());
    place.ok(&["verify", "t", "dem.asc", "-q"]);
    let all = walk(&place, "t");
    let large = |name: &&String| name.ends_with(".glb") && name.starts_with("east/13/");
    let name = all.iter().find(large).expect("a tile");
    let path = place.path("t").join(name);
    let whole = fs::read(&path).unwrap();
    let glb = Glb::of(&whole);
    let packed = |view: usize| {
        let told = &glb.text["bufferViews"][view]["extensions"]["EXT_meshopt_compression"];
        ["byteOffset", "byteLength"].map(|key| told[key].as_u64().unwrap() as usize)
    };
    let notices = |changed: &Glb, what: &str| {
        fs::write(&path, changed.bytes()).unwrap();
        let ran = place.run(&["verify", "t", "dem.asc", "-q"]);
        assert!([1, 65, 66].contains(&ran.code), "{what}: {} {}", ran.code, ran.err);
    };
    // Positions, places in the tile, corners of triangles and a side: how they are packed, and what they are; of
    // the first two the end as well, which is what the first element is.
    for view in [0, 1, 3, 4] {
        let [offset, length] = packed(view);
        let end = (view < 2).then(|| length - 3);
        // The last four bytes of indices stand for nothing.
        let is_told = |at: &usize| view < 3 || *at + 4 < length;
        for at in [0, 1, 3].into_iter().filter(is_told).chain(end) {
            let mut changed = Glb::of(&whole);
            changed.buffer[offset + at] ^= 0x15;
            notices(&changed, &format!("byte {at} of view {view}"));
        }
    }
    type Change = (&'static str, &'static str, serde_json::Value);
    let changes: [Change; 5] = [
        ("mode", "ATTRIBUTES", json!("TRIANGLES")),
        ("filter", "NONE", json!("EXPONENTIAL")),
        ("count", "one less", json!(7)),
        ("byteStride", "other", json!(12)),
        ("byteLength", "beyond", json!(1 << 20)),
    ];
    for (key, what, value) in changes {
        let mut changed = Glb::of(&whole);
        changed.text["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][key] = value;
        notices(&changed, &format!("{key}: {what}"));
    }
    let mut changed = Glb::of(&whole);
    changed.text["accessors"][0]["normalized"] = json!(false);
    notices(&changed, "steps that stand for parts");
    fs::write(&path, &whole).unwrap();
    place.ok(&["verify", "t", "dem.asc", "-q"]);
}
