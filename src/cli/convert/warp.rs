//! Arguments that say on which lattice a copy is to be.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::cli::shared::system::System;
use crate::cli::shared::{check, names, parse};
use crate::error::{Error, Result};
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
    /// Another lattice without a way to find heights, or the other way round; files that are not there, or would be
    /// replaced.
    pub(super) fn job(&self, copy: &ConvertJob) -> Result<Option<WarpJob>> {
        let transform = self.system.transform()?;
        let (like, resolution, extent) = (self.like.clone(), self.resolution, self.extent);
        let wanted = Wanted { like, resolution, extent };
        let Some(resampling) = self.resampling else { return self.refuse(&wanted).map(|()| None) };
        if transform.is_none() && !wanted.is_some() {
            return Err(Error::usage("--resampling alone leaves every sample where it is")
                .remedy("add --to-crs, --resolution, --extent or --like, or leave it out"));
        }
        let mut files = self.system.files()?;
        files.extend(self.like.clone());
        self.like.iter().try_for_each(|like| check::input(like))?;
        check::not_among(&files, &[&copy.output])?;
        Ok(Some(WarpJob { copy: copy.clone(), transform, wanted, resampling }))
    }

    /// Fails where samples would have to be made up unasked.
    fn refuse(&self, wanted: &Wanted) -> Result<()> {
        let options = [
            ("--to-crs", self.system.is_given()),
            ("--resolution", wanted.resolution.is_some()),
            ("--extent", wanted.extent.is_some()),
            ("--like", wanted.like.is_some()),
        ];
        let given = options.into_iter().find(|(_, given)| *given);
        given.map_or(Ok(()), |(option, _)| {
            let names: Vec<_> = RESAMPLINGS.iter().map(|own| own.name).collect();
            let message =
                format!("{option} moves samples, and grids are never resampled unless asked");
            Err(Error::usage(message)
                .remedy(format!("say how with --resampling: {}", names.join(", "))))
        })
    }
}
