//! Lines that edges follow: their steps over the point cloud, their pieces by region, and the heights of their
//! posts.
//!
//! A line is a path of steps of the frame ([`terrane_tin::scatter::ClippedSegments`]) as far as it is in the
//! convex hull of the points, and its *posts* are vertices that need not be points. So lines keep their
//! positions, and edges along them are computed in integers, region by region. The posts at ends, at crossings
//! and where a line enters a region are vertices from the start; the next region continues there.
//!
//! The height of a post depends on its position only: that of the point there, if there is one (to keep its
//! error within the tolerance); else the lowest height of the lines through it; else, if these lack heights,
//! that of the triangulation of all points.

use std::collections::HashMap;

use super::regions::{CloudTinRegion, CloudTinRegions};
use crate::point_index::{PointStore, SurroundingPoints, Tiling};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Point, SampleSegment};
use terrane_delaunay::{
    ConvexHull, FixedPosition, HullLocation, Location, SiteWindow, interpolate,
};
use terrane_engine::cloud_constraints::{LatticeLine, OnCloud};
use terrane_tin::scatter::{ClippedSegment, ClippedSegments, ScatterMesh};

type Site = [i32; 2];

/// Most positions in a region where lines cross.
const MAX_CROSSINGS: usize = 1 << 19;
/// No step.
const NONE: u32 = u32::MAX;

/// The steps of a line in a region that start and end in the hull.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct CloudLinePiece {
    region: u32,
    line: u32,
    from: u32,
    to: u32,
    /// Where the next piece of the line begins.
    next: u32,
    /// Where the last one ends.
    last: u32,
}

impl CloudLinePiece {
    /// Bytes of a piece and of the lists of a worker for it, posts included.
    const BYTES: u64 = 1 << 10;
}

/// All lines over a cloud.
pub(super) struct CloudLines<'a> {
    lines: &'a [LatticeLine],
    /// Origin of the lattice of the lines.
    low: [i64; 2],
    hull: ConvexHull,
    /// First and last step in the hull.
    spans: Vec<Option<[u32; 2]>>,
    /// Sorted.
    pieces: Vec<CloudLinePiece>,
}

impl<'a> CloudLines<'a> {
    /// The lines of `constraints` over the points of a store.
    pub(super) fn new(constraints: &'a OnCloud, hull: ConvexHull, tiling: &Tiling) -> Self {
        let low = tiling.window().low.map(i64::from);
        let outline = HullOutline::of(&hull);
        let mut lines =
            Self { lines: &constraints.lines, low, hull, spans: Vec::new(), pieces: Vec::new() };
        lines.spans =
            (0..lines.lines.len()).map(|line| lines.span(&lines.segment(line), &outline)).collect();
        lines
    }

    /// True for a line without a step over the point cloud.
    pub(super) fn is_outside(&self, line: usize) -> bool {
        self.spans[line].is_none()
    }

    /// True if there are no lines.
    pub(super) fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&self.spans[..]) + size_of_val(&self.pieces[..])) as u64
    }

    fn segment(&self, line: usize) -> SampleSegment {
        let [a, b] =
            self.lines[line].ends.map(|end| [0, 1].map(|i| i64::from(end[i]) + self.low[i]));
        SampleSegment::new(a, b)
    }

    fn is_inside(&self, site: Site) -> bool {
        self.hull.locate(FixedPosition::of(site)) != HullLocation::Outside
    }

    /// The first and the last step in the hull. Skips steps that must be outside because the previous one is
    /// far from the hull.
    fn span(&self, segment: &SampleSegment, outline: &HullOutline) -> Option<[u32; 2]> {
        let all = segment.steps();
        let (mut first, mut last) = (0, all);
        while !self.is_inside(site(segment, first)) {
            first += outline.steps_to(site(segment, first));
            if first > all {
                return None;
            }
        }
        while !self.is_inside(site(segment, last)) {
            last = last.checked_sub(outline.steps_to(site(segment, last)))?;
        }
        Some([first as u32, last as u32])
    }

    /// Number of line pieces in each tile.
    pub(super) fn by_square(&self, tiling: &Tiling) -> Vec<u32> {
        let mut counts = vec![0_u32; tiling.count()];
        for line in 0..self.lines.len() {
            self.each_window(
                line,
                tiling,
                |square| tiling.window_of(square),
                |square, _| counts[square] = counts[square].saturating_add(1),
            );
        }
        counts
    }

    /// Divides the lines among regions.
    pub(super) fn divide(&mut self, regions: &CloudTinRegions, tiling: &Tiling) {
        let mut pieces = Vec::new();
        for line in 0..self.lines.len() {
            let (segment, first) = (self.segment(line), pieces.len());
            self.each_window(
                line,
                tiling,
                |square| regions.all[regions.of(square)].window(tiling),
                |square, steps| {
                    let ends = self.ends_inside(&segment, steps);
                    pieces.extend(ends.map(|[from, to]| CloudLinePiece {
                        region: regions.of(square) as u32,
                        line: line as u32,
                        from,
                        to,
                        next: NONE,
                        last: NONE,
                    }));
                },
            );
            let (mut next, last) =
                (NONE, pieces.last().map_or(NONE, |piece: &CloudLinePiece| piece.to));
            for piece in pieces[first..].iter_mut().rev() {
                (piece.next, piece.last) = (next, last);
                next = piece.from;
            }
        }
        pieces.sort_unstable();
        self.pieces = pieces;
    }

    /// The first and the last step in the hull, of those from one step to another.
    fn ends_inside(&self, segment: &SampleSegment, [from, to]: [u32; 2]) -> Option<[u32; 2]> {
        let is_inside = |step: &u32| self.is_inside(site(segment, u64::from(*step)));
        Some([(from..=to).find(is_inside)?, (from..=to).rev().find(is_inside)?])
    }

    /// Calls `each` with the steps of a line in each window it enters; the window of a tile is part of one.
    fn each_window(
        &self,
        line: usize,
        tiling: &Tiling,
        window: impl Fn(usize) -> SiteWindow,
        mut each: impl FnMut(usize, [u32; 2]),
    ) {
        let Some([first, last]) = self.spans[line] else { return };
        let (segment, mut step) = (self.segment(line), u64::from(first));
        while step <= u64::from(last) {
            let at = site(&segment, step);
            let square = tiling.square_of(Point::new(at[0], at[1], 0));
            let SiteWindow { low, high } = window(square);
            let steps = segment.within(low.map(i64::from), high.map(i64::from));
            let end = steps.map_or(step, |steps| *steps.end()).min(u64::from(last));
            each(square, [step as u32, end as u32]);
            step = end + 1;
        }
    }

    /// The most bytes that a worker takes for the lines of a region.
    pub(super) fn max_bytes(&self) -> u64 {
        let of_region = self.pieces.chunk_by(|a, b| a.region == b.region);
        of_region.map(|pieces| pieces.len() as u64).max().unwrap_or(0) * CloudLinePiece::BYTES
    }

    /// The lines of a region; `points` are those of the region.
    pub(super) fn of_region(
        &self,
        number: usize,
        store: &'a PointStore,
        region: &CloudTinRegion,
    ) -> RegionLines<'_> {
        let number = number as u32;
        let from = self.pieces.partition_point(|piece| piece.region < number);
        let pieces = &self.pieces[from..];
        let pieces = &pieces[..pieces.partition_point(|piece| piece.region == number)];
        let courses = pieces.iter().map(|piece| ClippedSegment {
            segment: self.segment(piece.line as usize),
            from: piece.from.into(),
            to: piece.to.into(),
            next: (piece.next != NONE).then_some(piece.next.into()),
            last: piece.last.into(),
        });
        let window = region.window(store.tiling());
        let courses = ClippedSegments::new(courses.collect());
        RegionLines {
            lines: self,
            pieces,
            courses,
            store,
            around: None,
            loaded: HashMap::new(),
            window,
        }
    }
}

fn site(segment: &SampleSegment, step: u64) -> Site {
    segment.at(step).map(|steps| steps as i32)
}

/// The sides of a hull.
struct HullOutline(Vec<HullSide>);

/// A side of a hull: a corner, and the direction outward, of length 1.
struct HullSide {
    corner: Site,
    outward: [f64; 2],
}

impl HullSide {
    fn between(a: &Point, b: &Point) -> Self {
        let [dx, dy] = [f64::from(b.x) - f64::from(a.x), f64::from(b.y) - f64::from(a.y)];
        let length = (dx * dx + dy * dy).sqrt();
        Self { corner: [a.x, a.y], outward: [dy / length, -dx / length] }
    }

    /// Distance of a position beyond the side; negative inside of it.
    fn distance(&self, at: Site) -> f64 {
        let [dx, dy] = [0, 1].map(|i| f64::from(at[i]) - f64::from(self.corner[i]));
        dx * self.outward[0] + dy * self.outward[1]
    }
}

impl HullOutline {
    fn of(hull: &ConvexHull) -> Self {
        let corners = hull.corners();
        let next = corners.iter().cycle().skip(1);
        Self(corners.iter().zip(next).map(|(a, b)| HullSide::between(a, b)).collect())
    }

    /// Lower bound of the number of steps from outside to the hull, at least 1.
    fn steps_to(&self, at: Site) -> u64 {
        let distance = self.0.iter().map(|side| side.distance(at)).fold(0.0, f64::max);
        // Reduced by more than the rounding errors: a step too many would skip the hull.
        ((distance * (1.0 - 1e-9) - 1e-6) as u64).max(1)
    }
}

/// The lines of a region.
pub(super) struct RegionLines<'a> {
    lines: &'a CloudLines<'a>,
    pieces: &'a [CloudLinePiece],
    courses: ClippedSegments,
    store: &'a PointStore,
    /// All nearby points, loaded when a height needs them.
    around: Option<SurroundingPoints<'a>>,
    /// Points by tile.
    loaded: HashMap<usize, Vec<Point>>,
    window: SiteWindow,
}

impl RegionLines<'_> {
    /// The posts that are vertices from the start.
    pub(super) fn line_vertices(&mut self) -> Result<Vec<Point>> {
        if self.pieces.is_empty() {
            return Ok(Vec::new());
        }
        let mut sites = self.courses.crossings(MAX_CROSSINGS).ok_or_else(|| {
            Error::new(ErrorKind::Resource, "the lines have too many crossings")
                .remedy("remove overlapping lines")
        })?;
        sites.retain(|&site| self.lines.is_inside(site));
        for piece in self.pieces {
            let segment = self.lines.segment(piece.line as usize);
            sites.push(site(&segment, piece.from.into()));
            sites.extend((piece.to == piece.last).then(|| site(&segment, piece.to.into())));
        }
        sites.sort_unstable();
        sites.dedup();
        self.raise(&sites)
    }

    /// Adds posts to a mesh until edges follow the lines of the region, as far as possible. Returns the posts,
    /// and vertices without an edge along a line.
    pub(super) fn follow(&mut self, mesh: &mut ScatterMesh) -> Result<(Vec<Point>, Vec<Site>)> {
        let mut posts = Vec::new();
        if self.pieces.is_empty() {
            return Ok((posts, Vec::new()));
        }
        loop {
            let gaps = self.courses.gaps(mesh, |site| self.lines.is_inside(site));
            let more = self.raise(&gaps.posts)?;
            let before = posts.len();
            posts.extend(more.into_iter().filter(|&post| mesh.insert(post).is_some()));
            if posts.len() == before {
                return Ok((posts, gaps.apart));
            }
        }
    }

    /// Posts at these positions.
    fn raise(&mut self, sites: &[Site]) -> Result<Vec<Point>> {
        let (mut posts, mut bare) = (Vec::with_capacity(sites.len()), Vec::new());
        for &site in sites {
            let height = match self.point_at(site)? {
                Some(point) => Some(point.z),
                None => self.height_of_lines(site),
            };
            match height {
                Some(z) => posts.push(Point::new(site[0], site[1], z)),
                None => bare.push(site),
            }
        }
        if !bare.is_empty() {
            self.raise_bare(&bare, &mut posts)?;
            posts.sort_unstable();
        }
        Ok(posts)
    }

    /// The lowest point at a position.
    fn point_at(&mut self, site: Site) -> Result<Option<Point>> {
        let square = self.store.tiling().square_of(Point::new(site[0], site[1], 0));
        if !self.loaded.contains_key(&square) {
            let mut points = Vec::new();
            self.store.load_distinct(square, &mut points)?;
            self.loaded.insert(square, points);
        }
        let points = &self.loaded[&square];
        let found = points.binary_search_by_key(&site, |point| [point.x, point.y]);
        Ok(found.ok().map(|at| points[at]))
    }

    /// The lowest height of lines at a position.
    fn height_of_lines(&self, site: Site) -> Option<i32> {
        let heights = self.courses.at(site).filter_map(|(course, step)| {
            let line = self.pieces[course as usize].line as usize;
            let [from, to] = self.lines.lines[line].heights?;
            Some(along([from, to], step, self.lines.segment(line).steps()))
        });
        heights.min()
    }

    /// Adds posts on the triangulation of all points.
    fn raise_bare(&mut self, sites: &[Site], posts: &mut Vec<Point>) -> Result<()> {
        if self.around.is_none() {
            self.around = Some(SurroundingPoints::new(self.store, self.window)?);
        }
        let Some(around) = &mut self.around else { return Ok(()) };
        let (mut rest, before) = (sites.iter(), posts.len());
        let positions = sites.iter().map(|&site| FixedPosition::of(site));
        around.find_all(&self.lines.hull, positions, |position, location| {
            let Some(&[x, y]) = rest.next() else { return };
            let height = match location {
                Location::At(point) => Some(point.z),
                Location::Triangle(corners) => {
                    Some((interpolate(&corners, position) + 0.5).floor() as i32)
                }
                Location::Outside => None,
            };
            posts.extend(height.map(|z| Point::new(x, y, z)));
        })?;
        match posts.len() - before == sites.len() {
            true => Ok(()),
            false => Err(Error::new(ErrorKind::Internal, "a post lies on no triangle")),
        }
    }
}

/// The height after `step` of `steps` on a path, rounded half up.
fn along([from, to]: [i32; 2], step: u64, steps: u64) -> i32 {
    if steps == 0 {
        return from.min(to);
    }
    let (rise, steps) = (i128::from(to) - i128::from(from), i128::from(steps));
    // Rounded down after adding a half: a line from the other end has the same heights.
    let gone = (2 * rise * i128::from(step) + steps).div_euclid(2 * steps);
    (i128::from(from) + gone) as i32
}
