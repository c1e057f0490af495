//! Work on the points around each point, for stages: the points in parts of space, each with the parts around it.

mod partition;

use super::StageContext;
use crate::grid::surface_model::MetricFrame;
use crate::records::numbered::{self, RecordNumbers};
use crate::records::selection::place;
use crate::records::{PointRecords, total};
pub(super) use partition::NearestParts;
use partition::{MOST, NumberedPoint, PointParts, PointPartsBuilder, tables};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_cloud::CloudInfo;
use terrane_engine::workers;
use terrane_ground::neighbors::MetricSpace;

/// Points divided together.
const TOGETHER: usize = 1 << 14;
/// Least bytes for points being divided.
const DIVIDING: u64 = 4 << 20;
/// Bytes of a thread beside its points.
const THREAD: u64 = 2 << 20;
/// Largest distance from coordinate zero, in steps.
const MAX_STEPS: f64 = 1e18;

/// Bytes for `points` points, and for each thread; `bytes(n)` is for a part of n points.
pub(super) fn needed(points: u64, bytes: impl Fn(u64) -> u64) -> [u64; 2] {
    [tables(points) + DIVIDING, THREAD + bytes(MOST)]
}

/// Scale and origin of points in metres, and whether metres are assumed; `stage` is what needs them.
///
/// # Errors
/// Coordinates without a unit of length.
pub(super) fn metric_space(info: &CloudInfo, stage: &str) -> Result<(MetricSpace, bool)> {
    let metres = MetricFrame::of(&info.crs, &info.frame).map_err(|_| {
        Error::usage(format!("{stage} requires coordinates in a unit of length"))
            .remedy("reproject the points first, for example with the stage reproject:CRS")
    })?;
    let frame = &info.frame;
    let zero = [0, 1, 2].map(|axis| {
        (frame.offset[axis] / frame.scale[axis]).round().clamp(-MAX_STEPS, MAX_STEPS) as i64
    });
    Ok((MetricSpace { step: metres.step, zero }, metres.is_guess))
}

/// Points by parts of space.
pub(super) struct Neighborhoods<'a> {
    around: &'a StageContext<'a>,
    parts: PointParts<'a>,
    /// The numbers of all records.
    pub(super) numbers: RecordNumbers,
}

/// A part, and those around it.
pub(super) struct Neighborhood<'a> {
    pub(super) part: u64,
    pub(super) points: Vec<Point>,
    /// The numbers of their records.
    pub(super) numbers: Vec<u64>,
    pub(super) around: NearestParts<'a>,
}

impl<'a> Neighborhoods<'a> {
    /// The points of the records for which `is_taken` holds, in `memory` bytes.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn new(
        records: &dyn PointRecords,
        space: &'a MetricSpace,
        around: &'a StageContext<'a>,
        memory: u64,
        is_taken: impl Fn(&[u8]) -> bool + Sync,
    ) -> Result<Self> {
        let (work, points) = (around.work, total(records));
        work.at.progress.begin("places", points);
        let bounds = around.info.bounds.unwrap_or_default();
        let mut builder = PointPartsBuilder::new(space, bounds, points, work.folder(), memory);
        let mut some = Vec::with_capacity(TOGETHER);
        let numbers = numbered::pass(records, work.shares.flow, work.at, &mut |number, record| {
            if is_taken(record) {
                some.push(NumberedPoint::new(place(record), number));
            }
            if some.len() == TOGETHER { builder.add(&mut some) } else { Ok(()) }
        })?;
        builder.add(&mut some)?;
        let parts = builder.finish(work.at)?;
        work.at.progress.end();
        Ok(Self { around, parts, numbers })
    }

    /// Runs `act` on each part in all threads; `finish` gets the state of each thread at the end.
    ///
    /// # Errors
    /// Those of both.
    pub(super) fn each<S: Send + Default>(
        &self,
        progress: &str,
        act: impl Fn(&mut S, Neighborhood<'_>) -> Result<()> + Sync,
        finish: impl Fn(S) -> Result<()> + Sync,
    ) -> Result<()> {
        let (work, parts) = (self.around.work, &self.parts);
        work.at.progress.begin(progress, parts.count());
        let act = |state: &mut S, part| {
            let (mut points, mut numbers) = (Vec::new(), Vec::new());
            parts.load(part, &mut points, &mut numbers)?;
            act(state, Neighborhood { part, points, numbers, around: parts.around(part) })?;
            work.at.progress.advance(1);
            Ok(())
        };
        workers::run(work.shares.threads, parts.count(), work.at.cancel, S::default, act, finish)?;
        work.at.progress.end();
        Ok(())
    }
}
