//! Grids in memory, jobs on them, and what was written read back.
#![allow(dead_code, unreachable_pub)]

use std::cmp::Ordering;
use std::path::Path;

use terrane::Result;
use terrane_base::geom::plane::orient;
use terrane_base::geom::{Affine, Rect};
use terrane_engine::{Cancel, Resources, Silent};
use terrane_raster::{GridInfo, GridSource, SampleType};
use terrane_simplify::Length;
use terrane_terrain::contour::{ContourJob, ContourOptions, ContourReport, run, trace};
use terrane_vector::{self as vector, PropertyValue};

/// A grid in memory.
#[derive(Clone, Debug)]
pub struct Grid {
    pub info: GridInfo,
    pub heights: Vec<f64>,
}

impl Grid {
    pub fn new(width: u32, height: u32, transform: Affine, heights: Vec<f64>) -> Self {
        let info = GridInfo {
            transform,
            georeferenced: true,
            ..GridInfo::plain("memory", width, height, SampleType::F64)
        };
        Self { info, heights }
    }

    pub fn at(&self, col: u32, row: u32) -> f64 {
        self.heights[(row * self.info.width + col) as usize]
    }

    fn rows(&self, rect: Rect) -> impl Iterator<Item = f64> + '_ {
        let cols = move |row| (rect.col..rect.end_col()).map(move |col| self.at(col, row));
        (rect.row..rect.end_row()).flat_map(cols)
    }
}

impl GridSource for Grid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        out.iter_mut().zip(self.rows(rect)).for_each(|(out, z)| *out = z as f32);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        out.iter_mut().zip(self.rows(rect)).for_each(|(out, z)| *out = z);
        Ok(())
    }
}

/// A line as written.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub height: f64,
    pub xy: Vec<[f64; 2]>,
}

/// Where lines are drawn.
#[derive(Clone, Debug)]
pub enum Heights {
    Every { interval: f64, base: f64 },
    List(Vec<f64>),
}

impl Heights {
    /// As options.
    pub fn of(&self, options: &mut ContourOptions) {
        (options.interval, options.base, options.levels) = match self.clone() {
            Self::Every { interval, base } => (Some(interval), Some(base), Vec::new()),
            Self::List(levels) => (None, None, levels),
        };
    }
}

pub fn job(input: &str, output: &Path, interval: f64, tile: u32, threads: usize) -> ContourJob {
    let resources = Resources { threads, memory: 256 << 20, temp_dir: None };
    let interval = Some(interval);
    let mut options = ContourOptions::default();
    (options.interval, options.tile, options.resources) = (interval, tile, resources);
    ContourJob { input: input.into(), output: output.into(), options }
}

/// A length in units of the data.
pub fn units(value: f64) -> Length {
    Length { value, unit: None }
}

pub fn made(job: &ContourJob) -> Result<ContourReport> {
    run(job, &Silent, &Cancel::default())
}

/// The lines of a grid in memory, by way of a file.
pub fn lines_of(
    grid: &Grid,
    heights: &Heights,
    tolerance: Option<f64>,
    tile: u32,
    threads: usize,
) -> (Vec<Line>, ContourReport) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lines.geojson");
    let mut job = job("memory", &path, 1.0, tile, threads);
    heights.of(&mut job.options);
    job.options.tolerance = tolerance.map(units);
    let report = trace(grid, &job, &Silent, &Cancel::default()).unwrap();
    (read(&path, "elev"), report)
}

/// The lines of a file, in its order, with the heights in `attribute`; NaN where there is none.
pub fn read(path: &Path, attribute: &str) -> Vec<Line> {
    let mut source = vector::open(path, &Default::default()).unwrap();
    let mut lines = Vec::new();
    while let Some(feature) = source.next().unwrap() {
        let height = match feature.properties.get(attribute) {
            Some(PropertyValue::Real(height)) => *height,
            Some(PropertyValue::Int(height)) => *height as f64,
            _ => f64::NAN,
        };
        let parts: Vec<_> = feature.geometry.parts().map(|part| part.xy.to_vec()).collect();
        assert_eq!(parts.len(), 1);
        lines.extend(parts.into_iter().map(|xy| Line { height, xy }));
    }
    lines
}

type Segment = [[f64; 2]; 2];

/// The first two segments, of all lines together, that have a point in common which is not where one
/// goes on from the other.
pub fn first_meeting(lines: &[Line]) -> Option<(Segment, Segment)> {
    let pairs = |line: &Line| line.xy.windows(2).map(|p| [p[0], p[1]]).collect::<Vec<_>>();
    let mut all: Vec<Segment> = lines.iter().flat_map(pairs).collect();
    let (low, high) = (|s: &Segment| s[0][0].min(s[1][0]), |s: &Segment| s[0][0].max(s[1][0]));
    all.sort_by(|a, b| low(a).total_cmp(&low(b)));
    for (i, a) in all.iter().enumerate() {
        let near = all[i + 1..].iter().take_while(|b| low(b) <= high(a));
        if let Some(b) = near.into_iter().find(|b| meet(a, b)) {
            return Some((*a, *b));
        }
    }
    None
}

fn meet(a: &Segment, b: &Segment) -> bool {
    if a[0] == a[1] || b[0] == b[1] {
        return true;
    }
    for (a, b) in [(a, b), (b, a)] {
        if a[1] == b[0] && a[0] != b[1] {
            let ([ax, ay], [bx, by], [cx, cy]) = (a[0], a[1], b[1]);
            let turns_back = (bx - ax) * (cx - bx) + (by - ay) * (cy - by) < 0.0;
            return orient(a[0], a[1], b[1]) == Ordering::Equal && turns_back;
        }
    }
    let sides = |s: &Segment, t: &Segment| [orient(s[0], s[1], t[0]), orient(s[0], s[1], t[1])];
    let (ab, ba) = (sides(a, b), sides(b, a));
    if ab == [Ordering::Equal; 2] {
        let overlap = |i: usize| {
            let (low, high) = (a[0][i].min(a[1][i]), a[0][i].max(a[1][i]));
            b[0][i].min(b[1][i]) <= high && b[0][i].max(b[1][i]) >= low
        };
        return overlap(0) && overlap(1);
    }
    ab[0] != ab[1] && ba[0] != ba[1]
}
