//! The points of a point cloud nearest to the positions to keep.

use std::collections::HashMap;

use crate::point_index::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_delaunay::{ConvexHull, FixedPosition, HullLocation, SiteWindow};

/// Tiles whose points are in memory at a time.
const MAX_LOADED: usize = 256;

/// Points to keep.
#[derive(Debug, Default)]
pub(super) struct ConstraintPoints {
    /// Sorted, each once.
    pub(super) points: Vec<Point>,
    /// Positions beyond the hull.
    pub(super) beyond: u64,
}

/// The point of the store nearest to each position (in steps, sorted) inside its hull; the lowest of equally
/// near ones.
pub(super) fn nearest(
    store: &PointStore,
    hull: &ConvexHull,
    mut positions: Vec<[i32; 2]>,
) -> Result<ConstraintPoints> {
    let (mut constraints, mut search) =
        (ConstraintPoints::default(), NearestPointSearch { store, loaded: HashMap::new() });
    let count = positions.len();
    positions.retain(|&at| hull.locate(FixedPosition::of(at)) != HullLocation::Outside);
    constraints.beyond = (count - positions.len()) as u64;
    positions.dedup();
    let tiling = store.tiling();
    positions.sort_by_key(|&[x, y]| tiling.square_of(Point::new(x, y, 0)));
    for at in positions {
        constraints.points.extend(search.nearest(at)?);
    }
    constraints.points.sort_unstable();
    constraints.points.dedup();
    Ok(constraints)
}

struct NearestPointSearch<'a> {
    store: &'a PointStore,
    loaded: HashMap<usize, Vec<Point>>,
}

impl NearestPointSearch<'_> {
    /// Searches tiles by increasing distance.
    fn nearest(&mut self, at: [i32; 2]) -> Result<Option<Point>> {
        let tiling = *self.store.tiling();
        let counts = tiling.counts().map(i64::from);
        let [col, row] = tiling.tile_of(at).map(i64::from);
        let mut best: Option<(i64, Point)> = None;
        for ring in 0..counts[0].max(counts[1]) {
            // The position may lie anywhere in its tile: a ring is at least one side less away than its number.
            let min_distance = (ring - 1).max(0) * i64::from(tiling.side());
            if best.is_some_and(|(far, _)| min_distance * min_distance > far) {
                break;
            }
            for (dx, dy) in around(ring) {
                let place = [col + dx, row + dy];
                if !(0..2).all(|axis| (0..counts[axis]).contains(&place[axis])) {
                    continue;
                }
                let square = tiling.square(place.map(|n| n as u32));
                let Some(summary) = self.store.summary(square) else { continue };
                if best.is_none_or(|(far, _)| gap(at, summary.window) <= far) {
                    let points = self.points_of(square)?.iter();
                    let here = points.map(|&point| (far(at, [point.x, point.y]), point)).min();
                    best = best.into_iter().chain(here).min();
                }
            }
        }
        Ok(best.map(|(_, point)| point))
    }

    fn points_of(&mut self, square: usize) -> Result<&[Point]> {
        if self.loaded.len() >= MAX_LOADED && !self.loaded.contains_key(&square) {
            self.loaded.clear();
        }
        if !self.loaded.contains_key(&square) {
            let mut points = Vec::new();
            self.store.load_distinct(square, &mut points)?;
            self.loaded.insert(square, points);
        }
        Ok(&self.loaded[&square])
    }
}

/// Tiles on a ring at this distance in columns or rows.
fn around(ring: i64) -> impl Iterator<Item = (i64, i64)> {
    (-ring..=ring).flat_map(move |dy| {
        let step = if dy.abs() == ring { 1 } else { (2 * ring).max(1) };
        (-ring..=ring).step_by(step as usize).map(move |dx| (dx, dy))
    })
}

/// The squared distance of two positions.
fn far(a: [i32; 2], b: [i32; 2]) -> i64 {
    let [dx, dy] = [0, 1].map(|axis| i64::from(a[axis]) - i64::from(b[axis]));
    dx * dx + dy * dy
}

/// The squared distance of a position and a window.
fn gap(at: [i32; 2], window: SiteWindow) -> i64 {
    let inside = [0, 1].map(|axis| at[axis].clamp(window.low[axis], window.high[axis]));
    far(at, inside)
}
