//! Arguments about the model of the ground that tiles of clouds are made of, which several verbs share.

use crate::cli::shared::tabled::Tabled;
use crate::cloud::OpenOptions;
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::tiles::{GroundModel, ModelOptions};

/// The model of the ground of a cloud.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Ground {
    #[command(flatten)]
    pub(crate) options: Tabled<ModelOptions>,
}

impl Ground {
    /// The model of some clouds.
    pub(crate) fn model(&self, input: Vec<String>, cloud: OpenOptions) -> GroundModel {
        GroundModel { input: input.into(), cloud, model: self.options.0.clone() }
    }

    /// The first of these options that was given.
    pub(crate) fn given(&self) -> Option<String> {
        self.options.1.first().map(|name| format!("‹{name}›"))
    }

    /// Fails when any of these options was given, because `input` is no cloud.
    pub(crate) fn refuse(&self, input: &str) -> Result<()> {
        let Some(option) = self.given() else { return Ok(()) };
        Err(Error::usage(format!("{option} is for tiles of point clouds, and this is none"))
            .in_file(&path_of(input))
            .remedy(format!("leave {option} out")))
    }
}
