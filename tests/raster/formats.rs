//! Raw grids, PNG, DTED, USGS models, points, NumPy arrays and packed files: values, place, damage.

use std::path::Path;

use crate::raster_support::formats::{
    SIZE, Sample, bil, dted, envi, flt, gzip, height, heights, npy, png, samples, usgs, xyz, zip,
};
use crate::raster_support::{open_band, read_all, read_in_windows, same, write_anew};
use terrane_base::geom::Rect;
use terrane_raster::{GridOpenOptions, GridSource, open};

fn open_sample(folder: &Path, sample: &Sample) -> Box<dyn GridSource> {
    sample.write(folder);
    let name = sample.files[0].0;
    // The heights of the raw sample are in its second band.
    open_band(&folder.join(name), if name == "a.bil" { 2 } else { 1 })
        .unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// What `name` holds at index `i`: gray pictures are raised, some samples are left out.
fn expected(name: &str, i: usize) -> f64 {
    let height = f64::from(heights()[i]);
    let left_out = matches!(name, "a.dem" | "newline.dem" | "a.xyz" | "by_column.csv");
    match name {
        "gray.png" => height + 11.0,
        _ if left_out && i == 4 * SIZE.0 + 1 => f64::NAN,
        _ => height,
    }
}

#[test]
fn every_format_reads_the_grid_whole_and_in_windows() {
    let folder = tempfile::tempdir().unwrap();
    for sample in samples() {
        let name = sample.files[0].0;
        let source = open_sample(folder.path(), &sample);
        let info = source.info();
        assert_eq!((info.width as usize, info.height as usize), SIZE, "{name}");
        let all = read_all(source.as_ref()).unwrap();
        for (i, height) in all.iter().enumerate() {
            assert!(same(*height, expected(name, i)), "{name}, sample {i}: {height}");
        }
        for side in [1, 2, 3, 6] {
            let narrow = read_in_windows(source.as_ref(), side).unwrap();
            assert!(narrow.iter().zip(&all).all(|(n, h)| same(f64::from(*n), *h)), "{name}");
        }
        let outside = Rect::new(3, 3, 5, 2);
        assert!(source.read_f32(outside, &mut [0.0; 10]).is_err(), "{name}");
    }
}

#[test]
fn every_format_is_where_it_says() {
    let folder = tempfile::tempdir().unwrap();
    for sample in samples() {
        let name = sample.files[0].0;
        let source = open_sample(folder.path(), &sample);
        let map = source.info().transform;
        let (place, epsg) = match name {
            "a.bil" | "g.flt" | "gray.png" | "a.xyz" | "by_column.csv" | "a.zip" => {
                ([105.0, 195.0, 10.0, -10.0], None)
            }
            "e.dat" => ([105.0, 195.0, 10.0, -10.0], Some(32633)),
            "a.dem" | "newline.dem" => ([100.0, 190.0, 10.0, -10.0], Some(32633)),
            "a.dt0" | "a.dt0.gz" => {
                ([6.0, 45.0 + 4.0 * 0.025, 600.0 / 36000.0, -0.025], Some(4326))
            }
            _ => ([0.0, 0.0, 1.0, -1.0], None),
        };
        let found = [map.x0, map.y0, map.a, map.e];
        let off = found.iter().zip(place).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12, "{name}: {found:?}");
        assert_eq!(source.info().crs.epsg, epsg, "{name}");
        assert_eq!(source.info().georeferenced, place[2] != 1.0, "{name}");
    }
}

#[test]
fn utm_zones_have_the_code_of_their_datum_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let header = String::from_utf8(envi().files[1].1.clone()).unwrap();
    for (zone, epsg) in [
        ("33, South, WGS-84", Some(32733)),
        ("61, North, WGS-84", None),
        ("23, North, NAD83", Some(26923)),
        // Codes that are of state planes.
        ("29, North, North America 1983", None),
        ("29, South, North America 1983", None),
        ("22, North, North America 1927", Some(26722)),
        ("23, North, NAD27", None),
    ] {
        let text = header.replace("33, North, WGS-84", zone);
        write_anew(&folder.path().join("e.dat.hdr"), text.as_bytes());
        write_anew(&folder.path().join("e.dat"), &envi().files[0].1);
        let grid = open_band(&folder.path().join("e.dat"), 1).unwrap();
        assert_eq!(grid.info().crs.epsg, epsg, "{zone}");
    }
    for (datum, zone, epsg) in [
        (1, 22, Some(26722)),
        (1, 23, None),
        (2, 33, Some(32233)),
        (2, -33, Some(32333)),
        (3, -33, Some(32733)),
        (4, 23, Some(26923)),
        (4, 29, None),
        (4, -13, None),
    ] {
        let mut model = usgs("");
        model[162..168].copy_from_slice(format!("{zone:6}").as_bytes());
        model[890..892].copy_from_slice(format!("{datum:2}").as_bytes());
        write_anew(&folder.path().join("a.dem"), &model);
        let grid = open_band(&folder.path().join("a.dem"), 1).unwrap();
        assert_eq!(grid.info().crs.epsg, epsg, "datum {datum}, zone {zone}");
    }
}

/// The message for a file of this name and content, with others beside it.
fn refusal(name: &str, bytes: &[u8], beside: &[(&str, &[u8])]) -> String {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in beside {
        write_anew(&folder.path().join(name), bytes);
    }
    write_anew(&folder.path().join(name), bytes);
    match open_band(&folder.path().join(name), 1) {
        Ok(source) => panic!("{name} was opened: {:?}", source.info()),
        Err(error) => error.to_string(),
    }
}

fn check_refusal(name: &str, bytes: &[u8], beside: &[(&str, &[u8])], expected: &str) {
    let text = refusal(name, bytes, beside);
    assert!(text.contains(expected) && !text.contains('\n'), "{name}: {text}");
}

#[test]
fn raw_headers_that_lie() {
    let data = bil().files[0].1.clone();
    let header = String::from_utf8(bil().files[1].1.clone()).unwrap();
    let check = |from: &str, to: &str, expected: &str| {
        assert!(header.contains(from));
        let lie = header.replace(from, to);
        check_refusal("a.bil", &data, &[("a.hdr", lie.as_bytes())], expected);
    };
    check("NROWS 5", "NROWS 6", "183 bytes, expected 213");
    check("NROWS 5\n", "", "header lacks nrows");
    check("NCOLS 7", "NCOLS 9999999999", "ncols (9999999999) exceeds the limit of 1073741824");
    check("NCOLS 7", "NCOLS 0", "ncols is 0, expected a positive integer");
    check("NCOLS 7", "NCOLS 9", "BANDROWBYTES is 16, less than the 18 bytes of a row");
    check("NBITS 16", "NBITS 12", "12-bit integer samples are not supported");
    check("NBANDS 2", "NBANDS 70000", "nbands (70000) exceeds the limit");
    check("SKIPBYTES 3", "SKIPBYTES 18446744073709551615", "expected more than 2^64");
    check("TOTALROWBYTES 36", "TOTALROWBYTES 9e18", "expected an integer");
    check("LAYOUT BIL", "LAYOUT TILED", "layout TILED is not supported");
    check("BYTEORDER M", "BYTEORDER VAX", "byte order VAX is not supported");
    check("BYTEORDER M", "", "header lacks BYTEORDER, and defaults differ");
    check("SIGNEDINT", "COMPLEX", "pixel type COMPLEX is not supported");
    check("XDIM 10", "XDIM -10", "cell size or position");
    check("XDIM 10", "XDIM ten", "\"ten\", expected a number");
    check_refusal("a.bil", &data, &[], "without a header file");
    check_refusal("a.hdr", header.as_bytes(), &[("a.bil", &data)], "a.bil");
}

#[test]
fn envi_headers_that_lie() {
    let (data, header) = (vec![0; 72], "ENVI\nsamples = 7\nlines = 5\ndata type = 2\n");
    let check = |more: &str, expected: &str| {
        let text = format!("{header}{more}\n");
        check_refusal("e.img", &data, &[("e.hdr", text.as_bytes())], expected);
    };
    check("header offset = 3", "72 bytes, expected 73");
    check("bands = 2", "72 bytes, expected 140");
    check("interleave = tile", "interleave tile is not supported");
    check("byte order = 2", "byte order is 2, expected 0 or 1");
    check("file compression = 1", "compressed ENVI files");
    check("map info = {UTM, 1, 1}", "fewer than 7 items");
    check("map info = {UTM, 1, 1, 0, 0, 10, 0}", "invalid cell size");
    check("map info = {UTM, 1, 1, 0, 0, 1, 1, 33, North, WGS-84, rotation=30}", "rotated");
    check("major frame offsets = {4, 0}", "major frame offsets");
    let complex = header.replace("type = 2", "type = 6");
    check_refusal("e.img", &data, &[("e.hdr", complex.as_bytes())], "complex samples");
}

#[test]
fn pictures_that_are_no_grids() {
    let rgb = png(::png::ColorType::Rgb, 8, |_| vec![1, 2, 3]);
    check_refusal("a.png", &rgb, &[], "pass terrarium:");
    let narrow = png(::png::ColorType::Grayscale, 8, |_| vec![1]);
    let cut = &narrow[..narrow.len() - 20];
    check_refusal("a.png", cut, &[], "truncated");
    let mut flipped = narrow.clone();
    flipped[20] ^= 1;
    check_refusal("a.png", &flipped, &[], "damaged PNG");
    let wide = png(::png::ColorType::Rgb, 16, |_| vec![0; 6]);
    check_refusal("terrarium.png", &wide, &[], "16-bit RGB");
    check_refusal(
        "a.png",
        &narrow,
        &[("a.pgw", b"1 2 3")],
        "world file does not contain six numbers",
    );
}

#[test]
fn packed_heights_by_prefix_path_and_alpha() {
    let folder = tempfile::tempdir().unwrap();
    let tile = folder.path().join("10/163");
    std::fs::create_dir_all(&tile).unwrap();
    let path = tile.join("357.png");
    let alpha = |h: i32| if h == height(2, 2) { 0 } else { 255 };
    let rgba = png(::png::ColorType::Rgba, 8, |h| vec![1, 2, (h + 11) as u8, alpha(h)]);
    write_anew(&path, &rgba);
    let read = |mark: &str, nodata| {
        let options = GridOpenOptions { nodata, ..GridOpenOptions::default() };
        let source = open(&format!("{mark}:{}", path.display()), &options).unwrap();
        assert_eq!(source.info().crs.epsg, Some(3857));
        let [west, _, _, north, ..] = source.info().transform.to_gdal();
        assert!((west + 13_658_379.710).abs() < 0.01 && (north - 6_066_042.565).abs() < 0.01);
        read_all(source.as_ref()).unwrap()
    };
    let (mapbox, terrarium) = (read("terrain-rgb", None), read("terrarium", Some(66_048.0)));
    for (i, h) in heights().into_iter().enumerate() {
        let stored = f64::from((1 << 16) + (2 << 8) + (h + 11));
        let void = alpha(h) == 0;
        let expected = |h: f64, void: bool| if void { f64::NAN } else { h };
        assert!(same(mapbox[i], expected(stored * 0.1 - 10_000.0, void)));
        assert!(same(terrarium[i], expected(stored / 256.0 - 32_768.0, void || i == 0)));
    }
}

/// Files of samples as they are, whose lengths their headers tell: what is opened, and what is beside it.
fn exact_files() -> Vec<Sample> {
    let array = |name, bytes| Sample { files: vec![(name, bytes)] };
    let text = |text: &str| text.as_bytes().to_vec();
    let head = "NCOLS 7\nNROWS 5\nBYTEORDER I\nULXMAP 0\nULYMAP 0\nXDIM 1\nYDIM 1\n";
    let with = |name, bytes: usize, more: &str| Sample {
        files: vec![(name, vec![1; bytes]), ("x.hdr", text(&format!("{head}{more}\n")))],
    };
    vec![
        bil(),
        flt(),
        envi(),
        array("a.dt0", dted()),
        array("a.npy", npy("'<i4'", "False", i32::to_le_bytes, false)),
        array("N48W125.hgt", vec![0; 1201 * 1201 * 2]),
        with("x.bsq", 140, "NBANDS 2\nNBITS 16"),
        with("x.bip", 105, "NBANDS 3\nNBITS 8"),
        with("x.bsq", 147, "NBANDS 2\nNBITS 16\nBANDGAPBYTES 7"),
        with("x.bil", 70, "PIXELTYPE SIGNEDINT"),
    ]
}

#[test]
fn bytes_behind_the_last_sample_are_refused() {
    for sample in exact_files() {
        let folder = tempfile::tempdir().unwrap();
        sample.write(folder.path());
        let (name, bytes) = &sample.files[0];
        let path = folder.path().join(name);
        open_band(&path, 1).unwrap_or_else(|e| panic!("{name}: {e}"));
        // Twice as many would be samples twice as wide where the header does not say how wide.
        for more in [1, 2, 35, bytes.len() + 1] {
            write_anew(&path, &[bytes.as_slice(), &vec![0; more]].concat());
            let Err(error) = open_band(&path, 1) else { panic!("{name} with {more} more") };
            let text = error.to_string();
            let stem = name.split('.').next().unwrap();
            assert!(text.contains(&format!("{stem}.")) && !text.contains('\n'), "{text}");
        }
    }
}

#[test]
fn what_fills_up_the_last_row_may_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    bil().write(folder.path());
    let path = folder.path().join("a.bil");
    let bytes = &bil().files[0].1;
    for bytes in [bytes.clone(), bytes[..bytes.len() - 6].to_vec()] {
        write_anew(&path, &bytes);
        assert_eq!(read_all(open_band(&path, 2).unwrap().as_ref()).unwrap()[34], 167.0);
    }
    write_anew(&path, &bytes[..bytes.len() - 3]);
    assert!(open_band(&path, 2).is_err());
}

#[test]
fn a_header_without_the_width_of_samples_goes_by_the_length() {
    use terrane_raster::SampleType;
    let head = "NCOLS 7\nNROWS 5\nBYTEORDER I\nULXMAP 0\nULYMAP 0\nXDIM 1\nYDIM 1\n";
    // What GDAL 3.10 makes of these, but for those with a pixel type, which it takes for bytes.
    for (more, size, kind) in [
        ("", 1, SampleType::U8),
        ("", 2, SampleType::U16),
        ("", 4, SampleType::F32),
        ("NODATA -9999\n", 2, SampleType::I16),
        ("PIXELTYPE SIGNEDINT\n", 2, SampleType::I16),
        ("PIXELTYPE SIGNEDINT\n", 4, SampleType::I32),
        ("PIXELTYPE UNSIGNEDINT\n", 2, SampleType::U16),
        ("PIXELTYPE FLOAT\n", 4, SampleType::F32),
        ("PIXELTYPE FLOAT\n", 8, SampleType::F64),
        ("BANDROWBYTES 14\n", 2, SampleType::U16),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let header = format!("{head}{more}");
        write_anew(&folder.path().join("a.hdr"), header.as_bytes());
        let path = folder.path().join("a.bil");
        write_anew(&path, &vec![1; 35 * size]);
        let grid = open_band(&path, 1).unwrap_or_else(|e| panic!("{more}{size}: {e}"));
        assert_eq!(grid.info().sample_type, kind, "{more}{size}");
        for other in [34, 36, 35 * 3, 35 * size + 1] {
            let beside = [("a.hdr", header.as_bytes())];
            check_refusal("a.bil", &vec![1; other], &beside, "header lacks NBITS");
        }
    }
    // Rows of one length hold samples of either width.
    let either = format!("{head}BANDROWBYTES 20\n");
    check_refusal("a.bil", &[1; 100], &[("a.hdr", either.as_bytes())], "header lacks NBITS");
}

#[test]
fn headers_that_say_two_things_are_refused() {
    for (sample, line, expected) in [
        (bil(), "NBITS 8\n", "conflicting values of nbits"),
        (flt(), "ncols 5\n", "conflicting values of ncols"),
        (envi(), "data type = 4\n", "conflicting values of data type"),
    ] {
        let (name, bytes) = &sample.files[0];
        let (beside, header) = &sample.files[1];
        let header = [header.as_slice(), line.as_bytes()].concat();
        check_refusal(name, bytes, &[(*beside, &header)], expected);
    }
}

#[test]
fn headers_with_many_lines_take_no_longer_than_they_are_long() {
    // With all keys compared to all others, or lists gone through again for each line: minutes.
    let many = |line: &dyn Fn(u32) -> String| (0..80_000).map(line).collect::<String>();
    let lists = "wavelength = {\n".to_owned() + &many(&|i| format!("{i},\n")) + "}\n";
    let started = std::time::Instant::now();
    for (sample, lines) in [
        (flt(), many(&|i| format!("key{i} 1\n"))),
        (envi(), many(&|i| format!("k{i} = 1\n"))),
        (envi(), lists),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (name, bytes) = &sample.files[0];
        let (beside, header) = &sample.files[1];
        write_anew(&folder.path().join(beside), &[header.as_slice(), lines.as_bytes()].concat());
        let path = folder.path().join(name);
        write_anew(&path, bytes);
        open_band(&path, 1).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    assert!(started.elapsed().as_secs() < 10, "{:?}", started.elapsed());
}

/// What must not be in a line of "2 1 6": the line instead, and the line that is to be named.
const BAD_LINES: [&str; 14] = [
    "2 1 6 7937 3",
    "2 1 6 7",
    "2 1",
    "2 1 6\r1",
    "2 1\r6",
    "2\r1 6",
    "2 1 \"89.32",
    "2 1 89.32\"",
    "2 1 8\"9",
    "2 1 6e999",
    "2 1 -6e999",
    "2 1e999 6",
    "2 1 6\u{b}1",
    "2 1 0x6",
];

#[test]
fn every_line_of_points_is_like_the_first() {
    for (separator, ending) in [(" ", "xyz"), (",", "csv"), (";", "txt"), ("\t", "xyz")] {
        for bad in BAD_LINES {
            for heading in ["", "x y z\n"] {
                let text = format!("{heading}1 1 5\n{bad}\n1 2 7\n2 2 8\n").replace(' ', separator);
                let line = if heading.is_empty() { "line 2: " } else { "line 3: " };
                check_refusal(&format!("a.{ending}"), text.as_bytes(), &[], line);
            }
        }
    }
    // Others may follow, in every line.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xyz");
    write_anew(&path, b"1 1 5 9 9\n2 1 6 9 9\n1 2 7 9 9\n2 2 \"8\" 9 x\n");
    assert_eq!(read_all(open_band(&path, 1).unwrap().as_ref()).unwrap(), [5.0, 6.0, 7.0, 8.0]);
    // Beyond what 32 bits hold, and what is said to be infinite.
    write_anew(&path, b"1 1 5.5\n2 1 1e39\n1 2 inf\n2 2 nan\n");
    let found = read_all(open_band(&path, 1).unwrap().as_ref()).unwrap();
    assert!(found[..2] == [5.5, 1e39] && found[2].is_nan() && found[3].is_nan(), "{found:?}");
}

#[test]
fn every_line_of_a_text_cloud_is_like_the_first() {
    let folder = tempfile::tempdir().unwrap();
    for (separator, ending) in [(" ", "xyz"), (",", "csv"), (";", "txt")] {
        for bad in BAD_LINES {
            let text = format!("1 1 5\n{bad}\n1 2 7\n2 2 8\n").replace(' ', separator);
            let path = folder.path().join(format!("a.{ending}"));
            write_anew(&path, text.as_bytes());
            let options = terrane_cloud::CloudOpenOptions::default();
            let name = path.to_str().unwrap().to_owned();
            let Err(error) = terrane_cloud::open(&[name], &options) else { panic!("{text:?}") };
            let told = error.to_string();
            assert!(told.contains("line 2") && told.contains(ending), "{text:?}: {told}");
        }
    }
}

#[test]
fn cells_with_damage() {
    let check = |at: usize, byte: u8, expected: &str| {
        let mut bytes = dted();
        bytes[at] = byte;
        check_refusal("a.dt0", &bytes, &[], expected);
    };
    let (data, record) = (80 + 648 + 2700, 8 + 10 + 4);
    check(data + 2 * record + 9, 77, "column 3: checksum is");
    check(data + record, 0, "column 2: sentinel 0xAA is missing");
    check(50, b'9', "9 columns need 3626 bytes, found 3582");
    check(47, b'x', "longitude lines is not an integer");
    check(11, b'Q', "invalid origin longitude");
    let cut = &dted()[..data + 3 * record];
    check_refusal("a.dt0", cut, &[], "7 columns need 3582 bytes, found 3494");
    check_refusal("a.dt0", &dted()[..100], &[], "truncated");
    // The same three columns, said to be part of a cell: the others are void.
    let folder = tempfile::tempdir().unwrap();
    let mut partial = cut.to_vec();
    partial[80 + 289..80 + 291].copy_from_slice(b"42");
    let path = folder.path().join("p.dt0");
    write_anew(&path, &partial);
    let read = read_all(open_band(&path, 1).unwrap().as_ref()).unwrap();
    assert!((0..read.len()).all(|i| read[i].is_nan() == (i % SIZE.0 > 2)));
}

#[test]
fn models_that_lie() {
    let text = String::from_utf8(usgs("")).unwrap();
    let check = |from: &str, to: &str, expected: &str| {
        assert!(text.contains(from), "{from}");
        check_refusal("a.dem", text.replacen(from, to, 1).as_bytes(), &[], expected);
    };
    check("     1     7 ", "     1 99999 ", "99999 profiles need");
    check("     1     3     5", "     1     4     5", "profile 3 of 7: profile number is 4");
    check("     1     3     5", "     1     3   500", "500 x 1 heights declared");
    check("110.000000D+00", "111.000000D+00", "profile 2 of 7: x is 111");
    check(
        "110.000000D+00          160",
        "110.000000D+00          360",
        "4 heights from y 360 upwards exceed the grid of 5 rows",
    );
    check("        10.0", "         0.0", "must be above 0");
    check("        10.0", "      1D-300", "x is 110, expected 100");
    check_refusal("a.dem", &usgs("")[..5000], &[], "profile 5 of 7: file is truncated");
    // Without its last character a height would be another number.
    let last = 1024 * 7 + 144 + 6 * SIZE.1;
    check_refusal("a.dem", &usgs("")[..last - 1], &[], "profile 7 of 7: file is truncated");
    check_refusal("a.dem", b"hello", &[], "expected a first record of 1024 bytes");
    let more = [usgs(""), vec![b'7'; 1027]].concat();
    check_refusal("a.dem", &more, &[], "extra bytes after the last profile");
}

#[test]
fn points_that_make_no_grid() {
    let check = |text: &str, expected: &str| check_refusal("a.xyz", text.as_bytes(), &[], expected);
    check("0 0 1\n1 1 2\n", "line 2: the first two points share neither x nor y");
    check("0 0 1\n1 0 2\n", "spacing of y cannot be determined");
    check("0 1 1\n1 1 2\n1.4 1 3\n2 1 3\n0 0 1\n", "line 2: x 1 is off the grid of spacing 0.4");
    check("0 1 1\n1 1 2\n0 0 3\n0 0 4\n", "line 4: duplicate of the previous point");
    check("0 1 1\n1 1 2\n0 0 3\n1 0 4\n0 1 3\n", "line 5: point returns to an earlier row");
    check("0 1 1\n1 1 2\n1e10 0 3\n", "exceeds the limit");
    check("0 1 1\n1 1 2\n9999 0 3\n", "are too sparse for a grid");
    check("0 1 1\n1 1 two\n", "line 2: \"two\" is not a valid number");
    check("0 1 1\n1 1\n", "line 2: 2 values, expected");
    check(&format!("0 1 1{}\n", " ".repeat(5000)), "line exceeds 4096 bytes");
    check("\n\n", "cannot be determined");
}

#[test]
fn points_from_south_to_north_keep_their_rows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("up.txt");
    write_anew(&path, b"10,5 1 1\n11,5 1 2,5\n10,5 3 3\n11,5 3 nan\n");
    let source = open_band(&path, 1).unwrap();
    let map = source.info().transform;
    assert_eq!((map.x0, map.a, map.y0, map.e), (10.5, 1.0, 1.0, 2.0));
    let read = read_all(source.as_ref()).unwrap();
    assert!(read.iter().zip([1.0, 2.5, 3.0, f64::NAN]).all(|(a, b)| same(*a, b)), "{read:?}");
}

#[test]
fn arrays_that_are_no_grids() {
    let array = |descr: &str, order: &str| npy(descr, order, i32::to_le_bytes, false);
    let check = |bytes: &[u8], expected: &str| check_refusal("a.npy", bytes, &[], expected);
    check(&array("'<f8'", "False"), "268 bytes, expected 408");
    check(&array("'|b1'", "False"), "boolean arrays are not supported");
    check(&array("'<i8'", "False"), "arrays of type i8");
    check(&array("[('a', '<f4')]", "False"), "structured arrays");
    check(&array("'<i4'", "Maybe"), "neither True nor False");
    let text = |from: &str, to: &str| {
        let bytes = array("'<i4'", "False");
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
    };
    check(&text("(5, 7), ", "(5, 7,1)"), "arrays of 3 dimensions");
    check(&text("(5, 7), ", "(0, 7), "), "array is empty");
    check(&text("(5, 7), }    ", "(9999999999,7"), "shape");
    check(&text("(5, 7), }     ", "(9999999999,7)"), "rows (9999999999) exceeds the limit");
    check(&array("'<i4'", "False")[..9], "its header is not complete");
    check(b"\x93NUMPY\x07\x00\x00\x00", "version 7");
}

#[test]
fn packed_files_that_lie() {
    let data = xyz(" ", false);
    let cut = gzip(&data);
    check_refusal("a.xyz.gz", &cut[..cut.len() / 2], &[], "damaged gzip file");
    let mut flipped = gzip(&data);
    let end = flipped.len() - 6;
    flipped[end] ^= 1;
    check_refusal("a.xyz.gz", &flipped, &[], "damaged gzip file");
    check_refusal("a.xyz.gz", &gzip(&gzip(&data)), &[], "is compressed twice");
    check_refusal("a.md.gz", &gzip(b"hello"), &[], "a.md.gz: is not a raster file");
    let two = zip(&[("a.xyz", &data), ("b.xyz", &data)]);
    check_refusal("a.zip", &two, &[], "zip archive contains 2 grids (a.xyz, b.xyz");
    check_refusal("a.zip", &zip(&[("a.md", &data)]), &[], "contains no grid of a known format");
    let lonely = zip(&[("../a.flt", &data)]);
    check_refusal("a.zip", &lonely, &[], "a.zip: raw binary data without a header");
}

#[test]
fn sidecars_lie_beside_the_packed_file_too() {
    let folder = tempfile::tempdir().unwrap();
    let bil = bil();
    write_anew(&folder.path().join("a.bil.gz"), &gzip(&bil.files[0].1));
    write_anew(&folder.path().join("a.hdr"), &bil.files[1].1);
    write_anew(&folder.path().join("a.prj"), b"PROJCS[\"WGS_1984_UTM_Zone_33N\",X[]]");
    let source = open_band(&folder.path().join("a.bil.gz"), 2).unwrap();
    assert_eq!(source.info().crs.epsg, Some(32633));
    let read = read_all(source.as_ref()).unwrap();
    assert!(read.iter().zip(heights()).all(|(a, b)| *a == f64::from(b)));
}

#[test]
fn a_band_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    bil().write(folder.path());
    let error = open_band(&folder.path().join("a.bil"), 3).err().unwrap().to_string();
    assert!(error.contains("the file has 2 bands; pass ‹band› 1 to 2"), "{error}");
}

#[test]
fn an_array_type_of_line_breaks_is_refused_on_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    write_anew(&path, &npy("'<\n4'", "False", i32::to_le_bytes, false));
    let error = open_band(&path, 1).err().unwrap().to_string();
    assert!(error.contains(r"type \n4 are not supported") && !error.contains('\n'), "{error}");
}
