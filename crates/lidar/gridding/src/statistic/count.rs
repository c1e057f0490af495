//! How many points there are.

use bytemuck::{Pod, Zeroable};

use super::{Method, Nature, Of, Takes};
use crate::plane::{Keep, Primitive};
use terrane_base::geom::Point;

/// How many.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Count(pub(super) u32);

impl Count {
    pub(super) const KEPT: Primitive = Primitive::cells::<Self>("count");
}

impl Keep for Count {
    const NONE: Self = Self(0);

    #[inline(always)]
    fn take(&mut self, _: &Point, _: u128) -> bool {
        let (next, over) = self.0.overflowing_add(1);
        self.0 = next;
        !over
    }

    #[inline(always)]
    fn join(&mut self, other: Self) -> bool {
        let (next, over) = self.0.overflowing_add(other.0);
        self.0 = next;
        !over
    }
}

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
