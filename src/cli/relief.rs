//! `terrane slope`, `aspect`, `hillshade`, `curvature`, `roughness`, `tpi`, `tri`: what the ground is like at each
//! sample of a grid, as a grid.

use std::path::PathBuf;
use std::sync::Arc;

use clap::ValueEnum;

use crate::cli::convert;
use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, lists, many, names, parse, report};
use crate::error::{Error, Result};
use crate::jobs::convert::ConvertJob;
use crate::jobs::relief::{self, ReliefJob};
use crate::jobs::sift::Sifted;
use crate::relief::{self as kinds, Derivative, Gradient};

/// What is wanted of a grid: a verb of its own.
pub(super) trait Wanted: clap::Args + Clone + 'static {
    const NAME: &'static str;
    const ABOUT: &'static str;

    fn derivative(&self) -> Arc<dyn Derivative>;
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args<W: Wanted> {
    /// Grid file, or a synthetic terrain by name; several files, a folder, a list or a pattern in
    /// quotes are one mosaic. The last name is that of the file to write
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    #[command(flatten)]
    wanted: W,
    /// Samples at the border of the grid and beside voids have a value, too: what is beyond the grid is on the line
    /// through the two samples inside, and voids are as high as the sample
    #[arg(long)]
    compute_edges: bool,
    /// Units of heights in a unit of x and y [default: what the grid says of both; of degrees, their length at each
    /// latitude]
    #[arg(long, value_name = "S", value_parser = parse::positive)]
    scale: Option<f64>,
    #[command(flatten)]
    written: args::Written,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

impl<W: Wanted> Verb for Args<W> {
    const NAME: &'static str = W::NAME;
    const USAGE: Option<&'static str> = Some("[OPTIONS] <INPUT>... <OUTPUT>");
    const ABOUT: Option<&'static str> = Some(W::ABOUT);

    fn lists() -> Vec<String> {
        vec![
            lists::grids(),
            lists::grids_written(),
            lists::creation_options(),
            lists::EXIT_CODES.to_owned(),
        ]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        Some((&mut self.input, &mut self.output))
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        let resources = self.machine.resources();
        let options = self.grid.open_options(&resources);
        let Sifted { names, skipped } =
            self.many.take(&self.input, many::Kind::Grids(&options), &resources)?;
        self.grid.check_all(&names)?;
        let copy = ConvertJob {
            format: self.written.format.clone(),
            creation: self.written.co.clone(),
            reading: self.grid.reading(None),
            overwrite: self.written.overwrite,
            resources,
            ..ConvertJob::new(names, &self.output)
        };
        convert::check(&copy)?;
        let derivative = self.wanted.derivative();
        if self.scale.is_some() && !derivative.is_of_slopes() {
            return Err(Error::usage(format!("--scale is for slopes, and {} has none", W::NAME))
                .remedy("leave --scale out"));
        }
        let job = ReliefJob { copy, derivative, scale: self.scale, edges: self.compute_edges };
        let made = relief::run(&job, self.show.progress().as_ref(), call.cancel)?;
        let told = report::WithSkipped { report: &made, skipped: &skipped };
        self.show.tell(&told, || report::plain(&made))?;
        Ok(Outcome::Kept)
    }
}

/// How the change of height is told.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Algorithm {
    /// All eight neighbours (Horn 1981)
    #[default]
    Horn,
    /// The four straight beside it (Zevenbergen & Thorne 1987), for smooth ground
    ZevenbergenThorne,
}

impl From<Algorithm> for Gradient {
    fn from(algorithm: Algorithm) -> Self {
        match algorithm {
            Algorithm::Horn => Self::Horn,
            Algorithm::ZevenbergenThorne => Self::ZevenbergenThorne,
        }
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Slope {
    /// How the change of height is told
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    algorithm: Algorithm,
    /// In per cent instead of degrees
    #[arg(long)]
    percent: bool,
}

impl Wanted for Slope {
    const NAME: &'static str = "slope";
    const ABOUT: &'static str = "How steep a grid is at each sample, as a grid\n\n\
        The angle to a level plane in degrees, or its tangent in per cent, as 32-bit numbers (-9999 where there is \
        none).";

    fn derivative(&self) -> Arc<dyn Derivative> {
        Arc::new(kinds::Slope { gradient: self.algorithm.into(), is_percent: self.percent })
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Aspect {
    /// How the change of height is told
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    algorithm: Algorithm,
    /// Level ground has the aspect 0 instead of none
    #[arg(long)]
    zero_for_flat: bool,
}

impl Wanted for Aspect {
    const NAME: &'static str = "aspect";
    const ABOUT: &'static str = "Where a grid falls to at each sample, as a grid\n\n\
        The direction of steepest descent in degrees clockwise from north, as 32-bit numbers (-9999 where there is \
        none, as on level ground).";

    fn derivative(&self) -> Arc<dyn Derivative> {
        let (gradient, zero_for_flat) = (self.algorithm.into(), self.zero_for_flat);
        Arc::new(kinds::Aspect { gradient, zero_for_flat })
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Hillshade {
    /// How the change of height is told
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    algorithm: Algorithm,
    /// Where the light comes from, in degrees clockwise from north [default: 315]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = parse::finite,
          conflicts_with = "multidirectional")]
    azimuth: Option<f64>,
    /// Height of the light above the horizon, in degrees from 1 to 90
    #[arg(long, value_name = "DEG", value_parser = parse::altitude, default_value_t = 45.0)]
    altitude: f64,
    /// Factor on heights
    #[arg(long, value_name = "FACTOR", value_parser = parse::positive, default_value_t = 1.0)]
    z_factor: f64,
    /// Light from south-west, west, north-west and north, each weighted by how much the ground falls towards it or
    /// away from it
    #[arg(long)]
    multidirectional: bool,
    /// The angle to the light scaled by the slope's, so that level ground is brightest
    #[arg(long, conflicts_with = "multidirectional")]
    combined: bool,
}

impl Wanted for Hillshade {
    const NAME: &'static str = "hillshade";
    const ABOUT: &'static str = "How bright a grid is in the light at each sample, as a grid\n\n\
        Whole numbers from 1 (dark) to 255; 0 where there is none. In a grid of degrees heights count in metres.";

    fn derivative(&self) -> Arc<dyn Derivative> {
        let light = match (self.multidirectional, self.combined) {
            (true, _) => kinds::Light::Four,
            (false, true) => kinds::Light::Combined,
            (false, false) => kinds::Light::One,
        };
        let usual = kinds::Hillshade::default();
        Arc::new(kinds::Hillshade {
            gradient: self.algorithm.into(),
            light,
            azimuth: self.azimuth.unwrap_or(usual.azimuth),
            altitude: self.altitude,
            exaggeration: self.z_factor,
        })
    }
}

/// Which way the ground is looked along.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Kind {
    /// Of the whole: above 0 where the ground is convex
    #[default]
    General,
    /// Along the line of steepest descent: above 0 where the slope grows downhill
    Profile,
    /// Across it: above 0 where water parts
    Plan,
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Curvature {
    /// Which way the ground is looked along
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    kind: Kind,
}

impl Wanted for Curvature {
    const NAME: &'static str = "curvature";
    const ABOUT: &'static str = "How a grid bends at each sample, as a grid\n\n\
        By the partial quartic of Zevenbergen & Thorne (1987), in radians by metre, as 32-bit numbers (-9999 where \
        there is none); above 0 where the ground is convex. The general curvature is the sum of the two others.";

    fn derivative(&self) -> Arc<dyn Derivative> {
        Arc::new(kinds::Curvature(match self.kind {
            Kind::General => kinds::Kind::General,
            Kind::Profile => kinds::Kind::Profile,
            Kind::Plan => kinds::Kind::Plan,
        }))
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Roughness {}

impl Wanted for Roughness {
    const NAME: &'static str = "roughness";
    const ABOUT: &'static str = "How much heights differ around each sample, as a grid\n\n\
        The highest of a sample and its eight neighbours less the lowest, as 32-bit numbers (-9999 where there is \
        none).";

    fn derivative(&self) -> Arc<dyn Derivative> {
        Arc::new(kinds::Roughness)
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Tpi {}

impl Wanted for Tpi {
    const NAME: &'static str = "tpi";
    const ABOUT: &'static str = "How far each sample lies above what is around it, as a grid\n\n\
        The topographic position index: the height less the mean of the eight around it, as 32-bit numbers (-9999 \
        where there is none).";

    fn derivative(&self) -> Arc<dyn Derivative> {
        Arc::new(kinds::Position)
    }
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct Tri {
    /// The mean of the absolute differences (Wilson et al. 2007), not the root of the sum of squares (Riley et al.
    /// 1999)
    #[arg(long)]
    wilson: bool,
}

impl Wanted for Tri {
    const NAME: &'static str = "tri";
    const ABOUT: &'static str = "How far heights around each sample are from its own, as a grid\n\n\
        The terrain ruggedness index, as 32-bit numbers (-9999 where there is none).";

    fn derivative(&self) -> Arc<dyn Derivative> {
        let measure = if self.wilson { kinds::Measure::Wilson } else { kinds::Measure::Riley };
        Arc::new(kinds::Ruggedness(measure))
    }
}
