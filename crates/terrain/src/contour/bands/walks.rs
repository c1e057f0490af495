//! The closed walks around bands, along contour lines and borders, and the outer one of each hole.
//!
//! A walk has its band on the left. So each line belongs to two: forwards it bounds the band below its level,
//! backwards the one above. A line that is not written leads on along the border.

use super::loops::{BorderSample, Borders, RimHit, inconsistent};
use super::probe::{PieceProbe, ProbeHit, in_order, sample_vertex};
use crate::contour::join::{ContourPieces, JoinedContour};
use terrane_base::error::Result;
use terrane_engine::Cancel;
use terrane_window::contour::{ContourVertex, CrossedEdge};

/// Marks the lack of a walk, crossing or piece.
const NONE: u32 = u32::MAX;

/// Walks between two checks for cancellation.
const BATCH: usize = 1 << 12;

/// A line and what it is part of.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundLine {
    pub(super) line: JoinedContour,
    /// The piece with its lowest edge.
    low: u32,
    /// The border crossings of its first and last vertex, or [`NONE`].
    ends: [u32; 2],
    /// The walks along it, backwards and forwards.
    walks: [u32; 2],
    /// True for a line around no cell, which is not written.
    pub(super) is_dropped: bool,
}

/// A part of a walk.
#[derive(Clone, Copy, Debug)]
pub(super) enum WalkPart {
    /// A line by number; true for forwards.
    Line(u32, bool),
    /// The border from one crossing to another.
    Border(u32, u32),
    /// A whole border.
    Loop(u32),
}

/// A walk.
#[derive(Clone, Copy, Debug)]
pub(super) struct BandWalk {
    /// Its first part: a line or a loop.
    start: WalkPart,
    /// The rank of the heights of its band.
    pub(super) band: i32,
    /// Its lowest vertex.
    pub(super) low: ContourVertex,
    /// The piece with that vertex; [`NONE`] for a sample.
    low_piece: u32,
    pub(super) is_hole: bool,
}

/// All walks, and what they are made of.
pub(super) struct BandWalks {
    pub(super) lines: Vec<BoundLine>,
    line_of: Vec<u32>,
    pub(super) borders: Borders,
    probes: Vec<PieceProbe>,
    corners: Vec<(CrossedEdge, ProbeHit)>,
    pub(super) walks: Vec<BandWalk>,
    walk_of_loop: Vec<u32>,
}

impl BandWalks {
    /// Traces all walks. `probes` are those of all pieces; `corners` are sorted here.
    pub(super) fn new(
        pieces: &mut ContourPieces,
        borders: Borders,
        probes: Vec<PieceProbe>,
        mut corners: Vec<(CrossedEdge, ProbeHit)>,
        cancel: &Cancel,
    ) -> Result<Self> {
        corners.sort_unstable_by_key(|(sample, _)| *sample);
        let mut line_of = vec![NONE; probes.len()];
        let mut lines = Vec::new();
        for (number, line) in pieces.lines().into_iter().enumerate() {
            let mut low = NONE;
            for id in pieces.ids(&line) {
                line_of[id as usize] = number as u32;
                let [one, other] = [id, low].map(|at| probes.get(at as usize).map(|p| p.low.edge));
                if other.is_none() || one < other {
                    low = id;
                }
            }
            let is_dropped = line.closed && line.around == Some(0);
            let [ends, walks] = [[NONE; 2]; 2];
            lines.push(BoundLine { line, low, ends, walks, is_dropped });
        }
        let walk_of_loop = vec![NONE; borders.loops.len()];
        let walks = Vec::new();
        let mut this = Self { lines, line_of, borders, probes, corners, walks, walk_of_loop };
        this.meet_borders()?;
        this.trace(cancel)?;
        Ok(this)
    }

    /// Connects open lines with their crossings.
    fn meet_borders(&mut self) -> Result<()> {
        for (number, crossing) in self.borders.crossings.iter().enumerate() {
            let line = self.line_of[crossing.end.piece as usize] as usize;
            self.lines[line].ends[usize::from(crossing.end.is_last)] = number as u32;
        }
        let width = self.borders.tiles.width;
        for line in self.lines.iter_mut().filter(|line| !line.line.closed) {
            if line.ends.contains(&NONE) {
                return Err(inconsistent("a line that ends off the border"));
            }
            let [first, last] =
                line.ends.map(|at| self.borders.crossings[at as usize].end.vertex.nearer(width));
            line.is_dropped = line.line.around == Some(0) && first == last;
        }
        Ok(())
    }

    fn trace(&mut self, cancel: &Cancel) -> Result<()> {
        for line in 0..self.lines.len() {
            if line.is_multiple_of(BATCH) {
                cancel.check()?;
            }
            let BoundLine { is_dropped, .. } = self.lines[line];
            for forward in [false, true].into_iter().filter(|_| !is_dropped) {
                if self.lines[line].walks[usize::from(forward)] == NONE {
                    self.add(WalkPart::Line(line as u32, forward))?;
                }
            }
        }
        for number in 0..self.borders.loops.len() as u32 {
            if (number as usize).is_multiple_of(BATCH) {
                cancel.check()?;
            }
            let mut all = self.borders.crossings_of(number);
            if all.all(|crossing| self.entered(crossing).is_none()) {
                self.add(WalkPart::Loop(number))?;
            }
        }
        Ok(())
    }

    /// The line that a walk enters at a border crossing, and its direction; `None` if the walk goes on along
    /// the border.
    fn entered(&self, crossing: u32) -> Option<(u32, bool)> {
        let end = self.borders.crossings[crossing as usize].end;
        let line = self.line_of[end.piece as usize];
        (!self.lines[line as usize].is_dropped).then_some((line, !end.is_last))
    }

    fn band_of(&self, line: u32, forward: bool) -> i32 {
        self.lines[line as usize].line.level - i32::from(forward)
    }

    /// Adds the walk that begins with `start`.
    fn add(&mut self, start: WalkPart) -> Result<()> {
        let number = self.walks.len() as u32;
        let band = match start {
            WalkPart::Line(line, forward) => self.band_of(line, forward),
            WalkPart::Loop(number) => self.band_of_loop(number),
            WalkPart::Border(..) => return Err(inconsistent("a ring that begins on a border")),
        };
        let mut low: Option<(ContourVertex, u32, bool)> = None;
        let mut lower = |vertex: ContourVertex, piece: u32, is_hole: bool| {
            if low.is_none_or(|(known, ..)| in_order(&vertex, &known).is_lt()) {
                low = Some((vertex, piece, is_hole));
            }
        };
        let width = self.borders.tiles.width;
        let mut corner = |BorderSample { sample, is_hole, .. }| {
            lower(sample_vertex(sample, width), NONE, is_hole);
        };
        let mut met = Vec::new();
        let mut is_sound = true;
        self.parts(start, |part| match part {
            WalkPart::Line(line, forward) => met.push((line, forward)),
            WalkPart::Border(from, to) => self.borders.between(from, to, false, &mut corner),
            WalkPart::Loop(number) => self.borders.around(number, false, &mut corner),
        })?;
        for (line, forward) in met {
            is_sound &= self.band_of(line, forward) == band;
            let piece = self.lines[line as usize].low;
            let PieceProbe { low, first_is_above, .. } = self.probes[piece as usize];
            lower(low, piece, forward != first_is_above);
            self.lines[line as usize].walks[usize::from(forward)] = number;
        }
        if let WalkPart::Loop(at) = start {
            self.walk_of_loop[at as usize] = number;
        }
        let Some((low, low_piece, is_hole)) = low.filter(|_| is_sound) else {
            return Err(inconsistent("a walk along two bands"));
        };
        self.walks.push(BandWalk { start, band, low, low_piece, is_hole });
        Ok(())
    }

    /// The band along a loop without lines that are written.
    fn band_of_loop(&self, number: u32) -> i32 {
        match self.borders.crossings_of(number).next() {
            Some(crossing) => {
                let piece = self.borders.crossings[crossing as usize].end.piece;
                self.band_of(self.line_of[piece as usize], true)
            }
            None => self.borders.runs[self.borders.runs_of(number).start as usize].rank,
        }
    }

    /// Calls `each` with the parts of a walk.
    fn parts(&self, start: WalkPart, mut each: impl FnMut(WalkPart)) -> Result<()> {
        each(start);
        let WalkPart::Line(first, first_forward) = start else { return Ok(()) };
        if self.lines[first as usize].line.closed {
            return Ok(());
        }
        let (mut line, mut forward) = (first, first_forward);
        let mut left = 2 * self.lines.len();
        loop {
            let from = self.lines[line as usize].ends[usize::from(forward)];
            let mut to = self.borders.next(from);
            // One that is entered comes at last: that of `from` itself.
            (line, forward) = loop {
                match self.entered(to) {
                    Some(entered) => break entered,
                    None => to = self.borders.next(to),
                }
            };
            each(WalkPart::Border(from, to));
            if (line, forward) == (first, first_forward) {
                return Ok(());
            }
            each(WalkPart::Line(line, forward));
            left = left.checked_sub(1).ok_or_else(|| inconsistent("a walk without an end"))?;
        }
    }

    /// Calls `each` with the parts of walk `number`.
    pub(super) fn parts_of(&self, number: u32, each: impl FnMut(WalkPart)) -> Result<()> {
        self.parts(self.walks[number as usize].start, each)
    }

    /// The outer walk of each walk; itself for outer ones.
    pub(super) fn owners(&self, cancel: &Cancel) -> Result<Vec<u32>> {
        let mut owners: Vec<u32> = (0..self.walks.len() as u32)
            .map(|at| if self.walks[at as usize].is_hole { NONE } else { at })
            .collect();
        let mut path = Vec::new();
        for number in 0..owners.len() {
            if number.is_multiple_of(BATCH) {
                cancel.check()?;
            }
            let mut at = number as u32;
            while owners[at as usize] == NONE {
                path.push(at);
                at = self.beside(at)?;
            }
            let owner = owners[at as usize];
            path.drain(..).for_each(|at| owners[at as usize] = owner);
        }
        Ok(owners)
    }

    /// A walk around the same polygon as hole `number`: lower, or the outer one.
    fn beside(&self, number: u32) -> Result<u32> {
        let hole = &self.walks[number as usize];
        let hit = match self.probes.get(hole.low_piece as usize) {
            Some(probe) => Some(probe.hit),
            None => {
                let corner =
                    self.corners.binary_search_by_key(&hole.low.edge, |(sample, _)| *sample);
                corner.ok().map(|at| self.corners[at].1)
            }
        };
        let hit = hit.unwrap_or(ProbeHit::Sample(hole.low.edge));
        let found = self.met(hit, hole)?;
        let Some(walk) = self.walks.get(found as usize) else {
            return Err(inconsistent("a hole without a polygon"));
        };
        let is_lower = !walk.is_hole || in_order(&walk.low, &hole.low).is_lt();
        if walk.band != hole.band || !is_lower {
            return Err(inconsistent("a hole in another band"));
        }
        Ok(found)
    }

    /// The walk at what is met from the lowest vertex of a hole. A line that is not written has the band on both
    /// sides; the way goes on from its lowest vertex.
    fn met(&self, mut hit: ProbeHit, hole: &BandWalk) -> Result<u32> {
        loop {
            hit = match hit {
                ProbeHit::Piece(piece) => {
                    let line = &self.lines[self.line_of[piece as usize] as usize];
                    if !line.is_dropped {
                        return Ok(line.walks[usize::from(line.line.level > hole.band)]);
                    }
                    self.probes[line.low as usize].hit
                }
                ProbeHit::Sample(edge) => {
                    let sample = edge.first(self.borders.tiles.width);
                    // The lowest sample of the hole itself is on its border.
                    match self
                        .borders
                        .run_at(sample)
                        .filter(|_| (edge, 0.0) != (hole.low.edge, hole.low.at))
                    {
                        Some(run) => return Ok(self.along_border(run, sample)),
                        None => match self.borders.before(sample)? {
                            RimHit::Piece(piece) => ProbeHit::Piece(piece),
                            RimHit::Border(run, sample) => {
                                return Ok(self.along_border(run, sample));
                            }
                        },
                    }
                }
            }
        }
    }

    fn along_border(&self, run: u32, sample: (u32, u32)) -> u32 {
        let number = self.borders.loop_of(run);
        if self.walk_of_loop[number as usize] != NONE {
            return self.walk_of_loop[number as usize];
        }
        let Some(mut crossing) = self.borders.after(run, sample) else { return NONE };
        // There is one that is entered, else the loop has a walk.
        loop {
            match self.entered(crossing) {
                Some((line, forward)) => {
                    return self.lines[line as usize].walks[usize::from(forward)];
                }
                None => crossing = self.borders.next(crossing),
            }
        }
    }
}
