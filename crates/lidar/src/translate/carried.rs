//! The points of a cloud as records, part by part.

use std::sync::Mutex;

use super::noise::noted::{Marks, Noted};
use crate::points::parts_in;
use crate::records::choice::place;
use crate::records::{PointRecords, RecordUnit, Take};
use terrane_base::error::Result;
use terrane_cloud::{PointCensus, PointCloud, PointFormatConverter, PointSource};
use terrane_delaunay::SiteWindow;
use terrane_engine::FileAt;
use terrane_files::lock;

/// The records that a carrier hands on.
pub(super) struct CarriedRecords<'a> {
    cloud: &'a PointCloud,
    carrier: &'a PointFormatConverter<'a>,
    /// The parts that are read, and where points of them are wanted, if not everywhere.
    parts: Vec<usize>,
    within: Option<SiteWindow>,
    /// Those that are noise, where that is known.
    noise: Option<&'a Noted>,
    /// Of each part that was read.
    census: Mutex<Vec<PointCensus>>,
}

impl<'a> CarriedRecords<'a> {
    /// Those that lie in a window of the cloud's frame, or all.
    pub(super) fn within(
        cloud: &'a PointCloud,
        carrier: &'a PointFormatConverter<'a>,
        within: Option<SiteWindow>,
    ) -> Self {
        let all = || (0..cloud.parts()).collect();
        let parts: Vec<_> = within.map_or_else(all, |window| parts_in(cloud, &window));
        let census = Mutex::new(vec![PointCensus::default(); parts.len()]);
        Self { cloud, carrier, parts, within, noise: None, census }
    }

    /// The same, with the class of noise for those noted.
    pub(super) fn with(self, noise: Option<&'a Noted>) -> Self {
        Self { noise, ..self }
    }

    /// Points of all parts that are read, at most.
    pub(super) fn count(&self) -> u64 {
        self.parts.iter().map(|part| self.cloud.points_of(*part)).sum()
    }

    /// Whether a record lies where points are wanted.
    fn is_in(&self, record: &[u8]) -> bool {
        let (at, by) = (place(record), self.carrier.shift());
        let steps = [at.x.wrapping_sub(by[0]), at.y.wrapping_sub(by[1])];
        self.within.is_none_or(|window| window.contains(steps))
    }

    /// Hands on the records of a part that are wanted, with their classes.
    fn read_some(&self, part: usize, take: &mut Take<'_>) -> Result<PointCensus> {
        let (format, size) = (self.carrier.format(), self.carrier.size());
        let mut marks = self.noise.map(|noise| noise.marks(part));
        let mut some = Vec::new();
        self.carrier.read(part, &mut |bytes| {
            some.clear();
            for record in bytes.chunks_exact(size) {
                let class = marks.as_mut().and_then(Marks::take);
                if self.is_in(record) {
                    let first = some.len();
                    some.extend_from_slice(record);
                    class.into_iter().for_each(|class| format.set_class(&mut some[first..], class));
                }
            }
            take(&some)
        })
    }

    /// The cloud that they are of.
    pub(super) fn cloud(&self) -> &PointCloud {
        self.cloud
    }

    /// What became of the points.
    pub(super) fn census(&self) -> PointCensus {
        let mut sum = PointCensus::default();
        lock(&self.census).iter().for_each(|census| sum.add(census));
        sum
    }
}

impl PointRecords for CarriedRecords<'_> {
    fn units(&self) -> usize {
        self.parts.len()
    }

    fn unit(&self, unit: usize) -> RecordUnit<'_> {
        let part = self.parts[unit];
        RecordUnit { points: self.cloud.points_of(part), file: FileAt::new(self.cloud, part) }
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let part = self.parts[unit];
        let census = match self.within.is_none() && self.noise.is_none() {
            true => self.carrier.read(part, take)?,
            false => self.read_some(part, take)?,
        };
        lock(&self.census)[unit] = census;
        Ok(())
    }
}
