//! Reports on rasters and meshes of them.

mod breaklines;
mod overviews;
mod pictures;

use crate::cli_support::{Place, json};
use crate::raster_support::tiff_builder::{Spec, Value};
use crate::raster_support::{open_band, read_all};
use terrane_raster::{GridOpenOptions, open, open_all};

const GDAL_NODATA: u16 = 42_113;

/// Tags of cells of this size whose first corner is at x, y.
fn placed(cell: [f64; 2], corner: [f64; 2]) -> Vec<(u16, Value)> {
    vec![
        (33_550, Value::Double(vec![cell[0], cell[1], 0.0])),
        (33_922, Value::Double(vec![0.0, 0.0, 0.0, corner[0], corner[1], 0.0])),
    ]
}

/// Tags of the system of an EPSG code, and of a map to it by GDAL's six coefficients.
fn mapped(code: u16, [x, a, b, y, d, e]: [f64; 6]) -> Vec<(u16, Value)> {
    let is_degrees = code < 5000;
    let key = if is_degrees { [2048, 0, 1, code] } else { [3072, 0, 1, code] };
    let model = [1024, 0, 1, if is_degrees { 2 } else { 1 }];
    let keys = [[1, 1, 0, 3], model, [1025, 0, 1, 1], key].concat();
    let matrix = vec![a, b, 0.0, x, d, e, 0.0, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    vec![(34_264, Value::Double(matrix)), (34_735, Value::Short(keys))]
}

fn heights(place: &Place, name: &str) -> Vec<f64> {
    read_all(open_band(&place.path(name), 1).unwrap().as_ref()).unwrap()
}

fn same(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
}

fn facts(place: &Place, args: &[&str]) -> serde_json::Value {
    json(&place.ok(&[args, &["--json"]].concat()).out)
}

/// An ASCII grid from its lower left corner on.
fn ascii(size: [usize; 2], corner: [f64; 2], cell: f64, more: &str, rows: &str) -> String {
    let ([cols, count], [x, y]) = (size, corner);
    format!(
        "ncols {cols}\nnrows {count}\nxllcorner {x}\nyllcorner {y}\ncellsize {cell}\n{more}{rows}"
    )
}

/// OSGeo/gdal#1987: text of a nodata value that is not quite the one in the file.
#[test]
fn a1_nodata_text_rounds_to_the_type() {
    for (stored, text) in [
        (f64::from(f32::MAX), "3.40282346600000016e+38"),
        (f64::from(f32::MIN), "-3.40282347e+38"),
        (f64::from(f32::MIN), "-1.7E+308"),
    ] {
        let place = Place::new();
        let mut spec = Spec::new(64, 64, 3, 32);
        spec.extra = placed([10.0, 10.0], [5e5, 4e6]);
        spec.extra.push((GDAL_NODATA, Value::Text(text.to_owned())));
        place.write(
            "a.tif",
            spec.build(|col, row, _| match col < 32 {
                true => stored,
                false => ((col * 7 + row * 3) % 50) as f64,
            }),
        );
        let stats = facts(&place, &["info", "a.tif", "--stats"]);
        assert_eq!(stats["stats"]["valid"], 64 * 32, "{text}");
        assert_eq!((&stats["stats"]["min"], &stats["stats"]["max"]), (&0.0.into(), &49.0.into()));
        assert!(!stats["notes"].to_string().contains("nodata"), "{text}");
        let made = facts(&place, &["tin", "a.tif", "a.ply", "--max-error", "3"]);
        assert_eq!(made["valid_samples"], 64 * 32, "{text}");
        place.ok(&["verify", "a.ply", "a.tif"]);
        let lines = facts(&place, &["contour", "a.tif", "-o", "a.geojson", "--interval", "10"]);
        assert!(lines["lines"].as_u64().unwrap() < 5000, "{text}");
    }
}

/// OSGeo/gdal#13100: derivatives on grids that are turned, mirrored, or have the south above.
#[test]
fn a2_slopes_are_those_of_the_ground_on_any_axes() {
    const SIDE: usize = 65;
    const MIDDLE: f64 = 32.0;
    let (sine, cosine) = 30_f64.to_radians().sin_cos();
    let cell = 10.0;
    // Change of x and y by column and by row.
    let axes = [
        [cell, 0.0, 0.0, -cell],
        [cell, 0.0, 0.0, cell],
        [-cell, 0.0, 0.0, -cell],
        [cell * cosine, cell * sine, cell * sine, -cell * cosine],
        [-cell * cosine, cell * sine, -cell * sine, -cell * cosine],
    ];
    let verbs = ["slope", "aspect", "hillshade", "tpi", "tri", "roughness"];
    let mut first: Vec<Vec<f64>> = Vec::new();
    for (turn, [a, b, d, e]) in axes.into_iter().enumerate() {
        let place = Place::new();
        // The cone's top lies on the middle sample, whose centre is half a cell further.
        let at = |col: f64, row: f64| [a * col + b * row, d * col + e * row];
        let [x, y] = at(MIDDLE + 0.5, MIDDLE + 0.5);
        let mut spec = Spec::new(SIDE, SIDE, 3, 64);
        spec.extra = mapped(32_632, [5e5 - x, a, b, 5e6 - y, d, e]);
        spec.extra.push((GDAL_NODATA, Value::Text("-9999".to_owned())));
        place.write(
            "cone.tif",
            spec.build(|col, row, _| {
                let [x, y] = at(col as f64 - MIDDLE, row as f64 - MIDDLE);
                // A hundredth of a millimetre, so that the same place has the same height.
                1000.0 - (x.hypot(y) * 1e5).round() / 1e5
            }),
        );
        for (which, verb) in verbs.into_iter().enumerate() {
            place.ok(&[verb, "cone.tif", "o.tif", "--overwrite", "-q"]);
            let found = heights(&place, "o.tif");
            for (k, value) in found.iter().enumerate() {
                let [col, row] = [k % SIDE, k / SIDE].map(|i| i as f64 - MIDDLE);
                let [x, y] = at(col, row);
                let is_inner = col.abs().max(row.abs()) < MIDDLE;
                match verb {
                    _ if !is_inner => assert!(value.is_nan(), "{verb:?} {turn}"),
                    // Away from the top, everywhere.
                    "aspect" if x.hypot(y) > 60.0 => {
                        let away = x.atan2(y).to_degrees().rem_euclid(360.0);
                        let off = (value - away + 180.0).rem_euclid(360.0) - 180.0;
                        assert!(off.abs() < 0.5, "{turn}: {value} at {x} {y}");
                    }
                    "slope" if x.hypot(y) > 100.0 => {
                        assert!((value - 45.0).abs() < 0.5, "{turn}: {value}")
                    }
                    _ => {}
                }
            }
            // One place on the ground is one sample in the three grids that are not turned.
            if turn < 3 {
                let flip = |k: usize| {
                    let (col, row) = (k % SIDE, k / SIDE);
                    let col = if a < 0.0 { SIDE - 1 - col } else { col };
                    let row = if e > 0.0 { SIDE - 1 - row } else { row };
                    found[row * SIDE + col]
                };
                let upright: Vec<f64> = (0..found.len()).map(flip).collect();
                match turn {
                    0 => first.push(upright),
                    _ => {
                        // Tones may be rounded the other way, and north is 0 and 360.
                        let (slack, whole) =
                            if verb == "hillshade" { (1.0, 1e9) } else { (1e-3, 360.0) };
                        let apart = |a: &f64, b: &f64| {
                            ((a - b + whole / 2.0).rem_euclid(whole) - whole / 2.0).abs()
                        };
                        let near =
                            |a: &f64, b: &f64| apart(a, b) <= slack || a.is_nan() && b.is_nan();
                        let far =
                            first[which].iter().zip(&upright).filter(|(a, b)| !near(a, b)).count();
                        assert_eq!(far, 0, "{verb:?} {turn}");
                    }
                }
            }
        }
    }
}

/// OSGeo/gdal#12938, #10854, #9705: levels that are heights of samples.
#[test]
fn a3_levels_that_are_heights_of_samples() {
    let place = Place::new();
    let grid = |rows: &str| ascii([3, 3], [0.0, 0.0], 1.0, "", rows);
    place.write("a.asc", grid("3 3 3\n2 2 2\n1 1 1\n"));
    place.write("b.asc", grid("3.0000001 3.0000001 3.0000001\n2.0000001 2.0000001 2.0000001\n1.0000001 1.0000001 1.0000001\n"));
    place.write("c.asc", grid("2 2 2\n2 2 2\n2 2 2\n"));
    for (name, expected) in [("a.asc", &[2.0, 3.0][..]), ("b.asc", &[2.0, 3.0]), ("c.asc", &[])] {
        let args = ["contour", name, "-o", "o.geojson", "--levels", "1,2,3", "--overwrite"];
        place.ok(&args);
        let made = json(&String::from_utf8(place.bytes("o.geojson")).unwrap());
        let mut levels: Vec<f64> = made["features"]
            .as_array()
            .unwrap()
            .iter()
            .map(|line| line["properties"]["elev"].as_f64().unwrap())
            .collect();
        levels.sort_by(f64::total_cmp);
        assert_eq!(levels, expected, "{name}");
    }
}

/// GDAL 3.9.1: a nodata value that is no number beside whole numbers.
#[test]
fn a4_nodata_that_is_no_number_in_text_of_whole_numbers() {
    let rows = |void: &str| format!("1 2 3 4\n5 {void} 7 8\n9 10 {void} 12\n13 14 15 16\n");
    for (header, body) in [
        ("nan", "nan"),
        ("nan", "NaN"),
        ("1.#QNAN", "1.#QNAN"),
        ("-9999", "-9999.0"),
        ("-9999.0", "-9999"),
        ("-9999", "nan"),
    ] {
        let place = Place::new();
        let more = format!("NODATA_value {header}\n");
        place.write("a.asc", ascii([4, 4], [0.0, 0.0], 1.0, &more, &rows(body)));
        let expected: Vec<f64> = (0..16)
            .map(|k| if [5, 10].contains(&k) { f64::NAN } else { f64::from(k + 1) })
            .collect();
        assert!(same(&heights(&place, "a.asc"), &expected), "{header} {body}");
        for name in ["o.tif", "o.asc", "o.flt"] {
            let ran = place.run(&["convert", "a.asc", name, "--out-nodata", "-1"]);
            assert_eq!(ran.code, 0, "{header} {body} {name}: {}", ran.err);
            assert!(same(&heights(&place, name), &expected), "{header} {body} {name}");
        }
        place.ok(&["convert", "a.asc", "own.tif"]);
        assert!(same(&heights(&place, "own.tif"), &expected), "{header} {body}");
    }
}

/// libtiff, GDAL 3.10.1: the predictor of floats in the other byte order.
#[test]
fn a5_predicted_floats_of_either_byte_order_are_the_same() {
    let height =
        |col: usize, row: usize, _: usize| ((col * 37 + row * 91) % 173) as f64 * 0.37 - 11.3;
    for (bits, predictor) in [(32, 3), (64, 3), (16, 3), (32, 2), (64, 2)] {
        for (tile, strips) in [(Some((32, 16)), 1), (None, 7), (None, 16)] {
            for compression in [5, 8, 50_000] {
                let place = Place::new();
                for (name, big_endian, big_tiff) in
                    [("ii.tif", false, false), ("mm.tif", true, false), ("big.tif", true, true)]
                {
                    let mut spec = Spec::new(53, 45, 3, bits);
                    (spec.big_endian, spec.big_tiff, spec.tile) = (big_endian, big_tiff, tile);
                    (spec.rows_per_strip, spec.compression) = (strips, compression);
                    spec.predictor = predictor;
                    place.write(name, spec.build(height));
                }
                let twin = heights(&place, "ii.tif");
                for name in ["mm.tif", "big.tif"] {
                    assert!(
                        same(&twin, &heights(&place, name)),
                        "{bits} {predictor} {tile:?} {name}"
                    );
                }
                let wide = height(52, 44, 0);
                let last = match bits {
                    16 => half::f16::from_f64(wide).to_f64(),
                    32 => f64::from(wide as f32),
                    _ => wide,
                };
                assert_eq!(twin.last(), Some(&last));
            }
        }
    }
}

/// OSGeo/gdal#14353: not-a-number as nodata, and between valid samples, when a grid is resampled.
#[test]
fn a8_not_a_number_spreads_no_further_than_a_void() {
    const SIDE: usize = 41;
    let is_hole = |col: usize, row: usize| {
        (col * 13 + row * 7).is_multiple_of(29)
            || [0, SIDE - 1].contains(&col)
            || [0, SIDE - 1].contains(&row)
    };
    for method in ["near", "bilinear", "cubic"] {
        for resolution in ["5", "37"] {
            let made = ["nan", "-9999"].map(|nodata| {
                let place = Place::new();
                let mut spec = Spec::new(SIDE, SIDE, 3, 32);
                spec.extra = placed([10.0, 10.0], [5e5, 5e6]);
                spec.extra.push((GDAL_NODATA, Value::Text(nodata.to_owned())));
                place.write(
                    "a.tif",
                    spec.build(|col, row, _| match (is_hole(col, row), nodata) {
                        // Infinite, too, is void.
                        (true, "nan") if (col, row) == (29, 0) => f64::INFINITY,
                        (true, "nan") => f64::NAN,
                        (true, _) => -9999.0,
                        (false, _) => (col * 3 + row) as f64,
                    }),
                );
                place.ok(&[
                    "convert",
                    "a.tif",
                    "o.tif",
                    "--resampling",
                    method,
                    "--resolution",
                    resolution,
                ]);
                let grid = open_band(&place.path("o.tif"), 1).unwrap();
                (
                    read_all(grid.as_ref()).unwrap(),
                    grid.info().transform,
                    grid.info().width as usize,
                )
            });
            assert!(same(&made[0].0, &made[1].0), "{method} {resolution}");
            let (found, map, width) = &made[0];
            for (k, z) in found.iter().enumerate() {
                let [x, y] = map.apply((k % width) as f64, (k / width) as f64);
                let [col, row] = [(x - 5e5) / 10.0 - 0.5, (5e6 - y) / 10.0 - 0.5];
                let between = |at: f64| (at - at.floor() - 0.5).abs() < 1e-6;
                if between(col) || between(row) {
                    continue; // Two samples are as near.
                }
                let [col, row] = [col.round(), row.round()];
                let is_inside =
                    (0.0..SIDE as f64).contains(&col) && (0.0..SIDE as f64).contains(&row);
                let is_void = !is_inside || is_hole(col as usize, row as usize);
                assert_eq!(z.is_nan(), is_void, "{method} {resolution} at {col} {row}");
            }
        }
    }
}

/// OSGeo/gdal#15178: half a degree around the whole globe, from 0 to 360.
#[test]
fn a10_longitudes_from_0_to_360() {
    const COLUMNS: usize = 720;
    // A height that tells the longitude, modulo 360, by a sine.
    let row = |west: f64| {
        let height = |col: usize| {
            let longitude = west + 0.5 * (col as f64 + 0.5);
            format!("{:.6}", 100.0 * longitude.to_radians().sin() + 200.0)
        };
        (0..COLUMNS).map(height).collect::<Vec<_>>().join(" ")
    };
    for west in [0.0, 0.25, -0.25] {
        let place = Place::new();
        let rows = format!("{0}\n{0}\n{0}\n", row(west));
        place.write("a.asc", ascii([COLUMNS, 3], [west, -0.5], 0.5, "", &rows));
        place.write("a.prj", GLOBE);
        place.ok(&["tin", "a.asc", "a.ply", "--max-error", "2", "-q"]);
        place.ok(&["verify", "a.ply", "a.asc"]);
        let beyond =
            place.run(&["tin", "a.asc", "b.ply", "--max-error", "2", "--bbox", "350,-1,400,1"]);
        assert!([0, 2, 65].contains(&beyond.code), "{}", beyond.err);
        for (args, out) in [
            (vec!["tiles", "a.asc", "t", "--max-level", "3"], "t"),
            (
                vec![
                    "convert",
                    "a.asc",
                    "m.tif",
                    "--to-crs",
                    "EPSG:3857",
                    "--resampling",
                    "bilinear",
                ],
                "m.tif",
            ),
        ] {
            let ran = place.run(&args);
            match ran.code {
                0 => {}
                _ => {
                    assert!(ran.code == 65 || ran.code == 2, "{west} {args:?}: {}", ran.err);
                    assert!(
                        ["180", "beyond", "outside the domain"].iter().any(|w| ran.err.contains(w)),
                        "{west}: {}",
                        ran.err
                    );
                    assert!(!place.path(out).exists(), "nothing is half made");
                }
            }
        }
        // Where it is written, the place of each sample is right.
        if place.path("m.tif").exists() {
            let grid = open_band(&place.path("m.tif"), 1).unwrap();
            let found = read_all(grid.as_ref()).unwrap();
            let width = grid.info().width as usize;
            let odd = found.iter().enumerate().filter(|(_, z)| z.is_finite()).filter(|(k, z)| {
                let [x, _] = grid.info().transform.apply((k % width) as f64, (k / width) as f64);
                let longitude = x / 6_378_137.0;
                (100.0 * longitude.sin() + 200.0 - **z).abs() > 1.0
            });
            assert_eq!(odd.count(), 0, "{west}");
        }
    }
}

const GLOBE: &str = r#"GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]]"#;

/// PDAL#2292: cells of 5e-6 degrees are far from what doubles hold, and are no trouble.
#[test]
fn spare_cells_of_half_a_metre_in_degrees() {
    let place = Place::new();
    let rows: String = (0..100)
        .map(|row| {
            (0..1000)
                .map(|col| ((col * 7 + row * 3) % 40).to_string())
                .collect::<Vec<_>>()
                .join(" ")
                + "\n"
        })
        .collect();
    place.write("a.asc", ascii([1000, 100], [7.123_456, 45.654_321], 5e-6, "", &rows));
    place.write("a.prj", GLOBE);
    place.ok(&["tin", "a.asc", "a.ply", "--max-error", "5", "-q"]);
    place.ok(&["verify", "a.ply", "a.asc"]);
    let grid = open(place.path("a.asc").to_str().unwrap(), &GridOpenOptions::default()).unwrap();
    assert_eq!((grid.info().width, grid.info().height), (1000, 100));
}

/// OSGeo/gdal#13416: one file of a mosaic has the south above.
#[test]
fn spare_a_file_with_the_south_above_in_a_mosaic() {
    let place = Place::new();
    let write = |name: &str, south_up: bool, west: f64| {
        let mut spec = Spec::new(8, 6, 3, 32);
        let (north, e) = if south_up { (4_999_940.0, 10.0) } else { (5e6, -10.0) };
        spec.extra = mapped(32_632, [west, 10.0, 0.0, north, 0.0, e]);
        place.write(
            name,
            spec.build(|col, row, _| {
                let row = if south_up { 5 - row } else { row };
                (west - 5e5) / 10.0 + col as f64 + 100.0 * row as f64
            }),
        );
    };
    write("a.tif", false, 5e5);
    write("b.tif", true, 500_080.0);
    let inputs = ["a.tif", "b.tif"].map(|name| place.path(name).display().to_string());
    match open_all(&inputs, &GridOpenOptions::default()) {
        // Each sample in its place, or a refusal that tells what would mend it.
        Ok(grid) => {
            let found = read_all(grid.as_ref()).unwrap();
            let right = |k: usize| (k % 16) as f64 + 100.0 * (k / 16) as f64;
            assert!((0..found.len()).all(|k| found[k] == right(k)), "{found:?}");
        }
        Err(error) => {
            let told = error.to_string();
            assert!(told.contains("b.tif") && told.contains("resampling"), "{told}");
        }
    }
}
