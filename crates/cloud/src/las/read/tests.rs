//! Whole records of compressed parts beside those of the same file without compression.

use super::*;
use std::path::{Path, PathBuf};

/// A point of a format, as another writer takes it.
fn point(format: las::point::Format, number: u32) -> las::Point {
    let of = (number % 4 + 1) as u8;
    let (colour, step) = (las::Color::new(5, number as u16, 700), f64::from(number));
    las::Point {
        x: step * 0.25,
        y: 40.0 - step * 0.5,
        z: f64::from(number % 31),
        intensity: (number * 37 % 900) as u16,
        return_number: (number / 4 % u32::from(of) + 1) as u8,
        number_of_returns: of,
        scan_angle: f64::from(number % 40) as f32,
        user_data: (number % 9) as u8,
        point_source_id: (number / 300) as u16,
        gps_time: format.has_gps_time.then_some(1e6 + step * 1e-3),
        color: format.has_color.then_some(colour),
        nir: format.has_nir.then_some((number % 777) as u16),
        extra_bytes: vec![(number % 5) as u8; format.extra_bytes.into()],
        ..las::Point::default()
    }
}

/// Writes so many points to a file; compressed if its name says so.
fn write(path: &Path, format: u8, extra: u16, count: u32) {
    let mut format = las::point::Format::new(format).unwrap();
    format.extra_bytes = extra;
    let mut builder = las::Builder::from((1, 4));
    builder.point_format = format;
    let mut writer = las::Writer::from_path(path, builder.into_header().unwrap()).unwrap();
    (0..count).for_each(|number| writer.write_point(point(format, number)).unwrap());
    writer.close().unwrap();
}

/// All records, the largest block of them, and how many points are lost.
fn read(path: &Path, wanted: FieldSelection, salvage: bool) -> Result<(Vec<u8>, usize, u64)> {
    let file = LasFile::open(path, salvage)?;
    let (mut all, mut largest, mut lost, mut room) = (Vec::new(), 0, 0, LasReadBuffers::default());
    for part in 0..file.parts.len() {
        let mut next = file.parts[part].first;
        lost += file.records(part, wanted, salvage, &mut room, &mut |first, block| {
            assert_eq!(first, next);
            if let LasPointBlock::Records(records) = block {
                all.extend_from_slice(records);
                largest = largest.max(records.len());
                next += (records.len() / usize::from(file.header.record)) as u64;
            } else if let LasPointBlock::Fields(fields) = block {
                next += fields.len() as u64;
            }
            Ok(())
        })?;
    }
    Ok((all, largest, lost))
}

/// The places of two files in a folder, one compressed, the other not.
fn pair(folder: &Path) -> [PathBuf; 2] {
    ["a.laz", "a.las"].map(|name| folder.join(name))
}

#[test]
fn compressed_parts_yield_the_records_of_plain_ones() {
    let folder = tempfile::tempdir().unwrap();
    let [packed, plain] = pair(folder.path());
    for format in [0, 1, 2, 3, 6, 7, 8] {
        for (extra, count) in [(0, 1), (4, 9_000), (2_000, 1_500)] {
            for path in [&packed, &plain] {
                write(path, format, extra, count);
            }
            let expected = read(&plain, FieldSelection::RECORDS, false).unwrap();
            for salvage in [false, true] {
                let (records, largest, lost) =
                    read(&packed, FieldSelection::RECORDS, salvage).unwrap();
                assert!((&records, lost) == (&expected.0, 0), "format {format}, {extra}, {count}");
                assert!(largest <= 1 << 20, "{largest} bytes at a time");
            }
            let (fields, ..) = read(&packed, FieldSelection::ALL, false).unwrap();
            assert!(fields.is_empty(), "records that nobody wants");
        }
    }
}

#[test]
fn damage_to_what_only_records_need_is_told_or_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let [packed, _] = pair(folder.path());
    write(&packed, 7, 0, 2_000);
    let mut bytes = std::fs::read(&packed).unwrap();
    let part = LasFile::open(&packed, false).unwrap().parts[0];
    // The last layer is that of colours.
    let at = (part.at + part.bytes) as usize - 40;
    bytes[at..at + 4].iter_mut().for_each(|byte| *byte ^= 0x55);
    std::fs::write(&packed, &bytes).unwrap();
    assert!(read(&packed, FieldSelection::ALL, false).is_ok());
    let error = read(&packed, FieldSelection::RECORDS, false).unwrap_err().to_string();
    assert!(error.contains("chunk 0, points 0 to 1999") && error.contains("colours"), "{error}");
    let (records, _, lost) = read(&packed, FieldSelection::RECORDS, true).unwrap();
    assert_eq!((records.len(), lost), (0, 2_000));
}
