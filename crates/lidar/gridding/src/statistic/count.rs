//! Number of points.

use super::method::{StatisticMethod, StatisticSource, SubjectKinds, ValueNature};
use crate::plane::PointCount;

pub(super) const COUNT: StatisticMethod = StatisticMethod {
    name: "count",
    aliases: &["n"],
    about: "number of points; 0 in empty cells",
    nature: ValueNature::Count,
    takes: SubjectKinds::Conditions,
    of: StatisticSource::Points {
        needs: |_, rules| (rules.own(), vec![PointCount::KIND]),
        value: |_, cell| f64::from(cell.accumulator::<PointCount>(0).0),
    },
    ..StatisticMethod::HEIGHT
};

pub(super) const DENSITY: StatisticMethod = StatisticMethod {
    name: "density",
    about: "points per square unit of the CRS; 0 in empty cells",
    nature: ValueNature::Density,
    takes: SubjectKinds::Conditions,
    of: StatisticSource::Points {
        needs: |_, rules| (rules.own(), vec![PointCount::KIND]),
        value: |_, cell| f64::from(cell.accumulator::<PointCount>(0).0) / cell.units.area,
    },
    ..StatisticMethod::HEIGHT
};
