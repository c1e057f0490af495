//! Rectangles, affine maps, rounding and predicates against slow twins over many small inputs.

use std::cmp::Ordering;

use proptest::prelude::*;

use super::*;

fn rects() -> impl Strategy<Value = Rect> {
    (0..6_u32, 0..6_u32, 0..5_u32, 0..5_u32).prop_map(|(c, r, w, h)| Rect::new(c, r, w, h))
}

/// Is a sample in a rectangle?
fn holds(rect: &Rect, col: u32, row: u32) -> bool {
    let [cols, rows] = [(rect.col, rect.width, col), (rect.row, rect.height, row)]
        .map(|(first, count, at)| (0..count).any(|k| first + k == at));
    cols && rows
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(1.0)
}

/// Whole numbers few of which are far apart, so that many triples are on a line and many are not.
fn whole() -> impl Strategy<Value = [i64; 2]> {
    let any = prop_oneof![-3..=3_i64, -1_000_000_000..1_000_000_000_i64];
    [any.clone(), any]
}

/// Twice the area of a ring.
fn area(ring: &[[i64; 2]]) -> i128 {
    let cross = |i: usize| {
        let [p, q] = [ring[i], ring[(i + 1) % ring.len()]].map(|p| p.map(i128::from));
        p[0] * q[1] - p[1] * q[0]
    };
    (0..ring.len()).map(cross).sum()
}

/// Multiples of 2^-10, far from the origin.
fn floats(p: [i64; 2]) -> [f64; 2] {
    p.map(|v| v as f64 / 1024.0 + 3e6)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn rectangles_are_sets_of_samples(a in rects(), b in rects()) {
        let all = || (0..12).flat_map(|row| (0..12).map(move |col| (col, row)));
        let both = a.intersect(&b);
        for (col, row) in all() {
            prop_assert_eq!(a.contains(col, row), holds(&a, col, row));
            prop_assert_eq!(both.contains(col, row), holds(&a, col, row) && holds(&b, col, row));
        }
        let count = all().filter(|&(col, row)| holds(&a, col, row)).count();
        prop_assert_eq!((a.len(), a.is_empty()), (count, count == 0));
        prop_assert_eq!((a.end_col() - a.col, a.end_row() - a.row), (a.width, a.height));
    }

    #[test]
    fn affine_maps_are_what_they_are_of_single_steps(
        gt in [-900.0..900.0, 0.5..9.0, -0.4..0.4, -900.0..900.0, -0.4..0.4, -9.0..-0.5_f64],
        [col, row] in [-50.0..50.0_f64, -50.0..50.0],
        [i, j] in [-50.0..50.0_f64, -50.0..50.0],
    ) {
        let map = Affine::from_gdal(gt);
        // Of corners, as GDAL says; the sample is in the middle of its cell.
        let corner = |c: f64, r: f64| [gt[0] + c * gt[1] + r * gt[2], gt[3] + c * gt[4] + r * gt[5]];
        let [x, y] = map.apply(col, row);
        let [to_x, to_y] = corner(col + 0.5, row + 0.5);
        prop_assert!(near(x, to_x) && near(y, to_y));
        let [c, r] = map.invert(x, y);
        prop_assert!(near(c, col) && near(r, row));
        prop_assert!(map.to_gdal().iter().zip(gt).all(|(a, b)| near(*a, b)));
        let shifted = map.shifted(col, row).apply(i, j);
        let moved = map.apply(col + i, row + j);
        prop_assert!(near(shifted[0], moved[0]) && near(shifted[1], moved[1]));
        // The parallelogram of one step each way.
        let [o, a, b] = [map.apply(0.0, 0.0), map.apply(1.0, 0.0), map.apply(0.0, 1.0)];
        let area = (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
        prop_assert!(near(map.determinant(), area) && map.is_valid());
    }

    #[test]
    fn rounded_heights_come_back(height in -9000.0..9000.0_f64, origin in -5000.0..5000.0_f64) {
        let by_hand = |h: f64, scale: f64| {
            let stored = ((h - origin) * scale) as f32;
            f64::from(stored) / scale + origin
        };
        let plain = HeightQuantization::about(origin);
        prop_assert_eq!(plain.apply(height), by_hand(height, 1.0));
        let scaled = HeightQuantization { origin, scale: 3.0 };
        prop_assert_eq!(scaled.apply(height), by_hand(by_hand(height, 3.0), 3.0));
    }

    #[test]
    fn turns_and_areas_are_those_of_whole_numbers(
        ring in prop::collection::vec(whole(), 1..8),
    ) {
        let places: Vec<[f64; 2]> = ring.iter().map(|p| floats(*p)).collect();
        prop_assert_eq!(plane::area_sign(places.iter().copied()), area(&ring).cmp(&0));
        for i in 0..ring.len() {
            let [a, b, c] = [i, i + 1, i + 2].map(|k| k % ring.len());
            let turn = area(&[ring[a], ring[b], ring[c]]).cmp(&0);
            prop_assert_eq!(plane::orient(places[a], places[b], places[c]), turn);
        }
        let same = |k: usize| plane::key(places[0]) == plane::key(places[k]);
        prop_assert!((0..ring.len()).all(|k| same(k) == (ring[0] == ring[k])));
    }

    #[test]
    fn turns_on_a_lattice_are_areas([a, b, c] in prop::array::uniform3([-99..99_i32, -99..99])) {
        let ring = [a, b, c].map(|p| p.map(i64::from));
        prop_assert_eq!(i128::from(predicates::orient(a, b, c)), area(&ring));
    }

    #[test]
    fn points_are_where_their_frame_says(
        steps in [-999..999_i32, -999..999, -999..999], axis in 0..3_usize,
    ) {
        let frame = PointFrame { scale: [0.01, 0.5, 3.0], offset: [-7.0, 11.0, 13.0] };
        let world = frame.world(Point::new(steps[0], steps[1], steps[2]))[axis];
        prop_assert!(near(world, frame.offset[axis] + f64::from(steps[axis]) * frame.scale[axis]));
        prop_assert!(near(frame.steps(axis, world), steps[axis].into()));
        prop_assert_eq!(frame.ruler(axis).place(world), f64::from(steps[axis]));
    }
}

#[test]
fn signs_beyond_what_floats_tell() {
    // All but on a line; the sum of two products of 106 bits each.
    let (a, b) = ([1e100, 1e100], [1e-20, 1e-20]);
    for (c, sign) in [
        ([-1e100, -1e100], Ordering::Equal),
        ([-1e100, (-1e100_f64).next_down()], Ordering::Greater),
        ([-1e100, (-1e100_f64).next_up()], Ordering::Less),
    ] {
        assert_eq!(plane::orient(b, a, c), sign.reverse(), "{c:?}");
        assert_eq!(plane::orient(a, b, c), sign, "{c:?}");
        assert_eq!(plane::area_sign([a, b, c].into_iter()), sign, "{c:?}");
    }
    assert_eq!(plane::key([0.0, 1.0]), plane::key([-0.0, 1.0]));
}

#[test]
fn maps_that_cannot_be_inverted_are_not_valid() {
    assert!(Affine::LATTICE.is_valid());
    for broken in [
        Affine { a: 0.0, ..Affine::LATTICE },
        Affine { a: 1.0, b: 1.0, d: -1.0, ..Affine::LATTICE },
        Affine { x0: f64::NAN, ..Affine::LATTICE },
        Affine { e: f64::INFINITY, ..Affine::LATTICE },
    ] {
        assert!(!broken.is_valid(), "{broken:?}");
    }
}
