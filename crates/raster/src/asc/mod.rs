//! ESRI ASCII grids. One streaming pass at opening checks every value and records the offset of each block of
//! rows; windows are read by parsing the blocks they overlap. Rows need not be lines.

mod header;
mod tokens;

use std::path::Path;

use crate::cache::{DecodeBytes, SharedBlocks, too_large_for_cache};
use crate::format::{GridOpenOptions, RasterFormat, only_band};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::prj;
use crate::sample::{HeightSample, ToHeight};
use crate::window::SampleWindow;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_base::limits;
use terrane_files::{RawFile, RowRun};

use header::AscHeader;
use tokens::AscTokens;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "ESRI ASCII",
    extensions: &["asc"],
    about: "text grids with an ncols/nrows header; CRS from .prj",
    sniff: header::is_header,
    open,
};

/// Approximate number of samples of a block; at least one row.
const BLOCK_SAMPLES: u64 = 1 << 16;

fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let grid = AscGrid::open(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(grid))
}

/// An open text grid.
struct AscGrid {
    file: RawFile,
    info: GridInfo,
    /// Offset of the first value of each block.
    starts: Vec<u64>,
    to_height: ToHeight,
    cache: SharedBlocks,
}

impl AscGrid {
    fn open(path: &Path, options: &GridOpenOptions) -> Result<Self> {
        only_band(options.band)?;
        let file = RawFile::open(path)?;
        let header = header::read(&mut AscTokens::new(&file, 0, 1))?;
        check_length(&header, &file)?;
        let rows = (BLOCK_SAMPLES / u64::from(header.width)).clamp(1, u64::from(header.height));
        let block_bytes = u64::from(header.width) * rows * SampleType::F32.bytes() as u64;
        limits::check("row size in bytes", block_bytes, limits::MAX_BLOCK_BYTES)?;
        let scan = AscScan::run(&file, &header, rows)?;
        let samples = u64::from(header.width) * rows;
        let cache = options.blocks();
        check_cache(samples * scan.sample_type.bytes() as u64, cache.max_bytes())?;
        let info = describe(path, &header, &scan, rows as u32, options)?;
        Ok(Self { to_height: ToHeight::of(&info), starts: scan.starts, file, info, cache })
    }

    fn read<H: HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window =
            SampleWindow::new(&self.info, rect, out).map_err(|e| e.in_file(self.file.path()))?;
        if rect.is_empty() {
            return Ok(());
        }
        let rows = self.info.block.1;
        let blocks = rect.row / rows..rect.end_row().div_ceil(rows);
        let mut busy = Vec::new();
        for block in blocks {
            if !self.read_block(block, rect, false, &mut window)? {
                busy.push(block);
            }
        }
        // Blocks that other threads are parsing come last, so that threads do not wait for each other by turns.
        for block in busy {
            self.read_block(block, rect, true, &mut window)?;
        }
        Ok(())
    }

    /// Reads the samples of `rect` in a block; false if another thread is parsing it. With `wait`, waits for it.
    fn read_block<H: HeightSample>(
        &self,
        block: u32,
        rect: Rect,
        wait: bool,
        window: &mut SampleWindow<'_, H>,
    ) -> Result<bool> {
        let (all, size) = (self.block_rect(block), self.info.sample_type.bytes());
        let bytes = DecodeBytes { block: all.len() * size, beside: 0 };
        let samples = self.cache.get(block.into(), bytes, wait, |out| self.parse(block, out))?;
        let Some(samples) = samples else { return Ok(false) };
        let part = all.intersect(&rect);
        let pitch = all.width as usize * size;
        let first = (part.row - all.row) as usize * pitch + part.col as usize * size;
        let run = RowRun {
            offset: first as u64,
            pitch: pitch as u64,
            bytes: part.width as usize * size,
            rows: part.height as usize,
        };
        samples.each_row(run, |row, bytes| {
            self.to_height.convert(bytes, window.row(part, row as u32));
        })?;
        Ok(true)
    }

    fn block_rect(&self, block: u32) -> Rect {
        let row = block * self.info.block.1;
        let height = self.info.block.1.min(self.info.height - row);
        Rect::new(0, row, self.info.width, height)
    }

    /// Parses block `block` into stored samples.
    fn parse(&self, block: u32, out: &mut [u8]) -> Result<()> {
        let rect = self.block_rect(block);
        let mut tokens = AscTokens::new(&self.file, self.starts[block as usize], 1);
        // The opening pass has checked that integers fit.
        let found = match self.info.sample_type {
            SampleType::I16 => fill(&mut tokens, out, |value| (value as i16).to_ne_bytes()),
            SampleType::I32 => fill(&mut tokens, out, |value| (value as i32).to_ne_bytes()),
            SampleType::F64 => fill(&mut tokens, out, f64::to_ne_bytes),
            _ => fill(&mut tokens, out, |value| (value as f32).to_ne_bytes()),
        };
        match found {
            Ok(true) => Ok(()),
            Err(error) if error.kind() != ErrorKind::BadInput => Err(error),
            _ => Err(self.changed(rect)),
        }
    }

    /// Error of a value that the opening pass accepted: the file has changed.
    fn changed(&self, rect: Rect) -> Error {
        let error = Error::bad_input("file changed while it was open");
        error.at(format_args!("rows from {}", rect.row)).in_file(self.file.path())
    }
}

impl GridSource for AscGrid {
    reads_alike!();

    fn block_bytes(&self) -> u64 {
        self.block_rect(0).len() as u64 * self.info.sample_type.bytes() as u64
    }

    fn release(&self, rect: Rect) {
        let rect = rect.intersect(&self.info.bounds());
        let rows = self.info.block.1;
        for block in rect.row / rows..rect.end_row().div_ceil(rows) {
            let all = self.block_rect(block);
            let released = all.intersect(&rect).len() as u64;
            self.cache.release(block.into(), released, all.len() as u64);
        }
    }
}

/// Fills `out` with samples made by `stored` from the next words; false if there are too few.
fn fill<const N: usize>(
    tokens: &mut AscTokens<'_>,
    out: &mut [u8],
    stored: impl Fn(f64) -> [u8; N],
) -> Result<bool> {
    let samples = out.as_chunks_mut().0;
    let count = samples.len() as u64;
    let mut samples = samples.iter_mut();
    let found = tokens.values(count, |value| {
        if let Some(sample) = samples.next() {
            *sample = stored(value);
        }
    })?;
    Ok(found == count)
}

/// Each value takes at least two bytes, so a file can be too short for its header.
fn check_length(header: &AscHeader, file: &RawFile) -> Result<()> {
    let values = u64::from(header.width) * u64::from(header.height);
    let room = (file.size() - header.data.0).div_ceil(2);
    if values <= room {
        return Ok(());
    }
    Err(Error::bad_input(format!(
        "file is truncated: {values} values declared, at most {room} fit"
    )))
}

fn check_cache(block_bytes: u64, cache_bytes: usize) -> Result<()> {
    if block_bytes <= cache_bytes as u64 {
        return Ok(());
    }
    let message =
        format!("row of {block_bytes} bytes exceeds the block cache of {cache_bytes} bytes");
    Err(too_large_for_cache(message, block_bytes))
}

/// Result of the opening pass.
struct AscScan {
    starts: Vec<u64>,
    sample_type: SampleType,
}

/// Range of the values, and whether they are integers.
struct AscValueRange {
    whole: bool,
    low: f64,
    high: f64,
}

impl AscValueRange {
    fn add(&mut self, value: f64) {
        // Integers beyond 32 bits are read like decimals.
        self.whole &= f64::from(value as i32) == value;
        if value.is_finite() {
            self.low = self.low.min(value);
            self.high = self.high.max(value);
        }
    }

    /// The narrowest type that holds all values; decimals are read as `float32`, as in GDAL, unless out of
    /// range.
    fn sample_type(&self) -> SampleType {
        match self.whole {
            false if self.is_within(f32::MIN.into(), f32::MAX.into()) => SampleType::F32,
            false => SampleType::F64,
            true if self.is_within(i16::MIN.into(), i16::MAX.into()) => SampleType::I16,
            true => SampleType::I32,
        }
    }

    fn is_within(&self, low: f64, high: f64) -> bool {
        low <= self.low && self.high <= high
    }
}

impl AscScan {
    /// Parses every value once, and records the offset of each block of `rows` rows.
    fn run(file: &RawFile, header: &AscHeader, rows: u64) -> Result<Self> {
        let values = u64::from(header.width) * u64::from(header.height);
        let mut tokens = AscTokens::new(file, header.data.0, header.data.1);
        let mut range = AscValueRange { whole: true, low: 0.0, high: 0.0 };
        let mut lines = AscLineCheck::default();
        let mut starts = Vec::new();
        for first in (0..values).step_by((u64::from(header.width) * rows) as usize) {
            starts.push(tokens.offset());
            let count = (values - first).min(u64::from(header.width) * rows);
            for row in (first..first + count).step_by(header.width as usize) {
                let found = lines.row(&mut tokens, header.width, |value| range.add(value))?;
                if found < u64::from(header.width) {
                    return Err(truncated(row + found, values).at(tokens.place()));
                }
            }
        }
        if tokens.next()?.is_some() {
            let message = format!("more values than the {values} declared");
            return Err(Error::bad_input(message).at(tokens.place()));
        }
        Ok(Self { starts, sample_type: range.sample_type() })
    }
}

/// Whether rows are lines. They need not be, but if the first row is a line, an extra or missing value in
/// another line would shift all that follow.
#[derive(Default)]
struct AscLineCheck {
    rows: u64,
    are_rows: bool,
    /// Number of line ends before the last value.
    end: u64,
}

impl AscLineCheck {
    /// Passes a row of values to `each`; returns the number of values if the file ends before.
    fn row(
        &mut self,
        tokens: &mut AscTokens<'_>,
        width: u32,
        mut each: impl FnMut(f64),
    ) -> Result<u64> {
        let first = tokens.values(1, &mut each)?;
        let (start, at) = (tokens.breaks(), tokens.offset());
        let found = first + tokens.values(u64::from(width) - first, &mut each)?;
        let (goes_on, is_line) = (start == self.end, tokens.breaks() == start);
        self.end = tokens.breaks();
        self.rows += 1;
        match self.rows {
            1 => self.are_rows = is_line,
            2 if goes_on => self.are_rows = false,
            _ if self.are_rows && found == u64::from(width) && (goes_on || !is_line) => {
                let how = if goes_on { "more" } else { "fewer" };
                return Err(uneven(width, how).at(format_args!("line {}", tokens.line_of(at))));
            }
            _ => {}
        }
        Ok(found)
    }
}

fn uneven(width: u32, how: &str) -> Error {
    Error::bad_input(format!("line has {how} values than the first line ({width})"))
        .remedy("correct the line")
}

fn truncated(i: u64, values: u64) -> Error {
    Error::bad_input(format!("file is truncated: found {i} of {values} values"))
}

fn describe(
    path: &Path,
    header: &AscHeader,
    scan: &AscScan,
    rows: u32,
    options: &GridOpenOptions,
) -> Result<GridInfo> {
    let registration = if header.is_centre { "centre" } else { "corner" };
    Ok(GridInfo {
        width: header.width,
        height: header.height,
        transform: header.transform,
        georeferenced: true,
        pixel_is_point: header.is_centre,
        crs: prj::sidecar_crs(path)?,
        sample_type: scan.sample_type,
        nodata: options.nodata.or(header.nodata),
        scale: 1.0,
        offset: 0.0,
        block: (header.width, rows),
        bands: 1,
        band: 1,
        format: FORMAT.name,
        details: vec![
            ("compression".to_owned(), "none (text)".to_owned()),
            ("lower left".to_owned(), registration.to_owned()),
        ],
    })
}
