//! Points written with all that is known of them: every format, merged, thinned, in squares.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use terrane_base::geom::wkt;
use terrane_cloud::synth;
use terrane_cloud::{CloudFilter, CloudOpenOptions, PointFormat, PointSource, Return};
use terrane_crs::CoordinateOperation;
use terrane_engine::transform::TargetCrs;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_lidar::points::{
    self, BufferFlag, CellThinning, Dedupe, PointTiling, Reproject, TranslateJob, TranslateReport,
};
use terrane_lidar::synthetic_cloud;

use crate::cloud_support::{Made, Packing, Place, RECORD, keep_all, raw, read_all};
pub(crate) use crate::cloud_support::{number, whole};

pub(crate) fn job(input: &[&str], output: &Path) -> TranslateJob {
    let input = input.iter().map(|name| (*name).to_owned()).collect();
    TranslateJob { cloud: keep_all(), overwrite: true, ..TranslateJob::new(input, output) }
}

pub(crate) fn run(job: &TranslateJob) -> terrane::Result<TranslateReport> {
    points::run(job, &Silent, &Cancel::default())
}

fn packings(format: u8) -> Vec<Packing> {
    let stream = (format < 6).then_some(Packing::Stream);
    [Packing::Plain, Packing::Fixed(700), Packing::Variable(311)]
        .into_iter()
        .chain(stream)
        .collect()
}

#[test]
fn every_record_is_carried_byte_for_byte() {
    let place = Place::new();
    for format in 0..11 {
        for (extra, packing) in packings(format).into_iter().flat_map(|p| [(0, p), (5, p)]) {
            let made = Made::new(format, packing, 2345).with_extra(extra);
            let input = place.write("in.laz", &made.bytes());
            for ending in ["las", "laz"] {
                let output = place.path().join(format!("out.{ending}"));
                let report = run(&job(&[&input], &output)).unwrap();
                let found = whole(&output);
                assert!(found.records == made.records, "{format} {extra} {packing:?} {ending}");
                assert_eq!((found.format, report.point_format), (format, format));
                assert_eq!((report.points, report.census.unwrap().read), (2345, 2345));
                assert_eq!(report.output_bytes, output.metadata().unwrap().len());
            }
        }
    }
}

/// Descriptions of two-byte extra bytes by name.
fn extra_bytes(names: &[&str]) -> Vec<u8> {
    let about = |name: &&str| {
        let mut about = vec![0; 192];
        about[2] = 3;
        about[4..4 + name.len()].copy_from_slice(name.as_bytes());
        about
    };
    names.iter().flat_map(about).collect()
}

#[test]
fn files_of_any_format_become_one_whatever_their_order() {
    let place = Place::new();
    let names =
        |names: &[&str]| vec![("LASF_Spec", 4, extra_bytes(names)), ("all", 7, vec![1, 2, 3])];
    let old =
        Made { vlrs: names(&["a", "b"]), ..Made::new(3, Packing::Plain, 60_000).with_extra(4) };
    let mut new = Made {
        vlrs: names(&["b", "c"]),
        ..Made::new(6, Packing::Fixed(5000), 41_000).with_extra(4)
    };
    new.vlrs.push(("one", 8, vec![9]));
    let files = [place.write("1.las", &old.bytes()), place.write("2.laz", &new.bytes())];
    let output = place.path().join("all.laz");
    let report = run(&job(&[&files[1], &files[0]], &output)).unwrap();
    let found = whole(&output);
    assert_eq!((found.format, found.records.len()), (7, 101_000));
    assert!(report.notes.iter().any(|note| note.contains("one 8")), "{:?}", report.notes);
    let carried: Vec<_> =
        found.vlrs.iter().filter(|(user, ..)| user == "all" || user == "one").collect();
    assert_eq!(carried, [&("all".to_owned(), 7, vec![1, 2, 3])]);
    let described =
        &found.vlrs.iter().find(|(user, id, _)| user == "LASF_Spec" && *id == 4).unwrap().2;
    assert_eq!(*described, extra_bytes(&["a", "b", "c"]));
    for (record, from) in found.records.iter().zip(old.records.iter().chain(&new.records)) {
        assert_eq!(raw(record), raw(from));
        let extra = &record[36..42];
        let (own, is_old) = (&from[from.len() - 4..], from.len() == 38);
        let expected = if is_old { [own, &[0, 0]].concat() } else { [&[0, 0], own].concat() };
        assert_eq!(extra, expected);
        let time = if is_old { &from[20..28] } else { &from[22..30] };
        assert_eq!(&record[22..30], time);
        assert_eq!(&record[30..36], if is_old { &from[28..34] } else { &[0; 6] });
    }
    let bytes = std::fs::read(&output).unwrap();
    for (threads, memory) in [(1, 48), (3, 64), (4, 4096)] {
        let resources = Resources { threads, memory: memory << 20, temp_dir: None };
        run(&TranslateJob { resources, ..job(&[&files[0], &files[1]], &output) }).unwrap();
        assert!(std::fs::read(&output).unwrap() == bytes, "{threads} threads, {memory} MiB");
    }
}

#[test]
fn filters_are_those_of_other_verbs() {
    let place = Place::new();
    let made = Made::new(6, Packing::Fixed(1000), 9000);
    let input = place.write("in.laz", &made.bytes());
    let filter = CloudFilter {
        classes: Some(vec![2, 5]),
        returns: Some(Return::Last),
        z_range: Some([-20.0, 20.0]),
        ..CloudFilter::default()
    };
    let options = CloudOpenOptions { filter, ..CloudOpenOptions::default() };
    let output = place.path().join("out.las");
    let report = run(&TranslateJob { cloud: options.clone(), ..job(&[&input], &output) }).unwrap();
    // Points marked as withheld are points.
    let mut plain = options;
    plain.filter.keep_withheld = true;
    let (points, census) = read_all(&terrane_cloud::open(&[input], &plain).unwrap()).unwrap();
    assert_eq!((report.census, report.points), (Some(census), points.len() as u64));
    assert!(points.len() > 100);
    let written = terrane_cloud::open(&[output.to_str().unwrap().to_owned()], &keep_all()).unwrap();
    assert_eq!(read_all(&written).unwrap().0, points);
}

#[test]
fn formats_are_changed_or_refused() {
    let place = Place::new();
    let made = Made::new(7, Packing::Fixed(100), 300);
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.laz");
    let to = |number: u8| {
        let format = Some(PointFormat::new(number).unwrap());
        run(&TranslateJob { format, ..job(&[&input], &output) })
    };
    let report = to(6).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("colours")), "{:?}", report.notes);
    let found = whole(&output);
    assert!(found.records.iter().zip(&made.records).all(|(new, old)| new[..] == old[..30]));
    // Marks of overlap have no place before format 6.
    let error = to(3).unwrap_err().to_string();
    assert!(error.contains("the overlap flag") && error.contains("in.laz"), "{error}");
    // Each field that is narrower there, by the point that is too wide for it.
    for (at, bytes, word) in [
        (14, [9 | 9 << 4, 0], "return 9 of 9"),
        (16, [65, 0], "class 65"),
        (15, [32, 2], "scanner channel 2"),
        (18, (-25_305_i16).to_le_bytes(), "the scan angle -151.83 degrees"),
        (18, 30_000_i16.to_le_bytes(), "the scan angle 180 degrees"),
    ] {
        let mut made = Made::new(6, Packing::Fixed(100), 300);
        for record in &mut made.records {
            record[14..19].copy_from_slice(&[1 | 1 << 4, 0, 2, 0, 0]);
            record[19] = 0;
        }
        made.records[217][at..at + 2].copy_from_slice(&bytes);
        let wide = place.write("wide.laz", &made.bytes());
        for number in 0..6 {
            let format = Some(PointFormat::new(number).unwrap());
            let error = run(&TranslateJob { format, ..job(&[&wide], &output) }).unwrap_err();
            let told = error.to_string();
            assert!(told.contains(word) && told.contains("point 217"), "{number}: {told}");
            assert!(told.contains("‹point_format› 6 or higher"), "{number}: {told}");
        }
    }
    assert!(output.exists(), "the one that was there stays");
    let text = place.write("in.xyz", b"x y z class\n1 2 3.5 2\n4 5 6 7\n");
    run(&job(&[&format!("cloud:{text}")], &output)).unwrap();
    let found = whole(&output);
    assert_eq!((found.format, found.records.len(), found.records[1][16]), (6, 2, 7));
    let text = place.write("in.csv", b"x,y,z,return_number\n1,2,3,15\n1,2,3,16\n");
    let error = run(&job(&[&format!("cloud:{text}")], &output)).unwrap_err().to_string();
    assert!(error.contains("\"16\"") && error.contains("line 3"), "{error}");
    assert!(run(&job(&[&input], &place.path().join("out.tif"))).is_err());
}

#[test]
fn lines_of_text_tell_all_fields_and_are_read_again() {
    let place = Place::new();
    let mut about = extra_bytes(&["a", "b"]);
    // The second one is signed, in halves, from 10 on.
    (about[192 + 2], about[192 + 3]) = (4, 8 | 16);
    about[192 + 112..192 + 120].copy_from_slice(&0.5_f64.to_le_bytes());
    about[192 + 136..192 + 144].copy_from_slice(&10.0_f64.to_le_bytes());
    for format in [3, 8] {
        let vlrs = vec![("LASF_Spec", 4, about.clone())];
        let mut made = Made { vlrs, ..Made::new(format, Packing::Fixed(700), 9000).with_extra(4) };
        for record in &mut made.records {
            let end = record.len();
            record[end - 1] = 255;
        }
        let input = place.write("in.laz", &made.bytes());
        let output = place.path().join("out.csv");
        let report = run(&job(&[&input], &output)).unwrap();
        let text = std::fs::read_to_string(&output).unwrap();
        assert_eq!((report.points, report.output_bytes), (9000, text.len() as u64));
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let column = |name: &str| names.iter().position(|known| *known == name).unwrap();
        assert_eq!((names[0], names.last()), ("x", Some(&"b")));
        for (line, (record, world)) in lines.zip(made.records.iter().zip(made.world())) {
            let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
            assert_eq!(values.len(), names.len());
            assert!(values.iter().zip(world).all(|(told, at)| (told - at).abs() < 1e-6), "{line}");
            let is_old = format == 3;
            let byte = |at: usize| f64::from(record[at]);
            let short = |at: usize| f64::from(u16::from_le_bytes(number(record, at)));
            let float = |at: usize| f64::from_le_bytes(number(record, at));
            let end = record.len() - 4;
            let colour = if is_old { 28 } else { 30 };
            let signed = f64::from(i16::from_le_bytes(number(record, end + 2)));
            for (name, value) in [
                ("intensity", short(12)),
                ("return_number", f64::from(record[14] & if is_old { 7 } else { 15 })),
                ("classification", if is_old { f64::from(record[15] & 31) } else { byte(16) }),
                ("withheld", f64::from(record[15] >> if is_old { 7 } else { 2 } & 1)),
                ("user_data", byte(17)),
                ("point_source_id", short(if is_old { 18 } else { 20 })),
                ("gps_time", float(if is_old { 20 } else { 22 })),
                ("green", short(colour + 2)),
                ("a", short(end)),
                ("b", signed * 0.5 + 10.0),
            ] {
                assert_eq!(values[column(name)], value, "{name} of {line}");
            }
        }
        let again =
            terrane_cloud::open(&[format!("cloud:{}", output.display())], &keep_all()).unwrap();
        let (points, _) = read_all(&again).unwrap();
        let near =
            |(a, b): (&[f64; 3], &[f64; 3])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(points.len() == 9000 && points.iter().zip(&made.world()).all(near));
    }
}

#[test]
fn places_far_from_the_origin_keep_their_steps() {
    let place = Place::new();
    let mut made = Made::new(6, Packing::Fixed(700), 3000);
    for record in &mut made.records {
        let y = raw(record)[1] + 1_400_000_000;
        record[4..8].copy_from_slice(&y.to_le_bytes());
    }
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.las");
    run(&job(&[&input], &output)).unwrap();
    assert!(whole(&output).records == made.records);
    let octree = place.path().join("out.copc.laz");
    run(&job(&[&input], &octree)).unwrap();
    let squares = PointTiling { side: 100.0, buffer: 0.0, flag: BufferFlag::default() };
    let thin = "5:highest".parse::<CellThinning>().unwrap();
    let folder = place.path().join("squares");
    let report = run(
        &TranslateJob { squares: Some((squares, true)), ..job(&[&input], &folder) }.stage(thin)
    );
    let cell = |record: &Vec<u8>| [raw(record)[0].div_euclid(500), raw(record)[1].div_euclid(500)];
    let cells: HashSet<_> = made.records.iter().map(cell).collect();
    assert_eq!(report.unwrap().points, cells.len() as u64);
}

/// Points of small whole places, some of which are there several times.
fn crowd(count: usize) -> Made {
    let mut made = Made::new(6, Packing::Fixed(700), count);
    for (number, record) in made.records.iter_mut().enumerate() {
        let number = number % 12_000;
        let at =
            [number * 7919 % 97, number * 104_729 % 89, number * 31 % 13].map(|at| at as i32 * 5);
        record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
        record[22..30].copy_from_slice(&((number % 3) as f64).to_le_bytes());
    }
    made
}

/// How good a record is: the least is best.
type Rank = fn(&[u8]) -> i64;

#[test]
fn one_of_each_cell_is_kept_by_the_rule_and_order_stays() {
    let place = Place::new();
    let made = crowd(20_000);
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.las");
    // Cells of 40 steps of a hundredth, whose corners are at multiples; the offset is one of them.
    let cell = |record: &[u8]| [raw(record)[0].div_euclid(40), raw(record)[1].div_euclid(40)];
    let ranks: [(&str, Rank); 3] = [
        ("0.4:lowest", |record| raw(record)[2].into()),
        ("0.4:highest", |record| -i64::from(raw(record)[2])),
        ("0.4", |record| {
            let apart = |axis: usize| i64::from(raw(record)[axis].rem_euclid(40)) - 20;
            apart(0).pow(2) + apart(1).pow(2)
        }),
    ];
    for (thin, rank) in ranks {
        let mut best: HashMap<[i32; 2], (i64, usize)> = HashMap::new();
        for (number, record) in made.records.iter().enumerate() {
            let one = (rank(record), number);
            let known = best.entry(cell(record)).or_insert(one);
            *known = one.min(*known);
        }
        let mut kept: Vec<usize> = best.values().map(|(_, number)| *number).collect();
        kept.sort_unstable();
        let expected: Vec<_> =
            kept.into_iter().map(|number| made.records[number].clone()).collect();
        let job = job(&[&input], &output).stage(thin.parse::<CellThinning>().unwrap());
        let report = run(&job).unwrap();
        assert!(whole(&output).records == expected, "{thin}");
        assert_eq!(report.points, expected.len() as u64);
    }
    let by_chance = |seed: u64, inputs: &[&str]| {
        let thin = format!("0.4:random={seed}").parse::<CellThinning>().unwrap();
        run(&job(inputs, &output).stage(thin)).unwrap();
        whole(&output).records
    };
    let one = by_chance(1, &[&input]);
    let cells: HashSet<_> = one.iter().map(|record| cell(record)).collect();
    assert_eq!(cells.len(), one.len());
    assert!(one != by_chance(2, &[&input]));
}

#[test]
fn points_that_are_there_twice_are_written_once() {
    let place = Place::new();
    let made = crowd(20_000);
    let files = [place.write("1.laz", &made.bytes()), place.write("2.laz", &made.bytes())];
    let output = place.path().join("out.laz");
    let mut seen = HashSet::new();
    let is_new = |record: &&Vec<u8>| seen.insert((raw(record), record[22..30].to_vec()));
    let expected: Vec<_> = made.records.iter().filter(is_new).cloned().collect();
    for memory in [64, 1024] {
        let resources = Resources { threads: 2, memory: memory << 20, temp_dir: None };
        let job = TranslateJob { resources, ..job(&[&files[0], &files[1]], &output) }.stage(Dedupe);
        assert_eq!(run(&job).unwrap().points, expected.len() as u64);
        assert!(whole(&output).records == expected);
    }
    assert!(expected.len() < 15_000);
    let thin = "0.4:lowest".parse::<CellThinning>().unwrap();
    let both = run(&job(&[&files[0], &files[1]], &output).stage(Dedupe).stage(thin)).unwrap();
    let alone = run(&job(&[&files[0]], &output).stage(thin)).unwrap();
    assert_eq!(both.points, alone.points);
}

#[test]
fn squares_hold_their_points_and_those_of_their_buffers_marked() {
    let place = Place::new();
    for format in [3, 6] {
        let made = Made::new(format, Packing::Fixed(700), 6000);
        let input = place.write("in.laz", &made.bytes());
        let output = place.path().join("squares");
        let squares = PointTiling { side: 50.0, buffer: 7.5, flag: BufferFlag::Synthetic };
        let job = TranslateJob { squares: Some((squares, format == 3)), ..job(&[&input], &output) };
        let report = run(&job).unwrap();
        // Steps of a hundredth, from an offset that is a multiple of the side.
        let side = 5000;
        let square = |record: &[u8]| [0, 1].map(|axis| raw(record)[axis].div_euclid(side));
        let mut expected: BTreeMap<[i32; 2], Vec<Vec<u8>>> = BTreeMap::new();
        let there: HashSet<_> = made.records.iter().map(|record| square(record)).collect();
        let [low, high]: [fn(i32, i32) -> i32; 2] = [i32::min, i32::max];
        let end = |pick: fn(i32, i32) -> i32, axis: usize| {
            there.iter().map(|square| square[axis]).reduce(pick).unwrap()
        };
        for record in &made.records {
            let own = square(record);
            for x in (own[0] - 1).max(end(low, 0))..=(own[0] + 1).min(end(high, 0)) {
                for y in (own[1] - 1).max(end(low, 1))..=(own[1] + 1).min(end(high, 1)) {
                    let is_near = [x, y].iter().zip(raw(record)).all(|(at, steps)| {
                        (at * side - 750..=(at + 1) * side + 750).contains(&steps)
                    });
                    let mut copy = record.clone();
                    if [x, y] != own {
                        copy[15] |= if format == 3 { 1 << 5 } else { 1 };
                    }
                    if is_near {
                        expected.entry([x, y]).or_default().push(copy);
                    }
                }
            }
        }
        assert!(expected.len() > 3 && expected.values().any(|all| all.len() > 100));
        assert_eq!(report.files, expected.len() as u64);
        assert_eq!(report.points, expected.values().map(|all| all.len() as u64).sum::<u64>());
        for ([x, y], records) in expected {
            let [x, y] = [1000 + x * 50, 2000 + y * 50];
            let ending = if format == 3 { "las" } else { "laz" };
            let found = whole(&output.join(format!("{x}_{y}.{ending}")));
            assert!(found.records == records, "{x} {y}");
        }
        std::fs::write(output.join("notes.txt"), "mine").unwrap();
        assert!(run(&job).unwrap_err().to_string().contains("not created by terrane"));
        std::fs::remove_dir_all(&output).unwrap();
    }
}

#[test]
fn places_in_another_system_are_those_of_the_operation_and_the_rest_stays() {
    let place = Place::new();
    let input = place.path().join("in.laz");
    let survey = synthetic_cloud::SyntheticCloudJob {
        survey: synth::survey("cloud,size=60,density=6,seed=5").unwrap(),
        output: input.clone(),
        format: PointFormat::default(),
        overwrite: false,
        resources: Resources::default(),
    };
    synthetic_cloud::run(&survey, &Silent, &Cancel::default()).unwrap();
    let (input, from) = (input.to_str().unwrap(), synth::crs());
    for (target, step) in [("EPSG:32632", 0.01), ("EPSG:4326", 1e-8), ("EPSG:3035", 0.01)] {
        let output = place.path().join("out.laz");
        let transform = Some(TargetCrs::to(target));
        let thin = "2:lowest".parse::<CellThinning>().unwrap();
        let report =
            run(&job(&[input], &output).stage(thin).stages(transform.map(Reproject))).unwrap();
        let plain = place.path().join("plain.laz");
        run(&job(&[input], &plain).stage(thin)).unwrap();
        let to = wkt::of_srs(target);
        let operation = CoordinateOperation::between(
            &from,
            &to,
            &terrane_crs::CoordinateOperationOptions::default(),
        )
        .unwrap();
        let [before, after] = [&plain, &output].map(|path| {
            terrane_cloud::open(&[path.to_str().unwrap().to_owned()], &keep_all()).unwrap()
        });
        let [frame, moved] = [before.info().frame, after.info().frame];
        assert_eq!(moved.scale, [step, step, frame.scale[2]], "{target}");
        assert!(after.info().crs.agrees(&to) && report.transformed.is_some());
        let [(before, _), (after, _)] = [read_all(&before).unwrap(), read_all(&after).unwrap()];
        assert!(before.len() > 500 && before.len() == after.len());
        for (from, to) in before.iter().zip(&after) {
            let expected = operation.point(*from).unwrap();
            for (axis, size) in moved.scale.into_iter().enumerate() {
                assert!((to[axis] - expected[axis]).abs() <= 0.51 * size, "{to:?} {expected:?}");
            }
        }
        let [plain, output] = [whole(&plain).records, whole(&output).records];
        assert!(plain.iter().zip(&output).all(|(a, b)| a[12..] == b[12..]));
    }
}

#[test]
fn what_is_too_little_is_told_and_what_is_advised_is_enough() {
    let place = Place::new();
    let input = place.write("in.laz", &crate::octree::field(120_000).bytes());
    for ending in ["las", "laz", "copc.laz"] {
        let output: PathBuf = place.path().join(format!("out.{ending}"));
        let with = |memory: u64| {
            let resources = Resources { threads: 2, memory, temp_dir: None };
            run(&TranslateJob { resources, ..job(&[&input], &output) }.stage(Dedupe))
        };
        let error = with(1 << 20).unwrap_err().to_string();
        let advised =
            error.split("‹memory› ").nth(1).and_then(|text| text.split('M').next()).unwrap();
        with(advised.parse::<u64>().unwrap() << 20).unwrap();
    }
    assert_eq!(usize::from(RECORD[7]), PointFormat::new(7).unwrap().size());
}
