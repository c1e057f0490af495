//! Grids that differ in lattice or CRS, one on top of the other on one lattice.

use std::path::PathBuf;

use super::source::{self, WarpedGrid, put};
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_options::Choice;
use terrane_raster::{GridInfo, GridSource};

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
}

/// A grid on the lattice of the output.
pub(super) struct WarpedLayer {
    pub(super) grid: WarpedGrid,
    /// A rectangle in the CRS of the output that contains all its cells; `None` if unknown.
    pub(super) extent: Option<[f64; 4]>,
}

impl WarpedLayers {
    /// Grids from bottom to top, all on the lattice of `info`.
    pub(super) fn new(info: GridInfo, mut layers: Vec<WarpedLayer>) -> Self {
        layers.reverse();
        Self { info, layers }
    }

    /// Hands on each piece of a rectangle with its heights.
    fn each(&self, rect: Rect, visit: &mut dyn FnMut(Rect, &[f64])) -> Result<()> {
        let (mut heights, mut lower) = (Vec::new(), Vec::new());
        for row in (rect.row..rect.end_row()).step_by(SIDE as usize) {
            for col in (rect.col..rect.end_col()).step_by(SIDE as usize) {
                let piece = Rect::new(col, row, SIDE, SIDE).intersect(&rect);
                heights.clear();
                heights.resize(piece.len(), f64::NAN);
                let near = self.layers.iter().filter(|layer| layer.is_near(&self.info, piece));
                for layer in near {
                    lower.clear();
                    lower.resize(piece.len(), f64::NAN);
                    layer.grid.read_f64(piece, &mut lower)?;
                    let voids =
                        heights.iter_mut().zip(&lower).filter(|(height, _)| height.is_nan());
                    voids.for_each(|(height, lower)| *height = *lower);
                    if !heights.iter().any(|height| height.is_nan()) {
                        break;
                    }
                }
                visit(piece, &heights);
            }
        }
        Ok(())
    }
}

impl WarpedLayer {
    /// False if a piece of the lattice certainly has no sample of the layer.
    fn is_near(&self, lattice: &GridInfo, piece: Rect) -> bool {
        let Some([x0, y0, x1, y1]) = self.extent else { return true };
        let [right, bottom] = [piece.end_col(), piece.end_row()].map(|end| f64::from(end) - 0.5);
        let [left, top] = [piece.col, piece.row].map(|first| f64::from(first) - 0.5);
        let corners = [[left, top], [right, top], [left, bottom], [right, bottom]];
        let corners = corners.map(|[col, row]| lattice.transform.apply(col, row));
        let is_beyond = |is_beyond: &dyn Fn([f64; 2]) -> bool| corners.into_iter().all(is_beyond);
        // Longitudes may be a turn away.
        let has_turns = lattice.crs.horizontal_unit() == "degree";
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

/// Bytes that a thread holds beside those of [`source::WORKER_BYTES`]: two pieces.
pub(super) const WORKER_BYTES: u64 = source::WORKER_BYTES + 2 * 8 * (SIDE * SIDE) as u64;
