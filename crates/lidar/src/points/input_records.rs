//! The points of a cloud as records, part by part.

use std::sync::Mutex;

use super::stages::noise::noise_index::{Marks, Noted};
use crate::point_index::parts_in;
use crate::records::selection::place;
use crate::records::{PointRecords, RecordUnit, Take};
use terrane_base::error::Result;
use terrane_cloud::{PointCloud, PointFormatConverter, PointSource, ReturnCounts};
use terrane_delaunay::SiteWindow;
use terrane_engine::FileAt;
use terrane_files::lock;

/// The records of a point cloud.
pub(super) struct InputRecords<'a> {
    cloud: &'a PointCloud,
    converter: &'a PointFormatConverter<'a>,
    /// The parts to read, and the window of points, if not all.
    parts: Vec<usize>,
    within: Option<SiteWindow>,
    /// The noise, if known.
    noise: Option<&'a Noted>,
    /// Statistics of each part that was read.
    census: Mutex<Vec<ReturnCounts>>,
}

impl<'a> InputRecords<'a> {
    /// The records in a window of the point cloud's frame, or all.
    pub(super) fn within(
        cloud: &'a PointCloud,
        converter: &'a PointFormatConverter<'a>,
        within: Option<SiteWindow>,
    ) -> Self {
        let parts = match within {
            Some(window) => parts_in(cloud, &window),
            None => (0..cloud.parts()).collect(),
        };
        let census = Mutex::new(vec![ReturnCounts::default(); parts.len()]);
        Self { cloud, converter, parts, within, noise: None, census }
    }

    /// The records with the class of noise for recorded noise.
    pub(super) fn with(self, noise: Option<&'a Noted>) -> Self {
        Self { noise, ..self }
    }

    /// Upper bound of the number of points of all parts.
    pub(super) fn count(&self) -> u64 {
        self.parts.iter().map(|part| self.cloud.points_of(*part)).sum()
    }

    /// Whether a record lies in the window.
    fn is_in(&self, record: &[u8]) -> bool {
        let (at, by) = (place(record), self.converter.shift());
        let steps = [at.x.wrapping_sub(by[0]), at.y.wrapping_sub(by[1])];
        self.within.is_none_or(|window| window.contains(steps))
    }

    /// Reads the records of a part in the window, with their classes.
    fn read_some(&self, part: usize, take: &mut Take<'_>) -> Result<ReturnCounts> {
        let (format, size) = (self.converter.format(), self.converter.size());
        let mut marks = self.noise.map(|noise| noise.marks(part));
        let mut some = Vec::new();
        self.converter.read(part, &mut |bytes| {
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

    /// The point cloud.
    pub(super) fn cloud(&self) -> &PointCloud {
        self.cloud
    }

    /// Statistics of the points.
    pub(super) fn census(&self) -> ReturnCounts {
        let mut sum = ReturnCounts::default();
        lock(&self.census).iter().for_each(|census| sum.add(census));
        sum
    }
}

impl PointRecords for InputRecords<'_> {
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
            true => self.converter.read(part, take)?,
            false => self.read_some(part, take)?,
        };
        lock(&self.census)[unit] = census;
        Ok(())
    }
}
