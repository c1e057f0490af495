//! How large a mesh will be, from a few tiles spread over the grid.

use super::layout::{Layout, TileId};
use super::window::Window;
use super::worker::tile_input;
use crate::error::Result;
use crate::pipeline::Cancel;
use crate::raster::GridSource;
use crate::tin::{Scratch, Spec, TileMesh, triangulate_tile};

/// One tile in this many is sampled, but no more than [`MOST_TILES`].
const ONE_IN: u64 = 32;
const MOST_TILES: u64 = 16;
/// Halvings of the tolerance's range (on a logarithmic scale) for a first guess.
const HALVINGS: u32 = 10;

/// Vertices and triangles of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Size {
    pub(super) vertices: u64,
    pub(super) triangles: u64,
}

/// Triangulates the same few tiles at any tolerance.
pub(super) struct Estimator<'a> {
    source: &'a dyn GridSource,
    layout: Layout,
    cancel: &'a Cancel,
    tiles: Vec<TileId>,
    window: Window,
    scratch: Scratch,
}

impl<'a> Estimator<'a> {
    /// Chooses the tiles.
    pub(super) fn new(source: &'a dyn GridSource, layout: Layout, cancel: &'a Cancel) -> Self {
        let tiles = spread(&layout, (layout.tiles() / ONE_IN).clamp(1, MOST_TILES));
        let (window, scratch) = (Window::default(), Scratch::default());
        Self { source, layout, cancel, tiles, window, scratch }
    }

    /// The estimated size of the whole mesh.
    pub(super) fn size(&mut self, spec: &Spec) -> Result<Size> {
        let (mut samples, mut found) = (0, Size::default());
        for i in 0..self.tiles.len() {
            let tile = self.tiles[i];
            let mesh = self.triangulate(tile, spec)?;
            let owned = self.layout.owned(tile);
            let is_owned =
                |at: &&crate::tin::Local| at.col() < owned.width && at.row() < owned.height;
            found.vertices += mesh.vertices.iter().filter(is_owned).count() as u64;
            found.triangles += mesh.triangles.len() as u64;
            samples += owned.len() as u64;
        }
        let share = self.layout.samples() as f64 / samples.max(1) as f64;
        let whole = |count: u64| (count as f64 * share) as u64;
        Ok(Size { vertices: whole(found.vertices), triangles: whole(found.triangles) })
    }

    /// A tolerance at which `count` of the mesh's size is about `budget`; it is above 0.
    pub(super) fn guess(
        &mut self,
        spec: &Spec,
        budget: u64,
        count: impl Fn(Size) -> u64,
    ) -> Result<f64> {
        let relief = self.relief()?;
        let (mut low, mut high) = ((relief * 1e-6).ln(), relief.ln());
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            let size = self.size(&Spec { tolerance: middle.exp(), ..*spec })?;
            if count(size) > budget { low = middle } else { high = middle }
        }
        Ok(high.exp())
    }

    /// Highest minus lowest height of the sampled tiles; 1 when they are flat or void.
    fn relief(&mut self) -> Result<f64> {
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for &tile in &self.tiles {
            self.window.read(self.source, self.layout.rect(tile))?;
            let heights = self.window.heights().f32;
            low = heights.iter().copied().fold(low, f32::min);
            high = heights.iter().copied().fold(high, f32::max);
        }
        let relief = f64::from(high) - f64::from(low);
        Ok(if relief > 0.0 && relief.is_finite() { relief } else { 1.0 })
    }

    fn triangulate(&mut self, tile: TileId, spec: &Spec) -> Result<TileMesh> {
        self.cancel.check()?;
        self.window.read(self.source, self.layout.apron(tile))?;
        let input = tile_input(&self.layout, tile, self.window.heights());
        Ok(triangulate_tile(&input, spec, &mut self.scratch))
    }
}

/// `count` tiles at the points of a rank-one lattice, which lie evenly in both directions.
fn spread(layout: &Layout, count: u64) -> Vec<TileId> {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let place = |i: u64| {
        let down = (i as f64 + 0.5) / count as f64;
        let across = (0.5 + i as f64 * GOLDEN).fract();
        let pick = |share: f64, most: u32| ((share * f64::from(most)) as u32).min(most - 1);
        TileId::new(pick(down, layout.rows), pick(across, layout.cols))
    };
    let mut tiles: Vec<TileId> = (0..count).map(place).collect();
    tiles.sort();
    tiles.dedup();
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_spread_and_distinct() {
        let layout = Layout::new(512 * 20, 512 * 30, 512).unwrap();
        let tiles = spread(&layout, 16);
        assert_eq!(tiles.len(), 16);
        let cols: std::collections::HashSet<u32> = tiles.iter().map(|tile| tile.col / 5).collect();
        assert_eq!(cols.len(), 4);
        assert_eq!(spread(&Layout::new(100, 100, 512).unwrap(), 1), [TileId::new(0, 0)]);
    }
}
