//! Color relief: byte bands derived from a grid, written like any other grid.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::convert::copy::{DerivedBands, run_of};
use crate::convert::job::{ConvertJob, ConvertReport, DerivedGridOptions};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FileName, GridInput};
use terrane_engine::{Cancel, Progress};
use terrane_files::{RawFile, lock};
use terrane_options::{OptionRule, Options};
use terrane_raster::{GridInfo, GridSource, Inputs, SampleType, write};
use terrane_window::relief::{ColorInterpolation, ColorTable, Colour, Palette};

/// Largest size of a colour table, in bytes.
const MAX_BYTES: u64 = 1 << 20;
/// Rows of a block of heights.
const ROWS: u32 = 64;
/// Columns and rows of a piece.
const PIECE: [u32; 2] = [512, 64];
/// Bytes a thread holds: the heights of a piece, and the colours and encoded bands of a block of usual size.
const WORKER_BYTES: u64 = (PIECE[0] * PIECE[1]) as u64 * 8 + (2 << 20);

/// Colour relief of a grid
///
/// Each line of the colour file is a height and a colour, as for gdaldem: 1200 255 128 0, optionally followed by an
/// opacity from 0 to 255, or 1200 orange. Heights may be percentages of the height range (25%); nv is the colour of
/// voids. Colours are interpolated between heights. A .tif is a GeoTIFF with red, green and blue bytes; a .png comes
/// with a .pgw and a .prj.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct ColorReliefOptions {
    /// Colour file
    #[option(value = "COLORS", with = FileName, role = Reads, positional)]
    pub colors: PathBuf,
    /// Use the colour of the nearest height, without interpolation
    #[option(alias = "nearest_color_entry")]
    pub nearest: bool,
    /// Colour only the heights in the file; all others are black, or transparent with ‹alpha›
    #[option(alias = "exact_color_entry")]
    pub exact: bool,
    /// Write opacity as a fourth band
    pub alpha: bool,
    /// Input and output.
    #[option(flatten)]
    pub common: DerivedGridOptions,
}

const RULES: &[OptionRule] = &[OptionRule::NotWith("nearest", &["exact"])];

impl ColorReliefOptions {
    /// Interpolation between two entries of the colour table.
    fn between(&self) -> ColorInterpolation {
        match (self.nearest, self.exact) {
            (true, _) => ColorInterpolation::Nearest,
            (_, true) => ColorInterpolation::Nothing,
            _ => ColorInterpolation::Mixed,
        }
    }

    /// The job that copies the colours.
    fn copy(&self, inputs: &Inputs, output: &Path) -> Result<ConvertJob> {
        let mut job = self.common.job(inputs, output);
        let file = &mut job.options.file;
        file.format = Some(write::of_colours(output, file.format.as_deref())?.name.to_owned());
        Ok(job)
    }
}

impl Operation for ColorReliefOptions {
    const NAME: &'static str = "color-relief";
    type Input = GridInput;
    const WRITES: Writes = Writes::Colours;
    type Report = ConvertReport;

    fn check(&self, output: &Path) -> Result<()> {
        let copy = self.copy(&Inputs::default(), output)?;
        copy.options.check(output)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<ConvertReport> {
        let copy = self.copy(request.inputs, request.output)?;
        run(self, &copy, request.progress, request.cancel)
    }
}

/// Writes the colours of heights on the lattice and in the CRS of the grid: red, green, blue and optionally
/// opacity, as bytes. Voids get the `nv` colour of the table, or transparent black. A table with percentages
/// reads the grid twice.
fn run(
    options: &ColorReliefOptions,
    copy: &ConvertJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ConvertReport> {
    let palette = read(&options.colors)?;
    let report = run_of(copy, WORKER_BYTES, progress, cancel, |inner| {
        let own = inner.info();
        let range = match palette.needs_range() {
            true => range(inner.as_ref(), progress, cancel)?,
            false => [0.0; 2],
        };
        let nodata = own.nodata.map(|value| value * own.scale + own.offset);
        let table = palette.table(range, nodata, options.between());
        let info = GridInfo {
            sample_type: SampleType::U8,
            nodata: None,
            scale: 1.0,
            offset: 0.0,
            crs: own.crs.without_heights(),
            ..own.clone()
        };
        let parts = if options.alpha { 4 } else { 3 };
        let painted =
            Arc::new(ColoredGrid { info, inner, table, parts, waiting: Mutex::default() });
        let bands = (0..parts).map(|part| -> Box<dyn GridSource> {
            Box::new(ReliefColorBand { painted: painted.clone(), part })
        });
        Ok(DerivedBands::of_colours(bands.collect(), Vec::new()))
    })?;
    // The range of the colour bytes is not that of the heights.
    Ok(ConvertReport { lowest: None, highest: None, valid_samples: report.samples, ..report })
}

/// Reads a colour table.
fn read(path: &Path) -> Result<Palette> {
    let file = RawFile::open(path).map_err(|e| e.remedy("check the name"))?;
    if file.size() > MAX_BYTES {
        return Err(
            Error::limit("size of the colour table in bytes", file.size(), MAX_BYTES).in_file(path)
        );
    }
    let text = file.read_vec(0, file.size())?;
    Palette::parse(&String::from_utf8_lossy(&text)).map_err(|fault| {
        let error = Error::bad_input(fault.message)
            .remedy("write a height and its colour on each line, such as: 1200 255 128 0");
        let error =
            if fault.line > 0 { error.at(format_args!("line {}", fault.line)) } else { error };
        error.in_file(path)
    })
}

/// The lowest and highest height of a grid; 0 where there is none.
pub(crate) fn range(
    grid: &dyn GridSource,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<[f64; 2]> {
    let all = grid.info().bounds();
    let mut heights = vec![0.0; PIECE[0] as usize * ROWS as usize];
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    progress.begin("look", all.len() as u64);
    for row in (0..all.height).step_by(ROWS as usize) {
        cancel.check()?;
        for col in (0..all.width).step_by(PIECE[0] as usize) {
            let piece = Rect::new(col, row, PIECE[0], ROWS).intersect(&all);
            let heights = &mut heights[..piece.len()];
            grid.read_f64(piece, heights)?;
            grid.copied(piece);
            range = heights.iter().fold(range, |[low, high], z| [low.min(*z), high.max(*z)]);
            progress.advance(piece.len() as u64);
        }
    }
    progress.end();
    Ok(if range[0] <= range[1] { range } else { [0.0; 2] })
}

/// A grid and its colours.
struct ColoredGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    table: ColorTable,
    /// Number of bands.
    parts: usize,
    /// Colours of rectangles whose bands are not all read yet.
    waiting: Mutex<HashMap<Rect, Vec<Colour>>>,
}

impl ColoredGrid {
    fn colours(&self, rect: Rect) -> Result<Vec<Colour>> {
        let mut heights = vec![0.0; PIECE[0] as usize * PIECE[1] as usize];
        let mut colours = vec![Colour::default(); rect.len()];
        for row in (rect.row..rect.end_row()).step_by(PIECE[1] as usize) {
            for col in (rect.col..rect.end_col()).step_by(PIECE[0] as usize) {
                let piece = Rect::new(col, row, PIECE[0], PIECE[1]).intersect(&rect);
                let heights = &mut heights[..piece.len()];
                self.inner.read_f64(piece, heights)?;
                for (down, heights) in heights.chunks(piece.width as usize).enumerate() {
                    let down = (piece.row - rect.row) as usize + down;
                    let first = down * rect.width as usize + (piece.col - rect.col) as usize;
                    self.table.paint(heights, &mut colours[first..]);
                }
            }
        }
        self.inner.copied(rect);
        Ok(colours)
    }
}

/// One band of the colours of a grid.
struct ReliefColorBand {
    painted: Arc<ColoredGrid>,
    part: usize,
}

impl ReliefColorBand {
    fn read<H: From<u8>>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let Self { painted, part } = self;
        let waiting = lock(&painted.waiting).remove(&rect);
        let colours = waiting.map_or_else(|| painted.colours(rect), Ok)?;
        out.iter_mut().zip(&colours).for_each(|(out, colour)| *out = colour[*part].into());
        if part + 1 < painted.parts {
            lock(&painted.waiting).insert(rect, colours);
        }
        Ok(())
    }
}

impl GridSource for ReliefColorBand {
    fn info(&self) -> &GridInfo {
        &self.painted.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.read(rect, out)
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.read(rect, out)
    }

    fn block_bytes(&self) -> u64 {
        self.painted.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.painted.inner.members()
    }

    /// All bands are read from the same heights, which the last one releases.
    fn release(&self, rect: Rect) {
        if self.part + 1 == self.painted.parts {
            self.painted.inner.release(rect);
        }
    }

    fn copied(&self, rect: Rect) {
        self.painted.inner.copied(rect);
    }
}
