//! Versions of LAS: each with the points it has, its header and what that says; LAS 1.5 read and written.

use terrane_cloud::{LasVersion, PointFormat};
use terrane_lidar::points::TranslateJob;

use crate::cloud_support::{Made, Packing, Place, keep_all, number, read_all, whole};
use crate::translate::{job, run};

/// Where headers have the global encoding, the version and size, the old count, where points begin; from 1.4 on the
/// wide count; in 1.5 the last and first time and what they are counted from.
const ENCODING: usize = 6;
const HEADER: usize = 94;
const OLD_COUNT: usize = 107;
const COUNT: usize = 247;
const TIMES: usize = 375;
const TIME_OFFSET: usize = 391;

/// A file of version 1.5 whose times are counted from so many millions of seconds, if they are.
fn latest(format: u8, packing: Packing, millions: Option<u16>) -> (Made, Vec<u8>) {
    let mut made = Made { minor: 5, ..Made::new(format, packing, 2000) };
    for (i, record) in (0..).zip(&mut made.records) {
        record[22..30].copy_from_slice(&(f64::from(i) * 0.5).to_le_bytes());
    }
    let mut bytes = made.bytes();
    if let Some(millions) = millions {
        bytes[ENCODING] = 1 | 64;
        bytes[TIME_OFFSET..TIME_OFFSET + 2].copy_from_slice(&millions.to_le_bytes());
    }
    (made, bytes)
}

#[test]
fn each_version_is_written_with_its_header_and_read_again() {
    let place = Place::new();
    for (format, version, size) in [
        (1, "1.2", 227),
        (1, "1.3", 235),
        (1, "1.4", 375),
        (4, "1.3", 235),
        (5, "1.4", 375),
        (6, "1.4", 375),
        (6, "1.5", 393),
        (8, "1.5", 393),
    ] {
        let made = Made::new(format, Packing::Plain, 1234);
        let input = place.write("in.las", &made.bytes());
        for ending in ["las", "laz"] {
            let output = place.path().join(format!("out.{ending}"));
            let version: LasVersion = version.parse().unwrap();
            let job = TranslateJob { version: Some(version), ..job(&[&input], &output) };
            run(&job).unwrap();
            let bytes = std::fs::read(&output).unwrap();
            assert_eq!(bytes[24..26], [1, version.minor()]);
            assert_eq!(u16::from_le_bytes(number(&bytes, HEADER)), size, "{format} in {version}");
            let (old, wide) = (u32::from_le_bytes(number(&bytes, OLD_COUNT)), 1234);
            assert_eq!(old, if format < 6 { wide } else { 0 });
            if version.minor() >= 4 {
                assert_eq!(u64::from_le_bytes(number(&bytes, COUNT)), u64::from(wide));
            }
            assert_eq!(bytes[ENCODING] & 16 > 0, version.minor() == 5, "{version}");
            assert!(whole(&output).records == made.records, "{format} in {version}");
            let name = output.to_str().unwrap().to_owned();
            let again = terrane_cloud::open(&[name], &keep_all()).unwrap();
            assert_eq!(read_all(&again).unwrap().1.kept, 1234);
        }
    }
}

#[test]
fn versions_without_such_points_are_refused_and_others_are_chosen() {
    let place = Place::new();
    let input = place.write("in.las", &Made::new(3, Packing::Plain, 50).bytes());
    let to = |name: &str, version: LasVersion, format: Option<u8>| {
        let format = format.map(|number| PointFormat::new(number).unwrap());
        let output = place.path().join(name);
        run(&TranslateJob { version: Some(version), format, ..job(&[&input], &output) })
    };
    assert_eq!(to("out.las", LasVersion::V1_5, None).unwrap().point_format, 7);
    for (name, version, format, word) in [
        ("out.las", LasVersion::V1_5, Some(3), "LAS 1.5 does not support point format 3"),
        ("out.las", LasVersion::ALL[0], Some(6), "LAS 1.2 does not support point format 6"),
        ("out.copc.laz", LasVersion::V1_5, None, "COPC requires LAS 1.4"),
        ("out.csv", LasVersion::V1_4, None, "has no effect on text"),
    ] {
        let told = to(name, version, format).unwrap_err().to_string();
        assert!(told.contains(word) && told.contains("las_version"), "{told}");
    }
    assert_eq!(to("out.copc.laz", LasVersion::V1_4, None).unwrap().point_format, 7);
}

#[test]
fn las_1_5_is_read_with_its_times_and_written_where_it_is_asked_for() {
    let place = Place::new();
    for format in 6..11 {
        for packing in [Packing::Plain, Packing::Fixed(700)] {
            let (made, bytes) = latest(format, packing, None);
            let input = place.write("in.laz", &bytes);
            let output = place.path().join("out.laz");
            run(&job(&[&input], &output)).unwrap();
            assert!(whole(&output).records == made.records, "{format}");
            assert_eq!(std::fs::read(&output).unwrap()[25], 4, "not asked for");
        }
    }
    let output = place.path().join("out.laz");
    let version = Some(LasVersion::V1_5);
    let (made, bytes) = latest(6, Packing::Plain, Some(1300));
    let input = place.write("in.las", &bytes);
    let told = run(&job(&[&input], &output)).unwrap_err().to_string();
    assert!(told.contains("offset of 1300 million seconds"), "{told}");
    assert!(told.contains("‹las_version› 1.5"), "{told}");
    run(&TranslateJob { version, ..job(&[&input], &output) }).unwrap();
    let written = std::fs::read(&output).unwrap();
    assert_eq!(written[ENCODING] & 65, 65);
    assert_eq!(u16::from_le_bytes(number(&written, TIME_OFFSET)), 1300);
    // The first time is 0, which is none.
    let times = [TIMES, TIMES + 8].map(|at| f64::from_le_bytes(number(&written, at)));
    assert_eq!(times, [999.5, 0.5]);
    assert!(whole(&output).records == made.records);
    let text = place.path().join("out.csv");
    let notes = run(&job(&[&input], &text)).unwrap().notes.join("; ");
    assert!(notes.contains("minus 1300 million seconds"), "{notes}");
    // A thousand millions are what other versions count from, too.
    let (_, bytes) = latest(6, Packing::Plain, Some(1000));
    let usual = place.write("usual.las", &bytes);
    let plain = place.write("plain.las", &{
        let mut bytes = Made::new(6, Packing::Plain, 10).bytes();
        bytes[ENCODING] = 1;
        bytes
    });
    run(&job(&[&usual, &plain], &output)).unwrap();
    assert_eq!(std::fs::read(&output).unwrap()[ENCODING] & 65, 1);
    let told = run(&TranslateJob { version, ..job(&[&input, &plain], &output) }).unwrap_err();
    assert!(told.to_string().contains("GPS time encoding differs"), "{told}");
    let mut next = bytes.clone();
    next[25] = 6;
    let next = place.write("next.las", &next);
    let told = run(&job(&[&next], &output)).unwrap_err().to_string();
    assert!(told.contains("unknown LAS version 1.6"), "{told}");
}
