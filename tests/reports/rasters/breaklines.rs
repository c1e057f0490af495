//! A report on breaklines that are nearly one.

use super::facts;
use crate::cli_support::{Place, json};

/// Lines that are nearly one, within a square.
fn nearly_one([x, y]: [f64; 2], side: f64) -> Vec<(&'static str, String)> {
    let place = |[east, north]: [f64; 2]| [x + side * east, y + side * north];
    let line = |points: &[[f64; 2]]| {
        let all: Vec<_> = points.iter().map(|[px, py]| format!("{px} {py}")).collect();
        format!("LINESTRING({})\n", all.join(","))
    };
    let coast = |lift: f64, gap: f64| {
        let point = |i: u8| {
            let share = f64::from(i) / 40.0;
            let [px, py] = place([0.1 + 0.8 * share, 0.5 + 0.1 * f64::from(i).sin()]);
            [[px, py + lift], [px + gap, py + lift + gap]]
        };
        line(&(0..=40).flat_map(point).collect::<Vec<_>>())
    };
    let (forth, back) = (place([0.2, 0.2]), place([0.8, 0.3]));
    let [top, [px, py]] = [place([0.5, 0.8]), place([0.5, 0.25])];
    // The report's own segment, in shares of the side.
    let own = [[0.780_359_7, 0.570_920_7], [0.780_358_137_985, 0.571_076_022_852], [0.78, 0.6]];
    vec![
        ("close", coast(0.0, 1e-9)),
        ("less close", coast(0.0, 1e-6)),
        ("upon", coast(0.0, 1e-7) + &coast(1e-9, 1e-7) + &coast(1e-6, 1e-9)),
        ("back", line(&[forth, back, forth, [back[0], back[1] + 1e-9], forth])),
        ("touch", line(&[forth, back]) + &line(&[top, [px, py + 1e-7]])),
        ("report", line(&own.map(place))),
    ]
}

/// oscarpilote/Ortho4XP#125: constraints that are nearly one.
#[test]
fn a9_breaklines_nearly_upon_each_other_end_in_a_mesh_or_an_error() {
    let place = Place::new();
    place.ok(&["synth", "rough,size=129,seed=4", "dem.tif", "-q"]);
    place.ok(&["synth", "cloud,size=60,density=4,seed=5", "cloud.laz", "-q"]);
    let numbers = |value: &serde_json::Value| {
        let all = value.as_array().unwrap().iter();
        all.map(|v| v.as_f64().unwrap()).collect::<Vec<_>>()
    };
    let grid = numbers(&facts(&place, &["info", "dem.tif"])["sample_bounds"]);
    let cloud = facts(&place, &["info", "cloud.laz"])["bounds"].clone();
    let [low, high] = [0, 1].map(|end| numbers(&cloud[end]));
    for (input, corner, side) in [
        ("dem.tif", [grid[0], grid[1]], grid[2] - grid[0]),
        ("cloud.laz", [low[0], low[1]], (high[0] - low[0]).min(high[1] - low[1])),
    ] {
        for (name, lines) in nearly_one(corner, side) {
            place.write("l.wkt", &lines).write("l.prj", "EPSG:32631");
            let make = ["tin", input, "o.ply", "--max-error", "4", "--breaklines", "l.wkt"];
            let ran = place.run(&[&make[..], &["--overwrite", "--json"]].concat());
            assert!([0, 65].contains(&ran.code), "{input} {name}: {}", ran.err);
            if ran.code == 0 {
                // In proportion to the lines' length, not to how near they are.
                let vertices = json(&ran.out)["vertices"].as_u64().unwrap();
                assert!(vertices < 12_000, "{input} {name}: {vertices}");
                place.ok(&["verify", "o.ply", input, "--breaklines", "l.wkt"]);
            }
        }
    }
}
