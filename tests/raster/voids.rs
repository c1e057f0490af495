//! What stands for voids: the declared nodata value is the one that samples have, in every type and format;
//! a file's nodata value makes no sample of another file void; masks beside it are told of.

use std::collections::BTreeMap;
use std::path::Path;

use crate::cli_support::{Place, json};
use crate::raster_support::tiff_builder::{Spec, Value};
use crate::raster_support::{open_band, read_all};
use terrane_engine::{Cancel, Silent};
use terrane_raster::{SampleType, write};
use terrane_terrain::convert::{self, ConvertJob};

const SIZE: [usize; 2] = [6, 4];

/// Heights that every type holds, and voids.
fn height(k: usize) -> Option<f64> {
    (!k.is_multiple_of(7)).then_some(k as f64 + 1.0)
}

fn heights() -> Vec<Option<f64>> {
    (0..SIZE[0] * SIZE[1]).map(height).collect()
}

/// A grid of them as text, with this nodata value.
fn text(nodata: &str) -> String {
    let word = |k: usize| height(k).map_or(nodata.to_owned(), |z| z.to_string());
    let row = |row: usize| (0..SIZE[0]).map(|col| word(row * SIZE[0] + col)).collect::<Vec<_>>();
    let rows: Vec<String> = (0..SIZE[1]).map(|at| row(at).join(" ")).collect();
    let [width, height] = SIZE;
    format!(
        "ncols {width}\nnrows {height}\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value {nodata}\n{}\n",
        rows.join("\n")
    )
}

/// What a reader finds that knows the format and goes by the declared value alone: no sample is void but
/// those that are the value as declared.
struct Found {
    nodata: Option<f64>,
    samples: Vec<f64>,
}

impl Found {
    fn read(path: &Path, kind: SampleType) -> Self {
        let bytes = std::fs::read(path).unwrap();
        match path.extension().unwrap().to_str().unwrap() {
            "asc" => Self::ascii(&String::from_utf8(bytes).unwrap()),
            "flt" => {
                Self::float(&bytes, &std::fs::read_to_string(path.with_extension("hdr")).unwrap())
            }
            "png" => Self::gray(&bytes),
            _ => Self::tiff(&bytes, kind),
        }
    }

    fn ascii(text: &str) -> Self {
        let (header, rows): (Vec<_>, Vec<_>) =
            text.lines().enumerate().partition(|(at, _)| *at < 6);
        let nodata = header.iter().find_map(|(_, line)| line.strip_prefix("NODATA_value "));
        let nodata = nodata.and_then(|value| value.parse().ok());
        let words = rows.iter().flat_map(|(_, line)| line.split_whitespace());
        let samples = words.map(|word| word.parse().unwrap()).collect();
        Self { nodata, samples }
    }

    fn float(bytes: &[u8], header: &str) -> Self {
        let nodata = header.lines().find_map(|line| line.strip_prefix("NODATA_value "));
        let samples = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b).into());
        Self { nodata: nodata.and_then(|value| value.parse().ok()), samples: samples.collect() }
    }

    fn gray(bytes: &[u8]) -> Self {
        let mut reader = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let key = reader.info().trns.clone();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        assert_eq!(frame.color_type, ::png::ColorType::Grayscale);
        let samples = match frame.bit_depth {
            ::png::BitDepth::Eight => pixels.iter().map(|byte| f64::from(*byte)).collect(),
            _ => pixels.as_chunks::<2>().0.iter().map(|b| u16::from_be_bytes(*b).into()).collect(),
        };
        let nodata = key.map(|key| key.iter().fold(0.0, |n, byte| n * 256.0 + f64::from(*byte)));
        Self { nodata, samples }
    }

    /// An uncompressed TIFF of one block.
    fn tiff(bytes: &[u8], kind: SampleType) -> Self {
        let number = |at: usize, size: usize| {
            let mut all = [0; 8];
            all[..size].copy_from_slice(&bytes[at..at + size]);
            u64::from_le_bytes(all) as usize
        };
        let big = number(2, 2) == 43;
        let (start, width) = if big { (number(8, 8), 8) } else { (number(4, 4), 4) };
        let (head, entry) = if big { (8, 20) } else { (2, 12) };
        let entries = (0..number(start, head)).map(|i| start + head + entry * i);
        let tags: BTreeMap<usize, (usize, usize, usize)> = entries
            .map(|at| (number(at, 2), (number(at + 2, 2), number(at + 4, width), at + 4 + width)))
            .collect();
        let place = |tag: usize| {
            let (kind, count, at) = tags[&tag];
            let bytes = count * [0, 1, 1, 2, 4, 8][kind.min(5)].max(if kind == 16 { 8 } else { 0 });
            if bytes <= width { at } else { number(at, width) }
        };
        let value = |tag: usize| {
            let size = match tags[&tag].0 {
                3 => 2,
                16 => 8,
                _ => 4,
            };
            number(place(tag), size)
        };
        let nodata = tags.get(&42_113).map(|(_, count, _)| {
            let text = &bytes[place(42_113)..][..count - 1];
            std::str::from_utf8(text).unwrap().trim().parse().unwrap()
        });
        assert_eq!(value(259), 1, "not compressed");
        let is_tiled = tags.contains_key(&322);
        let (columns, at) = if is_tiled { (value(322), value(324)) } else { (SIZE[0], value(273)) };
        let size = kind.bytes();
        let sample = |k: usize| {
            let at = at + (k / SIZE[0] * columns + k % SIZE[0]) * size;
            decoded(kind, &bytes[at..at + size])
        };
        Self { nodata, samples: (0..SIZE[0] * SIZE[1]).map(sample).collect() }
    }

    /// Heights, by the declared value alone.
    fn heights(&self) -> Vec<Option<f64>> {
        let is_void = |z: f64| self.nodata.is_some_and(|n| n == z || n.is_nan() && z.is_nan());
        self.samples.iter().map(|z| (!is_void(*z)).then_some(*z)).collect()
    }
}

fn decoded(kind: SampleType, bytes: &[u8]) -> f64 {
    match kind {
        SampleType::I8 => i8::from_le_bytes([bytes[0]]).into(),
        SampleType::U8 => bytes[0].into(),
        SampleType::I16 => i16::from_le_bytes(bytes.try_into().unwrap()).into(),
        SampleType::U16 => u16::from_le_bytes(bytes.try_into().unwrap()).into(),
        SampleType::I32 => i32::from_le_bytes(bytes.try_into().unwrap()).into(),
        SampleType::U32 => u32::from_le_bytes(bytes.try_into().unwrap()).into(),
        SampleType::F16 => half::f16::from_le_bytes(bytes.try_into().unwrap()).to_f64(),
        SampleType::F32 => f32::from_le_bytes(bytes.try_into().unwrap()).into(),
        SampleType::F64 => f64::from_le_bytes(bytes.try_into().unwrap()),
    }
}

/// Values that are asked for, or that the input declares: beyond some types, between values of others.
const VALUES: [f64; 13] = [
    -9999.0,
    0.0,
    255.0,
    -32_768.0,
    -9999.9,
    65_535.0,
    70_000.0,
    -3.4e38,
    -3.402_823_47e38,
    1e300,
    -1.7e308,
    0.1,
    f64::NAN,
];

#[test]
fn the_declared_nodata_value_is_the_one_that_voids_are_stored_as() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (mut written, mut refused) = (0, Vec::new());
    let formats = [
        ("tif", "store"),
        ("tif", "COG"),
        ("tif", "GTiff"),
        ("asc", "AAIGrid"),
        ("flt", "GridFloat"),
        ("png", "PNG"),
    ];
    let asked = VALUES.map(|value| (-9999.0, Some(value)));
    let own = VALUES.map(|value| (value, None));
    for (own, asked) in asked.into_iter().chain(own) {
        std::fs::write(path("in.asc"), text(&format!("{own:?}"))).unwrap();
        for (kind, (ending, format)) in
            SampleType::ALL.into_iter().flat_map(|kind| formats.map(|format| (kind, format)))
        {
            let out = path(&format!("out.{ending}"));
            let mut job = ConvertJob::new(path("in.asc"), &out);
            (job.options.file.format, job.options.samples.sample_type) =
                (Some(format.to_owned()), Some(kind));
            (job.options.samples.out_nodata, job.options.file.replacing.overwrite) = (asked, true);
            if format == "COG" {
                job.options.written.co.push(("COMPRESS".to_owned(), "NONE".to_owned()));
            }
            let what = format!("{own} as {asked:?}, {}, {format}", kind.name());
            let _ = std::fs::remove_file(&out);
            match convert::run(&job, &Silent, &Cancel::default()) {
                Ok(_) => {
                    let found = Found::read(&out, kind);
                    assert_eq!(found.heights(), heights(), "{what}: {:?}", found.nodata);
                    written += 1;
                }
                Err(error) => {
                    let told = error.to_string();
                    assert!(
                        told.contains("nodata") || told.contains(kind.name()),
                        "{what}: {told}"
                    );
                    assert!(!out.exists(), "{what}");
                    refused.push(what);
                }
            }
        }
    }
    // Floats hold some value for voids whatever is asked; of the rest most do.
    let is_float = |what: &String| what.contains("float") && !what.contains("PNG");
    let odd: Vec<_> =
        refused.iter().filter(|what| is_float(what) && !what.contains("GridFloat")).collect();
    assert!(odd.is_empty() && written > 600, "{written} {odd:#?}");
}

#[test]
fn a_nodata_value_that_a_type_does_not_have_is_told_with_the_one_it_becomes() {
    let place = Place::new();
    place.write("in.asc", text("-9999"));
    let report = |args: &[&str]| {
        let ran =
            place.ok(&[&["convert", "in.asc", "o.tif", "--overwrite", "--json"], args].concat());
        json(&ran.out)
    };
    let half = report(&["--type", "float16"]);
    assert_eq!(half["nodata"], -10_000.0);
    let notes = half["notes"].to_string();
    assert!(notes.contains("nodata is -10000, the float16 nearest to -9999"), "{notes}");
    assert!(!report(&["--type", "float32"])["notes"].to_string().contains("nearest"));
    place.fails(
        &["convert", "in.asc", "n.tif", "--type", "uint8", "--out-nodata", "-1"],
        2,
        &["-1 cannot be stored as uint8"],
    );
}

#[test]
fn text_that_reads_as_nodata_is_refused_however_it_comes_about() {
    let place = Place::new();
    let one = |height: &str, nodata: &str| {
        format!(
            "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value {nodata}\n{height} {nodata}\n"
        )
    };
    // Rounded to it, and told in single precision like it.
    for (height, nodata, more) in [
        ("-9999.2", "-9999", &["--type", "int16", "--round"][..]),
        ("-9999.9", "-1", &["--out-nodata", "-9999.9", "--type", "float32", "--round"]),
        ("-9999.9", "-1", &["--out-nodata", "-9999.9"]),
    ] {
        place.write("in.asc", one(height, nodata));
        let args = [&["convert", "in.asc", "o.asc"], more].concat();
        place.fails(&args, 65, &["would be read as nodata", "--out-nodata"]);
    }
}

/// Four columns of one row from column `at` on, as a TIFF of 16-bit numbers that declares `nodata`.
fn strip(at: usize, bits: usize, nodata: Option<&str>, samples: [f64; 4]) -> Vec<u8> {
    let mut spec = Spec::new(4, 1, if bits == 32 { 3 } else { 2 }, bits);
    let west = 500_000.0 + 40.0 * at as f64;
    spec.extra = vec![
        (33_550, Value::Double(vec![10.0, 10.0, 0.0])),
        (33_922, Value::Double(vec![0.0, 0.0, 0.0, west, 5_000_000.0, 0.0])),
    ];
    spec.extra.extend(nodata.map(|text| (42_113, Value::Text(text.to_owned()))));
    spec.build(|col, _, _| samples[col])
}

#[test]
fn the_nodata_value_of_one_file_voids_no_sample_of_another() {
    const V: f64 = f64::NAN;
    let (a, b) = ([0.0, 5.0, 0.0, 7.0], [0.0, 1.0, -32_768.0, 0.0]);
    // Both nodata values, what is found, and what is written for voids.
    let cases = [
        (Some("0"), Some("-32768"), [V, 5.0, V, 7.0, 0.0, 1.0, V, 0.0], Some(-32_768.0)),
        (Some("-32768"), Some("0"), [0.0, 5.0, 0.0, 7.0, V, 1.0, -32_768.0, V], Some(-32_768.0)),
        (Some("0"), None, [V, 5.0, V, 7.0, 0.0, 1.0, V, 0.0], Some(-32_768.0)),
        (Some("-32768"), None, [0.0, 5.0, 0.0, 7.0, 0.0, 1.0, V, 0.0], Some(-32_768.0)),
        (Some("0"), Some("0"), [V, 5.0, V, 7.0, V, 1.0, -32_768.0, V], Some(0.0)),
        (Some("5"), Some("-9999"), [0.0, V, 0.0, 7.0, 0.0, 1.0, -32_768.0, 0.0], Some(-9999.0)),
        (None, None, [0.0, 5.0, 0.0, 7.0, 0.0, 1.0, -32_768.0, 0.0], None),
    ];
    for (i, (first, second, expected, nodata)) in cases.into_iter().enumerate() {
        for bits in [16, 32] {
            // Floats have not a number as a last resort.
            if bits == 32 && (first, second) == (Some("0"), None) {
                continue;
            }
            let place = Place::new();
            place
                .write("a.tif", strip(0, bits, first, a))
                .write("b.tif", strip(1, bits, second, b));
            let inputs = ["a.tif", "b.tif"].map(|name| place.path(name).display().to_string());
            let grid = terrane_raster::open_all(&inputs, &Default::default()).unwrap();
            let found = read_all(grid.as_ref()).unwrap();
            let same = |a: &f64, b: &f64| a == b || a.is_nan() && b.is_nan();
            assert!(found.iter().zip(&expected).all(|(a, b)| same(a, b)), "{i}: {found:?}");
            // A copy has the same voids, or is refused by the height that would become one.
            let ran = place.run(&["convert", "a.tif", "b.tif", "o.tif", "-q"]);
            let collides = nodata.is_some_and(|nodata| expected.contains(&nodata));
            if collides {
                assert!(
                    ran.code == 65 && ran.err.contains("would be read as nodata"),
                    "{i}: {}",
                    ran.err
                );
                continue;
            }
            assert_eq!(ran.code, 0, "{i}: {}", ran.err);
            let copy = open_band(&place.path("o.tif"), 1).unwrap();
            let again = read_all(copy.as_ref()).unwrap();
            assert!(again.iter().zip(&expected).all(|(a, b)| same(a, b)), "{i}: {again:?}");
            assert_eq!(copy.info().nodata, nodata, "{i}");
        }
    }
}

#[test]
fn overlaps_and_gaps_keep_to_each_files_own_nodata() {
    let place = Place::new();
    place.write("a.tif", strip(0, 16, Some("0"), [1.0, 2.0, 3.0, 4.0]));
    place.write("b.tif", strip(0, 16, Some("-1"), [0.0, -1.0, 0.0, -1.0]));
    place.write("c.tif", strip(2, 16, Some("-1"), [0.0, -1.0, 9.0, 9.0]));
    let inputs = ["a.tif", "b.tif", "c.tif"].map(|name| place.path(name).display().to_string());
    let grid = terrane_raster::open_all(&inputs, &Default::default()).unwrap();
    let found = read_all(grid.as_ref()).unwrap();
    assert_eq!(found[..4], [0.0, 2.0, 0.0, 4.0]);
    assert!(found[4..8].iter().all(|z| z.is_nan()) && found[9].is_nan());
    assert_eq!([found[8], found[10]], [0.0, 9.0]);
    let copy = ["convert", "a.tif", "b.tif", "c.tif", "o.tif", "--out-nodata", "-2", "--json"];
    let told = json(&place.ok(&copy).out)["notes"].to_string();
    assert!(told.contains("applied to its own file: 0, -1"), "{told}");
}

#[test]
fn masks_beside_a_nodata_value_and_masks_that_a_vrt_does_not_use_are_told() {
    let place = Place::new();
    let masked = |nodata: Option<&str>| {
        let mut grid = strip(0, 16, nodata, [1.0, 2.0, 3.0, -99.0]);
        let mut mask = Spec::new(4, 1, 1, 8);
        mask.extra = vec![(254, Value::Short(vec![4])), (262, Value::Short(vec![4]))];
        mask.append(&mut grid, &|col, _, _| f64::from(u8::from(col > 0)));
        grid
    };
    place.write("both.tif", masked(Some("-99"))).write("mask.tif", masked(None));
    place.write("plain.tif", strip(0, 16, Some("-99"), [1.0, 2.0, 3.0, -99.0]));
    let vrt = |file: &str, kind: &str, more: &str, mask: &str| {
        format!(
            "<VRTDataset rasterXSize=\"4\" rasterYSize=\"1\"><GeoTransform>0, 10, 0, 0, 0, -10</GeoTransform>\
             <VRTRasterBand dataType=\"Int16\" band=\"1\"><{kind}><SourceFilename relativeToVRT=\"1\">{file}\
             </SourceFilename><SourceBand>1</SourceBand>{more}</{kind}></VRTRasterBand>{mask}</VRTDataset>"
        )
    };
    let band = "<MaskBand><VRTRasterBand dataType=\"Byte\"><SimpleSource><SourceFilename relativeToVRT=\"1\">mask.tif\
                </SourceFilename><SourceBand>mask,1</SourceBand></SimpleSource></VRTRasterBand></MaskBand>";
    place.write("unused.vrt", vrt("mask.tif", "SimpleSource", "", ""));
    place
        .write("used.vrt", vrt("mask.tif", "ComplexSource", "<UseMaskBand>true</UseMaskBand>", ""));
    place.write("band.vrt", vrt("mask.tif", "SimpleSource", "", band));
    place.write("none.vrt", vrt("plain.tif", "SimpleSource", "", ""));
    for (name, words) in [
        ("both.tif", Some("nodata value and mask (internal)")),
        ("mask.tif", None),
        ("plain.tif", None),
        ("unused.vrt", Some("masks that the VRT does not use: 1")),
        ("used.vrt", None),
        ("band.vrt", None),
        ("none.vrt", None),
    ] {
        let notes = |ran: &str| json(ran)["notes"].to_string();
        let info = notes(&place.ok(&["info", name, "--json"]).out);
        let copy =
            place.ok(&["convert", name, "o.asc", "--overwrite", "--json", "--out-nodata", "-1"]);
        for told in [info, notes(&copy.out)] {
            let is_told = words.is_some_and(|words| told.contains(words));
            assert!(is_told || words.is_none() && !told.contains("mask"), "{name}: {told}");
        }
        // Void by either.
        let text = String::from_utf8(place.bytes("o.asc")).unwrap();
        let last = text.lines().last().unwrap();
        let expected = match name {
            "both.tif" => "-1 2 3 -1",
            "plain.tif" => "1 2 3 -1",
            // A VRT goes by its own nodata value, and this one has none.
            "none.vrt" => "1 2 3 -99",
            _ => "-1 2 3 -99",
        };
        assert_eq!(last, expected, "{name}");
    }
}

#[test]
fn gray_pictures_hold_whole_heights_and_packed_ones_are_a_name_or_an_option_away() {
    let place = Place::new();
    place.write("in.asc", text("-9999"));
    let info = |name: &str| json(&place.ok(&["info", name, "--json"]).out);
    for (kind, nodata) in [("uint8", "0"), ("uint8", "255"), ("uint16", "65535"), ("uint16", "0")] {
        let args =
            ["convert", "in.asc", "o.png", "--overwrite", "--type", kind, "--out-nodata", nodata];
        place.ok(&args);
        let facts = info("o.png");
        assert_eq!(
            (&facts["sample_type"], &facts["details"]["heights"]),
            (&kind.into(), &"gray".into())
        );
        let found = Found::read(&place.path("o.png"), SampleType::U8);
        assert_eq!((found.heights(), found.nodata), (heights(), nodata.parse().ok()));
    }
    place.ok(&["convert", "in.asc", "packed.png", "--co", "ENCODING=TERRARIUM"]);
    assert_eq!(info("terrarium:packed.png")["details"]["heights"], "terrarium");
    std::fs::create_dir(place.path("terrain-rgb")).unwrap();
    place.ok(&["convert", "in.asc", "terrain-rgb/o.png"]);
    assert_eq!(info("terrain-rgb/o.png")["details"]["heights"], "terrain-RGB");
    place.fails(
        &["convert", "in.asc", "n.png", "--type", "uint16"],
        65,
        &["is void", "--out-nodata"],
    );
    place.fails(
        &["convert", "in.asc", "n.png", "--type", "float32"],
        2,
        &["not float32", "--type"],
    );
    let packed = ["convert", "in.asc", "n.png", "--type", "uint16", "--co", "ENCODING=TERRARIUM"];
    place.fails(&packed, 2, &["RGB-encoded heights, not uint16"]);
    assert!(write::FORMATS.iter().any(|format| format.is_picture()));
}
