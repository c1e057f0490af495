//! Slow reference implementations: exhaustive, in integers.

use std::cmp::Ordering;

use super::worlds::{Cell, World};
use super::{RetainedChainVertices, Xy};

/// Distance of a position from a segment.
pub(super) fn distance(p: Xy, [a, b]: [Xy; 2]) -> f64 {
    let (u, w) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = u[0] * u[0] + u[1] * u[1];
    let t = if square > 0.0 { ((u[0] * w[0] + u[1] * w[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (w[0] - t * u[0]).hypot(w[1] - t * u[1])
}

/// Kept vertices are a subset with the ends of each chain; rings have four entries or more.
pub(super) fn selection(
    world: &World,
    kept: &RetainedChainVertices,
    may_drop: impl Fn(usize) -> bool,
    name: &str,
) {
    for chain in 0..world.rings.len() {
        let (of, all) = (kept.of(chain), world.range(chain));
        if of.is_empty() && (may_drop(chain) || all.is_empty()) {
            continue;
        }
        assert!(of.windows(2).all(|pair| pair[0] < pair[1]), "{name}: order");
        assert_eq!(of[0] as usize, all.start, "{name}: first of {chain}");
        assert_eq!(of[of.len() - 1] as usize + 1, all.end, "{name}: last of {chain}");
        let is_whole = of.len() == all.len();
        assert!(!world.closed[chain] || of.len() >= 4 || is_whole, "{name}: {chain} collapsed");
    }
}

/// No vertex is farther than the tolerance from the segment that replaces it.
pub(super) fn within(world: &World, kept: &RetainedChainVertices, tolerance: f64, name: &str) {
    for chain in 0..world.rings.len() {
        for pair in kept.of(chain).windows(2) {
            let segment = [world.points[pair[0] as usize], world.points[pair[1] as usize]];
            for v in pair[0]..pair[1] {
                let off = distance(world.points[v as usize], segment);
                assert!(off <= tolerance * (1.0 + 1e-12), "{name}: vertex {v} is {off} off");
            }
        }
    }
}

/// Remaining rings keep their orientation, if they had an area.
pub(super) fn areas(world: &World, kept: &RetainedChainVertices, name: &str) {
    for chain in (0..world.rings.len()).filter(|&c| world.closed[c] && !kept.of(c).is_empty()) {
        let now: Vec<Cell> = kept.of(chain).iter().map(|&v| world.cells[v as usize]).collect();
        let [now, then] = [&now, &world.rings[chain]].map(|ring| area(ring).signum());
        assert!(then == 0 || now == then, "{name}: ring {chain}");
    }
}

/// Twice the area.
pub(super) fn area(ring: &[Cell]) -> i128 {
    ring.windows(2).map(|w| cross(w[0], w[1])).sum()
}

fn cross(p: Cell, q: Cell) -> i128 {
    i128::from(p[0]) * i128::from(q[1]) - i128::from(p[1]) * i128::from(q[0])
}

fn sub(p: Cell, q: Cell) -> Cell {
    [p[0] - q[0], p[1] - q[1]]
}

/// Pairs of kept segments (as pairs of vertices) that meet off a common end vertex.
pub(super) fn crossings(world: &World, kept: &RetainedChainVertices) -> Vec<[[u32; 2]; 2]> {
    let mut all = Vec::new();
    for chain in 0..world.rings.len() {
        all.extend(kept.of(chain).windows(2).map(|w| [w[0], w[1]]));
    }
    let at = |s: [u32; 2]| s.map(|v| world.cells[v as usize]);
    all.retain(|&s| at(s)[0] != at(s)[1]);
    let mut found = Vec::new();
    for (i, &s) in all.iter().enumerate() {
        found.extend(all[..i].iter().filter(|&&t| meet(at(s), at(t))).map(|&t| [s, t]));
    }
    found
}

/// Whether two segments meet anywhere but at a common end, by rational parameters.
pub(super) fn meet(s: [Cell; 2], t: [Cell; 2]) -> bool {
    let (u, v, w) = (sub(s[1], s[0]), sub(t[1], t[0]), sub(t[0], s[0]));
    let den = cross(u, v);
    let shared = s.iter().filter(|p| t.contains(p)).count();
    if den != 0 {
        let (p, q) = (cross(w, v) * den.signum(), cross(w, u) * den.signum());
        let whole = 0..=den.abs();
        return whole.contains(&p) && whole.contains(&q) && shared == 0;
    }
    if cross(w, u) != 0 {
        return false;
    }
    let key = |p: Cell| i128::from(p[0]) * i128::from(u[0]) + i128::from(p[1]) * i128::from(u[1]);
    let span = |r: [Cell; 2]| (key(r[0]).min(key(r[1])), key(r[0]).max(key(r[1])));
    let ((a, b), (c, d)) = (span(s), span(t));
    let common = b.min(d).cmp(&a.max(c));
    common == Ordering::Greater || (common == Ordering::Equal && shared == 0)
}

/// Kept vertices and given points stay inside the same rings, and on their side of each line: the curve along
/// the old line and back along the new one does not wind around them an odd number of times.
pub(super) fn sides(world: &World, kept: &RetainedChainVertices, name: &str) {
    let vertices = kept.vertices.iter().map(|&v| world.cells[v as usize]);
    let positions: Vec<Cell> = vertices.chain(world.fixed_cells.iter().copied()).collect();
    for chain in (0..world.rings.len()).filter(|&c| !kept.of(c).is_empty()) {
        let old = &world.rings[chain];
        let new: Vec<Cell> = kept.of(chain).iter().map(|&v| world.cells[v as usize]).collect();
        for &p in positions.iter().filter(|&&p| !on(old, p)) {
            assert!(!on(&new, p), "{name}: {p:?} has come to lie on chain {chain}");
            let moved = crossed(old, p) != crossed(&new, p);
            assert!(!moved, "{name}: {p:?} is on another side of chain {chain}");
        }
    }
}

fn on(line: &[Cell], p: Cell) -> bool {
    line.windows(2).any(|w| {
        let [a, b] = [sub(w[0], p), sub(w[1], p)];
        let facing = i128::from(a[0]) * i128::from(b[0]) + i128::from(a[1]) * i128::from(b[1]);
        cross(a, b) == 0 && facing <= 0
    })
}

/// Whether the ray from `p` upwards crosses a line an odd number of times.
fn crossed(line: &[Cell], p: Cell) -> bool {
    let above = |w: &&[Cell]| {
        let (a, b) = (w[0].min(w[1]), w[0].max(w[1]));
        a[0] <= p[0] && p[0] < b[0] && cross(sub(b, a), sub(p, a)) < 0
    };
    line.windows(2).filter(above).count() % 2 == 1
}
