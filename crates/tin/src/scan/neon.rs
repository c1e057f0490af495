//! Kernels for NEON, which every aarch64 processor has: four samples to a vector.
#![allow(unsafe_code)]

use std::arch::aarch64::*;
use std::array::from_fn;

use super::scalar::{LANES, WorstSample, lane_offsets, run_of, worst};
use crate::adjust::star::{self, ErrorChunk, OffsetEnvelope};
use crate::facet::{EdgeFunction, PlaneFacet};
use crate::heights::FieldLevel;
use terrane_base::geom::predicates::orient;

/// See [`Scan`](super::Scan).
pub(super) fn scan(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    // SAFETY: NEON is part of aarch64.
    unsafe { scan_neon(level, facet) }
}

/// See [`star::list`].
pub(super) fn list_star(
    chunks: &mut [ErrorChunk],
    level: &FieldLevel<'_>,
    facet: &PlaneFacet,
) -> usize {
    // SAFETY: NEON is part of aarch64.
    unsafe { list_star_neon(chunks, level, facet) }
}

/// See [`star::envelope`].
pub(super) fn star_envelope(chunks: &[ErrorChunk], step: f32) -> OffsetEnvelope {
    // SAFETY: NEON is part of aarch64.
    unsafe { star_envelope_neon(chunks, step) }
}

/// The worst sample of each lane.
struct WorstOfLanes {
    errors: float32x4_t,
    /// `row << 16 | column` in decimated units.
    places: uint32x4_t,
}

impl WorstOfLanes {
    #[inline]
    #[target_feature(enable = "neon")]
    fn new() -> Self {
        Self { errors: vdupq_n_f32(0.0), places: vdupq_n_u32(0) }
    }

    /// Adds samples that follow all others of their lane by row and column.
    #[inline]
    #[target_feature(enable = "neon")]
    fn add(
        &mut self,
        samples: float32x4_t,
        planes: float32x4_t,
        inside: uint32x4_t,
        place: int32x4_t,
    ) {
        let error = vreinterpretq_u32_f32(vabdq_f32(samples, planes));
        let error = vreinterpretq_f32_u32(vandq_u32(error, inside));
        let place = vreinterpretq_u32_s32(place);
        // Both are false for NaN, so void samples are never the worst.
        self.places = vbslq_u32(vcgtq_f32(error, self.errors), place, self.places);
        self.errors = vmaxnmq_f32(self.errors, error);
    }

    /// Of equal errors the lowest row and column, as in the scalar scan.
    #[inline]
    #[target_feature(enable = "neon")]
    fn finish(self, level: &FieldLevel<'_>) -> WorstSample {
        let error = vmaxvq_f32(self.errors);
        let equal = vceqq_f32(self.errors, vdupq_n_f32(error));
        worst(level, error, vminvq_u32(vornq_u32(self.places, equal)))
    }
}

/// The edges of a triangle in `4 * N` columns of a row.
struct EdgeLanes<const N: usize> {
    /// Edge functions, by edge and column.
    sides: [[int32x4_t; N]; 3],
    steps: [int32x4_t; 3],
}

impl<const N: usize> EdgeLanes<N> {
    /// The first row; columns beyond `right` are outside.
    #[inline]
    #[target_feature(enable = "neon")]
    fn new(facet: &PlaneFacet, stride: i32, [left, first]: [i32; 2], right: i32) -> Self {
        let edges = facet.edge_functions(stride, [left, first]);
        let along = |edge: EdgeFunction, quad: usize| {
            let from = vdupq_n_s32(edge.start);
            vmlaq_n_s32(from, columns(4 * quad as i32), edge.per_column)
        };
        let mut sides = edges.map(|edge| from_fn(|quad| along(edge, quad)));
        for (quad, side) in sides[1].iter_mut().enumerate() {
            let beyond = vcgtq_s32(columns(left + 4 * quad as i32), vdupq_n_s32(right));
            *side = vbslq_s32(beyond, vdupq_n_s32(EdgeFunction::FAR_OUTSIDE), *side);
        }
        Self { sides, steps: edges.map(|edge| vdupq_n_s32(edge.per_row)) }
    }

    /// Negative outside the triangle.
    #[inline]
    #[target_feature(enable = "neon")]
    fn signs(&self, quad: usize) -> int32x4_t {
        let [a, b, c] = [0, 1, 2].map(|edge| self.sides[edge][quad]);
        vorrq_s32(vorrq_s32(a, b), c)
    }

    #[inline]
    #[target_feature(enable = "neon")]
    fn next_row(&mut self) {
        for (sides, step) in self.sides.iter_mut().zip(self.steps) {
            *sides = sides.map(|side| vaddq_s32(side, step));
        }
    }
}

/// The columns from `first` on.
#[inline]
#[target_feature(enable = "neon")]
fn columns(first: i32) -> int32x4_t {
    vaddq_s32(vdupq_n_s32(first), bytemuck::cast([0, 1, 2, 3]))
}

#[inline(always)]
fn load<const N: usize>(heights: &[f32], at: usize) -> [float32x4_t; N] {
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(&heights[at..][..4 * N]))
}

#[target_feature(enable = "neon")]
fn scan_neon(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let [left, right] = facet.column_range(level);
    match right - left {
        ..4 => narrow::<1>(level, facet),
        4..8 => narrow::<2>(level, facet),
        8..16 => narrow::<4>(level, facet),
        _ => wide(level, facet),
    }
}

/// A triangle of at most `4 * N` columns, all within a run of lanes: the signs of three edge functions determine its
/// samples.
#[target_feature(enable = "neon")]
fn narrow<const N: usize>(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let stride = 1 << level.shift;
    let [gx, gy] = [facet.gx, facet.gy].map(|slope| slope * f64::from(stride));
    let ([left, right], [first, last]) = (facet.column_range(level), facet.row_range(level));
    let offsets: [_; N] = load(&lane_offsets(gx), 0);
    let mut edges = EdgeLanes::<N>::new(facet, stride, [left, first], right);
    let mut worst = WorstOfLanes::new();
    for row in first..=last {
        let plane = (facet.base + gy * f64::from(row) + gx * f64::from(left)) as f32;
        let samples: [_; N] = load(level.heights, row as usize * level.pitch + left as usize);
        for quad in 0..N {
            let inside = vcgezq_s32(edges.signs(quad));
            let planes = vaddq_f32(vdupq_n_f32(plane), offsets[quad]);
            let place = vorrq_s32(columns(left + 4 * quad as i32), vdupq_n_s32(row << 16));
            worst.add(samples[quad], planes, inside, place);
        }
        edges.next_row();
    }
    worst.finish(level)
}

/// A triangle of any width, by the ends of its rows.
#[target_feature(enable = "neon")]
fn wide(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let stride = f64::from(1_u32 << level.shift);
    let (gx, gy) = (facet.gx * stride, facet.gy * stride);
    let offsets: [_; LANES / 4] = load(&lane_offsets(gx), 0);
    let ([left, _], [first, last]) = (facet.column_range(level), facet.row_range(level));
    let edges = facet.edges();
    let mut worst = WorstOfLanes::new();
    for row in first..=last {
        let [low, high] = edges.columns(level, row);
        let start = facet.base + gy * f64::from(row);
        let line = &level.heights[row as usize * level.pitch..];
        let mut run = run_of(low, left);
        while run <= high {
            let plane = vdupq_n_f32((start + gx * f64::from(run)) as f32);
            let samples: [_; LANES / 4] = load(line, run as usize);
            for quad in 0..LANES / 4 {
                let columns = columns(run + 4 * quad as i32);
                let inside = vandq_u32(
                    vcgeq_s32(columns, vdupq_n_s32(low)),
                    vcleq_s32(columns, vdupq_n_s32(high)),
                );
                let place = vorrq_s32(columns, vdupq_n_s32(row << 16));
                worst.add(samples[quad], vaddq_f32(plane, offsets[quad]), inside, place);
            }
            run += LANES as i32;
        }
    }
    worst.finish(level)
}

#[target_feature(enable = "neon")]
fn list_star_neon(chunks: &mut [ErrorChunk], level: &FieldLevel<'_>, facet: &PlaneFacet) -> usize {
    let stride = 1 << level.shift;
    let ([left, right], [first, last]) = (facet.column_range(level), facet.row_range(level));
    let [gx, gy] = [facet.gx, facet.gy].map(|slope| slope * f64::from(stride));
    let [a, b, c] = facet.corners;
    let scale = 1.0 / orient(a, b, c) as f32;
    let mut count = 0;
    for strip in (left..=right).step_by(star::LANES) {
        let mut edges = EdgeLanes::<2>::new(facet, stride, [strip, first], right);
        let start = facet.base + gy * f64::from(first);
        let at = |lane: i32| start + gx * f64::from(strip + lane);
        let mut planes: [float64x2_t; 4] = bytemuck::cast([0, 1, 2, 3, 4, 5, 6, 7].map(at));
        for row in first..=last {
            let signs = [0, 1].map(|quad| edges.signs(quad));
            if vmaxvq_s32(vmaxq_s32(signs[0], signs[1])) >= 0 {
                let at = row as usize * level.pitch + strip as usize;
                let samples: [_; 2] = load(level.heights, at);
                let offsets: [_; 2] = from_fn(|quad| {
                    let low =
                        vsubq_f64(planes[2 * quad], vcvt_f64_f32(vget_low_f32(samples[quad])));
                    let high = vsubq_f64(planes[2 * quad + 1], vcvt_high_f64_f32(samples[quad]));
                    let offsets = vcvt_high_f32_f64(vcvt_f32_f64(low), high);
                    vbslq_f32(vcltzq_s32(signs[quad]), vdupq_n_f32(f32::NAN), offsets)
                });
                let shares = edges.sides[0].map(|side| vmulq_n_f32(vcvtq_f32_s32(side), scale));
                let (offsets, shares) = (bytemuck::cast(offsets), bytemuck::cast(shares));
                chunks[count] = ErrorChunk { offsets, shares };
                count += 1;
            }
            edges.next_row();
            planes = planes.map(|planes| vaddq_f64(planes, vdupq_n_f64(gy)));
        }
    }
    count
}

#[target_feature(enable = "neon")]
fn star_envelope_neon(chunks: &[ErrorChunk], step: f32) -> OffsetEnvelope {
    // Error, offset and share of the extreme sample of each lane.
    let extremes = |error| [[vdupq_n_f32(error); 2], [vdupq_n_f32(0.0); 2], [vdupq_n_f32(0.0); 2]];
    let (mut top, mut bottom) = (extremes(f32::NEG_INFINITY), extremes(f32::INFINITY));
    for chunk in chunks {
        let [offsets, shares]: [[float32x4_t; 2]; 2] =
            [chunk.offsets, chunk.shares].map(bytemuck::cast);
        for half in 0..2 {
            let error = vaddq_f32(offsets[half], vmulq_n_f32(shares[half], step));
            let is_top = vcgtq_f32(error, top[0][half]);
            let is_bottom = vcltq_f32(error, bottom[0][half]);
            for (i, value) in [error, offsets[half], shares[half]].into_iter().enumerate() {
                top[i][half] = vbslq_f32(is_top, value, top[i][half]);
                bottom[i][half] = vbslq_f32(is_bottom, value, bottom[i][half]);
            }
        }
    }
    OffsetEnvelope::of_lanes(step, top.map(bytemuck::cast), bottom.map(bytemuck::cast))
}
