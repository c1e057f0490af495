//! Rules of GeoTIFF reading: sparse blocks, nodata, bands, scale, georeference, refusals, limits.

use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::raster_support::tiff_builder::{Spec, Value};
use crate::raster_support::{open_band, read_all};
use terrane_base::geom::{Affine, Rect};
use terrane_base::{Error, ErrorKind};
use terrane_raster::{GridOpenOptions, GridSource, open};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, spec: &Spec, value: impl Fn(usize, usize, usize) -> f64) -> PathBuf {
        self.raw(&spec.build(value))
    }

    fn raw(&self, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join("t.tif");
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn ramp(col: usize, row: usize, band: usize) -> f64 {
    (col + 10 * row + 100 * band) as f64
}

fn refusal(path: &Path, options: &GridOpenOptions) -> Error {
    match open(path.to_str().unwrap(), options) {
        Err(error) => error,
        Ok(source) => panic!("opened: {:?}", source.info()),
    }
}

fn georeferenced(extra: Vec<(u16, Value)>) -> Box<dyn GridSource> {
    let folder = Folder::new();
    let mut spec = Spec::new(4, 3, 2, 16);
    spec.extra = extra;
    open_band(&folder.write(&spec, ramp), 1).unwrap()
}

fn keys(raster_type: u16) -> (u16, Value) {
    let keys = vec![1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, raster_type, 3072, 0, 1, 32611];
    (34735, Value::Short(keys))
}

#[test]
fn sparse_blocks_are_nodata_or_zero() {
    let folder = Folder::new();
    for compression in [1, 8] {
        let mut spec = Spec::new(40, 20, 2, 16);
        spec.compression = compression;
        spec.tile = Some((16, 16));
        spec.sparse = vec![1];
        let source = open_band(&folder.write(&spec, ramp), 1).unwrap();
        let heights = read_all(source.as_ref()).unwrap();
        assert_eq!((heights[15], heights[16], heights[31], heights[32]), (15.0, 0.0, 0.0, 32.0));
        spec.extra = vec![(42113, Value::Text("-9999".to_owned()))];
        let source = open_band(&folder.write(&spec, ramp), 1).unwrap();
        let heights = read_all(source.as_ref()).unwrap();
        assert!(heights[16].is_nan() && heights[31].is_nan() && heights[32] == 32.0);
    }
}

#[test]
fn a_block_that_cannot_lie_where_it_is_said_to_is_refused() {
    let folder = Folder::new();
    for (compression, tile, big_tiff) in
        [(1, None, false), (8, None, false), (1, Some((16, 16)), false), (8, Some((16, 16)), true)]
    {
        for (offset, told) in
            [(0, "at offset 0 overlap the file header"), (5, "at offset 5 overlap the file header")]
        {
            let mut spec = Spec::new(40, 20, 2, 16);
            (spec.compression, spec.tile, spec.big_tiff) = (compression, tile, big_tiff);
            spec.lie = vec![(0, offset)];
            let path = folder.write(&spec, ramp);
            let Err(error) = open_band(&path, 1) else { panic!("{told}") };
            let text = error.to_string();
            assert!(text.contains(told) && text.contains("block 0"), "{text}");
        }
    }
}

#[test]
fn declared_and_given_nodata() {
    let folder = Folder::new();
    let mut spec = Spec::new(4, 3, 2, 16);
    spec.extra = vec![(42113, Value::Text(" 11 ".to_owned()))];
    let path = folder.write(&spec, ramp);
    let voids = |options: &GridOpenOptions| {
        let source = open(path.to_str().unwrap(), options).unwrap();
        let heights = read_all(source.as_ref()).unwrap();
        heights.iter().enumerate().filter(|h| h.1.is_nan()).map(|h| h.0).collect::<Vec<_>>()
    };
    assert_eq!(voids(&GridOpenOptions::default()), [5]);
    assert_eq!(voids(&GridOpenOptions { nodata: Some(2.0), ..GridOpenOptions::default() }), [2]);
    spec.extra = vec![(42113, Value::Text("none".to_owned()))];
    let error = refusal(&folder.write(&spec, ramp), &GridOpenOptions::default()).to_string();
    assert!(error.contains("\"none\"") && error.contains("‹nodata›"), "{error}");
}

#[test]
fn bands_out_of_range_are_misuse() {
    let folder = Folder::new();
    let mut spec = Spec::new(4, 3, 1, 16);
    spec.bands = 3;
    let path = folder.write(&spec, ramp);
    for band in [0, 4, u32::MAX] {
        let error = refusal(&path, &GridOpenOptions { band, ..GridOpenOptions::default() });
        assert_eq!(error.kind(), ErrorKind::Usage);
        assert!(error.to_string().contains("the file has 3 bands"), "{error}");
    }
}

#[test]
fn scale_offset_and_unit_of_the_band() {
    let xml = r#"<GDALMetadata><Item name="SCALE" sample="1" role="scale">0.5</Item>
        <Item name="OFFSET" sample="1" role="offset">-3</Item>
        <Item name="UNITTYPE" sample="1" role="unittype">m</Item></GDALMetadata>"#;
    let folder = Folder::new();
    let mut spec = Spec::new(4, 3, 2, 16);
    spec.bands = 2;
    spec.extra = vec![(42112, Value::Text(xml.to_owned())), (42113, Value::Text("101".to_owned()))];
    let path = folder.write(&spec, ramp);
    let plain = open_band(&path, 1).unwrap();
    assert_eq!(read_all(plain.as_ref()).unwrap()[3], 3.0);
    assert!(plain.info().exact_in_f32());
    let scaled = open_band(&path, 2).unwrap();
    let heights = read_all(scaled.as_ref()).unwrap();
    assert_eq!((heights[0], heights[3]), (47.0, 48.5));
    assert!(heights[1].is_nan(), "nodata is compared before scaling");
    assert!(!scaled.info().exact_in_f32());
    assert_eq!(scaled.info().crs.vertical_unit.as_deref(), Some("metre"));
    assert_eq!(scaled.info().crs.vertical_unit_text.as_deref(), Some("m"));
}

#[test]
fn area_point_matrix_and_none() {
    let tie = (33922, Value::Double(vec![1.0, 1.0, 0.0, 500.0, 900.0, 0.0]));
    let scale = (33550, Value::Double(vec![10.0, 20.0, 0.0]));
    let area = georeferenced(vec![scale.clone(), tie.clone(), keys(1)]);
    assert_eq!(area.info().transform.apply(0.5, 0.5), [500.0, 900.0]);
    assert_eq!(area.info().crs.epsg, Some(32611));
    let point = georeferenced(vec![scale, tie.clone(), keys(2)]);
    assert_eq!(point.info().transform.apply(1.0, 1.0), [500.0, 900.0]);
    assert!(point.info().pixel_is_point && !area.info().pixel_is_point);
    let south_up = vec![2.0, 0.5, 0.0, 7.0, -0.5, 2.0, 0.0, 9.0, 0., 0., 0., 0., 0., 0., 0., 1.0];
    let matrix = georeferenced(vec![(34264, Value::Double(south_up))]);
    assert_eq!(matrix.info().transform.to_gdal(), [7.0, 2.0, 0.5, 9.0, -0.5, 2.0]);
    for extra in [vec![], vec![tie]] {
        let none = georeferenced(extra);
        assert!(!none.info().georeferenced);
        assert_eq!(none.info().transform, Affine::LATTICE);
    }
}

#[test]
fn unsupported_features_are_refused_by_name_with_the_call_that_mends_them() {
    let folder = Folder::new();
    let refused = |spec: &Spec, name: &str, call: &str| {
        let error = refusal(&folder.write(spec, ramp), &GridOpenOptions::default());
        assert_eq!(error.kind(), ErrorKind::Unsupported);
        let text = error.to_string();
        let says = |words: &str| text.contains(words);
        assert!(says(name) && says(call), "{text}");
        assert!(says("is not supported") || says("are not supported"), "{text}");
    };
    let plain = Spec::new(4, 3, 2, 16);
    let compressions = [
        (7, "JPEG"),
        (34925, "LZMA"),
        (50001, "WebP"),
        (50002, "JPEG XL"),
        (4, "CCITT"),
        (65000, "unknown"),
    ];
    for (compression, name) in compressions {
        let call = "gdal_translate -co COMPRESS=DEFLATE IN OUT";
        refused(&Spec { compression, ..plain.clone() }, name, call);
    }
    for (format, bits, name, call) in [
        (1, 64, "64-bit unsigned", "gdal_translate -ot Float64"),
        (2, 64, "64-bit signed", "gdal_translate -ot Float64"),
        (6, 64, "complex", "gdal_translate -ot Float64"),
        (5, 32, "complex integer", "gdal_translate -ot Float32"),
        (3, 24, "24-bit floating", "gdal_translate -ot Float32"),
        (1, 1, "1-bit unsigned", "gdal_translate -ot Float32"),
    ] {
        refused(&Spec::new(4, 3, format, bits), name, call);
    }
    let with = |tag, value| Spec { extra: vec![(tag, Value::Short(vec![value]))], ..plain.clone() };
    refused(&with(258, 12), "12-bit signed integer samples", "gdal_translate -ot Float32");
    refused(&with(317, 34892), "predictor 34892", "gdal_translate -co");
    for (photometric, name) in [(3, "palette"), (5, "CMYK"), (6, "YCbCr"), (8, "CIE")] {
        refused(&with(262, photometric), name, "gdal_translate");
    }
    refused(&with(266, 2), "FillOrder 2", "gdal_translate");
    let mixed = Spec { bands: 2, extra: vec![(258, Value::Short(vec![16, 8]))], ..plain.clone() };
    refused(&mixed, "bands with different BitsPerSample", "gdal_translate -b 1");
}

#[test]
fn a_last_strip_padded_to_full_height() {
    let folder = Folder::new();
    for compression in [1, 5, 8, 32773, 50000] {
        let mut spec = Spec::new(9, 10, 3, 32);
        spec.compression = compression;
        spec.pad_last_strip = true;
        let source = open_band(&folder.write(&spec, ramp), 1).unwrap();
        assert_eq!(read_all(source.as_ref()).unwrap()[89], 98.0);
    }
}

#[test]
fn truncated_files_name_the_block() {
    let folder = Folder::new();
    for compression in [1, 8] {
        let mut spec = Spec::new(64, 64, 2, 16);
        (spec.compression, spec.rows_per_strip) = (compression, 16);
        let mut bytes = spec.build(ramp);
        // The builder puts the directory last, so the last offset is moved to the file's end.
        let last = spec.build(ramp).len() as u32 - 4;
        let offsets = bytes.windows(2).rposition(|w| w == [0x11, 0x01]).unwrap();
        let at = u32::from_le_bytes(bytes[offsets + 8..offsets + 12].try_into().unwrap()) as usize;
        bytes[at + 12..at + 16].copy_from_slice(&last.to_le_bytes());
        let error = refusal(&folder.raw(&bytes), &GridOpenOptions::default());
        assert_eq!(error.kind(), ErrorKind::BadInput);
        let text = error.to_string();
        assert!(
            text.contains("block 3") && text.contains("row 48") && text.contains("ends at"),
            "{text}"
        );
    }
}

/// A classic TIFF of 2^31 x 2^31 samples in less than 100 bytes, and one just within the limit.
#[test]
fn header_lies_are_turned_away() {
    let folder = Folder::new();
    for (side, word) in [(1_u64 << 31, "limit"), ((1 << 30) - 1, "truncated"), (0, "is 0")] {
        let mut bytes = b"II*\0\x08\0\0\0\x05\0".to_vec();
        let tags: [(u16, u32); 5] =
            [(256, side as u32), (257, side as u32), (258, 16), (273, 8), (278, u32::MAX)];
        for (tag, value) in tags {
            bytes.extend(tag.to_le_bytes());
            bytes.extend([4, 0, 1, 0, 0, 0]);
            bytes.extend(value.to_le_bytes());
        }
        let error = refusal(&folder.raw(&bytes), &GridOpenOptions::default()).to_string();
        assert!(error.contains(word), "{error}");
    }
}

/// One uncompressed strip of 1.6 GB is read by rows: a window costs what it holds.
#[test]
fn a_huge_strip_is_read_by_rows() {
    const SIDE: usize = 40_000;
    let folder = Folder::new();
    let mut spec = Spec::new(8, 1, 1, 8);
    spec.rows_per_strip = 50_000;
    let mut bytes = spec.build(|_, _, _| 0.0);
    let data_at = bytes.len() as u64;
    let mut patch = |tag: u16, value: u32| {
        let [low, high] = tag.to_le_bytes();
        let at = bytes.windows(4).rposition(|w| w == [low, high, 4, 0]).unwrap();
        bytes[at + 8..at + 12].copy_from_slice(&value.to_le_bytes());
    };
    patch(256, SIDE as u32);
    patch(257, SIDE as u32);
    patch(273, data_at as u32);
    patch(279, (SIDE * SIDE) as u32);
    let path = folder.raw(&bytes);
    let mut file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(data_at + (SIDE * SIDE) as u64).unwrap();
    file.seek(SeekFrom::Start(data_at + 39_999 * SIDE as u64 + 20_000)).unwrap();
    file.write_all(&[77]).unwrap();
    let options = GridOpenOptions { cache_bytes: 1 << 16, ..GridOpenOptions::default() };
    let source = open(path.to_str().unwrap(), &options).unwrap();
    let mut out = vec![0.0; 6];
    source.read_f32(Rect::new(19_999, 39_998, 3, 2), &mut out).unwrap();
    assert_eq!(out, [0.0, 0.0, 0.0, 0.0, 77.0, 0.0]);
}

#[test]
fn a_block_larger_than_the_cache_asks_for_memory() {
    let folder = Folder::new();
    let mut spec = Spec::new(64, 64, 3, 32);
    (spec.compression, spec.rows_per_strip) = (8, 64);
    let path = folder.write(&spec, ramp);
    let error =
        refusal(&path, &GridOpenOptions { cache_bytes: 32_767, ..GridOpenOptions::default() });
    assert_eq!(error.kind(), ErrorKind::Resource);
    assert!(error.to_string().contains("a block takes 32768 bytes"), "{error}");
    let enough = GridOpenOptions { cache_bytes: 32_768, ..GridOpenOptions::default() };
    assert!(open(path.to_str().unwrap(), &enough).is_ok());
}

#[test]
fn windows_outside_the_grid_are_misuse() {
    let folder = Folder::new();
    let source = open_band(&folder.write(&Spec::new(4, 3, 2, 16), ramp), 1).unwrap();
    for rect in [Rect::new(3, 0, 2, 1), Rect::new(0, u32::MAX, 1, 1), Rect::new(u32::MAX, 0, 2, 1)]
    {
        let error = source.read_f32(rect, &mut vec![0.0; rect.len()]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
    }
    assert!(source.read_f32(Rect::new(0, 0, 2, 2), &mut [0.0; 3]).is_err());
    source.read_f32(Rect::new(1, 1, 0, 2), &mut []).unwrap();
    source.release(Rect::new(0, 0, 9, 9));
}

#[test]
fn threads_share_one_source_within_a_small_cache() {
    let folder = Folder::new();
    let mut spec = Spec::new(300, 200, 3, 32);
    (spec.compression, spec.predictor, spec.tile) = (8, 3, Some((32, 32)));
    let path = folder.write(&spec, ramp);
    let options = GridOpenOptions { cache_bytes: 5 * 32 * 32 * 4, ..GridOpenOptions::default() };
    let source = open(path.to_str().unwrap(), &options).unwrap();
    let whole = read_all(source.as_ref()).unwrap();
    std::thread::scope(|scope| {
        for thread in 0..4_u32 {
            let (source, whole) = (&source, &whole);
            scope.spawn(move || {
                for i in 0..60 {
                    let rect = Rect::new((i * 37 + thread * 11) % 250, (i * 13) % 150, 50, 50);
                    let mut out = vec![0.0; rect.len()];
                    source.read_f32(rect, &mut out).unwrap();
                    let first = rect.row as usize * 300 + rect.col as usize;
                    assert_eq!(f64::from(out[0]), whole[first]);
                    assert_eq!(f64::from(out[2499]), whole[first + 49 * 300 + 49]);
                    source.release(rect);
                }
            });
        }
    });
}

#[test]
fn details_for_info() {
    let folder = Folder::new();
    let mut spec = Spec::new(40, 20, 3, 32);
    (spec.compression, spec.predictor, spec.tile) = (8, 3, Some((16, 32)));
    (spec.big_endian, spec.big_tiff, spec.bands) = (true, true, 2);
    let source = open_band(&folder.write(&spec, ramp), 2).unwrap();
    let details = &source.info().details;
    let expected = [
        ("container", "BigTIFF"),
        ("compression", "deflate"),
        ("predictor", "floating point (3)"),
        ("layout", "tiles of 16 x 32"),
        ("byte order", "big-endian"),
        ("bands stored", "interleaved"),
    ];
    assert_eq!(details.len(), expected.len());
    for (detail, expected) in details.iter().zip(expected) {
        assert_eq!((detail.0.as_str(), detail.1.as_str()), expected);
    }
}

/// More blocks than are held in memory: offsets are read from the file one by one.
#[test]
fn very_many_blocks() {
    let folder = Folder::new();
    let mut spec = Spec::new(2, 300_000, 2, 32);
    spec.rows_per_strip = 1;
    spec.sparse = vec![299_998];
    let path = folder.write(&spec, |col, row, _| (2 * row + col) as f64);
    let source = open_band(&path, 1).unwrap();
    let mut out = vec![0.0; 6];
    source.read_f64(Rect::new(0, 299_997, 2, 3), &mut out).unwrap();
    assert_eq!(out, [599_994.0, 599_995.0, 0.0, 0.0, 599_998.0, 599_999.0]);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes.drain(8..12);
    assert!(open_band(&folder.raw(&bytes), 1).is_err());
}

/// A LERC TIFF of 4 x 3 samples in big-endian order, as GDAL writes it: -30, -23, -16, ...
const BIG_ENDIAN_LERC: &str = "4d4d002a00000008000d01000003000000010004000001010003000000010003000001020003000000010010000001030003000000018847000001060003000000010001000001110004000000010000012401150003000000010001000001160003000000010003000001170004000000010000006301\
1c00030000000100010000015300030000000100020000a480000200000072000000b2c5f2000400000002000000aa0000000000000004000000003c4744414c4d657461646174613e0a20203c4974656d206e616d653d22434f4d5052455353494f4e5f5245564552534942494c4954592220646f6d61696e3d22494d414745\
5f535452554354555245223e4c4f53534c4553533c2f4974656d3e0a3c2f4744414c4d657461646174613e0a004c657263322004000000d5521c350300000004000000010000000c000000080000006300000002000000000000000000e03f000000000001bdc0000000000080c74000000000ffe2002f01ffe2ffe9fff0fff7\
fffe0005000c0013001a00210028002f";

#[test]
fn lerc_in_big_endian_files_holds_swapped_samples() {
    let mut bytes: Vec<u8> = (0..BIG_ENDIAN_LERC.len() / 2)
        .map(|i| u8::from_str_radix(&BIG_ENDIAN_LERC[2 * i..2 * i + 2], 16).unwrap())
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("l.tif");
    std::fs::write(&path, &bytes).unwrap();
    let heights = read_all(open_band(&path, 1).unwrap().as_ref()).unwrap();
    let expected: Vec<f64> = (0..12).map(|i| f64::from(i * 7 - 30)).collect();
    assert_eq!(heights, expected);
    // As 32-bit floats: bits per sample, and the sample format.
    let tag = |bytes: &[u8], tag: u16| {
        let entries = (10..).step_by(12).take(13);
        entries.clone().find(|at| bytes[*at..*at + 2] == tag.to_be_bytes()).unwrap() + 8
    };
    for (number, value) in [(258, 32), (339, 3)] {
        let at = tag(&bytes, number);
        bytes[at + 1] = value;
    }
    std::fs::write(&path, &bytes).unwrap();
    let told = open_band(&path, 1).err().unwrap().to_string();
    assert!(told.contains("LERC of big-endian floats is not supported"), "{told}");
}
