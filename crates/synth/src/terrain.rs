//! A terrain, its kind, and the heights of any window of it.

use super::octaves::{self, OctaveSpectrum};
use terrane_base::geom::Rect;

/// Most columns or rows of a terrain.
pub const MAX_SIDE: u32 = 1 << 30;

/// A parameter of a terrain, as `key=value`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SynthParameter {
    /// Name before the equals sign.
    pub key: &'static str,
    /// One line for the help, with the unit.
    pub about: &'static str,
    /// Value when it is not given.
    pub default: f64,
    /// Least and most value allowed.
    pub range: (f64, f64),
    /// True when only whole numbers make sense.
    pub whole: bool,
}

/// One kind of terrain: an entry of [`CHARACTERS`](crate::CHARACTERS).
#[derive(Clone, Copy, Debug)]
pub struct TerrainKind {
    /// Name, the first word of `rough,size=4097,seed=7`.
    pub name: &'static str,
    /// One line for the help.
    pub about: &'static str,
    /// A parameter only this character has.
    pub own: Option<SynthParameter>,
    /// True when every height is a whole number of metres between 0 and 32767.
    pub integer: bool,
    /// True when some samples can be void.
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

/// A terrain: what [`fill_f32`](Terrain::fill_f32) computes windows of.
#[derive(Clone, Copy, Debug)]
pub struct Terrain {
    /// Its kind.
    pub character: &'static TerrainKind,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Chooses one terrain among all of its kind.
    pub seed: u64,
    /// Metres between samples.
    pub cell: f64,
    /// Metres from low plains to high peaks, about.
    pub relief: f64,
    /// Value of the character's own parameter (0 when it has none).
    pub own: f64,
}

impl Terrain {
    /// Computes the heights in metres of the samples of `rect`, row by row; voids are NaN.
    ///
    /// Time is proportional to the samples, with a set-up of the order of a hundred samples for
    /// each row and each 512 columns begun: wide or square windows pay least.
    ///
    /// # Panics
    /// When `out.len()` is not `rect.len()`, or when `rect` ends beyond [`MAX_SIDE`].
    pub fn fill_f32(&self, rect: Rect, out: &mut [f32]) {
        assert_eq!(out.len(), rect.len(), "one value for each sample of the window");
        assert!(ends_within(rect), "the window ends beyond column or row {MAX_SIDE}");
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

fn ends_within(rect: Rect) -> bool {
    let end = |from: u32, length: u32| from.checked_add(length).is_some_and(|end| end <= MAX_SIDE);
    end(rect.col, rect.width) && end(rect.row, rect.height)
}
