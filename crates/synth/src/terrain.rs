//! A terrain, its kind, and the heights of any window of it.

use super::octaves::{self, OctaveSpectrum};
use terrane_base::geom::Rect;

/// Maximum number of columns or rows of a terrain.
pub const MAX_SIDE: u32 = 1 << 30;

/// A parameter of a terrain, as `key=value`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SynthParameter {
    /// Name before the equals sign.
    pub key: &'static str,
    /// One line for the help, with the unit.
    pub about: &'static str,
    /// Default value.
    pub default: f64,
    /// Minimum and maximum value.
    pub range: (f64, f64),
    /// True for integers.
    pub whole: bool,
}

/// One kind of terrain: an entry of [`CHARACTERS`](crate::CHARACTERS).
#[derive(Clone, Copy, Debug)]
pub struct TerrainKind {
    /// Name, the first word of `rough,size=4097,seed=7`.
    pub name: &'static str,
    /// One line for the help.
    pub about: &'static str,
    /// A parameter of this character only.
    pub own: Option<SynthParameter>,
    /// True if heights are whole metres from 0 to 32767.
    pub integer: bool,
    /// True if samples can be void.
    pub voids: bool,
    pub(super) spectrum: OctaveSpectrum,
    pub(super) finish: fn(&Terrain, SampleRunStart, &[f32], &mut [f32]),
}

/// Start of a run of samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleRunStart {
    pub(super) col: u32,
    pub(super) row: u32,
}

/// Parameters of a terrain; [`fill_f32`](Terrain::fill_f32) computes heights.
#[derive(Clone, Copy, Debug)]
pub struct Terrain {
    /// Its kind.
    pub character: &'static TerrainKind,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Random seed.
    pub seed: u64,
    /// Metres between samples.
    pub cell: f64,
    /// Approximate height range in metres.
    pub relief: f64,
    /// Value of the character's own parameter (0 without one).
    pub own: f64,
}

impl Terrain {
    /// Computes the heights in metres of the samples of `rect`, row by row; voids are NaN.
    ///
    /// Time is linear in the samples, plus a set-up of about a hundred samples for each row of
    /// each 512 columns: wide or square windows are fastest.
    ///
    /// # Panics
    /// If `out.len()` is not `rect.len()`, or if `rect` ends beyond [`MAX_SIDE`].
    pub fn fill_f32(&self, rect: Rect, out: &mut [f32]) {
        assert_eq!(out.len(), rect.len(), "one value for each sample of the window");
        assert!(rect.fits(MAX_SIDE, MAX_SIDE), "the window ends beyond column or row {MAX_SIDE}");
        let window = [rect.col, rect.row, rect.width, rect.height];
        octaves::relief(&self.character.spectrum, self.seed, window, |row, col, heights| {
            let line = (row - rect.row) as usize * rect.width as usize;
            let from = line + (col - rect.col) as usize;
            let out = &mut out[from..from + heights.len()];
            (self.character.finish)(self, SampleRunStart { col, row }, heights, out);
        });
    }

    /// The height in metres of one sample, NaN when void. For whole windows use
    /// [`fill_f32`](Self::fill_f32): this costs as much as a short row.
    pub fn sample(&self, col: u32, row: u32) -> f32 {
        let mut out = [0.0];
        self.fill_f32(Rect::new(col, row, 1, 1), &mut out);
        out[0]
    }
}
