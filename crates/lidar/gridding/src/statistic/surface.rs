//! Heights of surfaces through all points, which need no accumulators of cells.

use super::method::{StatisticMethod, StatisticSource, SubjectKinds, SurfaceInterpolation};
use crate::parameter::{NUMBER, StatisticParameter};

const MAX_EDGE: StatisticParameter = StatisticParameter {
    key: "max_edge",
    value: NUMBER,
    about: "maximum triangle edge; larger triangles are void [‹max_edge›]",
};

pub(super) const TIN: StatisticMethod = StatisticMethod {
    name: "tin",
    aliases: &["linear"],
    about: "height at the cell centre, linear in the Delaunay triangulation of all points",
    parameters: &[MAX_EDGE],
    takes: SubjectKinds::Nothing,
    check: |given| Ok([given.positive(MAX_EDGE.key)?, None]),
    of: StatisticSource::All(|statistic| SurfaceInterpolation::Linear {
        max_edge: statistic.parameter(MAX_EDGE.key),
    }),
    ..StatisticMethod::HEIGHT
};

pub(super) const NATURAL: StatisticMethod = StatisticMethod {
    name: "natural",
    aliases: &["sibson"],
    about: "height at the cell centre by natural neighbour interpolation of all points",
    takes: SubjectKinds::Nothing,
    of: StatisticSource::All(|_| SurfaceInterpolation::Natural),
    ..StatisticMethod::HEIGHT
};
