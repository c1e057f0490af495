//! The pass over the cells, in the order of rows: density, voids, overlaps, pictures and footprints.

use std::collections::BTreeMap;
use std::path::Path;

use super::density::CellCounts;
use super::differences::{LineComparison, LineInCell};
use super::footprint::{FootprintRun, RunWriter};
use super::lattice::QaLattice;
use super::picture::QaPicture;
use super::report::QaVoids;
use super::tally::CellTally;
use super::voids::VoidTracker;
use terrane_base::error::Result;
use terrane_engine::Cancel;
use terrane_files::AggregatedRecords;

/// Points and cells of a file.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FileCells {
    pub(super) points: u64,
    pub(super) cells: u64,
}

/// What the pass collects.
pub(super) struct CellSummary {
    pub(super) points: CellCounts,
    pub(super) pulses: CellCounts,
    pub(super) occupied: u64,
    /// Empty cells that occupied ones enclose.
    pub(super) enclosed: u64,
    /// `None` if a row has too many gaps.
    pub(super) voids: Option<QaVoids>,
    /// Number of cells of each flight line.
    pub(super) lines: BTreeMap<u16, u64>,
    pub(super) files: Vec<FileCells>,
    pub(super) comparison: LineComparison,
    pub(super) picture: QaPicture,
    /// Footprints of the files, if asked for.
    pub(super) runs: Option<AggregatedRecords<FootprintRun>>,
}

impl CellSummary {
    /// Mean number of points of occupied cells; 0 without any.
    pub(super) fn mean_points(&self) -> f64 {
        let points: u64 = self.files.iter().map(|file| file.points).sum();
        points as f64 / self.occupied.max(1) as f64
    }
}

/// How cells are summed up.
pub(super) struct CellPass<'a> {
    pub(super) lattice: &'a QaLattice,
    pub(super) files: usize,
    pub(super) min_void: f64,
    pub(super) max_range: f64,
    pub(super) has_footprints: bool,
    pub(super) folder: &'a Path,
    /// Bytes of differences in memory, and of footprints.
    pub(super) budget: u64,
}

/// Sums while cells come in.
struct CellSums<'a> {
    lattice: &'a QaLattice,
    summary: CellSummary,
    tracker: VoidTracker,
    runs: Option<RunWriter>,
    lines: Vec<LineInCell>,
}

/// Cells after which a run checks whether it is cancelled.
const CHECKED: u64 = 1 << 12;

impl CellPass<'_> {
    /// Sums up all cells.
    ///
    /// # Errors
    /// Temporary files that cannot be read or written; cancelled.
    pub(super) fn run(
        &self,
        cells: AggregatedRecords<CellTally>,
        cancel: &Cancel,
    ) -> Result<CellSummary> {
        let lattice = self.lattice;
        // A void of just this area counts.
        let min_cells = (self.min_void / lattice.area - 1e-9).ceil().max(1.0) as u64;
        let summary = CellSummary {
            points: CellCounts::default(),
            pulses: CellCounts::default(),
            occupied: 0,
            enclosed: 0,
            voids: None,
            lines: BTreeMap::new(),
            files: vec![FileCells::default(); self.files],
            comparison: LineComparison::new(self.max_range, lattice, self.folder, self.budget),
            picture: QaPicture::new(lattice),
            runs: None,
        };
        let runs =
            self.has_footprints.then(|| RunWriter::new(self.files, self.folder, self.budget));
        let tracker = VoidTracker::new(min_cells);
        let mut sums = CellSums { lattice, summary, tracker, runs, lines: Vec::new() };
        let mut cell: Vec<CellTally> = Vec::new();
        cells.read(&mut |tally| {
            if cell.first().is_some_and(|first| first.cell != tally.cell) {
                if sums.summary.occupied.is_multiple_of(CHECKED) {
                    cancel.check()?;
                }
                sums.add(&cell)?;
                cell.clear();
            }
            // A line comes again only for another file.
            cell.push(*tally);
            Ok(())
        })?;
        if !cell.is_empty() {
            sums.add(&cell)?;
        }
        sums.finish(self.min_void)
    }
}

impl CellSums<'_> {
    /// Adds a cell: its tallies by line, then file.
    fn add(&mut self, tallies: &[CellTally]) -> Result<()> {
        let Some(CellTally { cell, .. }) = tallies.first().copied() else { return Ok(()) };
        let (mut points, mut last) = (0, 0);
        self.lines.clear();
        for tally in tallies {
            points += tally.points;
            last += tally.last;
            let line = LineInCell::of(tally);
            match self.lines.last_mut().filter(|own| own.line == line.line) {
                Some(own) => own.merge(&line),
                None => self.lines.push(line),
            }
        }
        let summary = &mut self.summary;
        summary.occupied += 1;
        summary.points.add(points, 1);
        summary.pulses.add(last, 1);
        for line in &self.lines {
            *summary.lines.entry(line.line).or_default() += 1;
        }
        let difference = summary.comparison.add(&self.lines, self.lattice)?;
        summary.picture.add(cell, points, difference);
        self.tracker.add(cell.map(i64::from));
        self.add_files(tallies)
    }

    /// Counts the cell once for each file.
    fn add_files(&mut self, tallies: &[CellTally]) -> Result<()> {
        let mut files: Vec<u32> = tallies.iter().map(|tally| tally.file).collect();
        files.sort_unstable();
        files.dedup();
        for tally in tallies {
            self.summary.files[tally.file as usize].points += tally.points;
        }
        for file in files {
            self.summary.files[file as usize].cells += 1;
            if let Some(runs) = &mut self.runs {
                runs.add(file, tallies[0].cell)?;
            }
        }
        Ok(())
    }

    fn finish(self, min_void: f64) -> Result<CellSummary> {
        let (voids, enclosed) = self.tracker.finish(min_void, self.lattice).unzip();
        let enclosed = enclosed.unwrap_or(0);
        let mut summary = CellSummary { voids, enclosed, ..self.summary };
        summary.points.add(0, enclosed);
        summary.pulses.add(0, enclosed);
        summary.runs = self.runs.map(RunWriter::finish).transpose()?;
        Ok(summary)
    }
}
