//! Estimates the size of a mesh from a few tiles spread over the grid.
//!
//! At most 256 tiles of 128 cells in 16 bands are triangulated, which represent a grid of land and sea better
//! than a few large ones; their standard error is added.

use std::collections::HashMap;

use super::budget::ToleranceTrial;
use super::layout::{TileId, TileLayout};
use super::window::HeightBuffers;
use super::worker::tile_input;
use terrane_base::error::Result;
use terrane_engine::{Cancel, workers};
use terrane_raster::GridSource;
use terrane_tin::{TileMesh, TileScratch, TinSpec, triangulate_tile};

/// One tile in this many is sampled, but no more than [`MAX_TILES`].
const ONE_IN: u64 = 32;
const MAX_TILES: u64 = 16;
/// Cells along a tile of a thorough estimate. It
/// reads as many samples as a few large tiles, but spreads them more evenly over land and sea.
const FINE: u32 = 128;
const FINE_ONE_IN: u64 = 4;
const FINE_TILES: [u64; 2] = [64, 256];
/// Safety factor: isolated tiles keep slightly fewer vertices at their rims.
const MARGIN: f64 = 1.05;
/// Halvings of the tolerance's range (on a logarithmic scale) for a first guess.
const HALVINGS: u32 = 10;

/// Golden ratio: the fractional parts of its multiples are evenly spread.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Vertices and triangles of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MeshSize {
    pub(super) vertices: u64,
    pub(super) triangles: u64,
}

impl MeshSize {
    /// The size with `vertices` more.
    pub(super) fn with(self, vertices: u64) -> Self {
        Self { vertices: self.vertices + vertices, triangles: self.triangles + 2 * vertices }
    }

    fn times(self, share: f64) -> Self {
        let [vertices, triangles] =
            [self.vertices, self.triangles].map(|count| (count as f64 * share) as u64);
        Self { vertices, triangles }
    }
}

/// A sampled tile.
#[derive(Clone, Copy)]
struct TileSize {
    samples: u64,
    size: MeshSize,
}

/// Buffers of a thread.
struct EstimateBuffers {
    window: HeightBuffers,
    scratch: TileScratch,
}

/// Triangulates the same few tiles at any tolerance, each at once on one of several threads.
pub(super) struct SizeEstimator<'a> {
    source: &'a dyn GridSource,
    layout: TileLayout,
    threads: usize,
    cancel: &'a Cancel,
    tiles: Vec<TileId>,
    /// Results by tolerance: a search tries the same tolerances repeatedly.
    known: HashMap<u64, Vec<TileSize>>,
    /// Highest minus lowest height.
    relief: Option<f64>,
}

impl<'a> SizeEstimator<'a> {
    /// Chooses the tiles.
    pub(super) fn new(
        source: &'a dyn GridSource,
        layout: TileLayout,
        threads: usize,
        cancel: &'a Cancel,
    ) -> Self {
        let tiles = spread(&layout, (layout.tiles() / ONE_IN).clamp(1, MAX_TILES));
        Self { source, layout, threads, cancel, tiles, known: HashMap::new(), relief: None }
    }

    /// Selects more and smaller tiles, in a few bands that are read together.
    pub(super) fn thorough(
        source: &'a dyn GridSource,
        layout: TileLayout,
        threads: usize,
        cancel: &'a Cancel,
    ) -> Result<Self> {
        let layout = layout.finer(FINE)?;
        let [min_tiles, max_tiles] = FINE_TILES;
        let tiles = banded(&layout, (layout.tiles() / FINE_ONE_IN).clamp(min_tiles, max_tiles));
        Ok(Self { source, layout, threads, cancel, tiles, known: HashMap::new(), relief: None })
    }

    /// The estimated size of the whole mesh.
    pub(super) fn size(&mut self, spec: &TinSpec) -> Result<MeshSize> {
        self.sizes(spec).map(|sizes| self.extrapolate(&sizes))
    }

    /// The estimated size plus the standard error of the sampled tiles.
    pub(super) fn size_at_most(&mut self, spec: &TinSpec) -> Result<MeshSize> {
        let tiles = self.sizes(spec)?;
        let size = self.extrapolate(&tiles);
        let density = size.vertices as f64 / self.layout.samples() as f64;
        let residuals =
            tiles.iter().map(|tile| tile.size.vertices as f64 - density * tile.samples as f64);
        let square_sum: f64 = residuals.map(|residual| residual.powi(2)).sum();
        // Correction for a finite population: no error remains if every tile was sampled.
        let unseen = 1.0 - tiles.len() as f64 / self.layout.tiles() as f64;
        let sampled: u64 = tiles.iter().map(|tile| tile.size.vertices).sum();
        Ok(size.times(MARGIN + (square_sum * unseen).sqrt() / sampled.max(1) as f64))
    }

    /// Extrapolates the sizes of sampled tiles to the whole grid.
    fn extrapolate(&self, tiles: &[TileSize]) -> MeshSize {
        let mut total = MeshSize::default();
        for TileSize { size, .. } in tiles {
            total.vertices += size.vertices;
            total.triangles += size.triangles;
        }
        let samples: u64 = tiles.iter().map(|tile| tile.samples).sum();
        total.times(self.layout.samples() as f64 / samples.max(1) as f64)
    }

    fn sizes(&mut self, spec: &TinSpec) -> Result<Vec<TileSize>> {
        self.measure(spec, &[spec.tolerance])?;
        Ok(self.known.get(&spec.tolerance.to_bits()).cloned().unwrap_or_default())
    }

    /// Triangulates the tiles at tolerances without a result.
    fn measure(&mut self, spec: &TinSpec, tolerances: &[f64]) -> Result<()> {
        let new = tolerances.iter().filter(|t| !self.known.contains_key(&t.to_bits()));
        let new: Vec<f64> = new.copied().collect();
        let (count, mut made) = (self.tiles.len() as u64, Vec::new());
        let units = count * new.len() as u64;
        let threads = self.threads.min(usize::try_from(units).unwrap_or(usize::MAX));
        workers::in_order(
            threads,
            units,
            self.cancel,
            || self.buffers(),
            |buffers, unit| {
                let spec = TinSpec { tolerance: new[(unit / count) as usize], ..*spec };
                self.size_of(self.tiles[(unit % count) as usize], &spec, buffers)
            },
            |size| {
                made.push(size);
                Ok(())
            },
        )?;
        for (tolerance, sizes) in new.iter().zip(made.chunks(count.max(1) as usize)) {
            self.known.insert(tolerance.to_bits(), sizes.to_vec());
        }
        Ok(())
    }

    fn buffers(&self) -> EstimateBuffers {
        let mut scratch = TileScratch::default();
        scratch.stop_by(self.cancel);
        EstimateBuffers { window: HeightBuffers::default(), scratch }
    }

    /// The size of the mesh of a tile.
    fn size_of(
        &self,
        tile: TileId,
        spec: &TinSpec,
        buffers: &mut EstimateBuffers,
    ) -> Result<TileSize> {
        let mesh = self.triangulate(tile, spec, buffers)?;
        let owned = self.layout.owned(tile);
        let vertices = mesh.vertices.iter();
        let vertices = vertices.filter(|at| at.col() < owned.width && at.row() < owned.height);
        let size =
            MeshSize { vertices: vertices.count() as u64, triangles: mesh.triangles.len() as u64 };
        Ok(TileSize { samples: owned.len() as u64, size })
    }

    /// A tolerance at which `count` of the mesh's size is about `budget`; it is above 0. Estimates are
    /// taken to be off by the same factor as that for a trial.
    pub(super) fn guess(
        &mut self,
        spec: &TinSpec,
        budget: u64,
        trial: Option<ToleranceTrial>,
        count: impl Fn(MeshSize) -> u64,
    ) -> Result<f64> {
        let factor = match trial {
            Some(ToleranceTrial { tolerance, count: actual }) => {
                let estimated = count(self.size(&TinSpec { tolerance, ..*spec })?);
                estimated as f64 / actual.max(1) as f64
            }
            None => 1.0,
        };
        let budget = budget as f64 * factor;
        let relief = self.relief()?;
        let (mut low, mut high) = ((relief * 1e-6).ln(), relief.ln());
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            // Small tolerances take longest and come first: where a thread is free it looks at what is next then.
            let next = f64::midpoint(middle, high);
            let is_free = self.threads > self.tiles.len();
            self.measure(spec, &[middle.exp(), next.exp()][..1 + usize::from(is_free)])?;
            let size = self.size(&TinSpec { tolerance: middle.exp(), ..*spec })?;
            if count(size) as f64 > budget { low = middle } else { high = middle }
        }
        Ok(high.exp())
    }

    /// Highest minus lowest height of the sampled tiles; 1 when they are flat or void.
    fn relief(&mut self) -> Result<f64> {
        if let Some(relief) = self.relief {
            return Ok(relief);
        }
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut window = HeightBuffers::default();
        for &tile in &self.tiles {
            window.read(self.source, self.layout.rect(tile))?;
            let heights = window.heights().f32;
            low = heights.iter().copied().fold(low, f32::min);
            high = heights.iter().copied().fold(high, f32::max);
        }
        let relief = f64::from(high) - f64::from(low);
        let relief = if relief > 0.0 && relief.is_finite() { relief } else { 1.0 };
        Ok(*self.relief.insert(relief))
    }

    fn triangulate(
        &self,
        tile: TileId,
        spec: &TinSpec,
        buffers: &mut EstimateBuffers,
    ) -> Result<TileMesh> {
        self.cancel.check()?;
        buffers.window.read(self.source, self.layout.apron(tile))?;
        let input = tile_input(&self.layout, tile, buffers.window.heights(), &[], &[]);
        let mesh = triangulate_tile(&input, spec, &mut buffers.scratch);
        self.cancel.check()?;
        Ok(mesh)
    }
}

/// `count` tiles at the points of a rank-one lattice, which lie evenly in both directions.
fn spread(layout: &TileLayout, count: u64) -> Vec<TileId> {
    let tiles = (0..count).map(|i| {
        let down = (i as f64 + 0.5) / count as f64;
        let across = (0.5 + i as f64 * GOLDEN).fract();
        TileId::new(at_share(down, layout.rows), at_share(across, layout.cols))
    });
    let mut tiles: Vec<TileId> = tiles.collect();
    tiles.sort();
    tiles.dedup();
    tiles
}

/// The index among `count` at a share of them.
fn at_share(share: f64, count: u32) -> u32 {
    ((share * f64::from(count)) as u32).min(count - 1)
}

/// `count` tiles, evenly in both directions, in as few rows of tiles as possible.
fn banded(layout: &TileLayout, count: u64) -> Vec<TileId> {
    let aspect = f64::from(layout.rows) / f64::from(layout.cols);
    let rows = (count as f64 * aspect).sqrt().ceil().clamp(1.0, f64::from(layout.rows)) as u64;
    let cols = count.div_ceil(rows).min(layout.cols.into());
    let bands = (0..rows).flat_map(|band| {
        let row = evenly(band, rows, layout.rows, 0.5);
        // Each band begins elsewhere, so that columns are not sampled in step with what repeats in them.
        let shift = (0.5 + band as f64 * GOLDEN).fract();
        (0..cols).map(move |i| TileId::new(row, evenly(i, cols, layout.cols, shift)))
    });
    bands.collect()
}

/// The `i`th of `count` indices below `end`, evenly spaced and shifted by a share of a step.
fn evenly(i: u64, count: u64, end: u32, shift: f64) -> u32 {
    ((i as f64 + shift) * f64::from(end) / count as f64) as u32 % end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_few_and_small_grids_are_looked_at_whole() {
        for (cols, rows, count, bands) in [(200, 300, 256, 20), (300, 2, 256, 2), (3, 2, 6, 2)] {
            let layout = TileLayout::new(cols * FINE + 1, rows * FINE + 1, FINE).unwrap();
            let tiles = banded(&layout, 256);
            let distinct: std::collections::HashSet<_> = tiles.iter().collect();
            assert!(
                distinct.len() == tiles.len() && tiles.len() as u64 >= count,
                "{cols} x {rows}"
            );
            assert!(tiles.iter().all(|tile| tile.row < rows && tile.col < cols));
            let rows: std::collections::HashSet<u32> = tiles.iter().map(|tile| tile.row).collect();
            assert_eq!(rows.len(), bands, "{cols} x {rows:?}");
        }
    }

    #[test]
    fn tiles_are_spread_and_distinct() {
        let layout = TileLayout::new(512 * 20, 512 * 30, 512).unwrap();
        let tiles = spread(&layout, 16);
        assert_eq!(tiles.len(), 16);
        let cols: std::collections::HashSet<u32> = tiles.iter().map(|tile| tile.col / 5).collect();
        assert_eq!(cols.len(), 4);
        assert_eq!(spread(&TileLayout::new(100, 100, 512).unwrap(), 1), [TileId::new(0, 0)]);
    }
}
