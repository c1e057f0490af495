//! Tree tops beside a search of all pairs, and by plan.

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
