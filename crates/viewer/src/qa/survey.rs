//! The pass over the points: each thread reads parts, and adds what it counted to that of the others.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::lattice::QaLattice;
use super::tally::{AllowedTimes, CellTally, FileTally, LineTallies};
use terrane_base::error::Result;
use terrane_cloud::{Flags, InspectedPoint, PointCloud, PointSource};
use terrane_engine::input::workers;
use terrane_engine::{Cancel, FileAt, Progress, Resources};
use terrane_files::{AggregatedRecords, KeyedRecord, lock};

/// Cells that a thread holds.
const HELD: usize = 1 << 15;

/// Bytes of a thread: part of a file, and its cells.
pub(super) const WORKER: u64 = (12 << 20) + (HELD * (2 * size_of::<CellTally>() + 64)) as u64;

/// Counts of all points.
pub(super) struct QaSurvey {
    /// By file, in the order of the cloud's files.
    pub(super) files: Vec<FileTally>,
    pub(super) lines: LineTallies,
    pub(super) cells: AggregatedRecords<CellTally>,
    /// Points without a cell, because they are too far outside the bounds of their header.
    pub(super) unplaced: u64,
}

/// How points are read.
pub(super) struct QaReading<'a> {
    pub(super) cloud: &'a PointCloud,
    /// `None` without points.
    pub(super) lattice: Option<&'a QaLattice>,
    /// By file.
    pub(super) times: Vec<AllowedTimes>,
    /// Flight lines and cells have withheld points, too.
    pub(super) keep_withheld: bool,
    pub(super) folder: &'a Path,
    /// Bytes of cells in memory.
    pub(super) budget: u64,
}

/// Counts of one thread.
struct QaWorker<'a> {
    reading: &'a QaReading<'a>,
    cells: &'a AggregatedRecords<CellTally>,
    files: &'a Mutex<Vec<FileTally>>,
    lines: LineTallies,
    held: Vec<CellTally>,
    places: HashMap<u128, usize>,
    unplaced: u64,
}

impl QaReading<'_> {
    /// Reads all points that pass the filters.
    ///
    /// # Errors
    /// Damage that is not skipped; temporary files that cannot be written; cancelled.
    pub(super) fn run(
        &self,
        resources: &Resources,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<QaSurvey> {
        let rows = self.lattice.map_or(0, |lattice| lattice.size[1]);
        let range = [0, i64::try_from(rows).unwrap_or(i64::MAX)].map(CellTally::row_key);
        let cells = AggregatedRecords::new(self.folder, range, self.budget);
        let files = Mutex::new(vec![FileTally::default(); self.cloud.files().len()]);
        let next = AtomicUsize::new(0);
        progress.begin("read", self.cloud.info().count);
        let done = workers(resources)?.broadcast(|_| {
            let mut worker = QaWorker {
                reading: self,
                cells: &cells,
                files: &files,
                lines: LineTallies::default(),
                held: Vec::with_capacity(HELD),
                places: HashMap::with_capacity(HELD),
                unplaced: 0,
            };
            loop {
                let part = next.fetch_add(1, Ordering::Relaxed);
                if part >= self.cloud.parts() {
                    break;
                }
                cancel.check()?;
                FileAt::report_part(progress, self.cloud, part);
                worker.read(part)?;
                progress.advance(self.cloud.points_of(part));
            }
            worker.flush()?;
            Ok((worker.lines, worker.unplaced))
        });
        progress.end();
        let (mut lines, mut unplaced) = (LineTallies::default(), 0);
        for done in done {
            let (own, count) = done?;
            lines.merge(&own);
            unplaced += count;
        }
        let files = files.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        Ok(QaSurvey { files, lines, cells, unplaced })
    }
}

impl QaWorker<'_> {
    fn read(&mut self, part: usize) -> Result<()> {
        let QaReading { cloud, times, keep_withheld, .. } = self.reading;
        let file = cloud.file_of(part).unwrap_or(0);
        let (mut tally, mut failed) = (FileTally::default(), None);
        let census = cloud.inspect(part, &mut |point| {
            tally.add(point, &times[file]);
            let is_used = *keep_withheld || !point.record.flags.meets(Flags::WITHHELD);
            if is_used && failed.is_none() {
                self.lines.add(point);
                failed = self.add(file as u32, point).err();
            }
        })?;
        failed.map_or(Ok(()), Err)?;
        tally.stats.census = census;
        let mut files = lock(self.files);
        files[file] = std::mem::take(&mut files[file]).and(tally);
        Ok(())
    }

    /// Counts a point in its cell.
    fn add(&mut self, file: u32, point: &InspectedPoint<'_>) -> Result<()> {
        let cell = self.reading.lattice.and_then(|lattice| lattice.cell(point.record));
        let Some(cell) = cell else {
            self.unplaced += 1;
            return Ok(());
        };
        let tally = CellTally::of(cell, file, point);
        // Most points lie in the cell of the point before.
        if let Some(last) = self.held.last_mut().filter(|last| last.key() == tally.key()) {
            last.merge(&tally);
            return Ok(());
        }
        match self.places.entry(tally.key()) {
            std::collections::hash_map::Entry::Occupied(place) => {
                self.held[*place.get()].merge(&tally);
            }
            std::collections::hash_map::Entry::Vacant(place) => {
                place.insert(self.held.len());
                self.held.push(tally);
            }
        }
        if self.held.len() == HELD { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        self.places.clear();
        self.cells.push(&mut self.held)
    }
}
