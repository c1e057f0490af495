//! Arguments about the model of the ground that tiles of clouds are made of, which several verbs share.

use crate::cli::shared::parse;
use crate::cloud::OpenOptions;
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::grid::GroundFrom;
use crate::jobs::tiles::GroundModel;

/// The model of the ground of a cloud.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Model of the ground")]
pub(crate) struct Ground {
    /// Side of a cell of the model of a cloud, or its width and height, in the units of the CRS [default: the
    /// distance between points as the headers tell it, rounded up to 1, 2 or 5 times a power of ten]
    #[arg(long, value_name = "SIZE", value_parser = parse::cell)]
    cell: Option<[f64; 2]>,
    /// Which points of a cloud are ground, as in terrane grid: class, a method with its parameters, or auto: by
    /// class if there are any, else by the method adaptive [default: auto]
    #[arg(long, value_name = "HOW", value_parser = GroundName::parse)]
    ground: Option<GroundName>,
}

/// Which points are ground, as it is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GroundName(GroundFrom);

impl GroundName {
    /// As jobs have it, where it was named or not.
    pub(crate) fn of(named: Option<Self>) -> GroundFrom {
        named.map_or(GroundFrom::Auto, |Self(from)| from)
    }

    /// "auto", "class", or a method with its parameters.
    pub(crate) fn parse(text: &str) -> std::result::Result<Self, String> {
        text.parse().map(Self).map_err(|e: Error| e.to_string())
    }
}

impl Ground {
    /// The model of some clouds.
    pub(crate) fn model(&self, input: Vec<String>, cloud: OpenOptions) -> GroundModel {
        GroundModel { input, cloud, cell: self.cell, ground: GroundName::of(self.ground) }
    }

    /// The first of these options that was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let options = [("--cell", self.cell.is_some()), ("--ground", self.ground.is_some())];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// Fails when any of these options was given, because `input` is no cloud.
    pub(crate) fn refuse(&self, input: &str) -> Result<()> {
        let Some(option) = self.given() else { return Ok(()) };
        Err(Error::usage(format!("{option} is for tiles of point clouds, and this is none"))
            .in_file(&path_of(input))
            .remedy(format!("leave {option} out")))
    }
}
