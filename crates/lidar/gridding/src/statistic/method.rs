//! A statistic of the registry, and one with its parameters.

use serde::{Deserialize, Serialize};

use super::sorted::{self, CellValueList, RealValue, SortedCellValues, StepValue};
use crate::cell::{CellUnits, StatisticCell};
use crate::dimension::{ATTRIBUTE, CONDITIONS, Subject};
use crate::parameter::{GivenParameters, StatisticParameter};
use crate::plane::{AccumulatorKind, PointCount};
use crate::region::{CellNeighborhood, StatisticDefaults};
use terrane_base::error::Result;
use terrane_base::registry::RegistryEntry;

/// One statistic of the registry.
#[derive(Debug)]
pub struct StatisticMethod {
    /// Name for `--stat`, unique.
    pub name: &'static str,
    /// Other names.
    pub aliases: &'static [&'static str],
    /// One line for the documentation.
    pub about: &'static str,
    /// Its parameters.
    pub parameters: &'static [StatisticParameter],
    pub(super) nature: ValueNature,
    /// It is a percentile, whose rank is in its name.
    pub(super) ranks: bool,
    /// The conditions and attributes it supports.
    pub(super) takes: SubjectKinds,
    /// Default attribute; heights when `None`.
    pub(super) usual: Option<&'static str>,
    /// Completes a subject with defaults.
    pub(super) complete: fn(Subject) -> Subject,
    pub(super) check: fn(&GivenParameters) -> Result<Values>,
    pub(super) of: StatisticSource,
    /// The statistic of sorted real values, if supported.
    pub(super) reals: Option<OfSorted>,
}

/// Nature of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ValueNature {
    /// Whole numbers of points or values, 0 where there is none.
    Count,
    /// Points for an area, 0 where there is none.
    Density,
    /// Heights, or differences of them; or values of another attribute.
    Height,
    /// Numbers without a unit.
    Ratio,
    /// Codes, which cannot be interpolated.
    Nominal,
}

/// Conditions and attributes that a statistic supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SubjectKinds {
    Nothing,
    Conditions,
    /// Conditions and an attribute.
    Attributes,
}

/// Computes a value from all values of a cell, in world units.
pub(super) type OfSorted = fn(&Statistic, SortedCellValues<'_>, &CellUnits) -> f64;

/// Source of a statistic.
#[derive(Clone, Copy, Debug)]
pub(super) enum StatisticSource {
    /// Accumulators of points.
    Points {
        /// The neighbourhood and the accumulators.
        needs: fn(&Statistic, &StatisticDefaults) -> (CellNeighborhood, Vec<AccumulatorKind>),
        /// The value computed from them, in world units.
        value: fn(&Statistic, &StatisticCell<'_>) -> f64,
    },
    /// All values of a cell, sorted.
    Sorted(OfSorted),
    /// Ratio of the number of points to that of a base.
    Share {
        /// The subject of the base.
        base: fn(&Subject) -> Subject,
        /// The ratio.
        value: fn(&StatisticCell<'_>) -> f64,
    },
    /// The height of a surface through all points.
    All(fn(&Statistic) -> SurfaceInterpolation),
}

impl SubjectKinds {
    pub(super) fn parameters(self) -> impl Iterator<Item = &'static StatisticParameter> {
        let attribute = Some(&ATTRIBUTE).filter(|_| self == Self::Attributes);
        let conditions = CONDITIONS.iter().filter(move |_| self != Self::Nothing);
        attribute.into_iter().chain(conditions)
    }
}

impl StatisticMethod {
    /// Common defaults of methods: a height without parameters.
    pub(super) const HEIGHT: Self = Self {
        name: "",
        aliases: &[],
        about: "",
        parameters: &[],
        nature: ValueNature::Height,
        ranks: false,
        takes: SubjectKinds::Attributes,
        usual: None,
        complete: |subject| subject,
        check: |_| Ok([None; 2]),
        of: StatisticSource::Points {
            needs: |_, rules| (rules.own(), Vec::new()),
            value: |_, _| f64::NAN,
        },
        reals: None,
    };

    /// Whether it supports real values.
    pub(super) fn is_of_reals(&self) -> bool {
        self.reals.is_some() || matches!(self.of, StatisticSource::Sorted(_))
    }
}

impl RegistryEntry for StatisticMethod {
    const KIND: &'static str = "statistic";

    fn name(&self) -> &'static str {
        self.name
    }

    fn aliases(&self) -> &'static [&'static str] {
        self.aliases
    }
}

/// Interpolation between points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceInterpolation {
    /// Linear in the Delaunay triangulation.
    Linear {
        /// Triangles with a longer edge, in world units, are not part of the surface.
        max_edge: Option<f64>,
    },
    /// From natural neighbours (Sibson 1981).
    Natural,
}

/// A statistic of the registry with its parameters.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(into = "StoredStatistic", try_from = "StoredStatistic")]
pub struct Statistic {
    pub(super) method: &'static StatisticMethod,
    pub(super) values: Values,
}

/// Parameters in the order of the method's; the rank of a percentile.
pub(super) type Values = [Option<f64>; 2];

impl PartialEq for Statistic {
    fn eq(&self, other: &Self) -> bool {
        self.method.name == other.method.name && self.values == other.values
    }
}

impl Statistic {
    /// Its name in the registry.
    pub fn name(&self) -> &'static str {
        self.method.name
    }

    /// True for values in the unit of its subject.
    pub fn is_height(&self) -> bool {
        matches!(self.method.nature, ValueNature::Height | ValueNature::Nominal)
    }

    /// True for whole numbers of points or of values.
    pub fn is_whole(&self) -> bool {
        self.method.nature == ValueNature::Count
    }

    /// True when a cell without points has a value, which is 0.
    pub fn counts(&self) -> bool {
        matches!(self.method.nature, ValueNature::Count | ValueNature::Density)
    }

    /// True if values can be averaged, so that voids can be filled from neighbours.
    pub fn fills(&self) -> bool {
        matches!(self.method.nature, ValueNature::Height | ValueNature::Ratio)
    }

    /// The value of a parameter that was given.
    pub fn parameter(&self, key: &str) -> Option<f64> {
        self.place(key).and_then(|at| self.values[at])
    }

    /// The rank of a percentile, 0 to 100.
    pub fn rank(&self) -> Option<f64> {
        self.values[0].filter(|_| self.method.ranks)
    }

    /// True if it has a parameter of this name that was not given, so that the default of the job applies.
    pub fn lacks(&self, key: &str) -> bool {
        self.place(key).is_some_and(|at| self.values[at].is_none())
    }

    fn place(&self, key: &str) -> Option<usize> {
        self.method.parameters.iter().position(|parameter| parameter.key == key)
    }

    /// The surface, if the statistic is computed from all points instead of those of a cell.
    pub fn shape(&self) -> Option<SurfaceInterpolation> {
        match self.method.of {
            StatisticSource::All(shape) => Some(shape(self)),
            _ => None,
        }
    }

    /// Its neighbourhood and accumulators; `real` values are kept as such.
    pub(crate) fn needs(
        &self,
        rules: &StatisticDefaults,
        real: bool,
    ) -> (CellNeighborhood, Vec<AccumulatorKind>) {
        match self.method.of {
            StatisticSource::Points { needs, .. } if !real => needs(self, rules),
            StatisticSource::Points { .. } | StatisticSource::Sorted(_) => {
                (rules.own(), vec![if real { sorted::REAL } else { sorted::WHOLE }])
            }
            StatisticSource::Share { .. } => (rules.own(), vec![PointCount::KIND]),
            StatisticSource::All(_) => (rules.own(), Vec::new()),
        }
    }

    /// The base subject of a ratio, which needs the same accumulators.
    pub(crate) fn base(&self, subject: &Subject) -> Option<Subject> {
        match self.method.of {
            StatisticSource::Share { base, .. } => Some(base(subject)),
            _ => None,
        }
    }

    /// Its value in a cell of points with `real` values; NaN for none.
    pub(crate) fn value(&self, cell: &StatisticCell<'_>, real: bool) -> f64 {
        match self.method.of {
            StatisticSource::Points { value, .. } if !real => value(self, cell),
            StatisticSource::Points { .. } => {
                self.method.reals.map_or(f64::NAN, |value| value(self, reals(cell), cell.units))
            }
            StatisticSource::Sorted(value) if real => value(self, reals(cell), cell.units),
            StatisticSource::Sorted(value) => {
                let values = cell
                    .plane::<CellValueList<StepValue>>(0)
                    .map_or(&[][..], |all| all.of(cell.at));
                value(self, SortedCellValues::Whole(values), cell.units)
            }
            StatisticSource::Share { value, .. } => value(cell),
            // Cells know nothing of the points around them.
            StatisticSource::All(_) => f64::NAN,
        }
    }
}

/// The real values of a cell.
fn reals<'a>(cell: &StatisticCell<'a>) -> SortedCellValues<'a> {
    SortedCellValues::Real(
        cell.plane::<CellValueList<RealValue>>(0).map_or(&[][..], |all| all.of(cell.at)),
    )
}

/// A statistic as stored in plans.
#[derive(Serialize, Deserialize)]
pub(super) struct StoredStatistic {
    pub(super) name: String,
    pub(super) values: Values,
}

impl From<Statistic> for StoredStatistic {
    fn from(statistic: Statistic) -> Self {
        Self { name: statistic.name().to_owned(), values: statistic.values }
    }
}
