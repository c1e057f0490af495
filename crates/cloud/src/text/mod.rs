//! Point clouds as text: a point per line, with x y z first or as the header says (.xyz, .csv, .txt).

mod line;

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, PointFrame, wkt};
use terrane_base::limits;
use terrane_files::{self, RawFile};

use line::{PointLineGrammar, TextPointValues, content};

use super::column::{PointColumn, TIME};
use super::format::PointFormat;
use super::frame::ClaimedExtent;
use super::quantization::{PointLattice, PositionSpan};
pub(super) use line::TextPoint;

/// Bytes of a part; lines belong to the part in which they begin.
const PART_BYTES: u64 = 1 << 20;
/// Maximum bytes of a line.
const MAX_LINE: u64 = 4096;
/// Maximum bytes of a header and comments before it.
const HEADING_BYTES: u64 = 1 << 16;
/// Seconds per week; larger times are not GPS week times.
const WEEK: f64 = 604_800.0;
/// Maximum points of a block.
const BLOCK: usize = 8192;

/// A text file with a point per line. Its lattice has the decimals found, at most
/// [`MAX_DECIMALS`](super::lattice::MAX_DECIMALS) and within the range of steps; excess decimals are rounded, with
/// a note.
pub(super) struct TextFile {
    pub(super) path: PathBuf,
    pub(super) crs: Crs,
    pub(super) lattice: PointFrame,
    pub(super) parts: Vec<PointTextPart>,
    pub(super) notes: Vec<String>,
    /// True for adjusted standard GPS times, where times exceed a week.
    pub(super) is_standard: bool,
    len: u64,
    lines: PointTextLayout,
    placed: PointLattice,
    claim: Option<ClaimedExtent>,
}

/// Lines that begin in a range of bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PointTextPart {
    pub(super) points: u64,
    /// Index of its first point.
    first: u64,
    at: u64,
}

/// Result of the first pass.
#[derive(Default)]
struct PointTextScan {
    /// Lines with content.
    points: u64,
    lines: u64,
    span: PositionSpan,
    /// Minimum and maximum time, if any.
    times: Option<[f64; 2]>,
    /// The first invalid line, from 0, and the reason.
    bad: Option<(u64, String)>,
}

/// Offset and syntax of the lines of points.
struct PointTextLayout {
    grammar: PointLineGrammar,
    /// Offset of the first byte after the header.
    at: u64,
    /// Number of lines before it.
    before: u64,
}

impl TextFile {
    /// Reads all lines once. With `salvage`, invalid lines are counted as lost.
    pub(super) fn open(path: &Path, salvage: bool) -> Result<Self> {
        Self::read(&RawFile::open(path)?, path, salvage).map_err(|e| e.in_file(path))
    }

    fn read(file: &RawFile, path: &Path, salvage: bool) -> Result<Self> {
        let lines = PointTextLayout::of(file)?;
        let starts: Vec<u64> = (lines.at..file.size()).step_by(PART_BYTES as usize).collect();
        let surveys: Vec<PointTextScan> =
            starts.par_iter().map(|at| lines.survey(file, *at, salvage)).collect::<Result<_>>()?;
        let mut number = lines.before;
        for survey in &surveys {
            if let Some((line, what)) = &survey.bad {
                return Err(Error::bad_input(what.clone())
                    .at(format_args!("line {}", number + line + 1))
                    .remedy("pass ‹salvage› to skip such lines"));
            }
            number += survey.lines;
        }
        let (mut first, mut parts) = (0, Vec::with_capacity(starts.len()));
        for (at, survey) in starts.iter().zip(&surveys) {
            parts.push(PointTextPart { points: survey.points, first, at: *at });
            first += survey.points;
        }
        let all_times = surveys.iter().filter_map(|survey| survey.times).reduce(wider);
        let all =
            surveys.into_iter().fold(PositionSpan::default(), |all, found| all.join(&found.span));
        let placed = PointLattice::of(&all)?;
        Ok(Self {
            path: path.to_path_buf(),
            crs: crs_beside(path)?,
            lattice: placed.lattice(),
            claim: placed.claim(&all),
            notes: placed.note.iter().cloned().chain(lines.grammar.notes()).collect(),
            is_standard: all_times.is_some_and(|[low, high]| low < 0.0 || high >= WEEK),
            parts,
            len: file.size(),
            lines,
            placed,
        })
    }

    /// The point format with all columns.
    pub(super) fn format(&self) -> PointFormat {
        self.lines.grammar.format()
    }

    /// Whether its points have GPS times.
    pub(super) fn has_time(&self) -> bool {
        self.columns().iter().any(|column| column.name() == TIME)
    }

    /// The fields with a column, except class and returns.
    pub(super) fn columns(&self) -> Vec<PointColumn> {
        self.lines.grammar.known()
    }

    /// Extent of the points; `None` without points.
    pub(super) fn claim(&self) -> Option<ClaimedExtent> {
        self.claim
    }

    fn line(&self, values: &TextPointValues) -> TextPoint {
        let TextPointValues { world, class, returns, fields, .. } = *values;
        TextPoint { xyz: self.placed.quantize(world), class, returns, fields }
    }

    /// Passes on the points of a part; returns the number of invalid lines.
    ///
    /// # Errors
    /// Invalid lines, unless they are skipped, and errors of `each`.
    pub(super) fn records(
        &self,
        part: usize,
        salvage: bool,
        each: &mut dyn FnMut(u64, &[TextPoint]) -> Result<()>,
    ) -> Result<u64> {
        let PointTextPart { at, first, .. } = self.parts[part];
        let file = RawFile::open(&self.path)?;
        if file.size() != self.len {
            return Err(Error::bad_input("changed while it was read")
                .in_file(&self.path)
                .remedy("run again when no other program writes to it"));
        }
        let (mut block, mut next, mut lost) = (Vec::with_capacity(BLOCK), first, 0);
        self.lines.each(&file, at, |text| {
            match self.lines.grammar.values(text) {
                Ok(values) => block.push(self.line(&values)),
                Err(_) if salvage => lost += 1,
                Err(what) => return Err(Error::bad_input(what).in_file(&self.path)),
            }
            if block.len() < BLOCK {
                return Ok(());
            }
            each(next, &block)?;
            next += block.len() as u64;
            block.clear();
            Ok(())
        })?;
        each(next, &block)?;
        Ok(lost)
    }
}

impl PointTextLayout {
    fn of(file: &RawFile) -> Result<Self> {
        let head = file.head(limits::MAX_HEADER_BYTES.min(HEADING_BYTES))?;
        let (mut at, mut before) = (0, 0);
        for line in head.split_inclusive(|c| *c == b'\n') {
            if let Some(text) = content(line) {
                let place = format!("line {}", before + 1);
                let grammar =
                    PointLineGrammar::of(text).map_err(|what| not_points(what).at(place))?;
                if grammar.has_heading {
                    (at, before) = (at + line.len() as u64, before + 1);
                }
                return Ok(Self { grammar, at, before });
            }
            (at, before) = (at + line.len() as u64, before + 1);
        }
        Err(not_points(format!("no point within the first {} bytes", head.len())))
    }

    /// Calls `work` with the content of each line that begins in a part; returns the number of lines.
    fn each(
        &self,
        file: &RawFile,
        at: u64,
        mut work: impl FnMut(&[u8]) -> Result<()>,
    ) -> Result<u64> {
        // A line begins after the end of another.
        let from = if at == self.at { at } else { at - 1 };
        let bytes =
            file.read_vec(from, (at - from + PART_BYTES + MAX_LINE).min(file.size() - from))?;
        let (mut rest, mut place) = (&bytes[..], from);
        let mut lines = 0;
        if from < at {
            let skipped = rest.iter().position(|c| *c == b'\n').map_or(rest.len(), |end| end + 1);
            (rest, place) = (&rest[skipped..], place + skipped as u64);
        }
        while place < at + PART_BYTES && !rest.is_empty() {
            let end = rest.iter().position(|c| *c == b'\n').map_or(rest.len(), |end| end + 1);
            if end as u64 >= MAX_LINE {
                return Err(not_points(format!("a line is longer than {MAX_LINE} bytes"))
                    .at(format_args!("byte {place}")));
            }
            if let Some(text) = content(&rest[..end]) {
                work(text)?;
            }
            (rest, place, lines) = (&rest[end..], place + end as u64, lines + 1);
        }
        Ok(lines)
    }

    /// Surveys the lines of a part, up to the first invalid one.
    fn survey(&self, file: &RawFile, at: u64, salvage: bool) -> Result<PointTextScan> {
        let (mut survey, mut line) = (PointTextScan::default(), 0);
        survey.lines = self.each(file, at, |text| {
            match self.grammar.values(text) {
                Ok(values) => {
                    survey.span.add(values.world, values.decimals);
                    let time = self.grammar.time(&values).map(|time| [time; 2]);
                    survey.times = survey.times.into_iter().chain(time).reduce(wider);
                }
                Err(_) if salvage => {}
                Err(what) => survey.bad = survey.bad.take().or(Some((line, what))),
            }
            survey.points += 1;
            line += 1;
            Ok(())
        })?;
        Ok(survey)
    }
}

/// The union of two ranges.
fn wider([low, high]: [f64; 2], [from, to]: [f64; 2]) -> [f64; 2] {
    [low.min(from), high.max(to)]
}

fn not_points(what: String) -> Error {
    Error::bad_input(format!("is not a point cloud: {what}"))
        .remedy("use a .las or .laz file, or text with x y z on each line")
}

/// The CRS of a `.prj` file beside the points.
fn crs_beside(path: &Path) -> Result<Crs> {
    Ok(wkt::of_srs(&terrane_files::prj(path)?))
}
