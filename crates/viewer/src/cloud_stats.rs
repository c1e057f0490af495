//! Statistics of a point cloud: counts by class and return, extent, and heights.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;

use crate::heights::{HeightCounts, HeightDistribution};
use terrane_base::error::Result;
use terrane_base::geom::Point3;
use terrane_cloud::{FilterRecord, Flags, PointCloud, PointSource, ReturnCounts};
use terrane_engine::input::workers;
use terrane_engine::{Cancel, FileAt, Progress, Resources};

/// Counts of the points read.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CloudStats {
    /// Counts of all points.
    #[serde(flatten)]
    pub census: ReturnCounts,
    /// Points by class.
    pub classes: BTreeMap<u8, u64>,
    /// Points by number of their return.
    pub returns: BTreeMap<u8, u64>,
    /// Points that are the last return of their pulse.
    pub last: u64,
    /// Points by flag; points without flags are not counted.
    pub flags: BTreeMap<&'static str, u64>,
    /// Lowest and highest coordinates; absent without points.
    pub bounds: Option<[Point3; 2]>,
    /// Distribution of heights; absent without points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heights: Option<HeightDistribution>,
    #[serde(skip)]
    spread: HeightCounts,
}

impl CloudStats {
    fn add(&mut self, record: &FilterRecord) {
        self.count(record);
        self.spread.add(record.world[2]);
    }

    /// Counts a point without its height.
    pub(crate) fn count(&mut self, record: &FilterRecord) {
        *self.classes.entry(record.class).or_default() += 1;
        *self.returns.entry(record.number).or_default() += 1;
        self.last += u64::from(record.number >= record.returns);
        for (name, flag) in Flags::ALL {
            if record.flags.meets(flag) {
                *self.flags.entry(name).or_default() += 1;
            }
        }
        self.bounds = joined(self.bounds, Some([record.world; 2]));
    }

    /// Merges both.
    pub(crate) fn and(mut self, other: Self) -> Self {
        self.census.add(&other.census);
        self.last += other.last;
        other.classes.into_iter().for_each(|(k, n)| *self.classes.entry(k).or_default() += n);
        other.returns.into_iter().for_each(|(k, n)| *self.returns.entry(k).or_default() += n);
        other.flags.into_iter().for_each(|(k, n)| *self.flags.entry(k).or_default() += n);
        self.bounds = joined(self.bounds, other.bounds);
        self.spread = self.spread.and(other.spread);
        self
    }
}

/// The box around both.
fn joined(one: Option<[Point3; 2]>, other: Option<[Point3; 2]>) -> Option<[Point3; 2]> {
    let ([a, b], [c, d]) = match (one, other) {
        (Some(one), Some(other)) => (one, other),
        (one, other) => return one.or(other),
    };
    Some([std::array::from_fn(|i| a[i].min(c[i])), std::array::from_fn(|i| b[i].max(d[i]))])
}

/// Reads all points that pass the filters, part by part. The result does not depend on the number of threads.
pub fn cloud_stats(
    cloud: &PointCloud,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<CloudStats> {
    progress.begin("read", cloud.info().count);
    let stats = workers(resources)?.install(|| {
        let measured = (0..cloud.parts()).into_par_iter().map(|part| {
            cancel.check()?;
            FileAt::report_part(progress, cloud, part);
            let mut stats = CloudStats::default();
            stats.census = cloud.records(part, &mut |record| stats.add(record))?;
            progress.advance(cloud.points_of(part));
            Ok(stats)
        });
        measured.try_reduce(CloudStats::default, |one, other| Ok(one.and(other)))
    });
    progress.end();
    let stats = stats?;
    Ok(CloudStats { heights: stats.spread.distribution(), ..stats })
}
