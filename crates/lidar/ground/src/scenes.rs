//! Scenes whose ground is known exactly, for the method `csf-ptd`.

use crate::finder::Request;
use crate::lowest_points::{LowestPoints, NO_POINT};
use terrane_base::geom::Point;

const WIDTH: usize = 180;
const ROWS: usize = 170;

/// A cell's lowest point: its height in metres, and whether it is ground.
type Low = (f64, bool);

/// What is wrong with the ground that is found, cell by cell: ground that is refused, and what else is taken.
fn wrong(scene: impl Fn(usize, usize) -> Option<Low>) -> [Vec<(usize, usize)>; 2] {
    let cells: Vec<_> = (0..WIDTH * ROWS).map(|k| (k % WIDTH, k / WIDTH)).collect();
    let at = |v: usize| v as i32 * 100 + 50;
    let point = |&(col, row): &(usize, usize)| {
        let low = scene(col, row);
        low.map_or(NO_POINT, |(z, _)| Point::new(at(col), at(row), (z * 100.0).round() as i32))
    };
    let points: Vec<Point> = cells.iter().map(point).collect();
    let lows = LowestPoints {
        points: &points,
        width: WIDTH,
        cell: 1.0,
        corner: [0.0; 2],
        step: [0.01; 3],
    };
    let found = Request::DEFAULT.find(&lows);
    let mut wrong = [vec![], vec![]];
    for (at, (col, row)) in cells.into_iter().enumerate() {
        let Some((_, is_ground)) = scene(col, row) else { continue };
        let is_found = found.is_ground(col, row, [0.5; 2], points[at].z);
        match (is_ground, is_found) {
            (true, false) => wrong[0].push((col, row)),
            (false, true) => wrong[1].push((col, row)),
            _ => {}
        }
    }
    wrong
}

/// A slope that no scene is level on.
fn slope(col: usize, row: usize) -> f64 {
    col as f64 * 0.06 - row as f64 * 0.03
}

#[test]
fn both_sides_of_a_cliff_are_ground_but_for_some_cells_beside_it() {
    for height in [3.0, 6.0, 15.0] {
        let edge = |row: usize| 80 + row / 8;
        let top = |col: usize, row: usize| if col < edge(row) { 0.0 } else { height };
        let [refused, _] = wrong(|col, row| Some((slope(col, row) + top(col, row), true)));
        let away = |(col, row): &(usize, usize)| col.abs_diff(edge(*row));
        let far = refused.iter().map(away).max();
        let far = far.unwrap_or(0) as f64;
        assert!(far <= 1.0 + 0.7 * height && refused.len() < 600, "{height} {far} {refused:?}");
    }
}

#[test]
fn buildings_that_the_border_cuts_are_no_ground() {
    for deep in [6, 15, 30, 45] {
        for height in [2.5, 8.0] {
            let is_roof = |col: usize, row: usize| {
                let west = col < deep && (40..90).contains(&row);
                let corner = col >= WIDTH - deep && row >= ROWS - deep;
                west || corner
            };
            let [refused, taken] = wrong(|col, row| {
                let roof = if is_roof(col, row) { height } else { 0.0 };
                Some((slope(col, row) + roof, !is_roof(col, row)))
            });
            assert_eq!([refused, taken], [vec![], vec![]], "{deep} {height}");
        }
    }
}

#[test]
fn a_bridge_is_no_ground_and_what_it_spans_is() {
    for (half, deep) in [(15, 5.0), (25, 8.0)] {
        let valley = |row: usize| {
            let away = row.abs_diff(85).saturating_sub(half / 3);
            (away as f64 / (half - half / 3) as f64 - 1.0).min(0.0) * deep
        };
        let spans = |col: usize, row: usize| (90..98).contains(&col) && valley(row) < -0.5;
        let [refused, taken] = wrong(|col, row| {
            let level = col as f64 * 0.06;
            let z = if spans(col, row) { 0.0 } else { valley(row) };
            Some((level + z, !spans(col, row)))
        });
        assert!(refused.len() < 9 && taken.is_empty(), "{half} {refused:?} {taken:?}");
    }
}
