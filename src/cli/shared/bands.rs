//! Several bands at once: `--bands` and `--weights`.

use crate::cli::shared::args;
use crate::cli::shared::parse;
use crate::error::{Error, Result};
use crate::jobs::bands::Bands;
use crate::jobs::verify::AskedBands;

/// Which bands, and how much an error in each counts.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Several bands")]
pub(crate) struct Given {
    /// Bands that share one mesh, such as 1,2,3 for the colours of a photograph: the error of a sample is the
    /// largest over them of weight x |value - mesh|. The mesh has their values at its vertices; heights are
    /// those of --band, if it is among them, and 0 else
    #[arg(long, value_name = "N,..", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..))]
    bands: Vec<u32>,
    /// How much an error in each band counts [default: 1 each; of a proof, what the mesh states]
    #[arg(long, value_name = "W,..", value_delimiter = ',', value_parser = parse::positive, requires = "bands")]
    weights: Vec<f64>,
}

impl Given {
    /// True when there are any.
    pub(crate) fn is_given(&self) -> bool {
        !self.bands.is_empty()
    }

    /// The bands of a mesh to make.
    pub(crate) fn bands(&self, grid: &args::Grid) -> Result<Option<Bands>> {
        let given = self.is_given();
        given.then(|| Bands::new(&self.bands, &self.weights, grid.named_band())).transpose()
    }

    /// The bands that a mesh is to be held to.
    pub(crate) fn asked(&self, grid: &args::Grid) -> Result<Option<AskedBands>> {
        let Some(bands) = self.bands(grid)? else { return Ok(None) };
        let weights = self.weights.clone();
        Ok(Some(AskedBands { bands: self.bands.clone(), weights, heights: bands.heights() }))
    }

    /// Fails when bands were given and one of `options` is, too.
    pub(crate) fn refuse_beside(&self, options: &[(&str, bool)]) -> Result<()> {
        match options.iter().find(|(_, given)| self.is_given() && *given) {
            None => Ok(()),
            Some((option, _)) => Err(Error::usage(format!("--bands has no {option}"))
                .remedy(format!("leave {option} out, or name one band with --band"))),
        }
    }
}
