//! The part of one triangulation that a region sees, made from as few vertices as prove it.
//!
//! The mesh of a cloud is the Delaunay triangulation of all chosen vertices. A triangle of a smaller
//! set is one of it when no other vertex lies in its circle: vertices around the region are taken in
//! until that holds for every triangle that reaches into the region. Vertices further and further
//! apart, away from the region, keep the circles small; the hull of all closes the mesh.

use std::collections::HashMap;

use super::circle::Circle;
use super::regions::Region;
use crate::error::Result;
use crate::geom::Point;
use crate::pipeline::points::{PointStore, Tiling};
use crate::tin::scatter::Mesh;

/// Squares taken in at a time, the nearest first.
const AT_ONCE: usize = 64;
/// Squares on each side of a region, at each distance, one of which stands for its neighbours.
const STRIDES: i64 = 6;

/// A region's part of the triangulation of the vertices in a store.
pub(super) struct Local<'a> {
    vertices: &'a PointStore,
    region: Region,
    pub(super) mesh: Mesh,
    /// Squares that are in the mesh as a whole, with their vertices.
    loaded: HashMap<usize, Vec<Point>>,
    /// Lowest and highest corner of the box of squares all of which are loaded.
    whole: [[i64; 2]; 2],
}

impl<'a> Local<'a> {
    /// The triangulation of `vertices` as far as `region` sees it. `hull` are the corners of the
    /// convex hull of all vertices, at least three.
    pub(super) fn new(vertices: &'a PointStore, region: Region, hull: &[Point]) -> Result<Self> {
        let mesh = Mesh::of_first(hull).ok_or_else(super::no_surface)?;
        let whole = around(&region, vertices.tiling());
        let mut local = Self { vertices, region, mesh, loaded: HashMap::new(), whole };
        local.insert(hull);
        local.insert(&skeleton(vertices, &region));
        let near: Vec<usize> = vertices.tiling().touching(local.whole).collect();
        near.into_iter().try_for_each(|square| local.load(square))?;
        while local.complete()? {}
        Ok(local)
    }

    fn insert(&mut self, points: &[Point]) {
        for &point in points {
            self.mesh.insert(point);
        }
    }

    /// Takes in all vertices of a square.
    fn load(&mut self, square: usize) -> Result<()> {
        let mut points = Vec::new();
        self.vertices.load_distinct(square, &mut points)?;
        self.insert(&points);
        self.loaded.insert(square, points);
        Ok(())
    }

    /// Takes in squares that may have vertices in the circles; false when there are none.
    fn complete(&mut self) -> Result<bool> {
        let mut wanted = self.wanted();
        wanted.truncate(AT_ONCE);
        wanted.iter().try_for_each(|&square| self.load(square))?;
        Ok(!wanted.is_empty())
    }

    /// Squares not loaded that may have vertices in the circle of a triangle of the region, the
    /// nearest first.
    fn wanted(&self) -> Vec<usize> {
        let mut wanted = Vec::new();
        for corners in self.triangles() {
            let circle = Circle::around(corners);
            if !contains(self.whole, circle.corners()) {
                self.add_met(&circle, &mut wanted);
            }
        }
        let corners = self.region.corners(self.vertices.tiling());
        let distance = |square: &usize| {
            let [low, high] = self.vertices.tiling().corners(*square);
            let gap =
                |axis: usize| (low[axis] - corners[1][axis]).max(corners[0][axis] - high[axis]);
            (gap(0).max(gap(1)), *square)
        };
        wanted.sort_unstable();
        wanted.dedup();
        wanted.sort_by_key(distance);
        wanted
    }

    /// Adds the squares that the circle meets and that are not loaded.
    fn add_met(&self, circle: &Circle, wanted: &mut Vec<usize>) {
        let tiling = self.vertices.tiling();
        let [low, high] = circle.corners().map(|corner| tiling.place(corner));
        for row in low[1]..=high[1] {
            let [south, north] = tiling.corners(tiling.square([0, row])).map(|c| c[1] as f64);
            let Some([west, east]) = circle.between(south, north) else { continue };
            let [first, last] = [west.floor(), east.ceil()].map(|x| tiling.place([x as i64, 0])[0]);
            for square in (first..=last).map(|col| tiling.square([col, row])) {
                let is_met =
                    || self.vertices.summary(square).is_some_and(|s| circle.meets(s.bounds));
                if !self.loaded.contains_key(&square) && is_met() {
                    wanted.push(square);
                }
            }
        }
    }

    /// The triangles whose box touches the region's.
    fn triangles(&self) -> impl Iterator<Item = [Point; 3]> {
        let corners = self.region.corners(self.vertices.tiling());
        let all = (0..self.mesh.triangles().len() as u32).filter_map(|t| self.mesh.corners(t));
        all.filter(move |triangle| touches(corners, triangle))
    }

    /// Lowest and highest corner of a box that holds every circle that proves the mesh.
    pub(super) fn influence(&self) -> [[i64; 2]; 2] {
        self.triangles().fold(self.whole, |[low, high], triangle| {
            let [below, above] = Circle::around(triangle).corners();
            [
                [low[0].min(below[0]), low[1].min(below[1])],
                [high[0].max(above[0]), high[1].max(above[1])],
            ]
        })
    }

    /// The vertices of a square, from those loaded or from the store.
    pub(super) fn vertices_of(&mut self, square: usize) -> Result<&[Point]> {
        if !self.loaded.contains_key(&square) {
            let mut points = Vec::new();
            self.vertices.load_distinct(square, &mut points)?;
            self.loaded.insert(square, points);
        }
        Ok(&self.loaded[&square])
    }
}

/// The region's box with a square on each side.
fn around(region: &Region, tiling: &Tiling) -> [[i64; 2]; 2] {
    let side = i64::from(tiling.side());
    let [low, high] = region.corners(tiling);
    [low.map(|c| c - side), high.map(|c| c + side)]
}

/// Vertices far from the region, one for so many squares, fewer with the distance.
fn skeleton(vertices: &PointStore, region: &Region) -> Vec<Point> {
    let tiling = vertices.tiling();
    let (counts, mut found) = (tiling.counts().map(i64::from), Vec::new());
    let mut stride = 1;
    while stride < counts[0].max(counts[1]) {
        let first = |axis: usize| {
            let low = i64::from(region.low[axis]) - STRIDES * stride;
            (low.max(0) + stride - 1) / stride * stride
        };
        let end = |axis: usize| (i64::from(region.end[axis]) + STRIDES * stride).min(counts[axis]);
        for row in (first(1)..end(1)).step_by(stride as usize) {
            for col in (first(0)..end(0)).step_by(stride as usize) {
                let square = tiling.square([col as u32, row as u32]);
                found.extend(vertices.summary(square).map(|summary| summary.lowest));
            }
        }
        stride *= 2;
    }
    found
}

fn contains(outer: [[i64; 2]; 2], inner: [[i64; 2]; 2]) -> bool {
    (0..2).all(|axis| outer[0][axis] <= inner[0][axis] && inner[1][axis] <= outer[1][axis])
}

fn touches([low, high]: [[i64; 2]; 2], triangle: &[Point; 3]) -> bool {
    let [xs, ys] = [triangle.map(|p| i64::from(p.x)), triangle.map(|p| i64::from(p.y))];
    let overlaps = |values: [i64; 3], axis: usize| {
        values.iter().any(|&v| v >= low[axis]) && values.iter().any(|&v| v <= high[axis])
    };
    overlaps(xs, 0) && overlaps(ys, 1)
}
