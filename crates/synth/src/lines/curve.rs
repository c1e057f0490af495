//! The curves, each in a cell of side 1 with its lower left corner at the given place.

use super::{LineFamily, Place, SyntheticLines, Xy};

/// Every family.
pub const SHAPES: &[LineFamily] = &[
    LineFamily {
        name: "koch",
        about: "Koch curve, truncated to the number of vertices",
        is_rings: false,
        draw: koch,
    },
    LineFamily {
        name: "walk",
        about: "random walk with self-crossings",
        is_rings: false,
        draw: walk,
    },
    LineFamily {
        name: "zigzag",
        about: "zigzag of growing width: each split separates one vertex",
        is_rings: false,
        draw: zigzag,
    },
    LineFamily {
        name: "spiral",
        about: "inward spiral, 1000 vertices per turn",
        is_rings: false,
        draw: spiral,
    },
    LineFamily {
        name: "arc",
        about: "quarter circle: all vertices are equally significant",
        is_rings: false,
        draw: arc,
    },
    LineFamily {
        name: "coverage",
        about: "adjacent polygons with rough shared borders, without gaps or overlaps",
        is_rings: true,
        draw: cell,
    },
];

/// A position in the cell at a place.
fn within(place: Place, p: Xy) -> Xy {
    [0, 1].map(|k| f64::from(place[k]) + p[k])
}

/// Half of the square root of 3.
const HALF_ROOT: f64 = 0.866_025_403_784_438_6;

/// The six directions of the curve of von Koch, by sixths of a turn.
const SIXTHS: [Xy; 6] = [
    [1.0, 0.0],
    [0.5, HALF_ROOT],
    [-0.5, HALF_ROOT],
    [-1.0, 0.0],
    [-0.5, -HALF_ROOT],
    [0.5, -HALF_ROOT],
];

/// From west to east, with the fewest levels for the vertices. Source: H. von Koch, "Sur une courbe continue
/// sans tangente" (1904).
fn koch(lines: &SyntheticLines, place: Place, out: &mut Vec<Xy>) {
    let segments = u64::from(lines.vertices) - 1;
    let levels = (0..).find(|level| 4_u64.pow(*level) >= segments).unwrap_or(0);
    out.extend((0..u64::from(lines.vertices)).map(|vertex| within(place, koch_at(vertex, levels))));
}

/// A vertex by the base-4 digits of its number: each selects a quarter of the curve, which is a third as long.
fn koch_at(vertex: u64, levels: u32) -> Xy {
    if vertex == 4_u64.pow(levels) {
        return [1.0, 0.0];
    }
    let (mut at, mut heading, mut length) = ([0.0, 0.0], 0, 1.0);
    for level in (0..levels).rev() {
        length /= 3.0;
        let quarter = (vertex >> (2 * level) & 3) as usize;
        // Headings of the quarters, in sixths of a turn from that of the curve.
        let turns = [0, 1, 5, 0].map(|turn| (heading + turn) % 6);
        for turn in &turns[..quarter] {
            at = [0, 1].map(|k| at[k] + length * SIXTHS[*turn][k]);
        }
        heading = turns[quarter];
    }
    at
}

/// From the middle. A walk of n steps gets about sqrt(n) step lengths far, so few leave the square.
fn walk(lines: &SyntheticLines, place: Place, out: &mut Vec<Xy>) {
    let step = 0.25 / f64::from(lines.vertices).sqrt();
    let of = key(place);
    let mut at = [0.5, 0.5];
    for vertex in 0..u64::from(lines.vertices) {
        out.push(within(place, at));
        at = [0, 1].map(|k| at[k] + step * lines.chance(of, 2 * vertex + k as u64));
    }
}

fn key([col, row]: Place) -> u64 {
    u64::from(col) << 32 | u64::from(row)
}

fn zigzag(lines: &SyntheticLines, place: Place, out: &mut Vec<Xy>) {
    let last = f64::from(lines.vertices - 1);
    out.extend((0..lines.vertices).map(|vertex| {
        let x = f64::from(vertex) / last;
        let sign = if vertex.is_multiple_of(2) { 0.5 } else { -0.5 };
        within(place, [x, 0.5 + sign * x])
    }));
}

fn spiral(lines: &SyntheticLines, place: Place, out: &mut Vec<Xy>) {
    /// Half the angle from one vertex to the next, a thousandth of a turn.
    const HALF_STEP: f64 = std::f64::consts::PI / 1000.0;
    let [cosine, sine] = on_circle(HALF_STEP);
    let mut unit = [1.0, 0.0];
    for vertex in 0..lines.vertices {
        let radius = 0.5 * (1.0 - f64::from(vertex) / f64::from(lines.vertices));
        out.push(within(place, unit.map(|v| 0.5 + radius * v)));
        unit = [unit[0] * cosine - unit[1] * sine, unit[0] * sine + unit[1] * cosine];
    }
}

fn arc(lines: &SyntheticLines, place: Place, out: &mut Vec<Xy>) {
    let last = f64::from(lines.vertices - 1);
    let shares = (0..lines.vertices).map(|vertex| f64::from(vertex) / last);
    out.extend(shares.map(|share| within(place, on_circle(share))));
}

/// The point of the unit circle at an angle, from the tangent of half of it.
fn on_circle(half_tangent: f64) -> Xy {
    let square = half_tangent * half_tangent;
    [(1.0 - square) / (1.0 + square), 2.0 * half_tangent / (1.0 + square)]
}

/// The ring of a cell, counter-clockwise from its lower left corner. The offset of a border is less than the
/// distance to its nearer end, so borders do not cross.
fn cell(lines: &SyntheticLines, [col, row]: Place, out: &mut Vec<Xy>) {
    let steps = (lines.vertices / 4).max(1);
    out.extend((0..steps).map(|i| on_lower_border(lines, [col, row], i, steps)));
    out.extend((0..steps).map(|i| on_left_border(lines, [col + 1, row], i, steps)));
    out.extend((1..=steps).rev().map(|i| on_lower_border(lines, [col, row + 1], i, steps)));
    out.extend((0..=steps).rev().map(|i| on_left_border(lines, [col, row], i, steps)));
}

/// Vertex `i` of the lower border of a cell. The cells on both sides compute it by the same operations.
fn on_lower_border(lines: &SyntheticLines, [col, row]: Place, i: u32, steps: u32) -> Xy {
    let share = f64::from(i) / f64::from(steps);
    let off = stray(lines, key([col, row]) * 2, share, steps);
    [f64::from(col) + share, f64::from(row) + off]
}

/// The same of the left border.
fn on_left_border(lines: &SyntheticLines, [col, row]: Place, i: u32, steps: u32) -> Xy {
    let share = f64::from(i) / f64::from(steps);
    let off = stray(lines, key([col, row]) * 2 + 1, share, steps);
    [f64::from(col) + off, f64::from(row) + share]
}

/// Offset of a border from the line between its corners, at a share of its length: noise with octaves down to its
/// steps.
fn stray(lines: &SyntheticLines, border: u64, share: f64, steps: u32) -> f64 {
    let (mut height, mut weight, mut waves) = (0.0, 0.5, 4_u32);
    while waves / 4 < steps {
        let place = share * f64::from(waves);
        let (from, part) = (place.floor(), place - place.floor());
        let [start, end] = [from, from + 1.0]
            .map(|wave| lines.chance(border, u64::from(waves) << 32 | wave as u64));
        height += weight * (start * (1.0 - part) + end * part);
        weight *= 0.5;
        waves *= 2;
    }
    0.8 * share.min(1.0 - share) * height
}
