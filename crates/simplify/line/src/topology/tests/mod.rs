//! Untangled test data, checked by slow reference implementations.

mod twin;
mod worlds;

use super::*;
use std::cmp::Ordering;
use terrane_base::geom::plane::area_sign;
use terrane_base::{Cancel, ErrorKind};
use worlds::{Dice, World};

/// Plain Ramer-Douglas-Peucker: appends the kept vertices strictly between two vertices.
pub(super) fn rdp(points: &[Xy], from: u32, to: u32, tolerance: f64, out: &mut Vec<u32>) {
    let mut ends = vec![to];
    let mut start = from;
    while let Some(&end) = ends.last() {
        let segment = [points[start as usize], points[end as usize]];
        let off = |v: u32| twin::distance(points[v as usize], segment);
        let worst = (start + 1..end).max_by(|&a, &b| off(a).total_cmp(&off(b)).then(b.cmp(&a)));
        match worst.filter(|&v| off(v) > tolerance) {
            Some(v) => ends.push(v),
            None => {
                ends.pop();
                if !ends.is_empty() {
                    out.push(end);
                }
                start = end;
            }
        }
    }
}

fn solve(world: &World, tolerance: f64, options: UntangleOptions<'_>) -> UntangledChains {
    let chains = world.chains();
    let mut refine = |_: usize, from: u32, to: u32, out: &mut Vec<u32>| {
        rdp(chains.points, from, to, tolerance, out);
    };
    let kept = RetainedChainVertices::simplified(&chains, &mut refine);
    untangle(&chains, &kept, &world.fixed, &options, &mut refine).unwrap()
}

/// Both strategies, and each collapse policy.
fn ways<'a>() -> impl Iterator<Item = UntangleOptions<'a>> {
    let policies = [RingCollapse::Minimal, RingCollapse::Drop, RingCollapse::Keep];
    let strategies = [Strategy::Retroactive, Strategy::Proactive];
    policies.into_iter().flat_map(move |collapse| {
        strategies.map(|strategy| UntangleOptions {
            strategy,
            collapse,
            ..UntangleOptions::default()
        })
    })
}

/// Checks all guarantees of an outcome.
fn check(world: &World, is_clean: bool, tolerance: f64, options: UntangleOptions<'_>, name: &str) {
    let outcome = solve(world, tolerance, options);
    let kept = &outcome.kept;
    let name = format!("{name}, tolerance {tolerance}, {options:?}");
    let is_loop = |chain| options.loops.get(chain) == Some(&true);
    let may_drop = |chain| options.collapse == RingCollapse::Drop && !is_loop(chain);
    twin::selection(world, kept, may_drop, &name);
    twin::within(world, kept, tolerance, &name);
    twin::areas(world, kept, &name);
    let crossings = twin::crossings(world, kept);
    let new = crossings.iter().filter(|pair| pair.iter().any(|s| s[1] - s[0] != 1)).count();
    assert_eq!(new, 0, "{name}: new crossings");
    assert_eq!(crossings.len(), outcome.crossings.len(), "{name}: crossings reported");
    if is_clean {
        twin::sides(world, kept, &name);
    }
}

/// Test data of one kind, at tolerances that simplify little, much, and almost everything.
fn check_kind(count: u64, make: impl Fn(&mut Dice) -> World, name: &str, clean_at_least: f64) {
    let mut clean = 0;
    for seed in 0..count {
        let mut dice = Dice::new(seed);
        let world = make(&mut dice);
        let is_clean = world.is_clean();
        clean += u64::from(is_clean);
        let tolerance = f64::from(1 << dice.below(12));
        let loops: Vec<bool> = world.rings.iter().map(|_| dice.below(2) == 0).collect();
        let with_loops = ways().map(|options| UntangleOptions { loops: &loops, ..options });
        let with_loops = with_loops.filter(|options| options.collapse == RingCollapse::Drop);
        for options in ways().chain(with_loops) {
            check(&world, is_clean, tolerance, options, &format!("{name} {seed}"));
        }
    }
    assert!(clean as f64 >= clean_at_least * count as f64, "{name}: only {clean} clean worlds");
}

#[test]
fn archipelagos() {
    check_kind(200, worlds::archipelago, "archipelago", 0.9);
}

#[test]
fn nested_rings() {
    check_kind(200, worlds::nested, "nested", 0.5);
}

#[test]
fn rings_that_wind_tightly() {
    check_kind(150, worlds::spiral, "spiral", 0.9);
}

#[test]
fn coverages() {
    check_kind(150, worlds::coverage, "coverage", 0.5);
}

#[test]
fn anything_on_a_small_lattice() {
    check_kind(3000, worlds::lattice, "lattice", 0.01);
}

#[test]
fn segments_accepted_one_by_one_need_no_mending() {
    for seed in 0..200 {
        let mut dice = Dice::new(seed);
        let make = [worlds::archipelago, worlds::nested, worlds::spiral, worlds::coverage];
        let world = make[dice.below(4) as usize](&mut dice);
        if !world.is_clean() {
            continue;
        }
        let (chains, tolerance) = (world.chains(), f64::from(1 << dice.below(12)));
        let mut refine = |_: usize, from: u32, to: u32, out: &mut Vec<u32>| {
            rdp(chains.points, from, to, tolerance, out);
        };
        let kept = RetainedChainVertices::simplified(&chains, &mut refine);
        let (kept, _) = rings::mend(&chains, &kept, &UntangleOptions::default(), &mut refine);
        let points = SidePoints::new(&world.fixed).unwrap();
        let (kept, _) = proactive::accept(&chains, &kept, &points, None, &mut refine).unwrap();
        assert!(twin::crossings(&world, &kept).is_empty(), "seed {seed}: crossings");
        twin::sides(&world, &kept, &format!("seed {seed}"));
        twin::within(&world, &kept, tolerance, &format!("seed {seed}"));
    }
}

#[test]
fn an_island_does_not_jump_the_coast() {
    let coast = vec![[0, 0], [400, 90], [800, 0], [1600, 0]];
    let island = vec![[380, 30], [420, 30], [400, 50], [380, 30]];
    let world = World::new(vec![coast, island], vec![]);
    assert_eq!(solve(&world, 100.0, UntangleOptions::default()).kept.of(0), [0, 1, 3]);
    let alone = World::new(vec![vec![[0, 0], [400, 90], [800, 0], [1600, 0]]], vec![[400, 80]]);
    assert_eq!(solve(&alone, 100.0, UntangleOptions::default()).kept.of(0), [0, 1, 3]);
    let beyond = World::new(vec![vec![[0, 0], [400, 90], [800, 0], [1600, 0]]], vec![[400, 95]]);
    assert_eq!(solve(&beyond, 100.0, UntangleOptions::default()).kept.of(0), [0, 3]);
}

#[test]
fn a_line_that_ends_below_the_coast_is_not_blamed() {
    let coast = vec![[0, 0], [400, 90], [800, 0], [1600, 0]];
    let river = vec![[400, -300], [401, -100], [400, 50]];
    let kept =
        solve(&World::new(vec![coast, river], vec![]), 100.0, UntangleOptions::default()).kept;
    assert_eq!((kept.of(0), kept.of(1)), (&[0, 1, 3][..], &[4, 6][..]));
}

#[test]
fn what_is_dropped_first_is_not_in_the_way_later() {
    let one = vec![[0, 0], [50, 10], [100, 0]];
    let other = vec![[0, 5], [50, 15], [100, 5]];
    let options = UntangleOptions { strategy: Strategy::Proactive, ..UntangleOptions::default() };
    let kept = solve(&World::new(vec![one, other], vec![]), 20.0, options).kept;
    assert_eq!(kept.vertices, [0, 2, 3, 5]);
}

/// One by one, a chain has to leave space for vertices that the next one drops.
#[test]
fn what_is_dropped_later_is_in_the_way_first() {
    let one = vec![[0, 0], [50, 10], [100, 0]];
    let other = vec![[0, -5], [50, 5], [100, -5]];
    let world = World::new(vec![one, other], vec![]);
    let with = |strategy| {
        let outcome =
            solve(&world, 20.0, UntangleOptions { strategy, ..UntangleOptions::default() });
        (outcome.kept.vertices, outcome.refined)
    };
    assert_eq!(with(Strategy::Retroactive), (vec![0, 2, 3, 5], 0));
    assert_eq!(with(Strategy::Proactive), (vec![0, 1, 2, 3, 5], 1));
}

/// Cancelled before the start, and by the method itself when a piece is split.
#[test]
fn work_that_is_cancelled_ends() {
    let coast = vec![[0, 0], [400, 90], [800, 0], [1600, 0]];
    let river = vec![[400, -300], [401, -100], [400, 50]];
    let world = World::new(vec![coast, river], vec![]);
    for (strategy, at_once) in [Strategy::Retroactive, Strategy::Proactive]
        .into_iter()
        .flat_map(|s| [(s, true), (s, false)])
    {
        let cancel = Cancel::default();
        let chains = world.chains();
        let options =
            UntangleOptions { strategy, cancel: Some(&cancel), ..UntangleOptions::default() };
        let mut refine = |_: usize, from: u32, to: u32, out: &mut Vec<u32>| {
            rdp(chains.points, from, to, 100.0, out);
        };
        let kept = RetainedChainVertices::simplified(&chains, &mut refine);
        let mut splits = |_: usize, _: u32, _: u32, _: &mut Vec<u32>| cancel.cancel();
        if at_once {
            cancel.cancel();
        }
        let error = untangle(&chains, &kept, &world.fixed, &options, &mut splits).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Interrupted, "{strategy:?}, {at_once}");
    }
}

/// Only the invalid piece of a ring is split.
#[test]
fn a_ring_that_has_not_turned_over_is_left() {
    let ring = vec![[0, 0], [400, 90], [800, 0], [800, -600], [400, -690], [0, -600], [0, 0]];
    let outcome =
        solve(&World::new(vec![ring], vec![[400, 80]]), 100.0, UntangleOptions::default());
    assert_eq!(outcome.kept.vertices, [0, 1, 2, 3, 5, 6]);
    assert_eq!((outcome.refined, outcome.rounds), (1, 2));
}

#[test]
fn a_triangle_has_not_collapsed() {
    let ring = vec![[0, 0], [40, 1], [80, 0], [40, 90], [0, 0]];
    for collapse in [RingCollapse::Minimal, RingCollapse::Drop, RingCollapse::Keep] {
        let options = UntangleOptions { collapse, ..UntangleOptions::default() };
        let outcome = solve(&World::new(vec![ring.clone()], vec![]), 9.0, options);
        assert_eq!((outcome.kept.vertices, outcome.collapsed), (vec![0, 2, 3, 4], 0));
    }
}

#[test]
fn policies_of_collapse() {
    let ring = vec![[0, 0], [40, 0], [50, 20], [40, 40], [0, 40], [-10, 20], [0, 0]];
    let world = World::new(vec![ring], vec![]);
    let with = |collapse| {
        let options = UntangleOptions { collapse, ..UntangleOptions::default() };
        solve(&world, 1000.0, options)
    };
    assert_eq!(with(RingCollapse::Minimal).kept.vertices.len(), 4);
    assert_eq!((with(RingCollapse::Minimal).collapsed, with(RingCollapse::Minimal).rounds), (1, 1));
    assert_eq!(with(RingCollapse::Keep).kept.vertices.len(), 7);
    assert_eq!(with(RingCollapse::Drop).kept.vertices.len(), 0);
}

/// Keeps nothing more, and is called only if there are vertices between.
fn keep_nothing(_: usize, from: u32, to: u32, _: &mut Vec<u32>) {
    assert!(to - from > 1, "nothing lies between {from} and {to}");
}

/// The largest of all triangles with two given vertices and the ring's orientation; and the statistics of
/// rings.
#[test]
fn a_minimal_ring_has_the_largest_triangle() {
    for seed in 0..500 {
        let mut dice = Dice::new(seed);
        let ring: Vec<[i64; 2]> =
            (0..4 + dice.below(6)).map(|_| [dice.below(7), dice.below(7)]).collect();
        let ring = [&ring[..], &ring[..1]].concat();
        let last = ring.len() as u32 - 1;
        let far = 1 + dice.below(i64::from(last) - 1) as u32;
        let world = World::new(vec![ring], vec![]);
        let chains = world.chains();
        let kept = RetainedChainVertices { vertices: vec![0, far, last], starts: vec![0, 3] };
        let sign = area_sign(world.points.iter().copied());
        let (made, mended) =
            rings::mend(&chains, &kept, &UntangleOptions::default(), &mut keep_nothing);
        assert_eq!((mended.collapsed, mended.flat), (1, u64::from(sign == Ordering::Equal)));
        let twice = |v: u32| {
            let mut corners = [0, far, v];
            corners.sort_unstable();
            let [a, b, c] = corners.map(|v| world.cells[v as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let way = if sign == Ordering::Less { -1 } else { 1 };
        let mut inner = (1..last).filter(|v| *v != far);
        let best = inner.clone().map(|v| twice(v) * way).max().unwrap_or(0);
        // The first of several.
        let first = inner.find(|v| twice(*v) * way == best);
        if sign == Ordering::Equal {
            assert_eq!(made.vertices, (0..=last).collect::<Vec<_>>(), "seed {seed}: flat");
        } else if best > 0 && last > 3 {
            let [0, a, b, _] = made.vertices[..] else { panic!("seed {seed}: {made:?}") };
            let apex = if a == far { b } else { a };
            assert!([a, b].contains(&far), "seed {seed}");
            assert_eq!(Some(apex), first, "seed {seed}");
        } else {
            assert!(made.vertices.is_sorted_by(|a, b| a < b), "seed {seed}: {made:?}");
            let area = area_sign(made.vertices.iter().map(|v| world.points[*v as usize]));
            assert_eq!(area, sign, "seed {seed}");
        }
    }
}

/// Two squares of opposite orientation: without total area, there is no orientation to keep.
#[test]
fn a_ring_without_area_is_left_as_it_is() {
    let ring =
        [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0], [0, -2], [-2, -2], [-2, 0], [0, 0]].to_vec();
    let world = World::new(vec![ring], vec![]);
    let kept = RetainedChainVertices { vertices: vec![0, 1, 2, 3, 4, 6, 7, 8], starts: vec![0, 8] };
    for options in ways() {
        let (made, mended) = rings::mend(&world.chains(), &kept, &options, &mut keep_nothing);
        assert_eq!((made, mended.collapsed, mended.flat), (kept.clone(), 0, 1));
    }
}

/// The inside of a hook has the other orientation: it is refined until the ring keeps its own.
#[test]
fn a_ring_of_which_the_inside_is_kept_is_turned_back() {
    let hook = [[10, 2], [2, 2], [2, 8], [10, 8], [10, 10], [0, 10], [0, 0], [10, 0], [10, 2]];
    let world = World::new(vec![hook.to_vec()], vec![]);
    let kept = RetainedChainVertices { vertices: vec![0, 1, 2, 3, 8], starts: vec![0, 5] };
    for options in ways() {
        let (made, mended) = rings::mend(&world.chains(), &kept, &options, &mut keep_nothing);
        assert_eq!(made.vertices, [0, 1, 2, 3, 4, 5, 6, 8], "{options:?}");
        assert_eq!((mended.collapsed, mended.flat), (0, 0));
    }
}

#[test]
fn nothing_is_asked_of_neighbours() {
    for seed in 0..300 {
        let mut dice = Dice::new(seed);
        let world = worlds::lattice(&mut dice);
        let chains = world.chains();
        let kept = RetainedChainVertices::simplified(&chains, &mut |_, _, _, _| {});
        for options in ways() {
            let outcome = untangle(&chains, &kept, &world.fixed, &options, &mut keep_nothing);
            let name = format!("{options:?}, seed {seed}");
            let kept = outcome.expect("good arguments").kept;
            let crossings = twin::crossings(&world, &kept);
            assert!(crossings.iter().flatten().all(|s| s[1] - s[0] == 1), "{name}");
            twin::areas(&world, &kept, &name);
        }
    }
}

#[test]
fn bad_arguments_are_turned_away() {
    let points = [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]];
    let chains = Chains { points: &points, starts: &[0, 3], closed: &[false] };
    let mut refine = |_: usize, _: u32, _: u32, _: &mut Vec<u32>| {};
    let mut fails = |vertices: Vec<u32>, starts: Vec<usize>, fixed: &[Xy]| {
        untangle(
            &chains,
            &RetainedChainVertices { vertices, starts },
            fixed,
            &UntangleOptions::default(),
            &mut refine,
        )
        .is_err()
    };
    assert!(!fails(vec![0, 2], vec![0, 2], &[]));
    assert!(fails(vec![0, 1], vec![0, 2], &[]));
    assert!(fails(vec![1, 2], vec![0, 2], &[]));
    assert!(fails(vec![0, 0, 2], vec![0, 3], &[]));
    assert!(fails(vec![0, 2], vec![0, 1], &[]));
    assert!(fails(vec![0, 2], vec![0, 0, 2], &[]));
    assert!(fails(vec![0, 2], vec![0, 2], &[[0.0, f64::NAN]]));
    assert!(fails(vec![0, 2, 1], vec![0, 3], &[]));
    assert!(fails(vec![0, 2], vec![0, 3], &[]));
    assert!(fails(vec![0, 2], vec![0, 2], &[[f64::INFINITY, 0.0]]));
}

#[test]
fn empty_chains_and_points_for_chains() {
    let world = World::new(vec![vec![], vec![[3, 3]], vec![[0, 0], [9, 9]], vec![]], vec![]);
    let kept = solve(&world, 1.0, UntangleOptions::default()).kept;
    assert_eq!((kept.vertices, kept.starts), (vec![0, 1, 2], vec![0, 0, 1, 3, 3]));
}

/// A method receives the part alone, and its result is given in indices of the whole line.
#[test]
fn a_method_refines_a_part_of_a_line() {
    let vertices: Vec<_> = (0..20).map(|i| i * i).collect();
    let mut seen = Vec::new();
    let mut refine = refining(&vertices, |part: &[i32], kept: &mut Vec<u32>| {
        seen.push(part.to_vec());
        kept.extend((0..part.len() as u32).filter(|i| *i != 2));
    });
    let mut kept = vec![7];
    for (from, to) in [(3, 8), (0, 1), (5, 9)] {
        refine(0, from, to, &mut kept);
    }
    drop(refine);
    assert_eq!(kept, [7, 4, 6, 7, 6, 8]);
    assert_eq!(seen, [&vertices[3..=8], &vertices[0..=1], &vertices[5..=9]]);
}
