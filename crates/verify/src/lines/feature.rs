//! A feature prepared for comparison (parts, points and attributes), and matching of its parts with the
//! original ones.

use std::collections::{HashMap, HashSet};

use super::attributes::{Facts, stamp};
use terrane_vector::{Feature, PartRole};

/// The vertices of a part.
pub(super) struct FeaturePart {
    pub(super) points: Vec<[f64; 3]>,
    /// Heights and measures, NaN where there is none.
    pub(super) extras: Vec<[f64; 2]>,
    pub(super) role: PartRole,
}

impl FeaturePart {
    fn of(xy: &[[f64; 2]], z: &[f64], m: &[f64], role: PartRole) -> Self {
        let extras: Vec<[f64; 2]> =
            (0..xy.len()).map(|i| [z, m].map(|v| v.get(i).copied().unwrap_or(f64::NAN))).collect();
        let points = xy
            .iter()
            .zip(&extras)
            .map(|(p, &[z, _])| [p[0], p[1], if z.is_finite() { z } else { 0.0 }])
            .collect();
        Self { points, extras, role }
    }

    pub(super) fn is_ring(&self) -> bool {
        self.role != PartRole::Line
    }
}

/// A feature.
pub(super) struct ComparedFeature {
    pub(super) parts: Vec<FeaturePart>,
    /// Its point geometries, as one part.
    pub(super) points: FeaturePart,
    pub(super) facts: Facts,
    /// Lookup key of the attributes.
    pub(super) stamp: String,
}

impl ComparedFeature {
    pub(super) fn new(feature: &Feature, facts: Facts) -> Self {
        let parts = feature.geometry.parts();
        let parts = parts.map(|part| FeaturePart::of(part.xy, part.z, part.m, part.role)).collect();
        let mut points = FeaturePart::of(&[], &[], &[], PartRole::Line);
        for leaf in feature.geometry.leaves().filter(|leaf| leaf.kind().is_points()) {
            let xyzm = leaf.coordinates();
            let leaf = FeaturePart::of(&xyzm.xy, &xyzm.z, &xyzm.m, PartRole::Line);
            points.points.extend(leaf.points);
            points.extras.extend(leaf.extras);
        }
        let stamp = stamp(&facts);
        Self { parts, points, facts, stamp }
    }

    /// A line of one vertex as a point: a table with a row for each vertex does not distinguish the
    /// two.
    pub(super) fn one_row(mut self) -> Self {
        let is_row = matches!(&self.parts[..], [part] if part.points.len() == 1);
        if is_row && self.points.points.is_empty() {
            self.points = self.parts.remove(0);
        }
        self
    }

    /// All of its vertices.
    pub(super) fn vertices(&self) -> impl Iterator<Item = &[f64; 3]> {
        self.parts.iter().chain([&self.points]).flat_map(|part| &part.points)
    }

    fn extras(&self) -> impl Iterator<Item = &[f64; 2]> {
        self.parts.iter().chain([&self.points]).flat_map(|part| &part.extras)
    }

    /// Whether it has heights, and measures.
    pub(super) fn has(&self) -> [bool; 2] {
        [0, 1].map(|k| self.extras().any(|extras| !extras[k].is_nan()))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.vertices().next().is_none()
    }
}

/// Matching of the parts of a feature.
pub(super) struct MatchedParts {
    /// For each original part its part of the result, if it is still there.
    pub(super) of: Vec<Option<usize>>,
    /// Parts of the result without an original.
    pub(super) added: Vec<usize>,
    /// Whether all parts were made from the vertices of their originals, and the points are the same.
    pub(super) fits: bool,
}

/// Matches the parts of a feature with those of the original: first by equal vertices, then the
/// remaining ones in order. O(n).
pub(super) fn match_parts(before: &ComparedFeature, after: &ComparedFeature) -> MatchedParts {
    let same_points = before.points.points.len() == after.points.points.len()
        && before.points.points.iter().zip(&after.points.points).all(|(p, q)| key(p) == key(q));
    let mut pairs = before.parts.iter().zip(&after.parts);
    let is_in_order = before.parts.len() == after.parts.len()
        && pairs.all(|(old, new)| old.is_ring() == new.is_ring() && is_walk(old, new));
    if is_in_order {
        let of = (0..before.parts.len()).map(Some).collect();
        return MatchedParts { of, added: Vec::new(), fits: same_points };
    }
    let (mut of, strangers) = placed_by_vertices(before, after);
    let fits = strangers.is_empty() && same_points;
    let mut added = Vec::new();
    // The first line and the first ring that may be left.
    let mut next = [0; 2];
    for at in strangers {
        let is_ring = after.parts[at].is_ring();
        let next = &mut next[usize::from(is_ring)];
        *next = (*next..of.len())
            .find(|&old| of[old].is_none() && before.parts[old].is_ring() == is_ring)
            .unwrap_or(of.len());
        match of.get_mut(*next) {
            Some(old) => *old = Some(at),
            None => added.push(at),
        }
    }
    MatchedParts { of, added, fits }
}

/// For each original part the result part that has its vertices, and the result parts without such a
/// match.
fn placed_by_vertices(
    before: &ComparedFeature,
    after: &ComparedFeature,
) -> (Vec<Option<usize>>, Vec<usize>) {
    let mut having: HashMap<[u64; 2], Vec<usize>> = HashMap::new();
    for (number, part) in before.parts.iter().enumerate() {
        for point in &part.points {
            let numbers = having.entry(key(point)).or_default();
            if numbers.last() != Some(&number) {
                numbers.push(number);
            }
        }
    }
    let mut of: Vec<Option<usize>> = vec![None; before.parts.len()];
    let mut strangers = Vec::new();
    for (at, part) in after.parts.iter().enumerate() {
        let near = part.points.first().and_then(|first| having.get(&key(first)));
        let free = near
            .into_iter()
            .flatten()
            .copied()
            .filter(|&old| of[old].is_none() && before.parts[old].is_ring() == part.is_ring());
        let found = free
            .clone()
            .find(|&old| is_walk(&before.parts[old], part))
            .or_else(|| free.clone().find(|&old| is_known(&before.parts[old], part)));
        match found {
            Some(old) => of[old] = Some(at),
            None => strangers.push(at),
        }
    }
    (of, strangers)
}

/// Vertices of a ring at one position that are tried as its start.
const MAX_STARTS: usize = 64;

/// Whether the vertices of `new` are a subsequence of those of `old`; of a ring from any start and in either
/// direction. False negatives are possible where a ring visits its start more than [`MAX_STARTS`] times. O(n).
fn is_walk(old: &FeaturePart, new: &FeaturePart) -> bool {
    let ends = usize::from(new.is_ring());
    let (old, new) = (&old.points, &new.points);
    let (old, new) =
        (&old[..old.len().saturating_sub(ends)], &new[..new.len().saturating_sub(ends)]);
    let Some(first) = new.first() else { return true };
    let starts = if ends == 0 { 0..1.min(old.len()) } else { 0..old.len() };
    let mut starts = starts.filter(|&at| key(&old[at]) == key(first)).take(MAX_STARTS);
    starts.any(|at| {
        is_subsequence(new, old, at, 1)
            || (ends == 1 && is_subsequence(new, old, at, old.len() - 1))
    })
}

/// Whether `new` is a subsequence of `old` from `start` on, cyclically, `step` vertices at a time.
fn is_subsequence(new: &[[f64; 3]], old: &[[f64; 3]], start: usize, step: usize) -> bool {
    let mut rest = new.iter().peekable();
    for i in 0..old.len() {
        let at = &old[(start + i * step) % old.len()];
        rest.next_if(|next| key(next) == key(at));
    }
    rest.next().is_none()
}

/// Whether all vertices of `new` are vertices of `old`.
fn is_known(old: &FeaturePart, new: &FeaturePart) -> bool {
    let known: HashSet<[u64; 2]> = old.points.iter().map(key).collect();
    new.points.iter().all(|point| known.contains(&key(point)))
}

/// A position in the plane as bits, where 0 and -0 are the same.
pub(super) fn key(point: &[f64; 3]) -> [u64; 2] {
    [bits(point[0]), bits(point[1])]
}

/// A value as bits, where 0 and -0 are the same, and all NaN.
pub(super) fn bits(value: f64) -> u64 {
    if value.is_nan() { f64::NAN.to_bits() } else { (value + 0.0).to_bits() }
}
