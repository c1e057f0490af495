//! `terrane slope` and the like: the same bytes however they are made, on any lattice, refused by name.

use crate::cli_support::{Place, json};

const VERBS: [&str; 7] = ["slope", "aspect", "hillshade", "curvature", "roughness", "tpi", "tri"];

/// Values of a grid, row by row, and its columns.
pub(crate) fn values(place: &Place, name: &str) -> (usize, Vec<f64>) {
    let ascii = format!("{name}.values.asc");
    place.ok(&["convert", name, &ascii, "--overwrite", "-q"]);
    let text = String::from_utf8(place.bytes(&ascii)).unwrap();
    let columns = text.split_whitespace().nth(1).unwrap().parse().unwrap();
    let nodata = text
        .lines()
        .find_map(|line| line.to_lowercase().strip_prefix("nodata_value").map(str::to_owned));
    let nodata: Option<f64> = nodata.map(|value| value.trim().parse().unwrap());
    let rows =
        text.lines().filter(|line| line.starts_with(|c: char| c == '-' || c.is_ascii_digit()));
    let number = |word: &str| word.parse::<f64>().unwrap();
    let all = rows.flat_map(|row| row.split_whitespace().map(number));
    (columns, all.map(|z| if Some(z) == nodata { f64::NAN } else { z }).collect())
}

#[test]
fn threads_memory_formats_and_parts_leave_no_trace() {
    let place = Place::new();
    let dem = "synth:salt,size=700,voids=0.001";
    for verb in VERBS {
        let make = |name: &str, more: &[&str]| {
            place.ok(&[&[verb, dem, name, "--overwrite", "-q"][..], more].concat());
        };
        make("one.tif", &["--threads", "1"]);
        make("two.tif", &["--threads", "2", "--memory", "32M"]);
        assert!(place.bytes("one.tif") == place.bytes("two.tif"), "{verb}");
        make("cog.tif", &["-f", "COG", "--co", "BLOCKSIZE=128", "--co", "OVERVIEWS=NONE"]);
        let whole = values(&place, "one.tif");
        let same = |a: &[f64], b: &[f64]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
        };
        assert!(same(&whole.1, &values(&place, "cog.tif").1), "{verb}");
        // A part of the grid has a border of its own, and the same within.
        make("part.tif", &["--bbox", "500600,4746500,502000,4748000"]);
        let info = json(&place.ok(&["info", "part.tif", "--json"]).out);
        let [width, height] = ["width", "height"].map(|key| info[key].as_u64().unwrap() as usize);
        place.ok(&[
            "convert",
            "one.tif",
            "cut.tif",
            "--bbox",
            "500600,4746500,502000,4748000",
            "--overwrite",
            "-q",
        ]);
        let (part, cut) = (values(&place, "part.tif").1, values(&place, "cut.tif").1);
        let mut inner = 0;
        for i in 0..width * height {
            let is_edge =
                [0, width - 1].contains(&(i % width)) || [0, height - 1].contains(&(i / width));
            match is_edge {
                true => assert!(part[i].is_nan(), "{verb}"),
                false => {
                    inner += usize::from(!part[i].is_nan());
                    assert!(part[i] == cut[i] || part[i].is_nan() && cut[i].is_nan(), "{verb} {i}");
                }
            }
        }
        assert!(inner > 10_000, "{verb}");
        make("edges.tif", &["--compute-edges"]);
        let edges = values(&place, "edges.tif").1;
        let count = |values: &[f64]| values.iter().filter(|z| !z.is_nan()).count();
        assert!(count(&edges) > 489_000 && count(&whole.1) < 486_500, "{verb} {}", count(&edges));
    }
}

/// A plane is as steep in degrees as in metres, with the south above, in feet.
#[test]
fn slopes_are_in_metres_whatever_the_grid_is_in() {
    let place = Place::new();
    let plane = |name: &str, system: &str, [x, y, cell]: [f64; 3], by: [f64; 2]| {
        let row = |row: usize| {
            (0..30).map(move |col| (by[0] * col as f64 - by[1] * row as f64).to_string())
        };
        let rows: Vec<_> = (0..20).map(|r| row(r).collect::<Vec<_>>().join(" ")).collect();
        let head = format!(
            "ncols 30\nnrows 20\nxllcenter {x}\nyllcenter {y}\ncellsize {cell}\nNODATA_value -99999\n"
        );
        place.write(format!("{name}.asc").as_str(), format!("{head}{}\n", rows.join("\n")));
        place.write(format!("{name}.prj").as_str(), system);
    };
    // A degree is 111.1 km north at 46 degrees, and 77.5 km east.
    plane("degrees", "EPSG:4326", [7.0, 46.0, 0.001], [77.5, 111.1 / 2.0]);
    plane("metres", "EPSG:32631", [500_000.0, 5e6, 20.0], [20.0, 10.0]);
    plane("feet", "EPSG:2263", [900_000.0, 200_000.0, 20.0], [20.0, 10.0]);
    let slope = (1.0_f64 + 0.25).sqrt().atan().to_degrees();
    // It rises to the east and north.
    let aspect = 180.0 + 2.0_f64.atan().to_degrees();
    for name in ["degrees", "metres", "feet"] {
        let dem = format!("{name}.asc");
        place.ok(&["slope", &dem, "slope.tif", "--overwrite", "-q"]);
        place.ok(&["aspect", &dem, "aspect.tif", "--overwrite", "-q"]);
        for (file, expected) in [("slope.tif", slope), ("aspect.tif", aspect)] {
            let (columns, values) = values(&place, file);
            let middle = values[10 * columns + 15];
            assert!((middle - expected).abs() < 0.3, "{name} {file}: {middle}, {expected}");
        }
    }
    // Only differences of heights are in their unit.
    for verb in VERBS {
        place.ok(&[verb, "synth:rough,size=30", "u.tif", "--overwrite", "-q"]);
        let info =
            String::from_utf8(place.command(&["info", "u.tif"]).output().unwrap().stdout).unwrap();
        let is_height = ["roughness", "tpi", "tri"].contains(&verb);
        let unit =
            info.lines().find_map(|line| line.trim().strip_prefix("vertical")).map(str::trim);
        assert_eq!(unit == Some("metre"), is_height, "{verb}: {info}");
        assert!(info.contains("EPSG:32631"), "{verb}: {info}");
    }
    // As gdaldem -s has it.
    place.ok(&["slope", "metres.asc", "slope.tif", "--scale", "2", "--overwrite", "-q"]);
    let (columns, values) = values(&place, "slope.tif");
    let expected = ((1.0_f64 + 0.25).sqrt() / 2.0).atan().to_degrees();
    assert!((values[10 * columns + 15] - expected).abs() < 1e-4);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let place = Place::new();
    let dem = "synth:rough,size=60";
    place.ok(&["tin", dem, "m.ply", "--max-error", "5", "-q"]);
    for verb in VERBS {
        place.fails(&[verb, "none.tif", "o.tif"], 65, &["none.tif"]);
        place.fails(&[verb, dem, "o.none"], 2, &["o.none"]);
        place.ok(&[verb, dem, "o.tif", "--overwrite", "-q"]);
        place.fails(&[verb, dem, "o.tif"], 2, &["o.tif", "exists"]);
        place.fails(&[verb, dem, "-"], 2, &["stdout"]);
    }
    place.fails(
        &["hillshade", dem, "p.tif", "--multidirectional", "--combined"],
        2,
        &["--combined"],
    );
    place.fails(
        &["hillshade", dem, "p.tif", "--multidirectional", "--azimuth", "3"],
        2,
        &["--azimuth"],
    );
    place.fails(&["hillshade", dem, "p.tif", "--altitude", "91"], 2, &["--altitude"]);
    place.fails(&["slope", dem, "p.tif", "--scale", "0"], 2, &["--scale"]);
    for verb in ["roughness", "tpi", "tri"] {
        place.fails(&[verb, dem, "p.tif", "--scale", "2"], 2, &["--scale is for slopes", verb]);
    }
    place.fails(&["slope", "m.ply", "p.tif"], 65, &["m.ply"]);
}
