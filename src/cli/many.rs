//! Batches: files in folders below, and bad files among good ones.

use serde::Serialize;

use crate::cli::say;
use crate::cloud;
use crate::error::Result;
use crate::pipeline::Resources;
use crate::pipeline::sift::{self, Sifted, Skipped};
use crate::raster;
use crate::vector;

/// Which of many files are taken.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Many files")]
#[group(id = "many")]
pub(super) struct Many {
    /// Take the files in folders below the folders, too
    #[arg(long)]
    recursive: bool,
    /// Go on without files that cannot be opened: each is told on stderr and listed in the report
    #[arg(long)]
    skip_bad: bool,
}

/// The files that inputs stand for.
type Find = fn(&[String]) -> Result<Vec<String>>;

impl Many {
    /// The first of these options that was given.
    pub(super) fn given(&self) -> Option<&'static str> {
        let options = [("--recursive", self.recursive), ("--skip-bad", self.skip_bad)];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// The files of grids that are taken of `inputs`; the names as they are where nothing is asked for.
    pub(super) fn grids(
        &self,
        inputs: &[String],
        options: &raster::OpenOptions,
        resources: &Resources,
    ) -> Result<Sifted> {
        let sift = |names: &[String]| sift::grids(names, options, resources);
        self.taken(inputs, [raster::files, raster::files_below], sift)
    }

    /// The files of clouds.
    pub(super) fn clouds(
        &self,
        inputs: &[String],
        options: &cloud::OpenOptions,
        resources: &Resources,
    ) -> Result<Sifted> {
        let sift = |names: &[String]| sift::clouds(names, options, resources);
        self.taken(inputs, [cloud::files, cloud::files_below], sift)
    }

    /// The files of features; folders and patterns are taken without being asked for.
    pub(super) fn features(
        &self,
        inputs: &[String],
        layer: Option<&String>,
        resources: &Resources,
    ) -> Result<Sifted> {
        let options = vector::OpenOptions { layer: layer.cloned() };
        let sift = |names: &[String]| sift::features(names, &options, resources);
        let mut taken = self.taken(inputs, [vector::files, vector::files_below], sift)?;
        if !self.recursive && !self.skip_bad {
            taken.names = vector::files(inputs)?;
        }
        Ok(taken)
    }

    fn taken(
        &self,
        inputs: &[String],
        [files, files_below]: [Find; 2],
        sift: impl FnOnce(&[String]) -> Result<Sifted>,
    ) -> Result<Sifted> {
        let names = match (self.recursive, self.skip_bad) {
            (false, false) => inputs.to_vec(),
            (true, _) => files_below(inputs)?,
            (false, true) => files(inputs)?,
        };
        if !self.skip_bad {
            return Ok(Sifted { names, skipped: Vec::new() });
        }
        let sifted = sift(&names)?;
        for Skipped { file, reason } in &sifted.skipped {
            say::note(&format!("skipped {file}: {reason}"));
        }
        Ok(sifted)
    }
}

/// A report with the files that were left out.
#[derive(Serialize)]
pub(super) struct WithSkipped<'a, R> {
    #[serde(flatten)]
    pub(super) report: &'a R,
    #[serde(skip_serializing_if = "<[Skipped]>::is_empty")]
    pub(super) skipped: &'a [Skipped],
}
