//! Selection of vertices.
//!
//! First each region runs greedy insertion on its points and those around it, and keeps its own vertices. Then
//! the triangulation of all vertices is checked region by region, and points beyond the tolerance are inserted;
//! regions that see a change are checked again, until none finds a point. Each round is a function of the
//! vertices before it, so the result does not depend on the order of regions.
//!
//! Points to keep and the first posts of lines are vertices from the start; further posts are added in the same
//! rounds, where edges do not follow a line.

use std::ops::Range;
use std::sync::Mutex;

use super::context::CloudTinContext;
use super::region_mesh::RegionMesh;
use super::regions::CloudTinRegion;
use crate::point_index::{PointStore, Tiling};
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_delaunay::{ConvexHull, SiteWindow};
use terrane_files::lock;
use terrane_tin::scatter::{InsertUntilWithin, ScatterMesh};

/// Fraction of the side of a tile that the band of points around a region has in the first selection.
pub(super) const BAND: i32 = 4;

/// Result of the check of a region.
#[derive(Clone, Debug)]
pub(super) struct RegionInspection {
    /// New vertices: points and posts.
    pub(super) additions: Vec<Point>,
    /// Vertices on lines for which no edge can follow the line.
    apart: Vec<[i32; 2]>,
    /// The window in which a new vertex may change the result.
    pub(super) influence: SiteWindow,
    pub(super) errors: CloudTinErrors,
}

impl RegionInspection {
    /// The result of a region without new vertices and without lines.
    pub(super) fn settled(influence: SiteWindow, points: u64) -> Self {
        let errors = CloudTinErrors { points, ..CloudTinErrors::default() };
        Self { additions: Vec::new(), apart: Vec::new(), influence, errors }
    }
}

/// Distances of points from the surface, in steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CloudTinErrors {
    pub(super) max: f64,
    pub(super) squares: f64,
    pub(super) points: u64,
}

/// The selected vertices.
pub(super) struct ChosenVertices {
    pub(super) vertices: PointStore,
    pub(super) errors: CloudTinErrors,
    /// Vertices on lines without an edge along them, sorted.
    pub(super) apart: Vec<[i32; 2]>,
}

/// Selects the vertices for the tolerance (in steps of z); all points if it is 0. They include the corners of
/// the hull and the points of `required`.
pub(super) fn select(
    work: &CloudTinContext<'_>,
    tolerance: f64,
    hull: &[Point],
    required: &[Point],
) -> Result<ChosenVertices> {
    let post_bytes = match work.lines.is_empty() && required.is_empty() {
        true => 0,
        false => work.vertex_bytes / 4,
    };
    let [vertices, posts] = [work.vertex_bytes - post_bytes, post_bytes]
        .map(|bytes| PointStore::empty(*work.points.tiling(), work.folder, bytes));
    posts.add(required)?;
    insert_line_vertices(work, &posts)?;
    match tolerance == 0.0 {
        true => add_all(work.points, &vertices)?,
        false => {
            let all = 0..work.regions.all.len();
            select_first(work, all, tolerance, hull, &posts, &vertices)?;
        }
    }
    add_all(&posts, &vertices)?;
    drop(posts);
    let worklist = RegionWorklist::new(work.regions.all.len());
    let finished =
        worklist.run(&vertices, |due| inspect_all(work, &vertices, tolerance, hull, due))?;
    let (errors, apart) = finished.end(tolerance);
    Ok(ChosenVertices { vertices, errors, apart })
}

/// Adds the posts that every line has.
fn insert_line_vertices(work: &CloudTinContext<'_>, posts: &PointStore) -> Result<()> {
    if work.lines.is_empty() {
        return Ok(());
    }
    work.on_all(work.regions.all.len() as u64, |_, number| {
        let (number, region) = (number as usize, &work.regions.all[number as usize]);
        posts.add(&work.lines.of_region(number, work.points, region).line_vertices()?)
    })
}

fn add_all(from: &PointStore, to: &PointStore) -> Result<()> {
    let mut points = Vec::new();
    for square in (0..from.tiling().count()).filter(|&square| from.summary(square).is_some()) {
        from.load_distinct(square, &mut points)?;
        to.add(&points)?;
    }
    Ok(())
}

/// Adds the first vertices of some regions.
pub(super) fn select_first(
    work: &CloudTinContext<'_>,
    regions: Range<usize>,
    tolerance: f64,
    hull: &[Point],
    posts: &PointStore,
    vertices: &PointStore,
) -> Result<()> {
    let count = regions.len() as u64;
    work.progress.begin("choose", count);
    work.on_all(count, |_, number| {
        let region = regions.start + number as usize;
        let chosen = select_in_region(work, region, tolerance, hull, posts)?;
        work.progress.advance(1);
        vertices.add(&chosen)
    })?;
    work.progress.end();
    Ok(())
}

/// The first vertices of a region, from its points and those around it; includes those of the hull.
fn select_in_region(
    work: &CloudTinContext<'_>,
    number: usize,
    tolerance: f64,
    hull: &[Point],
    posts: &PointStore,
) -> Result<Vec<Point>> {
    let (store, region) = (work.points, &work.regions.all[number]);
    let tiling = store.tiling();
    let points = points_around(store, region)?;
    let is_own = |p: &Point| region.contains(tiling.tile_of([p.x, p.y]));
    let rim = ConvexHull::of(points.clone()).corners();
    let Some(mut mesh) = ScatterMesh::of_first(&rim) else {
        return Ok(points.into_iter().filter(is_own).collect());
    };
    for &point in rim.iter().chain(&points_around(posts, region)?) {
        mesh.insert(point);
    }
    InsertUntilWithin::new(&mut mesh, &points, tolerance).run();
    work.lines.of_region(number, store, region).follow(&mut mesh)?;
    let mut chosen: Vec<Point> = mesh.points().iter().chain(hull).copied().filter(is_own).collect();
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
}

/// The points of a region and of a band around it, tile by tile.
fn points_around(store: &PointStore, region: &CloudTinRegion) -> Result<Vec<Point>> {
    let near = region.window(store.tiling()).grown(store.tiling().side() / BAND);
    let (mut all, mut points) = (Vec::new(), Vec::new());
    for square in store.tiling().touching(near) {
        store.load_distinct(square, &mut points)?;
        all.extend(points.iter().filter(|p| near.contains([p.x, p.y])));
    }
    Ok(all)
}

/// Regions to check until no vertex is added.
pub(super) struct RegionWorklist {
    /// The last result of each region.
    inspections: Vec<RegionInspection>,
    /// Regions to check.
    due: Vec<usize>,
}

impl RegionWorklist {
    /// No region is checked yet.
    fn new(regions: usize) -> Self {
        Self {
            inspections: vec![RegionInspection::settled(SiteWindow::ALL, 0); regions],
            due: (0..regions).collect(),
        }
    }

    /// After a round that added vertices in some tiles.
    pub(super) fn after(
        inspections: Vec<RegionInspection>,
        changed: impl Iterator<Item = usize>,
        tiling: &Tiling,
    ) -> Self {
        let due = due(&inspections, changed, tiling);
        Self { inspections, due }
    }

    /// Adds vertices until every point is within the tolerance; `inspect` checks regions.
    pub(super) fn run(
        mut self,
        vertices: &PointStore,
        inspect: impl Fn(&[usize]) -> Result<Vec<(usize, RegionInspection)>>,
    ) -> Result<Self> {
        let tiling = vertices.tiling();
        while !self.due.is_empty() {
            let mut changed = Vec::new();
            for (region, mut inspection) in inspect(&self.due)? {
                let additions = std::mem::take(&mut inspection.additions);
                changed.extend(additions.iter().map(|point| tiling.square_of(*point)));
                vertices.add(&additions)?;
                self.inspections[region] = inspection;
            }
            self.due = due(&self.inspections, changed.into_iter(), tiling);
        }
        Ok(self)
    }

    /// The errors of all points, and the vertices on lines without an edge along them, sorted.
    pub(super) fn end(self, tolerance: f64) -> (CloudTinErrors, Vec<[i32; 2]>) {
        let mut errors = sum(&self.inspections);
        // It was rounded up, and all points are known to be within.
        errors.max = errors.max.min(tolerance);
        let mut apart: Vec<_> = self.inspections.into_iter().flat_map(|i| i.apart).collect();
        apart.sort_unstable();
        (errors, apart)
    }
}

/// The regions that see a changed tile.
pub(super) fn due(
    inspections: &[RegionInspection],
    changed: impl Iterator<Item = usize>,
    tiling: &Tiling,
) -> Vec<usize> {
    let changes = VertexChanges::of(changed, tiling);
    (0..inspections.len()).filter(|&i| changes.touch(inspections[i].influence, tiling)).collect()
}

/// Checks regions against the mesh of all vertices.
pub(super) fn inspect_all(
    work: &CloudTinContext<'_>,
    vertices: &PointStore,
    tolerance: f64,
    hull: &[Point],
    regions: &[usize],
) -> Result<Vec<(usize, RegionInspection)>> {
    work.progress.begin("prove", regions.len() as u64);
    let inspections = Mutex::new(Vec::with_capacity(regions.len()));
    work.on_all(regions.len() as u64, |_, number| {
        let region = regions[number as usize];
        let inspection = inspect(work, vertices, tolerance, hull, region)?;
        // In any order: vertices are sorted when they are loaded, and errors are summed by region.
        lock(&inspections).push((region, inspection));
        work.progress.advance(1);
        Ok(())
    })?;
    work.progress.end();
    Ok(std::mem::take(&mut *lock(&inspections)))
}

/// Checks a region, and finds the vertices that it lacks.
fn inspect(
    work: &CloudTinContext<'_>,
    vertices: &PointStore,
    tolerance: f64,
    hull: &[Point],
    number: usize,
) -> Result<RegionInspection> {
    let region = &work.regions.all[number];
    let mut local = RegionMesh::new(vertices, *region, hull)?;
    let influence = local.influence();
    let (mut points, mut square_points) = (Vec::new(), Vec::new());
    for square in region.squares(work.points.tiling()) {
        work.points.load_distinct(square, &mut square_points)?;
        points.extend_from_slice(&square_points);
    }
    let mut fit = InsertUntilWithin::new(&mut local.mesh, &points, tolerance);
    let (max, squares) = if work.measure { fit.measure() } else { (0.0, 0.0) };
    let mut additions = fit.run();
    let (posts, apart) =
        work.lines.of_region(number, work.points, region).follow(&mut local.mesh)?;
    additions.extend(posts);
    let errors = CloudTinErrors { max, squares, points: points.len() as u64 };
    Ok(RegionInspection { additions, apart, influence, errors })
}

fn sum(inspections: &[RegionInspection]) -> CloudTinErrors {
    inspections.iter().fold(CloudTinErrors::default(), |sum, RegionInspection { errors, .. }| {
        CloudTinErrors {
            max: sum.max.max(errors.max),
            squares: sum.squares + errors.squares,
            points: sum.points + errors.points,
        }
    })
}

/// Tiles with new vertices, summed from the south-west corner to each tile.
struct VertexChanges {
    sums: Vec<u32>,
    across: usize,
}

impl VertexChanges {
    fn of(changed: impl Iterator<Item = usize>, tiling: &Tiling) -> Self {
        let [cols, rows] = tiling.counts().map(|n| n as usize);
        let across = cols + 1;
        let mut sums = vec![0; across * (rows + 1)];
        for square in changed {
            let (col, row) = (square % cols, square / cols);
            sums[(row + 1) * across + col + 1] = 1;
        }
        for row in 1..=rows {
            for at in row * across + 1..(row + 1) * across {
                sums[at] = (sums[at] + sums[at - 1] + sums[at - across]) - sums[at - across - 1];
            }
        }
        Self { sums, across }
    }

    /// True if the window touches a changed tile.
    fn touch(&self, window: SiteWindow, tiling: &Tiling) -> bool {
        let [low, high] =
            [window.low, window.high].map(|at| tiling.tile_of(at).map(|n| n as usize));
        let (west, south, east, north) = (low[0], low[1], high[0] + 1, high[1] + 1);
        // Sums on both sides: the difference of unsigned numbers could go below 0 on the way.
        self.sum(east, north) + self.sum(west, south)
            > self.sum(west, north) + self.sum(east, south)
    }

    /// Number of changed tiles in the columns and rows before these.
    fn sum(&self, col: usize, row: usize) -> u32 {
        self.sums[row * self.across + col]
    }
}
