//! One octave: smooth noise on a square lattice of random values, evaluated row by row.
//!
//! Method: a uniform cubic B-spline surface over hashed lattice values (lattice noise with spline
//! filtering as in Lewis, "Algorithms for Solid Noise Synthesis", 1989): two times continuously
//! differentiable and nearly free of the lattice's directions. Along a row the noise inside a cell
//! is a cubic whose coefficients depend on the cell and the row only. Every sample is computed by
//! the same multiplications and additions in any window, so windows agree bit for bit, and
//! the result does not depend on the width of SIMD registers.

use std::ops::Range;

use super::hash::RowHash;

/// One octave of noise: a lattice whose cells are `1 << log2` samples wide.
#[derive(Clone, Copy, Debug)]
pub(super) struct Octave {
    /// Logarithm of the cell's side in samples.
    pub(super) log2: u32,
    /// Added to columns: keeps the lattices of different octaves from lining up.
    pub(super) shift_col: u32,
    /// Added to rows.
    pub(super) shift_row: u32,
    /// Seed of the lattice.
    pub(super) key: u64,
}

impl Octave {
    fn side(&self) -> usize {
        1 << self.log2
    }

    /// Cell of a shifted position, and the place in it (0 to 1).
    fn split(&self, position: u32) -> (u32, f32) {
        let inside = position & ((1 << self.log2) - 1);
        (position >> self.log2, inside as f32 / self.side() as f32)
    }
}

/// Nodes on each axis that reach into a cell: the one before it, its two, and the one after it.
const REACH: usize = 4;

/// Weights of the four nodes around place `t` of a cell.
fn spline(t: f32) -> [f32; REACH] {
    let (t2, t3, r) = (t * t, t * t * t, 1.0 - t);
    let inner = 3.0 * t3 - 6.0 * t2 + 4.0;
    [r * r * r * SIXTH, inner * SIXTH, (3.0 * (t + t2 - t3) + 1.0) * SIXTH, t3 * SIXTH]
}

/// Rounds the crests: half a width of about 0.05 in units of the noise.
const CREST: f32 = 0.008;

const SIXTH: f32 = 1.0 / 6.0;

/// A cubic in the place inside a cell.
#[derive(Clone, Copy, Debug, Default)]
struct CubicPolynomial([f32; 4]);

impl CubicPolynomial {
    /// The spline over four consecutive nodes.
    #[inline(always)]
    fn new(q: &[f32]) -> Self {
        let outer = q[0] + q[2];
        let c0 = (outer + 4.0 * q[1]) * SIXTH;
        let c1 = (q[2] - q[0]) * 0.5;
        let c2 = outer * 0.5 - q[1];
        let c3 = (q[3] - q[0] + 3.0 * (q[1] - q[2])) * SIXTH;
        Self([c0, c1, c2, c3])
    }

    #[inline(always)]
    fn at(self, u: f32) -> f32 {
        let [c0, c1, c2, c3] = self.0;
        c0 + u * (c1 + u * (c2 + u * c3))
    }
}

/// Heights and weights of one row of a run of columns.
pub(super) struct OctaveSums<'a> {
    pub(super) height: &'a mut [f32],
    /// Factor of the next octave.
    pub(super) weight: &'a mut [f32],
}

/// An octave over a run of columns, ready to be evaluated at any row.
pub(super) struct OctaveRun {
    octave: Octave,
    /// Lattice column of the first node.
    first: u32,
    /// Position of the first sample inside its cell.
    phase: usize,
    /// Place inside the cell of every sample.
    place: Vec<f32>,
    /// Lattice row of `nodes[0]`, if loaded.
    row: Option<u32>,
    /// Node values of four lattice rows.
    nodes: [Vec<f32>; REACH],
    /// Node values filtered to the current row.
    value: Vec<f32>,
}

impl OctaveRun {
    /// The octave over columns `col .. col + width`.
    pub(super) fn new(octave: Octave, col: u32, width: usize) -> Self {
        let (first, _) = octave.split(col + octave.shift_col);
        let mask = octave.side() - 1;
        let phase = (col + octave.shift_col) as usize & mask;
        let nodes = (phase + width - 1) / octave.side() + REACH;
        let place = (0..width).map(|k| ((phase + k) & mask) as f32 / octave.side() as f32);
        Self {
            octave,
            first,
            phase,
            place: place.collect(),
            row: None,
            nodes: std::array::from_fn(|_| vec![0.0; nodes]),
            value: vec![0.0; nodes],
        }
    }

    /// Turns to the samples of `row`.
    pub(super) fn turn_to(&mut self, row: u32) {
        let (lattice_row, t) = self.octave.split(row + self.octave.shift_row);
        self.load(lattice_row);
        self.filter(t);
    }

    fn load(&mut self, row: u32) {
        if self.row == Some(row) {
            return;
        }
        let reused = match self.row {
            Some(old) if old + 1 == row => REACH - 1,
            _ => 0,
        };
        // Consecutive rows share all lines of nodes except the last.
        self.nodes.rotate_left(1);
        for (nodes, row) in self.nodes.iter_mut().zip(row..).skip(reused) {
            let hash = RowHash::new(self.octave.key, row);
            for (node, col) in nodes.iter_mut().zip(self.first..) {
                *node = signed(hash.at(col));
            }
        }
        self.row = Some(row);
    }

    fn filter(&mut self, t: f32) {
        let w = spline(t);
        let n = self.value.len();
        let [q0, q1, q2, q3] = self.nodes.each_ref().map(|nodes| &nodes[..n]);
        for (i, value) in self.value.iter_mut().enumerate() {
            *value = (w[0] * q0[i] + w[1] * q1[i]) + (w[2] * q2[i] + w[3] * q3[i]);
        }
    }

    /// Calls `each` for every cell with its number and its samples.
    #[inline(always)]
    fn cells(&self, mut each: impl FnMut(usize, Range<usize>)) {
        let (side, width) = (self.octave.side(), self.place.len());
        let (mut from, mut i) = (0, 0);
        while from < width {
            let to = ((i + 1) * side - self.phase).min(width);
            each(i, from..to);
            (from, i) = (to, i + 1);
        }
    }

    /// Adds `amplitude * weight` times a noise with crests where the lattice noise is zero, and
    /// makes the weight heavier at the crests and lighter in the hollows.
    pub(super) fn add_ridged(&self, amplitude: f32, sums: &mut OctaveSums<'_>) {
        self.cells(|i, range| {
            let cell = CubicPolynomial::new(&self.value[i..i + REACH]);
            let n = range.len();
            let place = &self.place[range.clone()][..n];
            let height = &mut sums.height[range.clone()][..n];
            let weight = &mut sums.weight[range][..n];
            for k in 0..n {
                let noise = cell.at(place[k]);
                let ridge = 1.0 - (4.0 * noise * noise + CREST).sqrt();
                height[k] += amplitude * (ridge - 0.5) * weight[k];
                weight[k] = 0.5 * weight[k] + ridge * ridge;
            }
        });
    }

    /// Adds `amplitude * noise * weight` to the heights.
    pub(super) fn add_plain(&self, amplitude: f32, weight: &[f32], height: &mut [f32]) {
        match self.octave.log2 {
            2 => self.add_small::<4>(amplitude, weight, height),
            3 => self.add_small::<8>(amplitude, weight, height),
            4 => self.add_small::<16>(amplitude, weight, height),
            _ => self.cells(|i, range| self.add_cell(i, range, amplitude, weight, height)),
        }
    }

    #[inline(always)]
    #[allow(clippy::needless_range_loop)]
    fn add_cell(
        &self,
        i: usize,
        range: Range<usize>,
        amplitude: f32,
        weight: &[f32],
        height: &mut [f32],
    ) {
        let cell = CubicPolynomial::new(&self.value[i..i + REACH]);
        let n = range.len();
        let place = &self.place[range.clone()][..n];
        let weight = &weight[range.clone()][..n];
        let height = &mut height[range][..n];
        for k in 0..n {
            height[k] += amplitude * cell.at(place[k]) * weight[k];
        }
    }

    /// The same for cells of a side known to the compiler.
    fn add_small<const SIDE: usize>(&self, amplitude: f32, weight: &[f32], height: &mut [f32]) {
        let width = self.place.len();
        let head = ((SIDE - self.phase) % SIDE).min(width);
        let cells = (width - head) / SIDE;
        let first = usize::from(self.phase > 0);
        let tail = head + cells * SIDE;
        if head > 0 {
            self.add_cell(0, 0..head, amplitude, weight, height);
        }
        let place: [f32; SIDE] = std::array::from_fn(|k| k as f32 / SIDE as f32);
        let heights = height[head..tail].chunks_exact_mut(SIDE);
        let cubics = self.value[first..].windows(REACH).map(CubicPolynomial::new);
        for ((heights, weights), cell) in heights.zip(weight[head..].chunks_exact(SIDE)).zip(cubics)
        {
            for ((h, w), u) in heights.iter_mut().zip(weights).zip(&place) {
                *h += amplitude * cell.at(*u) * w;
            }
        }
        if tail < width {
            self.add_cell(first + cells, tail..width, amplitude, weight, height);
        }
    }
}

/// A number in [-1, 1) made of the upper 24 bits, exactly.
#[inline(always)]
fn signed(bits: u32) -> f32 {
    ((bits & 0xFFFF_FF00) as i32) as f32 * (1.0 / 2_147_483_648.0)
}
