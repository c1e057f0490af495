//! Heights of surfaces through all points, at positions in columns and rows.
//!
//! The triangle at a cell's centre is found without a triangulation: it is the optimal basis of a linear
//! programme with three rows, reached in about one pivot from the nearest points of the four quadrants
//! (`terrane_delaunay::TriangleFinder`). If its circle reaches into tiles with points that are not loaded,
//! these are loaded, too. So there is no fixed buffer, which would be wrong in wider voids.

use std::ops::Range;

use super::neighbourhood::SurroundingPoints;
use super::tile_store::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::{Point, PointFrame, REACH};
use terrane_delaunay::{ConvexHull, FixedPosition, Location, SiteWindow, interpolate};
use terrane_gridding::SurfaceInterpolation;
use terrane_gridding::pitfree::is_short;

/// Most points in memory for adjacent positions, unless a single one needs more.
pub(crate) const MAX_POINTS: u64 = 1 << 19;
/// The limit if all points are triangulated, which takes eight times the bytes.
const MAX_TRIANGULATED: u64 = 1 << 16;

/// The surface over the points of a store.
pub(crate) struct InterpolatedSurface<'a> {
    pub(crate) store: &'a PointStore,
    /// Hull of all points of the store.
    pub(crate) hull: &'a ConvexHull,
    pub(crate) frame: PointFrame,
    pub(crate) shape: SurfaceInterpolation,
}

/// Positions in columns and rows, in steps: a rectangle of them has one from each.
#[derive(Clone, Copy)]
pub(crate) struct ColumnRowPositions<'a> {
    /// Steps east of each column, rising.
    pub(crate) xs: &'a [f64],
    /// Steps north of each row, falling.
    pub(crate) ys: &'a [f64],
}

/// Some of the columns and rows.
#[derive(Clone)]
pub(crate) struct ColumnRowRange {
    pub(crate) cols: Range<usize>,
    pub(crate) rows: Range<usize>,
}

impl ColumnRowPositions<'_> {
    /// Divides the positions into parts with at most `max_points` points near each; calls back with each part and
    /// its window.
    pub(crate) fn in_parts(
        self,
        max_points: u64,
        points_near: impl Fn(SiteWindow) -> u64,
        mut each: impl FnMut(&ColumnRowRange, SiteWindow) -> Result<()>,
    ) -> Result<()> {
        let mut parts = vec![ColumnRowRange { cols: 0..self.xs.len(), rows: 0..self.ys.len() }];
        while let Some(part) = parts.pop() {
            let Some(window) = window(self, &part) else { continue };
            match part.halves() {
                Some(halves) if points_near(window) > max_points => parts.extend(halves),
                _ => each(&part, window)?,
            }
        }
        Ok(())
    }
}

impl ColumnRowRange {
    /// Two halves along the longer side, `None` for a single position.
    fn halves(&self) -> Option<[Self; 2]> {
        let Self { cols, rows } = self.clone();
        let [col, row] = [&cols, &rows].map(|range| range.start + range.len().div_ceil(2));
        if cols.len() >= rows.len() && cols.len() > 1 {
            let right = Self { cols: col..cols.end, rows: rows.clone() };
            return Some([Self { cols: cols.start..col, rows }, right]);
        }
        let below = Self { cols: cols.clone(), rows: row..rows.end };
        (rows.len() > 1).then_some([Self { cols, rows: rows.start..row }, below])
    }
}

impl InterpolatedSurface<'_> {
    /// World heights at the positions, row by row; NaN outside the surface. A value depends on the points and
    /// its position only.
    pub(crate) fn fill(&self, at: ColumnRowPositions<'_>, out: &mut [f64]) -> Result<()> {
        let max_points = match self.shape {
            SurfaceInterpolation::Linear { .. } => MAX_POINTS,
            SurfaceInterpolation::Natural => MAX_TRIANGULATED,
        };
        at.in_parts(
            max_points,
            |window| self.store.points_near(window),
            |part, window| self.fill_part(at, part, window, out),
        )
    }

    fn fill_part(
        &self,
        at: ColumnRowPositions<'_>,
        part: &ColumnRowRange,
        window: SiteWindow,
        out: &mut [f64],
    ) -> Result<()> {
        let mut around = SurroundingPoints::new(self.store, window.grown(self.margin()))?;
        let rows = part.rows.clone();
        let cells = rows.flat_map(|row| part.cols.clone().map(move |col| (col, row)));
        let positions =
            cells.clone().map(|(col, row)| FixedPosition::from_steps(at.xs[col], at.ys[row]));
        let mut places = cells.map(|(col, row)| row * at.xs.len() + col);
        match self.shape {
            SurfaceInterpolation::Linear { max_edge } => {
                let is_surface =
                    |corners: &[Point; 3]| has_short_edges(corners, &self.frame, max_edge);
                let take = |position: FixedPosition, location: Location| {
                    out[places.next().unwrap_or_default()] =
                        self.height(position, location, max_edge);
                };
                match self.longest() {
                    None => around.find_all_small(self.hull, positions, is_surface, take),
                    Some(longest) => {
                        let reach = reach(&self.frame, longest);
                        around.find_small(self.hull, positions, reach, is_surface, take)
                    }
                }
            }
            SurfaceInterpolation::Natural => {
                around.natural(self.hull, window, positions, |steps| {
                    out[places.next().unwrap_or_default()] =
                        steps.map_or(f64::NAN, |steps| self.world(steps));
                })
            }
        }
    }

    /// The longest valid edge, if longer ones can be rejected locally: with a part of the point cloud.
    fn longest(&self) -> Option<f64> {
        match self.shape {
            SurfaceInterpolation::Linear { max_edge } if self.store.limits.is_some() => max_edge,
            _ => None,
        }
    }

    /// Margin of the first window around the positions, in steps. With a part of the point cloud, it covers the
    /// longest valid edge, so that longer ones are rejected locally.
    fn margin(&self) -> i32 {
        self.longest().map_or(0, |longest| reach(&self.frame, longest))
    }

    fn world(&self, steps: f64) -> f64 {
        steps * self.frame.scale[2] + self.frame.offset[2]
    }

    fn height(&self, position: FixedPosition, location: Location, max_edge: Option<f64>) -> f64 {
        match location {
            Location::At(point) => self.world(f64::from(point.z)),
            Location::Triangle(corners) if has_short_edges(&corners, &self.frame, max_edge) => {
                self.world(interpolate(&corners, position))
            }
            Location::Triangle(_) | Location::Outside => f64::NAN,
        }
    }
}

/// Steps along a length in world units, at most, rounded up.
pub(crate) fn reach(frame: &PointFrame, length: f64) -> i32 {
    let [x, y, _] = frame.scale;
    (length / x.min(y)).ceil().min(f64::from(REACH)) as i32
}

/// Whether no edge of a triangle is longer than `max_edge` world units.
pub(crate) fn has_short_edges(
    corners: &[Point; 3],
    frame: &PointFrame,
    max_edge: Option<f64>,
) -> bool {
    let [x, y, _] = frame.scale;
    max_edge.is_none_or(|longest| is_short(corners, [x, y], longest))
}

/// The window of the positions of a part.
fn window(at: ColumnRowPositions<'_>, part: &ColumnRowRange) -> Option<SiteWindow> {
    let (xs, ys) = (at.xs.get(part.cols.clone())?, at.ys.get(part.rows.clone())?);
    let low = FixedPosition::from_steps(*xs.first()?, *ys.last()?).floor();
    let high = FixedPosition::from_steps(*xs.last()?, *ys.first()?).floor();
    Some(SiteWindow { low, high }.grown(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point_index::Tiling;

    const FRAME: PointFrame = PointFrame { scale: [0.01, 0.01, 0.001], offset: [0.0, 0.0, 5.0] };

    #[test]
    fn a_plane_is_reproduced_and_long_edges_are_no_surface() {
        let folder = tempfile::tempdir().unwrap();
        let point = |x: i32, y: i32| Point::new(x, y, 3 * x - 2 * y);
        let points: Vec<Point> = (0..50_i32)
            .flat_map(|i| (0..50_i32).map(move |j| (i * 97 + j % 7, j * 101 + i % 5)))
            .filter(|(x, y)| (x - 2400).pow(2) + (y - 2500).pow(2) > 1000 * 1000)
            .map(|(x, y)| point(x, y))
            .collect();
        let store = PointStore::empty(
            Tiling::new([point(0, 0), point(5000, 5000)], 400_000),
            folder.path(),
            1 << 20,
        );
        store.add(&points).unwrap();
        let hull = store.hull().unwrap();
        let xs: Vec<f64> = (0..60).map(|i| f64::from(i) * 100.0 - 500.0).collect();
        let ys: Vec<f64> = xs.iter().rev().copied().collect();
        let fill = |max_edge| {
            let shape = SurfaceInterpolation::Linear { max_edge };
            let linear = InterpolatedSurface { store: &store, hull: &hull, frame: FRAME, shape };
            let mut out = vec![0.0; 3600];
            linear.fill(ColumnRowPositions { xs: &xs, ys: &ys }, &mut out).unwrap();
            out
        };
        let (all, near) = (fill(None), fill(Some(3.0)));
        for (i, (all, near)) in all.iter().zip(&near).enumerate() {
            let (x, y) = (xs[i % 60], ys[i / 60]);
            let expected = (3.0 * x - 2.0 * y) * 0.001 + 5.0;
            assert!(all.is_nan() || (all - expected).abs() < 1e-9, "{all} {expected}");
            let in_void = (x - 2400.0).hypot(y - 2500.0) < 850.0;
            assert!(!(in_void && near.is_finite()) && (near.is_nan() || near == all));
        }
        let finite = |values: &[f64]| values.iter().filter(|v| v.is_finite()).count();
        assert!(finite(&all) > 2300 && finite(&near) + 200 < finite(&all));
    }
}
