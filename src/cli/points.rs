//! `terrane points`: clouds into files of points.

use std::path::{Path, PathBuf};

use crate::cli::shared::ground::GroundName;
use crate::cli::shared::many::Many;
use crate::cli::shared::points::{self, Points, parse_format};
use crate::cli::shared::system::{self, System};
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, parse, report, text};
use crate::cloud::{LasVersion, OpenOptions, PointFormat};
use crate::error::Result;
use crate::jobs::sift::Sifted;
use crate::jobs::translate::plan::{PointsWritten, run_in};
use crate::jobs::translate::{
    self, Above, Assign, BufferMark, Classify, HeightsAs, KEPT, Layers, Overlap, SORTS, Sort,
    Split, Squares, Thin, TranslateJob, TranslateReport,
};
use crate::jobs::{Cancel, Resources};
use terrane_ground::noise;

/// Write the points of clouds with all that is known of them: filtered, merged, thinned, in another format
///
/// Points marked as withheld are carried unless --drop-flag withheld says otherwise. Every attribute is carried: times, colours, waveforms, extra bytes, and the records of the header that are the
/// same in all files; what the output cannot hold is an error, or told in a note where the format asked for has no
/// field for it. Points stay in the order of the files' names and of the points in them unless --sort is given, so the
/// same files give the same bytes, whatever the order they are named in, threads and memory.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Point cloud: LAS, LAZ, COPC, or text after cloud:. Several files, a folder, a list or a pattern in quotes are
    /// one cloud. The last name is that of the file to write: .las, .laz, .copc.laz for an octree, or .csv, .txt, .xyz
    /// for text
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    input: Vec<String>,
    #[arg(skip)]
    output: PathBuf,
    #[command(flatten)]
    wanted: Wanted,
    /// Replace what exists
    #[arg(long)]
    overwrite: bool,
    /// Keep what is done in this folder, so that the same command goes on after it was killed; it can be removed when
    /// the squares are there
    #[arg(long, value_name = "FOLDER", requires = "tile", help_heading = "Resources")]
    workdir: Option<PathBuf>,
    #[command(flatten)]
    disk: args::Disk,
    #[command(flatten)]
    many: many::Many,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// Which points, written how: for a run of its own, and for a plan.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "wanted")]
pub(super) struct Wanted {
    /// Format of the points, 0 to 10 [default: the first that holds all fields of all files]
    #[arg(long, value_name = "N", value_parser = parse_format)]
    point_format: Option<PointFormat>,
    /// Version of LAS, 1.2 to 1.5 [default: the first that has points of the format]
    #[arg(long, value_name = "VERSION")]
    las_version: Option<LasVersion>,
    /// Only one of the points that have the same place and time: the first
    #[arg(long)]
    dedupe: bool,
    /// How high points are above the ground, exactly in the triangulation of its points: in the dimension
    /// HeightAboveGround of their extra bytes, or with =z as their z
    #[arg(long, value_name = "AS", num_args = 0..=1, require_equals = true, default_missing_value = "dimension", value_parser = ["dimension", "z"], help_heading = "Ground")]
    height_above_ground: Option<String>,
    /// Give points classes: noise[:METHOD] (7 for those that a method finds to be noise), ground (2 for those of
    /// classes 0 to 5 found to be ground, 1 for others that were; more classes take part with
    /// ground:reclassify=CLASS,...), or height:CLASS=FROM,... (those of no class, by their height above the
    /// ground); each may be given
    #[arg(long, value_name = "HOW", long_help = classify_help(), help_heading = "Ground")]
    classify: Vec<Classify>,
    /// Which points are ground: class (those of class 2), those that a method of terrane grid --ground finds among
    /// last returns, or auto: by class if there are any, else by the method adaptive [default: auto]
    #[arg(long, value_name = "HOW", value_parser = GroundName::parse, help_heading = "Ground")]
    ground: Option<GroundName>,
    /// Set an attribute to a number or a formula of attributes, x, y and z with + - * / and parentheses, such as
    /// intensity=intensity/256; names as of terrane grid --stat, those of extra bytes in double quotes where they have
    /// spaces. Fields of whole numbers take the nearest one, and what they cannot hold is an error. May be given several
    /// times
    #[arg(long, value_name = "NAME=FORMULA", help_heading = "Attributes")]
    attribute: Vec<Assign>,
    /// Where flight lines overlap only the points of one: in each square of this size those of the line (point source)
    /// with the least scan angle there, of two the one of the lower number; squares of twice the spacing of points,
    /// rounded up to 1, 2 or 5 times a power of ten, where no size is given
    #[arg(long, value_name = "CELL", num_args = 0..=1, require_equals = true, default_missing_value = AUTO, value_parser = parse_overlap, help_heading = "Fewer points")]
    drop_overlap: Option<Overlap>,
    /// Only one point of each square of this size, in units of x and y
    #[arg(long, value_name = "CELL[:WHICH]", long_help = thin_help(), help_heading = "Fewer points")]
    thin: Option<Thin>,
    /// Only points that are no nearer to each other than this, in space and the units of coordinates, and so many that
    /// each point left out is nearer than that to one of them (Poisson discs); chosen by a hash of places
    #[arg(long, value_name = "DISTANCE", value_parser = parse::positive, help_heading = "Fewer points")]
    thin_distance: Option<f64>,
    /// The order of points, instead of that of files and of points in them
    #[arg(long, value_name = "ORDER", long_help = sort_help())]
    sort: Option<Sort>,
    /// A folder instead of one file, of a file for each square of this size, named by its lowest corner
    #[arg(long, value_name = "SIDE", value_parser = parse::positive, group = "division", help_heading = "Folders")]
    tile: Option<f64>,
    /// A folder instead of one file, of a file for each value of this attribute, such as classification or
    /// point_source_id (flight lines), named by both
    #[arg(long, value_name = "ATTRIBUTE", group = "division", help_heading = "Folders")]
    split: Option<String>,
    /// Points around each square up to so far away, too, marked by --buffer-mark
    #[arg(long, value_name = "WIDTH", requires = "tile", value_parser = parse::positive, help_heading = "Folders")]
    buffer: Option<f64>,
    /// How points of buffers are marked: withheld or synthetic
    #[arg(long, value_name = "MARK", requires = "buffer", default_value_t, value_parser = parse_mark, help_heading = "Folders")]
    buffer_mark: BufferMark,
    /// What the files of a folder are: laz or las
    #[arg(long, value_name = "NAME", requires = "division", default_value = "laz", value_parser = ["laz", "las"], help_heading = "Folders")]
    tile_format: String,
    #[command(flatten)]
    points: Points,
    #[command(flatten)]
    system: System,
}

impl Verb for Args {
    const NAME: &'static str = "points";

    fn usage() -> Option<String> {
        Some("[OPTIONS] <INPUT>... <OUTPUT>".to_owned())
    }

    fn lists() -> Vec<String> {
        vec![lists::noises(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        Some((&mut self.input, &mut self.output))
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn parse_mark(text: &str) -> std::result::Result<BufferMark, String> {
    text.parse()
}

/// Stands for cells whose size follows from the spacing of points.
const AUTO: &str = "auto";

fn parse_overlap(text: &str) -> std::result::Result<Overlap, String> {
    match text {
        AUTO => Ok(Overlap::default()),
        _ => parse::positive(text).map(|cell| Overlap { cell: Some(cell) }),
    }
}

impl Wanted {
    /// How the clouds are opened.
    pub(super) fn open_options(&self, resources: &Resources) -> Result<OpenOptions> {
        self.points.open_options(resources)
    }

    /// The job that writes the points of `input`, opened so.
    pub(super) fn job(
        &self,
        input: Vec<String>,
        cloud: OpenOptions,
        output: &Path,
        resources: Resources,
    ) -> Result<TranslateJob> {
        Ok(TranslateJob {
            cloud,
            format: self.point_format,
            version: self.las_version,
            dedupe: self.dedupe,
            above: self.above(),
            assign: self.attribute.clone(),
            overlap: self.drop_overlap,
            thin: self.thin,
            distance: self.thin_distance,
            transform: self.system.transform()?,
            sort: self.sort,
            squares: self.squares(),
            split: self.split(),
            resources,
            ..TranslateJob::new(input, output)
        })
    }

    fn above(&self) -> Above {
        let heights = self.height_above_ground.as_deref().map(|name| match name {
            "z" => HeightsAs::Z,
            _ => HeightsAs::Dimension,
        });
        Above { from: GroundName::of(self.ground), heights, classify: self.classify.clone() }
    }

    fn split(&self) -> Option<Split> {
        let is_plain = self.is_plain();
        self.split.clone().map(|attribute| Split { attribute, is_plain })
    }

    fn is_plain(&self) -> bool {
        self.tile_format == "las"
    }

    /// The squares asked for, and whether their files are uncompressed.
    fn squares(&self) -> Option<(Squares, bool)> {
        let (buffer, mark) = (self.buffer.unwrap_or(0.0), self.buffer_mark);
        self.tile.map(|side| (Squares { side, buffer, mark }, self.is_plain()))
    }
}

fn classify_help() -> String {
    format!(
        "Give points classes, noise first, then one way after the other:\n\
         noise   7, or another class, to those that a method finds to be noise, which is no ground: \
         noise:METHOD:PARAMETER=VALUE,... [default: {}]\n\
         ground  2 to those found to be ground, and 1 to others of class 2, of classes 0 to 5 and those of \
         ground:reclassify=CLASS,...; others keep theirs\n\
         height  by the height above the ground, to those of no class (0 or 1): height:CLASS=FROM,... \
         [default: {}]",
        Classify::Noise(noise::Asked::BEST),
        Classify::Height(Layers::default())
    )
}

fn thin_help() -> String {
    let names: Vec<_> = KEPT.iter().map(|(name, about)| format!("{name:<8} {about}")).collect();
    format!(
        "Only one point of each square of this size, in units of x and y, whose corners are at its multiples; \
         which one is said after a colon:\n{}",
        names.join("\n")
    )
}

fn sort_help() -> String {
    let names: Vec<_> = SORTS.iter().map(|(name, about)| format!("{name:<8} {about}")).collect();
    format!(
        "The order of points, instead of that of files and of points in them, which those that are equal in it \
         keep:\n{}",
        names.join("\n")
    )
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    args.disk.check_workdir(args.workdir.as_deref())?;
    let resources = args.machine.resources();
    let cloud = args.wanted.open_options(&resources)?;
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Clouds(&cloud), &resources)?;
    check_files(args, &names)?;
    let cloud = args.many.reading(cloud);
    let job = args.wanted.job(names, cloud, &args.output, resources)?;
    let job = TranslateJob { overwrite: args.overwrite, ..job };
    let progress = args.show.progress();
    match &args.workdir {
        None => {
            let made = translate::run(&job, progress.as_ref(), cancel)?;
            let told = report::WithSkipped { report: &made, skipped: &skipped };
            args.show.tell(&told, || summary(&made))?;
        }
        Some(folder) => {
            let disk = args.disk.check();
            let made = run_in(folder, &job, &skipped, disk, progress.as_ref(), cancel)?;
            let told = report::WithSkipped { report: &made, skipped: &skipped };
            args.show.tell(&told, || written_squares(&made))?;
        }
    }
    Ok(Outcome::Kept)
}

/// Fails when the output is an input, or cannot be made.
fn check_files(args: &Args, names: &[String]) -> Result<()> {
    let output: Vec<&Path> =
        std::iter::once(&args.output).chain(&args.workdir).map(PathBuf::as_path).collect();
    let Wanted { points, system, tile, split, .. } = &args.wanted;
    check::not_among(&crate::cloud::files(names)?, &output)?;
    check::not_among(&points.files()?, &output)?;
    check::not_among(&system.files()?, &output)?;
    match tile.is_some() || split.is_some() {
        true => crate::atomic::refuse_stdout(&args.output),
        false => check::new_file(&args.output, args.overwrite),
    }
}

fn written(r: &TranslateReport) -> String {
    let points = format!("{} of point format {}", text::count(r.points), r.point_format);
    if r.files == 1 { points } else { format!("{points}, in {} files", text::count(r.files)) }
}

/// Squares that a plan wrote, for people.
pub(super) fn written_squares(r: &PointsWritten) -> String {
    let points = format!("{} of point format {}", text::count(r.points), r.point_format);
    let mut rows = vec![
        ("written", format!("{points}, in {} files", text::count(r.files))),
        ("system", r.crs.clone()),
        ("size", text::bytes(r.output_bytes)),
    ];
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}

fn summary(r: &TranslateReport) -> String {
    let mut rows = vec![
        ("points", points::census(&r.census)),
        ("written", written(r)),
        ("system", r.crs.clone()),
        ("size", text::bytes(r.output_bytes)),
    ];
    rows.extend(system::rows(r.transformed.as_ref()).filter(|(name, _)| *name == "operation"));
    let rate = text::rate(r.points_per_second, "points");
    rows.extend(report::took(&r.run, Some(rate), ""));
    rows.extend(report::notes(&r.notes));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}
