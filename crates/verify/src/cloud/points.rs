//! The points of a cloud spread over the domains of a layout through a temporary file.

use std::sync::Mutex;

use super::context::CloudProofContext;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point;
use terrane_cloud::ReturnCounts;
use terrane_engine::{FileAt, workers};
use terrane_files::{BucketWriter, Buckets, lock, unlocked};
use terrane_proof::DomainLayout;
use terrane_proof::cloud::{HullGatherer, ProofHull, position};

/// All points, by the domain that owns them, and their totals.
pub(super) struct SpreadPoints {
    /// Points with x and y counted from the lowest.
    pub(super) points: Buckets<Point>,
    pub(super) counts: ReturnCounts,
    /// `None` when the points have no surface.
    pub(super) hull: Option<ProofHull>,
}

/// Findings of one thread.
#[derive(Default)]
struct CloudPointFindings {
    counts: ReturnCounts,
    hull: HullGatherer,
}

/// A thread that spreads points over domains.
struct PointFiller<'a> {
    context: &'a CloudProofContext<'a>,
    layout: DomainLayout,
    findings: CloudPointFindings,
    writer: BucketWriter<'a, Point>,
}

impl PointFiller<'_> {
    /// Reads one part of the cloud.
    fn read(&mut self, part: usize) -> Result<()> {
        let Self { context, layout, findings, writer } = self;
        FileAt::report_part(context.work.progress, context.source, part);
        let counts = context.source.positions(part, &mut |batch| {
            batch.iter().try_for_each(|&point| {
                let point = place(point, context.bounds)?;
                findings.hull.add([point.x, point.y]);
                writer.push(layout.owner(position(point)) as usize, point)
            })
        })?;
        findings.counts.add(&counts);
        context.work.progress.advance(counts.read);
        Ok(())
    }

    fn finish(self, all: &Mutex<CloudPointFindings>) -> Result<()> {
        let mut all = lock(all);
        all.counts.add(&self.findings.counts);
        all.hull.merge(self.findings.hull);
        self.writer.finish()
    }
}

impl SpreadPoints {
    /// Reads the cloud once.
    pub(super) fn fill(context: &CloudProofContext<'_>, layout: DomainLayout) -> Result<Self> {
        let (work, source) = (&context.work, context.source);
        let points = work.buckets(layout, work.memory / 2);
        let all = Mutex::new(CloudPointFindings::default());
        work.progress.begin("points", source.info().count);
        workers::run(
            work.threads,
            source.parts() as u64,
            &work.cancel,
            || PointFiller {
                context,
                layout,
                findings: CloudPointFindings::default(),
                writer: points.writer(),
            },
            |filler, part| filler.read(part as usize),
            |filler| filler.finish(&all),
        )?;
        points.settle()?;
        work.progress.end();
        let CloudPointFindings { counts, hull } = unlocked(all);
        Ok(Self { points, counts, hull: hull.finish() })
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
        let message = "point outside the stated bounds of its cloud";
        return Err(Error::new(ErrorKind::Internal, message));
    }
    Ok(Point::new(point.x - low.x, point.y - low.y, point.z))
}
