//! Breaklines on a grid: segments from sample to sample, of which those near a rectangle are found quickly.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_tin::Segment;

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
        (vertices * (size_of::<Ends>() + size_of::<terrane_tin::Stretch>())) as u64
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.segments[..]) + size_of_val(&self.groups[..])) as u64
    }

    /// Steps of all paths.
    pub fn steps(&self) -> u64 {
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

/// The part of a segment over the cells around samples (Liang & Barsky 1984), from sample to sample.
fn clipped([a, b]: [[f64; 2]; 2], size: [u32; 2]) -> Option<Ends> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for axis in [0, 1] {
        let (start, step) = (a[axis], b[axis] - a[axis]);
        let (low, high) = (-0.5 - start, f64::from(size[axis]) - 0.5 - start);
        if !step.is_finite() || step == 0.0 && !(low <= 0.0 && high > 0.0) {
            return None;
        }
        if step != 0.0 {
            let [near, far] = if step > 0.0 { [low, high] } else { [high, low] };
            (from, to) = (from.max(near / step), to.min(far / step));
        }
    }
    let sample = |t: f64| {
        [0, 1].map(|axis| {
            let at = if t == 1.0 { b[axis] } else { a[axis] + t * (b[axis] - a[axis]) };
            (at + 0.5).floor().clamp(0.0, f64::from(size[axis] - 1)) as u32
        })
    };
    (from <= to).then(|| [sample(from), sample(to)])
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
            ([-5.0, 0.0], [5.0, 10.0], Some([[0, 5], [0, 5]])),
            ([-6.0, 0.0], [4.0, 11.0], None),
            ([-0.6, 1.0], [-0.6, 4.0], None),
            ([-0.5, 1.0], [-0.5, 4.0], Some([[0, 1], [0, 4]])),
            ([10.5, 1.0], [10.5, 4.0], None),
            ([3.0, 3.0], [3.0, 3.0], Some([[3, 3], [3, 3]])),
            ([f64::NAN, 1.0], [3.0, 1.0], None),
            ([1.0, 1.0], [f64::INFINITY, 1.0], None),
        ] {
            assert_eq!(clipped([a, b], size), expected, "{a:?} {b:?}");
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
