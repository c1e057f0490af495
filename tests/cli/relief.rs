//! `terrane slope` and the like: the same bytes however they are made, on any lattice, refused by name.

use crate::cli_support::{Place, json};
use crate::tiff_builder::{Spec, Value};

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
        place.fails(&[verb, dem, "p.tif", "--scale", "2"], 2, &["--scale", verb]);
    }
    place.fails(&["slope", "m.ply", "p.tif"], 65, &["m.ply"]);
}

/// The pixels of a picture in gray, and its bytes for each.
fn gray(place: &Place, name: &str) -> (Vec<u16>, usize) {
    let bytes = place.bytes(name);
    let mut reader = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(frame.color_type, ::png::ColorType::Grayscale, "{name}");
    match frame.bit_depth {
        ::png::BitDepth::Eight => (pixels.iter().map(|byte| u16::from(*byte)).collect(), 1),
        _ => (pixels.as_chunks::<2>().0.iter().map(|b| u16::from_be_bytes(*b)).collect(), 2),
    }
}

#[test]
fn a_png_is_a_picture_in_grays_that_stand_for_the_values() {
    let place = Place::new();
    let dem = "synth:salt,size=65,voids=0.01";
    for verb in VERBS {
        place.ok(&[verb, dem, "o.tif", "--overwrite", "-q"]);
        let (_, expected) = values(&place, "o.tif");
        // Text has the digits of single precision.
        let expected: Vec<f64> = expected.iter().map(|z| f64::from(*z as f32)).collect();
        let ran = place.ok(&[verb, dem, "o.png", "--overwrite", "--json"]);
        let (found, size) = gray(&place, "o.png");
        let valid = || expected.iter().filter(|z| !z.is_nan());
        let least = valid().fold(f64::INFINITY, |a, b| a.min(*b));
        let most = valid().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        let range = match verb {
            "hillshade" => [1.0, 255.0],
            "slope" => [0.0, 90.0],
            "aspect" => [0.0, 360.0],
            _ => [least, most],
        };
        let white = if verb == "hillshade" { 255.0 } else { 65_535.0 };
        assert_eq!((found.len(), size), (expected.len(), if verb == "hillshade" { 1 } else { 2 }));
        for (pixel, value) in found.iter().zip(&expected) {
            let share = (value - range[0]) / (range[1] - range[0]);
            let wanted = if value.is_nan() { 0.0 } else { (1.0 + share * (white - 1.0)).round() };
            assert_eq!(f64::from(*pixel), wanted, "{verb}: {value}");
        }
        let notes = json(&ran.out)["notes"].to_string();
        assert_eq!(notes.contains("stand for"), verb != "hillshade", "{verb}: {notes}");
        place.ok(&[verb, dem, "two.png", "--overwrite", "-q", "--threads", "2"]);
        assert!(place.bytes("o.png") == place.bytes("two.png"), "{verb}");
        // What is void is transparent, and read so.
        let info = json(&place.ok(&["info", "o.png", "--stats", "--json"]).out);
        assert_eq!(info["stats"]["valid"], valid().count(), "{verb}");
    }
    place.ok(&["hillshade", dem, "p.png", "--co", "ENCODING=TERRARIUM", "-q"]);
    assert_eq!(
        json(&place.ok(&["info", "terrarium:p.png", "--json"]).out)["details"]["heights"],
        "terrarium"
    );
}

/// A geographic system on an ellipsoid, in both kinds of text.
fn bodies(axis: f64, flattening: f64) -> [String; 2] {
    let first = format!(
        r#"GEOGCS["own",DATUM["D_own",SPHEROID["own",{axis},{flattening}]],PRIMEM["Reference_Meridian",0],UNIT["Degree",0.0174532925199433]]"#
    );
    let second = format!(
        r#"GEOGCRS["own",DATUM["own",ELLIPSOID["own",{axis},{flattening},LENGTHUNIT["metre",1]]],PRIMEM["Reference Meridian",0,ANGLEUNIT["degree",0.0174532925199433]],CS[ellipsoidal,2],AXIS["latitude",north,ORDER[1]],AXIS["longitude",east,ORDER[2]],ANGLEUNIT["degree",0.0174532925199433]]"#
    );
    [first, second]
}

/// Tags of a geographic system of its own by keys.
fn keyed(axis: f64, flattening: f64) -> Vec<(u16, Value)> {
    let keys = [
        [1, 1, 0, 6],
        [1024, 0, 1, 2],
        [1025, 0, 1, 1],
        [2048, 0, 1, 32_767],
        [2056, 0, 1, 32_767],
        [2057, 34_736, 1, 0],
        [2059, 34_736, 1, 1],
    ];
    vec![(34_735, Value::Short(keys.concat())), (34_736, Value::Double(vec![axis, flattening]))]
}

#[test]
fn slopes_of_degrees_are_by_the_ellipsoid_of_their_body() {
    for (name, axis, flattening) in [
        ("Moon", 1_737_400.0_f64, 0.0),
        ("Mars", 3_396_190.0, 169.894_447_223_612),
        ("Ceres", 470_000.0, 0.0),
        ("Earth, GRS 80", 6_378_137.0, 298.257_222_101),
        ("Jupiter", 71_492_000.0, 15.414_402_759_810_3),
    ] {
        // A metre up by two metres east, in degrees at the latitude of each row.
        let (cell, north) = (1.0 / 120.0, 46.0_f64);
        let f = if flattening == 0.0 { 0.0 } else { 1.0 / flattening };
        let across = |latitude: f64| {
            let (sine, cosine) = latitude.to_radians().sin_cos();
            (axis / (1.0 - f * (2.0 - f) * sine * sine).sqrt() * cosine).to_radians()
        };
        let mut spec = Spec::new(20, 20, 3, 64);
        spec.extra = vec![
            (33_550, Value::Double(vec![cell, cell, 0.0])),
            (33_922, Value::Double(vec![0.0, 0.0, 0.0, 10.0, north, 0.0])),
        ];
        let height = |col: usize, row: usize, _: usize| {
            let latitude = north - cell * (row as f64 + 0.5);
            0.5 * across(latitude) * cell * (col as f64 - 10.0)
        };
        let plain = spec.build(height);
        spec.extra.extend(keyed(axis, flattening));
        let place = Place::new();
        place
            .write("keys.tif", spec.build(height))
            .write("text.tif", &plain)
            .write("text2.tif", &plain);
        let vrt = |file: &str, system: &str| {
            let system = system.replace('"', "&quot;");
            format!(
                "<VRTDataset rasterXSize=\"20\" rasterYSize=\"20\"><SRS>{system}</SRS>\
                 <GeoTransform>10, {cell}, 0, {north}, 0, -{cell}</GeoTransform>\
                 <VRTRasterBand dataType=\"Float64\" band=\"1\"><SimpleSource><SourceFilename \
                 relativeToVRT=\"1\">{file}</SourceFilename><SourceBand>1</SourceBand></SimpleSource>\
                 </VRTRasterBand></VRTDataset>"
            )
        };
        let [first, second] = bodies(axis, flattening);
        place
            .write("text.vrt", vrt("text.tif", &first))
            .write("text2.vrt", vrt("text2.tif", &second));
        for input in ["keys.tif", "text.vrt", "text2.vrt"] {
            place.ok(&["slope", input, "o.tif", "--overwrite", "-q"]);
            let (columns, slopes) = values(&place, "o.tif");
            let middle = slopes[10 * columns + 10];
            assert!(
                (middle - 0.5_f64.atan().to_degrees()).abs() < 1e-3,
                "{name} {input}: {middle}"
            );
            // A mesh in metres is as large as its body.
            place.ok(&["tin", input, "o.stl", "--max-error", "1", "--overwrite", "-q"]);
            let info = json(&place.ok(&["info", "o.stl", "--json"]).out);
            let scale = info["scale"][0].as_f64().unwrap();
            let expected = across(north - 10.0 * cell);
            assert!((scale / expected - 1.0).abs() < 1e-5, "{name} {input}: {scale} {expected}");
            let lines = [
                "contour",
                input,
                "-o",
                "o.wkt",
                "--interval",
                "50",
                "--tolerance",
                "20m",
                "--overwrite",
            ];
            match name.starts_with("Earth") {
                true => assert_eq!(place.run(&lines).code, 0),
                false => {
                    assert!(place.run(&lines).err.contains("body other than the Earth"), "{name}")
                }
            }
        }
    }
}

#[test]
fn an_ellipsoid_that_is_told_and_not_known_is_refused() {
    let place = Place::new();
    let mut spec = Spec::new(20, 20, 3, 64);
    spec.extra = vec![
        (33_550, Value::Double(vec![0.01, 0.01, 0.0])),
        (33_922, Value::Double(vec![0.0, 0.0, 0.0, 10.0, 46.0, 0.0])),
    ];
    let with = |keys: Vec<[u16; 4]>| {
        let mut spec = spec.clone();
        spec.extra.push((34_735, Value::Short(keys.concat())));
        spec.build(|col, row, _| (col + row) as f64)
    };
    place.write("own.tif", with(vec![[1, 1, 0, 2], [1024, 0, 1, 2], [2048, 0, 1, 32_767]]));
    place.write("degrees.tif", with(vec![[1, 1, 0, 2], [1024, 0, 1, 2], [2054, 0, 1, 9102]]));
    place.fails(&["slope", "own.tif", "o.tif"], 65, &["ellipsoid", "--scale"]);
    place.fails(&["tin", "own.tif", "o.stl", "--max-error", "1"], 65, &["ellipsoid", "PLY"]);
    place.ok(&["slope", "own.tif", "o.tif", "--scale", "30323", "-q"]);
    place.ok(&["tpi", "own.tif", "p.tif", "-q"]);
    let told =
        json(&place.ok(&["slope", "degrees.tif", "d.tif", "--json"]).out)["notes"].to_string();
    assert!(told.contains("WGS 84 is assumed"), "{told}");
}
