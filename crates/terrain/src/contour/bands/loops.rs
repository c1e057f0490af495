//! Closed borders, and where contour lines end on them.

use super::border::BorderRun;
use crate::contour::tiles::ContourTiles;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::Cancel;
use terrane_window::contour::ContourVertex;

/// Runs visited between two checks for cancellation.
const VISITED: usize = 1 << 16;

/// The end of a line on the border or on the rim of a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineEnd {
    pub(super) vertex: ContourVertex,
    pub(super) piece: u32,
    /// True for the last vertex of the piece, false for the first.
    pub(super) is_last: bool,
}

/// The end of a line on the border.
#[derive(Clone, Copy, Debug)]
pub(super) struct BorderCrossing {
    pub(super) end: LineEnd,
    pub(super) run: u32,
    /// Distance from the start of the run, in edges.
    pub(super) along: f64,
}

/// A closed border: where its runs and crossings end. They start where those of the loop before end.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BorderLoop {
    runs_end: u32,
    crossings_end: u32,
}

/// Samples on a lattice line that belong to a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct BorderMark {
    /// The row or column.
    line: u32,
    /// The first of them, and the last.
    from: u32,
    to: u32,
    run: u32,
}

/// All closed borders.
pub(super) struct Borders {
    /// In the order of loops, each beginning where the one before it ends.
    pub(super) runs: Vec<BorderRun>,
    pub(super) loops: Vec<BorderLoop>,
    /// In the order of runs.
    pub(super) crossings: Vec<BorderCrossing>,
    /// Marks by row, and by column.
    marks: [Vec<BorderMark>; 2],
    /// Line ends along rows, sorted by row; and those down columns, sorted by column.
    ends: [Vec<LineEnd>; 2],
    pub(super) tiles: ContourTiles,
}

impl Borders {
    /// The borders made of `runs`. `ends` are all ends of pieces of lines.
    pub(super) fn new(
        runs: Vec<BorderRun>,
        ends: Vec<LineEnd>,
        tiles: ContourTiles,
        cancel: &Cancel,
    ) -> Result<Self> {
        let (runs, loops) = closed(runs, cancel)?;
        let (down, along) = ends.into_iter().partition(|end: &LineEnd| end.vertex.edge.is_down());
        let mut ends: [Vec<LineEnd>; 2] = [along, down];
        for (ends, is_down) in ends.iter_mut().zip([false, true]) {
            let key = |end: &LineEnd| line_key(&end.vertex, is_down, tiles);
            ends.sort_unstable_by(|a, b| {
                key(a).cmp(&key(b)).then(a.vertex.at.total_cmp(&b.vertex.at))
            });
        }
        let marks = [marks(&runs, false), marks(&runs, true)];
        let mut this = Self { runs, loops, crossings: Vec::new(), marks, ends, tiles };
        this.place_crossings(cancel)?;
        Ok(this)
    }

    /// Finds the crossings of each run: ends without a counterpart.
    fn place_crossings(&mut self, cancel: &Cancel) -> Result<()> {
        let mut crossings = Vec::new();
        let mut first = 0;
        for at in 0..self.loops.len() {
            for run in first..self.loops[at].runs_end {
                if (run as usize).is_multiple_of(VISITED) {
                    cancel.check()?;
                }
                self.cross(run, &mut crossings);
            }
            first = self.loops[at].runs_end;
            self.loops[at].crossings_end = crossings.len() as u32;
        }
        self.crossings = crossings;
        Ok(())
    }

    /// Appends the crossings of a run in its direction.
    fn cross(&self, number: u32, crossings: &mut Vec<BorderCrossing>) {
        let run = &self.runs[number as usize];
        let is_down = run.heading.is_down();
        let ends = &self.ends[usize::from(is_down)];
        let (line, [from, to]) = run.span();
        let [first, last] = [from, to].map(|at| {
            ends.partition_point(|end| line_key(&end.vertex, is_down, self.tiles) < (line, at))
        });
        let start = crossings.len();
        for (at, end) in ends.iter().enumerate().take(last).skip(first) {
            let same = |other: Option<&LineEnd>| other.is_some_and(|o| o.vertex == end.vertex);
            if same(ends.get(at + 1)) || at > 0 && same(ends.get(at - 1)) {
                continue;
            }
            let (_, edge) = line_key(&end.vertex, is_down, self.tiles);
            let along = run.along(f64::from(edge - from) + end.vertex.at);
            crossings.push(BorderCrossing { end: *end, run: number, along });
        }
        if !run.heading.is_upward() {
            crossings[start..].reverse();
        }
    }

    /// The loop of a run.
    pub(super) fn loop_of(&self, run: u32) -> u32 {
        self.loops.partition_point(|one| one.runs_end <= run) as u32
    }

    /// The runs of a loop.
    pub(super) fn runs_of(&self, number: u32) -> std::ops::Range<u32> {
        let start = number.checked_sub(1).map_or(0, |before| self.loops[before as usize].runs_end);
        start..self.loops[number as usize].runs_end
    }

    /// The crossings of a loop.
    pub(super) fn crossings_of(&self, number: u32) -> std::ops::Range<u32> {
        let before = number.checked_sub(1).map(|before| self.loops[before as usize]);
        let start = before.map_or(0, |before| before.crossings_end);
        start..self.loops[number as usize].crossings_end
    }

    /// The crossing after `crossing` on its loop; itself if there is no other.
    pub(super) fn next(&self, crossing: u32) -> u32 {
        let run = self.crossings[crossing as usize].run;
        let all = self.crossings_of(self.loop_of(run));
        if crossing + 1 < all.end { crossing + 1 } else { all.start }
    }

    /// The first crossing after a sample on a run; `None` if its loop has none.
    pub(super) fn after(&self, run: u32, (col, row): (u32, u32)) -> Option<u32> {
        let all = self.crossings_of(self.loop_of(run));
        let one = &self.runs[run as usize];
        let along = one.along(f64::from(col - one.col + (row - one.row)));
        let on_loop = &self.crossings[all.start as usize..all.end as usize];
        let at = on_loop.partition_point(|crossing| (crossing.run, crossing.along) <= (run, along))
            as u32;
        let found = if at < on_loop.len() as u32 { all.start + at } else { all.start };
        (!all.is_empty()).then_some(found)
    }

    /// The run after `run` on its loop.
    fn next_run(&self, run: u32, all: &std::ops::Range<u32>) -> u32 {
        if run + 1 < all.end { run + 1 } else { all.start }
    }

    /// Calls `each` with the samples between two crossings, the second of which may be the first again: where the
    /// border turns, or all of them.
    pub(super) fn between(
        &self,
        from: u32,
        to: u32,
        all_samples: bool,
        each: &mut impl FnMut(BorderSample),
    ) {
        let [start, end] = [from, to].map(|at| self.crossings[at as usize]);
        let all = self.runs_of(self.loop_of(start.run));
        let mut run = start.run;
        let mut first = start.along.floor() as u32 + 1;
        let mut is_whole = from < to && start.run == end.run;
        while !is_whole || run != end.run {
            self.samples(run, first..=self.runs[run as usize].len, &all, all_samples, each);
            (run, first, is_whole) = (self.next_run(run, &all), 1, true);
        }
        if all_samples {
            self.samples(run, first..=end.along.floor() as u32, &all, true, each);
        }
    }

    /// As [`between`](Self::between), for a whole loop.
    pub(super) fn around(
        &self,
        number: u32,
        all_samples: bool,
        each: &mut impl FnMut(BorderSample),
    ) {
        let all = self.runs_of(number);
        for run in all.clone() {
            self.samples(run, 1..=self.runs[run as usize].len, &all, all_samples, each);
        }
    }

    fn samples(
        &self,
        number: u32,
        along: std::ops::RangeInclusive<u32>,
        all: &std::ops::Range<u32>,
        all_samples: bool,
        each: &mut impl FnMut(BorderSample),
    ) {
        let run = &self.runs[number as usize];
        let next = self.runs[self.next_run(number, all) as usize].heading;
        let turns = run.heading != next;
        let is_left = next == run.heading.left();
        let first = if all_samples { *along.start() } else { run.len.max(*along.start()) };
        for at in first..=*along.end() {
            let turns = turns && at == run.len;
            if turns || all_samples {
                each(BorderSample { sample: run.sample(at), is_hole: turns && !is_left });
            }
        }
    }

    /// A run through a sample, if that is on a border.
    pub(super) fn run_at(&self, (col, row): (u32, u32)) -> Option<u32> {
        [(false, row, col), (true, col, row)].into_iter().find_map(|(is_down, line, at)| {
            self.mark_before(is_down, line, at).filter(|mark| mark.to >= at).map(|mark| mark.run)
        })
    }

    /// The mark of the highest reach that begins at the last marked sample of a line up to `at`.
    fn mark_before(&self, is_down: bool, line: u32, at: u32) -> Option<BorderMark> {
        let marks = &self.marks[usize::from(is_down)];
        let end = marks.partition_point(|mark| (mark.line, mark.from) <= (line, at));
        end.checked_sub(1).map(|last| marks[last]).filter(|mark| mark.line == line)
    }

    /// What is first met from a sample on a rim between tiles: to the north on a column, to the west on a row.
    pub(super) fn before(&self, (col, row): (u32, u32)) -> Result<RimHit> {
        let is_down = self.tiles.is_rim_col(col);
        let (line, at) = if is_down { (col, row) } else { (row, col) };
        let ends = &self.ends[usize::from(is_down)];
        let end =
            ends.partition_point(|end| line_key(&end.vertex, is_down, self.tiles) < (line, at));
        let end = end
            .checked_sub(1)
            .map(|last| (line_key(&ends[last].vertex, is_down, self.tiles), last));
        let end = end.filter(|((found, _), _)| *found == line);
        let mark = at.checked_sub(1).and_then(|before| self.mark_before(is_down, line, before));
        let marked = mark.map(|mark| mark.to.min(at - 1));
        match (end, mark) {
            (Some(((_, edge), last)), _) if marked.is_none_or(|marked| edge >= marked) => {
                Ok(RimHit::Piece(ends[last].piece))
            }
            (_, Some(mark)) => {
                let at = mark.to.min(at - 1);
                Ok(RimHit::Border(mark.run, if is_down { (line, at) } else { (at, line) }))
            }
            _ => Err(inconsistent("a rim without a border")),
        }
    }
}

/// What is met on a rim.
pub(super) enum RimHit {
    /// A piece of a line.
    Piece(u32),
    /// A run, at a sample.
    Border(u32, (u32, u32)),
}

/// A sample on a border.
#[derive(Clone, Copy, Debug)]
pub(super) struct BorderSample {
    pub(super) sample: (u32, u32),
    /// True if it turns to the right.
    pub(super) is_hole: bool,
}

/// The lattice line of a crossing, and its edge there.
fn line_key(vertex: &ContourVertex, is_down: bool, tiles: ContourTiles) -> (u32, u32) {
    let (col, row) = vertex.edge.first(tiles.width);
    if is_down { (col, row) } else { (row, col) }
}

/// The marks of all runs on rows, or on columns.
fn marks(runs: &[BorderRun], is_down: bool) -> Vec<BorderMark> {
    let mut marks = Vec::with_capacity(2 * runs.len());
    for (number, run) in runs.iter().enumerate() {
        let run_number = number as u32;
        if run.heading.is_down() == is_down {
            let (line, [from, to]) = run.span();
            // Its last sample begins a mark, too, in case that it ends the marks of a line.
            marks.push(BorderMark { line, from, to, run: run_number });
            marks.push(BorderMark { line, from: to, to, run: run_number });
        } else {
            let (at, lines) = run.span();
            for line in lines {
                marks.push(BorderMark { line, from: at, to: at, run: run_number });
            }
        }
    }
    // Of those that begin at one sample, the one that reaches farthest is the last.
    marks.sort_unstable();
    marks
}

/// Links runs to loops, which stay on the left of each sample that they meet at.
fn closed(runs: Vec<BorderRun>, cancel: &Cancel) -> Result<(Vec<BorderRun>, Vec<BorderLoop>)> {
    let mut starts: Vec<((u32, u32), u32)> = Vec::with_capacity(runs.len());
    starts.extend(runs.iter().enumerate().map(|(at, run)| (run.sample(0), at as u32)));
    starts.sort_unstable();
    let mut visited = vec![false; runs.len()];
    let (mut ordered, mut loops) = (Vec::with_capacity(runs.len()), Vec::new());
    // From sorted starts, so that the order does not depend on that of tiles.
    for &(_, first) in &starts {
        if visited[first as usize] {
            continue;
        }
        let mut at = first;
        loop {
            if ordered.len().is_multiple_of(VISITED) {
                cancel.check()?;
            }
            visited[at as usize] = true;
            let run = &runs[at as usize];
            ordered.push(*run);
            let end = run.sample(run.len);
            let from = starts.partition_point(|(sample, _)| *sample < end);
            let here = starts[from..].iter().take_while(|(sample, _)| *sample == end);
            let turn = |next: u32| runs[next as usize].heading != run.heading.left();
            let next = here.map(|&(_, next)| next).min_by_key(|&next| turn(next));
            at = next.ok_or_else(|| inconsistent("an open border"))?;
            if at == first {
                break;
            }
            if visited[at as usize] {
                return Err(inconsistent("a border that branches"));
            }
        }
        loops.push(BorderLoop { runs_end: ordered.len() as u32, crossings_end: 0 });
    }
    Ok((ordered, loops))
}

/// A fault of this program.
pub(super) fn inconsistent(what: &str) -> Error {
    Error::new(ErrorKind::Internal, format!("bands are inconsistent: {what}"))
        .remedy("report this, with the command and the grid")
}
