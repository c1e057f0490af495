//! Noise beside searches of all pairs, and what becomes of it.

use std::collections::HashMap;
use std::path::Path;

use proptest::prelude::*;
use terrane_cloud::{CloudFilter, CloudOpenOptions};
use terrane_engine::Resources;
use terrane_lidar::grid::GroundFrom;
use terrane_lidar::points::{Classify, HeightQuery, TranslateJob, TranslateReport};

use crate::cloud_support::{Made, Packing, Place, Random, raw};
use crate::translate::{job, run, whole};

/// Records of format 6 at these places, in steps of 0.01, 0.01 and 0.001; some are noise, others withheld.
fn cloud(places: &[[i32; 3]]) -> Made {
    let mut made = Made::new(6, Packing::Fixed(700), places.len());
    for (number, (record, place)) in made.records.iter_mut().zip(places).enumerate() {
        record[..12].copy_from_slice(place.map(i32::to_le_bytes).as_flattened());
        record[15] = if number % 41 == 7 { 4 } else { 0 };
        record[16] = [1, 2, 5, 6][number % 4];
        match number % 37 {
            0 => record[16] = 7,
            1 => record[16] = 18,
            _ => {}
        }
    }
    made
}

fn asked(classify: &[&str]) -> HeightQuery {
    let classify = classify.iter().map(|text| text.parse::<Classify>().unwrap()).collect();
    HeightQuery { classify, ..HeightQuery::default() }
}

fn marked(
    input: &[&str],
    output: &Path,
    above: HeightQuery,
    resources: Resources,
) -> (Vec<Vec<u8>>, TranslateReport) {
    let cloud = CloudOpenOptions::default();
    let report =
        run(&TranslateJob { cloud, resources, ..job(input, output) }.classify(above)).unwrap();
    (whole(output).records, report)
}

/// Records with a class for those that are noise of the ones looked at.
fn expected(
    records: &[Vec<u8>],
    class: u8,
    noise: impl Fn(&[[f64; 3]]) -> Vec<bool>,
) -> Vec<Vec<u8>> {
    let is_seen = |record: &&Vec<u8>| record[15] & 4 == 0 && ![7, 18].contains(&record[16]);
    let world = |record: &Vec<u8>| {
        let [x, y, z] = raw(record).map(f64::from);
        [x / 100.0, y / 100.0, z / 1000.0]
    };
    let mut is_noise =
        noise(&records.iter().filter(is_seen).map(world).collect::<Vec<_>>()).into_iter();
    let mark = |record: &Vec<u8>| {
        let mut record = record.clone();
        if is_seen(&&record) && is_noise.next().unwrap() {
            record[16] = class;
        }
        record
    };
    records.iter().map(mark).collect()
}

/// Points with no more than `most` in their cube and those around it, by a table of cubes.
fn alone(points: &[[f64; 3]], side: f64, most: usize) -> Vec<bool> {
    // Offsets are multiples of 10.
    let cube = |p: &[f64; 3]| p.map(|v| ((v * 1000.0).round() / (side * 1000.0)).floor() as i64);
    let mut counts: HashMap<[i64; 3], usize> = HashMap::new();
    points.iter().for_each(|p| *counts.entry(cube(p)).or_default() += 1);
    let around = |p: &[f64; 3]| {
        let at = cube(p);
        let beside = (0..27).map(|i| [at[0] + i % 3 - 1, at[1] + i / 3 % 3 - 1, at[2] + i / 9 - 1]);
        beside.filter_map(|cube| counts.get(&cube)).sum::<usize>()
    };
    points.iter().map(|p| around(p) <= most).collect()
}

/// Points whose mean distance to `k` others is more than `m` deviations above the mean of all, by all pairs.
fn far(points: &[[f64; 3]], k: usize, m: f64) -> Vec<bool> {
    let unit = 0.01 / 1024.0;
    let mean = |i: usize| {
        let square = |q: &[f64; 3]| (0..3).map(|a| (q[a] - points[i][a]).powi(2)).sum::<f64>();
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        let mut all: Vec<f64> = others.map(|(_, q)| square(q)).collect();
        let k = k.min(all.len());
        if k == 0 {
            return 0.0;
        }
        all.select_nth_unstable_by(k - 1, f64::total_cmp);
        (all[..k].iter().map(|square| square.sqrt()).sum::<f64>() / k as f64 / unit).round()
    };
    let means: Vec<f64> = (0..points.len()).map(mean).collect();
    let n = means.len() as f64;
    let middle = means.iter().sum::<f64>() / n;
    let square = means.iter().map(|mean| (mean - middle).powi(2)).sum::<f64>();
    let deviation = if means.len() < 2 { 0.0 } else { (square / (n - 1.0)).sqrt() };
    means.iter().map(|mean| *mean > middle + m * deviation).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn like_searches_of_all_pairs(
        seed in 0_usize..1000, count in 1_usize..700, extent in 1_usize..6000, height in 1_usize..9000,
        side in prop::sample::select(vec![0.5, 1.0, 4.0, 50.0]), most in 1_usize..9,
        k in 1_usize..12, threads in 1_usize..4, class in prop::sample::select(vec![7_u8, 18]),
    ) {
        let mut random = Random::of(seed);
        let mut axis = |most: usize| random.below(most) as i32 - most as i32 / 3;
        let places: Vec<_> = (0..count).map(|_| [axis(extent), axis(extent), axis(height)]).collect();
        let made = cloud(&places);
        let place = Place::new();
        let (input, output) = (place.write("in.laz", &made.bytes()), place.path().join("out.las"));
        let resources = Resources { threads, ..Resources::default() };
        let text = format!("noise:voxel:step={side},isolated={most},class={class}");
        let (found, _) = marked(&[&input], &output, asked(&[&text]), resources.clone());
        prop_assert!(found == expected(&made.records, class, |all| alone(all, side, most)));
        let text = format!("noise:statistical:k={k},class={class}");
        let (found, _) = marked(&[&input], &output, asked(&[&text]), resources);
        prop_assert!(found == expected(&made.records, class, |all| far(all, k, 2.0)));
    }
}

/// A lattice, a crowd that is denser by far, many points at one place, birds, and points far from all.
fn uneven() -> Vec<[i32; 3]> {
    let lattice = (0..4_000).map(|i| [i % 100 * 90, i / 100 * 90, i * 31 % 700]);
    let crowd = (0..6_000_i64).map(|i| [i * 7919 % 97, i * 104_729 % 91, i * 31 % 401]);
    let crowd = crowd.map(|place| place.map(|steps| steps as i32));
    let same = (0..18_500).map(|_| [5000, 5000, 100]);
    let birds = (0..60).map(|i| [i * 7919 % 9000, i * 104_729 % 9000, 60_000 + i * 900]);
    let lone = [[30_000_000, 40_000_000, 5], [-30_000_000, 7, 9], [30_000_900, 40_000_000, 5]];
    lattice.chain(crowd).chain(same).chain(birds).chain(lone).collect()
}

/// The least memory for it, as it is advised.
fn least_memory(input: &str, output: &Path, above: &HeightQuery) -> u64 {
    let resources = Resources { threads: 1, memory: 1 << 20, temp_dir: None };
    let job = TranslateJob { resources, ..job(&[input], output) }.classify(above.clone());
    let told = run(&job).unwrap_err().to_string();
    let advised = told.split("‹memory› ").nth(1).and_then(|text| text.split('M').next());
    advised.unwrap().parse::<u64>().unwrap() << 20
}

#[test]
fn the_same_in_any_memory_threads_and_order() {
    let place = Place::new();
    let made = cloud(&uneven());
    let (input, output) = (place.write("in.laz", &made.bytes()), place.path().join("out.las"));
    let (halves, both) = (made.records.split_at(9_000), place.path().join("both.las"));
    let files = [halves.0, halves.1].map(|half| Made { records: half.to_vec(), ..made.clone() });
    let [a, b] = [("1.laz", &files[0]), ("2.laz", &files[1])]
        .map(|(name, made)| place.write(name, &made.bytes()));
    // The last takes all for noise, each point of the many at one place, too, if none counts twice.
    let is_seen = |r: &&Vec<u8>| r[15] & 4 == 0 && ![7, 18].contains(&r[16]);
    let seen = made.records.iter().filter(is_seen).count();
    let all_noise = format!("noise:voxel:step=100000,isolated={seen}");
    for text in ["noise", "noise:voxel:step=0.5,isolated=3", "noise:statistical:k=4", &all_noise] {
        let above = asked(&[text]);
        let least = least_memory(&input, &output, &above);
        let few = Resources { threads: 1, memory: least, temp_dir: None };
        let (found, told) = marked(&[&input], &output, above.clone(), few);
        let twin = |all: &[[f64; 3]]| match text {
            "noise" => alone(all, 4.0, 5),
            "noise:statistical:k=4" => far(all, 4, 2.0),
            "noise:voxel:step=0.5,isolated=3" => alone(all, 0.5, 3),
            _ => vec![true; all.len()],
        };
        assert!(found == expected(&made.records, 7, twin), "{text}");
        let changed = found.iter().zip(&made.records).filter(|(a, b)| a != b).count();
        assert!(
            told.notes.iter().any(|note| note.contains(&format!("{changed} points of class 7")))
        );
        assert!(changed >= 2, "{text}: {changed}");
        let more = Resources { threads: 3, memory: 1 << 30, temp_dir: None };
        let (again, other) = marked(&[&b, &a], &both, above, more);
        assert!(found == again && told.notes == other.notes, "{text}: {:?}", other.notes);
    }
}

#[test]
fn noise_is_no_ground_whatever_comes_first() {
    let place = Place::new();
    // A plane, and pits below it that stand alone.
    let plane = (0..40_000).map(|i| [i % 200 * 50, i / 200 * 50, i % 7 * 10]);
    let pits = (0..50).map(|i| [i * 7919 % 10_000, i * 104_729 % 10_000, -20_000]);
    let mut made = cloud(&plane.chain(pits).collect::<Vec<_>>());
    for record in &mut made.records {
        (record[14], record[15], record[16]) = (0x11, 0, 1);
    }
    let (input, output) = (place.write("in.laz", &made.bytes()), place.path().join("out.las"));
    for order in [
        ["noise:voxel:isolated=4,class=18", "ground"],
        ["ground", "noise:voxel:isolated=4,class=18"],
    ] {
        let above = HeightQuery { from: "smrf".parse::<GroundFrom>().unwrap(), ..asked(&order) };
        let (found, report) = marked(&[&input], &output, above, Resources::default());
        let classes = |some: &[Vec<u8>], class: u8| some.iter().filter(|r| r[16] == class).count();
        assert_eq!(classes(&found[40_000..], 18), 50, "{:?}", report.notes);
        assert_eq!(classes(&found, 18), 50);
        assert_eq!(classes(&found[..40_000], 2), 40_000);
        let told = "noise: 50 points of class 18 by voxel:step=4,isolated=4,class=18";
        assert!(report.notes.iter().any(|note| note == told), "{:?}", report.notes);
    }
    // Where only some points are asked for, the ground is made of all that are no noise.
    let filter = CloudFilter { returns: Some("first".parse().unwrap()), ..CloudFilter::default() };
    let cloud = CloudOpenOptions { filter, ..CloudOpenOptions::default() };
    let above =
        HeightQuery { from: "smrf".parse::<GroundFrom>().unwrap(), ..asked(&["noise", "ground"]) };
    let some = TranslateJob { cloud, ..job(&[&input], &output) }.classify(above);
    let notes = run(&some).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("40000 of 40000 points")), "{notes:?}");
}

#[test]
fn points_marked_as_withheld_count_where_they_are_kept() {
    let place = Place::new();
    // Of ten points two are noise, and one is withheld.
    let made = cloud(&[[5, 5, 5]; 10]);
    let (input, output) = (place.write("in.laz", &made.bytes()), place.path().join("out.las"));
    for (keep_withheld, noise) in [(false, 8), (true, 1)] {
        let filter = CloudFilter { keep_withheld, ..CloudFilter::default() };
        let cloud = CloudOpenOptions { filter, ..CloudOpenOptions::default() };
        let above = asked(&["noise:voxel:isolated=7"]);
        run(&TranslateJob { cloud, ..job(&[&input], &output) }.classify(above)).unwrap();
        let found = whole(&output).records;
        assert_eq!(found.iter().filter(|record| record[16] == 7).count(), noise);
        assert!(keep_withheld || found[7] == made.records[7]);
    }
}
