//! Damaged clouds: the good part with exact counts of what was lost, or one clear error; never a
//! panic, a hang, or more points or memory than a file has.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::cloud_support::{Made, Packing, Place, Random, copc, keep_all, read_file};
use crate::data;
use terrane::{ErrorKind, Result};
use terrane_cloud::{CloudOpenOptions, ReturnCounts};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_lidar::points::{self, Dedupe, TranslateJob};

/// Far below what any of the lying headers asks for.
const MAX_MEMORY: u64 = 512 << 20;
/// A file that takes longer is one that hangs.
const PATIENCE: Duration = Duration::from_secs(10);

type Found = Result<(Vec<[f64; 3]>, ReturnCounts)>;

fn salvage() -> CloudOpenOptions {
    CloudOpenOptions { salvage: true, ..keep_all() }
}

/// Reads strictly and with salvage; checks what holds for any file.
fn both(name: &str) -> (Found, Found) {
    let start = Instant::now();
    let (strict, loose) = (read_file(name, &keep_all()), read_file(name, &salvage()));
    assert!(start.elapsed() < PATIENCE, "{name} hangs");
    for error in [&strict, &loose].into_iter().filter_map(|found| found.as_ref().err()) {
        let told = error.to_string();
        assert!(told.contains(Path::new(name).file_name().unwrap().to_str().unwrap()), "{told}");
        assert!(!told.contains('\n') && told.len() < 1000, "{told}");
    }
    if let (Ok(strict), Ok(loose)) = (&strict, &loose) {
        assert_eq!(strict, loose, "salvage changes nothing about sound files");
        assert_eq!((strict.1.lost, strict.1.outside), (0, 0));
    }
    (strict, loose)
}

fn peak_is_low() -> bool {
    terrane_engine::peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY)
}

/// Small files, one of each kind.
fn small(count: usize) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("old.las", Made::new(1, Packing::Plain, count).bytes()),
        ("new.las", Made::new(6, Packing::Plain, count).bytes()),
        ("wise.laz", Made::new(3, Packing::Fixed(7), count).bytes()),
        ("stream.laz", Made::new(1, Packing::Stream, count).bytes()),
        ("layers.laz", Made::new(7, Packing::Fixed(7), count).bytes()),
        ("variable.laz", Made::new(6, Packing::Variable(5), count).with_extra(2).bytes()),
        ("tree.copc.laz", copc(count / 9)),
    ]
}

#[test]
fn cut_off_anywhere() {
    let place = Place::new();
    for (name, bytes) in small(9) {
        let file = place.write(name, &bytes);
        let whole = both(&file).0.unwrap();
        for length in 1..bytes.len() {
            let file = place.write(name, &bytes[..length]);
            let (strict, loose) = both(&file);
            for (points, census) in [strict, loose].into_iter().flatten() {
                assert!(whole.0.starts_with(&points), "{name} cut at {length}");
                assert_eq!(census.read, whole.1.read, "{name} cut at {length}");
                assert_eq!(census.lost, whole.1.read - points.len() as u64);
            }
        }
    }
    assert!(peak_is_low());
}

#[test]
fn a_cut_file_gives_its_whole_records_or_chunks() {
    let place = Place::new();
    let made = Made::new(6, Packing::Plain, 100);
    let bytes = made.bytes();
    let (strict, loose) = both(&place.write("a.las", &bytes[..bytes.len() - 31]));
    let told = strict.unwrap_err().to_string();
    assert!(told.contains("expected 100 points, found 98") && told.contains("‹salvage›"), "{told}");
    let (points, census) = loose.unwrap();
    assert_eq!((points.as_slice(), census.lost), (&made.world()[..98], 2));
    let made = Made::new(6, Packing::Fixed(30), 100);
    let bytes = made.bytes();
    let (strict, loose) = both(&place.write("a.laz", &bytes[..bytes.len() - 200]));
    let told = strict.unwrap_err().to_string();
    assert!(told.contains("chunk table") && told.contains("‹salvage›"), "{told}");
    let (points, census) = loose.unwrap();
    assert_eq!((points.as_slice(), census.lost), (&made.world()[..90], 10));
}

#[test]
fn a_broken_chunk_leaves_the_others() {
    let place = Place::new();
    let made = Made::new(6, Packing::Fixed(50), 200);
    let mut bytes = made.bytes();
    let at = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize + 8;
    // The number of points of the first chunk.
    bytes[at + 30] ^= 1;
    let (strict, loose) = both(&place.write("a.laz", &bytes));
    let told = strict.unwrap_err().to_string();
    assert!(
        told.contains("a.laz: chunk 0, points 0 to 49:") && told.contains("‹salvage›"),
        "{told}"
    );
    let (points, census) = loose.unwrap();
    assert_eq!((points.as_slice(), census.lost), (&made.world()[50..], 50));
}

#[test]
fn a_layer_that_ends_early_costs_its_chunk() {
    let place = Place::new();
    let made = Made::new(6, Packing::Fixed(30_000), 40_000);
    let mut bytes = made.bytes();
    let first = first_chunk(&bytes);
    // The length of the layer of heights.
    let length = &mut bytes[first + 30 + 4 + 4..][..4];
    let shorter = u32::from_le_bytes((&*length).try_into().unwrap()) / 5 * 4;
    length.copy_from_slice(&shorter.to_le_bytes());
    let (strict, loose) = both(&place.write("a.laz", &bytes));
    let (points, census) = loose.unwrap();
    assert!(points == made.world()[30_000..] && census.lost == 30_000);
    let told = strict.unwrap_err().to_string();
    assert!(told.contains("a.laz: chunk 0, points 0 to 29999: chunk is damaged"), "{told}");
}

/// Where the first chunk of a file is.
fn first_chunk(bytes: &[u8]) -> usize {
    u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize + 8
}

/// How many mutants of a file are tried: more with TERRANE_MUTATIONS.
fn mutations(usual: usize) -> usize {
    let more = std::env::var("TERRANE_MUTATIONS").ok().and_then(|count| count.parse().ok());
    more.unwrap_or(usual)
}

/// Damages bytes of points in one of the ways that disks and copies do.
fn damage(bytes: &mut Vec<u8>, from: usize, random: &mut Random) {
    let at = from + random.below(bytes.len() - from);
    let most = bytes.len() - at;
    match random.below(8) {
        0..=3 => bytes[at] ^= 1 << random.below(8),
        4 => (0..1 + random.below(4)).for_each(|i| {
            let at = (at + 97 * i).min(bytes.len() - 1);
            bytes[at] = random.below(256) as u8;
        }),
        5 => bytes[at..at + most.min(1 + random.below(512))].fill(0),
        6 => {
            let block = bytes[from..from + most.min(64)].to_vec();
            bytes[at..at + block.len()].copy_from_slice(&block);
        }
        _ => bytes.truncate(at.max(from + 1)),
    }
}

/// Points kept, points lost, and how many of those kept are not where the sound file has them: what is
/// kept is in the order of the file, and chunks are kept whole.
fn invented(whole: &[[f64; 3]], kept: &[[f64; 3]]) -> usize {
    let (mut rest, mut invented) = (whole.iter(), 0);
    for point in kept {
        let mut ahead = rest.clone();
        match ahead.find(|sound| *sound == point) {
            Some(_) => rest = ahead,
            None => invented += 1,
        }
    }
    invented
}

#[test]
fn nothing_is_invented_from_damaged_points() {
    let place = Place::new();
    let kinds = [
        ("one.laz", Made::new(1, Packing::Fixed(400), 2000)),
        ("three.laz", Made::new(3, Packing::Fixed(400), 2000).with_extra(2)),
        ("stream.laz", Made::new(1, Packing::Stream, 2000)),
        ("six.laz", Made::new(6, Packing::Fixed(400), 2000)),
        ("eight.laz", Made::new(8, Packing::Variable(300), 2000).with_extra(3)),
    ];
    let (mut refused, mut kept, mut tried) = (0, 0, 0);
    for (name, made) in &kinds {
        let (sound, whole) = (made.bytes(), made.world());
        // What is not under the points of the first chunk: their first one is stored as it is.
        let from = first_chunk(&sound) + 80;
        for number in 0..mutations(150) {
            let mut bytes = sound.clone();
            damage(&mut bytes, from, &mut Random::of(number));
            let file = place.write(name, &bytes);
            let (strict, loose) = (read_file(&file, &keep_all()), read_file(&file, &salvage()));
            let is_raw = |found: &[[f64; 3]]| shifted(&whole, found);
            if let Ok((points, _)) = &strict {
                assert!(*points == whole || is_raw(points), "{name} {number}: read as sound");
            }
            refused += usize::from(strict.is_err());
            if let Ok((points, census)) = loose {
                assert_eq!(census.read, census.kept + census.lost + census.outside);
                let wrong = if is_raw(&points) { 0 } else { invented(&whole, &points) };
                assert_eq!(wrong, 0, "{name} {number}: {} kept", points.len());
                kept += points.len();
            }
            tried += 1;
        }
    }
    assert!(refused * 2 > tried && kept > 100 * tried, "{refused} refused, {kept} kept of {tried}");
}

/// Whether the only points that differ are those of a chunk whose first point, which is stored as it is,
/// was changed: they lie elsewhere by one and the same step, and nothing in a file tells.
fn shifted(whole: &[[f64; 3]], found: &[[f64; 3]]) -> bool {
    if whole.len() != found.len() {
        return false;
    }
    let step = |(a, b): (&[f64; 3], &[f64; 3])| {
        [0, 1, 2].map(|axis| ((b[axis] - a[axis]) * 1000.0).round() as i64)
    };
    let mut steps: Vec<_> = whole.iter().zip(found).map(step).filter(|s| *s != [0; 3]).collect();
    steps.dedup();
    steps.len() == 1
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn nothing_is_invented_from_damaged_files_of_the_corpus() {
    let (mut tried, mut lost) = (0, 0);
    let most = if std::env::var_os("TERRANE_MUTATIONS").is_some() { usize::MAX } else { 250_000 };
    for path in [data::files("lidar"), data::files("lidar/formats")].concat() {
        let sound = std::fs::read(&path).unwrap();
        if path.extension().is_none_or(|ending| ending != "laz") || sound.len() > most {
            continue;
        }
        let name = path.to_str().unwrap();
        let whole = read_file(name, &keep_all()).unwrap().0;
        let place = Place::new();
        for number in 0..mutations(6) {
            let mut bytes = sound.clone();
            damage(&mut bytes, first_chunk(&sound) + 100, &mut Random::of(number));
            let file = place.write("a.laz", &bytes);
            if let Ok((points, census)) = read_file(&file, &salvage()) {
                assert_eq!(invented(&whole, &points), 0, "{name}, {number}");
                lost += usize::from(census.lost > 0);
            }
            if let Ok((points, _)) = read_file(&file, &keep_all()) {
                assert!(points == whole, "{name}, {number}: read as sound");
            }
            tried += 1;
        }
    }
    println!("{tried} mutants, {lost} of them lost points");
    assert!(tried >= 40 && lost > tried / 4, "{lost} of {tried} lost points");
}

#[test]
fn a_chunk_with_a_point_that_cannot_be_is_given_up() {
    let place = Place::new();
    for (format, packing) in
        [(1, Packing::Fixed(50)), (6, Packing::Fixed(50)), (1, Packing::Stream)]
    {
        let mut made = Made::new(format, packing, 200);
        let mut bytes = made.bytes();
        let reach =
            |bytes: &mut [u8], east: f64| bytes[179..187].copy_from_slice(&east.to_le_bytes());
        // The header's bounds end before the easternmost point of all.
        let world = made.world();
        let east = world.iter().map(|p| p[0]).fold(f64::NEG_INFINITY, f64::max);
        reach(&mut bytes, east - 0.02);
        let size = if packing == Packing::Stream { 200 } else { 50 };
        let sound = |chunk: &&[[f64; 3]]| chunk.iter().all(|p| p[0] < east - 0.015);
        let expected: Vec<_> = world.chunks(size).filter(sound).flatten().copied().collect();
        let (points, census) = read_file(&place.write("a.laz", &bytes), &salvage()).unwrap();
        assert!(points == expected && census.lost == 200 - points.len() as u64, "{format}");
        // A return behind the last one.
        made.records[60][14] = if format < 6 { 5 | 2 << 3 } else { 5 | 2 << 4 };
        let (points, _) = read_file(&place.write("b.laz", &made.bytes()), &salvage()).unwrap();
        assert_eq!(points.len(), 200 - size, "{format}");
    }
}

#[test]
fn a_damaged_table_loses_no_chunk() {
    let place = Place::new();
    for (format, name) in [(1, "a.laz"), (6, "b.laz")] {
        let made = Made::new(format, Packing::Fixed(50), 200);
        let mut bytes = made.bytes();
        let table = u64::from_le_bytes(bytes[first_chunk(&bytes) - 8..][..8].try_into().unwrap());
        bytes[table as usize + 9] ^= 0x55;
        let file = place.write(name, &bytes);
        assert!(read_file(&file, &keep_all()).unwrap_err().to_string().contains("chunk table"));
        assert_eq!(read_file(&file, &salvage()).unwrap().0, made.world(), "{name}");
    }
}

#[test]
fn items_that_are_not_known_are_named() {
    let place = Place::new();
    let mut bytes = Made::new(1, Packing::Fixed(50), 100).with_extra(2).bytes();
    let items = 227 + 54 + 34;
    // Of version 1.
    (0..3).for_each(|item| bytes[items + 6 * item + 4] = 1);
    let (strict, loose) = both(&place.write("a.laz", &bytes));
    for told in [strict, loose].map(|found| found.unwrap_err().to_string()) {
        assert!(told.contains("extra bytes (type 0) of 2 bytes, version 1"), "{told}");
    }
}

#[test]
fn points_outside_the_bounds_claimed() {
    let place = Place::new();
    let made = Made::new(1, Packing::Plain, 100);
    let mut bytes = made.bytes();
    let at = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize + 28 * 60;
    bytes[at..at + 4].copy_from_slice(&1_000_000_i32.to_le_bytes());
    let (strict, loose) = both(&place.write("a.las", &bytes));
    let told = strict.unwrap_err().to_string();
    assert!(told.contains("a.las: point 60:") && told.contains("outside"), "{told}");
    let (points, census) = loose.unwrap();
    assert_eq!((points.len(), census.outside, census.read), (99, 1, 100));
    let mut options = keep_all();
    options.filter.classes = Some(vec![99]);
    let name = place.write("b.las", &bytes);
    assert!(read_file(&name, &options).is_ok(), "filters come first");
}

#[test]
fn headers_that_make_no_sense() {
    let place = Place::new();
    let sound = Made::new(6, Packing::Plain, 10).bytes();
    let f64s = |value: f64| value.to_le_bytes().to_vec();
    for (at, value, told) in [
        (0, b"LASX".to_vec(), "signature LASF is missing"),
        (24, vec![2, 0], "version 2.0"),
        (104, vec![11], "point format 11"),
        (104, vec![0x80 | 6], "LASzip VLR of the compressed points is missing"),
        (105, vec![29, 0], "record length is 29"),
        (94, vec![0, 0], "header is 0 bytes long"),
        (96, vec![255; 4], "point offset 4294967295"),
        (247, vec![255; 8], "number of points"),
        (131, f64s(0.0), "scale of x is 0"),
        (139, f64s(f64::NAN), "scale of y is NaN"),
        (147, f64s(-0.01), "scale of z is -0.01"),
        (155, f64s(f64::INFINITY), "offset inf"),
        (179, f64s(f64::NAN), "bounds of x"),
        (179, f64s(-1e9), "bounds of x"),
        (179, f64s(1e12), "steps"),
    ] {
        let mut bytes = sound.clone();
        bytes[at..at + value.len()].copy_from_slice(&value);
        let error = both(&place.write("a.las", &bytes)).0.unwrap_err().to_string();
        assert!(error.contains(told) && error.contains("; "), "{error}");
    }
    assert!(both(&place.write("empty.las", b"")).0.unwrap_err().to_string().contains("empty"));
}

/// Changes a few bytes, to anything or to values that tend to hurt.
fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..1 + random.below(4) {
        // Headers decide most.
        let most = if random.below(2) == 0 { bytes.len().min(700) } else { bytes.len() };
        let at = random.below(most);
        match random.below(6) {
            0 => bytes[at] = 0,
            1 => bytes[at] = 0xff,
            2 => bytes[at] ^= 1 << random.below(8),
            3 => {
                let numbers = [0, 1, 0x7fff_ffff, u64::MAX >> 1, u64::MAX, bytes.len() as u64];
                let number = numbers[random.below(numbers.len())].to_le_bytes();
                let width = [2, 4, 8][random.below(3)].min(bytes.len() - at);
                bytes[at..at + width].copy_from_slice(&number[..width]);
            }
            _ => bytes[at] = random.below(256) as u8,
        }
    }
    match random.below(20) {
        0 => bytes.truncate(1 + random.below(bytes.len())),
        1 => bytes.extend((0..random.below(100)).map(|i| i as u8)),
        _ => {}
    }
}

#[test]
fn ten_thousand_mutations() {
    let place = Place::new();
    let kinds = small(12);
    let (mut sound, mut saved) = (0, 0);
    for number in 0..10_000 {
        // The octree has many chunks, and each makes the decoder anew.
        let kind = if number % 20 == 0 { kinds.len() - 1 } else { number % (kinds.len() - 1) };
        let (name, bytes) = &kinds[kind];
        let mut bytes = bytes.clone();
        mutate(&mut bytes, &mut Random::of(number));
        let file = place.write(name, &bytes);
        let start = Instant::now();
        match read_file(&file, &keep_all()) {
            Ok(_) => sound += 1,
            Err(error) => {
                assert!(error.path().is_some_and(|path| path.ends_with(name)), "{error}");
                saved += usize::from(read_file(&file, &salvage()).is_ok());
            }
        }
        assert!(start.elapsed() < PATIENCE, "mutation {number} hangs");
    }
    assert!((1000..9000).contains(&sound) && saved > 500, "{sound} sound, {saved} saved");
    assert!(peak_is_low());
}

#[test]
fn points_of_damaged_files_are_written_or_nothing_is() {
    let place = Place::new();
    let kinds = small(12);
    let endings = ["las", "laz", "copc.laz", "csv"];
    let resources = Resources { threads: 1, memory: 256 << 20, temp_dir: None };
    let (mut written, mut refused) = (0, 0);
    for number in 0..2_000 {
        let (name, bytes) = &kinds[number % kinds.len()];
        let mut bytes = bytes.clone();
        mutate(&mut bytes, &mut Random::of(number + 77_777));
        let file = place.write(name, &bytes);
        let output = place.path().join(format!("out.{}", endings[number / 7 % 4]));
        let cloud = if number % 3 == 0 { salvage() } else { keep_all() };
        let job = TranslateJob {
            cloud,
            resources: resources.clone(),
            ..TranslateJob::new(vec![file], &output)
        }
        .stages((number % 5 == 0).then_some(Dedupe));
        let start = Instant::now();
        match points::run(&job, &Silent, &Cancel::default()) {
            Ok(report) => {
                let prefix = if number / 7 % 4 == 3 { "cloud:" } else { "" };
                // What is only copied may be of any extent.
                let options = CloudOpenOptions { any_extent: true, ..keep_all() };
                let again = read_file(&format!("{prefix}{}", output.display()), &options);
                let (_, census) = again.unwrap_or_else(|error| panic!("{number}: {error}"));
                assert_eq!(report.points, census.kept, "{number}");
                std::fs::remove_file(&output).unwrap();
                written += 1;
            }
            Err(error) => {
                let is_named = error.path().is_some_and(|path| path.ends_with(name));
                assert!(is_named || error.kind() == ErrorKind::Resource, "{number}: {error}");
                assert!(!output.exists());
                refused += 1;
            }
        }
        assert!(start.elapsed() < PATIENCE, "mutation {number} hangs");
    }
    assert!(written > 200 && refused > 200, "{written} written, {refused} refused");
    assert!(peak_is_low());
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn malformed_files_of_the_corpus() {
    let mut seen = 0;
    for path in data::files("malformed/las") {
        let name = path.file_name().unwrap().to_str().unwrap();
        let (strict, loose) = both(path.to_str().unwrap());
        let count = |found: &Found| found.as_ref().map_or(-1, |(points, _)| points.len() as i64);
        let expected = match name {
            "Semis_2022_0906_6665_LA93_IGN69_nok.laz" => (-1, -1),
            "bad-geotiff-keys.las" | "bad_vlr_count.las" => (10, 10),
            "garbage_nVariableLength.las" => (-1, 718),
            "lots_of_vlr.las" => (1, 1),
            "no-points.las" => (0, 0),
            "spurious.las" => (-1, 1064),
            "test_pdalfail_0643_6319_LA93_IGN69.laz" => (89, 89),
            "wontcompress3.las" => (1000, 1000),
            _ => panic!("{name} is new: say what it should give"),
        };
        assert_eq!((count(&strict), count(&loose)), expected, "{name}");
        seen += 1;
    }
    assert!(seen == 9 && peak_is_low());
}
