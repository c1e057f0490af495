//! Synthetic lines: curves that are hard on methods of simplification, walks, and coverages whose
//! polygons share their borders. Any feature on its own.
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
    /// Its features are polygons of one ring, closed.
    pub is_rings: bool,
    /// Appends the vertices of a feature in the cell at its place.
    draw: fn(&SyntheticLines, Place, &mut Vec<Xy>),
}

/// Lines or rings: what [`feature`](SyntheticLines::feature) draws.
#[derive(Clone, Copy, Debug)]
pub struct SyntheticLines {
    /// Kind of the features.
    pub shape: &'static LineFamily,
    /// Vertices of each feature, at least 2; of a ring about as many.
    pub vertices: u32,
    /// How many there are, side by side in rows.
    pub features: u32,
    /// Side of a feature's cell.
    pub size: f64,
    /// Chooses one among all of its kind.
    pub seed: u64,
}

impl SyntheticLines {
    /// Replaces `out` with the vertices of feature `number`. Linear in these, but for "koch" and
    /// "coverage", which take a logarithm more.
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

    /// -1 to 1, by chance.
    fn chance(&self, of: u64, at: u64) -> f64 {
        let bits = mix64(self.seed ^ mix64(of ^ mix64(at)));
        (bits >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0
    }
}

#[cfg(test)]
mod tests;
