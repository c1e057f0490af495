//! Scans for AVX-512 and AVX2. All `unsafe` of the kernel is here.
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::scalar::{LANES, Scan, WorstSample, lane_offsets, run_of, worst};
use crate::adjust::star::{ErrorChunk, ErrorLine, OffsetEnvelope, StarKernels};
use crate::facet::{EdgeFunction, EdgeSide, PlaneFacet, RowBounds, SLACK};
use crate::heights::FieldLevel;
use crate::measure::MeasuredTriangle;
use terrane_base::geom::predicates::orient;

/// Rows whose ends are computed together.
const ROWS: usize = 8;

/// Kernels this processor runs, slowest first.
pub(super) fn available() -> Vec<(&'static str, Scan)> {
    let mut kernels: Vec<(&'static str, Scan)> = Vec::new();
    if is_x86_feature_detected!("avx2") {
        kernels.push(("avx2", scan_avx2));
    }
    if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
        kernels.push(("avx512", scan_avx512));
    }
    kernels
}

/// Kernels of stars this processor runs.
pub(super) fn available_star() -> Option<(&'static str, StarKernels)> {
    let avx2 = StarKernels { list: list_star, envelope: star_envelope };
    is_x86_feature_detected!("avx2").then_some(("avx2", avx2))
}

fn list_star(chunks: &mut [ErrorChunk], level: &FieldLevel<'_>, facet: &PlaneFacet) -> usize {
    // SAFETY: listed by `available_star` only where AVX2 was detected.
    unsafe { list_star_avx2(chunks, level, facet) }
}

fn star_envelope(chunks: &[ErrorChunk], step: f32) -> OffsetEnvelope {
    // SAFETY: listed by `available_star` only where AVX2 was detected.
    unsafe { star_envelope_avx2(chunks, step) }
}

fn scan_avx512(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    // SAFETY: listed by `available` only where AVX-512F and DQ were detected.
    unsafe { avx512(level, facet) }
}

fn scan_avx2(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    // SAFETY: listed by `available` only where AVX2 was detected.
    unsafe { avx2(level, facet) }
}

pub(super) fn measured(triangle: &MeasuredTriangle<'_>) -> Option<(f32, f32)> {
    if !is_x86_feature_detected!("avx2") {
        return None;
    }
    // SAFETY: AVX2 was detected.
    Some(unsafe { measured_avx2(triangle) })
}

#[target_feature(enable = "avx2")]
fn measured_avx2(triangle: &MeasuredTriangle<'_>) -> (f32, f32) {
    triangle.measured()
}

/// Edges as bounds without a branch: an edge that does not bound a side is moved to infinity there.
#[inline(always)]
fn bounds(edges: &RowBounds, shrink: f64) -> [[f64; 3]; 4] {
    let [left, left_slopes] = side_bounds(edges, EdgeSide::Left, f64::NEG_INFINITY, shrink);
    let [right, right_slopes] = side_bounds(edges, EdgeSide::Right, f64::INFINITY, shrink);
    [left, left_slopes, right, right_slopes]
}

/// Offsets and slopes of the edges on one side of a row; the others are moved to `far`.
#[inline(always)]
fn side_bounds(edges: &RowBounds, side: EdgeSide, far: f64, shrink: f64) -> [[f64; 3]; 2] {
    let is_bound = edges.sides.map(|other| other == side);
    [
        std::array::from_fn(|i| if is_bound[i] { edges.offsets[i] * shrink } else { far }),
        std::array::from_fn(|i| if is_bound[i] { edges.slopes[i] } else { 0.0 }),
    ]
}

/// A row's offset into the level's heights plus its first column, and whether the run of lanes
/// from there stays inside the slice.
#[inline(always)]
fn run_pointer(level: &FieldLevel<'_>, row: i32, run: i32) -> *const f32 {
    let at = row as usize * level.pitch + run as usize;
    level.heights[at..at + LANES].as_ptr()
}

#[target_feature(enable = "avx512f,avx512dq")]
fn avx512(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let [left, right] = facet.column_range(level);
    if right - left < LANES as i32 { narrow(level, facet) } else { wide(level, facet) }
}

/// A triangle within a single run of lanes: the signs of three edge functions, exact in `i32` (coordinates are below
/// 2^14), determine its samples.
#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn narrow(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let stride = 1_i32 << level.shift;
    let (gx, gy) = (facet.gx * f64::from(stride), facet.gy * f64::from(stride));
    let offsets = wide_offsets(gx);
    let ([left, right], [first, last]) = (facet.column_range(level), facet.row_range(level));
    if right < left || last < first {
        return worst(level, 0.0, 0);
    }
    let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    let functions = facet.edge_functions(stride, [left, first]);
    let mut edges = [_mm512_setzero_si512(); 3];
    let mut steps = [_mm512_setzero_si512(); 3];
    for i in 0..3 {
        let along = _mm512_mullo_epi32(_mm512_set1_epi32(functions[i].per_column), lanes);
        edges[i] = _mm512_add_epi32(_mm512_set1_epi32(functions[i].start), along);
        steps[i] = _mm512_set1_epi32(functions[i].per_row);
    }
    let columns = ((2_u32 << (right - left)) - 1) as __mmask16;
    let mut pointer = run_pointer(level, first, left);
    // Only for its check: the first and the last run are inside the slice, and so are those between.
    run_pointer(level, last, left);
    let mut errors = _mm512_setzero_ps();
    let mut places = _mm512_setzero_si512();
    let mut place = _mm512_add_epi32(_mm512_set1_epi32((first << 16) | left), lanes);
    let along = gx * f64::from(left);
    for row in first..=last {
        let outside = _mm512_or_si512(_mm512_or_si512(edges[0], edges[1]), edges[2]);
        let mask = !_mm512_movepi32_mask(outside) & columns;
        let plane = ((facet.base + gy * f64::from(row)) + along) as f32;
        // SAFETY: this row lies between the two whose runs were checked to be inside the slice.
        let samples = unsafe { _mm512_loadu_ps(pointer) };
        let planes = _mm512_add_ps(_mm512_set1_ps(plane), offsets);
        let error = _mm512_abs_ps(_mm512_sub_ps(samples, planes));
        // An ordered comparison is false for NaN, so void samples are never the worst.
        let more = _mm512_mask_cmp_ps_mask::<_CMP_GT_OQ>(mask, error, errors);
        errors = _mm512_mask_mov_ps(errors, more, error);
        places = _mm512_mask_mov_epi32(places, more, place);
        for i in 0..3 {
            edges[i] = _mm512_add_epi32(edges[i], steps[i]);
        }
        place = _mm512_add_epi32(place, _mm512_set1_epi32(1 << 16));
        pointer = pointer.wrapping_add(level.pitch);
    }
    let error = _mm512_reduce_max_ps(errors);
    // Of equal errors the lowest row and column, as the scalar scan has it: all processors make one mesh.
    let equal = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(errors, _mm512_set1_ps(error));
    worst(level, error, _mm512_mask_reduce_min_epi32(equal, places) as u32)
}

#[target_feature(enable = "avx512f,avx512dq")]
fn wide(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let stride = f64::from(1_u32 << level.shift);
    let (gx, gy) = (facet.gx * stride, facet.gy * stride);
    let [left, left_slopes, right, right_slopes] = bounds(&facet.edges(), 1.0 / stride);
    let offsets = wide_offsets(gx);
    let mut errors = _mm512_setzero_ps();
    let mut places = _mm512_setzero_si512();
    let [first, last] = facet.row_range(level);
    let [left_most, _] = facet.column_range(level);
    let ramp = _mm512_setr_pd(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
    let mut row = first;
    while row <= last {
        let rows = _mm512_add_pd(_mm512_set1_pd(f64::from(row)), ramp);
        let mut low = _mm512_set1_pd(f64::from(level.bounds[0]));
        let mut high = _mm512_set1_pd(f64::from(level.bounds[1]));
        for edge in 0..3 {
            let at = |offset: f64, slope: f64| {
                let run = _mm512_mul_pd(_mm512_set1_pd(slope), rows);
                _mm512_add_pd(_mm512_set1_pd(offset), run)
            };
            let from = at(left[edge], left_slopes[edge]);
            let to = at(right[edge], right_slopes[edge]);
            low = _mm512_max_pd(low, _mm512_sub_pd(from, _mm512_set1_pd(SLACK)));
            high = _mm512_min_pd(high, _mm512_add_pd(to, _mm512_set1_pd(SLACK)));
        }
        let low = _mm512_cvt_roundpd_epi32::<{ _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC }>(low);
        let high = _mm512_cvt_roundpd_epi32::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(high);
        let (mut lows, mut highs) = ([0_i32; ROWS], [0_i32; ROWS]);
        // SAFETY: both arrays hold the eight lanes stored.
        unsafe {
            _mm256_storeu_si256(lows.as_mut_ptr().cast(), low);
            _mm256_storeu_si256(highs.as_mut_ptr().cast(), high);
        }
        let count = ((last - row + 1) as usize).min(ROWS);
        for i in 0..count {
            let at_row = row + i as i32;
            let start = facet.base + gy * f64::from(at_row);
            let mut run = run_of(lows[i], left_most);
            while run <= highs[i] {
                let to = (highs[i] - run + 1).min(LANES as i32) as u32;
                let from = (lows[i] - run).max(0) as u32;
                let mask = (((1_u32 << to) - 1) >> from << from) as __mmask16;
                let plane = (start + gx * f64::from(run)) as f32;
                // SAFETY: `run_pointer` has checked that the whole run is inside the slice.
                let samples = unsafe { _mm512_loadu_ps(run_pointer(level, at_row, run)) };
                let planes = _mm512_add_ps(_mm512_set1_ps(plane), offsets);
                let error = _mm512_abs_ps(_mm512_sub_ps(samples, planes));
                let more = _mm512_mask_cmp_ps_mask::<_CMP_GT_OQ>(mask, error, errors);
                errors = _mm512_mask_mov_ps(errors, more, error);
                let place = _mm512_set1_epi32((at_row << 16) | run);
                places = _mm512_mask_mov_epi32(places, more, place);
                run += LANES as i32;
            }
        }
        row += ROWS as i32;
    }
    let error = _mm512_reduce_max_ps(errors);
    let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    let equal = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(errors, _mm512_set1_ps(error));
    let lowest = _mm512_mask_reduce_min_epi32(equal, _mm512_add_epi32(places, lanes));
    worst(level, error, lowest as u32)
}

#[target_feature(enable = "avx512f")]
fn wide_offsets(gx: f64) -> __m512 {
    let lanes = _mm512_setr_pd(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
    let gx = _mm512_set1_pd(gx);
    let low = _mm512_cvtpd_ps(_mm512_mul_pd(gx, lanes));
    let high = _mm512_cvtpd_ps(_mm512_mul_pd(gx, _mm512_add_pd(lanes, _mm512_set1_pd(8.0))));
    let wide = _mm512_castps_pd(_mm512_castps256_ps512(low));
    _mm512_castpd_ps(_mm512_insertf64x4::<1>(wide, _mm256_castps_pd(high)))
}

/// As [`narrow`], for triangles of at most eight columns.
#[inline]
#[target_feature(enable = "avx2")]
fn narrow8(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let stride = 1_i32 << level.shift;
    let (gx, gy) = (facet.gx * f64::from(stride), facet.gy * f64::from(stride));
    let ([left, right], [first, last]) = (facet.column_range(level), facet.row_range(level));
    if right < left || last < first {
        return worst(level, 0.0, 0);
    }
    let half = |from: f64| {
        let lanes = _mm256_add_pd(_mm256_setr_pd(0.0, 1.0, 2.0, 3.0), _mm256_set1_pd(from));
        _mm256_cvtpd_ps(_mm256_mul_pd(_mm256_set1_pd(gx), lanes))
    };
    let offsets = _mm256_set_m128(half(4.0), half(0.0));
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let functions = facet.edge_functions(stride, [left, first]);
    let mut edges = [_mm256_setzero_si256(); 3];
    let mut steps = [_mm256_setzero_si256(); 3];
    for i in 0..3 {
        let along = _mm256_mullo_epi32(_mm256_set1_epi32(functions[i].per_column), lanes);
        edges[i] = _mm256_add_epi32(_mm256_set1_epi32(functions[i].start), along);
        steps[i] = _mm256_set1_epi32(functions[i].per_row);
    }
    let beyond = _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(right - left));
    let mut pointer = run_pointer(level, first, left);
    run_pointer(level, last, left);
    let mut errors = _mm256_setzero_ps();
    let mut places = _mm256_setzero_si256();
    let mut place = _mm256_add_epi32(_mm256_set1_epi32((first << 16) | left), lanes);
    let along = gx * f64::from(left);
    for row in first..=last {
        let two = _mm256_or_si256(edges[0], edges[1]);
        let outside = _mm256_or_si256(two, _mm256_or_si256(edges[2], beyond));
        let plane = ((facet.base + gy * f64::from(row)) + along) as f32;
        // SAFETY: this row lies between the two whose runs were checked to be inside the slice.
        let samples = unsafe { _mm256_loadu_ps(pointer) };
        let planes = _mm256_add_ps(_mm256_set1_ps(plane), offsets);
        let error = _mm256_andnot_ps(_mm256_set1_ps(-0.0), _mm256_sub_ps(samples, planes));
        let more = _mm256_cmp_ps::<_CMP_GT_OQ>(error, errors);
        let more = _mm256_andnot_ps(_mm256_castsi256_ps(outside), more);
        errors = _mm256_blendv_ps(errors, error, more);
        places = _mm256_castps_si256(_mm256_blendv_ps(
            _mm256_castsi256_ps(places),
            _mm256_castsi256_ps(place),
            more,
        ));
        for i in 0..3 {
            edges[i] = _mm256_add_epi32(edges[i], steps[i]);
        }
        place = _mm256_add_epi32(place, _mm256_set1_epi32(1 << 16));
        pointer = pointer.wrapping_add(level.pitch);
    }
    let swapped = _mm256_max_ps(errors, _mm256_permute2f128_ps::<1>(errors, errors));
    let swapped = _mm256_max_ps(swapped, _mm256_shuffle_ps::<0b01_00_11_10>(swapped, swapped));
    let largest = _mm256_max_ps(swapped, _mm256_shuffle_ps::<0b10_11_00_01>(swapped, swapped));
    let less = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(errors, largest));
    let places = _mm256_or_si256(places, _mm256_srli_epi32::<1>(less));
    let lowest = _mm256_min_epi32(places, _mm256_permute2x128_si256::<1>(places, places));
    let lowest = _mm256_min_epi32(lowest, _mm256_shuffle_epi32::<0b01_00_11_10>(lowest));
    let lowest = _mm256_min_epi32(lowest, _mm256_shuffle_epi32::<0b10_11_00_01>(lowest));
    worst(level, _mm256_cvtss_f32(largest), _mm256_extract_epi32::<0>(lowest) as u32)
}

#[target_feature(enable = "avx2")]
fn avx2(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let [left, right] = facet.column_range(level);
    if right - left < 8 { narrow8(level, facet) } else { wide8(level, facet) }
}

#[target_feature(enable = "avx2")]
fn wide8(level: &FieldLevel<'_>, facet: &PlaneFacet) -> WorstSample {
    let stride = f64::from(1_u32 << level.shift);
    let (gx, gy) = (facet.gx * stride, facet.gy * stride);
    let [left, left_slopes, right, right_slopes] = bounds(&facet.edges(), 1.0 / stride);
    let lanes = lane_offsets(gx);
    // SAFETY: the array holds sixteen lanes.
    let offsets =
        unsafe { [_mm256_loadu_ps(lanes.as_ptr()), _mm256_loadu_ps(lanes[8..].as_ptr())] };
    let numbers = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let mut errors = [_mm256_setzero_ps(); 2];
    let mut places = [_mm256_setzero_si256(); 2];
    let [first, last] = facet.row_range(level);
    let [left_most, _] = facet.column_range(level);
    for row in first..=last {
        let (mut low, mut high) = (f64::from(level.bounds[0]), f64::from(level.bounds[1]));
        for edge in 0..3 {
            low = low.max(left[edge] + left_slopes[edge] * f64::from(row) - SLACK);
            high = high.min(right[edge] + right_slopes[edge] * f64::from(row) + SLACK);
        }
        let (low, high) = (low.ceil() as i32, high.floor() as i32);
        let start = facet.base + gy * f64::from(row);
        for run in (run_of(low, left_most)..=high).step_by(LANES) {
            let plane = _mm256_set1_ps((start + gx * f64::from(run)) as f32);
            let pointer = run_pointer(level, row, run);
            for half in 0..2 {
                let columns = _mm256_add_epi32(_mm256_set1_epi32(run + 8 * half as i32), numbers);
                let inside = _mm256_andnot_si256(
                    _mm256_cmpgt_epi32(columns, _mm256_set1_epi32(high)),
                    _mm256_cmpgt_epi32(columns, _mm256_set1_epi32(low - 1)),
                );
                let mask = _mm256_castsi256_ps(inside);
                // SAFETY: `run_pointer` has checked all sixteen lanes of the run.
                let samples = unsafe { _mm256_loadu_ps(pointer.add(8 * half)) };
                let off = _mm256_sub_ps(samples, _mm256_add_ps(plane, offsets[half]));
                let error = _mm256_andnot_ps(_mm256_set1_ps(-0.0), off);
                let more = _mm256_cmp_ps::<_CMP_GT_OQ>(error, errors[half]);
                let more = _mm256_and_ps(more, mask);
                errors[half] = _mm256_blendv_ps(errors[half], error, more);
                let place = _mm256_set1_epi32((row << 16) | (run + 8 * half as i32));
                places[half] = _mm256_blendv_epi8(places[half], place, _mm256_castps_si256(more));
            }
        }
    }
    reduce_avx2(level, errors, places)
}

#[target_feature(enable = "avx2")]
fn reduce_avx2(level: &FieldLevel<'_>, errors: [__m256; 2], places: [__m256i; 2]) -> WorstSample {
    let (mut values, mut at) = ([0.0_f32; LANES], [0_i32; LANES]);
    for half in 0..2 {
        // SAFETY: each array holds sixteen lanes, written eight at a time.
        unsafe {
            _mm256_storeu_ps(values.as_mut_ptr().add(8 * half), errors[half]);
            _mm256_storeu_si256(at.as_mut_ptr().add(8 * half).cast(), places[half]);
        }
    }
    let error = values.iter().fold(0.0, |a: f32, &b| a.max(b));
    let lanes = (0..LANES).filter(|&lane| values[lane] == error);
    let lowest = lanes.map(|lane| at[lane] + (lane % 8) as i32).min().unwrap_or(0);
    worst(level, error, lowest as u32)
}

#[target_feature(enable = "avx2")]
fn list_star_avx2(chunks: &mut [ErrorChunk], level: &FieldLevel<'_>, facet: &PlaneFacet) -> usize {
    let stride = 1 << level.shift;
    let ([left, right], [first, last]) = (facet.column_range(level), facet.row_range(level));
    let [gx, gy] = [facet.gx, facet.gy].map(|slope| slope * f64::from(stride));
    let [a, b, c] = facet.corners;
    let scale = _mm256_set1_ps(1.0 / orient(a, b, c) as f32);
    let numbers = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let rise = _mm256_set1_pd(gy);
    if last < first {
        return 0;
    }
    let (mut count, mut strip) = (0, left);
    while strip <= right {
        let edges = facet.edge_functions(stride, [strip, first]);
        let (mut sides, mut steps) = ([_mm256_setzero_si256(); 3], [_mm256_setzero_si256(); 3]);
        for i in 0..3 {
            let along = _mm256_mullo_epi32(_mm256_set1_epi32(edges[i].per_column), numbers);
            sides[i] = _mm256_add_epi32(_mm256_set1_epi32(edges[i].start), along);
            steps[i] = _mm256_set1_epi32(edges[i].per_row);
        }
        let beyond = _mm256_cmpgt_epi32(numbers, _mm256_set1_epi32(right - strip));
        sides[1] =
            _mm256_blendv_epi8(sides[1], _mm256_set1_epi32(EdgeFunction::FAR_OUTSIDE), beyond);
        let start = _mm256_set1_pd(facet.base + gy * f64::from(first));
        let mut planes = [0, 4].map(|half| {
            let columns = _mm_add_epi32(_mm_set1_epi32(strip + half), _mm_setr_epi32(0, 1, 2, 3));
            let along = _mm256_mul_pd(_mm256_set1_pd(gx), _mm256_cvtepi32_pd(columns));
            _mm256_add_pd(start, along)
        });
        let mut pointer = run_pointer(level, first, strip);
        // Only for its check, as in `narrow`.
        run_pointer(level, last, strip);
        for _ in first..last + 1 {
            let outside = _mm256_or_si256(sides[0], _mm256_or_si256(sides[1], sides[2]));
            let outside = _mm256_castsi256_ps(outside);
            if _mm256_movemask_ps(outside) != 0xff {
                let offsets = [0, 1].map(|half| {
                    // SAFETY: this row lies between the two whose runs were checked to be inside the slice.
                    let heights = unsafe { _mm_loadu_ps(pointer.add(4 * half)) };
                    _mm256_cvtpd_ps(_mm256_sub_pd(planes[half], _mm256_cvtps_pd(heights)))
                });
                let offsets = _mm256_set_m128(offsets[1], offsets[0]);
                let offsets = _mm256_blendv_ps(offsets, _mm256_set1_ps(f32::NAN), outside);
                let shares = _mm256_mul_ps(_mm256_cvtepi32_ps(sides[0]), scale);
                let chunk = &mut chunks[count];
                // SAFETY: both arrays hold eight lanes.
                unsafe {
                    _mm256_storeu_ps(chunk.offsets.as_mut_ptr(), offsets);
                    _mm256_storeu_ps(chunk.shares.as_mut_ptr(), shares);
                }
                count += 1;
            }
            for edge in 0..3 {
                sides[edge] = _mm256_add_epi32(sides[edge], steps[edge]);
            }
            planes = planes.map(|half| _mm256_add_pd(half, rise));
            pointer = pointer.wrapping_add(level.pitch);
        }
        strip += 8;
    }
    count
}

#[target_feature(enable = "avx2")]
fn star_envelope_avx2(chunks: &[ErrorChunk], step: f32) -> OffsetEnvelope {
    let zero = _mm256_setzero_ps();
    let steps = _mm256_set1_ps(step);
    // Error, offset and share of the extreme sample of each lane; below, with the signs turned.
    let mut top = [_mm256_set1_ps(f32::NEG_INFINITY), zero, zero];
    let mut bottom = [_mm256_set1_ps(f32::INFINITY), zero, zero];
    for chunk in chunks {
        // SAFETY: both arrays hold eight lanes.
        let [offsets, shares] = unsafe {
            [_mm256_loadu_ps(chunk.offsets.as_ptr()), _mm256_loadu_ps(chunk.shares.as_ptr())]
        };
        let error = _mm256_add_ps(offsets, _mm256_mul_ps(steps, shares));
        let is_top = _mm256_cmp_ps::<_CMP_GT_OQ>(error, top[0]);
        let is_bottom = _mm256_cmp_ps::<_CMP_LT_OQ>(error, bottom[0]);
        top[0] = _mm256_max_ps(error, top[0]);
        bottom[0] = _mm256_min_ps(error, bottom[0]);
        for (i, values) in [offsets, shares].into_iter().enumerate() {
            top[i + 1] = _mm256_blendv_ps(top[i + 1], values, is_top);
            bottom[i + 1] = _mm256_blendv_ps(bottom[i + 1], values, is_bottom);
        }
    }
    let (max, high) = extreme_line(top);
    let (min, low) = extreme_line([_mm256_sub_ps(zero, bottom[0]), bottom[1], bottom[2]]);
    OffsetEnvelope { step, max: [max, min], lines: [high, low] }
}

/// The largest error and its line, of the first lane in a tie.
#[target_feature(enable = "avx2")]
fn extreme_line([errors, offsets, shares]: [__m256; 3]) -> (f32, ErrorLine) {
    let swapped = _mm256_max_ps(errors, _mm256_permute2f128_ps::<1>(errors, errors));
    let swapped = _mm256_max_ps(swapped, _mm256_shuffle_ps::<0b01_00_11_10>(swapped, swapped));
    let largest = _mm256_max_ps(swapped, _mm256_shuffle_ps::<0b10_11_00_01>(swapped, swapped));
    let equal = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(errors, largest));
    let lane = _mm256_set1_epi32(equal.trailing_zeros() as i32);
    let [offset, share] =
        [offsets, shares].map(|values| _mm256_cvtss_f32(_mm256_permutevar8x32_ps(values, lane)));
    (_mm256_cvtss_f32(largest), ErrorLine { offset, share })
}
