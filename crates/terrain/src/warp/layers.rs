//! Grids that differ in lattice or CRS, one on top of the other on one lattice. A feathered grid fades into those below
//! near its voids and its border, see [`Feather`]: weights go from 1 to 0 there, and a height is the mean of the heights
//! by weight, from top to bottom, each of what those above have left.

use std::path::PathBuf;

use super::feather::Feather;
use super::near::NearLayers;
use super::source::{self, WarpedGrid, put};
use crate::bands::{ComputedBands, PIECE};
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_options::Choice;
use terrane_raster::{GridInfo, GridSource, SampleType};

/// Which of several files that differ in lattice or CRS is on top.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum LayerPriority {
    /// Later files; those on the lattice of an earlier one are with it
    #[default]
    Order,
    /// Files with smaller cells in the CRS of the output; later ones among equals
    Resolution,
}

/// Columns and rows of a piece.
const SIDE: u32 = 128;

/// Grids on one lattice: a void is filled from below.
pub(super) struct WarpedLayers {
    info: GridInfo,
    /// From top to bottom.
    layers: Vec<WarpedGrid>,
    near: NearLayers,
    /// How a grid fades into those below.
    feather: Feather,
    bands: ComputedBands,
}

/// Buffers of a thread.
#[derive(Default)]
struct BlendBuffers {
    blends: Vec<Blend>,
    /// Heights of a grid in a piece and around it, and its weights.
    own: Vec<f64>,
    weights: Vec<f64>,
    heights: Vec<f64>,
}

/// The height of a sample, as far as it is known from the grids on top.
#[derive(Clone, Copy)]
struct Blend {
    /// The height if a single grid has one, and otherwise the sum of weighted heights.
    height: f64,
    /// Sum of the weights.
    weight: f64,
    /// What is left for the grids below.
    rest: f64,
    /// Number of grids with a height.
    count: u32,
}

impl Blend {
    const NONE: Self = Self { height: f64::NAN, weight: 0.0, rest: 1.0, count: 0 };

    /// With the height and weight of the next grid below.
    fn add(&mut self, height: f64, weight: f64) {
        if height.is_nan() || self.rest == 0.0 {
            return;
        }
        let share = self.rest * weight;
        self.height = match self.count {
            0 => height,
            1 => self.height * self.weight + height * share,
            _ => self.height + height * share,
        };
        self.weight += share;
        self.rest *= 1.0 - weight;
        self.count += 1;
    }

    fn height(self) -> f64 {
        if self.count > 1 { self.height / self.weight } else { self.height }
    }
}

impl WarpedLayers {
    /// Grids from bottom to top, all on the lattice of `info`.
    pub(super) fn new(
        info: GridInfo,
        mut layers: Vec<WarpedGrid>,
        feather: Feather,
        memory: u64,
    ) -> Self {
        layers.reverse();
        let bands = ComputedBands::new(info.width, bands_bytes(feather, memory));
        let near = NearLayers::new(info.width);
        Self { info, layers, near, feather, bands }
    }

    /// Hands on pieces that cover a rectangle, with their heights.
    fn each(&self, rect: Rect, visit: &mut dyn FnMut(Rect, &[f64])) -> Result<()> {
        if self.feather.0 == 0 || !self.bands.are_for(rect) {
            return self.blend(rect, visit);
        }
        let columns: Vec<u32> = (rect.col / PIECE..=(rect.end_col() - 1) / PIECE).collect();
        let mut compute = |piece: Rect| {
            let mut heights = vec![f64::NAN; piece.len()];
            self.blend(piece, &mut |part, own| put(&mut heights, piece, part, own, |z| z))?;
            Ok(heights)
        };
        self.bands.each(rect, self.info.bounds(), &columns, &mut compute, visit)
    }

    /// Hands on each piece of a rectangle with its heights.
    fn blend(&self, rect: Rect, visit: &mut dyn FnMut(Rect, &[f64])) -> Result<()> {
        let mut buffers = BlendBuffers::default();
        for cell in NearLayers::cells(rect) {
            let near = self.near.of(cell, self.info.bounds(), &self.layers);
            let part = cell.intersect(&rect);
            // Low rectangles are cut less often.
            let wide = if self.feather.0 == 0 { SIDE * SIDE / part.height } else { SIDE };
            for row in (part.row..part.end_row()).step_by(SIDE as usize) {
                for col in (part.col..part.end_col()).step_by(wide as usize) {
                    let piece = Rect::new(col, row, wide, SIDE).intersect(&part);
                    self.blend_piece(piece, &near, &mut buffers)?;
                    visit(piece, &buffers.heights);
                }
            }
        }
        Ok(())
    }

    /// Blends the grids `near` a piece.
    fn blend_piece(&self, piece: Rect, near: &[u32], buffers: &mut BlendBuffers) -> Result<()> {
        let BlendBuffers { blends, own, weights, heights } = buffers;
        let around = self.feather.around(piece, self.info.bounds());
        blends.clear();
        blends.resize(piece.len(), Blend::NONE);
        for layer in near {
            own.clear();
            own.resize(around.len(), f64::NAN);
            self.layers[*layer as usize].read_f64(around, own)?;
            self.feather.weights(piece, around, own, weights);
            let rows = own.chunks_exact(around.width as usize);
            let rows = rows.skip((piece.row - around.row) as usize);
            let first = (piece.col - around.col) as usize;
            let inside = rows.flat_map(|row| &row[first..][..piece.width as usize]);
            for ((blend, height), weight) in blends.iter_mut().zip(inside).zip(&*weights) {
                blend.add(*height, *weight);
            }
            if blends.iter().all(|blend| blend.rest == 0.0) {
                break;
            }
        }
        heights.clear();
        heights.extend(blends.iter().map(|blend| self.stored(*blend)));
        Ok(())
    }

    /// A height, rounded to the type of the output if it was computed here.
    fn stored(&self, blend: Blend) -> f64 {
        match self.info.sample_type {
            SampleType::F32 if blend.count > 1 => f64::from(blend.height() as f32),
            _ => blend.height(),
        }
    }
}

impl GridSource for WarpedLayers {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.each(rect, &mut |piece, heights| put(out, rect, piece, heights, |z| z as f32))
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.each(rect, &mut |piece, heights| put(out, rect, piece, heights, |z| z))
    }

    fn block_bytes(&self) -> u64 {
        self.layers.iter().map(GridSource::block_bytes).max().unwrap_or(0)
    }

    fn members(&self) -> Vec<PathBuf> {
        self.layers.iter().flat_map(GridSource::members).collect()
    }
}

/// Bytes of all threads for bands, within a memory limit: without a feather nothing around a strip is needed.
pub(super) fn bands_bytes(feather: Feather, memory: u64) -> u64 {
    if feather.0 > 0 { ComputedBands::bytes(memory) } else { 0 }
}

/// Bytes that a thread holds: those of [`source::WORKER_BYTES`], and the heights, weights and distances of a piece with
/// what is around it.
pub(super) fn worker_bytes(feather: Feather) -> u64 {
    let side = u64::from(SIDE + 2 * feather.0);
    source::WORKER_BYTES + side * side * 12 + u64::from(SIDE).pow(2) * 48
}
