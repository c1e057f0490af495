//! The points of a cloud spread over the domains of a layout through a temporary file.

use std::sync::Mutex;

use super::context::CloudProofContext;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point;
use terrane_cloud::ReturnCounts;
use terrane_engine::{FileAt, workers};
use terrane_files::{BucketWriter, Buckets, lock};
use terrane_proof::DomainLayout;
use terrane_proof::cloud::{HullGatherer, ProofHull, position};

/// All points, by the domain that owns them, and their totals.
pub(super) struct SpreadPoints {
    /// Points with x and y counted from the lowest.
    pub(super) points: Buckets<Point>,
    pub(super) census: ReturnCounts,
    /// `None` when the points have no surface.
    pub(super) hull: Option<ProofHull>,
}

/// Findings of one thread.
#[derive(Default)]
struct CloudPointFindings {
    census: ReturnCounts,
    wrap: HullGatherer,
}

impl SpreadPoints {
    /// Reads the cloud once.
    pub(super) fn fill(context: &CloudProofContext<'_>, layout: DomainLayout) -> Result<Self> {
        let (work, source) = (&context.work, context.source);
        let points = work.buckets(layout, work.memory / 2);
        let all = Mutex::new(CloudPointFindings::default());
        work.progress.begin("points", source.info().count);
        let start = || (CloudPointFindings::default(), points.writer());
        let read = |(found, writer): &mut (CloudPointFindings, BucketWriter<'_, Point>),
                    part: u64| {
            FileAt::report_part(work.progress, source, part as usize);
            let census = source.read(part as usize, &mut |batch| {
                batch.iter().try_for_each(|&point| {
                    let point = place(point, context.bounds)?;
                    found.wrap.add([point.x, point.y]);
                    writer.push(layout.owner(position(point)) as usize, point)
                })
            })?;
            found.census.add(&census);
            work.progress.advance(census.read);
            Ok(())
        };
        let finish = |(found, writer): (CloudPointFindings, BucketWriter<'_, Point>)| {
            let mut all = lock(&all);
            all.census.add(&found.census);
            all.wrap.merge(found.wrap);
            writer.finish()
        };
        let parts = source.parts() as u64;
        workers::run(work.threads, parts, &work.cancel, start, read, finish)?;
        points.settle()?;
        work.progress.end();
        let CloudPointFindings { census, wrap } = std::mem::take(&mut *lock(&all));
        Ok(Self { points, census, hull: wrap.finish() })
    }

    /// Bytes spilled.
    pub(super) fn bytes(&self) -> u64 {
        self.points.spilled()
    }
}

/// A point with x and y counted from the lowest. Fails outside the bounds that the cloud states.
fn place(point: Point, [low, high]: [Point; 2]) -> Result<Point> {
    let is_inside = low.x <= point.x && point.x <= high.x && low.y <= point.y && point.y <= high.y;
    if !is_inside {
        let message = "a point lies outside the bounds that its cloud states";
        return Err(Error::new(ErrorKind::Internal, message));
    }
    Ok(Point::new(point.x - low.x, point.y - low.y, point.z))
}
