//! Batches: files in subfolders, and skipping of bad files.

use std::path::Path;

use crate::cli::shared::{check, output, pipes};
use terrane_base::error::{Error, Result, all};
use terrane_cloud as cloud;
use terrane_engine::Resources;
use terrane_engine::input::is_mesh;
use terrane_engine::skip_bad::{self, ReadableFiles, Skipped};
use terrane_files::{is_file, is_made, is_there, path_of};
use terrane_raster as raster;
use terrane_vector as vector;

/// Selection of input files.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Input files")]
#[group(id = "many")]
pub(crate) struct InputSelection {
    /// Include files in subfolders
    #[arg(long)]
    recursive: bool,
    /// Skip files that cannot be opened; they are listed on stderr and in the report. If a point cloud turns out to be
    /// damaged while it is read, only the damaged points are lost, as with --salvage, and a note names the file
    #[arg(long)]
    pub(crate) skip_bad: bool,
}

/// Kind of files, and how they are opened.
#[derive(Clone, Copy)]
pub(crate) enum InputFileKind<'a> {
    Grids(&'a raster::GridOpenOptions),
    Clouds(&'a cloud::CloudOpenOptions),
    Features(&'a vector::VectorOpenOptions),
}

impl InputFileKind<'_> {
    fn files(self, inputs: &[String]) -> Result<Vec<String>> {
        match self {
            Self::Grids(_) => raster::files(inputs),
            Self::Clouds(_) => cloud::files(inputs),
            Self::Features(_) => vector::files(inputs),
        }
    }

    fn files_below(self, inputs: &[String]) -> Result<Vec<String>> {
        match self {
            Self::Grids(_) => raster::files_below(inputs),
            Self::Clouds(_) => cloud::files_below(inputs),
            Self::Features(_) => vector::files_below(inputs),
        }
    }

    /// Fails if one of the files of `names` is missing.
    fn check(self, names: &[String]) -> Result<()> {
        match self {
            Self::Clouds(_) => {
                all(cloud::files(names)?.iter().map(|file| check_exists(file)).collect()).map(drop)
            }
            Self::Grids(_) => check::inputs(names),
            Self::Features(_) => check::features(names),
        }
    }

    fn check_files(self, names: &[String], resources: &Resources) -> Result<ReadableFiles> {
        match self {
            Self::Grids(options) => skip_bad::grids(names, options, resources),
            Self::Clouds(options) => skip_bad::clouds(names, options, resources),
            Self::Features(options) => skip_bad::features(names, options, resources),
        }
    }
}

/// True for a vector file.
pub(crate) fn are_lines(path: &Path) -> bool {
    is_file(path) && vector::identify(path).is_ok_and(|format| format.is_some())
}

/// True for a vector file that is not a grid or mesh as well.
pub(crate) fn are_features(input: &str) -> bool {
    are_lines(&path_of(input)) && is_mesh(input).is_err()
}

/// True for synthetic lines by name.
pub(crate) fn are_made_lines(input: &str) -> bool {
    vector::synthetic(&path_of(input)).is_some_and(|lines| lines.is_ok())
}

/// Fails for a missing point cloud.
fn check_exists(file: &str) -> Result<()> {
    let path = path_of(file);
    if is_made(file) || is_there(&path) {
        return Ok(());
    }
    Err(Error::missing(&path))
}

impl InputSelection {
    /// The first given option of this group.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let options = [("--recursive", self.recursive), ("--skip-bad", self.skip_bad)];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// True if `input` is a point cloud by its name, or by those of its files.
    ///
    /// # Errors
    /// A folder that contains both grids and point clouds.
    pub(crate) fn is_cloud(&self, input: &str) -> Result<bool> {
        let is_cloud: fn(&str) -> bool =
            if self.recursive { cloud::is_cloud_below } else { cloud::is_cloud };
        let grids = if self.recursive { raster::files_below } else { raster::files };
        let (is_cloud, path) = (is_cloud(input), path_of(input));
        if is_cloud && path.is_dir() && grids(&[input.to_owned()]).is_ok() {
            return Err(Error::usage("holds both point clouds and grids")
                .in_file(&path)
                .remedy("name files of one kind by a pattern, such as '*.laz'"));
        }
        Ok(is_cloud)
    }

    /// True if the inputs are point clouds.
    ///
    /// # Errors
    /// Point clouds and grids together.
    pub(crate) fn are_clouds(&self, inputs: &[String]) -> Result<bool> {
        let are = inputs.iter().map(|input| self.is_cloud(input)).collect::<Result<Vec<_>>>()?;
        let all = are.iter().all(|is_cloud| *is_cloud);
        match inputs.iter().zip(&are).find(|(_, is_cloud)| **is_cloud != all) {
            Some((odd, _)) => Err(Error::usage("point clouds and grids cannot be mixed")
                .in_file(&path_of(odd))
                .remedy("name files of one kind")),
            None => Ok(all),
        }
    }

    /// Selected files of `inputs`, good and bad; the unchanged names without options. Features are always
    /// expanded, because several files are never one input.
    ///
    /// # Errors
    /// Folders and patterns without files; missing files unless bad ones are skipped.
    pub(crate) fn find(&self, inputs: &[String], kind: InputFileKind<'_>) -> Result<Vec<String>> {
        inputs.iter().try_for_each(|input| pipes::refuse_input(input))?;
        let names = match (self.recursive, self.skip_bad, kind) {
            (true, ..) => kind.files_below(inputs)?,
            (_, true, _) | (.., InputFileKind::Features(_)) => kind.files(inputs)?,
            _ => inputs.to_vec(),
        };
        if !self.skips_bad(&names) {
            kind.check(&names)?;
        }
        Ok(names)
    }

    /// The good files of those found, if bad ones are skipped. A single file is not tested, because nothing
    /// would remain without it.
    pub(crate) fn check_files(
        &self,
        names: Vec<String>,
        kind: InputFileKind<'_>,
        resources: &Resources,
    ) -> Result<ReadableFiles> {
        if !self.skips_bad(&names) {
            return Ok(ReadableFiles { names, skipped: Vec::new() });
        }
        let readable = kind.check_files(&names, resources)?;
        readable.skipped.iter().for_each(print_skipped);
        Ok(readable)
    }

    fn skips_bad(&self, names: &[String]) -> bool {
        self.skip_bad && names.len() > 1
    }

    /// Adds advice to skip bad files, if that would help.
    pub(crate) fn advise(&self, error: Error) -> Error {
        match !self.skip_bad && error.spares_some() {
            true => error.remedy("repair them, leave them out, or skip them with --skip-bad"),
            false => error,
        }
    }
}

/// Prints a skipped file on stderr.
pub(crate) fn print_skipped(Skipped { file, reason }: &Skipped) {
    output::note(&format!("skipped {file}: {reason}"));
}
