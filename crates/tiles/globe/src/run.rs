//! Samples of the ground, and those that are handed on together, so that what they have in common is found once.

use crate::globe::{EllipsoidNormal, SinCos, bend};

/// A sample of the ground.
#[derive(Clone, Copy, Debug)]
pub struct GroundSample {
    /// Longitude and latitude in degrees.
    pub place: [f64; 2],
    /// Metres.
    pub height: f64,
    /// What is upright there.
    pub upright: EllipsoidNormal,
}

impl GroundSample {
    /// A sample at a longitude and a latitude.
    pub fn new(place: [f64; 2], height: f64) -> Self {
        Self { place, height, upright: EllipsoidNormal::at(place) }
    }
}

/// A meridian of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleMeridian {
    /// Degrees.
    pub(crate) lon: f64,
    pub(crate) turn: SinCos,
}

/// A parallel of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleParallel {
    /// Degrees.
    pub(crate) lat: f64,
    pub(crate) turn: SinCos,
    /// Metres from the ellipsoid to the axis of the earth, along what is upright there.
    pub(crate) bend: f64,
}

impl SampleMeridian {
    pub(crate) fn new(lon: f64) -> Self {
        Self { lon, turn: SinCos::of(lon) }
    }
}

impl SampleParallel {
    pub(crate) fn new(lat: f64) -> Self {
        let turn = SinCos::of(lat);
        Self { lat, turn, bend: bend(turn) }
    }

    /// The sample of a column.
    #[inline]
    pub(crate) fn sample(&self, column: &SampleMeridian, height: f64) -> GroundSample {
        let upright = EllipsoidNormal::of(column.turn, self.turn, self.bend);
        GroundSample { place: [column.lon, self.lat], height, upright }
    }
}

/// Samples along a parallel, void ones among them.
#[derive(Clone, Copy, Debug)]
pub struct SampleRow<'a> {
    pub(crate) parallel: SampleParallel,
    /// Of the first sample and those after it.
    pub(crate) columns: &'a [SampleMeridian],
    pub(crate) heights: &'a [f64],
    /// From one sample to the next.
    pub(crate) stride: usize,
}

impl<'a> SampleRow<'a> {
    /// How many samples there are.
    pub(crate) fn len(&self) -> usize {
        self.heights.len().div_ceil(self.stride)
    }

    /// Columns and heights of its samples.
    #[inline]
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&'a SampleMeridian, f64)> + use<'a> {
        self.columns.iter().zip(self.heights.iter().copied()).step_by(self.stride)
    }
}

/// Samples that are near each other.
#[derive(Clone, Copy, Debug)]
pub enum GroundSampleRun<'a> {
    /// Some along a parallel.
    Row(SampleRow<'a>),
    /// A valid one.
    One(GroundSample),
}

impl GroundSampleRun<'_> {
    /// Hands on the valid ones.
    #[inline]
    pub fn each(&self, found: &mut impl FnMut(GroundSample)) {
        match self {
            Self::One(sample) => found(*sample),
            Self::Row(row) => {
                for (column, height) in row.iter().filter(|(_, height)| height.is_finite()) {
                    found(row.parallel.sample(column, height));
                }
            }
        }
    }
}
