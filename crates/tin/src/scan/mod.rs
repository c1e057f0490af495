//! The hot loop: the sample of a triangle with the maximum distance from its plane; and the errors of finished
//! triangles.
//!
//! Every kernel does the same arithmetic in the same order (see [`scalar`]), so all of them give
//! the same bits; which one runs is chosen once, at run time.
//!
//! The samples of a row are found by the signs of three integer edge functions in a narrow triangle, by the exact span
//! of each row in a wide one.
//!
//! Measured: edge functions in narrow triangles, 31.4 to 26.2 ns a sample at 5 % kept with AVX-512, 50 to
//! 34.6 with AVX2; two rows to a vector with exact row ends was slower (35.7).

#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;
#[cfg(target_arch = "x86_64")]
mod x86;

use super::adjust::star::{self, StarKernels};
use super::heights::HeightField;
use super::lattice_position::TilePosition;
use super::measure::MeasuredTriangle;

pub(super) use scalar::{LANES, Scan};

/// The fastest kernel supported by this processor.
pub(super) fn fastest() -> Scan {
    available().last().map_or(scalar::scan, |&(_, scan)| scan)
}

/// All kernels supported by this processor, slowest first.
pub(super) fn available() -> Vec<(&'static str, Scan)> {
    #[cfg(target_arch = "x86_64")]
    let more = x86::available();
    #[cfg(target_arch = "aarch64")]
    let more: [(&str, Scan); 1] = [("neon", neon::scan)];
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let more = None;
    let scalar: (&'static str, Scan) = ("scalar", scalar::scan);
    std::iter::once(scalar).chain(more).collect()
}

/// The fastest kernels of stars supported by this processor.
pub(super) fn fastest_star() -> StarKernels {
    available_star().last().map_or(SCALAR_STAR, |&(_, kernels)| kernels)
}

/// All kernels of stars supported by this processor, slowest first.
pub(super) fn available_star() -> Vec<(&'static str, StarKernels)> {
    #[cfg(target_arch = "x86_64")]
    let more = x86::available_star();
    #[cfg(target_arch = "aarch64")]
    let more = [("neon", StarKernels { list: neon::list_star, envelope: neon::star_envelope })];
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let more = None;
    std::iter::once(("scalar", SCALAR_STAR)).chain(more).collect()
}

const SCALAR_STAR: StarKernels = StarKernels { list: star::list, envelope: star::envelope };

/// Measures triangle `p`, all samples of which are within `tolerance`, in `f64`. A sample on edge `i`
/// counts in the sum only when `owned[i]`; vertices have no error. Returns (largest error, sum of
/// squares); no sample is further off than the first, for which all rounding goes up, though not
/// beyond the tolerance. Time linear in the samples.
pub(super) fn measure(
    field: &HeightField,
    p: [TilePosition; 3],
    owned: [bool; 3],
    tolerance: f64,
) -> (f32, f32) {
    let triangle = MeasuredTriangle { field, p, owned, tolerance };
    measured(&triangle).unwrap_or_else(|| triangle.measured())
}

/// Measures a triangle with the widest registers of this processor; `None` if these are the baseline ones.
#[cfg(target_arch = "x86_64")]
fn measured(triangle: &MeasuredTriangle<'_>) -> Option<(f32, f32)> {
    x86::measured(triangle)
}

#[cfg(not(target_arch = "x86_64"))]
fn measured(_: &MeasuredTriangle<'_>) -> Option<(f32, f32)> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facet::PlaneFacet;
    use crate::heights::{FieldLevel, HeightWindow, LEVELS};
    use proptest::prelude::*;
    use scalar::WorstSample;
    use terrane_base::geom::predicates::orient;

    const SIDE: u32 = 70;

    fn field(seed: u32, margin: u32) -> HeightField {
        let height = |i: u32| match (i ^ seed).wrapping_mul(0x9e37_79b9) >> 20 {
            0..40 => f32::NAN,
            height => (height % 97) as f32 * 0.37 - 11.0,
        };
        let heights: Vec<f32> = (0..SIDE * SIDE).map(height).collect();
        let heights = HeightWindow { width: SIDE, height: SIDE, f32: &heights, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, SIDE, SIDE], [margin; 4], None);
        field
    }

    /// Every sample of the field, tested against the triangle's edges by exact orientation.
    fn members(p: [TilePosition; 3], level: &FieldLevel<'_>) -> Vec<TilePosition> {
        let [a, b, c] = p.map(TilePosition::lattice);
        let stride = 1 << level.shift;
        let [first, last, top, bottom] = level.bounds;
        let all = (top..=bottom).flat_map(|row| (first..=last).map(move |col| (col, row)));
        let inside = |q: &TilePosition| {
            let q = q.lattice();
            orient(a, b, q) >= 0 && orient(b, c, q) >= 0 && orient(c, a, q) >= 0
        };
        let local = |(col, row): (i32, i32)| {
            TilePosition::new((col * stride) as u32, (row * stride) as u32)
        };
        all.map(local).filter(inside).collect()
    }

    fn corner() -> impl Strategy<Value = TilePosition> {
        (0..SIDE, 0..SIDE).prop_map(|(col, row)| TilePosition::new(col, row))
    }

    fn last_corner() -> impl Strategy<Value = TilePosition> {
        (SIDE - 7..SIDE, 0..SIDE).prop_map(|(col, row)| TilePosition::new(col, row))
    }

    fn kernels_agree(
        field: &HeightField,
        facet: &PlaneFacet,
        level: u8,
    ) -> Result<(), TestCaseError> {
        let expected = scalar::scan(&field.level(level), facet);
        for (name, scan) in available() {
            let found = scan(&field.level(level), facet);
            prop_assert_eq!(found, expected, "kernel {}", name);
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn kernels_agree_bit_for_bit(
            p in [corner(), corner(), corner()], z in [-20.0..20.0, -20.0..20.0, -20.0..20.0],
            level in 0..LEVELS as u8, margin in 0_u32..2, seed in 0_u32..9
        ) {
            let [a, b, c] = p.map(TilePosition::lattice);
            prop_assume!(orient(a, b, c) > 0);
            kernels_agree(&field(seed, margin), &PlaneFacet::new(p, z), level)?;
        }

        /// Triangles of few columns that end at the last one, which scans leave out.
        #[test]
        fn kernels_agree_in_the_last_columns(
            p in [last_corner(), last_corner(), last_corner()],
            z in [-20.0..20.0, -20.0..20.0, -20.0..20.0], level in 0..2_u8, seed in 0_u32..9
        ) {
            let [a, b, c] = p.map(TilePosition::lattice);
            prop_assume!(orient(a, b, c) > 0);
            kernels_agree(&field(seed, 1), &PlaneFacet::new(p, z), level)?;
        }

        #[test]
        fn scans_see_every_sample_of_the_closed_triangle(
            p in [corner(), corner(), corner()], level in 0..LEVELS as u8, margin in 0_u32..2,
            pick in any::<prop::sample::Index>()
        ) {
            let [a, b, c] = p.map(TilePosition::lattice);
            prop_assume!(orient(a, b, c) > 0);
            let members = members(p, &field(0, margin).level(level));
            prop_assume!(!members.is_empty());
            let target = members[pick.index(members.len())];
            let mut heights = vec![0.0; (SIDE * SIDE) as usize];
            heights[(target.row() * SIDE + target.col()) as usize] = 1.0;
            let heights = HeightWindow { width: SIDE, height: SIDE, f32: &heights, f64: None };
            let mut one = HeightField::default();
            one.load(&heights, [0, 0, SIDE, SIDE], [margin; 4], None);
            let found = scalar::scan(&one.level(level), &PlaneFacet::new(p, [0.0; 3]));
            prop_assert_eq!(found, WorstSample { error: 1.0, at: target });
        }
    }

    proptest! {
        /// A sample at the start of a run of lanes that the plane meets: only the rounding errors of the plane are seen.
        #[test]
        fn kernels_round_planes_alike(
            left in 0..30_u32, [width, height] in [1..40_u32, 2..60_u32], row in any::<prop::sample::Index>(),
            [along, down] in [-9.0..9.0, -9.0..9.0]
        ) {
            let row = row.index(height as usize + 1) as u32;
            let p = [(left, 0), (left + width, 0), (left, height)];
            let z = p.map(|(col, r)| along * f64::from(col - left) + down * (f64::from(r) - f64::from(row)));
            let mut heights = vec![f32::NAN; (SIDE * SIDE) as usize];
            heights[(row * SIDE + left) as usize] = 0.0;
            let heights = HeightWindow { width: SIDE, height: SIDE, f32: &heights, f64: None };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
            let p = p.map(|(col, row)| TilePosition::new(col, row));
            kernels_agree(&field, &PlaneFacet::new(p, z), 0)?;
        }
    }

    proptest! {
        /// Heights of few steps, so that many samples are as far from a level triangle.
        #[test]
        fn of_samples_as_far_off_the_first_is_told(
            p in [corner(), corner(), corner()], level in 0..LEVELS as u8, one_in in 1_u32..60, seed: u32
        ) {
            let [a, b, c] = p.map(TilePosition::lattice);
            prop_assume!(orient(a, b, c) > 0);
            let is_off = |i: u32| ((i ^ seed).wrapping_mul(0x9e37_79b9) >> 16).is_multiple_of(one_in);
            let heights: Vec<f32> = (0..SIDE * SIDE).map(|i| if is_off(i) { 2.0 } else { 0.0 }).collect();
            let heights = HeightWindow { width: SIDE, height: SIDE, f32: &heights, f64: None };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
            let far = members(p, &field.level(level)).into_iter().find(|&at| field.sample(at) > 0.0);
            let expected = far.map_or(WorstSample { error: 0.0, at: TilePosition::new(0, 0) }, |at| WorstSample { error: 2.0, at });
            for (name, scan) in available() {
                prop_assert_eq!(scan(&field.level(level), &PlaneFacet::new(p, [0.0; 3])), expected, "{}", name);
            }
        }
    }

    /// Triangles as wide as a run of lanes, one more and one less, that begin anywhere.
    #[test]
    fn kernels_see_the_ends_of_rows_of_any_length() {
        for (width, left) in (1..36).flat_map(|width| (0..18).map(move |left| (width, left))) {
            let flat = [(left, 3), (left + width, 3), (left + width, 4)];
            let p = flat.map(|(col, row)| TilePosition::new(col, row));
            for col in left..=left + width {
                let mut heights = vec![0.0; (SIDE * SIDE) as usize];
                heights[(3 * SIDE + col) as usize] = 1.0;
                let heights = HeightWindow { width: SIDE, height: SIDE, f32: &heights, f64: None };
                let mut field = HeightField::default();
                field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
                let expected = WorstSample { error: 1.0, at: TilePosition::new(col, 3) };
                for (name, scan) in available() {
                    let found = scan(&field.level(0), &PlaneFacet::new(p, [0.0; 3]));
                    assert_eq!(found, expected, "{name} {width} {left}");
                }
            }
        }
    }
}
