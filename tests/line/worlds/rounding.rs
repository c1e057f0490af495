//! What rounding may do to what is kept: nothing but move it.

use std::collections::BTreeSet;

use super::lattice::{Cell, Segment, Shape, Way, rounded};
use super::whole::{area, is_on, is_simple, meet, turns};
use super::{Written, in_order};

/// What is written, with vertices where they were before they were rounded.
pub(super) fn before(moved: &[Shape], written: &[Vec<Written>]) -> Vec<Vec<Written>> {
    let of = |(shape, parts): (&Shape, &Vec<Written>)| -> Vec<Written> {
        let old = |z: &i64| shape.parts[(z / 1000) as usize][(z % 1000) as usize];
        parts.iter().map(|part| part.iter().map(|(_, z)| (old(z), *z)).collect()).collect()
    };
    moved.iter().zip(written).map(of).collect()
}

/// What is wrong with how vertices were rounded.
pub(super) fn faults(before: &[Vec<Written>], after: &[Vec<Written>], way: &Way) -> Vec<String> {
    let places = |all: &[Vec<Written>]| -> Vec<Vec<Cell>> {
        let parts = all.iter().flatten();
        parts.map(|part| part.iter().map(|(p, _)| *p).collect()).collect()
    };
    let (old, new) = (places(before), places(after));
    let mut faults = Vec::new();
    for (p, q) in old.iter().flatten().zip(new.iter().flatten()) {
        let to = way.decimals.map_or(*p, |decimals| rounded(*p, decimals));
        if q != p && *q != to {
            faults.push(format!("{p:?} went to {q:?}"));
        }
    }
    if way.decimals.is_some() {
        pairs(&old, &new, &mut faults);
        rings(&old, &new, &mut faults);
        sides(&old, &new, &mut faults);
    }
    faults
}

/// Segments meet where they did.
fn pairs(old: &[Vec<Cell>], new: &[Vec<Cell>], faults: &mut Vec<String>) {
    let all = old.iter().zip(new).flat_map(|(p, q)| p.windows(2).zip(q.windows(2)));
    let all: BTreeSet<[Segment; 2]> = all
        .map(|(p, q)| [[p[0], p[1]], [q[0], q[1]]])
        .filter(|[p, q]| p[0] != p[1] && q[0] != q[1])
        .map(|[p, q]| if p[0] < p[1] { [p, q] } else { [[p[1], p[0]], [q[1], q[0]]] })
        .collect();
    for [p, q] in &all {
        for [r, s] in all.range(..[*p, *q]) {
            if meet(*q, *s) && !meet(*p, *r) {
                faults.push(format!("{q:?} and {s:?} meet, and did not as {p:?} and {r:?}"));
            }
        }
    }
    let count = all.iter().map(|[_, q]| in_order(*q)).collect::<BTreeSet<_>>().len();
    if count < all.len() {
        faults.push("segments have become one".into());
    }
}

/// Rings keep their sense, and touch themselves nowhere where they did not.
fn rings(old: &[Vec<Cell>], new: &[Vec<Cell>], faults: &mut Vec<String>) {
    let rings = old.iter().zip(new).filter(|(old, _)| old.len() > 2 && is_simple(old));
    for (old, new) in rings.filter(|(old, _)| old.first() == old.last()) {
        if !is_simple(new) || area(old).signum() != area(new).signum() {
            faults.push(format!("{old:?} is spoilt as {new:?}"));
        }
    }
}

/// Vertices are on the side of every part where they were, but for those that have become one with another.
fn sides(old: &[Vec<Cell>], new: &[Vec<Cell>], faults: &mut Vec<String>) {
    let pairs = || old.iter().flatten().zip(new.iter().flatten());
    for (p, q) in pairs().collect::<BTreeSet<_>>() {
        if pairs().any(|(other, at)| at == q && other != p) {
            continue;
        }
        for (before, after) in old.iter().zip(new).filter(|(before, _)| !is_on(before, *p)) {
            let is_ring = before.len() > 2 && before.first() == before.last();
            if is_on(after, *q) || (is_ring && turns(before, *p) != turns(after, *q)) {
                faults.push(format!("{p:?} changes sides of {before:?} as {q:?} of {after:?}"));
            }
        }
    }
}
