//! Some points as a share of others.

use super::method::{StatisticMethod, StatisticSource, SubjectKinds, ValueNature};
use crate::cell::StatisticCell;
use crate::dimension::Subject;
use crate::plane::PointCount;
use terrane_base::attribute::Return;

pub(super) const SHARE: StatisticMethod = StatisticMethod {
    name: "share",
    about: "share of points in a class, return or height layer, 0 to 1",
    nature: ValueNature::Ratio,
    takes: SubjectKinds::Conditions,
    of: StatisticSource::Share { base: |_| Subject::default(), value: share },
    ..StatisticMethod::HEIGHT
};

/// Height that cover is above, unless another is given, in world units.
const ABOVE: f64 = 2.0;

pub(super) const COVER: StatisticMethod = StatisticMethod {
    name: "cover",
    about: "share of first returns above a height or in a height layer, 0 to 1 [above=2]",
    nature: ValueNature::Ratio,
    takes: SubjectKinds::Conditions,
    complete: |subject| {
        let above = subject.above.or((!subject.has_limits()).then_some(ABOVE));
        let returns = subject.returns.or(Some(Return::First));
        Subject { above, returns, ..subject }
    },
    of: StatisticSource::Share { base: Subject::of_any_height, value: share },
    ..StatisticMethod::HEIGHT
};

/// Ratio of the points of the first plane to those of the second; NaN if there are none of these.
fn share(cell: &StatisticCell<'_>) -> f64 {
    let [some, all] = [0, 1].map(|of| f64::from(cell.accumulator::<PointCount>(of).0));
    some / all
}
