//! Containers from finished objects, for a run that continues from them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::tasks::{StripTask, TileStrips};
use crate::tin::artifact::{ArtifactFile, TinArtifactFacts};
use crate::tin::container::TileContainer;
use crate::tin::layout::TileId;
use crate::tin::worker::ContainerSource;
use terrane_base::error::Result;
use terrane_engine::plan::{PlannedWork, TaskStates};
use terrane_files::lock;

/// Objects open at once: the sweep is in one strip, or at the seam between two.
const MAX_OPEN: usize = 4;

/// Opens objects as the sweep over the tiles comes to them.
pub(super) struct ArtifactCache<'a, W: PlannedWork> {
    states: &'a TaskStates<'a, W>,
    strips: TileStrips,
    /// The task whose object has the tiles of a row.
    task_of: fn(&TileStrips, u32) -> StripTask,
    /// By the number in their task's name, so that the first one was left behind first.
    open: Mutex<BTreeMap<(u32, StripTask), Arc<ArtifactFile>>>,
}

impl<'a, W: PlannedWork<Task = StripTask, Facts = TinArtifactFacts>> ArtifactCache<'a, W> {
    /// Of the finished objects; `task_of` says whose tiles of a row are taken.
    pub(super) fn new(
        states: &'a TaskStates<'a, W>,
        strips: TileStrips,
        task_of: fn(&TileStrips, u32) -> StripTask,
    ) -> Self {
        Self { states, strips, task_of, open: Mutex::default() }
    }

    fn object(&self, task: StripTask) -> Result<Arc<ArtifactFile>> {
        let (StripTask::Strip(number) | StripTask::Seam(number)) = task;
        let mut open = lock(&self.open);
        if let Some(object) = open.get(&(number, task)) {
            return Ok(Arc::clone(object));
        }
        let (path, done) = self.states.object(task)?;
        let tiles = self.strips.work(task).tiles();
        let object = Arc::new(ArtifactFile::open(path, done.facts.index, tiles)?);
        if open.len() >= MAX_OPEN {
            open.pop_first();
        }
        open.insert((number, task), Arc::clone(&object));
        Ok(object)
    }
}

impl<W: PlannedWork<Task = StripTask, Facts = TinArtifactFacts>> ContainerSource
    for ArtifactCache<'_, W>
{
    fn load(&self, tile: TileId) -> Result<TileContainer> {
        let task = (self.task_of)(&self.strips, tile.row);
        self.object(task)?.read(self.strips.position(task, tile))
    }
}
