//! Stations along the centre lines of a river.

use super::Xy;

/// The segments of a river's centre lines.
#[derive(Debug)]
pub(super) struct RiverAxis {
    segments: Vec<RiverReach>,
    /// Bounds of each group of [`Self::GROUP`] segments.
    groups: Vec<[Xy; 2]>,
}

/// A segment of a centre line.
#[derive(Clone, Copy, Debug)]
struct RiverReach {
    ends: [Xy; 2],
    line: u32,
    /// Start and length of the segment in stations.
    start: f64,
    length: f64,
}

/// Nearest position on a centre line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RiverStation {
    pub(super) line: u32,
    /// Distance from the start of the line in stations.
    pub(super) along: f64,
}

impl RiverAxis {
    const GROUP: usize = 16;

    /// From lines and their numbers; at least one has a positive length.
    pub(super) fn new<'a>(lines: impl Iterator<Item = (u32, &'a [Xy])>, station: f64) -> Self {
        let mut segments = Vec::new();
        for (line, at) in lines {
            let mut start = 0.0;
            for pair in at.windows(2) {
                let length = distance(pair[0], pair[1]) / station;
                segments.push(RiverReach { ends: [pair[0], pair[1]], line, start, length });
                start += length;
            }
        }
        let groups = segments.chunks(Self::GROUP).map(bounds).collect();
        Self { segments, groups }
    }

    /// The position nearest to `at`, the first of several. `last` is a hint that only affects speed.
    pub(super) fn nearest(&self, at: Xy, last: &mut usize) -> RiverStation {
        let mut best = *last;
        let (mut share, mut least) = self.segments[best].nearest(at);
        for (group, bounds) in self.groups.iter().enumerate() {
            // Rounding errors are far smaller.
            let slack = 1e-9 * (distance(bounds[0], bounds[1]) + least);
            if beyond(at, bounds) > least + slack {
                continue;
            }
            let first = group * Self::GROUP;
            for (number, segment) in (first..).zip(self.segments[first..].iter().take(Self::GROUP))
            {
                let (there, far) = segment.nearest(at);
                if (far, number) < (least, best) {
                    (best, share, least) = (number, there, far);
                }
            }
        }
        *last = best;
        let RiverReach { line, start, length, .. } = self.segments[best];
        RiverStation { line, along: start + share * length }
    }
}

impl RiverReach {
    /// Fraction of the segment before the point nearest to `at`, and its distance.
    fn nearest(&self, at: Xy) -> (f64, f64) {
        let [a, b] = self.ends.map(|end| [end[0] - at[0], end[1] - at[1]]);
        let on = [b[0] - a[0], b[1] - a[1]];
        let square = on[0] * on[0] + on[1] * on[1];
        let share = match square > 0.0 {
            true => (-(a[0] * on[0] + a[1] * on[1]) / square).clamp(0.0, 1.0),
            false => 0.0,
        };
        (share, (a[0] + share * on[0]).hypot(a[1] + share * on[1]))
    }
}

/// Length of a line in stations.
pub(super) fn length(line: &[Xy], station: f64) -> f64 {
    line.windows(2).map(|pair| distance(pair[0], pair[1]) / station).sum()
}

fn distance(a: Xy, b: Xy) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

fn bounds(segments: &[RiverReach]) -> [Xy; 2] {
    let ends = segments.iter().flat_map(|segment| segment.ends);
    ends.fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], at| {
        [[0, 1].map(|axis| low[axis].min(at[axis])), [0, 1].map(|axis| high[axis].max(at[axis]))]
    })
}

/// Distance of a position from a bounding box.
fn beyond(at: Xy, [low, high]: &[Xy; 2]) -> f64 {
    let [x, y] = [0, 1].map(|axis| (low[axis] - at[axis]).max(at[axis] - high[axis]).max(0.0));
    x.hypot(y)
}
