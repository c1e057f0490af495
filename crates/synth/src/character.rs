//! The registry of characters of terrains.

use super::hash::{RowHash, mix64};
use super::octaves::OctaveSpectrum;
use super::terrain::{MAX_SIDE, SampleRunStart, SynthParameter, Terrain, TerrainKind};

const ROUGH: OctaveSpectrum =
    OctaveSpectrum { coarsest: 12, ridged: 9, detail: 5, finest: 2, amplitude: 0.25, gain: 0.56 };
const SMOOTH: OctaveSpectrum =
    OctaveSpectrum { coarsest: 12, ridged: 9, detail: 9, finest: 5, amplitude: 0.35, gain: 0.45 };

/// Shorter swells than `ROUGH`, so that a thousand samples include both land and sea.
const SHORES: OctaveSpectrum =
    OctaveSpectrum { coarsest: 9, ridged: 7, detail: 5, finest: 2, amplitude: 0.12, gain: 0.56 };

const SEA: SynthParameter = SynthParameter {
    key: "sea",
    about: "sea level, as a share of the relief",
    default: 0.6,
    range: (-2.0, 2.0),
    whole: false,
};
const STEP: SynthParameter = SynthParameter {
    key: "step",
    about: "height of a terrace in metres",
    default: 60.0,
    range: (0.01, 10_000.0),
    whole: false,
};
const VOIDS: SynthParameter = SynthParameter {
    key: "voids",
    about: "share of void samples, from 0 to 1",
    default: 0.005,
    range: (0.0, 1.0),
    whole: false,
};

/// Parameters of all characters.
pub const PARAMETERS: &[SynthParameter] = &[
    SynthParameter {
        key: "size",
        about: "columns and rows",
        default: 4097.0,
        range: (1.0, MAX_SIDE as f64),
        whole: true,
    },
    SynthParameter {
        key: "width",
        about: "columns, instead of size",
        default: 4097.0,
        range: (1.0, MAX_SIDE as f64),
        whole: true,
    },
    SynthParameter {
        key: "height",
        about: "rows, instead of size",
        default: 4097.0,
        range: (1.0, MAX_SIDE as f64),
        whole: true,
    },
    SynthParameter {
        key: "seed",
        about: "random seed, an integer",
        default: 1.0,
        range: (0.0, u64::MAX as f64),
        whole: true,
    },
    SynthParameter {
        key: "cell",
        about: "metres between samples (does not change heights)",
        default: 10.0,
        range: (1e-3, 1e5),
        whole: false,
    },
    SynthParameter {
        key: "relief",
        about: "approximate height range in metres",
        default: 1500.0,
        range: (1e-3, 10_000.0),
        whole: false,
    },
];

/// All characters.
pub const CHARACTERS: &[TerrainKind] = &[
    TerrainKind {
        name: "rough",
        about: "mountain ranges, valleys and plains with fractal detail down to four samples",
        own: None,
        integer: false,
        voids: false,
        spectrum: ROUGH,
        finish: land,
    },
    TerrainKind {
        name: "smooth",
        about: "rolling hills without fine detail",
        own: None,
        integer: false,
        voids: false,
        spectrum: SMOOTH,
        finish: land,
    },
    TerrainKind {
        name: "integer",
        about: "islands and shores in whole metres above a flat sea at 0",
        own: Some(SEA),
        integer: true,
        voids: false,
        spectrum: SHORES,
        finish: whole_metres,
    },
    TerrainKind {
        name: "plateaus",
        about: "level terraces with steep sides",
        own: Some(STEP),
        integer: false,
        voids: false,
        spectrum: ROUGH,
        finish: terraces,
    },
    TerrainKind {
        name: "coast",
        about: "islands and shores in metres above the sea; everything beyond the coast line is void",
        own: Some(SEA),
        integer: false,
        voids: true,
        spectrum: SHORES,
        finish: coast,
    },
    TerrainKind {
        name: "salt",
        about: "rough, with single void samples strewn over it",
        own: Some(VOIDS),
        integer: false,
        voids: true,
        spectrum: ROUGH,
        finish: salt,
    },
];

/// Metres above the base of the terrain, from the height of the octaves.
#[inline(always)]
fn metres(terrain: &Terrain) -> impl Fn(f32) -> f32 + use<> {
    let (foot, scale) = (0.6 * terrain.relief as f32, 0.9 * terrain.relief as f32);
    move |height| foot + scale * height
}

fn land(terrain: &Terrain, _at: SampleRunStart, heights: &[f32], out: &mut [f32]) {
    let metres = metres(terrain);
    for (z, height) in out.iter_mut().zip(heights) {
        *z = metres(*height);
    }
}

/// Adding and subtracting 2^23 rounds an `f32` below 2^22 to the nearest integer.
const ROUND: f32 = 8_388_608.0;

fn whole_metres(terrain: &Terrain, _at: SampleRunStart, heights: &[f32], out: &mut [f32]) {
    let (metres, sea) = (metres(terrain), (terrain.own * terrain.relief) as f32);
    for (z, height) in out.iter_mut().zip(heights) {
        let above = metres(*height) - sea;
        let above = if above > 0.0 { above } else { 0.0 };
        let above = if above < 32_767.0 { above } else { 32_767.0 };
        *z = (above + ROUND) - ROUND;
    }
}

fn terraces(terrain: &Terrain, _at: SampleRunStart, heights: &[f32], out: &mut [f32]) {
    const BELOW: f32 = 1_048_576.0;
    let (metres, step) = (metres(terrain), terrain.own as f32);
    for (z, height) in out.iter_mut().zip(heights) {
        let level = metres(*height) / step;
        let tread = (level + BELOW) as i32 as f32 - BELOW;
        let rise = (level - tread) * 4.0 - 3.0;
        let rise = if rise > 0.0 { rise } else { 0.0 };
        *z = step * (tread + rise * rise * (3.0 - 2.0 * rise));
    }
}

fn coast(terrain: &Terrain, _at: SampleRunStart, heights: &[f32], out: &mut [f32]) {
    let (metres, sea) = (metres(terrain), (terrain.own * terrain.relief) as f32);
    for (z, height) in out.iter_mut().zip(heights) {
        let above = metres(*height) - sea;
        *z = if above > 0.0 { above } else { f32::NAN };
    }
}

fn salt(terrain: &Terrain, at: SampleRunStart, heights: &[f32], out: &mut [f32]) {
    land(terrain, at, heights, out);
    let hash = RowHash::new(mix64(terrain.seed), at.row);
    // The upper 24 bits of a hash, as a probability.
    let limit = (terrain.own * 16_777_216.0) as u32;
    for (z, col) in out.iter_mut().zip(at.col..) {
        *z = if hash.at(col) >> 8 < limit { f32::NAN } else { *z };
    }
}
