//! Derivatives of a sample and its eight neighbours: slope, aspect, hillshade, roughness, position, ruggedness,
//! curvature. And the colours of heights ([`Palette`]).
//!
//! Each derivative is a file here and a line in the list of verbs. All are functions of nine heights and of the
//! ground vectors of a column and a row ([`Turn`]), so grids may be rotated or south-up.
//!
//! ```
//! use terrane_window::relief::{Derivative, Gradient, Slope};
//! // Ten metres apart, and ten metres higher by each column: 45 degrees.
//! let rows = [[0.0, 10.0, 20.0]; 3];
//! let mut out = [0.0];
//! let slope = Slope { gradient: Gradient::Horn, is_percent: false };
//! slope.row(rows.each_ref().map(|row| &row[..]), &[[0.1, 0.0], [0.0, -0.1]], &mut out);
//! assert!((out[0] - 45.0).abs() < 1e-12);
//! ```

mod aspect;
mod colours;
mod curvature;
mod position;
mod roughness;
mod ruggedness;
mod shade;
mod slope;
#[cfg(test)]
mod tests;

pub use aspect::Aspect;
pub use colours::{ColorInterpolation, ColorTable, ColorTableError, Colour, NAMES, Palette};
pub use curvature::{Curvature, CurvatureKind};
pub use position::TopographicPositionIndex;
pub use roughness::Roughness;
pub use ruggedness::{Ruggedness, RuggednessMeasure};
pub use shade::{Hillshade, HillshadeMode};
pub use slope::Slope;
use terrane_options::Choice;

/// Matrix from the gradient by column and row to that by metre east and north.
pub type Turn = [[f64; 2]; 2];

/// A sample and its neighbours: row by row from above, each from the left.
pub type Heights = [f64; 9];

/// A derivative of the surface at a sample.
pub trait Derivative: Send + Sync {
    /// The value at the fifth of nine valid heights; NaN if undefined.
    fn at(&self, heights: &Heights, turn: &Turn) -> f64;

    /// Whether values are integers from 1 to 255.
    fn is_byte(&self) -> bool {
        false
    }

    /// Range of possible values, if known.
    fn range(&self) -> Option<[f64; 2]> {
        None
    }

    /// Whether it depends on the spacing of samples.
    fn is_of_slopes(&self) -> bool {
        true
    }

    /// Values of a row of samples between two others, each with one more sample at both ends: NaN if one of the
    /// nine heights is. Takes time linear in the samples.
    fn row(&self, rows: [&[f64]; 3], turn: &Turn, out: &mut [f64]) {
        each(rows, out, f64::NAN, |heights| self.at(heights, turn));
    }
}

/// Applies a function to each sample of a row with nine valid heights, and `none` to others.
#[inline(always)]
fn each<T: Copy>(rows: [&[f64]; 3], out: &mut [T], none: T, at: impl Fn(&Heights) -> T) {
    let [above, here, below] = rows.map(|row| row.windows(3));
    for (((above, here), below), out) in above.zip(here).zip(below).zip(out) {
        let heights =
            [above[0], above[1], above[2], here[0], here[1], here[2], below[0], below[1], below[2]];
        let is_whole = !heights.iter().sum::<f64>().is_nan();
        *out = if is_whole { at(&heights) } else { none };
    }
}

/// Gradient algorithm, of nine heights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum Gradient {
    /// Eight neighbours (Horn 1981)
    #[default]
    Horn,
    /// Four direct neighbours (Zevenbergen & Thorne 1987), for smooth terrain
    ZevenbergenThorne,
}

impl Gradient {
    /// The change of height by metre east and by metre north.
    #[inline]
    fn of(self, heights: &Heights, turn: &Turn) -> [f64; 2] {
        let [a, b, c, d, _, f, g, h, i] = *heights;
        let by = match self {
            Self::Horn => [
                ((c + f + f + i) - (a + d + d + g)) / 8.0,
                ((g + h + h + i) - (a + b + b + c)) / 8.0,
            ],
            Self::ZevenbergenThorne => [(f - d) / 2.0, (h - b) / 2.0],
        };
        turn.map(|[col, row]| col * by[0] + row * by[1])
    }
}
