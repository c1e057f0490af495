//! Arcs against their definition, and simplified coverages.

use std::collections::{BTreeMap, BTreeSet};

use super::*;
use crate::topology::{UntangleOptions, untangle};

type Cell = [i64; 2];

/// A generator with a fixed seed (SplitMix64).
struct Dice(u64);

impl Dice {
    fn below(&mut self, count: i64) -> i64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut v = self.0;
        v = (v ^ (v >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ (v >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((v ^ (v >> 31)) % count as u64) as i64
    }
}

/// Rings (closed parts) and lines in flat arrays.
#[derive(Clone, Debug)]
struct Flat {
    points: Vec<Xy>,
    starts: Vec<usize>,
    closed: Vec<bool>,
}

impl Flat {
    fn new(parts: &[Vec<Cell>]) -> Self {
        let mut flat = Self { points: vec![], starts: vec![0], closed: vec![] };
        for part in parts {
            flat.points.extend(part.iter().map(|p| p.map(|v| v as f64)));
            flat.starts.push(flat.points.len());
            flat.closed.push(part.len() > 1 && part.first() == part.last());
        }
        flat
    }

    fn chains(&self) -> Chains<'_> {
        Chains { points: &self.points, starts: &self.starts, closed: &self.closed }
    }
}

fn cell(p: &Xy) -> Cell {
    p.map(|v| v as i64)
}

/// Parts composed of the kept vertices of arcs.
fn rebuilt(arcs: &CoverageArcs, kept: &RetainedChainVertices) -> Vec<Vec<Cell>> {
    let parts = arcs.rebuild(kept);
    let of = |pair: &[usize]| {
        let vertices = &parts.vertices[pair[0]..pair[1]];
        vertices.iter().map(|&v| cell(&arcs.points[v as usize])).collect()
    };
    parts.starts.windows(2).map(of).collect()
}

/// A ring or line without repeated vertices, a ring starting at its lowest vertex.
fn canonical(part: &[Cell]) -> Vec<Cell> {
    let mut part = part.to_vec();
    let is_ring = part.len() > 1 && part.first() == part.last();
    part.dedup();
    if is_ring && part.len() > 1 {
        part.pop();
        let turns = (0..part.len()).map(|k| [&part[k..], &part[..k]].concat());
        part = turns.min().unwrap();
        part.push(part[0]);
    }
    part
}

/// Random rings and lines on few positions, some repeated with another start.
fn tangle(dice: &mut Dice) -> Vec<Vec<Cell>> {
    let size = 2 + dice.below(6);
    let mut parts: Vec<Vec<Cell>> = Vec::new();
    for _ in 0..1 + dice.below(6) {
        let mut part: Vec<Cell> =
            (0..dice.below(9)).map(|_| [dice.below(size), dice.below(size)]).collect();
        if dice.below(2) == 0 && part.len() > 1 {
            part.push(part[0]);
        }
        parts.push(part);
        let mut copy = parts[dice.below(parts.len() as i64) as usize].clone();
        if dice.below(2) == 0 && copy.len() > 1 && copy[0] == copy[copy.len() - 1] {
            copy.pop();
            let turn = dice.below(copy.len() as i64) as usize;
            copy.rotate_left(turn);
            copy.push(copy[0]);
        }
        if dice.below(2) == 0 {
            copy.reverse();
        }
        parts.push(copy);
    }
    parts
}

/// Junctions by definition: from pairs of neighbours at each position.
fn junctions(parts: &[Vec<Cell>]) -> BTreeSet<Cell> {
    let mut seen: BTreeMap<Cell, BTreeSet<[Option<Cell>; 2]>> = BTreeMap::new();
    for part in parts {
        let mut line = part.clone();
        let is_ring = line.len() > 1 && line.first() == line.last();
        line.dedup();
        let n = line.len();
        for i in 0..n {
            let last = n - 1;
            let [before, after] = match is_ring && n > 1 {
                true => [
                    Some(line[if i == 0 { last - 1 } else { i - 1 }]),
                    Some(line[if i == last { 1 } else { i + 1 }]),
                ],
                false => [i.checked_sub(1).map(|k| line[k]), line.get(i + 1).copied()],
            };
            seen.entry(line[i]).or_default().insert([before.min(after), before.max(after)]);
        }
    }
    let is_junction = |ways: &BTreeSet<[Option<Cell>; 2]>| {
        ways.len() > 1 || ways.iter().any(|[p, q]| p == q || p.is_none() || q.is_none())
    };
    seen.into_iter().filter(|(_, ways)| is_junction(ways)).map(|(p, _)| p).collect()
}

#[test]
fn arcs_are_as_defined() {
    for seed in 0..6000 {
        let parts = tangle(&mut Dice(seed));
        let flat = Flat::new(&parts);
        let arcs = CoverageArcs::new(&flat.chains(), 0.0).unwrap();
        let all = rebuilt(&arcs, &RetainedChainVertices::all(&arcs.chains()));
        for (old, new) in parts.iter().zip(&all) {
            assert_eq!(canonical(old), canonical(new), "seed {seed}: {parts:?}");
            let goes_on = new.windows(2).all(|pair| pair[0] != pair[1]);
            assert!(goes_on, "seed {seed}: {new:?} has a vertex twice where arcs join");
        }
        let junctions = junctions(&parts);
        let mut edges = BTreeMap::new();
        for (i, pair) in arcs.starts.windows(2).enumerate() {
            let arc: Vec<Cell> = arcs.points[pair[0]..pair[1]].iter().map(cell).collect();
            let (first, last) = (arc[0], arc[arc.len() - 1]);
            for p in &arc[1..arc.len() - usize::from(arc.len() > 1)] {
                assert!(arc.len() == 1 || !junctions.contains(p), "seed {seed}: not cut at {p:?}");
            }
            let is_free = first == last && arc.iter().all(|p| *p >= first);
            assert!(junctions.contains(&first) || is_free, "seed {seed}: {arc:?} begins anywhere");
            assert!(junctions.contains(&last) || is_free, "seed {seed}: {arc:?} ends anywhere");
            for w in arc.windows(2) {
                let other = edges.insert([w[0].min(w[1]), w[0].max(w[1])], i);
                let is_bounce = other == Some(i) && arc.len() == 3;
                assert!(other.is_none() || is_bounce, "seed {seed}: {w:?} is in two arcs");
            }
            for (p, &source) in arc.iter().zip(&arcs.sources[pair[0]..pair[1]]) {
                let lowest = flat.points.iter().position(|q| cell(q) == *p);
                assert_eq!(lowest, Some(source as usize));
            }
        }
    }
}

/// Rings of the cells of a jittered grid with rough borders, in one or two layers, with random start
/// and in either direction.
fn subdivision(dice: &mut Dice) -> Vec<Vec<Cell>> {
    let (across, down) = (1 + dice.below(4) as usize, 1 + dice.below(4) as usize);
    let rough = 1 + dice.below(300);
    let corner: Vec<Vec<Cell>> = (0..=down as i64)
        .map(|y| {
            (0..=across as i64)
                .map(|x| [x * 1000 + dice.below(300), y * 1000 + dice.below(300)])
                .collect()
        })
        .collect();
    let mut line = |a: Cell, b: Cell| -> Vec<Cell> {
        let n = 1 + dice.below(25);
        let mut all: Vec<Cell> = (0..=n)
            .map(|i| {
                let off = (dice.below(2 * rough + 1) - rough) * 4 * i * (n - i) / (n * n);
                let along = [b[0] - a[0], b[1] - a[1]];
                let size = along[0].abs().max(along[1].abs());
                [
                    a[0] + along[0] * i / n - along[1] * off / size,
                    a[1] + along[1] * i / n + along[0] * off / size,
                ]
            })
            .collect();
        all.dedup();
        all
    };
    let flat: Vec<Vec<Vec<Cell>>> = (0..=down)
        .map(|y| (0..across).map(|x| line(corner[y][x], corner[y][x + 1])).collect())
        .collect();
    let upright: Vec<Vec<Vec<Cell>>> = (0..down)
        .map(|y| (0..=across).map(|x| line(corner[y][x], corner[y + 1][x])).collect())
        .collect();
    let back = |line: &Vec<Cell>| line.iter().rev().copied().collect::<Vec<_>>();
    let mut rings = Vec::new();
    for y in 0..down {
        for x in 0..across {
            let sides = [
                flat[y][x].clone(),
                upright[y][x + 1].clone(),
                back(&flat[y + 1][x]),
                back(&upright[y][x]),
            ];
            let mut ring: Vec<Cell> = sides.concat();
            ring.dedup();
            ring.pop();
            let turn = dice.below(ring.len() as i64) as usize;
            ring.rotate_left(turn);
            ring.push(ring[0]);
            rings.push(ring);
        }
    }
    rings
}

/// Twice the area.
fn area(ring: &[Cell]) -> i64 {
    ring.windows(2).map(|w| w[0][0] * w[1][1] - w[0][1] * w[1][0]).sum()
}

/// Directed segments of the rings with their counts.
fn segments(rings: &[Vec<Cell>]) -> BTreeMap<[Cell; 2], u32> {
    let mut all = BTreeMap::new();
    for pair in rings.iter().flat_map(|ring| ring.windows(2)) {
        *all.entry([pair[0], pair[1]]).or_default() += 1;
    }
    all
}

/// Whether two segments meet off a common end.
fn meet([a, b]: [Cell; 2], [c, d]: [Cell; 2]) -> bool {
    let turn = |p: Cell, q: Cell, r: Cell| {
        ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])).signum()
    };
    let on = |p: Cell| {
        turn(a, b, p) == 0
            && (p[0] - a[0]) * (p[0] - b[0]) <= 0
            && (p[1] - a[1]) * (p[1] - b[1]) <= 0
            && p != a
            && p != b
    };
    let on_other = |p: Cell| {
        turn(c, d, p) == 0
            && (p[0] - c[0]) * (p[0] - d[0]) <= 0
            && (p[1] - c[1]) * (p[1] - d[1]) <= 0
            && p != c
            && p != d
    };
    let proper = turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0;
    let same = (a == c && b == d) || (a == d && b == c);
    proper || on(c) || on(d) || on_other(a) || on_other(b) || same
}

#[test]
fn neighbours_keep_their_borders() {
    let (mut simplified, mut clean) = (0, 0);
    for seed in 0..400 {
        let mut dice = Dice(seed);
        let rings = subdivision(&mut dice);
        let flat = Flat::new(&rings);
        let arcs = CoverageArcs::new(&flat.chains(), 0.0).unwrap();
        let tolerance = (1 << dice.below(11)) as f64;
        let chains = arcs.chains();
        let mut kept = RetainedChainVertices::new();
        for arc in 0..chains.count() {
            // Ends only: topology restores all that is needed.
            let range = chains.range(arc);
            kept.vertices.extend([range.start as u32, range.end as u32 - 1]);
            kept.close();
        }
        let mut refine = |_: usize, from: u32, to: u32, out: &mut Vec<u32>| {
            if f64::from(to - from) > tolerance {
                out.push((from + to) / 2);
            }
        };
        let outcome =
            untangle(&chains, &kept, &[], &UntangleOptions::default(), &mut refine).unwrap();
        let result = rebuilt(&arcs, &outcome.kept);
        simplified += usize::from(outcome.kept.vertices.len() < arcs.points.len());
        // The outline may change, but every gain of a cell is a loss of its neighbour.
        let (before, after) = (segments(&rings), segments(&result));
        let is_shared =
            |all: &BTreeMap<[Cell; 2], u32>, s: [Cell; 2]| all.contains_key(&[s[1], s[0]]);
        for &s in after.keys() {
            // A segment is shared if the arc it replaces was: both ends were on a shared border.
            let ends_shared =
                s.iter().all(|p| before.keys().any(|t| t.contains(p) && is_shared(&before, *t)));
            let outline = before.keys().any(|t| t[0] == s[0] && !is_shared(&before, *t));
            assert!(is_shared(&after, s) || outline || !ends_shared, "seed {seed}: {s:?}");
        }
        let outline: i64 =
            after.keys().filter(|s| !is_shared(&after, **s)).map(|s| area(&s[..])).sum();
        let sum: i64 = result.iter().map(|r| area(r)).sum();
        assert_eq!(sum, outline, "seed {seed}: cells and their union");
        if outcome.crossings.is_empty() {
            clean += 1;
            let undirected: Vec<[Cell; 2]> =
                after.keys().copied().filter(|s| s[0] < s[1] || !is_shared(&after, *s)).collect();
            for (i, s) in undirected.iter().enumerate() {
                assert!(
                    undirected[..i].iter().all(|t| !meet(*s, *t)),
                    "seed {seed}: {s:?} crosses"
                );
            }
            for (old, new) in rings.iter().zip(&result) {
                assert_eq!(
                    area(old).signum(),
                    area(new).signum(),
                    "seed {seed}: a cell turned over"
                );
            }
        }
    }
    assert!(simplified > 350 && clean > 200, "{simplified} simplified, {clean} clean");
}

#[test]
fn islands_in_two_layers_are_one_arc() {
    let ring: Vec<Cell> = vec![[5, 5], [9, 5], [9, 9], [5, 9], [5, 5]];
    let other: Vec<Cell> = vec![[9, 9], [9, 5], [5, 5], [5, 9], [9, 9]];
    let flat = Flat::new(&[ring, other]);
    let arcs = CoverageArcs::new(&flat.chains(), 0.0).unwrap();
    assert_eq!(arcs.closed, [true]);
    assert_eq!(arcs.passages.iter().map(|p| p.is_backward()).collect::<Vec<_>>(), [false, true]);
}

#[test]
fn a_ring_that_goes_around_twice_has_its_arc_twice() {
    let twice: Vec<Cell> = vec![[5, 5], [9, 5], [9, 9], [5, 5], [9, 5], [9, 9], [5, 5]];
    let flat = Flat::new(&[twice.clone(), twice[3..].to_vec()]);
    let arcs = CoverageArcs::new(&flat.chains(), 0.0).unwrap();
    assert_eq!((arcs.points.len(), arcs.passages.len()), (4, 3));
}

/// Kept vertices of every part, for `kept` vertices of the arcs.
fn own(flat: &Flat, arcs: &CoverageArcs, kept: &RetainedChainVertices) -> Vec<Vec<u32>> {
    let of = |part: usize| {
        let mut own = Vec::new();
        let points = &flat.points[flat.starts[part]..flat.starts[part + 1]];
        arcs.own(part, points, flat.closed[part], kept, &mut own);
        own
    };
    (0..flat.closed.len()).map(of).collect()
}

#[test]
fn parts_know_what_is_kept_of_their_own_vertices() {
    for seed in 0..3000 {
        let mut dice = Dice(seed);
        let parts = tangle(&mut dice);
        let flat = Flat::new(&parts);
        let mut arcs = CoverageArcs::new(&flat.chains(), 0.0).unwrap();
        for arc in (0..arcs.closed.len()).filter(|&arc| arcs.free[arc]).collect::<Vec<_>>() {
            let at = dice.below((arcs.starts[arc + 1] - arcs.starts[arc] - 1) as i64);
            arcs.open_at(arc, at as usize);
        }
        let mut kept = RetainedChainVertices::new();
        for range in arcs.starts.windows(2).map(|ends| ends[0]..ends[1]) {
            let is_kept =
                |v: &usize| *v == range.start || *v + 1 == range.end || dice.below(2) == 0;
            kept.vertices.extend(range.clone().filter(is_kept).map(|v| v as u32));
            kept.close();
        }
        let rebuilt = rebuilt(&arcs, &kept);
        for (part, own) in own(&flat, &arcs, &kept).iter().enumerate() {
            let vertices = &parts[part];
            assert!(own.is_sorted_by(|a, b| a < b), "seed {seed}");
            let mut line: Vec<Cell> = own.iter().map(|&at| vertices[at as usize]).collect();
            match flat.closed[part] {
                true => line.extend(line.first().copied()),
                false if vertices.len() > 1 => {
                    let ends = (own[0] as usize, own[own.len() - 1] as usize);
                    assert_eq!(ends, (0, vertices.len() - 1), "seed {seed}");
                }
                false => {}
            }
            assert_eq!(canonical(&line), canonical(&rebuilt[part]), "seed {seed}: {vertices:?}");
        }
    }
}

/// Duplicate vertices, and a line with two ends.
#[test]
fn a_line_that_stays_where_it_is_keeps_its_first_and_last_vertex() {
    for count in [1, 2, 5] {
        let mut flat = Flat::new(&[vec![[3, 4]; count]]);
        flat.closed = vec![false];
        let arcs = CoverageArcs::new(&flat.chains(), 0.0).unwrap();
        let mut kept = RetainedChainVertices::new();
        kept.vertices.push(0);
        kept.close();
        let expected = if count == 1 { vec![0] } else { vec![0, count as u32 - 1] };
        assert_eq!(own(&flat, &arcs, &kept), [expected]);
    }
}

#[test]
fn minus_zero_is_zero() {
    let points = [[0.0, 1.0], [-0.0, 2.0], [3.0, -0.0], [3.0, 0.0], [0.0, 2.0]];
    let chains = Chains { points: &points, starts: &[0, 3, 5], closed: &[false, false] };
    let arcs = CoverageArcs::new(&chains, 0.0).unwrap();
    assert_eq!(arcs.sources, [0, 1, 1, 2]);
}

/// The snapping rule, literally.
fn snap_twin(points: &[Xy], anchors: &[Xy], distance: f64) -> Vec<Xy> {
    let mut order: Vec<Xy> = points.to_vec();
    order.sort_by(|p, q| p.partial_cmp(q).unwrap());
    order.dedup();
    let near = |p: Xy, q: Xy| (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2) <= distance * distance;
    let mut stayed: Vec<Xy> = anchors.to_vec();
    let mut to: Vec<(Xy, Xy)> = Vec::new();
    for p in order {
        let found = stayed.iter().filter(|&&q| near(p, q));
        match found.min_by(|p, q| p.partial_cmp(q).unwrap()) {
            Some(&q) => to.push((p, q)),
            None => {
                stayed.push(p);
                to.push((p, p));
            }
        }
    }
    let moved = |p: &Xy| to.iter().find(|(from, _)| from == p).unwrap().1;
    points.iter().map(moved).collect()
}

#[test]
fn snapping_follows_its_rule() {
    for seed in 0..1500 {
        let mut dice = Dice(seed);
        let size = 1 + dice.below(60);
        let count = dice.below(120);
        let mut at = || dice.below(size) as f64 / 4.0 - 3.0;
        let points: Vec<Xy> = (0..count).map(|_| [at(), at()]).collect();
        let anchors: Vec<Xy> = (0..seed % 4).map(|_| [at(), at()]).collect();
        let distance = (1 + dice.below(9)) as f64 / 4.0;
        let mut snapped = points.clone();
        snapping::snap(&mut snapped, &anchors, distance);
        assert_eq!(snapped, snap_twin(&points, &anchors, distance), "seed {seed}");
    }
}

#[test]
fn borders_that_nearly_match_are_one_after_snapping() {
    let a: Vec<Cell> = vec![[0, 0], [1000, 0], [1001, 500], [999, 1000], [0, 1000], [0, 0]];
    let b: Vec<Cell> =
        vec![[1001, 1], [2000, 0], [2000, 1000], [1000, 1001], [1000, 500], [1001, 1]];
    let flat = Flat::new(&[a, b]);
    assert_eq!(CoverageArcs::new(&flat.chains(), 0.0).unwrap().closed, [true, true]);
    let arcs = CoverageArcs::new(&flat.chains(), 3.0).unwrap();
    assert_eq!(arcs.closed.len(), 3, "two outlines and a border");
    assert_eq!(arcs.passages.len(), 4);
}

#[test]
fn bad_snap_distances_are_turned_away() {
    let flat = Flat::new(&[vec![[0, 0], [1, 1]]]);
    for snap in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(CoverageArcs::new(&flat.chains(), snap).is_err());
    }
    assert!(CoverageArcs::new(&Flat::new(&[]).chains(), 0.0).is_ok());
    // No snapping is not a distance: callers have one.
    for distance in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(snap(&mut [[0.0, 0.0]], &[], distance).is_err());
    }
    assert!(snap(&mut [[0.0, 0.0]], &[], 1e-9).is_ok());
}

#[test]
fn a_free_arc_begins_where_it_is_told() {
    let ring: Vec<Cell> = vec![[5, 5], [9, 5], [9, 9], [5, 9], [5, 5]];
    let mut arcs =
        CoverageArcs::new(&Flat::new(&[vec![[0, 0], [1, 1]], ring]).chains(), 0.0).unwrap();
    arcs.open_at(1, 2);
    assert_eq!(arcs.free, [false, true]);
    assert_eq!(arcs.sources, [0, 1, 4, 5, 2, 3, 4]);
    let cells: Vec<Cell> = arcs.points.iter().map(cell).collect();
    assert_eq!(cells, [[0, 0], [1, 1], [9, 9], [5, 9], [5, 5], [9, 5], [9, 9]]);
}
