//! Metadata of a level, as terrane writes it.

use serde::Deserialize;

use terrane_base::error::{Error, Result};

/// A level as terrane says of its own sets.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct StatedLevel {
    level: u8,
    pub(super) tolerance: f64,
    pub(super) step: f64,
    pub(super) lattice: Option<f64>,
    pub(super) skirt: Option<f64>,
    pub(super) error: f64,
    pub(super) tiles: u64,
}

/// Checks terrane's metadata of levels: each level once, down to the finest, with valid numbers.
pub(super) fn check_levels(mut levels: Vec<StatedLevel>, finest: u8) -> Result<Vec<StatedLevel>> {
    levels.sort_by_key(|level| level.level);
    let is_each = levels.iter().map(|level| level.level).eq(0..=finest);
    if !is_each {
        return Err(Error::bad_input("does not state each of its levels once"));
    }
    let numbers = |own: &StatedLevel| {
        let [lattice, skirt] = [own.lattice, own.skirt].map(Option::unwrap_or_default);
        [own.tolerance, own.step, lattice, skirt, own.error]
    };
    let is_bad = |value: &f64| !value.is_finite() || *value < 0.0;
    match levels.iter().find(|own| numbers(own).iter().any(is_bad)) {
        Some(own) => Err(Error::bad_input(format!(
            "states a tolerance, step, skirt or error of level {} that is none",
            own.level
        ))),
        None => Ok(levels),
    }
}
