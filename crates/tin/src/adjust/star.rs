//! Errors of the samples around a vertex as linear functions of its height, and the height that minimizes the largest.
//!
//! Rows of a triangle are listed in chunks of [`LANES`] samples. This is the reference in portable Rust; kernels for
//! vector registers equal it bit for bit.

use crate::facet::{EdgeFunction, PlaneFacet, level_for};
use crate::heights::{FieldLevel, HeightField, LEVELS};
use crate::mesh::{LatticeMesh, next, prev};
use crate::scan;
use terrane_base::geom::predicates::orient;

/// Samples of a chunk. Part of the arithmetic: of equal errors, the first lane's is the extreme.
pub(crate) const LANES: usize = 8;
/// Approximate number of samples tested per triangle before the final tolerance is reached.
const ENOUGH: i64 = 32;
/// Minimum relative reduction of a star's maximum error by a move.
pub(super) const GAIN: f32 = 1.0 / 32.0;
/// Maximum relative distance of a move's largest error from that of the best.
const EVEN: f32 = 1.0 / 1024.0;

/// Errors of neighbouring samples of a row.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ErrorChunk {
    /// Height of the mesh above each sample; NaN outside the triangle.
    pub(crate) offsets: [f32; LANES],
    /// Share of each sample in a move of the vertex, from 0 to 1.
    pub(crate) shares: [f32; LANES],
}

/// Errors of the samples of a star.
#[derive(Debug)]
pub(super) struct StarErrors {
    /// The first `count` are of the star; the others were of larger ones.
    chunks: Vec<ErrorChunk>,
    count: usize,
    kernels: StarKernels,
}

/// Kernels for an instruction set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StarKernels {
    /// See [`list`].
    pub(crate) list: fn(&mut [ErrorChunk], &FieldLevel<'_>, &PlaneFacet) -> usize,
    /// See [`envelope`].
    pub(crate) envelope: fn(&[ErrorChunk], f32) -> OffsetEnvelope,
}

/// The error of a sample by the height of the vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ErrorLine {
    pub(crate) offset: f32,
    pub(crate) share: f32,
}

/// The largest errors of a star, after a move of its vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OffsetEnvelope {
    pub(crate) step: f32,
    /// Maximum errors above and below the samples.
    pub(crate) max: [f32; 2],
    /// The samples with these errors.
    pub(crate) lines: [ErrorLine; 2],
}

impl OffsetEnvelope {
    /// From the errors, offsets and shares of the extreme samples of each lane: above, and below.
    #[inline(always)]
    pub(crate) fn of_lanes(step: f32, top: [[f32; LANES]; 3], bottom: [[f32; LANES]; 3]) -> Self {
        let ([above, below], lanes) = ([&top[0], &bottom[0]], 1..LANES);
        let high = lanes.clone().fold(0, |best, i| if above[i] > above[best] { i } else { best });
        let low = lanes.fold(0, |best, i| if below[i] < below[best] { i } else { best });
        let line = |[_, offsets, shares]: [[f32; LANES]; 3], lane| ErrorLine {
            offset: offsets[lane],
            share: shares[lane],
        };
        let lines = [line(top, high), line(bottom, low)];
        Self { step, max: [above[high], -below[low]], lines }
    }

    pub(super) fn largest(self) -> f32 {
        self.max[0].max(self.max[1])
    }

    /// The move at which the two extreme lines meet, and their error there: no move has a smaller maximum error.
    fn meeting(self) -> (f32, f32) {
        let [top, bottom] = self.lines;
        let step = -(top.offset + bottom.offset) / (top.share + bottom.share);
        // Level lines do not meet.
        let least = if step.is_finite() { top.offset + step * top.share } else { self.largest() };
        (step, least)
    }
}

/// A move of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VertexMove {
    pub(super) step: f32,
    /// Maximum error of the star before the move.
    pub(super) before: f32,
}

/// Lists the samples of a triangle whose first corner moves, including its edges; returns the number of chunks.
/// There must be space for [`chunks_of`] the triangle.
pub(crate) fn list(chunks: &mut [ErrorChunk], level: &FieldLevel<'_>, facet: &PlaneFacet) -> usize {
    const NUMBERS: [i32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7];
    let stride = 1 << level.shift;
    let ([left, right], [first, last]) = (facet.column_range(level), facet.row_range(level));
    let [gx, gy] = [facet.gx, facet.gy].map(|slope| slope * f64::from(stride));
    let [a, b, c] = facet.corners;
    let scale = 1.0 / orient(a, b, c) as f32;
    let mut count = 0;
    for strip in (left..=right).step_by(LANES) {
        let edges = facet.edge_functions(stride, [strip, first]);
        let mut sides = edges.map(|edge| NUMBERS.map(|lane| edge.start + edge.per_column * lane));
        for lane in (0..LANES).filter(|&lane| strip + NUMBERS[lane] > right) {
            sides[1][lane] = EdgeFunction::FAR_OUTSIDE;
        }
        let start = facet.base + gy * f64::from(first);
        let mut planes = NUMBERS.map(|lane| start + gx * f64::from(strip + lane));
        for row in first..=last {
            let heights = &level.heights[row as usize * level.pitch + strip as usize..][..LANES];
            let is_outside: [bool; LANES] =
                std::array::from_fn(|lane| sides[0][lane] | sides[1][lane] | sides[2][lane] < 0);
            if is_outside != [true; LANES] {
                chunks[count].offsets = std::array::from_fn(|lane| {
                    let offset = (planes[lane] - f64::from(heights[lane])) as f32;
                    if is_outside[lane] { f32::NAN } else { offset }
                });
                chunks[count].shares = sides[0].map(|side| side as f32 * scale);
                count += 1;
            }
            for (side, edge) in sides.iter_mut().zip(edges) {
                side.iter_mut().for_each(|lane| *lane += edge.per_row);
            }
            planes.iter_mut().for_each(|plane| *plane += gy);
        }
    }
    count
}

/// Maximum number of chunks of a triangle.
pub(super) fn chunks_of(level: &FieldLevel<'_>, facet: &PlaneFacet) -> usize {
    let [[left, right], [first, last]] = [facet.column_range(level), facet.row_range(level)];
    let (columns, rows) = ((right - left + 1).max(0) as usize, (last - first + 1).max(0) as usize);
    columns.div_ceil(LANES) * rows
}

/// The largest errors after a move.
pub(crate) fn envelope(chunks: &[ErrorChunk], step: f32) -> OffsetEnvelope {
    let (mut top, mut top_offset, mut top_share) =
        ([f32::NEG_INFINITY; LANES], [0.0; LANES], [0.0; LANES]);
    let (mut bottom, mut bottom_offset, mut bottom_share) =
        ([f32::INFINITY; LANES], [0.0; LANES], [0.0; LANES]);
    for ErrorChunk { offsets, shares } in chunks {
        for lane in 0..LANES {
            // Comparisons with NaN are false.
            let error = offsets[lane] + step * shares[lane];
            let is_top = error > top[lane];
            top[lane] = if is_top { error } else { top[lane] };
            top_offset[lane] = if is_top { offsets[lane] } else { top_offset[lane] };
            top_share[lane] = if is_top { shares[lane] } else { top_share[lane] };
            let is_bottom = error < bottom[lane];
            bottom[lane] = if is_bottom { error } else { bottom[lane] };
            bottom_offset[lane] = if is_bottom { offsets[lane] } else { bottom_offset[lane] };
            bottom_share[lane] = if is_bottom { shares[lane] } else { bottom_share[lane] };
        }
    }
    OffsetEnvelope::of_lanes(
        step,
        [top, top_offset, top_share],
        [bottom, bottom_offset, bottom_share],
    )
}

impl Default for StarErrors {
    fn default() -> Self {
        Self { chunks: Vec::new(), count: 0, kernels: scan::fastest_star() }
    }
}

impl StarErrors {
    /// Lists the samples of a star, given by its half-edges: all of them, or a subset.
    pub(super) fn list(
        &mut self,
        field: &HeightField,
        mesh: &LatticeMesh,
        star: &[u32],
        all: bool,
    ) {
        self.count = 0;
        for &half_edge in star {
            let tri = &mesh.tris[(half_edge >> 2) as usize];
            let corner = half_edge & 3;
            let corners =
                [corner, next(corner), prev(corner)].map(|corner| tri.corners[corner as usize]);
            let level = if all { 0 } else { level_for(corners, ENOUGH, LEVELS) };
            let facet = PlaneFacet::new(corners, field.vertices(corners));
            let level = field.level(level);
            let end = self.count + chunks_of(&level, &facet);
            if self.chunks.len() < end {
                self.chunks.resize(end, ErrorChunk::default());
            }
            self.count += (self.kernels.list)(&mut self.chunks[self.count..end], &level, &facet);
        }
    }

    /// The largest errors after a move.
    pub(super) fn envelope(&self, step: f32) -> OffsetEnvelope {
        (self.kernels.envelope)(&self.chunks[..self.count], step)
    }

    /// The move with the least maximum error among `steps` iterations, if the gain suffices. Iterates over
    /// intersections of the two extreme lines, and bisects if an intersection diverges.
    pub(super) fn best_move(&self, steps: usize) -> Option<VertexMove> {
        let first = self.envelope(0.0);
        let enough = first.largest() * (1.0 - GAIN);
        let (mut at, mut best) = (first, first);
        let mut between = [f32::NEG_INFINITY, f32::INFINITY];
        for _ in 0..steps {
            let (step, least) = at.meeting();
            if least >= enough || least >= best.largest() * (1.0 - EVEN) {
                break;
            }
            between[usize::from(at.max[0] > at.max[1])] = at.step;
            // The lines furthest out now may meet outside of what is left of the interval, as others take over.
            let is_between = between[0] < step && step < between[1];
            let step = if is_between { step } else { f32::midpoint(between[0], between[1]) };
            if !step.is_finite() {
                break;
            }
            at = self.envelope(step);
            if at.largest() < best.largest() {
                best = at;
            }
        }
        let before = first.largest();
        (best.largest() < enough).then_some(VertexMove { step: best.step, before })
    }
}

#[cfg(test)]
impl StarErrors {
    /// Errors given by offset and share.
    pub(super) fn of(errors: impl Iterator<Item = (f32, f32)>) -> Self {
        let mut chunks = Vec::new();
        for (i, (offset, share)) in errors.enumerate() {
            if i % LANES == 0 {
                chunks.push(ErrorChunk { offsets: [f32::NAN; LANES], shares: [0.0; LANES] });
            }
            let chunk: &mut ErrorChunk = &mut chunks[i / LANES];
            (chunk.offsets[i % LANES], chunk.shares[i % LANES]) = (offset, share);
        }
        Self { count: chunks.len(), chunks, kernels: scan::fastest_star() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::HeightWindow;
    use crate::lattice_position::TilePosition;
    use proptest::prelude::*;

    const SIDE: u32 = 70;

    fn field(seed: u32, margin: u32) -> HeightField {
        let height = |i: u32| ((i ^ seed).wrapping_mul(0x9e37_79b9) >> 20) as f32 * 0.37 - 700.0;
        let heights: Vec<f32> = (0..SIDE * SIDE).map(height).collect();
        let heights = HeightWindow { width: SIDE, height: SIDE, f32: &heights, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, SIDE, SIDE], [margin; 4], None);
        field
    }

    fn bits(chunks: &[ErrorChunk]) -> Vec<[[u32; LANES]; 2]> {
        chunks
            .iter()
            .map(|chunk| [chunk.offsets, chunk.shares].map(|v| v.map(f32::to_bits)))
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn kernels_agree_bit_for_bit(
            p in prop::array::uniform3((0..SIDE, 0..SIDE)), z in prop::array::uniform3(-900.0..900.0_f64),
            level in 0..LEVELS as u8, margin in 0_u32..2, seed in 0_u32..9, step in -50.0..50.0_f32
        ) {
            let p = p.map(|(col, row)| TilePosition::new(col, row));
            let [a, b, c] = p.map(TilePosition::lattice);
            prop_assume!(orient(a, b, c) > 0);
            let (field, facet) = (field(seed, margin), PlaneFacet::new(p, z));
            let level = field.level(level);
            let mut expected = vec![ErrorChunk::default(); chunks_of(&level, &facet)];
            let count = list(&mut expected, &level, &facet);
            for (name, kernels) in scan::available_star() {
                let mut chunks = vec![ErrorChunk::default(); expected.len()];
                prop_assert_eq!((kernels.list)(&mut chunks, &level, &facet), count, "{}", name);
                prop_assert_eq!(bits(&chunks), bits(&expected), "{}", name);
                for step in [0.0, step] {
                    let found = (kernels.envelope)(&chunks[..count], step);
                    prop_assert_eq!(found, envelope(&expected[..count], step), "{}", name);
                }
            }
        }
    }

    proptest! {
        /// Samples that a plane meets: only the rounding errors of the plane are seen.
        #[test]
        fn kernels_round_planes_alike(
            at in (0..30_u32, 0..30_u32), [width, height] in [1..40_u32, 1..40_u32],
            [along, down] in [-9.0..9.0_f64, -9.0..9.0]
        ) {
            let (col, row) = at;
            let p = [(col, row), (col + width, row), (col, row + height)];
            let z = [0.0, along * f64::from(width), down * f64::from(height)];
            let facet = PlaneFacet::new(p.map(|(col, row)| TilePosition::new(col, row)), z);
            let samples = (0..SIDE * SIDE).map(|i| [i % SIDE, i / SIDE].map(f64::from));
            let samples = samples.map(|[x, y]| {
                (along * (x - f64::from(col)) + down * (y - f64::from(row))) as f32
            });
            let samples: Vec<f32> = samples.collect();
            let mut field = HeightField::default();
            let heights = HeightWindow { width: SIDE, height: SIDE, f32: &samples, f64: None };
            field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
            let level = field.level(0);
            let mut expected = vec![ErrorChunk::default(); chunks_of(&level, &facet)];
            list(&mut expected, &level, &facet);
            for (name, kernels) in scan::available_star() {
                let mut chunks = vec![ErrorChunk::default(); expected.len()];
                (kernels.list)(&mut chunks, &level, &facet);
                prop_assert_eq!(bits(&chunks), bits(&expected), "{}", name);
            }
        }
    }

    /// Rows of samples with three different errors: of equal ones, the first lane's line is told.
    #[test]
    fn kernels_agree_on_equal_errors() {
        for seed in 0..200_u32 {
            let value = |i: u32, of: u32| {
                let hash = ((seed << 6 | i) << 1 | of).wrapping_mul(0x9e37_79b9);
                f32::from((hash >> 16) as u8 % 3)
            };
            let line = |i| (value(i, 0) - 1.0 - value(i, 1) / 2.0, value(i, 1) / 2.0);
            let star = StarErrors::of((0..seed % 33).map(line));
            for (name, kernels) in scan::available_star() {
                let found = (kernels.envelope)(&star.chunks, 1.0);
                assert_eq!(found, envelope(&star.chunks, 1.0), "{name} {seed}");
            }
        }
    }
}
