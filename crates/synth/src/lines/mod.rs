//! Synthetic lines: worst cases of simplification methods, random walks, and coverages of polygons with
//! shared borders. Each feature is made independently.
//!
//! Only additions, multiplications, divisions and square roots are used: the same bits on any machine.

mod curve;
mod name;

pub use curve::SHAPES;
pub use name::PARAMETERS;

use super::hash::mix64;

type Xy = [f64; 2];

/// Column and row of a cell.
type Place = [u32; 2];

/// A family of lines.
#[derive(Clone, Copy, Debug)]
pub struct LineFamily {
    /// Its name.
    pub name: &'static str,
    /// Description for lists.
    pub about: &'static str,
    /// True if features are closed rings.
    pub is_rings: bool,
    /// Appends the vertices of a feature in the cell at its place.
    draw: fn(&SyntheticLines, Place, &mut Vec<Xy>),
}

/// Parameters of lines or rings; [`feature`](SyntheticLines::feature) makes them.
#[derive(Clone, Copy, Debug)]
pub struct SyntheticLines {
    /// Kind of the features.
    pub shape: &'static LineFamily,
    /// Vertices of each feature, at least 2; approximate for rings.
    pub vertices: u32,
    /// Number of features, side by side in rows.
    pub features: u32,
    /// Side of a feature's cell.
    pub size: f64,
    /// Random seed.
    pub seed: u64,
}

impl SyntheticLines {
    /// Replaces `out` with the vertices of feature `number`, in O(n), or O(n log n) for "koch" and "coverage".
    pub fn feature(&self, number: u32, out: &mut Vec<Xy>) {
        let across = self.across();
        out.clear();
        (self.shape.draw)(self, [number % across, number / across], out);
        out.iter_mut().flatten().for_each(|v| *v *= self.size);
    }

    /// Features in a row.
    fn across(&self) -> u32 {
        f64::from(self.features).sqrt().ceil().max(1.0) as u32
    }

    /// A random number from -1 to 1.
    fn chance(&self, of: u64, at: u64) -> f64 {
        let bits = mix64(self.seed ^ mix64(of ^ mix64(at)));
        (bits >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0
    }
}

#[cfg(test)]
mod tests;
