//! The scan every other kernel must equal bit for bit: plain Rust, runs everywhere.

use super::{Facet, LANES, Level, Worst};
use crate::tin::Local;

/// Scans the samples of `level` in the closed triangle `facet`.
///
/// Per row the columns between the edges are visited in runs of [`LANES`]; a run's first plane
/// height is computed in `f64` and rounded once, each lane adds its own rounded offset to it.
pub(super) fn scan(level: &Level<'_>, facet: &Facet) -> Worst {
    let stride = f64::from(1_u32 << level.shift);
    let (gx, gy) = (facet.gx * stride, facet.gy * stride);
    let offsets: [f32; LANES] = std::array::from_fn(|lane| (gx * lane as f64) as f32);
    let mut worst = Worst { error: 0.0, at: Local::new(0, 0) };
    let [first, last] = facet.row_range(level);
    for row in first..=last {
        let [low, high] = facet.columns(level, row);
        let start = facet.base + gy * f64::from(row);
        let line = row as usize * level.pitch;
        for run in (low..=high).step_by(LANES) {
            let plane = (start + gx * f64::from(run)) as f32;
            let lanes = (high - run + 1).min(LANES as i32) as usize;
            let samples = &level.heights[line + run as usize..][..lanes];
            for (lane, (&sample, &offset)) in samples.iter().zip(&offsets).enumerate() {
                let error = (sample - (plane + offset)).abs();
                if error > worst.error {
                    let col = (run as u32 + lane as u32) << level.shift;
                    worst = Worst { error, at: Local::new(col, (row as u32) << level.shift) };
                }
            }
        }
    }
    worst
}
