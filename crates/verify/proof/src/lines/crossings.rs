//! Crossings: pairs of segments that meet off a common end.

use super::exact::{Xy, by_ends, meet, upward};
use super::pieces::{LineProofPieces, XRange};
use super::report::LineCheckReport;
use super::sides::strip_of;

/// Mean number of segments in a strip.
const TO_A_STRIP: usize = 256;

/// A segment, its end with the lesser x (then y) first.
#[derive(Clone, Copy, Debug)]
struct ProofSegment {
    ends: [Xy; 2],
    part: u32,
}

impl ProofSegment {
    fn new(ends: [Xy; 2], part: u32) -> Self {
        Self { ends: upward(ends), part }
    }

    /// True when sorted segments have one with these ends.
    fn is_in(&self, sorted: &[Self]) -> bool {
        sorted.binary_search_by(|other| by_ends(&other.ends, &self.ends)).is_ok()
    }

    fn span(&self, axis: usize) -> [f64; 2] {
        let [p, q] = self.ends.map(|p| p[axis]);
        [p.min(q), p.max(q)]
    }
}

/// Counts the pairs of segments that meet off a common end, before and after; segments at the same
/// place are one. A pair counts in the band that has the lowest x the two share.
pub(super) fn count(pieces: &LineProofPieces, band: XRange, report: &mut LineCheckReport) {
    let original =
        pieces.of(band).flat_map(|p| p.segments().map(move |ends| ProofSegment::new(ends, p.part)));
    let old = distinct(original, band);
    each_pair(&old, band, &mut |_, _| report.original_crossings += 1);
    let replacing = pieces.of(band).filter_map(|p| Some(ProofSegment::new(p.replacing()?, p.part)));
    let new = distinct(replacing.filter(|s| s.ends[0] != s.ends[1]), band);
    each_pair(&new, band, &mut |s, t| {
        report.crossings += 1;
        if !s.is_in(&old) || !t.is_in(&old) {
            report.new_crossings.add(s.part, s.ends[0]);
        }
    });
}

/// The segments that reach into a band, each place once.
fn distinct(segments: impl Iterator<Item = ProofSegment>, band: XRange) -> Vec<ProofSegment> {
    let mut all: Vec<ProofSegment> = segments.filter(|s| band.meets(s.span(0))).collect();
    all.sort_unstable_by(|s, t| by_ends(&s.ends, &t.ends).then(s.part.cmp(&t.part)));
    all.dedup_by(|s, t| s.ends == t.ends);
    all
}

/// Calls `visit` for each pair that meets off a common end, once.
///
/// The band is divided into strips of y with about equal numbers of segments (plane sweep). In a strip,
/// segments are visited by minimum x and compared with the earlier ones that reach that x. A pair counts in the
/// strip of the lowest y the two share.
fn each_pair(
    segments: &[ProofSegment],
    band: XRange,
    visit: &mut impl FnMut(&ProofSegment, &ProofSegment),
) {
    let mut lows: Vec<f64> = segments.iter().map(|s| s.span(1)[0]).collect();
    lows.sort_unstable_by(f64::total_cmp);
    let mut borders: Vec<f64> = lows.into_iter().step_by(TO_A_STRIP).skip(1).collect();
    borders.dedup();
    // Segments come in the order of their minimum x.
    let mut entries = Vec::with_capacity(segments.len() * 5 / 4);
    for (i, segment) in (0u32..).zip(segments) {
        let [low, high] = segment.span(1);
        entries.extend((strip_of(&borders, low)..=strip_of(&borders, high)).map(|s| (s as u32, i)));
    }
    entries.sort_unstable();
    let mut active: Vec<u32> = Vec::new();
    for entry in entries.chunk_by(|p, q| p.0 == q.0) {
        active.clear();
        for &(at, i) in entry {
            let s = &segments[i as usize];
            let x = s.ends[0][0];
            active.retain(|&j| segments[j as usize].ends[1][0] >= x);
            if band.from <= x {
                for t in active.iter().map(|&j| &segments[j as usize]) {
                    let ([low, high], [other_low, other_high]) = (s.span(1), t.span(1));
                    let common = low.max(other_low);
                    let near =
                        common <= high.min(other_high) && strip_of(&borders, common) == at as usize;
                    if near && meet(s.ends, t.ends) {
                        visit(s, t);
                    }
                }
            }
            active.push(i);
        }
    }
}
