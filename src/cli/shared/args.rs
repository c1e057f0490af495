//! Arguments that several verbs share.

use std::path::PathBuf;

use clap::Args;

use crate::cli::shared::progress::{self, How};
use crate::cli::shared::{names, parse, say};
use crate::error::{Error, Result};
use crate::files::is_made;
use crate::files::path_of;
use crate::jobs::input::is_mesh;
use crate::jobs::memory::cache_beside;
use crate::jobs::options::GridInput;
use crate::jobs::{Progress, Resources};
use crate::raster::OpenOptions;

/// How a grid is read.
#[derive(Clone, Debug, Args)]
pub(crate) struct Grid {
    /// Band to read, from 1 [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    band: Option<u32>,
    /// Stored value that means "no height", instead of the file's own
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true, value_parser = parse::finite_or_nan)]
    pub(crate) nodata: Option<f64>,
    /// Part of a grid, in its coordinates, widened to whole cells (the square around each sample); the points of a cloud
    /// within this box, its borders included; of a mesh that is shown, its own part
    #[arg(long, visible_alias = "bbox", value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true, value_parser = parse::bbox)]
    pub(crate) bounds: Option<[f64; 4]>,
    /// Polygons of a file of features, in the system of the grid or cloud; rings within a polygon are holes. Samples outside
    /// of all of them are taken for voids, and those on a border stay; points outside are left out, and of those on a border
    /// the ones on eastern and northern borders
    #[arg(long, visible_alias = "polygon", value_name = "FILE", value_parser = names::any())]
    pub(crate) clip: Option<String>,
}

impl Grid {
    /// What is asked to be read, with the water of a file.
    pub(crate) fn reading(&self, water: Option<&String>) -> GridInput {
        let Self { band, nodata, bounds, ref clip } = *self;
        GridInput { band, nodata, bounds, clip: clip.clone(), water: water.cloned() }
    }

    /// The same of all of the grid.
    pub(crate) fn whole(&self) -> Self {
        Self { bounds: None, ..self.clone() }
    }

    /// Options for opening each file of the grid within `resources`.
    pub(crate) fn open_options(&self, resources: &Resources) -> OpenOptions {
        let cache_bytes = cache_beside(resources.memory);
        let (threads, temp_dir) = (resources.threads, resources.temp_dir.clone());
        let usual = OpenOptions::default();
        let (band, nodata) = (self.band.unwrap_or(usual.band), self.nodata);
        OpenOptions { band, nodata, cache_bytes, threads, temp_dir, ..usual }
    }

    /// The same with the polygons that the whole grid is clipped to.
    pub(crate) fn clipped(&self, resources: &Resources) -> Result<OpenOptions> {
        self.reading(None).options(resources, cache_beside(resources.memory))
    }

    /// As [`check`](Self::check), for each of `inputs`.
    pub(crate) fn check_all(&self, inputs: &[String]) -> Result<()> {
        inputs.iter().try_for_each(|input| self.check(input))
    }

    /// Fails when an option was given that cannot act on `input`: it is a mesh or made by rule.
    pub(crate) fn check(&self, input: &str) -> Result<()> {
        match self.given() {
            // A synthetic terrain has samples, too.
            Some(option @ ("--clip" | "--bounds")) => only_grids(option, input),
            Some(option) => only_grid_files(option, input),
            None => Ok(()),
        }
    }

    /// Fails when an option was given, because `input` is `what`, such as a point cloud.
    pub(crate) fn refuse(&self, input: &str, what: &str) -> Result<()> {
        self.given().map_or(Ok(()), |option| Err(refusal(option, input, what)))
    }

    /// Fails when an option was given that is about grids alone, because `input` is a point cloud.
    pub(crate) fn refuse_cloud(&self, input: &str) -> Result<()> {
        self.given_of_grids().map_or(Ok(()), |option| Err(refusal(option, input, "a point cloud")))
    }

    /// The first of these options that was given and is about grids alone.
    pub(crate) fn given_of_grids(&self) -> Option<&'static str> {
        self.given().filter(|option| !["--bounds", "--clip"].contains(option))
    }

    /// The first of these options that was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let options = [
            ("--band", self.band.is_some()),
            ("--nodata", self.nodata.is_some()),
            ("--bounds", self.bounds.is_some()),
            ("--clip", self.clip.is_some()),
        ];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }
}

/// Fails when `input` is no grid file, because `option` is about those.
pub(crate) fn only_grid_files(option: &str, input: &str) -> Result<()> {
    if is_made(input) {
        return Err(refusal(option, input, "a synthetic terrain"));
    }
    only_grids(option, input)
}

/// Fails when `input` is a mesh, because `option` is about grids.
pub(crate) fn only_grids(option: &str, input: &str) -> Result<()> {
    // What cannot be told from a grid is told of when it is opened.
    if is_mesh(input).unwrap_or(false) { Err(refusal(option, input, "a mesh")) } else { Ok(()) }
}

/// The error of an option that is for grid files, given with `what`.
pub(crate) fn refusal(option: &str, input: &str, what: &str) -> Error {
    Error::usage(format!("{option} is for grid files, and this is {what}"))
        .in_file(&path_of(input))
        .remedy(format!("leave {option} out"))
}

/// What a job may use.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Resources")]
pub(crate) struct Machine {
    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Memory for everything the job holds, such as 512M or 4GiB [default: half of the machine's,
    /// at most 4GiB]
    #[arg(long, value_name = "SIZE", value_parser = parse::bytes)]
    memory: Option<u64>,
}

impl Machine {
    /// The resources asked for.
    pub(crate) fn resources(&self) -> Resources {
        let default = Resources::default();
        Resources {
            threads: self.threads.map_or(default.threads, usize::from),
            memory: self.memory.unwrap_or(default.memory),
            temp_dir: None,
        }
    }
}

/// What a job may use that spills to temporary files.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Resources")]
pub(crate) struct SpillingMachine {
    #[command(flatten)]
    machine: Machine,
    /// Folder for temporary files [default: the output's, or the system's where there is none and
    /// for inputs that must be unpacked]
    #[arg(long, value_name = "DIR")]
    temp_dir: Option<PathBuf>,
}

impl SpillingMachine {
    /// The resources asked for.
    pub(crate) fn resources(&self) -> Resources {
        Resources { temp_dir: self.temp_dir.clone(), ..self.machine.resources() }
    }

    /// For a verb that needs none of it for meshes: fails when any was given and `input` is one.
    pub(crate) fn check(&self, input: &str) -> Result<()> {
        let options = [
            ("--threads", self.machine.threads.is_some()),
            ("--memory", self.machine.memory.is_some()),
        ];
        match options.into_iter().find(|(_, given)| *given) {
            Some((option, _)) => only_grids(option, input),
            None => self.check_temp_dir(input),
        }
    }

    /// For a verb that spills nothing itself: fails when the folder was given and `input` is a mesh,
    /// which is never unpacked.
    pub(crate) fn check_temp_dir(&self, input: &str) -> Result<()> {
        if self.temp_dir.is_some() { only_grids("--temp-dir", input) } else { Ok(()) }
    }
}

/// What is shown while a job runs and after.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Messages")]
pub(crate) struct Show {
    /// Progress on stderr: a bar on a terminal, lines of JSON for programs
    #[arg(long, value_name = "HOW", value_enum, default_value_t = How::Auto)]
    progress: How,
    /// Print the result as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Print no progress and no summary
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// True where stdout has the result itself.
    #[arg(skip)]
    is_taken: bool,
}

impl Show {
    /// The progress display asked for.
    pub(crate) fn progress(&self) -> Box<dyn Progress> {
        progress::display(if self.quiet { How::None } else { self.progress })
    }

    /// The same, on stderr where stdout has the result itself.
    pub(crate) fn beside(&self, is_taken: bool) -> Self {
        Self { is_taken, ..self.clone() }
    }

    /// Tells a result, as JSON or for people, unless nothing is wanted; returns whether it was told.
    pub(crate) fn tell<R: serde::Serialize>(
        &self,
        report: &R,
        summary: impl FnOnce() -> String,
    ) -> Result<bool> {
        match (self.json, self.quiet) {
            (true, _) if self.is_taken => say::aside(&say::pretty(report)?),
            (true, _) => say::json(report)?,
            (false, false) if self.is_taken => say::aside(&summary()),
            (false, false) => say::result(&summary())?,
            (false, true) => return Ok(false),
        }
        Ok(true)
    }
}
