//! What the ground tells of points: heights above it beside those of another triangulation, and classes.

use std::path::Path;

use spade::{DelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation};
use terrane_cloud::{CloudFilter, CloudOpenOptions, PointFormat, Return, synth};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_lidar::grid::GroundFrom;
use terrane_lidar::points::{CellThinning, Classify, HeightQuery, HeightsAs, TranslateJob};
use terrane_lidar::synthetic_cloud;

use crate::cloud_support::{Place, raw};
use crate::translate::{job, number, run, whole};

const NONE: i32 = i32::MIN;

pub(crate) fn survey(place: &Place, name: &str, format: u8, output: &str) -> String {
    let output = place.path().join(output);
    let survey = synthetic_cloud::SyntheticCloudJob {
        survey: synth::survey(name).unwrap(),
        output: output.clone(),
        format: PointFormat::new(format).unwrap(),
        overwrite: true,
        resources: Resources::default(),
    };
    synthetic_cloud::run(&survey, &Silent, &Cancel::default()).unwrap();
    output.to_str().unwrap().to_owned()
}

/// Changes each record of a plain file.
fn rewrite(path: &str, change: impl Fn(&mut [u8])) {
    let records = whole(Path::new(path)).records;
    let (size, mut bytes) = (records[0].len(), std::fs::read(path).unwrap());
    let first = bytes.len() - size * records.len();
    bytes[first..].chunks_exact_mut(size).for_each(change);
    std::fs::write(path, bytes).unwrap();
}

/// A survey of formats from 6 on without ground in its west.
fn bare_west(place: &Place, name: &str, format: u8) -> String {
    let input = survey(place, name, format, "in.las");
    let west = whole(Path::new(&input)).records.iter().map(|r| raw(r)[0]).min().unwrap() + 500;
    rewrite(&input, |record| {
        if raw(record)[0] < west && record[16] == 2 {
            record[16] = 1;
        }
    });
    input
}

fn above(heights: Option<HeightsAs>, classify: &[&str]) -> HeightQuery {
    let classify = classify.iter().map(|text| text.parse().unwrap()).collect();
    HeightQuery { heights, classify, ..HeightQuery::default() }
}

/// Records of the cloud with what is asked, which are to differ from those of the input in that alone.
fn records(input: &str, asked: HeightQuery, output: &Path) -> Vec<Vec<u8>> {
    run(&job(&[input], output).classify(asked)).unwrap();
    whole(output).records
}

fn class(record: &[u8]) -> u8 {
    record[16]
}

/// The height that a record ends with.
fn height(record: &[u8]) -> i32 {
    i32::from_le_bytes(number(record, record.len() - 4))
}

struct Corner([i32; 3]);

impl HasPosition for Corner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.0[0].into(), self.0[1].into())
    }
}

/// The ground as spade triangulates it.
struct Twin(DelaunayTriangulation<Corner>);

impl Twin {
    fn of(mut ground: Vec<[i32; 3]>) -> Self {
        ground.sort_unstable();
        ground.dedup_by_key(|p| [p[0], p[1]]);
        Self(DelaunayTriangulation::bulk_load(ground.into_iter().map(Corner).collect()).unwrap())
    }

    fn height(&self, [x, y, _]: [i32; 3]) -> Option<f64> {
        let all = &self.0;
        let corners = match all.locate(Point2::new(x.into(), y.into())) {
            PositionInTriangulation::OnVertex(one) => {
                return Some(all.vertex(one).data().0[2].into());
            }
            PositionInTriangulation::OnFace(face) => all.face(face).vertices(),
            PositionInTriangulation::OnEdge(edge) => {
                let edge = all.directed_edge(edge);
                let face = edge.face().as_inner().or(edge.rev().face().as_inner())?;
                face.vertices()
            }
            _ => return None,
        };
        let [a, b, c] = corners.map(|corner| corner.data().0.map(f64::from));
        let cross = |p: [f64; 3], q: [f64; 3]| {
            (p[0] - a[0]) * (q[1] - a[1]) - (p[1] - a[1]) * (q[0] - a[0])
        };
        let p = [f64::from(x), f64::from(y), 0.0];
        let whole = cross(b, c);
        Some(a[2] + cross(p, c) / whole * (b[2] - a[2]) + cross(b, p) / whole * (c[2] - a[2]))
    }
}

#[test]
fn heights_are_those_above_another_triangulation_of_the_ground() {
    let place = Place::new();
    let output = place.path().join("out.laz");
    let mut all_high = 0;
    for (seed, format) in [(5, 6), (6, 7), (7, 8)] {
        let input = bare_west(&place, &format!("cloud,size=70,density=5,seed={seed}"), format);
        let before = whole(Path::new(&input)).records;
        let after = records(&input, above(Some(HeightsAs::Dimension), &[]), &output);
        let ground = before.iter().filter(|record| class(record) == 2).map(|record| raw(record));
        let twin = Twin::of(ground.collect());
        assert_eq!(before.len(), after.len());
        let (mut none, mut high) = (0, 0);
        for (before, after) in before.iter().zip(&after) {
            assert_eq!(before[..], after[..before.len()]);
            let own = (height(after) != NONE).then_some(height(after));
            let expected =
                twin.height(raw(before)).map(|ground| f64::from(raw(before)[2]) - ground);
            match (own, expected) {
                (Some(own), Some(expected)) => {
                    assert!((f64::from(own) - expected).abs() < 0.5 + 1e-6, "{own} {expected}");
                    high += usize::from(own > 300);
                }
                (own, expected) => {
                    assert!(own.is_none() && expected.is_none(), "{own:?} {expected:?}");
                    none += 1;
                }
            }
        }
        assert!(none > 500 && none < 5000, "{none}");
        all_high += high;
        // A dimension that is there is made anew.
        let again = place.path().join("again.laz");
        assert_eq!(
            after,
            records(output.to_str().unwrap(), above(Some(HeightsAs::Dimension), &[]), &again)
        );
        assert!(std::fs::read(&output).unwrap() == std::fs::read(&again).unwrap());
    }
    assert!(all_high > 1000, "{all_high}");
}

#[test]
fn heights_in_place_of_z_are_the_same_and_points_without_are_left_out() {
    let place = Place::new();
    let input = bare_west(&place, "cloud,size=50,density=5,seed=8", 6);
    let [first, second] = ["1.laz", "2.laz"].map(|name| place.path().join(name));
    let heights: Vec<_> = records(&input, above(Some(HeightsAs::Dimension), &[]), &first)
        .iter()
        .map(|record| ([raw(record)[0], raw(record)[1], height(record)], record[12..30].to_vec()))
        .filter(|(place, _)| place[2] != NONE)
        .collect();
    let as_z: Vec<_> = records(&input, above(Some(HeightsAs::Z), &[]), &second)
        .iter()
        .map(|record| (raw(record), record[12..].to_vec()))
        .collect();
    assert!(heights == as_z && as_z.len() > 5000);
    let cloud =
        terrane_cloud::open(&[second.to_str().unwrap().to_owned()], &CloudOpenOptions::default());
    let cloud = cloud.unwrap();
    use terrane_cloud::PointSource;
    assert_eq!(cloud.info().frame.offset[2], 0.0);
    let thin = "1:highest".parse::<CellThinning>().unwrap();
    let above = above(Some(HeightsAs::Z), &["ground", "height"]);
    for output in ["3.copc.laz", "3.csv"] {
        let output = place.path().join(output);
        let job = job(&[&input], &output).classify(above.clone()).stage(thin);
        assert!(run(&job).unwrap().points > 2000);
    }
}

#[test]
fn classes_come_from_the_ground_filter_and_from_heights() {
    let place = Place::new();
    let output = place.path().join("out.laz");
    for format in [3, 6] {
        let input = survey(&place, "cloud,size=90,density=6,seed=9", format, "in.laz");
        let before = whole(Path::new(&input)).records;
        let class = |record: &[u8]| if format == 3 { record[15] & 31 } else { record[16] };
        // As if nobody had looked at it.
        let bare = place.path().join("bare.las");
        let job = |above: HeightQuery, input: &str, output: &Path| {
            run(&job(&[input], output).classify(above)).unwrap();
            whole(output).records
        };
        job(HeightQuery::default(), &input, &bare);
        let bare = bare.to_str().unwrap();
        rewrite(bare, |record| match format {
            3 => record[15] = record[15] & !31 | 1,
            _ => record[16] = 1,
        });
        let found = job(above(None, &["ground"]), bare, &output);
        let is_ground = |record: &[u8]| class(record) == 2;
        let right = before.iter().zip(&found).filter(|(a, b)| is_ground(a) && is_ground(b)).count();
        let all = before.iter().filter(|record| is_ground(record)).count();
        let taken = found.iter().filter(|record| is_ground(record)).count();
        assert!(right * 10 > all * 8 && right * 100 > taken * 95, "{right} {all} {taken}");
        assert!(found.iter().all(|record| [1, 2].contains(&class(record))));
        let asked = above(Some(HeightsAs::Dimension), &["ground", "height:3=0.5,5=5,4=7.25"]);
        let layered = job(asked, bare, &output);
        let mut counts = [0; 32];
        for (found, layered) in found.iter().zip(&layered) {
            let metres = f64::from(height(layered)) * 0.01;
            let expected = match metres {
                _ if is_ground(found) => 2,
                // Heights are rounded to a step for the dimension alone.
                _ if [0.5, 5.0, 7.25].iter().any(|from: &f64| (from - metres).abs() < 0.011) => {
                    continue;
                }
                _ if height(layered) == NONE || metres < 0.5 => 1,
                _ if metres < 5.0 => 3,
                _ if metres < 7.25 => 5,
                _ => 4,
            };
            assert_eq!(class(layered), expected, "{metres}");
            counts[usize::from(expected)] += 1;
        }
        assert!(counts[1..6].iter().all(|count| *count > 0), "{counts:?}");
        // Those that were ground are it no longer, where they are not found.
        let refound = job(above(None, &["ground"]), &input, &output);
        let of_ground = |records: &[Vec<u8>]| records.iter().filter(|r| is_ground(r)).count();
        assert!(of_ground(&refound).abs_diff(taken) < taken / 20);
        let others = before.iter().zip(&refound).filter(|(a, b)| !is_ground(a) && !is_ground(b));
        assert!(others.into_iter().all(|(a, b)| a == b));
    }
}

#[test]
fn neither_filters_nor_memory_nor_threads_change_what_is_told() {
    let place = Place::new();
    let input = survey(&place, "cloud,width=400,height=100,density=6,seed=3", 7, "in.laz");
    let output = place.path().join("out.laz");
    let asked = above(Some(HeightsAs::Dimension), &["ground", "height"]);
    let all = records(&input, asked.clone(), &output);
    let bytes = std::fs::read(&output).unwrap();
    let least = {
        let resources = Resources { threads: 1, memory: 1 << 20, temp_dir: None };
        let job = TranslateJob { resources, ..job(&[&input], &output) }.classify(asked.clone());
        let error = run(&job).unwrap_err().to_string();
        let advised = error.split("‹memory› ").nth(1).and_then(|text| text.split('M').next());
        advised.unwrap().parse::<u64>().unwrap()
    };
    for (threads, memory) in [(1, least), (3, least + 100), (2, 4096)] {
        let resources = Resources { threads, memory: memory << 20, temp_dir: None };
        run(&TranslateJob { resources, ..job(&[&input], &output) }.classify(asked.clone()))
            .unwrap();
        assert!(std::fs::read(&output).unwrap() == bytes, "{threads} {memory}");
    }
    let filter = CloudFilter {
        classes: Some(vec![5, 6]),
        returns: Some(Return::First),
        ..job(&[&input], &output).cloud.filter
    };
    let options = CloudOpenOptions { filter, ..job(&[&input], &output).cloud };
    let some = TranslateJob { cloud: options, ..job(&[&input], &output) }.classify(asked);
    run(&some).unwrap();
    let found = whole(&output).records;
    let before = whole(Path::new(&input)).records;
    let is_wanted = |record: &[u8]| [5, 6].contains(&class(record)) && record[14] & 15 <= 1;
    let expected: Vec<_> =
        before.iter().zip(&all).filter(|(a, _)| is_wanted(a)).map(|(_, b)| b.clone()).collect();
    assert!(found == expected && found.len() > 1000);
}

#[test]
fn what_the_ground_cannot_tell_is_refused() {
    let place = Place::new();
    let input = survey(&place, "cloud,size=30,density=4,seed=2", 3, "in.laz");
    let output = place.path().join("out.laz");
    let refused = |above: HeightQuery, told: &str| {
        let error = run(&job(&[&input], &output).classify(above)).unwrap_err();
        assert!(error.to_string().contains(told), "{error}");
        assert!(!output.exists());
    };
    let heights = Some(HeightsAs::Dimension);
    refused(above(None, &["ground", "ground"]), "same method twice");
    refused(above(None, &["height:64=3"]), "class 64 is not supported by point format 3");
    refused(
        HeightQuery { from: GroundFrom::Class, ..above(None, &["ground"]) },
        "‹classify› ground has no effect",
    );
    refused(
        HeightQuery { from: GroundFrom::PMF, ..HeightQuery::default() },
        "‹ground› has no effect",
    );
    let few = survey(&place, "cloud,size=30,density=4,seed=2", 6, "few.laz");
    let filter = CloudFilter { z_range: Some([1e5, 2e5]), ..CloudFilter::default() };
    let options = CloudOpenOptions { filter, ..CloudOpenOptions::default() };
    let nothing =
        TranslateJob { cloud: options, ..job(&[&few], &output) }.classify(above(heights, &[]));
    assert!(run(&nothing).unwrap_err().to_string().contains("no ground found"));
    for text in
        ["", "grounds", "height:", "height:3", "height:3=x", "height:300=1", "height:3=2,4=1"]
    {
        assert!(text.parse::<Classify>().is_err(), "{text}");
    }
    for text in ["ground", "height:3=0.5,4=2,5=5"] {
        assert_eq!(text.parse::<Classify>().unwrap().to_string(), text);
    }
}

#[test]
fn whole_numbers_far_from_zero_change_nothing() {
    let place = Place::new();
    let output = place.path().join("out.laz");
    let near = survey(&place, "cloud,size=60,density=5,seed=4", 6, "near.las");
    let far = place.path().join("far.las");
    // As files of one lattice for a country have it: y beyond 2^29 steps of a centimetre.
    let (mut bytes, steps) = (std::fs::read(&near).unwrap(), 600_000_000);
    let offset = f64::from_le_bytes(number(&bytes, 163)) - f64::from(steps) * 0.01;
    bytes[163..171].copy_from_slice(&offset.to_le_bytes());
    std::fs::write(&far, bytes).unwrap();
    let far = far.to_str().unwrap();
    rewrite(far, |record| {
        let y = raw(record)[1] + steps;
        record[4..8].copy_from_slice(&y.to_le_bytes());
    });
    let thin = "0.7:lowest".parse::<CellThinning>().unwrap();
    let told = |input: &str, ask: &str, thin| {
        let from = if ask == "ground" { GroundFrom::PMF } else { GroundFrom::Auto };
        let above = HeightQuery { from, ..above(Some(HeightsAs::Dimension), &[ask]) };
        run(&job(&[input], &output).classify(above).stages(thin)).unwrap();
        let all = whole(&output).records;
        all.iter().map(|r| (raw(r)[0], class(r), height(r))).collect::<Vec<_>>()
    };
    for thin in [None, Some(thin)] {
        let found = told(&near, "height", thin);
        assert!(found == told(far, "height", thin) && found.len() > 4000, "{thin:?}");
    }
    // The cells of the filter begin where the frame does, so a few points may differ.
    let [near, far] = [&near, far].map(|input| told(input, "ground", None));
    let same = near.iter().zip(&far).filter(|(a, b)| a.1 == b.1).count();
    assert!(same * 1000 > near.len() * 995, "{same} of {}", near.len());
}
