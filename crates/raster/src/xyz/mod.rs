//! Grids as text with one "x y z" point per line (.xyz, .csv, .txt), in row or column order; points without a
//! height may be missing. Two passes at opening determine the spacing and store the heights in a temporary
//! file.

mod points;

use std::path::Path;

use crate::format::{GridOpenOptions, RasterFormat, only_band};
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::prj;
use crate::spool::SampleSpool;
use crate::strided::{StridedGrid, StridedLayout};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;
use terrane_base::limits;
use terrane_files::RawFile;

use points::XyzPointReader;

/// The registry entry.
pub(super) const FORMAT: RasterFormat = RasterFormat {
    name: "XYZ",
    extensions: &["xyz", "csv", "txt"],
    about: "points of a regular grid, one per line; missing points are void; CRS from .prj",
    sniff: |_| false,
    open,
};

/// Maximum number of grid samples per point: sparser points are not a grid.
const MAX_SPARSE: u64 = 100;
/// Maximum offset of a point from its position, in cells.
const SLACK: f64 = 0.1;
/// Largest integer up to which all integers are exact in `f32`.
const EXACT_IN_F32: f64 = 16_777_216.0;

fn open(path: &Path, options: &GridOpenOptions) -> Result<Box<dyn GridSource>> {
    let grid = read(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(grid))
}

fn read(path: &Path, options: &GridOpenOptions) -> Result<StridedGrid> {
    only_band(options.band)?;
    let file = RawFile::open(path)?;
    let survey = XyzScan::of(&file)?;
    let grid = survey.grid(file.size())?;
    let spool = grid.spool(&file, SampleSpool::new(path, options.temp_dir.as_deref())?)?;
    let order = if grid.by_column { "by column" } else { "by row" };
    let info = GridInfo {
        transform: grid.transform(),
        georeferenced: true,
        crs: prj::sidecar_crs(path)?,
        nodata: options.nodata,
        details: vec![
            ("compression".to_owned(), "none (text)".to_owned()),
            ("order".to_owned(), order.to_owned()),
            ("points".to_owned(), survey.points.to_string()),
        ],
        ..GridInfo::plain(FORMAT.name, grid.x.count, grid.y.count, grid.sample_type)
    };
    let size = grid.sample_type.bytes();
    let layout = match grid.by_column {
        true => StridedLayout::columns(grid.y.count, size),
        false => StridedLayout::rows(grid.x.count, size),
    };
    StridedGrid::new(spool, info, layout)
}

/// Steps between neighbouring points along an axis. The mean of the smallest steps is a better estimate of
/// the spacing than a single one, since coordinates may be rounded.
#[derive(Clone, Copy, Default)]
struct AxisSteps {
    least: f64,
    sum: f64,
    count: u64,
}

impl AxisSteps {
    fn add(&mut self, step: f64) {
        let step = step.abs();
        if self.count == 0 || step < 0.67 * self.least {
            *self = Self { least: step, sum: step, count: 1 };
        } else if step < 1.5 * self.least {
            self.least = self.least.min(step);
            self.sum += step;
            self.count += 1;
        }
    }
}

/// Minimum and maximum.
#[derive(Clone, Copy)]
struct XyzRange {
    low: f64,
    high: f64,
}

impl XyzRange {
    const EMPTY: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    fn add(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }
}

/// Result of the first pass.
struct XyzScan {
    points: u64,
    by_column: bool,
    /// True if the first change of row is to the north.
    northward: bool,
    spans: [XyzRange; 2],
    steps: [AxisSteps; 2],
    whole: bool,
    heights: XyzRange,
}

impl XyzScan {
    fn of(file: &RawFile) -> Result<Self> {
        let mut points = XyzPointReader::new(file)?;
        let mut survey = Self {
            points: 0,
            by_column: false,
            northward: false,
            spans: [XyzRange::EMPTY; 2],
            steps: [AxisSteps::default(); 2],
            whole: true,
            heights: XyzRange::EMPTY,
        };
        let mut last = None;
        while let Some(point) = points.next()? {
            if let Some(last) = last {
                survey.step(last, point).map_err(|e| e.at(points.place()))?;
            }
            survey.points += 1;
            survey.spans[0].add(point[0]);
            survey.spans[1].add(point[1]);
            survey.whole &= !point[2].is_finite() || point[2].fract() == 0.0;
            if point[2].is_finite() {
                survey.heights.add(point[2]);
            }
            last = Some(point);
        }
        Ok(survey)
    }

    fn step(&mut self, last: [f64; 3], point: [f64; 3]) -> Result<()> {
        let step = [point[0] - last[0], point[1] - last[1]];
        if self.points == 1 {
            self.by_column = step[0] == 0.0 && step[1] != 0.0;
            if step[0] != 0.0 && step[1] != 0.0 {
                return Err(irregular("the first two points share neither x nor y"));
            }
        }
        let (inner, outer) = if self.by_column { (1, 0) } else { (0, 1) };
        if step[outer] == 0.0 {
            if step[inner] == 0.0 {
                return Err(Error::bad_input("duplicate of the previous point"));
            }
            self.steps[inner].add(step[inner]);
        } else {
            // Columns always give a grid from north to south; rows keep their order.
            if self.steps[outer].count == 0 {
                self.northward = !self.by_column && step[1] > 0.0;
            }
            self.steps[outer].add(step[outer]);
        }
        Ok(())
    }

    fn grid(&self, file_bytes: u64) -> Result<XyzGrid> {
        let x = XyzAxis::of("x", self.spans[0], self.steps[0])?;
        let y = XyzAxis::of("y", self.spans[1], self.steps[1])?;
        let samples = u64::from(x.count) * u64::from(y.count);
        if samples / MAX_SPARSE > self.points {
            return Err(irregular(format!(
                "{} points in {file_bytes} bytes are too sparse for a grid of {} x {} samples",
                self.points, x.count, y.count
            )));
        }
        // Without any height both are infinite.
        let heights = Some(self.heights).filter(|heights| heights.low <= heights.high);
        let largest = heights.map_or(0.0, |heights| heights.low.abs().max(heights.high.abs()));
        let most = if self.whole { EXACT_IN_F32 } else { f32::MAX.into() };
        let wide = largest > most;
        let sample_type = if wide { SampleType::F64 } else { SampleType::F32 };
        Ok(XyzGrid { x, y, by_column: self.by_column, northward: self.northward, sample_type })
    }
}

fn off_grid(name: &str, at: f64, axis: &XyzAxis) -> Error {
    irregular(format!("{name} {at} is off the grid of spacing {}", axis.step))
}

/// Error of points that do not form a grid.
fn irregular(message: impl Into<String>) -> Error {
    Error::unsupported(message).remedy("sort points of a regular grid row by row")
}

/// Positions along x or y.
#[derive(Clone, Copy)]
struct XyzAxis {
    low: f64,
    step: f64,
    count: u32,
}

impl XyzAxis {
    fn of(name: &str, span: XyzRange, steps: AxisSteps) -> Result<Self> {
        if steps.count == 0 {
            return Err(irregular(format!("spacing of {name} cannot be determined")));
        }
        let range = span.high - span.low;
        let cells = (range / (steps.sum / steps.count as f64)).round();
        if !(cells >= 1.0 && range.is_finite()) {
            return Err(irregular(format!("invalid spacing of {name}")));
        }
        limits::check(
            &format!("number of samples along {name}"),
            cells as u64,
            limits::MAX_SIDE - 1,
        )?;
        Ok(Self { low: span.low, step: range / cells, count: cells as u32 + 1 })
    }

    /// The index of `position`; `None` if it is off the grid.
    fn index(&self, position: f64) -> Option<u32> {
        let at = (position - self.low) / self.step;
        // At most half a cell below the lowest position, so truncation rounds.
        let index = (at + 0.5) as u32;
        ((at - f64::from(index)).abs() <= SLACK).then_some(index.min(self.count - 1))
    }
}

/// The grid of the points.
struct XyzGrid {
    x: XyzAxis,
    y: XyzAxis,
    by_column: bool,
    northward: bool,
    sample_type: SampleType,
}

impl XyzGrid {
    fn transform(&self) -> Affine {
        let high = self.y.low + f64::from(self.y.count - 1) * self.y.step;
        let (y0, e) = if self.northward { (self.y.low, self.y.step) } else { (high, -self.y.step) };
        Affine { x0: self.x.low, a: self.x.step, b: 0.0, y0, d: 0.0, e }
    }

    /// Column and row of a point.
    fn cell(&self, [x, y, _]: [f64; 3]) -> Result<(u32, u32)> {
        let col = self.x.index(x).ok_or_else(|| off_grid("x", x, &self.x))?;
        let up = self.y.index(y).ok_or_else(|| off_grid("y", y, &self.y))?;
        Ok((col, if self.northward { up } else { self.y.count - 1 - up }))
    }

    /// The second pass: lines of heights, void where points are missing.
    fn spool(&self, file: &RawFile, spool: SampleSpool) -> Result<RawFile> {
        let mut points = XyzPointReader::new(file)?;
        let (inner, outer) = if self.by_column {
            (self.y.count, self.x.count)
        } else {
            (self.x.count, self.y.count)
        };
        let mut lines = XyzLines {
            spool,
            line: Vec::new(),
            length: inner as usize,
            number: 0,
            kind: self.sample_type,
        };
        while let Some(point) = points.next()? {
            let placed = self.cell(point).and_then(|(col, row)| {
                let (at, line) = if self.by_column { (row, col) } else { (col, row) };
                lines.put(line, at as usize, point[2])
            });
            placed.map_err(|e| e.at(points.place()))?;
        }
        lines.finish(outer)
    }
}

/// Buffered lines of the grid.
struct XyzLines {
    spool: SampleSpool,
    /// Heights of the current line; empty before the first.
    line: Vec<Option<f64>>,
    length: usize,
    /// Number of the current line.
    number: u32,
    kind: SampleType,
}

impl XyzLines {
    fn put(&mut self, line: u32, at: usize, height: f64) -> Result<()> {
        if line < self.number {
            return Err(irregular("point returns to an earlier row or column"));
        }
        self.advance(line)?;
        self.line.resize(self.length, None);
        if self.line[at].replace(height).is_some() {
            return Err(Error::bad_input("duplicate point"));
        }
        Ok(())
    }

    /// Writes the lines before `line`.
    fn advance(&mut self, line: u32) -> Result<()> {
        while self.number < line {
            self.line.resize(self.length, None);
            let heights = self.line.iter().map(|height| height.unwrap_or(f64::NAN));
            let bytes: Vec<u8> = match self.kind {
                SampleType::F64 => heights.flat_map(f64::to_ne_bytes).collect(),
                _ => heights.flat_map(|height| (height as f32).to_ne_bytes()).collect(),
            };
            self.spool.write(&bytes)?;
            self.line.clear();
            self.number += 1;
        }
        Ok(())
    }

    fn finish(mut self, lines: u32) -> Result<RawFile> {
        self.advance(lines)?;
        self.spool.finish()
    }
}
