//! Synthetic clouds: every part is a pure function, returns are sound, and the ground is known.

use std::collections::BTreeMap;

use terrane::ErrorKind;
use terrane_base::geom::Point;
use terrane_cloud::synth::{SyntheticCloud, frame, survey};
use terrane_cloud::{CloudFilter, CloudOpenOptions, Flags, PointSource, Return, is_cloud};
use terrane_synth::cloud::{BUILDING, GROUND, HIGH_NOISE, LOW_NOISE, LidarSurvey, SimulatedReturn};
use terrane_synth::{CHARACTERS, Terrain};

const NAME: &str = "cloud,width=420,height=300,density=4,seed=11,outliers=0.01";

fn parts(survey: &LidarSurvey) -> Vec<Vec<SimulatedReturn>> {
    let mut echoes = Vec::new();
    let part = |k| {
        survey.fill(k, &mut echoes);
        echoes.clone()
    };
    (0..survey.parts()).map(part).collect()
}

fn all(name: &str) -> Vec<SimulatedReturn> {
    parts(&survey(name).unwrap()).concat()
}

/// FNV-1a over every field, so that a bit that differs on some machine is seen.
fn digest(echoes: &[SimulatedReturn]) -> u64 {
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut eat = |value: u64| {
        for byte in value.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        }
    };
    for e in echoes {
        let SimulatedReturn { point: Point { x, y, z }, time, intensity, source, angle, .. } = *e;
        let wide = [x as u64, y as u64, z as u64, time.to_bits(), angle as u64];
        let small = [u64::from(intensity), u64::from(source), u64::from(e.class)];
        let returns = [u64::from(e.number), u64::from(e.of)];
        let marks = [e.withheld, e.overlap, e.eastward, e.edge].map(u64::from);
        wide.into_iter().chain(small).chain(returns).chain(marks).for_each(&mut eat);
    }
    hash
}

#[test]
fn parts_are_pure_and_the_same_everywhere() {
    let survey = survey(NAME).unwrap();
    let forth = parts(&survey);
    let mut echoes = Vec::new();
    for part in (0..survey.parts()).rev() {
        survey.clone().fill(part, &mut echoes);
        assert_eq!(echoes, forth[part]);
        assert!(echoes.len() as u64 <= survey.most(part));
        let [west, south, east, north] = survey.area(part).map(|side| side / survey.scale);
        assert!(
            echoes.iter().map(|e| (f64::from(e.point.x), f64::from(e.point.y))).all(|(x, y)| x
                >= west - 1.0
                && x <= east
                && y >= south - 1.0
                && y <= north)
        );
    }
    assert_eq!(
        digest(&forth.concat()),
        6_297_605_933_034_567_867,
        "the same bits on every machine"
    );
}

#[test]
fn another_seed_is_another_cloud() {
    let digest = |name: &str| digest(&all(name));
    assert_ne!(digest("cloud,size=50,seed=1"), digest("cloud,size=50,seed=2"));
    assert_ne!(digest("cloud,size=50,zigzag=0"), digest("cloud,size=50"));
}

#[test]
fn the_ground_is_where_it_is_said_to_be() {
    for (name, noise) in [("cloud,size=250,seed=3,noise=0", 0.0), (NAME, 0.03)] {
        let survey = survey(name).unwrap();
        let most = 3.5 * noise + 0.5 * survey.scale + 1e-6;
        let mut seen = 0;
        for e in all(name).iter().filter(|e| e.class == GROUND && !e.withheld).step_by(50) {
            let [x, y, z] = [e.point.x, e.point.y, e.point.z].map(|s| f64::from(s) * survey.scale);
            let truth = survey.ground(x, y);
            assert!((z - truth).abs() <= most, "({x}, {y}): {z} is not {truth}");
            seen += 1;
        }
        assert!(seen > 1000);
    }
}

/// The ground as its definition says: a sum over sixteen samples of the terrain.
fn naive_ground(survey: &LidarSurvey, x: f64, y: f64) -> f64 {
    let bell = |t: f64| match t.abs() {
        t if t < 1.0 => 2.0 / 3.0 - t * t + t * t * t / 2.0,
        t if t < 2.0 => (2.0 - t).powi(3) / 6.0,
        _ => 0.0,
    };
    let terrain =
        Terrain { seed: survey.seed, relief: survey.relief, ..Terrain::new(&CHARACTERS[0]) };
    let (u, v) = (x / 2.0, y / 2.0);
    let mut sum = 0.0;
    for row in 0..4 {
        for col in 0..4 {
            let (col, row) = (u as u32 + col, v as u32 + row);
            let weight = bell(u + 1.0 - f64::from(col)) * bell(v + 1.0 - f64::from(row));
            sum += weight * f64::from(terrain.sample(col, row));
        }
    }
    sum
}

#[test]
fn the_ground_is_a_spline_over_the_terrain() {
    let survey = survey("cloud,size=9000,seed=5,relief=800").unwrap();
    let (xs, ys) = ([0.0, 0.3, 17.77, 18.0, 8999.99], [0.0, 1.999, 2.0, 77.5, 130.1]);
    let rows = survey.ground_rows(&xs, &ys);
    for (row, y) in rows.chunks(xs.len()).zip(ys) {
        for (height, x) in row.iter().zip(xs) {
            assert_eq!(height.to_bits(), survey.ground(x, y).to_bits());
            assert!((height - naive_ground(&survey, x, y)).abs() < 1e-9, "({x}, {y})");
        }
    }
    assert!(survey.ground_rows(&[], &ys).is_empty());
}

#[test]
fn returns_of_a_pulse_belong_together() {
    let echoes = all(NAME);
    let mut several = 0;
    let mut rest = &echoes[..];
    while let [first, ..] = rest {
        let (pulse, next) = rest.split_at(usize::from(first.of));
        for (echo, number) in pulse.iter().zip(1..) {
            assert_eq!((echo.number, echo.of), (number, first.of));
            assert_eq!((echo.time.to_bits(), echo.source), (first.time.to_bits(), first.source));
            assert!(number < first.of || echo.point.y == first.point.y);
        }
        // But for the noise of ranging.
        assert!(pulse.windows(2).all(|pair| pair[0].point.z > pair[1].point.z - 25), "{pulse:?}");
        several += usize::from(first.of > 1);
        rest = next;
    }
    assert!(several > 1000, "{several}");
    assert!(echoes.is_sorted_by(|a, b| (a.source, a.time) <= (b.source, b.time)));
}

#[test]
fn classes_marks_and_bounds_are_as_promised() {
    let survey = survey(NAME).unwrap();
    let ([width, height], [low, high]) = (survey.steps(), survey.heights());
    let mut classes = BTreeMap::new();
    for e in parts(&survey).concat() {
        let Point { x, y, z } = e.point;
        assert!((0..width).contains(&x) && (0..height).contains(&y) && (low..=high).contains(&z));
        *classes.entry((e.class, e.withheld)).or_insert(0) += 1;
    }
    let expected = [GROUND, 3, 4, 5, BUILDING, LOW_NOISE, HIGH_NOISE].map(|class| (class, false));
    assert!(expected.iter().all(|key| classes.contains_key(key)), "{classes:?}");
    assert!(classes[&(GROUND, true)] > 100, "{classes:?}");
    assert_eq!(classes.len(), 8, "{classes:?}");
    let lines: Vec<u16> = all(NAME).iter().map(|e| e.source).collect();
    assert!(lines.is_sorted() && lines.last() == Some(&3));
    let overlap = all(NAME).iter().filter(|e| e.overlap).count() as f64 / lines.len() as f64;
    assert!((0.1..0.3).contains(&overlap), "{overlap}");
}

#[test]
fn the_density_is_that_asked_for() {
    for name in [
        "cloud,size=700,density=2,seed=1",
        "cloud,size=160,density=9,cover=0,zigzag=0",
        "cloud,width=170,height=400,density=5,cover=0",
        "cloud,width=5000,height=900,density=0.2",
        "cloud,size=20,density=100,cover=0",
    ] {
        let (count, expected) = (all(name).len() as f64, survey(name).unwrap().expected() as f64);
        assert!((count / expected - 1.0).abs() < 0.1, "{name}: {count} for {expected}");
    }
}

#[test]
fn density_is_even_on_bare_ground() {
    let mut cells = [0_u32; 400];
    for e in all("cloud,size=100,density=20,cover=0,outliers=0") {
        cells[(e.point.y / 500 * 20 + e.point.x / 500) as usize] += 1;
    }
    assert!(cells.iter().all(|n| (330..680).contains(n)), "{cells:?}");
}

#[test]
fn voids_lie_on_tiles_and_hold_nothing() {
    let name = "cloud,size=600,density=3,voids=9,tile=200,seed=4";
    let survey = survey(name).unwrap();
    let echoes = all(name);
    let whole = |place: f64| (place / 200.0).fract() == 0.0;
    for [x, y, r] in survey.void_places() {
        assert!((7.5..30.0).contains(&r) && (whole(x) || whole(y)), "({x}, {y}) {r}");
        // Crowns lean into a void by up to 23 m * 0.2.
        let near = |e: &SimulatedReturn, r: f64| {
            let (dx, dy) = (f64::from(e.point.x) * 0.01 - x, f64::from(e.point.y) * 0.01 - y);
            dx * dx + dy * dy < r * r
        };
        assert!(!echoes.iter().any(|e| e.class == GROUND && near(e, r)));
        assert!(echoes.iter().any(|e| near(e, r + 4.0)));
    }
    assert_eq!(survey.void_places().count(), 9);
}

#[test]
fn filters_act_on_synthetic_clouds() {
    let survey = survey(NAME).unwrap();
    let echoes = parts(&survey).concat();
    let world = |e: &SimulatedReturn| frame(&survey).world(e.point);
    let bounds = [500_050.0, 4_750_020.0, 500_100.0, 4_750_090.5];
    let middle = world(&echoes[echoes.len() / 2])[2];
    let heights = [middle - 5.0, middle + 30.0];
    let within = |e: &SimulatedReturn| {
        let [x, y, _] = world(e);
        x >= bounds[0] && x <= bounds[2] && y >= bounds[1] && y <= bounds[3]
    };
    type Wanted<'a> = Box<dyn Fn(&SimulatedReturn) -> bool + 'a>;
    let cases: Vec<(CloudFilter, Wanted<'_>)> = vec![
        (CloudFilter::default(), Box::new(|e| !e.withheld)),
        (CloudFilter { keep_withheld: true, ..CloudFilter::default() }, Box::new(|_| true)),
        (
            CloudFilter { classes: Some(vec![2, 6]), ..CloudFilter::default() },
            Box::new(|e| !e.withheld && (e.class == 2 || e.class == 6)),
        ),
        (
            CloudFilter {
                returns: Some(Return::Last),
                drop: Flags::OVERLAP,
                ..CloudFilter::default()
            },
            Box::new(|e| !e.withheld && !e.overlap && e.number == e.of),
        ),
        (
            CloudFilter { bounds: Some(bounds), z_range: Some(heights), ..CloudFilter::default() },
            Box::new(|e| {
                !e.withheld && within(e) && (heights[0]..=heights[1]).contains(&world(e)[2])
            }),
        ),
    ];
    for (filter, wanted) in cases {
        let source = SyntheticCloud::new(survey.clone(), filter.clone()).unwrap();
        let info = source.info().clone();
        let (mut points, mut census) = (Vec::new(), terrane_cloud::ReturnCounts::default());
        for part in 0..source.parts() {
            let mut take = |batch: &[Point]| {
                points.extend_from_slice(batch);
                Ok(())
            };
            census.add(&source.positions(part, &mut take).unwrap());
        }
        let expected: Vec<Point> = echoes.iter().filter(|e| wanted(e)).map(|e| e.point).collect();
        assert!(!expected.is_empty(), "{filter:?}");
        assert_eq!(points, expected, "{filter:?}");
        let is_whole = filter.bounds.is_none();
        assert!(
            census.read == echoes.len() as u64 || !is_whole && census.read < echoes.len() as u64
        );
        assert_eq!(census.kept + census.withheld + census.filtered, census.read);
        let [low, high] = info.bounds.unwrap();
        assert!(points.iter().all(|p| p.x >= low.x && p.y >= low.y && p.z >= low.z));
        assert!(points.iter().all(|p| p.x <= high.x && p.y <= high.y && p.z <= high.z));
    }
    let nowhere = CloudFilter { bounds: Some([0.0, 0.0, 1.0, 1.0]), ..CloudFilter::default() };
    assert_eq!(SyntheticCloud::new(survey, nowhere).unwrap().info().bounds, None);
}

#[test]
fn a_synthetic_cloud_is_an_input_but_not_among_files() {
    let names = |all: &[&str]| all.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
    let open = |all: &[&str]| terrane_cloud::source(&names(all), &CloudOpenOptions::default());
    assert!(is_cloud("synth:cloud,size=5") && !is_cloud("synth:rough,size=5"));
    assert_eq!(open(&["synth:cloud,size=5,density=4"]).unwrap().info().count, 100);
    let error = open(&["synth:cloud,size=5", "a.las"]).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Usage);
    assert!(open(&["synth:cloud,sise=5"]).is_err());
}

#[test]
fn every_parameter_is_in_the_book() {
    let names = include_str!("../../docs/src/reference/names.md");
    let clouds = names.split("\n## Parameters of a cloud\n").nth(1).unwrap();
    let clouds = clouds.split("\n## ").next().unwrap();
    for parameter in terrane_synth::cloud::PARAMETERS {
        assert!(clouds.contains(&format!("| `{}` |", parameter.key)), "{}", parameter.key);
    }
}

#[test]
fn names_round_trip_and_mistakes_are_explained() {
    let first = survey("synth:cloud, width=30.5,size=7,seed=18446744073709551615,cover=0").unwrap();
    assert_eq!((first.width, first.height, first.seed), (30.5, 7.0, u64::MAX));
    assert_eq!(LidarSurvey::parse(&first.to_string()).unwrap(), first);
    for (name, expected) in [
        ("clouds", "begin the name"),
        ("cloud,", "empty parameter"),
        ("cloud,sise=3", "size, width"),
        ("cloud,size=0", "a number from 1 to"),
        ("cloud,density=nan", "per square metre"),
        ("cloud,seed=1,seed=2", "given twice"),
        ("cloud,cover=0.5", "whole number"),
        ("cloud,size=100000,scale=0.0001", "larger scale"),
        ("cloud,size=100,voids=3", "smaller than the cloud"),
    ] {
        let error = survey(name).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage, "{name}");
        assert!(error.to_string().contains(expected), "{name}: {error}");
    }
}

#[test]
fn extremes_are_sound() {
    for name in [
        "cloud,size=1,density=2000",
        "cloud,size=1,density=0.001",
        "cloud,size=30,relief=0,noise=10",
        "cloud,size=200,relief=10000,scale=1",
        "cloud,width=1,height=3000,density=0.5",
        "cloud,size=90,outliers=1",
    ] {
        let survey = survey(name).unwrap();
        let ([width, height], [low, high]) = (survey.steps(), survey.heights());
        for SimulatedReturn { point: Point { x, y, z }, .. } in parts(&survey).concat() {
            assert!((0..width).contains(&x) && (0..height).contains(&y), "{name}");
            assert!((low..=high).contains(&z), "{name}: {z}");
        }
    }
    let huge = survey("cloud,size=1000000,density=2000").unwrap();
    let mut echoes = Vec::new();
    huge.fill(huge.parts() - 1, &mut echoes);
    assert!(echoes.len() > 1000);
}
