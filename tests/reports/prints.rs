//! Reports on printed models.

use std::collections::BTreeMap;

use crate::cli_support::{Place, json};

/// The corners of an STL, in steps of a ten-thousandth of a millimetre.
fn corners(bytes: &[u8]) -> Vec<[i64; 3]> {
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let triangles = (bytes.len() - 84) / 50;
    let corner = |i: usize| {
        let at = 84 + 50 * (i / 3) + 12 + 12 * (i % 3);
        [0, 4, 8].map(|axis| (f64::from(number(at + axis)) * 1e4).round() as i64)
    };
    (0..3 * triangles).map(corner).collect()
}

/// The heights above the bottom along a side: by the place along it.
fn profile(bytes: &[u8], axis: usize, is_high: bool) -> BTreeMap<i64, i64> {
    let all = corners(bytes);
    let bottom = all.iter().map(|c| c[2]).min().unwrap();
    let sides = all.iter().map(|c| c[axis]);
    let side = if is_high { sides.max() } else { sides.min() }.unwrap();
    let lowest = all.iter().map(|c| c[1 - axis]).min().unwrap();
    let on_side = all.iter().filter(|c| (c[axis] - side).abs() <= 1);
    let mut heights = BTreeMap::new();
    for corner in on_side {
        let height = heights.entry(corner[1 - axis] - lowest).or_insert(0);
        *height = (*height).max(corner[2] - bottom);
    }
    heights
}

/// TouchTerrain#79, #36: prints of neighbours whose sides differ in height.
#[test]
fn d10_neighbouring_prints_meet_with_one_bottom_and_a_note_says_how() {
    let place = Place::new();
    place.ok(&["synth", "rough,size=129,seed=4", "dem.tif"]);
    let info = json(&place.ok(&["info", "dem.tif", "--json"]).out);
    let bounds: Vec<f64> =
        info["bounds"].as_array().unwrap().iter().map(|side| side.as_f64().unwrap()).collect();
    let [west, south, east, north] = [bounds[0], bounds[1], bounds[2], bounds[3]];
    let cell = (east - west) / 129.0;
    let middle = west + 64.5 * cell;
    let boxes =
        [[west, south, middle + cell / 2.0, north], [middle - cell / 2.0, south, east, north]];
    let print = |name: &str, side: usize, more: &[&str]| {
        let bbox = boxes[side].map(|end| end.to_string()).join(",");
        let args = [
            "tin",
            "dem.tif",
            name,
            "--bbox",
            &bbox,
            "--max-error",
            "0.01",
            "--scale",
            "1:25000",
            "--json",
        ];
        json(&place.ok(&[&args[..], more].concat()).out)
    };
    for format in ["stl", "3mf"] {
        let report = print(&format!("a.{format}"), 0, &["--base", "3mm"]);
        let notes = report["notes"].to_string();
        assert!(
            notes.contains("--co SOLID_BASE=HEIGHT") && notes.contains("adjacent prints"),
            "{notes}"
        );
    }
    let base = ["--co", "SOLID_BASE=100"];
    let notes = print("west.stl", 0, &base)["notes"].to_string();
    assert!(!notes.contains("SOLID_BASE"), "{notes}");
    print("east.stl", 1, &base);
    let [one, other] =
        [profile(&place.bytes("west.stl"), 0, true), profile(&place.bytes("east.stl"), 0, false)];
    assert!(one.len() > 100, "{} corners on the common side", one.len());
    for ((place_1, height_1), (place_2, height_2)) in one.iter().zip(&other) {
        assert!(
            (place_1 - place_2).abs() <= 2 && (height_1 - height_2).abs() <= 5,
            "{place_1}: {height_1} {height_2}"
        );
    }
    assert_eq!(one.len(), other.len());
}
