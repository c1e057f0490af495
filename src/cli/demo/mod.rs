//! `terrane demo`: the main job from end to end on a synthetic terrain, as a test of the installation; or a
//! comparison of methods.

mod methods;

use std::path::{Path, PathBuf};

use crate::cli::shared::tabled::OperationOptionArgs;
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, output, report, text};
use crate::cli::{tin, verify};
use terrane_base::error::{Error, Result};
use terrane_engine::proof::{OutputProof, WrittenOutput};
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic;
use terrane_terrain::convert::{self, ConvertJob};
use terrane_terrain::tin::{TinGoal, TinJob, TinReport};
use terrane_verify::{MeshProof, VerifyReport};
use terrane_viewer::view::{PictureOptions, ViewJob};

/// Make a synthetic terrain, simplify it, verify the result and draw it
#[derive(Clone, Debug, clap::Args)]
pub(super) struct DemoArgs {
    /// Output folder; files of an earlier demo are replaced
    #[arg(long, value_name = "DIR", default_value = "terrane-demo")]
    dir: PathBuf,
    /// Compare six methods on a small terrain at the same maximum error instead, in one picture in the subfolder
    /// "methods"
    #[arg(long)]
    methods: bool,
    #[command(flatten)]
    resources: OperationOptionArgs<Resources>,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// The terrain, and the error bound in metres.
const TERRAIN: &str = "synth:rough,size=2049,seed=7";
const TOLERANCE: f64 = 5.0;

/// Files of the demo folder.
struct DemoFiles {
    grid: PathBuf,
    mesh: PathBuf,
    picture: PathBuf,
    report: PathBuf,
}

impl DemoFiles {
    fn within(folder: &Path) -> Self {
        Self {
            grid: folder.join("terrain.tif"),
            mesh: folder.join("terrain.ply"),
            picture: folder.join("preview.png"),
            report: folder.join("report.json"),
        }
    }
}

impl Verb for DemoArgs {
    const NAME: &'static str = "demo";

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        match self.methods {
            true => methods::run(self, call.cancel),
            false => run(self, call.cancel),
        }
    }
}

fn run(args: &DemoArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    atomic::create_folders(&args.dir)?;
    let files = DemoFiles::within(&args.dir);
    let resources = args.resources.0.clone();
    let progress = args.show.progress();
    let progress = progress.as_ref();
    convert::run(&terrain(TERRAIN, &files.grid, &resources), progress, cancel)?;
    let job = mesh(&files.grid, &files.mesh, &resources)?;
    let made = terrane_terrain::tin::run(&job, progress, cancel)?;
    let checked = prove(&job, &made, progress, cancel)?;
    terrane_viewer::view::run(&picture(&files.mesh, &files.picture, &resources), progress, cancel)?;
    let report =
        tin::MadeMeshReport { made: &made, checked: Some(&checked), skipped: &[], shortfall: None };
    report::write(&files.report, true, &report)?;
    if args.show.json {
        output::json(&report)?;
    } else if !args.show.quiet {
        output::result(&summary(&files, &made, &checked)?)?;
    }
    Ok(verify::outcome(&checked.verdict))
}

fn terrain(rule: &str, grid: &Path, resources: &Resources) -> ConvertJob {
    ConvertJob::new(rule, grid).with(|options| {
        options.file.replacing.overwrite = true;
        options.resources = resources.clone();
    })
}

/// Verifies the output of a job.
fn prove(
    job: &TinJob,
    made: &TinReport,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<VerifyReport> {
    let mut proof = MeshProof::default();
    proof.max_error = Some(made.tolerance);
    proof.grid = job.reading.clone();
    proof.resources = job.resources.clone();
    let written = WrittenOutput { file: job.output.clone(), original: job.input.clone() };
    proof.prove(&written, progress, cancel)
}

fn mesh(grid: &Path, mesh: &Path, resources: &Resources) -> Result<TinJob> {
    let job = TinJob::new(name_of(grid)?, mesh, TinGoal::MaxError(TOLERANCE));
    Ok(TinJob { overwrite: true, resources: resources.clone(), ..job })
}

fn picture(mesh: &Path, picture: &Path, resources: &Resources) -> ViewJob {
    let mut options = PictureOptions::default();
    options.edges = true;
    options.replacing.overwrite = true;
    options.resources = resources.clone();
    let input = mesh.to_string_lossy().into_owned().into();
    ViewJob { input, output: picture.to_owned(), options }
}

fn name_of(path: &Path) -> Result<String> {
    let name = path.to_str().map(str::to_owned);
    name.ok_or_else(|| {
        Error::usage("folder name is not UTF-8").in_file(path).remedy("choose another --dir")
    })
}

/// Name and size of a file.
fn size(path: &Path) -> Result<String> {
    let found = std::fs::metadata(path).map_err(|e| Error::read(path, e))?;
    Ok(format!("{}, {}", path.display(), text::bytes(found.len())))
}

fn summary(files: &DemoFiles, made: &TinReport, checked: &VerifyReport) -> Result<String> {
    let verdict = if checked.verdict.passed { "proved" } else { "NOT kept" };
    let unit = &made.vertical_unit;
    let rows = [
        ("terrain", size(&files.grid)?),
        ("mesh", size(&files.mesh)?),
        ("picture", size(&files.picture)?),
        ("report", size(&files.report)?),
        (
            "size",
            format!(
                "{} of {} samples kept ({}), {} triangles",
                text::count(made.vertices),
                text::count(made.valid_samples),
                text::percent(made.kept),
                text::count(made.triangles),
            ),
        ),
        (
            "accuracy",
            format!(
                "{verdict}: largest error {} {unit} ({} {unit} allowed), RMSE {} {unit}",
                text::height(checked.max_error),
                text::number(made.tolerance),
                text::height(checked.rmse),
            ),
        ),
        (
            "time",
            format!(
                "{}, {}",
                text::seconds(made.run.wall_seconds),
                text::rate(made.samples_per_second, "samples")
            ),
        ),
    ];
    Ok(text::table(&rows))
}
