//! A part beside the one it was made from.

use super::exact::area_sign;
use super::matching::Matching;
use super::pieces::{Kind, Pieces};
use super::{Distance, Farthest, Report, Xy};

/// How parts are compared with those they were made from.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// How distances are measured.
    pub distance: Distance,
    /// Largest allowed distance, in its units; `None` to measure only.
    pub tolerance: Option<f64>,
}

impl Comparison {
    /// Compares part number `part` after with what it was before, and adds its pieces to those that are
    /// to be looked at together. A ring ends with the vertex it begins with; a part without vertices
    /// has been dropped. O(n log n).
    pub fn part(
        &self,
        part: u32,
        before: &[[f64; 3]],
        after: &[[f64; 3]],
        is_ring: bool,
        report: &mut Report,
        pieces: &mut Pieces,
    ) {
        report.vertices[0] += before.len() as u64;
        report.vertices[1] += after.len() as u64;
        report.parts += u64::from(!after.is_empty());
        let all = |points: &[[f64; 3]]| points.iter().map(|&p| (flat(p), true)).collect::<Vec<_>>();
        let Some(&first) = after.first() else {
            report.dropped += u64::from(!before.is_empty());
            return pieces.push(part, Kind::Gone, all(before).into_iter());
        };
        if is_ring {
            count_area(part, before, after, report);
        }
        let matching = Matching::new(self.distance, before, after, is_ring);
        let Some(places) = matching.best() else {
            report.foreign.add(part, flat(first));
            pieces.push(part, Kind::Gone, all(before).into_iter());
            return pieces.push(part, Kind::Stranger, all(after).into_iter());
        };
        for pair in places.windows(2) {
            self.measure(part, &matching, pair[0], pair[1], report);
        }
        let mut kept = places.iter().copied().peekable();
        let [from, to] = [places[0], places[places.len() - 1]];
        let vertices = (from..=to).map(|v| {
            let is_end = kept.next_if_eq(&v).is_some();
            (flat(matching.vertex(v)), is_end)
        });
        pieces.push(part, Kind::Kept, vertices);
    }

    /// Measures how far the vertices between two that were kept are off the segment between these.
    fn measure(&self, part: u32, matching: &Matching<'_>, from: u32, to: u32, report: &mut Report) {
        let (distance, vertex) = matching.farthest(from, to);
        let place = |v: u32| flat(matching.vertex(v));
        if to - from > 1 && report.farthest.is_none_or(|f| distance > f.distance) {
            report.farthest = Some(Farthest { distance, part, at: place(vertex) });
        }
        let Some(tolerance) = self.tolerance.filter(|&t| distance > t) else { return };
        let (a, b) = (matching.vertex(from), matching.vertex(to));
        for v in from + 1..to {
            if self.distance.of(matching.vertex(v), a, b) > tolerance {
                report.beyond.add(part, place(v));
            }
        }
    }
}

/// Counts a ring without area that had some, or whose area has changed its sign. O(n).
fn count_area(part: u32, before: &[[f64; 3]], after: &[[f64; 3]], report: &mut Report) {
    let [before, sign] = [before, after].map(area_sign);
    if before != 0 && before != sign {
        let defect = if sign == 0 { &mut report.collapsed } else { &mut report.turned };
        defect.add(part, flat(after[0]));
    }
}

fn flat(p: [f64; 3]) -> Xy {
    [p[0], p[1]]
}
