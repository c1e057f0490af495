//! `terrane tin`: meshes of grids and point clouds with a proven error bound.

mod cloud;
mod grid;
mod report;

pub(crate) use report::{MadeMeshReport, stages};

use std::path::PathBuf;

use crate::cli::operation::{FinishedRun, RunArguments, is_replacing, make};
use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::report::Summarize;
use crate::cli::shared::union::{InputKindOptions, InputKinds, InputUnion};
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{self, VerbOutcome, args, batch, lists, names};
use crate::cli::verify;
use terrane_base::error::{Error, Result};
use terrane_engine::proof::{OutputProof, WrittenOutput};
use terrane_lidar::cloud_tin::CloudTinOptions;
use terrane_terrain::tin::TinOptions;
use terrane_verify::{CloudMeshProof, MeshOriginal, MeshProof, MeshReport};

/// Simplify a grid or a point cloud into a triangle mesh with a proven vertical error bound
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct TinVerbArgs {
    /// Grid file, or name of a synthetic terrain such as synth:rough,size=4097,seed=7; several files, a folder, a list
    /// or a quoted pattern are one mosaic. Or one or more point clouds (.las, .laz). The last name is the output mesh
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    input: Vec<String>,
    #[arg(skip)]
    output: PathBuf,
    /// Output file, if it is not the last name
    #[arg(short = 'o', long = "output", value_name = "FILE", help_heading = "Output")]
    named: Option<PathBuf>,
    /// Write the report to a JSON file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Verify the written mesh against the grid
    #[arg(long, help_heading = "Output")]
    verify: bool,
    #[command(flatten)]
    options: InputUnion<TinSources>,
    #[command(flatten)]
    many: batch::InputSelection,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// Kinds of input.
#[derive(Clone, Debug)]
pub(crate) struct TinSources;

impl InputKinds for TinSources {
    const ALL: &'static [InputKindOptions] = &[
        InputKindOptions::of::<TinOptions>("grids"),
        InputKindOptions::of::<CloudTinOptions>("point clouds"),
    ];
}

impl Verb for TinVerbArgs {
    const NAME: &'static str = "tin";

    fn usage() -> Option<String> {
        Some("[OPTIONS] <--max-error <E>|--max-vertices <N>|--max-triangles <N>> <INPUT>... <OUTPUT>".to_owned())
    }

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::meshes(), lists::meshers(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        let Self { input, output, named, .. } = self;
        let Some(named) = named.take() else { return Some((input, output)) };
        *output = named;
        None
    }

    fn input_selection(&self) -> Option<&InputSelection> {
        Some(&self.many)
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        match self.many.are_clouds(&self.input)? {
            true => self.of_cloud(call),
            false => self.of_grid(call),
        }
    }
}

impl TinVerbArgs {
    fn frame(&self) -> RunArguments<'_> {
        let Self { input, output, options, report, many, show, .. } = self;
        let (given, report) = (options.given(), report.as_deref());
        RunArguments { input, output, given, report, many, show }
    }

    fn of_grid(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        let mut options: TinOptions = self.options.of(&self.input[0])?;
        if self.verify {
            refuse_proof(&options)?;
        }
        let made = make(&mut options, &self.frame(), call)?;
        let mut proof = MeshProof::default();
        proof.max_error = Some(made.report.tolerance);
        proof.constraints = options.refinement.constraints.clone();
        proof.grid = options.grid.clone();
        proof.bands = options.bands.clone();
        proof.weights = options.weights.clone();
        proof.resources = options.resources.clone();
        self.print(is_replacing(&options), &made, &proof, verify::summary, call)
    }

    fn of_cloud(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        let mut options: CloudTinOptions = self.options.of(&self.input[0])?;
        let made = make(&mut options, &self.frame(), call)?;
        let mut proof = CloudMeshProof::default();
        proof.max_error = Some(made.report.tolerance);
        proof.constraints = options.constraints.clone();
        proof.cloud = options.cloud.clone();
        proof.resources = options.resources.clone();
        self.print(is_replacing(&options), &made, &proof, verify::cloud::summary, call)
    }

    /// Verifies the mesh if requested, and writes and prints both reports.
    fn print<R: Summarize, O: MeshOriginal, P: OutputProof<Report = MeshReport<O>>>(
        &self,
        is_replacing: bool,
        made: &FinishedRun<R>,
        proof: &P,
        summary: fn(&MeshReport<O>) -> String,
        call: &VerbCall<'_>,
    ) -> Result<VerbOutcome> {
        let FinishedRun { report, inputs, skipped, .. } = made;
        let written = WrittenOutput { file: self.output.clone(), original: inputs.clone() };
        let progress = self.show.progress();
        let checked = self.verify.then(|| proof.prove(&written, progress.as_ref(), call.cancel));
        let checked = checked.transpose()?;
        let both = MadeMeshReport {
            made: report,
            checked: checked.as_ref(),
            skipped,
            shortfall: report.shortfall(),
        };
        if let Some(path) = &self.report {
            shared::report::write(path, is_replacing, &both)?;
        }
        both.print(&self.show, || report.summary(), summary)
    }
}

/// Fails for meshes that cannot be verified against their grid: solids, and meshes in another CRS.
fn refuse_proof(options: &TinOptions) -> Result<()> {
    if options.base.is_some() || !options.co.is_empty() {
        return Err(Error::usage("--verify is not supported for solids")
            .remedy("leave --verify out, or ‹base› and ‹co› SOLID_BASE"));
    }
    if options.reprojection.to_crs.is_some() {
        return Err(Error::usage("--verify requires the CRS of the grid")
            .remedy("leave --verify out, or ‹to_crs›"));
    }
    Ok(())
}
