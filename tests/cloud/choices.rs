//! Flight lines that overlap, attributes that are set, points in another order.

use std::collections::HashMap;

use terrane_engine::Resources;
use terrane_lidar::points::{Assign, Overlap, Sort, TranslateJob};

use crate::cloud_support::{Made, Packing, Place, raw};
use crate::translate::{job, number, run, whole};

/// Two strips of points side by side, whose scanners look down in the middle of each.
fn strips(format: u8) -> Made {
    let mut made = Made::new(format, Packing::Fixed(700), 20_000);
    for (i, record) in made.records.iter_mut().enumerate() {
        let (line, across) = (i % 3 / 2, (i * 7919 % 6007) as i32);
        let place = [across + 4000 * line as i32, (i * 104_729 % 4001) as i32, (i % 50) as i32];
        record[..12].copy_from_slice(place.map(i32::to_le_bytes).as_flattened());
        let angle = (across - 3000) / 2;
        let source = 7 - line as u16;
        if format < 6 {
            record[16] = (angle / 60) as i8 as u8;
            record[18..20].copy_from_slice(&source.to_le_bytes());
        } else {
            record[18..20].copy_from_slice(&(angle as i16).to_le_bytes());
            record[20..22].copy_from_slice(&source.to_le_bytes());
        }
    }
    made
}

#[test]
fn in_each_cell_one_flight_line_is_kept() {
    let place = Place::new();
    for format in [1, 6] {
        let made = strips(format);
        let input = place.write("in.laz", &made.bytes());
        let output = place.path().join("out.las");
        let angle = |record: &[u8]| match format {
            1 => i32::from(record[16] as i8).abs(),
            _ => i32::from(i16::from_le_bytes(number(record, 18))).abs(),
        };
        let source =
            |record: &[u8]| u16::from_le_bytes(number(record, if format == 1 { 18 } else { 20 }));
        // Cells of 200 steps, whose corners are at multiples of that.
        let cell = |record: &[u8]| [raw(record)[0].div_euclid(200), raw(record)[1].div_euclid(200)];
        let mut best: HashMap<[i32; 2], (i32, u16)> = HashMap::new();
        for record in &made.records {
            let one = (angle(record), source(record));
            best.entry(cell(record)).and_modify(|best| *best = one.min(*best)).or_insert(one);
        }
        let is_kept = |record: &&Vec<u8>| best[&cell(record)].1 == source(record);
        let expected: Vec<_> = made.records.iter().filter(is_kept).cloned().collect();
        let overlap = Some(Overlap { cell: Some(2.0) });
        let mut bytes = Vec::new();
        for (threads, memory) in [(1, 64), (3, 1024)] {
            let resources = Resources { threads, memory: memory << 20, temp_dir: None };
            let job = TranslateJob { resources, ..job(&[&input], &output) }.stages(overlap);
            let report = run(&job).unwrap();
            assert!(whole(&output).records == expected, "{format}");
            let left_out = made.records.len() - expected.len();
            assert!(
                left_out > 2000
                    && report.notes.iter().any(|note| note.contains(&format!("{left_out} points")))
            );
            bytes.push(std::fs::read(&output).unwrap());
        }
        assert!(bytes[0] == bytes[1]);
        // 100 by 40: twice the spacing of 20,000 points is some 0.9.
        let usual = job(&[&input], &output).stage(Overlap::default());
        assert!(run(&usual).unwrap().notes.iter().any(|note| note.ends_with("in cells of 1")));
    }
}

#[test]
fn attributes_are_set_one_after_the_other() {
    let place = Place::new();
    let mut about = vec![0; 192];
    (about[2], about[3]) = (6, 8);
    about[4..7].copy_from_slice(b"own");
    about[112..120].copy_from_slice(&0.5_f64.to_le_bytes());
    for format in [3, 7] {
        let vlrs = vec![("LASF_Spec", 4, about.clone())];
        let mut made = Made { vlrs, ..Made::new(format, Packing::Fixed(700), 5000).with_extra(4) };
        for record in &mut made.records {
            record[12..14].copy_from_slice(&1000_u16.to_le_bytes());
        }
        let input = place.write("in.laz", &made.bytes());
        let output = place.path().join("out.laz");
        let assign = [
            "intensity = (intensity + 24) / 4",
            "class=return+1",
            "OWN = z * 2 - intensity",
            "nir=1",
        ];
        let all = assign.map(|text| text.parse::<Assign>().unwrap()).to_vec();
        let told = run(&job(&[&input], &output).stages(all.clone())).unwrap_err();
        assert!(told.to_string().contains("no attribute \"nir\""), "{told}");
        run(&job(&[&input], &output).stages(all[..3].to_vec())).unwrap();
        let found = whole(&output).records;
        assert_eq!(found.len(), 5000);
        for (before, after) in made.records.iter().zip(&found) {
            let (is_old, end) = (format == 3, before.len() - 4);
            let mut expected = before.clone();
            expected[12..14].copy_from_slice(&256_u16.to_le_bytes());
            let returned = before[14] & if is_old { 7 } else { 15 };
            match is_old {
                true => expected[15] = before[15] & !31 | (returned + 1),
                false => expected[16] = returned + 1,
            }
            // Heights are in thousandths, and the field in halves.
            let own = (f64::from(raw(before)[2]) / 1000.0 * 2.0 - 256.0) * 2.0;
            let stored = i32::from_le_bytes(number(after, end));
            assert!((f64::from(stored) - own).abs() <= 0.5 + 1e-9);
            expected[end..].copy_from_slice(&stored.to_le_bytes());
            assert_eq!(*after, expected);
        }
        for (text, told) in [
            ("class=300", "300 does not fit into classification"),
            ("user_data=-1", "-1 does not fit into user_data"),
            ("intensity=intensity/(class-class)", "intensity: division by zero"),
            ("gps_time=1e300*1e300", "gps_time: numeric overflow"),
        ] {
            let assign = text.parse::<Assign>().unwrap();
            let error = run(&job(&[&input], &output).stage(assign)).unwrap_err();
            let error = error.to_string();
            assert!(error.contains(told) && error.contains("in.laz"), "{error}");
            assert!(error.contains("the point at "), "{error}");
        }
    }
}

#[test]
fn points_come_in_the_order_asked_for() {
    let place = Place::new();
    let made = Made::new(6, Packing::Fixed(700), 30_000);
    let half = |part: &[Vec<u8>]| Made { records: part.to_vec(), ..made.clone() }.bytes();
    let files = [
        place.write("1.laz", &half(&made.records[..9000])),
        place.write("2.laz", &half(&made.records[9000..])),
    ];
    let curve = |record: &[u8]| {
        let [x, y] = [0, 1].map(|axis| (i64::from(raw(record)[axis]) + (1 << 31)) as u64);
        (0..32)
            .map(|bit| (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1))
            .sum::<u64>()
    };
    let time = |record: &[u8]| f64::from_le_bytes(number(record, 22));
    for by in [Sort::Morton, Sort::Time] {
        let mut expected = made.records.clone();
        expected.sort_by(|a, b| match by {
            Sort::Morton => {
                (curve(a), raw(a)[2]).cmp(&(curve(b), raw(b)[2])).then(time(a).total_cmp(&time(b)))
            }
            Sort::Time => time(a).total_cmp(&time(b)),
        });
        for (threads, memory) in [(1, 40), (3, 1024)] {
            let resources = Resources { threads, memory: memory << 20, temp_dir: None };
            let output = place.path().join("out.laz");
            let job = job(&[&files[1], &files[0]], &output);
            run(&TranslateJob { resources, ..job }.stage(by)).unwrap();
            assert!(whole(&output).records == expected, "{by:?} {threads}");
        }
    }
}
