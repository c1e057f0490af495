//! Clouds of every point format, version and packing, made here and real: all points come out, as
//! independent readers have them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::cloud_support::{Made, Packing, Place, copc, keep_all, raw, read_all, read_file};
use crate::data;
use terrane_cloud::{self as cloud, CloudOpenOptions, PointSource};

const PACKINGS: [Packing; 5] = [
    Packing::Plain,
    Packing::Fixed(100),
    Packing::Fixed(50_000),
    Packing::Variable(77),
    Packing::Stream,
];

#[test]
fn all_formats_versions_and_packings() {
    let place = Place::new();
    for format in 0..=10 {
        for packing in PACKINGS {
            if packing == Packing::Stream && format > 5 {
                continue;
            }
            for (extra, count) in [(0, 777), (5, 321), (0, 1)] {
                let mut made = Made::new(format, packing, count).with_extra(extra);
                made.minor = if format > 5 { 4 } else { 2 + format / 4 };
                let name = place.write("a.laz", &made.bytes());
                let (points, census) = read_file(&name, &keep_all()).unwrap();
                assert_eq!(points, made.world(), "format {format}, {packing:?}");
                assert_eq!((census.read, census.kept), (count as u64, count as u64));
            }
        }
    }
}

#[test]
fn old_and_new_versions_without_points() {
    let place = Place::new();
    for minor in 0..=4 {
        for packing in [Packing::Plain, Packing::Fixed(50_000)] {
            let made = Made { minor, ..Made::new(1, packing, 0) };
            let cloud = cloud::open(&[place.write("a.las", &made.bytes())], &keep_all()).unwrap();
            assert_eq!((cloud.info().bounds, cloud.info().count), (None, 0));
            assert_eq!(read_all(&cloud).unwrap().0.len(), 0);
        }
        let made = Made { minor, ..Made::new(1, Packing::Plain, 3) };
        let name = place.write("a.las", &made.bytes());
        assert_eq!(read_file(&name, &keep_all()).unwrap().0, made.world());
    }
}

#[test]
fn records_longer_than_their_format_and_a_gap_before_points() {
    let place = Place::new();
    let made = Made { extra: 9, ..Made::new(3, Packing::Plain, 50) }.with_extra(9);
    let mut bytes = made.bytes();
    bytes.splice(227..227, [7; 13]);
    bytes[96..100].copy_from_slice(&240_u32.to_le_bytes());
    let name = place.write("gap.las", &bytes);
    assert_eq!(read_file(&name, &keep_all()).unwrap().0, made.world());
}

#[test]
fn an_unfinished_chunk_table_is_found_at_the_end_or_done_without() {
    let place = Place::new();
    for format in [0, 6] {
        let made = Made::new(format, Packing::Fixed(100), 350);
        let bytes = made.bytes();
        let at = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
        let table = bytes[at..at + 8].to_vec();
        for unset in [0_i64, -1] {
            let mut late = bytes.clone();
            late[at..at + 8].copy_from_slice(&unset.to_le_bytes());
            let mut never = late.clone();
            late.extend(&table);
            never.truncate(u64::from_le_bytes(table[..].try_into().unwrap()) as usize);
            for (name, bytes) in [("late.laz", late), ("never.laz", never)] {
                let name = place.write(name, &bytes);
                let cloud = cloud::open(std::slice::from_ref(&name), &keep_all()).unwrap();
                assert_eq!(read_all(&cloud).unwrap().0, made.world(), "{name}, format {format}");
                assert_eq!(
                    cloud.notes().iter().any(|n| n.contains("chunk")),
                    name.contains("never")
                );
            }
        }
    }
}

#[test]
fn an_octree_equals_the_same_file_without_it() {
    let place = Place::new();
    let tree = copc(40);
    let name = place.write("a.copc.laz", &tree);
    let mut plain = tree.clone();
    plain[375 + 2..375 + 6].copy_from_slice(b"xopc");
    let whole = read_file(&place.write("b.laz", &plain), &keep_all()).unwrap();
    assert_eq!(read_file(&name, &keep_all()).unwrap(), whole);
    let mut options = keep_all();
    options.filter.bounds = Some([0.0, 0.0, 1000.0, 1000.0]);
    let part = cloud::open(std::slice::from_ref(&name), &options).unwrap();
    let (mut found, census) = read_all(&part).unwrap();
    let within = |p: &&[f64; 3]| p[0] <= 1000.0 && p[1] <= 1000.0;
    let mut expected: Vec<_> = whole.0.iter().filter(within).copied().collect();
    found.sort_by(|a, b| a.partial_cmp(b).unwrap());
    expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(found, expected);
    assert_eq!((part.parts(), census.read), (3, 120), "the root and two of eight are touched");
}

fn real_files() -> Vec<PathBuf> {
    let mut files = data::files("lidar");
    files.extend(data::files("lidar/formats"));
    files
}

/// Points as the `las` crate has them: coordinates, class, return, returns.
fn oracle(path: &PathBuf) -> Vec<([f64; 3], u8, u8, u8)> {
    let points = las::Reader::from_path(path).unwrap().read_all().unwrap();
    let places = points.x().zip(points.y()).zip(points.z()).map(|((x, y), z)| [x, y, z]);
    let returns = points.return_number().zip(points.number_of_returns());
    let all = places.zip(points.classification()).zip(returns);
    all.map(|((place, class), (number, returns))| (place, class, number, returns)).collect()
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn real_files_hold_what_another_reader_finds() {
    for path in real_files() {
        let name = path.to_str().unwrap().to_owned();
        let cloud = cloud::open(std::slice::from_ref(&name), &keep_all()).unwrap();
        let expected = oracle(&path);
        let (points, census) = read_all(&cloud).unwrap();
        assert_eq!((points.len(), census.read), (expected.len(), expected.len() as u64), "{name}");
        for (a, (b, ..)) in points.iter().zip(&expected) {
            let scale = cloud.info().frame.scale;
            assert!((0..3).all(|i| (a[i] - b[i]).abs() < scale[i] / 1000.0), "{name}: {a:?} {b:?}");
        }
        let mut at = expected.iter();
        for part in 0..cloud.parts() {
            cloud
                .records(part, &mut |r| {
                    let (_, class, number, returns) = *at.next().unwrap();
                    assert_eq!((r.class, r.number, r.returns), (class, number, returns), "{name}");
                })
                .unwrap();
        }
    }
}

/// What the catalogue of the data says of classes.
#[test]
#[ignore = "needs TERRANE_DATA"]
fn classes_of_a_real_tile() {
    let name = data::at("lidar/ahn3_delft_1.laz").to_str().unwrap().to_owned();
    let cloud = cloud::open(&[name], &keep_all()).unwrap();
    let mut classes = BTreeMap::new();
    for part in 0..cloud.parts() {
        cloud.records(part, &mut |r| *classes.entry(r.class).or_insert(0) += 1).unwrap();
    }
    let known = [(1, 196_137), (2, 195_988), (6, 246_753), (9, 267), (26, 1365)];
    assert_eq!(classes, BTreeMap::from(known));
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn a_real_octree_equals_its_file_read_as_chunks() {
    let place = Place::new();
    for path in ["lidar/lone-star.copc.laz", "lidar/formats/simple.copc.laz"].map(data::at) {
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[375 + 2..375 + 6].copy_from_slice(b"xopc");
        let plain = place.write("plain.laz", &bytes);
        let options = CloudOpenOptions::default();
        let tree = read_file(path.to_str().unwrap(), &options).unwrap();
        assert_eq!(tree, read_file(&plain, &options).unwrap());
    }
}

#[test]
fn points_far_from_the_offset_are_exact() {
    let place = Place::new();
    let mut made = Made::new(6, Packing::Plain, 100);
    for record in &mut made.records {
        let x = raw(record)[0] + 2_000_000_000;
        record[..4].copy_from_slice(&x.to_le_bytes());
    }
    let name = place.write("far.las", &made.bytes());
    let (points, _) = read_file(&name, &keep_all()).unwrap();
    for (a, b) in points.iter().zip(made.world()) {
        assert!((a[0] - b[0]).abs() < 1e-6 && a[1..] == b[1..], "{a:?} {b:?}");
    }
}
