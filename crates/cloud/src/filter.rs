//! Filters of points.

use std::num::NonZeroU32;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use terrane_base::attribute::Return;
use terrane_base::error::Result;
use terrane_base::geom::{Crs, Point, PointFrame};

use super::condition::Condition;
use super::frame::clip;
use super::polygon::FilterPolygon;
use super::raw::Flags;

/// A filter of points: all conditions must hold. Limits are first converted to steps of the cloud's frame, in which
/// all comparisons are made (see [`CompiledFilter`]).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CloudFilter {
    /// Classes to keep.
    pub classes: Option<Vec<u8>>,
    /// Return to keep.
    pub returns: Option<Return>,
    /// Keeps points with the withheld flag.
    pub keep_withheld: bool,
    /// Drops points with any of these flags.
    pub drop: Flags,
    /// Bounds: x min, y min, x max, y max, borders included; in world units.
    pub bounds: Option<[f64; 4]>,
    /// Keeps points inside this polygon.
    pub polygon: Option<Arc<FilterPolygon>>,
    /// Range of heights, both ends included; in world units.
    pub z_range: Option<[f64; 2]>,
    /// Keeps points for which this condition holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<Condition>,
    /// Keeps every n-th point of each file, counted from the first before all other filters.
    pub every: Option<NonZeroU32>,
}

const EVERYWHERE: [f64; 4] = [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY];

/// The fields of a point that filters use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterRecord {
    /// In steps of the cloud's frame.
    pub point: Point,
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
pub enum FilterVerdict {
    /// It is handed on.
    Keep,
    /// It is marked as withheld.
    Withheld,
    /// It is not wanted.
    Filtered,
}

impl CloudFilter {
    /// Fails where polygons are in another reference system than a cloud.
    pub(crate) fn check_system(&self, cloud: &Crs) -> Result<()> {
        self.polygon.as_ref().map_or(Ok(()), |polygon| polygon.check(cloud))
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
}

/// A filter whose limits are steps of a frame.
#[derive(Clone, Debug)]
pub struct CompiledFilter {
    options: CloudFilter,
    /// Lowest and highest steps of the points wanted; none where they cross over.
    limits: [[i32; 2]; 3],
    /// In steps.
    polygon: Option<Arc<FilterPolygon>>,
}

impl CompiledFilter {
    /// For points of `frame`.
    pub fn new(filter: &CloudFilter, frame: &PointFrame) -> Self {
        let [west, south, east, north] = filter.area();
        let heights = filter.z_range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let ranges = [[west, east], [south, north], heights];
        let limits = std::array::from_fn(|axis| {
            let (ruler, [low, high]) = (frame.ruler(axis), ranges[axis]);
            [clip(ruler.first(low)), clip(ruler.last(high))]
        });
        let polygon = filter.polygon.as_ref().map(|polygon| Arc::new(polygon.in_steps(frame)));
        Self { options: filter.clone(), limits, polygon }
    }

    /// What it was made of.
    pub fn options(&self) -> &CloudFilter {
        &self.options
    }

    /// A box of points cut to the box and heights asked for; `None` where nothing is left.
    pub fn cut(&self, [low, high]: [Point; 2]) -> Option<[Point; 2]> {
        let [x, y, z] = self.limits;
        let low = Point::new(low.x.max(x[0]), low.y.max(y[0]), low.z.max(z[0]));
        let high = Point::new(high.x.min(x[1]), high.y.min(y[1]), high.z.min(z[1]));
        (low.x <= high.x && low.y <= high.y && low.z <= high.z).then_some([low, high])
    }

    /// What becomes of `record`, by all but the [`CloudFilter::condition`]. A point that is withheld and not wanted
    /// for another reason, too, counts as withheld.
    pub fn judge(&self, record: &FilterRecord) -> FilterVerdict {
        if !self.options.keep_withheld && record.flags.meets(Flags::WITHHELD) {
            return FilterVerdict::Withheld;
        }
        match self.accepts(record) {
            true => FilterVerdict::Keep,
            false => FilterVerdict::Filtered,
        }
    }

    fn accepts(&self, record: &FilterRecord) -> bool {
        let (filter, Point { x, y, z }) = (&self.options, record.point);
        let [[west, east], [south, north], [bottom, top]] = self.limits;
        filter.every.is_none_or(|n| record.index.is_multiple_of(u64::from(n.get())))
            && filter.classes.as_ref().is_none_or(|classes| classes.contains(&record.class))
            && filter.returns.is_none_or(|wanted| wanted.is(record.number, record.returns))
            && !record.flags.meets(filter.drop)
            && (west..=east).contains(&x)
            && (south..=north).contains(&y)
            && (bottom..=top).contains(&z)
            && self.polygon.as_ref().is_none_or(|polygon| polygon.contains(x.into(), y.into()))
    }
}
