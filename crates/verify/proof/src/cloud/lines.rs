//! Breaklines over a cloud: whether edges follow them, and anchor vertices on them.
//!
//! A line stands for a path of steps, as one between samples of a grid does ([`crate::follow`]), as far as it is over
//! the hull of the points. The mesh follows it if both ends of that are vertices, and every vertex on it has an edge to
//! one further along. A vertex on it without a point is an anchor, at the lowest of the heights of the lines there.
//! Heights of anchors on lines without heights are not judged.

use super::hull::ProofHull;
use super::strips::ProofStrips;
use crate::breaklines::ProofBreakline;
use crate::{GridDomain, ProofPosition, ProofTally};

/// A line clipped to the hull of a point cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudTrack {
    line: ProofBreakline,
    /// At start and end, in steps.
    heights: Option<[i32; 2]>,
    /// First and last step over the hull.
    first: i64,
    last: i64,
}

/// Steps by which a path and its straight line may be apart, and more.
const ASIDE: f64 = 1.0;

impl CloudTrack {
    /// Between two positions of the lattice, the lower (by row, then column) first, with heights there; `None` where no
    /// step of it is over the hull. O(corners + steps within a step of the hull's outline).
    pub fn new(ends: [[u32; 2]; 2], heights: Option<[i32; 2]>, hull: &ProofHull) -> Option<Self> {
        let line = ProofBreakline::between(ends[0], ends[1]);
        let steps = line.steps();
        let [start, end] = ends.map(|end| end.map(f64::from));
        let (mut first, mut last) = (0.0_f64, steps as f64);
        for (from, inward) in hull.lines() {
            let [a, b] = [start, end]
                .map(|at| (at[0] - from[0]) * inward[0] + (at[1] - from[1]) * inward[1] + ASIDE);
            let crossed = a / (a - b) * steps as f64;
            match (a < 0.0, b < 0.0) {
                (true, true) => return None,
                (true, false) => first = first.max(crossed - ASIDE),
                (false, true) => last = last.min(crossed + ASIDE),
                (false, false) => {}
            }
        }
        let steps = (first.max(0.0) as i64)..=(last.ceil() as i64).min(steps);
        let mut inside = steps.filter(|&step| hull.contains(sample(line.at(step))));
        let first = inside.next()?;
        let last = inside.next_back().unwrap_or(first);
        Some(Self { line, heights, first, last })
    }

    /// Calls `each` with one position in each domain along the line.
    pub fn each_domain(
        &self,
        owner: impl Fn(ProofPosition) -> GridDomain,
        mut each: impl FnMut(ProofPosition),
    ) {
        let mut step = self.first;
        while step <= self.last {
            let at = sample(self.line.at(step));
            each(at);
            step = self.line.steps_in(&owner(at)).end.max(step + 1);
        }
    }

    /// True where the line passes through a domain.
    pub fn is_in(&self, domain: &GridDomain) -> bool {
        !self.steps_in(domain).is_empty()
    }

    fn steps_in(&self, domain: &GridDomain) -> std::ops::Range<i64> {
        let steps = self.line.steps_in(domain);
        steps.start.max(self.first)..steps.end.min(self.last + 1)
    }

    /// The step of a position on the line; `None` off the line.
    fn place(&self, at: ProofPosition) -> Option<i64> {
        let whole = [at.col, at.row].map(|fixed| fixed >> ProofPosition::FRACTION);
        let step = at.is_sample().then(|| self.line.place(whole)).flatten()?;
        (self.first..=self.last).contains(&step).then_some(step)
    }

    /// Its height after so many steps, to the nearest step of height, halves up.
    fn height(&self, step: i64) -> Option<i64> {
        let [from, to] = self.heights?.map(i128::from);
        let all = i128::from(self.line.steps());
        if all == 0 {
            return Some(from.min(to) as i64);
        }
        // from + (to - from) * step / all + 1/2, rounded down.
        let twice = 2 * (from * (all - i128::from(step)) + to * i128::from(step)) + all;
        Some(twice.div_euclid(2 * all) as i64)
    }
}

fn sample([col, row]: [i64; 2]) -> ProofPosition {
    ProofPosition::sample(col, row)
}

/// A vertex on a line.
#[derive(Clone, Copy, Debug)]
struct TrackStop {
    at: ProofPosition,
    track: usize,
    step: i64,
    has_edge: bool,
}

/// The vertices of a domain on lines.
pub(super) struct TrackVertices<'a> {
    lines: &'a [CloudTrack],
    domain: &'a GridDomain,
    /// Sorted by position.
    all: Vec<TrackStop>,
}

impl<'a> TrackVertices<'a> {
    /// From sorted positions, which may be more than the domain owns.
    pub(super) fn new(
        lines: &'a [CloudTrack],
        domain: &'a GridDomain,
        positions: &[ProofPosition],
    ) -> Self {
        let mut all = Vec::new();
        if !lines.is_empty() {
            let mut owned = positions.to_vec();
            owned.retain(|&at| domain.owns(at));
            let strips = ProofStrips::new(owned);
            for (track, line) in lines.iter().enumerate() {
                let steps = line.steps_in(domain);
                if steps.is_empty() {
                    continue;
                }
                let ends = [steps.start, steps.end - 1].map(|step| sample(line.line.at(step)));
                strips.visit(&ends, |range| {
                    for &at in &strips.things()[range] {
                        let step = line.place(at);
                        all.extend(step.map(|step| TrackStop { at, track, step, has_edge: false }));
                    }
                });
            }
        }
        all.sort_unstable_by_key(|stop| (stop.at, stop.track));
        Self { lines, domain, all }
    }

    fn range(&self, at: ProofPosition) -> std::ops::Range<usize> {
        let first = self.all.partition_point(|stop| stop.at < at);
        first..first + self.all[first..].partition_point(|stop| stop.at == at)
    }

    /// True where a vertex of this height, without a point, may be an anchor.
    pub(super) fn may_be_line_vertex(&self, at: ProofPosition, z: f64) -> bool {
        let stops = &self.all[self.range(at)];
        let heights = stops.iter().filter_map(|stop| self.lines[stop.track].height(stop.step));
        !stops.is_empty() && heights.min().map_or(z.fract() == 0.0, |height| height as f64 == z)
    }

    /// Takes note of an edge.
    pub(super) fn edge(&mut self, [a, b]: [ProofPosition; 2]) {
        for (from, to) in [(a, b), (b, a)] {
            let range = self.range(from);
            for stop in &mut self.all[range] {
                let further = self.lines[stop.track].place(to);
                stop.has_edge |= further.is_some_and(|step| step > stop.step);
            }
        }
    }

    /// Counts the vertices on lines, and the places where the mesh does not follow them.
    pub(super) fn finish(self, tally: &mut ProofTally) {
        for at in self.all.chunk_by(|a, b| a.at == b.at) {
            tally.on_lines += u64::from(at[0].at.is_sample());
        }
        for stop in &self.all {
            if !stop.has_edge && stop.step < self.lines[stop.track].last {
                tally.not_followed.add(stop.at);
            }
        }
        for track in self.lines {
            let ends = [track.first, track.last].map(|step| sample(track.line.at(step)));
            let ends = &ends[..if ends[0] == ends[1] { 1 } else { 2 }];
            for &end in ends.iter().filter(|&&end| self.domain.owns(end)) {
                if self.range(end).is_empty() {
                    tally.not_followed.add(end);
                }
            }
        }
    }
}
