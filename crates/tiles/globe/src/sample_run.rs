//! Samples of the ground, grouped so that common values are computed once.

use crate::globe::{EllipsoidNormal, SinCos, bend};

/// A sample of the ground.
#[derive(Clone, Copy, Debug)]
pub struct TerrainSample {
    /// Longitude and latitude in degrees.
    pub place: [f64; 2],
    /// Metres.
    pub height: f64,
    /// Vertical at the sample.
    pub upright: EllipsoidNormal,
}

impl TerrainSample {
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
    /// Metres from the ellipsoid to the axis of the earth, along the vertical.
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

    /// Sample of a column.
    #[inline]
    pub(crate) fn sample(&self, column: &SampleMeridian, height: f64) -> TerrainSample {
        let upright = EllipsoidNormal::of(column.turn, self.turn, self.bend);
        TerrainSample { place: [column.lon, self.lat], height, upright }
    }
}

/// Samples along a parallel, including voids.
#[derive(Clone, Copy, Debug)]
pub struct SampleRow<'a> {
    pub(crate) parallel: SampleParallel,
    /// First sample and those after it.
    pub(crate) columns: &'a [SampleMeridian],
    pub(crate) heights: &'a [f64],
    /// Step between samples.
    pub(crate) stride: usize,
}

impl<'a> SampleRow<'a> {
    /// Number of samples.
    pub(crate) fn len(&self) -> usize {
        self.heights.len().div_ceil(self.stride)
    }

    /// Columns and heights of its samples.
    #[inline]
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&'a SampleMeridian, f64)> + use<'a> {
        self.columns.iter().zip(self.heights.iter().copied()).step_by(self.stride)
    }
}

/// Samples near each other.
#[derive(Clone, Copy, Debug)]
pub enum TerrainSampleRun<'a> {
    /// Some along a parallel.
    Row(SampleRow<'a>),
    /// A valid one.
    One(TerrainSample),
}

impl TerrainSampleRun<'_> {
    /// Passes on the valid samples.
    #[inline]
    pub fn each(&self, found: &mut impl FnMut(TerrainSample)) {
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
