//! Samples of each water body.

use std::ops::ControlFlow;

use super::{Water, Xy};
use crate::GridInfo;
use crate::clip::{ClipRings, Labelled, PolygonEdgeIndex, PolygonScan, join};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Ends, Paths, Rect, cut};

/// Sample coordinates: x is the column, y is the row.
const SAMPLES: Affine = Affine { x0: 0.0, a: 1.0, b: 0.0, y0: 0.0, d: 0.0, e: 1.0 };

/// Water on a grid.
#[derive(Debug)]
pub(super) struct WaterMask {
    size: [u32; 2],
    /// Polygons with their corners snapped to samples.
    inside: PolygonEdgeIndex,
    /// Body of each polygon.
    body_of: Vec<u32>,
    bodies: Vec<WaterBody>,
}

/// A water body on the grid.
#[derive(Clone, Debug, Default)]
struct WaterBody {
    sides: Paths,
    /// Minimum and maximum column and row.
    bounds: Option<Ends>,
}

impl WaterMask {
    /// The water of a file on a grid. O(n log n) for n edges.
    ///
    /// # Errors
    /// Another CRS; no polygon on the grid; coordinates outside the range of exact predicates.
    pub(super) fn new(water: &Water, grid: &GridInfo) -> Result<Self> {
        let of_file = |e: Error| e.in_file(&water.path);
        grid.crs.check_same(&water.crs, "water").map_err(of_file)?;
        let size = [grid.width, grid.height];
        let mut inside = ClipRings::default();
        let mut bodies = vec![WaterBody::default(); water.bodies.len()];
        let mut sides = vec![Vec::new(); bodies.len()];
        let mut features = 0;
        for (area, ring) in water.features.rings() {
            while features <= area {
                inside.begin_feature()?;
                features += 1;
            }
            let at: Vec<_> = ring.iter().map(|&[x, y]| grid.transform.invert(x, y)).collect();
            let body = water.body_of[area as usize] as usize;
            let corners = corners(&at, size, &mut sides[body]);
            inside.push(&corners).map_err(of_file)?;
            bodies[body].grow(&corners, size);
        }
        if bodies.iter().all(|body| body.bounds.is_none()) {
            return Err(of_file(
                Error::bad_input("water polygons do not overlap the grid")
                    .remedy("choose polygons that overlap the grid (terrane info prints the bounds of both)"),
            ));
        }
        for (body, sides) in bodies.iter_mut().zip(sides) {
            body.sides = Paths::of(sides);
        }
        Ok(Self {
            size,
            inside: PolygonEdgeIndex::new(inside),
            body_of: water.body_of.clone(),
            bodies,
        })
    }

    /// Edges of all bodies.
    pub(super) fn into_sides(self) -> Vec<Ends> {
        let all = Rect::new(0, 0, self.size[0], self.size[1]);
        self.bodies.iter().flat_map(|body| body.sides.ends_near(all)).collect()
    }

    /// True if there may be water in a rectangle.
    pub(super) fn may_be_in(&self, rect: Rect) -> bool {
        self.bodies.iter().any(|body| body.may_be_in(rect))
    }

    /// Water of each row of a rectangle as column ranges from its first column: sorted by body, disjoint per
    /// body.
    pub(super) fn rows(&self, rect: Rect) -> Vec<Vec<Labelled>> {
        let mut rows = vec![Vec::new(); rect.height as usize];
        if !self.may_be_in(rect) {
            return rows;
        }
        let scan = PolygonScan::new(&self.inside, SAMPLES, rect).labelled(&self.body_of);
        let _ = scan.rows(|row, inside| {
            rows[row as usize].extend_from_slice(inside);
            ControlFlow::<()>::Continue(())
        });
        let low = [rect.col, rect.row].map(i64::from);
        let high = [rect.end_col() - 1, rect.end_row() - 1].map(i64::from);
        for (number, body) in (0..).zip(&self.bodies).filter(|(_, body)| body.may_be_in(rect)) {
            for side in body.sides.near(rect) {
                for step in side.within(low, high).into_iter().flatten() {
                    let [col, row] = side.at(step);
                    let [col, row] = [col - low[0], row - low[1]].map(|at| at as u32);
                    rows[row as usize].push((number, col..col + 1));
                }
            }
        }
        rows.iter_mut().for_each(join);
        rows
    }

    /// The bodies at a sample.
    pub(super) fn at(&self, [col, row]: [u32; 2]) -> Vec<u32> {
        let rows = self.rows(Rect::new(col, row, 1, 1));
        rows.into_iter().flatten().map(|(body, _)| body).collect()
    }
}

impl WaterBody {
    fn grow(&mut self, corners: &[Xy], size: [u32; 2]) {
        let cols = covered(corners.iter().map(|at| at[0]), size[0]);
        let rows = covered(corners.iter().map(|at| at[1]), size[1]);
        let (Some(cols), Some(rows)) = (cols, rows) else { return };
        let [low, high] = self.bounds.unwrap_or([[cols[0], rows[0]], [cols[1], rows[1]]]);
        self.bounds = Some([
            [low[0].min(cols[0]), low[1].min(rows[0])],
            [high[0].max(cols[1]), high[1].max(rows[1])],
        ]);
    }

    fn may_be_in(&self, rect: Rect) -> bool {
        self.bounds.is_some_and(|[low, high]| {
            !rect.is_empty()
                && low[0] < rect.end_col()
                && low[1] < rect.end_row()
                && high[0] >= rect.col
                && high[1] >= rect.row
        })
    }
}

/// First and last column or row of `side` in the range of coordinates; `None` if all are outside.
fn covered(coordinates: impl Iterator<Item = f64>, side: u32) -> Option<[u32; 2]> {
    let [low, high] = coordinates
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)]);
    let last = f64::from(side - 1);
    (low <= last && high >= 0.0).then(|| [low.max(0.0) as u32, high.min(last) as u32])
}

/// Corners of a ring with its edge ends snapped to samples, clipped to the neighbourhood of the grid; appends
/// the edges. Parts outside the grid stay outside.
fn corners(ring: &[Xy], size: [u32; 2], sides: &mut Vec<Ends>) -> Vec<Xy> {
    let mut corners = Vec::with_capacity(ring.len());
    for pair in ring.windows(2) {
        let side = cut([pair[0], pair[1]], size);
        if side.is_none() || is_beyond(pair[0], size) {
            corners.push(outwards(pair[0], size));
        }
        let Some([a, b]) = side else { continue };
        let ends = match [pair[0][1], pair[0][0]] <= [pair[1][1], pair[1][0]] {
            true => [a, b],
            false => [b, a],
        };
        corners.extend(ends.map(|at| at.map(f64::from)));
        sides.push([a, b]);
    }
    corners.dedup();
    corners
}

fn is_beyond(at: Xy, size: [u32; 2]) -> bool {
    (0..2).any(|axis| !(-0.5..=f64::from(size[axis]) - 0.5).contains(&at[axis]))
}

/// A position rounded to integers that stays outside the grid if it was outside.
fn outwards(at: Xy, size: [u32; 2]) -> Xy {
    [0, 1].map(|axis| match at[axis] {
        c if c < -0.5 => c.floor(),
        c if c > f64::from(size[axis]) - 0.5 => c.ceil(),
        c => (c + 0.5).floor(),
    })
}
