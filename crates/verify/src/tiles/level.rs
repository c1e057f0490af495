//! Metadata of a level, as terrane writes it.

use serde::Deserialize;

use terrane_base::error::{Error, Result};

/// A level in terrane's own metadata.
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
        return Err(Error::bad_input(format!(
            "levels are not stated once each from 0 to {finest}"
        )));
    }
    match levels.iter().find(|level| !level.is_valid()) {
        Some(level) => Err(Error::bad_input(format!(
            "tolerance, step, lattice, skirt or error of level {} is not a finite non-negative number",
            level.level
        ))),
        None => Ok(levels),
    }
}

impl StatedLevel {
    fn is_valid(&self) -> bool {
        let Self { tolerance, step, error, .. } = *self;
        let [lattice, skirt] = [self.lattice, self.skirt].map(Option::unwrap_or_default);
        let all = [tolerance, step, lattice, skirt, error];
        all.iter().all(|value| value.is_finite() && *value >= 0.0)
    }
}
