//! Which points of a cloud are wanted.

use std::num::NonZeroU32;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Polygon;

/// Which points are wanted: those that meet every condition given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Filter {
    /// Of one of these classes.
    pub classes: Option<Vec<u8>>,
    /// Of this return of their pulse.
    pub returns: Option<Return>,
    /// Points marked as withheld, too.
    pub keep_withheld: bool,
    /// Bearing none of these marks.
    pub drop: Flags,
    /// Within x low, y low, x high, y high, borders included; in world units.
    pub bounds: Option<[f64; 4]>,
    /// Inside this polygon.
    pub polygon: Option<Arc<Polygon>>,
    /// Not lower than the first and not higher than the second; in world units.
    pub z_range: Option<[f64; 2]>,
    /// Every so many points of each file, from its first one on, counted before all else.
    pub every: Option<NonZeroU32>,
}

const EVERYWHERE: [f64; 4] = [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY];

/// A return of a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Return {
    /// The first one.
    First,
    /// The last one, which may be the first one as well.
    Last,
    /// The first one of pulses that have no other.
    Only,
    /// The one of this number, from 1.
    Number(u8),
}

/// Marks that a point may bear, by the bits of LAS 1.4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flags(pub u8);

impl Flags {
    /// Made by other means than measuring.
    pub const SYNTHETIC: Self = Self(1);
    /// A key point of a model, not to be thinned out.
    pub const KEY: Self = Self(2);
    /// To be left out.
    pub const WITHHELD: Self = Self(4);
    /// In the overlap of flight lines.
    pub const OVERLAP: Self = Self(8);

    /// All marks with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("synthetic", Self::SYNTHETIC),
        ("keypoint", Self::KEY),
        ("withheld", Self::WITHHELD),
        ("overlap", Self::OVERLAP),
    ];

    /// The marks of both.
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// True when the two have a mark in common.
    pub const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

/// All of a point that filters ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// World coordinates.
    pub world: [f64; 3],
    /// Classification.
    pub class: u8,
    /// Number of the return, from 1.
    pub number: u8,
    /// Returns of the pulse.
    pub returns: u8,
    /// Marks.
    pub flags: Flags,
    /// Which point of its file, from 0.
    pub index: u64,
}

/// What becomes of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is handed on.
    Keep,
    /// It is marked as withheld.
    Withheld,
    /// It is not wanted.
    Filtered,
}

impl Return {
    /// Whether it is return `number` of `returns`.
    pub fn is(self, number: u8, returns: u8) -> bool {
        match self {
            Self::First => number <= 1,
            Self::Last => number >= returns,
            Self::Only => number <= 1 && returns <= 1,
            Self::Number(wanted) => number == wanted,
        }
    }
}

impl Filter {
    /// What becomes of `record`, condition by condition. A point that is withheld and not wanted
    /// for another reason, too, counts as withheld.
    pub fn judge(&self, record: &Record) -> Verdict {
        if !self.keep_withheld && record.flags.meets(Flags::WITHHELD) {
            return Verdict::Withheld;
        }
        match self.is_wanted(record) {
            true => Verdict::Keep,
            false => Verdict::Filtered,
        }
    }

    /// The box around the points asked for: x low, y low, x high, y high.
    pub fn area(&self) -> [f64; 4] {
        let [west, south, east, north] = self.bounds.unwrap_or(EVERYWHERE);
        let [left, bottom, right, top] =
            self.polygon.as_ref().map_or(EVERYWHERE, |polygon| polygon.bounds());
        [west.max(left), south.max(bottom), east.min(right), north.min(top)]
    }

    /// Whether a point of the box may be wanted.
    pub fn touches(&self, low: [f64; 3], high: [f64; 3]) -> bool {
        let [west, south, east, north] = self.area();
        let across = low[0] <= east && west <= high[0] && low[1] <= north && south <= high[1];
        across && self.z_range.is_none_or(|[bottom, top]| low[2] <= top && bottom <= high[2])
    }

    fn is_wanted(&self, record: &Record) -> bool {
        let [x, y, z] = record.world;
        self.every.is_none_or(|n| record.index.is_multiple_of(u64::from(n.get())))
            && self.classes.as_ref().is_none_or(|classes| classes.contains(&record.class))
            && self.returns.is_none_or(|wanted| wanted.is(record.number, record.returns))
            && !record.flags.meets(self.drop)
            && self.bounds.is_none_or(|[west, south, east, north]| {
                (west..=east).contains(&x) && (south..=north).contains(&y)
            })
            && self.z_range.is_none_or(|[low, high]| (low..=high).contains(&z))
            && self.polygon.as_ref().is_none_or(|polygon| polygon.contains(x, y))
    }
}
