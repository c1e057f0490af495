//! A stack of octaves: the relief to which a character is applied.
//!
//! Wide swells come first and decide where mountains and plains are; ridged octaves follow, heavier
//! at crests and in the mountains (after the multifractals of Musgrave, in Ebert et al., "Texturing
//! and Modeling", 1994); the finest octaves share the last weight.

use super::hash::mix64;
use super::lattice::{Octave, OctaveRun, OctaveSums};

/// Parameters of the octaves. Octaves are named by the logarithm of their cell's side in samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct OctaveSpectrum {
    /// Coarsest octave, a swell.
    pub(super) coarsest: u32,
    /// First ridged octave.
    pub(super) ridged: u32,
    /// First octave of plain detail.
    pub(super) detail: u32,
    /// Finest octave.
    pub(super) finest: u32,
    /// Amplitude of the first octave after the swells; that of the coarsest swell is 1.
    pub(super) amplitude: f32,
    /// Amplitude of an octave over that of the next coarser one: `2^-H`.
    pub(super) gain: f32,
}

impl OctaveSpectrum {
    fn octaves(&self) -> impl Iterator<Item = u32> + use<> {
        (self.finest..=self.coarsest).rev()
    }
}

/// Columns per run, so that all sums stay in the first-level cache.
const RUN: u32 = 512;

/// Calls `finish(row, first column, heights)` for every row of every run of columns of the window
/// `[col, row, width, height]`; heights are about -1 to 1.
pub(super) fn relief(
    spectrum: &OctaveSpectrum,
    seed: u64,
    [col, row, width, height]: [u32; 4],
    mut finish: impl FnMut(u32, u32, &[f32]),
) {
    let octaves: Vec<Octave> = spectrum.octaves().map(|log2| octave(seed, log2)).collect();
    let mut heights = [0.0; RUN as usize];
    let mut weights = [0.0; RUN as usize];
    for from in (col..col + width).step_by(RUN as usize) {
        let n = RUN.min(col + width - from) as usize;
        let mut runs: Vec<OctaveRun> =
            octaves.iter().map(|o| OctaveRun::new(*o, from, n)).collect();
        for row in row..row + height {
            let sums = OctaveSums { height: &mut heights[..n], weight: &mut weights[..n] };
            add_octaves(spectrum, &mut runs, row, sums);
            finish(row, from, &heights[..n]);
        }
    }
}

/// An octave of a seed, with its own lattice.
fn octave(seed: u64, log2: u32) -> Octave {
    let key = mix64(seed ^ mix64(u64::from(log2)));
    let shift = mix64(key);
    let mask = (1 << log2) - 1;
    Octave { log2, shift_col: shift as u32 & mask, shift_row: (shift >> 32) as u32 & mask, key }
}

fn add_octaves(
    spectrum: &OctaveSpectrum,
    runs: &mut [OctaveRun],
    row: u32,
    mut sums: OctaveSums<'_>,
) {
    sums.height.fill(0.0);
    sums.weight.fill(1.0);
    let mut amplitude = 1.0;
    for (run, log2) in runs.iter_mut().zip(spectrum.octaves()) {
        if log2 == spectrum.ridged {
            weigh(&mut sums);
            amplitude = spectrum.amplitude;
        }
        run.turn_to(row);
        if (spectrum.detail + 1..=spectrum.ridged).contains(&log2) {
            run.add_ridged(amplitude, &mut sums);
        } else {
            run.add_plain(amplitude, sums.weight, sums.height);
        }
        amplitude *= spectrum.gain;
    }
}

/// Mountains where the swells are high, plains where they are low.
fn weigh(sums: &mut OctaveSums<'_>) {
    for (weight, height) in sums.weight.iter_mut().zip(sums.height.iter()) {
        let wild = 0.5 + 1.2 * height;
        let wild = if wild > 0.15 { wild } else { 0.15 };
        *weight = if wild < 1.2 { wild } else { 1.2 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::RowHash;

    const ALL: OctaveSpectrum =
        OctaveSpectrum { coarsest: 9, ridged: 7, detail: 5, finest: 2, amplitude: 0.4, gain: 0.55 };

    /// One octave at one sample, as its definition says: a sum over sixteen nodes, in `f64`.
    fn noise(octave: &Octave, col: u32, row: u32) -> f64 {
        let side = f64::from(1 << octave.log2);
        let x = f64::from(col + octave.shift_col) / side;
        let y = f64::from(row + octave.shift_row) / side;
        let mut sum = 0.0;
        for j in 0..4 {
            for i in 0..4 {
                let hash = RowHash::new(octave.key, y as u32 + j).at(x as u32 + i);
                let node = f64::from(hash as i32 >> 8) / f64::from(1 << 23);
                sum += node
                    * bell(x.fract() + 1.0 - f64::from(i))
                    * bell(y.fract() + 1.0 - f64::from(j));
            }
        }
        sum
    }

    /// The uniform cubic B-spline.
    fn bell(t: f64) -> f64 {
        match t.abs() {
            t if t < 1.0 => 2.0 / 3.0 - t * t + t * t * t / 2.0,
            t if t < 2.0 => (2.0 - t).powi(3) / 6.0,
            _ => 0.0,
        }
    }

    fn naive(spectrum: &OctaveSpectrum, seed: u64, col: u32, row: u32) -> f64 {
        let (mut height, mut weight, mut amplitude) = (0.0_f64, 1.0, 1.0);
        for log2 in spectrum.octaves() {
            if log2 == spectrum.ridged {
                weight = (0.5 + 1.2 * height).clamp(0.15, 1.2);
                amplitude = f64::from(spectrum.amplitude);
            }
            let noise = noise(&octave(seed, log2), col, row);
            if log2 <= spectrum.ridged && log2 > spectrum.detail {
                let ridge = 1.0 - (4.0 * noise * noise + 0.008_f64).sqrt();
                height += amplitude * (ridge - 0.5) * weight;
                weight = 0.5 * weight + ridge * ridge;
            } else {
                height += amplitude * noise * weight;
            }
            amplitude *= f64::from(spectrum.gain);
        }
        height
    }

    #[test]
    fn agrees_with_the_sum_over_sixteen_nodes() {
        let window = [(1 << 30) - 700, 12_345, 600, 9];
        relief(&ALL, 11, window, |row, first, heights| {
            for (col, height) in (first..).zip(heights) {
                let expected = naive(&ALL, 11, col, row);
                assert!((f64::from(*height) - expected).abs() < 1e-5, "({col}, {row})");
            }
        });
    }
}
