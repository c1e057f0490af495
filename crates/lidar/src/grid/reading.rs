//! Reading the points of a cloud into the blocks of a grid.

use std::sync::atomic::{AtomicBool, Ordering};

use super::band_input::{BandInput, OutsideCounter};
use super::blocks::CellBlocks;
use super::extent::GridExtent;
use super::queue::ReadQueue;
use crate::point_index::PointStore;
use terrane_base::error::Result;
use terrane_cloud::{AttributeSelection, PointBatch, PointSource, ReturnCounts};
use terrane_engine::{Cancel, FileAt, Progress};
use terrane_gridding::{SelectedPoints, StatisticRecipe, SubjectSelector};

/// A cloud and the blocks it goes into.
pub(super) struct CloudReader<'a> {
    pub(super) source: &'a dyn PointSource,
    /// The attributes that the recipe needs.
    pub(super) selection: &'a AttributeSelection,
    /// The parts of it that are read.
    pub(super) parts: Vec<usize>,
    pub(super) extent: &'a GridExtent,
    pub(super) recipe: &'a StatisticRecipe,
    pub(super) blocks: &'a CellBlocks<'a>,
}

/// Statistics of the points.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReadOutcome {
    pub(super) census: ReturnCounts,
    /// Points outside of all written cells.
    pub(super) outside: u64,
}

impl CloudReader<'_> {
    /// Reads all parts on `threads` threads; `store` takes all points if surfaces need them.
    pub(super) fn run(
        &self,
        store: Option<&PointStore>,
        threads: usize,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<ReadOutcome> {
        progress.begin("points", self.parts.iter().map(|part| self.source.points_of(*part)).sum());
        let queue = ReadQueue::new(self.parts.len(), threads);
        let failed = AtomicBool::new(false);
        let all: Result<Vec<ReadOutcome>> = std::thread::scope(|scope| {
            let (queue, failed) = (&queue, &failed);
            let workers = (0..threads).map(|thread| {
                scope.spawn(move || {
                    let worker = GridReadWorker::new(self, store);
                    let outcome = self.work(worker, queue, thread, failed, progress, cancel);
                    failed.fetch_or(outcome.is_err(), Ordering::Relaxed);
                    outcome
                })
            });
            // All are started before the first is waited for.
            let workers: Vec<_> = workers.collect();
            let joined = workers.into_iter().map(|worker| worker.join());
            joined.map(|end| end.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
        });
        progress.end();
        let mut sum = ReadOutcome::default();
        for outcome in all? {
            sum.census.add(&outcome.census);
            sum.outside += outcome.outside;
        }
        Ok(sum)
    }

    fn work(
        &self,
        mut worker: GridReadWorker<'_>,
        queue: &ReadQueue,
        thread: usize,
        failed: &AtomicBool,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<ReadOutcome> {
        let mut census = ReturnCounts::default();
        while let Some(part) = queue.take(thread).filter(|_| !failed.load(Ordering::Relaxed)) {
            cancel.check()?;
            let part = self.parts[part];
            FileAt::report_part(progress, self.source, part);
            let selection = self.selection;
            census.add(&self.source.read(part, selection, &mut |batch| worker.take(batch))?);
            progress.advance(self.source.points_of(part));
        }
        Ok(ReadOutcome { census, outside: worker.outside() })
    }
}

/// Per-thread state for adding points to blocks.
struct GridReadWorker<'a> {
    store: Option<&'a PointStore>,
    /// For each subject: the selection of its points, if not all, and its consumer.
    lanes: Vec<(Option<SubjectSelector>, BandInput<'a>)>,
    selected: SelectedPoints,
    /// Counts points outside of all cells, if no consumer sees all points.
    apart: Option<OutsideCounter<'a>>,
}

impl<'a> GridReadWorker<'a> {
    fn new(reader: &'a CloudReader<'a>, store: Option<&'a PointStore>) -> Self {
        let CloudReader { source, recipe, extent, blocks, .. } = *reader;
        let (names, frame) = (recipe.attributes(), source.info().frame);
        let lanes = recipe.subjects().iter().enumerate().map(|(number, subject)| {
            let selector =
                (!subject.is_plain()).then(|| SubjectSelector::new(subject, &names, &frame));
            (selector, BandInput::new(recipe, number, extent, blocks))
        });
        let lanes: Vec<_> = lanes.collect();
        let is_apart = !lanes.is_empty() && lanes.iter().all(|(selector, _)| selector.is_some());
        let apart = is_apart.then(|| OutsideCounter::new(extent));
        Self { store, lanes, selected: SelectedPoints::default(), apart }
    }

    /// Adds a batch of points to the blocks they touch.
    fn take(&mut self, batch: PointBatch<'_>) -> Result<()> {
        let PointBatch { positions: points, attributes } = batch;
        let Self { store, lanes, selected, apart } = self;
        store.map_or(Ok(()), |store| store.add(points))?;
        apart.iter_mut().for_each(|outside| outside.take(points));
        lanes.iter_mut().try_for_each(|(selector, lane)| match selector {
            None => lane.take(points, &[]),
            Some(selector) => {
                selector.select(points, attributes, selected);
                lane.take(&selected.points, &selected.reals)
            }
        })
    }

    /// Points in no cell that is written.
    fn outside(&self) -> u64 {
        let unselective = self.lanes.iter().find(|(selector, _)| selector.is_none());
        let apart = self.apart.as_ref().map_or(0, |outside| outside.count);
        unselective.map_or(apart, |(_, lane)| lane.outside)
    }
}
