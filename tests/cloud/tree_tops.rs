//! Tree tops and trees beside searches of all pairs, and by threads, memory and plan.

use terrane_engine::Resources;
use terrane_lidar::points::{PointTiling, StageText, TranslateJob};

use crate::cloud_support::{Made, Packing, Place, Random, raw};
use crate::noise_plan::{files, planned};
use crate::translate::{job, run, whole};

/// Crowns of some metres, with many equal heights; in steps of 0.01, 0.01 and 0.001.
fn crowns(count: usize) -> Made {
    let mut random = Random::of(21);
    let mut made = Made::new(6, Packing::Fixed(2000), count);
    for record in &mut made.records {
        let [x, y] = [6000, 5000].map(|most| random.below(most) as i32);
        let away = f64::from((x % 700 - 350).pow(2) + (y % 600 - 300).pow(2)).sqrt();
        let height = (12.0 - away / 40.0 + random.below(3) as f64).round().max(0.0) as i32;
        let at = [x, y, 1000 * height];
        record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
    }
    made
}

#[test]
fn tops_are_the_highest_around() {
    let place = Place::new();
    let made = crowns(4000);
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.las");
    for (window, min) in [(0.5, 2.0), (3.0, 2.0), (3.0, 11.5), (7.0, -1.0), (200.0, 2.0)] {
        let stage: StageText = format!("tree-tops:{window}:min={min}").parse().unwrap();
        run(&job(&[&input], &output).stage(stage.stage().clone())).unwrap();
        let at: Vec<[i32; 3]> = made.records.iter().map(|record| raw(record)).collect();
        // Offsets of the header are those of x, y and z.
        let high = |[_, _, z]: &[i32; 3]| f64::from(*z) * made.scale[2] + made.offset[2] >= min;
        let is_near = |[ax, ay, _]: &[i32; 3], [bx, by, _]: &[i32; 3]| {
            let half = (window * 50.0) as i64;
            i64::from(ax - bx).pow(2) + i64::from(ay - by).pow(2) < half * half
        };
        let order = |[x, y, z]: &[i32; 3]| [*z, *x, *y];
        let expected = at
            .iter()
            .filter(|a| high(a) && !at.iter().any(|b| order(b) > order(a) && is_near(a, b)));
        let expected: Vec<_> = expected.copied().collect();
        let found: Vec<_> = whole(&output).records.iter().map(|record| raw(record)).collect();
        assert!(found == expected, "{window} {min}: {} of {}", found.len(), expected.len());
        assert!(!found.is_empty());
    }
}

#[test]
fn tops_are_the_same_by_threads_memory_and_plan() {
    let place = Place::new();
    let input = place.write("in.laz", &crowns(60_000).bytes());
    let stage: StageText = "tree-tops:5".parse().unwrap();
    let made = |threads, memory: u64| {
        let output = place.path().join("out.las");
        let resources = Resources { threads, memory: memory << 20, temp_dir: None };
        let job = TranslateJob { resources, ..job(&[&input], &output) };
        run(&job.stage(stage.stage().clone())).unwrap();
        whole(&output).records
    };
    let tops = made(1, 1024);
    assert!(made(3, 128) == tops && tops.len() > 60 && tops.len() < 200, "{}", tops.len());
    let squares = PointTiling { side: 13.0, buffer: 0.0, flag: Default::default() };
    let folder = place.path().join("whole");
    let whole = TranslateJob { squares: Some((squares, true)), ..job(&[&input], &folder) };
    let whole = whole.stage(stage.stage().clone());
    run(&whole).unwrap();
    let work = place.path().join("work");
    planned(&whole, &work, 1);
    assert!(files(&work.join("points")) == files(&folder));
}

/// The number of the tree of a record; 0 for none.
fn tree(record: &[u8]) -> u32 {
    u32::from_le_bytes(*record.last_chunk().unwrap())
}

/// The trees of points, by the nearest of all tops.
fn trees(made: &Made, tops: &[[i32; 3]], radius: f64, height: f64) -> Vec<u32> {
    let mut tops = tops.to_vec();
    tops.sort_unstable();
    let z = |at: &[i32; 3]| f64::from(at[2]) * made.scale[2] + made.offset[2];
    let square = |a: &[i32; 3], b: &[i32; 3]| {
        let apart = [0, 1].map(|i| f64::from(a[i] - b[i]) * made.scale[i]);
        apart[0].powi(2) + apart[1].powi(2)
    };
    let of = |at: [i32; 3]| {
        let nearest = tops.iter().enumerate();
        let (number, top) =
            nearest.min_by(|(_, a), (_, b)| square(&at, a).total_cmp(&square(&at, b))).unwrap();
        let top_z = z(top).max(0.0);
        let is_in = square(&at, top) <= (radius * top_z).powi(2) && z(&at) >= height * top_z;
        if is_in { number as u32 + 1 } else { 0 }
    };
    made.records.iter().map(|record| of(raw(record))).collect()
}

#[test]
fn points_belong_to_the_nearest_tree_that_is_high_enough() {
    let place = Place::new();
    let made = crowns(4000);
    let input = place.write("in.laz", &made.bytes());
    let [tops, output] = ["tops.las", "out.las"].map(|name| place.path().join(name));
    for (window, more, radius, height) in [
        (3.0, "", 0.6, 0.3),
        (7.0, ":radius=0.2:height=0.5", 0.2, 0.5),
        (0.5, ":height=0", 0.6, 0.0),
        (9.0, ":min=-1:radius=10:height=0", 10.0, 0.0),
    ] {
        let stages = [format!("tree-tops:{window}"), format!("trees:{window}{more}")];
        let min = if more.contains("min") { ":min=-1" } else { "" };
        let [tops_stage, trees_stage] = [stages[0].clone() + min, stages[1].clone()]
            .map(|text| text.parse::<StageText>().unwrap().stage().clone());
        run(&job(&[&input], &tops).stage(tops_stage)).unwrap();
        run(&job(&[&input], &output).stage(trees_stage)).unwrap();
        let tops: Vec<_> = whole(&tops).records.iter().map(|record| raw(record)).collect();
        let expected = trees(&made, &tops, radius, height);
        let found: Vec<u32> = whole(&output).records.iter().map(|record| tree(record)).collect();
        assert_eq!(found, expected, "{window}{more}");
        let without = found.iter().filter(|number| **number == 0).count();
        assert!(found.iter().max().is_some_and(|most| *most as usize == tops.len()));
        assert!(height == 0.0 || (1..4000).contains(&without), "{without}");
    }
}

#[test]
fn trees_are_the_same_by_threads_and_memory() {
    let place = Place::new();
    let input = place.write("in.laz", &crowns(60_000).bytes());
    let chain = ["trees:5", "where:TreeID > 7"];
    let stages = chain.map(|text| text.parse::<StageText>().unwrap().stage().clone());
    let made = |threads, memory: u64| {
        let output = place.path().join("out.las");
        let resources = Resources { threads, memory: memory << 20, temp_dir: None };
        let job = TranslateJob { resources, ..job(&[&input], &output) };
        run(&job.stages(stages.clone())).unwrap();
        whole(&output).records
    };
    let records = made(1, 1024);
    assert!(made(3, 128) == records && records.iter().all(|record| tree(record) > 7));
    assert!(!records.is_empty());
}
