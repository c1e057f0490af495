//! Simplifying the lines of a tile, so that they cross neither each other nor those of other tiles.

use super::tiles::{Rim, Tiles};
use crate::contour::{Line, Lines, Vertex};
use crate::error::Result;
use crate::geom::{Affine, Rect};
use crate::line::cone::cone;
use crate::line::metric::Plane;
use crate::line::topology::{Chains, Kept, Options, open_at, refining, untangle};
use crate::line::{Scratch, Xy, ring};

/// Simplifies tiles, one after the other.
pub(super) struct Simplifier {
    tolerance: f64,
    transform: Affine,
    scratch: Scratch,
    /// What became of the last tile.
    lines: Lines,
}

/// The lines of a tile as chains, whose ends stay.
#[derive(Default)]
struct Input {
    vertices: Vec<Vertex>,
    points: Vec<Xy>,
    starts: Vec<usize>,
    closed: Vec<bool>,
    /// What is kept of each chain.
    kept: Kept,
    /// True for the second of two chains that are one line.
    goes_on: Vec<bool>,
}

impl Simplifier {
    /// `tolerance` is in the units of x and y, to which `transform` maps.
    pub(super) fn new(tolerance: f64, transform: Affine) -> Self {
        Self { tolerance, transform, scratch: Scratch::default(), lines: Lines::default() }
    }

    /// Simplifies the lines of the tile with the samples `rect`.
    pub(super) fn simplify(&mut self, lines: &Lines, rect: Rect, tiles: Tiles) -> Result<&Lines> {
        let mut input = Input { starts: vec![0], kept: Kept::new(), ..Input::default() };
        for (index, line) in lines.lines.iter().enumerate() {
            let vertices = lines.of(index);
            let cut = if line.closed { None } else { turning(vertices, rect, tiles) };
            match (line.closed, cut) {
                (true, _) => self.add_ring(&mut input, vertices, tiles),
                (false, None) => self.add(&mut input, vertices, false, tiles),
                (false, Some(at)) => {
                    self.add(&mut input, &vertices[..=at], false, tiles);
                    self.add(&mut input, &vertices[at..], true, tiles);
                }
            }
        }
        let Input { points, starts, closed, kept, .. } = &input;
        let chains = Chains { points, starts, closed };
        let (tolerance, scratch) = (self.tolerance, &mut self.scratch);
        let mut refine = refining(points, |points, kept| {
            cone(&Plane, points, tolerance, scratch, kept);
        });
        let outcome = untangle(&chains, kept, &[], &Options::default(), &mut refine)?;
        drop(refine);
        self.collect(lines, &input, &outcome.kept);
        Ok(&self.lines)
    }

    /// Adds an open chain.
    fn add(&mut self, input: &mut Input, vertices: &[Vertex], goes_on: bool, tiles: Tiles) {
        let start = input.points.len();
        input.points.extend(vertices.iter().map(|v| position(&self.transform, v, tiles)));
        input.vertices.extend_from_slice(vertices);
        let kept = &mut input.kept.vertices;
        let before = kept.len();
        cone(&Plane, &input.points[start..], self.tolerance, &mut self.scratch, kept);
        kept[before..].iter_mut().for_each(|v| *v += start as u32);
        input.end_chain(false, goes_on);
    }

    /// Adds a ring, beginning at a vertex that is kept.
    fn add_ring(&mut self, input: &mut Input, vertices: &[Vertex], tiles: Tiles) {
        let start = input.points.len();
        input.points.extend(vertices.iter().map(|v| position(&self.transform, v, tiles)));
        input.vertices.extend_from_slice(vertices);
        let points = &mut input.points[start..];
        let mut kept = Vec::new();
        let tolerance = self.tolerance;
        let method = |points: &[Xy], scratch: &mut Scratch, kept: &mut Vec<u32>| {
            cone(&Plane, points, tolerance, scratch, kept);
        };
        ring::simplify(&Plane, points, tolerance, true, method, &mut self.scratch, &mut kept);
        let first = kept.first().copied().unwrap_or(0);
        open_at(points, first as usize);
        open_at(&mut input.vertices[start..], first as usize);
        input.kept.vertices.extend(kept.iter().map(|v| v - first + start as u32));
        input.kept.vertices.push(input.points.len() as u32 - 1);
        input.end_chain(true, false);
    }

    /// Fills `lines` with the kept vertices of those given.
    fn collect(&mut self, lines: &Lines, input: &Input, kept: &Kept) {
        self.lines.clear();
        let mut originals = lines.lines.iter();
        for (chain, goes_on) in input.goes_on.iter().enumerate() {
            let kept = &kept.of(chain)[usize::from(*goes_on)..];
            let vertices = kept.iter().map(|v| input.vertices[*v as usize]);
            self.lines.vertices.extend(vertices);
            let end = self.lines.vertices.len();
            match (goes_on, self.lines.lines.last_mut()) {
                (true, Some(line)) => line.end = end,
                _ => self.lines.lines.extend(originals.next().map(|line| Line { end, ..*line })),
            }
        }
    }
}

impl Input {
    fn end_chain(&mut self, closed: bool, goes_on: bool) {
        self.starts.push(self.points.len());
        self.closed.push(closed);
        self.goes_on.push(goes_on);
        self.kept.close();
    }
}

/// Where a vertex is, in the units of the CRS.
pub(super) fn position(transform: &Affine, vertex: &Vertex, tiles: Tiles) -> Xy {
    let [col, row] = vertex.place(tiles.width);
    transform.apply(col, row)
}

/// The vertex that is farthest from the rim which a line comes from and goes back to, if it does.
fn turning(vertices: &[Vertex], rect: Rect, tiles: Tiles) -> Option<usize> {
    let rim = tiles.rim(rect, vertices.first()?)?;
    if tiles.rim(rect, vertices.last()?)? != rim {
        return None;
    }
    let depth = |vertex: &Vertex| {
        let [col, row] = vertex.place(tiles.width);
        match rim {
            Rim::North => row - f64::from(rect.row),
            Rim::South => f64::from(rect.end_row() - 1) - row,
            Rim::West => col - f64::from(rect.col),
            Rim::East => f64::from(rect.end_col() - 1) - col,
        }
    };
    let deepest = |best: (usize, f64), (at, depth)| if depth > best.1 { (at, depth) } else { best };
    let (at, _) = vertices.iter().map(depth).enumerate().fold((0, 0.0), deepest);
    (at > 0 && at + 1 < vertices.len()).then_some(at)
}
