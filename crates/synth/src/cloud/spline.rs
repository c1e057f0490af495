//! Uniform bicubic B-splines over lattices of nodes: smooth surfaces.

/// Metres between nodes of the ground.
pub(super) const GROUND: f64 = 2.0;
/// Metres between nodes of the map of forest, fields, towns and water.
pub(super) const COVER: f64 = 64.0;

/// A window of a surface over a lattice. Coordinate p lies in cell floor(p / side), which the nodes of
/// this and the next three numbers determine.
pub(super) struct Spline {
    inverse: f64,
    first: [i64; 2],
    width: usize,
    nodes: Vec<f32>,
}

/// Nodes along each axis that determine a cell.
const REACH: u32 = 4;

impl Spline {
    /// The surface over [x min, y min, x max, y max], none of them negative. `fill` gives nodes
    /// of the window [column, row, width, height], row by row.
    pub(super) fn new(
        side: f64,
        [x0, y0, x1, y1]: [f64; 4],
        fill: impl FnOnce([u32; 4], &mut [f32]),
    ) -> Self {
        let inverse = 1.0 / side;
        let [col, row, last_col, last_row] = [x0, y0, x1, y1].map(|place| (place * inverse) as u32);
        let (width, height) = (last_col - col + REACH, last_row - row + REACH);
        let mut nodes = vec![0.0; width as usize * height as usize];
        fill([col, row, width, height], &mut nodes);
        Self { inverse, first: [i64::from(col), i64::from(row)], width: width as usize, nodes }
    }

    /// The surface at a position in the window.
    #[inline(always)]
    pub(super) fn at(&self, x: f64, y: f64) -> f64 {
        let (u, v) = (x * self.inverse, y * self.inverse);
        let (col, row) = (u as i64, v as i64);
        let (across, up) = (weights(u - col as f64), weights(v - row as f64));
        let from = (row - self.first[1]) as usize * self.width + (col - self.first[0]) as usize;
        let lines: [f64; REACH as usize] = std::array::from_fn(|k| {
            let q = &self.nodes[from + k * self.width..][..REACH as usize];
            let [q0, q1, q2, q3] = [q[0], q[1], q[2], q[3]].map(f64::from);
            (across[0] * q0 + across[1] * q1) + (across[2] * q2 + across[3] * q3)
        });
        (up[0] * lines[0] + up[1] * lines[1]) + (up[2] * lines[2] + up[3] * lines[3])
    }
}

/// Weights of the four nodes around position `t` (0 to 1) of a cell.
#[inline(always)]
fn weights(t: f64) -> [f64; 4] {
    const SIXTH: f64 = 1.0 / 6.0;
    let (t2, t3, r) = (t * t, t * t * t, 1.0 - t);
    let inner = 3.0 * t3 - 6.0 * t2 + 4.0;
    [r * r * r * SIXTH, inner * SIXTH, (3.0 * (t + t2 - t3) + 1.0) * SIXTH, t3 * SIXTH]
}
