//! The part of the triangulation that a region sees, computed from as few vertices as necessary.
//!
//! The mesh of a point cloud is the Delaunay triangulation of all selected vertices. A triangle of a subset
//! belongs to it if no other vertex lies in its circle: vertices around the region are added until that holds
//! for every triangle that reaches into the region. Sparse distant vertices keep the circles small; the hull of
//! all closes the mesh.

use std::collections::HashMap;

use super::regions::{CloudTinRegion, no_surface};
use crate::point_index::PointStore;
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_delaunay::{CircumscribedDisc, SiteWindow};
use terrane_tin::scatter::ScatterMesh;

/// Tiles loaded at a time, the nearest first.
const AT_ONCE: usize = 64;
/// Tiles on each side of a region, at each distance, that are represented by one.
const STRIDES: i64 = 6;

/// A region's part of the triangulation of the vertices in a store.
pub(super) struct RegionMesh<'a> {
    vertices: &'a PointStore,
    region: CloudTinRegion,
    pub(super) mesh: ScatterMesh,
    /// Loaded tiles with their vertices.
    loaded: HashMap<usize, Vec<Point>>,
    /// All tiles in this window are loaded.
    loaded_window: SiteWindow,
}

impl<'a> RegionMesh<'a> {
    /// The triangulation of `vertices` as far as `region` sees it. `hull` has the corners of
    /// the convex hull of all vertices, at least three.
    pub(super) fn new(
        vertices: &'a PointStore,
        region: CloudTinRegion,
        hull: &[Point],
    ) -> Result<Self> {
        let mesh = ScatterMesh::of_first(hull).ok_or_else(no_surface)?;
        let tiling = vertices.tiling();
        let loaded_window = region.window(tiling).grown(tiling.side());
        let mut local = Self { vertices, region, mesh, loaded: HashMap::new(), loaded_window };
        local.insert(hull);
        local.insert(&skeleton(vertices, &region));
        tiling.touching(loaded_window).try_for_each(|square| local.load(square))?;
        while local.complete()? {}
        Ok(local)
    }

    fn insert(&mut self, points: &[Point]) {
        for &point in points {
            self.mesh.insert(point);
        }
    }

    /// Adds all vertices of a tile.
    fn load(&mut self, square: usize) -> Result<()> {
        let mut points = Vec::new();
        self.vertices.load_distinct(square, &mut points)?;
        self.insert(&points);
        self.loaded.insert(square, points);
        Ok(())
    }

    /// Loads tiles that may have vertices in the circles; false if there are none.
    fn complete(&mut self) -> Result<bool> {
        let mut missing = self.missing_tiles();
        missing.truncate(AT_ONCE);
        missing.iter().try_for_each(|&square| self.load(square))?;
        Ok(!missing.is_empty())
    }

    /// Tiles not loaded that may have vertices in the circle of a triangle of the region, the nearest first.
    fn missing_tiles(&self) -> Vec<usize> {
        let mut missing = Vec::new();
        for disc in self.discs().filter(|disc| !self.vertices.is_within(disc, &self.loaded_window))
        {
            let touched = self.vertices.squares_in(disc);
            missing.extend(touched.filter(|square| !self.loaded.contains_key(square)));
        }
        missing.sort_unstable();
        missing.dedup();
        let tiling = self.vertices.tiling();
        let region = self.region.window(tiling);
        missing.sort_by_key(|&square| (region.steps_to(&tiling.window_of(square)), square));
        missing
    }

    /// The circles of the triangles whose box touches the region's.
    fn discs(&self) -> impl Iterator<Item = CircumscribedDisc> {
        let window = self.region.window(self.vertices.tiling());
        let all = (0..self.mesh.triangles().len() as u32).filter_map(|t| self.mesh.corners(t));
        let all = all.map(|corners| corners.map(|p| [p.x, p.y]));
        all.filter(move |corners| {
            SiteWindow::of(*corners).is_some_and(|bounds| bounds.intersection(&window).is_some())
        })
        .map(CircumscribedDisc::around)
    }

    /// A window that holds every vertex that may change the mesh here.
    pub(super) fn influence(&self) -> SiteWindow {
        let all = self.vertices.tiling().window();
        let parts = self.discs().filter_map(|disc| disc.clip(&all));
        parts.fold(self.loaded_window, |sum, part| sum.union(&part))
    }

    /// The vertices of a tile, from those loaded or from the store.
    pub(super) fn vertices_of(&mut self, square: usize) -> Result<&[Point]> {
        if !self.loaded.contains_key(&square) {
            let mut points = Vec::new();
            self.vertices.load_distinct(square, &mut points)?;
            self.loaded.insert(square, points);
        }
        Ok(&self.loaded[&square])
    }
}

/// Sparse vertices far from the region, fewer with the distance.
fn skeleton(vertices: &PointStore, region: &CloudTinRegion) -> Vec<Point> {
    let tiling = vertices.tiling();
    let (counts, mut skeleton) = (tiling.counts().map(i64::from), Vec::new());
    let mut stride = 1;
    while stride < counts[0].max(counts[1]) {
        let [cols, rows] = [0, 1].map(|axis| {
            let low = i64::from(region.low[axis]) - STRIDES * stride;
            let first = (low.max(0) + stride - 1) / stride * stride;
            let end = (i64::from(region.end[axis]) + STRIDES * stride).min(counts[axis]);
            (first..end).step_by(stride as usize)
        });
        for row in rows {
            for col in cols.clone() {
                let square = tiling.square([col as u32, row as u32]);
                skeleton.extend(vertices.summary(square).map(|summary| summary.lowest));
            }
        }
        stride *= 2;
    }
    skeleton
}
