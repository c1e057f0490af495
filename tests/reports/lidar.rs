//! Reports on point clouds.

use std::collections::HashSet;

use crate::cli_support::{Place, json};
use crate::cloud_support::{Made, Packing, Random, Whole, number, raw, whole};

/// The records of a file that terrane wrote, by another decoder; sorted where order is that of an octree.
fn records(place: &Place, name: &str) -> Vec<Vec<u8>> {
    let mut found = whole(&place.path(name)).records;
    if name.contains(".copc.") {
        found.sort_unstable();
    }
    found
}

/// The notes of a run, one line each.
fn notes(place: &Place, args: &[&str]) -> String {
    let told = json(&place.ok(&[args, &["--json"]].concat()).out);
    let notes = told["notes"].as_array().unwrap().iter();
    notes.map(|note| note.as_str().unwrap()).collect::<Vec<_>>().join("\n")
}

fn put<const N: usize>(record: &mut [u8], at: usize, bytes: [u8; N]) {
    record[at..at + N].copy_from_slice(&bytes);
}

/// laz-rs/laz-rs#51: fields that are constant but not 0 are decoded otherwise by other programs.
#[test]
fn b1_constant_fields_of_compressed_points_are_read_by_another_decoder() {
    let place = Place::new();
    for (format, count) in [(6, 50_000), (7, 100_001), (8, 50_001)] {
        let mut random = Random::of(count);
        let mut made = Made::new(format, Packing::Plain, count);
        for (i, record) in (0..).zip(&mut made.records) {
            put(record, 12, 300_u16.to_le_bytes());
            put(record, 14, [2 | 3 << 4, 0x40, 6, random.below(256) as u8]);
            put(record, 18, (-5000_i16).to_le_bytes());
            put(record, 20, 1_u16.to_le_bytes());
            put(record, 22, (7e8 + f64::from(i) * 1e-5).to_le_bytes());
            record[30..].fill(9);
        }
        place.write("in.las", made.bytes());
        for output in ["out.laz", "out.copc.laz"] {
            place.ok(&["points", "in.las", output, "--overwrite"]);
            if output.contains("copc") {
                made.records.sort_unstable();
            }
            assert!(records(&place, output) == made.records, "{format}: {output}");
        }
        // What another encoder wrote is read.
        made.packing = Packing::Fixed(50_000);
        place.write("other.laz", made.bytes());
        place.ok(&["points", "other.laz", "back.las", "--overwrite"]);
        assert!(records(&place, "back.las") == made.records, "{format}");
    }
}

/// gadomski/las-rs#97: bytes behind the first zero of texts are not part of them.
#[test]
fn b2_texts_end_at_their_first_zero_and_are_written_with_zeros_behind() {
    let place = Place::new();
    let mut about = described("height", 3);
    about[4 + 7..4 + 10].copy_from_slice(b"\xfc9x");
    let vlrs = vec![("someone", 77, b"data".to_vec()), ("LASF_Spec", 4, about.to_vec())];
    let made = Made { vlrs, ..Made::new(6, Packing::Plain, 100).with_extra(2) };
    let mut bytes = made.bytes();
    put(&mut bytes, 26, *b"LDBV - LasW\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xfc\x39\0");
    put(&mut bytes, 58, *b"M\xfcnchen\0\xfc\x39");
    put(&mut bytes, 375 + 2 + 8, *b"\xfc\x39");
    put(&mut bytes, 375 + 22, *b"\xdcber\0\xfc");
    place.write("in.las", bytes);
    let told = place.ok(&["info", "in.las"]).out;
    for word in ["LDBV - LasW\u{1}", "München", "someone 77", "Über"] {
        assert!(told.contains(word), "{word}: {told}");
    }
    place.ok(&["points", "in.las", "out.las"]);
    let written = place.bytes("out.las");
    assert_eq!(written[26..58], *b"LDBV - LasW\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0");
    let found = whole(&place.path("out.las"));
    assert!(found.records == made.records);
    let users: Vec<_> = found.vlrs.iter().map(|(user, id, _)| (user.as_str(), *id)).collect();
    assert_eq!(users, [("LASF_Spec", 4), ("someone", 77)]);
    assert_eq!(found.vlrs[0].2, described("height", 3));
    place.ok(&["points", "in.las", "out.csv"]);
    assert!(heading(&place, "out.csv").ends_with(",height"));
}

/// A description of extra bytes.
fn described(name: &str, kind: u8) -> [u8; 192] {
    let mut about = [0; 192];
    about[2] = kind;
    about[4..4 + name.len()].copy_from_slice(name.as_bytes());
    about
}

fn heading(place: &Place, name: &str) -> String {
    String::from_utf8(place.bytes(name)).unwrap().lines().next().unwrap().to_owned()
}

/// r-lidar/lasR#117 and #104: descriptions of extra bytes that are not as the records are.
#[test]
fn b3_extra_bytes_that_fit_are_named_and_no_byte_is_moved() {
    let place = Place::new();
    let long = "a name of thirty-two characters!";
    let none = |bytes: u8| {
        let mut about = described("plain", 0);
        about[3] = bytes;
        about
    };
    // Descriptions, record by record; the columns that they are known by; and what notes say.
    type Case<'a> = (&'a str, Vec<Vec<[u8; 192]>>, &'a [&'a str], &'a [&'a str]);
    let four = |name: &str| described(name, 5);
    let two = |name: &str| described(name, 3);
    let cases: [Case<'_>; 10] = [
        ("more", vec![vec![four("a"), four("b"), four("c")]], &["a"], &["\"b\", \"c\" do not fit"]),
        ("none fits", vec![vec![described("a", 10)]], &[], &["\"a\" do not fit"]),
        ("fewer", vec![vec![two("a")]], &["a"], &[]),
        ("undocumented", vec![vec![none(2), two("a")]], &["a"], &[]),
        ("nothing", vec![vec![none(0), two("a"), two("b")]], &["a", "b"], &[]),
        ("deprecated", vec![vec![described("p", 13)]], &["p[0]", "p[1]"], &[]),
        ("unknown", vec![vec![two("a"), described("b", 99)]], &["a"], &["data type 99", "\"b\""]),
        ("two records", vec![vec![two("a")], vec![two("b")]], &["a", "b"], &["2 Extra Bytes VLRs"]),
        ("long name", vec![vec![four(long)]], &[long], &[]),
        ("one name", vec![vec![two("a"), two("a")]], &["a", "a"], &["are named \"a\""]),
    ];
    for (what, vlrs, names, words) in cases {
        let vlrs = vlrs.into_iter().map(|all| ("LASF_Spec", 4, all.concat())).collect();
        let made = Made { vlrs, ..Made::new(6, Packing::Fixed(100), 500).with_extra(4) };
        place.write("in.laz", made.bytes());
        let told = place.ok(&["info", "in.laz"]).out;
        let notes = notes(&place, &["points", "in.laz", "out.las", "--overwrite"]);
        for word in words {
            assert!(notes.contains(word) && told.contains(word), "{what}: {notes}, {told}");
        }
        let is_told = |text: &str| {
            ["data type", "do not fit", "extra bytes are named"]
                .iter()
                .any(|word| text.contains(word))
        };
        assert_eq!(
            is_told(&notes),
            words.iter().any(|word| !word.contains("VLRs")),
            "{what}: {notes}"
        );
        assert!(records(&place, "out.las") == made.records, "{what}");
        // Where records become others, extra bytes are moved as a whole.
        place.ok(&["points", "in.laz", "seven.las", "--point-format", "7", "--overwrite"]);
        let seven = records(&place, "seven.las");
        assert!(seven.iter().zip(&made.records).all(|(a, b)| a[36..] == b[30..]), "{what}");
        place.ok(&["points", "in.laz", "out.csv", "--overwrite"]);
        let names: Vec<_> = names.iter().map(|name| format!(",{name}")).collect();
        let expected = format!("point_source_id,gps_time{}", names.concat());
        assert!(heading(&place, "out.csv").ends_with(&expected), "{what}");
    }
}

/// PDAL/PDAL#2824 and #3348: extended records that are not where the header says, or not so long.
#[test]
fn b4_extended_records_that_are_not_there_are_named_and_points_are_read() {
    let place = Place::new();
    let text = b"GEOGCS[\"WGS 84\"]".to_vec();
    let made =
        Made { evlrs: vec![("LASF_Projection", 2112, text)], ..Made::new(6, Packing::Plain, 500) };
    let whole = made.bytes();
    let at = u64::from_le_bytes(number(&whole, 235));
    // Where the records begin, how many there are, how long the first one is; and what is to be said of it.
    for (start, count, length, word) in [
        (1 << 63, 0_u32, None, ""),
        (0, 0, None, ""),
        (0, 1, None, "the offset 0 is inside the header"),
        (374, 1, None, "the offset 374 is inside the header"),
        (1000, 1, None, "the offset 1000 is inside the points"),
        (at - 1, 1, None, "is inside the points"),
        (1 << 63, 1, None, "0 of 1 extended variable length records read"),
        (u64::MAX, u32::MAX, None, "0 of 4294967295 extended"),
        (at, 7, None, "1 of 7 extended"),
        (at, 1, Some(1_u64 << 40), "the next states 1099511627776 bytes"),
        (at, 1, Some(u64::MAX), "the next states 18446744073709551615 bytes"),
    ] {
        let mut bytes = whole.clone();
        put(&mut bytes, 235, start.to_le_bytes());
        put(&mut bytes, 243, count.to_le_bytes());
        if let Some(length) = length {
            put(&mut bytes, at as usize + 20, length.to_le_bytes());
        }
        place.write("in.las", bytes);
        for more in [&[][..], &["--salvage"]] {
            let args = [&["points", "in.las", "out.las", "--overwrite", "--memory", "64M"], more];
            let notes = notes(&place, &args.concat());
            assert_eq!(notes.contains("extended"), !word.is_empty(), "{start} {count}: {notes}");
            assert!(notes.contains(word), "{start} {count}: {notes}");
            assert!(records(&place, "out.las") == made.records, "{start} {count}");
        }
    }
}

/// qgis/QGIS#59887 and #61778: coordinates that do not fit into whole numbers of a fixed scale.
#[test]
fn b8_coordinates_of_any_size_fit_or_are_refused_by_name() {
    let place = Place::new();
    for (text, told, word) in [
        ("473850.0 637.0 67.8", "473850,637,67.8", ""),
        ("473850.0 637.0 67.8\n473851.5 637.25 67.9", "473850,637,67.8\n473851.5,637.25,67.9", ""),
        ("0.123456789012345 -0.1 1e-15", "0.123456789,-0.1,0", "rounded to 9 decimals"),
        ("10000000.123 10000000.456 1.5", "10000000.123,10000000.456,1.5", ""),
        ("-9999999.001 0.5 0\n9999999.001 0.5 0", "-9999999,0.5,0\n9999999,0.5,0", "rounded to 1"),
    ] {
        place.write("in.xyz", text);
        let notes = notes(&place, &["points", "cloud:in.xyz", "out.las", "--overwrite"]);
        assert_eq!(notes.contains("rounded"), !word.is_empty(), "{text}: {notes}");
        assert!(notes.contains(word), "{text}: {notes}");
        place.ok(&["points", "out.las", "out.csv", "--overwrite"]);
        let lines = String::from_utf8(place.bytes("out.csv")).unwrap();
        let xyz = |line: &str| line.split(',').take(3).collect::<Vec<_>>().join(",");
        let found: Vec<_> = lines.lines().skip(1).map(xyz).collect();
        assert_eq!(found.join("\n"), told);
    }
    // Files so many kilometres apart, in steps of a millimetre.
    for (far, is_one) in [(400, true), (3000, true), (5000, false)] {
        let mut made = Made { scale: [0.001; 3], ..Made::new(6, Packing::Plain, 50) };
        place.write("a.las", made.bytes());
        made.offset[0] += f64::from(far) * 1000.0;
        place.write("b.las", made.bytes());
        let args = ["points", "a.las", "b.las", "out.las", "--overwrite"];
        if !is_one {
            let words = ["x ranges from", "steps of 0.001", "steps of a file"];
            place.write("out.las", "").fails(&args, 65, &words);
            continue;
        }
        place.ok(&args);
        let bytes = place.bytes("out.las");
        let offset = f64::from_le_bytes(number(&bytes, 155));
        let x = |record: &Vec<u8>| (f64::from(raw(record)[0]) * 0.001 + offset).round();
        let found = records(&place, "out.las");
        let apart = x(&found[50]) - x(&found[0]);
        assert!((apart - f64::from(far) * 1000.0).abs() <= 1.0, "{far}: {apart}");
    }
}

/// hobuinc/untwine#63: points that get lost on their way into an octree.
#[test]
fn b9_octrees_hold_each_point_once_wherever_they_lie() {
    let place = Place::new();
    let whole_of = |place: f64| place.round() as i32;
    let ellipsoid = |i: usize| {
        let (height, turn) = (i as f64 / 50_000.0 - 1.0, i as f64 * 2.399_963);
        let round = (1.0 - height * height).sqrt() * 63_000.0;
        [round * turn.cos(), round * turn.sin(), height * 31_000.0].map(whole_of)
    };
    let plane = |i: usize| [(i % 400) as i32 * 10, (i / 400) as i32 * 10, 500];
    let slope = |i: usize| [(i % 400) as i32 * 10, (i % 400) as i32 * 10, (i / 400) as i32 * 3];
    let border =
        |i: usize| [i % 33, i / 33 % 33, i / 1089 % 33].map(|at| at as i32 * 1024 - 16_384);
    type Shape<'a> = (&'a str, usize, &'a dyn Fn(usize) -> [i32; 3]);
    let shapes: [Shape<'_>; 5] = [
        ("ellipsoid", 100_000, &ellipsoid),
        ("plane", 100_000, &plane),
        ("slope", 100_000, &slope),
        ("one place", 70_000, &|_| [-7, -8, -9]),
        ("borders of octants", 100_000, &border),
    ];
    for (what, count, at) in shapes {
        let mut made = Made { offset: [0.0; 3], ..Made::new(6, Packing::Plain, count) };
        for (i, record) in made.records.iter_mut().enumerate() {
            record[..12].copy_from_slice(at(i).map(i32::to_le_bytes).as_flattened());
        }
        place.write("in.las", made.bytes());
        place.ok(&["points", "in.las", "out.copc.laz", "--overwrite"]);
        let Whole { records: found, vlrs, .. } = whole(&place.path("out.copc.laz"));
        let (_, _, hierarchy) =
            vlrs.iter().find(|(user, id, _)| user == "copc" && *id == 1000).unwrap();
        let of_nodes =
            hierarchy.chunks(32).map(|entry| u64::from(u32::from_le_bytes(number(entry, 28))));
        assert_eq!((of_nodes.sum::<u64>(), found.len()), (count as u64, count), "{what}");
        // Readers walk down from the root.
        let keys = hierarchy
            .chunks(32)
            .map(|entry| [0, 4, 8, 12].map(|at| i32::from_le_bytes(number(entry, at))));
        let keys: HashSet<[i32; 4]> = keys.collect();
        let is_reached = |[level, x, y, z]: &[i32; 4]| {
            *level == 0 || keys.contains(&[level - 1, x / 2, y / 2, z / 2])
        };
        assert!(keys.iter().all(is_reached), "{what}: {keys:?}");
        place.ok(&["points", "out.copc.laz", "back.las", "--overwrite"]);
        let mut back = records(&place, "back.las");
        back.sort_unstable();
        made.records.sort_unstable();
        assert!(back == made.records, "{what}");
    }
}

/// hobuinc/untwine#146: classes that change where marks are set.
#[test]
fn b10_classes_and_marks_are_kept_apart() {
    let place = Place::new();
    // The byte of format 1; class and marks of format 6.
    let bytes =
        [(0x22, 2, 1), (0x42, 2, 2), (0x82, 2, 4), (0xE2, 2, 7), (0x1F, 31, 0), (0x0C, 12, 8)];
    let mut made = Made::new(1, Packing::Plain, bytes.len());
    for (i, (record, (byte, ..))) in made.records.iter_mut().zip(bytes).enumerate() {
        (record[14], record[15], record[16]) = (1 | 1 << 3, byte, 0);
        put(record, 20, (i as f64).to_le_bytes());
    }
    place.write("in.las", made.bytes());
    place.ok(&["points", "in.las", "out.copc.laz"]);
    let mut found = whole(&place.path("out.copc.laz")).records;
    let time = |record: &Vec<u8>| f64::from_le_bytes(number(record, 22));
    found.sort_by(|a, b| time(a).total_cmp(&time(b)));
    for (record, (byte, class, marks)) in found.iter().zip(bytes) {
        assert_eq!((record[16], record[15] & 15), (class, marks), "{byte:#x}");
    }
    place.ok(&["points", "out.copc.laz", "back.las", "--point-format", "1", "--sort", "time"]);
    let back = records(&place, "back.las");
    assert!(back.iter().zip(&made.records).all(|(a, b)| a[12..] == b[12..]));
    let mut made = Made::new(6, Packing::Plain, 8);
    for (marks, record) in (0..).zip(&mut made.records) {
        (record[14], record[15], record[16]) = (1 | 1 << 4, marks, 40);
    }
    place.write("six.las", made.bytes());
    place.ok(&["points", "six.las", "six.copc.laz"]);
    made.records.sort_unstable();
    assert!(records(&place, "six.copc.laz") == made.records);
    let args = ["points", "six.copc.laz", "one.las", "--point-format", "1"];
    place.fails(&args, 65, &["class 40", "point ", "--point-format 6 or higher"]);
}
