//! Grids that differ in lattice or CRS, one on top of the other on one lattice. A feathered grid fades into those below
//! near its voids and its border, see [`Feather`]: weights go from 1 to 0 there, and a height is the mean of the heights
//! by weight, from top to bottom, each of what those above have left.

use std::path::PathBuf;

use super::feather::Feather;
use super::source::{self, WarpedGrid, put};
use crate::bands::{ComputedBands, PIECE};
use terrane_base::error::Result;
use terrane_base::geom::{Affine, Rect};
use terrane_options::Choice;
use terrane_raster::{GridInfo, GridSource, SampleType};

/// Which of several files that differ in lattice or CRS is on top.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum LayerPriority {
    /// Later files
    #[default]
    Order,
    /// Files with smaller cells; later ones among equals
    Resolution,
}

/// Columns and rows of a piece.
const SIDE: u32 = 128;

/// Grids on one lattice: a void is filled from below.
pub(super) struct WarpedLayers {
    info: GridInfo,
    /// From top to bottom.
    layers: Vec<WarpedLayer>,
    /// Longitudes may be a turn away.
    has_turns: bool,
    /// How a grid fades into those below.
    feather: Feather,
    bands: ComputedBands,
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

/// A grid on the lattice of the output.
pub(super) struct WarpedLayer {
    pub(super) grid: WarpedGrid,
    /// A rectangle in the CRS of the output that contains all its cells; `None` if unknown.
    pub(super) extent: Option<[f64; 4]>,
}

impl WarpedLayers {
    /// Grids from bottom to top, all on the lattice of `info`.
    pub(super) fn new(
        info: GridInfo,
        mut layers: Vec<WarpedLayer>,
        feather: Feather,
        memory: u64,
    ) -> Self {
        layers.reverse();
        let has_turns = info.crs.horizontal_unit() == "degree";
        let bands = ComputedBands::new(info.width, bands_bytes(feather, memory));
        Self { info, layers, has_turns, feather, bands }
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
        // Low rectangles are cut less often.
        let is_wide = self.feather.0 == 0;
        let wide = if is_wide { (SIDE * SIDE / rect.height.max(1)).max(SIDE) } else { SIDE };
        let (mut blends, mut weights) = (Vec::new(), Vec::new());
        let (mut own, mut heights) = (Vec::new(), Vec::new());
        for row in (rect.row..rect.end_row()).step_by(SIDE as usize) {
            for col in (rect.col..rect.end_col()).step_by(wide as usize) {
                let piece = Rect::new(col, row, wide, SIDE).intersect(&rect);
                let around = self.feather.around(piece, self.info.bounds());
                blends.clear();
                blends.resize(piece.len(), Blend::NONE);
                let near = self
                    .layers
                    .iter()
                    .filter(|layer| layer.is_near(piece, &self.info.transform, self.has_turns));
                for layer in near {
                    own.clear();
                    own.resize(around.len(), f64::NAN);
                    layer.grid.read_f64(around, &mut own)?;
                    self.feather.weights(piece, around, &own, &mut weights);
                    let rows = own.chunks_exact(around.width as usize);
                    let rows = rows.skip((piece.row - around.row) as usize);
                    let first = (piece.col - around.col) as usize;
                    let inside = rows.flat_map(|row| &row[first..][..piece.width as usize]);
                    for ((blend, height), weight) in blends.iter_mut().zip(inside).zip(&weights) {
                        blend.add(*height, *weight);
                    }
                    if blends.iter().all(|blend: &Blend| blend.rest == 0.0) {
                        break;
                    }
                }
                heights.clear();
                heights.extend(blends.iter().map(|blend| self.stored(*blend)));
                visit(piece, &heights);
            }
        }
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

impl WarpedLayer {
    /// False if a piece of the lattice certainly has no sample of the layer.
    fn is_near(&self, piece: Rect, lattice: &Affine, has_turns: bool) -> bool {
        let Some([x0, y0, x1, y1]) = self.extent else { return true };
        let [right, bottom] = [piece.end_col(), piece.end_row()].map(|end| f64::from(end) - 0.5);
        let [left, top] = [piece.col, piece.row].map(|first| f64::from(first) - 0.5);
        let corners = [[left, top], [right, top], [left, bottom], [right, bottom]];
        let corners = corners.map(|[col, row]| lattice.apply(col, row));
        let is_beyond = |is_beyond: &dyn Fn([f64; 2]) -> bool| corners.into_iter().all(is_beyond);
        let is_beside = is_beyond(&|[x, _]| x < x0) || is_beyond(&|[x, _]| x > x1);
        let is_off = is_beyond(&|[_, y]| y < y0) || is_beyond(&|[_, y]| y > y1);
        !(is_off || is_beside && !has_turns)
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
        self.layers.iter().map(|layer| layer.grid.block_bytes()).max().unwrap_or(0)
    }

    fn members(&self) -> Vec<PathBuf> {
        self.layers.iter().flat_map(|layer| layer.grid.members()).collect()
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
