//! How many points there are.

use super::method::{Method, Nature, Of, Takes};
use crate::plane::Count;

pub(super) const COUNT: Method = Method {
    name: "count",
    aliases: &["n"],
    about: "number of points, 0 where there is none",
    nature: Nature::Count,
    takes: Takes::Conditions,
    of: Of::Points {
        needs: |_, rules| (rules.own(), vec![Count::KEPT]),
        value: |_, cell| f64::from(cell.kept::<Count>(0).0),
    },
    ..Method::HEIGHT
};

pub(super) const DENSITY: Method = Method {
    name: "density",
    about: "points in a square unit of the CRS, 0 where there is none",
    nature: Nature::Density,
    takes: Takes::Conditions,
    of: Of::Points {
        needs: |_, rules| (rules.own(), vec![Count::KEPT]),
        value: |_, cell| f64::from(cell.kept::<Count>(0).0) / cell.units.area,
    },
    ..Method::HEIGHT
};
