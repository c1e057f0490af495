//! Normals and shapes beside a search of all pairs.

use terrane_engine::Resources;
use terrane_lidar::points::{StageText, TranslateJob};

use crate::cloud_support::{Made, Packing, Place, Random, raw};
use crate::translate::{job, run, whole};

/// Metres of a step.
const STEPS: [f64; 3] = [0.01, 0.01, 0.001];
const VALUES: usize = 7;

/// Places on slopes, walls and lines, many of them equal.
fn places(random: &mut Random, count: usize) -> Vec<[i32; 3]> {
    let of = |random: &mut Random, most: usize| random.below(most) as i32;
    (0..count)
        .map(|number| match number % 5 {
            0 => [of(random, 4000), of(random, 4000), of(random, 300)],
            1 => {
                let [x, y] = [of(random, 4000), of(random, 4000)];
                [x, y, 5 * x - 3 * y]
            }
            2 => [2000, 50 * of(random, 40), 500 * of(random, 30)],
            3 => [100 * of(random, 40), 100 * of(random, 40), 0],
            _ => [30 * of(random, 100), 0, 40_000],
        })
        .collect()
}

/// The offsets of the nearest others, itself among them, in metres; the first in order of equally near ones.
fn nearest(places: &[[i32; 3]], at: [i32; 3], count: usize) -> Vec<[f64; 3]> {
    let offset = |other: &[i32; 3]| [0, 1, 2].map(|i| f64::from(other[i] - at[i]) * STEPS[i]);
    let square = |other: &[i32; 3]| {
        let [x, y, z] = offset(other);
        x * x + y * y + z * z
    };
    let mut all = places.to_vec();
    all.sort_by(|a, b| square(a).total_cmp(&square(b)).then(a.cmp(b)));
    all[..count].iter().map(offset).collect()
}

/// The variance of points across a plane with this normal, and along it at most and at least.
fn variances(points: &[[f64; 3]], normal: [f64; 3]) -> [f64; 3] {
    let mean = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64);
    let along = |axis: [f64; 3]| {
        let dot = |p: &[f64; 3]| (0..3).map(|i| (p[i] - mean[i]) * axis[i]).sum::<f64>();
        points.iter().map(|p| dot(p) * dot(p)).sum::<f64>()
    };
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let unit = |a: [f64; 3]| {
        let length = a.iter().map(|v| v * v).sum::<f64>().sqrt();
        a.map(|v| v / length)
    };
    let least = (0..3).min_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs())).unwrap();
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let a = unit(cross(normal, axis));
    let b = cross(normal, a);
    let turned = |angle: f64| {
        let (sine, cosine) = angle.sin_cos();
        along([0, 1, 2].map(|i| cosine * a[i] + sine * b[i]))
    };
    let all = (0..3600).map(|i| turned(f64::from(i) * std::f64::consts::PI / 3600.0));
    let [most, few] = [all.clone().fold(0.0, f64::max), all.fold(f64::INFINITY, f64::min)];
    [along(normal), few, most]
}

#[test]
fn normals_are_those_of_the_nearest_points() {
    let place = Place::new();
    let mut random = Random::of(11);
    let at = places(&mut random, 700);
    let mut made = Made::new(6, Packing::Fixed(300), at.len());
    for (record, at) in made.records.iter_mut().zip(&at) {
        record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
    }
    let input = place.write("in.laz", &made.bytes());
    let output = place.path().join("out.las");
    for count in [3, 8, 30] {
        let stage: StageText = format!("normals:k={count}").parse().unwrap();
        run(&job(&[&input], &output).stage(stage.stage().clone())).unwrap();
        let records = whole(&output).records;
        let (mut flat, mut none) = (0, 0);
        for record in &records {
            let values: [f32; VALUES] = std::array::from_fn(|i| {
                let first = record.len() - 4 * (VALUES - i);
                f32::from_le_bytes(*record[first..].first_chunk().unwrap())
            });
            let near = nearest(&at, raw(record), count + 1);
            let [x, y, z, curvature, linearity, planarity, scattering] = values.map(f64::from);
            if x.is_nan() {
                none += 1;
                assert!(values.iter().all(|value| value.is_nan()));
                let has_plane =
                    near.iter().any(|p| p[0] != 0.0) && near.iter().any(|p| p[1] != 0.0);
                assert!(!has_plane, "{near:?}");
                continue;
            }
            assert!(z >= 0.0 && ((x * x + y * y + z * z).sqrt() - 1.0).abs() < 1e-6);
            let [small, middle, large] = variances(&near, [x, y, z]);
            // No direction has less variance, as far as single precision tells.
            assert!(small <= middle + 1e-9 * large, "{small} {middle} {large} {near:?}");
            let near_to = |found: f64, expected: f64| (found - expected).abs() < 2e-3;
            let roots = [large, middle, small].map(f64::sqrt);
            assert!(near_to(curvature, small / (small + middle + large)), "{curvature}");
            assert!(near_to(linearity, (roots[0] - roots[1]) / roots[0]));
            assert!(near_to(planarity, (roots[1] - roots[2]) / roots[0]));
            assert!(near_to(scattering, roots[2] / roots[0]));
            flat += usize::from(curvature < 1e-6);
        }
        assert!(records.len() == at.len() && flat > 10, "{count}: {flat} flat");
        assert!(none > 0 || count > 3, "{count}: none without a plane");
    }
}

#[test]
fn normals_are_the_same_by_threads_memory_and_order() {
    let place = Place::new();
    let mut random = Random::of(5);
    // Equally near points in several parts.
    let at: Vec<[i32; 3]> =
        (0..60_000).map(|_| [0, 1, 2].map(|_| 100 * random.below(50) as i32)).collect();
    let mut made = Made::new(6, Packing::Fixed(5000), at.len());
    for (record, at) in made.records.iter_mut().zip(&at) {
        record[..12].copy_from_slice(at.map(i32::to_le_bytes).as_flattened());
    }
    let input = place.write("in.laz", &made.bytes());
    let mut reversed = made.clone();
    reversed.records.reverse();
    let other = place.write("reversed.laz", &reversed.bytes());
    let stage: StageText = "normals".parse().unwrap();
    let made = |input: &str, threads, memory: u64| {
        let output = place.path().join("out.las");
        let resources = Resources { threads, memory: memory << 20, temp_dir: None };
        let job = TranslateJob { resources, ..job(&[input], &output) };
        run(&job.stage(stage.stage().clone())).unwrap();
        whole(&output).records
    };
    let expected = made(&input, 1, 1024);
    assert!(made(&input, 3, 160) == expected);
    let mut found = made(&other, 2, 256);
    found.reverse();
    assert!(found == expected, "the order of points matters");
}
