//! The derivatives, each a struct of its options. A new one is one here, its kernel, and a line in
//! `terrane::OPERATIONS`.

use std::path::Path;
use std::sync::Arc;

use terrane_options::{OptionRange, OptionRule, Options};

use super::{DerivativeOptions, DerivativeRequest, run};
use crate::convert::job::ConvertReport;
use terrane_base::error::Result;
use terrane_engine::Resources;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FileOutput, FiniteNumber, GridInput, GridOutput};
use terrane_raster::Inputs;
use terrane_window::relief::{
    self as kernels, CurvatureKind, Gradient, HillshadeMode, RuggednessMeasure,
};

terrane_engine::has_within!(
    SlopeOptions AspectOptions HillshadeOptions CurvatureOptions RoughnessOptions TpiOptions TriOptions:
    DerivativeOptions => [FileOutput GridOutput GridInput Resources]
);

/// Implements an operation for a struct of options: its name, the vertical unit if any, and its kernel.
macro_rules! derivative {
    ($options:ident, $name:literal, |$own:ident| $scale:expr, $kernel:expr) => {
        impl Operation for $options {
            const NAME: &'static str = $name;
            type Input = GridInput;
            const WRITES: Writes = Writes::Grid;
            type Report = ConvertReport;

            fn check(&self, output: &Path) -> Result<()> {
                self.common.copy(&Inputs::default(), output).options.check(output)
            }

            fn run(&self, request: RunRequest<'_>) -> Result<ConvertReport> {
                let $own = self;
                let asked = DerivativeRequest {
                    derivative: Arc::new($kernel),
                    scale: $scale,
                    common: &self.common,
                };
                run(&asked, request)
            }
        }
    };
}

/// Slope of a grid at each sample
///
/// The angle to a level plane in degrees, or its tangent in per cent, as 32-bit numbers (-9999 where there is none).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct SlopeOptions {
    /// Gradient algorithm
    #[option(value = "NAME")]
    pub algorithm: Gradient,
    /// In per cent instead of degrees
    pub percent: bool,
    /// Units of heights in a unit of x and y
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "what the grid says of both; of degrees, their length at each latitude")]
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
/// The direction of steepest descent in degrees clockwise from north, as 32-bit numbers (-9999 where there is none, as on
/// level ground).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct AspectOptions {
    /// Gradient algorithm
    #[option(value = "NAME")]
    pub algorithm: Gradient,
    /// Level ground has the aspect 0 instead of none
    pub zero_for_flat: bool,
    /// Units of heights in a unit of x and y
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "what the grid says of both; of degrees, their length at each latitude")]
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
/// Whole numbers from 1 (dark) to 255; 0 where there is none. In a grid of degrees heights count in metres.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = OF_LIGHT)]
#[non_exhaustive]
pub struct HillshadeOptions {
    /// Gradient algorithm
    #[option(value = "NAME")]
    pub algorithm: Gradient,
    /// Direction of the light, in degrees clockwise from north
    #[option(value = "DEG", with = FiniteNumber, default_text = "315")]
    pub azimuth: Option<f64>,
    /// Height of the light above the horizon, in degrees
    #[option(value = "DEG", default = 45.0, range = OptionRange::new(1.0, 90.0))]
    pub altitude: f64,
    /// Factor on heights
    #[option(value = "FACTOR", default = 1.0, range = OptionRange::POSITIVE)]
    pub z_factor: f64,
    /// Light from south-west, west, north-west and north, each weighted by how much the ground falls towards it or away
    /// from it
    pub multidirectional: bool,
    /// The angle to the light scaled by the slope's, so that level ground is brightest
    pub combined: bool,
    /// Units of heights in a unit of x and y
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "what the grid says of both; of degrees, their length at each latitude")]
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
/// By the partial quartic of Zevenbergen & Thorne (1987), in radians by metre, as 32-bit numbers (-9999 where there is
/// none); above 0 where the ground is convex. The general curvature is the sum of the two others.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct CurvatureOptions {
    /// Which curvature
    #[option(value = "NAME")]
    pub kind: CurvatureKind,
    /// Units of heights in a unit of x and y
    #[option(value = "S", range = OptionRange::POSITIVE,
             default_text = "what the grid says of both; of degrees, their length at each latitude")]
    pub scale: Option<f64>,
    /// Options of all derivatives.
    #[option(flatten)]
    pub common: DerivativeOptions,
}

derivative!(CurvatureOptions, "curvature", |own| own.scale, kernels::Curvature(own.kind));

/// Roughness of a grid: the range of heights around each sample
///
/// The highest of a sample and its eight neighbours less the lowest, as 32-bit numbers (-9999 where there is none).
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
/// The height less the mean of the eight around it, as 32-bit numbers (-9999 where there is none).
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
/// How far heights around a sample are from its own, as 32-bit numbers (-9999 where there is none).
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct TriOptions {
    /// The mean of the absolute differences (Wilson et al. 2007), not the root of the sum of squares (Riley et al. 1999)
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
