//! Parameters of statistics: their names, defaults and given values.

use terrane_base::error::{Error, Result};

/// A parameter of a statistic.
#[derive(Debug)]
pub struct StatisticParameter {
    /// Its name.
    pub key: &'static str,
    /// The kind of its value, in a word.
    pub value: &'static str,
    /// One line for the documentation, with the default.
    pub about: &'static str,
}

/// The kind of most values.
pub(super) const NUMBER: &str = "NUMBER";

pub(super) const RADIUS: StatisticParameter = StatisticParameter {
    key: "radius",
    value: NUMBER,
    about: "search radius around the cell centre [‹radius›]",
};

/// Parameters as given.
#[derive(Debug, Default)]
pub(super) struct GivenParameters {
    pub(super) rank: Option<f64>,
    pub(super) values: Vec<(String, f64)>,
}

impl GivenParameters {
    pub(super) fn value(&self, key: &str) -> Option<f64> {
        self.values.iter().find(|(k, _)| k == key).map(|(_, value)| *value)
    }

    pub(super) fn positive(&self, key: &str) -> Result<Option<f64>> {
        match self.value(key) {
            Some(value) if value <= 0.0 => {
                Err(Error::usage(format!("{key}={value} is not above zero")))
            }
            value => Ok(value),
        }
    }
}
