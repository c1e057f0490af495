//! What lies beside the lines of a tile: from the lowest edge of each, back along its lattice row.
//!
//! Between two neighbouring crossings of a lattice row there is one band. So the line, or border, that is met on
//! the way back from the lowest edge of a hole bounds the same polygon, and is lower itself. Following such steps
//! leads to the outer ring.

use super::border::{BorderRun, BorderTile, GridBorder, Heading};
use crate::contour::simplify::position;
use crate::contour::tiles::{ContourTiles, lowest};
use crate::contour::trace::ContourTask;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Affine, Rect};
use terrane_window::contour::{ContourLevels, ContourVertex, CrossedEdge, WindowContours};

/// What is met first.
#[derive(Clone, Copy, Debug)]
pub(super) enum ProbeHit {
    /// A piece of a line.
    Piece(u32),
    /// A sample on the border, or on the rim of the tile, as the number of its edge along the row.
    Sample(CrossedEdge),
}

/// The lowest vertex of a piece of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct PieceProbe {
    pub(super) low: ContourVertex,
    /// What is met from there.
    pub(super) hit: ProbeHit,
    /// True if the first sample of its edge is above the level.
    pub(super) first_is_above: bool,
}

/// What bands need of a tile besides its lines.
#[derive(Debug, Default)]
pub(in crate::contour) struct TileBands {
    /// One for each line.
    pub(super) probes: Vec<PieceProbe>,
    /// Samples with a void right below only, and what is met from there.
    pub(super) corners: Vec<(CrossedEdge, ProbeHit)>,
    pub(super) border: GridBorder,
    /// All crossings in order, with their lines.
    crossings: Vec<(ContourVertex, u32)>,
    has_voids: bool,
}

impl TileBands {
    /// Fills itself from a tile with its lines.
    ///
    /// # Errors
    /// Lines of two levels that meet; more parts of the border than memory is reserved for.
    pub(in crate::contour) fn fill<H: Copy + Into<f64>>(
        &mut self,
        (rect, heights): (Rect, &[H]),
        task: &ContourTask<'_>,
        lines: &WindowContours,
    ) -> Result<()> {
        let ContourTask { tiles, levels, budget, .. } = *task;
        let tile = BorderTile { rect, tiles, heights, levels };
        self.border.fill(&tile);
        // Simplification takes twice as much for a side as for a crossing.
        let share = if task.tolerance.is_some() { 2 } else { 1 };
        let (sides, most) = (self.border.runs.len() as u64, budget.crossings / share);
        if sides > most {
            return Err(Error::new(
                ErrorKind::Resource,
                format!("the voids in a tile have more than {most} straight sides"),
            )
            .remedy("raise ‹memory›, reduce ‹tile›, or fill the voids first"));
        }
        self.has_voids = heights.iter().any(|&height| height.into().is_nan());
        self.sort(lines);
        self.check(lines, tile.tiles, levels, &task.source.info().transform)?;
        self.probes.clear();
        for (index, line) in lines.lines.iter().enumerate() {
            let vertices = lines.of(index);
            let low = vertices[lowest(vertices)];
            let (col, row) = low.edge.first(tiles.width);
            let first_is_above = tile.height(col, row) >= levels.height(line.level);
            let hit = self.before(&tile, &low);
            self.probes.push(PieceProbe { low, hit, first_is_above });
        }
        self.corners.clear();
        for at in 0..self.border.runs.len() {
            if let Some(corner) = hole_corner(&tile, &self.border.runs[at]) {
                let hit = self.left(&tile, corner, false);
                let (col, row) = corner;
                self.corners.push((CrossedEdge::new(col, row, false, tiles.width), hit));
            }
        }
        Ok(())
    }

    fn sort(&mut self, lines: &WindowContours) {
        self.crossings.clear();
        for (index, line) in lines.lines.iter().enumerate() {
            let vertices = &lines.of(index)[usize::from(line.closed)..];
            self.crossings.extend(vertices.iter().map(|vertex| (*vertex, index as u32)));
        }
        self.crossings.sort_unstable_by(|(a, _), (b, _)| in_order(a, b));
    }

    /// Fails where two crossings of an edge have one position.
    fn check(
        &self,
        lines: &WindowContours,
        tiles: ContourTiles,
        levels: &ContourLevels,
        transform: &Affine,
    ) -> Result<()> {
        for pair in self.crossings.windows(2) {
            let [a, b] = [&pair[0], &pair[1]];
            if a.0.edge == b.0.edge
                && position(transform, &a.0, tiles) == position(transform, &b.0, tiles)
            {
                let [one, other] =
                    [a, b].map(|(_, line)| levels.height(lines.lines[*line as usize].level));
                let (col, row) = a.0.edge.first(tiles.width);
                return Err(Error::bad_input(format!(
                    "the band from {} to {} has no width at column {col}, row {row}",
                    one.min(other),
                    one.max(other)
                ))
                .remedy("raise ‹interval›, or leave out one of the ‹levels›"));
            }
        }
        Ok(())
    }

    /// What is met from a crossing back to the first sample of its edge, and on to the left.
    fn before<H: Copy + Into<f64>>(
        &self,
        tile: &BorderTile<'_, H>,
        low: &ContourVertex,
    ) -> ProbeHit {
        let at = self.crossings.partition_point(|(vertex, _)| in_order(vertex, low).is_lt());
        match at.checked_sub(1).map(|at| self.crossings[at]) {
            Some((vertex, line)) if vertex.edge == low.edge => ProbeHit::Piece(line),
            _ => self.left(tile, low.edge.first(tile.tiles.width), true),
        }
    }

    /// What is met from a sample to the left, starting with the sample itself if `counts`.
    fn left<H: Copy + Into<f64>>(
        &self,
        tile: &BorderTile<'_, H>,
        (mut col, row): (u32, u32),
        mut counts: bool,
    ) -> ProbeHit {
        let edge = |col| CrossedEdge::new(col, row, false, tile.tiles.width);
        let mut at = self.crossings.partition_point(|(vertex, _)| vertex.edge < edge(col));
        loop {
            if counts && self.is_at_end(tile, col, row) {
                return ProbeHit::Sample(edge(col));
            }
            let before = edge(col - 1);
            while at > 0 && self.crossings[at - 1].0.edge > before {
                at -= 1;
            }
            if let Some((vertex, line)) = at.checked_sub(1).map(|at| self.crossings[at])
                && vertex.edge == before
            {
                return ProbeHit::Piece(line);
            }
            (col, counts) = (col - 1, true);
        }
    }

    /// True for a sample on the border or on the rim of the tile.
    fn is_at_end<H: Copy + Into<f64>>(&self, tile: &BorderTile<'_, H>, col: u32, row: u32) -> bool {
        !is_within(tile.rect, col, row)
            || self.has_voids
                && ![(1, 1), (0, 1), (1, 0), (0, 0)]
                    .iter()
                    .all(|(left, up)| tile.is_whole(col - left, row - up))
    }

    /// The parts of the border within the tile, from vertex to vertex.
    pub(in crate::contour) fn segments(
        &self,
        tiles: ContourTiles,
    ) -> impl Iterator<Item = [ContourVertex; 2]> {
        self.border.runs.iter().flat_map(move |run| {
            let ends = [0, run.len].map(|along| run.part_end(along, tiles));
            let mut vertices = vec![ends[0]];
            for along in 0..run.len {
                let edge = run.edge(along, tiles);
                let from = self.crossings.partition_point(|(vertex, _)| vertex.edge < edge);
                let on_edge = self.crossings[from..].iter().map(|(vertex, _)| *vertex);
                vertices.extend(on_edge.take_while(|vertex| vertex.edge == edge));
            }
            vertices.push(ends[1]);
            let pairs: Vec<_> = vertices.windows(2).map(|pair| [pair[0], pair[1]]).collect();
            pairs
        })
    }
}

impl BorderRun {
    /// The edge `along` edges from its lowest sample.
    fn edge(&self, along: u32, tiles: ContourTiles) -> CrossedEdge {
        let is_down = self.heading.is_down();
        let (right, down) = if is_down { (0, along) } else { (along, 0) };
        CrossedEdge::new(self.col + right, self.row + down, is_down, tiles.width)
    }

    /// The sample `along` edges from its lowest one.
    fn part_end(&self, along: u32, tiles: ContourTiles) -> ContourVertex {
        let (right, down) = if self.heading.is_down() { (0, along) } else { (along, 0) };
        sample_vertex((self.col + right, self.row + down), tiles.width)
    }
}

/// A sample as a vertex.
pub(super) fn sample_vertex((col, row): (u32, u32), width: u32) -> ContourVertex {
    ContourVertex { edge: CrossedEdge::new(col, row, false, width), at: 0.0 }
}

/// The order of vertices: by edge, and along it.
pub(super) fn in_order(a: &ContourVertex, b: &ContourVertex) -> std::cmp::Ordering {
    a.edge.cmp(&b.edge).then(a.at.total_cmp(&b.at))
}

/// The first sample of a run that goes east, if the cell right below it is the only one with a void.
fn hole_corner<H: Copy + Into<f64>>(
    tile: &BorderTile<'_, H>,
    run: &BorderRun,
) -> Option<(u32, u32)> {
    let (col, row) = (run.col, run.row);
    let is_corner = run.heading == Heading::East
        && is_within(tile.rect, col, row)
        && tile.is_whole(col - 1, row - 1)
        && tile.is_whole(col - 1, row);
    is_corner.then_some((col, row))
}

/// True for a sample of which all four cells are in the tile.
fn is_within(rect: Rect, col: u32, row: u32) -> bool {
    col > rect.col && row > rect.row && col + 1 < rect.end_col() && row + 1 < rect.end_row()
}
