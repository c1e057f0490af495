//! Values at nodes of a lattice, and polynomials between them.

use terrane_base::error::Result;

/// Values at nodes of a lattice, interpolated by cubic polynomials through four nodes along each axis.
#[derive(Debug)]
pub(crate) struct CubicTable<const N: usize> {
    from: [f64; 2],
    pub(crate) step: [f64; 2],
    pub(crate) parts: [u32; 2],
    nodes: Vec<[f64; N]>,
}

impl<const N: usize> CubicTable<N> {
    /// Tabulates a function on a rectangle divided into parts.
    pub(crate) fn new(
        sides: [[f64; 2]; 2],
        parts: [u32; 2],
        of: impl Fn([f64; 2]) -> Result<[f64; N]>,
    ) -> Result<Self> {
        let from = sides.map(|[low, _]| low);
        let step =
            [0, 1].map(|axis: usize| (sides[axis][1] - sides[axis][0]) / f64::from(parts[axis]));
        let all = (0..=parts[1]).flat_map(|row| (0..=parts[0]).map(move |col| [col, row]));
        let nodes = all.map(|node| {
            of([0, 1].map(|axis: usize| from[axis] + step[axis] * f64::from(node[axis])))
        });
        Ok(Self { from, step, parts, nodes: nodes.collect::<Result<_>>()? })
    }

    pub(crate) fn node(&self, [col, row]: [usize; 2]) -> [f64; N] {
        self.nodes[row * (self.parts[0] as usize + 1) + col]
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.nodes.len() * size_of::<[f64; N]>()) as u64
    }

    pub(crate) fn at(&self, at: [f64; 2]) -> [f64; N] {
        let [(left, across), (top, down)] = [0, 1].map(|axis: usize| {
            let part = (at[axis] - self.from[axis]) / self.step[axis];
            let first = (part.floor() - 1.0).clamp(0.0, f64::from(self.parts[axis] - 3));
            (first as usize, weights(part - first))
        });
        let mut sum = [0.0; N];
        for (row, by_row) in down.into_iter().enumerate() {
            let from = (top + row) * (self.parts[0] as usize + 1) + left;
            for (node, by_col) in self.nodes[from..from + 4].iter().zip(across) {
                let by = by_row * by_col;
                (0..N).for_each(|i| sum[i] += node[i] * by);
            }
        }
        sum
    }
}

/// Weights of four nodes at a position, in steps from the first.
fn weights(at: f64) -> [f64; 4] {
    let [a, b, c, d] = [at, at - 1.0, at - 2.0, at - 3.0];
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}
