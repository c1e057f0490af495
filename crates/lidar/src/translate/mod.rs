//! Clouds into files of points: filtered, thinned and merged; one file, or one for each square or value.
//!
//! ```text
//! files, sorted ── parts ── records of one format ──[single]──[noise]──[what the ground tells]──[attributes set] ─┐
//!                                      file ──[sorted]──[moved]──[discs]──[thinned]──[one flight line each] ◀─────┘
//! ```
//!
//! Whatever else is asked for, points stay in the order of files and of points in them, so the bytes depend on neither
//! threads nor memory. What needs to know of other points looks at all first (`choice`, `discs`).

mod above;
mod assign;
mod carried;
mod discs;
mod moved;
mod noise;
mod octree;
mod options;
mod overlap;
pub mod plan;
mod portion;
mod prepared;
mod report;
mod shares;
mod sorted;
mod split;
mod squares;
mod thin;
mod wide;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::prelude::*;

use crate::records::choice::{Choice, Chosen, needed};
use crate::records::{Packer, Records};
pub use above::{Above, Classify, HeightsAs, Layers, Reclassify};
use above::{Looking, Told};
pub use assign::Assign;
use assign::{Assigned, Assigning};
use carried::CarriedRecords;
use moved::{Move, MovedRecords};
pub use options::{PointsOptions, PointsSetters, TileFormat};
use overlap::FlightLines;
pub use overlap::Overlap;
use portion::Portion;
use prepared::{Prepared, least, record_bytes, stored};
pub use report::TranslateReport;
use shares::Shares;
pub use sorted::Sort;
use sorted::Sorted;
pub use split::Split;
use split::Values;
pub use squares::{BufferMark, Squares};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Apart;
use terrane_cloud::write::{CloudWriter, Packing, WriteOptions};
use terrane_cloud::{
    Carrier, Cloud, CloudInfo, Filter, LasVersion, OpenOptions, PointFormat, PointSource,
};
use terrane_engine::input::workers;
use terrane_engine::memory::with_polygons;
use terrane_engine::plan::At;
use terrane_engine::transform::Transform;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::{AtomicFile, AtomicFolder, Sidecar, refuse_existing};
use terrane_files::{folder_for, path_of};
pub use thin::{KEPT, Keep, Thin};
use wide::Wide;

/// Clouds to be written as one.
#[derive(Clone, Debug)]
pub struct TranslateJob {
    /// File names, folders, patterns, lists.
    pub input: Vec<String>,
    /// How they are read, and which points; those marked as withheld are kept unless the filter drops that mark.
    pub cloud: OpenOptions,
    /// LAS, LAZ or COPC file to write, or a folder of the first two.
    pub output: PathBuf,
    /// Format of its points; the first that holds all fields of all files when `None`.
    pub format: Option<PointFormat>,
    /// Version of LAS; the first that has points of that format when `None`.
    pub version: Option<LasVersion>,
    /// Keep one point of those of one place and time.
    pub dedupe: bool,
    /// Heights above the ground, and classes.
    pub above: Above,
    /// Attributes that are set, one after the other.
    pub assign: Vec<Assign>,
    /// Keep the points of one flight line in each cell.
    pub overlap: Option<Overlap>,
    /// Keep one point of each cell.
    pub thin: Option<Thin>,
    /// Keep points that are no nearer to each other than this, in space and world units; as many as that allows.
    pub distance: Option<f64>,
    /// The system that they are to be in.
    pub transform: Option<Transform>,
    /// Their order; that of files and of points in them when `None`.
    pub sort: Option<Sort>,
    /// A folder of a file for each square, rather than one file; uncompressed ones, where so told.
    pub squares: Option<(Squares, bool)>,
    /// A folder of a file for each value of an attribute, rather than one file.
    pub split: Option<Split>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// What the job may use.
    pub resources: Resources,
}

impl TranslateJob {
    /// The job with everything else at its default.
    pub fn new(input: Vec<String>, output: impl Into<PathBuf>) -> Self {
        Self {
            input,
            cloud: OpenOptions::default(),
            output: output.into(),
            format: None,
            version: None,
            dedupe: false,
            above: Above::default(),
            assign: Vec::new(),
            overlap: None,
            thin: None,
            distance: None,
            transform: None,
            sort: None,
            squares: None,
            split: None,
            overwrite: false,
            resources: Resources::default(),
        }
    }
}

/// Lines that a thread makes at a time.
const LINES: usize = 4096;
/// Least memory for records that are put into columns or squares.
const SPREAD: u64 = 32 << 20;

/// Writes the points. Nothing appears under the output's name unless it succeeds.
///
/// # Errors
/// An output that exists, cannot be created, or is of no known ending; files that do not go into one; what the
/// format cannot hold of a point; too little memory.
pub fn run(
    job: &TranslateJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TranslateReport> {
    let (start, at) = (Instant::now(), At { progress, cancel });
    refuse_existing(&job.output, job.overwrite)?;
    job.packing()?;
    let cloud = job.open()?;
    if job.squares.is_some() || job.split.is_some() {
        squares::refuse_within(cloud.files(), &job.output)?;
    }
    let make = |resources| {
        let job = TranslateJob { resources, ..job.clone() };
        prepared(&job, &cloud, None, at, |prepared| prepared.report(start))
    };
    let mut report = with_polygons(&job.cloud, &job.resources, make)?;
    report.run.memory_budget = job.resources.memory;
    Ok(report)
}

/// Does something with all that a job on a cloud, or some squares of it, needs.
fn prepared<T: Send>(
    job: &TranslateJob,
    cloud: &Cloud,
    portion: Option<&Portion<'_>>,
    at: At<'_>,
    act: impl FnOnce(&Prepared<'_>) -> Result<T> + Send,
) -> Result<T> {
    let packing = job.packing()?;
    let carrier = prepared::carrier(job, cloud)?;
    let told = job.above.info(carrier.info());
    let columns = carrier.columns();
    let assigning = Assigning::new(&job.assign, (carrier.format(), &columns), &told.frame)?;
    let values = |split: &Split| Values::new(split, (carrier.format(), &columns));
    let values = job.split.as_ref().map(values).transpose()?;
    let source = CarriedRecords::within(cloud, &carrier, portion.map(Portion::window))
        .with(portion.and_then(Portion::noise).map(|noise| &noise.own));
    let needed = job.needed(packing, carrier.info(), (source.count(), portion.is_some()));
    let shares = Shares::new(&job.resources, (carrier.size(), carrier.extra_bytes()), needed)?;
    let threads = shares.threads;
    let moved = job.moved(&told)?;
    let info = moved.as_ref().map_or(&told, |moved| &moved.info);
    let file = carrier.file(info.frame, info.crs.clone());
    let options = WriteOptions { packing, overwrite: job.overwrite, ..file };
    let work = Work {
        job,
        input: cloud,
        cloud: cloud.info(),
        assigning: &assigning,
        values: values.as_ref(),
        told: &told,
        info,
        moved: moved.as_ref(),
        carrier: &carrier,
        options,
        shares,
        portion,
        at,
    };
    let resources = Resources { threads, ..job.resources.clone() };
    let prepared = Prepared { work, source: &source };
    workers(&resources)?.install(|| act(&prepared))
}

impl TranslateJob {
    /// The cloud, opened as it is to be read.
    fn open(&self) -> Result<Cloud> {
        terrane_cloud::open(&self.input, &self.reading())
    }

    /// How many times some points are chosen of all.
    fn choices(&self) -> u64 {
        let choices = [self.dedupe, self.thin.is_some(), self.overlap.is_some()];
        choices.map(u64::from).iter().sum()
    }

    /// How far from a point others may be that decide whether it is kept, or noise: of its cell, and of the cells of
    /// these.
    fn reach(&self, info: &CloudInfo) -> Result<f64> {
        let overlap = self.overlap.and_then(|overlap| overlap.cell).unwrap_or_default();
        let noise = self.above.noise().map_or(Ok(0.0), |asked| noise::reach(asked, info))?;
        Ok(self.thin.map_or(0.0, |thin| thin.cell) + overlap + noise)
    }

    /// Bytes of memory that it needs beside records on their way, so many of them read of such a cloud, which may be
    /// but a part; and more for each thread.
    fn needed(
        &self,
        packing: Packing,
        info: &CloudInfo,
        (points, is_part): (u64, bool),
    ) -> [u64; 2] {
        // However far around a part the ground is read.
        let is_wide = is_part && self.dedupe && self.above.is_asked();
        let wide = if is_wide { needed(info.count) } else { 0 };
        let choices = self.choices() * needed(points) + wide;
        let is_spread = packing == Packing::Nodes || self.squares.is_some() || self.split.is_some();
        let spread = if is_spread { SPREAD } else { 0 };
        let sort = self.sort.map_or(0, |_| sorted::LEAST);
        let [discs, each_disc] = self.distance.map_or([0; 2], |_| discs::needed(info.count));
        let [above, each] = self.above.needed(info);
        let noise = self.above.noise().map(|asked| noise::needed(asked, points));
        let [noise, each_part] = noise.unwrap_or_default();
        let each = each.max(each_disc).max(each_part);
        [choices + above + noise + discs + spread + sort, each]
    }

    /// Fails where something asked for cannot act on points of a format and packing, which lie so.
    fn check(&self, (format, packing): (PointFormat, Packing), info: &CloudInfo) -> Result<()> {
        self.above.check(format)?;
        self.above.noise().map_or(Ok(0.0), |asked| noise::reach(asked, info))?;
        if let Some(least) = self.distance {
            discs::check(least, info)?;
        }
        match self.sort {
            Some(_) if packing == Packing::Nodes => {
                Err(Error::usage("‹sort› cannot act: an octree has an order of its own")
                    .remedy("leave it out, or choose a name that ends in .laz only"))
            }
            Some(by) => sorted::check(by, format),
            None => Ok(()),
        }
    }

    /// How files are read: a mark is an attribute as others are, so points marked as withheld are points.
    fn reading(&self) -> OpenOptions {
        let filter = Filter { keep_withheld: true, ..self.cloud.filter.clone() };
        OpenOptions { filter, any_extent: self.is_copy(), ..self.cloud.clone() }
    }

    /// Whether nothing is computed of the places of several points.
    fn is_copy(&self) -> bool {
        let is_divided = self.squares.is_some() || self.overlap.is_some() || self.thin.is_some();
        let is_measured = self.distance.is_some() || self.transform.is_some();
        let is_looked_at = self.above.is_asked() || self.above.noise().is_some();
        !(is_divided || is_measured || is_looked_at)
    }

    /// Where points lie in the system asked for.
    fn moved(&self, info: &CloudInfo) -> Result<Option<Move>> {
        let Some(transform) = &self.transform else { return Ok(None) };
        let corners = info.bounds.map(|ends| ends.map(|point| info.frame.world(point)));
        let extent = corners.map(|[low, high]| [low[0], low[1], high[0], high[1]]);
        let name = self.input.first().map(|name| path_of(name).into_owned()).unwrap_or_default();
        let operation = transform.operation((&name, &info.crs), extent, &self.resources)?;
        if self.above.heights == Some(HeightsAs::Z) && !operation.keeps_heights() {
            return Err(Error::usage("heights above the ground do not change with the system")
                .remedy("leave ‹geoid› out, or put them into a dimension"));
        }
        Move::new(info, operation).map(Some)
    }
}

/// What was made.
#[derive(Default)]
struct Made {
    files: u64,
    points: u64,
    bytes: u64,
}

/// A job whose input is open.
struct Work<'a> {
    job: &'a TranslateJob,
    input: &'a Cloud,
    /// What is read, in the frame that methods work in.
    cloud: &'a CloudInfo,
    /// What is known before points are moved.
    told: &'a CloudInfo,
    assigning: &'a Assigning,
    /// What records are divided by.
    values: Option<&'a Values>,
    /// What is written.
    info: &'a CloudInfo,
    moved: Option<&'a Move>,
    carrier: &'a Carrier<'a>,
    options: WriteOptions,
    shares: Shares,
    /// The squares that are made, if not all.
    portion: Option<&'a Portion<'a>>,
    at: At<'a>,
}

impl Work<'_> {
    /// Writes what is chosen of all records, and says what was found.
    fn run(&self, source: &dyn Records, wide: Option<&Wide>) -> Result<(Made, Vec<String>)> {
        let (job, record) = (self.job, self.shares.flow.record);
        let single = self.single(source)?;
        let records = over(&single, source);
        let marked = self.mark(records)?;
        let records = over(&marked, records);
        let told = job.above.is_asked().then(|| self.tell(records, wide)).transpose()?;
        let records = over(&told, records);
        let (assigning, cloud) = (self.assigning, self.input);
        let assigned =
            (!job.assign.is_empty()).then_some(Assigned { records, assigning, record, cloud });
        let records = over(&assigned, records);
        let lines = job.overlap.map(|overlap| self.lines(records, overlap)).transpose()?;
        let records = over(&lines, records);
        let thinned = job.thin.map(|thin| self.thin(records, thin)).transpose()?;
        let records = over(&thinned, records);
        let apart = job.distance.map(|least| self.discs(least).choose(records)).transpose()?;
        let records = over(&apart, records);
        let moved = self.moved.map(|to| MovedRecords { records, to, record });
        let records = over(&moved, records);
        let sorted = job.sort.map(|by| self.sort(records, by)).transpose()?;
        let made = self.write(over(&sorted, records))?;
        let note = lines.iter().zip(job.overlap).map(|(lines, overlap)| {
            let (side, left_out) = (overlap.side(self.told), lines.left_out());
            format!("overlap: {left_out} points of other flight lines left out, in cells of {side}")
        });
        let noise = marked.iter().flat_map(|marked| &marked.notes);
        let ground = told.iter().flat_map(|told| &told.notes);
        let mut notes: Vec<_> = noise.chain(ground).cloned().chain(note).collect();
        // Both may say that the unit is a guess.
        notes.dedup();
        Ok((made, notes))
    }

    /// The records without those that are there twice, where these are not wanted.
    fn single<'r>(&self, records: &'r dyn Records) -> Result<Option<Chosen<'r>>> {
        let twice = thin::Twice::new(self.options.format);
        let choose = || self.choose(records, &twice, "points there twice");
        self.job.dedupe.then(choose).transpose()
    }

    /// The records with the class of noise for those that are, where it is looked for.
    fn mark<'r>(&self, records: &'r dyn Records) -> Result<Option<noise::Marked<'r>>> {
        let look = |asked| noise::Looking {
            asked,
            info: self.carrier.info(),
            format: self.carrier.format(),
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks,
            folder: self.folder(),
            keeps_withheld: self.job.cloud.filter.keep_withheld,
            at: self.at,
        };
        self.job.above.noise().map(|asked| look(asked).mark(records)).transpose()
    }

    fn lines<'r>(&self, records: &'r dyn Records, overlap: Overlap) -> Result<Chosen<'r>> {
        let (side, format) = (overlap.side(self.told), self.options.format);
        let lines = FlightLines::new(side, &self.told.frame, format)?;
        self.choose(records, &lines, "flight lines")
    }

    fn thin<'r>(&self, records: &'r dyn Records, thin: Thin) -> Result<Chosen<'r>> {
        self.choose(records, &thin::Cells::new(thin, &self.told.frame)?, "cells")
    }

    fn discs(&self, least: f64) -> discs::Discs<'_> {
        discs::Discs {
            apart: Apart::new(self.told.frame.scale, least),
            info: self.told,
            format: self.options.format,
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks,
            folder: self.folder(),
            at: self.at,
        }
    }

    fn sort(&self, records: &dyn Records, by: Sort) -> Result<Sorted> {
        let held = (self.shares.flow, self.shares.marks / 4, self.folder());
        Sorted::new(records, (by, self.options.format), held, self.at)
    }

    fn looking(&self) -> Looking<'_> {
        let square = self.job.above.square(self.cloud);
        Looking {
            above: &self.job.above,
            info: self.cloud,
            shift: self.carrier.shift(),
            format: self.carrier.format(),
            flow: self.shares.flow,
            threads: self.shares.threads,
            memory: self.shares.marks.saturating_sub(square),
            square,
            folder: self.folder(),
            keeps_withheld: self.job.cloud.filter.keep_withheld,
            portion: self.portion,
            at: self.at,
        }
    }

    fn choose<'r>(
        &self,
        records: &'r dyn Records,
        choice: &dyn Choice,
        stage: &str,
    ) -> Result<Chosen<'r>> {
        self.at.progress.begin(stage, total(records));
        let held = (self.shares.flow, self.shares.marks, self.folder());
        let chosen = Chosen::new(records, choice, held, self.at)?;
        self.at.progress.end();
        Ok(chosen)
    }

    /// Where what has to wait goes: beside the output, which a plan is far from.
    fn folder(&self) -> &Path {
        match (&self.job.resources.temp_dir, self.portion) {
            (None, Some(portion)) => portion.folder,
            (asked, _) => folder_for(&self.job.output, asked.as_deref()),
        }
    }

    fn write(&self, records: &dyn Records) -> Result<Made> {
        if let Some(values) = self.values {
            return self.split(values, records);
        }
        match (&self.job.squares, self.options.packing) {
            (Some((squares, _)), _) => self.divide(*squares, records),
            (None, Packing::Nodes) => self.octree(records),
            (None, Packing::Text) => self.text(records),
            (None, _) => self.file(records),
        }
    }

    fn file(&self, records: &dyn Records) -> Result<Made> {
        let mut writer = CloudWriter::create(&self.job.output, &self.options)?;
        self.at.progress.begin("points", total(records));
        let mut packer = Packer::new(&mut writer, self.shares.threads);
        self.shares.flow.run(records, self.at, &mut |bytes| packer.take(bytes))?;
        packer.finish()?;
        self.at.progress.end();
        finish(writer)
    }

    fn text(&self, records: &dyn Records) -> Result<Made> {
        let path = &self.job.output;
        let beside = path.with_extension("prj");
        let says_so = |found: &str| self.info.crs.is_said_by(found);
        let beside = Sidecar::new(
            beside,
            self.info.crs.to_wkt().map(|text| text + "\n"),
            says_so,
            self.job.overwrite,
        )?;
        let mut file = AtomicFile::create(path, self.job.overwrite)?;
        let lines = self.carrier.lines(&self.info.frame);
        let mut put =
            |text: &str| file.write_all(text.as_bytes()).map_err(|e| Error::write(path, e));
        put(&lines.heading())?;
        self.at.progress.begin("points", total(records));
        let (size, mut points) = (self.shares.flow.record, 0);
        self.shares.flow.run(records, self.at, &mut |bytes| {
            points += (bytes.len() / size) as u64;
            let parts: Vec<_> =
                bytes.par_chunks(LINES * size).map(|some| lines.lines(some)).collect();
            parts.iter().try_for_each(|text| put(text))
        })?;
        self.at.progress.end();
        let bytes = file.commit()?;
        beside.commit()?;
        Ok(Made { files: 1, points, bytes })
    }

    fn octree(&self, records: &dyn Records) -> Result<Made> {
        let place = &octree::Place::new(self.info);
        let options = WriteOptions { cube: Some(place.cube()), ..self.options.clone() };
        let mut writer = CloudWriter::create(&self.job.output, &options)?;
        let (layout, folder) = (writer.layout(), self.folder());
        let octree =
            octree::Octree { place, layout, folder, memory: self.shares.columns(), at: self.at };
        octree.write(records, self.shares.flow, &mut writer)?;
        finish(writer)
    }

    fn divide(&self, squares: Squares, records: &dyn Records) -> Result<Made> {
        if let Some(Portion { spans, folder, .. }) = self.portion {
            return self.files((squares, *spans), records, folder);
        }
        let folder = AtomicFolder::create(&self.job.output, self.job.overwrite, squares::is_ours)?;
        let spans = squares::spans(&squares, self.info)?;
        let made = self.files((squares, spans), records, folder.inside())?;
        folder.commit()?;
        Ok(made)
    }

    fn split(&self, values: &Values, records: &dyn Records) -> Result<Made> {
        let folder = AtomicFolder::create(&self.job.output, self.job.overwrite, |folder| {
            values.is_ours(folder)
        })?;
        let (flow, threads) = (self.shares.flow, self.shares.threads);
        let waiting = (self.folder(), self.shares.marks / 2);
        let into = (folder.inside(), &self.options);
        let made = values.write(records, (flow, threads), into, waiting, self.at)?;
        folder.commit()?;
        Ok(made)
    }

    /// Writes the files of some squares into a folder.
    fn files(
        &self,
        squares: (Squares, portion::Spans),
        records: &dyn Records,
        folder: &Path,
    ) -> Result<Made> {
        let waiting = (self.folder(), self.shares.marks / 2);
        let division = squares::Division::new(squares, self.info, waiting, &self.options);
        division.write(records, (self.shares.flow, self.shares.threads), folder, self.at)
    }
}

/// Records made of others, where there are any, or these.
fn over<'r>(made: &'r Option<impl Records>, others: &'r dyn Records) -> &'r dyn Records {
    made.as_ref().map_or(others, |made| made)
}

fn finish(writer: CloudWriter) -> Result<Made> {
    let points = writer.points();
    Ok(Made { files: 1, points, bytes: writer.finish()? })
}

fn total(records: &dyn Records) -> u64 {
    (0..records.units()).map(|unit| records.unit(unit).points).sum()
}
