//! Arguments that several verbs share.

use std::path::PathBuf;

use clap::Args;

use crate::cli::parse;
use crate::cli::progress::{self, How};
use crate::pipeline::{Progress, Resources};
use crate::raster::OpenOptions;

/// How a grid is read.
#[derive(Clone, Debug, Args)]
pub(super) struct Grid {
    /// Band to read, from 1
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) band: u32,
    /// Stored value that means "no height", instead of the file's own
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true, value_parser = parse::finite_or_nan)]
    pub(super) nodata: Option<f64>,
}

impl Grid {
    /// Options for opening the grid within `resources`.
    pub(super) fn open_options(&self, resources: &Resources) -> OpenOptions {
        let cache_bytes = usize::try_from(resources.memory / 4).unwrap_or(usize::MAX);
        OpenOptions { band: self.band, nodata: self.nodata, cache_bytes }
    }
}

/// What a job may use.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Resources")]
pub(super) struct Machine {
    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Memory for everything the job holds, such as 512M or 4GiB [default: half of the machine's,
    /// at most 4GiB]
    #[arg(long, value_name = "SIZE", value_parser = parse::bytes)]
    memory: Option<u64>,
    /// Folder for temporary files [default: the output's]
    #[arg(long, value_name = "DIR")]
    temp_dir: Option<PathBuf>,
}

impl Machine {
    /// The resources asked for.
    pub(super) fn resources(&self) -> Resources {
        let default = Resources::default();
        Resources {
            threads: self.threads.map_or(default.threads, usize::from),
            memory: self.memory.unwrap_or(default.memory),
            temp_dir: self.temp_dir.clone(),
        }
    }
}

/// What is shown while a job runs and after.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Messages")]
pub(super) struct Show {
    /// Progress on stderr: a bar on a terminal, lines of JSON for programs
    #[arg(long, value_name = "HOW", value_enum, default_value_t = How::Auto)]
    progress: How,
    /// Print the result as JSON
    #[arg(long)]
    pub(super) json: bool,
    /// Print no progress and no summary
    #[arg(short, long)]
    pub(super) quiet: bool,
}

impl Show {
    /// The progress display asked for.
    pub(super) fn progress(&self) -> Box<dyn Progress> {
        progress::display(if self.quiet { How::None } else { self.progress })
    }
}
