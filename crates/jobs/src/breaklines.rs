//! Breaklines on a grid: segments from sample to sample, of which those near a rectangle are found quickly.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_tin::{Segment, Stretch};

/// Ends of a segment: columns and rows, each below 2^31.
type Ends = [[u32; 2]; 2];

/// Segments that edges of a mesh follow.
#[derive(Clone, Debug, Default)]
pub struct Breaklines {
    /// Each once, those near each other together.
    segments: Vec<Ends>,
    /// Bounds of each [`Self::GROUP`] of them: least and largest column and row.
    groups: Vec<Ends>,
    path: Option<PathBuf>,
    asked: u64,
    outside: u64,
}

impl Breaklines {
    /// None.
    pub const NONE: Self =
        Self { segments: Vec::new(), groups: Vec::new(), path: None, asked: 0, outside: 0 };

    /// Segments whose bounds are looked at together.
    const GROUP: usize = 64;

    /// Those of lines through positions on the lattice of a grid of `size` columns and rows, each of which ends at
    /// one of `ends`. An end of a segment is the sample nearest to where the segment is, or enters the grid.
    ///
    /// # Errors
    /// No line on the grid.
    pub(crate) fn on(at: &[[f64; 2]], ends: &[u32], size: [u32; 2], path: PathBuf) -> Result<Self> {
        let starts = std::iter::once(0).chain(ends.iter().map(|&end| end as usize));
        let lines = starts.zip(ends).map(|(start, &end)| &at[start..end as usize]);
        let (mut segments, mut asked) = (Vec::new(), 0);
        for pair in lines.flat_map(|line| line.windows(2)) {
            asked += 1;
            segments.extend(clipped([pair[0], pair[1]], size));
        }
        let outside = asked - segments.len() as u64;
        if segments.is_empty() {
            return Err(Error::bad_input("no line of this file lies on the grid")
                .in_file(&path)
                .remedy("choose lines on the grid (terrane info tells the bounds of both)"));
        }
        Ok(Self { path: Some(path), asked, outside, ..Self::of(segments) })
    }

    /// These, in any order and either direction.
    pub fn of(mut segments: Vec<Ends>) -> Self {
        let asked = segments.len() as u64;
        let row_first = |[col, row]: [u32; 2]| (row, col);
        segments.iter_mut().for_each(|ends| ends.sort_unstable_by_key(|&at| row_first(at)));
        let block = |[col, row]: [u32; 2]| (row / 256, col / 256);
        segments.sort_unstable_by_key(|&[a, b]| (block(a), row_first(a), row_first(b)));
        segments.dedup();
        let groups = segments.chunks(Self::GROUP).map(bounds).collect();
        Self { segments, groups, asked, ..Self::default() }
    }

    /// Most bytes of those of lines with so many vertices, with what a worker lists of them.
    pub fn most_bytes(vertices: usize) -> u64 {
        (vertices * (size_of::<Ends>() + size_of::<Segment>() + size_of::<Stretch>())) as u64
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.segments[..]) + size_of_val(&self.groups[..])) as u64
    }

    /// About how many vertices they have, and hardly more, in a mesh that has so many of so many samples without
    /// them (measured: 1.8 for each that a line of its length would meet, and those at the ends).
    pub fn vertices_in(&self, vertices: u64, samples: u64) -> u64 {
        let density = vertices as f64 / samples.max(1) as f64;
        let met = 2.0 * self.steps() as f64 * density.sqrt();
        let most = 2 * self.segments.len() as u64 + met as u64;
        most.min(samples - vertices.min(samples))
    }

    /// Steps of all paths.
    fn steps(&self) -> u64 {
        let steps = |[a, b]: &Ends| u64::from(a[0].abs_diff(b[0])) + u64::from(a[1].abs_diff(b[1]));
        self.segments.iter().map(steps).sum()
    }

    /// True when there are none.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// The segments with a path that may come to a sample of a rectangle, in the same order wherever they are
    /// asked for. Time linear in those of all groups near it, and in all groups.
    pub fn near(&self, rect: Rect) -> impl Iterator<Item = Segment> + '_ {
        let segment = |[a, b]: Ends| Segment::new(a.map(i64::from), b.map(i64::from));
        self.ends_near(rect).map(segment)
    }

    /// Their ends.
    pub fn ends_near(&self, rect: Rect) -> impl Iterator<Item = Ends> + '_ {
        let meets = move |&[low, high]: &Ends| {
            !rect.is_empty()
                && low[0] < rect.end_col()
                && low[1] < rect.end_row()
                && high[0] >= rect.col
                && high[1] >= rect.row
        };
        let groups = self.groups.iter().zip(self.segments.chunks(Self::GROUP));
        let near = groups.filter(move |(bounds, _)| meets(bounds)).flat_map(|(_, group)| group);
        near.copied().filter(move |&ends| meets(&bounds(&[ends])))
    }

    /// What a report says; `None` where no lines were asked for.
    pub fn report(&self, apart: u64) -> Option<BreaklinesReport> {
        (self.asked > 0).then(|| BreaklinesReport {
            file: self.path.as_deref().map_or_else(String::new, |path| path.display().to_string()),
            segments: self.asked,
            outside: self.outside,
            apart,
        })
    }
}

/// What became of breaklines.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BreaklinesReport {
    /// The file they are in.
    pub file: String,
    /// Segments of its lines and rings.
    pub segments: u64,
    /// Those that lie beyond the grid.
    pub outside: u64,
    /// Vertices from which a line should go on along an edge, and does not.
    pub apart: u64,
}

fn bounds(segments: &[Ends]) -> Ends {
    let all = || segments.iter().flatten();
    let least = |axis: usize| all().map(|at| at[axis]).min().unwrap_or_default();
    let most = |axis: usize| all().map(|at| at[axis]).max().unwrap_or_default();
    [[least(0), least(1)], [most(0), most(1)]]
}

/// The part of a segment over the cells around samples, from sample to sample: the same in both directions.
fn clipped([a, b]: [[f64; 2]; 2], size: [u32; 2]) -> Option<Ends> {
    if !a.iter().chain(&b).all(|at| at.is_finite()) {
        return None;
    }
    let [mut a, mut b] = if [a[1], a[0]] <= [b[1], b[0]] { [a, b] } else { [b, a] };
    // Sutherland & Hodgman (1974), side by side.
    for axis in [0, 1] {
        let most = f64::from(size[axis]) - 0.5;
        if a[axis].max(b[axis]) < -0.5 || a[axis].min(b[axis]) >= most {
            return None;
        }
        for side in [-0.5, most] {
            let is_beyond = |at: f64| if side < 0.0 { at < side } else { at > side };
            match [a, b].map(|at| is_beyond(at[axis])) {
                [true, false] => a = crossing(a, b, axis, side),
                [false, true] => b = crossing(b, a, axis, side),
                _ => {}
            }
        }
    }
    let nearest = |at: [f64; 2]| {
        [0, 1].map(|axis| (at[axis] + 0.5).floor().clamp(0.0, f64::from(size[axis] - 1)) as u32)
    };
    Some([nearest(a), nearest(b)])
}

/// Where the segment from `a` to `b` meets a side. Halves, as differences of what is far apart may not be numbers.
fn crossing(a: [f64; 2], b: [f64; 2], axis: usize, side: f64) -> [f64; 2] {
    let [from, to] = [a, b].map(|at| at.map(|at| at / 2.0));
    let share = (side / 2.0 - from[axis]) / (to[axis] - from[axis]);
    let other = 1 - axis;
    let mut at = [side; 2];
    at[other] = (from[other] + share * (to[other] - from[other])) * 2.0;
    at
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
            assert_eq!(sorted(clipped([a, b], size)), sorted(expected), "{a:?} {b:?}");
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
            let found = clipped([a, b], size);
            prop_assert_eq!(found, clipped([b, a], size));
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

    #[test]
    fn what_lies_outside_is_counted_and_all_of_it_refused() {
        let at = [[0.0, 0.0], [5.0, 0.0], [50.0, 0.0], [60.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
        let lines = Breaklines::on(&at, &[4, 6], [11, 6], "a.wkt".into()).unwrap();
        let told = lines.report(3).unwrap();
        assert_eq!((told.segments, told.outside, told.apart), (4, 1, 3));
        let all: Vec<_> = lines.near(Rect::new(0, 0, 11, 6)).collect();
        let expected = [[[0, 0], [5, 0]], [[5, 0], [10, 0]], [[1, 1], [2, 2]]];
        assert_eq!(all, expected.map(|[a, b]| Segment::new(a, b)));
        let error = Breaklines::on(&at[2..4], &[2], [11, 6], "a.wkt".into()).unwrap_err();
        assert!(error.to_string().contains("no line of this file"), "{error}");
        assert_eq!(Breaklines::NONE.report(0), None);
    }

    proptest! {
        /// Its twin looks at all samples of all paths.
        #[test]
        fn no_path_that_comes_to_a_rectangle_is_missed(
            ends in prop::collection::vec([[0..900_u32, 0..700_u32], [0..900_u32, 0..700_u32]], 1..300),
            (col, row) in (0..900_u32, 0..700_u32), (width, height) in (0..300_u32, 0..300_u32)
        ) {
            let rect = Rect::new(col, row, width.min(900 - col), height.min(700 - row));
            let lines = Breaklines::of(ends.clone());
            let near: Vec<_> = lines.near(rect).collect();
            let comes = |segment: &Segment| (0..=segment.steps()).any(|step| {
                let [col, row] = segment.at(step);
                rect.contains(col as u32, row as u32)
            });
            let all = ends.iter().map(|&[a, b]| Segment::new(a.map(i64::from), b.map(i64::from)));
            for segment in all.filter(comes) {
                prop_assert_eq!(near.iter().filter(|&&other| other == segment).count(), 1);
            }
        }
    }
}
