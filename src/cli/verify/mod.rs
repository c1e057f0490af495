//! `terrane verify`: verifies a mesh or terrain tiles against their grid or point cloud, and simplified lines
//! against their original.

pub(crate) mod cloud;
mod grid;
mod line;
mod tiles;
mod verdict;

pub(crate) use grid::summary;
pub(crate) use verdict::{outcome, print};

use std::path::{Path, PathBuf};

use terrane_options::{Choice, Options, check_given};

use crate::cli::operation::{OperationInput, take};
use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::union::{InputKindOptions, InputKinds, InputUnion};
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, batch, check, lists, names, pipes, report};
use terrane_base::error::{Error, Result};
use terrane_cloud::is_cloud;
use terrane_engine::Cancel;
use terrane_engine::input::is_mesh;
use terrane_engine::operation::{HasGroup, read_beside};
use terrane_engine::options::{CloudInput, GridInput};
use terrane_engine::proof::{OutputProof, WrittenOutput};
use terrane_engine::skip_bad::{ReadableFiles, Skipped};
use terrane_files::{name_of, path_of};
use terrane_tiles::TilesFormat;
use terrane_verify::tiles::{CloudTilesProof, TilesProof, is_tiles};
use terrane_verify::{CloudMeshProof, LineProof, MeshProof};

/// Verify meshes, terrain tiles or simplified lines against their original
///
/// Meshes and tiles are checked against their grid or point cloud, lines against the file they were made from: error
/// bound, coverage and topology; for lines also features, properties, heights and points; for tiles also borders, gaps
/// between levels and completeness. The exit code is 1 if a check fails, and 3 if a check cannot be decided (such as
/// the error of a mesh that states no bound). Vertices that are not samples or points of the original are a failure
/// only in meshes written by terrane.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct VerifyArgs {
    /// Mesh file, simplified lines, or a folder of terrain tiles (quantized-mesh with layer.json, 3D Tiles with
    /// tileset.json)
    mesh: PathBuf,
    /// Original grid file, or name of a synthetic terrain; several files, a folder, a list or a quoted pattern are one
    /// mosaic. Or the original point clouds, with the same point options. Or the original feature file
    #[arg(required = true, value_name = "ORIGINAL", value_parser = names::any())]
    source: Vec<String>,
    #[command(flatten)]
    options: InputUnion<Proofs>,
    #[command(flatten)]
    many: batch::InputSelection,
    /// Write the report to a JSON file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Overwrite an existing report
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// Kinds of verification.
#[derive(Clone, Debug)]
struct Proofs;

impl InputKinds for Proofs {
    const ALL: &'static [InputKindOptions] = &[
        InputKindOptions::of::<MeshProof>(MeshProof::OF),
        InputKindOptions::of::<CloudMeshProof>(CloudMeshProof::OF),
        InputKindOptions::of::<TilesProof>(TilesProof::OF),
        InputKindOptions::of::<CloudTilesProof>(CloudTilesProof::OF),
        InputKindOptions::of::<LineProof>(LineProof::OF),
    ];
}

impl Verb for VerifyArgs {
    const NAME: &'static str = "verify";

    fn lists() -> Vec<String> {
        vec![lists::meshes(), lists::grids(), lists::EXIT_CODES.to_owned()]
    }

    fn input_selection(&self) -> Option<&InputSelection> {
        Some(&self.many)
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        run(self, call.cancel)
    }
}

fn run(args: &VerifyArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let mesh = name_of(args.mesh.clone())?;
    check::written(&mesh)?;
    args.source.iter().try_for_each(|name| pipes::refuse_input(name))?;
    if is_tiles(&args.mesh) {
        return match args.many.are_clouds(&args.source)? {
            true => args.prove::<CloudTilesProof, CloudInput>(cancel, tiles::summary),
            false => args.prove::<TilesProof, GridInput>(cancel, tiles::summary),
        };
    }
    if let Some(set) = one_of_sets(&args.mesh) {
        return Err(Error::usage("holds tilesets of several formats")
            .in_file(&args.mesh)
            .remedy(format!("name one of them, such as {}", set.display())));
    }
    if !is_mesh(&mesh).unwrap_or(false) && batch::are_lines(&args.mesh) {
        return args.prove_lines(cancel);
    }
    if is_cloud(&mesh) {
        return Err(wrong_way_round("cloud", &mesh, &args.source[0]));
    }
    if args.many.are_clouds(&args.source)? {
        if !is_mesh(&mesh)? {
            return Err(no_mesh(&args.mesh));
        }
        return args.prove::<CloudMeshProof, CloudInput>(cancel, cloud::summary);
    }
    // A missing file among several may be skipped.
    let may_skip = args.many.skip_bad && args.source.len() > 1;
    for grid in &args.source {
        match check::input(grid) {
            Err(_) if may_skip => {}
            checked => checked.and_then(|()| check_kinds(&args.mesh, grid))?,
        }
    }
    args.prove::<MeshProof, GridInput>(cancel, grid::summary)
}

/// The first tileset in a folder that is not one itself.
fn one_of_sets(folder: &Path) -> Option<PathBuf> {
    let mut sets = TilesFormat::names().into_iter().map(|format| folder.join(format.name));
    sets.find(|set| set.is_dir() && is_tiles(set))
}

impl VerifyArgs {
    /// Options of a verification.
    fn of<P: OutputProof>(&self) -> Result<P> {
        let options = self.options.of(&name_of(self.mesh.clone())?)?;
        check_given(&options, self.options.given()).map(|()| options)
    }

    fn prove<P: OutputProof + HasGroup<I>, I: OperationInput>(
        &self,
        cancel: &Cancel,
        summary: fn(&P::Report) -> String,
    ) -> Result<VerbOutcome> {
        let mut options: P = self.of()?;
        let (given, many) = (self.options.given(), &self.many);
        let ReadableFiles { names, skipped } =
            take::<P, I>(&mut options, given, self.source.clone(), many)?;
        self.check_files(&options, I::files(&names)?)?;
        self.print(&options, names, &skipped, cancel, summary)
    }

    fn prove_lines(&self, cancel: &Cancel) -> Result<VerbOutcome> {
        let options: LineProof = self.of()?;
        if let Some(option) = self.many.given() {
            return Err(Error::usage(format!(
                "{option} is not supported for lines (they have one original)"
            ))
            .remedy(format!("leave {option} out")));
        }
        check::features(&self.source)?;
        self.check_files(&options, self.source.clone())?;
        self.print(&options, self.source.clone(), &[], cancel, line::summary)
    }

    /// Fails for a missing auxiliary file, or a report that is also an input.
    fn check_files(&self, options: &impl Options, originals: Vec<String>) -> Result<()> {
        let auxiliary = read_beside(options)?;
        check::check_sidecars(&auxiliary)?;
        let read = [originals, auxiliary, vec![name_of(self.mesh.clone())?]].concat();
        check::report(self.report.as_deref(), &read, &[], self.overwrite)
    }

    /// Verifies, and prints the report.
    fn print<P: OutputProof>(
        &self,
        options: &P,
        originals: Vec<String>,
        skipped: &[Skipped],
        cancel: &Cancel,
        summary: fn(&P::Report) -> String,
    ) -> Result<VerbOutcome> {
        let written = WrittenOutput { file: self.mesh.clone(), original: originals.into() };
        let report = options.prove(&written, self.show.progress().as_ref(), cancel)?;
        let proof = report::WithSkipped { report: &report, skipped };
        if let Some(path) = &self.report {
            report::write(path, self.overwrite, &proof)?;
        }
        let verdict = P::verdict(&report);
        if !self.show.print(&proof, || summary(&report))? {
            print(verdict);
        }
        Ok(outcome(verdict))
    }
}

/// Fails unless the inputs are a mesh and a grid, in this order.
fn check_kinds(mesh: &Path, raster: &str) -> Result<()> {
    let name = name_of(mesh.to_path_buf())?;
    match (is_mesh(&name)?, is_mesh(raster)?) {
        (true, false) => Ok(()),
        (false, true) => Err(wrong_way_round("grid", &name, raster)),
        (false, false) => Err(no_mesh(mesh)),
        (true, true) => Err(Error::bad_input("is a mesh, not a grid")
            .in_file(&path_of(raster))
            .remedy("name the grid that the mesh was made from")),
    }
}

fn no_mesh(path: &Path) -> Error {
    Error::bad_input("is a grid, not a mesh")
        .in_file(path)
        .remedy("name a mesh, such as one made by ‹terrane tin›")
}

/// Error of a mesh and its original in the wrong order.
fn wrong_way_round(what: &str, first: &str, second: &str) -> Error {
    Error::usage(format!("mesh and {what} are swapped"))
        .remedy(format!("write `terrane verify {second} {first}`"))
}
