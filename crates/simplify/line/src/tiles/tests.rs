//! Tiles against slow reference implementations.

use super::*;
use proptest::prelude::*;
use terrane_base::geom::plane::Xy;

/// Positions of a few magnitudes, most of them clustered.
fn positions() -> impl Strategy<Value = Vec<Xy>> {
    let one = (-20i32..20, -20i32..20, 0i32..4, -30i32..30).prop_map(|(x, y, far, fine)| {
        let scale = [1.0, 1.0, 300.0, 1e-3][far as usize];
        [f64::from(x) * scale + f64::from(fine) * 1e-6, f64::from(y) * scale]
    });
    proptest::collection::vec(one, 1..300)
}

fn divided(points: &[Xy], most: u64) -> Result<VertexQuadtree, terrane_base::error::Error> {
    let mut census = VertexHistogram::default();
    // In batches, as features are read.
    for some in points.chunks(7) {
        census.add(some).unwrap();
    }
    let mut quadtree = VertexQuadtree::new(&census, most)?;
    while let Some(mut finer) = quadtree.finer() {
        points.chunks(11).for_each(|some| finer.add(some));
        quadtree = VertexQuadtree::refined(finer, &quadtree)?;
    }
    Ok(quadtree)
}

fn all_of(points: &[Xy], quadtree: &VertexQuadtree) -> Vec<u32> {
    let mut place = LastTile::default();
    points.iter().map(|p| quadtree.of(*p, &mut place).unwrap()).collect()
}

/// Largest number of identical positions.
fn crowd(points: &[Xy]) -> u64 {
    let same = |p: &&Xy| points.iter().filter(|q| p == q).count() as u64;
    points.iter().map(|p| same(&p)).max().unwrap()
}

proptest! {
    #[test]
    fn every_vertex_has_a_tile_and_no_tile_too_many(points in positions(), most in 2u64..40) {
        let most = most.max(crowd(&points));
        let quadtree = divided(&points, most).unwrap();
        let of = all_of(&points, &quadtree);
        let mut counts = vec![0; quadtree.count()];
        of.iter().for_each(|tile| counts[*tile as usize] += 1);
        for (tile, count) in counts.into_iter().enumerate() {
            prop_assert_eq!(quadtree.vertices(tile), count);
            prop_assert!(count <= most);
        }
        prop_assert_eq!(quadtree.count() == 1, points.len() as u64 <= most);
        // Tiles are disjoint: bounding boxes of their vertices do not intersect.
        let around = |tile: u32| {
            let own = points.iter().zip(&of).filter(|(_, s)| **s == tile).map(|(p, _)| *p);
            own.fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], p| {
                [[0, 1].map(|i| low[i].min(p[i])), [0, 1].map(|i| high[i].max(p[i]))]
            })
        };
        let boxes: Vec<_> = (0..quadtree.count() as u32).map(around).collect();
        for (i, [low, high]) in boxes.iter().enumerate() {
            let meets = |other: &[Xy; 2]| (0..2).all(|k| low[k] <= other[1][k] && other[0][k] <= high[k]);
            prop_assert!(!boxes[..i].iter().any(meets));
        }
    }

    #[test]
    fn the_order_of_vertices_leaves_no_trace(points in positions(), most in 8u64..40) {
        let most = most.max(crowd(&points));
        let mut backward = points.clone();
        backward.reverse();
        let (one, other) = (divided(&points, most).unwrap(), divided(&backward, most).unwrap());
        prop_assert_eq!(all_of(&points, &one), all_of(&points, &other));
    }

    /// Positions along a segment, exact on this lattice, are in tiles that the segment intersects.
    #[test]
    fn segments_meet_the_tiles_that_they_go_through(
        cells in proptest::collection::vec((-40i32..40, -40i32..40), 2..200),
        ends in (0usize..200, 0usize..200),
    ) {
        let at = |(x, y): &(i32, i32)| [x, y].map(|c| f64::from(*c) * 256.0);
        let points: Vec<Xy> = cells.iter().map(at).collect();
        let quadtree = divided(&points, crowd(&points)).unwrap();
        prop_assume!(quadtree.count() > 1);
        let [a, b] = [ends.0, ends.1].map(|i| points[i % points.len()]);
        let mut found = Vec::new();
        quadtree.meeting([a, b], &mut found);
        prop_assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        for k in 0..=256 {
            let p = [0, 1].map(|i| a[i] + (b[i] - a[i]) / 256.0 * f64::from(k));
            let tile = quadtree.of(p, &mut LastTile::default()).unwrap();
            prop_assert!(found.contains(&tile), "{p:?} in {tile}, not in {found:?}");
        }
    }

    #[test]
    fn runs_have_every_vertex_once(points in positions(), is_ring: bool) {
        let mut part = points.clone();
        if is_ring {
            part.push(part[0]);
        }
        let quadtree = divided(&part, 6u64.max(crowd(&part))).unwrap();
        let of = all_of(&part, &quadtree);
        let mut runs = Vec::new();
        cut(&part, is_ring, &quadtree, &mut LastTile::default(), &mut runs);
        if runs.len() == 1 {
            prop_assert_eq!(runs[0], TileRun { tile: of[0], first: 0, count: part.len() });
            return Ok(());
        }
        let count = points.len();
        let inside = |run: &TileRun| (run.first..run.first + run.count).map(move |v| v % count);
        let mut seen: Vec<usize> = runs.iter().flat_map(inside).collect();
        prop_assert!(runs.iter().all(|run| inside(run).all(|v| of[v] == run.tile)));
        let next = runs.iter().skip(1).chain(runs.first().filter(|_| is_ring));
        prop_assert!(runs.iter().zip(next).all(|(run, next)| run.tile != next.tile));
        seen.sort_unstable();
        prop_assert_eq!(seen, (0..count).collect::<Vec<_>>());
        let mut found: Vec<[Xy; 2]> = cross_overs(&part, is_ring, &runs).collect();
        let pairs = part.windows(2).zip(of.windows(2)).filter(|(_, of)| of[0] != of[1]);
        let mut want: Vec<[Xy; 2]> = pairs.map(|(pair, _)| [pair[0], pair[1]]).collect();
        let order = |p: &[Xy; 2], q: &[Xy; 2]| p.partial_cmp(q).unwrap();
        found.sort_by(order);
        want.sort_by(order);
        prop_assert_eq!(found, want);
    }
}

#[test]
fn few_vertices_are_one_tile_wherever_they_are() {
    let quadtree = divided(&[[1.0, 2.0], [-5.0, 1e9]], 2).unwrap();
    assert_eq!((quadtree.count(), quadtree.vertices(0)), (1, 2));
    assert_eq!(quadtree.of([7.0, 7.0], &mut LastTile::default()), Some(0));
    assert_eq!(divided(&[], 1).unwrap().count(), 1);
}

#[test]
fn a_segment_meets_no_tile_beside_it() {
    let corners = [[0.0, 0.0], [100.0, 0.0], [0.0, 100.0], [100.0, 100.0]];
    let quadtree = divided(&corners, 1).unwrap();
    let of = |p: Xy| quadtree.of(p, &mut LastTile::default()).unwrap();
    let [low, east, north, high] = corners.map(of);
    let meets = |a: Xy, b: Xy| {
        let mut found = Vec::new();
        quadtree.meeting([a, b], &mut found);
        found
    };
    assert_eq!(meets([10.0, 10.0], [90.0, 10.0]), [low, east]);
    assert_eq!(meets([10.0, 10.0], [90.0, 89.0]), [low, east, high]);
    assert_eq!(meets([10.0, 90.0], [20.0, 90.0]), [north]);
    // A corner belongs to all four.
    assert_eq!(meets([0.0, 0.0], [100.0, 100.0]), [low, east, north, high]);
}

#[test]
fn a_crowd_far_from_the_rest_is_divided_by_finer_counts() {
    let mut points = vec![[-1e7, 0.0], [1e7, 3.0]];
    points.extend((0..500).map(|i| [f64::from(i % 25) * 0.01, f64::from(i / 25) * 0.01]));
    let quadtree = divided(&points, 20).unwrap();
    assert!((50..200).contains(&quadtree.count()), "{}", quadtree.count());
}

#[test]
fn too_many_in_one_place_are_told() {
    let points = [&[[3.5, 4.5]; 9][..], &[[0.0, 0.0], [-1e5, 1e5]]].concat();
    let error = divided(&points, 8).unwrap_err();
    assert!(error.to_string().contains("at one position"), "{error}");
    assert!(divided(&points, 9).is_ok());
    assert!(VertexHistogram::default().add(&[[f64::NAN, 0.0]]).is_err());
    assert!(VertexHistogram::default().add(&[[0.0, 1e141]]).is_err());
}

/// Positions below a border belong to the tile there, those on it to the next.
#[test]
fn tiles_are_half_open() {
    let corners = [[-100.0, -100.0], [100.0, -100.0], [-100.0, 100.0], [100.0, 100.0]];
    let quadtree = divided(&corners, 1).unwrap();
    let of = |p: Xy| quadtree.of(p, &mut LastTile::default());
    let [low, east, north, high] = corners.map(of);
    assert_eq!(of([0.0, 0.0]), high);
    assert_eq!(of([-f64::MIN_POSITIVE, 0.0]), north);
    assert_eq!(of([0.0, -f64::MIN_POSITIVE]), east);
    assert_eq!(of([-f64::MIN_POSITIVE, -f64::MIN_POSITIVE]), low);
    assert_eq!([of([1e9, 0.0]), of([0.0, -1e9])], [None; 2]);
    // The previous tile must not matter.
    for (from, to) in
        [(low, [0.0, -5.0]), (low, [-5.0, 0.0]), (high, [-0.1, 5.0]), (high, [5.0, -0.1])]
    {
        let mut place = LastTile::default();
        let start = corners[[low, east, north, high].iter().position(|s| *s == from).unwrap()];
        assert_eq!(quadtree.of(start, &mut place), from);
        assert_eq!(quadtree.of(to, &mut place), of(to));
        assert_ne!(of(to), from);
    }
    let meeting = |a: Xy, b: Xy| {
        let mut found = Vec::new();
        quadtree.meeting([a, b], &mut found);
        found
    };
    // A segment that ends on a border intersects the next tile.
    let all = [low, east, north, high].map(Option::unwrap);
    for (a, b, want) in [
        ([-5.0, 9.0], [0.0, 9.0], [all[2], all[3]]),
        ([5.0, 9.0], [0.0, 9.0], [all[2], all[3]]),
        ([9.0, -5.0], [9.0, 0.0], [all[1], all[3]]),
        ([9.0, 5.0], [9.0, 0.0], [all[1], all[3]]),
    ] {
        assert_eq!([meeting(a, b), meeting(b, a)], [want, want]);
    }
    assert_eq!(meeting([5.0, 9.0], [0.1, 9.0]), [all[3]]);
    let around = |p: Xy, reach: f64| {
        let mut found = vec![9];
        quadtree.around(p, reach, &mut found);
        found
    };
    assert_eq!(around([3.0, 5.0], 2.0), all[3..]);
    // Positions below a border do not reach it.
    assert_eq!([around([3.0, 5.0], 3.0), around([5.0, 3.0], 3.0)], [[all[3]], [all[3]]]);
    assert_eq!(around([3.0, 5.0], 3.5), [all[2], all[3]]);
    assert_eq!(around([5.0, 3.0], 3.5), [all[1], all[3]]);
    assert_eq!(around([3.0, 5.0], 6.0), all);
    assert_eq!(around([-3.0, 5.0], 3.0), [all[2], all[3]]);
    assert_eq!(around([-3.0, 5.0], 2.9), [all[2]]);
    assert_eq!(around([-5.0, -3.0], 3.0), [all[0], all[2]]);
    assert_eq!(around([-5.0, -3.0], 9.0), all);
    assert_eq!(around([1e6, 0.0], 9.0), [0_u32; 0]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// The previous tile leaves no trace, and close tiles are found.
    #[test]
    fn a_place_is_a_short_cut_only(points in positions(), most in 2u64..40, reach in 0.0..30.0) {
        let quadtree = divided(&points, most.max(crowd(&points))).unwrap();
        let of = all_of(&points, &quadtree);
        let mut found = Vec::new();
        for (p, tile) in points.iter().zip(&of) {
            prop_assert_eq!(quadtree.of(*p, &mut LastTile::default()), Some(*tile));
        }
        let p = points[0];
        quadtree.around(p, reach, &mut found);
        for (q, tile) in points.iter().zip(&of).filter(|_| quadtree.count() > 1) {
            let is_near = (0..2).all(|axis| (p[axis] - q[axis]).abs() <= reach);
            prop_assert!(!is_near || found.contains(tile), "{:?}", q);
        }
    }
}

/// Cells a whole grid apart are distinct, with and without growth.
#[test]
fn cells_at_both_ends_of_a_grid_are_two() {
    for far in [1023.0, 1024.0, 1025.0, 4096.0] {
        for way in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]] {
            let end = way.map(|c| c * far);
            let points = [&[[0.5, 0.5]; 3][..], &[end; 2], &[way.map(|c| c * 8.0); 2]].concat();
            for most in 3..5 {
                let quadtree = divided(&points, most).unwrap();
                let of = all_of(&points, &quadtree);
                for tile in 0..quadtree.count() {
                    let own = of.iter().filter(|own| **own as usize == tile).count() as u64;
                    assert!(own <= most, "{far} {way:?}");
                    assert_eq!(quadtree.vertices(tile), own, "{far} {way:?}");
                }
            }
        }
    }
}

/// One by one, increasingly distant: the grid grows with all earlier counts.
#[test]
fn counts_survive_growth() {
    let mut wide = vec![[0.25, 0.0]];
    wide.extend((0..39).map(|i| [f64::from(1 << (i % 20)) + 0.25, f64::from(i)]));
    let high: Vec<Xy> = wide.iter().map(|p| [p[1], p[0]]).collect();
    for points in [wide, high] {
        let (mut all, mut one) = (VertexHistogram::default(), VertexHistogram::default());
        all.add(&points).unwrap();
        points.iter().for_each(|p| one.add(&[*p]).unwrap());
        assert_eq!((all.total(), one.total()), (40, 40));
        for most in [2, 10, 39] {
            let of = |census: &VertexHistogram| -> Vec<u64> {
                let quadtree = VertexQuadtree::new(census, most).unwrap();
                (0..quadtree.count()).map(|tile| quadtree.vertices(tile)).collect()
            };
            assert_eq!(of(&all), of(&one));
            assert!(most < 39 || of(&all).iter().sum::<u64>() == 40);
        }
    }
}

/// No more tiles than required.
#[test]
fn tiles_begin_with_those_that_hold_all() {
    for (a, b) in [([0.5, 0.5], [1023.5, 0.5]), ([0.5, 0.5], [0.5, 1023.5])] {
        assert_eq!(divided(&[a, b], 1).unwrap().count(), 2);
    }
    assert_eq!(divided(&[[0.5, 0.5], [1023.5, 1023.5]], 1).unwrap().count(), 4);
}
