//! Simplifying the lines of a tile, so that they cross neither each other nor those of other tiles.

use super::bands::TileBands;
use super::tiles::{ContourTiles, TileEdge, lowest};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Rect};
use terrane_engine::Cancel;
use terrane_line::cone::cone;
use terrane_line::topology::{
    Chains, RetainedChainVertices, UntangleOptions, open_at, refining, untangle,
};
use terrane_line::{
    DistanceMetric, GeographicMetric, LocatedVertex, PlaneMetric, SimplifyScratch, Xy, ring,
};
use terrane_raster::GridInfo;
use terrane_simplify::{DistanceKind, Length, goal_of};
use terrane_window::contour::{ContourVertex, WindowContour, WindowContours};

/// A tolerance and its metric.
#[derive(Clone, Copy, Debug)]
pub(super) struct MetricTolerance {
    pub(super) measure: DistanceKind,
    pub(super) value: f64,
}

/// A length over a grid.
pub(super) fn measured(length: Length, info: &GridInfo) -> Result<MetricTolerance> {
    let (measure, value) = goal_of(length, false, &info.crs)?;
    let [east, south] = [info.width, info.height].map(|samples| f64::from(samples) - 1.0);
    let corners = [[0.0, 0.0], [east, 0.0], [0.0, south], [east, south]];
    let mut latitudes = corners.into_iter().map(|[col, row]| info.transform.apply(col, row)[1]);
    if measure == DistanceKind::Geographic && latitudes.any(|latitude| latitude.abs() > 90.0 + 1e-6)
    {
        return Err(Error::bad_input("the grid extends beyond 90 degrees of latitude")
            .remedy("pass ‹tolerance› as a plain number, in units of the CRS"));
    }
    Ok(MetricTolerance { measure, value })
}

/// Simplifies tiles, one after the other.
pub(super) struct Simplifier {
    transform: Affine,
    cone: DoubleCone,
    /// Result of the last tile.
    lines: WindowContours,
}

/// The lines of a tile as chains, whose ends stay.
#[derive(Default)]
struct TileChains {
    vertices: Vec<ContourVertex>,
    points: Vec<Xy>,
    starts: Vec<usize>,
    closed: Vec<bool>,
    /// What is kept of each chain.
    kept: RetainedChainVertices,
    /// True for a chain that continues the line of the one before it.
    goes_on: Vec<bool>,
}

impl Simplifier {
    /// Distances are those of positions after `transform`.
    pub(super) fn new(tolerance: MetricTolerance, transform: Affine) -> Self {
        let cone =
            DoubleCone { tolerance, scratch: SimplifyScratch::default(), located: Vec::new() };
        Self { transform, cone, lines: WindowContours::default() }
    }

    /// Simplifies the lines of the tile with the samples `rect`. Those of `bands` do not touch the border, either.
    pub(super) fn simplify(
        &mut self,
        lines: &WindowContours,
        rect: Rect,
        tiles: ContourTiles,
        bands: Option<&TileBands>,
        cancel: &Cancel,
    ) -> Result<&WindowContours> {
        let mut input = TileChains {
            starts: vec![0],
            kept: RetainedChainVertices::new(),
            ..TileChains::default()
        };
        for (index, line) in lines.lines.iter().enumerate() {
            cancel.check()?;
            let vertices = lines.of(index);
            if line.closed {
                self.add_ring(&mut input, vertices, tiles);
                continue;
            }
            let fixed = fixed_vertices(vertices, rect, tiles);
            for (index, ends) in fixed.windows(2).enumerate() {
                self.add(&mut input, &vertices[ends[0]..=ends[1]], index > 0, tiles);
            }
        }
        let lines_end = input.goes_on.len();
        for border in bands.into_iter().flat_map(|bands| bands.segments(tiles)) {
            self.add(&mut input, &border, false, tiles);
        }
        let TileChains { points, starts, closed, kept, .. } = &input;
        let chains = Chains { points, starts, closed };
        let mut refine = refining(points, |points, kept| self.cone.line(points, kept));
        let options = UntangleOptions { cancel: Some(cancel), ..UntangleOptions::default() };
        let outcome = untangle(&chains, kept, &[], &options, &mut refine)?;
        drop(refine);
        if let (Some(_), Some([at, _])) = (bands, outcome.crossings.first()) {
            return Err(too_close(points[*at as usize]));
        }
        input.goes_on.truncate(lines_end);
        self.collect(lines, &input, &outcome.kept);
        Ok(&self.lines)
    }

    /// Adds an open chain.
    fn add(
        &mut self,
        input: &mut TileChains,
        vertices: &[ContourVertex],
        goes_on: bool,
        tiles: ContourTiles,
    ) {
        let start = input.points.len();
        input.points.extend(vertices.iter().map(|v| position(&self.transform, v, tiles)));
        input.vertices.extend_from_slice(vertices);
        let kept = &mut input.kept.vertices;
        let before = kept.len();
        self.cone.line(&input.points[start..], kept);
        kept[before..].iter_mut().for_each(|v| *v += start as u32);
        input.end_chain(false, goes_on);
    }

    /// Adds a ring, beginning at its lowest edge, which stays.
    fn add_ring(
        &mut self,
        input: &mut TileChains,
        vertices: &[ContourVertex],
        tiles: ContourTiles,
    ) {
        let start = input.points.len();
        input.points.extend(vertices.iter().map(|v| position(&self.transform, v, tiles)));
        input.vertices.extend_from_slice(vertices);
        let low = lowest(vertices);
        open_at(&mut input.vertices[start..], low);
        let points = &mut input.points[start..];
        open_at(points, low);
        let mut kept = Vec::new();
        self.cone.ring(points, &mut kept);
        let end = points.len() as u32 - 1;
        if let (Some(&first), Some(&last)) = (kept.first(), kept.last())
            && first > 0
        {
            kept = self.cone.around(points, first, last, &kept);
        } else {
            kept.push(end);
        }
        input.kept.vertices.extend(kept.iter().map(|v| v + start as u32));
        input.end_chain(true, false);
    }

    /// Fills `lines` with the kept vertices of those given.
    fn collect(
        &mut self,
        lines: &WindowContours,
        input: &TileChains,
        kept: &RetainedChainVertices,
    ) {
        self.lines.clear();
        let mut originals = lines.lines.iter();
        for (chain, goes_on) in input.goes_on.iter().enumerate() {
            let kept = &kept.of(chain)[usize::from(*goes_on)..];
            let vertices = kept.iter().map(|v| input.vertices[*v as usize]);
            self.lines.vertices.extend(vertices);
            let end = self.lines.vertices.len();
            match (goes_on, self.lines.lines.last_mut()) {
                (true, Some(line)) => line.end = end,
                _ => self
                    .lines
                    .lines
                    .extend(originals.next().map(|line| WindowContour { end, ..*line })),
            }
        }
    }
}

/// The greedy double cone, in the given metric.
struct DoubleCone {
    tolerance: MetricTolerance,
    scratch: SimplifyScratch,
    located: Vec<LocatedVertex>,
}

impl DoubleCone {
    /// Appends the vertices kept of a line.
    fn line(&mut self, points: &[Xy], kept: &mut Vec<u32>) {
        let (tolerance, scratch) = (self.tolerance.value, &mut self.scratch);
        match self.tolerance.measure {
            DistanceKind::Geographic => {
                locate(points, &mut self.located);
                cone(&GeographicMetric, &self.located, tolerance, scratch, kept);
            }
            DistanceKind::Plane | DistanceKind::Space => {
                cone(&PlaneMetric, points, tolerance, scratch, kept)
            }
        }
    }

    /// `kept` of a ring, with its start and end: the parts before `first` and after `last` are computed again.
    fn around(&mut self, points: &[Xy], first: u32, last: u32, kept: &[u32]) -> Vec<u32> {
        let mut all = Vec::new();
        self.line(&points[..=first as usize], &mut all);
        all.extend(&kept[1..]);
        let after = all.len();
        self.line(&points[last as usize..], &mut all);
        all[after..].iter_mut().for_each(|v| *v += last);
        // It is there already.
        all.remove(after);
        all
    }

    /// Appends the vertices kept of a ring.
    fn ring(&mut self, points: &[Xy], kept: &mut Vec<u32>) {
        match self.tolerance.measure {
            DistanceKind::Geographic => {
                locate(points, &mut self.located);
                ring_in(
                    &GeographicMetric,
                    &self.located,
                    self.tolerance.value,
                    &mut self.scratch,
                    kept,
                );
            }
            DistanceKind::Plane | DistanceKind::Space => {
                ring_in(&PlaneMetric, points, self.tolerance.value, &mut self.scratch, kept);
            }
        }
    }
}

fn locate(points: &[Xy], located: &mut Vec<LocatedVertex>) {
    located.clear();
    located.extend(points.iter().map(|point| LocatedVertex::new(*point)));
}

fn ring_in<V: Copy, M: DistanceMetric<V>>(
    metric: &M,
    points: &[V],
    tolerance: f64,
    scratch: &mut SimplifyScratch,
    kept: &mut Vec<u32>,
) {
    ring::simplify(
        metric,
        points,
        tolerance,
        true,
        |points, scratch, kept| cone(metric, points, tolerance, scratch, kept),
        scratch,
        kept,
    );
}

impl TileChains {
    fn end_chain(&mut self, closed: bool, goes_on: bool) {
        self.starts.push(self.points.len());
        self.closed.push(closed);
        self.goes_on.push(goes_on);
        self.kept.close();
    }
}

/// The error of lines that touch before they are simplified.
fn too_close([x, y]: Xy) -> Error {
    Error::bad_input(format!("contour lines touch near x {x}, y {y}"))
        .remedy("leave ‹tolerance› out, or raise ‹interval›")
}

/// Where a vertex is, in the units of the CRS.
pub(super) fn position(transform: &Affine, vertex: &ContourVertex, tiles: ContourTiles) -> Xy {
    let [col, row] = vertex.place(tiles.width);
    transform.apply(col, row)
}

/// The vertices of an open line that stay, ends included. One from rim to rim may be part of a ring: its
/// lowest edge may be where that begins.
fn fixed_vertices(vertices: &[ContourVertex], rect: Rect, tiles: ContourTiles) -> Vec<usize> {
    let last = vertices.len() - 1;
    let mut fixed = vec![0, last];
    if fixed.iter().all(|&at| tiles.rim(rect, &vertices[at]).is_some()) {
        fixed.push(lowest(vertices));
        fixed.extend(turning_vertex(vertices, rect, tiles));
    }
    fixed.sort_unstable();
    fixed.dedup();
    fixed
}

/// The vertex that is farthest from the rim which a line comes from and goes back to, if it does.
fn turning_vertex(vertices: &[ContourVertex], rect: Rect, tiles: ContourTiles) -> Option<usize> {
    let rim = tiles.rim(rect, vertices.first()?)?;
    if tiles.rim(rect, vertices.last()?)? != rim {
        return None;
    }
    let (mut deepest, mut max_depth) = (0, 0.0);
    for (at, vertex) in vertices.iter().enumerate() {
        let depth = depth(rim, vertex.place(tiles.width), rect);
        if depth > max_depth {
            (deepest, max_depth) = (at, depth);
        }
    }
    (deepest > 0 && deepest + 1 < vertices.len()).then_some(deepest)
}

/// Distance of a position in a tile from one of its sides, in cells.
fn depth(side: TileEdge, [col, row]: [f64; 2], rect: Rect) -> f64 {
    match side {
        TileEdge::North => row - f64::from(rect.row),
        TileEdge::South => f64::from(rect.end_row() - 1) - row,
        TileEdge::West => col - f64::from(rect.col),
        TileEdge::East => f64::from(rect.end_col() - 1) - col,
    }
}
