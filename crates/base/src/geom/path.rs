//! Paths of samples along straight segments on a grid.

use std::ops::RangeInclusive;

use super::Rect;

/// End points of a segment on a grid: columns and rows.
pub type Ends = [[u32; 2]; 2];

/// A straight segment between two samples and its path: consecutive samples of the path are neighbours in a row or a
/// column, and none is more than 0.71 cells off the segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SampleSegment {
    from: [i64; 2],
    to: [i64; 2],
}

impl SampleSegment {
    /// Between two samples (column, row), in either order.
    pub fn new(a: [i64; 2], b: [i64; 2]) -> Self {
        // One direction for both: `at` rounds halves up, and a path walked backwards would round them down.
        let is_first = (a[1], a[0]) <= (b[1], b[0]);
        let [from, to] = if is_first { [a, b] } else { [b, a] };
        Self { from, to }
    }

    /// The same segment, with positions relative to `origin`.
    pub fn seen_from(&self, origin: [i64; 2]) -> Self {
        let [from, to] =
            [self.from, self.to].map(|at| [0, 1].map(|axis: usize| at[axis] - origin[axis]));
        Self { from, to }
    }

    /// Columns and rows between the ends.
    fn spans(&self) -> [u64; 2] {
        [0, 1].map(|axis| self.to[axis].abs_diff(self.from[axis]))
    }

    /// Number of steps of the path.
    pub fn steps(&self) -> u64 {
        self.spans().into_iter().sum()
    }

    /// The sample after this number of steps.
    pub fn at(&self, step: u64) -> [i64; 2] {
        // Twice a step times a span of 33 bits each is beyond 64.
        let all = u128::from(self.steps());
        let cols = match all {
            0 => 0,
            _ => (2 * u128::from(step) * u128::from(self.spans()[0]) + all) / (2 * all),
        };
        let gone = [cols as u64, step - cols as u64];
        [0, 1].map(|axis| {
            let on = if self.to[axis] < self.from[axis] { -1 } else { 1 };
            self.from[axis] + on * gone[axis] as i64
        })
    }

    /// Number of steps to a sample, if it is on the path.
    pub fn step_of(&self, at: [i64; 2]) -> Option<u64> {
        let step = [0, 1].map(|axis| at[axis].abs_diff(self.from[axis])).into_iter().sum();
        (step <= self.steps() && self.at(step) == at).then_some(step)
    }

    /// Steps at which the path is between two samples, the upper left and the lower right.
    pub fn within(&self, low: [i64; 2], high: [i64; 2]) -> Option<RangeInclusive<u64>> {
        let (mut first, mut last) = (0, self.steps());
        for axis in [0, 1] {
            let (low, high) = (low[axis], high[axis]);
            let is_forward = self.to[axis] >= self.from[axis];
            let entry = self.first_step(first, last, |at| {
                if is_forward { at[axis] >= low } else { at[axis] <= high }
            });
            first = entry?;
            let exit = self.first_step(first, last, |at| {
                if is_forward { at[axis] > high } else { at[axis] < low }
            });
            last = match exit {
                Some(beyond) => beyond.checked_sub(1).filter(|&last| last >= first)?,
                None => last,
            };
        }
        Some(first..=last)
    }

    /// The first step at which a monotone test holds.
    fn first_step(&self, from: u64, to: u64, holds: impl Fn([i64; 2]) -> bool) -> Option<u64> {
        let (mut low, mut high) = (from, to + 1);
        while low < high {
            let middle = low.midpoint(high);
            if holds(self.at(middle)) { high = middle } else { low = middle + 1 }
        }
        (low <= to).then_some(low)
    }
}

/// The part of a segment over the cells of the grid, from sample to sample: the same in both directions.
pub fn cut([a, b]: [[f64; 2]; 2], size: [u32; 2]) -> Option<Ends> {
    if !a.iter().chain(&b).all(|at| at.is_finite()) {
        return None;
    }
    let [mut a, mut b] = if [a[1], a[0]] <= [b[1], b[0]] { [a, b] } else { [b, a] };
    // Sutherland & Hodgman (1974), side by side.
    for axis in [0, 1] {
        let end = f64::from(size[axis]) - 0.5;
        if a[axis].max(b[axis]) < -0.5 || a[axis].min(b[axis]) >= end {
            return None;
        }
        for side in [-0.5, end] {
            let is_beyond =
                [a, b].map(|at| if side < 0.0 { at[axis] < side } else { at[axis] > side });
            match is_beyond {
                [true, false] => a = crossing(a, b, axis, side),
                [false, true] => b = crossing(b, a, axis, side),
                _ => {}
            }
        }
    }
    Some([a, b].map(|at| {
        [0, 1].map(|axis: usize| {
            (at[axis] + 0.5).floor().clamp(0.0, f64::from(size[axis] - 1)) as u32
        })
    }))
}

/// Intersection of the segment from `a` to `b` with a side. Coordinates are halved because differences of distant
/// values may overflow.
fn crossing(a: [f64; 2], b: [f64; 2], axis: usize, side: f64) -> [f64; 2] {
    let [from, to] = [a, b].map(|at| at.map(|at| at / 2.0));
    let share = (side / 2.0 - from[axis]) / (to[axis] - from[axis]);
    let other = 1 - axis;
    let mut at = [side; 2];
    at[other] = (from[other] + share * (to[other] - from[other])) * 2.0;
    at
}

/// Segments on a grid with a fast search near rectangles.
#[derive(Clone, Debug, Default)]
pub struct Paths {
    /// Each segment once, sorted by place.
    segments: Vec<Ends>,
    /// Bounds of each [`Self::GROUP`] of segments: minimum and maximum column and row.
    groups: Vec<Ends>,
}

impl Paths {
    /// No segments.
    pub const NONE: Self = Self { segments: Vec::new(), groups: Vec::new() };

    /// Number of segments per group.
    const GROUP: usize = 64;

    /// From segments in any order and direction. Time O(n log n).
    pub fn of(mut segments: Vec<Ends>) -> Self {
        segments.iter_mut().for_each(|ends| ends.sort_unstable_by_key(|&at| row_first(at)));
        // By blocks, so that the bounds of groups are small.
        segments.sort_unstable_by_key(|&[a, b]| (block(a), row_first(a), row_first(b)));
        segments.dedup();
        let groups = segments.chunks(Self::GROUP).map(bounds).collect();
        Self { segments, groups }
    }

    /// The union with other segments.
    pub fn and(mut self, others: Vec<Ends>) -> Self {
        self.segments.extend(others);
        Self::of(self.segments)
    }

    /// Number of segments.
    pub fn count(&self) -> usize {
        self.segments.len()
    }

    /// True when there are none.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.segments[..]) + size_of_val(&self.groups[..])) as u64
    }

    /// Number of steps of all paths.
    pub fn steps(&self) -> u64 {
        let spans =
            self.segments.iter().flat_map(|[a, b]| [a[0].abs_diff(b[0]), a[1].abs_diff(b[1])]);
        spans.map(u64::from).sum()
    }

    /// Segments whose path may touch a sample of a rectangle, in a fixed order. Time linear in the number of groups
    /// and of the segments in groups near the rectangle.
    pub fn near(&self, rect: Rect) -> impl Iterator<Item = SampleSegment> + '_ {
        self.ends_near(rect).map(|[a, b]| SampleSegment::new(a.map(i64::from), b.map(i64::from)))
    }

    /// The end points of these segments.
    pub fn ends_near(&self, rect: Rect) -> impl Iterator<Item = Ends> + '_ {
        let groups = self.groups.iter().zip(self.segments.chunks(Self::GROUP));
        let near =
            groups.filter(move |(bounds, _)| meets(rect, **bounds)).flat_map(|(_, group)| group);
        near.copied().filter(move |&ends| meets(rect, bounds(&[ends])))
    }
}

fn row_first([col, row]: [u32; 2]) -> (u32, u32) {
    (row, col)
}

fn block([col, row]: [u32; 2]) -> (u32, u32) {
    (row / 256, col / 256)
}

/// Whether a rectangle meets bounds, which include their ends.
fn meets(rect: Rect, [low, high]: Ends) -> bool {
    !rect.is_empty()
        && low[0] < rect.end_col()
        && low[1] < rect.end_row()
        && high[0] >= rect.col
        && high[1] >= rect.row
}

/// Minimum and maximum column and row.
fn bounds(segments: &[Ends]) -> Ends {
    let mut bounds = [[u32::MAX; 2], [0; 2]];
    for at in segments.iter().flatten() {
        for axis in 0..2 {
            bounds[0][axis] = bounds[0][axis].min(at[axis]);
            bounds[1][axis] = bounds[1][axis].max(at[axis]);
        }
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_segment_is_cut_where_the_grid_ends() {
        let size = [11, 6];
        for (a, b, expected) in [
            ([0.0, 0.0], [10.0, 5.0], Some([[0, 0], [10, 5]])),
            ([0.4, 1.6], [3.5, 2.4], Some([[0, 2], [4, 2]])),
            ([-10.0, 2.0], [20.0, 2.0], Some([[0, 2], [10, 2]])),
            ([20.0, 2.0], [-10.0, 2.0], Some([[10, 2], [0, 2]])),
            ([5.0, -6.0], [5.0, 3.0], Some([[5, 0], [5, 3]])),
            ([-5.0, 0.0], [5.0, 10.0], Some([[0, 5], [1, 5]])),
            ([-6.0, 0.0], [4.0, 11.0], None),
            ([-0.6, 1.0], [-0.6, 4.0], None),
            ([-0.5, 1.0], [-0.5, 4.0], Some([[0, 1], [0, 4]])),
            ([10.5, 1.0], [10.5, 4.0], None),
            ([3.0, 3.0], [3.0, 3.0], Some([[3, 3], [3, 3]])),
            ([-1e22, 2.0], [1e22, 2.0], Some([[0, 2], [10, 2]])),
            ([-1e308, 2.0], [1e308, 2.0], Some([[0, 2], [10, 2]])),
            ([f64::NAN, 1.0], [3.0, 1.0], None),
            ([1.0, 1.0], [f64::INFINITY, 1.0], None),
        ] {
            let sorted = |ends: Option<Ends>| ends.map(|[a, b]| [a.min(b), a.max(b)]);
            assert_eq!(sorted(cut([a, b], size)), sorted(expected), "{a:?} {b:?}");
        }
    }

    proptest! {
        /// Its twin looks at many positions along it.
        #[test]
        fn the_part_of_a_segment_on_the_grid_is_the_same_in_both_directions(
            a in [-30..60_i32, -30..60_i32], b in [-30..60_i32, -30..60_i32],
            size in [2..20_u32, 2..20_u32], share in 0.2..3.0
        ) {
            let [a, b] = [a, b].map(|at| at.map(|at| f64::from(at) * share));
            let found = cut([a, b], size);
            prop_assert_eq!(found, cut([b, a], size));
            let on = (0..=4000).map(|i| f64::from(i) / 4000.0).filter_map(|t| {
                let at = [0, 1].map(|axis| a[axis] + t * (b[axis] - a[axis]));
                let inside = |axis: usize| at[axis] >= -0.5 && at[axis] < f64::from(size[axis]) - 0.5;
                (inside(0) && inside(1)).then_some(at)
            });
            let on: Vec<_> = on.collect();
            if let (Some(first), Some(last)) = (on.first(), on.last()) {
                let [from, to] = found.unwrap();
                let near = |at: &[f64; 2], end: [u32; 2]| {
                    (0..2).all(|axis| (at[axis] - f64::from(end[axis])).abs() < 0.6)
                };
                prop_assert!(near(first, from) && near(last, to) || near(first, to) && near(last, from));
            }
        }
    }

    proptest! {
        /// Its twin looks at all samples of all paths.
        #[test]
        fn no_path_that_comes_to_a_rectangle_is_missed(
            ends in prop::collection::vec([[0..900_u32, 0..700_u32], [0..900_u32, 0..700_u32]], 1..300),
            (col, row) in (0..900_u32, 0..700_u32), (width, height) in (0..300_u32, 0..300_u32)
        ) {
            let rect = Rect::new(col, row, width.min(900 - col), height.min(700 - row));
            let lines = Paths::of(ends.clone());
            let near: Vec<_> = lines.near(rect).collect();
            let comes = |segment: &SampleSegment| (0..=segment.steps()).any(|step| {
                let [col, row] = segment.at(step);
                rect.contains(col as u32, row as u32)
            });
            let all = ends.iter().map(|&[a, b]| SampleSegment::new(a.map(i64::from), b.map(i64::from)));
            for segment in all.filter(comes) {
                prop_assert_eq!(near.iter().filter(|&&other| other == segment).count(), 1);
            }
        }
    }
}
