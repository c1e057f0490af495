//! `terrane info`: properties of grids, meshes, point clouds and vector files.

mod cloud;
mod details;
mod features;
mod grid;
mod mesh;
mod picture;
mod quality;

use serde::Serialize;
use terrane_options::check_given;

use crate::cli::operation::{OperationInput, take};
use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::union::{InputKindOptions, InputKinds, InputUnion};
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, batch, check, lists, names, output, report, text};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::input::is_mesh;
use terrane_engine::operation::HasGroup;
use terrane_engine::options::{CloudInput, FeatureInput, GridInput};
use terrane_engine::proof::Inspection;
use terrane_engine::skip_bad::{ReadableFiles, Skipped};
use terrane_engine::{Cancel, Progress};
use terrane_files::path_of;
use terrane_raster::Inputs;
use terrane_viewer::info::{
    CloudInfoOptions, CloudInfoReport, FeaturesInfoOptions, FeaturesInfoReport, GridInfoOptions,
    GridInfoReport, MeshInfoOptions, MeshInfoReport,
};

/// Describe grids, meshes, point clouds and feature files: metadata, anomalies, and the cost of a TIN of a grid
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct InfoArgs {
    /// Grid, mesh, point cloud and feature files, or names of synthetic terrains; a folder, a list or a quoted pattern
    /// is one mosaic or one point cloud
    #[arg(required = true, value_name = "FILE", value_parser = names::any())]
    files: Vec<String>,
    /// Treat all files as one mosaic or one point cloud
    #[arg(long)]
    mosaic: bool,
    #[command(flatten)]
    options: InputUnion<DescribedInput>,
    #[command(flatten)]
    pub(crate) many: batch::InputSelection,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// Kinds of input.
#[derive(Clone, Debug)]
struct DescribedInput;

impl InputKinds for DescribedInput {
    const ALL: &'static [InputKindOptions] = &[
        InputKindOptions::of::<GridInfoOptions>(GridInfoOptions::OF),
        InputKindOptions::of::<MeshInfoOptions>(MeshInfoOptions::OF),
        InputKindOptions::of::<CloudInfoOptions>(CloudInfoOptions::OF),
        InputKindOptions::of::<FeaturesInfoOptions>(FeaturesInfoOptions::OF),
    ];
}

impl Verb for InfoArgs {
    const NAME: &'static str = "info";

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::meshes()]
    }

    fn input_selection(&self) -> Option<&InputSelection> {
        Some(&self.many)
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self, call.cancel)
    }
}

/// Describes each file, independent of bad ones.
fn run(args: &InfoArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let progress = args.show.progress();
    let (mut is_any_described, mut failures) = (false, Vec::new());
    let at_once = if args.mosaic { args.files.len() } else { 1 };
    if args.options.given().contains(&"picture") && args.files.len() > at_once {
        return Err(Error::usage("‹picture› is not supported for several inputs")
            .remedy("merge them with --mosaic, or name one"));
    }
    for files in args.files.chunks(at_once.max(1)) {
        match args.describe(files, progress.as_ref(), cancel) {
            Ok((facts, skipped)) => {
                is_any_described = true;
                match args.show.json {
                    true => output::json_line(&report::WithSkipped {
                        report: &facts,
                        skipped: &skipped,
                    })?,
                    false => output::result(&facts.text(&describe(files)))?,
                }
            }
            Err(error) => {
                cancel.check()?;
                failures.push((describe(files), error));
            }
        }
    }
    let may_skip = failures.iter().all(|(_, error)| error.is_about_a_file());
    if args.many.skip_bad && is_any_described && may_skip {
        return skip(&failures, args);
    }
    let last = failures.pop();
    failures.into_iter().for_each(|(_, error)| output::error(&args.many.advise(error)));
    last.map_or(Ok(VerbOutcome::Kept), |(_, error)| Err(error))
}

/// Reports single files that are skipped.
fn skip(failures: &[(String, Error)], args: &InfoArgs) -> Result<VerbOutcome> {
    let skipped = failures.iter().map(|(name, error)| Skipped::new(name, error));
    let skipped: Vec<Skipped> = skipped.collect();
    skipped.iter().for_each(batch::print_skipped);
    if args.show.json && !skipped.is_empty() {
        output::json_line(&serde_json::json!({ "skipped": skipped }))?;
    }
    Ok(VerbOutcome::Kept)
}

fn describe(files: &[String]) -> String {
    Inputs::from(files.to_vec()).to_string()
}

/// Properties of a file.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum InfoReport {
    Grid(Box<GridInfoReport>),
    Mesh(Box<MeshInfoReport>),
    Cloud(Box<CloudInfoReport>),
    Features(Box<FeaturesInfoReport>),
}

impl InfoReport {
    fn text(&self, file: &str) -> String {
        let rows = match self {
            InfoReport::Grid(grid) => grid::rows(grid),
            InfoReport::Mesh(mesh) => mesh::rows(mesh),
            InfoReport::Cloud(cloud) => cloud::rows(cloud),
            InfoReport::Features(features) => features::rows(features),
        };
        format!("{file}\n{}", text::table(&rows))
    }
}

/// Properties of files, with the skipped ones.
type Known<R = InfoReport> = (R, Vec<Skipped>);

impl InfoArgs {
    fn describe(
        &self,
        files: &[String],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Known> {
        if files.iter().any(|file| batch::are_features(file)) {
            let (facts, skipped) = self.features(files, progress, cancel)?;
            return Ok((InfoReport::Features(Box::new(facts)), skipped));
        }
        let are_clouds = files.iter().map(|file| self.many.is_cloud(file));
        if are_clouds.collect::<Result<Vec<_>>>()?.contains(&true) {
            let options: CloudInfoOptions = self.of(files)?;
            if let Some(picture) = &options.picture {
                check::new_file(picture, options.replacing.overwrite)?;
            }
            let (facts, skipped) =
                self.inspect::<_, CloudInput>(options, files, progress, cancel)?;
            return Ok((InfoReport::Cloud(Box::new(facts)), skipped));
        }
        let as_grid = match self.surface(files, progress, cancel) {
            Err(error) if error.kind() == ErrorKind::BadInput => error,
            other => return other,
        };
        // A table of positions may be a vector file.
        if !files.iter().any(|file| batch::are_lines(&path_of(file))) {
            return Err(as_grid);
        }
        match self.features(files, progress, cancel) {
            Ok((mut facts, skipped)) if facts.is_more_than_positions() => {
                facts.notes.push(format!("read as features; not a grid: {as_grid}"));
                Ok((InfoReport::Features(Box::new(facts)), skipped))
            }
            _ => Err(as_grid),
        }
    }

    fn features(
        &self,
        files: &[String],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Known<FeaturesInfoReport>> {
        if files.len() > 1 {
            return Err(Error::usage("--mosaic is not supported for feature files")
                .remedy("leave --mosaic out"));
        }
        self.inspect::<FeaturesInfoOptions, FeatureInput>(self.of(files)?, files, progress, cancel)
    }

    /// Properties of grids or of a mesh.
    fn surface(&self, files: &[String], progress: &dyn Progress, cancel: &Cancel) -> Result<Known> {
        if let [file] = files {
            check::input(file)?;
        }
        match files {
            [file] if is_mesh(file)? => {
                let given = self.options.given();
                if !given.contains(&"against") {
                    GridInput::check(file, &self.many, given)?;
                }
                let options: MeshInfoOptions = self.of(files)?;
                if let Some(grid) = &options.against {
                    check::input(grid)?;
                    GridInput::check(grid, &self.many, given)?;
                }
                let facts = options.inspect(&file.clone().into(), progress, cancel)?;
                Ok((InfoReport::Mesh(Box::new(facts)), Vec::new()))
            }
            _ => {
                let options: GridInfoOptions = self.of(files)?;
                let (facts, skipped) =
                    self.inspect::<_, GridInput>(options, files, progress, cancel)?;
                Ok((InfoReport::Grid(Box::new(facts)), skipped))
            }
        }
    }

    /// Options for files of one kind.
    fn of<O: Inspection>(&self, files: &[String]) -> Result<O> {
        let options = self.options.of(&describe(files))?;
        check_given(&options, self.options.given()).map(|()| options)
    }

    /// Properties of the selected files.
    fn inspect<O: Inspection + HasGroup<I>, I: OperationInput>(
        &self,
        mut options: O,
        files: &[String],
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<Known<O::Report>> {
        let given = self.options.given();
        let ReadableFiles { names, skipped } =
            take::<O, I>(&mut options, given, files.to_vec(), &self.many)?;
        Ok((options.inspect(&names.into(), progress, cancel)?, skipped))
    }
}
