//! Bands of small grids: a partition, by slow and simple checks.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use proptest::prelude::*;
use serde_json::Value;
use terrane_base::geom::plane::orient;
use terrane_engine::{Cancel, Silent};
use terrane_line::topology::conflict;

use crate::contour::budget::ContourMemory;
use crate::contour::{ContourJob, ContourOptions, run};

type Position = [f64; 2];

/// A polygon with its band.
struct WrittenBand {
    min: Option<f64>,
    max: Option<f64>,
    rings: Vec<Vec<Position>>,
}

/// A grid of heights, NaN for voids; cells have side 1, and sample (col, row) is at x = col, y = -row.
struct SmallGrid {
    heights: Vec<f64>,
    width: usize,
}

impl std::fmt::Debug for SmallGrid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text())
    }
}

impl SmallGrid {
    /// Heights as digits, voids as dots.
    fn of(rows: &[&str]) -> Self {
        let heights = rows.iter().flat_map(|row| row.chars());
        let heights = heights.map(|z| z.to_digit(10).map_or(f64::NAN, f64::from)).collect();
        Self { heights, width: rows[0].len() }
    }

    fn rows(&self) -> usize {
        self.heights.len() / self.width
    }

    fn height(&self, col: usize, row: usize) -> f64 {
        self.heights[row * self.width + col]
    }

    fn is_whole(&self, col: usize, row: usize) -> bool {
        col + 1 < self.width
            && row + 1 < self.rows()
            && [(0, 0), (1, 0), (0, 1), (1, 1)]
                .iter()
                .all(|(c, r)| !self.height(col + c, row + r).is_nan())
    }

    fn whole_cells(&self) -> usize {
        let cells = (0..self.rows()).flat_map(|row| (0..self.width).map(move |col| (col, row)));
        cells.filter(|&(col, row)| self.is_whole(col, row)).count()
    }

    fn text(&self) -> String {
        let (width, rows) = (self.width, self.rows());
        let mut text = format!(
            "ncols {width}\nnrows {rows}\nxllcenter 0\nyllcenter {}\ncellsize 1\nNODATA_value -9999\n",
            1 - rows as i64
        );
        for row in self.heights.chunks(width) {
            for z in row {
                let z = if z.is_nan() { -9999.0 } else { *z };
                write!(text, "{z} ").unwrap();
            }
            text.push('\n');
        }
        text
    }
}

fn job(folder: &Path, output: &str, options: &ContourOptions) -> ContourJob {
    let mut options = options.clone();
    options.file.replacing.overwrite = true;
    let input = folder.join("grid.asc").display().to_string();
    ContourJob { input: input.as_str().into(), output: folder.join(output), options }
}

fn written(folder: &Path, grid: &SmallGrid, options: &ContourOptions) -> Vec<u8> {
    std::fs::write(folder.join("grid.asc"), grid.text()).unwrap();
    let job = job(folder, "bands.geojson", options);
    run(&job, &Silent, &Cancel::default()).unwrap();
    std::fs::read(&job.output).unwrap()
}

fn features(bytes: &[u8]) -> Vec<Value> {
    let all: Value = serde_json::from_slice(bytes).unwrap();
    all["features"].as_array().unwrap().clone()
}

fn positions(ring: &Value) -> Vec<Position> {
    let both = |p: &Value| [p[0].as_f64().unwrap() + 0.0, p[1].as_f64().unwrap() + 0.0];
    ring.as_array().unwrap().iter().map(both).collect()
}

fn bands(bytes: &[u8]) -> Vec<WrittenBand> {
    let polygon = |feature: &Value| {
        assert_eq!(feature["geometry"]["type"], "Polygon");
        let rings = feature["geometry"]["coordinates"].as_array().unwrap();
        let properties = &feature["properties"];
        WrittenBand {
            min: properties["elev_min"].as_f64(),
            max: properties["elev_max"].as_f64(),
            rings: rings.iter().map(positions).collect(),
        }
    };
    features(bytes).iter().map(polygon).collect()
}

fn cross(o: Position, a: Position, b: Position) -> f64 {
    (a[0] - o[0]) * (b[1] - o[1]) - (b[0] - o[0]) * (a[1] - o[1])
}

fn area(ring: &[Position]) -> f64 {
    ring.windows(2).map(|pair| cross(ring[0], pair[0], pair[1])).sum::<f64>() / 2.0
}

/// By the number of edges to the right of a point that is on none. Exact.
fn contains(rings: &[Vec<Position>], place: Position) -> bool {
    let edges = rings.iter().flat_map(|ring| ring.windows(2));
    let met = edges.filter(|pair| {
        let (low, high) =
            if pair[0][1] < pair[1][1] { (pair[0], pair[1]) } else { (pair[1], pair[0]) };
        let is_beside = low[1] <= place[1] && place[1] < high[1];
        is_beside && orient(low, high, place) == orient([0.0, 0.0], [0.0, 1.0], [-1.0, 0.0])
    });
    met.count() % 2 == 1
}

type EdgeBits = [[u64; 2]; 2];

fn edge(a: Position, b: Position) -> EdgeBits {
    [a, b].map(|p| p.map(f64::to_bits))
}

fn directed(bands: &[WrittenBand]) -> BTreeMap<EdgeBits, [Position; 2]> {
    let mut edges = BTreeMap::new();
    for pair in bands.iter().flat_map(|band| &band.rings).flat_map(|ring| ring.windows(2)) {
        let known = edges.insert(edge(pair[0], pair[1]), [pair[0], pair[1]]);
        assert!(known.is_none(), "an edge twice in one direction: {pair:?}");
    }
    edges
}

/// Rings are closed and simple, outer ones counter-clockwise; polygons have no overlaps and no gaps.
fn check_partition(grid: &SmallGrid, bands: &[WrittenBand]) {
    let mut sum = 0.0;
    for band in bands {
        for (number, ring) in band.rings.iter().enumerate() {
            assert_eq!(ring.first(), ring.last());
            let distinct: BTreeSet<_> = ring[1..].iter().map(|p| p.map(f64::to_bits)).collect();
            assert_eq!(distinct.len(), ring.len() - 1, "a ring meets itself: {ring:?}");
            assert_eq!(area(ring) > 0.0, number == 0, "a ring is the wrong way round: {ring:?}");
            sum += area(ring);
        }
        for hole in &band.rings[1..] {
            let own = hole.iter().find(|place| !band.rings[0].contains(place)).unwrap();
            let inside = contains(&band.rings[..1], *own);
            assert!(inside, "a hole outside of its polygon: {hole:?} {:?}", band.rings[0]);
        }
    }
    let cells = grid.whole_cells() as f64;
    assert!((sum - cells).abs() <= 1e-9 * cells.max(1.0), "{sum} of {cells} cells");
    let edges = directed(bands);
    let mut outline = 0.0;
    for [a, b] in edges.values() {
        if !edges.contains_key(&edge(*b, *a)) {
            let is_along = |axis: usize| a[axis] == b[axis] && a[axis].fract() == 0.0;
            assert!(is_along(0) || is_along(1), "a border off the lattice: {a:?} {b:?}");
            outline += cross([0.0; 2], *a, *b) / 2.0;
        }
    }
    assert!((outline - cells).abs() <= 1e-9 * cells.max(1.0), "{outline} of {cells} cells");
    check_crossings(&edges);
}

/// No two edges cross, and no vertex is within an edge.
fn check_crossings(edges: &BTreeMap<EdgeBits, [Position; 2]>) {
    let mut all: Vec<_> =
        edges.values().map(|&[a, b]| if a <= b { [a, b] } else { [b, a] }).collect();
    all.sort_by(|a, b| a.partial_cmp(b).unwrap());
    all.dedup();
    for (at, [a, b]) in all.iter().enumerate() {
        for [c, d] in all[at + 1..].iter().take_while(|other| other[0][0] <= b[0]) {
            assert!(!conflict([*a, *b], [*c, *d]), "{a:?} {b:?} and {c:?} {d:?} meet");
        }
    }
}

/// Each sample beside whole cells, and not on a level, is in the polygon of its band and in no other.
fn check_samples(grid: &SmallGrid, bands: &[WrittenBand]) {
    for (at, &z) in grid.heights.iter().enumerate() {
        let (col, row) = (at % grid.width, at / grid.width);
        let cells = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(left, up)| {
            let cell = (col.wrapping_sub(left), row.wrapping_sub(up));
            let is_whole =
                cell.0 < grid.width && cell.1 < grid.rows() && grid.is_whole(cell.0, cell.1);
            is_whole.then_some([0.5 - left as f64, up as f64 - 0.5])
        });
        if z.is_nan() || bands.iter().any(|band| [band.min, band.max].contains(&Some(z))) {
            continue;
        }
        for [right, up] in cells.into_iter().flatten() {
            let near = 1e-9;
            let place = [col as f64 + right * near * 0.9, -(row as f64) + up * near];
            let found: Vec<_> = bands.iter().filter(|band| contains(&band.rings, place)).collect();
            assert_eq!(found.len(), 1, "sample {col} {row} of height {z}");
            let WrittenBand { min, max, .. } = found[0];
            assert!(
                min.is_none_or(|min| min < z) && max.is_none_or(|max| z < max),
                "{z} {min:?} {max:?}"
            );
        }
    }
}

/// The edges between polygons are those of the lines.
fn check_lines(folder: &Path, options: &ContourOptions, bands: &[WrittenBand]) {
    let options = ContourOptions { polygons: false, ..options.clone() };
    let job = job(folder, "lines.geojson", &options);
    run(&job, &Silent, &Cancel::default()).unwrap();
    let mut lines = BTreeSet::new();
    for line in features(&std::fs::read(&job.output).unwrap()) {
        let line = positions(&line["geometry"]["coordinates"]);
        lines.extend(line.windows(2).map(|pair| edge(pair[0], pair[1])));
        lines.extend(line.windows(2).map(|pair| edge(pair[1], pair[0])));
    }
    let edges = directed(bands);
    let between = edges.values().filter(|[a, b]| edges.contains_key(&edge(*b, *a)));
    let between: BTreeSet<_> = between.map(|[a, b]| edge(*a, *b)).collect();
    assert_eq!(between, lines);
}

fn options(levels: &[f64], tile: u32, threads: usize) -> ContourOptions {
    let mut options = ContourOptions { polygons: true, tile, ..ContourOptions::default() };
    match levels {
        [interval] => options.interval = Some(*interval),
        _ => options.levels = levels.to_vec(),
    }
    options.resources.threads = threads;
    options
}

/// All checks; returns the polygons.
fn checked(grid: &SmallGrid, levels: &[f64]) -> Vec<WrittenBand> {
    let folder = tempfile::tempdir().unwrap();
    let options_of = |tile, threads| options(levels, tile, threads);
    let bytes = written(folder.path(), grid, &options_of(1024, 1));
    let bands = bands(&bytes);
    check_partition(grid, &bands);
    check_samples(grid, &bands);
    check_lines(folder.path(), &options_of(1024, 1), &bands);
    assert!(written(folder.path(), grid, &options_of(16, 3)) == bytes, "tiles change the result");
    bands
}

/// Polygons of a grid and levels: number of rings of each, with its band.
fn told(rows: &[&str], levels: &[f64]) -> String {
    let bands = checked(&SmallGrid::of(rows), levels);
    let end = |end: Option<f64>| end.map_or(String::new(), |end| end.to_string());
    let texts = bands.iter().map(|band| {
        let rings = band.rings.len();
        format!(
            "{}-{}{}",
            end(band.min),
            end(band.max),
            if rings > 1 { format!(":{rings}") } else { String::new() }
        )
    });
    texts.collect::<Vec<_>>().join(" ")
}

#[test]
fn cases() {
    let cases: &[(&[&str], &[f64], &str)] = &[
        (&["11", "11"], &[2.0], "0-2"),
        (&["13", "13"], &[2.0], "0-2 2-4"),
        (&["1"], &[2.0], ""),
        (&["1234"], &[2.0], ""),
        (&["1", "2", "3"], &[2.0], ""),
        // A top, and a top in a hollow in a top.
        (&["111", "131", "111"], &[2.0], "0-2:2 2-4"),
        (&["11111", "13331", "13131", "13331", "11111"], &[2.0], "0-2:2 0-2 2-4:2"),
        // Plateaus on a level, and single samples on it, which make no band.
        (&["1111", "1221", "1221", "1111"], &[2.0], "0-2:2 2-4"),
        (&["111", "121", "111"], &[2.0], "0-2"),
        (&["1111", "1221", "1111"], &[2.0], "0-2"),
        (&["121", "111", "111"], &[2.0], "0-2"),
        (&["211", "111", "111"], &[2.0], "0-2"),
        (&["222", "212", "222"], &[2.0], "0-2 2-4:2"),
        (&["222", "222", "222"], &[2.0], "2-4"),
        // Saddles: the mean of 2.5 connects the high corners, that of 1.5 the low ones.
        (&["41", "14"], &[2.0], "0-2 0-2 2-4"),
        (&["30", "03"], &[2.0], "0-2 2-4 2-4"),
        // Voids: one sample, two that touch at a corner, a void in the corner.
        (&["11111", "11111", "11.11", "11111", "11111"], &[2.0], "0-2:2"),
        (
            &["1111111", "1111111", "11.1111", "1111111", "1111.11", "1111111", "1111111"],
            &[2.0],
            "0-2:3",
        ),
        (&["1111", "1111", "11.."], &[2.0], "0-2"),
        (&["13113", "13113", "1.1.1", "13113"], &[2.0], "0-2 0-2 2-4 2-4"),
        (&["...", "...", "..."], &[2.0], ""),
        (&["11.", "11.", "..."], &[2.0], "0-2"),
        // Two cells that touch at a sample are two polygons.
        (&["11.", "111", ".11"], &[2.0], "0-2 0-2"),
        // A sample on the level at the corner of a void: it and the hole are in the lower band.
        (&["111111", "111111", "112111", "111.11", "111111", "111111"], &[2.0], "0-2:2"),
        // Open ends of a list.
        (&["1357", "1357"], &[2.0, 4.0], "-2 2-4 4-"),
    ];
    for (rows, levels, expected) in cases {
        assert_eq!(told(rows, levels), *expected, "{rows:?}");
    }
}

/// Grids of few heights, many on levels; with single voids and rectangles of voids, or none.
fn grids() -> impl Strategy<Value = SmallGrid> {
    let height = prop_oneof![6 => (0..6_i32).prop_map(f64::from), 3 => (0..24_i32).prop_map(|z| f64::from(z) / 4.0)];
    let size = prop_oneof![3 => (1..7_usize, 1..7_usize), 2 => (15..40_usize, 15..40_usize)];
    let share = prop_oneof![Just(0_u32), Just(3), Just(30)];
    let lakes = prop::collection::vec((0..40_usize, 0..40_usize, 1..9_usize, 1..9_usize), 0..4);
    (size, share, lakes, 0..3_u32).prop_flat_map(move |((rows, width), voids, lakes, smooth)| {
        let void = (0..100_u32).prop_map(move |at| at < voids);
        let samples = prop::collection::vec((height.clone(), void), rows * width);
        samples.prop_map(move |samples| {
            let mut heights: Vec<f64> = samples.iter().map(|(z, _)| *z).collect();
            for _ in 0..smooth {
                let means =
                    heights.windows(2).map(|pair| ((pair[0] + pair[1]) * 2.0).round() / 4.0);
                heights = means.chain(heights.last().copied()).collect();
            }
            for (at, z) in heights.iter_mut().enumerate() {
                let (col, row) = (at % width, at / width);
                let mut around = lakes.iter();
                let in_lake = around
                    .any(|&(c, r, w, h)| (c..c + w).contains(&col) && (r..r + h).contains(&row));
                if samples[at].1 || in_lake {
                    *z = f64::NAN;
                }
            }
            SmallGrid { heights, width }
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_grids(grid in grids(), levels in prop_oneof![
        Just(vec![1.0]), Just(vec![0.3]), Just(vec![50.0]), Just(vec![2.0, 3.0]), Just(vec![0.0, 5.0]), Just(vec![2.25, 2.5, 4.0]),
    ]) {
        checked(&grid, &levels);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn simplified(grid in grids(), interval in prop_oneof![Just(1.0), Just(0.7)], tolerance in 0.0..6.0_f64) {
        let folder = tempfile::tempdir().unwrap();
        for tile in [16, 1024] {
            let mut options = options(&[interval], tile, 2);
            options.tolerance = Some(tolerance.into());
            check_partition(&grid, &bands(&written(folder.path(), &grid, &options)));
        }
    }
}

/// The memory that the error names is enough, and no less is.
#[test]
fn the_memory_for_a_polygon_is_told() {
    for vertices in [1, 1000, 123_456_789] {
        let lines = |memory| {
            let mut options = options(&[1.0], 16, 1);
            options.resources.memory = memory;
            ContourMemory::of(&job(Path::new(""), "", &options)).line_vertices()
        };
        let enough = ContourMemory::for_line(vertices);
        assert_eq!((lines(enough), lines(enough - 1)), (vertices, vertices - 1));
    }
}

#[test]
fn levels_without_a_band_between_them_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let grid = SmallGrid::of(&["1119", "1119"]);
    std::fs::write(folder.path().join("grid.asc"), grid.text()).unwrap();
    let job = job(folder.path(), "bands.geojson", &options(&[5.0, 5.0_f64.next_up()], 16, 1));
    let error = run(&job, &Silent, &Cancel::default()).unwrap_err().to_string();
    assert!(error.contains("has no width at column 2, row 0"), "{error}");
}
