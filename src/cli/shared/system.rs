//! Arguments that say in which reference system an output is to be.

use clap::Args;
use terrane_options::check as check_options;

use crate::cli::shared::report::Row;
use crate::cli::shared::tabled::Tabled;
use crate::cli::shared::{check, text};
use crate::error::Result;
use crate::files::name_of;
use crate::jobs::options::Reprojection;
use crate::jobs::transform::{Transform, Transformed};

/// Another system than that of the input.
#[derive(Clone, Debug, Args)]
pub(crate) struct System {
    #[command(flatten)]
    options: Tabled<Reprojection>,
}

impl System {
    /// What is asked for.
    ///
    /// # Errors
    /// Options that do not go together; files of grids that are not there.
    pub(crate) fn transform(&self) -> Result<Option<Transform>> {
        check_options(&self.options.0)?;
        check::beside(&self.files()?)?;
        Ok(self.options.0.transform())
    }

    /// True where another system is asked for.
    pub(crate) fn is_given(&self) -> bool {
        self.options.0.to_crs.is_some()
    }

    /// The files that are read for it.
    pub(crate) fn files(&self) -> Result<Vec<String>> {
        let Reprojection { shift_grid, geoid, .. } = &self.options.0;
        shift_grid.iter().chain(geoid).map(|path| name_of(path.clone())).collect()
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
