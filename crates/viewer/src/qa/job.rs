//! A report from its inputs to its files.

use std::io::Write;
use std::time::Instant;

use terrane_options::changed;

use super::cells::{CellPass, CellSummary};
use super::differences::{MAX_PAIRS, MIN_RETURNS, USUAL_SLOPE};
use super::findings::{allowed_times, created, findings};
use super::footprint::POLYGON_BYTES;
use super::index::{IndexFormat, TileIndex};
use super::lattice::{POINTS_OF_CELL, QaLattice};
use super::options::QaOptions;
use super::page::QaPage;
use super::picture::PICTURE_BYTES;
use super::report::{QaComparison, QaContents, QaFile, QaLine, QaReport, QaRequirement};
use super::survey::{QaReading, QaSurvey, WORKER};
use super::tally::{FileTally, LineTallies};
use super::voids::{GAP_BYTES, MAX_GAPS};
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as clouds, CloudFilter, PointCloud, PointSource, StatedHeader};
use terrane_engine::Resources;
use terrane_engine::memory::{PROGRAM, beside_polygons, beside_program, polygon_bytes, short};
use terrane_engine::operation::RunRequest;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::skip_bad::LostPoints;
use terrane_files::atomic::{AtomicFile, refuse_existing};
use terrane_files::{folder_for, shown};

/// With fewer points per occupied cell, a cell without points is a gap between points, not a void.
const MIN_MEAN_POINTS: f64 = 4.0;
/// With more in cells of the default size, ten times [`POINTS_OF_CELL`], the bounds are mostly empty.
const MAX_MEAN_POINTS: f64 = 10.0 * POINTS_OF_CELL;
/// Least bytes for cells.
const MIN_CELLS: u64 = 8 << 20;

/// A report to make.
pub(super) struct QaJob<'a> {
    pub(super) options: &'a QaOptions,
    pub(super) request: RunRequest<'a>,
}

/// Division of the memory.
struct QaMemory {
    threads: usize,
    /// Bytes of cells, and of differences and footprints each.
    cells: u64,
    others: u64,
}

impl QaMemory {
    fn divide(resources: &Resources, has_index: bool, reserved: u64) -> Result<Self> {
        // Polygons are made when the cells and gaps are gone.
        let least = if has_index { POLYGON_BYTES } else { 0 }.max(MIN_CELLS + GAP_BYTES);
        let Some(rest) =
            beside_program(resources.memory).checked_sub(PICTURE_BYTES + least + WORKER)
        else {
            let required = PROGRAM + PICTURE_BYTES + least + WORKER + reserved;
            let mib = required.div_ceil(1 << 20);
            return Err(short(format!("the report needs {mib} MiB of memory"), required));
        };
        let threads = resources.threads.clamp(1, 1 + (rest / 2 / WORKER) as usize);
        // One part in eight for fragmentation.
        let cells = least - GAP_BYTES + (rest - (threads as u64 - 1) * WORKER) / 8 * 7;
        Ok(Self { threads, cells, others: WORKER / 4 })
    }
}

impl QaJob<'_> {
    pub(super) fn run(&self) -> Result<QaReport> {
        let started = Instant::now();
        let Self { options, request } = self;
        let overwrite = options.replacing.overwrite;
        refuse_existing(request.output, overwrite)?;
        let index = options.index.as_deref();
        index.map_or(Ok(()), |index| refuse_existing(index, overwrite))?;

        let mut opening = options.cloud.options(&options.resources)?;
        let keep_withheld = std::mem::replace(&mut opening.filter.keep_withheld, true);
        opening.any_extent = true;
        let is_whole =
            opening.filter == CloudFilter { keep_withheld: true, ..CloudFilter::default() };
        if let Some(path) = index.filter(|_| !is_whole)
            && matches!(IndexFormat::of(path)?, IndexFormat::Vpc)
        {
            return Err(Error::usage(
                "a Virtual Point Cloud describes whole files, but filters leave points out",
            )
            .in_file(path)
            .remedy("remove the filters, or use .geojson, .fgb or .shp"));
        }
        let resources = beside_polygons(&opening, &options.resources);
        let memory = QaMemory::divide(&resources, index.is_some(), polygon_bytes(&opening))?;
        let resources = Resources { threads: memory.threads, ..resources };
        let cloud = clouds::open(request.inputs.names(), &opening)?;
        let headers = cloud.headers()?;
        let mut notes = cloud.notes().to_vec();
        let info = cloud.info();
        let lattice = info
            .bounds
            .map(|bounds| QaLattice::new(info, bounds, options.cell, &mut notes))
            .transpose()?;

        let folder = folder_for(request.output, resources.temp_dir.as_deref());
        let reading = QaReading {
            cloud: &cloud,
            lattice: lattice.as_ref(),
            times: headers.iter().map(allowed_times).collect(),
            keep_withheld,
            folder,
            budget: memory.cells,
        };
        let survey = reading.run(&resources, request.progress, request.cancel)?;
        let QaSurvey { files: tallies, lines, cells, unplaced } = survey;
        let spilled = cells.spilled();
        if unplaced > 0 {
            notes.push(format!(
                "{unplaced} points are too far outside the bounds of their header to have a cell"
            ));
        }
        let max_range = options.max_range.or(lattice.as_ref().map(|it| it.rise * USUAL_SLOPE));
        let summary = lattice.as_ref().map(|lattice| {
            let pass = CellPass {
                lattice,
                files: headers.len(),
                min_void: options.min_void.unwrap_or(lattice.area),
                max_range: max_range.unwrap_or_default(),
                has_footprints: index.is_some(),
                folder,
                budget: memory.others,
            };
            request.progress.begin("cells", 0);
            let summary = pass.run(cells, request.cancel);
            request.progress.end();
            summary
        });
        let mut summary = summary.transpose()?;

        let mut report = self.report(&cloud, lattice.as_ref(), &tallies);
        report.findings = findings(&headers, &tallies, is_whole);
        report.headers_compared = is_whole;
        report.file_list = file_list(&headers, &tallies, lattice.as_ref(), summary.as_ref());
        report.comparison =
            max_range.map(|max_range| QaComparison { min_returns: MIN_RETURNS, max_range });
        let runs = summary.as_mut().and_then(|summary| summary.runs.take());
        let mut page = QaPage::default();
        if let (Some(summary), Some(lattice)) = (summary, &lattice) {
            let most = summary.points.percentile(98);
            page.density = Some(summary.picture.densities(most, &resources)?);
            page.differences = summary.picture.differences(&resources)?;
            page.step = summary.picture.step();
            report.lines = line_list(&lines, &summary, lattice);
            self.fill(&mut report, summary, lattice, &mut notes)?;
        }
        let mut file = AtomicFile::create(request.output, overwrite)?;
        let mut written = None;
        if let Some(path) = index {
            let index = TileIndex {
                path,
                format: IndexFormat::of(path)?,
                overwrite,
                temp_dir: resources.temp_dir.clone(),
                crs: &info.crs,
                lattice: lattice.as_ref(),
                headers: &headers,
                tallies: &tallies,
                files: &report.file_list,
            };
            let (sink, found) = index.write(runs)?;
            notes.extend(found.into_iter().map(of_index));
            written = Some(sink);
        }
        notes.extend(LostPoints::of(&cloud).notes());
        notes.extend(
            request.skipped.iter().map(|it| format!("{} is left out: {}", it.file, it.reason)),
        );
        if report.lines.iter().map(|line| line.line).eq([0]) {
            notes.push("all point source ids are 0: flight lines are unknown".to_owned());
        }
        report.notes = notes;
        let html = page.html(&report);
        file.write_all(html.as_bytes()).map_err(|e| Error::write(request.output, e))?;
        request.cancel.check()?;
        // A run that fails before leaves the files of an earlier one.
        if let Some(sink) = written {
            report.notes.extend(sink.finish(&[])?.notes.into_iter().map(of_index));
        }
        report.output_bytes = file.commit()?;
        report.run = RunStatistics::since(started, &options.resources)
            .with_threads(memory.threads)
            .with_spilled(Some(spilled));
        Ok(report)
    }

    /// The report without results of cells.
    fn report(
        &self,
        cloud: &PointCloud,
        lattice: Option<&QaLattice>,
        tallies: &[FileTally],
    ) -> QaReport {
        let Self { options, request } = self;
        let info = cloud.info();
        let all = tallies.iter().cloned().fold(FileTally::default(), FileTally::and);
        QaReport {
            input: request.inputs.to_string(),
            output: request.output.display().to_string(),
            format: cloud.format(),
            files: cloud.files().len() as u64,
            crs: info.crs.label(),
            epsg: info.crs.epsg,
            vertical_epsg: info.crs.vertical_epsg,
            horizontal_unit: info.crs.horizontal_unit(),
            vertical_unit: info.crs.vertical_unit.clone(),
            filters: changed(&options.cloud),
            cell: lattice.map(|lattice| lattice.side),
            cell_area: lattice.map(|lattice| lattice.area),
            area_unit: lattice.map_or("unit", |lattice| lattice.area_unit),
            occupied_cells: 0,
            enclosed_cells: 0,
            footprint_area: 0.0,
            density: None,
            pulse_density: None,
            // Without points, no cell has the required density.
            min_density: options.min_density.map(|required| QaRequirement {
                required,
                is_met: Some(false),
                below: 1.0,
            }),
            voids: None,
            lines: Vec::new(),
            overlaps: Vec::new(),
            overlaps_left_out: 0,
            comparison: None,
            contents: QaContents {
                stats: all.stats,
                intensity: all.intensity,
                scan_angle: all.angle,
                gps_time: all.time,
            },
            headers_compared: false,
            findings: Vec::new(),
            file_list: Vec::new(),
            index: options.index.as_ref().map(|index| index.display().to_string()),
            notes: Vec::new(),
            output_bytes: 0,
            run: RunStatistics::default(),
        }
    }

    /// Adds the results of cells.
    fn fill(
        &self,
        report: &mut QaReport,
        summary: CellSummary,
        lattice: &QaLattice,
        notes: &mut Vec<String>,
    ) -> Result<()> {
        let required = self.options.min_density;
        report.occupied_cells = summary.occupied;
        report.enclosed_cells = summary.enclosed;
        report.footprint_area = (summary.occupied + summary.enclosed) as f64 * lattice.area;
        report.density = summary.points.report(lattice.area, None);
        report.pulse_density = summary.pulses.report(lattice.area, required);
        let mean = summary.mean_points();
        let is_judged = mean >= MIN_MEAN_POINTS;
        if let (Some(density), Some(requirement)) = (&report.pulse_density, &mut report.min_density)
        {
            requirement.is_met = is_judged.then_some(density.mean >= requirement.required);
            requirement.below = density.below.unwrap_or_default();
        }
        if summary.occupied > 0 && !is_judged {
            notes.push(
                "cells are smaller than the point spacing; densities are too high: choose a larger ‹cell›".to_owned(),
            );
        }
        if self.options.cell.is_none() && mean > MAX_MEAN_POINTS {
            notes.push(
                "the bounds of the headers are much larger than the survey: set the size of cells with ‹cell›"
                    .to_owned(),
            );
        }
        if summary.voids.is_none() {
            notes.push(format!(
                "voids are not counted: a row of cells has {MAX_GAPS} gaps or more; choose a larger ‹cell›"
            ));
        }
        report.voids = summary.voids.filter(|_| summary.occupied > 0);
        (report.overlaps, report.overlaps_left_out) = summary.comparison.finish(lattice)?;
        if report.overlaps_left_out > 0 {
            notes.push(format!(
                "{MAX_PAIRS} pairs of lines are compared; {} overlaps of other pairs, counted by cell, are left out: \
                 these point source ids may not be flight lines",
                report.overlaps_left_out
            ));
        }
        Ok(())
    }
}

fn line_list(lines: &LineTallies, summary: &CellSummary, lattice: &QaLattice) -> Vec<QaLine> {
    let all = lines.0.iter().map(|(line, tally)| {
        let area = summary.lines.get(line).copied().unwrap_or(0) as f64 * lattice.area;
        QaLine {
            line: *line,
            points: tally.points,
            last_returns: tally.last,
            area,
            density: per_area(tally.points, area),
            pulse_density: per_area(tally.last, area),
            gps_time: tally.time,
            scan_angle: tally.angle,
        }
    });
    all.collect()
}

fn of_index(note: String) -> String {
    format!("index: {note}")
}

fn per_area(points: u64, area: f64) -> f64 {
    if area > 0.0 { points as f64 / area } else { 0.0 }
}

fn file_list(
    headers: &[StatedHeader<'_>],
    tallies: &[FileTally],
    lattice: Option<&QaLattice>,
    summary: Option<&CellSummary>,
) -> Vec<QaFile> {
    let files = headers.iter().zip(tallies).enumerate();
    let all = files.map(|(at, (header, tally))| {
        let cells = summary.map(|summary| summary.files[at]).unwrap_or_default();
        let area = cells.cells as f64 * lattice.map_or(0.0, |lattice| lattice.area);
        QaFile {
            file: shown(header.name),
            points: tally.stats.census.kept,
            area,
            density: per_area(cells.points, area),
            bounds: tally.stats.bounds,
            gps_time: tally.time,
            version: header.las.map(|las| format!("{}.{}", las.version[0], las.version[1])),
            point_format: header.las.map(|_| header.format),
            created: header.las.and_then(|las| created(&las)).map(|day| day.to_string()),
            crs: header.crs.label(),
        }
    });
    all.collect()
}
