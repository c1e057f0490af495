//! Arguments that say on which lattice a copy is to be.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::cli::shared::system::System;
use crate::cli::shared::{check, names, parse};
use crate::error::Result;
use crate::jobs::convert::ConvertJob;
use crate::jobs::warp::{Wanted, WarpJob};
use crate::registry;
use crate::resample::{RESAMPLINGS, Resampling};

/// Another lattice than that of the input.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Lattice")]
pub(super) struct Warp {
    #[command(flatten)]
    system: System,
    /// How heights are found where samples of the output lie between those of the input; nothing is ever resampled
    /// without it
    #[arg(long, value_name = "NAME", value_parser = resampling())]
    resampling: Option<&'static Resampling>,
    /// Side of a cell of the output, or its width and height, in units of its system; edges lie at multiples of it
    /// [default: as large as in the middle of the input]
    #[arg(long, value_name = "X[,Y]", value_parser = parse::cell, conflicts_with = "like")]
    resolution: Option<[f64; 2]>,
    /// Rectangle that the output covers, in its system [default: all of the input]
    #[arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true, value_parser = parse::bbox,
          conflicts_with = "like")]
    extent: Option<[f64; 4]>,
    /// Grid whose lattice the output is to have: sample on sample
    #[arg(long, value_name = "GRID", value_parser = names::any())]
    like: Option<String>,
}

fn resampling() -> impl TypedValueParser<Value = &'static Resampling> {
    let names =
        RESAMPLINGS.iter().map(|own| clap::builder::PossibleValue::new(own.name).help(own.about));
    PossibleValuesParser::new(names.collect::<Vec<_>>())
        .try_map(|name| registry::named(RESAMPLINGS, &name))
}

impl Warp {
    /// The job that is asked for instead of a copy, if one is.
    ///
    /// # Errors
    /// Those of [`WarpJob::asked`]; files that are not there, or would be replaced.
    pub(super) fn job(&self, copy: &ConvertJob) -> Result<Option<WarpJob>> {
        let (like, resolution, extent) = (self.like.clone(), self.resolution, self.extent);
        let wanted = Wanted { like, resolution, extent };
        let mut files = self.system.files()?;
        files.extend(self.like.clone());
        self.like.iter().try_for_each(|like| check::input(like))?;
        check::not_among(&files, &[&copy.output])?;
        WarpJob::asked(copy, self.system.transform()?, wanted, self.resampling)
    }
}
