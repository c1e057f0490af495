//! Contour lines of whole grids: tiles against the kernel on the grid as a whole, the same bytes
//! however the work is done, and what simplified lines promise.

mod support;

use std::collections::HashMap;

use crate::data;
use proptest::prelude::*;
use support::{Grid, Heights, Line, first_meeting, job, lines_of, made, read, units};
use terrane::ErrorKind;
use terrane_base::geom::{Affine, Crs, Rect};
use terrane_engine::{Cancel, Silent};
use terrane_proof::lines::{self, LineQuestion, ProofDistance};
use terrane_simplify::Length;
use terrane_terrain::contour::trace;
use terrane_vector as vector;
use terrane_window::contour::{
    self as contour, ContourLevels, ContourScratch, ContourWindow, WindowContours,
};

const TERRAIN: &str = "synth:rough,size=300,seed=3";

/// What the kernel makes of a grid in one piece, as a job writes it; and all its vertices.
fn at_once(grid: &Grid, levels: &ContourLevels) -> (Vec<Line>, u64) {
    let width = grid.info.width;
    let window =
        ContourWindow { rect: grid.info.bounds(), grid_width: width, heights: &grid.heights };
    let mut traced = WindowContours::default();
    contour::trace(
        &window,
        levels,
        u64::MAX,
        &mut ContourScratch::default(),
        &mut traced,
        &Cancel::default(),
    )
    .unwrap();
    let mut found = Vec::new();
    for (index, line) in traced.lines.iter().enumerate() {
        let mut vertices = traced.of(index).to_vec();
        let ends = [vertices[0], vertices[vertices.len() - 1]].map(|v| v.nearer(width));
        if line.around == Some(0) && ends[0] == ends[1] {
            continue;
        }
        if line.closed {
            let low = (0..vertices.len()).min_by_key(|&i| vertices[i].edge).unwrap();
            vertices.pop();
            let count = vertices.len();
            vertices.rotate_left(low % count);
            vertices.push(vertices[0]);
        }
        let key = (line.level, vertices[0].edge);
        let position = |v: &contour::ContourVertex| {
            let [col, row] = v.place(width);
            grid.info.transform.apply(col, row)
        };
        let mut xy: Vec<_> = vertices.iter().map(position).collect();
        if grid.info.transform.determinant() > 0.0 {
            xy.reverse();
        }
        found.push((key, Line { height: levels.height(line.level), xy }));
    }
    found.sort_by_key(|(key, _)| *key);
    (found.into_iter().map(|(_, line)| line).collect(), traced.vertices.len() as u64)
}

/// Grids with plateaus on levels, saddles and voids, larger than a few of the smallest tiles.
fn grids() -> impl Strategy<Value = Grid> {
    let sample = prop_oneof![
        9 => (0..4_i32).prop_map(f64::from),
        3 => 0.0..4.0,
        1 => Just(f64::NAN),
    ];
    let full = (0..5_i32).prop_map(|z| f64::from(z) / 2.0);
    let maps = prop_oneof![
        Just(Affine::LATTICE),
        Just(Affine { x0: 5e5, a: 30.0, b: 0.0, y0: 4e6, d: 0.0, e: -30.0 }),
        Just(Affine { x0: -7.0, a: 0.5, b: 0.0, y0: 3.0, d: 0.0, e: 0.5 }),
        Just(Affine { x0: 0.0, a: 1.0, b: 0.5, y0: 0.0, d: 0.25, e: -1.0 }),
    ];
    (1..60_u32, 1..60_u32, maps).prop_flat_map(move |(width, height, map)| {
        let count = (width * height) as usize;
        let smooth = (prop::collection::vec(-3.0..3.0_f64, 6), 0.02..0.4_f64);
        let waves = smooth.prop_map(move |(w, f): (Vec<f64>, f64)| {
            let wave = |i: usize| {
                let (x, y) = ((i as u32 % width) as f64 * f, (i as u32 / width) as f64 * f);
                w[0] * (x + w[3]).sin() + w[1] * (y + w[4] * x).cos() + w[2] * (w[5] * x - y).sin()
            };
            (0..count).map(wave).collect::<Vec<f64>>()
        });
        let heights = prop_oneof![
            prop::collection::vec(sample.clone(), count),
            prop::collection::vec(full.clone(), count),
            waves,
        ];
        heights.prop_map(move |heights| Grid::new(width, height, map, heights))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]

    #[test]
    fn tiles_are_joined_to_what_one_piece_gives(grid in grids(), interval in 0.2..1.5_f64) {
        let levels = ContourLevels::every(interval, 0.0).unwrap();
        let (expected, traced) = at_once(&grid, &levels);
        let heights = Heights::Every { interval, base: 0.0 };
        for (tile, threads) in [(16, 1), (17, 3), (64, 1)] {
            let (lines, report) = lines_of(&grid, &heights, None, tile, threads);
            prop_assert_eq!(&lines, &expected);
            prop_assert_eq!(report.lines, expected.len() as u64);
            prop_assert_eq!(report.vertices, expected.iter().map(|l| l.xy.len() as u64).sum::<u64>());
            prop_assert_eq!(report.original_vertices, traced);
        }
    }

    #[test]
    fn simplified_lines_keep_their_promises(
        grid in grids(), interval in 0.2..1.5_f64, cells in 0.0..30.0_f64,
    ) {
        let heights = Heights::Every { interval, base: 0.0 };
        let map = grid.info.transform;
        let tolerance = cells * map.determinant().abs().sqrt();
        let (before, _) = lines_of(&grid, &heights, None, 16, 1);
        let (after, _) = lines_of(&grid, &heights, Some(tolerance), 16, 2);
        prop_assert_eq!(after.len(), before.len());
        let originals = check_simplified(&before, &after, tolerance);
        // The border between tiles is straight to the last bit where it runs along an axis.
        if map.b == 0.0 {
            prop_assert_eq!(first_meeting(&after), None);
            prove(&before, &after, &originals, ProofDistance::Plane, tolerance);
        }
    }

    #[test]
    fn higher_ground_is_on_the_right(grid in grids(), interval in 0.2..1.5_f64) {
        let heights = Heights::Every { interval, base: 0.0 };
        let (lines, _) = lines_of(&grid, &heights, None, 16, 1);
        let map = grid.info.transform;
        for line in &lines {
            for pair in line.xy.windows(2) {
                let [col, row] = map.invert(pair[0][0], pair[0][1]);
                // The samples at the ends of the edge that the segment starts from.
                let is_down = (col - col.round()).abs() < (row - row.round()).abs();
                let (col, row) = if is_down { (col.round(), row) } else { (col, row.round()) };
                let ends = [[col.floor(), row.floor()], [col.ceil(), row.ceil()]];
                let z = ends.map(|[c, r]| grid.at(c as u32, r as u32));
                let high = if z[0] > z[1] { ends[0] } else { ends[1] };
                let [x, y] = map.apply(high[0], high[1]);
                let ([ax, ay], [bx, by]) = (pair[0], pair[1]);
                prop_assert!((bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0.0);
            }
        }
    }
}

/// Holds lines to the independent checker: distances, crossings, rings, sides. `originals` are the
/// places in `before` of what `after` was made from.
fn prove(
    before: &[Line],
    after: &[Line],
    originals: &[usize],
    distance: ProofDistance,
    tolerance: f64,
) {
    type Flat = (Vec<[f64; 3]>, Vec<usize>, Vec<bool>);
    let flat = |lines: &mut dyn Iterator<Item = &Line>| -> Flat {
        let (mut points, mut starts, mut closed) = (Vec::new(), vec![0], Vec::new());
        for line in lines {
            points.extend(line.xy.iter().map(|[x, y]| [*x, *y, 0.0]));
            starts.push(points.len());
            closed.push(line.xy[0] == line.xy[line.xy.len() - 1]);
        }
        (points, starts, closed)
    };
    let sides = [flat(&mut originals.iter().map(|i| &before[*i])), flat(&mut after.iter())];
    let [original, simplified] = [0, 1].map(|i| lines::ProofLines {
        points: &sides[i].0,
        starts: &sides[i].1,
        closed: &sides[i].2,
    });
    // Its formula for distances is another one.
    let tolerance = Some(tolerance * (1.0 + 1e-9) + 1e-9);
    let question = LineQuestion { original, simplified, points: &[], distance, tolerance };
    let report = lines::check(&question).unwrap();
    assert!(report.is_sound(), "{report:?}");
    assert_eq!((report.original_crossings, report.crossings, report.dropped), (0, 0, 0));
    assert_eq!(report.parts, before.len() as u64);
}

/// Each line of `after` is one of `before` with vertices left out, ends kept, each within `tolerance`;
/// which one.
fn check_simplified(before: &[Line], after: &[Line], tolerance: f64) -> Vec<usize> {
    let mut places = HashMap::new();
    for (index, line) in before.iter().enumerate() {
        for (at, p) in line.xy.iter().enumerate().rev() {
            places.insert((line.height.to_bits(), p.map(f64::to_bits)), (index, at));
        }
    }
    let mut seen = vec![false; before.len()];
    let mut originals = Vec::new();
    for line in after {
        let place = |p: &[f64; 2]| places[&(line.height.to_bits(), p.map(f64::to_bits))];
        let (index, first) = place(&line.xy[0]);
        assert!(!std::mem::replace(&mut seen[index], true), "a line twice");
        originals.push(index);
        let original = &before[index].xy;
        let closed = original[0] == original[original.len() - 1];
        assert_eq!(closed, line.xy[0] == line.xy[line.xy.len() - 1]);
        assert!(closed || (first == 0 && line.xy.last() == original.last()), "an end is gone");
        assert!(!closed || line.xy.len() >= 4, "a ring without area");
        let count = if closed { original.len() - 1 } else { usize::MAX };
        let mut at = first;
        for pair in line.xy.windows(2) {
            let (same, to) = place(&pair[1]);
            assert_eq!(same, index);
            let mut steps = 0;
            while at != to || steps == 0 {
                let distance = distance(original[at], pair[0], pair[1]);
                assert!(distance <= tolerance * (1.0 + 1e-9) + 1e-9, "{distance} > {tolerance}");
                at = (at + 1) % count;
                steps += 1;
                assert!(steps <= original.len(), "vertices out of order");
            }
        }
        assert!(closed || at == original.len() - 1);
        assert!(!closed || at == first, "a ring that goes around more or less than once");
    }
    assert!(originals.iter().copied().eq(0..before.len()), "in another order");
    originals
}

fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, q) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let part = (q[0] * d[0] + q[1] * d[1]) / (d[0] * d[0] + d[1] * d[1]);
    let part = part.clamp(0.0, 1.0);
    (q[0] - part * d[0]).hypot(q[1] - part * d[1])
}

#[test]
fn the_same_bytes_for_any_threads_memory_and_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, tile, threads, memory: u64, tolerance: Option<f64>| {
        let path = folder.path().join(name);
        let mut job = job("synth:rough,size=700,seed=5", &path, 2.0, tile, threads);
        job.options.resources.memory = memory << 20;
        job.options.tolerance = tolerance.map(units);
        let report = made(&job).unwrap();
        (std::fs::read(&path).unwrap(), report)
    };
    let (expected, first) = run("a.geojson", 1024, 1, 1024, None);
    assert!(
        first.lines > 500 && first.rings > 100 && first.run.spilled_bytes == Some(0),
        "{first:?}"
    );
    let mut spilled = 0;
    for (name, tile, threads, memory) in
        [("b.geojson", 64, 1, 36), ("c.geojson", 100, 3, 1024), ("d.geojson", 350, 2, 64)]
    {
        let (bytes, report) = run(name, tile, threads, memory, None);
        assert!(bytes == expected, "{name}");
        spilled += report.run.spilled_bytes.unwrap();
    }
    assert!(spilled > 0);
    let (expected, first) = run("e.geojson", 128, 1, 1024, Some(2.0));
    assert!(first.vertices * 4 < first.original_vertices, "{first:?}");
    for (name, threads, memory) in [("f.geojson", 3, 1024), ("g.geojson", 2, 50)] {
        assert!(run(name, 128, threads, memory, Some(2.0)).0 == expected, "{name}");
    }
}

#[test]
fn simplified_terrain_crosses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for (terrain, tile) in [(TERRAIN, 64), ("synth:plateaus,size=300,seed=3", 100)] {
        let run = |tolerance: Option<f64>| {
            let path = folder.path().join("lines.geojson");
            let mut job = job(terrain, &path, 5.0, tile, 2);
            (job.options.tolerance, job.options.file.replacing.overwrite) =
                (tolerance.map(units), true);
            made(&job).unwrap();
            read(&path, "elev")
        };
        let before = run(None);
        let count = |lines: &[Line]| lines.iter().map(|line| line.xy.len()).sum::<usize>();
        let mut last = count(&before) + 1;
        for tolerance in [0.0, 0.5, 3.0, 20.0] {
            let after = run(Some(tolerance));
            let originals = check_simplified(&before, &after, tolerance);
            assert_eq!(first_meeting(&after), None, "{terrain} {tolerance}");
            prove(&before, &after, &originals, ProofDistance::Plane, tolerance);
            assert!(count(&after) < last, "{terrain} {tolerance}");
            last = count(&after);
        }
    }
}

#[test]
fn every_format_that_is_written_holds_them() {
    let map = Affine { x0: 5.0, a: 0.01, b: 0.0, y0: 45.0, d: 0.0, e: -0.01 };
    let wave = |i: u32| (f64::from(i % 50) / 7.0).sin() + (f64::from(i / 50) / 5.0).cos();
    let grid = Grid::new(50, 40, map, (0..50 * 40).map(wave).collect());
    let (expected, _) = lines_of(&grid, &Heights::Every { interval: 0.25, base: 0.0 }, None, 16, 1);
    assert!(expected.len() > 10);
    let folder = tempfile::tempdir().unwrap();
    for format in vector::FORMATS.iter().filter(|format| format.create.is_some()) {
        let path = folder.path().join("lines").with_extension(format.extensions[0]);
        let mut job = job("memory", &path, 0.25, 16, 1);
        (job.options.attribute, job.options.with_z) = ("height".to_owned(), true);
        let report = trace(&grid, &job, &Silent, &Cancel::default()).unwrap();
        assert_eq!((report.format.as_str(), report.lines), (format.name, expected.len() as u64));
        let found = read(&path, "height");
        // Features of a file with an index come in its order.
        let sorted = |lines: &[Line]| {
            let height = |line: &Line| if format.holds.properties { line.height } else { 0.0 };
            let mut lines: Vec<_> = lines.iter().map(|l| (l.xy.clone(), height(l))).collect();
            lines.sort_by(|a, b| a.partial_cmp(b).unwrap());
            lines
        };
        assert!(sorted(&found) == sorted(&expected), "{}", format.name);
    }
}

#[test]
fn lists_of_levels_and_grids_without_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.geojson");
    let mut wanted = job(TERRAIN, &path, 1.0, 64, 1);
    let all = made(&wanted).unwrap();
    let (low, high) = (all.lowest.unwrap() + 3.5, all.highest.unwrap() - 7.0);
    Heights::List(vec![high, -1e9, low, high]).of(&mut wanted.options);
    wanted.options.file.replacing.overwrite = true;
    let report = made(&wanted).unwrap();
    assert_eq!((report.levels, report.lowest, report.highest), (2, Some(low), Some(high)));
    for (width, height) in [(1, 1), (1, 9), (40, 1), (33, 33)] {
        let flat = Grid::new(width, height, Affine::LATTICE, vec![1.0; (width * height) as usize]);
        let heights = Heights::Every { interval: 1.0, base: 0.0 };
        let (lines, report) = lines_of(&flat, &heights, Some(1.0), 16, 2);
        assert_eq!((lines.len(), report.levels, report.lowest), (0, 0, None));
    }
}

#[test]
fn lines_around_nothing_are_left_out_wherever_tiles_meet() {
    // Single samples on the level: inside a tile, on a rim, where four tiles meet, at the border; and
    // a row of them across a rim.
    let mut heights = vec![0.0; 40 * 40];
    for (col, row) in [(5, 5), (16, 7), (16, 16), (0, 9), (39, 39), (20, 0)] {
        heights[row * 40 + col] = 1.0;
    }
    heights[30 * 40 + 10..30 * 40 + 22].fill(1.0);
    let grid = Grid::new(40, 40, Affine::LATTICE, heights);
    for tile in [16, 64] {
        let (lines, report) = lines_of(&grid, &Heights::List(vec![1.0]), None, tile, 1);
        assert_eq!((lines.len(), report.left_out, report.vertices), (0, 7, 0), "{tile}");
        let (lines, _) = lines_of(&grid, &Heights::List(vec![0.5]), None, tile, 1);
        assert_eq!(lines.len(), 7);
    }
}

/// Waves over 90 x 70 samples that are `cell` apart, from `x0`, `y0` on, southwards.
fn waves(x0: f64, y0: f64, cell: f64, crs: Crs) -> Grid {
    let map = Affine { x0, a: cell, b: 0.0, y0, d: 0.0, e: -cell };
    let wave = |i: u32| (f64::from(i % 90) / 6.0).sin() + (f64::from(i / 90) / 8.0).cos();
    let mut grid = Grid::new(90, 70, map, (0..90 * 70).map(wave).collect());
    grid.info.crs = crs;
    grid
}

#[test]
fn tolerances_have_units() {
    let folder = tempfile::tempdir().unwrap();
    let run = |grid: &Grid, value, unit| {
        let path = folder.path().join("lines.geojson");
        let mut job = job("memory", &path, 0.2, 32, 2);
        (job.options.tolerance, job.options.file.replacing.overwrite) =
            (Some(Length { value, unit }), true);
        let report = trace(grid, &job, &Silent, &Cancel::default())?;
        Ok::<_, terrane::Error>((read(&path, "elev"), report))
    };
    let every = Heights::Every { interval: 0.2, base: 0.0 };
    // Degrees: at 60 degrees north, one of longitude has half the metres of one of latitude.
    let degrees = Crs { epsg: Some(4326), geographic: Some(true), ..Crs::default() };
    let grid = waves(10.0, 60.0, 0.001, degrees.clone());
    let (before, _) = lines_of(&grid, &every, None, 32, 1);
    let (after, report) = run(&grid, 40.0, Some(1.0)).unwrap();
    let told = report.tolerance.unwrap();
    assert_eq!((told.value, told.metres), (40.0, true));
    assert!(report.vertices * 3 < report.original_vertices, "{report:?}");
    // 40 m are 0.00072 degrees of longitude there.
    let originals = check_simplified(&before, &after, 0.00073);
    prove(&before, &after, &originals, ProofDistance::Geographic, 40.0);
    // Feet are converted in a projected system.
    let metres = Crs { epsg: Some(32633), geographic: Some(false), ..Crs::default() };
    let grid = waves(5e5, 6e6, 30.0, metres);
    let (in_feet, report) = run(&grid, 50.0, Some(0.3048)).unwrap();
    assert_eq!(report.tolerance.map(|t| (t.value, t.metres)), Some((50.0 * 0.3048, false)));
    assert_eq!(in_feet, run(&grid, 50.0 * 0.3048, None).unwrap().0);
    // What cannot be told is refused.
    let unknown = run(&waves(0.0, 0.0, 1.0, Crs::default()), 40.0, Some(1.0)).unwrap_err();
    assert!(unknown.to_string().contains("‹tolerance›"), "{unknown}");
    let beyond = run(&waves(0.0, 90.01, 0.001, degrees), 40.0, Some(1.0)).unwrap_err();
    assert!(beyond.to_string().contains("beyond 90 degrees"), "{beyond}");
}

#[test]
fn index_contours_are_marked() {
    let folder = tempfile::tempdir().unwrap();
    let grid = waves(0.0, 0.0, 1.0, Crs::default());
    for name in ["a.geojson", "a.fgb", "a.shp"] {
        let path = folder.path().join(name);
        let mut job = job("memory", &path, 0.25, 32, 1);
        job.options.index = Some(4);
        Heights::Every { interval: 0.25, base: 0.5 }.of(&mut job.options);
        trace(&grid, &job, &Silent, &Cancel::default()).unwrap();
        let mut source = vector::open(&path, &Default::default()).unwrap();
        let mut marked = 0;
        while let Some(feature) = source.next().unwrap() {
            let Some(vector::PropertyValue::Real(height)) = feature.properties.get("elev") else {
                panic!()
            };
            let is_index = (height - 0.5).rem_euclid(1.0) == 0.0;
            let mark = feature.properties.get("index");
            assert_eq!(mark, Some(&vector::PropertyValue::Bool(is_index)), "{name} {height}");
            marked += u32::from(is_index);
        }
        assert!(marked > 3, "{name}");
    }
}

#[test]
fn what_does_not_fit_into_memory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |heights: Vec<f64>, words: &str| {
        let grid = Grid::new(600, 600, Affine::LATTICE, heights);
        let path = folder.path().join("a.geojson");
        let mut job = job("memory", &path, 1.0, 64, 1);
        Heights::List(vec![0.5]).of(&mut job.options);
        job.options.resources.memory = 36 << 20;
        let error = trace(&grid, &job, &Silent, &Cancel::default()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Resource);
        let told = error.to_string();
        assert!(told.contains(words) && told.contains("‹memory›"), "{told}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    // A winding corridor: one line around it.
    let is_wall = |i: u32| {
        let (col, row) = (i % 600, i / 600);
        let gap = if col % 4 == 0 { 1 } else { 598 };
        [0, 599].contains(&col) || [0, 599].contains(&row) || (col % 2 == 0 && row != gap)
    };
    let corridor = (0..600 * 600).map(|i| f64::from(u8::from(is_wall(i))));
    fails(corridor.collect(), "the contour at 0.5 has");
    // Single samples, each with a ring around it.
    let single = (0..600 * 600).map(|i| f64::from(u8::from(i % 2 == 0 && (i / 600) % 2 == 0)));
    fails(single.collect(), "contour segments");
}

#[test]
fn what_cannot_be_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.geojson");
    let usual = || job(TERRAIN, &path, 10.0, 64, 1);
    let fails = |job: &_, kind, words: &str| {
        let error = made(job).unwrap_err();
        assert_eq!(error.kind(), kind, "{error}");
        assert!(error.to_string().contains(words), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    let every = |interval| Heights::Every { interval, base: 0.0 };
    for heights in
        [every(0.0), every(f64::NAN), Heights::List(vec![]), Heights::List(vec![f64::NAN])]
    {
        let mut job = usual();
        heights.of(&mut job.options);
        fails(&job, ErrorKind::Usage, "");
    }
    let mut job = usual();
    job.options.index = Some(5);
    Heights::List(vec![1.0]).of(&mut job.options);
    fails(&job, ErrorKind::Usage, "‹index›");
    job = usual();
    (job.options.index, job.options.attribute) = (Some(5), "index".to_owned());
    fails(&job, ErrorKind::Usage, "‹attribute›");
    job = usual();
    job.options.tile = 8;
    fails(&job, ErrorKind::Usage, "from 16 to 8192");
    job = usual();
    job.options.tolerance = Some(units(-1.0));
    fails(&job, ErrorKind::Usage, "tolerance");
    job = usual();
    job.output = folder.path().join("a.topojson");
    fails(&job, ErrorKind::Usage, "TopoJSON");
    job = usual();
    job.options.resources.memory = 4 << 20;
    fails(&job, ErrorKind::Resource, "‹memory›");
    job = usual();
    every(1e-4).of(&mut job.options);
    fails(&job, ErrorKind::Resource, "‹interval›");
    job = usual();
    every(1e-12).of(&mut job.options);
    fails(&job, ErrorKind::BadInput, "‹interval›");
    std::fs::write(&path, "mine").unwrap();
    assert_eq!(made(&usual()).unwrap_err().kind(), ErrorKind::Usage);
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn windows_of_real_terrain_are_joined() {
    let dem = data::at("dem/srtm_bigtujunga30m_utm11.tif");
    let source = terrane_raster::open(dem.to_str().unwrap(), &Default::default()).unwrap();
    let info = source.info().clone();
    let mut heights = vec![0.0; info.bounds().len()];
    source.read_f64(Rect::new(0, 0, info.width, info.height), &mut heights).unwrap();
    let grid = Grid::new(info.width, info.height, info.transform, heights);
    let levels = ContourLevels::every(20.0, 0.0).unwrap();
    let (lines, report) =
        lines_of(&grid, &Heights::Every { interval: 20.0, base: 0.0 }, None, 100, 2);
    assert!(lines == at_once(&grid, &levels).0);
    assert!(report.lines > 500, "{report:?}");
    assert_eq!(first_meeting(&lines), None);
}
