//! Clouds in memory, their naive statistics, and what is in the files that grids are written to.
#![allow(dead_code, unreachable_pub)]

use std::collections::BTreeMap;
use std::path::Path;

use terrane::Result;
use terrane_base::geom::{Crs, Point, PointFrame};
use terrane_cloud::{
    AttributeSelection, BATCH, CloudInfo, PointBatch, PointConsumer, PointSource, ReturnCounts,
};
use terrane_engine::{Cancel, Silent};
use terrane_gridding::{Statistic, parse_list};
use terrane_lidar::grid::{GridJob, GridReport, grid};
use terrane_raster as raster;

/// Points in memory.
pub struct Memory {
    pub info: CloudInfo,
    pub parts: Vec<Vec<Point>>,
}

impl Memory {
    /// These points, in parts of `size`.
    pub fn new(frame: PointFrame, points: &[Point], size: usize) -> Self {
        let fold = |pick: fn(i32, i32) -> i32| {
            let join =
                |a: Point, b: &Point| Point::new(pick(a.x, b.x), pick(a.y, b.y), pick(a.z, b.z));
            points.iter().skip(1).fold(points[0], join)
        };
        let bounds = (!points.is_empty()).then(|| [fold(i32::min), fold(i32::max)]);
        let info = CloudInfo { frame, bounds, count: points.len() as u64, crs: Crs::default() };
        Self { info, parts: points.chunks(size).map(<[Point]>::to_vec).collect() }
    }
}

impl PointSource for Memory {
    fn info(&self) -> &CloudInfo {
        &self.info
    }

    fn parts(&self) -> usize {
        self.parts.len()
    }

    fn points_of(&self, part: usize) -> u64 {
        self.parts[part].len() as u64
    }

    fn read(
        &self,
        part: usize,
        _selection: &AttributeSelection,
        each: &mut PointConsumer<'_>,
    ) -> Result<ReturnCounts> {
        let count = self.points_of(part);
        let batches = self.parts[part].chunks(BATCH);
        batches
            .map(|positions| PointBatch { positions, ..PointBatch::default() })
            .try_for_each(each)?;
        Ok(ReturnCounts { read: count, kept: count, ..ReturnCounts::default() })
    }
}

/// A frame with steps of `scale` in all axes.
pub fn frame(scale: f64, offset: [f64; 3]) -> PointFrame {
    PointFrame { scale: [scale; 3], offset }
}

/// Numbers that look random.
pub struct Lots(pub u64);

impl Lots {
    pub fn below(&mut self, end: u32) -> i32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % u64::from(end)) as i32
    }
}

/// Points between -half and half, every third one on a multiple of `grid` in x and y.
pub fn points(count: usize, half: u32, grid: i32, seed: u64) -> Vec<Point> {
    let mut lots = Lots(seed);
    let each = |i: usize| {
        let [x, y] = [0; 2].map(|_| lots.below(2 * half) - half as i32);
        let z = lots.below(4000) - 1000;
        match i % 3 {
            0 => Point::new(x / grid * grid, y / grid * grid, z),
            _ => Point::new(x, y, z),
        }
    };
    (0..count).map(each).collect()
}

/// A job of these statistics in cells of `cell`.
pub fn job(output: &Path, stats: &str, cell: f64) -> GridJob {
    GridJob::new(["memory"], output, parse_list(stats).unwrap(), cell)
}

/// Runs it.
pub fn run(source: &Memory, job: &GridJob) -> GridReport {
    grid(source, job, &Silent, &Cancel::default()).unwrap()
}

/// A band as written: columns, values row by row, and the grid's corner (west, north).
pub struct Written {
    pub width: usize,
    pub values: Vec<f64>,
    pub corner: [f64; 2],
}

/// Reads band `band` (from 1).
pub fn read(path: &Path, band: u32) -> Written {
    let options = raster::GridOpenOptions { band, ..raster::GridOpenOptions::default() };
    let source = raster::open(path.to_str().unwrap(), &options).unwrap();
    let rect = source.info().bounds();
    let mut values = vec![0.0; rect.len()];
    source.read_f64(rect, &mut values).unwrap();
    let t = source.info().transform;
    let corner = [t.x0 - 0.5 * t.a, t.y0 - 0.5 * t.e];
    Written { width: rect.width as usize, values, corner }
}

/// The world heights of the points in each cell (column to the east, row to the north), by the rule
/// as the manual states it.
pub fn cells(frame: &PointFrame, points: &[Point], cell: f64) -> BTreeMap<[i64; 2], Vec<f64>> {
    let mut cells: BTreeMap<[i64; 2], Vec<f64>> = BTreeMap::new();
    for point in points {
        let [x, y, z] = frame.world(*point);
        let at = [x, y].map(|v| (v / cell + 1e-9).floor() as i64);
        cells.entry(at).or_default().push(z);
    }
    cells
}

/// A statistic of heights, told plainly; NaN where there is none.
pub fn plain(statistic: Statistic, heights: &[f64], area: f64) -> f64 {
    let n = heights.len() as f64;
    let mean = heights.iter().sum::<f64>() / n;
    let mut sorted = heights.to_vec();
    sorted.sort_by(f64::total_cmp);
    let lowest = sorted.first().copied().unwrap_or(f64::NAN);
    let highest = sorted.last().copied().unwrap_or(f64::NAN);
    match statistic.name() {
        "count" => n,
        "density" => n / area,
        "min" => lowest,
        "max" => highest,
        "range" => highest - lowest,
        "mean" => mean,
        "std" | "median" | "pN" if heights.is_empty() => f64::NAN,
        "std" => {
            let ddof = statistic.parameter("ddof").unwrap_or(0.0);
            let spread: f64 = heights.iter().map(|z| (z - mean).powi(2)).sum();
            (spread / (n - ddof)).sqrt()
        }
        "median" | "pN" => {
            let rank = statistic.rank().unwrap();
            let place = rank / 100.0 * (n - 1.0);
            let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            low + (high - low) * place.fract()
        }
        other => unreachable!("{other} is of a radius, or of all points"),
    }
}

/// True when both are void or apart by no more than `slack`.
pub fn near(a: f64, b: f64, slack: f64) -> bool {
    (a.is_nan() && b.is_nan()) || (a - b).abs() <= slack
}
