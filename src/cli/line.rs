//! `terrane simplify`: simplification of lines and rings.

use std::path::{Path, PathBuf};

use terrane_options::{Options, check_given};

use crate::cli::operation::needed;
use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::tabled::OperationOptionArgs;
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, batch, check, lists, names, pipes, report, text};
use terrane_base::error::{Error, Result};
use terrane_base::frontend::Frontend;
use terrane_engine::Cancel;
use terrane_engine::operation::read_beside;
use terrane_engine::skip_bad::ReadableFiles;
use terrane_files::atomic;
use terrane_simplify::{DistanceKind, HierarchyReport, LineJob, LineOptions, LineReport};
use terrane_vector as vector;

#[derive(Clone, Debug, clap::Args)]
#[group(id = "line")]
pub(super) struct SimplifyArgs {
    /// Feature files: GeoJSON, Shapefile, FlatGeobuf, WKT, CSV, GPX, TopoJSON. The last name is the output file; for
    /// several inputs, a folder or a pattern it is an output folder, where files keep their names
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    /// Format of stdin (input -): GeoJSON, GeoJSONSeq, WKT or CSV [default: detected from the first bytes]
    #[arg(long, value_name = "NAME")]
    input_format: Option<String>,
    #[command(flatten)]
    pub(super) many: batch::InputSelection,
    #[command(flatten)]
    options: OperationOptionArgs<LineOptions>,
    /// Output file or folder, if it is not the last name
    #[arg(short = 'o', long = "output", value_name = "FILE", help_heading = "Output")]
    named: Option<PathBuf>,
    /// Write the report to a JSON file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    report: Option<PathBuf>,
    #[command(flatten)]
    show: args::ReportDisplay,
}

impl Verb for SimplifyArgs {
    const NAME: &'static str = "simplify";
    const ALIASES: &'static [&'static str] = &["line"];

    fn about() -> Option<String> {
        Some(Frontend::CommandLine.spell(LineOptions::TABLE.about).into_owned())
    }

    fn usage() -> Option<String> {
        Some(format!("[OPTIONS] {}<INPUT>... <OUTPUT>", needed(LineOptions::TABLE)))
    }

    fn lists() -> Vec<String> {
        vec![lists::simplifiers(), lists::features(), lists::EXIT_CODES.to_owned()]
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
        run(self, call.cancel)
    }
}

fn run(args: &SimplifyArgs, cancel: &Cancel) -> Result<VerbOutcome> {
    let options = &args.options.0;
    check_given(options, &args.options.1)?;
    let resources = &options.resources;
    let (mut input, mut output) = (args.input.clone(), args.output.clone());
    let holds = pipes::PipeContent::Features(args.input_format.as_deref());
    let mut stdin = pipes::StdinFile::expect(&mut input, holds, resources)?;
    if args.input_format.is_some() && !stdin.is_read() {
        return Err(Error::usage("‹input_format› requires stdin (-) as an input")
            .remedy("leave ‹input_format› out"));
    }
    // The names decide, not the number of existing or good files.
    let into_folder = input.len() > 1 || vector::is_collection(&input[0]);
    if into_folder {
        atomic::refuse_stdout(&output)?;
    }
    let stdout = pipes::StdoutFile::take(&mut output, options.file.format.as_deref(), resources)?;
    let open =
        vector::VectorOpenOptions { layer: options.features.layer.clone(), ..Default::default() };
    let features = batch::InputFileKind::Features(&open);
    input = args.many.find(&input, features)?;
    check_files(options, &input, &output, args.report.as_deref())?;
    match into_folder {
        true => check::folder(&output)?,
        false => check::new_file(&output, options.file.replacing.overwrite)?,
    }
    let job = LineJob { into_folder, ..options.job(&input, &output)? };
    job.check()?;
    stdin.gather(&mut input, cancel)?;
    let ReadableFiles { names, skipped } = args.many.check_files(input, features, resources)?;
    let job = LineJob { into_folder, ..options.job(&names, &output)? };
    check_report(&job, args.report.as_deref(), &[names, read_beside(options)?].concat())?;
    let report = terrane_simplify::run(&job, args.show.progress().as_ref(), cancel)?;
    stdout.as_ref().map_or(Ok(()), pipes::StdoutFile::pour)?;
    let with_skipped = report::WithSkipped { report: &report, skipped: &skipped };
    if let Some(path) = &args.report {
        report::write(path, options.file.replacing.overwrite, &with_skipped)?;
    }
    args.show.with_pipe(stdout.is_some()).print(&with_skipped, || summary(&report))?;
    Ok(VerbOutcome::Kept)
}

/// Fails for a missing input or an existing output.
fn check_files(
    options: &LineOptions,
    input: &[String],
    output: &Path,
    report: Option<&Path>,
) -> Result<()> {
    let auxiliary = read_beside(options)?;
    check::check_sidecars(&auxiliary)?;
    let outputs: Vec<&Path> = std::iter::once(output).chain(options.hierarchy.as_deref()).collect();
    check::not_among(&[input, &auxiliary].concat(), &outputs)?;
    if let Some(report) = report {
        check::new_file(report, options.file.replacing.overwrite)?;
        check::not_among(&auxiliary, &[report])?;
    }
    match options.hierarchy.as_deref().filter(|path| !path.exists()) {
        Some(hierarchy) => check::new_file(hierarchy, false),
        None => Ok(()),
    }
}

/// Fails if the report would replace an input or output of the job.
fn check_report(job: &LineJob, report: Option<&Path>, names: &[String]) -> Result<()> {
    let mut results = terrane_simplify::outputs(job)?;
    results.extend(job.hierarchy.clone());
    let results: Vec<&Path> = results.iter().map(PathBuf::as_path).collect();
    check::report(report, names, &results, job.overwrite)
}

/// Summary of a simplification.
fn summary(r: &LineReport) -> String {
    let share = text::percent(r.kept as f64 / r.vertices.max(1) as f64);
    let unit = match r.measure {
        DistanceKind::Geographic => " m",
        DistanceKind::Plane | DistanceKind::Space => "",
    };
    let (features, parts) = (text::count(r.features), text::count(r.parts));
    let largest = text::number(r.largest_distance);
    let mut rows = vec![
        ("read", format!("{features} features, {parts} lines and rings, {}", r.crs)),
        ("vertices", format!("{} of {} ({share})", text::count(r.kept), text::count(r.vertices))),
        ("method", format!("{}, threshold {}{unit}", r.method, text::number(r.threshold.value))),
        ("distance", format!("at most {largest}{unit} from the result")),
    ];
    if r.collapsed > 0 {
        rows.push(("collapsed", format!("{} rings", text::count(r.collapsed))));
    }
    if r.arcs > 0 {
        let [arcs, refined, found] = [r.arcs, r.refined, r.input_crossings].map(text::count);
        rows.push(("topology", format!("{arcs} arcs, {refined} pieces refined")));
        rows.push(("crossings", format!("{found} in the input")));
    }
    rows.extend(r.hierarchy.as_ref().map(|report| ("hierarchy", hierarchy(report))));
    rows.push(("files", format!("{}, {}", text::bytes(r.output_bytes), r.outputs.join(", "))));
    rows.extend(report::transformed(r.transformed.as_ref()));
    rows.extend(report::took(&r.run, None, ""));
    rows.extend(report::notes(&r.notes));
    format!("{}\n{}", r.inputs.join(", "), text::table(&rows))
}

/// Summary of a hierarchy file.
fn hierarchy(r: &HierarchyReport) -> String {
    let done = if r.made { "made" } else { "checked" };
    let [prepared, queried] = [r.prepare_seconds, r.query_seconds].map(text::seconds);
    format!("{}, {}, {done} in {prepared}, queried in {queried}", r.file, text::bytes(r.bytes))
}
