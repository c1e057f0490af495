//! Grids on other lattices (`convert --resampling`): sample by sample against the operation and the formulas, the same
//! bytes however they are made, and what is refused.

use crate::cli_support::{Place, json};
use crate::relief::values;
use terrane_base::geom::wkt::of_srs;
use terrane_crs::{CoordinateOperation, CoordinateOperationOptions};

const SIZE: [usize; 2] = [60, 50];

/// A grid in the middle of Switzerland (CH1903+ / LV95), of waves and voids.
fn place() -> (Place, Vec<f64>) {
    let place = Place::new();
    let height = |col: usize, row: usize| match (col * 7 + row * 13) % 41 {
        0 => f64::NAN,
        _ => {
            let wave = (col as f64 / 3.0).sin() * (row as f64 / 4.0).cos();
            (4000.0 + 640.0 * wave).round() / 8.0
        }
    };
    let heights: Vec<f64> =
        (0..SIZE[0] * SIZE[1]).map(|i| height(i % SIZE[0], i / SIZE[0])).collect();
    let text = |z: &f64| if z.is_nan() { "-9999".to_owned() } else { z.to_string() };
    let rows =
        heights.chunks(SIZE[0]).map(|row| row.iter().map(text).collect::<Vec<_>>().join(" "));
    let rows = rows.collect::<Vec<_>>().join("\n");
    place.write(
        "dem.asc",
        format!("ncols 60\nnrows 50\nxllcorner 2600000\nyllcorner 1200000\ncellsize 25\nNODATA_value -9999\n{rows}\n"),
    );
    place.write("dem.prj", "EPSG:2056");
    (place, heights)
}

fn near(found: &[f64; 2], wanted: &[f64; 2], most: f64) {
    assert!((0..2).all(|i| (found[i] - wanted[i]).abs() <= most), "{found:?}, not {wanted:?}");
}

/// Weights as Keys (1981) has them, and a hat.
fn weight(name: &str, x: f64) -> f64 {
    match (name, x) {
        ("bilinear", x) if x < 1.0 => 1.0 - x,
        ("cubic", x) if x < 1.0 => 1.5 * x.powi(3) - 2.5 * x.powi(2) + 1.0,
        ("cubic", x) if x < 2.0 => -0.5 * x.powi(3) + 2.5 * x.powi(2) - 4.0 * x + 2.0,
        _ => 0.0,
    }
}

/// The height at a place among the samples, by a loop over all of them.
fn slow(name: &str, heights: &[f64], [col, row]: [f64; 2], scale: [f64; 2]) -> f64 {
    let get = |c: i64, r: i64| match (usize::try_from(c), usize::try_from(r)) {
        (Ok(c), Ok(r)) if c < SIZE[0] && r < SIZE[1] => heights[r * SIZE[0] + c],
        _ => f64::NAN,
    };
    let nearest = get((col + 0.5).floor() as i64, (row + 0.5).floor() as i64);
    if name == "near" || nearest.is_nan() {
        return nearest;
    }
    let (mut sum, mut total) = (0.0, 0.0);
    for r in -20..70 {
        for c in -20..80 {
            let [x, y] = [(c as f64 - col).abs() / scale[0], (r as f64 - row).abs() / scale[1]];
            let (weight, height) = (weight(name, x) * weight(name, y), get(c, r));
            if !height.is_nan() {
                (sum, total) = (sum + weight * height, total + weight);
            } else if weight != 0.0 && name == "cubic" {
                return slow("bilinear", heights, [col, row], scale);
            }
        }
    }
    sum / total
}

#[test]
fn samples_are_those_of_the_operation_and_the_formula() {
    let (place, heights) = place();
    let extent = Some([2_600_012.5, 1_200_012.5, 2_601_487.5, 1_201_237.5]);
    let options = CoordinateOperationOptions { extent, ..CoordinateOperationOptions::default() };
    for (target, cell) in [("EPSG:32632", "20"), ("EPSG:32632", "70"), ("EPSG:4326", "0.0003")] {
        let back = CoordinateOperation::between(&of_srs("EPSG:2056"), &of_srs(target), &options)
            .unwrap()
            .inverse();
        for name in ["near", "bilinear", "cubic"] {
            let asked = ["convert", "dem.asc", "o.tif", "--to-crs", target, "--resampling", name];
            let more = ["--resolution", cell, "--overwrite", "--json"];
            let told = json(&place.ok(&[&asked[..], &more].concat()).out);
            let info = json(&place.ok(&["info", "o.tif", "--json"]).out);
            let (columns, found) = values(&place, "o.tif");
            let cell: f64 = cell.parse().unwrap();
            // Edges are at multiples, so the first sample is half a cell from one.
            let edge = |at: usize| info["geotransform"][at].as_f64().unwrap();
            let (x0, y0) = (edge(0) + cell / 2.0, edge(3) - cell / 2.0);
            for at in [x0, y0] {
                let steps = at / cell - 0.5;
                assert!((steps - steps.round()).abs() < 1e-6, "{at} {cell}");
            }
            let scale = [0, 1].map(|axis| told["scale"][axis].as_f64().unwrap_or(1.0));
            // A sample is 25 metres wide and high, and so many degrees.
            let expected = match (name, cell) {
                ("near", _) | (_, 20.0) => [1.0, 1.0],
                (_, 70.0) => [2.8, 2.8],
                _ => [1.0, 1.33],
            };
            near(&scale, &expected, 0.1);
            let mut valid = 0;
            for (i, found) in found.iter().enumerate() {
                let (col, row) = ((i % columns) as f64, (i / columns) as f64);
                let [x, y] = back.position([x0 + cell * col, y0 - cell * row]).unwrap();
                let at = [(x - 2_600_012.5) / 25.0, (1_201_237.5 - y) / 25.0];
                let wanted = slow(name, &heights, at, scale);
                valid += usize::from(!wanted.is_nan());
                let is_near = (wanted.is_nan() && found.is_nan()) || (found - wanted).abs() < 1e-4;
                assert!(is_near, "{target} {name} {i}: {found}, not {wanted}");
            }
            let metres = if cell < 1.0 { [76_100.0, 111_200.0] } else { [1.0; 2] };
            let whole = 1500.0 * 1250.0 / (cell * metres[0] * cell * metres[1]);
            assert!(valid as f64 > 0.9 * whole, "{valid} of {whole}");
            assert_eq!(told["resampling"], name);
            assert!(told["transformed"]["operation"].as_str().unwrap().contains("CH1903+"));
        }
    }
}

#[test]
fn threads_memory_blocks_and_parts_leave_no_trace() {
    let place = Place::new();
    let dem = "synth:salt,size=700,voids=0.001";
    for name in ["near", "bilinear", "cubic"] {
        let make = |output: &str, more: &[&str]| {
            let asked = ["convert", dem, output, "--to-crs", "EPSG:4326", "--resampling", name];
            place.ok(&[&asked[..], &["--overwrite", "-q"], more].concat());
        };
        make("one.tif", &["--threads", "1", "--resolution", "0.0002"]);
        make("two.tif", &["--threads", "2", "--resolution", "0.0002", "--memory", "32M"]);
        assert!(place.bytes("one.tif") == place.bytes("two.tif"), "{name}");
        let whole = values(&place, "one.tif");
        let same = |a: &[f64], b: &[f64]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
        };
        let tiles =
            ["-f", "GTiff", "--co", "TILED=YES", "--co", "BLOCKXSIZE=48", "--co", "BLOCKYSIZE=32"];
        make("tiles.tif", &[&tiles[..], &["--resolution", "0.0002"]].concat());
        assert!(same(&whole.1, &values(&place, "tiles.tif").1), "{name}");
        // The lattice of another grid, sample on sample.
        make("like.tif", &["--like", "one.tif"]);
        assert!(place.bytes("one.tif") == place.bytes("like.tif"), "{name}");
        // A part of the output is that part of the whole.
        let part = ["--extent", "3.02,42.86,3.05,42.88"];
        make("part.tif", &[&part[..], &["--resolution", "0.0002"]].concat());
        let cut = [
            "convert",
            "one.tif",
            "cut.tif",
            "--bbox",
            "3.02,42.86,3.05,42.88",
            "--overwrite",
            "-q",
        ];
        place.ok(&cut);
        let (a, b) = (values(&place, "part.tif"), values(&place, "cut.tif"));
        assert_eq!((a.0, a.1.len()), (b.0, b.1.len()));
        let close =
            |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan() || (a - b).abs() < 1e-3;
        assert!(a.1.iter().zip(&b.1).all(close) && a.1.iter().any(|z| !z.is_nan()), "{name}");
    }
}

#[test]
fn nearest_heights_are_kept_and_others_computed() {
    let (place, heights) = place();
    place.ok(&["convert", "dem.asc", "dem.tif", "--type", "float64", "-q"]);
    place.ok(&["synth", "integer,size=80,seed=3", "whole.tif", "-q"]);
    let kind = |name: &str| json(&place.ok(&["info", name, "--json"]).out)["sample_type"].clone();
    let own = kind("whole.tif");
    for (input, name, expected) in [
        ("whole.tif", "near", own.as_str().unwrap()),
        ("whole.tif", "cubic", "float32"),
        ("dem.tif", "near", "float64"),
        ("dem.tif", "bilinear", "float64"),
    ] {
        let asked = ["convert", input, "o.tif", "--to-crs", "EPSG:4326", "--resampling", name];
        place.ok(&[&asked[..], &["--out-nodata", "-9999", "--overwrite", "-q"]].concat());
        assert_eq!(kind("o.tif"), expected, "{input} {name}");
    }
    // Rounded where that is allowed, and else refused.
    let asked = ["convert", "whole.tif", "i.tif", "--to-crs", "EPSG:4326", "--resampling", "cubic"];
    let int = ["--type", "int16", "--out-nodata", "-9999", "-q"];
    place.fails(&[&asked[..], &int].concat(), 65, &["int16", "--round"]);
    place.ok(&[&asked[..], &int, &["--round"]].concat());
    // In its own system a grid stays what it is, and half as close every other place is a sample.
    place.ok(&[
        "convert",
        "dem.asc",
        "s.tif",
        "--to-crs",
        "EPSG:2056",
        "--resampling",
        "cubic",
        "-q",
    ]);
    let same = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
    assert!(values(&place, "s.tif").1.iter().zip(&heights).all(same));
    place.ok(&["convert", "dem.asc", "n.tif", "--resolution", "5", "--resampling", "near", "-q"]);
    let (columns, fine) = values(&place, "n.tif");
    assert_eq!((columns, fine.len()), (300, 300 * 250));
    assert!((0..3000).all(|i| same((&fine[(i / 60 * 5 + 2) * 300 + i % 60 * 5 + 2], &heights[i]))));
    // A grid without a system has a lattice, too.
    std::fs::remove_file(place.path("dem.prj")).unwrap();
    place.ok(&["convert", "dem.asc", "u.tif", "--resolution", "5", "--resampling", "near", "-q"]);
    assert!(values(&place, "u.tif").1.iter().zip(&fine).all(same));
}

#[test]
fn geoids_change_heights_and_what_is_nowhere_is_told() {
    let (place, _) = place();
    let mut gtx: Vec<u8> = [46.0_f64, 7.0, 1.0, 1.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    gtx.extend([3_u32, 3].iter().flat_map(|v| v.to_be_bytes()));
    gtx.extend(
        [40.0_f32, 42.0, 44.0, 44.0, 46.0, 48.0, 48.0, 50.0, 52.0]
            .iter()
            .flat_map(|v| v.to_be_bytes()),
    );
    place.write("g.gtx", gtx);
    let with = |output: &str, more: &[&str]| {
        let asked = ["convert", "dem.asc", output, "--resampling", "near", "-q"];
        place.ok(&[&asked[..], more].concat());
        values(&place, output)
    };
    let high = with("e.tif", &["--to-crs", "EPSG:4979", "--geoid", "g.gtx"]);
    let low = with("s.tif", &["--to-crs", "EPSG:4326"]);
    assert_eq!((high.0, high.1.len()), (low.0, low.1.len()));
    let rise: Vec<f64> =
        high.1.iter().zip(&low.1).map(|(a, b)| a - b).filter(|d| !d.is_nan()).collect();
    assert!(rise.len() > 2000 && rise.iter().all(|d| (44.0..46.0).contains(d)), "{rise:?}");
    // Half of the earth is in no zone of UTM.
    let asked = ["convert", "dem.asc", "w.tif", "--to-crs", "EPSG:4326", "--resampling", "near"];
    let more = ["--extent", "-180,-90,180,90", "--resolution", "10", "--json"];
    let told = json(&place.ok(&[&asked[..], &more].concat()).out);
    let notes = told["notes"].to_string();
    assert!(notes.contains("samples are set to nodata"), "{notes}");
    assert_eq!(told["width"], 36);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let (place, _) = place();
    let asked = ["convert", "dem.asc", "o.tif"];
    let fails = |more: &[&str], code: i32, words: &[&str]| {
        place.fails(&[&asked[..], more].concat(), code, words);
    };
    for option in [
        &["--to-crs", "EPSG:4326"][..],
        &["--resolution", "5"],
        &["--extent", "0,0,1,1"],
        &["--like", "dem.asc"],
    ] {
        fails(option, 2, &[option[0], "requires --resampling", "near, bilinear, cubic"]);
    }
    fails(&["--resampling", "near"], 2, &["--resampling", "no effect", "--to-crs"]);
    let to = ["--to-crs", "EPSG:4326", "--resampling", "cubic"];
    let with = |more: &[&'static str]| [&to[..], more].concat();
    fails(&with(&["--extent", "0,0,1,1"]), 2, &["does not intersect the grid", "covers 7.4"]);
    fails(&with(&["--resolution", "1e-12"]), 2, &["samples", "--resolution"]);
    fails(&with(&["--resolution", "0.2"]), 65, &["input samples for each", "near"]);
    fails(&with(&["--like", "dem.asc"]), 2, &["dem.asc", "EPSG:2056", "EPSG:4326", "--to-crs"]);
    fails(&with(&["--like", "none.tif"]), 65, &["none.tif"]);
    fails(&["--to-crs", "EPSG:4267", "--resampling", "near"], 65, &["shift", "--shift-grid"]);
    fails(&["--to-crs", "EPSG:4979", "--resampling", "near"], 65, &["--geoid"]);
    fails(&["--resampling", "spline", "--to-crs", "EPSG:4326"], 2, &["spline", "bilinear"]);
    std::fs::remove_file(place.path("dem.prj")).unwrap();
    fails(&to, 65, &["dem.asc"]);
    // What of the earth has no place on the map, unless a part is named.
    let row = "1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36";
    let head = "ncols 36\nnrows 18\nxllcorner -180\nyllcorner -90\ncellsize 10\n";
    place.write("world.asc", format!("{head}{}", format!("{row}\n").repeat(18)));
    place.write("world.prj", "EPSG:4326");
    let globe = ["convert", "world.asc", "m.tif", "--to-crs", "EPSG:3857", "--resampling", "near"];
    place.fails(&globe, 65, &["--extent", "--like"]);
    place.ok(&[&globe[..], &["--extent", "-2e7,-2e7,2e7,2e7", "-q"]].concat());
}
