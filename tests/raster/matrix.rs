//! Compression x predictor x sample type x layout x byte order x container: every combination is
//! written by the builder, read whole and in windows, and compared with the values put in and with
//! the `tiff` crate.

use std::io::Cursor;
use std::path::Path;

use crate::raster_support::tiff_builder::Spec;
use crate::raster_support::{open_band, read_all, read_in_windows, write_anew};
use tiff::decoder::{Decoder, DecodingResult};

const WIDTH: usize = 37;
const HEIGHT: usize = 29;

/// (SampleFormat, BitsPerSample)
const TYPES: [(u16, usize); 9] =
    [(1, 8), (1, 16), (1, 32), (2, 8), (2, 16), (2, 32), (3, 16), (3, 32), (3, 64)];
const COMPRESSIONS: [u16; 6] = [1, 5, 8, 32773, 32946, 50000];

/// A value every type can hold exactly, different everywhere.
fn value(spec: &Spec, col: usize, row: usize, band: usize) -> f64 {
    let mixed = (col * 31 + row * 17 + band * 7) ^ (col * row);
    match (spec.format, spec.bits) {
        (1, 8) => (mixed % 256) as f64,
        (2, 8) => (mixed % 256) as f64 - 128.0,
        (1, 32) => (mixed as f64) * 2_000_003.0,
        (2, 32) => (mixed as f64 - 500.0) * 1_000_003.0,
        (1, _) => (mixed * 31 % 65_536) as f64,
        (2, _) => (mixed * 31 % 65_536) as f64 - 32_768.0,
        (_, 16) => (mixed % 1000) as f64 * 0.5 - 100.0,
        (_, 32) => mixed as f64 * 0.125 - 70.0,
        _ => mixed as f64 / 3.0,
    }
}

fn predictors(spec: &Spec) -> &'static [u16] {
    match (spec.compression, spec.format) {
        (1 | 32773, _) => &[1],
        (_, 3) => &[1, 2, 3],
        _ => &[1, 2],
    }
}

fn specs() -> Vec<Spec> {
    let mut specs = Vec::new();
    for (format, bits) in TYPES {
        for compression in COMPRESSIONS {
            for bits_of_choice in 0..24 {
                let mut spec = Spec::new(WIDTH, HEIGHT, format, bits);
                spec.compression = compression;
                spec.big_endian = bits_of_choice & 1 != 0;
                spec.big_tiff = bits_of_choice & 2 != 0;
                spec.tile = (bits_of_choice & 4 != 0).then_some((16, 16));
                spec.bands = if bits_of_choice >= 8 { 3 } else { 1 };
                spec.separate = bits_of_choice >= 16;
                for predictor in predictors(&spec) {
                    specs.push(Spec { predictor: *predictor, ..spec.clone() });
                }
            }
        }
    }
    specs
}

fn check_values(spec: &Spec, path: &Path) {
    for band in 0..spec.bands {
        let source = open_band(path, band as u32 + 1).unwrap_or_else(|e| panic!("{e}: {spec:?}"));
        let heights = read_all(source.as_ref()).unwrap_or_else(|e| panic!("{e}: {spec:?}"));
        let narrow = read_in_windows(source.as_ref(), 11).unwrap();
        for row in 0..HEIGHT {
            for col in 0..WIDTH {
                let expected = value(spec, col, row, band);
                let i = row * WIDTH + col;
                assert_eq!(heights[i], expected, "{col},{row} band {band}: {spec:?}");
                assert_eq!(narrow[i], expected as f32, "{col},{row} band {band}: {spec:?}");
            }
        }
    }
}

/// What the `tiff` crate makes of it, all bands interleaved; `None` where it cannot read it.
fn by_tiff_crate(bytes: &[u8]) -> Option<Vec<f64>> {
    let wide = |result| -> Option<Vec<f64>> {
        Some(match result {
            DecodingResult::U8(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::U16(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::U32(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::I8(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::I16(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::I32(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::F16(v) => v.into_iter().map(|v| v.to_f64()).collect(),
            DecodingResult::F32(v) => v.into_iter().map(f64::from).collect(),
            DecodingResult::F64(v) => v,
            _ => return None,
        })
    };
    wide(Decoder::new(Cursor::new(bytes)).ok()?.read_image().ok()?)
}

#[test]
fn every_combination() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.tif");
    let (mut ran, mut compared) = (0, 0);
    for spec in specs() {
        let bytes = spec.build(|col, row, band| value(&spec, col, row, band));
        write_anew(&path, &bytes);
        check_values(&spec, &path);
        ran += 1;
        if let (1, Some(oracle)) = (spec.bands, by_tiff_crate(&bytes)) {
            let source = open_band(&path, 1).unwrap();
            assert_eq!(read_all(source.as_ref()).unwrap(), oracle, "{spec:?}");
            compared += 1;
        }
    }
    assert!(ran > 2000, "only {ran} combinations");
    assert!(compared > 500, "only {compared} compared with the tiff crate");
}
