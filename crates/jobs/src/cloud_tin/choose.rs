//! Which points become vertices.
//!
//! First each region by itself, with the points around it: greedy insertion, of which it keeps the
//! vertices of its own. Then the triangulation of all vertices is looked at, region by region, and
//! points beyond the tolerance are inserted; where that changed anything, the regions that see it look
//! again, until none finds a point. Each round is a function of the vertices before it, so the order
//! of regions leaves no trace.

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
    /// Points to become vertices.
    open: Vec<Point>,
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

/// Chooses the vertices for the tolerance (in steps of z). The hull's corners are among them.
pub(super) fn choose(
    work: &Work<'_>,
    tolerance: f64,
    hull: &[Point],
) -> Result<(PointStore, Errors)> {
    let vertices = PointStore::empty(*work.points.tiling(), work.folder, work.vertex_bytes);
    first_choice(work, tolerance, hull, &vertices)?;
    let mut errors = settle(work, tolerance, hull, &vertices)?;
    // It was rounded up, and all points are known to be within.
    errors.most = errors.most.min(tolerance);
    Ok((vertices, errors))
}

fn first_choice(
    work: &Work<'_>,
    tolerance: f64,
    hull: &[Point],
    vertices: &PointStore,
) -> Result<()> {
    work.progress.begin("choose", work.regions.all.len() as u64);
    let choose = |_: &mut (), number: u64| {
        let region = work.regions.all[number as usize];
        let chosen = choose_in(work.points, &region, tolerance, hull)?;
        work.progress.advance(1);
        vertices.add(&chosen)
    };
    work.on_all(work.regions.all.len() as u64, choose)?;
    work.progress.end();
    Ok(())
}

/// The vertices that a region chooses with the points around it, those of the hull among them.
fn choose_in(
    store: &PointStore,
    region: &Region,
    tolerance: f64,
    hull: &[Point],
) -> Result<Vec<Point>> {
    let tiling = store.tiling();
    let points = points_around(store, region)?;
    let is_own = |p: &Point| contains(region, tiling, *p);
    let rim = Hull::of(points.clone()).corners();
    let Some(mut mesh) = Mesh::of_first(&rim) else {
        return Ok(points.into_iter().filter(is_own).collect());
    };
    rim.iter().for_each(|&point| {
        mesh.insert(point);
    });
    Fit::new(&mut mesh, &points, tolerance).run();
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
) -> Result<Errors> {
    let unseen = Look { open: Vec::new(), influence: Window::ALL, errors: Errors::default() };
    let mut looks = vec![unseen; work.regions.all.len()];
    let mut due: Vec<usize> = (0..looks.len()).collect();
    while !due.is_empty() {
        work.progress.begin("prove", due.len() as u64);
        let found = Mutex::new(Vec::new());
        let look = |_: &mut (), number: u64| {
            let region = due[number as usize];
            let look = look_at(work, vertices, tolerance, hull, &work.regions.all[region])?;
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
    Ok(sum(&looks))
}

fn look_at(
    work: &Work<'_>,
    vertices: &PointStore,
    tolerance: f64,
    hull: &[Point],
    region: &Region,
) -> Result<Look> {
    let mut local = RegionMesh::new(vertices, *region, hull)?;
    let influence = local.influence();
    let (mut points, mut square_points) = (Vec::new(), Vec::new());
    for square in region.squares(work.points.tiling()) {
        work.points.load_distinct(square, &mut square_points)?;
        points.extend_from_slice(&square_points);
    }
    let mut fit = Fit::new(&mut local.mesh, &points, tolerance);
    let (most, squares) = if work.measure { fit.measure() } else { (0.0, 0.0) };
    let open = fit.run();
    let errors = Errors { most, squares, points: points.len() as u64 };
    Ok(Look { open, influence, errors })
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
