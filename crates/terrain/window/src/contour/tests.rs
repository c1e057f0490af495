//! The kernel against its slow twin, and against what its rules promise.

use proptest::prelude::*;

use super::*;
use terrane_base::error::ErrorKind;

fn traced(heights: &[f64], width: usize, levels: &ContourLevels) -> WindowContours {
    let rect = Rect::new(0, 0, width as u32, (heights.len() / width) as u32);
    let window = ContourWindow { rect, grid_width: width as u32, heights };
    let mut lines = WindowContours::default();
    trace(
        &window,
        levels,
        u64::MAX,
        &mut ContourScratch::default(),
        &mut lines,
        &Cancel::default(),
    )
    .unwrap();
    lines
}

/// All lines in a form that does not depend on their order or on where rings begin.
fn canonical(lines: &WindowContours, levels: &ContourLevels) -> Vec<oracle::Line> {
    let mut all: Vec<oracle::Line> = (0..lines.lines.len())
        .map(|i| {
            let WindowContour { level, closed, .. } = lines.lines[i];
            let mut vertices = lines.of(i).to_vec();
            if closed {
                vertices.pop();
                let low = (0..vertices.len()).min_by_key(|&i| vertices[i].edge).unwrap();
                vertices.rotate_left(low);
                vertices.push(vertices[0]);
            }
            (levels.height(level), vertices, closed)
        })
        .collect();
    sort(&mut all);
    all
}

fn sort(lines: &mut [oracle::Line]) {
    lines.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1[0].edge.cmp(&b.1[0].edge)));
}

/// Grids of few different heights, some of them on levels, some void; many plateaus and saddles.
fn grids() -> impl Strategy<Value = (Vec<f64>, usize)> {
    let sample = prop_oneof![
        8 => (0..6_i32).prop_map(f64::from),
        2 => 0.0..6.0,
        1 => Just(f64::NAN),
    ];
    let void_free = prop_oneof![3 => (0..4_i32).prop_map(f64::from), 1 => 0.0..4.0];
    let size = (1..12_usize, 1..80_usize);
    size.prop_flat_map(move |(height, width)| {
        let any = prop::collection::vec(sample.clone(), width * height);
        let full = prop::collection::vec(void_free.clone(), width * height);
        (prop_oneof![any, full], Just(width))
    })
}

fn some_levels() -> impl Strategy<Value = (ContourLevels, std::ops::Range<i32>)> {
    let list = prop::collection::vec(prop_oneof![(0..6_i32).prop_map(f64::from), 0.0..6.0], 1..6);
    prop_oneof![
        prop_oneof![Just(1.0), Just(0.5), Just(0.3), 0.1..3.0]
            .prop_map(|interval| (ContourLevels::every(interval, 0.0).unwrap(), -1..100)),
        list.prop_map(|list| {
            let levels = ContourLevels::list(list.clone()).unwrap();
            let mut distinct = list;
            distinct.sort_by(f64::total_cmp);
            distinct.dedup();
            let end = distinct.len() as i32 + 1;
            (levels, 1..end)
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn as_the_slow_twin((heights, width) in grids(), (levels, numbers) in some_levels()) {
        let found = canonical(&traced(&heights, width, &levels), &levels);
        let heights_of_levels = oracle::levels_of(&heights, &levels, numbers);
        let mut expected: Vec<_> = heights_of_levels
            .iter()
            .flat_map(|&level| oracle::lines(&heights, width, level))
            .collect();
        sort(&mut expected);
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn vertices_are_at_the_level_and_ends_where_lines_may_end(
        (heights, width) in grids(), (levels, _) in some_levels(),
    ) {
        let lines = traced(&heights, width, &levels);
        let rows = heights.len() / width;
        let z = |col: usize, row: usize| heights[row * width + col];
        for i in 0..lines.lines.len() {
            let level = levels.height(lines.lines[i].level);
            for v in lines.of(i) {
                let (col, row) = v.edge.first(width as u32);
                let (col, row) = (col as usize, row as usize);
                let (dc, dr) = if v.edge.is_down() { (0, 1) } else { (1, 0) };
                let (a, b) = (z(col, row), z(col + dc, row + dr));
                let height = a + (b - a) * v.at;
                prop_assert!((height - level).abs() <= (b - a).abs() * NEAREST * 1.01);
                prop_assert!((a >= level) != (b >= level));
            }
            let line = lines.of(i);
            let ends = if lines.lines[i].closed { vec![] } else { vec![line[0], line[line.len() - 1]] };
            for end in ends {
                let (col, row) = end.edge.first(width as u32);
                let (col, row) = (col as usize, row as usize);
                // The two cells of the edge: one of them is not there or has a void.
                let other = if end.edge.is_down() { (col.wrapping_sub(1), row) } else { (col, row.wrapping_sub(1)) };
                let is_whole = |(col, row): (usize, usize)| {
                    col < width - 1 && row < rows - 1
                        && [(0, 0), (1, 0), (0, 1), (1, 1)].iter().all(|(c, r)| !z(col + c, row + r).is_nan())
                };
                prop_assert!(!is_whole((col, row)) || !is_whole(other));
            }
        }
    }

    #[test]
    fn no_two_segments_touch_but_at_common_ends(
        (heights, width) in grids(), (levels, _) in some_levels(),
    ) {
        let lines = traced(&heights, width, &levels);
        let mut segments = Vec::new();
        for i in 0..lines.lines.len() {
            let places: Vec<[f64; 2]> = lines.of(i).iter().map(|v| v.place(width as u32)).collect();
            segments.extend(places.windows(2).map(|pair| [pair[0], pair[1]]));
        }
        segments.sort_by(|a, b| a[0][0].total_cmp(&b[0][0]));
        for (i, a) in segments.iter().enumerate() {
            prop_assert!(a[0] != a[1], "a segment without length");
            for b in &segments[i + 1..] {
                if b[0][0] > a[0][0] + 2.0 {
                    break;
                }
                prop_assert!(!meet(*a, *b), "{a:?} meets {b:?}");
            }
        }
    }
}

/// True when two segments have a point in common other than the end of one that is the start of the
/// other.
fn meet(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> bool {
    use std::cmp::Ordering::Equal;
    use terrane_base::geom::plane::orient;
    if a[1] == b[0] || b[1] == a[0] {
        // Neighbours on a line meet again only if they turn back on themselves.
        let (from, middle, to) = if a[1] == b[0] { (a[0], a[1], b[1]) } else { (b[0], b[1], a[1]) };
        let (u, v) =
            ([middle[0] - from[0], middle[1] - from[1]], [to[0] - middle[0], to[1] - middle[1]]);
        return orient(from, middle, to) == Equal && u[0] * v[0] + u[1] * v[1] < 0.0;
    }
    let sides =
        |s: [[f64; 2]; 2], t: [[f64; 2]; 2]| [orient(s[0], s[1], t[0]), orient(s[0], s[1], t[1])];
    let (ab, ba) = (sides(a, b), sides(b, a));
    if ab == [Equal, Equal] {
        let overlap = |i: usize| {
            let (low, high) = (a[0][i].min(a[1][i]), a[0][i].max(a[1][i]));
            b[0][i].min(b[1][i]) <= high && b[0][i].max(b[1][i]) >= low
        };
        return overlap(0) && overlap(1);
    }
    ab[0] != ab[1] && ba[0] != ba[1]
}

#[test]
fn lines_go_clockwise_around_tops() {
    let heights = [0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0];
    let lines = traced(&heights, 3, &ContourLevels::list(vec![3.0]).unwrap());
    let places: Vec<_> = lines.of(0).iter().map(|v| v.place(3)).collect();
    let third = 1.0 / 3.0;
    let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-9;
    let ring = [[third, 1.0], [1.0, third], [2.0 - third, 1.0], [1.0, 2.0 - third], [third, 1.0]];
    assert!(lines.lines[0].closed);
    assert!(places.iter().zip(ring).all(|(a, b)| near(*a, b)), "{places:?}");
}

#[test]
fn the_mean_of_a_saddle_says_what_belongs_together() {
    // High in the north-west and south-east. The mean is 0.5: it is above 0.4 and, being equal, 0.5,
    // so the low corners are cut off, and the high ones where it is below the level.
    let heights = [1.0, 0.0, 0.0, 1.0];
    for (level, corners) in
        [(0.4, [[1, 0], [0, 1]]), (0.5, [[1, 0], [0, 1]]), (0.6, [[0, 0], [1, 1]])]
    {
        let lines = traced(&heights, 2, &ContourLevels::list(vec![level]).unwrap());
        assert_eq!(lines.lines.len(), 2);
        for corner in corners {
            // A line cuts off the corner that both of its edges have.
            let cuts = |i: usize| {
                lines.of(i).iter().all(|v| {
                    let (col, row) = v.edge.first(2);
                    let (dc, dr) = if v.edge.is_down() { (0, 1) } else { (1, 0) };
                    corner == [col, row] || corner == [col + dc, row + dr]
                })
            };
            assert!(cuts(0) || cuts(1), "{level} {corner:?}");
        }
    }
}

#[test]
fn samples_on_the_level_are_passed_on_the_lower_side() {
    // A single sample on the level: a ring next to it, around nothing.
    let mut heights = [0.0; 25];
    heights[12] = 5.0;
    let level = ContourLevels::list(vec![5.0]).unwrap();
    let lines = traced(&heights, 5, &level);
    assert_eq!((lines.lines.len(), lines.of(0).len()), (1, 5));
    assert_eq!(lines.lines[0].around, Some(0));
    assert!(lines.of(0).iter().all(|v| v.nearer(5) == (2, 2)));
    // A row of them: nothing within, either.
    heights[11] = 5.0;
    assert_eq!(traced(&heights, 5, &level).lines[0].around, Some(0));
    // A whole cell of them: a line around something.
    (heights[6], heights[7]) = (5.0, 5.0);
    assert_eq!(traced(&heights, 5, &level).lines[0].around.map(i64::abs), Some(2));
    // One that is higher.
    heights[6] = 5.5;
    assert_eq!(traced(&heights, 5, &level).lines[0].around, None);
}

#[test]
fn nonsense_is_refused() {
    let levels = ContourLevels::every(1.0, 0.0).unwrap();
    let run = |heights: &[f64], width, most| {
        let rect = Rect::new(7, 9, width, 2);
        let window = ContourWindow { rect, grid_width: 100, heights };
        trace(
            &window,
            &levels,
            most,
            &mut ContourScratch::default(),
            &mut WindowContours::default(),
            &Cancel::default(),
        )
    };
    assert!(run(&[0.0; 5], 2, 9).is_err());
    let side = MOST_SIDE as usize;
    assert!(run(&vec![0.0; 2 * side], MOST_SIDE, 9).is_ok());
    assert!(run(&vec![0.0; 2 * side + 2], MOST_SIDE + 1, 9).is_err());
    let told = run(&[0.0, 0.0, 0.0, 1e12], 2, 9).unwrap_err().to_string();
    assert!(told.contains("column 8, row 10") && told.contains("‹nodata› 1e12"), "{told}");
    let heights = [0.0, 4.0, 4.0, 0.0];
    assert!(run(&heights, 2, 16).is_ok());
    let told = run(&heights, 2, 15).unwrap_err();
    assert_eq!(told.kind(), ErrorKind::Resource);
}

/// Before its first row is read.
#[test]
fn work_that_is_cancelled_ends() {
    let (levels, cancel) = (ContourLevels::every(1.0, 0.0).unwrap(), Cancel::default());
    cancel.cancel();
    let window = ContourWindow {
        rect: Rect::new(0, 0, 2, 2),
        grid_width: 2,
        heights: &[0.0, 1.0, 2.0, 9.0],
    };
    let (mut scratch, mut lines) = (ContourScratch::default(), WindowContours::default());
    let error = trace(&window, &levels, 99, &mut scratch, &mut lines, &cancel).unwrap_err();
    assert_eq!((error.kind(), lines.lines.len()), (ErrorKind::Interrupted, 0));
}

#[test]
fn halfway_the_second_sample_is_the_nearer() {
    for (at, along, down) in [(0.5_f64.next_down(), (3, 2), (3, 2)), (0.5, (4, 2), (3, 3))] {
        let nearer =
            |is_down| ContourVertex { edge: CrossedEdge::new(3, 2, is_down, 7), at }.nearer(7);
        assert_eq!([nearer(false), nearer(true)], [along, down]);
    }
}

#[test]
fn nothing_stays_of_what_was_traced_before() {
    let levels = ContourLevels::every(1.0, 0.0).unwrap();
    let (mut scratch, mut lines) = (ContourScratch::default(), WindowContours::default());
    for (width, heights) in
        [(3, vec![0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0]), (2, vec![0.5; 6])]
    {
        let rect = Rect::new(0, 0, width, heights.len() as u32 / width);
        let window = ContourWindow { rect, grid_width: width, heights: &heights };
        trace(&window, &levels, u64::MAX, &mut scratch, &mut lines, &Cancel::default()).unwrap();
        assert_eq!(lines, traced(&heights, width as usize, &levels));
    }
}
