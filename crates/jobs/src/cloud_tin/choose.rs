//! Which points become vertices.
//!
//! First each region by itself, with the points around it: greedy insertion, of which it keeps the
//! vertices of its own. Then the triangulation of all vertices is looked at, region by region, and
//! points beyond the tolerance are inserted; where that changed anything, the regions that see it look
//! again, until none finds a point. Each round is a function of the vertices before it, so the order
//! of regions leaves no trace.
//!
//! Points to keep and the first posts of lines are vertices before any are chosen; further posts come in the same
//! rounds, where edges do not follow a line.

use std::sync::Mutex;

use super::Work;
use super::region_mesh::RegionMesh;
use super::regions::Region;
use crate::points::{PointStore, Tiling};
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_delaunay::{Hull, Window};
use terrane_files::lock;
use terrane_tin::scatter::{Fit, Mesh};

/// The band of points around a region that its first choice looks at: the side of a square over this.
const BAND: i32 = 4;

/// What a region found when it looked at the mesh.
#[derive(Clone, Debug)]
struct Look {
    /// Points and posts to become vertices.
    open: Vec<Point>,
    /// Vertices from which no edge follows a line, and never will.
    apart: Vec<[i32; 2]>,
    /// The part of the plane in which a new vertex may change what was seen.
    influence: Window,
    errors: Errors,
}

/// Distances of points from the surface, in steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    pub(super) most: f64,
    pub(super) squares: f64,
    pub(super) points: u64,
}

/// What was chosen.
pub(super) struct Chosen {
    pub(super) vertices: PointStore,
    pub(super) errors: Errors,
    /// Vertices on lines without an edge that goes on, in order.
    pub(super) apart: Vec<[i32; 2]>,
}

/// Chooses the vertices for the tolerance (in steps of z), all points where that is 0. The hull's corners are among
/// them, and so are the points of `kept`.
pub(super) fn choose(
    work: &Work<'_>,
    tolerance: f64,
    hull: &[Point],
    kept: &[Point],
) -> Result<Chosen> {
    let empty = |bytes| PointStore::empty(*work.points.tiling(), work.folder, bytes);
    let of_posts = match work.lines.is_empty() && kept.is_empty() {
        true => 0,
        false => work.vertex_bytes / 4,
    };
    let (vertices, posts) = (empty(work.vertex_bytes - of_posts), empty(of_posts));
    posts.add(kept)?;
    first_posts(work, &posts)?;
    match tolerance == 0.0 {
        true => take_all(work, &vertices)?,
        false => first_choice(work, tolerance, hull, &posts, &vertices)?,
    }
    add_all(&posts, &vertices)?;
    drop(posts);
    let (mut errors, mut apart) = settle(work, tolerance, hull, &vertices)?;
    // It was rounded up, and all points are known to be within.
    errors.most = errors.most.min(tolerance);
    apart.sort_unstable();
    Ok(Chosen { vertices, errors, apart })
}

/// Puts the posts there that every line has.
fn first_posts(work: &Work<'_>, posts: &PointStore) -> Result<()> {
    if work.lines.is_empty() {
        return Ok(());
    }
    work.on_all(work.regions.all.len() as u64, |_, number| {
        let (number, region) = (number as usize, &work.regions.all[number as usize]);
        posts.add(&work.lines.of_region(number, work.points, region).first_posts()?)
    })
}

/// Makes all points vertices.
fn take_all(work: &Work<'_>, vertices: &PointStore) -> Result<()> {
    add_all(work.points, vertices)
}

fn add_all(from: &PointStore, to: &PointStore) -> Result<()> {
    let mut points = Vec::new();
    for square in (0..from.tiling().count()).filter(|&square| from.summary(square).is_some()) {
        from.load_distinct(square, &mut points)?;
        to.add(&points)?;
    }
    Ok(())
}

fn first_choice(
    work: &Work<'_>,
    tolerance: f64,
    hull: &[Point],
    posts: &PointStore,
    vertices: &PointStore,
) -> Result<()> {
    work.progress.begin("choose", work.regions.all.len() as u64);
    let choose = |_: &mut (), number: u64| {
        let chosen = choose_in(work, number as usize, tolerance, hull, posts)?;
        work.progress.advance(1);
        vertices.add(&chosen)
    };
    work.on_all(work.regions.all.len() as u64, choose)?;
    work.progress.end();
    Ok(())
}

/// The vertices that a region chooses with the points around it, those of the hull among them.
fn choose_in(
    work: &Work<'_>,
    number: usize,
    tolerance: f64,
    hull: &[Point],
    posts: &PointStore,
) -> Result<Vec<Point>> {
    let (store, region) = (work.points, &work.regions.all[number]);
    let tiling = store.tiling();
    let points = points_around(store, region)?;
    let is_own = |p: &Point| contains(region, tiling, *p);
    let rim = Hull::of(points.clone()).corners();
    let Some(mut mesh) = Mesh::of_first(&rim) else {
        return Ok(points.into_iter().filter(is_own).collect());
    };
    for &point in rim.iter().chain(&points_around(posts, region)?) {
        mesh.insert(point);
    }
    Fit::new(&mut mesh, &points, tolerance).run();
    work.lines.of_region(number, store, region).follow(&mut mesh)?;
    let mut chosen: Vec<Point> = mesh.points().iter().chain(hull).copied().filter(is_own).collect();
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
}

/// The points of a region and of a band around it, square by square.
fn points_around(store: &PointStore, region: &Region) -> Result<Vec<Point>> {
    let near = region.window(store.tiling()).grown(store.tiling().side() / BAND);
    let (mut all, mut points) = (Vec::new(), Vec::new());
    for square in store.tiling().touching(near) {
        store.load_distinct(square, &mut points)?;
        all.extend(points.iter().filter(|p| near.contains([p.x, p.y])));
    }
    Ok(all)
}

fn contains(region: &Region, tiling: &Tiling, point: Point) -> bool {
    let place = tiling.place([point.x, point.y]);
    (0..2).all(|axis| region.low[axis] <= place[axis] && place[axis] < region.end[axis])
}

/// Adds vertices until every point is within the tolerance.
fn settle(
    work: &Work<'_>,
    tolerance: f64,
    hull: &[Point],
    vertices: &PointStore,
) -> Result<(Errors, Vec<[i32; 2]>)> {
    let unseen = Look {
        open: Vec::new(),
        apart: Vec::new(),
        influence: Window::ALL,
        errors: Errors::default(),
    };
    let mut looks = vec![unseen; work.regions.all.len()];
    let mut due: Vec<usize> = (0..looks.len()).collect();
    while !due.is_empty() {
        work.progress.begin("prove", due.len() as u64);
        let found = Mutex::new(Vec::new());
        let look = |_: &mut (), number: u64| {
            let region = due[number as usize];
            let look = look_at(work, vertices, tolerance, hull, region)?;
            lock(&found).push((region, look));
            work.progress.advance(1);
            Ok(())
        };
        work.on_all(due.len() as u64, look)?;
        work.progress.end();
        let found = std::mem::take(&mut *lock(&found));
        found.into_iter().for_each(|(region, look)| looks[region] = look);
        let changes = Changes::of(&looks, vertices.tiling());
        for look in &mut looks {
            vertices.add(&std::mem::take(&mut look.open))?;
        }
        due = (0..looks.len())
            .filter(|&i| changes.touch(looks[i].influence, vertices.tiling()))
            .collect();
    }
    let errors = sum(&looks);
    Ok((errors, looks.into_iter().flat_map(|look| look.apart).collect()))
}

fn look_at(
    work: &Work<'_>,
    vertices: &PointStore,
    tolerance: f64,
    hull: &[Point],
    number: usize,
) -> Result<Look> {
    let region = &work.regions.all[number];
    let mut local = RegionMesh::new(vertices, *region, hull)?;
    let influence = local.influence();
    let (mut points, mut square_points) = (Vec::new(), Vec::new());
    for square in region.squares(work.points.tiling()) {
        work.points.load_distinct(square, &mut square_points)?;
        points.extend_from_slice(&square_points);
    }
    let mut fit = Fit::new(&mut local.mesh, &points, tolerance);
    let (most, squares) = if work.measure { fit.measure() } else { (0.0, 0.0) };
    let mut open = fit.run();
    let (posts, apart) =
        work.lines.of_region(number, work.points, region).follow(&mut local.mesh)?;
    open.extend(posts);
    let errors = Errors { most, squares, points: points.len() as u64 };
    Ok(Look { open, apart, influence, errors })
}

fn sum(looks: &[Look]) -> Errors {
    looks.iter().fold(Errors::default(), |sum, Look { errors, .. }| Errors {
        most: sum.most.max(errors.most),
        squares: sum.squares + errors.squares,
        points: sum.points + errors.points,
    })
}

/// Squares with new vertices, summed from the south-west corner to each square.
struct Changes {
    sums: Vec<u32>,
    across: usize,
}

impl Changes {
    fn of(looks: &[Look], tiling: &Tiling) -> Self {
        let [cols, rows] = tiling.counts().map(|n| n as usize);
        let across = cols + 1;
        let mut sums = vec![0; across * (rows + 1)];
        for point in looks.iter().flat_map(|look| &look.open) {
            let [col, row] = tiling.place([point.x, point.y]);
            sums[(row as usize + 1) * across + col as usize + 1] = 1;
        }
        for row in 1..=rows {
            for at in row * across + 1..(row + 1) * across {
                sums[at] = (sums[at] + sums[at - 1] + sums[at - across]) - sums[at - across - 1];
            }
        }
        Self { sums, across }
    }

    /// True when a square that the window touches has changed.
    fn touch(&self, window: Window, tiling: &Tiling) -> bool {
        let [low, high] = [window.low, window.high].map(|at| tiling.place(at).map(|n| n as usize));
        let sum = |col: usize, row: usize| self.sums[row * self.across + col];
        let (west, south, east, north) = (low[0], low[1], high[0] + 1, high[1] + 1);
        sum(east, north) + sum(west, south) > sum(west, north) + sum(east, south)
    }
}
