//! Arguments that say in which reference system an output is to be.

use std::path::PathBuf;

use clap::Args;

use crate::cli::shared::report::Row;
use crate::cli::shared::{check, parse, text};
use crate::error::Result;
use crate::files::name_of;
use crate::jobs::transform::{Transform, Transformed};

/// Another system than that of the input.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Reference system")]
pub(crate) struct System {
    /// Write in this reference system, such as EPSG:4326 or well-known text; all that is decided is
    /// decided before, in the system of the input
    #[arg(long, value_name = "CRS", value_parser = parse::crs)]
    to_crs: Option<String>,
    /// Grid of shifts between the datums of the two systems: an NTv2 file (.gsb)
    #[arg(long, value_name = "FILE", requires = "to_crs")]
    shift_grid: Option<PathBuf>,
    /// Heights of a geoid above the ellipsoid (GTX or GeoTIFF), for systems that count heights from
    /// different ones of the two
    #[arg(long, value_name = "FILE", requires = "to_crs")]
    geoid: Option<PathBuf>,
}

impl System {
    /// What is asked for.
    ///
    /// # Errors
    /// Files of grids that are not there.
    pub(crate) fn transform(&self) -> Result<Option<Transform>> {
        let Some(target) = self.to_crs.clone() else { return Ok(None) };
        let transform =
            Transform { target, shift_grid: self.shift_grid.clone(), geoid: self.geoid.clone() };
        self.files()?.iter().try_for_each(|file| check::input(file))?;
        Ok(Some(transform))
    }

    /// True where another system is asked for.
    pub(crate) fn is_given(&self) -> bool {
        self.to_crs.is_some()
    }

    /// The files that are read for it.
    pub(crate) fn files(&self) -> Result<Vec<String>> {
        self.shift_grid.iter().chain(&self.geoid).map(|path| name_of(path.clone())).collect()
    }
}

/// What was done to positions, for people.
pub(crate) fn rows(done: Option<&Transformed>) -> impl Iterator<Item = Row> {
    done.into_iter().flat_map(|done| {
        let accuracy = match done.accuracy {
            Some(0.0) => String::new(),
            Some(metres) => format!(", right to {} m", text::number(metres)),
            None => ", how right is not known".to_owned(),
        };
        [("written in", done.crs.clone()), ("operation", format!("{}{accuracy}", done.operation))]
    })
}
