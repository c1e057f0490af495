//! Arguments about points of clouds, which several verbs share.

use crate::cli::shared::args::Grid;
use crate::cli::shared::tabled::Tabled;
use crate::cli::shared::text;
use crate::cloud::{Census, OpenOptions};
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::Resources;
use crate::jobs::options::{CloudInput, PointFilter};

/// Which points of a cloud are read, and how, of a verb that reads grids as well.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Points {
    #[command(flatten)]
    filter: Tabled<PointFilter>,
}

impl Points {
    /// How clouds are opened within `resources`; where and clipped to what is said for grids, too.
    ///
    /// # Errors
    /// A file of polygons that cannot be read.
    pub(crate) fn open_options(&self, place: &Grid, resources: &Resources) -> Result<OpenOptions> {
        self.input(place.bounds, place.clip.clone()).options(resources)
    }

    /// How clouds are read, within bounds and polygons.
    pub(crate) fn input(&self, bounds: Option<[f64; 4]>, clip: Option<String>) -> CloudInput {
        CloudInput { bounds, clip, points: self.filter.0.clone() }
    }

    /// Fails when any of these options was given, because `input` is no cloud.
    pub(crate) fn refuse(&self, input: &str) -> Result<()> {
        let Some(option) = self.filter.1.first() else { return Ok(()) };
        Err(Error::usage(format!("‹{option}› is for point clouds, and this is none"))
            .in_file(&path_of(input))
            .remedy(format!("leave ‹{option}› out, or name a .las or .laz file")))
    }
}

/// What became of the points, for people.
pub(crate) fn census(census: &Census) -> String {
    let left_out = [
        (census.withheld, "withheld"),
        (census.filtered, "filtered out"),
        (census.outside, "outside the claimed bounds"),
        (census.lost, "lost"),
    ];
    let left_out = left_out.iter().filter(|(count, _)| *count > 0);
    let left_out: String =
        left_out.map(|(count, how)| format!(", {} {how}", text::count(*count))).collect();
    format!("{} of {}{left_out}", text::count(census.kept), text::count(census.read))
}
