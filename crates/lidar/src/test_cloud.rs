//! A cloud in memory, for the tests of jobs.

use terrane_base::error::Result;
use terrane_base::geom::{Crs, Point, PointFrame};
use terrane_cloud::{
    AttributeSelection, CloudInfo, PointBatch, PointConsumer, PointSource, ReturnCounts,
};

/// Points in memory, in parts of a thousand.
pub(crate) struct PointSample {
    pub(crate) info: CloudInfo,
    pub(crate) points: Vec<Point>,
}

const PART: usize = 1000;

impl PointSample {
    /// These points in steps of `frame`.
    pub(crate) fn new(frame: PointFrame, points: Vec<Point>) -> Self {
        let fold = |f: fn(i32, i32) -> i32| {
            let join = |a: Point, b: Point| Point::new(f(a.x, b.x), f(a.y, b.y), f(a.z, b.z));
            points.iter().copied().reduce(join)
        };
        let bounds = fold(i32::min).zip(fold(i32::max)).map(|(low, high)| [low, high]);
        let info = CloudInfo { frame, bounds, count: points.len() as u64, crs: Crs::default() };
        Self { info, points }
    }

    /// The same points, with another number in the headers.
    pub(crate) fn claiming(mut self, count: u64) -> Self {
        self.info.count = count;
        self
    }
}

impl PointSource for PointSample {
    fn info(&self) -> &CloudInfo {
        &self.info
    }

    fn parts(&self) -> usize {
        self.points.len().div_ceil(PART)
    }

    fn points_of(&self, part: usize) -> u64 {
        self.points.chunks(PART).nth(part).map_or(0, |part| part.len() as u64)
    }

    fn read(
        &self,
        part: usize,
        _selection: &AttributeSelection,
        each: &mut PointConsumer<'_>,
    ) -> Result<ReturnCounts> {
        let positions = self.points.chunks(PART).nth(part).unwrap_or_default();
        each(PointBatch { positions, ..PointBatch::default() })?;
        let count = positions.len() as u64;
        Ok(ReturnCounts { read: count, kept: count, ..ReturnCounts::default() })
    }
}
