//! The points of a cloud as records, part by part.

use std::sync::Mutex;

use crate::records::{Records, Take};
use terrane_base::error::Result;
use terrane_cloud::{Carrier, Census, Cloud, PointSource};
use terrane_files::lock;

/// The records that a carrier hands on.
pub(super) struct CarriedRecords<'a> {
    cloud: &'a Cloud,
    carrier: &'a Carrier<'a>,
    /// Of each part that was read.
    census: Mutex<Vec<Census>>,
}

impl<'a> CarriedRecords<'a> {
    pub(super) fn new(cloud: &'a Cloud, carrier: &'a Carrier<'a>) -> Self {
        let census = Mutex::new(vec![Census::default(); cloud.parts()]);
        Self { cloud, carrier, census }
    }

    /// What became of the points.
    pub(super) fn census(&self) -> Census {
        let mut sum = Census::default();
        lock(&self.census).iter().for_each(|census| sum.add(census));
        sum
    }
}

impl Records for CarriedRecords<'_> {
    fn units(&self) -> usize {
        self.cloud.parts()
    }

    fn points(&self, unit: usize) -> u64 {
        self.cloud.points_of(unit)
    }

    fn read(&self, unit: usize, take: &mut Take<'_>) -> Result<()> {
        let census = self.carrier.read(unit, take)?;
        lock(&self.census)[unit] = census;
        Ok(())
    }
}
