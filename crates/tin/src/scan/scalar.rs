//! Reference scan in portable Rust; all other kernels equal it bit for bit.

use crate::facet::PlaneFacet;
use crate::heights::FieldLevel;
use crate::lattice_position::TilePosition;

/// Samples per run of lanes. Part of the arithmetic: plane heights are rounded to `f32` once per run.
pub(crate) const LANES: usize = 16;

/// The worst sample of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WorstSample {
    /// |sample - plane| in `f32`; 0 when no sample is off the plane.
    pub(crate) error: f32,
    /// Its position; the lowest (row, column) of a tie. Undefined if the error is 0.
    pub(crate) at: TilePosition,
}

/// A scan kernel. The triangle is inside the field whose level is scanned.
pub(crate) type Scan = fn(&FieldLevel<'_>, &PlaneFacet) -> WorstSample;

/// Scans the samples of `level` in the closed triangle `facet`.
///
/// Per row the columns between the edges are visited in runs of [`LANES`] from the triangle's first
/// column on; a run's first plane height is computed in `f64` and rounded once, each lane adds its
/// own rounded offset to it.
pub(super) fn scan(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let stride = f64::from(1_u32 << level.shift);
    let (gx, gy) = (facet.gx * stride, facet.gy * stride);
    let offsets = lane_offsets(gx);
    let mut worst = WorstSample { error: 0.0, at: TilePosition::new(0, 0) };
    let [first, last] = facet.row_range(level);
    let [left, _] = facet.column_range(level);
    let edges = facet.edges();
    for row in first..=last {
        let [low, high] = edges.columns(level, row);
        let start = facet.base + gy * f64::from(row);
        let line = &level.heights[row as usize * level.pitch..];
        for run in (run_of(low, left)..=high).step_by(LANES) {
            let plane = (start + gx * f64::from(run)) as f32;
            for col in run.max(low)..=high.min(run + LANES as i32 - 1) {
                let error = (line[col as usize] - (plane + offsets[(col - run) as usize])).abs();
                if error > worst.error {
                    let [col, row] = [col as u32, row as u32].map(|at| at << level.shift);
                    worst = WorstSample { error, at: TilePosition::new(col, row) };
                }
            }
        }
    }
    worst
}

/// Heights of the plane above that at the start of a run of lanes.
#[inline(always)]
pub(super) fn lane_offsets(gx: f64) -> [f32; LANES] {
    std::array::from_fn(|lane| (gx * lane as f64) as f32)
}

/// The start of the run of lanes that holds column `low`; the first run begins at `left`.
#[inline(always)]
pub(super) fn run_of(low: i32, left: i32) -> i32 {
    left + (low - left) / LANES as i32 * LANES as i32
}

/// A worst sample at `row << 16 | column` in decimated units.
#[inline(always)]
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
pub(super) fn worst(level: &FieldLevel<'_>, error: f32, lowest: u32) -> WorstSample {
    let [col, row] = if error == 0.0 { [0, 0] } else { [lowest & 0xffff, lowest >> 16] };
    WorstSample { error, at: TilePosition::new(col << level.shift, row << level.shift) }
}
