//! Statistics of a grid within the polygons of a feature file.
//!
//! Features are read in batches. Each polygon is divided into the tiles of the grid, whose cells are weighted and tallied
//! on all threads; tallies are merged tile by tile in the order of the grid. So the output does not depend on threads or
//! memory. A tile of a grid is decoded once for each polygon in it, but from the cache for neighbours.

mod job;
mod statistics;

use std::collections::VecDeque;
use std::path::Path;
use std::time::Instant;

use crate::annotate::{AnnotatedFeatures, AnnotatedNames, BatchedFeature, GridPlace};
use statistics::ZoneTally;
use terrane_base::error::{Error, Result};
use terrane_engine::memory::{self, MemoryShares};
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::GridInput;
use terrane_engine::outputs::not_member;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, workers};
use terrane_files::atomic;
use terrane_raster::{self as raster, GridOpenOptions, GridSource};
use terrane_vector::{GeometryType, PartRole, PropertyValue};
use terrane_window::coverage::{CoverageScratch, PolygonCells, TILE};

pub use job::{ZonalOptions, ZonalReport, ZonalSetters, ZoneCells};
pub use statistics::{ZoneStatistic, ZoneStatisticList, ZoneStatistics};

/// Cells of a tile.
const CELLS: u64 = TILE as u64 * TILE as u64;
/// Bytes of a worker: heights, shares and their steps, and samples of a tile.
const WORKER_BYTES: u64 = CELLS * 8 * 4;
/// Bytes of a value and its weight; sorting and growing take as much again, each.
const VALUE_BYTES: u64 = 16;
/// Results of a worker that may wait, with the one in work.
const WAITING: u64 = 5;
/// Most tiles of a unit of work.
const MAX_TILES: u64 = 16;

impl Operation for ZonalOptions {
    const NAME: &'static str = "zonal";
    type Input = GridInput;
    const WRITES: Writes = Writes::Features;
    type Report = ZonalReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.format(output).map(drop)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<ZonalReport> {
        run(self, request)
    }
}

fn run(options: &ZonalOptions, request: RunRequest<'_>) -> Result<ZonalReport> {
    let start = Instant::now();
    let RunRequest { inputs, output, progress, cancel, .. } = request;
    let format = options.format(output)?;
    atomic::refuse_existing(output, options.file.replacing.overwrite)?;
    let budget = ZonalMemory::of(options);
    let (resources, cache) = (&options.resources, GridOpenOptions::default().cache_bytes);
    let opening = options.grid.options(resources, cache)?;
    let (grid, shares) = memory::open(inputs, &opening, resources, budget.worker)?;
    let budget = budget.with(shares);
    not_member(grid.as_ref(), output)?;
    let info = grid.info();
    info.check_cells().map_err(|e| e.in_file(Path::new(&inputs.to_string())))?;
    let zones = crate::annotate::path(&options.zones);
    let layer = options.features.layer.as_deref();
    let are_points = false;
    let names = AnnotatedNames { input: &zones, layer, are_points, output, file: &options.file };
    let mut features =
        AnnotatedFeatures::open(&names, format, &options.fields(), info, &options.resources)?;
    let mut report = ZonalReport::default();
    progress.begin("zones", 0);
    loop {
        let batch = features.read(budget.shares.mesh / 2)?;
        if batch.is_empty() {
            break;
        }
        let job = ZonalBatch { options, grid: grid.as_ref(), budget: &budget, cancel };
        job.write(batch, &mut features, &mut report, progress)?;
    }
    cancel.check()?;
    report.transformed = features.place().transformed();
    let written = features.finish()?;
    progress.end();
    report.notes = [written.notes, raster::cautions(info), report.own_notes()].concat();
    let run = RunStatistics::since(start, &options.resources).with_threads(budget.shares.threads);
    Ok(ZonalReport {
        input: inputs.to_string(),
        zones_file: zones.display().to_string(),
        output: output.display().to_string(),
        format: format.name.to_owned(),
        crs: info.crs.label(),
        output_bytes: written.bytes,
        samples_per_second: run.rate(report.samples),
        run,
        ..report
    })
}

/// How the memory is divided.
struct ZonalMemory {
    shares: MemoryShares,
    /// Bytes of a thread.
    worker: u64,
    keeps_values: bool,
    /// Tiles of a unit of work.
    tiles: u32,
    /// Most values of a zone.
    max_values: u64,
    memory: u64,
}

impl ZonalMemory {
    /// What a thread takes; without shares of an open grid.
    fn of(options: &ZonalOptions) -> Self {
        let keeps_values = options.stat.0.iter().any(|statistic| statistic.needs_values());
        let (memory, threads) = (options.resources.memory, options.resources.threads.max(1));
        let tile = if keeps_values { CELLS * VALUE_BYTES * WAITING } else { 0 };
        let tiles = match tile {
            0 => MAX_TILES,
            tile => (memory / 8 / threads as u64 / tile).clamp(1, MAX_TILES),
        };
        let shares = MemoryShares { threads, cache: 0, mesh: 0 };
        let worker = WORKER_BYTES + tile * tiles;
        Self { shares, worker, keeps_values, tiles: tiles as u32, max_values: 0, memory }
    }

    /// The same with the shares that the open grid leaves.
    fn with(self, shares: MemoryShares) -> Self {
        Self { shares, max_values: shares.mesh / 2 / (3 * VALUE_BYTES), ..self }
    }
}

/// Some features at work.
struct ZonalBatch<'a> {
    options: &'a ZonalOptions,
    grid: &'a dyn GridSource,
    budget: &'a ZonalMemory,
    cancel: &'a Cancel,
}

/// Tiles of a polygon: a unit of work.
struct ZoneUnit {
    feature: usize,
    strip: u32,
    tiles: std::ops::Range<u32>,
}

/// The tallies of a unit, tile by tile.
struct ZonePart {
    feature: usize,
    tallies: Vec<ZoneTally>,
    samples: u64,
}

#[derive(Default)]
struct ZoneBuffers {
    coverage: CoverageScratch,
    heights: Vec<f64>,
}

impl ZonalBatch<'_> {
    /// Computes and writes the properties of some features.
    fn write(
        &self,
        batch: Vec<BatchedFeature<'_>>,
        features: &mut AnnotatedFeatures<'_>,
        report: &mut ZonalReport,
        progress: &dyn Progress,
    ) -> Result<()> {
        // Polygons of long edges over many tiles take more than they do as features.
        let bytes = self.budget.shares.mesh / 2;
        let (mut left, mut waiting) = (VecDeque::from(batch), Vec::new());
        while !left.is_empty() {
            self.cancel.check()?;
            let (mut polygons, mut taken) = (Vec::new(), 0);
            while let Some(own) = left.front() {
                let polygon = self.polygon(own, features.place()).map_err(|e| own.error(e))?;
                if polygon.bytes() > bytes {
                    let needed = polygon.bytes() >> 20;
                    let message = format!("the polygon takes {needed} MiB over the grid");
                    let enough = self.budget.memory / bytes.max(1) * polygon.bytes() * 5 / 4;
                    let error = memory::short(message, enough).or("simplify it");
                    return Err(own.error(error));
                }
                if taken + polygon.bytes() > bytes && !polygons.is_empty() {
                    break;
                }
                taken += polygon.bytes();
                polygons.push(polygon);
                waiting.extend(left.pop_front());
            }
            let values = self.values(&polygons, &waiting, report)?;
            for (own, values) in waiting.iter_mut().zip(values) {
                features.write(own, values)?;
            }
            progress.advance(waiting.len() as u64);
            waiting.clear();
        }
        Ok(())
    }

    /// The polygon of a feature over the grid.
    fn polygon(&self, own: &BatchedFeature<'_>, place: &GridPlace) -> Result<PolygonCells> {
        let info = self.grid.info();
        let mut polygon = PolygonCells::new([info.width, info.height], self.options.cells.rule());
        for leaf in own.feature.geometry.leaves() {
            if !leaf.kind().is_polygons() && leaf.kind() != GeometryType::Null {
                let kind = leaf.kind().name();
                return Err(Error::bad_input(format!("{kind} has no area"))
                    .remedy("pass polygons, or ‹terrane sample› for heights at points"));
            }
        }
        for part in own.feature.geometry.parts() {
            let ring = place.cells(part.xy)?;
            polygon.push(&ring, part.role == PartRole::Hole);
        }
        polygon.finish();
        Ok(polygon)
    }

    /// The properties of all polygons.
    fn values(
        &self,
        polygons: &[PolygonCells],
        own: &[BatchedFeature<'_>],
        report: &mut ZonalReport,
    ) -> Result<Vec<Vec<PropertyValue>>> {
        let mut ends: Vec<u64> = polygons.iter().map(|polygon| self.units(polygon)).collect();
        (1..ends.len()).for_each(|at| ends[at] += ends[at - 1]);
        let mut values = Vec::new();
        let mut open = ZoneTally::default();
        let statistics = &self.options.stat.0;
        let close = |tally: ZoneTally, report: &mut ZonalReport| {
            report.zones += 1;
            report.empty_zones += u64::from(tally.is_empty());
            tally.properties(statistics)
        };
        workers::in_order(
            self.budget.shares.threads,
            ends.last().copied().unwrap_or(0),
            self.cancel,
            ZoneBuffers::default,
            |buffers: &mut ZoneBuffers, unit| {
                let feature = ends.partition_point(|end| *end <= unit);
                let first = feature.checked_sub(1).map_or(0, |before| ends[before]);
                let unit = self.unit(feature, &polygons[feature], unit - first);
                let part = self.tally(&polygons[feature], &unit, buffers)?;
                part.ok_or_else(|| own[feature].error(unsound()))
            },
            |part: ZonePart| {
                while values.len() < part.feature {
                    values.push(close(std::mem::take(&mut open), report));
                }
                part.tallies.into_iter().for_each(|tally| open.add(tally));
                report.samples += part.samples;
                match open.values() > self.budget.max_values {
                    true => {
                        let cells = polygons[part.feature].bounds().len() as u64;
                        Err(own[part.feature].error(self.too_many(cells)))
                    }
                    false => Ok(()),
                }
            },
        )?;
        while values.len() < polygons.len() {
            values.push(close(std::mem::take(&mut open), report));
        }
        let beyond = polygons.iter().filter(|polygon| !polygon.is_within());
        report.zones_beyond += beyond.count() as u64;
        Ok(values)
    }

    /// Number of units of a polygon, row by row of tiles.
    fn units(&self, polygon: &PolygonCells) -> u64 {
        let across = polygon.tiles().len().div_ceil(self.budget.tiles as usize);
        polygon.strips().len() as u64 * across as u64
    }

    fn unit(&self, feature: usize, polygon: &PolygonCells, number: u64) -> ZoneUnit {
        let (tiles, strips) = (polygon.tiles(), polygon.strips());
        let across = u64::from(tiles.end - tiles.start).div_ceil(self.budget.tiles.into());
        let first = tiles.start + (number % across) as u32 * self.budget.tiles;
        let end = (first + self.budget.tiles).min(tiles.end);
        ZoneUnit { feature, strip: strips.start + (number / across) as u32, tiles: first..end }
    }

    /// The tallies of a unit; `None` if rings cross.
    fn tally(
        &self,
        polygon: &PolygonCells,
        unit: &ZoneUnit,
        buffers: &mut ZoneBuffers,
    ) -> Result<Option<ZonePart>> {
        let ZoneBuffers { coverage, heights } = buffers;
        let mut part = ZonePart { feature: unit.feature, tallies: Vec::new(), samples: 0 };
        let is_sound =
            polygon.strip(unit.strip, unit.tiles.clone(), coverage, |rect, shares| {
                heights.clear();
                heights.resize(rect.len(), 0.0);
                self.grid.read_f64(rect, heights)?;
                self.grid.copied(rect);
                part.samples += rect.len() as u64;
                part.tallies.push(ZoneTally::of(heights, shares, self.budget.keeps_values));
                Ok::<(), Error>(())
            })?;
        Ok(is_sound.then_some(part))
    }

    /// The error for a zone within `cells` cells with more values than fit.
    fn too_many(&self, cells: u64) -> Error {
        let limit = self.budget.max_values;
        let message = format!("the zone has more than {limit} different heights");
        // Shares of half a half, without what is for fragmentation; workers take an eighth beside their tiles.
        let values = memory::with_slack(4 * 3 * VALUE_BYTES * cells);
        let workers = WORKER_BYTES * self.options.resources.threads as u64;
        let enough = memory::with_slack(memory::PROGRAM + workers + values);
        memory::short(message, enough.max(self.budget.memory))
            .or("leave out percentiles, majority, minority and variety")
    }
}

fn unsound() -> Error {
    Error::bad_input("rings of the polygon cross or overlap")
        .remedy("repair the polygon, as with ST_MakeValid")
}
