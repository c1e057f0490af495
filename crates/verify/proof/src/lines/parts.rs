//! Comparison of a part with its original.

use super::exact::{Xy, area_sign};
use super::gone::lies_along_a_segment;
use super::matching::{PartMatching, PartVertices, ResultPart};
use super::measure::ProofDistance;
use super::pieces::{LineProofPieces, PieceKind};
use super::report::{LineCheckReport, ProofFarthestVertex};

/// Comparison of parts with their originals.
#[derive(Clone, Copy, Debug)]
pub struct PartComparison {
    /// How distances are measured.
    pub distance: ProofDistance,
    /// Largest allowed distance, in its units; `None` to measure only.
    pub tolerance: Option<f64>,
    /// Which parts may be gone.
    pub drops: DroppedParts,
}

/// Which parts may have been dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DroppedParts {
    /// No part.
    None,
    /// Rings with two vertices whose segment has all others within the tolerance, and with them their
    /// holes that lie within it, too.
    Thin,
    /// Any.
    Any,
}

impl PartComparison {
    /// Compares part number `part` with its original and adds its pieces. A ring ends with the vertex it begins
    /// with, and may be reversed; a part without vertices has been dropped. O(n log n).
    pub fn part(
        &self,
        part: u32,
        before: PartVertices<'_>,
        after: PartVertices<'_>,
        is_ring: bool,
        report: &mut LineCheckReport,
        pieces: &mut LineProofPieces,
    ) {
        report.vertices[0] += before.points.len() as u64;
        report.vertices[1] += after.points.len() as u64;
        report.parts += u64::from(!after.points.is_empty());
        let Some(&first) = after.points.first() else {
            self.gone(part, before, is_ring, report);
            return pieces.push_unmatched(part, PieceKind::Gone, before.points);
        };
        let Some(matched) = MatchedPart::best(self, before, after, is_ring) else {
            report.foreign.add(part, flat(first));
            pieces.push_unmatched(part, PieceKind::Gone, before.points);
            return pieces.push_unmatched(part, PieceKind::Stranger, after.points);
        };
        let MatchedPart { matching, places, changed } = &matched;
        if is_ring {
            count_area(part, before.points, matching.new_points(), report);
        }
        changed.iter().for_each(|at| report.changed.add(part, *at));
        for pair in places.windows(2) {
            self.measure(part, matching, pair[0], pair[1], report);
        }
        let mut kept = places.iter().copied().peekable();
        let [from, to] = [places[0], places[places.len() - 1]];
        let vertices = (from..=to).map(|v| {
            let is_end = kept.next_if_eq(&v).is_some();
            (flat(matching.vertex(v)), is_end)
        });
        pieces.push(part, PieceKind::Kept, vertices);
    }

    /// Judges a missing part.
    fn gone(
        &self,
        part: u32,
        before: PartVertices<'_>,
        is_ring: bool,
        report: &mut LineCheckReport,
    ) {
        let Some(&first) = before.points.first() else { return };
        report.dropped += 1;
        let may_be_gone = match self.drops {
            DroppedParts::Any => Some(true),
            DroppedParts::Thin if is_ring => match self.is_thin(before.points, &[]) {
                Some(false) if !before.outer.is_empty() => {
                    self.is_thin(before.outer, before.points)
                }
                is_thin => is_thin,
            },
            _ => Some(false),
        };
        match may_be_gone {
            Some(true) => {}
            Some(false) => report.missing.add(part, flat(first)),
            None => report.unknown += 1,
        }
    }

    /// Whether a ring with its holes fits a segment within the tolerance; `None` where that is not known.
    fn is_thin(&self, ring: &[[f64; 3]], holes: &[[f64; 3]]) -> Option<bool> {
        lies_along_a_segment(self.distance, ring, holes, self.tolerance?)
    }

    /// Measures how far the vertices between two that were kept are off the segment between these.
    fn measure(
        &self,
        part: u32,
        matching: &PartMatching<'_>,
        from: u32,
        to: u32,
        report: &mut LineCheckReport,
    ) {
        let (distance, vertex) = matching.farthest(from, to);
        if to - from > 1 && report.farthest.is_none_or(|f| distance > f.distance) {
            let at = flat(matching.vertex(vertex));
            report.farthest = Some(ProofFarthestVertex { distance, part, at });
        }
        let Some(tolerance) = self.tolerance.filter(|&t| distance > t) else { return };
        let (a, b) = (matching.vertex(from), matching.vertex(to));
        for v in from + 1..to {
            let vertex = matching.vertex(v);
            if self.distance.of(vertex, a, b) > tolerance {
                report.beyond.add(part, flat(vertex));
            }
        }
    }
}

/// A part of the result and the indices of its vertices in the original.
struct MatchedPart<'a> {
    matching: PartMatching<'a>,
    places: Vec<u32>,
    /// Vertices whose height or measure is another one.
    changed: Vec<Xy>,
}

impl<'a> MatchedPart<'a> {
    /// The best match by position, height and measure, or else by position alone. A ring is matched in both
    /// directions: the one within the tolerance counts, or the one with the sign of the original area.
    fn best(
        by: &PartComparison,
        before: PartVertices<'a>,
        after: PartVertices<'_>,
        is_ring: bool,
    ) -> Option<Self> {
        let has_extras = !before.extras.is_empty() && !after.extras.is_empty();
        let sign = if is_ring { area_sign(before.points) } else { 0 };
        for with_extras in [true, false].into_iter().filter(|with| has_extras || !with) {
            let mut best: Option<([bool; 2], Self)> = None;
            for is_backward in [false, true].into_iter().filter(|back| is_ring || !back) {
                let (mut points, mut extras) = (after.points.to_vec(), after.extras.to_vec());
                if is_backward {
                    points.reverse();
                    extras.reverse();
                }
                let is_same = sign == 0 || area_sign(&points) == sign;
                let own = ResultPart { points, extras, with_extras };
                let matching = PartMatching::new(by.distance, before, own, is_ring);
                let Some((worst, places)) = matching.best(by.tolerance) else { continue };
                let changed =
                    if has_extras { matching.changed(&places, before) } else { Vec::new() };
                let found = Self { matching, places, changed };
                let faults = [by.tolerance.is_some_and(|tolerance| worst > tolerance), !is_same];
                if faults == [false; 2] {
                    return Some(found);
                }
                if best.as_ref().is_none_or(|(fewer, _)| faults < *fewer) {
                    best = Some((faults, found));
                }
            }
            if let Some((_, found)) = best {
                return Some(found);
            }
        }
        None
    }
}

/// Counts a ring without area that had some, or whose area has changed its sign. O(n).
fn count_area(part: u32, before: &[[f64; 3]], after: &[[f64; 3]], report: &mut LineCheckReport) {
    let [before, sign] = [before, after].map(area_sign);
    if before != 0 && before != sign {
        let defect = if sign == 0 { &mut report.collapsed } else { &mut report.turned };
        defect.add(part, flat(after[0]));
    }
}

/// x and y of a vertex.
pub(super) fn flat(p: [f64; 3]) -> Xy {
    [p[0], p[1]]
}
