//! Lines and points to keep, against a twin that looks at every step of every line and at every point.

use super::*;
use proptest::prelude::*;
use std::collections::HashSet;
use terrane_base::geom::{Crs, SampleSegment};
use terrane_engine::constraints::ConstraintVertices;

/// Vertices of lines, in steps, each with a height or NaN.
type Shapes = Vec<Vec<[f64; 3]>>;

fn features(shapes: &Shapes) -> ConstraintVertices {
    let all = || shapes.iter().flatten();
    let world = |&[x, y, _]: &[f64; 3]| [x * 0.01 + 1000.0, y * 0.01 + 2000.0];
    let ends = shapes.iter().scan(0, |end, shape| {
        *end += shape.len() as u32;
        Some(*end)
    });
    ConstraintVertices {
        path: "lines.wkt".into(),
        crs: Crs::default(),
        at: all().map(world).collect(),
        z: all().map(|[_, _, z]| z * 0.01).collect(),
        ends: ends.collect(),
    }
}

fn kept(source: &PointSample, points: &Shapes, lines: &Shapes) -> OnCloud {
    let some = |shapes: &Shapes| (!shapes.is_empty()).then(|| features(shapes));
    let bounds = source.info.bounds.unwrap();
    OnCloud::new(some(points), some(lines), &source.info, bounds).unwrap()
}

/// What a line is to the twin: its steps over the hull, and its heights at these.
struct Way {
    sites: Vec<[i32; 2]>,
    heights: Option<Vec<i32>>,
}

fn ways(kept: &OnCloud, source: &PointSample) -> Vec<Way> {
    let [low, _] = source.info.bounds.unwrap();
    let hull = ConvexHull::of(source.points.clone());
    let way = |line: &terrane_engine::cloud_constraints::LatticeLine| {
        let [a, b] = line
            .ends
            .map(|[x, y]| [i64::from(low.x) + i64::from(x), i64::from(low.y) + i64::from(y)]);
        let segment = SampleSegment::new(a, b);
        let all: Vec<_> =
            (0..=segment.steps()).map(|step| segment.at(step).map(|v| v as i32)).collect();
        let inside = |site: &[i32; 2]| {
            use terrane_delaunay::{FixedPosition, HullLocation};
            hull.locate(FixedPosition::of(*site)) != HullLocation::Outside
        };
        let (first, last) = (all.iter().position(inside)?, all.iter().rposition(inside)?);
        let height = |step: usize, [p, q]: [i32; 2]| match segment.steps() {
            0 => p.min(q),
            steps => {
                let share = step as f64 / steps as f64;
                (f64::from(p) + share * f64::from(q - p) + 0.5 + 1e-9).floor() as i32
            }
        };
        let heights =
            line.heights.map(|ends| (first..=last).map(|step| height(step, ends)).collect());
        Some(Way { sites: all[first..=last].to_vec(), heights })
    };
    kept.lines.iter().filter_map(way).collect()
}

/// Fails unless the mesh follows all lines, has no other vertices than it may, and keeps points and the bound.
fn judge(
    kept: &OnCloud,
    source: &PointSample,
    tolerance: f64,
    made: &(Vec<Point>, Vec<[u64; 3]>, CloudTinOutcome),
) {
    let (vertices, triangles, made) = made;
    let mut reference = whole(vertices);
    assert_eq!(shapes(vertices, triangles), shapes_of(&reference));
    let mut points = source.points.clone();
    points.sort_unstable();
    points.dedup_by_key(|p| (p.x, p.y));
    assert!(
        !InsertUntilWithin::new(&mut reference, &points, tolerance).is_open(),
        "a point is beyond {tolerance}"
    );
    let at = |v: u64| [vertices[v as usize].x, vertices[v as usize].y];
    let all: HashSet<[i32; 2]> = vertices.iter().map(|v| [v.x, v.y]).collect();
    let mut edges = HashSet::new();
    for [a, b, c] in triangles.iter().map(|ids| ids.map(at)) {
        edges.extend([(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)]);
    }
    let ways = ways(kept, source);
    assert_eq!(made.apart, Vec::<[i32; 2]>::new());
    for way in &ways {
        let on: Vec<_> = way.sites.iter().copied().filter(|site| all.contains(site)).collect();
        assert!(on.first() == way.sites.first() && on.last() == way.sites.last(), "an end is none");
        for (i, &from) in on.iter().enumerate().take(on.len() - 1) {
            assert!(on[i + 1..].iter().any(|&to| edges.contains(&(from, to))), "{from:?}");
        }
    }
    for vertex in vertices.iter().filter(|vertex| !points.contains(vertex)) {
        let site = [vertex.x, vertex.y];
        assert!(!points.iter().any(|p| [p.x, p.y] == site), "a post in place of a point");
        let here = ways.iter().filter_map(|way| {
            let step = way.sites.iter().position(|&other| other == site)?;
            Some(way.heights.as_ref().map(|heights| heights[step]))
        });
        let here: Vec<_> = here.collect();
        assert!(!here.is_empty(), "{site:?} is neither a point nor on a line");
        match here.iter().flatten().min() {
            Some(&z) => assert_eq!(z, vertex.z, "{site:?}"),
            None => assert_eq!(surface(&points, site), vertex.z, "{site:?}"),
        }
    }
}

/// The height of the triangulation of all points, by looking at all triangles.
fn surface(points: &[Point], [x, y]: [i32; 2]) -> i32 {
    let mesh = whole(points);
    let all = (0..mesh.triangles().len() as u32).filter_map(|t| mesh.corners(t));
    let turn = |a: [i32; 2], b: [i32; 2], c: [i32; 2]| terrane_delaunay::orient(a, b, c);
    let heights = all.filter_map(|corners| {
        let [a, b, c] = corners.map(|p| [p.x, p.y]);
        let sides = [turn(b, c, [x, y]), turn(c, a, [x, y]), turn(a, b, [x, y])];
        let area: i64 = sides.iter().sum();
        let sum: i128 = (0..3).map(|i| i128::from(sides[i]) * i128::from(corners[i].z)).sum();
        let twice = 2 * sum + i128::from(area);
        sides.iter().all(|&side| side >= 0).then(|| twice.div_euclid(2 * i128::from(area)) as i32)
    });
    heights.min().unwrap()
}

fn small() -> impl Strategy<Value = (Vec<Point>, Shapes, Shapes)> {
    let point = (0..90i32, 0..70i32, 0..25i32).prop_map(|(x, y, z)| Point::new(x, y, z));
    let points = prop::collection::vec(point, 4..150);
    let height = prop_oneof![Just(f64::NAN), -20.0..40.0f64];
    let vertex = (-15.0..105.0f64, -15.0..85.0f64, height).prop_map(|(x, y, z)| [x, y, z]);
    let lines = prop::collection::vec(prop::collection::vec(vertex, 2..5), 1..7);
    let kept = prop::collection::vec((0.0..90.0f64, 0.0..70.0f64), 0..5)
        .prop_map(|at| at.into_iter().map(|(x, y)| vec![[x, y, f64::NAN]]).collect());
    (points, lines, kept)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn lines_over_any_small_cloud_are_followed(
        (points, lines, peaks) in small(), tolerance in 0..3usize, claimed in 1..40u64
    ) {
        prop_assume!(!ConvexHull::of(points.clone()).is_flat());
        let source = source(points, claimed * 4096);
        let tolerance = [0.0, 4.5, 18.0][tolerance];
        let kept = kept(&source, &peaks, &lines);
        let one = mesh_with(&kept, &source, tolerance, 30, 2, 1 << 30);
        judge(&kept, &source, tolerance, &one);
        let mut back = source.points.clone();
        back.reverse();
        let back = super::source(back, claimed * 4096);
        let two = mesh_with(&kept, &back, tolerance, 30, 1, 4000);
        prop_assert_eq!((one.0, one.1), (two.0, two.1));
    }
}

#[test]
fn lines_through_many_regions_are_followed() {
    let source = source(ground(8000), 8000 * 100);
    let bends: Vec<_> = (0..40)
        .map(|i| [f64::from(i) * 500.3, 7000.0 + 2500.0 * (f64::from(i) * 0.4).sin(), f64::NAN])
        .collect();
    let lines = vec![
        bends,
        vec![[-900.0, -700.0, 10.0], [21_000.0, 9000.0, 300.0]],
        vec![[3010.0, 3010.0, f64::NAN], [3040.0, 3050.0, f64::NAN], [9000.0, 3010.0, 2.0]],
        // A hull edge, a line a step beside another, and one that is a point.
        vec![[0.0, 0.0, f64::NAN], [19_000.0, 0.0, f64::NAN]],
        vec![[2000.0, 500.0, 0.0], [18_000.0, 4000.0, 0.0]],
        vec![[2000.0, 501.0, 90.0], [18_000.0, 4001.0, 90.0]],
        vec![[777.0, 777.0, 5.0], [777.0, 777.0, 5.0]],
    ];
    let peaks = vec![vec![[3333.0, 4444.0, f64::NAN]], vec![[100.0, 19_000.0, f64::NAN]]];
    let kept = kept(&source, &peaks, &lines);
    for tolerance in [0.0, 40.0] {
        let made = mesh_with(&kept, &source, tolerance, 700, 2, 1 << 30);
        judge(&kept, &source, tolerance, &made);
        let plain = mesh(&source, tolerance, 700, 2, 1 << 30);
        let more = made.0.len() - plain.0.len();
        assert!((50..3000).contains(&more), "{more}");
    }
}

#[test]
fn points_nearest_to_others_are_vertices() {
    let source = source(ground(3000), 3000 * 100);
    let mut state = 5;
    let at: Vec<[f64; 3]> = (0..200)
        .map(|_| [random(&mut state, 24_000), random(&mut state, 24_000), 0].map(f64::from))
        .collect();
    let kept = kept(&source, &vec![at.clone()], &Vec::new());
    let (vertices, ..) = mesh_with(&kept, &source, 500.0, 700, 2, 1 << 30);
    let hull = ConvexHull::of(source.points.clone());
    let (mut inside, mut nearest_of_all) = (0, HashSet::new());
    for [x, y] in at.iter().map(|at| [at[0] as i32, at[1] as i32]) {
        use terrane_delaunay::{FixedPosition, HullLocation};
        if hull.locate(FixedPosition::of([x, y])) == HullLocation::Outside {
            continue;
        }
        let far = |p: &Point| (i64::from(p.x - x).pow(2) + i64::from(p.y - y).pow(2), *p);
        let nearest = source.points.iter().copied().min_by_key(far).unwrap();
        assert!(vertices.contains(&nearest), "{nearest:?}");
        nearest_of_all.insert(nearest);
        inside += 1;
    }
    let report =
        |beyond| kept.points_report(beyond, nearest_of_all.len() as u64, 0).unwrap().unwrap();
    let beyond = kept.points.len() as u64 - inside;
    assert!((20..190).contains(&inside) && report(beyond).outside == 200 - inside);
}

#[test]
fn what_is_not_over_the_cloud_is_counted_or_refused() {
    let source = source(ground(3000), 3000);
    let bounds = source.info.bounds.unwrap();
    let far = vec![vec![[-500.0, 5.0, 1.0], [-300.0, 9.0, 1.0]]];
    let kept = kept(&source, &far, &far);
    assert!(kept.breaklines_report(|_| false, 0).is_err() && kept.points_report(0, 0, 0).is_err());
    let huge = vec![vec![[50.0, 50.0, 1e300], [60.0, 50.0, 0.0]]];
    let error = OnCloud::new(None, Some(features(&huge)), &source.info, bounds).unwrap_err();
    assert!(
        error.to_string().contains("lines.wkt") && error.to_string().contains("height"),
        "{error}"
    );
    for odd in [f64::NAN, f64::INFINITY, -1e308, 5e-324] {
        let line = vec![
            vec![[odd, 50.0, 1.0], [600.0, odd, 1.0]],
            vec![[50.0, 50.0, 1.0], [900.0, 60.0, 1.0]],
        ];
        let kept = super::lines::kept(&source, &Vec::new(), &line);
        let made = mesh_with(&kept, &source, 40.0, 700, 2, 1 << 30);
        judge(&kept, &source, 40.0, &made);
    }
}

#[test]
fn heights_are_cut_with_their_lines_and_do_not_know_directions() {
    let source =
        source(vec![Point::new(0, 0, 0), Point::new(100, 100, 0), Point::new(0, 100, 5)], 3);
    let line = [[-100.0, 50.0, 0.0], [100.0, 50.0, 200.0]];
    let lines: Vec<_> = [line, [line[1], line[0]]].iter().map(|line| line.to_vec()).collect();
    let kept = kept(&source, &Vec::new(), &lines);
    let expected = terrane_engine::cloud_constraints::LatticeLine {
        ends: [[0, 50], [100, 50]],
        heights: Some([100, 200]),
    };
    assert_eq!(kept.lines, [expected]);
    let told = kept.breaklines_report(|_| false, 7).unwrap().unwrap();
    assert_eq!((told.segments, told.outside, told.apart), (2, 0, 7));
    assert_eq!(kept.breaklines_report(|_| true, 0).unwrap_err().kind(), ErrorKind::BadInput);
}
