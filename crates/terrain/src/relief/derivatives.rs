//! The derivatives, each a struct of its options. A new one is one here, its kernel, and a line in
//! `terrane::OPERATIONS`.

use std::path::Path;
use std::sync::Arc;

use terrane_options::{OptionRange, OptionRule, Options};

use super::{DerivativeOptions, DerivativeRequest, run};
use crate::convert::job::ConvertReport;
use terrane_base::error::Result;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FiniteNumber, GridInput};
use terrane_raster::Inputs;
use terrane_window::relief::{
    self as kernels, CurvatureKind, Gradient, HillshadeMode, RuggednessMeasure,
};

/// Implements an operation for a struct of options: its name, the vertical unit if any, and its kernel.
macro_rules! derivative {
    ($options:ident, $name:literal, |$own:ident| $scale:expr, $kernel:expr) => {
        impl Operation for $options {
            const NAME: &'static str = $name;
            type Input = GridInput;
            const WRITES: Writes = Writes::Grid;
            type Report = ConvertReport;

            fn check(&self, output: &Path) -> Result<()> {
                self.common.common.job(&Inputs::default(), output).options.check(output)
            }

            fn run(&self, request: RunRequest<'_>) -> Result<ConvertReport> {
                let $own = self;
                let options = DerivativeRequest {
                    derivative: Arc::new($kernel),
                    scale: $scale,
                    common: &self.common,
                };
                run(&options, request)
            }
        }
    };
}

/// Slope of a grid at each sample
///
/// Slope angle in degrees, or percent slope, as float32 (-9999 is nodata).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct SlopeOptions {
    /// Gradient algorithm
    #[option(value = "NAME")]
    pub algorithm: Gradient,
    /// Percent slope instead of degrees
    pub percent: bool,
    /// Ratio of vertical to horizontal units, such as 111120 for metres over degrees
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "from the units of the grid; for degrees, from their length at each latitude")]
    pub scale: Option<f64>,
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(
    SlopeOptions,
    "slope",
    |own| own.scale,
    kernels::Slope { gradient: own.algorithm, is_percent: own.percent }
);

/// Aspect of a grid at each sample
///
/// Direction of steepest descent in degrees clockwise from north, as float32 (-9999 is nodata, also for level ground).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct AspectOptions {
    /// Gradient algorithm
    #[option(value = "NAME")]
    pub algorithm: Gradient,
    /// Aspect 0 instead of nodata for level ground
    pub zero_for_flat: bool,
    /// Ratio of vertical to horizontal units, such as 111120 for metres over degrees
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "from the units of the grid; for degrees, from their length at each latitude")]
    pub scale: Option<f64>,
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(
    AspectOptions,
    "aspect",
    |own| own.scale,
    kernels::Aspect { gradient: own.algorithm, zero_for_flat: own.zero_for_flat }
);

/// Shaded relief of a grid
///
/// Integers from 1 (dark) to 255; 0 is nodata. In grids with degrees, heights are in metres.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_LIGHT)]
#[non_exhaustive]
pub struct HillshadeOptions {
    /// Gradient algorithm
    #[option(value = "NAME")]
    pub algorithm: Gradient,
    /// Azimuth of the light, in degrees clockwise from north
    #[option(value = "DEG", with = FiniteNumber, default_text = "315")]
    pub azimuth: Option<f64>,
    /// Altitude of the light above the horizon, in degrees
    #[option(value = "DEG", default = 45.0, range = OptionRange::new(1.0, 90.0))]
    pub altitude: f64,
    /// Vertical exaggeration factor
    #[option(value = "FACTOR", default = 1.0, range = OptionRange::POSITIVE)]
    pub z_factor: f64,
    /// Multidirectional shading: light from south-west, west, north-west and north, each weighted by the slope in its
    /// direction
    pub multidirectional: bool,
    /// Combined shading: oblique light scaled by slope, so that level ground is brightest
    pub combined: bool,
    /// Ratio of vertical to horizontal units, such as 111120 for metres over degrees
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "from the units of the grid; for degrees, from their length at each latitude")]
    pub scale: Option<f64>,
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(HillshadeOptions, "hillshade", |own| own.scale, own.kernel());

const OF_LIGHT: &[OptionRule] =
    &[OptionRule::NotWith("multidirectional", &["azimuth", "combined"])];

impl HillshadeOptions {
    fn kernel(&self) -> kernels::Hillshade {
        let light = match (self.multidirectional, self.combined) {
            (true, _) => HillshadeMode::Four,
            (false, true) => HillshadeMode::Combined,
            (false, false) => HillshadeMode::One,
        };
        let azimuth = self.azimuth.unwrap_or(kernels::Hillshade::default().azimuth);
        let (altitude, exaggeration) = (self.altitude, self.z_factor);
        kernels::Hillshade { gradient: self.algorithm, light, azimuth, altitude, exaggeration }
    }
}

/// Curvature of a grid at each sample
///
/// Partial quartic surface of Zevenbergen & Thorne (1987), in radians per metre, as float32 (-9999 is nodata); positive
/// where the ground is convex. General curvature is the sum of profile and plan curvature.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct CurvatureOptions {
    /// Type of curvature
    #[option(value = "NAME")]
    pub kind: CurvatureKind,
    /// Ratio of vertical to horizontal units, such as 111120 for metres over degrees
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "from the units of the grid; for degrees, from their length at each latitude")]
    pub scale: Option<f64>,
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(CurvatureOptions, "curvature", |own| own.scale, kernels::Curvature(own.kind));

/// Roughness of a grid: the range of heights around each sample
///
/// Maximum minus minimum of a sample and its eight neighbours, as float32 (-9999 is nodata).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct RoughnessOptions {
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(RoughnessOptions, "roughness", |_own| None, kernels::Roughness);

/// Topographic position index of a grid at each sample
///
/// Height minus the mean of the eight neighbours, as float32 (-9999 is nodata).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct TpiOptions {
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(TpiOptions, "tpi", |_own| None, kernels::TopographicPositionIndex);

/// Terrain ruggedness index of a grid at each sample
///
/// Height difference between a sample and its eight neighbours, as float32 (-9999 is nodata).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct TriOptions {
    /// Mean of the absolute differences (Wilson et al. 2007) instead of the root of the sum of squares (Riley et al.
    /// 1999)
    pub wilson: bool,
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(
    TriOptions,
    "tri",
    |own| None,
    kernels::Ruggedness(if own.wilson {
        RuggednessMeasure::Wilson
    } else {
        RuggednessMeasure::Riley
    })
);
