//! Statistics of a grid within the polygons of a feature file.
//!
//! Each polygon is divided into the tiles of the grid, whose cells are weighted and tallied on all threads; tallies are
//! merged tile by tile in the order of the grid. So the output does not depend on threads or memory. A block of the grid is
//! decoded once for each polygon in it, but from the cache for neighbours.

mod job;
mod statistics;

use std::collections::VecDeque;
use std::ops::Range;
use std::path::Path;

use crate::annotate::{
    self, AnnotatedFile, AnnotationGrid, AnnotationRequest, BatchedFeature, FeatureBatch,
};
use statistics::ZoneTally;
use terrane_base::error::{Error, Result};
use terrane_engine::memory::with_slack;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::GridInput;
use terrane_engine::workers;
use terrane_vector::{GeometryType, PartRole, PropertyValue};
use terrane_window::coverage::{CoverageScratch, PolygonCells, TILE};

pub use job::{ZonalOptions, ZonalReport, ZonalSetters};
pub use statistics::{ZONE_STATISTICS, ZoneStatistic, ZoneStatisticList, ZoneStatistics};

/// Cells of a tile.
const CELLS: u64 = TILE as u64 * TILE as u64;
/// Bytes of a worker: heights, shares and their steps, and samples of a tile.
const WORKER_BYTES: u64 = CELLS * 8 * 4;
/// Bytes of a value and its weight; sorting takes half as much again, and growing as much.
const VALUE_BYTES: u64 = 16;
const ALL_VALUE_BYTES: u64 = 3 * VALUE_BYTES;
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
        let units = UnitSize::of(self);
        let format = self.format(request.output)?;
        let request = AnnotationRequest {
            options: &self.common,
            features: &self.zones,
            run: request,
            format,
            are_points: false,
            omits_geometry: !format.holds.kinds.contains(&GeometryType::Polygon),
            worker: units.worker,
            naming: "‹prefix›",
        };
        let mut report = ZonalReport::default();
        let common = annotate::run(
            &request,
            |info| self.fields(info),
            |grid, batch, file| {
                ZonalBatch { options: self, grid, units, report: &mut report }.write(batch, file)
            },
        )?;
        report.samples_per_second = common.run.rate(report.samples);
        report.common = common;
        let notes = report.own_notes();
        report.common.notes.extend(notes);
        Ok(report)
    }
}

/// The tiles of a unit of work.
#[derive(Clone, Copy)]
struct UnitSize {
    tiles: u32,
    keeps_values: bool,
    /// Bytes of a worker.
    worker: u64,
}

impl UnitSize {
    fn of(options: &ZonalOptions) -> Self {
        let keeps_values = options.stat.0.iter().any(|statistic| statistic.needs_values());
        let resources = &options.common.resources;
        let tile = if keeps_values { CELLS * VALUE_BYTES * WAITING } else { 0 };
        let share = resources.memory / 8 / resources.threads.max(1) as u64;
        let tiles = share.checked_div(tile).map_or(MAX_TILES, |tiles| tiles.clamp(1, MAX_TILES));
        Self { tiles: tiles as u32, keeps_values, worker: WORKER_BYTES + tile * tiles }
    }
}

/// Some features at work.
struct ZonalBatch<'a> {
    options: &'a ZonalOptions,
    grid: &'a AnnotationGrid<'a>,
    units: UnitSize,
    report: &'a mut ZonalReport,
}

/// Tiles of a polygon: a unit of work.
struct ZoneUnit {
    strip: u32,
    tiles: Range<u32>,
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
    fn write(&mut self, batch: FeatureBatch<'_>, file: &mut AnnotatedFile) -> Result<()> {
        // Polygons of long edges over many tiles take more than they do as features.
        let most = self.grid.shares.mesh / 4;
        let (mut left, mut group, mut polygons) = (VecDeque::from(batch), Vec::new(), Vec::new());
        while let Some(own) = left.pop_front() {
            let polygon = self.polygon(&own).map_err(|e| own.error(e))?;
            if polygon.bytes() > most {
                let message =
                    format!("the polygon takes {} MiB over the grid", polygon.bytes() >> 20);
                let error = self.grid.short(message, polygon.bytes(), 4).or("simplify it");
                return Err(own.error(error));
            }
            polygons.push(polygon);
            group.push(own);
            let bytes: u64 = polygons.iter().map(PolygonCells::bytes).sum();
            if bytes > most || left.is_empty() {
                let values = self.values(&polygons, &group)?;
                let group = std::mem::take(&mut group).into_iter();
                group.zip(values).try_for_each(|(own, values)| file.write(own, values))?;
                polygons.clear();
            }
        }
        Ok(())
    }

    /// The polygon of a feature over the grid.
    fn polygon(&self, own: &BatchedFeature<'_>) -> Result<PolygonCells> {
        let info = self.grid.source.info();
        let geometry = &own.feature.geometry;
        let mut kinds = geometry.leaves().map(|leaf| leaf.kind());
        let other = |kind: &GeometryType| !kind.is_polygons() && *kind != GeometryType::Null;
        if let Some(kind) = kinds.find(other) {
            return Err(Error::bad_input(format!("{} has no area", kind.name()))
                .remedy("pass polygons, or ‹terrane sample› for heights at points"));
        }
        let parts = geometry.parts().map(|part| (part.xy, part.role == PartRole::Hole));
        let mut polygon = PolygonCells::new([info.width, info.height], self.options.cells);
        let rings = self.grid.place.rings(parts)?;
        rings.iter().for_each(|ring| polygon.push(&ring.positions, ring.is_hole));
        polygon.finish();
        Ok(polygon)
    }

    /// The properties of all polygons.
    fn values(
        &mut self,
        polygons: &[PolygonCells],
        own: &[BatchedFeature<'_>],
    ) -> Result<Vec<Vec<PropertyValue>>> {
        let mut ends: Vec<u64> = polygons.iter().map(|polygon| self.count(polygon)).collect();
        (1..ends.len()).for_each(|at| ends[at] += ends[at - 1]);
        let (options, grid, units) = (self.options, self.grid, self.units);
        let is_whole = annotate::is_whole(grid.source.info());
        let max_values = (grid.shares.mesh / 2 / ALL_VALUE_BYTES) as usize;
        let (mut values, mut open) = (Vec::new(), ZoneTally::default());
        let (mut empty, mut samples) = (0, 0);
        let mut close = |tally: ZoneTally| {
            empty += u64::from(tally.is_empty());
            tally.properties(&options.stat.0, is_whole)
        };
        workers::in_order(
            grid.shares.threads,
            ends.last().copied().unwrap_or(0),
            grid.cancel,
            ZoneBuffers::default,
            |buffers: &mut ZoneBuffers, unit| {
                let feature = ends.partition_point(|end| *end <= unit);
                let first = feature.checked_sub(1).map_or(0, |before| ends[before]);
                let unit = units.unit(&polygons[feature], unit - first);
                let part = tally(grid, units, &polygons[feature], &unit, buffers)?;
                let (tallies, samples) = part.ok_or_else(|| own[feature].error(overlapping()))?;
                Ok(ZonePart { feature, tallies, samples })
            },
            |part: ZonePart| {
                while values.len() < part.feature {
                    values.push(close(std::mem::take(&mut open)));
                }
                samples += part.samples;
                part.tallies.into_iter().for_each(|tally| open.add(tally, max_values));
                match open.values() > max_values {
                    true => {
                        let cells = polygons[part.feature].bounds().len() as u64;
                        Err(own[part.feature].error(too_many(grid, max_values, cells)))
                    }
                    false => Ok(()),
                }
            },
        )?;
        while values.len() < polygons.len() {
            values.push(close(std::mem::take(&mut open)));
        }
        self.report.empty_zones += empty;
        self.report.samples += samples;
        let beyond = polygons.iter().filter(|polygon| !polygon.is_within());
        self.report.zones_beyond += beyond.count() as u64;
        Ok(values)
    }

    /// Number of units of a polygon.
    fn count(&self, polygon: &PolygonCells) -> u64 {
        polygon.strips().len() as u64 * self.units.across(polygon)
    }
}

impl UnitSize {
    /// Units of a polygon in a row of tiles.
    fn across(self, polygon: &PolygonCells) -> u64 {
        (polygon.tiles().len() as u64).div_ceil(self.tiles.into())
    }

    /// A unit of a polygon, row by row of tiles.
    fn unit(self, polygon: &PolygonCells, number: u64) -> ZoneUnit {
        let (tiles, across) = (polygon.tiles(), self.across(polygon));
        let first = tiles.start + (number % across) as u32 * self.tiles;
        let strip = polygon.strips().start + (number / across) as u32;
        ZoneUnit { strip, tiles: first..(first + self.tiles).min(tiles.end) }
    }
}

/// The tallies of a unit and the number of samples; `None` if rings overlap.
fn tally(
    grid: &AnnotationGrid<'_>,
    units: UnitSize,
    polygon: &PolygonCells,
    unit: &ZoneUnit,
    buffers: &mut ZoneBuffers,
) -> Result<Option<(Vec<ZoneTally>, u64)>> {
    let ZoneBuffers { coverage, heights } = buffers;
    let (mut tallies, mut samples) = (Vec::new(), 0);
    let is_sound = polygon.strip(unit.strip, unit.tiles.clone(), coverage, |rect, shares| {
        heights.clear();
        heights.resize(rect.len(), 0.0);
        grid.source.read_f64(rect, heights)?;
        grid.source.copied(rect);
        samples += rect.len() as u64;
        tallies.push(ZoneTally::of(heights, shares, units.keeps_values));
        Ok::<(), Error>(())
    })?;
    Ok(is_sound.then_some((tallies, samples)))
}

/// The error for a zone within `cells` cells with more values than fit.
fn too_many(grid: &AnnotationGrid<'_>, most: usize, cells: u64) -> Error {
    let message = format!("the zone has more than {most} different heights");
    // More memory makes larger units of work, which take at most an eighth of it.
    let bytes = with_slack(cells.saturating_mul(ALL_VALUE_BYTES));
    grid.short(message, bytes, 2).or("leave out percentiles, majority, minority and variety")
}

fn overlapping() -> Error {
    Error::bad_input("rings of the polygon cross or overlap")
        .remedy("repair the polygon, as with ST_MakeValid")
}
