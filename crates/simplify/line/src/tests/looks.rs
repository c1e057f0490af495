//! Number of tests of Ramer-Douglas-Peucker on adversarial lines: counts, not seconds.

use super::methods::plain_rdp;
use super::*;
use crate::rdp::{counted, rdp};

/// A line of this many vertices, and a tolerance.
type Line = (fn(u32) -> Vec<Xy>, f64);

fn line(count: u32, vertex: impl Fn(u32) -> Xy) -> Vec<Xy> {
    (0..count).map(vertex).collect()
}

fn sign(i: u32) -> f64 {
    if i.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// Polar coordinates as a position.
fn polar(radius: f64, turn: f64) -> Xy {
    [radius * turn.cos(), radius * turn.sin()]
}

/// Between two slanted lines, exact: every second split has half of all vertices at equal distance.
fn slanted(count: u32) -> Vec<Xy> {
    line(count, |i| {
        let (x, y) = (f64::from(i), sign(i));
        [4.0 * x - 3.0 * y, 3.0 * x + 4.0 * y]
    })
}

/// The same, except for one vertex off the lattice.
fn slanted_with_one_odd(count: u32) -> Vec<Xy> {
    let mut line = slanted(count);
    line[count as usize / 2][0] += 0.1;
    line
}

/// The same, rounded everywhere.
fn slanted_and_rounded(count: u32) -> Vec<Xy> {
    line(count, |i| [0.6 * f64::from(i) - 0.8 * sign(i), 0.8 * f64::from(i) + 0.6 * sign(i)])
}

fn growing(count: u32) -> Vec<Xy> {
    line(count, |i| {
        let (x, y) = (f64::from(i), sign(i) * (1.0 + 1e-5 * f64::from(i)));
        [0.6 * x - 0.8 * y, 0.8 * x + 0.6 * y]
    })
}

/// A comb whose farthest vertex is always next to the end.
fn sawtooth(count: u32) -> Vec<Xy> {
    line(count, |i| [f64::from(i), sign(i) * f64::from(i)])
}

fn spiral(count: u32) -> Vec<Xy> {
    line(count, |i| polar(0.01 * f64::from(count - i), 0.01 * f64::from(i)))
}

fn whirl(count: u32) -> Vec<Xy> {
    line(count, |i| polar(f64::from(count - i), 2.4 * f64::from(i)))
}

/// Almost on a circle around the end, the next vertex always the farthest: half of the corners of every
/// hull lie beyond the end, nearly as far.
fn crown(count: u32) -> Vec<Xy> {
    line(count, |i| match i + 1 == count {
        true => [0.0, 0.0],
        false => polar(1.0 + 1e-7 * f64::from(count - i), 2.4 * f64::from(i)),
    })
}

fn arc(count: u32) -> Vec<Xy> {
    line(count, |i| (3.0 * f64::from(i) / f64::from(count)).sin_cos().into())
}

/// A convex chain whose farthest vertex is next to the start.
fn hook(count: u32) -> Vec<Xy> {
    line(count, |i| [(-12.0 * f64::from(i) / f64::from(count)).exp(), f64::from(i) * 1e-9])
}

/// Three positions repeated.
fn triangle(count: u32) -> Vec<Xy> {
    let corners = [[0.0, 0.0], [5.0, 0.0], [2.0, 3.0]];
    line(count, |i| corners[i as usize % 3])
}

/// Back and forth on one line.
fn collinear(count: u32) -> Vec<Xy> {
    line(count, |i| [f64::from(i) * sign(i), 0.0])
}

/// Distant points on an arc around the vertices near the end, alternating: each split searches the vertex
/// farthest from a new end.
fn shuttle(count: u32) -> Vec<Xy> {
    let n = f64::from(count);
    line(count, |i| match i {
        i if i + 1 == count => [1000.0, 0.0],
        i if i.is_multiple_of(2) => {
            let turn = 1e-4 * (f64::from(i) * 2.4).sin();
            let radius = 999.0 - 1e-6 * f64::from(i) / n;
            [999.0 - radius * turn.cos(), radius * turn.sin()]
        }
        i => [999.0, 1.0 - 1e-6 * f64::from(i) / n],
    })
}

/// Three positions off any lattice.
fn triangle_rounded(count: u32) -> Vec<Xy> {
    let corners = [[0.1, 0.0], [5.3, 0.7], [2.0, 3.3]];
    line(count, |i| corners[i as usize % 3])
}

const LINES: &[(&str, Line)] = &[
    ("slanted", (slanted, 0.5)),
    ("slanted, one odd", (slanted_with_one_odd, 0.5)),
    ("growing", (growing, 0.5)),
    ("sawtooth", (sawtooth, 0.5)),
    ("spiral", (spiral, 0.001)),
    ("whirl", (whirl, 0.5)),
    ("crown", (crown, 1e-6)),
    ("arc", (arc, 0.0)),
    ("hook", (hook, 0.0)),
    ("triangle", (triangle, 0.0)),
    ("collinear", (collinear, 0.0)),
    ("shuttle", (shuttle, 1e-9)),
    ("triangle rounded", (triangle_rounded, 0.0)),
];

/// Tests per vertex and doubling of the line, at most: 48 of them for bounding boxes.
const MOST: f64 = 90.0;

/// Tests of a line, per vertex and doubling.
fn looks(line: &[Xy], tolerance: f64) -> f64 {
    let mut kept = Vec::new();
    let looks = counted(&PlaneMetric, line, tolerance, &mut SimplifyScratch::default(), &mut kept);
    let count = line.len() as f64;
    looks as f64 / (count * count.log2())
}

fn assert_few(name: &str, make: fn(u32) -> Vec<Xy>, count: u32, tolerance: f64) {
    let looks = looks(&make(count), tolerance);
    println!("{name}, {count} vertices: {looks:.1} n log2 n");
    assert!(looks < MOST, "{name}, {count} vertices: {looks} n log2 n");
}

#[test]
fn looks_are_few_on_lines_made_to_take_many() {
    for (name, (make, tolerance)) in LINES {
        for count in [1000, 10_000, 100_000] {
            assert_few(name, *make, count, *tolerance);
        }
    }
    assert_few("crown", crown, 1_000_000, 1e-6);
}

#[test]
#[ignore = "a minute"]
fn looks_are_few_at_a_million_vertices() {
    for (name, (make, tolerance)) in LINES {
        assert_few(name, *make, 1_000_000, *tolerance);
    }
}

/// Ambiguity by rounding is not bounded: no lattice contains these vertices.
#[test]
fn rounded_vertices_near_one_line_take_more() {
    assert!(looks(&slanted_and_rounded(10_000), 0.5) < MOST);
    assert!(looks(&slanted_and_rounded(100_000), 0.5) < MOST);
}

#[test]
fn lines_made_to_take_many_looks_are_split_as_by_scans() {
    let rounded: Line = (slanted_and_rounded, 0.5);
    for (make, tolerance) in LINES.iter().map(|(_, line)| *line).chain([rounded]) {
        for line in [make(3000), make(401)] {
            assert_eq!(
                run(rdp, &PlaneMetric, &line, tolerance),
                plain_rdp(&PlaneMetric, &line, tolerance)
            );
        }
    }
}
