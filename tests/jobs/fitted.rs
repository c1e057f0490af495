//! Fitted heights of samples that `f64` does not hold exactly.

use terrane::prelude::*;
use terrane::{ArrayGrid, ErrorBound};

/// A number from 0 to 1 that looks random.
fn noise(at: usize, seed: usize) -> f64 {
    let mixed = (at as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (seed as u64) << 40;
    let mixed = (mixed ^ mixed >> 31).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

/// How a height is rounded.
type Rounding = fn(f64) -> f64;

/// Vertices at the tolerance from their samples are within it in exact arithmetic, as `verify` judges them.
#[test]
fn fitted_heights_are_within_the_tolerance_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    for seed in 0..24 {
        let height = |at: usize| {
            let (col, row) = ((at % 90) as f64, (at / 90) as f64);
            30.0 * (col / 17.0).sin() * (row / 13.0).cos() + 2.4 * (noise(at, seed) - 0.5)
        };
        // Centimetres; tenths of whole numbers; less than `f32` tells from zero.
        let kinds: [(Rounding, f64); 3] = [
            (|z| (z * 100.0).round() / 100.0, 1.5),
            (|z| z.round() * 0.1, 0.1),
            (|z| z * 1e-200, 1e-200),
        ];
        for (kind, tolerance) in kinds {
            let heights: Vec<f64> = (0..90 * 90).map(|at| kind(height(at))).collect();
            let grid = terrane::open_array(ArrayGrid::shared(heights, 90, 90).unwrap()).unwrap();
            for bound in [ErrorBound::Samples, ErrorBound::Surface] {
                let job = grid.tin().max_error(tolerance).bound(bound).fit_heights(true);
                job.overwrite(true).write(&path).unwrap();
                let proof = grid.verify(&path).run().unwrap();
                assert!(proof.verdict.passed, "seed {seed}, {tolerance}, {bound:?}: {proof:?}");
            }
        }
    }
}
